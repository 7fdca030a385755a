//! Saved states from which a run can be restarted.

use thiserror::Error;

use super::Stepper;
use crate::fem::equilibrium::EquilibriumError;
use crate::fem::kinematics::RigidMotion;
use crate::fem::point_field::PointField;
use crate::las::{Backend, RealBackend};

/// The state of a run after a full step, except the displacements of the nodes, which are those of [`Stepper::state`], and
/// the memory of its point field: what is the same on all ranks of a divided body. Loads, deformation gradients and nodal
/// forces follow from all of them.
// Checkpoints contain it: a change of its fields is a new format of checkpoints (`VERSION` in `sealed_file.rs`).
#[derive(Clone, Debug, Default, PartialEq)]
#[cfg_attr(feature = "app", derive(serde::Serialize, serde::Deserialize))]
pub struct SavedState {
    /// Number of converged full steps, at least 1.
    pub completed_steps: usize,
    /// Number of halvings of the increment at which the next attempt starts.
    pub halvings: u32,
    /// Upper limit of the next increment in steps, if increments are adaptive.
    pub increment: f64,
    /// Motions of the rigid surfaces.
    pub rigid: Vec<RigidMotion>,
    /// The pressures of each volume constraint, Pa: that of the state and that of the last augmentation.
    pub pressures: Vec<[f64; 2]>,
}

/// The reason why a saved state cannot be restored. `R` is the error of the callback that restores the point field, `E`
/// the error of the point field, `F` the error of the backend.
#[derive(Clone, Debug, Error, PartialEq)]
pub enum RestoreError<R: std::fmt::Display, E: std::fmt::Display, F: std::fmt::Display> {
    /// The saved state lies beyond the end of the run or at its beginning.
    #[error("the state was saved after step {completed_steps}; this run has the steps 1 to {count}")]
    Steps {
        /// Number of converged steps in the saved state.
        completed_steps: usize,
        /// Number of steps of the run.
        count: usize,
    },
    /// The displacements belong to another mesh.
    #[error("the state has displacements of {found} nodes; the mesh has {expected} nodes")]
    Nodes {
        /// Number of displacements.
        found: usize,
        /// Number of nodes of the mesh.
        expected: usize,
    },
    /// The saved state has another number of rigid surfaces.
    #[error("the state has motions of {found} rigid surfaces; the conditions have {expected}")]
    RigidSurfaces {
        /// Number of rigid surfaces in the saved state.
        found: usize,
        /// Number of rigid surfaces of the conditions.
        expected: usize,
    },
    /// The motion of a rigid surface is not finite. Holds the surface, from 0.
    #[error("the motion of rigid surface {0} in the saved state is not a finite number")]
    RigidNotFinite(usize),
    /// The saved state belongs to other constraints.
    #[error("the state has pressures of {found} volume constraints; this run has {expected}")]
    Constraints {
        /// Number of constraints in the saved state.
        found: usize,
        /// Number of constraints of the run.
        expected: usize,
    },
    /// A pressure is not finite. Holds the constraint, from 0.
    #[error("the pressure of volume constraint {0} in the saved state is not a finite number")]
    PressureNotFinite(usize),
    /// A displacement is not finite. Holds the node, from 0.
    #[error("the displacement of node {0} in the saved state is not a finite number")]
    NotFinite(usize),
    /// The point field cannot be restored.
    #[error("{0}")]
    Field(R),
    /// The point field cannot be evaluated or committed at the saved state. The stepper is then invalid and must be
    /// created anew.
    #[error("the saved state: {0}")]
    Points(#[from] EquilibriumError<E, F>),
}

/// The [`RestoreError`] of a run on backend `B` with point field `P`, whose restoration has error `R`.
pub type StepperRestoreError<B, P, R> = RestoreError<R, <P as PointField>::Error, <B as Backend>::Error>;

impl<B: RealBackend, P: PointField> Stepper<B, P> {
    /// Returns the state after the last full step; `None` before the first one, and if the committed state lies
    /// within a step that failed later.
    pub fn saved(&self) -> Option<SavedState> {
        let state = self.body.committed();
        let full = self.completed_steps > 0 && state.t == self.time_after(self.completed_steps);
        full.then(|| SavedState {
            completed_steps: self.completed_steps,
            halvings: self.increments.halvings,
            increment: self.increments.length,
            rigid: state.rigid.clone(),
            pressures: state.volumes.iter().map(|state| [state.pressure, state.augmented]).collect(),
        })
    }

    /// Restores a state that [`Stepper::saved`] returned for the same mesh, conditions and number of steps, with the
    /// `displacements` of the nodes then, m. The run continues as the saved run would have, bit for bit, if `field`
    /// restores the point field exactly.
    ///
    /// The point field is evaluated once at the restored state and then commits. Increments are
    /// limited to those of this run.
    ///
    /// # Errors
    /// Returns [`RestoreError`]; the stepper is then unchanged, except after [`RestoreError::Points`] and for what `field`
    /// has changed before [`RestoreError::Field`].
    pub fn restore<R: std::fmt::Display>(
        &mut self,
        state: &SavedState,
        displacements: &[[f64; 3]],
        field: impl FnOnce(&mut P) -> Result<(), R>,
    ) -> Result<(), StepperRestoreError<B, P, R>> {
        let (count, nodes) = (self.params.count, self.body.mesh().nodes().len());
        if state.completed_steps == 0 || state.completed_steps > count {
            return Err(RestoreError::Steps { completed_steps: state.completed_steps, count });
        }
        if displacements.len() != nodes {
            return Err(RestoreError::Nodes { found: displacements.len(), expected: nodes });
        }
        let rigid = self.body.committed().rigid.len();
        if state.rigid.len() != rigid {
            return Err(RestoreError::RigidSurfaces { found: state.rigid.len(), expected: rigid });
        }
        let is_finite = |RigidMotion { displacement, rotation }: &RigidMotion| {
            displacement.iter().chain(rotation).all(|component| component.is_finite())
        };
        if let Some(surface) = state.rigid.iter().position(|motion| !is_finite(motion)) {
            return Err(RestoreError::RigidNotFinite(surface));
        }
        if let Some(node) = displacements.iter().position(|u| u.iter().any(|u| !u.is_finite())) {
            return Err(RestoreError::NotFinite(node));
        }
        let constraints = self.body.constraints().len();
        if state.pressures.len() != constraints {
            return Err(RestoreError::Constraints { found: state.pressures.len(), expected: constraints });
        }
        if let Some(constraint) = state.pressures.as_flattened().iter().position(|p| !p.is_finite()) {
            return Err(RestoreError::PressureNotFinite(constraint / 2));
        }
        field(self.body.field_mut()).map_err(RestoreError::Field)?;
        self.body
            .restore_at(self.time_after(state.completed_steps), displacements, &state.rigid, &state.pressures)
            .map_err(RestoreError::Points)?;
        self.completed_steps = state.completed_steps;
        self.increments.restore(state.halvings, state.increment);
        self.undeformed = false;
        Ok(())
    }

    /// Returns the pseudo-time at the end of a full step, rounded exactly as in [`Stepper::step`].
    pub(super) fn time_after(&self, step: usize) -> f64 {
        step as f64 / self.params.count as f64
    }
}
