//! Element types of the Gmsh format: their numbers and the order of their nodes.

use crate::fem::element::{CellType, ElementType, FaceType};

/// The treatment of an element type.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum ElementTreatment {
    /// Points and lines, with this number of nodes: skipped.
    Ignored(usize),
    Face(FaceType),
    Volume(ElementType),
}

/// Returns the treatment of an element type number.
///
/// # Errors
/// Returns the name and a cure if the type is not supported.
pub(super) fn treatment(number: i32) -> Result<ElementTreatment, (String, &'static str)> {
    let face = FACES.iter().find(|(_, of)| *of == number).map(|&(face, _)| ElementTreatment::Face(face));
    let volume = VOLUMES.iter().find(|(_, of)| *of == number).map(|&(volume, _)| ElementTreatment::Volume(volume));
    let line = match number {
        15 => Some(1),
        1 => Some(2),
        8 => Some(3),
        _ => None,
    };
    face.or(volume).or(line.map(ElementTreatment::Ignored)).ok_or_else(|| unsupported(number))
}

const FACES: [(FaceType, i32); 5] =
    [(FaceType::Tri3, 2), (FaceType::Tri6, 9), (FaceType::Quad4, 3), (FaceType::Quad8, 16), (FaceType::Quad9, 10)];
const VOLUMES: [(ElementType, i32); 6] = [
    (ElementType::Tet4, 4),
    (ElementType::Tet10, 11),
    (ElementType::Hex8, 5),
    (ElementType::Hex20, 17),
    (ElementType::Hex27, 12),
    (ElementType::Wedge6, 6),
];

/// A cell type with a number in the format.
pub(super) trait GmshType: CellType {
    /// Returns the element type number.
    fn number(self) -> i32;

    /// Returns the expected content of a message about its nodes.
    fn expected(self) -> &'static str;

    /// Returns, for each node in the order of the crate, its place in the order of Gmsh; `None` if the orders are equal.
    fn places(self) -> Option<&'static [usize]>;
}

impl GmshType for ElementType {
    fn number(self) -> i32 {
        VOLUMES[self as usize].1
    }

    fn expected(self) -> &'static str {
        match self {
            Self::Tet4 => "the four nodes of a tetrahedron",
            Self::Tet10 => "the ten nodes of a tetrahedron of order 2",
            Self::Hex8 => "the eight nodes of a hexahedron",
            Self::Hex20 | Self::Hex27 => "the nodes of a hexahedron of order 2",
            Self::Wedge6 => "the six nodes of a wedge",
        }
    }

    fn places(self) -> Option<&'static [usize]> {
        match self {
            Self::Tet10 => Some(&TET10),
            Self::Hex20 => Some(&HEX27[..20]),
            Self::Hex27 => Some(&HEX27),
            Self::Tet4 | Self::Hex8 | Self::Wedge6 => None,
        }
    }
}

impl GmshType for FaceType {
    fn number(self) -> i32 {
        FACES[self as usize].1
    }

    fn expected(self) -> &'static str {
        match self {
            Self::Tri3 => "the three nodes of a triangle",
            Self::Tri6 => "the six nodes of a triangle of order 2",
            Self::Quad4 => "the four nodes of a quadrilateral",
            Self::Quad8 | Self::Quad9 => "the nodes of a quadrilateral of order 2",
        }
    }

    fn places(self) -> Option<&'static [usize]> {
        None
    }
}

const TET10: [usize; 10] = [0, 1, 2, 3, 4, 5, 6, 7, 9, 8];
#[rustfmt::skip]
const HEX27: [usize; 27] = [
    0, 1, 2, 3, 4, 5, 6, 7,
    8, 11, 13, 9, 16, 18, 19, 17, 10, 12, 14, 15,
    22, 23, 21, 24, 20, 25, 26,
];

/// Returns the name of an unsupported element type and a cure.
fn unsupported(number: i32) -> (String, &'static str) {
    const ORDER: &str = "export the mesh with element order 1 or 2 (in Gmsh: Mesh.ElementOrder = 2)";
    const LINEAR: &str = "export the mesh with element order 1 (in Gmsh: Mesh.ElementOrder = 1)";
    const NO_PYRAMIDS: &str = "mesh the body without pyramids: with tetrahedra only, or with hexahedra and wedges only";
    const UNKNOWN: &str = "the file is damaged or of a newer version: export it again from Gmsh";
    let (name, order, cure) = match number {
        7 => ("5-node pyramids", 1, NO_PYRAMIDS),
        13 => ("18-node prisms", 2, LINEAR),
        14 => ("14-node pyramids", 2, NO_PYRAMIDS),
        18 => ("15-node prisms", 2, LINEAR),
        19 => ("13-node pyramids", 2, NO_PYRAMIDS),
        20 => ("9-node triangles", 3, ORDER),
        21 => ("10-node triangles", 3, ORDER),
        22 => ("12-node triangles", 4, ORDER),
        23 => ("15-node triangles", 4, ORDER),
        24 => ("15-node triangles", 5, ORDER),
        25 => ("21-node triangles", 5, ORDER),
        26 => ("4-node lines", 3, ORDER),
        27 => ("5-node lines", 4, ORDER),
        28 => ("6-node lines", 5, ORDER),
        29 => ("20-node tetrahedra", 3, ORDER),
        30 => ("35-node tetrahedra", 4, ORDER),
        31 => ("56-node tetrahedra", 5, ORDER),
        92 => ("64-node hexahedra", 3, ORDER),
        93 => ("125-node hexahedra", 4, ORDER),
        _ => return (format!("elements of type {number}"), UNKNOWN),
    };
    (format!("{name} (order {order}, element type {number})"), cure)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn supported_types_are_accepted() {
        let accepted: Vec<i32> = (-5..200).filter(|&number| treatment(number).is_ok()).collect();
        assert_eq!(accepted, [1, 2, 3, 4, 5, 6, 8, 9, 10, 11, 12, 15, 16, 17]);
        assert_eq!(treatment(13).unwrap_err().0, "18-node prisms (order 2, element type 13)");
        assert_eq!(treatment(77).unwrap_err().0, "elements of type 77");
        for (volume, number) in VOLUMES {
            assert_eq!((treatment(number), volume.number()), (Ok(ElementTreatment::Volume(volume)), number));
        }
        for (face, number) in FACES {
            assert_eq!((treatment(number), face.number()), (Ok(ElementTreatment::Face(face)), number));
        }
    }

    /// The edges and faces in the order of the nodes on them, from the section "Node ordering" of the Gmsh manual.
    #[test]
    fn nodes_lie_on_the_edges_and_faces_of_the_manual() {
        const TET: &[&[usize]] = &[&[0, 1], &[1, 2], &[2, 0], &[3, 0], &[3, 2], &[3, 1]];
        #[rustfmt::skip]
        const HEX: &[&[usize]] = &[
            &[0, 1], &[0, 3], &[0, 4], &[1, 2], &[1, 5], &[2, 3], &[2, 6], &[3, 7], &[4, 5], &[4, 7], &[5, 6], &[6, 7],
            &[0, 3, 2, 1], &[0, 1, 5, 4], &[0, 4, 7, 3], &[1, 2, 6, 5], &[2, 3, 7, 6], &[4, 5, 6, 7],
            &[0, 1, 2, 3, 4, 5, 6, 7],
        ];
        for (element_type, between) in
            [(ElementType::Tet10, TET), (ElementType::Hex20, &HEX[..12]), (ElementType::Hex27, HEX)]
        {
            let nodes = element_type.reference_nodes();
            let places = element_type.places().unwrap();
            for (node, &place) in places.iter().enumerate() {
                let expected: [f64; 3] = match place.checked_sub(element_type.corners()) {
                    None => nodes[place],
                    Some(k) => std::array::from_fn(|j| {
                        let corners = between[k];
                        corners.iter().map(|&corner| nodes[corner][j]).sum::<f64>() / corners.len() as f64
                    }),
                };
                assert_eq!(nodes[node], expected, "{element_type:?}, node {node}");
            }
        }
    }
}
