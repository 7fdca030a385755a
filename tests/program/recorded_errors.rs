//! Input that does not match its mesh or its files, and the exact messages that it produces: every entry of
//! `recorded_errors.txt`.
//!
//! An entry consists of a header `=== BASE: description`, changes of the base, a line `---`, and the whole output on
//! stderr of `biotissue check`, with `FOLDER` for its folder. A change is a line `FROM => TO`, in which `\n` is a line break. A line `+++ FILE` begins
//! the text of another file. The base `command` is not a case: its one line has the arguments of the program.

use std::path::Path;

use biotissue::fem::element::ElementType;
use biotissue::fem::mesh::{gmsh, shapes};

use crate::fields::{BAR, CELLS};
use crate::hollow_box::hollow_box;
use crate::line;

const FILE: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/program/recorded_errors.txt");
const ENTRIES: &str = include_str!("recorded_errors.txt");

/// The material of the bar.
const MATERIAL: &str = "model = \"neo-hookean\", youngs_modulus = 1.0e3, poisson_ratio = 0.3";

/// A box with a cavity, whose side x1 is pulled.
const HOLLOW: &str = r#"[mesh]
file = "hollow.msh"
[[region]]
name = "*"
material = { model = "neo-hookean", youngs_modulus = 1.0e3, poisson_ratio = 0.3 }
[[boundary]]
surface = "x0"
displacement = { x = 0.0, y = 0.0, z = 0.0 }
[[boundary]]
surface = "x1"
displacement = { x = 1.5, y = 0.8 }
[[constraint]]
cavity = ["floor", "walls"]
name = "lumen"
volume = [[0.0, 1.0], [1.0, 0.9]]
[[constraint]]
region = "body"
volume = "constant"
"#;

fn write(folder: &Path, name: &str, text: &str) {
    std::fs::write(folder.join(name), text).unwrap();
}

/// Returns what the program says of an entry, as it is recorded.
fn messages(folder: &Path, base: &str, changes: &str) -> String {
    if base == "command" {
        return line(folder, changes.trim_end()).stderr;
    }
    let bar = || BAR.trim_start().replace("CELLS", "2").replace("MATERIAL", MATERIAL);
    let mut case = if base == "hollow" { HOLLOW.to_owned() } else { bar() };
    let mut parts = changes.split("+++ ");
    for change in parts.next().unwrap_or_default().lines() {
        let (from, to) = change.split_once(" => ").unwrap_or_else(|| panic!("a change: {change}"));
        assert!(case.contains(from), "{from} is in the base");
        case = case.replace(from, &to.replace("\\n", "\n"));
    }
    for file in parts {
        let (name, text) = file.split_once('\n').unwrap();
        write(folder, name, text);
    }
    write(folder, "case.toml", &case);
    line(folder, "check case.toml").stderr
}

#[test]
fn input_that_does_not_match_its_files_gives_the_recorded_errors() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    gmsh::write(&folder.join("hollow.msh"), &hollow_box(ElementType::Hex8)).unwrap();
    for element_type in [ElementType::Wedge6, ElementType::Tet10] {
        let mesh = shapes::cuboid_of(element_type, [2, 1, 1], [1.0, 0.5, 0.5]).unwrap();
        gmsh::write(&folder.join(format!("{}.msh", element_type.name())), &mesh).unwrap();
    }
    write(folder, "cells.vtu", CELLS);
    let mut all = String::new();
    for entry in ENTRIES.split("=== ").skip(1) {
        let (header, body) = entry.split_once('\n').unwrap();
        let (base, _) = header.split_once(": ").unwrap();
        let (changes, _) = body.split_once("---\n").unwrap();
        let found = messages(folder, base, changes).replace(folder.to_str().unwrap(), "FOLDER");
        all += &format!("=== {header}\n{changes}---\n{found}");
    }
    if std::env::var_os("BIOTISSUE_ACCEPT").is_some() {
        std::fs::write(FILE, all).unwrap();
        return;
    }
    for (number, (expected, found)) in ENTRIES.lines().zip(all.lines()).enumerate() {
        assert_eq!(found, expected, "line {}; to accept what was found, set BIOTISSUE_ACCEPT=1", number + 1);
    }
    assert_eq!(all.lines().count(), ENTRIES.lines().count());
}
