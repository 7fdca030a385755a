//! Rigid surfaces: nodes that follow a reference point.

use std::sync::Arc;

use nalgebra::Vector3;

use super::{BoundaryError, LoadCurve, PrescribedComponent, Source, check_finite, find_surface};
use crate::fem::kinematics::{RigidMotion, RigidSurface};
use crate::fem::mesh::{Mesh, Surface};

/// A surface whose nodes move as a rigid body, like a grip: the node at `X` moves by `d + (R - I) (X - X_ref)`. The
/// displacement `d` of the reference point and the rotation vector of `R` are prescribed or free, component by component.
/// The forces on the body in a free direction of `d` sum to zero, as do the moments conjugate to a free component of the
/// rotation vector.
///
/// The rotation vector is the axis times the angle; a rotation about a fixed axis is prescribed by three components, two
/// of which may be 0. With a free component, the length of the vector must stay below `2 pi`, where the rotations about
/// all axes coincide.
#[derive(Clone, Debug, PartialEq)]
pub struct RigidCondition {
    /// The surface's name.
    pub surface: String,
    /// The reference point in the reference state, m; `None` is the centroid of the surface.
    pub reference: Option<[f64; 3]>,
    /// Prescribed displacement of the reference point by component, m.
    pub displacement: [Option<f64>; 3],
    /// Prescribed rotation vector by component, rad.
    pub rotation: [Option<f64>; 3],
    /// The factor over pseudo-time of displacement and rotation.
    pub curve: LoadCurve,
}

/// A rigid condition on a mesh.
#[derive(Clone, Debug)]
pub(super) struct ResolvedRigid {
    pub surface: RigidSurface,
    /// The prescribed values at a factor of 1: displacement, m, then rotation, rad.
    values: [Option<f64>; 6],
    curve: Arc<LoadCurve>,
}

impl RigidCondition {
    pub(super) fn resolve(&self, mesh: &Mesh) -> Result<ResolvedRigid, BoundaryError> {
        let (number, surface) = find_surface(mesh, &self.surface)?;
        let reference = self.reference.unwrap_or_else(|| centroid(mesh, surface));
        let ([ux, uy, uz], [rx, ry, rz]) = (self.displacement, self.rotation);
        let values = [ux, uy, uz, rx, ry, rz];
        let resolved = ResolvedRigid {
            surface: RigidSurface::new(number, reference, surface.nodes(), mesh.nodes()),
            values,
            curve: Arc::new(self.curve.clone()),
        };
        let given = values.iter().flatten().copied().chain(reference);
        let numbers: Vec<f64> = given.chain([0.0, 1.0].map(|t| resolved.factor(t))).collect();
        check_finite(|| Source::Surface(number).describe(mesh), &numbers)?;
        Ok(resolved)
    }
}

impl ResolvedRigid {
    fn factor(&self, t: f64) -> f64 {
        self.curve.factor(t, self.surface.reference)
    }

    /// Returns which of the six unknowns are prescribed.
    pub fn prescribed(&self) -> [bool; 6] {
        self.values.map(|value| value.is_some())
    }

    /// Writes the prescribed components of the motion at pseudo-time `t`.
    pub fn apply(&self, t: f64, motion: &mut RigidMotion) {
        let factor = self.factor(t);
        let components = motion.displacement.iter_mut().chain(&mut motion.rotation);
        for (component, value) in components.zip(self.values) {
            if let Some(value) = value {
                *component = value * factor;
            }
        }
    }

    /// Returns true if the surface cannot move its nodes along x, y or z (`component` 0, 1, 2), whatever its other
    /// motions: the component is then held without a condition of its own.
    pub fn holds(&self, component: usize) -> bool {
        let is_held = |k: usize| self.values[k] == Some(0.0);
        is_held(component) && (0..3).all(|k| k == component || is_held(3 + k))
    }

    /// Returns true if the surface holds the displacements that a component prescribes on one of its nodes.
    pub fn agrees_with(&self, component: &PrescribedComponent) -> bool {
        component.value == 0.0 && self.holds(usize::from(component.component))
    }

    pub fn break_points(&self) -> Vec<f64> {
        let moves = self.values.iter().flatten().any(|&value| value != 0.0);
        if moves { self.curve.break_points() } else { Vec::new() }
    }
}

fn centroid(mesh: &Mesh, surface: &Surface) -> [f64; 3] {
    let (mut area, mut moment) = (0.0, Vector3::zeros());
    for (face_type, nodes) in surface.faces.typed() {
        let positions = mesh.positions_of(nodes);
        face_type.integrate(&positions, |values, normal| {
            let part = Vector3::from(normal).norm();
            let position: Vector3<f64> =
                positions.iter().zip(values).map(|(x, value)| Vector3::from(*x) * *value).sum();
            area += part;
            moment += position * part;
        });
    }
    if area > 0.0 { (moment / area).into() } else { moment.into() }
}
