//! Optional features of mesh files.

use crate::fem::mesh::{Elements, Faces};

use super::{TEXT_2, TEXT_4, read, with};

fn warnings(text: &str) -> Vec<String> {
    read(text).unwrap().warnings
}

#[test]
fn both_versions_of_a_file_give_the_same_mesh() {
    let (two, four) = (read(TEXT_2).unwrap(), read(TEXT_4).unwrap());
    assert_eq!(two, four);
    assert_eq!(two.warnings, [""; 0]);
    assert_eq!(two.mesh.regions(), ["tissue"]);
    // The triangle is reversed, because the normal of 1 2 3 in the file points into the body.
    assert_eq!(two.mesh.surface("base").unwrap().faces, Faces::from(vec![[0, 2, 1]]));
    assert_eq!(two.mesh.volume(), 1.0 / 6.0);
}

#[test]
fn a_file_without_volume_groups_is_one_body() {
    let text = with(TEXT_2, "2\n2 1 \"base\"\n3 1 \"tissue\"\n", "0\n");
    let text = with(&text, "2 4 2 1 1 ", "2 4 2 0 1 ");
    let mesh = read(text).unwrap().mesh;
    assert_eq!(mesh.regions(), ["body"]);
    assert_eq!(mesh.surface_names().collect::<Vec<_>>(), ["1"]);
    let start = TEXT_4.find("$Physical").unwrap();
    let end = TEXT_4.find("$Nodes").unwrap();
    let mesh = read([&TEXT_4[..start], &TEXT_4[end..]].concat()).unwrap().mesh;
    assert_eq!(mesh.regions(), ["body"]);
    assert!(mesh.surfaces().is_empty());
}

#[test]
fn inverted_elements_are_reversed_with_a_warning() {
    let file = read(with(TEXT_2, "1 2 3 4\n", "1 2 4 3\n")).unwrap();
    assert_eq!(file.warnings, ["1 tetrahedra had a negative volume and have been reversed"]);
    assert_eq!(file.mesh.elements(), &Elements::from(vec![[0, 1, 2, 3]]));
}

#[test]
fn nodes_without_elements_are_left_out_with_a_warning() {
    let text = with(TEXT_2, "$Nodes\n4\n1 0 0 0\n", "$Nodes\n6\n11 7 7 7\n1 0 0 0\n12 8 8 8\n");
    let file = read(text).unwrap();
    assert_eq!(file.warnings, ["2 nodes belong to no element and are left out"]);
    assert_eq!(file.mesh, read(TEXT_2).unwrap().mesh);
}

#[test]
fn coincident_nodes_cause_a_warning() {
    let text = with(TEXT_2, "$Nodes\n4\n", "$Nodes\n8\n5 0 0 0\n6 1 0 0\n7 -0.0 1 0\n8 0 0 -1\n");
    let text = with(&text, "$Elements\n2\n", "$Elements\n3\n3 4 2 1 1 5 6 7 8\n");
    let found = warnings(&text);
    assert_eq!(
        found[1..],
        ["3 nodes have exactly the position of another node: parts of the body may not be connected there"]
    );
}

#[test]
fn empty_groups_are_left_out_with_a_warning() {
    let text = with(TEXT_2, "Names\n2\n", "Names\n5\n0 1 \"point\"\n2 9 \"skin\"\n3 9 \"bone\"\n");
    assert_eq!(
        warnings(&text),
        [
            "the physical surface `skin` has no elements and is left out",
            "the physical volume `bone` has no elements and is left out"
        ]
    );
}

#[test]
fn an_entity_may_be_in_several_groups_with_negative_numbers_and_equal_names() {
    let text = with(TEXT_4, "1 1 0 1 1 0\n", "1 1 0 4 -1 8 1 9 0\n");
    let text = with(&text, "Names\n2\n", "Names\n3\n2 9 \"base\"\n");
    let mesh = read(text).unwrap().mesh;
    assert_eq!(mesh.surface_names().collect::<Vec<_>>(), ["base", "8"]);
    assert!(mesh.surfaces().iter().all(|surface| surface.faces == Faces::from(vec![[0, 2, 1]])));
}

#[test]
fn regions_and_surfaces_are_ordered_by_their_numbers() {
    let text = with(TEXT_2, "$Nodes\n4\n", "$Nodes\n5\n5 0 0 -1\n");
    let text = with(&text, "$Elements\n2\n", "$Elements\n4\n7 4 2 5 1 1 3 2 5\n8 2 2 3 9 1 2 4\n");
    let mesh = read(text).unwrap().mesh;
    assert_eq!(mesh.regions(), ["tissue", "5"]);
    assert_eq!(mesh.region_of(), [1, 0]);
    assert_eq!(mesh.surface_names().collect::<Vec<_>>(), ["base", "3"]);
    // A triangle between two tetrahedra keeps its orientation.
    assert_eq!(mesh.surface("base").unwrap().faces, Faces::from(vec![[1, 2, 3]]));
}

#[test]
fn other_sections_points_lines_and_blank_lines_are_ignored() {
    let text = with(TEXT_2, "$Nodes\n", "$Comments\nanything $Nodes\n$EndComments\n\n$Empty\n$EndEmpty\n$Nodes\n\n");
    let text = with(&text, "$Elements\n2\n", "$Elements\n4\n91 15 2 0 1 1\n92 1 3 4 1 7 1 2\n\n");
    assert_eq!(read(&text).unwrap(), read(TEXT_2).unwrap());
    assert_eq!(read(text.replace('\n', "\r\n")).unwrap(), read(TEXT_2).unwrap());
    let text = with(TEXT_2, "$Nodes\n", "made by hand\n$Nodes\n");
    assert_eq!(warnings(&text), ["line 9, `made by hand`, is outside all sections and is ignored"]);
}

#[test]
fn parameters_of_nodes_are_ignored() {
    let text = with(TEXT_4, "2 5 0 3\n", "2 5 1 3\n");
    let text = with(&text, "30\n0 0 0\n1 0 0\n0 1 0\n", "30\n0 0 0 9 9\n1 0 0 -1 nan\n0 1 0 2 2\n");
    assert_eq!(read(text).unwrap(), read(TEXT_4).unwrap());
}

/// Builds a binary file in either byte order.
struct Bytes {
    bytes: Vec<u8>,
    /// True if the file is big-endian.
    big: bool,
    /// True if counts and tags have eight bytes, false if four.
    wide: bool,
}

impl Bytes {
    fn int(&mut self, values: &[i32]) {
        for value in values {
            self.bytes.extend(if self.big { value.to_be_bytes() } else { value.to_le_bytes() });
        }
    }

    fn size(&mut self, values: &[u32]) {
        for &value in values {
            match self.wide {
                true => self.bytes.extend(if self.big {
                    u64::from(value).to_be_bytes()
                } else {
                    u64::from(value).to_le_bytes()
                }),
                false => self.int(&[value as i32]),
            }
        }
    }

    fn number(&mut self, values: &[f64]) {
        for value in values {
            self.bytes.extend(if self.big { value.to_be_bytes() } else { value.to_le_bytes() });
        }
    }

    fn text(&mut self, text: &str) {
        self.bytes.extend(text.bytes());
    }
}

const CORNERS: [[f64; 3]; 4] = [[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];

fn names(out: &mut Bytes) {
    out.text("\n$EndMeshFormat\n$PhysicalNames\n2\n2 1 \"base\"\n3 1 \"tissue\"\n$EndPhysicalNames\n");
}

#[test]
fn binary_files_of_either_byte_order() {
    for big in [false, true] {
        let mut out = Bytes { bytes: b"$MeshFormat\n2.2 1 8\n".into(), big, wide: false };
        out.int(&[1]);
        names(&mut out);
        out.text("$Nodes\n4\n");
        for (tag, corner) in (1..).zip(CORNERS) {
            out.int(&[tag]);
            out.number(&corner);
        }
        out.text("\n$EndNodes\n$Elements\n3\n");
        out.int(&[15, 1, 0, 90, 1]);
        out.int(&[2, 1, 2, 1, 1, 1, 1, 2, 3]);
        out.int(&[4, 1, 3, 2, 1, 1, 17, 1, 2, 3, 4]);
        out.text("\n$EndElements\n");
        assert_eq!(read(&out.bytes), read(TEXT_2), "most significant byte first: {big}");
    }
}

#[test]
fn binary_files_of_either_byte_order_and_size() {
    for (big, wide) in [(false, false), (false, true), (true, false), (true, true)] {
        let width = if wide { 8 } else { 4 };
        let mut out = Bytes { bytes: format!("$MeshFormat\n4.1 1 {width}\n").into(), big, wide };
        out.int(&[1]);
        names(&mut out);
        out.text("$Entities\n");
        out.size(&[1, 0, 1, 1]);
        for (tag, dimension) in [(8, 0), (5, 2), (6, 3)] {
            out.int(&[tag]);
            out.number(&vec![0.5; if dimension == 0 { 3 } else { 6 }]);
            if dimension == 0 {
                out.size(&[0]);
            } else {
                out.size(&[1]);
                out.int(&[-1]);
                out.size(&[2]);
                out.int(&[4, -9]);
            }
        }
        out.text("\n$EndEntities\n$Nodes\n");
        out.size(&[1, 4, 1, 4]);
        out.int(&[2, 5, 1]);
        out.size(&[4, 1, 2, 3, 4]);
        for corner in CORNERS {
            out.number(&corner);
            out.number(&[7.0, f64::NAN]);
        }
        out.text("\n$EndNodes\n$Unknown\nbytes \0 of $ any kind\n$EndUnknown\n$Elements\n");
        out.size(&[2, 2, 1, 2]);
        out.int(&[2, 5, 2]);
        out.size(&[1, 1, 1, 2, 3]);
        out.int(&[3, 6, 4]);
        out.size(&[1, 2, 1, 2, 3, 4]);
        out.text("\n$EndElements\n");
        assert_eq!(read(&out.bytes), read(TEXT_2), "most significant byte first: {big}, eight bytes: {wide}");
    }
}
