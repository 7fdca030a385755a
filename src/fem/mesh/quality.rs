//! The shape quality of elements.
//!
//! The measure is the *mean ratio*. At a corner with the edges `A = [a_1 a_2 a_3]`, and `W` the edges at a corner of the
//! ideal element, a regular tetrahedron, a cube, or a prism of an equilateral triangle with square sides,
//!
//! `eta = 3 det(S)^(2/3) / |S|^2`, with `S = A W^-1` and the Frobenius norm:
//!
//! the ratio of the geometric to the arithmetic mean of the squared singular values of `S`. It is 1 for the ideal
//! element of any size and orientation, and tends to 0 as the corner becomes flat or very long. The quality of an
//! element is its least value over the corners, and 0 if a corner is inverted. In a tetrahedron it is the same at
//! all corners, `12 (3 V)^(2/3)` divided by the sum of the squared edges (Liu and Joe). Nodes between the corners, in
//! elements of order 2, are ignored.
//!
//! References: A. Liu, B. Joe, *Relationship between tetrahedron shape measures*, BIT 34 (1994), 268-287; P. M. Knupp,
//! *Algebraic mesh quality metrics for unstructured initial meshes*, Finite Elements in Analysis and Design 39 (2003),
//! 217-241.

use super::Mesh;
use super::measure::{cross, difference, dot};
use crate::fem::element::{CellType, ElementType};
use crate::parallel;

/// The quality of the elements of a mesh: the mean ratio, which is 1 for ideal elements and 0 for flat ones.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "app", derive(serde::Serialize))]
pub struct ElementQuality {
    /// The least quality.
    pub minimum: f64,
    /// Index of the first element with this quality, from 0.
    pub worst: usize,
    /// The median; with an even number of elements, the lower of the two in the middle.
    pub median: f64,
}

impl ElementQuality {
    /// Summarizes the qualities of elements; `None` without elements.
    pub fn of(qualities: &[f64]) -> Option<Self> {
        let least = |best: (usize, f64), (element, &quality): (usize, &f64)| {
            if quality < best.1 { (element, quality) } else { best }
        };
        let (worst, minimum) = qualities.iter().enumerate().fold((0, *qualities.first()?), least);
        let mut sorted = qualities.to_vec();
        let middle = (sorted.len() - 1) / 2;
        let median = *sorted.select_nth_unstable_by(middle, f64::total_cmp).1;
        Some(Self { minimum, worst, median })
    }
}

impl Mesh {
    /// Returns the quality of every element: the mean ratio, from 0 for a flat element or one with an inverted corner
    /// to 1 for a regular tetrahedron, a cube, or a prism of an equilateral triangle with square sides. It does not
    /// depend on the size of the element, and counts corners only.
    ///
    /// References: A. Liu, B. Joe, *Relationship between tetrahedron shape measures*, BIT 34 (1994), 268-287; P. M.
    /// Knupp, *Algebraic mesh quality metrics for unstructured initial meshes*, Finite Elements in Analysis and Design
    /// 39 (2003), 217-241.
    pub fn element_qualities(&self) -> Vec<f64> {
        let ideals = ElementType::ALL.map(Ideal::of);
        parallel::collect(self.elements.len(), |element| {
            let ideal = &ideals[self.elements.cell_type(element) as usize];
            ideal.quality(&self.elements[element], &self.nodes)
        })
    }
}

/// The corners of an element type, and the ideal corner.
struct Ideal {
    /// Each corner, followed by its three neighbors in right-handed order; in a wedge, the last one is on the other
    /// triangle.
    corners: Vec<[usize; 4]>,
    /// `(W^T W)^-1` of the edges `W` of length 1.
    inverse_gram: [[f64; 3]; 3],
    /// `det W`.
    volume: f64,
}

impl Ideal {
    fn of(element_type: ElementType) -> Self {
        let x = element_type.reference_nodes();
        let frame = |corner: usize| {
            let others = element_type.edges().iter().filter_map(|&[a, b]| match corner {
                _ if corner == a => Some(b),
                _ if corner == b => Some(a),
                _ => None,
            });
            let mut others: Vec<usize> = others.collect();
            // The triangles of a wedge are at constant z.
            others.sort_by(|&a, &b| (x[a][2] - x[corner][2]).abs().total_cmp(&(x[b][2] - x[corner][2]).abs()));
            let edges = [0, 1, 2].map(|k| difference(x[others[k]], x[corner]));
            if dot(cross(edges[0], edges[1]), edges[2]) < 0.0 {
                others.swap(0, 1);
            }
            [corner, others[0], others[1], others[2]]
        };
        let (inverse_gram, volume, different) = match element_type {
            ElementType::Tet4 | ElementType::Tet10 => {
                ([[1.5, -0.5, -0.5], [-0.5, 1.5, -0.5], [-0.5, -0.5, 1.5]], 0.5_f64.sqrt(), 1)
            }
            ElementType::Hex8 | ElementType::Hex20 | ElementType::Hex27 => {
                ([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]], 1.0, 8)
            }
            ElementType::Wedge6 => {
                let (same, mixed) = (4.0 / 3.0, -2.0 / 3.0);
                ([[same, mixed, 0.0], [mixed, same, 0.0], [0.0, 0.0, 1.0]], 0.75_f64.sqrt(), 6)
            }
        };
        debug_assert!(different <= element_type.corners());
        Self { corners: (0..different).map(frame).collect(), inverse_gram, volume }
    }

    fn quality(&self, nodes: &[u32], positions: &[[f64; 3]]) -> f64 {
        let position = |local: usize| positions[nodes[local] as usize];
        let at_corner = |&[corner, ref others @ ..]: &[usize; 4]| {
            let a = [0, 1, 2].map(|k| difference(position(others[k]), position(corner)));
            let volume = (dot(cross(a[0], a[1]), a[2]) / self.volume).max(0.0);
            let pairs = (0..9).map(|k| self.inverse_gram[k / 3][k % 3] * dot(a[k / 3], a[k % 3]));
            let (ratio, norm): (f64, f64) = (volume.cbrt(), pairs.sum());
            3.0 * ratio * ratio / norm
        };
        // Rounding may exceed 1.
        self.corners.iter().map(at_corner).fold(1.0, f64::min)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fem::mesh::shapes::{cuboid, cuboid_of};

    fn qualities_of(element_type: ElementType, map: impl Fn([f64; 3]) -> [f64; 3]) -> f64 {
        let nodes: Vec<[f64; 3]> = element_type.reference_nodes().into_iter().map(map).collect();
        let numbers: Vec<u32> = (0..nodes.len() as u32).collect();
        Ideal::of(element_type).quality(&numbers, &nodes)
    }

    /// Maps the reference tetrahedron or triangle to a regular one; other coordinates are doubled or halved.
    fn regular(element_type: ElementType, [x, y, z]: [f64; 3]) -> [f64; 3] {
        let h = 0.75_f64.sqrt();
        match element_type {
            ElementType::Tet4 | ElementType::Tet10 => {
                [x + 0.5 * y + 0.5 * z, h * y + h / 3.0 * z, (2.0_f64 / 3.0).sqrt() * z]
            }
            // z has the length 2 on the reference domain.
            ElementType::Wedge6 => [x + 0.5 * y, h * y, 0.5 * z],
            _ => [x, y, z],
        }
    }

    #[test]
    fn ideal_elements_of_any_size_and_orientation_have_quality_1() {
        for element_type in ElementType::ALL {
            // A rotation about (1, 1, 1) by 120 degrees, then one about z by 0.7 rad.
            let (sine, cosine) = 0.7_f64.sin_cos();
            let turn = |[x, y, z]: [f64; 3]| [cosine * z - sine * x, sine * z + cosine * x, y].map(|x| 1e-5 * x + 3e-5);
            let quality = qualities_of(element_type, |xi| turn(regular(element_type, xi)));
            assert!((quality - 1.0).abs() < 1e-14 && quality <= 1.0, "{element_type:?}: {quality}");
        }
    }

    #[test]
    fn stretched_and_inverted_elements_are_of_lower_quality() {
        for element_type in ElementType::ALL {
            let stretched = |factor: f64| {
                let quality = qualities_of(element_type, |xi| {
                    let [x, y, z] = regular(element_type, xi);
                    [x, y, factor * z]
                });
                // All corners have S = diag(1, 1, factor), in some basis.
                let expected = 3.0 * factor.powf(2.0 / 3.0) / (2.0 + factor * factor);
                assert!((quality - expected).abs() < 1e-13, "{element_type:?}: {quality}, {expected}");
            };
            [0.01, 0.5, 3.0, 100.0].into_iter().for_each(stretched);
            assert_eq!(qualities_of(element_type, |[x, y, z]| [x, y, -z]), 0.0);
            assert_eq!(qualities_of(element_type, |[x, y, _]| [x, y, 0.0]), 0.0);
        }
        // One corner of a cube is moved to the center of the three next to it, and beyond.
        let dented =
            |depth: f64| qualities_of(ElementType::Hex8, |xi| if xi == [1.0; 3] { [1.0 - depth; 3] } else { xi });
        assert!(dented(0.1) < 0.99 && dented(0.5) > 0.0 && dented(1.0) == 0.0, "{} {}", dented(0.1), dented(0.5));
    }

    #[test]
    fn a_tetrahedron_has_the_measure_of_liu_and_joe() {
        let x = [[0.1, 0.0, 0.2], [1.0, 0.1, 0.0], [0.2, 0.9, 0.1], [0.0, 0.3, 1.2]];
        let mesh = Mesh::new(x.to_vec(), vec![[0, 1, 2, 3]], vec![0], vec!["body".into()], Vec::new()).unwrap();
        let mut edges = 0.0;
        for a in 0..4 {
            for b in 0..a {
                edges += dot(difference(x[a], x[b]), difference(x[a], x[b]));
            }
        }
        let expected = 12.0 * (3.0 * mesh.volume()).powf(2.0 / 3.0) / edges;
        assert!((mesh.element_qualities()[0] - expected).abs() < 1e-14);
    }

    #[test]
    fn a_mesh_has_the_summary_of_its_elements() {
        // Twelve tetrahedra of a cube: 12 (3/6)^(2/3) / 10.
        let mesh = cuboid([2, 1, 1], [2.0, 1.0, 1.0]).unwrap();
        let summary = ElementQuality::of(&mesh.element_qualities()).unwrap();
        let expected = 1.2 * 0.5_f64.powf(2.0 / 3.0);
        assert!((summary.minimum - expected).abs() < 1e-14 && (summary.median - expected).abs() < 1e-14);
        let summary = ElementQuality::of(&[0.5, 0.9, 0.2, 0.2, 0.6]);
        assert_eq!(summary, Some(ElementQuality { minimum: 0.2, worst: 2, median: 0.5 }));
        assert_eq!(ElementQuality::of(&[0.4, 0.3]).unwrap().median, 0.3);
        assert_eq!(ElementQuality::of(&[]), None);
        let wedges = cuboid_of(ElementType::Wedge6, [1; 3], [1.0; 3]).unwrap();
        assert!(wedges.element_qualities().iter().all(|quality| (0.5..1.0).contains(quality)));
    }
}
