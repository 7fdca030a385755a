//! Classification of stationary points, and departure from saddle points.
//!
//! Newton's method solves `r = 0` without regard to the kind of solution. If `r` is the gradient of a potential, the
//! stable solutions are its minima, where the Hessian `K` is positive semi-definite. At any other stationary point `K`
//! has a direction `p` of negative curvature, `p . K p < 0`, and the potential decreases along both `p` and `-p`
//! (Nocedal and Wright, *Numerical Optimization*, 2nd ed., 2006, sections 2.1 and 3.4). A Cholesky factorization
//! distinguishes the two cases.

use super::{
    Backend, Failure, MatrixOps, NewtonError, NewtonReport, NewtonSystem, NonlinearProblem, Potential, Scalar,
    SolveError, Solver, VectorOps, is_recoverable,
};
use crate::las::{Factorization, Value};

/// A negative eigenvalue above `-neutral_limit(tolerance)` times the largest diagonal entry is treated as zero: the
/// forces that remain at convergence (up to `tolerance` relative to all forces) give motions without stiffness a
/// curvature of either sign.
///
/// For the usual tolerance of 1e-10 the limit is 1e-9: far above rounding errors, far below the stiffness of any
/// elastic motion.
fn neutral_limit(tolerance: f64) -> f64 {
    (10.0 * tolerance).clamp(1e-9, 1e-3)
}

/// A Cholesky factor with a pivot ratio below this value belongs to a matrix that is singular up to rounding.
const ROUNDING: f64 = 1e-12;

/// The definiteness of the Hessian at a stationary point, as determined by its factorization.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Curvature {
    /// The Hessian is positive definite, so that the point is a minimum. The solver holds its factorization.
    Definite,
    /// The Hessian is positive definite only after its diagonal is shifted by ten times the tolerance of the residual
    /// (and at least 1e-9) relative to its largest diagonal entry: some motions have no stiffness.
    Neutral,
    /// The Hessian is indefinite: the point is a saddle point or a maximum.
    Indefinite {
        /// Number of negative eigenvalues of the shifted Hessian, counted by the negative pivots of LDL^T; `None` if
        /// the solver does not count them.
        negative_pivots: Option<usize>,
    },
    /// The definiteness is undetermined: the solver supports only LU.
    Unknown,
}

/// The result of an attempt to leave a saddle point.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SaddleExit {
    /// The potential has decreased, and the residual is above its limit: a minimization can start.
    Descended,
    /// The residual stays within its limit, or the potential does not decrease along the direction: the point is
    /// numerically indistinguishable from one with motions without stiffness.
    Stationary,
}

/// A trial point on the path away from a saddle point.
struct Step {
    length: f64,
    potential: f64,
    norm: f64,
}

/// Two shifts of the Hessian: `upper` makes it positive definite (or singular up to rounding), `lower` does not, so
/// that `-upper <= lambda < -lower` for the lowest eigenvalue `lambda`.
struct Bracket {
    lower: f64,
    upper: f64,
}

impl<B: Backend<Reduced: Scalar>> NewtonSystem<B> {
    /// Classifies the Hessian at the state of the last evaluation, where the residual norm is at most
    /// [`ResidualScale::limit`](super::ResidualScale::limit) of `tolerance`. Afterwards the solver holds the
    /// factorization of the Hessian if it is [`Curvature::Definite`], and no usable factorization otherwise.
    ///
    /// An iterative solver detects only what its preconditioner reveals ([`Solver::factor_definite`]).
    ///
    /// # Errors
    /// Returns [`NewtonError::Problem`] if the Jacobian is undefined, and [`NewtonError::Solve`] for failures of the
    /// solver that are not due to the Hessian.
    pub fn curvature<P: NonlinearProblem<B>>(
        &mut self,
        problem: &mut P,
        tolerance: f64,
    ) -> Result<Curvature, NewtonError<P::Error, B::Error>> {
        if self.matrix.shape().0 == 0 {
            return Ok(Curvature::Definite);
        }
        self.assemble(problem)?;
        match self.solver.factor_definite(&self.matrix) {
            Ok(factor) if factor.kind == Factorization::Lu && factor.negative_pivots.is_none() => {
                return Ok(Curvature::Unknown);
            }
            Ok(factor) if factor.kind == Factorization::Approximate || factor.pivot_ratio >= ROUNDING => {
                return Ok(Curvature::Definite);
            }
            Err(SolveError::Unsupported { .. }) => return Ok(Curvature::Unknown),
            outcome => ignore_matrix_failure(outcome)?,
        };
        let max_diagonal = self.shift_diagonal(0.0)?;
        if self.is_definite(problem, neutral_limit(tolerance) * max_diagonal)? {
            return Ok(Curvature::Neutral);
        }
        let negative_pivots = match self.solver.factor(&self.matrix) {
            Ok(factor) => factor.negative_pivots,
            outcome => {
                ignore_matrix_failure(outcome)?;
                None
            }
        };
        Ok(Curvature::Indefinite { negative_pivots })
    }

    /// Moves the state off a saddle point along a direction of negative curvature, as far as the potential decreases.
    ///
    /// Inverse iteration computes the direction with the Hessian shifted until it is just positive definite. It starts
    /// from a fixed vector, so that the choice between the two sides of a symmetric saddle point is reproducible.
    ///
    /// # Errors
    /// Returns the errors of [`NewtonSystem::curvature`], and [`NewtonError::Problem`] if a state cannot be evaluated.
    pub fn escape_saddle<P: Potential<B>>(
        &mut self,
        problem: &mut P,
        tolerance: f64,
        report: &mut NewtonReport,
    ) -> Result<SaddleExit, NewtonError<P::Error, B::Error>> {
        let Some(curvature) = self.negative_curvature(problem, tolerance)? else { return Ok(SaddleExit::Stationary) };
        let iterate = self.evaluate(problem, report)?;
        let limit = iterate.residual_scale.limit(tolerance);
        let start = Step { length: 0.0, potential: problem.potential(), norm: iterate.norm };
        for side in [1.0, -1.0] {
            let reached = self.step_along(problem, &start, side, limit / curvature.abs(), report)?;
            if reached.length > 0.0 {
                return Ok(if reached.norm > limit { SaddleExit::Descended } else { SaddleExit::Stationary });
            }
        }
        Ok(SaddleExit::Stationary)
    }

    /// Takes the longest of a growing sequence of steps along the direction over which the potential decreases. `first`
    /// is the step at which the residual of a quadratic potential reaches its limit.
    fn step_along<P: Potential<B>>(
        &mut self,
        problem: &mut P,
        start: &Step,
        side: f64,
        first: f64,
        report: &mut NewtonReport,
    ) -> Result<Step, Failure<B, P>> {
        /// Enough steps to cover the range from rounding errors to any length scale.
        const MAX_STEPS: u32 = 60;
        const GROWTH: f64 = 4.0;
        let mut reached = Step { ..*start };
        let mut length = if first > 0.0 && first.is_finite() { 10.0 * first } else { f64::EPSILON };
        for _ in 0..MAX_STEPS {
            self.advance(problem, side * (length - reached.length))?;
            let step = match self.evaluate(problem, report) {
                Ok(trial) => {
                    let slope = side * self.residual_dot_direction()?;
                    let step = Step { length, potential: problem.potential(), norm: trial.norm };
                    // A short step changes the potential by less than its rounding errors; the slope is more accurate.
                    (slope < 0.0 && step.potential <= reached.potential + 1e-12 * reached.potential.abs())
                        .then_some(step)
                }
                Err(error) if is_recoverable::<B, P>(&error) => None,
                Err(error) => return Err(error),
            };
            let Some(step) = step else {
                self.advance(problem, side * (reached.length - length))?;
                self.evaluate(problem, report)?;
                break;
            };
            reached = step;
            length *= GROWTH;
        }
        Ok(reached)
    }

    /// Computes a unit vector of negative curvature of the Hessian by inverse iteration (G. H. Golub and C. F. Van
    /// Loan, *Matrix Computations*, 4th ed., 2013, section 8.2.2), stores it in `direction` and returns the curvature;
    /// `None` if the factorizations find no negative curvature.
    fn negative_curvature<P: NonlinearProblem<B>>(
        &mut self,
        problem: &mut P,
        tolerance: f64,
    ) -> Result<Option<f64>, Failure<B, P>> {
        const MAX_ITERATIONS: u32 = 100;
        let Some(Bracket { lower, upper: shift }) = self.bracket(problem, tolerance)? else { return Ok(None) };
        // A start vector without any symmetry that the Hessian may have.
        let start = |x: &mut [B::Scalar]| {
            x.iter_mut().enumerate().for_each(|(k, x)| *x = B::Scalar::every((k as f64 + 1.0).sqrt().fract() - 0.3));
        };
        self.direction.with_local_mut(start)?;
        self.direction.finish()?;
        for _ in 0..MAX_ITERATIONS {
            let length = self.direction.norm()?.as_f64();
            self.normalize_into_residual(length)?;
            self.solver.solve(&self.residual, &mut self.direction)?;
            // Rayleigh quotient `x . H x / |x|^2` of the solution `x` of `(H + shift I) x = u`, where `u` is the unit
            // vector on the right-hand side.
            let length = self.direction.norm()?.as_f64();
            let quotient = self.residual_dot_direction()? / (length * length) - shift;
            if quotient <= -0.5 * lower {
                self.normalize_into_residual(length)?;
                std::mem::swap(&mut self.residual, &mut self.direction);
                return Ok(Some(quotient));
            }
        }
        Ok(None)
    }

    /// Stores the direction, divided by its length, in `residual`.
    fn normalize_into_residual(&mut self, length: f64) -> Result<(), B::Error> {
        self.residual.zero()?;
        self.residual.axpy(B::Scalar::every(1.0 / length), &self.direction)
    }

    /// Brackets minus the lowest eigenvalue between two shifts that differ by a factor of `8^(1/8)`: multiplies a shift
    /// by eight until it makes the Hessian positive definite, and bisects three times. The solver then holds the
    /// factorization of the Hessian shifted by the larger one. Returns `None` if no shift below 1e9 times the largest
    /// diagonal entry makes the Hessian positive definite.
    fn bracket<P: NonlinearProblem<B>>(
        &mut self,
        problem: &mut P,
        tolerance: f64,
    ) -> Result<Option<Bracket>, Failure<B, P>> {
        let max_diagonal = self.assemble_shifted(problem, 0.0)?;
        let mut lower = neutral_limit(tolerance) * max_diagonal;
        let mut upper = 8.0 * lower;
        while !self.is_definite(problem, upper)? {
            (lower, upper) = (upper, 8.0 * upper);
            if upper.is_nan() || upper >= 1e9 * max_diagonal {
                return Ok(None);
            }
        }
        for _ in 0..3 {
            let middle = (lower * upper).sqrt();
            *(if self.is_definite(problem, middle)? { &mut upper } else { &mut lower }) = middle;
        }
        Ok(self.is_definite(problem, upper)?.then_some(Bracket { lower, upper }))
    }

    /// Returns true if the Hessian with its diagonal shifted is positive definite, or singular up to rounding.
    fn is_definite<P: NonlinearProblem<B>>(&mut self, problem: &mut P, shift: f64) -> Result<bool, Failure<B, P>> {
        self.assemble_shifted(problem, shift)?;
        match self.solver.factor_definite(&self.matrix) {
            Ok(_) | Err(SolveError::Singular { .. }) => Ok(true),
            outcome => Ok(ignore_matrix_failure(outcome).map(|()| false)?),
        }
    }
}

/// Ignores failures of a factorization that are due to the matrix; returns all other errors.
fn ignore_matrix_failure<T, F>(outcome: Result<T, SolveError<F>>) -> Result<(), SolveError<F>> {
    match outcome {
        Ok(_) | Err(SolveError::Indefinite { .. } | SolveError::Singular { .. } | SolveError::Inaccurate { .. }) => {
            Ok(())
        }
        Err(error) => Err(error),
    }
}
