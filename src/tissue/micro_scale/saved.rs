//! The state of RVEs that passes from one load step to the next, to save and restore.

use nalgebra::Matrix3;
use thiserror::Error;

use crate::fem::material::Response;
use crate::fiber::rve::{Rve, RveStateError};

/// The state of one RVE at the last converged load step.
#[derive(Clone, Debug, PartialEq)]
pub struct UnitState {
    /// The network; `None` for a matrix alone.
    pub rve: Option<Rve>,
    /// The last deformation gradient and the response there: the RVE returns this response at the same gradient without
    /// a solve.
    pub answer: Option<(Matrix3<f64>, Response)>,
    /// Newton iterations of that load step.
    pub iterations: usize,
}

/// The reason why saved RVEs do not match those of a field.
#[derive(Clone, Debug, Error, PartialEq)]
pub enum FieldRestoreError {
    /// The numbers of RVEs differ.
    #[error("the state has {found} RVEs; this body has {expected}")]
    Units {
        /// RVEs of the state.
        found: usize,
        /// RVEs of the field.
        expected: usize,
    },
    /// Only one side has fibers.
    #[error("element {element} has {} here", if *saved { "fibers in the saved state, but none" } else { "no fibers in the saved state, but has some" })]
    Fibers {
        /// The element, from 0.
        element: usize,
        /// Whether the saved state has fibers there.
        saved: bool,
    },
    /// Communication between the ranks that share the RVEs failed.
    #[error("{0}")]
    Ranks(String),
    /// The saved state does not match the network.
    #[error("element {element}: {reason}")]
    Rve {
        /// The element, from 0.
        element: usize,
        /// The mismatch.
        reason: RveStateError,
    },
}
