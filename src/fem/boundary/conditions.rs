//! Boundary conditions by name: surfaces, points and regions with their values and load curves.

use std::sync::Arc;

use super::{LoadCondition, LoadCurve};
use crate::fem::constraint::VolumeConstraint;

/// All boundary conditions of a body.
///
/// ```
/// use std::sync::Arc;
/// use biotissue::fem::boundary::{Conditions, LoadCurve, SurfaceCondition, Traction};
///
/// let clamp = SurfaceCondition { surface: "x0".into(), displacement: [Some(0.0); 3], curve: LoadCurve::Ramp };
/// let pull = Traction { surface: "x1".into(), value: [2.0e3, 0.0, 0.0], curve: LoadCurve::Ramp };
/// let conditions = Conditions { surfaces: vec![clamp], loads: vec![Arc::new(pull)], ..Conditions::default() };
/// assert!(conditions.points.is_empty());
/// ```
#[derive(Clone, Debug, Default)]
pub struct Conditions {
    /// Prescribed displacements of surfaces. At a shared edge, the first condition gets the reaction (see
    /// [`reactions`](crate::fem::reactions)).
    pub surfaces: Vec<SurfaceCondition>,
    /// Prescribed displacements of single nodes.
    pub points: Vec<PointCondition>,
    /// Loads, whose forces are added in this order: [`Traction`](super::Traction),
    /// [`Pressure`](super::Pressure), [`Foundation`](super::Foundation), [`PointLoad`](super::PointLoad),
    /// [`BodyForce`](super::BodyForce), or any other implementation of [`LoadCondition`].
    pub loads: Vec<Arc<dyn LoadCondition>>,
    /// Volumes of regions and cavities that are held or driven.
    pub constraints: Vec<VolumeConstraint>,
}

/// A prescribed displacement of a surface. The surface may also carry loads, for example a traction along y while its
/// displacement along x is prescribed.
#[derive(Clone, Debug, PartialEq)]
pub struct SurfaceCondition {
    /// The surface's name.
    pub surface: String,
    /// Prescribed displacement by component, m; `None` leaves the component free.
    pub displacement: [Option<f64>; 3],
    /// The factor over pseudo-time.
    pub curve: LoadCurve,
}

/// A point whose force and displacement are reported, and the prescribed displacement of its node.
#[derive(Clone, Debug, PartialEq)]
pub struct PointCondition {
    /// The node.
    pub place: PointLocation,
    /// Prescribed displacement by component, m; `None` leaves the component free.
    pub displacement: [Option<f64>; 3],
    /// The factor over pseudo-time.
    pub curve: LoadCurve,
}

/// The node of a point condition.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum PointLocation {
    /// The node nearest to a position in meters; the lowest index if several are equally near.
    Nearest([f64; 3]),
    /// The node of this index, from 0.
    Node(usize),
}
