//! What the RVEs remember from one load step to the next, given out and taken back.

use nalgebra::Matrix3;
use thiserror::Error;

use super::TissueField;
use super::unit::{Fibers, Unit};
use crate::fem::material::Response;
use crate::fiber::rve::{Rve, RveStateError};
use crate::las::{Backend, Scalar};

/// The memory of one RVE at the last converged load step.
#[derive(Clone, Debug, PartialEq)]
pub struct UnitState {
    /// The network; `None` for a matrix alone.
    pub rve: Option<Rve>,
    /// The last answer and the deformation gradient that it belongs to: asked there again, the RVE answers without a
    /// solve.
    pub answer: Option<(Matrix3<f64>, Response)>,
    /// Newton iterations of that load step.
    pub iterations: usize,
}

/// Why saved RVEs are not those of a field.
#[derive(Clone, Debug, Error, PartialEq)]
pub enum FieldRestoreError {
    /// Another number of RVEs.
    #[error("the state has {found} RVEs; this body has {expected}")]
    Units {
        /// RVEs of the state.
        found: usize,
        /// RVEs of the field.
        expected: usize,
    },
    /// Fibers on one side only.
    #[error("element {element} has {} here", if *saved { "fibers in the saved state, but none" } else { "no fibers in the saved state, but has some" })]
    Fibers {
        /// The element, from 0.
        element: usize,
        /// Whether the saved state has fibers there.
        saved: bool,
    },
    /// The state of a network does not fit it.
    #[error("element {element}: {reason}")]
    Rve {
        /// The element, from 0.
        element: usize,
        /// What does not fit.
        reason: RveStateError,
    },
}

impl<B: Backend<Scalar = f64>> TissueField<B>
where
    B::Reduced: Scalar,
{
    /// The memory of all RVEs in their order, that of the elements; right after a commit it is all that the next load
    /// step depends on.
    pub fn unit_states(&self) -> impl ExactSizeIterator<Item = UnitState> + '_ {
        self.units.iter().map(|unit| UnitState {
            // Right after a commit this is the committed state, with the prediction that goes with it.
            rve: unit.fibers.as_ref().map(|f| f.current.clone()),
            answer: unit.answer,
            iterations: unit.committed_iterations,
        })
    }

    /// Takes all RVEs back to what [`TissueField::unit_states`] gave.
    ///
    /// # Errors
    /// [`FieldRestoreError`]; nothing has changed then.
    pub fn restore_units(&mut self, states: Vec<UnitState>) -> Result<(), FieldRestoreError> {
        let (found, expected) = (states.len(), self.units.len());
        if found != expected {
            return Err(FieldRestoreError::Units { found, expected });
        }
        let places = self.units.iter().zip(&self.element_of);
        let units = states
            .into_iter()
            .zip(places)
            .map(|(state, (unit, &element))| self.restored(state, unit, element))
            .collect::<Result<Vec<Unit>, _>>()?;
        self.units = units;
        Ok(())
    }

    fn restored(&self, state: UnitState, unit: &Unit, element: usize) -> Result<Unit, FieldRestoreError> {
        let UnitState { rve, answer, iterations } = state;
        let fibers = match (rve, &unit.fibers) {
            (Some(current), Some(Fibers { model, committed, .. })) => {
                current
                    .check(self.models[*model].network())
                    .map_err(|reason| FieldRestoreError::Rve { element, reason })?;
                let mut committed = committed.clone();
                committed.take_equilibrium(&current);
                Some(Fibers { model: *model, current, committed })
            }
            (None, None) => None,
            (saved, _) => return Err(FieldRestoreError::Fibers { element, saved: saved.is_some() }),
        };
        // Committing makes the iterations since the last commit those of the last load step.
        Ok(Unit { fibers, matrix: unit.matrix, answer, iterations, committed_iterations: iterations })
    }
}
