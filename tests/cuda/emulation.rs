//! Runs this program again with an emulated device: libraries of the driver, of NVRTC and of cuSPARSE, in `emulator`, whose
//! kernels the processor executes.

use std::path::Path;
use std::process::{Command, ExitCode, Output, Stdio};

/// The sources of the libraries, and the header of the kernels.
const SOURCES: [(&str, &str); 4] = [
    ("device.cpp", include_str!("emulator/device.cpp")),
    ("compiler.cpp", include_str!("emulator/compiler.cpp")),
    ("cusparse.cpp", include_str!("emulator/cusparse.cpp")),
    ("threads.h", include_str!("emulator/threads.h")),
];

/// The variable that names the folder of the header to the emulated compiler.
const HEADERS: &str = "EMULATED_CUDA_HEADERS";

/// Returns true if the device of this program is emulated.
pub fn is_emulated() -> bool {
    std::env::var_os(HEADERS).is_some()
}

/// Returns `count` on a device, a tenth of it where kernels are executed by the processor.
pub fn trials(count: usize) -> usize {
    if is_emulated() { count.div_ceil(10) } else { count }
}

/// Compiles the libraries; returns false if there is no C++ compiler.
fn build(folder: &Path) -> bool {
    for (name, text) in SOURCES {
        std::fs::write(folder.join(name), text).unwrap();
    }
    // The variable may have options of the compiler.
    let compile = "${CXX:-c++} -std=c++20 -O1 -Wall -Wextra -shared -fPIC -o libcuda.so *.cpp -ldl";
    let output = Command::new("sh").args(["-c", compile]).current_dir(folder).output().unwrap();
    /// Exit code of the shell if there is no such command.
    const NOT_FOUND: i32 = 127;
    if output.status.code() == Some(NOT_FOUND) {
        return false;
    }
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    for library in ["libnvrtc.so", "libcusparse.so"] {
        std::os::unix::fs::symlink("libcuda.so", folder.join(library)).unwrap();
    }
    true
}

/// Runs the checks on an emulated device, those of each of the `groups` in a process of its own; if `words` are given, those
/// whose names contain one of them in one process.
pub fn run(words: &[String], groups: &[&str]) -> ExitCode {
    let folder = tempfile::tempdir().unwrap();
    if !build(folder.path()) {
        println!("skipped: there is no C++ compiler to emulate a device");
        let is_required = std::env::var("BIOTISSUE_REQUIRE_CXX").is_ok_and(|required| required != "0");
        return if is_required { ExitCode::FAILURE } else { ExitCode::SUCCESS };
    }
    let before = std::env::var("LD_LIBRARY_PATH").map_or_else(|_| String::new(), |path| format!(":{path}"));
    let libraries = format!("{}{before}", folder.path().display());
    let run = |words: &[String]| -> Output {
        let mut command = Command::new(std::env::current_exe().unwrap());
        command.args(words).env("LD_LIBRARY_PATH", &libraries).env(HEADERS, folder.path());
        command.stderr(Stdio::inherit()).output().unwrap()
    };
    let of_processes: Vec<Vec<String>> = match words {
        [] => groups.iter().map(|group| vec![(*group).to_owned()]).collect(),
        words => vec![words.to_vec()],
    };
    let outputs: Vec<Output> = std::thread::scope(|scope| {
        let threads: Vec<_> = of_processes.iter().map(|words| scope.spawn(|| run(words))).collect();
        threads.into_iter().map(|thread| thread.join().unwrap()).collect()
    });
    for output in &outputs {
        print!("{}", String::from_utf8_lossy(&output.stdout));
        if !output.status.success() {
            println!("{}", output.status);
        }
    }
    if outputs.iter().all(|output| output.status.success()) { ExitCode::SUCCESS } else { ExitCode::FAILURE }
}
