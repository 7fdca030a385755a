//! Rigid surfaces: nodes that follow a reference point.

use std::f64::consts::TAU;

use nalgebra::Vector3;

use super::prescribed::compared_times;
use super::{BoundaryError, ENDS, LoadCurve, PrescribedComponent, Source, check_finite, check_finite_at, find_surface};
use crate::fem::kinematics::{RigidMotion, RigidSurface};
use crate::fem::mesh::{Mesh, Part, Surface};

/// The greatest part of a displacement that may be normal to a plane of symmetry, and the greatest sine of an angle between a
/// rotation vector and the normal: above the errors of values with 5 digits, and of the normal of a mesh whose coordinates
/// have 6 digits.
const OUT_OF_PLANE: f64 = 1e-4;

/// A surface whose nodes move as a rigid body, like a grip: the node at `X` moves by `d + (R - I) (X - X_ref)`. The
/// displacement `d` of the reference point and the rotation vector of `R` are prescribed or free, component by
/// component. The forces on the body in a free direction of `d` sum to zero, as do the moments conjugate to a free
/// component of the rotation vector.
///
/// The rotation vector is the axis times the angle; a rotation about a fixed axis is prescribed by three components,
/// two of which may be 0. With a free component, the length of the vector must stay below `2 pi`, where the rotations
/// about all axes coincide. The moment conjugate to a free component is the moment about its axis only for small
/// rotations: with the derivative `T` of the rotation, `T^T m = 0` in that component.
#[derive(Clone, Debug, PartialEq)]
pub struct RigidCondition {
    /// The surface's name.
    pub surface: String,
    /// The reference point in the reference state, m; `None` is the centroid of the surface.
    pub reference: Option<[f64; 3]>,
    /// Prescribed displacement of the reference point by component, m.
    pub displacement: [Option<TimedValue>; 3],
    /// Prescribed rotation vector by component, rad.
    pub rotation: [Option<TimedValue>; 3],
}

/// A value with its factor over pseudo-time, which is evaluated at the reference point.
#[derive(Clone, Debug, PartialEq)]
pub struct TimedValue {
    /// The value at a factor of 1.
    pub value: f64,
    /// The factor.
    pub curve: LoadCurve,
}

impl From<f64> for TimedValue {
    /// A value that grows in proportion to pseudo-time.
    fn from(value: f64) -> Self {
        Self { value, curve: LoadCurve::Ramp }
    }
}

/// A rigid condition on a mesh.
#[derive(Clone, Debug)]
pub(super) struct ResolvedRigid {
    pub surface: RigidSurface,
    /// The prescribed components: displacement, m, then rotation, rad.
    components: [Option<TimedValue>; 6],
}

impl RigidCondition {
    pub(super) fn resolve(&self, mesh: &Mesh) -> Result<ResolvedRigid, BoundaryError> {
        let (number, surface) = find_surface(mesh, &self.surface)?;
        let reference = self.reference.unwrap_or_else(|| centroid(mesh, surface));
        let ([ux, uy, uz], [rx, ry, rz]) = (self.displacement.clone(), self.rotation.clone());
        let resolved = ResolvedRigid {
            surface: RigidSurface::new(number, reference, surface.nodes(), mesh.nodes()),
            components: [ux, uy, uz, rx, ry, rz],
        };
        check_finite(|| Source::Surface(number).describe(mesh), &reference)?;
        ENDS.into_iter().try_for_each(|t| resolved.check_finite(mesh, t))?;
        resolved.check_angle(&self.surface)?;
        Ok(resolved)
    }
}

impl ResolvedRigid {
    /// Returns the rigid surface on a part of the mesh.
    pub fn on_part(&self, part: &Part) -> Self {
        Self { surface: self.surface.on_part(|node| part.local_node(node)), components: self.components.clone() }
    }

    /// Checks that the prescribed part of a rotation vector with free components stays below the length at which the
    /// vector does not determine the rotation about other axes.
    fn check_angle(&self, surface: &str) -> Result<(), BoundaryError> {
        /// Curves are checked at so many equal intervals of pseudo-time.
        const SAMPLES: usize = 64;
        if self.prescribed()[3..].iter().all(|&prescribed| prescribed) {
            return Ok(());
        }
        let angle = |k: usize| {
            let mut motion = RigidMotion::default();
            self.apply(k as f64 / SAMPLES as f64, &mut motion);
            Vector3::from(motion.rotation).norm()
        };
        let largest = (0..=SAMPLES).map(angle).fold(0.0, f64::max);
        // Values that are not finite are reported where they are used.
        if largest < TAU || !largest.is_finite() {
            return Ok(());
        }
        Err(BoundaryError::RotationTooLarge { surface: surface.to_owned(), angle: largest })
    }

    /// Checks that the prescribed components are finite at pseudo-time `t`.
    pub fn check_finite(&self, mesh: &Mesh, t: f64) -> Result<(), BoundaryError> {
        let place = || Source::Surface(self.surface.surface).describe(mesh);
        let mut components = self.components.iter().flatten();
        components.try_for_each(|TimedValue { value, curve }| {
            check_finite_at(place, (&[*value], curve), t, self.surface.reference)
        })
    }

    /// Returns which of the six unknowns are prescribed.
    pub fn prescribed(&self) -> [bool; 6] {
        self.components.each_ref().map(Option::is_some)
    }

    /// Writes the prescribed components of the motion at pseudo-time `t`.
    pub fn apply(&self, t: f64, motion: &mut RigidMotion) {
        let components = motion.displacement.iter_mut().chain(&mut motion.rotation);
        for (component, prescribed) in components.zip(&self.components) {
            if let Some(TimedValue { value, curve }) = prescribed {
                *component = value * curve.factor(t, self.surface.reference);
            }
        }
    }

    /// Returns true if the surface cannot move its nodes along x, y or z (`component` 0, 1, 2), whatever its other
    /// motions: the component is then held without a condition of its own.
    pub fn holds(&self, component: usize) -> bool {
        let is_held = |k: usize| self.components[k].as_ref().is_some_and(|component| component.value == 0.0);
        is_held(component) && (0..3).all(|k| k == component || is_held(3 + k))
    }

    /// Returns the motions at the times at which motions are compared, with free components of 0.
    pub fn compared_motions(&self) -> Vec<RigidMotion> {
        let at = |t: f64| {
            let mut motion = RigidMotion::default();
            self.apply(t, &mut motion);
            motion
        };
        compared_times(self.break_points()).map(at).collect()
    }

    /// Returns true if the surface moves its nodes within planes with this normal, whatever its free motions, given
    /// the [compared motions](Self::compared_motions): the displacement is normal to it, and so is every free component;
    /// the rotation vector is parallel to it, and so is every free component.
    pub fn stays_in_plane(&self, normal: &Vector3<f64>, motions: &[RigidMotion]) -> bool {
        let free = |first: usize| (0..3).filter(move |k| self.components[first + k].is_none()).map(unit);
        let out = |displacement: Vector3<f64>| normal.dot(&displacement).abs();
        let tilt = |rotation: Vector3<f64>| normal.cross(&rotation).norm();
        if free(0).any(|axis| out(axis) > OUT_OF_PLANE) || free(3).any(|axis| tilt(axis) > OUT_OF_PLANE) {
            return false;
        }
        let displacements = || motions.iter().map(|motion| Vector3::from(motion.displacement));
        let rotations = || motions.iter().map(|motion| Vector3::from(motion.rotation));
        let limit = |largest: f64, scale: f64| OUT_OF_PLANE * largest + 16.0 * f64::EPSILON * scale;
        let farthest = limit(displacements().map(|d| d.norm()).fold(0.0, f64::max), self.surface.length);
        let widest = limit(rotations().map(|theta| theta.norm()).fold(0.0, f64::max), 1.0);
        displacements().all(|d| out(d) <= farthest) && rotations().all(|theta| tilt(theta) <= widest)
    }

    /// Returns true if the surface holds the displacements that a component prescribes on one of its nodes.
    pub fn agrees_with(&self, component: &PrescribedComponent) -> bool {
        component.is_held() && self.holds(usize::from(component.component))
    }

    pub fn break_points(&self) -> Vec<f64> {
        let moving = self.components.iter().flatten().filter(|component| component.value != 0.0);
        moving.flat_map(|component| component.curve.break_points()).collect()
    }
}

fn unit(axis: usize) -> Vector3<f64> {
    Vector3::ith(axis, 1.0)
}

/// Returns the centroid of a surface, m.
pub(crate) fn centroid(mesh: &Mesh, surface: &Surface) -> [f64; 3] {
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
