//! Equilibrium of the body as a nonlinear problem: find the displacements at which internal and external forces
//! balance.

mod checks;
mod constraints;
mod largest_residual;
mod linearize;
mod near_null_space;
mod problem;
mod rank_sums;

use std::sync::Arc;

use nalgebra::Matrix3;
use thiserror::Error;

use super::assembly::Assembler;
use super::boundary::Boundary;
use super::constraint::{Constraints, VolumeState};
use super::kinematics::RigidMotion;
use super::mesh::Mesh;
use super::point_field::{PointField, PointResponses};
use super::reactions::BoundaryForces;
use crate::las::{Backend, RealBackend, ResidualScale, VectorOps};
use crate::parallel;
use constraints::Volumes;
pub use largest_residual::LargestResidual;
pub use linearize::LinearizedStart;
use rank_sums::{Divided, RankSums};

/// The reason why the body has no residual at a state, or why a state cannot be committed.
#[derive(Clone, Debug, Error, PartialEq)]
pub enum EquilibriumError<E, F> {
    /// The point field failed at a point: `J <= 0`, or an RVE without equilibrium.
    #[error(transparent)]
    PointField(#[from] E),
    /// The point field failed on another rank, at a point of its part of the body.
    #[error("a point of another rank has no response")]
    OtherRank,
    /// An operation of the backend failed.
    #[error(transparent)]
    Backend(F),
    /// Equilibrium was restored repeatedly with responses that continue the committed state, but each time the new
    /// equilibrium has responses that do not continue it. Holds the number of times that responses were replaced.
    #[error(
        "materials at some points, such as fiber networks, snap to other equilibria than those that continue from the last converged state, still after {0} corrections"
    )]
    OffBranch(usize),
    /// Points kept changing their material after equilibrium was restored repeatedly at the same load. Holds the number
    /// of times that equilibrium was restored.
    #[error("points still change their material after equilibrium was restored {0} times at this load")]
    StillChanging(usize),
    /// The loads do not balance on the deformed body, and nothing but the supports against free rigid-body modes holds
    /// it.
    #[error(
        "the forces or moments of the loads do not balance on the deformed body: a support against a rigid-body mode exerts {force:.3e} N (at most {limit:.3e} N are due to rounding and the tolerance)"
    )]
    UnbalancedLoads {
        /// The largest force component, N.
        force: f64,
        /// The largest one that the residual explains, N.
        limit: f64,
    },
    /// Augmentation of the pressures of the penalty method did not bring a volume to its target.
    #[error(
        "the volume of constraint `{constraint}` is {volume:.6e} m^3 after {rounds} augmentations of its pressure; its target is {target:.6e} m^3"
    )]
    VolumeNotReached {
        /// The name of the constraint.
        constraint: String,
        /// The volume, m^3.
        volume: f64,
        /// The target volume, m^3.
        target: f64,
        /// Number of augmentations.
        rounds: usize,
    },
    /// The trial state about to be committed is out of balance.
    #[error("the converged state is out of balance: |r| = {residual:.3e} N, but Newton stops at {limit:.3e} N")]
    OutOfBalance {
        /// Norm of the residual of the free unknowns and of the constraints, N.
        residual: f64,
        /// The convergence threshold of Newton at this state, N.
        limit: f64,
    },
}

/// The complete state of the body at one pseudo-time, for all nodes and all integration points; that of the part of a rank if
/// the body is divided.
#[derive(Clone, Debug, PartialEq)]
pub struct BodyState {
    /// Pseudo-time.
    pub t: f64,
    /// Displacements of the nodes, m.
    pub displacements: Vec<[f64; 3]>,
    /// Motions of the rigid surfaces; the displacements of their nodes follow from them.
    pub rigid: Vec<RigidMotion>,
    /// Deformation gradient of each point; in patches of elements, that of the F-bar method.
    pub gradients: Vec<Matrix3<f64>>,
    /// Energy, stress and tangent of each point.
    pub responses: PointResponses,
    /// Internal force at each node, N, including prescribed components, and including the pressures of constrained
    /// regions.
    pub internal: Vec<[f64; 3]>,
    /// External force at each node, N, including the pressures of constrained cavities.
    pub external: Vec<[f64; 3]>,
    /// Volume, target and pressure of each constraint.
    pub volumes: Vec<VolumeState>,
}

impl BodyState {
    fn undeformed(mesh: &Mesh, boundary: &Boundary, constraints: usize) -> Self {
        let (nodes, points) = (mesh.nodes().len(), mesh.points().len());
        Self {
            t: 0.0,
            displacements: vec![[0.0; 3]; nodes],
            rigid: vec![RigidMotion::default(); boundary.kinematics().rigid_surfaces().len()],
            gradients: parallel::filled(Matrix3::identity(), points),
            responses: PointResponses::zeros(points),
            internal: vec![[0.0; 3]; nodes],
            external: vec![[0.0; 3]; nodes],
            volumes: vec![VolumeState::default(); constraints],
        }
    }
}

/// The body: mesh, boundary conditions, point field, and state.
///
/// The body keeps two states: the trial state, which Newton changes, and the state committed by
/// [`Equilibrium::commit`]. Both include stresses and tangents, so the point field is never evaluated twice at one
/// state.
pub struct Equilibrium<B: Backend, P> {
    mesh: Arc<Mesh>,
    boundary: Boundary,
    assembler: Assembler<B>,
    field: P,
    trial: BodyState,
    committed: BodyState,
    /// Displacements and motions to which [`NonlinearProblem::restore`](crate::las::NonlinearProblem::restore) returns.
    saved: (Vec<[f64; 3]>, Vec<RigidMotion>),
    volumes: Volumes,
    ranks: RankSums<B>,
    /// Work array for nodal forces or increments that are copied to or from a vector.
    nodal: Vec<[f64; 3]>,
    /// The norm of the residual due to rounding of deformation gradients of order one, N.
    floor: f64,
    /// The largest gradient of a shape function, 1/m.
    steepest: f64,
}

impl<B: RealBackend, P: PointField> Equilibrium<B, P> {
    /// Creates the undeformed body at `t = 0`. Its tangent gives the linearized start of the first step and the floor
    /// of the residual.
    ///
    /// # Errors
    /// Returns [`EquilibriumError::PointField`] if the point field fails at `F = I`.
    pub fn new(
        mesh: Arc<Mesh>,
        boundary: Boundary,
        assembler: Assembler<B>,
        field: P,
    ) -> Result<Self, EquilibriumError<P::Error, B::Error>> {
        Self::constrained(mesh, boundary, Constraints::default(), assembler, field)
    }

    /// Creates a body like [`Equilibrium::new`], with volume constraints that were given to
    /// [`Assembler::locate_constraints`].
    ///
    /// # Errors
    /// As for [`Equilibrium::new`].
    pub fn constrained(
        mesh: Arc<Mesh>,
        boundary: Boundary,
        constraints: Constraints,
        assembler: Assembler<B>,
        field: P,
    ) -> Result<Self, EquilibriumError<P::Error, B::Error>> {
        Self::on_ranks(RankSums::new(None), mesh, boundary, constraints, assembler, field)
    }

    /// Creates the part of a body that this rank holds: `mesh` is a part of a mesh, and `context` that of the linear
    /// system of the part ([`Backend::with_rows`]); the whole body has this number of unknowns. All ranks call it, and all
    /// other methods, alike.
    ///
    /// # Errors
    /// As for [`Equilibrium::new`].
    pub(super) fn on_part(
        (context, unknowns): (B::Context, usize),
        mesh: Arc<Mesh>,
        boundary: Boundary,
        constraints: Constraints,
        assembler: Assembler<B>,
        field: P,
    ) -> Result<Self, EquilibriumError<P::Error, B::Error>> {
        let ranks = RankSums::new(mesh.part().map(|part| Divided { part: Arc::clone(part), context, unknowns }));
        Self::on_ranks(ranks, mesh, boundary, constraints, assembler, field)
    }

    fn on_ranks(
        ranks: RankSums<B>,
        mesh: Arc<Mesh>,
        boundary: Boundary,
        constraints: Constraints,
        assembler: Assembler<B>,
        field: P,
    ) -> Result<Self, EquilibriumError<P::Error, B::Error>> {
        let [trial, committed] = [0; 2].map(|_| BodyState::undeformed(&mesh, &boundary, constraints.len()));
        let volumes = Volumes::new(constraints, mesh.nodes().len());
        let mut steepest = [assembler.geometry().steepest_gradient()];
        ranks.max(&mut steepest).map_err(EquilibriumError::Backend)?;
        let mut body = Self {
            committed,
            saved: (trial.displacements.clone(), trial.rigid.clone()),
            nodal: trial.displacements.clone(),
            volumes,
            ranks,
            floor: 0.0,
            steepest: steepest[0],
            mesh,
            boundary,
            assembler,
            field,
            trial,
        };
        body.evaluate_points()?;
        let mut squares = [body.assembler.squared_errors(&body.trial.responses.tangent)];
        body.ranks.sum(&mut squares).map_err(EquilibriumError::Backend)?;
        body.floor = Assembler::<B>::rounding_error_of(squares[0]);
        body.start_constraints();
        body.commit(true)?;
        Ok(body)
    }

    /// Returns the mesh.
    pub fn mesh(&self) -> &Arc<Mesh> {
        &self.mesh
    }

    /// Returns the boundary conditions.
    pub fn boundary(&self) -> &Boundary {
        &self.boundary
    }

    /// Returns the point field.
    pub fn field(&self) -> &P {
        &self.field
    }

    /// Returns the point field, so that its micro states can be restored.
    pub(super) fn field_mut(&mut self) -> &mut P {
        &mut self.field
    }

    /// Returns the committed state.
    pub fn committed(&self) -> &BodyState {
        &self.committed
    }

    /// Returns the surface and point forces on the body in the committed state. Collective if the body is divided; all
    /// values are then NaN if the ranks cannot communicate.
    pub fn forces(&self) -> BoundaryForces {
        let add = |forces: &mut BoundaryForces| self.add_cavity_resultants(&self.committed, forces);
        let sum = |values: &mut [f64]| self.sum_or_nan(values);
        BoundaryForces::of_ranks(&self.mesh, &self.boundary, &self.committed, add, sum)
    }

    /// Returns the volume of each region in the committed state, m^3, in the order of [`Mesh::regions`]. Collective like
    /// [`Equilibrium::forces`].
    pub fn region_volumes(&self) -> Vec<f64> {
        let mut volumes = self.mesh.deformed_region_volumes(&self.committed.displacements);
        self.sum_or_nan(&mut volumes);
        volumes
    }

    fn sum_or_nan(&self, values: &mut [f64]) {
        if self.ranks.sum(values).is_err() {
            values.fill(f64::NAN);
        }
    }

    /// Replaces the responses that do not continue the committed state by responses that do; see
    /// [`PointField::verify`]. Returns true if any was replaced; the state may then be out of balance.
    ///
    /// # Errors
    /// Returns [`EquilibriumError::PointField`] if a continuation does not exist.
    pub(super) fn verify(&mut self) -> Result<bool, EquilibriumError<P::Error, B::Error>> {
        let Self { field, trial, .. } = self;
        Ok(field.verify(&trial.gradients, &mut trial.responses)?)
    }

    /// Changes the material of points as the trial state demands; see [`PointField::evolve`]. Returns true if a point
    /// changed; the state is then out of balance.
    ///
    /// # Errors
    /// Returns [`EquilibriumError::PointField`] if other ranks cannot be reached.
    pub(super) fn evolve(&mut self) -> Result<bool, EquilibriumError<P::Error, B::Error>> {
        Ok(self.field.evolve()?)
    }

    /// Commits the trial state, at which the residual was evaluated last. `ends_step` is as for [`PointField::commit`].
    ///
    /// # Errors
    /// Returns [`EquilibriumError::PointField`] if the point field cannot commit.
    pub fn commit(&mut self, ends_step: bool) -> Result<(), EquilibriumError<P::Error, B::Error>> {
        self.field.commit(ends_step)?;
        std::mem::swap(&mut self.trial, &mut self.committed);
        self.reset_to_committed();
        Ok(())
    }

    /// Resets displacements, motions and volumes of the trial state to the committed ones.
    fn reset_to_committed(&mut self) {
        self.trial.displacements.copy_from_slice(&self.committed.displacements);
        self.trial.rigid.copy_from_slice(&self.committed.rigid);
        self.trial.volumes.copy_from_slice(&self.committed.volumes);
    }

    /// Writes internal minus external forces of the trial state into the work array.
    fn set_net_forces(&mut self) {
        net_forces(&self.trial, &mut self.nodal);
    }

    /// Returns the scale of the residual of the trial state and its norm that is due to rounding, N: of deformation
    /// gradients of order one, or of displacements that are longer than an element.
    fn residual_scale(&self) -> Result<ResidualScale, B::Error> {
        let BodyState { displacements, internal, external, volumes, .. } = &self.trial;
        let mut squares = [self.ranks.squares(internal), self.ranks.squares(external)];
        self.ranks.sum(&mut squares)?;
        let forces = squares[0].sqrt().max(squares[1].sqrt());
        let mut largest = [displacements.as_flattened().iter().fold(0.0, |most: f64, u| most.max(u.abs()))];
        self.ranks.max(&mut largest)?;
        let gradient = (self.steepest * largest[0]).max(1.0);
        let norms = self.volumes.gradient_norms(&self.ranks)?;
        Ok(ResidualScale {
            scale: forces.max(Volumes::scale(volumes, &norms)),
            floor: (gradient * self.floor).hypot(self.volumes.floor(volumes, &norms, largest[0])),
        })
    }

    /// Resets the trial displacements and the micro states to the committed ones.
    ///
    /// # Errors
    /// Returns [`EquilibriumError::PointField`] if the point field cannot revert.
    pub fn revert(&mut self) -> Result<(), EquilibriumError<P::Error, B::Error>> {
        self.trial.t = self.committed.t;
        self.reset_to_committed();
        Ok(self.field.revert()?)
    }

    /// Commits the state with these displacements, motions and pressures at pseudo-time `t`, independently of the
    /// previously committed one.
    pub(super) fn restore_at(
        &mut self,
        t: f64,
        displacements: &[[f64; 3]],
        rigid: &[RigidMotion],
        pressures: &[[f64; 2]],
    ) -> Result<(), EquilibriumError<P::Error, B::Error>> {
        self.trial.t = t;
        self.trial.displacements.copy_from_slice(displacements);
        self.trial.rigid.copy_from_slice(rigid);
        self.set_pressures(pressures);
        self.set_targets();
        self.evaluate_external_forces();
        self.evaluate_points()?;
        self.add_constraint_forces();
        self.commit(true)
    }

    /// Starts a step to pseudo-time `t`: the trial state is the committed state with the prescribed displacements, the
    /// external forces and the target volumes of `t`.
    pub fn begin_step(&mut self, t: f64) {
        self.trial.t = t;
        self.reset_to_committed();
        self.boundary.apply_prescribed(t, &mut self.trial.displacements, &mut self.trial.rigid);
        self.set_targets();
        self.evaluate_external_forces();
    }

    /// Evaluates the external forces of the trial state.
    fn evaluate_external_forces(&mut self) {
        let trial = &mut self.trial;
        self.boundary.external_forces(trial.t, &trial.displacements, &mut trial.external);
    }

    /// Adds the tangent stiffness of the points and of the loads at pseudo-time `t` to `k`, and that of the rigid
    /// surfaces under the net forces in the work array.
    fn add_tangent(&self, state: &BodyState, t: f64, k: &mut B::Matrix) -> Result<(), B::Error> {
        let BodyState { displacements, rigid, responses, .. } = state;
        self.assembler.stiffness(displacements, rigid, responses, k)?;
        self.assembler.load_stiffness(self.boundary.loads(), t, displacements, rigid, k)?;
        self.assembler.rigid_stiffness(rigid, &self.nodal, k)?;
        self.add_constraint_stiffness(state, k)
    }

    /// Evaluates stresses, tangents and internal forces of the trial state.
    fn evaluate_points(&mut self) -> Result<(), EquilibriumError<P::Error, B::Error>> {
        let trial = &mut self.trial;
        self.assembler.deformation_gradients(&trial.displacements, &mut trial.gradients);
        let updated = match self.field.update(&trial.gradients, &mut trial.responses) {
            // The ranks cannot communicate.
            Err(error) if P::is_final(&error) => return Err(error.into()),
            updated => updated,
        };
        let mut failed = [f64::from(u8::from(updated.is_err()))];
        self.ranks.max(&mut failed).map_err(EquilibriumError::Backend)?;
        updated?;
        if failed[0] > 0.0 {
            return Err(EquilibriumError::OtherRank);
        }
        self.assembler.internal_forces(&trial.displacements, &trial.responses.pk1, &mut trial.internal);
        Ok(())
    }

    fn advance_displacements(&mut self, a: f64, direction: &B::Vector) -> Result<(), B::Error> {
        let BodyState { displacements, rigid, .. } = &mut self.trial;
        self.assembler.advance(a, direction, displacements, rigid, &mut self.nodal)
    }
}

/// Writes the forces on nodes, at these motions of the rigid surfaces, into `r` at the free unknowns; overwrites
/// `forces`.
fn scatter<B: RealBackend>(
    assembler: &Assembler<B>,
    forces: &mut [[f64; 3]],
    rigid: &[RigidMotion],
    r: &mut B::Vector,
) -> Result<(), B::Error> {
    r.zero()?;
    assembler.scatter(forces, rigid, r)?;
    r.finish()
}

/// The number of nodes that one thread treats at a time.
const NODES_PER_CHUNK: usize = 4096;

/// Writes internal minus external forces of a state into `net`.
fn net_forces(state: &BodyState, net: &mut [[f64; 3]]) {
    let forces = state.internal.chunks(NODES_PER_CHUNK).zip(state.external.chunks(NODES_PER_CHUNK));
    parallel::map(net.chunks_mut(NODES_PER_CHUNK).zip(forces), |(net, (internal, external))| {
        for ((net, internal), external) in net.iter_mut().zip(internal).zip(external) {
            *net = std::array::from_fn(|i| internal[i] - external[i]);
        }
    });
}
