//! Concentrated forces on nodes.

use super::{
    BoundaryError, ENDS, Indivisible, Load, LoadCondition, LoadCurve, PointLocation, Source, check_finite,
    check_finite_at, find_node,
};
use crate::fem::mesh::{Mesh, Part};

/// A force on the node of a point condition, whose direction and magnitude do not follow the deformation.
///
/// The displacement under a concentrated force grows without bound as the mesh is refined; a traction on a small
/// surface does not have this defect.
#[derive(Clone, Debug, PartialEq)]
pub struct PointLoad {
    /// The point condition to which the force is assigned: index into
    /// [`Conditions::points`](super::Conditions::points).
    pub point: usize,
    /// The node, that of the point condition.
    pub place: PointLocation,
    /// The force at a factor of 1, N.
    pub value: [f64; 3],
    /// The factor over pseudo-time.
    pub curve: LoadCurve,
}

#[derive(Clone, Debug)]
struct Concentrated {
    point: usize,
    /// The point condition in messages.
    place: String,
    node: u32,
    /// The reference position of the node, m.
    position: [f64; 3],
    value: [f64; 3],
    curve: LoadCurve,
}

impl LoadCondition for PointLoad {
    fn resolve(&self, mesh: &Mesh) -> Result<Box<dyn Load>, BoundaryError> {
        let node = find_node(mesh, self.point, self.place)?;
        check_finite(|| Source::Point(self.point).describe(mesh), &self.value)?;
        let (position, curve) = (mesh.nodes()[node as usize], self.curve.clone());
        let place = Source::Point(self.point).describe(mesh);
        let load = Concentrated { point: self.point, place, node, position, value: self.value, curve };
        ENDS.into_iter().try_for_each(|t| load.check_finite_at(t))?;
        Ok(Box::new(load))
    }
}

impl Concentrated {
    fn check_finite_at(&self, t: f64) -> Result<(), BoundaryError> {
        check_finite_at(|| self.place.clone(), (&self.value, &self.curve), t, self.position)
    }
}

impl Load for Concentrated {
    fn add_forces(&self, t: f64, displacements: &[[f64; 3]], forces: &mut [[f64; 3]]) {
        let force = self.resultant(t, displacements);
        forces[self.node as usize].iter_mut().zip(force).for_each(|(sum, force)| *sum += force);
    }

    fn resultant(&self, t: f64, _: &[[f64; 3]]) -> [f64; 3] {
        self.value.map(|value| value * self.curve.factor(t, self.position))
    }

    fn break_points(&self) -> Vec<f64> {
        self.curve.break_points()
    }

    fn check_finite(&self, t: f64) -> Result<(), BoundaryError> {
        if self.curve.is_separable() { Ok(()) } else { self.check_finite_at(t) }
    }

    fn source(&self) -> Option<Source> {
        Some(Source::Point(self.point))
    }

    fn on_part(&self, part: &Part) -> Result<Option<Box<dyn Load>>, Indivisible> {
        Ok(part.own_node(self.node).map(|node| -> Box<dyn Load> { Box::new(Self { node, ..self.clone() }) }))
    }
}
