//! The volume constraints of the body: pressures, their forces and stiffness, and the border of the linear system.
//!
//! Newton's method gets constraints in the unit of forces, `w c`, with multipliers `p / w` in meters; see
//! [`constraint`](crate::fem::constraint#weight).

use super::{BodyState, Equilibrium, EquilibriumError, RankSums, scatter};
use crate::fem::assembly::Assembler;
use crate::fem::boundary::Source;
use crate::fem::constraint::{Constraint, ConstraintMethod, Constraints, VolumeState};
use crate::fem::kinematics::RigidMotion;
use crate::fem::point_field::PointField;
use crate::fem::reactions::BoundaryForces;
use crate::las::{Border, NewtonSystem, RealBackend};

/// The constraints of a body with the gradients at the last evaluation.
pub(super) struct Volumes {
    pub constraints: Constraints,
    /// `dV/du` of each constraint at the trial state, m^2, for all nodes.
    gradients: Vec<Vec<[f64; 3]>>,
    /// The states to which Newton returns if it fails.
    pub saved: Vec<VolumeState>,
}

impl Volumes {
    pub fn new(constraints: Constraints, nodes: usize) -> Self {
        let (count, gradient) = (constraints.len(), vec![[0.0; 3]; nodes]);
        Self { constraints, gradients: vec![gradient; count], saved: Vec::new() }
    }

    fn with<'a>(&'a self, states: &'a [VolumeState]) -> impl Iterator<Item = (&'a Constraint, &'a VolumeState)> {
        self.constraints.iter().zip(states)
    }

    /// Returns the norm of the constraints in the unit of forces, N.
    pub fn residual(&self, states: &[VolumeState]) -> f64 {
        let squares = self.with(states).map(|(constraint, state)| weighted_residual(constraint, state).powi(2));
        squares.sum::<f64>().sqrt()
    }

    /// Returns the norm of the gradient of each constraint, m^2.
    pub fn gradient_norms<B: RealBackend>(&self, ranks: &RankSums<B>) -> Result<Vec<f64>, B::Error> {
        let mut squares: Vec<f64> = self.gradients.iter().map(|gradient| ranks.squares(gradient)).collect();
        if !squares.is_empty() {
            ranks.sum(&mut squares)?;
        }
        Ok(squares.into_iter().map(f64::sqrt).collect())
    }

    /// Returns the largest norm of the forces of a constraint, N: the forces of the material may cancel them.
    pub fn scale(states: &[VolumeState], gradient_norms: &[f64]) -> f64 {
        let norms = states.iter().zip(gradient_norms).map(|(state, norm)| state.pressure.abs() * norm);
        norms.fold(0.0, f64::max)
    }

    /// Writes the gradients of the last evaluation by the unknowns at these motions of the rigid surfaces, and the
    /// compliances, in the unit of forces; `nodal` is overwritten.
    fn write_border<B: RealBackend>(
        &self,
        assembler: &Assembler<B>,
        rigid: &[RigidMotion],
        nodal: &mut [[f64; 3]],
        border: &mut Border<B>,
    ) -> Result<(), B::Error> {
        for (j, constraint) in self.constraints.iter().enumerate() {
            let weight = constraint.weight();
            border.compliances[j] = weight * weight * constraint.compliance();
            nodal.iter_mut().zip(&self.gradients[j]).for_each(|(to, from)| *to = from.map(|g| weight * g));
            scatter(assembler, nodal, rigid, &mut border.gradients_mut()[j])?;
        }
        Ok(())
    }

    /// Returns the norm of the constraints that is due to rounding, N: 8 units in the last place of each volume and, by
    /// the gradients of the last evaluation, of displacements of which the largest is `displacement`, m.
    pub fn floor(&self, states: &[VolumeState], gradient_norms: &[f64], displacement: f64) -> f64 {
        let squares = self.with(states).zip(gradient_norms).map(|((constraint, state), norm)| {
            let volume = state.volume.abs().max(state.target) + norm * displacement;
            (8.0 * f64::EPSILON * constraint.weight() * volume).powi(2)
        });
        squares.sum::<f64>().sqrt()
    }
}

fn weighted_residual(constraint: &Constraint, state: &VolumeState) -> f64 {
    constraint.weight() * constraint.residual(state)
}

impl<B: RealBackend, P: PointField> Equilibrium<B, P> {
    /// Returns the volume constraints; [`BodyState::volumes`] has their states.
    pub fn constraints(&self) -> &Constraints {
        &self.volumes.constraints
    }

    /// Sets weights and penalty parameters from the tangents at rest.
    pub(super) fn start_constraints(&mut self) {
        if self.volumes.constraints.is_empty() {
            return;
        }
        let volumes = self.assembler.geometry().volumes();
        let norms: Vec<f64> = self.trial.responses.tangent.iter().map(|tangent| tangent.norm()).collect();
        let own = self.mesh.own_points();
        let mut sums = Vec::with_capacity(2 * self.volumes.constraints.len());
        for constraint in self.volumes.constraints.iter() {
            let is_inside = |point: usize| constraint.region_points().is_none_or(|points| points[point]);
            let points = (0..norms.len()).filter(|&point| is_inside(point) && own[point]);
            let (sum, volume) =
                points.fold((0.0, 0.0), |(sum, all), k| (sum + volumes[k] * norms[k], all + volumes[k]));
            sums.extend([sum, volume]);
        }
        self.sum_or_nan(&mut sums);
        for (constraint, sums) in self.volumes.constraints.iter_mut().zip(sums.chunks_exact(2)) {
            constraint.set_stiffness(sums[0] / sums[1]);
        }
        self.set_targets();
        self.add_constraint_forces();
    }

    /// Sets the targets of the trial state from its pseudo-time.
    pub(super) fn set_targets(&mut self) {
        let BodyState { t, volumes, .. } = &mut self.trial;
        let with_targets = self.volumes.constraints.iter().zip(volumes);
        with_targets.for_each(|(constraint, state)| state.target = constraint.target(*t));
    }

    /// Evaluates the volumes of the trial state, and adds their forces to its internal and external forces.
    pub(super) fn add_constraint_forces(&mut self) {
        let (geometry, trial) = (self.assembler.geometry(), &mut self.trial);
        let gradients = &mut self.volumes.gradients;
        for ((constraint, state), gradient) in self.volumes.constraints.iter().zip(&mut trial.volumes).zip(gradients) {
            state.volume = constraint.evaluate(geometry, &trial.displacements, gradient);
        }
        self.sum_volumes();
        self.add_region_forces();
        self.add_cavity_forces();
    }

    /// Replaces the volumes of the trial state, the shares of this rank, by those of the whole body.
    fn sum_volumes(&mut self) {
        let mut volumes: Vec<f64> = self.trial.volumes.iter().map(|state| state.volume).collect();
        if !volumes.is_empty() {
            self.sum_or_nan(&mut volumes);
        }
        self.trial.volumes.iter_mut().zip(volumes).for_each(|(state, volume)| state.volume = volume);
    }

    /// Adds the forces of regions at the gradients of the last evaluation to the internal forces of the trial state.
    pub(super) fn add_region_forces(&mut self) {
        let BodyState { volumes, internal, .. } = &mut self.trial;
        let constraints = self.volumes.constraints.iter().zip(volumes).zip(&self.volumes.gradients);
        for ((_, state), gradient) in constraints.filter(|((constraint, _), _)| constraint.cavity().is_none()) {
            add_multiple(-state.pressure, gradient, internal);
        }
    }

    /// Adds the forces of cavities at the gradients of the last evaluation to the external forces of the trial state.
    fn add_cavity_forces(&mut self) {
        let BodyState { volumes, external, .. } = &mut self.trial;
        let constraints = self.volumes.constraints.iter().zip(volumes).zip(&self.volumes.gradients);
        for ((_, state), gradient) in constraints.filter(|((constraint, _), _)| constraint.cavity().is_some()) {
            add_multiple(state.pressure, gradient, external);
        }
    }

    /// Adds the stiffness of the pressures of `state`, `-p d^2V/du^2`, to `k`.
    pub(super) fn add_constraint_stiffness(&self, state: &BodyState, k: &mut B::Matrix) -> Result<(), B::Error> {
        let BodyState { displacements, rigid, volumes, .. } = state;
        if let Some(pressures) = self.volumes.constraints.region_pressures(volumes, state.gradients.len()) {
            self.assembler.pressure_stiffness(&pressures, displacements, rigid, k)?;
        }
        if self.volumes.constraints.have_cavities() {
            let pressures: Vec<f64> = volumes.iter().map(|state| state.pressure).collect();
            self.assembler.cavity_stiffness(&self.volumes.constraints, &pressures, displacements, rigid, k)?;
        }
        Ok(())
    }

    /// Adds the forces of cavities to the external forces of the trial state, whose prescribed components have moved by
    /// `increments`, and adds the linearized change of the forces of regions to `self.nodal`.
    pub(super) fn linearize_constraint_forces(&mut self, increments: &[[f64; 3]]) {
        let (geometry, trial) = (self.assembler.geometry(), &self.trial);
        for (constraint, gradient) in self.volumes.constraints.iter().zip(&mut self.volumes.gradients) {
            if constraint.cavity().is_some() {
                constraint.evaluate(geometry, &trial.displacements, gradient);
            }
        }
        self.add_cavity_forces();
        let BodyState { displacements, volumes, gradients, .. } = &self.committed;
        if let Some(pressures) = self.volumes.constraints.region_pressures(volumes, gradients.len()) {
            let geometry = self.assembler.geometry();
            geometry.add_linearized_pressure_forces(&pressures, displacements, increments, &mut self.nodal);
        }
    }

    /// Writes the border of the linearization of the committed state: the gradients at its displacements, and minus the
    /// constraints at the targets of the trial state after the `increments` of the prescribed components.
    pub(super) fn linearize_constraints(
        &mut self,
        increments: &[[f64; 3]],
        system: &mut NewtonSystem<B>,
    ) -> Result<(), B::Error> {
        let geometry = self.assembler.geometry();
        let states = self.trial.volumes.iter_mut().zip(&mut self.volumes.gradients);
        for (constraint, (state, gradient)) in self.volumes.constraints.iter().zip(states) {
            let committed = constraint.evaluate(geometry, &self.committed.displacements, gradient);
            state.volume = committed + self.ranks.product(gradient, increments);
        }
        self.sum_volumes();
        for (j, (constraint, state)) in self.volumes.with(&self.trial.volumes).enumerate() {
            system.border.residuals[j] = -weighted_residual(constraint, state);
        }
        let Self { volumes, nodal, assembler, committed, .. } = self;
        volumes.write_border(assembler, &committed.rigid, nodal, &mut system.border)
    }

    /// Writes the gradients of the last evaluation by the unknowns, at the motions of the rigid surfaces of the trial
    /// state, and the compliances in the unit of forces.
    pub(super) fn write_border(&mut self, border: &mut Border<B>) -> Result<(), B::Error> {
        let Self { volumes, nodal, assembler, trial, .. } = self;
        volumes.write_border(assembler, &trial.rigid, nodal, border)
    }

    /// Writes the constraints in the unit of forces.
    pub(super) fn write_constraint_residuals(&self, c: &mut [f64]) {
        let values = self.volumes.with(&self.trial.volumes);
        c.iter_mut().zip(values).for_each(|(c, (constraint, state))| *c = weighted_residual(constraint, state));
    }

    /// Adds `a` times the increments of the multipliers to the pressures.
    pub(super) fn advance_pressures(&mut self, a: f64, increments: &[f64]) {
        let constraints = self.volumes.constraints.iter().zip(&mut self.trial.volumes).zip(increments);
        constraints.for_each(|((constraint, state), dp)| state.pressure += a * constraint.weight() * dp);
    }

    /// Augments the pressures of the penalty method if a volume is not within `tolerance` of its target, relative to
    /// the reference volume. Returns true if it did; the constraints are then no longer satisfied.
    pub(in crate::fem) fn augment(&mut self, tolerance: f64) -> bool {
        let is_off = |(constraint, state): (&Constraint, &VolumeState)| {
            let is_penalty = matches!(constraint.method(), ConstraintMethod::Penalty { .. });
            is_penalty && (state.volume - state.target).abs() > accepted(constraint, tolerance)
        };
        let augments = self.volumes.with(&self.trial.volumes).any(is_off);
        if augments {
            self.trial.volumes.iter_mut().for_each(|state| state.augmented = state.pressure);
        }
        augments
    }

    /// Returns true if the error of every constraint of the trial state is at most `factor` times `tolerance`, relative
    /// to its reference volume, whatever force would correct it.
    pub(super) fn constraints_hold(&self, tolerance: f64, factor: f64) -> bool {
        let mut constraints = self.volumes.with(&self.trial.volumes);
        constraints
            .all(|(constraint, state)| constraint.residual(state).abs() <= factor * accepted(constraint, tolerance))
    }

    /// Returns the error for volumes that augmentation did not bring to their targets in this number of rounds: that of
    /// the largest deviation.
    pub(in crate::fem) fn volume_not_reached(&self, rounds: usize) -> EquilibriumError<P::Error, B::Error> {
        let deviation = |(constraint, state): &(&Constraint, &VolumeState)| {
            (state.volume - state.target).abs() / constraint.reference()
        };
        let constraints = self.volumes.with(&self.trial.volumes);
        let worst = constraints.max_by(|one, other| deviation(one).total_cmp(&deviation(other)));
        let (constraint, volume, target) = worst.map_or_else(Default::default, |(constraint, state)| {
            (constraint.name().to_owned(), state.volume, state.target)
        });
        EquilibriumError::VolumeNotReached { constraint, volume, target, rounds }
    }

    /// Sets the pressures of the trial state, Pa: those of the state and those of the last augmentation.
    pub(super) fn set_pressures(&mut self, pressures: &[[f64; 2]]) {
        for (state, &[pressure, augmented]) in self.trial.volumes.iter_mut().zip(pressures) {
            (state.pressure, state.augmented) = (pressure, augmented);
        }
    }

    /// Adds the forces and moments of the pressures in cavities to those of their surfaces.
    pub(super) fn add_cavity_resultants(&self, state: &BodyState, forces: &mut BoundaryForces) {
        for (constraint, VolumeState { pressure, .. }) in self.volumes.with(&state.volumes) {
            let Some(cavity) = constraint.cavity() else { continue };
            for (surface, faces) in cavity.surfaces() {
                let displacements = &state.displacements;
                let nodal = |forces: &mut [[f64; 3]]| cavity.add_forces(faces, *pressure, displacements, forces);
                let resultant = || cavity.resultant(faces, *pressure, displacements);
                forces.add_load(Source::Surface(surface), resultant, nodal, (&self.mesh, &self.boundary));
            }
        }
    }
}

/// Returns the accepted error of a volume, m^3: `tolerance` relative to the reference volume, but not less than the
/// rounding error of a sum over many elements.
fn accepted(constraint: &Constraint, tolerance: f64) -> f64 {
    tolerance.max(1e-13) * constraint.reference()
}

fn add_multiple(factor: f64, vectors: &[[f64; 3]], sums: &mut [[f64; 3]]) {
    for (sum, value) in sums.as_flattened_mut().iter_mut().zip(vectors.as_flattened()) {
        *sum += factor * value;
    }
}
