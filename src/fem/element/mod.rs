//! The linear tetrahedron: volume, gradients of the shape functions, and deformation gradient.

use nalgebra::{Matrix3, Vector3};
use thiserror::Error;

use super::mesh::longest_edge;

/// Nodes of a linear tetrahedron.
pub const NODES: usize = 4;
/// Unknowns of a linear tetrahedron: three displacement components per node, ordered `3 * node + component`.
pub const UNKNOWNS: usize = 3 * NODES;

/// Volume and shape-function gradients of a linear tetrahedron in the reference state; both are constant over it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Tetrahedron {
    /// Volume, m^3, positive.
    pub volume: f64,
    /// `gradients[a][J] = dN_a / dX_J`, 1/m; they sum to zero over `a`.
    pub gradients: [[f64; 3]; NODES],
}

/// The reason why four points do not form an element.
#[derive(Clone, Copy, Debug, Error, PartialEq)]
pub enum ElementError {
    /// The nodes are numbered left-handedly, lie in one plane, or hold a NaN.
    #[error(
        "the volume is {volume:.3e} m^3 (longest edge {longest:.3e} m): the nodes lie in one plane or are numbered left-handedly"
    )]
    Degenerate {
        /// Signed volume, m^3.
        volume: f64,
        /// Longest edge, m.
        longest: f64,
    },
}

impl Tetrahedron {
    /// Computes the geometry from node positions in meters.
    ///
    /// With the edge matrix `D = [X_1 - X_0, X_2 - X_0, X_3 - X_0]` and the natural coordinates `xi` defined by
    /// `X = X_0 + D xi`, `N_a = xi_a` for `a = 1..3` and `N_0 = 1 - sum xi`. Hence the gradients of nodes 1 to 3 are
    /// the rows of `D^-1`, and the volume is `det D / 6`.
    ///
    /// # Errors
    /// Returns [`ElementError::Degenerate`] if the volume does not exceed `1e-14` times the cube of the longest edge.
    pub fn new(nodes: &[[f64; 3]; NODES]) -> Result<Self, ElementError> {
        let x = nodes.map(Vector3::from);
        let edges = Matrix3::from_columns(&[x[1] - x[0], x[2] - x[0], x[3] - x[0]]);
        let volume = edges.determinant() / 6.0;
        let longest = longest_edge(*nodes);
        let degenerate = ElementError::Degenerate { volume, longest };
        if !(volume > 1e-14 * longest.powi(3) && volume.is_finite()) {
            return Err(degenerate);
        }
        let inverse = edges.try_inverse().ok_or(degenerate)?;
        let row = |a: usize| [inverse[(a, 0)], inverse[(a, 1)], inverse[(a, 2)]];
        let (g1, g2, g3) = (row(0), row(1), row(2));
        let g0 = std::array::from_fn(|j| -(g1[j] + g2[j] + g3[j]));
        Ok(Self { volume, gradients: [g0, g1, g2, g3] })
    }

    /// Computes `du/dX = sum_a u_a (x) grad N_a` from nodal displacements in meters.
    ///
    /// Uses displacements relative to node 0, so that a rigid translation cancels exactly.
    #[inline(always)]
    pub fn displacement_gradient(&self, u: &[[f64; 3]; NODES]) -> Matrix3<f64> {
        let [_, g1, g2, g3] = &self.gradients;
        let relative = |a: usize, i: usize| u[a][i] - u[0][i];
        Matrix3::from_fn(|i, j| relative(1, i) * g1[j] + relative(2, i) * g2[j] + relative(3, i) * g3[j])
    }

    /// Computes `F = I + du/dX` from nodal displacements in meters.
    #[inline(always)]
    pub fn deformation_gradient(&self, u: &[[f64; 3]; NODES]) -> Matrix3<f64> {
        self.displacement_gradient(u) + Matrix3::identity()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const CORNERS: [[f64; 3]; 4] = [[0.1, 0.0, 0.2], [1.0, 0.1, 0.0], [0.2, 0.9, 0.1], [0.0, 0.3, 1.2]];

    #[test]
    fn the_unit_corner_is_known() {
        let t = Tetrahedron::new(&[[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]).unwrap();
        assert!((t.volume - 1.0 / 6.0).abs() < 1e-16);
        assert_eq!(t.gradients, [[-1.0, -1.0, -1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]);
    }

    #[test]
    fn affine_displacements_give_their_gradient() {
        let t = Tetrahedron::new(&CORNERS).unwrap();
        let h = Matrix3::new(0.1, -0.2, 0.05, 0.3, 0.02, -0.1, 0.07, 0.2, -0.15);
        let u = CORNERS.map(|x| (h * Vector3::from(x) + Vector3::new(5.0, -3.0, 2.0)).into());
        let f = t.deformation_gradient(&u);
        assert!((f - Matrix3::identity() - h).norm() < 1e-14, "{f}");
    }

    #[test]
    fn flat_left_handed_and_nonfinite_elements_are_rejected() {
        let swapped = [CORNERS[1], CORNERS[0], CORNERS[2], CORNERS[3]];
        assert!(matches!(Tetrahedron::new(&swapped), Err(ElementError::Degenerate { volume, .. }) if volume < -0.1));
        let flat = CORNERS.map(|[x, y, _]| [x, y, 1.0]);
        assert!(Tetrahedron::new(&flat).is_err());
        let mut unreal = CORNERS;
        unreal[2][1] = f64::NAN;
        assert!(Tetrahedron::new(&unreal).is_err());
    }
}
