//! Invalid files and the exact messages they produce: every entry of `broken.txt`.
//!
//! An entry consists of a header `=== KIND: description`, a text, a line `---`, and all errors without the folder of
//! the case. `KIND` states where the text goes: it is the `whole` file, is appended to the smallest case (`more`),
//! replaces the line below `[mesh]` there (`mesh`), or replaces the entries of its material (`material`).

use super::{Folder, SMALL};

const FILE: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/src/app/case/tests/broken.txt");
const ENTRIES: &str = include_str!("broken.txt");
const SMALL_MESH: &str = "generate = { shape = \"dogbone\", element_size = 0.002 }";
const SMALL_MATERIAL: &str = "model = \"neo-hookean\", shear_modulus = 1.0e5, lame_lambda = 2.0e5";

/// The file that an entry describes.
fn whole_text(kind: &str, text: &str) -> String {
    match kind {
        "whole" => text.to_string(),
        "more" => format!("{SMALL}{text}"),
        "mesh" => SMALL.replace(SMALL_MESH, text.trim_end()),
        "material" => SMALL.replace(SMALL_MATERIAL, text.trim_end()),
        _ => panic!("an entry of the kind {kind:?}"),
    }
}

/// Lists the lines in which two texts differ, with their numbers in the first one, `start` for its first line.
fn differences(start: usize, expected: &str, found: &str) -> String {
    let (mut expected, mut found) = (expected.lines(), found.lines());
    let mut text = String::new();
    for line in start.. {
        match (expected.next(), found.next()) {
            (None, None) => break,
            (a, b) if a == b => {}
            (a, b) => {
                let [a, b] = [a, b].map(|line| line.unwrap_or("(no line)"));
                text += &format!("broken.txt:{line}\n  expected: {a}\n  found:    {b}\n");
            }
        }
    }
    text
}

#[test]
fn every_invalid_file_gives_the_recorded_errors() {
    let folder = Folder::new();
    let (mut all, mut different, mut line) = (String::new(), String::new(), 1);
    for entry in ENTRIES.split("=== ").skip(1) {
        let (header, body) = entry.split_once('\n').unwrap();
        let (kind, _) = header.split_once(": ").unwrap();
        let (text, _) = body.split_once("---\n").unwrap();
        let found = format!("{header}\n{text}---\n{}\n", folder.errors(&whole_text(kind, text)));
        different += &differences(line, entry, &found);
        line += entry.lines().count();
        all += &format!("=== {found}");
    }
    if std::env::var_os("BIOTISSUE_ACCEPT").is_some() {
        std::fs::write(FILE, all).unwrap();
        return;
    }
    assert!(different.is_empty(), "{different}to accept what was found, run this test with BIOTISSUE_ACCEPT=1");
}

#[test]
fn only_lines_that_differ_are_listed() {
    assert_eq!(differences(7, "a\nb\nc\n", "a\nb\nc\n"), "");
    let expected = "broken.txt:8\n  expected: b\n  found:    B\nbroken.txt:9\n  expected: (no line)\n  found:    c\n";
    assert_eq!(differences(7, "a\nb\n", "a\nB\nc\n"), expected);
}
