//! A surface whose nodes move as a rigid body.

use nalgebra::{Matrix3, Matrix3x6, Vector3};

use super::rotation;

/// The motion of a rigid surface.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "app", derive(serde::Serialize, serde::Deserialize))]
pub struct RigidMotion {
    /// Displacement of the reference point, m.
    pub displacement: [f64; 3],
    /// Rotation vector: its direction is the axis, its length the angle, rad.
    pub rotation: [f64; 3],
}

/// A surface whose nodes follow a reference point rigidly: the node at `X` moves by `d + (R - I) (X - X_ref)`.
///
/// Its six unknowns are the displacement `d`, m, and the rotation vector of `R` times [`RigidSurface::length`], m, so
/// that all unknowns of a body have one unit, and so have the forces conjugate to them.
#[derive(Clone, Debug, PartialEq)]
pub struct RigidSurface {
    /// Index into [`Mesh::surfaces`](crate::fem::mesh::Mesh::surfaces).
    pub surface: usize,
    /// The reference point in the reference state, m.
    pub reference: [f64; 3],
    /// The greatest distance of a node from the reference point, m; 1 if all nodes are there.
    pub length: f64,
    /// The nodes.
    pub nodes: Vec<u32>,
    /// `X - X_ref` of each node, m.
    arms: Vec<Vector3<f64>>,
}

/// The dependence of the displacements of a rigid surface on its unknowns, at one rotation.
#[derive(Clone, Debug)]
pub(in crate::fem) struct RigidDerivatives {
    /// `dR / d theta_i` divided by the length of the surface, 1/m.
    rotation: [Matrix3<f64>; 3],
}

impl RigidSurface {
    /// Creates a rigid surface of nodes at these positions, m.
    pub(in crate::fem) fn new(surface: usize, reference: [f64; 3], nodes: Vec<u32>, positions: &[[f64; 3]]) -> Self {
        let arm = |&node: &u32| Vector3::from(positions[node as usize]) - Vector3::from(reference);
        let arms: Vec<Vector3<f64>> = nodes.iter().map(arm).collect();
        let longest = arms.iter().map(Vector3::norm).fold(0.0, f64::max);
        Self { surface, reference, length: if longest > 0.0 { longest } else { 1.0 }, nodes, arms }
    }

    /// Returns the surface with the nodes of a part of the mesh; `place` returns the number of a node in the part.
    pub(in crate::fem) fn on_part(&self, place: impl Fn(u32) -> Option<u32>) -> Self {
        let held = self.nodes.iter().zip(&self.arms).filter_map(|(&node, arm)| Some((place(node)?, *arm)));
        let (nodes, arms) = held.unzip();
        Self { nodes, arms, ..*self }
    }

    /// Returns `X - X_ref` of the node at this position in [`RigidSurface::nodes`].
    pub(super) fn arm(&self, position: usize) -> &Vector3<f64> {
        &self.arms[position]
    }

    /// Writes the displacements of the nodes, m, that belong to a motion.
    pub fn place(&self, motion: &RigidMotion, displacements: &mut [[f64; 3]]) {
        let turn = rotation::rotation(&motion.rotation.into()) - Matrix3::identity();
        let displacement = Vector3::from(motion.displacement);
        for (&node, arm) in self.nodes.iter().zip(&self.arms) {
            displacements[node as usize] = (displacement + turn * arm).into();
        }
    }

    /// Adds `a` times an increment of the unknowns to a motion.
    pub(super) fn advance(&self, a: f64, increments: &[f64; 6], motion: &mut RigidMotion) {
        for i in 0..3 {
            motion.displacement[i] += a * increments[i];
            motion.rotation[i] += a * increments[3 + i] / self.length;
        }
    }

    pub(super) fn derivatives(&self, motion: &RigidMotion) -> RigidDerivatives {
        let rotation = rotation::derivatives(&motion.rotation.into()).map(|derivative| derivative / self.length);
        RigidDerivatives { rotation }
    }

    /// Returns the forces conjugate to the unknowns, N, of forces on the nodes of the mesh.
    pub(super) fn generalized_forces(&self, derivatives: &RigidDerivatives, forces: &[[f64; 3]]) -> [f64; 6] {
        let mut sum = Vector3::zeros();
        let mut virial = Matrix3::zeros();
        for (&node, arm) in self.nodes.iter().zip(&self.arms) {
            let force = Vector3::from(forces[node as usize]);
            sum += force;
            virial += force * arm.transpose();
        }
        let turning = derivatives.rotation.map(|derivative| virial.dot(&derivative));
        [sum[0], sum[1], sum[2], turning[0], turning[1], turning[2]]
    }

    /// Returns the second derivative of `sum f . u` with respect to the three unknowns of rotation at constant forces
    /// `f` on the nodes, N/m.
    pub(super) fn geometric_stiffness(&self, motion: &RigidMotion, forces: &[[f64; 3]]) -> Matrix3<f64> {
        let mut virial = Matrix3::zeros();
        for (&node, arm) in self.nodes.iter().zip(&self.arms) {
            virial += Vector3::from(forces[node as usize]) * arm.transpose();
        }
        rotation::second_derivatives(&motion.rotation.into(), &virial) / (self.length * self.length)
    }

    /// Returns the moment of forces on the nodes about the displaced reference point, N m.
    pub fn moment(&self, motion: &RigidMotion, forces: &[[f64; 3]]) -> [f64; 3] {
        let turn = rotation::rotation(&motion.rotation.into());
        let moment = |(&node, arm): (&u32, &Vector3<f64>)| (turn * arm).cross(&Vector3::from(forces[node as usize]));
        self.nodes.iter().zip(&self.arms).map(moment).sum::<Vector3<f64>>().into()
    }
}

impl RigidDerivatives {
    /// Returns the derivative of the displacement of a node with this arm with respect to the six unknowns.
    pub(super) fn of_node(&self, arm: &Vector3<f64>) -> Matrix3x6<f64> {
        let mut columns = Matrix3x6::identity();
        for (i, derivative) in self.rotation.iter().enumerate() {
            columns.set_column(3 + i, &(derivative * arm));
        }
        columns
    }
}
