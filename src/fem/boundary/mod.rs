//! Boundary conditions: named [`Conditions`], resolved on a mesh into a [`Boundary`].
//!
//! A condition prescribes displacements, makes a surface rigid, or is a [`Load`]. A new load is a new file that
//! implements [`LoadCondition`] and [`Load`]; nothing else in [`fem`](crate::fem) depends on the kind of load.
//!
//! # Shared nodes
//! Two surfaces with prescribed displacements may share a node and prescribe the same component there. Equal
//! displacements are allowed; the reaction is then assigned to the first condition, surfaces before points. Different
//! displacements cause a [`BoundaryError::Conflict`], so the order of the conditions never decides a displacement. Two
//! displacements are equal if their values and curves are, or if they agree exactly at every hundredth of pseudo-time and at
//! the break points of both curves.
//!
//! A plane of symmetry may share nodes with any other condition that leaves them in the plane; the conditions share the
//! reaction by their directions. A rigid surface gets the whole reaction of its nodes; other conditions may hold only
//! components there that the rigid surface holds itself, and an inclined plane of symmetry must be one in which it moves.
//! Its displacement is then normal to the normal of the plane, and its rotation vector parallel to it: free components always,
//! prescribed ones at every hundredth of pseudo-time and at the break points, up to `1e-4` of the greatest displacement
//! or rotation. The rigid surface alone moves the nodes, also by the remainder.

mod conditions;
mod curve;
mod dead;
mod error;
mod foundation;
mod load;
mod part;
mod plane;
mod point_load;
mod prescribed;
mod pressure;
mod resolve;
mod restraints;
mod rigid;
mod skew;

pub use conditions::{Conditions, PointCondition, PointDisplacement, PointLocation, SurfaceCondition};
pub use curve::{CurveError, LoadCurve, LoadFunction, LoadTable};
pub use dead::{BodyForce, Traction};
pub use error::BoundaryError;
pub use foundation::Foundation;
pub use load::{CoupledNodes, Indivisible, Load, LoadCondition, Support};
pub use point_load::PointLoad;
pub use prescribed::{PrescribedComponent, Source};
pub use pressure::Pressure;
pub(in crate::fem) use pressure::{add_pressure_stiffness, unmatched_edges};
#[cfg(feature = "app")]
pub(crate) use rigid::centroid;
pub use rigid::{RigidCondition, TimedValue};

use std::sync::Arc;

use super::kinematics::{Kinematics, RigidMotion};
use super::mesh::{Mesh, Surface};
use crate::las::Symmetry;
use prescribed::PrescribedCollector;
use resolve::{check_coupled_nodes, rigid_surfaces, symmetry_planes};
use rigid::ResolvedRigid;
use skew::{GivenDirection, SkewNode};

/// Both ends of pseudo-time, at which the conditions themselves are checked.
const ENDS: [f64; 2] = [0.0, 1.0];

/// Boundary conditions resolved on a mesh.
#[derive(Debug)]
pub struct Boundary {
    prescribed_components: Vec<PrescribedComponent>,
    /// Nodes with prescribed displacements along other directions than x, y and z, ascending.
    skew_nodes: Vec<SkewNode>,
    rigid: Vec<ResolvedRigid>,
    kinematics: Arc<Kinematics>,
    loads: Vec<Box<dyn Load>>,
    /// The node of each point condition; `None` if it belongs to another rank.
    point_nodes: Vec<Option<u32>>,
}

impl Boundary {
    /// Resolves the names and distributes the loads to nodes.
    ///
    /// # Errors
    /// Returns [`BoundaryError`] if a name or node is unknown, a value is not finite, two conditions conflict, or a
    /// load couples nodes that no element contains.
    pub fn new(mesh: &Mesh, conditions: &Conditions) -> Result<Self, BoundaryError> {
        let mut boundary = Self::without_supports(mesh, conditions)?;
        if conditions.hold_free_modes {
            boundary.hold_free_modes(mesh);
        }
        Ok(boundary)
    }

    /// Resolves the conditions on an excerpt of the mesh; `supports` are the [`Boundary::free_mode_supports`] of the whole
    /// mesh. Loads and prescribed displacements at the nodes of the part are those on the whole mesh.
    pub(in crate::fem) fn on_excerpt(
        excerpt: &Mesh,
        conditions: &Conditions,
        supports: &[(u32, u8)],
    ) -> Result<Self, BoundaryError> {
        let mut boundary = Self::without_supports(excerpt, conditions)?;
        let local = |&(node, component): &(u32, u8)| Some((excerpt.local_node(node)?, component));
        boundary.hold(excerpt, supports.iter().filter_map(local));
        Ok(boundary)
    }

    fn without_supports(mesh: &Mesh, conditions: &Conditions) -> Result<Self, BoundaryError> {
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
        for PointDisplacement { point, component, value, curve } in &conditions.point_displacements {
            let known = point_nodes.len();
            let node = point_nodes.get(*point).ok_or(BoundaryError::UnknownPoint { point: *point, known })?;
            if *component > 2 {
                return Err(BoundaryError::UnknownComponent { point: *point, component: *component });
            }
            let displacement: [Option<f64>; 3] = std::array::from_fn(|i| (i == *component).then_some(*value));
            prescribed.add(&[*node], &displacement, curve, Source::Point(*point))?;
        }
        let mut planes = symmetry_planes(mesh, &conditions.symmetry_planes, &mut prescribed)?;
        let rigid = rigid_surfaces(mesh, &conditions.rigid, &mut prescribed, &mut planes)?;
        let skew_nodes = planes.into_iter().map(|(node, mut directions)| {
            directions.extend(prescribed.take(node).into_iter().map(GivenDirection::of_component));
            SkewNode::new(mesh, node, directions)
        });
        let skew_nodes = skew_nodes.collect::<Result<Vec<_>, _>>()?;
        let mut loads = Vec::new();
        for condition in &conditions.loads {
            let load = condition.resolve(mesh)?;
            check_coupled_nodes(mesh, load.coupled_nodes())?;
            loads.push(load);
        }
        let frames = skew_nodes.iter().map(|node| (node.node, node.frame)).collect();
        let surfaces = rigid.iter().map(|rigid| rigid.surface.clone()).collect();
        let kinematics = Arc::new(Kinematics::new(mesh.nodes().len(), frames, surfaces));
        let prescribed_components = prescribed.into_components();
        let point_nodes = point_nodes.into_iter().map(Some).collect();
        Ok(Self { prescribed_components, skew_nodes, rigid, kinematics, loads, point_nodes })
    }

    /// Checks that loads and prescribed displacements are finite at these pseudo-times, where they act on the mesh of the
    /// conditions. Both ends of pseudo-time were checked with the conditions, which suffices for curves that are
    /// [separable](LoadCurve::is_separable).
    ///
    /// # Errors
    /// Returns [`BoundaryError::NotFiniteAt`] for the first value that is not finite.
    pub fn check_finite(&self, mesh: &Mesh, times: &[f64]) -> Result<(), BoundaryError> {
        let components = self.prescribed_components.iter().chain(self.skew_nodes.iter().flat_map(SkewNode::components));
        let components: Vec<_> = components.filter(|component| !component.is_separable()).collect();
        for &t in times {
            components.iter().try_for_each(|component| component.check_finite(mesh, t))?;
            self.rigid.iter().try_for_each(|rigid| rigid.check_finite(mesh, t))?;
            self.loads.iter().try_for_each(|load| load.check_finite(t))?;
        }
        Ok(())
    }

    /// Returns which components of the `nodes` nodes are prescribed. Those of a node with a frame
    /// ([`Kinematics`]) are components along the frame; those of the nodes of a rigid surface are all prescribed.
    ///
    /// # Panics
    /// Panics if `nodes` is less than the number of nodes of the mesh.
    pub fn prescribed_mask(&self, nodes: usize) -> Vec<[bool; 3]> {
        let mut mask = vec![[false; 3]; nodes];
        for prescribed in &self.prescribed_components {
            mask[prescribed.node as usize][usize::from(prescribed.component)] = true;
        }
        for skew in &self.skew_nodes {
            mask[skew.node as usize] = std::array::from_fn(|k| k < skew.prescribed());
        }
        for node in self.rigid.iter().flat_map(|rigid| &rigid.surface.nodes) {
            mask[*node as usize] = [true; 3];
        }
        mask
    }

    /// Returns which displacement components along x, y and z of the `nodes` nodes cannot change: prescribed ones,
    /// except those of nodes that move along inclined planes or with a rigid surface.
    ///
    /// # Panics
    /// Panics if `nodes` is less than the number of nodes of the mesh.
    pub fn fixed_components(&self, nodes: usize) -> Vec<[bool; 3]> {
        let mut mask = self.prescribed_mask(nodes);
        for skew in &self.skew_nodes {
            mask[skew.node as usize] = [skew.prescribed() == 3; 3];
        }
        for rigid in &self.rigid {
            let is_fixed = rigid.prescribed().iter().all(|&prescribed| prescribed);
            rigid.surface.nodes.iter().for_each(|&node| mask[node as usize] = [is_fixed; 3]);
        }
        mask
    }

    /// Returns which of the six unknowns of each rigid surface are prescribed.
    pub fn prescribed_of_rigid_surfaces(&self) -> Vec<[bool; 6]> {
        self.rigid.iter().map(ResolvedRigid::prescribed).collect()
    }

    /// Returns the map from unknowns to displacements of nodes.
    pub fn kinematics(&self) -> &Arc<Kinematics> {
        &self.kinematics
    }

    /// Returns the number of free unknowns of a mesh of `nodes` nodes.
    ///
    /// # Panics
    /// Panics if `nodes` is less than the number of nodes of the mesh.
    pub fn free_unknowns(&self, nodes: usize) -> usize {
        let of_nodes = self.prescribed_mask(nodes).as_flattened().iter().filter(|&&prescribed| !prescribed).count();
        let of_surfaces = self.prescribed_of_rigid_surfaces();
        of_nodes + of_surfaces.as_flattened().iter().filter(|&&prescribed| !prescribed).count()
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

    /// Returns the symmetry of the tangent: the weakest of `body`, of the loads that depend on the displacements, and
    /// of rigid surfaces that can rotate, which may make the tangent indefinite.
    pub fn symmetry(&self, body: Symmetry) -> Symmetry {
        let rotates = self.rigid.iter().any(|rigid| rigid.prescribed()[3..].contains(&false));
        let body = if rotates && body == Symmetry::Definite { Symmetry::Symmetric } else { body };
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
        let of_rigid = self.rigid.iter().flat_map(ResolvedRigid::break_points);
        let prescribed = prescribed.chain(self.skew_nodes.iter().flat_map(SkewNode::break_points)).chain(of_rigid);
        let mut times: Vec<f64> = prescribed.chain(self.loads.iter().flat_map(|load| load.break_points())).collect();
        times.sort_by(f64::total_cmp);
        times.dedup();
        times
    }

    /// Returns the node of each point condition; `None` if the mesh is a part and the node belongs to another rank.
    pub fn point_nodes(&self) -> &[Option<u32>] {
        &self.point_nodes
    }

    /// Writes the prescribed displacements of pseudo-time `t`, m, and the prescribed components of the `motions` of the
    /// rigid surfaces; leaves the other components unchanged.
    ///
    /// # Panics
    /// Panics if `displacements` has fewer nodes than the mesh.
    pub fn apply_prescribed(&self, t: f64, displacements: &mut [[f64; 3]], motions: &mut [RigidMotion]) {
        for prescribed in &self.prescribed_components {
            displacements[prescribed.node as usize][usize::from(prescribed.component)] = prescribed.displacement(t);
        }
        for skew in &self.skew_nodes {
            skew.apply(t, &mut displacements[skew.node as usize]);
        }
        for (rigid, motion) in self.rigid.iter().zip(motions) {
            rigid.apply(t, motion);
            rigid.surface.place(motion, displacements);
        }
    }

    /// Calls `add` with every reaction, N, at the nodes for which `is_counted` returns true: the part of the force
    /// `internal - external` on a node that a condition exerts on the body.
    pub(super) fn reactions(
        &self,
        (internal, external): (&[[f64; 3]], &[[f64; 3]]),
        is_counted: impl Fn(u32) -> bool,
        mut add: impl FnMut(Source, [f64; 3]),
    ) {
        let exerted = |node: u32| -> [f64; 3] {
            std::array::from_fn(|i| internal[node as usize][i] - external[node as usize][i])
        };
        for prescribed in self.prescribed_components.iter().filter(|component| is_counted(component.node)) {
            let (component, mut force) = (usize::from(prescribed.component), [0.0; 3]);
            force[component] = exerted(prescribed.node)[component];
            add(prescribed.source, force);
        }
        for skew in self.skew_nodes.iter().filter(|skew| is_counted(skew.node)) {
            skew.reactions(exerted(skew.node)).for_each(|(source, force)| add(source, force.into()));
        }
        for rigid in &self.rigid {
            let nodes = rigid.surface.nodes.iter().filter(|&&node| is_counted(node));
            nodes.for_each(|&node| add(Source::Surface(rigid.surface.surface), exerted(node)));
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

fn check_finite(place: impl FnOnce() -> String, values: &[f64]) -> Result<(), BoundaryError> {
    match values.iter().find(|value| !value.is_finite()) {
        Some(&value) => Err(BoundaryError::NotFinite { place: place(), value }),
        None => Ok(()),
    }
}

/// Checks the values of a load at a pseudo-time and a position.
fn check_finite_at(
    place: impl FnOnce() -> String,
    (values, curve): (&[f64], &LoadCurve),
    t: f64,
    position: [f64; 3],
) -> Result<(), BoundaryError> {
    let factor = curve.factor(t, position);
    match values.iter().map(|value| value * factor).find(|value| !value.is_finite()) {
        Some(value) => {
            let formula = curve.formula().map(str::to_owned);
            Err(BoundaryError::NotFiniteAt { place: place(), value, formula, t, position })
        }
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
    match place {
        PointLocation::Node(node) => {
            let known = u32::try_from(node).ok().and_then(|node| mesh.local_node(node));
            known.ok_or_else(|| BoundaryError::UnknownNode { node, nodes: mesh.whole().nodes })
        }
        PointLocation::Nearest(position) => {
            check_finite(|| Source::Point(number).describe(mesh), &position)?;
            Ok(mesh.nearest_node(position).0 as u32)
        }
    }
}

#[cfg(test)]
mod tests;
