//! The program `biotissue` as a user runs it: its output, its files and its errors.
#![cfg(feature = "app")]

mod arguments;
mod balance;
mod constraints;
mod cuda;
#[cfg(all(feature = "petsc", feature = "sparse"))]
mod divided;
mod element_ranks;
mod elements;
mod failed_step;
mod field_names;
mod fields;
mod files;
#[path = "../support/hollow_box.rs"]
mod hollow_box;
mod killed;
mod killed_migration;
mod loads;
mod measure;
mod memory;
mod mesh_files;
mod messages;
mod network_fields;
mod networks;
mod outputs;
#[cfg(all(feature = "petsc", feature = "sparse"))]
mod parts;
#[path = "../support/networks.rs"]
mod published;
mod rank_report;
mod ranks;
mod recorded_errors;
mod run;
mod rve;
#[path = "../support/skip.rs"]
mod skip;
mod solvers;
mod states;
mod streams;
#[cfg(unix)]
mod tutorials;
mod variants;

use std::ffi::OsStr;
use std::path::{Path, PathBuf};
use std::process::Command;

/// The exit code and the output of a command.
struct Outcome {
    code: i32,
    stdout: String,
    stderr: String,
}

/// Returns a command that starts the program in `folder`.
fn program(folder: &Path) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_biotissue"));
    command.current_dir(folder);
    command
}

/// Runs the program and checks that it does not panic.
fn biotissue<S: AsRef<OsStr>>(folder: &Path, arguments: &[S]) -> Outcome {
    let shown = || arguments.iter().map(|a| a.as_ref().to_string_lossy()).collect::<Vec<_>>().join(" ");
    let output = program(folder).args(arguments).output().unwrap();
    let outcome = Outcome {
        code: output.status.code().unwrap_or_else(|| panic!("{}: {}", shown(), output.status)),
        stdout: String::from_utf8(output.stdout).unwrap(),
        stderr: String::from_utf8(output.stderr).unwrap(),
    };
    assert!(!outcome.stderr.contains("panicked"), "{}: {}", shown(), outcome.stderr);
    assert!([0, 2, 3, 4].contains(&outcome.code), "{}: {}: {}", shown(), outcome.code, outcome.stderr);
    outcome
}

/// As [`biotissue`], with the arguments in one line, separated by blanks.
fn line(folder: &Path, arguments: &str) -> Outcome {
    biotissue(folder, &arguments.split_whitespace().collect::<Vec<_>>())
}

impl Outcome {
    /// Returns the stdout of a command that succeeded.
    fn done(&self) -> &str {
        assert_eq!(self.code, 0, "{}", self.stderr);
        &self.stdout
    }

    /// Returns the JSON object that a successful command printed.
    fn object(&self) -> serde_json::Value {
        assert_eq!(self.done().lines().count(), 1, "{}", self.stdout);
        serde_json::from_str(&self.stdout).unwrap()
    }

    /// Returns the error block on stderr of a command that failed with `code` and printed no result; progress before it
    /// is omitted.
    fn failed(&self, code: i32) -> &str {
        assert_eq!(self.code, code, "{}", self.stderr);
        assert_eq!(self.stdout, "");
        self.block()
    }

    /// Returns the only error block on stderr.
    fn block(&self) -> &str {
        let starts: Vec<usize> = self.stderr.match_indices("error: ").map(|(at, _)| at).collect();
        assert_eq!(starts.len(), 1, "one block: {}", self.stderr);
        let block = &self.stderr[starts[0]..];
        assert!(starts[0] == 0 || self.stderr[..starts[0]].ends_with('\n'), "{}", self.stderr);
        assert!(block.contains("\n  expected: ") && block.contains("\n  cure: "), "{block}");
        block
    }
}

/// Returns the keys of a JSON object, in alphabetical order.
fn keys(object: &serde_json::Value) -> Vec<&str> {
    let mut keys: Vec<&str> = object.as_object().unwrap().keys().map(String::as_str).collect();
    keys.sort_unstable();
    keys
}

/// Returns the path of a file in the folder `tests`.
fn beside(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests").join(name)
}

/// Returns the path of the frozen network, which has linear fibers.
fn frozen() -> String {
    beside("networks/frozen.txt").to_str().unwrap().to_owned()
}

/// Writes the network `chain.txt`: a straight chain of three fibers along every diagonal of the cube, whose interior
/// nodes no fiber supports against lateral motion.
fn write_floppy_network(folder: &Path) {
    let corner = |k: usize| [k & 1, k >> 1 & 1, k >> 2].map(|x| x as f64);
    let mut nodes: Vec<[f64; 3]> = (0..8).map(corner).collect();
    let mut fibers = Vec::new();
    for (k, shift) in [0.0, 0.01, 0.02, 0.03].into_iter().enumerate() {
        let (from, to) = (corner(k), corner(7 - k));
        let at = |part: f64| [0, 1, 2].map(|i| from[i] + (to[i] - from[i]) * (part + shift));
        let first = nodes.len();
        nodes.extend([at(0.3), at(0.7)]);
        fibers.extend([[k, first], [first, first + 1], [first + 1, 7 - k]]);
    }
    let mut text = format!("{} {} 0\n", nodes.len(), fibers.len());
    nodes.iter().for_each(|[x, y, z]| text.push_str(&format!("{x} {y} {z}\n")));
    fibers.iter().for_each(|[a, b]| text.push_str(&format!("{a} {b}\n")));
    std::fs::write(folder.join("chain.txt"), text).unwrap();
}
