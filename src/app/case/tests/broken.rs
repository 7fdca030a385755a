//! Invalid files and the exact messages they produce: every entry of `broken.txt`.
//!
//! An entry is a header `=== KIND: description`, the text, a line `---`, and all errors without the folder of the case.
//! `KIND` is where the text goes: it is the `whole` file, is appended to the smallest case (`more`), replaces the line
//! below `[mesh]` there (`mesh`), or replaces the entries of its material (`material`).

use super::{Folder, SMALL};

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

#[test]
fn every_broken_file_is_explained_word_by_word() {
    let folder = Folder::new();
    let mut found = String::new();
    for entry in ENTRIES.split("=== ").skip(1) {
        let (header, body) = entry.split_once('\n').unwrap();
        let (kind, _) = header.split_once(": ").unwrap();
        let (text, _) = body.split_once("---\n").unwrap();
        found += &format!("=== {header}\n{text}---\n{}\n", folder.errors(&whole_text(kind, text)));
    }
    let differs = found.lines().zip(ENTRIES.lines()).position(|(found, expected)| found != expected);
    assert!(found == ENTRIES, "the first difference is at line {:?} of\n{found}", differs.map(|line| line + 1));
}
