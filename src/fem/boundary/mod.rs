//! Boundary conditions: named [`Conditions`], resolved on a mesh into a [`Boundary`].
//!
//! # Shared nodes
//! Two surfaces with prescribed displacements may share a node and prescribe the same component there. Equal values
//! (with equal curves, unless the value is 0) are allowed; the reaction is then assigned to the first condition,
//! surfaces before points. Different values cause a [`BoundaryError::Conflict`], so the order of the conditions never
//! decides a displacement.

mod conditions;
mod curve;
mod error;

use std::collections::BTreeMap;
use std::sync::Arc;

pub use conditions::{BodyForce, Conditions, PointCondition, PointLocation, SurfaceCondition, SurfaceLoad};
pub use curve::{CurveError, LoadCurve, LoadTable};
pub use error::BoundaryError;

use super::mesh::{Mesh, Surface};

/// The origin of a prescribed displacement or a load.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Source {
    /// A surface: index into [`Mesh::surfaces`].
    Surface(usize),
    /// A point condition: index into [`Conditions::points`].
    Point(usize),
    /// A body force: index into [`Conditions::body_forces`].
    Body(usize),
}

/// One prescribed displacement component.
#[derive(Clone, Debug, PartialEq)]
pub struct Held {
    /// The node.
    pub node: u32,
    /// 0, 1, 2 for x, y, z.
    pub component: u8,
    /// Displacement at a factor of 1, m.
    pub value: f64,
    /// The condition that prescribes the component.
    pub source: Source,
    curve: Arc<LoadCurve>,
}

/// A load distributed over nodes: the force on node `a` is `share_a * value * factor(t)`.
#[derive(Clone, Debug, PartialEq)]
pub struct NodalLoad {
    /// The origin of the load.
    pub source: Source,
    /// Pa for a traction, N/m^3 for a body force.
    pub value: [f64; 3],
    /// Nodes with their shares of the area, m^2, or volume, m^3; ascending by node.
    pub shares: Vec<(u32, f64)>,
    curve: Arc<LoadCurve>,
}

/// Boundary conditions resolved on a mesh.
#[derive(Clone, Debug, PartialEq)]
pub struct Boundary {
    held: Vec<Held>,
    loads: Vec<NodalLoad>,
    points: Vec<u32>,
}

impl Boundary {
    /// Resolves the names and distributes the loads to nodes.
    ///
    /// # Errors
    /// Returns [`BoundaryError`] if a name or node is unknown, a value is not finite, or two conditions conflict.
    pub fn new(mesh: &Mesh, conditions: &Conditions) -> Result<Self, BoundaryError> {
        let mut holding = Holding { held: BTreeMap::new(), mesh };
        let mut loads = Vec::new();
        for condition in &conditions.surfaces {
            let (number, surface) = find_surface(mesh, &condition.surface)?;
            let source = Source::Surface(number);
            match &condition.load {
                SurfaceLoad::Displacement(displacement) => {
                    holding.hold(&surface.nodes(), displacement, &Arc::new(condition.curve.clone()), source)?;
                }
                SurfaceLoad::Traction(value) => {
                    check_finite(mesh, source, value)?;
                    loads.push(NodalLoad {
                        source,
                        value: *value,
                        shares: area_shares(mesh, surface),
                        curve: Arc::new(condition.curve.clone()),
                    });
                }
            }
        }
        let mut points = Vec::new();
        for (number, point) in conditions.points.iter().enumerate() {
            let node = find_node(mesh, number, point.place)?;
            points.push(node);
            holding.hold(&[node], &point.displacement, &Arc::new(point.curve.clone()), Source::Point(number))?;
        }
        for (number, force) in conditions.body_forces.iter().enumerate() {
            let source = Source::Body(number);
            check_finite(mesh, source, &force.value)?;
            let shares = volume_shares(mesh, &force.region)?;
            loads.push(NodalLoad { source, value: force.value, shares, curve: Arc::new(force.curve.clone()) });
        }
        Ok(Self { held: holding.held.into_values().collect(), loads, points })
    }

    /// Returns which components of the `nodes` nodes are prescribed by surface or point conditions.
    ///
    /// # Panics
    /// Panics if `nodes` is less than the number of nodes of the mesh.
    #[must_use]
    pub fn prescribed(&self, nodes: usize) -> Vec<[bool; 3]> {
        let mut prescribed = vec![[false; 3]; nodes];
        for held in &self.held {
            prescribed[held.node as usize][usize::from(held.component)] = true;
        }
        prescribed
    }

    /// Returns the prescribed components, ascending by node and component.
    #[must_use]
    pub fn held(&self) -> &[Held] {
        &self.held
    }

    /// Returns the loads: tractions, then body forces, in the order of the conditions.
    #[must_use]
    pub fn loads(&self) -> &[NodalLoad] {
        &self.loads
    }

    /// Returns the node of each point condition.
    #[must_use]
    pub fn points(&self) -> &[u32] {
        &self.points
    }

    /// Writes the prescribed displacements of pseudo-time `t`, m; leaves the other components unchanged.
    ///
    /// # Panics
    /// Panics if `displacements` has fewer nodes than the mesh.
    pub fn prescribe(&self, t: f64, displacements: &mut [[f64; 3]]) {
        for held in &self.held {
            displacements[held.node as usize][usize::from(held.component)] = held.value * held.curve.factor(t);
        }
    }

    /// Writes the external forces of pseudo-time `t` on all nodes, N.
    ///
    /// # Panics
    /// Panics if `forces` has fewer nodes than the mesh.
    pub fn external_forces(&self, t: f64, forces: &mut [[f64; 3]]) {
        forces.fill([0.0; 3]);
        for load in &self.loads {
            load.add_forces(t, forces);
        }
    }
}

impl NodalLoad {
    fn add_forces(&self, t: f64, forces: &mut [[f64; 3]]) {
        let force = self.per_share(t);
        for &(node, share) in &self.shares {
            for (sum, force) in forces[node as usize].iter_mut().zip(force) {
                *sum += share * force;
            }
        }
    }

    /// Returns the resultant force at pseudo-time `t`, N.
    #[must_use]
    pub fn resultant(&self, t: f64) -> [f64; 3] {
        let whole: f64 = self.shares.iter().map(|(_, share)| share).sum();
        self.per_share(t).map(|force| whole * force)
    }

    fn per_share(&self, t: f64) -> [f64; 3] {
        let factor = self.curve.factor(t);
        self.value.map(|value| value * factor)
    }
}

/// Collects prescribed components and detects conflicting values.
struct Holding<'m> {
    held: BTreeMap<(u32, u8), Held>,
    mesh: &'m Mesh,
}

impl Holding<'_> {
    fn hold(
        &mut self,
        nodes: &[u32],
        displacement: &[Option<f64>; 3],
        curve: &Arc<LoadCurve>,
        source: Source,
    ) -> Result<(), BoundaryError> {
        for (component, value) in (0_u8..).zip(displacement) {
            let Some(value) = *value else { continue };
            check_finite(self.mesh, source, &[value])?;
            for &node in nodes {
                let held = Held { node, component, value, source, curve: Arc::clone(curve) };
                self.insert(held)?;
            }
        }
        Ok(())
    }

    fn insert(&mut self, held: Held) -> Result<(), BoundaryError> {
        let key = (held.node, held.component);
        let Some(first) = self.held.get(&key) else {
            self.held.insert(key, held);
            return Ok(());
        };
        if first.value == held.value && (first.value == 0.0 || first.curve == held.curve) {
            return Ok(());
        }
        Err(BoundaryError::Conflict {
            node: held.node as usize,
            component: usize::from(held.component),
            first: describe(self.mesh, first.source),
            first_value: first.value,
            second: describe(self.mesh, held.source),
            second_value: held.value,
        })
    }
}

fn describe(mesh: &Mesh, source: Source) -> String {
    match source {
        Source::Surface(number) => {
            let name = mesh.surfaces().get(number).map_or("?", |surface| surface.name.as_str());
            format!("surface `{name}`")
        }
        Source::Point(number) => format!("point condition {}", number + 1),
        Source::Body(number) => format!("body force {}", number + 1),
    }
}

fn check_finite(mesh: &Mesh, source: Source, values: &[f64]) -> Result<(), BoundaryError> {
    match values.iter().find(|value| !value.is_finite()) {
        Some(&value) => Err(BoundaryError::NotFinite { place: describe(mesh, source), value }),
        None => Ok(()),
    }
}

fn find_surface<'m>(mesh: &'m Mesh, name: &str) -> Result<(usize, &'m Surface), BoundaryError> {
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
            check_finite(mesh, Source::Point(number), &position)?;
            mesh.nearest_node(position).0
        }
    };
    u32::try_from(node).ok().filter(|_| node < nodes).ok_or(BoundaryError::UnknownNode { node, nodes })
}

/// Returns the nodal shares of a surface: each node of a triangle gets a third of its reference area, the integral of
/// the shape function.
fn area_shares(mesh: &Mesh, surface: &Surface) -> Vec<(u32, f64)> {
    let mut shares = BTreeMap::new();
    for &triangle in &surface.triangles {
        let [x, y, z] = mesh.area_vector(triangle);
        let share = (x * x + y * y + z * z).sqrt() / 3.0;
        for node in triangle {
            *shares.entry(node).or_insert(0.0) += share;
        }
    }
    shares.into_iter().collect()
}

/// Returns the nodal shares of a region: each node of an element gets a quarter of its volume.
fn volume_shares(mesh: &Mesh, region: &str) -> Result<Vec<(u32, f64)>, BoundaryError> {
    let number =
        match region {
            "*" => None,
            name => Some(mesh.region(name).ok_or_else(|| BoundaryError::UnknownRegion {
                name: name.to_owned(),
                known: mesh.regions().to_vec(),
            })?),
        };
    let mut shares = BTreeMap::new();
    for (element, (nodes, &of)) in mesh.elements().iter().zip(mesh.region_of()).enumerate() {
        if number.is_none_or(|number| number == of) {
            let share = mesh.element_volume(element) / 4.0;
            for &node in nodes {
                *shares.entry(node).or_insert(0.0) += share;
            }
        }
    }
    Ok(shares.into_iter().collect())
}

#[cfg(test)]
mod tests;
