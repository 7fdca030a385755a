//! The command `biotissue rve`.

use std::path::Path;

use serde_json::Value;

use crate::{Outcome, biotissue, frozen, keys, line, write_floppy_network};

const REST: &str = "1 0 0 0 1 0 0 0 1";
const STRETCH: &str = "1.2 0.05 0 0 0.95 0 0 -0.02 1";
const FLOPPY_LAW: &str = "--law linear --youngs-modulus 1e8 --radius 5e-8";

/// Runs `biotissue rve` on the frozen network at a deformation gradient, with more options in one line.
fn rve(gradient: &str, options: &str) -> Outcome {
    of(Path::new("."), &frozen(), gradient, options)
}

/// Runs `biotissue rve` like [`rve`], on a network in a folder.
fn of(folder: &Path, network: &str, gradient: &str, options: &str) -> Outcome {
    let mut arguments = vec!["rve", network, "--F", gradient];
    arguments.extend(options.split_whitespace());
    biotissue(folder, &arguments)
}

fn json(gradient: &str, options: &str) -> Value {
    rve(gradient, &format!("{options} --json")).object()
}

fn matrix<const N: usize>(value: &Value) -> [[f64; N]; N] {
    serde_json::from_value::<Vec<Vec<f64>>>(value.clone())
        .unwrap()
        .into_iter()
        .map(|row| <[f64; N]>::try_from(row).unwrap())
        .collect::<Vec<_>>()
        .try_into()
        .unwrap()
}

fn largest<const N: usize>(m: &[[f64; N]; N]) -> f64 {
    m.iter().flatten().fold(0.0, |largest, x| x.abs().max(largest))
}

fn assert_close<const N: usize>(a: &[[f64; N]; N], b: &[[f64; N]; N], tolerance: f64) {
    let scale = largest(b);
    for (x, y) in a.iter().flatten().zip(b.iter().flatten()) {
        assert!((x - y).abs() <= tolerance * scale, "{x} {y} of {scale}");
    }
}

#[test]
fn the_json_object_has_the_documented_keys() {
    let answer = json(STRETCH, "");
    let documented = [
        "J",
        "cauchy",
        "converged",
        "energy",
        "iterations",
        "ladder",
        "negative_pivots",
        "network",
        "neutral",
        "orientation",
        "pk1",
        "residuals",
        "scale",
        "seconds",
        "stable",
        "stress_gradient",
        "stress_gradient_undefined",
        "stretch",
        "tangent",
    ];
    assert_eq!(keys(&answer), documented);
    assert_eq!(
        keys(&answer["network"]),
        ["boundary_nodes", "cube_edge", "fibers", "free_dofs", "nodes", "total_length"]
    );
    assert_eq!(keys(&answer["stretch"]), ["max", "min"]);
    assert_eq!(keys(&answer["orientation"]), ["current", "reference"]);
    assert_eq!(keys(&answer["seconds"]), ["analyze", "solve", "tangent"]);
    assert_eq!(answer["converged"], true);
    assert!(answer["iterations"].as_u64().unwrap() > 0);

    let network = &answer["network"];
    assert_eq!((&network["nodes"], &network["fibers"]), (&127.into(), &151.into()));
    let (nodes, boundary) = (network["nodes"].as_u64().unwrap(), network["boundary_nodes"].as_u64().unwrap());
    assert_eq!(network["free_dofs"], 3 * (nodes - boundary));
    assert_eq!(answer["scale"], 1.0);

    let residuals: Vec<[f64; 2]> = serde_json::from_value(answer["residuals"].clone()).unwrap();
    assert!(residuals.last().unwrap()[1] < 1e-10 && residuals[0][1] > 1e-4, "{residuals:?}");
    let f = [[1.2, 0.05, 0.0], [0.0, 0.95, 0.0], [0.0, -0.02, 1.0]];
    let determinant = answer["J"].as_f64().unwrap();
    assert!((determinant - 1.2 * 0.95).abs() < 1e-14);
    let pk1: [[f64; 3]; 3] = matrix(&answer["pk1"]);
    let cauchy: [[f64; 3]; 3] = std::array::from_fn(|i| {
        std::array::from_fn(|j| (0..3).map(|k| pk1[i][k] * f[j][k]).sum::<f64>() / determinant)
    });
    assert_close(&matrix(&answer["cauchy"]), &cauchy, 1e-13);
    let tangent: [[f64; 9]; 9] = matrix(&answer["tangent"]);
    assert_close(&tangent, &std::array::from_fn(|i| std::array::from_fn(|j| tangent[j][i])), 1e-9);
    for state in ["reference", "current"] {
        let orientation: [[f64; 3]; 3] = matrix(&answer["orientation"][state]);
        assert!(((0..3).map(|i| orientation[i][i]).sum::<f64>() - 1.0).abs() < 1e-12);
    }
    assert!(answer["stretch"]["min"].as_f64() < Some(1.0) && answer["stretch"]["max"].as_f64() > Some(1.0));
    assert!(answer["energy"].as_f64() > Some(0.0));
}

#[test]
fn the_stress_at_rest_is_zero() {
    let answer = json(REST, "");
    assert_eq!(largest::<3>(&matrix(&answer["pk1"])), 0.0);
    assert_eq!(answer["residuals"].as_array().unwrap().last().unwrap(), &serde_json::json!([0.0, 0.0]));
    assert_eq!((&answer["stretch"]["min"], &answer["stretch"]["max"]), (&1.0.into(), &1.0.into()));
    let half_turn = json("-1 0 0 0 -1 0 0 0 1", "");
    assert!(largest::<3>(&matrix(&half_turn["pk1"])) < 1e-9 * largest::<9>(&matrix(&answer["tangent"])));
}

#[test]
fn the_text_contains_the_same_numbers_as_the_json() {
    let text = rve(STRETCH, "").done().to_owned();
    let pk1: [[f64; 3]; 3] = matrix(&json(STRETCH, "")["pk1"]);
    assert!(text.starts_with("network      127 nodes, 151 fibers, "), "{text}");
    assert!(text.contains(&format!("{:.8e}", pk1[0][0])), "{text}");
    assert!(text.contains("\ncube         edge 1 in the file"), "{text}");
    assert_eq!(text.lines().count(), 6 + 9 + 1 + 9 + 4, "{text}");
}

#[test]
fn every_law_has_its_parameters() {
    let laws = [
        "--law linear --youngs-modulus 1e8 --radius 5e-8",
        "--law exponential --youngs-modulus 1e8 --radius 5e-8 --nonlinearity 1.2",
        "--law exponential-stretch --youngs-modulus 1e8 --radius 5e-8 --nonlinearity 1.2 --transition 1.1",
    ];
    let at_rest = laws.map(|law| matrix::<9>(&json(REST, law)["tangent"]));
    let stretched = laws.map(|law| matrix::<3>(&json(STRETCH, law)["pk1"]));
    for k in 0..3 {
        assert_close(&at_rest[k], &at_rest[0], 1e-10);
        let other = &stretched[(k + 1) % 3];
        assert!((stretched[k][0][0] - other[0][0]).abs() > 1e-4 * largest(other), "the laws give the same stress");
    }
    // The law in the file of the network is the same linear law.
    assert_close(&stretched[0], &matrix(&json(STRETCH, "")["pk1"]), 1e-10);
}

#[test]
fn options_have_their_documented_effect() {
    let plain = json(STRETCH, "");
    let pk1: [[f64; 3]; 3] = matrix(&plain["pk1"]);

    let scaled = json(STRETCH, "--scale 0.003");
    let kappa = scaled["scale"].as_f64().unwrap();
    assert!(kappa > 1.0);
    assert_close(&matrix(&scaled["pk1"]), &pk1.map(|row| row.map(|x| kappa * x)), 1e-12);
    assert_eq!(json(STRETCH, "--scale raw")["pk1"], plain["pk1"]);

    let in_steps = json(STRETCH, "--steps 4");
    assert!(in_steps["iterations"].as_u64() > plain["iterations"].as_u64());
    assert_close(&matrix(&in_steps["pk1"]), &pk1, 1e-8);

    let rough = json(STRETCH, "--tolerance 1e-2");
    assert!(rough["iterations"].as_u64() < plain["iterations"].as_u64());

    // `scripts/gpu.sh` tests the backend that needs a device.
    for backend in biotissue::backends::compiled().iter().filter(|&&backend| backend != "cuda") {
        assert_close(&matrix(&json(STRETCH, &format!("--backend {backend}"))["pk1"]), &pk1, 1e-9);
    }
}

#[test]
fn invalid_arguments_are_reported() {
    for (gradient, options, message) in [
        ("-1 0 0 0 1 0 0 0 1", "", "error: --F has determinant -1\n"),
        ("0 0 0 0 1 0 0 0 1", "", "error: --F has determinant 0\n"),
        ("1e200 0 0 0 1e200 0 0 0 1", "", "error: --F has determinant inf\n"),
        ("1 0 0 0 1 0 0 0", "", "error: invalid --F \"1 0 0 0 1 0 0 0\"\n"),
        ("1 0 0 0 1 0 0 0 nan", "", "error: invalid --F \"1 0 0 0 1 0 0 0 nan\"\n"),
        ("", "", "error: invalid --F \"\"\n"),
        (REST, "--scale -0.003", "error: invalid --scale -0.003\n"),
        (REST, "--scale 1.5", "error: invalid --scale 1.5\n"),
        (REST, "--scale rae", "error: invalid --scale rae\n"),
        (REST, "--steps 0", "error: invalid --steps 0\n"),
        (REST, "--tolerance -1e-3", "error: invalid --tolerance -0.001\n"),
        (REST, "--tolerance nan", "error: invalid --tolerance NaN\n"),
        (REST, "--backend petsk", "error: --backend petsk: there is no backend `petsk`"),
        (
            REST,
            "--law linear --youngs-modulus -1 --radius 1",
            "error: the youngs_modulus is -1, but must be finite and above 0\n",
        ),
        (
            REST,
            "--law exponential --youngs-modulus 1 --radius 1",
            "error: the law `exponential` needs a nonlinearity\n",
        ),
        (
            REST,
            "--law linear --youngs-modulus 1 --radius 1 --nonlinearity -2",
            "error: the law `linear` has no nonlinearity\n",
        ),
        (
            REST,
            "--law exponential-stretch --youngs-modulus 1 --radius 1 --nonlinearity 1 --transition 0.9",
            "error: the transition",
        ),
    ] {
        let failed = rve(gradient, options);
        let block = failed.failed(2);
        assert!(block.starts_with(message), "{gradient} {options}: {block}");
    }
}

#[test]
fn invalid_networks_are_reported_with_file_and_line() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("letters.txt"), "2 1 0\n0 0 zero\n1 1 1\n0 1\n").unwrap();
    write_floppy_network(folder.path());
    for (network, message) in [
        ("letters.txt", "error: letters.txt:2: "),
        ("absent.txt", "error: absent.txt: cannot be read: "),
        (".", "error: .: cannot be read: "),
        ("chain.txt", "error: the network chain.txt has no fiber materials"),
    ] {
        let failed = of(folder.path(), network, REST, "");
        assert!(failed.failed(2).starts_with(message), "{network}: {}", failed.stderr);
    }
}

#[test]
fn a_floppy_network_is_solved() {
    let folder = tempfile::tempdir().unwrap();
    write_floppy_network(folder.path());
    let answer = of(folder.path(), "chain.txt", REST, &format!("{FLOPPY_LAW} --json")).done().to_owned();
    let answer: Value = serde_json::from_str(&answer).unwrap();
    assert!(answer["tangent"][0][0].as_f64().unwrap() > 0.0);
    assert_eq!(stability(&answer), (true, true, 0), "the network is floppy at rest");
}

fn stability(answer: &Value) -> (bool, bool, u64) {
    let is = |key: &str| answer[key].as_bool().unwrap();
    (is("stable"), is("neutral"), answer["negative_pivots"].as_u64().unwrap())
}

/// A straight column of two fibers is compressed along its axis: the straight state is in equilibrium, but is not a
/// minimum of the energy.
#[test]
fn a_saddle_point_is_left_or_reported() {
    let folder = tempfile::tempdir().unwrap();
    let nodes = "0 0.5 0.5\n0.5 0.5 0.5\n1 0.5 0.5\n0.6 0 0.6\n0.8 1 0.6\n0.6 0.6 0\n0.8 0.6 1\n";
    std::fs::write(folder.path().join("column.txt"), format!("7 4 0\n{nodes}0 1\n1 2\n3 4\n5 6\n")).unwrap();
    let press = |options: &str| {
        of(folder.path(), "column.txt", "0.8 0 0 0 1 0 0 0 1", &format!("{FLOPPY_LAW} --json {options}"))
    };
    let answer: Value = serde_json::from_str(press("").done()).unwrap();
    assert_eq!(stability(&answer), (true, true, 0), "the column has buckled and is slack");
    assert!(answer["ladder"]["saddles"].as_u64().unwrap() > 0);

    let refused = press("--stages newton");
    assert_eq!(refused.code, 3);
    assert!(refused.block().contains("the equilibrium found is unstable: its stiffness has 2 negative pivots"));
    let answer: Value = serde_json::from_str(&refused.stdout).unwrap();
    assert_eq!((&answer["converged"], stability(&answer)), (&false.into(), (false, false, 2)));

    assert_eq!(stability(&json(STRETCH, "")), (true, false, 0));
}

#[test]
fn single_stages_may_fail() {
    let law = "--law exponential --youngs-modulus 1e8 --radius 5e-8 --nonlinearity 1.2";
    let far = "0.93 -0.3 0.05 0 0.81 0.09 0.02 0 0.69";
    let failed = rve(far, &format!("{law} --stages newton,cuts"));
    let block = failed.failed(3);
    assert!(block.contains("\n  at: the RVE of ") && block.contains("frozen.txt\n"), "{block}");
    assert!(block.contains("Newton: ") && block.contains("cut increments (6 halvings, "), "{block}");
    assert!(!block.contains("relaxation"), "{block}");

    let failed = rve(far, &format!("{law} --stages newton --json"));
    assert_eq!(failed.code, 3);
    failed.block();
    let answer: Value = serde_json::from_str(&failed.stdout).unwrap();
    assert_eq!(answer["converged"], false);
    assert_eq!(keys(&answer), ["J", "converged", "iterations", "ladder", "network", "residuals", "scale", "seconds"]);

    let failed = rve(REST, "--stages newton,prayer");
    assert!(failed.failed(2).contains("there is no stage `prayer`"), "{}", failed.stderr);
}

#[test]
fn the_residual_of_dynamic_relaxation_is_reported() {
    let alone = json(STRETCH, "--stages relaxation");
    let residuals: Vec<[f64; 2]> = serde_json::from_value(alone["residuals"].clone()).unwrap();
    let [norm, relative] = *residuals.last().unwrap();
    assert!(norm > 0.0 && relative > 0.0 && relative <= 1e-10, "{residuals:?}");
    assert_eq!((&alone["ladder"]["stage"], &alone["ladder"]["at_rounding"]), (&"relaxation".into(), &false.into()));
    let text = rve(STRETCH, "--stages relaxation").done().to_owned();
    let steps = alone["ladder"]["relaxation_steps"].as_u64().unwrap();
    assert!(steps > 0 && text.contains(&format!("0 iterations and {steps} steps of relaxation, |r| = {norm:.3e} N ")));
    assert!(text.contains(" of all forces), by dynamic relaxation\n"), "{text}");
}

#[test]
fn a_residual_at_the_rounding_limit_is_accepted() {
    assert_eq!(json(STRETCH, "--tolerance 1e-20")["ladder"]["at_rounding"], true);
    let text = rve(STRETCH, "--tolerance 1e-20").done().to_owned();
    assert!(text.contains(" of all forces, at rounding), by Newton\n"), "{text}");
    assert!(!rve(STRETCH, "").done().contains("rounding"));
}

#[test]
fn failing_increments_are_reported_or_replaced_by_one_increment() {
    let law = "--law exponential --youngs-modulus 1e8 --radius 5e-8 --nonlinearity 1.2";
    let failed = rve("100 0 0 0 100 0 0 0 1", &format!("{law} --stages newton --steps 2"));
    let block = failed.failed(3);
    assert!(block.contains("\n  at: step 1 of 2 of ") && block.contains("leave --stages out"), "{block}");

    // If one of the `--steps` fails, the whole deformation is applied in one increment.
    let folder = tempfile::tempdir().unwrap();
    let network = "network generate --kind voronoi --density 60 --strength 0.5 -o va.txt --align 1,0,0";
    line(folder.path(), network).done();
    let press = |options: &str| of(folder.path(), "va.txt", "0.9 0 0 0 1 0 0 0 1", &format!("{FLOPPY_LAW} {options}"));
    let (once, in_steps) = (press("--json --dump once.json").object(), press("--json --steps 10 --dump last.json"));
    let answer: Value = serde_json::from_str(in_steps.done()).unwrap();
    assert_eq!(line(folder.path(), "rve --replay last.json --json").object()["pk1"], answer["pk1"]);
    // Whether a step fails, and which, depends on rounding.
    if !in_steps.stderr.is_empty() {
        assert!(in_steps.stderr.starts_with("warning: step "), "{}", in_steps.stderr);
        assert!(in_steps.stderr.contains(" of 10 of va.txt: no equilibrium; "), "{}", in_steps.stderr);
        assert_eq!(answer["pk1"], once["pk1"]);
    }
    let failed = line(folder.path(), "rve --replay once.json --stages newton");
    let block = failed.failed(3);
    assert!(block.contains("cure: ") && block.contains("leave --stages out") && !block.contains("--steps"), "{block}");
}

#[test]
fn a_dump_repeats_the_last_increment_bitwise() {
    let folder = tempfile::tempdir().unwrap();
    let law = "--law exponential --youngs-modulus 1e8 --radius 5e-8 --nonlinearity 1.2 --scale 0.003";
    let gradient = "1.3 0.1 0 0 0.9 0 0.05 0 1";
    let options = format!("{law} --steps 3 --json --dump dump.json");
    let first = of(folder.path(), &frozen(), gradient, &options).done().to_owned();
    let again = line(folder.path(), "rve --replay dump.json --json").done().to_owned();
    let [mut first, again]: [Value; 2] = [first, again].map(|text| serde_json::from_str(&text).unwrap());
    // The dump has the network alone, in the unit cube.
    let edge = first["network"].as_object_mut().unwrap().remove("cube_edge");
    assert_eq!(edge, Some(1.0.into()));
    for key in ["pk1", "tangent", "energy", "residuals", "scale", "network", "J"] {
        assert_eq!(first[key], again[key], "{key}");
    }
    std::fs::write(folder.path().join("dump.json"), "{\n  \"origin\": 3\n}").unwrap();
    let failed = line(folder.path(), "rve --replay dump.json");
    assert!(failed.failed(2).contains("dump.json:2: is not an RVE to replay: "), "{}", failed.stderr);
}

#[test]
fn an_excessive_deformation_is_reported() {
    let law = "--law exponential --youngs-modulus 1e8 --radius 5e-8 --nonlinearity 1.2";
    for gradient in ["100 0 0 0 100 0 0 0 1", "1e55 0 0 0 1e55 0 0 0 1e55", "1e60 0 0 0 1e60 0 0 0 1e60"] {
        let failed = rve(gradient, law);
        let block = failed.failed(3);
        assert!(block.contains("the fiber forces are excessive: at stretch "), "{block}");
        assert!(block.contains("units") && block.contains("--steps"), "{block}");
    }
    // The squares of the tangent's entries overflow.
    for gradient in ["1e55 0 0 0 1e55 0 0 0 1e55", "1e60 0 0 0 1e60 0 0 0 1e60"] {
        rve(gradient, "").failed(3);
    }
}
