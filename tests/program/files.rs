//! The files in a result directory that a run may replace, and those that it must not change.

use std::collections::BTreeMap;
use std::io::{BufRead, BufReader};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};

use crate::run::{PRESSED, fibers, run, write_case};
use crate::{frozen, line, program};

/// Returns a case of two steps that takes almost no time.
fn short() -> String {
    PRESSED.replace("x = -1.5", "x = -0.5").replace("count = 5", "count = 2")
}

/// Returns all files and links below a folder with their contents.
fn contents(folder: &Path) -> BTreeMap<PathBuf, Vec<u8>> {
    let (mut found, mut folders) = (BTreeMap::new(), vec![folder.to_owned()]);
    while let Some(folder) = folders.pop() {
        for entry in std::fs::read_dir(folder).unwrap() {
            let path = entry.unwrap().path();
            match path.is_symlink() {
                true => drop(
                    found
                        .insert(path.clone(), std::fs::read_link(&path).unwrap().into_os_string().into_encoded_bytes()),
                ),
                false if path.is_dir() => folders.push(path),
                false => drop(found.insert(path.clone(), std::fs::read(&path).unwrap())),
            }
        }
    }
    found
}

/// Checks that the command is rejected with a message that names the file, and that no file changes.
#[track_caller]
fn assert_refused(folder: &Path, arguments: &str, file: &str) {
    let before = contents(folder);
    let failed = line(folder, arguments);
    let block = failed.failed(2);
    assert!(block.starts_with(&format!("error: {file}: ")) && block.contains("nothing was touched"), "{block}");
    assert!(block.contains("--out") || block.contains("-o"), "{block}");
    assert!(contents(folder) == before, "{arguments}");
}

#[test]
fn a_case_file_is_not_replaced_by_the_copy_of_a_case() {
    let folder = tempfile::tempdir().unwrap();
    let deep = folder.path().join("deep");
    std::fs::create_dir(&deep).unwrap();
    write_case(&deep, "case.toml", &format!("# mine\n{}", short()));
    for arguments in [
        "run deep/case.toml --out deep",
        "run deep/case.toml --out deep --resume",
        "run deep/case.toml --out deep --ranks 2",
    ] {
        assert_refused(folder.path(), arguments, "deep/case.toml");
    }
    assert_refused(&deep, "run case.toml --out .", "./case.toml");
    // A case file with another name does not prevent a run, nor do meshes and networks.
    std::fs::rename(deep.join("case.toml"), deep.join("pull.toml")).unwrap();
    for name in ["body.msh", "frozen.txt", "fields.vtu", "fields-1.vtu", "step-00001.bin"] {
        std::fs::write(deep.join(name), "mine").unwrap();
    }
    line(&deep, "run pull.toml --out .").done();
    let first = contents(&deep);
    line(&deep, "run pull.toml --out .").done();
    line(&deep, "run pull.toml --out . --resume").done();
    assert_eq!(first.keys().collect::<Vec<_>>(), contents(&deep).keys().collect::<Vec<_>>());
    assert_eq!(std::fs::read_to_string(deep.join("body.msh")).unwrap(), "mine");
    assert!(std::fs::read_to_string(deep.join("pull.toml")).unwrap().starts_with("# mine\n"));
    // The copy of a case can be run in its own directory as long as it is unchanged.
    line(&deep, "run case.toml --out .").done();
    let copy = std::fs::read_to_string(deep.join("case.toml")).unwrap();
    std::fs::write(deep.join("case.toml"), copy.replace("count = 2", "count = 3")).unwrap();
    assert_refused(&deep, "run case.toml --out .", "./case.toml");
    // Earlier versions wrote the copy without a checksum and without the name of the file.
    let earlier = copy.split_once('\n').unwrap().1.replace("# Case file: case.toml\n", "");
    std::fs::write(deep.join("case.toml"), earlier).unwrap();
    line(&deep, "run pull.toml --out .").done();
}

/// Cases in one folder have the same result directory, if none of them names another.
#[test]
fn the_results_of_another_case_are_not_replaced() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    write_case(folder, "one.toml", &short());
    write_case(folder, "two.toml", &short());
    line(folder, "run one.toml").done();
    let before = contents(folder);
    for options in ["", " --ranks 2"] {
        let failed = line(folder, &format!("run two.toml{options}"));
        let block = failed.failed(2);
        assert!(block.contains("one.toml, which this run would replace; nothing was touched"), "{block}");
        assert!(block.contains("results`"), "{block}");
        assert!(contents(folder) == before, "{options}");
    }
    // One's own results are replaced, also those of a case that has another name by now, and others if the user says so.
    line(folder, "run one.toml").done();
    for out in ["results".to_owned(), folder.join("results").display().to_string()] {
        line(folder, &format!("run two.toml --out {out}")).done();
        line(folder, &format!("run one.toml --out {out}")).done();
    }
    line(folder, "run two.toml --out results").done();
    std::fs::remove_file(folder.join("two.toml")).unwrap();
    line(folder, "run one.toml").done();
    // A copy of the case continues its run.
    write_case(folder, "two.toml", &short());
    line(folder, "run two.toml --resume").done();
}

#[test]
fn files_that_no_run_has_written_are_not_replaced() {
    let folder = tempfile::tempdir().unwrap();
    write_case(folder.path(), "pull.toml", &short());
    line(folder.path(), "run pull.toml --out out").done();
    for file in [
        "case.toml",
        "loads.csv",
        "log.jsonl",
        "fields.pvd",
        "fields-00001.vtu",
        "fields-00007.pvtu",
        "fields-00002-part-0001.vtu",
        "rve/element-00000.pvd",
        "rve/element-00000-step-00001.vtp",
        "lost-rve/step-00001-cut-00-element-0.json",
        "checkpoint/step-00001.bin",
        "checkpoint/step-00001-body-0000.bin",
        "checkpoint/step-00007-body-0003.bin",
    ] {
        let path = folder.path().join("out").join(file);
        let before = std::fs::read(&path).ok();
        std::fs::create_dir_all(path.parent().unwrap()).unwrap();
        for foreign in ["step,t,force\n1,2,3\n", "title = \"mine\"\n"] {
            std::fs::write(&path, foreign).unwrap();
            assert_refused(folder.path(), "run pull.toml --out out", &format!("out/{file}"));
            assert_refused(folder.path(), "run pull.toml --out out --resume", &format!("out/{file}"));
        }
        match before {
            Some(before) => std::fs::write(&path, before).unwrap(),
            None => std::fs::remove_file(&path).unwrap(),
        }
    }
    line(folder.path(), "run pull.toml --out out --resume").done();
    line(folder.path(), "run pull.toml --out out").done();
}

#[test]
#[cfg(unix)]
fn links_in_a_result_directory_are_not_followed() {
    use std::os::unix::fs::symlink;

    let folder = tempfile::tempdir().unwrap();
    write_case(folder.path(), "pull.toml", &short());
    let out = folder.path().join("out");
    for elsewhere in ["elsewhere/checkpoint", "out"] {
        std::fs::create_dir_all(folder.path().join(elsewhere)).unwrap();
    }
    line(folder.path(), "run pull.toml --out elsewhere").done();
    for name in
        ["case.toml", "loads.csv", "log.jsonl", "fields.pvd", "fields-00001.vtu", "checkpoint", "rve", "lost-rve"]
    {
        symlink(Path::new("../elsewhere").join(name), out.join(name)).unwrap();
        assert_refused(folder.path(), "run pull.toml --out out", &format!("out/{name}"));
        assert_refused(folder.path(), "run pull.toml --out out --resume", &format!("out/{name}"));
        std::fs::remove_file(out.join(name)).unwrap();
    }
    // The result directory itself may be a symbolic link.
    symlink("elsewhere", folder.path().join("link")).unwrap();
    line(folder.path(), "run pull.toml --out link --resume").done();
    line(folder.path(), "run pull.toml --out link").done();
    assert!(folder.path().join("link").is_symlink());
}

#[test]
fn a_report_is_removed_with_its_results() {
    let folder = tempfile::tempdir().unwrap();
    write_case(folder.path(), "pull.toml", &short());
    let page = folder.path().join("out/report.html");
    line(folder.path(), "run pull.toml --out out").done();
    line(folder.path(), "report out").done();
    line(folder.path(), "run pull.toml --out out --resume").done();
    assert!(page.exists(), "a resumed run keeps the report");
    line(folder.path(), "run pull.toml --out out").done();
    assert!(!page.exists());
    // Earlier versions wrote the page without the generator tag.
    let earlier =
        "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<title>pull</title>\n<style>body{margin:0;background:#f3f5f7;";
    std::fs::write(&page, earlier).unwrap();
    line(folder.path(), "run pull.toml --out out").done();
    assert!(!page.exists());
    std::fs::write(&page, "<!DOCTYPE html>\n<p>mine").unwrap();
    line(folder.path(), "run pull.toml --out out").done();
    let failed = line(folder.path(), "report out");
    assert!(failed.failed(2).starts_with("error: out/report.html: is not a page"), "{}", failed.stderr);
    assert_eq!(std::fs::read_to_string(&page).unwrap(), "<!DOCTYPE html>\n<p>mine");
    line(folder.path(), "report out -o page.html").done();
}

/// Returns a case with more steps than any test waits for.
pub fn endless() -> String {
    PRESSED.replace("x = -1.5", "x = -0.5").replace("count = 5", "count = 1000000")
}

/// Starts a run, waits until its first step has converged, and returns the process and its stderr.
pub fn started(folder: &Path, arguments: &str) -> (Child, BufReader<std::process::ChildStderr>) {
    started_by(program(folder).args(arguments.split_whitespace()))
}

/// As [`started`], for a run that is started by any command.
fn started_by(command: &mut Command) -> (Child, BufReader<std::process::ChildStderr>) {
    let mut child = command.stderr(Stdio::piped()).spawn().unwrap();
    let mut stderr = BufReader::new(child.stderr.take().unwrap());
    let mut message = String::new();
    while !message.contains("step 2/") {
        assert!(stderr.read_line(&mut message).unwrap() > 0, "{message}");
    }
    (child, stderr)
}

#[test]
fn two_runs_do_not_share_a_directory() {
    let folder = tempfile::tempdir().unwrap();
    write_case(folder.path(), "endless.toml", &endless());
    write_case(folder.path(), "short.toml", &short());
    for (first, others) in [("", ["", " --resume", " --ranks 3"]), (" --ranks 2", ["", " --resume", " --ranks 2"])] {
        let (mut child, _stderr) = started(folder.path(), &format!("run endless.toml --out out{first}"));
        for other in others {
            let failed = line(folder.path(), &format!("run short.toml --out out{other}"));
            let message = format!("error: out: in use by another run: process {}", child.id());
            assert!(failed.failed(4).starts_with(&message), "{}", failed.stderr);
        }
        // Reading the directory needs no lock.
        line(folder.path(), "report out").done();
        child.kill().unwrap();
        child.wait().unwrap();
        // The lock file that a killed run leaves does not prevent another run.
        assert!(folder.path().join("out/.biotissue.lock").exists());
        line(folder.path(), "run short.toml --out out").done();
        let names = std::fs::read_dir(folder.path().join("out")).unwrap();
        assert!(names.map(|entry| entry.unwrap().file_name()).all(|name| name != ".biotissue.lock"));
    }
}

#[test]
fn an_interrupted_run_prints_how_to_continue() {
    let folder = tempfile::tempdir().unwrap();
    let text = fibers(&frozen()).replace("count = 2", "count = 12");
    run(folder.path(), &text, "--out whole").done();
    let whole = std::fs::read(folder.path().join("whole/loads.csv")).unwrap();
    for (signal, options) in [("INT", ""), ("TERM", ""), ("INT", " --ranks 3")] {
        let (mut child, stderr) = started(folder.path(), &format!("run case.toml --out out{options}"));
        if is_ignored(child.id(), 2) {
            crate::skip::skip("the tests were started with SIGINT ignored");
            child.kill().unwrap();
            return;
        }
        let sent = Command::new("kill").args([format!("-{signal}"), child.id().to_string()]).status();
        assert!(sent.unwrap().success());
        let message: Vec<String> = stderr.lines().map(Result::unwrap).collect();
        assert_eq!(child.wait().unwrap().code(), Some(130), "{message:?}");
        let expected =
            "interrupted: the converged load steps are in out; the same command with --resume continues after them";
        assert_eq!(message.last().map(String::as_str), Some(expected));
        line(folder.path(), "run case.toml --out out --resume").done();
        assert!(std::fs::read(folder.path().join("out/loads.csv")).unwrap() == whole);
        std::fs::remove_dir_all(folder.path().join("out")).unwrap();
    }
}

/// The case is a pipe into which nothing is written.
#[test]
#[cfg(target_os = "linux")]
fn a_run_may_be_interrupted_while_it_is_prepared() {
    let folder = tempfile::tempdir().unwrap();
    assert!(Command::new("mkfifo").arg(folder.path().join("case.toml")).status().unwrap().success());
    let mut command = Command::new(env!("CARGO_BIN_EXE_biotissue"));
    let command = command.args(["run", "case.toml"]).current_dir(folder.path()).stderr(Stdio::piped());
    let mut child = command.spawn().unwrap();
    if is_ignored(child.id(), 15) {
        crate::skip::skip("the tests were started with SIGTERM ignored");
        child.kill().unwrap();
        child.wait().unwrap();
        return;
    }
    // Without a handler, the signal ends the process by itself.
    for _ in 0..5000 {
        if signals(child.id(), "SigCgt:") >> 14 & 1 == 1 {
            break;
        }
        std::thread::sleep(std::time::Duration::from_millis(1));
    }
    assert!(Command::new("kill").args(["-TERM", &child.id().to_string()]).status().unwrap().success());
    let output = child.wait_with_output().unwrap();
    let message = String::from_utf8(output.stderr).unwrap();
    assert_eq!((output.status.code(), &*message), (Some(130), "interrupted before the first load step of this run\n"));
}

/// If checkpoints are not written after every step, an interrupted run first completes its step and writes one; a second
/// interrupt ends it at once.
#[test]
fn an_interrupted_run_with_few_checkpoints_writes_one_more() {
    let folder = tempfile::tempdir().unwrap();
    let text = format!("{}\n[output]\ncheckpoint = 1000\n", fibers(&frozen()).replace("count = 2", "count = 400"));
    run(folder.path(), &text, "--out whole").done();
    let whole = std::fs::read(folder.path().join("whole/loads.csv")).unwrap();
    for options in ["", " --ranks 3"] {
        let (mut child, stderr) = started(folder.path(), &format!("run case.toml --out out{options}"));
        if is_ignored(child.id(), 2) {
            crate::skip::skip("the tests were started with SIGINT ignored");
            child.kill().unwrap();
            return;
        }
        assert!(Command::new("kill").args(["-INT", &child.id().to_string()]).status().unwrap().success());
        let message: Vec<String> = stderr.lines().map(Result::unwrap).collect();
        assert_eq!(child.wait().unwrap().code(), Some(130), "{message:?}");
        let interrupted: Vec<&str> =
            message.iter().filter(|line| line.starts_with("interrupted: ")).map(String::as_str).collect();
        let [first, last] = interrupted[..] else { panic!("{message:?}") };
        assert!(first.starts_with("interrupted: the run ends after the current load step, with a checkpoint;"));
        assert_eq!(
            last,
            "interrupted: the converged load steps are in out; the same command with --resume continues after them"
        );
        let rows = std::fs::read_to_string(folder.path().join("out/loads.csv")).unwrap().lines().count() - 1;
        assert!(rows < 400, "the run was not interrupted");
        let resumed = line(folder.path(), "run case.toml --out out --resume");
        assert!(resumed.stderr.contains(&format!("continuing after step {rows} of 400")), "{}", resumed.stderr);
        assert!(std::fs::read(folder.path().join("out/loads.csv")).unwrap() == whole);
        std::fs::remove_dir_all(folder.path().join("out")).unwrap();
    }
}

/// A signal may be ignored at the start, as under `nohup` or in the background of a script; the other signals still end
/// the run with a message.
#[test]
#[cfg(target_os = "linux")]
fn a_signal_that_is_ignored_at_the_start_remains_ignored() {
    let folder = tempfile::tempdir().unwrap();
    write_case(folder.path(), "endless.toml", &endless());
    for (ignored, ends, number) in [("HUP", "INT", 2), ("INT", "TERM", 15), ("TERM", "HUP", 1)] {
        let mut command = Command::new("sh");
        // A shell cannot reset a signal that was ignored when the shell started.
        let script = format!("trap '' {ignored}; exec \"$0\" run endless.toml --out out");
        command.args(["-c", &script, env!("CARGO_BIN_EXE_biotissue")]).current_dir(folder.path());
        let (mut child, stderr) = started_by(&mut command);
        if is_ignored(child.id(), number) {
            crate::skip::skip(&format!("the tests were started with SIG{ends} ignored"));
            child.kill().unwrap();
            child.wait().unwrap();
            continue;
        }
        let send = |signal: &str| Command::new("kill").args([format!("-{signal}"), child.id().to_string()]).status();
        assert!(send(ignored).unwrap().success());
        assert!(send(ends).unwrap().success());
        let message: Vec<String> = stderr.lines().map(Result::unwrap).collect();
        let last = &message[message.len().saturating_sub(3)..];
        assert_eq!(child.wait().unwrap().code(), Some(130), "{last:?}");
        assert_eq!(message.iter().filter(|line| line.starts_with("interrupted")).count(), 1, "{last:?}");
        std::fs::remove_dir_all(folder.path().join("out")).unwrap();
    }
}

/// Returns true if a process ignores a signal: SIGINT in the background of a script, SIGHUP under `nohup`.
fn is_ignored(process: u32, signal: u32) -> bool {
    signals(process, "SigIgn:") >> (signal - 1) & 1 == 1
}

/// Returns a set of signals of a process, one bit for each; empty on systems without it.
fn signals(process: u32, set: &str) -> u64 {
    let status = std::fs::read_to_string(format!("/proc/{process}/status")).unwrap_or_default();
    let mask = status.lines().find_map(|line| line.strip_prefix(set)).unwrap_or("0");
    u64::from_str_radix(mask.trim(), 16).unwrap_or(0)
}

/// Every case of `examples` is valid.
#[test]
fn the_examples_pass_their_check() {
    let examples = Path::new(env!("CARGO_MANIFEST_DIR")).join("examples");
    for name in ["capillary", "dogbone", "ligament", "neuron"] {
        let plan = line(&examples, &format!("check {name}/{name}.toml --json")).object();
        assert!(plan["elements"].as_u64().unwrap() > 500, "{plan}");
        assert!(examples.join(name).join("README.md").is_file(), "{name}");
    }
}
