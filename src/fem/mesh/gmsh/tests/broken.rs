//! Error messages for files with invalid sections.

use super::super::{Version, WriteOptions, to_writer};
use super::{TEXT_2, TEXT_4, read, with};
use crate::fem::mesh::shapes::cuboid;

// Expected contents and hints.
pub(super) const DAMAGED: &str = "the file is damaged or was changed by hand: export it again";
pub(super) const NODE: &str = "a node: its number and its x, y and z";
pub(super) const LINE_END: &str = "a new line";
const CUT_OFF: &str = "the file was cut off: export or copy it again";
const BEGIN: &str = "a Gmsh mesh file: its first line is `$MeshFormat`";
const EXPORT: &str = "export the mesh as Gmsh `.msh`, version 4.1 or 2.2";
const VERSIONS: &str = "version 4.1 or 2.2";
const CONVERT: &str =
    "open the file in Gmsh and export it as version 4.1 (`gmsh old.msh -save -format msh41 -o new.msh`)";
const SECTIONS: &str = "a file with $Nodes and $Elements";
const OPENING: &str = "a line that opens a section, such as `$Nodes`";
const NAME: &str = "a dimension, a number and a name between double quotes, as in `3 1 \"gauge\"`";
const QUOTE: &str = "put the name between double quotes";

/// A file; the position and description of its error, the expected content, and the hint.
pub(super) type Case = (Vec<u8>, &'static str, &'static str, &'static str);

pub(super) fn said(cases: Vec<Case>) {
    for (bytes, problem, expected, hint) in cases {
        let error = read(&bytes).map(|_| ()).expect_err(problem);
        let said = format!("{problem}\n  expected: {expected}\n  cure: {hint}");
        assert_eq!(error.to_string(), said, "of the file\n{}", String::from_utf8_lossy(&bytes));
    }
}

pub(super) fn two(old: &str, new: &str) -> Vec<u8> {
    with(TEXT_2, old, new).into()
}

pub(super) fn four(old: &str, new: &str) -> Vec<u8> {
    with(TEXT_4, old, new).into()
}

fn without(text: &str, section: &str) -> Vec<u8> {
    let end = format!("$End{section}\n");
    let (start, stop) = (text.find(&format!("${section}")).unwrap(), text.find(&end).unwrap() + end.len());
    [&text[..start], &text[stop..]].concat().into()
}

fn binary(version: Version) -> Vec<u8> {
    let mut bytes = Vec::new();
    to_writer(&mut bytes, &cuboid([1, 1, 1], [1.0; 3]).unwrap(), WriteOptions { version, binary: true }).unwrap();
    bytes
}

fn find(bytes: &[u8], piece: &[u8]) -> usize {
    bytes.windows(piece.len()).position(|window| window == piece).unwrap()
}

#[test]
fn files_that_do_not_begin_as_they_should() {
    said(vec![
        (Vec::new(), "a.msh: is empty", BEGIN, EXPORT),
        (b" \n ".into(), "a.msh: is empty", BEGIN, EXPORT),
        (b"solid cube\n".into(), "a.msh: begins with `solid`: it is no Gmsh mesh file", BEGIN, EXPORT),
        (
            vec![0x7f, 0xff, 0xfe, 0],
            "a.msh: begins with `bytes that are no text`: it is no Gmsh mesh file",
            BEGIN,
            EXPORT,
        ),
        (b"$NOD\n1\n".into(), "a.msh: is a Gmsh file of version 1", BEGIN, EXPORT),
        (two("2.2 0 8", "3.0 0 8"), "a.msh:2: Gmsh format 3.0 is not supported", VERSIONS, CONVERT),
        (two("2.2 0 8", "4 0 8"), "a.msh:2: Gmsh format 4.0 is not supported", VERSIONS, CONVERT),
        (
            two("2.2 0 8", "2.2 2 8"),
            "a.msh:2: the file type is 2",
            "0 for text or 1 for binary",
            "the file is damaged: export it again",
        ),
        (two("2.2 0 8", "2.2 0 4"), "a.msh:2: the data size is 4", "8 bytes", "export the mesh again from Gmsh"),
        (
            two("2.2 0 8", "2.2 0"),
            "a.msh:2: the line ends too early",
            "the size of the file's numbers in bytes, 8",
            DAMAGED,
        ),
        (two("2.2 0 8", "2.2 0 8 9"), "a.msh:2: `9` was found where the line should end", LINE_END, DAMAGED),
        (
            two("$EndMeshFormat\n", ""),
            "a.msh:3: `$EndMeshFormat` is missing: `$PhysicalNames` was found instead",
            "`$EndMeshFormat`",
            DAMAGED,
        ),
    ]);
}

#[test]
fn sections_that_are_missing_or_do_not_end() {
    said(vec![
        (without(TEXT_2, "Nodes"), "a.msh: $Nodes is missing", SECTIONS, DAMAGED),
        (without(TEXT_4, "Elements"), "a.msh: $Elements is missing", SECTIONS, DAMAGED),
        (
            two("$EndNodes\n", ""),
            "a.msh:15: `$EndNodes` is missing: `$Elements` was found instead",
            "`$EndNodes`",
            DAMAGED,
        ),
        (two("$EndElements\n", ""), "a.msh:20: `$EndElements` is missing: the file ends", "`$EndElements`", DAMAGED),
        (
            two("$EndElements\n", "$EndElements\n$Nodes\n0\n$EndNodes\n"),
            "a.msh:21: a second $Nodes",
            "one $Nodes in a file",
            "the file holds several meshes or is damaged: export one mesh a file",
        ),
        (
            two("$EndElements\n", "$EndElements\n$Periodic\n0\n"),
            "a.msh:21: the section `$Periodic` is not closed: no line `$EndPeriodic` follows",
            "`$EndPeriodic`",
            CUT_OFF,
        ),
        (two("$EndElements\n", "$EndElements\n$\n"), "a.msh:21: a `$` without the name of a section", OPENING, DAMAGED),
        (
            two("$EndElements\n", "$EndElements\n$EndElements\n"),
            "a.msh:21: `$EndElements` closes a section that is not open",
            OPENING,
            DAMAGED,
        ),
        (
            four("$Entities\n", "$PartitionedEntities\n2\n"),
            "a.msh:9: the mesh is partitioned",
            "a mesh in one piece",
            "undo the partition in Gmsh (Unpartition) and export it again; ranks are given elements when a run starts",
        ),
    ]);
}

#[test]
fn physical_names_that_are_wrong() {
    said(vec![
        (
            two("\"tissue\"", "tissue"),
            "a.msh:7: the name of physical group 1 is `tissue`: not between double quotes",
            NAME,
            QUOTE,
        ),
        (
            two("\"tissue\"", "\"tissue"),
            "a.msh:7: the name of physical group 1 is `\"tissue`: not between double quotes",
            NAME,
            QUOTE,
        ),
        (
            two("\"tissue\"", "\"\""),
            "a.msh:7: physical group 1 is called ``",
            "a name of printable characters without quotes",
            "rename the physical group and export the mesh again",
        ),
        (
            two("3 1 \"tissue\"", "2 1 \"tissue\""),
            "a.msh:7: physical group 1 of dimension 2 is called both `base` and `tissue`",
            "one name a group",
            "remove one of the two lines",
        ),
        (two("Names\n2\n", "Names\n3\n"), "a.msh:8: $PhysicalNames ends after 2 of 3 physical names", NAME, DAMAGED),
    ]);
}

#[test]
fn binary_files_that_are_damaged() {
    let cut = |version: Version, section: &[u8], behind: usize| {
        let bytes = binary(version);
        let end = find(&bytes, section) + behind;
        bytes[..end].to_vec()
    };
    let changed = |piece: &[u8], behind: usize, byte: u8| {
        let mut bytes = binary(Version::V4_1);
        let at = find(&bytes, piece) + piece.len() + behind;
        bytes[at] = byte;
        bytes
    };
    // The second byte of the integer that encodes the byte order; the sixth byte of the node count of the first block.
    let (order, huge) = (changed(b"4.1 1 8\n", 1, 7), changed(b"$Nodes\n", 32 + 12 + 6, 1));
    said(vec![
        (
            cut(Version::V2_2, b"$Nodes", 100),
            "a.msh: at byte 237: the file ends within $Nodes after 3 of 8 nodes",
            NODE,
            CUT_OFF,
        ),
        (
            cut(Version::V4_1, b"$Elements", 200),
            "a.msh: at byte 1220: the file ends within $Elements after 3 of 18 elements",
            "the three nodes of a triangle",
            CUT_OFF,
        ),
        (
            order,
            "a.msh: the number that tells the byte order is 1793, not 1",
            "the number 1 in four bytes, in either byte order",
            "the file is damaged, perhaps copied as text: export it again",
        ),
        (huge, "a.msh: at byte 1839: the file ends within $Nodes after 0 of 8 nodes", "the tag of a node", CUT_OFF),
    ]);
}
