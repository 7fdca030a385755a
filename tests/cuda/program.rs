//! Checks of the program: the body and its RVEs on a device, several ranks on one device, and a device without memory.

use std::ffi::OsStr;
use std::path::Path;
use std::process::{Command, Output};

use biotissue::backends::cuda::Device;

use crate::Check;
use crate::body::{self, Results};
use crate::emulation::is_emulated;

pub const CHECKS: &[Check] = &[
    ("program_body_and_rves", body_and_rves),
    ("program_ranks", ranks),
    ("program_memory", memory),
    ("program_errors", errors),
];

/// The program, if it was built with these checks.
fn program(folder: &Path) -> Option<Command> {
    let path = Path::new(env!("CARGO_BIN_EXE_biotissue"));
    if !path.exists() {
        println!("       skipped: the program is not there");
        return None;
    }
    let mut command = Command::new(path);
    command.current_dir(folder);
    Some(command)
}

/// As [`program`], started as four processes.
fn processes(folder: &Path) -> Option<Command> {
    let single = program(folder)?;
    let mut command = Command::new(std::env::var_os("MPIRUN").unwrap_or_else(|| "mpirun".into()));
    command.args(["--oversubscribe", "-n", "4"]).arg(single.get_program()).current_dir(folder);
    command.envs([("OMPI_ALLOW_RUN_AS_ROOT", "1"), ("OMPI_ALLOW_RUN_AS_ROOT_CONFIRM", "1")]);
    Some(command)
}

fn stderr(output: &Output) -> String {
    String::from_utf8_lossy(&output.stderr).into_owned()
}

/// Runs a case; returns its results and its messages.
fn run(mut command: Command, folder: &Path, case: &str, options: &[&str]) -> (Results, String) {
    let out = format!("{case}.out");
    let _ = std::fs::remove_dir_all(folder.join(&out));
    let output = command.args(["run", case, "--out", &out]).args(options).output().unwrap();
    assert!(output.status.success(), "{case} {options:?}: {}", stderr(&output));
    (Results::read(&folder.join(&out)), stderr(&output))
}

/// A folder with the case for a device, alone and on ranks, and the results without one.
struct Cases {
    folder: tempfile::TempDir,
    expected: Results,
}

/// The case on one rank of the body and three of the RVEs, and on two of each.
const ON_RANKS: [&str; 2] = ["on_1_3.toml", "on_2_2.toml"];

impl Cases {
    /// `None` if the program is not there.
    fn new() -> Option<Self> {
        let folder = tempfile::tempdir().unwrap();
        body::write(folder.path(), "alone.toml", "cuda", "");
        for (name, (of_body, of_rves)) in ON_RANKS.into_iter().zip([(1, 3), (2, 2)]) {
            let scales = format!("[scales]\nmacro = {of_body}\nmicro = {of_rves}");
            body::write(folder.path(), name, "cuda", &scales);
        }
        body::write(folder.path(), "none.toml", "none", "");
        let (expected, _) = run(program(folder.path())?, folder.path(), "none.toml", &[]);
        Some(Self { folder, expected })
    }

    fn path(&self) -> &Path {
        self.folder.path()
    }

    fn program(&self) -> Command {
        program(self.path()).expect("it was there")
    }

    /// Runs a case and compares it; returns the share of solutions made on the device, and the messages.
    fn check(&self, command: Command, case: &str, options: &[&str]) -> (f64, String) {
        let of_device = |(name, value): (&OsStr, Option<&OsStr>)| {
            let name = name.to_string_lossy().into_owned();
            name.starts_with("EMULATED").then(|| format!("{name}={} ", value.unwrap_or_default().display()))
        };
        let variables: String = command.get_envs().filter_map(of_device).collect();
        let program = Path::new(command.get_program()).file_name().unwrap_or_default().display().to_string();
        let what = format!("{variables}{program} {case} {}", options.join(" "));
        let (found, messages) = run(command, self.path(), case, options);
        found.assert_same(&self.expected, &what);
        println!("       {what}: {:.0} % on the device", 100.0 * found.share_of_device());
        (found.share_of_device(), messages)
    }
}

/// The body on the device, its RVEs on the processor or on the same device.
fn body_and_rves(_: &Device) {
    let Some(cases) = Cases::new() else { return };
    assert_eq!(cases.check(cases.program(), "none.toml", &["--backend", "cuda"]).0, 0.0);
    assert!(cases.check(cases.program(), "alone.toml", &["--backend", "cuda"]).0 > 0.9);
}

/// Ranks that are threads, and ranks that are processes, share a device.
fn ranks(_: &Device) {
    let Some(cases) = Cases::new() else { return };
    for case in ON_RANKS {
        assert!(cases.check(cases.program(), case, &[]).0 > 0.9);
        if cfg!(feature = "mpi") {
            let share = cases.check(processes(cases.path()).expect("it was there"), case, &[]).0;
            assert!(share > 0.9, "{share}");
        }
    }
}

/// However little memory a device has, the results are the same: RVEs for which there is no room are solved by the processor.
fn memory(_: &Device) {
    if !is_emulated() {
        println!("       skipped: the memory of a device cannot be set");
        return;
    }
    let Some(cases) = Cases::new() else { return };
    let with = |mut command: Command, bytes: &str| {
        command.env("EMULATED_CUDA_MEMORY", bytes);
        command
    };
    // Room for all, for some networks, for no RVE, for not even the networks.
    for (bytes, shares) in
        [("100000000", 0.9..=1.0), ("7000000", 0.2..=0.9), ("1000000", 0.0..=0.0), ("40000", 0.0..=0.0)]
    {
        let (share, messages) = cases.check(with(cases.program(), bytes), "alone.toml", &[]);
        assert!(shares.contains(&share), "{bytes}: {share}");
        assert_eq!(messages.contains(", 0 % on the device or in lanes"), share == 0.0, "{messages}");
        cases.check(with(cases.program(), bytes), ON_RANKS[0], &[]);
        if cfg!(feature = "mpi") {
            let mut command = with(processes(cases.path()).expect("it was there"), bytes);
            command.env("EMULATED_CUDA_SHARED", cases.path().join(format!("of_device_{bytes}")));
            cases.check(command, ON_RANKS[1], &[]);
        }
    }
    let mut command = cases.program();
    command.env("EMULATED_CUDA_OF_KERNEL", "10000000000");
    assert_eq!(cases.check(command, "alone.toml", &[]).0, 0.0, "no kernel can be started");
    let mut command = cases.program();
    command.env("EMULATED_CUDA_DEVICES", "2");
    assert!(cases.check(command, ON_RANKS[0], &[]).0 > 0.9, "two devices");
}

/// What the body needs of a device and does not get is reported as such.
fn errors(_: &Device) {
    if !is_emulated() {
        return;
    }
    let Some(cases) = Cases::new() else { return };
    let fails = |code: i32, options: &[&str], variable: (&str, &str)| {
        let mut command = cases.program();
        command.args(["run", "none.toml", "--out", "failed"]).args(options).env(variable.0, variable.1);
        let output = command.output().unwrap();
        assert_eq!(output.status.code(), Some(code), "{}", stderr(&output));
        stderr(&output)
    };
    let message = fails(2, &["--backend", "cuda"], ("EMULATED_CUDA_HEADERS", "nowhere"));
    assert!(message.contains("error: --backend cuda: NVRTC cannot compile a kernel"), "{message}");
    let message = fails(2, &["--backend", "cuda"], ("EMULATED_CUDA_DEVICES", "0"));
    assert!(message.contains("error: --backend cuda: there is no CUDA device number 0"), "{message}");
    let iterative = body::write(cases.path(), "none.toml", "none", "");
    let text = std::fs::read_to_string(&iterative).unwrap();
    let solver = "[newton]\nsolver = { method = \"cg\", preconditioner = \"multigrid\" }";
    std::fs::write(&iterative, text.replace("[newton]", solver)).unwrap();
    let message = fails(3, &["--backend", "cuda"], ("EMULATED_CUDA_MEMORY", "60000"));
    assert!(message.contains("error: load step 1 of 2 fails: the CUDA driver failed"), "{message}");
    assert!(message.contains("another --backend") && !message.contains("det F"), "{message}");
}
