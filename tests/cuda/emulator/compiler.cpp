// The run-time compiler: NVRTC's interface to the C++ compiler of the machine. What it calls machine code is the path of a
// shared library, in which each kernel NAME has a function `emulated_NAME` that makes its launches.

#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <fstream>
#include <functional>
#include <mutex>
#include <regex>
#include <sstream>
#include <string>
#include <unistd.h>

namespace {

enum Status { SUCCESS = 0, COMPILATION = 6 };

struct Program {
    std::string source, log, code;
};

std::string text_of(const std::string &path) {
    std::ostringstream text;
    text << std::ifstream(path).rdbuf();
    return text.str();
}

// Runs the compiler; returns whether it succeeded.
bool compile(const std::string &arguments, const std::string &log) {
    const char *compiler = std::getenv("CXX");
    const std::string command = std::string(compiler ? compiler : "c++") + " " + arguments + " 2>'" + log + "'";
    return std::system(command.c_str()) == 0;
}

// Makes C++ of the kernels, after the preprocessor.
std::string translated(std::string text) {
    const std::regex root("asm\\s*\\(\\s*\"rsqrt[^\"]*\"\\s*:\\s*\"=d\"\\((\\w+)\\)\\s*:\\s*\"d\"\\((\\w+)\\)\\s*\\)");
    text = std::regex_replace(text, root, "$1 = 1.0f / std::sqrt((float)$2)");
    const std::regex kernel("__global__\\s+void\\s+(?:__launch_bounds__\\s*\\(\\s*\\w+\\s*\\)\\s*)?(\\w+)\\s*\\(");
    std::string launches;
    for (std::sregex_iterator found(text.begin(), text.end(), kernel), end; found != end; ++found) {
        const std::string name = (*found)[1];
        launches += "extern \"C\" std::function<void()> *emulated_" + name +
                    "(const unsigned *grid, const unsigned *threads, void **arguments) {\n"
                    "    emulator::Launch launch{{grid[0], grid[1], grid[2]}, {threads[0], threads[1], threads[2]}, "
                    "emulator::bound(" + name + ", arguments)};\n"
                    "    return new std::function<void()>([launch]() mutable { launch.run(); });\n}\n";
    }
    return "#include \"threads.h\"\n" + text + launches;
}

// Compiles a program, unless another process has compiled the same source: libraries stay beside the header.
int compile(Program &program) {
    static std::mutex one_at_a_time;
    const std::lock_guard lock(one_at_a_time);
    const char *headers = std::getenv("EMULATED_CUDA_HEADERS");
    if (!headers) {
        program.log = "EMULATED_CUDA_HEADERS must name the folder of threads.h";
        return COMPILATION;
    }
    const std::string beside = std::string(headers) + "/kernels-" + std::to_string(std::hash<std::string>()(program.source));
    program.code = beside + ".so";
    if (access(program.code.c_str(), R_OK) == 0) return SUCCESS;
    const std::string at = beside + "-" + std::to_string(getpid()), log = at + ".log";
    std::ofstream(at + ".cu") << program.source;
    bool is_done = compile("-std=c++17 -x c++ -E -o '" + at + ".ii' '" + at + ".cu'", log);
    if (is_done) {
        std::ofstream(at + ".cpp") << translated(text_of(at + ".ii"));
        is_done = compile("-std=c++17 -O2 -march=native -ffp-contract=off -U_FORTIFY_SOURCE -shared -fPIC -Wno-unknown-pragmas -Wl,-Bsymbolic -I'" +
                              std::string(headers) + "' -o '" + at + ".so' '" + at + ".cpp'", log) &&
                  std::rename((at + ".so").c_str(), program.code.c_str()) == 0;
    }
    program.log = text_of(log);
    for (const char *ending : {".cu", ".ii", ".cpp", ".log"}) unlink((at + ending).c_str());
    return is_done ? SUCCESS : COMPILATION;
}

} // namespace

extern "C" {

const char *nvrtcGetErrorString(int status) { return status == SUCCESS ? "NVRTC_SUCCESS" : "NVRTC_ERROR_COMPILATION"; }

int nvrtcVersion(int *major, int *minor) {
    *major = 13, *minor = 0;
    return SUCCESS;
}

int nvrtcCreateProgram(void **program, const char *source, const char *, int, const char *const *, const char *const *) {
    *program = new Program{source, "", ""};
    return SUCCESS;
}

int nvrtcDestroyProgram(void **program) {
    delete static_cast<Program *>(*program);
    *program = nullptr;
    return SUCCESS;
}

int nvrtcCompileProgram(void *program, int, const char *const *) { return compile(*static_cast<Program *>(program)); }

int nvrtcGetProgramLogSize(void *program, size_t *size) {
    *size = static_cast<Program *>(program)->log.size() + 1;
    return SUCCESS;
}

int nvrtcGetProgramLog(void *program, char *log) {
    std::strcpy(log, static_cast<Program *>(program)->log.c_str());
    return SUCCESS;
}

int nvrtcGetCUBINSize(void *program, size_t *size) {
    *size = static_cast<Program *>(program)->code.size() + 1;
    return SUCCESS;
}

int nvrtcGetCUBIN(void *program, char *code) {
    std::strcpy(code, static_cast<Program *>(program)->code.c_str());
    return SUCCESS;
}

int nvrtcGetPTXSize(void *program, size_t *size) { return nvrtcGetCUBINSize(program, size); }
int nvrtcGetPTX(void *program, char *code) { return nvrtcGetCUBIN(program, code); }

} // extern "C"
