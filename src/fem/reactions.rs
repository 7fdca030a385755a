//! Forces on the body through each surface and each point condition.
//!
//! At a prescribed component the support exerts the reaction `f_int - f_ext`. Each reaction is counted once, for the
//! first condition that prescribes the component; on a rigid surface it is the whole force on the node. The force
//! through a surface or a point is the sum of its reactions and of the loads on it. Free components satisfy `f_int =
//! f_ext`, and internal forces sum to zero. Hence the forces over all surfaces and points sum to minus the body forces,
//! up to the tolerance of Newton.

use nalgebra::Vector3;

use super::boundary::{Boundary, Source};
use super::equilibrium::BodyState;
use super::kinematics::{RigidMotion, RigidSurface};
use super::mesh::{Mesh, Surface};
use crate::parallel;

/// Force, area and mean displacement of one surface.
#[derive(Clone, Debug, PartialEq)]
pub struct SurfaceForce {
    /// The surface's name.
    pub name: String,
    /// Its current (deformed) area, m^2.
    pub area: f64,
    /// Its area in the reference state, m^2.
    pub reference_area: f64,
    /// The force exerted on the body through the surface, N.
    pub force: [f64; 3],
    /// The displacement averaged over the reference area, m.
    pub displacement: [f64; 3],
}

/// Force and displacement of one point condition.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct PointForce {
    /// The node.
    pub node: u32,
    /// The force exerted on the body at the node, N; excludes components that a surface prescribes.
    pub force: [f64; 3],
    /// The displacement of the node, m.
    pub displacement: [f64; 3],
}

/// The motion of a rigid surface and the moment on it.
#[derive(Clone, Debug, PartialEq)]
pub struct RigidForce {
    /// Index into [`BoundaryForces::surfaces`], whose force contains that of the rigid surface.
    pub surface: usize,
    /// The moment about the displaced reference point that is exerted on the body through the surface, by its reactions
    /// and by loads on it, N m.
    pub moment: [f64; 3],
    /// The motion.
    pub motion: RigidMotion,
}

/// All external forces on the body except body forces.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct BoundaryForces {
    /// All surfaces, in the order of [`Mesh::surfaces`].
    pub surfaces: Vec<SurfaceForce>,
    /// All point conditions, in their order.
    pub points: Vec<PointForce>,
    /// All rigid surfaces, in the order of their conditions.
    pub rigid: Vec<RigidForce>,
}

impl BoundaryForces {
    /// Assigns the nodal forces of an equilibrium state to surfaces and points. For a part of a mesh, these are the shares
    /// of its own nodes; [`Stepper::forces`](super::stepping::Stepper::forces) returns the sums over the ranks.
    ///
    /// # Panics
    /// Panics if the state has fewer nodes than the mesh.
    pub fn new(mesh: &Mesh, boundary: &Boundary, state: &BodyState) -> Self {
        Self::of_ranks(mesh, boundary, state, |_| (), |_| ())
    }

    /// Does the same if the mesh may be a part: `add` adds the forces of other loads ([`BoundaryForces::add_load`]), and
    /// `sum` replaces each value by its sum over the ranks.
    pub(super) fn of_ranks(
        mesh: &Mesh,
        boundary: &Boundary,
        state: &BodyState,
        add: impl FnOnce(&mut Self),
        sum: impl FnOnce(&mut [f64]),
    ) -> Self {
        let mut forces = Self::of_own_nodes(mesh, boundary, state);
        add(&mut forces);
        if mesh.part().is_some() {
            let mut values = forces.to_values();
            sum(&mut values);
            forces.set_values(&values);
        }
        forces.surfaces.iter_mut().for_each(SurfaceForce::average_displacement);
        forces
    }

    /// Returns the parts of the forces, areas and displacements that belong to the own nodes; the displacements of surfaces
    /// are still integrals.
    fn of_own_nodes(mesh: &Mesh, boundary: &Boundary, state: &BodyState) -> Self {
        let BodyState { t, displacements, internal, external, .. } = state;
        let surface = |surface: &Surface| SurfaceForce::integrated(mesh, surface, displacements);
        let point = |node: &Option<u32>| {
            node.map_or_else(PointForce::default, |node| PointForce::new(mesh, node, displacements))
        };
        let mut forces = Self {
            surfaces: parallel::map(mesh.surfaces(), surface),
            points: boundary.point_nodes().iter().map(point).collect(),
            rigid: rigid_forces(mesh, boundary, state),
        };
        boundary.reactions(
            (internal, external),
            |node| mesh.is_own_node(node),
            |source, reaction| {
                if let Some(force) = forces.force_mut(source) {
                    force.iter_mut().zip(reaction).for_each(|(sum, part)| *sum += part);
                }
            },
        );
        for load in boundary.loads() {
            if let Some(source) = load.source() {
                let nodal = |forces: &mut [[f64; 3]]| load.add_forces(*t, displacements, forces);
                let resultant = || load.resultant(*t, displacements);
                forces.add_load(source, resultant, nodal, (mesh, boundary));
            }
        }
        forces
    }

    /// Returns all values that are sums over the ranks.
    fn to_values(&self) -> Vec<f64> {
        let of_surface = |s: &SurfaceForce| [[s.area, s.reference_area, 0.0], s.force, s.displacement];
        let of_point = |p: &PointForce| [[f64::from(p.node), 0.0, 0.0], p.force, p.displacement];
        let all = self.surfaces.iter().flat_map(of_surface).chain(self.points.iter().flat_map(of_point));
        all.chain(self.rigid.iter().map(|rigid| rigid.moment)).flatten().collect()
    }

    /// Sets the values of [`BoundaryForces::to_values`].
    fn set_values(&mut self, values: &[f64]) {
        let (values, _) = values.as_chunks::<3>();
        let (of_surfaces, values) = values.split_at(3 * self.surfaces.len());
        let (of_points, moments) = values.split_at(3 * self.points.len());
        self.rigid.iter_mut().zip(moments).for_each(|(rigid, moment)| rigid.moment = *moment);
        for (surface, values) in self.surfaces.iter_mut().zip(of_surfaces.chunks_exact(3)) {
            [surface.area, surface.reference_area, _] = values[0];
            (surface.force, surface.displacement) = (values[1], values[2]);
        }
        for (point, values) in self.points.iter_mut().zip(of_points.chunks_exact(3)) {
            *point = PointForce { node: values[0][0] as u32, force: values[1], displacement: values[2] };
        }
    }

    /// Adds the force of a load, N, and its moment on a rigid surface; `nodal` adds the forces on the nodes. In a part of a
    /// mesh, the force is that on own nodes.
    pub(super) fn add_load(
        &mut self,
        source: Source,
        resultant: impl FnOnce() -> [f64; 3],
        nodal: impl Fn(&mut [[f64; 3]]),
        (mesh, boundary): (&Mesh, &Boundary),
    ) {
        let Some(force) = self.force_mut(source) else { return };
        let resultant = match mesh.part() {
            None => resultant(),
            Some(part) => of_own_nodes(&part.is_own_node, &nodal),
        };
        force.iter_mut().zip(resultant).for_each(|(sum, part)| *sum += part);
        let mut surfaces = self.rigid.iter_mut().zip(boundary.kinematics().rigid_surfaces());
        if let Some((of, rigid)) = surfaces.find(|(of, _)| source == Source::Surface(of.surface))
            && is_own(mesh, rigid)
        {
            let mut forces = vec![[0.0; 3]; mesh.nodes().len()];
            nodal(&mut forces);
            let moment = rigid.moment(&of.motion, &forces);
            of.moment.iter_mut().zip(moment).for_each(|(sum, part)| *sum += part);
        }
    }

    /// Returns the sum over all surfaces and points, N: minus the total body force.
    pub fn sum(&self) -> [f64; 3] {
        let parts = self.surfaces.iter().map(|s| s.force).chain(self.points.iter().map(|p| p.force));
        parts.fold([0.0; 3], |sum, part| std::array::from_fn(|i| sum[i] + part[i]))
    }

    fn force_mut(&mut self, source: Source) -> Option<&mut [f64; 3]> {
        match source {
            Source::Surface(number) => self.surfaces.get_mut(number).map(|surface| &mut surface.force),
            Source::Point(number) => self.points.get_mut(number).map(|point| &mut point.force),
            // These forces are zero.
            Source::FreeMode => None,
        }
    }
}

/// Returns the motions of the rigid surfaces, and the moments on those whose nodes belong to this rank.
fn rigid_forces(mesh: &Mesh, boundary: &Boundary, state: &BodyState) -> Vec<RigidForce> {
    let exerted = state.internal.iter().zip(&state.external);
    let exerted: Vec<[f64; 3]> = exerted.map(|(f, external)| std::array::from_fn(|i| f[i] - external[i])).collect();
    let surfaces = boundary.kinematics().rigid_surfaces().iter().zip(&state.rigid);
    let force = |(rigid, motion): (&RigidSurface, &RigidMotion)| RigidForce {
        surface: rigid.surface,
        moment: if is_own(mesh, rigid) { rigid.moment(motion, &exerted) } else { [0.0; 3] },
        motion: *motion,
    };
    surfaces.map(force).collect()
}

/// Returns true if the nodes of a rigid surface belong to this rank.
fn is_own(mesh: &Mesh, rigid: &RigidSurface) -> bool {
    rigid.nodes.first().is_some_and(|&node| mesh.is_own_node(node))
}

/// Returns the sum over the own nodes of the forces that `nodal` adds, N.
fn of_own_nodes(is_own: &[bool], nodal: impl Fn(&mut [[f64; 3]])) -> [f64; 3] {
    let mut forces = vec![[0.0; 3]; is_own.len()];
    nodal(&mut forces);
    let own = forces.iter().zip(is_own).filter(|(_, is_own)| **is_own);
    own.fold([0.0; 3], |sum, (force, _)| std::array::from_fn(|i| sum[i] + force[i]))
}

impl SurfaceForce {
    /// Integrates area and displacement over the faces whose first node is an own one.
    fn integrated(mesh: &Mesh, surface: &Surface, displacements: &[[f64; 3]]) -> Self {
        let (mut area, mut reference, mut moment) = (0.0, 0.0, [0.0; 3]);
        for (face_type, nodes) in surface.faces.typed().filter(|(_, nodes)| mesh.is_own_node(nodes[0])) {
            let x = mesh.positions_of(nodes);
            let u: Vec<[f64; 3]> = nodes.iter().map(|&node| displacements[node as usize]).collect();
            let current: Vec<[f64; 3]> = x.iter().zip(&u).map(|(x, u)| std::array::from_fn(|i| x[i] + u[i])).collect();
            face_type.integrate(&current, |_, normal| area += Vector3::from(normal).norm());
            face_type.integrate(&x, |values, normal| {
                let share = Vector3::from(normal).norm();
                reference += share;
                for (i, moment) in moment.iter_mut().enumerate() {
                    *moment += share * values.iter().zip(&u).map(|(value, u)| value * u[i]).sum::<f64>();
                }
            });
        }
        Self { name: surface.name.clone(), area, reference_area: reference, force: [0.0; 3], displacement: moment }
    }

    /// Divides the integral of the displacement by the reference area.
    fn average_displacement(&mut self) {
        let reference = self.reference_area;
        self.displacement = if reference > 0.0 { self.displacement.map(|m| m / reference) } else { [0.0; 3] };
    }
}

impl PointForce {
    fn new(mesh: &Mesh, node: u32, displacements: &[[f64; 3]]) -> Self {
        let in_whole = mesh.part().map_or(node, |part| part.nodes[node as usize]);
        Self { node: in_whole, force: [0.0; 3], displacement: displacements[node as usize] }
    }
}
