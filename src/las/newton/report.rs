//! Parameters, reports and errors of Newton's method.

use thiserror::Error;

use super::{Forcing, Iterate};
use crate::las::{FactorReport, Factorization, SolveError, SolveReport};

/// The parameters of Newton's method.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct NewtonParams {
    /// Residual norm relative to [`ResidualScale::scale`](super::ResidualScale::scale) at convergence. Default `1e-10`.
    pub tolerance: f64,
    /// Maximum number of iterations, each with one factorization. Default 50.
    pub max_iterations: usize,
    /// Maximum number of reductions of the step length per line search; 0 always takes the full step. Default 10.
    pub max_backtracks: u32,
    /// The constant `c` of the sufficient-decrease (Armijo) condition: a step length `a` is accepted if
    /// `|r_new| <= (1 - c a) max |r|`, with the maximum over the last [`NewtonParams::nonmonotone_memory`] iterates
    /// (Nocedal and Wright, *Numerical Optimization*, 2nd ed., 2006, section 3.1). Default `1e-4`.
    pub sufficient_decrease: f64,
    /// Number of iterates in the sufficient-decrease condition; 1 requires a decrease in every step. The default 6 lets
    /// the residual rise temporarily: near a singular Jacobian, the residual norm has local minima that are not
    /// solutions (Grippo, Lampariello and Lucidi, SIAM J. Numer. Anal. 23 (1986) 707).
    pub nonmonotone_memory: usize,
    /// If given, the iteration converges only after a step `a d` with `|a d| <= tolerance s`, where `s` is
    /// [`NonlinearProblem::state_scale`](super::NonlinearProblem::state_scale). Default `None`.
    pub step_tolerance: Option<f64>,
    /// If given, the iteration converges only after a step `a d` whose work is small, `|a d . r| <= tolerance s |f|`,
    /// with the residual `r` before the step, the same `s`, and
    /// [`ResidualScale::scale`](super::ResidualScale::scale) for `|f|`. Default `None`.
    pub energy_tolerance: Option<f64>,
    /// If given, an iterative linear solver solves each system only as far as Newton's method needs. Default `None`:
    /// each system to the tolerance of the solver.
    pub forcing: Option<Forcing>,
    /// Whether an iterative linear solver may keep its preconditioner over several iterations
    /// ([`Solver::update`](crate::las::Solver::update)). Default false.
    pub keep_preconditioner: bool,
    /// Whether the first iteration uses the factorization that the solver holds, of a nearby state (a chord step), instead
    /// of a new one. Default false.
    pub reuse_factorization: bool,
    /// The most further steps that an iteration takes with its factorization (chord steps), as long as the last step had
    /// the full length and reduced the residual to [`NewtonParams::CHORD_SHARE`]. Default 0.
    pub chord_steps: usize,
}

impl NewtonParams {
    /// The share of the residual to which a step must reduce it so that its factorization serves the next one.
    pub const CHORD_SHARE: f64 = 0.1;

    /// Returns true if a small residual alone is not enough.
    pub(super) fn has_step_criteria(&self) -> bool {
        self.step_tolerance.is_some() || self.energy_tolerance.is_some()
    }
}

impl Default for NewtonParams {
    fn default() -> Self {
        Self {
            tolerance: 1e-10,
            max_iterations: 50,
            max_backtracks: 10,
            sufficient_decrease: 1e-4,
            nonmonotone_memory: 6,
            step_tolerance: None,
            energy_tolerance: None,
            forcing: None,
            keep_preconditioner: false,
            reuse_factorization: false,
            chord_steps: 0,
        }
    }
}

/// The result of a Newton iteration.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct NewtonReport {
    /// Number of iterations.
    pub iterations: usize,
    /// `|r|` at the initial state and after every iteration.
    pub residuals: Vec<f64>,
    /// The same residuals divided by [`ResidualScale::scale`](super::ResidualScale::scale); 0 if the scale is 0.
    pub relative: Vec<f64>,
    /// Number of rejected trial steps: each shortens the step (line search) or raises the shift (regularized Newton).
    pub backtracks: usize,
    /// Number of Cholesky factorizations.
    pub cholesky: usize,
    /// Number of LDL^T factorizations.
    pub ldlt: usize,
    /// Number of LU factorizations.
    pub lu: usize,
    /// Number of preconditioner setups of an iterative solver.
    pub approximate: usize,
    /// Number of Jacobians for which an iterative solver kept the preconditioner of an earlier one, and of steps with the
    /// factorization of an earlier one.
    pub kept: usize,
    /// Total number of iterations of the iterative solver.
    pub linear_iterations: usize,
    /// The solution of the linear system of each step; empty for a direct solver.
    pub linear_solves: Vec<SolveReport>,
    /// Number of systems that the iterative solver did not solve and a direct one did.
    pub fallbacks: usize,
    /// Number of factorizations that found a Jacobian declared positive definite to be indefinite.
    pub indefinite: usize,
    /// Number of factorizations that found the shifted Jacobian singular or too ill-conditioned (regularized Newton).
    pub singular: usize,
    /// Number of factorizations repeated with a larger shift of the diagonal (regularized Newton).
    pub shifts: usize,
    /// Computation time by phase.
    pub seconds: NewtonSeconds,
}

/// Computation time by phase, in seconds.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct NewtonSeconds {
    /// Residual evaluations, including those of the line search.
    pub residual: f64,
    /// Assembly of Jacobians.
    pub jacobian: f64,
    /// Factorizations.
    pub factor: f64,
    /// Triangular or iterative solves.
    pub solve: f64,
}

impl NewtonReport {
    /// Creates a report with capacity for `iterations`, so that recording does not allocate.
    pub(super) fn with_capacity(iterations: usize) -> Self {
        /// Limit of the initial capacity; longer histories are rare and reallocate.
        const MAX: usize = 64;
        let capacity = (iterations + 1).min(MAX);
        Self { residuals: Vec::with_capacity(capacity), relative: Vec::with_capacity(capacity), ..Self::default() }
    }

    pub(super) fn record(&mut self, iterate: &Iterate) {
        self.residuals.push(iterate.norm);
        self.relative.push(iterate.residual_scale.relative(iterate.norm));
    }

    pub(super) fn count_solve(&mut self, solve: &SolveReport) {
        self.linear_iterations += solve.iterations;
        if solve.iterations > 0 {
            self.linear_solves.push(*solve);
        }
        self.fallbacks += solve.fallbacks;
    }

    pub(super) fn count(&mut self, factor: &FactorReport) {
        self.indefinite += usize::from(factor.indefinite_at.is_some());
        match factor.kind {
            Factorization::Cholesky => self.cholesky += 1,
            Factorization::Ldlt => self.ldlt += 1,
            Factorization::Lu => self.lu += 1,
            Factorization::Approximate => self.approximate += 1,
            Factorization::Kept => self.kept += 1,
        }
    }
}

/// The reason why Newton failed; the problem is restored to its initial state.
#[derive(Clone, Debug, Error, PartialEq)]
pub enum NewtonError<E, F> {
    /// The residual or the Jacobian is undefined at a state, and shorter steps did not help.
    #[error(transparent)]
    Problem(E),
    /// The residual norm of the initial state, or its scale, is NaN or infinite.
    #[error("the residual of the initial state is not finite")]
    NotFinite,
    /// The iteration limit was reached.
    #[error("no convergence in {iterations} iterations: |r| = {residual:.3e}, limit {limit:.3e}")]
    TooManyIterations {
        /// Number of iterations performed.
        iterations: usize,
        /// The final `|r|`.
        residual: f64,
        /// The limit that `|r|` did not reach.
        limit: f64,
    },
    /// The iteration limit was reached: the residual is small enough, but the last step or its work is not.
    #[error(
        "no convergence in {iterations} iterations: |r| = {residual:.3e} is within its limit, but the last correction is larger than the displacement or energy tolerance, or a constraint is not satisfied"
    )]
    StillMoving {
        /// Number of iterations performed.
        iterations: usize,
        /// The final `|r|`.
        residual: f64,
    },
    /// The line search found no step along the Newton direction that reduces the residual sufficiently.
    #[error(
        "the line search found no decrease of |r| = {residual:.3e} in iteration {iteration} down to a step of {step:.1e}"
    )]
    LineSearch {
        /// The iteration, from 1.
        iteration: usize,
        /// `|r|` before this iteration.
        residual: f64,
        /// The shortest step length tried; 1 is the full step.
        step: f64,
    },
    /// No shift of the Hessian gives a step that reduces the potential.
    #[error("no step reduces the potential in iteration {iteration}: |r| = {residual:.3e}")]
    NoDescent {
        /// The iteration, from 1.
        iteration: usize,
        /// `|r|` before this iteration.
        residual: f64,
    },
    /// The linear solver failed.
    #[error(transparent)]
    Solve(#[from] SolveError<F>),
}

impl<E, F> From<F> for NewtonError<E, F> {
    fn from(error: F) -> Self {
        Self::Solve(SolveError::Backend(error))
    }
}

/// A failed Newton iteration.
#[derive(Clone, Debug, Error, PartialEq)]
#[error("{reason}")]
pub struct NewtonFailure<E: std::fmt::Display, F: std::fmt::Display> {
    /// The reason of the failure.
    pub reason: NewtonError<E, F>,
    /// The report up to the failure.
    pub report: Box<NewtonReport>,
}
