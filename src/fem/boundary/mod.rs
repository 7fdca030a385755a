//! Boundary conditions: named [`Conditions`], resolved on a mesh into a [`Boundary`].
//!
//! A condition either prescribes displacements or is a [`Load`]. A new load is a new file that implements
//! [`LoadCondition`] and [`Load`]; nothing else in [`fem`](crate::fem) depends on the kind of load.
//!
//! # Shared nodes
//! Two surfaces with prescribed displacements may share a node and prescribe the same component there. Equal values
//! (with equal curves, unless the value is 0) are allowed; the reaction is then assigned to the first condition,
//! surfaces before points. Different values cause a [`BoundaryError::Conflict`], so the order of the conditions never
//! decides a displacement.

mod conditions;
mod curve;
mod dead;
mod error;
mod foundation;
mod load;
mod point_load;
mod prescribed;
mod pressure;

pub use conditions::{Conditions, PointCondition, PointLocation, SurfaceCondition};
pub use curve::{CurveError, LoadCurve, LoadFunction, LoadTable};
pub use dead::{BodyForce, Traction};
pub use error::BoundaryError;
pub use foundation::Foundation;
pub use load::{CoupledNodes, Load, LoadCondition, Support};
pub use point_load::PointLoad;
pub use prescribed::{PrescribedComponent, Source};
pub use pressure::Pressure;
pub(in crate::fem) use pressure::{add_pressure_stiffness, unmatched_edges};

use super::mesh::{Mesh, Surface};
use crate::las::Symmetry;
use prescribed::PrescribedCollector;

/// Boundary conditions resolved on a mesh.
#[derive(Debug)]
pub struct Boundary {
    prescribed_components: Vec<PrescribedComponent>,
    loads: Vec<Box<dyn Load>>,
    point_nodes: Vec<u32>,
}

impl Boundary {
    /// Resolves the names and distributes the loads to nodes.
    ///
    /// # Errors
    /// Returns [`BoundaryError`] if a name or node is unknown, a value is not finite, two conditions conflict, or a
    /// load couples nodes that no element contains.
    pub fn new(mesh: &Mesh, conditions: &Conditions) -> Result<Self, BoundaryError> {
        let mut prescribed = PrescribedCollector::new(mesh);
        for condition in &conditions.surfaces {
            let (number, surface) = find_surface(mesh, &condition.surface)?;
            prescribed.add(&surface.nodes(), &condition.displacement, &condition.curve, Source::Surface(number))?;
        }
        let mut point_nodes = Vec::new();
        for (number, point) in conditions.points.iter().enumerate() {
            let node = find_node(mesh, number, point.place)?;
            point_nodes.push(node);
            prescribed.add(&[node], &point.displacement, &point.curve, Source::Point(number))?;
        }
        let mut loads = Vec::new();
        for condition in &conditions.loads {
            let load = condition.resolve(mesh)?;
            check_coupled_nodes(mesh, load.coupled_nodes())?;
            loads.push(load);
        }
        Ok(Self { prescribed_components: prescribed.into_components(), loads, point_nodes })
    }

    /// Returns which components of the `nodes` nodes are prescribed by surface or point conditions.
    ///
    /// # Panics
    /// Panics if `nodes` is less than the number of nodes of the mesh.
    pub fn prescribed_mask(&self, nodes: usize) -> Vec<[bool; 3]> {
        let mut mask = vec![[false; 3]; nodes];
        for prescribed in &self.prescribed_components {
            mask[prescribed.node as usize][usize::from(prescribed.component)] = true;
        }
        mask
    }

    /// Returns the prescribed components, ascending by node and component.
    pub fn prescribed_components(&self) -> &[PrescribedComponent] {
        &self.prescribed_components
    }

    /// Returns the loads, in the order of the conditions.
    pub fn loads(&self) -> &[Box<dyn Load>] {
        &self.loads
    }

    /// Returns the directions in which loads resist motions of nodes.
    pub fn supports(&self) -> impl Iterator<Item = &Support> {
        self.loads.iter().flat_map(|load| load.supports())
    }

    /// Returns true if the external forces depend on the displacements.
    pub fn depends_on_displacements(&self) -> bool {
        self.loads.iter().any(|load| !load.coupled_nodes().is_none())
    }

    /// Returns the symmetry of the tangent: the weakest of `body` and of the loads that depend on the displacements.
    pub fn symmetry(&self, body: Symmetry) -> Symmetry {
        let coupled = self.loads.iter().filter(|load| !load.coupled_nodes().is_none());
        coupled.fold(body, |weakest, load| match (weakest, load.symmetry()) {
            (Symmetry::None, _) | (_, Symmetry::None) => Symmetry::None,
            (Symmetry::Symmetric, _) | (_, Symmetry::Symmetric) => Symmetry::Symmetric,
            (Symmetry::Definite, Symmetry::Definite) => Symmetry::Definite,
        })
    }

    /// Returns the pseudo-times at which the rate of a load or of a prescribed displacement jumps, ascending.
    pub fn break_points(&self) -> Vec<f64> {
        let prescribed = self.prescribed_components.iter().flat_map(PrescribedComponent::break_points);
        let mut times: Vec<f64> = prescribed.chain(self.loads.iter().flat_map(|load| load.break_points())).collect();
        times.sort_by(f64::total_cmp);
        times.dedup();
        times
    }

    /// Returns the node of each point condition.
    pub fn point_nodes(&self) -> &[u32] {
        &self.point_nodes
    }

    /// Writes the prescribed displacements of pseudo-time `t`, m; leaves the other components unchanged.
    ///
    /// # Panics
    /// Panics if `displacements` has fewer nodes than the mesh.
    pub fn apply_prescribed(&self, t: f64, displacements: &mut [[f64; 3]]) {
        for prescribed in &self.prescribed_components {
            displacements[prescribed.node as usize][usize::from(prescribed.component)] = prescribed.displacement(t);
        }
    }

    /// Writes the external forces at pseudo-time `t` and at these displacements (m) on all nodes, N.
    ///
    /// # Panics
    /// Panics if `forces` has fewer nodes than the mesh.
    pub fn external_forces(&self, t: f64, displacements: &[[f64; 3]], forces: &mut [[f64; 3]]) {
        forces.fill([0.0; 3]);
        for load in &self.loads {
            load.add_forces(t, displacements, forces);
        }
    }
}

/// Checks that the nodes of each group belong to one element, so that the sparsity pattern couples them.
fn check_coupled_nodes(mesh: &Mesh, coupled: CoupledNodes<'_>) -> Result<(), BoundaryError> {
    if coupled.is_none() {
        return Ok(());
    }
    let mut elements_of = vec![Vec::new(); mesh.nodes().len()];
    for nodes in mesh.elements() {
        nodes.iter().for_each(|&node| elements_of[node as usize].push(nodes));
    }
    for group in coupled.groups() {
        let elements = group.first().and_then(|&node| elements_of.get(node as usize));
        let contain = |nodes: &&[u32]| group.iter().all(|node| nodes.contains(node));
        if !elements.is_some_and(|elements| elements.iter().any(contain)) {
            return Err(BoundaryError::NotInOneElement(group.to_vec()));
        }
    }
    Ok(())
}

fn check_finite(place: impl FnOnce() -> String, values: &[f64]) -> Result<(), BoundaryError> {
    match values.iter().find(|value| !value.is_finite()) {
        Some(&value) => Err(BoundaryError::NotFinite { place: place(), value }),
        None => Ok(()),
    }
}

/// Returns the position at which the shape functions of nodes at `positions` have these values.
fn position_at(positions: impl Iterator<Item = [f64; 3]>, values: &[f64]) -> [f64; 3] {
    positions.zip(values).fold([0.0; 3], |sum, (x, value)| std::array::from_fn(|i| sum[i] + value * x[i]))
}

/// Returns the surface of this name and its index in [`Mesh::surfaces`], for implementations of [`LoadCondition`].
///
/// # Errors
/// Returns [`BoundaryError::UnknownSurface`] if the mesh has no such surface.
pub fn find_surface<'m>(mesh: &'m Mesh, name: &str) -> Result<(usize, &'m Surface), BoundaryError> {
    mesh.surfaces().iter().enumerate().find(|(_, surface)| surface.name == name).ok_or_else(|| {
        BoundaryError::UnknownSurface {
            name: name.to_owned(),
            known: mesh.surface_names().map(str::to_owned).collect(),
        }
    })
}

fn find_node(mesh: &Mesh, number: usize, place: PointLocation) -> Result<u32, BoundaryError> {
    let nodes = mesh.nodes().len();
    let node = match place {
        PointLocation::Node(node) => node,
        PointLocation::Nearest(position) => {
            check_finite(|| Source::Point(number).describe(mesh), &position)?;
            mesh.nearest_node(position).0
        }
    };
    u32::try_from(node).ok().filter(|_| node < nodes).ok_or(BoundaryError::UnknownNode { node, nodes })
}

#[cfg(test)]
mod tests;
