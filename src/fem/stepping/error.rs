//! Errors of setup and of runs.

use thiserror::Error;

use crate::fem::assembly::GeometryError;
use crate::fem::boundary::BoundaryError;
use crate::fem::constraint::ConstraintError;
use crate::fem::equilibrium::{EquilibriumError, LargestResidual};
use crate::fem::rigid_modes::UnderconstrainedBody;
use crate::las::{NewtonError, SolveError, SparsityError};

/// The reason why an attempt failed: `E` is the error of the point field, `F` the error of the backend.
pub type StepFailure<E, F> = NewtonError<EquilibriumError<E, F>, F>;

/// The reason why a body cannot be set up.
#[derive(Clone, Debug, Error, PartialEq)]
pub enum SetupError<E: std::fmt::Display, F: std::fmt::Display> {
    /// The conditions contradict the mesh or each other.
    #[error(transparent)]
    Boundary(#[from] BoundaryError),
    /// A volume constraint cannot be imposed.
    #[error(transparent)]
    Constraint(#[from] ConstraintError),
    /// A part of the body has free rigid-body modes.
    #[error(transparent)]
    Underconstrained(#[from] UnderconstrainedBody),
    /// An element is degenerate.
    #[error(transparent)]
    Geometry(#[from] GeometryError),
    /// The system has too many unknowns.
    #[error(transparent)]
    Sparsity(#[from] SparsityError),
    /// The backend could not create its vectors, matrix or solver.
    #[error("the linear system cannot be set up: {0}")]
    System(#[from] SolveError<F>),
    /// The point field failed in the undeformed body.
    #[error("the undeformed body: {0}")]
    Undeformed(#[from] EquilibriumError<E, F>),
}

/// The reason why a run stopped. The state is the last converged one; steps already reported to the observer remain
/// valid. `O` is the error of the observer.
#[derive(Clone, Debug, Error, PartialEq)]
pub enum SteppingError<E: std::fmt::Display, F: std::fmt::Display, O> {
    /// An attempt failed and could not be repeated with a smaller increment, because the limit of halvings was reached
    /// or a smaller increment cannot help.
    #[error(
        "step {step} does not converge beyond t = {reached}: the smallest increment tried is {increment:.3e} ({halvings} halvings): {reason}"
    )]
    NotConverged {
        /// The step, from 1.
        step: usize,
        /// The pseudo-time at which the last attempt would have ended.
        t: f64,
        /// The last converged pseudo-time, including substeps.
        reached: f64,
        /// Length of the last attempt in pseudo-time.
        increment: f64,
        /// Number of halvings at the last attempt.
        halvings: u32,
        /// The reason for the failure of the last attempt.
        reason: StepFailure<E, F>,
        /// Where the residual was largest then, if Newton's method ended without a small one.
        largest_residual: Option<Box<LargestResidual>>,
    },
    /// The observer stopped the run.
    #[error("the run was stopped in step {step}, t = {t}: {reason}")]
    Stopped {
        /// The step, from 1.
        step: usize,
        /// The last converged pseudo-time.
        t: f64,
        /// The error of the observer.
        reason: O,
    },
}
