//! Runs that are killed while they write a checkpoint, at each of their operations on its files.
#![cfg(target_os = "linux")]

use std::os::unix::process::ExitStatusExt as _;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use crate::balance::{BY_ITERATIONS, restless};
use crate::program;
use crate::ranks::{read, with_life_cycles};
use crate::run::{events, write_case};

/// Numbers of ranks of the macro and the micro scale.
type Scales = (usize, usize);

/// A run of ten steps that is killed while it writes the checkpoint of step 9.
pub struct KilledRun {
    folder: tempfile::TempDir,
    /// The library that kills.
    library: PathBuf,
    text: String,
}

impl KilledRun {
    /// Runs the case without interruption to `whole`, and up to step 8 to `begun`. Returns `None` if no C compiler is
    /// found.
    pub fn new() -> Option<Self> {
        let folder = tempfile::tempdir().unwrap();
        let library = folder.path().join("kill_at_write.so");
        let source = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/program/kill_at_write.c");
        let compiled =
            Command::new("cc").args(["-shared", "-fPIC", "-o"]).args([&library, &source]).arg("-ldl").output();
        match compiled {
            Ok(output) if output.status.success() => {}
            Ok(output) => panic!("{}", String::from_utf8_lossy(&output.stderr)),
            Err(_) => {
                crate::skip::skip("needs cc");
                return None;
            }
        }
        // Pieces are written by several calls of the system, and RVEs have been deleted and others sleep.
        let killed = Self { folder, library, text: with_life_cycles() };
        killed.run("whole", (1, 3), "", None).unwrap_done();
        let status = killed.run("begun", (1, 3), "", Some(1)).0.status;
        assert_eq!(status.signal(), Some(9), "the library has no effect: {status}");
        let last = &events(&killed.path("whole"))[..];
        let of_rves = last.iter().rev().find(|event| event["event"] == "step").unwrap();
        assert!(of_rves["rve"]["deleted"].as_u64().unwrap() > 0, "{of_rves}");
        Some(killed)
    }

    fn path(&self, out: &str) -> PathBuf {
        self.folder.path().join(out)
    }

    /// Writes the case for a split; returns its name and the arguments that run it. RVEs move between ranks, but never
    /// because of measured times, so that every run does the same operations.
    fn arguments(&self, out: &str, scales: Scales, options: &str) -> Vec<String> {
        let name = format!("case-{}-{}.toml", scales.0, scales.1);
        write_case(self.folder.path(), &name, &restless(&self.text, scales, BY_ITERATIONS));
        let backend = if options.contains("--backend") { "" } else { "--backend sparse" };
        format!("run {name} {backend} --out {out} {options}").split_whitespace().map(str::to_owned).collect()
    }

    /// Sets the environment that kills a process at an operation on the checkpoint of step 9.
    fn kill(&self, command: &mut Command, operation: usize) {
        command
            .env("LD_PRELOAD", &self.library)
            .envs([("KILL_FROM", "step-00009"), ("KILL_UNTIL", "step-00010")])
            .env("KILL_AT", operation.to_string());
    }

    fn run(&self, out: &str, scales: Scales, options: &str, operation: Option<usize>) -> Ended {
        let mut command = program(self.folder.path());
        command.args(self.arguments(out, scales, options));
        operation.into_iter().for_each(|operation| self.kill(&mut command, operation));
        Ended(command.output().unwrap())
    }

    fn copy(&self, from: &str, to: &str) {
        let (from, to) = (self.path(from), self.path(to));
        let _ = std::fs::remove_dir_all(&to);
        let status = Command::new("cp").arg("-r").args([from, to]).status().unwrap();
        assert!(status.success());
    }

    /// Checks that the results of a run that was killed are those of the uninterrupted one.
    fn assert_same(&self, out: &str, what: &str) {
        for file in ["loads.csv", "fields.pvd"] {
            // A divided body has an index file for each step.
            let of = |out: &str| read(self.folder.path(), &format!("{out}/{file}")).replace(".pvtu", ".vtu");
            assert!(of(out) == of("whole"), "{what}: {file}");
        }
        let steps: Vec<u64> = events(&self.path(out))
            .iter()
            .filter(|event| event["event"] == "step")
            .map(|event| event["step"].as_u64().unwrap())
            .collect();
        assert_eq!(steps, (1..=10).collect::<Vec<u64>>(), "{what}");
        let (found, expected) = (self.checkpoints(out), self.checkpoints("whole"));
        let main = |files: &[String]| -> Vec<String> {
            files.iter().filter(|name| name.matches('-').count() == 1).cloned().collect()
        };
        assert_eq!(main(&found), main(&expected), "{what}");
        assert!(found.iter().all(|name| name.starts_with("step-")), "{what}: {found:?}");
    }

    fn checkpoints(&self, out: &str) -> Vec<String> {
        let entries = std::fs::read_dir(self.path(out).join("checkpoint")).unwrap();
        let mut names: Vec<String> = entries.map(|entry| entry.unwrap().file_name().into_string().unwrap()).collect();
        names.sort();
        names
    }
}

struct Ended(Output);

impl Ended {
    fn stderr(&self) -> String {
        String::from_utf8_lossy(&self.0.stderr).into_owned()
    }

    fn unwrap_done(self) -> String {
        assert!(self.0.status.success(), "{}", self.stderr());
        self.stderr()
    }
}

/// Kills a run on `scales` at each operation, and resumes it on the same split and on `others`.
fn kill_everywhere(scales: Scales, others: Scales) {
    let Some(killed) = KilledRun::new() else { return };
    let mut resumed_after = Vec::new();
    for operation in 1.. {
        killed.copy("begun", "killed");
        let ended = killed.run("killed", scales, "--resume", Some(operation));
        if ended.0.status.signal() != Some(9) {
            ended.unwrap_done();
            killed.assert_same("killed", "not killed");
            break;
        }
        let files = killed.checkpoints("killed");
        let step = if files.iter().any(|name| name == "step-00009.bin") { 9 } else { 8 };
        resumed_after.push(step);
        for split in [scales, others] {
            let what = format!("{scales:?} killed at operation {operation}, resumed on {split:?}");
            killed.copy("killed", "resumed");
            let message = killed.run("resumed", split, "--resume", None).unwrap_done();
            assert!(message.contains(&format!("continuing after step {step} of 10")), "{what}: {message}");
            assert!(!message.contains("warning"), "{what}: {message}");
            killed.assert_same("resumed", &what);
            let count = |kind: &str| killed.checkpoints("resumed").iter().filter(|name| name.contains(kind)).count();
            let (pieces, of_body) = (count("-part-"), count("-body-"));
            assert_eq!(of_body, 2, "{what}: a piece of each checkpoint, because the body is not divided");
            // Of two checkpoints, of which that of step 9 may have been written before. A rank without RVEs writes none.
            let of_9 = if step == 9 { scales.1 } else { split.1 };
            assert!((2..=of_9 + split.1).contains(&pieces), "{what}: {pieces} pieces");
        }
    }
    assert!(resumed_after.is_sorted() && resumed_after.contains(&9), "{resumed_after:?}");
    // Each rank of the micro scale opens, writes, and syncs a piece, as the first one of the body does.
    assert!(resumed_after.iter().filter(|&&step| step == 8).count() > 5 * (scales.1 + 1), "{resumed_after:?}");
}

#[test]
fn a_run_killed_at_any_write_of_a_checkpoint_is_resumed() {
    kill_everywhere((1, 3), (2, 2));
}

#[test]
fn a_run_with_two_ranks_of_the_body_killed_at_any_write_of_a_checkpoint_is_resumed() {
    kill_everywhere((2, 2), (1, 1));
}

/// Every error names the file, and the checkpoint before remains.
#[test]
fn a_disk_that_is_full_at_any_write_of_a_checkpoint_leaves_one() {
    let Some(killed) = KilledRun::new() else { return };
    let mut failures = 0;
    for operation in 1.. {
        killed.copy("begun", "killed");
        let mut command = program(killed.folder.path());
        command.args(killed.arguments("killed", (1, 3), "--resume"));
        killed.kill(&mut command, operation);
        let ended = Ended(command.env("KILL_FULL", "1").output().unwrap());
        let message = ended.stderr();
        match ended.0.status.code() {
            // The first operation beyond the checkpoint.
            Some(0) => break,
            code => assert_eq!(code, Some(4), "{operation}: {message}"),
        }
        assert!(message.contains("error: killed/checkpoint") && message.contains("cannot be written: "), "{message}");
        killed.run("killed", (2, 1), "--resume", None).unwrap_done();
        killed.assert_same("killed", &format!("the disk is full at operation {operation}"));
        failures += 1;
    }
    assert!(failures > 20, "{failures}");
}

/// One of the processes of an MPI run is killed.
#[cfg(feature = "mpi")]
mod processes {
    use super::*;
    use crate::ranks::processes::{launched, one_at_a_time};

    impl KilledRun {
        fn launch(&self, out: &str, scales: Scales, options: &str, killed: Option<(usize, usize)>) -> Ended {
            let arguments = self.arguments(out, scales, options).join(" ");
            let mut command = launched(self.folder.path(), scales.0 + scales.1, &arguments);
            if let Some((rank, operation)) = killed {
                self.kill(&mut command, operation);
                command.env("KILL_RANK", rank.to_string());
            }
            Ended(command.output().unwrap())
        }
    }

    /// Kills each process at each of its operations, and resumes the run on the same split, and after every third operation on
    /// the other one; `compare` compares the loads with those of the uninterrupted run.
    fn kill_processes(backend: &str, splits: [Scales; 2], compare: impl Fn(&str, &str)) {
        let _turn = one_at_a_time();
        let Some(killed) = KilledRun::new() else { return };
        let whole = read(killed.folder.path(), "whole/loads.csv");
        let options = format!("--resume --backend {backend}");
        // What the killed threads have left there would be removed by the first operations.
        std::fs::remove_dir_all(killed.path("begun")).unwrap();
        killed.launch("begun", splits[0], &format!("--backend {backend}"), Some((0, 1)));
        let begun = killed.checkpoints("begun");
        assert!(begun.iter().any(|name| name == "step-00008.bin"), "{begun:?}");
        // The other ranks may have written their pieces, whose removal would count.
        let unfinished = begun.iter().filter(|name| name.contains("step-00009"));
        unfinished.for_each(|name| std::fs::remove_file(killed.path("begun/checkpoint").join(name)).unwrap());
        let mut steps = Vec::new();
        for rank in 0..splits[0].0 + splits[0].1 {
            for operation in 1.. {
                killed.copy("begun", "killed");
                let ended = killed.launch("killed", splits[0], &options, Some((rank, operation)));
                if ended.0.status.success() {
                    // Each process opens, writes, and syncs a piece.
                    assert!(operation > 4, "rank {rank} has {operation} operations");
                    compare(&read(killed.folder.path(), "killed/loads.csv"), &whole);
                    break;
                }
                assert!(ended.stderr().contains("signal 9"), "rank {rank}, operation {operation}: {}", ended.stderr());
                let files = killed.checkpoints("killed");
                let step = if files.iter().any(|name| name == "step-00009.bin") { 9 } else { 8 };
                steps.push(step);
                for split in &splits[..if operation % 3 == 0 { 2 } else { 1 }] {
                    let what = format!("rank {rank} killed at operation {operation}, resumed on {split:?}");
                    killed.copy("killed", "resumed");
                    let message = killed.launch("resumed", *split, &options, None).unwrap_done();
                    assert!(message.contains(&format!("continuing after step {step} of 10")), "{what}: {message}");
                    compare(&read(killed.folder.path(), "resumed/loads.csv"), &whole);
                }
            }
        }
        assert!(steps.contains(&8) && steps.contains(&9), "{steps:?}");
    }

    #[test]
    fn a_run_on_processes_killed_at_any_write_of_a_checkpoint_is_resumed() {
        let same = |found: &str, whole: &str| assert_eq!(found, whole);
        kill_processes("sparse", [(1, 3), (2, 2)], same);
    }

    #[cfg(feature = "petsc")]
    #[test]
    fn a_run_on_petsc_killed_at_any_write_of_a_checkpoint_is_resumed() {
        kill_processes("petsc", [(2, 2), (1, 3)], crate::ranks::processes::assert_same_to_rounding);
    }
}
