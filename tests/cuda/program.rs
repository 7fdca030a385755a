//! Checks of the program: the body and its RVEs on a device, several ranks on one device, and a device without memory.

use std::ffi::OsStr;
use std::path::Path;
use std::process::{Command, Output};

use biotissue::backends::cuda::Device;

use crate::Check;
use crate::body::{self, Results};
use crate::emulation::is_emulated;
use crate::launcher::Launcher;

pub const CHECKS: &[Check] = &[
    ("program_body_and_rves", body_and_rves),
    ("program_ranks", ranks),
    ("program_memory", memory),
    ("program_parts", parts),
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
        // RVEs that stay where they are make the share of the device repeatable; others move between the ranks.
        for (name, scales) in
            ON_RANKS.into_iter().zip(["macro = 1\nmicro = 3\nbalance = { planner = \"none\" }", "macro = 2\nmicro = 2"])
        {
            body::write(folder.path(), name, "cuda", &format!("[scales]\n{scales}"));
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

    /// The program as four processes; `None` without the feature `mpi`.
    fn processes(&self) -> Option<Command> {
        /// A run takes a few seconds.
        const SECONDS: u32 = 300;
        let launcher = cfg!(feature = "mpi").then(|| Launcher::find().unwrap())?;
        let mut command = launcher.command(Path::new(self.program().get_program()), 4, SECONDS);
        command.current_dir(self.path());
        Some(command)
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
        if let Some(command) = cases.processes() {
            assert!(cases.check(command, case, &[]).0 > 0.9);
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
    // Room for all, for some networks, for no RVE, for not even the networks. Ranks have room for fewer.
    let all = [
        ("100000000", 0.9..=1.0, 0.9..=1.0),
        ("7000000", 0.2..=0.9, 0.05..=0.9),
        ("1000000", 0.0..=0.0, 0.0..=0.0),
        ("40000", 0.0..=0.0, 0.0..=0.0),
    ];
    for (bytes, alone, on_ranks) in all {
        let (share, messages) = cases.check(with(cases.program(), bytes), "alone.toml", &[]);
        assert!(alone.contains(&share), "{bytes}: {share}");
        assert_eq!(messages.contains(", 0 % on the device or in lanes"), share == 0.0, "{messages}");
        let (share, _) = cases.check(with(cases.program(), bytes), ON_RANKS[0], &[]);
        assert!(on_ranks.contains(&share), "{bytes}: {share}");
        if let Some(command) = cases.processes() {
            let mut command = with(command, bytes);
            command.env("EMULATED_CUDA_SHARED", cases.path().join(format!("of_device_{bytes}")));
            let (share, _) = cases.check(command, ON_RANKS[1], &[]);
            assert!(on_ranks.contains(&share), "{bytes}: {share}");
        }
    }
    let mut command = cases.program();
    command.env("EMULATED_CUDA_OF_KERNEL", "10000000000");
    assert_eq!(cases.check(command, "alone.toml", &[]).0, 0.0, "no kernel can be started");
    // Rank 1 of the RVEs has the second device for itself.
    let mut command = with(cases.program(), "7000000");
    command.env("EMULATED_CUDA_DEVICES", "2");
    let (on_one, on_two) =
        (cases.check(with(cases.program(), "7000000"), ON_RANKS[0], &[]).0, cases.check(command, ON_RANKS[0], &[]).0);
    assert!(on_two > on_one, "{on_two} with two devices, {on_one} with one");
}

/// More RVEs of a network than the device has room for at once are solved one part after the other.
fn parts(_: &Device) {
    if !is_emulated() {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let Some(command) = program(folder.path()) else { return };
    for device in ["none", "cuda"] {
        let file = body::write(folder.path(), &format!("{device}.toml"), device, "");
        let text = std::fs::read_to_string(&file).unwrap();
        std::fs::write(&file, text.replace("network_*", "network_1").replace("[3, 3, 2]", "[3, 3, 3]")).unwrap();
    }
    let (expected, _) = run(command, folder.path(), "none.toml", &[]);
    // 162 RVEs, of which 128 fit.
    let mut command = program(folder.path()).expect("it was there");
    command.env("EMULATED_CUDA_MEMORY", "3500000");
    let (found, _) = run(command, folder.path(), "cuda.toml", &[]);
    found.assert_same(&expected, "in parts");
    assert!(found.share_of_device() > 0.9, "{}", found.share_of_device());
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
    assert!(message.contains("expected: an NVRTC that compiles the kernels"), "{message}");
    let message = fails(2, &["--backend", "cuda"], ("EMULATED_CUDA_DEVICES", "0"));
    assert!(message.contains("error: --backend cuda: there is no CUDA device number 0"), "{message}");
    let iterative = body::write(cases.path(), "none.toml", "none", "");
    let text = std::fs::read_to_string(&iterative).unwrap();
    let solver = "[newton]\nsolver = { method = \"cg\", preconditioner = \"multigrid\" }";
    std::fs::write(&iterative, text.replace("[newton]", solver)).unwrap();
    let message = fails(4, &["--backend", "cuda"], ("EMULATED_CUDA_MEMORY", "60000"));
    assert!(message.contains("error: load step 1 of 2 fails: the CUDA driver failed"), "{message}");
    assert!(message.contains("another --backend") && !message.contains("det F"), "{message}");
}
