//! Elements: their types, their reference elements, and the geometry of their integration points.

mod cell_type;
mod element_type;
mod face_type;
pub mod reference;

use nalgebra::{Matrix3, Vector3};
use thiserror::Error;

pub use cell_type::CellType;
pub use element_type::{ElementType, FaceNodes};
pub use face_type::FaceType;
use reference::{Element, QuadraturePoint};

use super::mesh::longest_edge;

/// Volume and shape-function gradients of one integration point in the reference state; constant over a linear
/// tetrahedron.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PointGeometry<const N: usize> {
    /// Weight of the point in volume integrals, m^3, positive.
    pub volume: f64,
    /// `gradients[a][J] = dN_a / dX_J`, 1/m; they sum to zero over `a`.
    pub gradients: [[f64; 3]; N],
}

/// The reason why nodes do not form an element.
#[derive(Clone, Copy, Debug, Error, PartialEq)]
pub enum ElementError {
    /// The nodes are numbered left-handedly, lie in one plane, distort the element, or hold a NaN.
    #[error(
        "the volume is {volume:.3e} m^3 (longest edge {longest:.3e} m): the nodes lie in one plane, are numbered left-handedly, or distort the element"
    )]
    Degenerate {
        /// Signed volume of an integration point, m^3.
        volume: f64,
        /// Longest edge, m.
        longest: f64,
    },
}

/// Computes the geometry of all integration points from node positions in meters.
///
/// # Errors
/// Returns [`ElementError::Degenerate`] if the volume of a point does not exceed `1e-14` times the cube of the longest
/// edge.
pub fn geometry<E: Element<3, N, Q>, const N: usize, const Q: usize>(
    nodes: &[[f64; 3]; N],
) -> Result<[PointGeometry<N>; Q], ElementError> {
    let mut points = [PointGeometry { volume: 0.0, gradients: [[0.0; 3]; N] }; Q];
    for (slot, point) in points.iter_mut().zip(E::quadrature()) {
        *slot = PointGeometry::new::<E, Q>(nodes, &point)?;
    }
    Ok(points)
}

impl<const N: usize> PointGeometry<N> {
    /// Computes the geometry at a point from node positions in meters.
    ///
    /// With the Jacobian `D_Jj = dX_J / dxi_j = sum_a X_a[J] dN_a/dxi_j`, the gradients are
    /// `dN_a/dX_J = sum_j dN_a/dxi_j (D^-1)_jJ`, and the volume is `det D` times the weight of the point.
    ///
    /// # Errors
    /// Returns [`ElementError::Degenerate`] if the volume does not exceed `1e-14` times the cube of the longest edge.
    pub fn new<E: Element<3, N, Q>, const Q: usize>(
        nodes: &[[f64; 3]; N],
        point: &QuadraturePoint<3>,
    ) -> Result<Self, ElementError> {
        let natural = E::gradients(point.xi);
        // Relative to node 0, so that the position of the body does not matter.
        let relative = nodes.map(|x| Vector3::from(x) - Vector3::from(nodes[0]));
        let mut jacobian = Matrix3::zeros();
        for (x, slope) in relative.iter().zip(&natural) {
            jacobian += x * Vector3::from(*slope).transpose();
        }
        let volume = jacobian.determinant() * point.weight;
        let longest = longest_edge(nodes, E::EDGES);
        let degenerate = ElementError::Degenerate { volume, longest };
        if !(volume > 1e-14 * longest.powi(3) && volume.is_finite()) {
            return Err(degenerate);
        }
        let inverse = jacobian.try_inverse().ok_or(degenerate)?;
        let gradients = natural.map(|slope| {
            let of = |j: usize| slope[0] * inverse[(0, j)] + slope[1] * inverse[(1, j)] + slope[2] * inverse[(2, j)];
            [of(0), of(1), of(2)]
        });
        Ok(Self { volume, gradients: balanced(gradients) })
    }

    /// Computes `du/dX = sum_a u_a (x) grad N_a` from nodal displacements in meters.
    ///
    /// Uses displacements relative to node 0, so that a rigid translation cancels exactly.
    #[inline(always)]
    pub fn displacement_gradient(&self, u: &[[f64; 3]; N]) -> Matrix3<f64> {
        let mut h = [[0.0; 3]; 3];
        for a in 1..N {
            for i in 0..3 {
                let relative = u[a][i] - u[0][i];
                for (sum, gradient) in h[i].iter_mut().zip(self.gradients[a]) {
                    let term = relative * gradient;
                    *sum = if a == 1 { term } else { *sum + term };
                }
            }
        }
        Matrix3::from_fn(|i, j| h[i][j])
    }

    /// Computes `F = I + du/dX` from nodal displacements in meters.
    #[inline(always)]
    pub fn deformation_gradient(&self, u: &[[f64; 3]; N]) -> Matrix3<f64> {
        self.displacement_gradient(u) + Matrix3::identity()
    }
}

/// Replaces the gradient of node 0 by minus the sum of the others, so that the sum vanishes up to one rounding.
fn balanced<const N: usize>(mut gradients: [[f64; 3]; N]) -> [[f64; 3]; N] {
    for j in 0..3 {
        let mut sum = gradients[1][j];
        for gradient in &gradients[2..] {
            sum += gradient[j];
        }
        gradients[0][j] = -sum;
    }
    gradients
}

#[cfg(test)]
mod tests {
    use super::reference::{Hex8, Hex20, Hex27, Tet4, Tet10, Wedge6};
    use super::*;

    const CORNERS: [[f64; 3]; 4] = [[0.1, 0.0, 0.2], [1.0, 0.1, 0.0], [0.2, 0.9, 0.1], [0.0, 0.3, 1.2]];

    fn tetrahedron(nodes: &[[f64; 3]; 4]) -> Result<PointGeometry<4>, ElementError> {
        geometry::<Tet4, 4, 1>(nodes).map(|[point]| point)
    }

    #[test]
    fn the_unit_corner_is_known() {
        let t = tetrahedron(&[[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]).unwrap();
        assert!((t.volume - 1.0 / 6.0).abs() < 1e-16);
        assert_eq!(t.gradients, [[-1.0, -1.0, -1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]);
    }

    /// A curved element, and the affine displacement of its nodes.
    fn affine_displacements_give_their_gradient<E: Element<3, N, Q>, const N: usize, const Q: usize>() {
        let h = Matrix3::new(0.1, -0.2, 0.05, 0.3, 0.02, -0.1, 0.07, 0.2, -0.15);
        let nodes = E::nodes().map(|[x, y, z]| [x + 0.05 * y * z + 3.0, y - 0.03 * x * x, 1.2 * z + 0.04 * x * y]);
        let u = nodes.map(|x| (h * Vector3::from(x) + Vector3::new(5.0, -3.0, 2.0)).into());
        for point in geometry::<E, N, Q>(&nodes).unwrap() {
            let f = point.deformation_gradient(&u);
            assert!((f - Matrix3::identity() - h).norm() < 1e-13, "{f}");
            let sum: f64 = point.gradients.iter().map(|g| g[0] + g[1] + g[2]).sum();
            assert!(sum.abs() < 1e-14 && point.volume > 0.0);
        }
    }

    #[test]
    fn affine_displacements_give_their_gradient_in_all_elements() {
        affine_displacements_give_their_gradient::<Tet4, _, _>();
        affine_displacements_give_their_gradient::<Tet10, _, _>();
        affine_displacements_give_their_gradient::<Hex8, _, _>();
        affine_displacements_give_their_gradient::<Hex20, _, _>();
        affine_displacements_give_their_gradient::<Hex27, _, _>();
        affine_displacements_give_their_gradient::<Wedge6, _, _>();
    }

    #[test]
    fn flat_left_handed_and_nonfinite_elements_are_rejected() {
        let swapped = [CORNERS[1], CORNERS[0], CORNERS[2], CORNERS[3]];
        assert!(matches!(tetrahedron(&swapped), Err(ElementError::Degenerate { volume, .. }) if volume < -0.1));
        let flat = CORNERS.map(|[x, y, _]| [x, y, 1.0]);
        assert!(tetrahedron(&flat).is_err());
        let mut unreal = CORNERS;
        unreal[2][1] = f64::NAN;
        assert!(tetrahedron(&unreal).is_err());
    }
}
