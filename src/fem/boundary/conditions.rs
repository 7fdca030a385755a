//! Boundary conditions by name: surfaces, points and regions with their values and load curves.

use super::LoadCurve;

/// All boundary conditions of a body.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Conditions {
    /// Surface conditions. At a shared edge, the first condition gets the reaction (see
    /// [`reactions`](crate::fem::reactions)).
    pub surfaces: Vec<SurfaceCondition>,
    /// Conditions at single nodes.
    pub points: Vec<PointCondition>,
    /// Body forces by region.
    pub body_forces: Vec<BodyForce>,
}

/// A condition on a surface. A surface may have several, for example a prescribed displacement along x and a traction
/// along y.
#[derive(Clone, Debug, PartialEq)]
pub struct SurfaceCondition {
    /// The surface's name.
    pub surface: String,
    /// The prescribed displacement or traction.
    pub load: SurfaceLoad,
    /// The factor over pseudo-time.
    pub curve: LoadCurve,
}

/// The type of a surface condition.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum SurfaceLoad {
    /// Prescribed displacement by component, m; `None` leaves the component free.
    Displacement([Option<f64>; 3]),
    /// Dead traction, Pa of reference area: direction and magnitude do not follow the deformation.
    Traction([f64; 3]),
}

/// A prescribed displacement at a node.
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

/// A dead force per reference volume.
#[derive(Clone, Debug, PartialEq)]
pub struct BodyForce {
    /// The region's name; `*` selects the whole body.
    pub region: String,
    /// The force density, N/m^3.
    pub value: [f64; 3],
    /// The factor over pseudo-time.
    pub curve: LoadCurve,
}
