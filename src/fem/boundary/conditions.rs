//! What is prescribed, in the words of whoever prescribes it: names of surfaces and regions, values, curves.

use super::LoadCurve;

/// All that is prescribed on a body.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Conditions {
    /// On surfaces; the order decides to whom a shared edge belongs (see [`reactions`](crate::fem::reactions)).
    pub surfaces: Vec<SurfaceCondition>,
    /// At single nodes.
    pub points: Vec<PointCondition>,
    /// In regions.
    pub body_forces: Vec<BodyForce>,
}

/// What is prescribed on a surface. A surface may be named more than once: held along x, loaded along y.
#[derive(Clone, Debug, PartialEq)]
pub struct SurfaceCondition {
    /// The surface's name.
    pub surface: String,
    /// What is prescribed.
    pub load: SurfaceLoad,
    /// Its course.
    pub curve: LoadCurve,
}

/// What a surface condition prescribes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum SurfaceLoad {
    /// Displacement by component, m; `None` is free.
    Displacement([Option<f64>; 3]),
    /// Dead traction, Pa of reference area: direction and size do not follow the deformation.
    Traction([f64; 3]),
}

/// What is prescribed at a node.
#[derive(Clone, Debug, PartialEq)]
pub struct PointCondition {
    /// Which node.
    pub place: PointLocation,
    /// Displacement by component, m; `None` is free.
    pub displacement: [Option<f64>; 3],
    /// Its course.
    pub curve: LoadCurve,
}

/// Which node.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum PointLocation {
    /// The one nearest to a position in meters; of several, the first.
    Nearest([f64; 3]),
    /// The one of this index, from 0.
    Node(usize),
}

/// A dead force per reference volume.
#[derive(Clone, Debug, PartialEq)]
pub struct BodyForce {
    /// The region's name; `*` is all of the body.
    pub region: String,
    /// N/m^3.
    pub value: [f64; 3],
    /// Its course.
    pub curve: LoadCurve,
}
