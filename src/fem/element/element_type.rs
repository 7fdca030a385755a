//! The types of elements, at run time, and what depends on the type alone.

use std::sync::OnceLock;

use super::cell_type::{CellType, corners_around, counts, jacobian};
use super::face_type::FaceType;
use super::reference::{Element, Hex8, Hex20, Hex27, Tet4, Tet10, Wedge6};

/// Evaluates an expression with the reference element `$E` of a run-time element type.
macro_rules! with_element {
    ($element_type:expr, $E:ident => $body:expr) => {
        match $element_type {
            ElementType::Tet4 => {
                type $E = Tet4;
                $body
            }
            ElementType::Tet10 => {
                type $E = Tet10;
                $body
            }
            ElementType::Hex8 => {
                type $E = Hex8;
                $body
            }
            ElementType::Hex20 => {
                type $E = Hex20;
                $body
            }
            ElementType::Hex27 => {
                type $E = Hex27;
                $body
            }
            ElementType::Wedge6 => {
                type $E = Wedge6;
                $body
            }
        }
    };
}

/// The type of an element of a mesh.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
#[cfg_attr(feature = "app", derive(serde::Serialize, serde::Deserialize))]
pub enum ElementType {
    /// Linear tetrahedron.
    Tet4,
    /// Quadratic tetrahedron.
    Tet10,
    /// Trilinear hexahedron.
    Hex8,
    /// Serendipity hexahedron.
    Hex20,
    /// Triquadratic hexahedron.
    Hex27,
    /// Linear wedge.
    Wedge6,
}

/// A face of an element type.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct FaceNodes {
    /// The type of the face.
    pub face_type: FaceType,
    /// Its nodes as local nodes of the element, in the order of the face type, with the normal pointing outward.
    pub nodes: Vec<usize>,
}

fn volume_at<E: Element<3, N, Q>, const N: usize, const Q: usize>(
    corners: &[[f64; 3]],
    mut visit: impl FnMut(&[f64], f64),
) {
    for point in E::quadrature() {
        let gradients = E::gradients(point.xi);
        visit(&E::values(point.xi), determinant(jacobian(corners, &gradients)) * point.weight);
    }
}

fn determinant([a, b, c]: [[f64; 3]; 3]) -> f64 {
    a[0] * (b[1] * c[2] - b[2] * c[1]) + a[1] * (b[2] * c[0] - b[0] * c[2]) + a[2] * (b[0] * c[1] - b[1] * c[0])
}

impl ElementType {
    /// All types.
    pub const ALL: [Self; 6] = [Self::Tet4, Self::Tet10, Self::Hex8, Self::Hex20, Self::Hex27, Self::Wedge6];

    fn counts(self) -> [usize; 3] {
        with_element!(self, E => counts::<E, 3, _, _>())
    }

    /// Number of integration points.
    pub fn points(self) -> usize {
        self.counts()[2]
    }

    /// Returns the name in case files and summaries.
    pub fn name(self) -> &'static str {
        match self {
            Self::Tet4 => "tet4",
            Self::Tet10 => "tet10",
            Self::Hex8 => "hex8",
            Self::Hex20 => "hex20",
            Self::Hex27 => "hex27",
            Self::Wedge6 => "wedge6",
        }
    }

    /// Returns true for the types of order 2, which have nodes between the corners.
    pub fn is_quadratic(self) -> bool {
        self.nodes() > self.corners()
    }

    /// Returns the noun of messages, in the singular and in the plural.
    pub fn nouns(self) -> [&'static str; 2] {
        match self {
            Self::Tet4 | Self::Tet10 => ["tetrahedron", "tetrahedra"],
            Self::Hex8 | Self::Hex20 | Self::Hex27 => ["hexahedron", "hexahedra"],
            Self::Wedge6 => ["wedge", "wedges"],
        }
    }

    /// Returns the pairs of corners that are edges; the nodes between the corners follow them in this order.
    pub fn edges(self) -> &'static [[usize; 2]] {
        with_element!(self, E => E::EDGES)
    }

    /// Returns the corners of each face, ordered so that the normal points outward.
    pub fn face_corners(self) -> &'static [&'static [usize]] {
        with_element!(self, E => E::FACES)
    }

    /// Returns the positions of the nodes on the reference domain.
    pub fn reference_nodes(self) -> Vec<[f64; 3]> {
        with_element!(self, E => E::nodes().to_vec())
    }

    /// Returns, for each node after the corners, the corners at whose center it lies.
    pub fn corners_around_nodes(self) -> Vec<Vec<usize>> {
        let nodes = self.reference_nodes();
        corners_around(&nodes[self.corners()..], |xi| match self {
            Self::Tet4 | Self::Tet10 => Tet4::values(xi).into(),
            Self::Hex8 | Self::Hex20 | Self::Hex27 => Hex8::values(xi).into(),
            Self::Wedge6 => Wedge6::values(xi).into(),
        })
    }

    /// Returns the faces with all their nodes.
    pub fn faces(self) -> &'static [FaceNodes] {
        static FACES: OnceLock<[Vec<FaceNodes>; 6]> = OnceLock::new();
        &FACES.get_or_init(|| Self::ALL.map(Self::find_faces))[self as usize]
    }

    fn find_faces(self) -> Vec<FaceNodes> {
        let reference = self.reference_nodes();
        let face = |corners: &&'static [usize]| {
            let face_type = self.face_type(corners.len());
            let corners: Vec<[f64; 3]> = corners.iter().map(|&corner| reference[corner]).collect();
            let nodes = face_type.positions_between(&corners).into_iter().map(|position| nearest(&reference, position));
            FaceNodes { face_type, nodes: nodes.collect() }
        };
        self.face_corners().iter().map(face).collect()
    }

    fn face_type(self, corners: usize) -> FaceType {
        match (self, corners) {
            (Self::Tet10, _) => FaceType::Tri6,
            (Self::Hex20, _) => FaceType::Quad8,
            (Self::Hex27, _) => FaceType::Quad9,
            (_, 3) => FaceType::Tri3,
            _ => FaceType::Quad4,
        }
    }

    /// Returns, for each node of the element reflected in a plane, its node in this element. An inverted element with
    /// its nodes in this order has a positive volume.
    pub fn mirrored(self) -> Vec<usize> {
        let reference = self.reference_nodes();
        let reflect = |[x, y, z]: [f64; 3]| match self {
            Self::Tet4 | Self::Tet10 => [x, z, y],
            _ => [x, y, -z],
        };
        reference.iter().map(|&position| nearest(&reference, reflect(position))).collect()
    }

    /// Calls `visit` at each integration point of an element with these node positions, m, with the values of the shape
    /// functions and the volume of the point, m^3, which is negative if the element is inverted there.
    pub fn integrate(self, nodes: &[[f64; 3]], visit: impl FnMut(&[f64], f64)) {
        with_element!(self, E => volume_at::<E, _, _>(nodes, visit));
    }
}

/// Returns the node at a position on the reference domain.
fn nearest(nodes: &[[f64; 3]], position: [f64; 3]) -> usize {
    let distance = |node: &[f64; 3]| -> f64 { node.iter().zip(position).map(|(a, b)| (a - b).abs()).sum() };
    let at = (0..nodes.len()).min_by(|&a, &b| distance(&nodes[a]).total_cmp(&distance(&nodes[b])));
    at.unwrap_or(0)
}

impl CellType for ElementType {
    fn nodes(self) -> usize {
        self.counts()[0]
    }

    fn corners(self) -> usize {
        self.counts()[1]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A distorted but planar-faced image of the reference domain.
    fn mapped(xi: [f64; 3]) -> [f64; 3] {
        let [x, y, z] = xi;
        [1.3 * x + 0.2 * y - 0.1 * z, 0.1 * x + 0.9 * y + 0.3 * z, -0.2 * x + 0.15 * y + 1.1 * z]
    }

    #[test]
    fn faces_close_the_element() {
        for element_type in ElementType::ALL {
            let nodes: Vec<_> = element_type.reference_nodes().into_iter().map(mapped).collect();
            let mut volume = 0.0;
            element_type.integrate(&nodes, |values, part| {
                assert!((values.iter().sum::<f64>() - 1.0).abs() < 1e-14);
                volume += part;
            });
            // Divergence theorem: the sum of the areas vanishes, and x . n integrates to three times the volume.
            let (mut closed, mut flux) = ([0.0; 3], 0.0);
            for FaceNodes { face_type, nodes: local } in element_type.faces() {
                assert_eq!(local.len(), face_type.nodes());
                assert_eq!(local.iter().collect::<std::collections::HashSet<_>>().len(), local.len(), "{local:?}");
                let positions: Vec<_> = local.iter().map(|&node| nodes[node]).collect();
                face_type.integrate(&positions, |values, area| {
                    for j in 0..3 {
                        let x: f64 = values.iter().zip(&positions).map(|(value, x)| value * x[j]).sum();
                        closed[j] += area[j];
                        flux += x * area[j];
                    }
                });
            }
            assert!(volume > 0.0 && closed.iter().all(|sum| sum.abs() < 1e-13), "{element_type:?}: {closed:?}");
            assert!((flux / (3.0 * volume) - 1.0).abs() < 1e-13, "{element_type:?}: {flux} {volume}");
        }
    }

    #[test]
    fn mirrored_elements_have_the_opposite_volume() {
        for element_type in ElementType::ALL {
            let nodes: Vec<_> = element_type.reference_nodes().into_iter().map(mapped).collect();
            let volume = |nodes: &[[f64; 3]]| {
                let mut sum = 0.0;
                element_type.integrate(nodes, |_, part| sum += part);
                sum
            };
            let mirrored: Vec<_> = element_type.mirrored().iter().map(|&node| nodes[node]).collect();
            assert!((volume(&nodes) + volume(&mirrored)).abs() < 1e-14 && volume(&nodes) > 0.1, "{element_type:?}");
        }
    }

    #[test]
    fn reversed_faces_have_the_opposite_normal() {
        for element_type in ElementType::ALL {
            let nodes: Vec<_> = element_type.reference_nodes().into_iter().map(mapped).collect();
            for FaceNodes { face_type, nodes: local } in element_type.faces() {
                let area = |order: &[usize]| {
                    let positions: Vec<_> = order.iter().map(|&k| nodes[local[k]]).collect();
                    let mut sum = [0.0; 3];
                    face_type.integrate(&positions, |_, area| (0..3).for_each(|j| sum[j] += area[j]));
                    sum
                };
                let same: Vec<usize> = (0..face_type.nodes()).collect();
                let (given, reversed) = (area(&same), area(face_type.reversed()));
                assert!((0..3).all(|j| (given[j] + reversed[j]).abs() < 1e-14), "{given:?} {reversed:?}");
            }
        }
    }
}
