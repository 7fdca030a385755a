//! The state a run can be taken up from again.

use thiserror::Error;

use super::{StepParams, Stepper};
use crate::fem::equilibrium::EquilibriumError;
use crate::fem::point_field::PointField;
use crate::las::{Backend, Scalar};

/// Where a run stands after a full step, beside what its point field remembers. Loads, deformation gradients and nodal
/// forces follow from it.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct SavedState {
    /// Full steps that have converged, at least 1.
    pub completed_steps: usize,
    /// Halvings of the increment that the next attempt starts with.
    pub halvings: u32,
    /// Displacements of the nodes, m.
    pub displacements: Vec<[f64; 3]>,
}

/// Why a saved state cannot be taken up. `R` is the error of whoever takes the point field back, `E` that of the point
/// field, `F` the fault of the backend.
#[derive(Clone, Debug, Error, PartialEq)]
pub enum RestoreError<R, E, F>
where
    R: std::fmt::Display,
    E: std::fmt::Display,
    F: std::fmt::Display,
{
    /// It lies beyond the end of the run, or at its beginning.
    #[error("the state was saved after step {completed_steps}; this run has the steps 1 to {count}")]
    Steps {
        /// Full steps done in the saved state.
        completed_steps: usize,
        /// Steps of the run.
        count: usize,
    },
    /// It belongs to another mesh.
    #[error("the state has displacements of {found} nodes; the mesh has {expected} nodes")]
    Nodes {
        /// Nodes of the saved state.
        found: usize,
        /// Nodes of the mesh.
        expected: usize,
    },
    /// A displacement that is no finite number.
    #[error("the displacement of node {node} in the saved state is no finite number")]
    NotFinite {
        /// The node, from 0.
        node: usize,
    },
    /// The point field cannot be taken back.
    #[error("{0}")]
    Field(R),
    /// The points have no answer there. The body is then in no state to go on from: it must be set up anew.
    #[error("the saved state: {0}")]
    Points(EquilibriumError<E, F>),
}

/// The [`RestoreError`] of a run on backend `B` with point field `P`, which is taken back with an error `R`.
pub type StepperRestoreError<B, P, R> = RestoreError<R, <P as PointField>::Error, <B as Backend>::Fault>;

impl<B, P> Stepper<B, P>
where
    B: Backend<Scalar = f64>,
    B::Reduced: Scalar,
    P: PointField,
{
    /// The state after the last full step; `None` before the first one, and where the last accepted state lies within
    /// a step that failed later.
    #[must_use]
    pub fn saved(&self) -> Option<SavedState> {
        let state = self.body.accepted();
        let full = self.completed_steps > 0 && state.t == self.time_after(self.completed_steps);
        full.then(|| SavedState {
            completed_steps: self.completed_steps,
            halvings: self.halvings,
            displacements: state.displacements.clone(),
        })
    }

    /// Takes up a state that [`Stepper::saved`] gave for the same mesh, conditions and number of steps: the next step
    /// then goes as it would have gone there, bit for bit, if `field` takes the point field back to what it was.
    ///
    /// The points are asked once about the restored state, and the field then commits. More halvings than the run
    /// allows count as those that it allows.
    ///
    /// # Errors
    /// [`RestoreError`]; nothing has changed then but for [`RestoreError::Points`].
    pub fn restore<R: std::fmt::Display>(
        &mut self,
        state: &SavedState,
        field: impl FnOnce(&mut P) -> Result<(), R>,
    ) -> Result<(), StepperRestoreError<B, P, R>> {
        let (count, nodes) = (self.params.count, self.body.mesh().nodes().len());
        if state.completed_steps == 0 || state.completed_steps > count {
            return Err(RestoreError::Steps { completed_steps: state.completed_steps, count });
        }
        if state.displacements.len() != nodes {
            return Err(RestoreError::Nodes { found: state.displacements.len(), expected: nodes });
        }
        if let Some(node) = state.displacements.iter().position(|u| u.iter().any(|u| !u.is_finite())) {
            return Err(RestoreError::NotFinite { node });
        }
        field(self.body.field_mut()).map_err(RestoreError::Field)?;
        self.body
            .restore_at(self.time_after(state.completed_steps), &state.displacements)
            .map_err(RestoreError::Points)?;
        self.completed_steps = state.completed_steps;
        self.halvings = state.halvings.min(self.params.max_cuts).min(StepParams::MAX_CUTS);
        self.undeformed = false;
        Ok(())
    }

    /// Where a full step ends, exactly as stepping gets there.
    fn time_after(&self, step: usize) -> f64 {
        step as f64 / self.params.count as f64
    }
}
