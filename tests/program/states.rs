//! The states that a run accepts are in equilibrium, even if RVEs are deleted, and do not depend on earlier trial
//! states.

use std::path::Path;

use crate::line;
use crate::run::{events, run};

/// A box of fibers and matrix, clamped at `x0`. `MOVED` is the displacement of `x1`.
const BOX: &str = r#"
title = "A box"
[mesh]
generate = { shape = "box", cells = CELLS, size = [1.0, 1.0, 1.0] }
[[region]]
name = "*"
[region.material]
model = "fiber-rve"
networks = ["net-*.txt"]
fiber_volume_fraction = 0.003
law = { name = "exponential", youngs_modulus = 1.0e8, radius = 5.0e-8, nonlinearity = 1.2 }
matrix = { model = "neo-hookean", shear_modulus = MATRIX, poisson_ratio = 0.3 }
LIFE
[[boundary]]
surface = "x0"
displacement = { x = 0.0, y = 0.0, z = 0.0 }
[[boundary]]
surface = "x1"
displacement = { x = MOVED, y = 0.0, z = 0.0 }
"#;

/// Generates the networks `net-SEED.txt`.
fn networks(folder: &Path, points: usize, seeds: &[usize]) {
    for seed in seeds {
        let options = format!("--kind delaunay --points {points} --seed {seed} -o net-{seed}.txt");
        line(folder, &format!("network generate {options}")).done();
    }
}

/// Returns the pseudo-times of the rows of `loads.csv`, and the force through `x1` along x, N.
fn pulled(folder: &Path) -> Vec<[f64; 2]> {
    let mut rows = csv::Reader::from_path(folder.join("loads.csv")).unwrap();
    let place = |headers: &csv::StringRecord, name: &str| headers.iter().position(|header| header == name).unwrap();
    let headers = rows.headers().unwrap().clone();
    let (t, force) = (place(&headers, "t"), place(&headers, "x1.fx"));
    let rows = rows.records().map(|row| row.unwrap());
    rows.map(|row| [t, force].map(|place| row[place].parse().unwrap())).collect()
}

/// Checks that every step in the log is in equilibrium.
fn assert_balance(folder: &Path) {
    for step in events(folder).iter().filter(|event| event["event"] == "step") {
        let (balance, newton) = (&step["balance"], &step["newton"]["relative"]);
        assert!(balance["relative"].as_f64().unwrap() < 1e-7, "step {}: {balance}", step["step"]);
        assert!(newton.as_array().unwrap().last().unwrap().as_f64().unwrap() < 1e-7, "{newton}");
    }
}

/// When the most strained RVEs are deleted, the others take over their load: the body must be in equilibrium again
/// before the step ends, and the set of remaining RVEs must not depend on the number of steps.
#[test]
fn a_tearing_body_is_in_equilibrium_and_independent_of_the_number_of_steps() {
    let folder = tempfile::tempdir().unwrap();
    networks(folder.path(), 30, &[1, 2]);
    let text = BOX
        .replace("CELLS", "[2, 2, 2]")
        .replace("MATRIX", "1000.0")
        .replace("MOVED", "0.2")
        .replace("LIFE", "life = { deleted_at = 0.12 }");
    let tear = |steps: usize, options: &str| {
        let text = format!("{text}\n[steps]\ncount = {steps}\n");
        run(folder.path(), &text, &format!("--out out {options}")).done();
        let out = folder.path().join("out");
        assert_balance(&out);
        let events = events(&out);
        let steps: Vec<_> = events.iter().filter(|event| event["event"] == "step").collect();
        let rounds: u64 = steps.iter().map(|step| step["rounds"].as_u64().unwrap()).sum();
        let deleted = steps.last().unwrap()["rve"]["deleted"].as_u64().unwrap();
        (pulled(&out), rounds, deleted)
    };
    let (few, rounds, deleted) = tear(5, "");
    assert!(rounds > 1 && (1..48).contains(&deleted), "{deleted} deleted in {rounds} rounds");
    let (more, _, as_many) = tear(10, "");
    assert_eq!(deleted, as_many);
    for [t, force] in &few {
        let [_, other] = more.iter().find(|[other, _]| (t - other).abs() < 1e-12).unwrap();
        assert!((force - other).abs() < 1e-6 * force.abs(), "t = {t}: {force} {other}");
    }
    assert!(few[4][1] < 0.7 * few[1][1], "the force does not fall: {few:?}");
    let (on_ranks, _, _) = tear(5, "--ranks 4");
    assert_eq!(on_ranks, few);
}

/// Networks under compression have several equilibria. The accepted one depends on the last committed state only.
#[test]
fn accepted_states_do_not_depend_on_trial_states() {
    let folder = tempfile::tempdir().unwrap();
    networks(folder.path(), 60, &[3]);
    let text =
        BOX.replace("CELLS", "[2, 1, 1]").replace("MATRIX", "10000.0").replace("MOVED", "-0.1875").replace("LIFE", "");
    let press = |start: &str, line_search: bool, predictor: bool, options: &str| {
        let newton = format!("[newton]\ntolerance = 1e-11\nstart = \"{start}\"\nline_search = {line_search}");
        let text =
            format!("{text}\n[steps]\ncount = 3\n{newton}\n[micro]\ntolerance = 1e-12\npredictor = {predictor}\n");
        run(folder.path(), &text, &format!("--out out {options}")).done();
        let out = folder.path().join("out");
        assert_balance(&out);
        let replaced: u64 = events(&out).iter().filter_map(|event| event["rve"]["replaced"].as_u64()).sum();
        assert!(events(&out).iter().all(|event| event["event"] != "cut"), "a step was cut");
        (pulled(&out), replaced)
    };
    let (expected, _) = press("tangent", true, true, "");
    let (_, replaced) = press("held", true, true, "");
    assert!(replaced > 0, "the start `held` leads to other equilibria");
    for start in ["held", "tangent"] {
        for (line_search, predictor, options) in
            [(true, true, ""), (false, true, ""), (true, false, ""), (false, false, ""), (true, true, "--ranks 4")]
        {
            let (found, _) = press(start, line_search, predictor, options);
            for ([t, expected], [_, found]) in expected.iter().zip(&found) {
                let what = format!("{start} {line_search} {predictor} {options} at t = {t}");
                assert!((expected - found).abs() < 1e-8 * expected.abs(), "{what}: {expected} {found}");
            }
        }
    }
}

/// If meters are given instead of millimeters, the run ends soon, because the forces of the fibers are excessive.
#[test]
fn an_excessive_displacement_gives_a_hint_on_units() {
    let folder = tempfile::tempdir().unwrap();
    networks(folder.path(), 30, &[1]);
    let replacements = [("CELLS", "[2, 1, 1]"), ("MATRIX", "1000.0"), ("MOVED", "200.0"), ("LIFE", "")];
    let text = replacements.iter().fold(BOX.to_owned(), |text, (from, to)| text.replace(from, to));
    let pulled = run(folder.path(), &format!("{text}\n[steps]\ncount = 10\n"), "--out out");
    assert!(pulled.failed(3).contains("the fiber forces are excessive"), "{}", pulled.stderr);
    assert!(pulled.stderr.contains("are both in m?"), "{}", pulled.stderr);
    let saved: Vec<_> =
        std::fs::read_dir(folder.path().join("out/lost-rve")).unwrap().map(|entry| entry.unwrap()).collect();
    assert!(!saved.is_empty());
    for file in saved {
        let again = line(folder.path(), &format!("rve --replay {}", file.path().display()));
        assert!(again.failed(3).contains("the fiber forces are excessive"), "{}", again.stderr);
    }
}
