//! Runs whose RVEs move between the ranks of the micro scale: all results stay the same.

use std::path::Path;

use biotissue::app::results::collection::field_file;
use biotissue::app::results::{CostRow, read_costs, read_fields, read_points};
use serde_json::Value;

use crate::frozen;
use crate::ranks::{read, with_life_cycles, with_scales};
use crate::run::{events, fibers, run};

/// Returns a case whose RVEs move as often as any other plan seems better.
pub fn restless(text: &str, scales: (usize, usize), balance: &str) -> String {
    let trigger = "{ threshold = 1.0, always = true }";
    format!("{}balance = {{ trigger = {trigger}, {balance} }}\n", with_scales(text, scales))
}

/// A balance whose migrations do not depend on measured times.
pub const BY_ITERATIONS: &str = "planner = \"longest-first\", weights = \"iterations\"";

/// Returns a case whose body shears unevenly, so that some RVEs take more iterations than others.
pub fn uneven(text: &str) -> String {
    text.replace("displacement = { x = 0.05 }", "displacement = { x = 0.2, y = 0.9 }")
}

/// Returns the migrations in the log of a run.
pub fn migrations(folder: &Path) -> Vec<Value> {
    events(folder).into_iter().filter(|event| event["event"] == "migration").collect()
}

/// Checks that two runs on the same ranks of the macro scale have written the same fields and points, bit for bit; only
/// the ranks of the RVEs may differ.
pub fn assert_same_files(folder: &Path, found: &str, expected: &str) {
    let names = |run: &str| -> Vec<String> {
        let entries = std::fs::read_dir(folder.join(run)).unwrap();
        let names = entries.map(|entry| entry.unwrap().file_name().into_string().unwrap());
        let is_whole = |name: &String| name.ends_with("vtu") && !name.contains("-part-");
        let mut names: Vec<String> = names.filter(is_whole).collect();
        names.sort();
        names
    };
    let both = [found, expected];
    let [of_found, of_expected] = both.map(names);
    assert_eq!(of_found, of_expected);
    assert!(of_found.iter().any(|name| name.starts_with("points-")), "{of_found:?}");
    for name in of_found {
        // Unlike numbers, their shortest decimals are equal if both are NaN.
        let shown = both.map(|run| {
            let path = folder.join(run).join(&name);
            if name.starts_with("points-") {
                let mut values = read_points(&path).unwrap();
                values.integers.retain(|(name, _)| name != "rank");
                format!("{values:?}")
            } else {
                let mut fields = read_fields(&path).unwrap();
                fields.cell_integers.retain(|(name, _)| name != "rank");
                format!("{fields:?}")
            }
        });
        assert!(shown[0] == shown[1], "{name}");
    }
}

#[test]
fn migrations_do_not_change_results() {
    let folder = tempfile::tempdir().unwrap();
    let text = uneven(&fibers(&frozen())).replace("cells = [1, 1, 1]", "cells = [2, 2, 1]");
    let text = text.replace("count = 2", "count = 5") + "[output]\npoints = true\n";
    run(folder.path(), &text, "--out alone").done();
    let alone = read(folder.path(), "alone/loads.csv");
    let at_steps = format!("{BY_ITERATIONS}, when = \"step\"");
    for (scales, balance) in [
        ((1, 3), BY_ITERATIONS),
        ((2, 5), "planner = \"greedy\", weights = \"iterations\""),
        ((3, 4), &at_steps),
        ((2, 3), "planner = \"greedy\", weights = \"seconds\""),
        ((1, 4), "planner = \"longest-first\""),
        // Few RVEs on each rank: METIS must not print into the summary.
        #[cfg(feature = "metis")]
        ((1, 14), "planner = \"metis\", weights = \"iterations\""),
        #[cfg(feature = "metis")]
        ((2, 7), "planner = \"metis\", weights = \"iterations\""),
    ] {
        let still = format!("{}balance = {{ planner = \"none\" }}\n", with_scales(&text, scales));
        run(folder.path(), &still, "--out still").done();
        let text = restless(&text, scales, balance);
        let summary = run(folder.path(), &text, "--out shared --json").object();
        assert_eq!(read(folder.path(), "shared/loads.csv"), alone, "{scales:?} {balance}");
        assert_same_files(folder.path(), "shared", "still");
        let moved = migrations(&folder.path().join("shared"));
        let units: u64 = moved.iter().map(|event| event["units"].as_u64().unwrap()).sum();
        assert_eq!(
            (&summary["scales"]["migrations"], &summary["scales"]["moved"]),
            (&moved.len().into(), &units.into())
        );
        // Whether a plan from measured times moves RVEs differs from run to run.
        assert!(!moved.is_empty() || !balance.contains("iterations"), "{scales:?} {balance}");
        for event in &moved {
            let load = &event["max_over_mean"];
            assert!(event["units"].as_u64().unwrap() > 0 && event["bytes"].as_u64().unwrap() > 1000, "{event}");
            assert!(load[0].as_f64().unwrap() > load[1].as_f64().unwrap(), "{event}");
            assert!(!balance.contains("step") || event["iteration"] == 1, "{event}");
        }
        let steps: Vec<Value> =
            events(&folder.path().join("shared")).into_iter().filter(|event| event["event"] == "step").collect();
        let of_steps: u64 = steps.iter().map(|step| step["scales"]["migrations"].as_u64().unwrap()).sum();
        assert_eq!(of_steps as usize, moved.len());
        for step in &steps {
            let micro = &step["scales"]["micro"];
            let [any, mean] = ["idle_any", "idle_mean"].map(|share| micro[share].as_f64().unwrap());
            assert!((0.0..=1.0).contains(&any) && (0.0..=any).contains(&mean), "{step}");
            assert!(micro["max_over_mean"].as_f64().unwrap() >= 1.0, "{step}");
            let skill = step["scales"]["skill"].as_f64();
            assert!(skill.is_none_or(|skill| (-1.0..=1.0).contains(&skill)), "{step}");
            assert!(skill.is_some() || balance.contains("iterations"), "all measured times differ: {step}");
        }
    }
}

/// RVEs are created, sleep, wake and are deleted between migrations, which also happen within steps.
#[test]
fn life_cycles_and_migrations_do_not_disturb_each_other() {
    let folder = tempfile::tempdir().unwrap();
    let text = with_life_cycles();
    run(folder.path(), &text, "--out alone").done();
    let alone = read(folder.path(), "alone/loads.csv");
    for (scales, balance) in
        [((1, 2), BY_ITERATIONS), ((3, 3), "weights = \"iterations\""), ((1, 3), "when = \"iteration\"")]
    {
        run(folder.path(), &restless(&text, scales, balance), "--out shared").done();
        assert_eq!(read(folder.path(), "shared/loads.csv"), alone, "{scales:?}");
        let moved = migrations(&folder.path().join("shared")).len();
        assert!(moved > 3 || !balance.contains("iterations"), "{scales:?}: {moved}");
    }
}

#[test]
fn a_run_is_resumed_after_migrations() {
    let folder = tempfile::tempdir().unwrap();
    let text = uneven(&fibers(&frozen())).replace("cells = [1, 1, 1]", "cells = [2, 1, 1]");
    let text = text.replace("count = 2", "count = 4");
    run(folder.path(), &text, "--out alone").done();
    let alone = read(folder.path(), "alone/loads.csv");
    let restless = |scales| restless(&text, scales, BY_ITERATIONS);
    run(folder.path(), &restless((1, 3)), "--out shared").done();
    assert!(!migrations(&folder.path().join("shared")).is_empty());
    for scales in [(2, 2), (1, 4)] {
        std::fs::remove_file(folder.path().join("shared/checkpoint/step-00004.bin")).unwrap();
        run(folder.path(), &restless(scales), "--out shared --resume").done();
        assert_eq!(read(folder.path(), "shared/loads.csv"), alone, "{scales:?}");
    }
    // Without balancing, and in one process.
    std::fs::remove_file(folder.path().join("shared/checkpoint/step-00004.bin")).unwrap();
    run(folder.path(), &text, "--out shared --resume").done();
    assert_eq!(read(folder.path(), "shared/loads.csv"), alone);
}

/// Intervals of RVEs, some of which sleep and cost little, leave a rank without any: its piece of the checkpoint is empty.
#[test]
fn a_run_is_resumed_after_a_migration_that_empties_a_rank() {
    let folder = tempfile::tempdir().unwrap();
    let matrix = "matrix = { model = \"neo-hookean\", shear_modulus = \"1000*exp(12*x)\", poisson_ratio = 0.3 }";
    let text = uneven(&fibers(&frozen())).replace("cells = [1, 1, 1]", "cells = [2, 1, 1]");
    let text = text.replace("law = {", &format!("{matrix}\nlife = {{ asleep_below = 8e-3 }}\nlaw = {{"));
    let text = text.replace("count = 2", "count = 6") + "[output]\npoints = true\n";
    run(folder.path(), &text, "--out alone").done();
    let alone = read(folder.path(), "alone/loads.csv");
    let still = format!("{}balance = {{ planner = \"none\" }}\n", with_scales(&text, (1, 4)));
    run(folder.path(), &still, "--out still").done();
    let greedy = |scales| restless(&text, scales, "planner = \"greedy\", weights = \"iterations\"");
    run(folder.path(), &greedy((1, 4)), "--out shared").done();
    assert_eq!(read(folder.path(), "shared/loads.csv"), alone);
    assert_same_files(folder.path(), "shared", "still");
    // The RVEs of the micro ranks until the end of step 5, after which the run is resumed.
    let log = events(&folder.path().join("shared"));
    let until_then = log.iter().take_while(|event| event["event"] != "step" || event["step"] != 5);
    let of_ranks = until_then.filter(|event| event["event"] == "ranks").map(|event| event["ranks"].as_array().unwrap());
    let counts: Vec<Vec<u64>> =
        of_ranks.map(|ranks| ranks[1..].iter().map(|rank| rank["rves"].as_u64().unwrap()).collect()).collect();
    assert!(counts[0] == [3, 3, 3, 3] && counts.last().unwrap().contains(&0), "{counts:?}");
    for scales in [(1, 5), (1, 4), (2, 2)] {
        std::fs::remove_file(folder.path().join("shared/checkpoint/step-00006.bin")).unwrap();
        run(folder.path(), &greedy(scales), "--out shared --resume").done();
        assert_eq!(read(folder.path(), "shared/loads.csv"), alone, "{scales:?}");
        if scales.0 == 1 {
            assert_same_files(folder.path(), "shared", "still");
        }
    }
}

/// A step that fails reverts RVEs that moved within it.
#[test]
fn a_step_is_cut_after_migrations() {
    let folder = tempfile::tempdir().unwrap();
    let text = fibers(&frozen()).replace("cells = [1, 1, 1]", "cells = [2, 1, 1]");
    let text =
        text.replace("displacement = { x = 0.05 }", "displacement = { x = 0.4 }").replace("count = 2", "count = 1");
    let text = format!("{text}max_cuts = 8\n[newton]\nmax_iterations = 2\n");
    run(folder.path(), &text, "--out alone").done();
    let alone = read(folder.path(), "alone/loads.csv");
    assert!(events(&folder.path().join("alone")).iter().any(|event| event["event"] == "cut"));
    run(folder.path(), &restless(&text, (2, 3), BY_ITERATIONS), "--out shared").done();
    assert_eq!(read(folder.path(), "shared/loads.csv"), alone);
    assert!(!migrations(&folder.path().join("shared")).is_empty());
}

/// Every RVE has one row per sweep, whatever rank solves it, and the rows add up to the counts of the log.
#[test]
fn the_costs_of_all_sweeps_are_recorded() {
    let folder = tempfile::tempdir().unwrap();
    let text = fibers(&frozen()).replace("cells = [1, 1, 1]", "cells = [2, 1, 1]");
    let text = text.replace("displacement = { x = 0.05 }", "displacement = { x = 0.4 }");
    let text = format!("{text}max_cuts = 8\n[newton]\nmax_iterations = 2\n[output]\ncosts = true\n");
    run(folder.path(), &text, "--out alone").done();
    run(folder.path(), &restless(&text, (1, 3), BY_ITERATIONS), "--out shared").done();
    let rows = |run: &str| {
        let mut rows = read_costs(&folder.path().join(run).join("costs.csv")).unwrap();
        rows.sort_by_key(|row| (row.step, row.iteration, row.rve));
        rows
    };
    let work = |rows: &[CostRow]| -> Vec<_> {
        rows.iter().map(|row| (row.step, row.iteration, row.rve, row.network.clone(), row.iterations)).collect()
    };
    let alone = rows("alone");
    assert!(work(&rows("shared")) == work(&alone), "the rows depend on the ranks");
    assert!(alone.iter().all(|row| row.network == alone[0].network && !row.network.is_empty()));
    let log = events(&folder.path().join("alone"));
    assert!(log.iter().any(|event| event["event"] == "cut"));
    for (step, event) in (1..).zip(log.iter().filter(|event| event["event"] == "step")) {
        let of_step: Vec<&CostRow> = alone.iter().filter(|row| row.step == step).collect();
        let sweeps = of_step.iter().map(|row| row.iteration).max().unwrap();
        assert_eq!(of_step.len(), sweeps * 12, "every RVE once per sweep");
        let iterations: u64 = of_step.iter().map(|row| u64::from(row.iterations)).sum();
        assert_eq!(event["rve"]["iterations_total"], iterations);
        let seconds: f64 = of_step.iter().map(|row| row.seconds).sum();
        assert!((event["rve"]["seconds_cpu"].as_f64().unwrap() - seconds).abs() < 1e-9);
    }
    // A resumed run replaces the rows of the step that it repeats by the same ones.
    for (run_of, text) in [("alone", text.clone()), ("shared", restless(&text, (1, 3), BY_ITERATIONS))] {
        std::fs::remove_file(folder.path().join(run_of).join("checkpoint/step-00002.bin")).unwrap();
        run(folder.path(), &text, &format!("--out {run_of} --resume")).done();
        assert!(work(&rows(run_of)) == work(&alone), "the rows of `{run_of}` depend on the resume");
    }
    let count = |rows: &[CostRow], step: usize| -> u32 {
        rows.iter().filter(|row| row.step == step).map(|row| row.iterations).sum()
    };
    // One that writes none leaves only those of the steps before.
    std::fs::remove_file(folder.path().join("alone/checkpoint/step-00002.bin")).unwrap();
    run(folder.path(), &text.replace("costs = true", ""), "--out alone --resume").done();
    let left = rows("alone");
    assert!(count(&left, 1) == count(&alone, 1) && left.iter().all(|row| row.step == 1));
    // A run without costs removes those of the run before.
    run(folder.path(), &text.replace("costs = true", ""), "--out alone").done();
    assert!(!folder.path().join("alone/costs.csv").exists());
}

/// A step in increments: the fields have the sum over all of them, and an RVE sleeps by its change in the whole step.
#[test]
fn iterations_and_sleep_of_rves_are_those_of_whole_steps() {
    let folder = tempfile::tempdir().unwrap();
    let text = fibers(&frozen()).replace("cells = [1, 1, 1]", "cells = [2, 1, 1]").replace(
        "law = {",
        "matrix = { model = \"neo-hookean\", shear_modulus = 1000.0, poisson_ratio = 0.3 }\nlife = { asleep_below = 8e-3 }\nlaw = {",
    );
    let text = format!("{text}adaptive = {{ largest = 0.25 }}\n[output]\ncosts = true\n");
    run(folder.path(), &text, "--out alone").done();
    run(folder.path(), &restless(&text, (1, 3), BY_ITERATIONS), "--out shared").done();
    for run in ["alone", "shared"] {
        let folder = folder.path().join(run);
        let costs = read_costs(&folder.join("costs.csv")).unwrap();
        for (step, event) in (1..).zip(events(&folder).iter().filter(|event| event["event"] == "step")) {
            assert_eq!((&event["increments"], &event["cuts"]), (&Value::from(4), &Value::from(0)));
            assert_eq!(event["rve"]["asleep"], 0, "every RVE moves by more than 0.02");
            let fields = read_fields(&folder.join(field_file(step))).unwrap();
            let (_, iterations) = fields.cell_integers.iter().find(|(name, _)| name == "rve_iterations").unwrap();
            for (rve, &of_rve) in (0..).zip(iterations) {
                let rows = costs.iter().filter(|row| row.step == step && row.rve == rve);
                assert_eq!(of_rve, rows.map(|row| i64::from(row.iterations)).sum::<i64>(), "{run}: RVE {rve}");
            }
        }
    }
    let loads = ["alone", "shared"].map(|run| read(folder.path(), &format!("{run}/loads.csv")));
    assert_eq!(loads[0], loads[1]);
}

#[test]
fn balancing_can_be_switched_off_and_is_written_with_the_case() {
    let folder = tempfile::tempdir().unwrap();
    let text = with_scales(&fibers(&frozen()), (1, 3));
    let done = run(folder.path(), &format!("{text}balance = {{ planner = \"none\" }}\n"), "--out out");
    let line = done.done().lines().next().unwrap();
    assert!(line.starts_with("micro ranks idle for ") && line.ends_with("; no RVE moved"), "{line}");
    assert!(migrations(&folder.path().join("out")).is_empty());
    assert!(read(folder.path(), "out/case.toml").contains("balance = { planner = \"none\" }"));
    run(folder.path(), &format!("{text}balance = {{ trigger = 1.2, when = \"step\" }}\n"), "--out out").done();
    let written = read(folder.path(), "out/case.toml");
    assert!(written.contains("threshold = 1.2, sweeps = 1"), "{written}");
    let again = run(folder.path(), &written, "--out again");
    again.done();
    assert_eq!(read(folder.path(), "again/case.toml").replace("again", "out"), written);
}

#[test]
fn wrong_keys_and_planners_are_errors() {
    let folder = tempfile::tempdir().unwrap();
    let text = with_scales(&fibers(&frozen()), (1, 2));
    for (balance, complaint) in [
        ("planner = \"zoltan\"", "\"diffusive\""),
        ("weigths = \"unit\"", "weights"),
        ("weights = \"mass\"", "\"predictor\""),
        ("when = \"never\"", "\"iteration\""),
        ("trigger = 0.5", "at least 1"),
        ("trigger = { treshold = 2.0 }", "threshold"),
        ("trigger = { sweeps = 0 }", "from 1"),
    ] {
        let failed = run(folder.path(), &format!("{text}balance = {{ {balance} }}\n"), "--out out");
        assert!(failed.failed(2).contains(complaint), "{balance}: {}", failed.stderr);
    }
}
