//! Laws on the command line and in the files beside a network: tables, compression, several types of fibers.
use std::path::Path;
use std::process::{Command, Output};

use serde_json::Value;

fn biotissue(folder: &Path, arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_biotissue")).current_dir(folder).args(arguments).output().unwrap()
}

fn text(bytes: &[u8]) -> &str {
    std::str::from_utf8(bytes).unwrap()
}

/// Runs a command with a deformation gradient and returns the JSON that it prints.
fn answer(folder: &Path, arguments: &str) -> Value {
    let mut words: Vec<&str> = arguments.split_whitespace().collect();
    words.extend(["--F", "1.1 0 0 0 0.97 0 0 0 0.97", "--json"]);
    let output = biotissue(folder, &words);
    assert!(output.status.success(), "{arguments}: {}", text(&output.stderr));
    serde_json::from_slice(&output.stdout).unwrap()
}

const SOFT: &str = "fraction=0.7,law=exponential,youngs-modulus=1e7,radius=5e-8,nonlinearity=1.2";
const STIFF: &str = "fraction=0.3, law=linear, youngs-modulus=1e8, radius=1e-7, compression=0.01";

#[test]
fn several_types_are_written_read_and_solved() {
    let folder = tempfile::tempdir().unwrap();
    let make = |name: &str, seed: &str| {
        let generate = ["network", "generate", "--points", "40", "--seed", seed, "-o", name];
        let made = biotissue(folder.path(), &[&generate[..], &["--fiber", SOFT, "--fiber", STIFF]].concat());
        assert!(made.status.success(), "{}", text(&made.stderr));
        assert!(!folder.path().join(name).with_extension("txt.params").exists(), "unsupported laws");
        std::fs::read_to_string(folder.path().join(name).with_extension("txt.toml")).unwrap()
    };
    let sidecar = make("net.txt", "3");
    assert_eq!(make("again.txt", "3"), sidecar, "the same seed");
    let info = biotissue(folder.path(), &["network", "info", "net.txt", "--json"]);
    let info: Value = serde_json::from_slice(&info.stdout).unwrap();
    assert_eq!((&info["laws"][0]["name"], &info["laws"][1]["compression"]), (&"exponential".into(), &0.01.into()));

    let mixed = answer(folder.path(), "rve net.txt");
    let soft =
        answer(folder.path(), "rve net.txt --law exponential --youngs-modulus 1e7 --radius 5e-8 --nonlinearity 1.2");
    let stress = |answer: &Value| answer["pk1"][0][0].as_f64().unwrap();
    assert!(stress(&mixed) > 1.5 * stress(&soft), "{} {}", stress(&mixed), stress(&soft));

    // Cleaning keeps the types of the remaining fibers.
    let arguments = ["network", "check", "net.txt", "--shorter-than", "0.1", "--clean", "-o", "clean.txt"];
    assert!(biotissue(folder.path(), &arguments).status.success());
    let text = std::fs::read_to_string(folder.path().join("clean.txt.toml")).unwrap();
    assert!(text.contains("[[fiber_type]]") && text.contains("types = ["), "{text}");
    answer(folder.path(), "rve clean.txt");

    // A sidecar of another network is rejected.
    std::fs::copy(folder.path().join("clean.txt.toml"), folder.path().join("net.txt.toml")).unwrap();
    let refused = biotissue(folder.path(), &["network", "info", "net.txt"]);
    assert_eq!(refused.status.code(), Some(2));
}

#[test]
fn a_table_is_read_from_its_file() {
    let folder = tempfile::tempdir().unwrap();
    let generate = "network generate --points 30 --seed 1 -o net.txt";
    assert!(biotissue(folder.path(), &generate.split(' ').collect::<Vec<_>>()).status.success());
    // Hooke's law as a table and as a formula: the table reproduces a straight line exactly.
    std::fs::write(folder.path().join("hooke.csv"), "stretch,stress\n0.5,-5e7\n1.0,0\n1.5,5e7\n").unwrap();
    let table = answer(folder.path(), "rve net.txt --law table --table hooke.csv --radius 5e-8");
    let straight = "--law exponential-stretch --youngs-modulus 1e8 --radius 5e-8 --nonlinearity 1 --transition 1";
    let hooke = answer(folder.path(), &format!("rve net.txt {straight}"));
    let (found, expected) = (table["energy"].as_f64().unwrap(), hooke["energy"].as_f64().unwrap());
    assert!((found / expected - 1.0).abs() < 1e-10, "{found} {expected}");

    // The sidecar contains the points of the table, so the CSV file may be removed.
    let law = "--law table --table hooke.csv --radius 5e-8 --compression 0.1";
    let generate = format!("{generate} {law}");
    assert!(biotissue(folder.path(), &generate.split(' ').collect::<Vec<_>>()).status.success());
    std::fs::remove_file(folder.path().join("hooke.csv")).unwrap();
    let buckling = answer(folder.path(), "rve net.txt")["energy"].as_f64().unwrap();
    assert!(buckling < 0.98 * found, "{buckling} {found}");
}

#[test]
fn invalid_laws_are_reported_with_a_cure() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("bad.csv"), "1,0\n1.1,5\n1.2,4\n").unwrap();
    let generate = ["network", "generate", "--points", "9", "-o", "x.txt"];
    let half = "fraction=0.5,law=linear,youngs-modulus=1,radius=1";
    let cases: [(&[&str], &str); 11] = [
        (&["--law", "table", "--radius", "1"], "--table <FILE>"),
        (&["--law", "table", "--table", "bad.csv", "--radius", "1"], "bad.csv:3: the stress falls from 5 to 4"),
        (&["--law", "table", "--table", "no.csv", "--radius", "1"], "no.csv: cannot be read"),
        (
            &["--law", "linear", "--youngs-modulus", "1", "--radius", "1", "--table", "bad.csv"],
            "error: the law `linear` has no file\n  expected: only parameters that the law has\n  cure: leave out --table",
        ),
        (
            &["--law", "linear", "--youngs-modulus", "1", "--radius", "1", "--compression", "-1"],
            "error: the compression is -1, but must be finite and from 0 to 1",
        ),
        (&["--fiber", half], "error: the fractions of the fiber types sum to 0.5"),
        (&["--fiber", half, "--law", "linear"], "cannot be used with"),
        (&["--fiber", "fraction=1,law=linear,radius=1"], "error: the law `linear` needs a youngs_modulus"),
        (&["--fiber", "fraction=1,law=linear,radios=1"], "there is no key `radios`"),
        (&["--fiber", "law=linear,radius=1"], "there is no `fraction=`"),
        (&["--fiber", "fraction=1,law=linear,radius=x"], "radius: expected a number"),
    ];
    for (arguments, message) in cases {
        let output = biotissue(folder.path(), &[&generate[..], arguments].concat());
        let stderr = text(&output.stderr);
        assert_eq!(output.status.code(), Some(2), "{arguments:?}: {stderr}");
        assert!(stderr.contains(message), "{arguments:?}: {stderr}");
        assert!(!folder.path().join("x.txt").exists());
    }
}
