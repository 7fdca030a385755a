//! The stress-gradient term of the volume-averaged balance of momentum.
//!
//! Where the deformation varies over an RVE, the divergence of the averaged stress is not zero but equals (W. R. Tobin,
//! *The Adaptive Multiscale Simulation Infrastructure*, 2018, equation A.58; T. Stylianopoulos and V. H. Barocas,
//! Comput. Methods Appl. Mech. Engrg. 196 (2007) 2981)
//!
//! ```text
//! Q_j = 1/v integral_dv (s_ij - sigma_ij) u_k,i n_k da
//! ```
//!
//! with the stress `s` in the RVE, its average `sigma`, the outward normal `n` and the displacement gradient
//! `u_k,i = du_k/dx_i`. Here the boundary moves affinely, so that `u_k,i = H_ki` with `H = I - F^-1`. The integral of
//! `sigma_ij H_ki n_k` over a closed surface vanishes. A fiber with the axial force `f`, the current direction `e` and
//! the cross section `a` has the stress `f/a e (x) e`, and the face cuts it over the area `a / |e . n|`. So
//!
//! ```text
//! Q = kappa^(3/2) / J  sum f e (e . H^T n) / |e . n|
//! ```
//!
//! over all ends of fibers on the boundary; `kappa^(-1/2)` is the edge of the RVE in meters. Because it contracts `s`
//! with `H^T n` and not with `n`, the sum does not vanish although the forces balance; as `H` does, it depends on
//! rotations of the RVE.

use nalgebra::{Matrix3, Vector3};

use super::network::BOUNDARY_TOLERANCE;
use super::rve::RveModel;
use super::workspace::Workspace;
use crate::las::RealBackend;

/// The term `Q`, or the reason why it is undefined.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum StressGradient {
    /// `Q`, in Pa/m (in units of `kappa^(3/2)` N).
    Defined([f64; 3]),
    /// This number of fibers under load lies in a face, which cuts them over an infinite area.
    FibersInFaces(usize),
}

/// Implements [`EquilibriumState::stress_gradient`](super::equilibrium::EquilibriumState::stress_gradient). Returns
/// `None` if `f` is singular.
pub(super) fn stress_gradient<B: RealBackend>(
    model: &RveModel<B>,
    f: &Matrix3<f64>,
    workspace: &Workspace<B>,
) -> Option<StressGradient> {
    let inverse = f.try_inverse()?;
    let (pull_back, displacement_gradient) = (inverse.transpose(), Matrix3::identity() - inverse);
    let (nodes, states) = (model.network().nodes(), workspace.states());
    let (mut sum, mut in_faces) = (Vector3::zeros(), 0);
    for ((&[a, b], e), &force) in model.truss().ends().iter().zip(&states.directions).zip(&states.forces) {
        let e = Vector3::from(*e);
        let ends = [nodes[a as usize], nodes[b as usize]];
        if faces(&ends[0]).any(|face| faces(&ends[1]).any(|other| other == face)) {
            in_faces += usize::from(force != 0.0);
            continue;
        }
        for end in &ends {
            // At an edge of the cube, the fiber leaves through the face that it crosses at the steepest angle.
            let normals = faces(end).map(|normal| (pull_back * normal).normalize());
            let steepest = normals.max_by(|one, other| e.dot(one).abs().total_cmp(&e.dot(other).abs()));
            if let Some(normal) = steepest {
                sum += e * (force * e.dot(&(displacement_gradient.transpose() * normal)) / e.dot(&normal).abs());
            }
        }
    }
    if in_faces > 0 {
        return Some(StressGradient::FibersInFaces(in_faces));
    }
    Some(StressGradient::Defined((sum * (model.scale().powf(1.5) / f.determinant())).into()))
}

/// Returns the outward normals of the faces of the unit cube on which a node lies.
fn faces(node: &[f64; 3]) -> impl Iterator<Item = Vector3<f64>> {
    let on_face = node.map(|x| (x.abs() - 0.5).abs() <= BOUNDARY_TOLERANCE);
    let signs = node.map(f64::signum);
    (0..3).filter(move |&axis| on_face[axis]).map(move |axis| Vector3::ith(axis, signs[axis]))
}
