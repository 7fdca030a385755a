//! The types of the faces of elements, at run time.

use super::cell_type::{CellType, corners_around, counts, jacobian};
use super::reference::{Element, Quad4, Quad8, Quad9, Tri3, Tri6};

/// Evaluates an expression with the reference element `$E` of a run-time face type.
macro_rules! with_face {
    ($face_type:expr, $E:ident => $body:expr) => {
        match $face_type {
            FaceType::Tri3 => {
                type $E = Tri3;
                $body
            }
            FaceType::Tri6 => {
                type $E = Tri6;
                $body
            }
            FaceType::Quad4 => {
                type $E = Quad4;
                $body
            }
            FaceType::Quad8 => {
                type $E = Quad8;
                $body
            }
            FaceType::Quad9 => {
                type $E = Quad9;
                $body
            }
        }
    };
}

/// The type of a face of an element.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
#[cfg_attr(feature = "app", derive(serde::Serialize, serde::Deserialize))]
pub enum FaceType {
    /// Linear triangle.
    Tri3,
    /// Quadratic triangle.
    Tri6,
    /// Bilinear quadrilateral.
    Quad4,
    /// Serendipity quadrilateral.
    Quad8,
    /// Biquadratic quadrilateral.
    Quad9,
}

fn tangents_at<E: Element<2, N, Q>, const N: usize, const Q: usize>(
    nodes: &[[f64; 3]],
    mut visit: impl FnMut(&[f64], &[[f64; 2]], [[f64; 3]; 2], f64),
) {
    for point in E::quadrature() {
        let gradients = E::gradients(point.xi);
        visit(&E::values(point.xi), &gradients, jacobian(nodes, &gradients), point.weight);
    }
}

impl FaceType {
    fn counts(self) -> [usize; 3] {
        with_face!(self, E => counts::<E, 2, _, _>())
    }

    /// Number of integration points.
    pub fn points(self) -> usize {
        self.counts()[2]
    }

    /// Returns the noun of messages, in the singular and in the plural.
    pub fn nouns(self) -> [&'static str; 2] {
        match self {
            Self::Tri3 | Self::Tri6 => ["triangle", "triangles"],
            Self::Quad4 | Self::Quad8 | Self::Quad9 => ["quadrilateral", "quadrilaterals"],
        }
    }

    /// Returns, for each node of the face with opposite normal and the same first node, its node in this face.
    pub fn reversed(self) -> &'static [usize] {
        match self {
            Self::Tri3 => &[0, 2, 1],
            Self::Tri6 => &[0, 2, 1, 5, 4, 3],
            Self::Quad4 => &[0, 3, 2, 1],
            Self::Quad8 => &[0, 3, 2, 1, 7, 6, 5, 4],
            Self::Quad9 => &[0, 3, 2, 1, 7, 6, 5, 4, 8],
        }
    }

    /// Returns, for each node after the corners, the corners at whose center it lies.
    pub fn corners_around_nodes(self) -> Vec<Vec<usize>> {
        let nodes = with_face!(self, E => E::nodes().to_vec());
        corners_around(&nodes[self.corners()..], |xi| match self.corners() {
            3 => Tri3::values(xi).into(),
            _ => Quad4::values(xi).into(),
        })
    }

    /// Returns the nodes on the edges of the face, in order around it.
    pub fn outline(self) -> &'static [usize] {
        match self {
            Self::Tri3 => &[0, 1, 2],
            Self::Tri6 => &[0, 3, 1, 4, 2, 5],
            Self::Quad4 => &[0, 1, 2, 3],
            Self::Quad8 | Self::Quad9 => &[0, 4, 1, 5, 2, 6, 3, 7],
        }
    }

    /// Calls `visit` at each integration point of a face with these node positions, m, with the values of the shape
    /// functions and the area of the point times the unit normal, m^2.
    pub fn integrate(self, nodes: &[[f64; 3]], mut visit: impl FnMut(&[f64], [f64; 3])) {
        self.integrate_tangents(nodes, |values, _, [a, b], weight| {
            let normal = [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
            visit(values, normal.map(|component| component * weight));
        });
    }

    /// Calls `visit` at each integration point of a face with these node positions, m, with the values of the shape
    /// functions, their derivatives by the two reference coordinates, the tangents `dx/dxi_j`, m, and the weight of the
    /// point; the area vector of the point is the cross product of the tangents times the weight.
    pub fn integrate_tangents(self, nodes: &[[f64; 3]], visit: impl FnMut(&[f64], &[[f64; 2]], [[f64; 3]; 2], f64)) {
        with_face!(self, E => tangents_at::<E, _, _>(nodes, visit));
    }

    /// Returns the positions of all nodes of a plane face between these corners.
    pub(super) fn positions_between(self, corners: &[[f64; 3]]) -> Vec<[f64; 3]> {
        let reference = with_face!(self, E => E::nodes().to_vec());
        let position = |xi: [f64; 2]| {
            let values: Vec<f64> = match corners.len() {
                3 => Tri3::values(xi).into(),
                _ => Quad4::values(xi).into(),
            };
            let weighted = |j: usize| values.iter().zip(corners).map(|(value, corner)| value * corner[j]).sum();
            std::array::from_fn(weighted)
        };
        reference.into_iter().map(position).collect()
    }
}

impl CellType for FaceType {
    fn nodes(self) -> usize {
        self.counts()[0]
    }

    fn corners(self) -> usize {
        self.counts()[1]
    }
}
