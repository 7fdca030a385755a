//! Error messages for files with invalid sections, nodes, elements and groups.

use super::super::{Version, WriteOptions, to_writer};
use super::{TEXT_2, TEXT_4, read, with};
use crate::fem::mesh::shapes::cuboid;

// Expected contents and cures.
const DAMAGED: &str = "the file is damaged or was changed by hand: export it again";
const NODE: &str = "a node: its number and its x, y and z";
const LINE_END: &str = "a new line";
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
const NOT_FINITE: &str = "find the cause in the program that wrote the mesh";
const ONCE: &str = "each node once";
const RENUMBER: &str = "renumber the mesh in Gmsh (Mesh, Renumber) or export it again";
const NODE_BLOCK: &str = "a block of nodes: dimension and tag of its entity, parametric flag (0 or 1), number of nodes";
const ADD_UP: &str = "blocks that add up to the number announced";
const KNOWN_NODES: &str = "nodes of this file";
const TYPES: &str =
    "tetrahedra and hexahedra of order 1 or 2, wedges of order 1, and their faces (points and lines are ignored)";
const LINEAR: &str = "export the mesh with element order 1 (in Gmsh: Mesh.ElementOrder = 1)";
const BODY: &str = "a body of tetrahedra, hexahedra or wedges";
const MESH_VOLUME: &str = "mesh the volume (in Gmsh: Mesh, 3D), put it in a physical group (Gmsh saves nothing else if there are any groups), and export again";
const ONE_GROUP_OR_NONE: &str = "every element in one physical volume group (or no such group at all)";
const ADD_TO_GROUP: &str = "add the volumes left out to a physical group (and export with Mesh.SaveAll = 0: version 2.2 loses the groups otherwise), or remove all physical volume groups and their names";
const ONE_GROUP: &str = "every element in one physical volume group";
const TAKE_OUT: &str = "remove its volume from one of the groups";
const COHERENCE: &str = "remove duplicate elements (in Gmsh: Coherence Mesh) and export again";

/// Checks the errors of files. Cases: a file => the position and description of its error, the expected content, the
/// cure.
macro_rules! check {
    ($($file:expr => $problem:literal, $expected:expr, $cure:expr;)*) => {
        $(assert_error($file, $problem, $expected, $cure);)*
    };
}

fn assert_error(bytes: Vec<u8>, problem: &str, expected: &str, cure: &str) {
    let error = read(&bytes).map(|_| ()).expect_err(problem);
    let message = format!("{problem}\n  expected: {expected}\n  cure: {cure}");
    assert_eq!(error.to_string(), message, "for the file\n{}", String::from_utf8_lossy(&bytes));
}

/// Returns the file of version 2.2 with a replaced piece.
fn two(old: &str, new: &str) -> Vec<u8> {
    with(TEXT_2, old, new).into()
}

/// Returns the file of version 4.1 with a replaced piece.
fn four(old: &str, new: &str) -> Vec<u8> {
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
fn invalid_headers_are_errors() {
    check! {
        Vec::new() => "a.msh: is empty", BEGIN, EXPORT;
        b" \n ".into() => "a.msh: is empty", BEGIN, EXPORT;
        b"solid cube\n".into() => "a.msh: begins with `solid`: it is not a Gmsh mesh file", BEGIN, EXPORT;
        vec![0x7f, 0xff, 0xfe, 0] => "a.msh: begins with `bytes that are not text`: it is not a Gmsh mesh file",
            BEGIN, EXPORT;
        b"$NOD\n1\n".into() => "a.msh: is a Gmsh file of version 1", BEGIN, EXPORT;
        two("2.2 0 8", "3.0 0 8") => "a.msh:2: Gmsh format 3.0 is not supported", VERSIONS, CONVERT;
        two("2.2 0 8", "4 0 8") => "a.msh:2: Gmsh format 4.0 is not supported", VERSIONS, CONVERT;
        two("2.2 0 8", "2.2 2 8") => "a.msh:2: the file type is 2",
            "0 for text or 1 for binary", "the file is damaged: export it again";
        two("2.2 0 8", "2.2 0 4") => "a.msh:2: the data size is 4", "8 bytes", "export the mesh again from Gmsh";
        two("2.2 0 8", "2.2 0") => "a.msh:2: the line ends too early",
            "the size of the file's numbers in bytes, 8", DAMAGED;
        two("2.2 0 8", "2.2 0 8 9") => "a.msh:2: `9` was found where the line should end", LINE_END, DAMAGED;
        two("$EndMeshFormat\n", "") => "a.msh:3: `$EndMeshFormat` is missing: `$PhysicalNames` was found instead",
            "`$EndMeshFormat`", DAMAGED;
    }
}

#[test]
fn missing_and_unclosed_sections_are_errors() {
    check! {
        without(TEXT_2, "Nodes") => "a.msh: $Nodes is missing", SECTIONS, DAMAGED;
        without(TEXT_4, "Elements") => "a.msh: $Elements is missing", SECTIONS, DAMAGED;
        two("$EndNodes\n", "") => "a.msh:15: `$EndNodes` is missing: `$Elements` was found instead",
            "`$EndNodes`", DAMAGED;
        two("$EndElements\n", "") => "a.msh:20: `$EndElements` is missing: the file ends", "`$EndElements`", DAMAGED;
        two("$EndElements\n", "$EndElements\n$Nodes\n0\n$EndNodes\n") => "a.msh:21: a second $Nodes",
            "one $Nodes in a file", "the file contains several meshes or is damaged: export one mesh per file";
        two("$EndElements\n", "$EndElements\n$Periodic\n0\n") =>
            "a.msh:21: the section `$Periodic` is not closed: no line `$EndPeriodic` follows",
            "`$EndPeriodic`", CUT_OFF;
        two("$EndElements\n", "$EndElements\n$\n") => "a.msh:21: a `$` without the name of a section", OPENING, DAMAGED;
        two("$EndElements\n", "$EndElements\n$EndElements\n") =>
            "a.msh:21: `$EndElements` closes a section that is not open", OPENING, DAMAGED;
        four("$Entities\n", "$PartitionedEntities\n2\n") => "a.msh:9: the mesh is partitioned",
            "a mesh in one piece",
            "undo the partition in Gmsh (Unpartition) and export it again; elements are distributed when a run starts";
    }
}

#[test]
fn invalid_physical_names_are_errors() {
    check! {
        two("\"tissue\"", "tissue") => "a.msh:7: the name of physical group 1 is `tissue`: not between double quotes",
            NAME, QUOTE;
        two("\"tissue\"", "\"tissue") =>
            "a.msh:7: the name of physical group 1 is `\"tissue`: not between double quotes", NAME, QUOTE;
        two("\"tissue\"", "\"\"") => "a.msh:7: physical group 1 is called ``",
            "a name of printable characters without quotes", "rename the physical group and export the mesh again";
        two("3 1 \"tissue\"", "2 1 \"tissue\"") =>
            "a.msh:7: physical group 1 of dimension 2 is called both `base` and `tissue`",
            "one name per group", "remove one of the two lines";
        two("Names\n2\n", "Names\n3\n") => "a.msh:8: $PhysicalNames ends after 2 of 3 physical names", NAME, DAMAGED;
    }
}

#[test]
fn damaged_binary_files_are_errors() {
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
    check! {
        cut(Version::V2_2, b"$Nodes", 100) => "a.msh: at byte 237: the file ends within $Nodes after 3 of 8 nodes",
            NODE, CUT_OFF;
        cut(Version::V4_1, b"$Elements", 200) =>
            "a.msh: at byte 1220: the file ends within $Elements after 3 of 18 elements",
            "the three nodes of a triangle", CUT_OFF;
        order => "a.msh: the number that indicates the byte order is 1793, not 1",
            "the number 1 in four bytes, in either byte order",
            "the file is damaged, perhaps copied as text: export it again";
        huge => "a.msh: at byte 1839: the file ends within $Nodes after 0 of 8 nodes", "the tag of a node", CUT_OFF;
    }
}

#[test]
fn invalid_nodes_are_errors() {
    check! {
        two("$Nodes\n4\n", "$Nodes\n5\n") => "a.msh:15: $Nodes ends after 4 of 5 nodes", NODE, DAMAGED;
        two("$Nodes\n4\n", "$Nodes\n3\n") => "a.msh:14: `4` follows the 3 nodes announced", "`$EndNodes`", DAMAGED;
        two("$Nodes\n4\n", "$Nodes\n1000000000000000000\n") =>
            "a.msh:15: $Nodes ends after 4 of 1000000000000000000 nodes", NODE, DAMAGED;
        two("$Nodes\n4\n", "$Nodes\n-4\n") => "a.msh:10: `-4` is not a nonnegative whole number",
            "the number of nodes", DAMAGED;
        two("2 1 0 0\n", "2 1 O 0\n") => "a.msh:12: `O` is not a number", NODE, DAMAGED;
        two("2 1 0 0\n", "2 1 NaN 0\n") => "a.msh:12: NaN is not finite", NODE, NOT_FINITE;
        two("2 1 0 0\n", "2 1 -1e999 0\n") => "a.msh:12: -inf is not finite", NODE, NOT_FINITE;
        two("2 1 0 0\n", "2 1 0\n") => "a.msh:12: the line ends too early", NODE, DAMAGED;
        two("2 1 0 0\n", "2 1 0 0 0\n") => "a.msh:12: `0` was found where the line should end", LINE_END, DAMAGED;
        two("2 1 0 0\n", "-2 1 0 0\n") => "a.msh:12: -2 is negative", NODE, DAMAGED;
        two("2 1 0 0\n", "1 1 0 0\n") => "a.msh:12: node 1 is defined a second time", ONCE, RENUMBER;
        four("10\n20\n", "10\n10\n") => "a.msh:18: node 10 is defined a second time", ONCE, RENUMBER;
        four("2 4 10 90000", "2 5 10 90000") => "a.msh:25: the blocks contain 4 nodes, but 5 are announced",
            ADD_UP, DAMAGED;
        four("2 4 10 90000", "3 4 10 90000") => "a.msh:26: $Nodes ends after 4 of 4 nodes", NODE_BLOCK, DAMAGED;
        four("3 6 0 1\n", "3 6 2 1\n") => "a.msh:23: a block of dimension 3 whose parametric flag is 2",
            NODE_BLOCK, DAMAGED;
        four("3 6 0 1\n", "3 6 0 2\n") => "a.msh:25: the line ends too early",
            "x, y and z of a node, and its parameters on the entity in a parametric block", DAMAGED;
    }
}

#[test]
fn invalid_elements_are_errors() {
    check! {
        two("1 2 3 4\n", "1 2 3 9\n") => "a.msh:19: tetrahedron 2 refers to node 9, which is not in $Nodes",
            KNOWN_NODES, DAMAGED;
        four("10 20 30 90000\n", "10 20 30 90001\n") =>
            "a.msh:32: tetrahedron 2 refers to node 90001, which is not in $Nodes", KNOWN_NODES, DAMAGED;
        two("1 2 3 4\n", "1 2 3 3\n") => "a.msh:19: tetrahedron 2 has node 3 twice",
            "different nodes", "remove the collapsed element or mesh again";
        two("4 0 0 1\n", "4 0.3 0.3 0\n") =>
            "a.msh:19: tetrahedron 2 is flat: its volume is 0e0, its longest edge 1.4142135623730951e0",
            "tetrahedra with a volume", "improve the mesh (in Gmsh: Optimize 3D) or mesh again";
        two("1 2 3 4\n", "1 2 3\n") => "a.msh:19: the line ends too early", "the four nodes of a tetrahedron", DAMAGED;
        two("1 2 3 4\n", "1 2 3 4 1\n") => "a.msh:19: `1` was found where the line should end", LINE_END, DAMAGED;
        two("2 4 2 1 1 1 2 3 4\n", "2 13 2 1 1 1 2 3 4 5 6 7 8 9 10\n") =>
            "a.msh:19: the mesh has 18-node prisms (order 2, element type 13)", TYPES, LINEAR;
        two("2 4 2 1 1 1 2 3 4\n", "2 29 2 1 1 1 2 3 4 5 6 7 8\n") =>
            "a.msh:19: the mesh has 20-node tetrahedra (order 3, element type 29)", TYPES,
            "export the mesh with element order 1 or 2 (in Gmsh: Mesh.ElementOrder = 2)";
        two("2 4 2 1 1 1 2 3 4\n", "2 7 2 1 1 1 2 3 4 5\n") =>
            "a.msh:19: the mesh has 5-node pyramids (order 1, element type 7)", TYPES,
            "mesh the body without pyramids: with tetrahedra only, or with hexahedra and wedges only";
        two("2 4 2 1 1 1 2 3 4\n", "2 5 2 1 1 1 2 3 4\n") => "a.msh:19: the line ends too early",
            "the eight nodes of a hexahedron", DAMAGED;
        two("2 4 2 1 1 1 2 3 4\n", "2 11 2 1 1 1 2 3 4 5 6 7 8 9 10\n") =>
            "a.msh:19: tetrahedron 2 refers to node 5, which is not in $Nodes", KNOWN_NODES, DAMAGED;
        two("2 4 2 1 1 1 2 3 4\n", "2 99 2 1 1 1 2 3 4\n") => "a.msh:19: the mesh has elements of type 99",
            TYPES, "the file is damaged or of a newer version: export it again from Gmsh";
        four("3 6 4 1\n", "3 6 18 1\n") => "a.msh:31: the mesh has 15-node prisms (order 2, element type 18)",
            TYPES, LINEAR;
        four("3 6 4 1\n", "2 6 4 1\n") => "a.msh:31: a block of tetrahedra lies on an entity of dimension 2",
            "dimension 3", DAMAGED;
        four("2 2 1 2\n", "2 3 1 2\n") => "a.msh:32: the blocks contain 2 elements, but 3 are announced",
            ADD_UP, DAMAGED;
        two("$Elements\n2\n", "$Elements\n3\n") => "a.msh:20: $Elements ends after 2 of 3 elements",
            "an element: its number, its type, its number of tags, its tags, its nodes", DAMAGED;
    }
}

#[test]
fn invalid_bodies_and_groups_are_errors() {
    check! {
        two("\n2 4 2 1 1 1 2 3 4\n", "\n2 2 2 1 1 1 2 4\n") => "a.msh: the mesh has no elements with a volume, only 2 faces",
            BODY, MESH_VOLUME;
        with(&with(TEXT_4, "2 2 1 2\n", "0 0 0 0\n$EndElements\n$Rest\n"), "30 90000\n$EndElements\n", "30 90000\n$EndRest\n")
            .into() =>
            "a.msh: the mesh has no elements with a volume", BODY, MESH_VOLUME;
        two("2 4 2 1 1 1", "2 4 2 0 1 1") => "a.msh: 1 of 1 tetrahedra are in no physical volume group",
            ONE_GROUP_OR_NONE, ADD_TO_GROUP;
        four("6 0 0 0 1 1 1 1 1 1 5", "6 0 0 0 1 1 1 0 1 5") =>
            "a.msh: 1 of 1 tetrahedra are in no physical volume group", ONE_GROUP_OR_NONE, ADD_TO_GROUP;
        four("6 0 0 0 1 1 1 1 1 1 5", "6 0 0 0 1 1 1 2 1 4 1 5") =>
            "a.msh:32: tetrahedron 2 is in two physical volume groups, `tissue` and `4`", ONE_GROUP, TAKE_OUT;
        two("$Elements\n2\n", "$Elements\n3\n3 4 2 4 1 2 1 3 4\n") =>
            "a.msh:20: tetrahedron 2 is in two physical volume groups, `4` and `tissue`", ONE_GROUP, TAKE_OUT;
        two("$Elements\n2\n", "$Elements\n3\n3 4 2 1 1 2 1 3 4\n") => "a.msh:20: tetrahedra 3 and 2 are the same",
            "each element once", COHERENCE;
        two("$Elements\n2\n", "$Elements\n3\n3 2 2 1 1 2 1 3\n") =>
            "a.msh:19: triangles 3 and 1 of surface `base` are the same", "each face of a surface once", COHERENCE;
        with(&with(TEXT_2, "$Nodes\n4\n", "$Nodes\n5\n5 1 1 1\n"), "$Elements\n2\n", "$Elements\n3\n3 4 2 1 1 1 2 3 5\n")
            .into() =>
            "a.msh:21: tetrahedra 3 and 2 overlap: they lie on the same side of a face they share",
            "a body that does not overlap itself",
            "check the mesh for inverted and overlapping elements and mesh again";
        with(&with(TEXT_2, "$Nodes\n4\n", "$Nodes\n5\n5 1 1 1\n"), "$Elements\n2\n", "$Elements\n3\n3 2 2 1 1 1 2 5\n")
            .into() =>
            "a.msh:19: triangle 3 of surface `base` is not a face of any element",
            "surfaces that bound the body or lie in it",
            "remove the surface from the physical group, or export also the volume that it belongs to";
        four("$Entities\n0 0 1 1\n", "$Entities\n0 0 2 1\n5 0 0 0 1 1 0 1 1 0\n") =>
            "a.msh:12: a second entity 5 of dimension 2", "each entity once", DAMAGED;
    }
}
