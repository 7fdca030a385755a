//! A run that fails, and continues with other settings.

use std::path::Path;

use crate::run::{events, run};

/// A step whose first increments converged before another failed: the state is that before the step.
#[test]
fn a_run_that_fails_within_a_step_continues_with_it() {
    const COMPRESSED: &str = r#"
[mesh]
generate = { shape = "box", cells = [2, 2, 2], size = [1.0e-3, 1.0e-3, 1.0e-3] }
[[region]]
name = "*"
material = { model = "neo-hookean", youngs_modulus = 1e3, poisson_ratio = 0.3 }
[[boundary]]
surface = "x0"
displacement = { x = 0.0, y = 0.0, z = 0.0 }
[[boundary]]
surface = "x1"
displacement = { x = -2e-3, y = 0.0, z = 0.0 }
[output]
checkpoint = 20
[steps]
count = 10
max_cuts = 3
"#;
    let folder = tempfile::tempdir().unwrap();
    let failed = |case: &str, options: &str| {
        let failed = run(folder.path(), case, options);
        assert!(failed.failed(3).contains("load step 5 of 10 does not converge"), "{}", failed.block());
        failed.stderr
    };
    failed(COMPRESSED, "--out out");
    // The failed attempts since the last start or resumption.
    let cuts = |folder: &Path| -> Vec<f64> {
        let events = events(folder);
        let start = events.iter().rposition(|event| event["event"] == "start").unwrap();
        let cuts = events[start..].iter().filter(|event| event["event"] == "cut");
        cuts.map(|event| event["t"].as_f64().unwrap()).collect()
    };
    let before = cuts(&folder.path().join("out"));
    assert!(before.windows(2).any(|pair| pair[1] >= pair[0]), "an increment of the step has converged: {before:?}");
    let more = COMPRESSED.replace("max_cuts = 3", "max_cuts = 4");
    let resumed = failed(&more, "--out out --resume");
    assert!(resumed.contains("continuing after step 4 of 10"), "{resumed}");
    failed(&more, "--out whole");
    let [out, whole] = ["out", "whole"].map(|run| folder.path().join(run));
    assert_eq!(std::fs::read(out.join("loads.csv")).unwrap(), std::fs::read(whole.join("loads.csv")).unwrap());
    assert_eq!(cuts(&out), cuts(&whole), "the resumed run begins with a whole step, as the other did");
}
