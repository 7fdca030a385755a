//! The standard streams of the program: closed pipes and a full disk; the files of a killed run.

use std::io::{BufRead, BufReader};
use std::process::Stdio;

use crate::run::{PRESSED, fibers, run, write_case};
use crate::{biotissue, frozen, line, program};

#[test]
fn closed_pipes_are_not_errors() {
    let folder = tempfile::tempdir().unwrap();
    let network = frozen();
    let rve = ["rve", &network, "--F", "1 0 0 0 1 0 0 0 1"];
    for arguments in [&["info"][..], &["info", "--json"], &rve, &["network", "info", &network], &["--help"]] {
        let mut child =
            program(folder.path()).args(arguments).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
        drop(child.stdout.take());
        let output = child.wait_with_output().unwrap();
        let message = String::from_utf8_lossy(&output.stderr);
        assert_eq!((output.status.code(), message.as_ref()), (Some(0), ""), "{arguments:?}");
    }
    // A closed stderr does not stop a run.
    let case = write_case(folder.path(), "steps.toml", &PRESSED.replace("x = -1.5", "x = -0.5"));
    let mut child =
        program(folder.path()).args(["run", &case]).stdout(Stdio::null()).stderr(Stdio::piped()).spawn().unwrap();
    drop(child.stderr.take());
    assert_eq!(child.wait().unwrap().code(), Some(0));
}

#[test]
#[cfg(target_os = "linux")]
fn a_full_disk_gives_exit_code_4() {
    let folder = tempfile::tempdir().unwrap();
    let full = std::fs::File::options().write(true).open("/dev/full").unwrap();
    let output = program(folder.path()).arg("info").stdout(full).output().unwrap();
    assert_eq!(output.status.code(), Some(4));
    assert!(String::from_utf8(output.stderr).unwrap().starts_with("error: standard output: cannot be written: "));
}

/// The results of the converged steps can be read, whenever a run is killed.
#[test]
fn a_killed_run_leaves_files_that_can_be_read() {
    let folder = tempfile::tempdir().unwrap();
    let endless = PRESSED.replace("x = -1.5", "x = -0.5").replace("count = 5", "count = 1000000");
    let case = write_case(folder.path(), "endless.toml", &endless);
    for steps in [1, 3, 8] {
        let out = format!("after-{steps}");
        let mut child =
            program(folder.path()).args(["run", &case, "--out", &out]).stderr(Stdio::piped()).spawn().unwrap();
        let lines = BufReader::new(child.stderr.take().unwrap()).lines();
        let seen = lines.map(Result::unwrap).find(|line| line.starts_with(&format!("step {steps}/1000000 ")));
        child.kill().unwrap();
        child.wait().unwrap();
        assert!(seen.is_some());
        let loads = std::fs::read_to_string(folder.path().join(&out).join("loads.csv")).unwrap();
        assert!(loads.lines().count() > steps, "{loads}");
        let fields = std::fs::read_to_string(folder.path().join(&out).join("fields.pvd")).unwrap();
        assert!(fields.trim_end().ends_with("</VTKFile>") && fields.matches("<DataSet ").count() >= steps, "{fields}");
        line(folder.path(), &format!("report {out}")).done();
        assert!(folder.path().join(&out).join("report.html").is_file());
    }
}

#[test]
fn warnings_are_not_printed_on_stdout() {
    let folder = tempfile::tempdir().unwrap();
    let text = std::fs::read_to_string(frozen()).unwrap();
    let (header, rest) = text.split_once('\n').unwrap();
    std::fs::write(folder.path().join("more.txt"), format!("{header} 7\n{rest}")).unwrap();
    let info = biotissue(folder.path(), &["network", "info", "more.txt", "--json"]);
    assert_eq!(info.object()["warnings"].as_array().unwrap().len(), 1);
    assert!(info.stderr.starts_with("warning: more.txt"), "{}", info.stderr);
}

/// Checks that lines within a step say how many of the RVEs are done, more and more of them, and which is the slowest.
pub fn assert_reports_rves(stderr: &str, rves: usize) {
    let text = format!(" of {rves} RVEs done, ");
    let is_of_step = |line: &&str| line.contains(&text) && !line.starts_with("undeformed body, ");
    let beats: Vec<&str> = stderr.lines().filter(is_of_step).collect();
    let is_slowest = |line: &&str| line.contains(", the slowest, of element ") && line.contains("(stage: newton)");
    assert!(beats.iter().any(is_slowest), "{stderr}");
    assert!(beats.iter().all(|line| line.contains("iteration")), "{stderr}");
    let done_of = |line: &&str| line.split(&text).next()?.rsplit(' ').next()?.parse::<usize>().ok();
    let done: Vec<usize> = beats.iter().filter_map(done_of).collect();
    assert!(done.iter().any(|&done| done > 0 && done < rves), "{stderr}");
    assert!(done.iter().all(|&done| done <= rves), "{stderr}");
}

/// A long step is not silent; a run whose steps are short prints no more than one line for each.
#[test]
fn long_steps_report_what_their_rves_do() {
    let folder = tempfile::tempdir().unwrap();
    let text = fibers(&frozen()).replace("cells = [1, 1, 1]", "cells = [6, 6, 5]") + "[micro]\nlanes = \"off\"\n";
    let done = run(folder.path(), &text, "--progress 0.02 --threads 1");
    done.done();
    let is_beat = |line: &&str| line.contains(" of 1080 RVEs done, ");
    let beats: Vec<&str> = done.stderr.lines().filter(is_beat).collect();
    assert!(beats.iter().any(|line| line.starts_with("undeformed body, ")), "{}", done.stderr);
    assert!(beats.iter().any(|line| line.contains("the slowest, of element ")), "{}", done.stderr);
    assert!(beats.iter().any(|line| line.contains("(stage: newton)")), "{}", done.stderr);
    assert!(beats.iter().any(|line| line.starts_with("step 2/2 to t = 1.0000: iteration ")), "{}", done.stderr);
    // The same with RVEs in lanes, where the machine has them, and with ranks that solve the RVEs.
    let lanes = text.replace("[micro]\nlanes = \"off\"\n", "");
    for (text, options) in [(&lanes, ""), (&text, "--ranks 3")] {
        let done = run(folder.path(), text, &format!("--progress 0.02 --threads 1 {options}"));
        done.done();
        assert_reports_rves(&done.stderr, 1080);
    }
    let short = run(folder.path(), &fibers(&frozen()), "");
    short.done();
    assert!(!short.stderr.contains("RVEs done"), "{}", short.stderr);
    let failed = run(folder.path(), &text, "--progress 0");
    assert!(failed.failed(2).contains("invalid --progress 0"), "{}", failed.stderr);
}
