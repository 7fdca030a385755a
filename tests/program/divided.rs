//! Bodies that `biotissue divide` has divided: runs read the parts, and have the results of runs that divide the body.

use std::collections::BTreeSet;
use std::path::Path;

use crate::line;
use crate::parts::{assert_same_points, loaded, varying};
use crate::ranks::processes::{assert_same_to_rounding, launched, mpirun_done, one_at_a_time};
use crate::ranks::{read, with_life_cycles, with_scales};
use crate::run::{events, write_case};

/// Runs a case on three ranks of the body and two of its RVEs, whose body is divided before, and compares it with a run that
/// divides it; returns the warnings of both.
fn agrees(folder: &Path, text: &str) -> BTreeSet<String> {
    write_case(folder, "case.toml", &with_scales(text, (3, 2)));
    let divided = line(folder, "divide case.toml --ranks 3 --out divided");
    assert!(divided.done().contains(" in 3 parts in divided, the largest of "), "{}", divided.stdout);
    let warnings = ["whole", "parts"].map(|out| {
        let option = if out == "parts" { "--divided divided" } else { "" };
        let options = format!("run case.toml --backend petsc --out {out} {option}");
        let run = launched(folder, 5, &options).output().unwrap();
        let stderr = String::from_utf8_lossy(&run.stderr);
        assert!(run.status.success(), "{stderr}");
        stderr.lines().filter(|line| line.starts_with("warning")).map(str::to_owned).collect::<BTreeSet<_>>()
    });
    assert_eq!(warnings[0], warnings[1]);
    assert_same_to_rounding(&read(folder, "parts/loads.csv"), &read(folder, "whole/loads.csv"));
    let starts = ["whole", "parts"].map(|out| events(&folder.join(out))[0].clone());
    assert_eq!(starts[0], starts[1]);
    warnings.into_iter().next().unwrap()
}

#[test]
fn a_divided_body_gives_the_results_of_one_that_the_run_divides() {
    let _turn = one_at_a_time();
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let warnings = agrees(folder, &loaded("tet4", 1));
    assert!(warnings.iter().any(|warning| warning.contains("2 of 5 ranks are for RVEs")), "{warnings:?}");
    assert_same_points(&folder.join("parts/points-00002.pvtu"), &folder.join("whole/points-00002.pvtu"));
    // The checkpoint of either run continues by the other.
    for (out, options) in [("whole", "--divided divided"), ("parts", "")] {
        let before = read(folder, &format!("{out}/loads.csv"));
        for file in std::fs::read_dir(folder.join(out).join("checkpoint")).unwrap() {
            let path = file.unwrap().path();
            if path.file_name().unwrap().to_string_lossy().starts_with("step-00002") {
                std::fs::remove_file(path).unwrap();
            }
        }
        mpirun_done(folder, 5, &format!("run case.toml --backend petsc --out {out} --resume {options}"));
        assert_same_to_rounding(&read(folder, &format!("{out}/loads.csv")), &before);
        assert_eq!(events(&folder.join(out)).iter().filter(|event| event["event"] == "start").count(), 2);
    }
}

#[test]
fn rves_of_a_divided_body_are_created_and_deleted() {
    let _turn = one_at_a_time();
    let folder = tempfile::tempdir().unwrap();
    let text = with_life_cycles() + "[newton]\ntolerance = 1e-12\n[output]\nrve = [1, 4]\n";
    agrees(folder.path(), &text);
    assert!(folder.path().join("parts/rve/element-00004.pvd").is_file());
}

/// The networks of a division are found beside the case, wherever that is.
#[test]
fn a_division_moves_with_its_case() {
    let _turn = one_at_a_time();
    let folder = tempfile::tempdir().unwrap();
    let [before, after] = ["before", "after"].map(|name| folder.path().join(name));
    std::fs::create_dir(&before).unwrap();
    agrees(&before, &varying(&before));
    std::fs::rename(&before, &after).unwrap();
    let run = "run case.toml --backend petsc --out moved --divided divided";
    mpirun_done(&after, 5, run);
    assert_same_to_rounding(&read(&after, "moved/loads.csv"), &read(&after, "whole/loads.csv"));
    flip_a_bit(&after.join("divided/fields.bin"));
    refused(&after, 5, run, "divided/fields.bin: its ");
    let fields = read(&after, "fields.csv");
    std::fs::write(after.join("fields.csv"), format!("{fields}\n")).unwrap();
    refused(&after, 5, run, "was made with another content of fields.csv");
    std::fs::write(after.join("fields.csv"), fields).unwrap();
    // Other networks of the same names, and one more.
    let case = read(&after, "case.toml");
    let copied = std::process::Command::new("cp").args(["-r", "networks", "others"]).current_dir(&after).status();
    assert!(copied.unwrap().success());
    write_case(&after, "case.toml", &case.replace("networks/*.txt", "others/*.txt"));
    refused(&after, 5, run, "was made for another case: the case differs in [files]");
    write_case(&after, "case.toml", &case);
    line(&after, "network generate --points 25 -o networks/network-0003.txt").done();
    refused(&after, 5, run, "was made for another case: the case differs in [region.material]");
}

fn flip_a_bit(path: &Path) {
    let mut bytes = std::fs::read(path).unwrap();
    let middle = bytes.len() / 2;
    bytes[middle] ^= 1;
    std::fs::write(path, bytes).unwrap();
}

/// Checks that all ranks end with one message, which says how to divide the body again.
fn refused(folder: &Path, ranks: usize, run: &str, expected: &str) {
    let failed = launched(folder, ranks, run).output().unwrap();
    let message = String::from_utf8_lossy(&failed.stderr);
    assert!(!failed.status.success() && message.contains(expected), "{expected}: {message}");
    assert_eq!(message.matches(expected).count(), 1, "{message}");
    assert!(message.contains("cure: divide the body again: `biotissue divide case.toml --ranks "), "{message}");
}

#[test]
fn a_division_of_something_else_is_refused() {
    let _turn = one_at_a_time();
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    line(folder, "mesh box --cells 3,2,2 --size 1,1,1 -o body.msh").done();
    let generate = "generate = { shape = \"box\", cells = [4, 3, 2], size = [2.0, 1.5, 1.0], element = \"tet4\" }";
    let text = loaded("tet4", 1).replace(generate, "file = \"body.msh\"").replace("[2.0, 1.5, 0.0]", "[1.0, 1.0, 0.0]");
    let write = |text: &str| write_case(folder, "case.toml", &with_scales(text, (2, 1)));
    write(&text);
    for ranks in ["1", "100001"] {
        let failed = line(folder, &format!("divide case.toml --ranks {ranks} --out divided"));
        assert!(failed.failed(2).contains("expected: 2 to 100000 ranks"), "{}", failed.stderr);
    }
    let failed = launched(folder, 3, "run case.toml --backend petsc --out out --divided case.toml").output().unwrap();
    assert!(String::from_utf8_lossy(&failed.stderr).contains("case.toml: is a file"));
    let run = "run case.toml --backend petsc --out out --divided divided";
    let refused = |expected: &str| {
        refused(folder, 3, run, expected);
        assert!(!folder.join("out").exists());
    };
    refused("divided/body.bin: cannot be read");
    line(folder, "divide case.toml --ranks 3 --out divided").done();
    refused("has 3 parts, and the body has 2 ranks");
    line(folder, "divide case.toml --ranks 2 --out divided").done();
    assert!(!folder.join("divided/part-00002.bin").exists());
    for (before, after, expected) in [
        ("pressure = 80.0", "pressure = 81.0", "was made for another case: the case differs in [[boundary]]"),
        ("count = 2", "count = 3", "the case differs in [steps]"),
        ("[newton]\n", "[newton]\nsolver = \"direct\"\n", "the case differs in [newton]"),
        (
            "[output]\n",
            "[output]\nrve = [1]\n",
            "the case differs in [output]: `rve = \"none\"` before, `rve = [1]` now",
        ),
    ] {
        write(&text.replace(before, after));
        refused(expected);
    }
    write(&text);
    let mesh = read(folder, "body.msh");
    std::fs::write(folder.join("body.msh"), format!("{mesh}\n")).unwrap();
    refused("was made with another content of body.msh");
    std::fs::write(folder.join("body.msh"), mesh).unwrap();
    // A part of another division, and a damaged one.
    write(&text.replace("bulk_modulus = 2e4", "bulk_modulus = 3e4").replace("200*x", "300*x"));
    line(folder, "divide case.toml --ranks 2 --out other").done();
    write(&text);
    let part = |of: &str| folder.join(of).join("part-00001.bin");
    std::fs::copy(part("divided"), folder.join("kept")).unwrap();
    std::fs::copy(part("other"), part("divided")).unwrap();
    refused("part-00001.bin: belongs to another division than body.bin");
    std::fs::copy(folder.join("kept"), part("divided")).unwrap();
    flip_a_bit(&part("divided"));
    refused("part-00001.bin: its ");
    std::fs::copy(folder.join("kept"), part("divided")).unwrap();
    // Settings may change, and a division that fails leaves the earlier one.
    write(&text.replace("tolerance = 1e-12", "tolerance = 1e-11").replace("points = true", "points = false"));
    let broken = text.replace("surface = \"z1\"", "surface = \"nothing\"");
    write_case(folder, "broken.toml", &broken);
    assert!(line(folder, "divide broken.toml --ranks 2 --out divided").failed(2).contains("nothing"));
    mpirun_done(folder, 3, run);
}

#[test]
fn other_files_are_not_replaced_by_a_division() {
    let _turn = one_at_a_time();
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    write_case(folder, "case.toml", &with_scales(&loaded("tet4", 1), (2, 1)));
    std::fs::create_dir(folder.join("mine")).unwrap();
    for name in ["part-00001.bin", "part-00002.bin"] {
        std::fs::write(folder.join("mine").join(name), "mine").unwrap();
    }
    // What an interrupted division leaves, and a folder.
    std::fs::write(folder.join("mine/.part-00001.bin.Ab3xYz.part"), b"BIOTISSU\x08\0\0\0rest").unwrap();
    std::fs::create_dir(folder.join("mine/part-00003.bin")).unwrap();
    let failed = line(folder, "divide case.toml --ranks 2 --out mine");
    assert!(failed.failed(2).contains("part-00001.bin: cannot be written: another file has this name"));
    assert_eq!(read(folder, "mine/part-00001.bin"), "mine");
    assert!(!folder.join("mine/part-00000.bin").exists());
    std::fs::remove_file(folder.join("mine/part-00001.bin")).unwrap();
    line(folder, "divide case.toml --ranks 2 --out mine").done();
    assert_eq!(read(folder, "mine/part-00002.bin"), "mine");
    assert!(!folder.join("mine/.part-00001.bin.Ab3xYz.part").exists() && folder.join("mine/part-00003.bin").is_dir());
    // Only PETSc divides a body, and only among several ranks.
    let expected = "--divided for a body that this run does not divide";
    for options in ["--backend sparse --ranks 3", "--backend petsc", ""] {
        if !options.contains("ranks") {
            write_case(folder, "case.toml", &loaded("tet4", 1));
        }
        let failed = line(folder, &format!("run case.toml {options} --out out --divided mine"));
        assert!(failed.failed(2).contains(expected), "{}", failed.stderr);
    }
    write_case(folder, "case.toml", &with_scales(&loaded("tet4", 1), (1, 2)));
    let failed = launched(folder, 3, "run case.toml --backend petsc --out out --divided mine").output().unwrap();
    let message = String::from_utf8_lossy(&failed.stderr);
    assert!(!failed.status.success());
    assert_eq!(message.matches(expected).count(), 1, "{message}");
    assert!(!folder.join("out").exists());
}
