//! Boundary conditions by name: surfaces, points and regions with their values and load curves.

use std::sync::Arc;

use super::{LoadCondition, LoadCurve, RigidCondition};
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
    /// Displacement components at those nodes with curves of their own.
    pub point_displacements: Vec<PointDisplacement>,
    /// Loads, whose forces are added in this order: [`Traction`](super::Traction),
    /// [`Pressure`](super::Pressure), [`Foundation`](super::Foundation), [`PointLoad`](super::PointLoad),
    /// [`BodyForce`](super::BodyForce), or any other implementation of [`LoadCondition`].
    pub loads: Vec<Arc<dyn LoadCondition>>,
    /// The names of plane surfaces, of any orientation, whose nodes do not move along the normal: planes of symmetry,
    /// or frictionless walls.
    pub symmetry_planes: Vec<String>,
    /// Surfaces that move as rigid bodies.
    pub rigid: Vec<RigidCondition>,
    /// Whether the nodes of each part of the body get as many additional zero displacements as are necessary to prevent
    /// its rigid-body motions. The loads must balance, so that these supports exert no force.
    pub hold_free_modes: bool,
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

/// A displacement component of the node of a point condition with a curve of its own.
#[derive(Clone, Debug, PartialEq)]
pub struct PointDisplacement {
    /// The point condition to which the reaction is assigned: index into [`Conditions::points`].
    pub point: usize,
    /// 0, 1, 2 for x, y, z.
    pub component: usize,
    /// The displacement at a factor of 1, m.
    pub value: f64,
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
