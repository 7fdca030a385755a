//! MPI runs in which RVEs move: results stay the same; if one process is killed meanwhile, all ranks end, and the run is
//! resumed from its checkpoint.
#![cfg(all(target_os = "linux", feature = "mpi"))]

use std::path::{Path, PathBuf};
use std::process::Command;

use crate::balance::{BY_ITERATIONS, assert_same_files, migrations, restless};
use crate::ranks::processes::{launched, mpirun_done, one_at_a_time};
use crate::ranks::{read, with_life_cycles, with_scales};
use crate::run::{events, run, write_case};

/// The tag of the messages that carry RVEs and updates of couplings during a migration.
const TAG: u32 = 2 + u16::MAX as u32;

/// Builds the library that kills a process.
fn library(folder: &Path) -> PathBuf {
    let library = folder.join("kill_in_migration.so");
    let source = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/program/kill_in_migration.c");
    let compiler = std::env::var("MPICC").unwrap_or_else(|_| "mpicc".into());
    let compiled = Command::new(compiler).args(["-shared", "-fPIC", "-o"]).args([&library, &source]).output().unwrap();
    assert!(compiled.status.success(), "{}", String::from_utf8_lossy(&compiled.stderr));
    library
}

/// On processes, RVEs that move leave all results as they are without balancing, also between creations and deletions.
#[test]
fn migrations_between_processes_do_not_change_results() {
    let _turn = one_at_a_time();
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let text = with_life_cycles() + "[output]\npoints = true\n";
    for scales in [(1, 3), (2, 2)] {
        let still = format!("{}balance = {{ planner = \"none\" }}\n", with_scales(&text, scales));
        for (out, text) in [("still", still), ("moved", restless(&text, scales, BY_ITERATIONS))] {
            write_case(folder, "case.toml", &text);
            mpirun_done(folder, scales.0 + scales.1, &format!("run case.toml --backend sparse --out {out}"));
        }
        assert!(migrations(&folder.join("still")).is_empty());
        assert!(migrations(&folder.join("moved")).len() > 3, "{scales:?}");
        assert_eq!(read(folder, "moved/loads.csv"), read(folder, "still/loads.csv"), "{scales:?}");
        assert_same_files(folder, "moved", "still");
    }
}

#[test]
fn a_run_killed_in_a_migration_is_resumed() {
    let _turn = one_at_a_time();
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let library = library(folder);
    let text = with_life_cycles();
    run(folder, &text, "--backend sparse --out alone").done();
    let alone = read(folder, "alone/loads.csv");
    let case_of = |scales: (usize, usize)| {
        let name = format!("case-{}-{}.toml", scales.0, scales.1);
        write_case(folder, &name, &restless(&text, scales, BY_ITERATIONS));
        name
    };
    let (case, other) = (case_of((1, 3)), case_of((2, 2)));
    let mut steps = Vec::new();
    for (rank, message, after) in [(1, 1, false), (3, 8, true), (2, 25, false), (3, 40, true)] {
        let what = format!("rank {rank}, message {message}");
        let _ = std::fs::remove_dir_all(folder.join("killed"));
        let mut killed = launched(folder, 4, &format!("run {case} --backend sparse --out killed"));
        killed.env("LD_PRELOAD", &library).env("KILL_TAG", TAG.to_string());
        killed.env("KILL_RANK", rank.to_string()).env("KILL_AT", message.to_string());
        if after {
            killed.env("KILL_AFTER", "1");
        }
        // The costs of RVEs are measured, so that the number of migrations differs from run to run.
        if killed.output().unwrap().status.success() {
            continue;
        }
        let log = events(&folder.join("killed"));
        assert!(log.iter().all(|event| event["event"] != "end"), "{what}");
        steps.push(log.iter().filter(|event| event["event"] == "step").count());
        for (ranks, case) in [(4, &case), (4, &other)] {
            let resumed = folder.join("resumed");
            let _ = std::fs::remove_dir_all(&resumed);
            assert!(Command::new("cp").arg("-r").args([&folder.join("killed"), &resumed]).status().unwrap().success());
            let resume = format!("run {case} --backend sparse --out resumed --resume");
            let ended = launched(folder, ranks, &resume).output().unwrap();
            let message = String::from_utf8_lossy(&ended.stderr);
            assert!(ended.status.success() && !message.contains("warning"), "{what}: {message}");
            assert_eq!(read(folder, "resumed/loads.csv"), alone, "{what}, resumed with {case}");
        }
        assert!(!migrations(&folder.join("resumed")).is_empty(), "{what}");
    }
    assert!(steps.len() > 1 && steps.iter().any(|&count| count > 1), "killed after these numbers of steps: {steps:?}");
}
