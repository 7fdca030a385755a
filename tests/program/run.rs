//! `biotissue run` and `biotissue check`.

use std::path::Path;

use serde_json::Value;

use crate::{Outcome, biotissue, frozen, keys, line, write_floppy_network};

/// A box that is compressed beyond zero length: it is flat at `t = 2/3`, so that three of the five load steps converge.
pub const PRESSED: &str = r#"
title = "Pressed through itself"
[mesh]
generate = { shape = "box", cells = [1, 1, 1], size = [1.0, 1.0, 1.0] }
[[region]]
name = "*"
material = { model = "neo-hookean", youngs_modulus = 1.0e3, poisson_ratio = 0.3 }
[[boundary]]
surface = "x0"
displacement = { x = 0.0, y = 0.0, z = 0.0 }
[[boundary]]
surface = "x1"
displacement = { x = -1.5, y = 0.0, z = 0.0 }
[steps]
count = 5
"#;

/// A box of one cell, extended by 5 %, with a fiber network in every element.
const FIBERS: &str = r#"
title = "Fibers"
[mesh]
generate = { shape = "box", cells = [1, 1, 1], size = [1.0, 1.0, 1.0] }
[[region]]
name = "*"
[region.material]
model = "fiber-rve"
networks = ["NETWORK"]
fiber_volume_fraction = 0.003
law = { name = "linear", youngs_modulus = 1.0e8, radius = 5.0e-8 }
[[boundary]]
surface = "x0"
displacement = { x = 0.0, y = 0.0, z = 0.0 }
[[boundary]]
surface = "x1"
displacement = { x = 0.05 }
[steps]
count = 2
"#;

/// Writes a case and returns the name of its file.
pub fn write_case(folder: &Path, name: &str, text: &str) -> String {
    std::fs::write(folder.join(name), text).unwrap();
    name.to_owned()
}

pub fn run(folder: &Path, text: &str, options: &str) -> Outcome {
    write_case(folder, "case.toml", text);
    line(folder, &format!("run case.toml {options}"))
}

pub fn fibers(network: &str) -> String {
    FIBERS.replace("NETWORK", network)
}

pub fn events(folder: &Path) -> Vec<Value> {
    let log = std::fs::read_to_string(folder.join("log.jsonl")).unwrap();
    log.lines().map(|line| serde_json::from_str(line).unwrap()).collect()
}

fn steps_in_loads(folder: &Path) -> usize {
    std::fs::read_to_string(folder.join("loads.csv")).unwrap().lines().count() - 1
}

/// Returns the number of files that `fields.pvd` names, after checking that each exists.
fn field_files(folder: &Path) -> usize {
    let collection = std::fs::read_to_string(folder.join("fields.pvd")).unwrap();
    let names = collection.split("file=\"").skip(1).map(|rest| rest.split('"').next().unwrap());
    names.inspect(|name| assert!(folder.join(name).is_file(), "{name}")).count()
}

#[test]
fn a_case_runs_to_its_results() {
    let folder = tempfile::tempdir().unwrap();
    let done = run(folder.path(), &fibers(&frozen()), "--json --ranks 1 --threads 2");
    let summary = done.object();
    assert_eq!(
        keys(&summary),
        ["converged", "cuts", "directory", "iterations", "seconds", "steps", "wasted_iterations"]
    );
    assert_eq!((&summary["converged"], &summary["steps"], &summary["cuts"]), (&true.into(), &2.into(), &0.into()));
    let progress: Vec<&str> = done.stderr.lines().collect();
    assert!(progress[0].starts_with("6 elements, ") && progress[0].ends_with("6 RVEs of 1 network, 2 threads"));
    assert!(progress[1].starts_with("step 1/2 t = 0.5000: ") && progress[2].starts_with("step 2/2 t = 1.0000: "));
    assert_eq!(progress.len(), 3);

    let results = folder.path().join("results");
    assert_eq!((steps_in_loads(&results), field_files(&results)), (2, 2));
    let events = events(&results);
    let kinds: Vec<&str> = events.iter().map(|event| event["event"].as_str().unwrap()).collect();
    assert_eq!(kinds, ["start", "step", "step", "end"]);
    assert_eq!(
        (&events[0]["rves"], &events[0]["threads"], &events[3]["converged"]),
        (&6.into(), &2.into(), &true.into())
    );
    let report = line(folder.path(), "report results");
    assert_eq!(report.done().trim_end(), Path::new("results").join("report.html").to_str().unwrap());

    // The copy of the case, whose paths are absolute, gives the same results in another folder.
    let again = run(folder.path(), &std::fs::read_to_string(results.join("case.toml")).unwrap(), "--out deep/again");
    assert!(again.done().starts_with("2 load steps, ") && again.done().trim_end().ends_with("results in deep/again"));
    let loads = |folder: &Path| std::fs::read_to_string(folder.join("loads.csv")).unwrap();
    assert_eq!(loads(&results), loads(&folder.path().join("deep/again")));
}

#[test]
fn check_prints_the_plan_and_writes_nothing() {
    let folder = tempfile::tempdir().unwrap();
    write_case(folder.path(), "case.toml", &fibers(&frozen()));
    let plan = line(folder.path(), "check case.toml --json --threads 2").object();
    for (key, value) in [("elements", 6), ("nodes", 8), ("unknowns", 8), ("rves", 6), ("steps", 2), ("threads", 2)] {
        assert_eq!(plan[key], value, "{key}");
    }
    assert_eq!(
        (&plan["ranks"], &plan["regions"], &plan["networks"][0]["rves"]),
        (&1.into(), &serde_json::json!(["body"]), &6.into())
    );
    assert_eq!((&plan["element_types"], &plan["integration_points"]), (&serde_json::json!({ "tet4": 6 }), &6.into()));
    let memory = &plan["memory"];
    assert!(memory["rves"].as_u64() > Some(0) && memory["total"].as_u64() > memory["networks"].as_u64(), "{memory}");
    assert_eq!(plan["bounding_box"], serde_json::json!([[0.0, 0.0, 0.0], [1.0, 1.0, 1.0]]));
    for (found, expected) in [
        (&plan["volume"], 1.0),
        (&plan["surface_areas"]["y1"], 1.0),
        (&plan["quality"]["minimum"], 1.2 * 0.5_f64.powf(2.0 / 3.0)),
        (&plan["quality"]["median"], 1.2 * 0.5_f64.powf(2.0 / 3.0)),
    ] {
        assert!((found.as_f64().unwrap() - expected).abs() < 1e-12, "{found}, {expected}");
    }
    let text = line(folder.path(), "check case.toml");
    for words in [
        "title      Fibers",
        "6 elements, 8 nodes",
        "6 tet4; 6 integration points",
        "8 free",
        "frozen.txt",
        "condition  surface \"x1\" (2 faces, 1.0000e0 m^2): displacement x 0.05 m, 5.0 % of the longest edge\n",
        "free       surfaces y0 (1.0000e0 m^2), y1 (1.0000e0 m^2), z0 (1.0000e0 m^2), z1 (1.0000e0 m^2)\n",
        "box        [0.0, 0.0, 0.0] to [1.0, 1.0, 1.0] m, volume 1.0000e0 m^3\n",
        "quality    0.756 (element 0) or better, median 0.756; mean ratio, 1 is ideal\n",
    ] {
        assert!(text.done().contains(words), "{words}: {}", text.stdout);
    }
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1, "only the case");
}

#[test]
fn check_warns_of_floppy_networks_without_a_matrix_or_with_a_soft_one() {
    let folder = tempfile::tempdir().unwrap();
    write_floppy_network(folder.path());
    write_case(folder.path(), "case.toml", &fibers("chain.txt"));
    let checked = line(folder.path(), "check case.toml --json");
    assert_eq!(checked.object()["floppy_networks"], serde_json::json!(["chain.txt"]));
    let warning = "warning: case.toml:5: region \"*\": the network has motions that no fiber resists, and no matrix resists \
                   them either: chain.txt; ";
    assert!(checked.stderr.starts_with(warning), "{}", checked.stderr);
    assert_eq!(checked.stderr.matches("warning: ").count(), 1, "{}", checked.stderr);
    let with_matrix = |shear_modulus: f64| {
        let matrix = format!(
            "matrix = {{ model = \"neo-hookean\", shear_modulus = {shear_modulus:?}, poisson_ratio = 0.3 }}\nlaw"
        );
        write_case(folder.path(), "case.toml", &fibers("chain.txt").replace("law", &matrix));
    };
    with_matrix(1e3);
    let soft = line(folder.path(), "check case.toml");
    let warning = "the network has motions that no fiber resists, and the matrix, about 2600 Pa, is too soft beside the fibers, \
                   about 5.0e4 Pa, to resist them: chain.txt; ";
    assert!(soft.stderr.contains(warning), "{}", soft.stderr);
    let measured = line(folder.path(), "check case.toml --measure --json").object();
    let measured = &measured["measured"];
    assert_eq!((&measured["failures"], &measured["forecast_is_least"]), (&0.into(), &true.into()), "{measured}");
    let text = line(folder.path(), "check case.toml --measure").done().to_owned();
    assert!(
        text.contains("\nforecast   ") && text.contains("\n           at least: the networks of the warning"),
        "{text}"
    );
    with_matrix(1e4);
    assert_eq!(line(folder.path(), "check case.toml").stderr, "");
    // A rigid network needs none.
    write_case(folder.path(), "case.toml", &fibers(&frozen()));
    let checked = line(folder.path(), "check case.toml --json");
    assert_eq!((&checked.object()["floppy_networks"], &*checked.stderr), (&serde_json::json!([]), ""));
}

#[test]
fn steps_that_converged_before_a_failure_are_written() {
    let folder = tempfile::tempdir().unwrap();
    let failed = run(folder.path(), PRESSED, "--out pressed");
    let block = failed.failed(3);
    assert!(block.starts_with("error: load step 4 of 5 does not converge, halved 6 times: element "), "{block}");
    assert!(block.contains("det F = -") && block.contains("the 3 load steps before it are in pressed\n"), "{block}");
    let results = folder.path().join("pressed");
    // The fourth field file is the state of the last converged substep of the fourth step.
    assert_eq!((steps_in_loads(&results), field_files(&results)), (3, 4));
    let events = events(&results);
    let count = |kind: &str| events.iter().filter(|event| event["event"] == kind).count();
    assert_eq!((count("start"), count("step"), count("end")), (1, 3, 1));
    assert!(count("cut") >= 6);
    let end = events.last().unwrap();
    assert_eq!((&end["event"], &end["converged"], &end["steps"]), (&"end".into(), &false.into(), &3.into()));
    assert!(end["reason"].as_str().unwrap().contains("det F"));
    let report = line(folder.path(), "report pressed");
    report.done();
    assert!(std::fs::read_to_string(results.join("report.html")).unwrap().contains("det F"));
}

#[test]
fn a_body_without_supports_is_an_input_error() {
    let folder = tempfile::tempdir().unwrap();
    let (body, rest) = PRESSED.split_once("[[boundary]]").unwrap();
    let steps = &rest[rest.find("[steps]").unwrap()..];
    let failed = run(folder.path(), &format!("{body}{steps}"), "");
    let block = failed.failed(2);
    assert!(block.contains("the body is free to move in every direction and to rotate about every axis"), "{block}");
    assert!(block.contains("prescribe displacements") && block.contains("`BooleanFragments`"), "{block}");
    assert!(!folder.path().join("results").exists());
}

#[test]
fn a_floppy_network_runs_and_is_reported() {
    let folder = tempfile::tempdir().unwrap();
    write_floppy_network(folder.path());
    // Before the first step, once, on ranks as well.
    for options in ["", "--ranks 3"] {
        let done = run(folder.path(), &fibers("chain.txt"), options);
        done.done();
        let warning = "the network has motions that no fiber resists, and no matrix resists them either: chain.txt; ";
        assert!(done.stderr.starts_with(&format!("warning: case.toml:5: region \"*\": {warning}")), "{}", done.stderr);
        assert_eq!(done.stderr.matches("no fiber resists").count(), 1, "{}", done.stderr);
    }
    let rigid = run(folder.path(), &fibers(&frozen()), "");
    rigid.done();
    assert!(!rigid.stderr.contains("warning: "), "{}", rigid.stderr);
    assert!(line(folder.path(), "network check chain.txt").done().contains("floppy"));
}

#[test]
fn relaxation_is_shown_as_progress() {
    let folder = tempfile::tempdir().unwrap();
    let relaxing = run(folder.path(), &(fibers(&frozen()) + "[micro]\nstages = [\"relaxation\"]\n"), "");
    relaxing.done();
    assert!(relaxing.stderr.contains(" steps of relaxation in all, "), "{}", relaxing.stderr);
    assert!(!run(folder.path(), &fibers(&frozen()), "").stderr.contains("relaxation"));
}

#[test]
fn a_region_without_networks_is_reported() {
    let folder = tempfile::tempdir().unwrap();
    let matrix = "matrix = { model = \"neo-hookean\", shear_modulus = 100.0, poisson_ratio = 0.3 }\n[[boundary]]";
    let bare: String =
        fibers("").lines().filter(|line| !line.starts_with("law")).map(|l| l.to_owned() + "\n").collect();
    let bare = bare.replace("[\"\"]", "[]").replacen("[[boundary]]", matrix, 1);
    write_case(folder.path(), "case.toml", &bare);
    for command in ["check", "run"] {
        let outcome = line(folder.path(), &format!("{command} case.toml"));
        outcome.done();
        let message = "case.toml: the region \"*\" has no networks: its RVEs are the matrix alone\n";
        assert!(outcome.stderr.contains(message), "{}", outcome.stderr);
    }
}

#[test]
fn a_failed_rve_can_be_replayed() {
    let folder = tempfile::tempdir().unwrap();
    let case = fibers(&frozen()) + "[micro]\nmax_iterations = 1\nstages = [\"newton\"]\n";
    let failed = run(folder.path(), &case.replace("[steps]", "[steps]\nmax_cuts = 0"), "");
    let block = failed.failed(3);
    let file = "results/lost-rve/step-00001-cut-00-element-0.json";
    assert!(
        block.contains("`biotissue rve --replay ") && block.contains(&format!("{file}` repeats the RVE")),
        "{block}"
    );
    assert!(block.contains("cure: leave `stages` and `max_iterations` of [micro] at the default; then: "), "{block}");
    let log = std::fs::read_to_string(folder.path().join("results/log.jsonl")).unwrap();
    assert!(log.contains(r#""lost_rve":"lost-rve/step-00001-cut-00-element-0.json""#), "{log}");

    let again = line(folder.path(), &format!("rve --replay {file}"));
    let message = again.failed(3);
    assert!(
        message.contains("Newton: no convergence in 1 iterations") && message.contains("element 0 in load step 1"),
        "{message}"
    );
    let residual = |text: &str| text.split("|r| = ").nth(1).unwrap().split(',').next().unwrap().to_owned();
    assert_eq!(residual(message), residual(block), "the same failure");
    line(folder.path(), &format!("rve --replay {file} --stages regularised")).done();

    // A new run removes the file and reports it; a run that does not start removes nothing.
    let replacing = "results; --resume continues those of the same case\n";
    assert!(!run(folder.path(), &fibers(&frozen()), "--backend absent").stderr.contains("replacing"));
    assert!(!run(folder.path(), &fibers("absent.txt"), "").stderr.contains("replacing"));
    let again = run(folder.path(), &fibers(&frozen()), "");
    again.done();
    assert!(again.stderr.contains(replacing), "{}", again.stderr);
    assert!(!folder.path().join(file).exists());
}

#[test]
fn insufficient_supports_are_an_input_error() {
    let folder = tempfile::tempdir().unwrap();
    let hinge = PRESSED.replace(
        "surface = \"x0\"\ndisplacement = { x = 0.0, y = 0.0, z = 0.0 }",
        "surface = \"x0\"\ntraction = [1.0, 0.0, 0.0]",
    );
    let slide = hinge.replace("x = -1.5, y = 0.0, z = 0.0", "x = -1.5, z = 0.0");
    // The displacements of two nodes are prescribed and no others.
    let two = hinge.replace("displacement = { x = -1.5, y = 0.0, z = 0.0 }", "traction = [-1.0, 0.0, 0.0]")
        + "[[point]]\nat = [0.0, 0.0, 0.0]\ndisplacement = { x = 0.0, y = 0.0, z = 0.0 }\n\
           [[point]]\nat = [0.0, 0.0, 1.0]\ndisplacement = { x = 0.0, y = 0.0, z = 0.0 }\n";
    for (case, mode) in [
        (slide, "the body is free to move along y\n"),
        (two.clone(), "the body is free to rotate about z (the axis through (0, 0, 0.5))\n"),
    ] {
        write_case(folder.path(), "case.toml", &case);
        for command in ["check", "run"] {
            let failed = line(folder.path(), &format!("{command} case.toml"));
            let block = failed.failed(2);
            assert!(block.starts_with(&format!("error: case.toml: {mode}")), "{block}");
            assert!(block.contains("of every connected part") && block.contains("[[point]]"), "{block}");
        }
    }
    assert!(!folder.path().join("results").exists());
    // A third node removes the rigid-body mode.
    let supported = two + "[[point]]\nat = [1.0, 0.0, 0.0]\ndisplacement = { y = 0.0 }\n";
    write_case(folder.path(), "case.toml", &supported);
    line(folder.path(), "check case.toml").done();
}

#[test]
fn a_directory_that_cannot_be_written_gives_exit_code_4() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("FILE"), "a file").unwrap();
    for out in ["FILE", "FILE/sub"] {
        let failed = run(folder.path(), PRESSED, &format!("--out {out}"));
        assert!(failed.failed(4).starts_with(&format!("error: {out}: cannot be written: ")), "{}", failed.stderr);
    }
    assert_eq!(std::fs::read_to_string(folder.path().join("FILE")).unwrap(), "a file");
}

#[test]
fn all_errors_of_a_case_are_shown_at_once() {
    let folder = tempfile::tempdir().unwrap();
    let bad = PRESSED
        .replace("youngs_modulus", "yungs_modulus")
        .replace("\"box\"", "\"bux\"")
        .replace("count = 5", "count = -5")
        .replace("x = -1.5", "x = \"far\"");
    for command in ["run", "check"] {
        write_case(folder.path(), "case.toml", &bad);
        let failed = line(folder.path(), &format!("{command} case.toml"));
        let block = failed.failed(2);
        for message in [
            "case.toml:4: `mesh.generate.shape` is the string \"bux\"",
            "case.toml:7: unknown key `region.material.yungs_modulus`",
            "cure: did you mean `youngs_modulus`?",
            "case.toml:13: ",
            "case.toml:15: `steps.count` is -5",
        ] {
            assert!(block.contains(message), "{message}: {block}");
        }
    }
    // Errors of names that only the mesh can confirm are also shown at once.
    let unknown = PRESSED.replace("\"x0\"", "\"left\"").replace("\"x1\"", "\"right\"");
    let failed = run(folder.path(), &unknown, "");
    let block = failed.failed(2);
    assert!(block.contains("no surface \"left\"") && block.contains("no surface \"right\""), "{block}");
    assert!(!folder.path().join("results").exists());
}

#[test]
fn files_and_counts_of_a_case_must_be_valid() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("letters.txt"), "2 1 0\n0 0 zero\n1 1 1\n0 1\n").unwrap();
    let no_law: String =
        fibers("chain.txt").lines().filter(|l| !l.starts_with("law")).map(|l| l.to_owned() + "\n").collect();
    write_floppy_network(folder.path());
    let mesh = PRESSED
        .replace("generate = { shape = \"box\", cells = [1, 1, 1], size = [1.0, 1.0, 1.0] }", "file = \"a.msh\"");
    for (text, message) in [
        (fibers("absent/*.txt"), "absent/*.txt"),
        (fibers("letters.txt"), "letters.txt:2: "),
        (no_law, "chain.txt"),
        (mesh, "case.toml:4: `mesh.file` names \"a.msh\", but this file does not exist"),
        (PRESSED.replace("cells = [1, 1, 1]", "cells = [9999, 9999, 9999]"), "elements"),
        (String::new(), "case.toml"),
    ] {
        let failed = run(folder.path(), &text, "");
        assert!(failed.failed(2).contains(message), "{message}: {}", failed.stderr);
    }
    for (case, message) in [("absent.toml", "cannot be read: "), (".", "is a folder"), ("letters.txt", "")] {
        let failed = biotissue(folder.path(), &["run", case]);
        assert!(failed.failed(2).starts_with(&format!("error: {case}")), "{}", failed.stderr);
        assert!(failed.stderr.contains(message), "{}", failed.stderr);
    }
    let failed = biotissue(folder.path(), &["check", "letters.txt"]);
    assert!(failed.failed(2).contains("`biotissue network check`"), "{}", failed.stderr);
}

#[test]
fn invalid_options_are_rejected_before_files_are_read() {
    let folder = tempfile::tempdir().unwrap();
    for (options, message) in [
        ("--threads 0", "error: invalid --threads 0\n"),
        ("--threads 100000", "error: invalid --threads 100000\n"),
        ("--ranks 0", "error: invalid --ranks 0\n"),
        ("--ranks 100000", "error: 100000 ranks\n"),
        ("--backend petsk", "error: --backend petsk: there is no backend `petsk`"),
    ] {
        let failed = run(folder.path(), PRESSED, options);
        assert!(failed.failed(2).starts_with(message), "{}", failed.stderr);
    }
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1, "only the case");
}

/// The loads of both runs agree to rounding.
#[test]
#[cfg(all(feature = "petsc", feature = "sparse"))]
fn a_run_on_petsc_gives_the_same_loads() {
    let folder = tempfile::tempdir().unwrap();
    let loads = |backend: &str| {
        run(folder.path(), &fibers(&frozen()), &format!("--backend {backend}")).done();
        let text = std::fs::read_to_string(folder.path().join("results/loads.csv")).unwrap();
        let numbers =
            text.lines().skip(1).flat_map(|row| row.split(',').map(|cell| cell.parse::<f64>().unwrap_or(0.0)));
        numbers.collect::<Vec<f64>>()
    };
    let (sparse, petsc) = (loads("sparse"), loads("petsc"));
    let largest = sparse.iter().fold(0.0, |largest: f64, value| largest.max(value.abs()));
    assert!(largest > 0.0 && sparse.len() == petsc.len());
    for (sparse, petsc) in sparse.iter().zip(&petsc) {
        assert!((sparse - petsc).abs() <= 1e-9 * largest.min(1e3), "{sparse} {petsc}");
    }
}
