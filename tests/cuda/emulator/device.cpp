// The driver of devices that are not there: memory with limits, streams and launches, executed by the processor.
//
// It is stricter than a device where a device lets mistakes pass. Work of a stream is done as late as possible, when somebody
// waits for it or the stream is destroyed. New memory is filled with NaN; a protected page follows it, after at most 15 unused
// bytes. The program aborts if a transfer exceeds its memory or uses memory that was freed or belongs to another device, and if
// memory is freed twice. The driver cannot detect a missing wait between two streams, or memory of another device in the arguments
// of a kernel.
//
//     EMULATED_CUDA_DEVICES    number of devices (1)
//     EMULATED_CUDA_MEMORY     bytes of a device (4 GiB)
//     EMULATED_CUDA_OF_KERNEL  bytes that must be free when a kernel is launched (0)
//     EMULATED_CUDA_SHARED     a file, by which several processes share the memory of the devices

#include <atomic>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <dlfcn.h>
#include <fcntl.h>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <string>
#include <sys/mman.h>
#include <unistd.h>
#include <vector>

namespace {

enum Status {
    SUCCESS = 0,
    INVALID_VALUE = 1,
    OUT_OF_MEMORY = 2,
    INVALID_CONTEXT = 201,
    INVALID_IMAGE = 200,
    INVALID_DEVICE = 101,
    INVALID_HANDLE = 400,
    NOT_FOUND = 500,
};

constexpr int MOST_DEVICES = 8;
constexpr size_t PAGE = 4096;

size_t setting(const char *name, size_t otherwise) {
    const char *text = std::getenv(name);
    return text ? std::strtoull(text, nullptr, 10) : otherwise;
}

[[noreturn]] void refuse(const char *what) {
    std::fprintf(stderr, "emulated device: %s\n", what);
    std::abort();
}

int device_count() { return static_cast<int>(setting("EMULATED_CUDA_DEVICES", 1)); }

// Bytes in use of each device, by all processes that share the file.
std::atomic<int64_t> *used() {
    static std::atomic<int64_t> *const counters = [] {
        static std::atomic<int64_t> own[MOST_DEVICES];
        const char *path = std::getenv("EMULATED_CUDA_SHARED");
        if (!path) return own;
        const int file = open(path, O_RDWR | O_CREAT, 0600);
        if (file < 0 || ftruncate(file, PAGE) != 0) refuse("EMULATED_CUDA_SHARED names no file that can be written");
        void *map = mmap(nullptr, PAGE, PROT_READ | PROT_WRITE, MAP_SHARED, file, 0);
        close(file);
        return static_cast<std::atomic<int64_t> *>(map);
    }();
    return counters;
}

// A context is the number of its device, from 1.
thread_local void *current = nullptr;

int current_device() { return static_cast<int>(reinterpret_cast<intptr_t>(current)) - 1; }

struct Allocation {
    void *pages;
    size_t bytes;
    int device;
    bool is_freed;
};

// All memory of all devices by its address, and page-locked memory of the host.
std::mutex of_memory;
std::map<uint64_t, Allocation> allocations;
std::map<uint64_t, size_t> page_locked;
// What this process has of each device.
int64_t own_bytes[MOST_DEVICES];

struct Leave {
    ~Leave() {
        for (int k = 0; k < MOST_DEVICES; k++) used()[k] -= own_bytes[k];
    }
} leave;

size_t memory_of_device() { return setting("EMULATED_CUDA_MEMORY", size_t(4) << 30); }

size_t in_pages(size_t bytes) { return (bytes + PAGE - 1) / PAGE * PAGE; }

int allocate(int device, size_t bytes, uint64_t *address) {
    if (bytes == 0) return INVALID_VALUE;
    const std::lock_guard lock(of_memory);
    const int64_t rounded = in_pages(bytes), all = memory_of_device();
    int64_t before = used()[device];
    do {
        if (before + rounded > all) return OUT_OF_MEMORY;
    } while (!used()[device].compare_exchange_weak(before, before + rounded));
    void *pages = mmap(nullptr, rounded + PAGE, PROT_READ | PROT_WRITE, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0);
    if (pages == MAP_FAILED) refuse("the host has no memory left");
    mprotect(static_cast<char *>(pages) + rounded, PAGE, PROT_NONE);
    // All numbers are NaN.
    std::memset(pages, 0xff, rounded);
    own_bytes[device] += rounded;
    *address = reinterpret_cast<uint64_t>(pages) + (rounded - bytes) / 16 * 16;
    allocations[*address] = {pages, static_cast<size_t>(rounded), device, false};
    return SUCCESS;
}

// Marks memory, so that it cannot be freed twice before the stream comes to it.
void begin_free(uint64_t address) {
    const std::lock_guard lock(of_memory);
    const auto found = allocations.find(address);
    if (found == allocations.end() || found->second.is_freed) refuse("memory is freed that is not allocated");
    found->second.is_freed = true;
}

void end_free(uint64_t address) {
    const std::lock_guard lock(of_memory);
    const Allocation freed = allocations.at(address);
    allocations.erase(address);
    munmap(freed.pages, freed.bytes + PAGE);
    used()[freed.device] -= freed.bytes;
    own_bytes[freed.device] -= freed.bytes;
}

// Ends the program unless the bytes belong to one allocation of the current device.
void check_device_memory(uint64_t address, size_t bytes) {
    const std::lock_guard lock(of_memory);
    auto found = allocations.upper_bound(address);
    if (found == allocations.begin()) refuse("a transfer with memory that is not of a device");
    --found;
    const uint64_t end = reinterpret_cast<uint64_t>(found->second.pages) + found->second.bytes;
    if (address + bytes > end) refuse("a transfer beyond the end of memory");
    if (found->second.is_freed) refuse("a transfer with memory that was freed");
    if (found->second.device != current_device()) refuse("a transfer with memory of another device");
}

bool is_page_locked(const void *address, size_t bytes) {
    const std::lock_guard lock(of_memory);
    const uint64_t at = reinterpret_cast<uint64_t>(address);
    auto found = page_locked.upper_bound(at);
    return found != page_locked.begin() && at + bytes <= (--found)->first + found->second;
}

// Work in its order.
struct Stream {
    int device;
    std::mutex mutex;
    std::vector<std::function<void()>> work;

    void add(std::function<void()> item) {
        const std::lock_guard lock(mutex);
        work.push_back(std::move(item));
    }
    void finish() {
        const std::lock_guard lock(mutex);
        for (auto &item : work) item();
        work.clear();
    }
};

std::mutex of_streams;
std::vector<Stream *> streams;

void finish_all(int device) {
    const std::lock_guard lock(of_streams);
    for (Stream *stream : streams)
        if (stream->device == device) stream->finish();
}

using Launcher = std::function<void()> *(const unsigned *, const unsigned *, void **);

struct Function {
    Launcher *launcher;
    int device;
};

// Kernels of a device.
struct Module {
    void *library;
    int device;
    std::map<std::string, Function> functions;
};

} // namespace

#define NEEDS_CONTEXT                                                                                                  \
    if (!current) return INVALID_CONTEXT
#define NEEDS_STREAM(stream)                                                                                           \
    NEEDS_CONTEXT;                                                                                                     \
    if (static_cast<Stream *>(stream)->device != current_device()) return INVALID_HANDLE

extern "C" {

int cuInit(unsigned) { return SUCCESS; }

int cuGetErrorName(int status, const char **name) {
    *name = status == OUT_OF_MEMORY ? "CUDA_ERROR_OUT_OF_MEMORY" : "CUDA_ERROR_OF_THE_EMULATION";
    return SUCCESS;
}

int cuGetErrorString(int status, const char **text) {
    *text = status == OUT_OF_MEMORY ? "out of memory" : "error of the emulation";
    return SUCCESS;
}

int cuDeviceGetCount(int *count) {
    *count = device_count();
    return SUCCESS;
}

int cuDeviceGet(int *device, int ordinal) {
    *device = ordinal;
    return ordinal < device_count() && ordinal < MOST_DEVICES ? SUCCESS : INVALID_DEVICE;
}

int cuDeviceGetName(char *name, int length, int) {
    std::snprintf(name, length, "emulated device");
    return SUCCESS;
}

int cuDeviceGetUuid_v2(unsigned char *uuid, int device) {
    std::memset(uuid, 0xe0 + device, 16);
    return SUCCESS;
}

int cuDeviceGetAttribute(int *value, int attribute, int) {
    switch (attribute) {
    case 16: *value = 4; return SUCCESS;  // multiprocessors
    case 75: *value = 9; return SUCCESS;  // compute capability
    case 76: *value = 0; return SUCCESS;
    case 115: *value = 1; return SUCCESS; // memory pools
    default: return INVALID_VALUE;
    }
}

int cuDevicePrimaryCtxRetain(void **context, int device) {
    *context = reinterpret_cast<void *>(static_cast<intptr_t>(device + 1));
    return SUCCESS;
}

int cuDevicePrimaryCtxRelease_v2(int) { return SUCCESS; }

int cuCtxSetCurrent(void *context) {
    current = context;
    return SUCCESS;
}

int cuCtxGetCurrent(void **context) {
    *context = current;
    return SUCCESS;
}

int cuCtxSynchronize() {
    NEEDS_CONTEXT;
    finish_all(current_device());
    return SUCCESS;
}

int cuStreamCreate(void **stream, unsigned) {
    NEEDS_CONTEXT;
    Stream *created = new Stream{current_device(), {}, {}};
    const std::lock_guard lock(of_streams);
    streams.push_back(created);
    *stream = created;
    return SUCCESS;
}

int cuStreamDestroy_v2(void *stream) {
    Stream *of = static_cast<Stream *>(stream);
    of->finish();
    const std::lock_guard lock(of_streams);
    std::erase(streams, of);
    delete of;
    return SUCCESS;
}

int cuStreamSynchronize(void *stream) {
    NEEDS_STREAM(stream);
    static_cast<Stream *>(stream)->finish();
    return SUCCESS;
}

// Events have no effect: this crate does not use those that cudarc makes.
int cuEventCreate(void **event, unsigned) {
    *event = new char;
    return SUCCESS;
}

int cuEventDestroy_v2(void *event) {
    delete static_cast<char *>(event);
    return SUCCESS;
}

int cuEventSynchronize(void *) { return SUCCESS; }
int cuEventQuery(void *) { return SUCCESS; }

int cuMemGetInfo_v2(size_t *free, size_t *total) {
    NEEDS_CONTEXT;
    *total = memory_of_device();
    const size_t taken = used()[current_device()];
    *free = taken < *total ? *total - taken : 0;
    return SUCCESS;
}

int cuMemAllocAsync(uint64_t *address, size_t bytes, void *stream) {
    NEEDS_STREAM(stream);
    const int device = current_device();
    int status = allocate(device, bytes, address);
    if (status == OUT_OF_MEMORY) {
        // Memory that is freed by now can be taken again.
        finish_all(device);
        status = allocate(device, bytes, address);
    }
    return status;
}

int cuMemFreeAsync(uint64_t address, void *stream) {
    NEEDS_STREAM(stream);
    begin_free(address);
    static_cast<Stream *>(stream)->add([address] { end_free(address); });
    return SUCCESS;
}

int cuMemHostAlloc(void **address, size_t bytes, unsigned) {
    NEEDS_CONTEXT;
    if (bytes == 0) return INVALID_VALUE;
    *address = std::malloc(bytes);
    std::memset(*address, 0xff, bytes);
    const std::lock_guard lock(of_memory);
    page_locked[reinterpret_cast<uint64_t>(*address)] = bytes;
    return SUCCESS;
}

int cuMemFreeHost(void *address) {
    NEEDS_CONTEXT;
    const std::lock_guard lock(of_memory);
    if (page_locked.erase(reinterpret_cast<uint64_t>(address)) == 0) refuse("page-locked memory is freed twice");
    std::free(address);
    return SUCCESS;
}

int cuMemsetD8Async(uint64_t address, unsigned char value, size_t bytes, void *stream) {
    NEEDS_STREAM(stream);
    check_device_memory(address, bytes);
    static_cast<Stream *>(stream)->add([=] { std::memset(reinterpret_cast<void *>(address), value, bytes); });
    return SUCCESS;
}

int cuMemcpyHtoDAsync_v2(uint64_t to, const void *from, size_t bytes, void *stream) {
    NEEDS_STREAM(stream);
    check_device_memory(to, bytes);
    if (is_page_locked(from, bytes)) {
        static_cast<Stream *>(stream)->add([=] {
            if (!is_page_locked(from, bytes)) refuse("a transfer from page-locked memory that was freed");
            std::memcpy(reinterpret_cast<void *>(to), from, bytes);
        });
    } else {
        auto copy = std::make_shared<std::vector<char>>(bytes);
        std::memcpy(copy->data(), from, bytes);
        static_cast<Stream *>(stream)->add([=] { std::memcpy(reinterpret_cast<void *>(to), copy->data(), bytes); });
    }
    return SUCCESS;
}

int cuMemcpyDtoHAsync_v2(void *to, uint64_t from, size_t bytes, void *stream) {
    NEEDS_STREAM(stream);
    check_device_memory(from, bytes);
    const bool is_locked = is_page_locked(to, bytes);
    static_cast<Stream *>(stream)->add([=] {
        if (is_locked && !is_page_locked(to, bytes)) refuse("a transfer to page-locked memory that was freed");
        std::memcpy(to, reinterpret_cast<void *>(from), bytes);
    });
    if (!is_locked) static_cast<Stream *>(stream)->finish();
    return SUCCESS;
}

int cuMemcpyDtoDAsync_v2(uint64_t to, uint64_t from, size_t bytes, void *stream) {
    NEEDS_STREAM(stream);
    check_device_memory(to, bytes);
    check_device_memory(from, bytes);
    static_cast<Stream *>(stream)->add(
        [=] { std::memmove(reinterpret_cast<void *>(to), reinterpret_cast<void *>(from), bytes); });
    return SUCCESS;
}

int cuModuleLoadData(void **module, const void *image) {
    NEEDS_CONTEXT;
    void *library = dlopen(static_cast<const char *>(image), RTLD_NOW | RTLD_LOCAL);
    if (!library) {
        std::fprintf(stderr, "emulated device: %s\n", dlerror());
        return INVALID_IMAGE;
    }
    *module = new Module{library, current_device(), {}};
    return SUCCESS;
}

// The library stays: streams may have work of it.
int cuModuleUnload(void *) { return SUCCESS; }

int cuModuleGetFunction(void **function, void *module, const char *name) {
    Module *of = static_cast<Module *>(module);
    void *launcher = dlsym(of->library, (std::string("emulated_") + name).c_str());
    if (!launcher) return NOT_FOUND;
    *function = &(of->functions[name] = {reinterpret_cast<Launcher *>(launcher), of->device});
    return SUCCESS;
}

int cuOccupancyMaxActiveBlocksPerMultiprocessorWithFlags(int *blocks, void *, int, size_t, unsigned) {
    *blocks = 2;
    return SUCCESS;
}

int cuLaunchKernel(void *function, unsigned grid_x, unsigned grid_y, unsigned grid_z, unsigned x, unsigned y, unsigned z,
                   unsigned shared_bytes, void *stream, void **arguments, void **) {
    NEEDS_STREAM(stream);
    const Function &kernel = *static_cast<Function *>(function);
    if (kernel.device != current_device()) return INVALID_HANDLE;
    if (grid_x == 0 || x == 0 || x > 1024) return INVALID_VALUE;
    if (grid_y != 1 || grid_z != 1 || y != 1 || z != 1 || shared_bytes != 0) refuse("a launch in several dimensions");
    size_t free, total;
    cuMemGetInfo_v2(&free, &total);
    if (free < setting("EMULATED_CUDA_OF_KERNEL", 0)) return OUT_OF_MEMORY;
    const unsigned grid[] = {grid_x, 1, 1}, threads[] = {x, 1, 1};
    const std::shared_ptr<std::function<void()>> launch(kernel.launcher(grid, threads, arguments));
    static_cast<Stream *>(stream)->add([launch] { (*launch)(); });
    return SUCCESS;
}

// For the other emulated libraries.
void emulated_enqueue(void *stream, const std::function<void()> &work) { static_cast<Stream *>(stream)->add(work); }

} // extern "C"
