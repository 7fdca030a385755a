//! How a run can fail.

use thiserror::Error;

use crate::fem::assembly::GeometryError;
use crate::fem::boundary::BoundaryError;
use crate::fem::equilibrium::EquilibriumError;
use crate::fem::rigid_modes::UnheldBody;
use crate::las::{NewtonError, SolveError, SparsityError};

/// Why an attempt failed: `E` is the error of the point field, `F` the fault of the backend.
pub type StepFailure<E, F> = NewtonError<EquilibriumError<E, F>, F>;

/// Why a body cannot be set up.
#[derive(Clone, Debug, Error, PartialEq)]
pub enum SetupError<E, F>
where
    E: std::fmt::Display,
    F: std::fmt::Display,
{
    /// The conditions do not fit the mesh or each other.
    #[error(transparent)]
    Boundary(#[from] BoundaryError),
    /// A part of the body can move or turn as a whole.
    #[error(transparent)]
    Unheld(#[from] UnheldBody),
    /// A degenerate element.
    #[error(transparent)]
    Geometry(#[from] GeometryError),
    /// Too many unknowns.
    #[error(transparent)]
    Sparsity(#[from] SparsityError),
    /// The backend could not make its vectors, matrix or solver.
    #[error("the linear system cannot be set up: {0}")]
    System(SolveError<F>),
    /// The points have no answer in the undeformed body.
    #[error("the undeformed body: {0}")]
    Undeformed(EquilibriumError<E, F>),
}

/// Why a run stopped; the state is the last one that converged, and what was reported stays reported. `O` is the error
/// of the observer.
#[derive(Clone, Debug, Error, PartialEq)]
pub enum SteppingError<E, F, O>
where
    E: std::fmt::Display,
    F: std::fmt::Display,
{
    /// A step failed, however small.
    #[error(
        "step {step} does not converge beyond t = {reached}: the smallest increment tried is {increment:.3e} ({halvings} halvings of the step): {reason}"
    )]
    NotConverged {
        /// The step, from 1.
        step: usize,
        /// The pseudo-time that the last attempt aimed at.
        t: f64,
        /// The last converged pseudo-time, sub-steps included.
        reached: f64,
        /// Length of the last attempt.
        increment: f64,
        /// Halvings of the step at the last attempt.
        halvings: u32,
        /// Why the last attempt failed.
        reason: StepFailure<E, F>,
    },
    /// The observer stopped the run.
    #[error("the run was stopped in step {step}, t = {t}: {reason}")]
    Stopped {
        /// The step, from 1.
        step: usize,
        /// The last converged pseudo-time.
        t: f64,
        /// What the observer said.
        reason: O,
    },
}
