//! The files that an interrupted run leaves behind, and the conditions under which a run resumes from them.

use std::fs;
use std::path::Path;
use std::sync::OnceLock;

use biotissue::app::results::{DirectoryLock, ResultsError};
use biotissue::app::run::ResumeError;
use biotissue::app::run::RootWriter;
use biotissue::backends::comm::thread;

use super::{CASE, Killed, assert_same, contents, copy, resume, simulation, whole_and_killed};

/// A run is resumed only if all results up to its checkpoint exist and are unchanged.
#[test]
fn a_run_with_changed_results_is_not_resumed() {
    let root = tempfile::tempdir().unwrap();
    let (whole, killed) = whole_and_killed(root.path());
    let text = fs::read_to_string(killed.join("loads.csv")).unwrap();
    let [header, one, two, three] = text.lines().collect::<Vec<_>>()[..] else { panic!("{text}") };
    let last_digit = two.replacen("e0,", "1e0,", 1);
    let refused = |change: &dyn Fn(&Path), message: &str| {
        let changed = root.path().join("changed");
        copy(&killed, &changed);
        change(&changed);
        let before = contents(&changed);
        let error = simulation(CASE).resume(&changed).unwrap_err();
        assert!(matches!(error, ResumeError::Results(_)) && error.to_string().contains(message), "{message}: {error}");
        assert!(contents(&changed) == before, "files were changed");
        fs::remove_dir_all(&changed).unwrap();
    };
    for (lines, message) in [
        (vec![header, one, three], "loads.csv:3: has load step 3 where step 2 belongs"),
        (vec![header, one, one, two, three], "loads.csv:3: has load step 1 where step 2 belongs"),
        (vec![header, two, one, three], "loads.csv:2: has load step 2 where step 1 belongs"),
        (vec![header, one], "loads.csv:2: ends after load step 1"),
        (vec![header, one, &last_digit, three], "loads.csv:3: was changed since the run"),
    ] {
        let lines: String = lines.iter().map(|line| format!("{line}\n")).collect();
        refused(&|dir| fs::write(dir.join("loads.csv"), &lines).unwrap(), message);
    }
    for file in ["loads.csv", "fields-00001.vtu", "fields-00002.vtu", "rve/element-00007-step-00001.vtp"] {
        refused(&|dir| fs::remove_file(dir.join(file)).unwrap(), &format!("{file}: is missing"));
    }
    let cut = |dir: &Path| {
        let file = fs::File::options().write(true).open(dir.join("fields-00002.vtu")).unwrap();
        file.set_len(2000).unwrap();
    };
    refused(&cut, "fields-00002.vtu: has 2000 bytes where ");

    // Results after the checkpoint are ignored, and a missing collection is restored.
    fs::write(killed.join("loads.csv"), [header, one, two, "3,nonsense", ""].join("\n")).unwrap();
    fs::remove_file(killed.join("fields.pvd")).unwrap();
    fs::remove_file(killed.join("fields-00003.vtu")).unwrap();
    let resumed = resume(CASE, &killed);
    let [message] = &resumed.warnings[..] else { panic!("{resumed:?}") };
    assert!(
        message.contains("fields.pvd: does not list 2 field files of the run, which will be listed again"),
        "{message}"
    );
    assert_same(&whole, &killed);
}

#[test]
fn lost_collections_of_networks_are_restored() {
    let root = tempfile::tempdir().unwrap();
    let (whole, killed) = whole_and_killed(root.path());
    fs::remove_file(killed.join("rve/element-00007.pvd")).unwrap();
    let cut = killed.join("rve/element-00000.pvd");
    let text = fs::read_to_string(&cut).unwrap();
    let lines: Vec<&str> = text.lines().filter(|line| !line.contains("step-00001")).collect();
    fs::write(&cut, lines.join("\n")).unwrap();
    let resumed = resume(CASE, &killed);
    let message = |file: &str, what: &str| {
        let collection = killed.join(file);
        format!("{}: does not list {what} of the run, which will be listed again", collection.display())
    };
    let expected = [message("rve/element-00000.pvd", "a network"), message("rve/element-00007.pvd", "2 networks")];
    assert_eq!(resumed.warnings, expected);
    assert_same(&whole, &killed);
}

#[test]
fn results_without_a_checkpoint_are_not_removed() {
    let root = tempfile::tempdir().unwrap();
    let (whole, _) = whole_and_killed(root.path());
    let refused = |text: &str, dir: &Path, message: &str| {
        let before = contents(dir);
        let error = simulation(text).resume(dir).unwrap_err();
        assert!(matches!(error, ResumeError::NoCheckpoint { .. }) && error.to_string().contains(message), "{error}");
        assert!(contents(dir) == before, "files were changed");
    };
    // The loads or the log alone show that there are results.
    for (missing, message) in
        [("log.jsonl", "loads.csv: holds 4 load steps"), ("loads.csv", "log.jsonl: holds 4 load steps")]
    {
        let bare = root.path().join("bare");
        copy(&whole, &bare);
        fs::remove_dir_all(bare.join("checkpoint")).unwrap();
        fs::remove_file(bare.join(missing)).unwrap();
        refused(CASE, &bare, message);
        fs::remove_dir_all(&bare).unwrap();
    }
    let fields = root.path().join("fields");
    fs::create_dir(&fields).unwrap();
    fs::copy(whole.join("fields-00003.vtu"), fields.join("fields-00003.vtu")).unwrap();
    refused(CASE, &fields, "fields-00003.vtu: holds the state of load step 3");

    // A run killed before its first checkpoint: the step is repeated, but only by the same run.
    let first = root.path().join("first");
    let unused = root.path().join("unused");
    simulation(CASE).run(&unused, &mut Killed { from: &unused, to: &first, step: 1 }).unwrap();
    assert!(!first.join("checkpoint").exists() && first.join("fields-00001.vtu").exists());
    refused(&CASE.replace("x = 0.4", "x = 0.3"), &first, "loads.csv: holds 1 load step, but");
    assert_eq!(resume(CASE, &first).step, 0);
    assert_same(&whole.join("checkpoint"), &first.join("checkpoint"));
    assert_eq!(fs::read(whole.join("loads.csv")).unwrap(), fs::read(first.join("loads.csv")).unwrap());
}

#[test]
fn temporary_files_of_a_killed_run_are_removed() {
    let root = tempfile::tempdir().unwrap();
    let (whole, killed) = whole_and_killed(root.path());
    for name in ["case.toml", "loads.csv", "log.jsonl", "fields.pvd", "fields-00003.vtu", "report.html"] {
        fs::write(killed.join(format!(".{name}.77.part")), "half").unwrap();
    }
    fs::write(killed.join("rve/.element-00007-step-00003.vtp.77.part"), "half").unwrap();
    fs::write(killed.join("checkpoint/.step-00003.bin.77.part"), "half").unwrap();
    fs::write(killed.join(".notes.txt.77.part"), "mine").unwrap();
    resume(CASE, &killed);
    assert_eq!(fs::read_to_string(killed.join(".notes.txt.77.part")).unwrap(), "mine");
    fs::remove_file(killed.join(".notes.txt.77.part")).unwrap();
    assert_same(&whole, &killed);
    // The same holds for a run that was killed while it removed an old checkpoint, or while it wrote its first file.
    fs::copy(whole.join("checkpoint/step-00003.bin"), killed.join("checkpoint/step-00001.bin")).unwrap();
    resume(CASE, &killed);
    assert_same(&whole, &killed);
    fs::remove_dir_all(&killed).unwrap();
    fs::create_dir(&killed).unwrap();
    fs::write(killed.join(".case.toml.77.part"), "half").unwrap();
    resume(CASE, &killed);
    assert_same(&whole, &killed);
}

/// Only the root accesses the directory, but all ranks return the error and none waits for a message.
#[test]
fn all_ranks_report_that_a_directory_is_in_use() {
    let root = tempfile::tempdir().unwrap();
    let dir = root.path().join("results");
    let (lock, _) = DirectoryLock::acquire(&dir).unwrap();
    let outcome = thread::run(2, |comm| {
        let broken = OnceLock::new();
        let ranks = RootWriter { comm: &comm, broken: &broken };
        let mut simulation = simulation(CASE);
        let message = [
            simulation.take_directory(&ranks, &dir).unwrap_err().to_string(),
            simulation.resume_among(&ranks, &dir).unwrap_err().to_string(),
            simulation.run_among(&ranks, &dir, &mut ()).unwrap_err().to_string(),
        ];
        assert!(message.iter().all(|message| message.contains("in use by another run: process ")), "{message:?}");
        Ok::<_, ResultsError>(())
    });
    assert!(outcome.is_ok(), "{outcome:?}");
    drop(lock);
    assert_eq!(fs::read_dir(&dir).unwrap().count(), 0);
}

/// If fields are not written at every step, the run may be killed after a step without fields.
#[test]
fn a_run_with_fewer_fields_is_resumed() {
    let root = tempfile::tempdir().unwrap();
    let text = CASE.replace("[output]", "[output]\nevery = 3");
    let (whole, killed) = (root.path().join("whole"), root.path().join("killed"));
    for step in [1, 2, 3, 4] {
        simulation(&text).run(&whole, &mut Killed { from: &whole, to: &killed, step }).unwrap();
        let expected = if step == 1 { 0 } else { step - 1 };
        assert_eq!(resume(&text, &killed).step, expected);
        assert_same(&whole, &killed);
        fs::remove_dir_all(&killed).unwrap();
    }
}
