//! What Newton may do, what it did, and why it stopped short.

use thiserror::Error;

use super::ResidualScale;
use crate::las::{FactorReport, Factorization, SolveError};

/// When Newton stops and what it may try.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct NewtonParams {
    /// Residual relative to [`ResidualScale::scale`]. Default `1e-10`.
    pub tolerance: f64,
    /// Iterations, each one factorization. Default 50.
    pub max_iterations: usize,
    /// How often a step may be shortened; 0 always takes the full step. Default 10.
    pub max_line_search_cuts: u32,
    /// A step `a` is taken if `|r_new| <= (1 - decrease a) max |r|` over the last [`NewtonParams::memory`] residuals.
    /// Default `1e-4`.
    pub decrease: f64,
    /// How many residuals a step is compared with; 1 asks for a decrease in every step. Default 6: near a singular
    /// Jacobian, where the residual has local minima that are no solutions, it must be allowed to rise for a while
    /// (Grippo, Lampariello and Lucidi, SIAM J. Numer. Anal. 23 (1986) 707).
    pub memory: usize,
}

impl Default for NewtonParams {
    fn default() -> Self {
        Self { tolerance: 1e-10, max_iterations: 50, max_line_search_cuts: 10, decrease: 1e-4, memory: 6 }
    }
}

/// What Newton did.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct NewtonReport {
    /// Steps taken.
    pub iterations: usize,
    /// `|r|` before every step and at the end: one more than there are steps.
    pub residuals: Vec<f64>,
    /// The same over [`ResidualScale::scale`]; 0 where the scale is 0.
    pub relative: Vec<f64>,
    /// Steps that were shortened, counted once a shortening.
    pub line_search_cuts: usize,
    /// Factorizations by Cholesky.
    pub cholesky: usize,
    /// Factorizations by LDL^T: the Jacobian was not positive definite there.
    pub ldlt: usize,
    /// Factorizations by LU.
    pub lu: usize,
    /// Approximate inverses made for an iterative method.
    pub approximate: usize,
    /// Iterations of that method.
    pub linear_iterations: usize,
    /// Factorizations, by whichever method served in the end, of a Jacobian that was stated to be definite and was not.
    pub indefinite: usize,
    /// Jacobians that no factorization served.
    pub singular: usize,
    /// Factorizations made again with a larger shift of the diagonal (regularized Newton).
    pub shifts: usize,
    /// Where the time went, in seconds.
    pub seconds: NewtonSeconds,
}

/// Seconds by phase.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct NewtonSeconds {
    /// Residuals, those of the line search included.
    pub residual: f64,
    /// Jacobians.
    pub jacobian: f64,
    /// Factorizations.
    pub factor: f64,
    /// Solves.
    pub solve: f64,
}

impl NewtonReport {
    /// One with room for the history of that many iterations, so that they need not allocate.
    pub(super) fn with_room(iterations: usize) -> Self {
        /// Longer histories are rare, and grow.
        const MOST: usize = 64;
        let room = (iterations + 1).min(MOST);
        Self { residuals: Vec::with_capacity(room), relative: Vec::with_capacity(room), ..Self::default() }
    }

    pub(super) fn record(&mut self, norm: f64, residual_scale: ResidualScale) {
        self.residuals.push(norm);
        self.relative.push(residual_scale.relative(norm));
    }

    pub(super) fn count(&mut self, factor: &FactorReport) {
        self.indefinite += usize::from(factor.indefinite_at.is_some());
        match factor.kind {
            Factorization::Cholesky => self.cholesky += 1,
            Factorization::Ldlt => self.ldlt += 1,
            Factorization::Lu => self.lu += 1,
            Factorization::Approximate => self.approximate += 1,
        }
    }
}

/// Why Newton stopped short; the state is the one it started from.
#[derive(Clone, Debug, Error, PartialEq)]
pub enum NewtonError<E, F> {
    /// The problem has no residual or Jacobian at a state, and shorter steps did not help.
    #[error("{0}")]
    Problem(E),
    /// The residual of the initial state is a NaN or an infinity.
    #[error("the residual of the initial state is not finite")]
    NotFinite,
    /// Out of iterations.
    #[error("no convergence in {iterations} iterations: |r| = {residual:.3e}, limit {limit:.3e}")]
    TooManyIterations {
        /// How many were taken.
        iterations: usize,
        /// `|r|` at the end.
        residual: f64,
        /// What it should have fallen to.
        limit: f64,
    },
    /// No step along the Newton direction lessens the residual.
    #[error(
        "the line search found no decrease of |r| = {residual:.3e} in iteration {iteration} down to a step of {step:.1e}"
    )]
    LineSearch {
        /// The iteration, from 1.
        iteration: usize,
        /// `|r|` before it.
        residual: f64,
        /// The shortest step tried.
        step: f64,
    },
    /// However large the shift of the Hessian, no step lessens the potential.
    #[error("no step lessens the potential in iteration {iteration}: |r| = {residual:.3e}")]
    NoDescent {
        /// The iteration, from 1.
        iteration: usize,
        /// `|r|` before it.
        residual: f64,
    },
    /// The linear system was not solved.
    #[error("{0}")]
    Solve(SolveError<F>),
}

/// A failed attempt: why, and what was done until then.
#[derive(Clone, Debug, Error, PartialEq)]
#[error("{reason}")]
pub struct NewtonFailure<E, F>
where
    E: std::fmt::Display,
    F: std::fmt::Display,
{
    /// Why.
    pub reason: NewtonError<E, F>,
    /// What was done until then.
    pub report: Box<NewtonReport>,
}
