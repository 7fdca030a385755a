//! A run that fails, and continues with other settings.

use std::path::Path;

use crate::run::{PRESSED, events, run};

/// A step whose first increments converged before another failed: the state is that before the step.
#[test]
fn a_run_that_fails_within_a_step_continues_with_it() {
    let few = |cuts: u32| {
        let text = PRESSED.replace("cells = [1, 1, 1]", "cells = [2, 2, 2]");
        format!("{text}max_cuts = {cuts}\n[output]\ncheckpoint = 20\n")
    };
    let folder = tempfile::tempdir().unwrap();
    let failed = |case: &str, options: &str| {
        let failed = run(folder.path(), case, options);
        assert!(failed.failed(3).contains("load step 4 of 5 does not converge"), "{}", failed.block());
        failed.stderr
    };
    failed(&few(3), "--out out");
    // The failed attempts since the last start or resumption.
    let cuts = |folder: &Path| -> Vec<f64> {
        let events = events(folder);
        let start = events.iter().rposition(|event| event["event"] == "start").unwrap();
        let cuts = events[start..].iter().filter(|event| event["event"] == "cut");
        cuts.map(|event| event["t"].as_f64().unwrap()).collect()
    };
    let before = cuts(&folder.path().join("out"));
    assert!(before.windows(2).any(|pair| pair[1] >= pair[0]), "an increment of the step has converged: {before:?}");
    let resumed = failed(&few(4), "--out out --resume");
    assert!(resumed.contains("continuing after step 3 of 5"), "{resumed}");
    failed(&few(4), "--out whole");
    let [out, whole] = ["out", "whole"].map(|run| folder.path().join(run));
    assert_eq!(std::fs::read(out.join("loads.csv")).unwrap(), std::fs::read(whole.join("loads.csv")).unwrap());
    assert_eq!(cuts(&out), cuts(&whole), "the resumed run begins with a whole step, as the other did");
}
