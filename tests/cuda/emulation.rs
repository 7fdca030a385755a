//! Runs this program again with an emulated device: libraries of the driver and of NVRTC, in `emulator`, whose kernels the
//! processor executes. Speed aside, all but cuSPARSE happens as on a device.

use std::path::Path;
use std::process::{Command, ExitCode, Stdio};

/// The sources of the libraries, and the header of the kernels.
const SOURCES: [(&str, &str); 3] = [
    ("device.cpp", include_str!("emulator/device.cpp")),
    ("compiler.cpp", include_str!("emulator/compiler.cpp")),
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

/// Compiles the libraries; returns the reason if this machine cannot.
fn build(folder: &Path) -> Result<(), String> {
    for (name, text) in SOURCES {
        std::fs::write(folder.join(name), text).map_err(|error| error.to_string())?;
    }
    let compiler = std::env::var("CXX").unwrap_or_else(|_| "c++".into());
    let options = ["-std=c++20", "-O1", "-Wall", "-Wextra", "-Werror", "-shared", "-fPIC", "-o", "libcuda.so"];
    let command =
        Command::new(&compiler).args(options).args(["device.cpp", "compiler.cpp", "-ldl"]).current_dir(folder).output();
    let output = command.map_err(|_| format!("there is no C++ compiler `{compiler}` to emulate one"))?;
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    std::os::unix::fs::symlink("libcuda.so", folder.join("libnvrtc.so")).map_err(|error| error.to_string())
}

/// Runs the checks on an emulated device, those of each of the `groups` in a process of its own; if `words` are given, those
/// whose names contain one of them in one process.
pub fn run(words: &[String], groups: &[&str]) -> ExitCode {
    let folder = tempfile::tempdir().unwrap();
    if let Err(reason) = build(folder.path()) {
        println!("skipped: {reason}");
        return ExitCode::SUCCESS;
    }
    let before = std::env::var("LD_LIBRARY_PATH").map_or_else(|_| String::new(), |path| format!(":{path}"));
    let libraries = format!("{}{before}", folder.path().display());
    let start = |words: &[String]| {
        let mut command = Command::new(std::env::current_exe().unwrap());
        command.args(words).env("LD_LIBRARY_PATH", &libraries).env(HEADERS, folder.path());
        command.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap()
    };
    let processes: Vec<_> = if words.is_empty() {
        groups.iter().map(|group| start(&[(*group).to_owned()])).collect()
    } else {
        vec![start(words)]
    };
    let mut all_passed = true;
    for process in processes {
        let output = process.wait_with_output().unwrap();
        all_passed &= output.status.success();
        print!("{}{}", String::from_utf8_lossy(&output.stdout), String::from_utf8_lossy(&output.stderr));
        if !output.status.success() {
            println!("{}", output.status);
        }
    }
    if all_passed { ExitCode::SUCCESS } else { ExitCode::FAILURE }
}
