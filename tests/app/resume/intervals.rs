//! Checkpoints that are not written after every step.

use std::fs;
use std::path::Path;

use biotissue::app::Progress;
use biotissue::app::results::log::{self, Cut, Step};
use biotissue::app::results::{Collection, Event};
use biotissue::app::run::{ResumeError, RunError, Simulation};
use biotissue::backends::sparse::Sparse;

use super::{CASE, Killed, assert_same, checkpoints, copy, resume, run, simulation};

/// Returns the case with seven steps and a checkpoint every `k` steps.
fn every(k: usize) -> String {
    CASE.replace("count = 4", "count = 7").replace("[output]", &format!("[output]\ncheckpoint = {k}"))
}

fn steps_in_log(dir: &Path) -> Vec<usize> {
    let events = log::read(&dir.join("log.jsonl")).unwrap();
    events.iter().filter_map(|event| if let Event::Step(step) = event { Some(step.step) } else { None }).collect()
}

fn vtu_files(dir: &Path) -> Vec<String> {
    let names = fs::read_dir(dir).unwrap().map(|entry| entry.unwrap().file_name().into_string().unwrap());
    let mut names: Vec<String> = names.filter(|name| name.ends_with(".vtu")).collect();
    names.sort();
    names
}

/// The rows, fields and networks of steps after the checkpoint are dropped and written again.
#[test]
fn a_run_with_fewer_checkpoints_is_resumed_bitwise() {
    let root = tempfile::tempdir().unwrap();
    let text = every(3);
    let whole = root.path().join("whole");
    run(&text, &whole);
    assert_eq!(checkpoints(&whole), ["step-00006.bin", "step-00007.bin"]);
    for step in 1..=7 {
        let (again, killed) = (root.path().join("again"), root.path().join(format!("killed-{step}")));
        simulation(&text).run(&again, &mut Killed { from: &again, to: &killed, step }).unwrap();
        assert_eq!(resume(&text, &killed).step, (step - 1) / 3 * 3, "killed in step {step}");
        assert_same(&whole, &killed);
        assert_eq!(steps_in_log(&killed), [1, 2, 3, 4, 5, 6, 7]);
    }
}

/// Files of steps after the checkpoint that the resumed run does not write again are removed.
#[test]
fn files_after_the_checkpoint_are_removed() {
    let root = tempfile::tempdir().unwrap();
    let (text, whole, killed) = (every(3), root.path().join("whole"), root.path().join("killed"));
    simulation(&text).run(&whole, &mut Killed { from: &whole, to: &killed, step: 6 }).unwrap();
    assert_eq!(vtu_files(&killed).len(), 6);
    let fewer = text.replace("rve = [0, 7]", "every = 4");
    assert_eq!(resume(&fewer, &killed).step, 3);
    assert_eq!(vtu_files(&killed), [1, 2, 3, 4, 7].map(|step| format!("fields-0000{step}.vtu")));
    assert_eq!(Collection::read(killed.join("fields.pvd")).unwrap().entries().len(), 5);
    assert_eq!(fs::read(killed.join("loads.csv")).unwrap(), fs::read(whole.join("loads.csv")).unwrap());
    let networks = fs::read_dir(killed.join("rve")).unwrap().count();
    assert_eq!(networks, 2 * (3 + 1), "networks of three steps and their collections");
}

/// A run without a checkpoint may be repeated by the same run only.
#[test]
fn a_run_killed_before_its_first_checkpoint_starts_again() {
    let root = tempfile::tempdir().unwrap();
    let (text, whole, killed) = (every(5), root.path().join("whole"), root.path().join("killed"));
    simulation(&text).run(&whole, &mut Killed { from: &whole, to: &killed, step: 5 }).unwrap();
    assert!(!killed.join("checkpoint").exists());
    let changed = root.path().join("changed");
    copy(&killed, &changed);
    let error = simulation(&text.replace("x = 0.4", "x = 0.3")).resume(&changed).unwrap_err();
    assert!(matches!(error, ResumeError::NoCheckpoint { .. }) && error.to_string().contains("5 load steps"), "{error}");
    // What may change at a checkpoint may change before the first one too.
    for other in [every(4), text.replace("[output]", "[newton]\nsolver = \"direct\"\n[scales]\nmicro = 2\n[output]")] {
        let again = root.path().join("again");
        copy(&changed, &again);
        assert_eq!(resume(&other, &again).step, 0);
        assert_eq!(fs::read(whole.join("loads.csv")).unwrap(), fs::read(again.join("loads.csv")).unwrap());
        fs::remove_dir_all(&again).unwrap();
    }
    let resumed = resume(&text, &killed);
    assert!(resumed.step == 0 && resumed.warnings[0].contains("no checkpoint"), "{resumed:?}");
    assert_same(&whole, &killed);
    // More rows than steps up to the first checkpoint come from elsewhere, or the checkpoint was lost.
    fs::remove_dir_all(killed.join("checkpoint")).unwrap();
    assert!(matches!(simulation(&text).resume(&killed), Err(ResumeError::NoCheckpoint { .. })));
}

/// A step that does not converge leaves a checkpoint of the last one, from which the run continues with other settings.
#[test]
fn a_failed_run_has_a_checkpoint_of_its_last_step() {
    // The last displacement turns the body inside out. If the curve bends within step 6, the first part of it converges,
    // and the state after step 5 no longer exists.
    for (bend, last) in [(5.0 / 7.0, 5), (0.72, 3)] {
        let root = tempfile::tempdir().unwrap();
        let curve = format!("x = 0.4 }}\ncurve = [[0.0, 0.0], [{bend}, 0.3], [1.0, -9.0]]");
        let text = every(3).replace("x = 0.4 }", &curve).replace("count = 7", "count = 7\nmax_cuts = 0");
        let fails = |simulation: &mut Simulation<Sparse>| {
            let error = simulation.run(root.path(), &mut ()).unwrap_err();
            assert!(matches!(error, RunError::NotConverged { step: 6, .. }), "{error}");
        };
        fails(&mut simulation(&text));
        assert_eq!(checkpoints(root.path()).last().unwrap(), &format!("step-0000{last}.bin"));
        let loads = fs::read(root.path().join("loads.csv")).unwrap();
        let mut again = simulation(&text.replace("max_cuts = 0", "max_cuts = 1"));
        assert_eq!(again.resume(root.path()).unwrap().step, last);
        fails(&mut again);
        assert_eq!(fs::read(root.path().join("loads.csv")).unwrap(), loads);
        assert_eq!(steps_in_log(root.path()), [1, 2, 3, 4, 5]);
    }
}

/// Interrupts a run in a step.
struct Interrupting {
    step: usize,
    is_interrupted: bool,
    saved: Vec<usize>,
}

impl Progress for Interrupting {
    fn converged(&mut self, step: &Step) {
        self.is_interrupted |= step.step == self.step;
    }

    fn failed(&mut self, _: &Cut) {}

    fn saved(&mut self, step: usize) {
        self.saved.push(step);
    }

    fn is_interrupted(&self) -> bool {
        self.is_interrupted
    }
}

#[test]
fn an_interrupted_run_ends_with_a_checkpoint() {
    let root = tempfile::tempdir().unwrap();
    let (text, whole) = (every(3), root.path().join("whole"));
    run(&text, &whole);
    for step in 1..7 {
        let dir = root.path().join(format!("at-{step}"));
        let mut progress = Interrupting { step, is_interrupted: false, saved: Vec::new() };
        let error = simulation(&text).run(&dir, &mut progress).unwrap_err();
        assert!(matches!(error, RunError::Interrupted(at) if at == step), "{error}");
        assert_eq!(progress.saved.last(), Some(&step));
        assert_eq!(resume(&text, &dir).step, step);
        assert_eq!(fs::read(dir.join("loads.csv")).unwrap(), fs::read(whole.join("loads.csv")).unwrap());
        assert_eq!(steps_in_log(&dir), [1, 2, 3, 4, 5, 6, 7]);
    }
    // An interrupt in the last step has no effect.
    let mut progress = Interrupting { step: 7, is_interrupted: false, saved: Vec::new() };
    simulation(&text).run(&whole, &mut progress).unwrap();
    assert_eq!(progress.saved, [3, 6, 7]);
}
