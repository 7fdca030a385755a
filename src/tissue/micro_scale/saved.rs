//! What the RVEs remember from one load step to the next, given out and taken back.

use nalgebra::Matrix3;
use thiserror::Error;

use crate::fem::material::Response;
use crate::fiber::rve::{Rve, RveStateError};

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
    /// The ranks that share the RVEs could not exchange something.
    #[error("{0}")]
    Ranks(String),
    /// The state of a network does not fit it.
    #[error("element {element}: {reason}")]
    Rve {
        /// The element, from 0.
        element: usize,
        /// What does not fit.
        reason: RveStateError,
    },
}
