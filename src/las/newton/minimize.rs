//! Regularized Newton: a minimizer for problems with a potential, for cases in which Newton's method fails.
//!
//! The Hessian `K` is shifted, `(K + s I) d = r`, by the smallest `s` of a growing sequence that makes it positive
//! definite, so that `-d` is a descent direction even if `K` is indefinite or singular (J. Nocedal and S. J. Wright,
//! *Numerical Optimization*, 2nd ed., 2006, section 3.4, algorithm 3.3). The quadratic model predicts that the step
//! `-d` reduces the potential `W` by
//!
//! ```text
//! m(0) - m(-d) = r . d - d . K d / 2 = (r . d + s |d|^2) / 2
//! ```
//!
//! The reduction ratio, `(W(x) - W(x - d)) / (m(0) - m(-d))`, decides as in a trust-region method whether a step is
//! accepted and whether the next shift is larger or smaller (equation 4.4 and algorithm 4.1; section 10.3 for the shift
//! in place of the radius). Near a regular minimum the shift falls to zero, and the convergence is
//! quadratic as in Newton's method.

use super::{
    Backend, Evaluation, Failure, MatrixOps, NewtonError, NewtonFailure, NewtonReport, NewtonSystem, NonlinearProblem,
    Scalar, SolveError, Solver, VectorOps, is_recoverable,
};
use crate::las::{Index, MatVec, Value};

/// A nonlinear problem whose residual is the gradient of a potential.
pub trait Potential<B: Backend>: NonlinearProblem<B> {
    /// Returns the potential at the state of the last [`NonlinearProblem::residual`], up to a constant.
    fn potential(&mut self) -> f64;
}

/// The parameters of regularized Newton.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct RegularizedParams {
    /// Maximum number of accepted steps. Default 300.
    pub max_iterations: usize,
    /// Smallest nonzero shift relative to the largest diagonal entry of the Hessian. Default `1e-9`.
    pub min_shift: f64,
    /// Shift at which the iteration fails, relative to the same entry. Default `1e12`.
    pub max_shift: f64,
    /// Reduction ratio above which a step is accepted. Default `1e-4`.
    pub min_reduction_ratio: f64,
}

impl Default for RegularizedParams {
    fn default() -> Self {
        Self { max_iterations: 300, min_shift: 1e-9, max_shift: 1e12, min_reduction_ratio: 1e-4 }
    }
}

/// The state of a minimization between two steps.
struct Descent<'a> {
    params: &'a RegularizedParams,
    /// The shift of the Hessian's diagonal.
    shift: f64,
    /// The largest diagonal entry of the last Hessian, by absolute value.
    max_diagonal: f64,
    /// The potential at the iterate; `None` before the first step.
    potential: Option<f64>,
}

impl Descent<'_> {
    fn larger_shift(&self) -> f64 {
        (8.0 * self.shift).max(self.params.min_shift * self.max_diagonal)
    }

    /// Raises the shift after a rejected step, or when the Hessian was not positive definite.
    ///
    /// # Errors
    /// Returns [`NewtonError::NoDescent`] if the shift is then too large.
    fn raise<E, F>(&mut self, iteration: usize, residual: f64) -> Result<(), NewtonError<E, F>> {
        self.shift = self.larger_shift();
        let limit = self.params.max_shift * self.max_diagonal;
        // If the Hessian is zero, no shift can be scaled. A NaN also fails.
        if self.shift <= limit && limit != 0.0 { Ok(()) } else { Err(NewtonError::NoDescent { iteration, residual }) }
    }

    /// Adapts the shift after an accepted step. `residual_ratio` is the residual norm after the step over the norm
    /// before. After a successful step the shift falls at least as fast as the residual, which makes the convergence
    /// quadratic (D.-H. Li, M. Fukushima, L. Qi and N. Yamashita, Comput. Optim. Appl. 28 (2004) 131).
    fn adapt(&mut self, reduction_ratio: f64, residual_ratio: f64) {
        if reduction_ratio > 0.75 {
            self.shift *= residual_ratio.min(0.125);
            if self.shift < self.params.min_shift * self.max_diagonal {
                self.shift = 0.0;
            }
        } else if reduction_ratio < 0.25 {
            self.shift = self.larger_shift();
        }
    }
}

impl<B: Backend<Reduced: Scalar>> NewtonSystem<B> {
    /// Minimizes the potential of `problem` by regularized Newton, until the residual norm is at most
    /// [`ResidualScale::limit`](super::ResidualScale::limit) of `tolerance`.
    ///
    /// # Errors
    /// Returns [`NewtonFailure`] if the iteration fails; the problem is restored to its initial state.
    ///
    /// # Panics
    /// Panics if the problem has constraints, which are not supported.
    pub fn minimize<P: Potential<B>>(
        &mut self,
        problem: &mut P,
        tolerance: f64,
        params: &RegularizedParams,
    ) -> Result<NewtonReport, NewtonFailure<P::Error, B::Error>> {
        assert!(problem.constraints() == 0 && self.border.is_empty(), "a minimization has no constraints");
        let mut descent = Descent { params, shift: 0.0, max_diagonal: 0.0, potential: None };
        self.iterate(problem, tolerance, params.max_iterations, true, |system, problem, iterate, limit, report| {
            system.regularized_step(problem, iterate.norm, limit, &mut descent, report)
        })
    }

    /// Takes one accepted step from the iterate with this residual norm; rejected trial steps only raise the shift.
    fn regularized_step<P: Potential<B>>(
        &mut self,
        problem: &mut P,
        current_norm: f64,
        limit: f64,
        descent: &mut Descent<'_>,
        report: &mut NewtonReport,
    ) -> Evaluation<B, P> {
        /// Relative to the potential, a predicted reduction below this value is lost in rounding errors.
        const ROUNDING: f64 = 1e-9;
        let current_potential = descent.potential.unwrap_or_else(|| problem.potential());
        loop {
            self.factor_shifted(problem, current_norm, descent, report)?;
            report.count_solve(&self.solver.solve(&self.residual, &mut self.direction)?);
            let slope = self.residual_dot_direction()?;
            let length = self.direction.norm()?.as_f64();
            let predicted_reduction = 0.5 * (slope + descent.shift * length * length);
            self.advance(problem, -1.0)?;
            match self.evaluate(problem, report) {
                Ok(trial) => {
                    let potential = problem.potential();
                    let reduction = if predicted_reduction > ROUNDING * current_potential.abs() {
                        current_potential - potential
                    } else {
                        // The slopes at both ends are more accurate (trapezoidal rule).
                        0.5 * (slope + self.residual_dot_direction()?)
                    };
                    if reduction > descent.params.min_reduction_ratio * predicted_reduction || trial.norm <= limit {
                        descent.adapt(reduction / predicted_reduction, trial.norm / current_norm);
                        descent.potential = Some(potential);
                        return Ok(trial);
                    }
                }
                Err(error) if is_recoverable::<B, P>(&error) => {}
                Err(error) => return Err(error),
            }
            report.backtracks += 1;
            self.advance(problem, 1.0)?;
            self.evaluate(problem, report)?;
            descent.raise(report.iterations, current_norm)?;
        }
    }

    /// Factors the shifted Hessian, raising the shift until it is positive definite.
    fn factor_shifted<P: Potential<B>>(
        &mut self,
        problem: &mut P,
        current_norm: f64,
        descent: &mut Descent<'_>,
        report: &mut NewtonReport,
    ) -> Result<(), Failure<B, P>> {
        loop {
            descent.max_diagonal = self.assemble_shifted(problem, descent.shift)?;
            match self.solver.factor_definite(&self.matrix) {
                Ok(factor) => {
                    report.count(&factor);
                    return Ok(());
                }
                Err(SolveError::Indefinite { .. }) => report.indefinite += 1,
                Err(SolveError::Singular { .. } | SolveError::Inaccurate { .. }) => report.singular += 1,
                Err(error) => return Err(error.into()),
            }
            descent.raise(report.iterations, current_norm)?;
            report.shifts += 1;
        }
    }

    /// Assembles the Jacobian at the current state with `shift` added to its diagonal. Returns the largest diagonal
    /// entry of the Jacobian itself, by absolute value. Overwrites the direction.
    pub(super) fn assemble_shifted<P: NonlinearProblem<B>>(
        &mut self,
        problem: &mut P,
        shift: f64,
    ) -> Result<f64, Failure<B, P>> {
        self.assemble(problem)?;
        Ok(self.shift_diagonal(shift)?)
    }

    /// Adds `shift` to every diagonal entry of the matrix, which must be finished, and finishes it again. Returns the
    /// largest previous diagonal entry, by absolute value. Overwrites the direction. All ranks read the diagonal in one
    /// collective call.
    ///
    /// # Errors
    /// Returns the backend's error.
    pub fn shift_diagonal(&mut self, shift: f64) -> Result<f64, SolveError<B::Error>> {
        let Self { matrix, direction, .. } = self;
        matrix.diagonal(direction)?;
        let largest =
            |entries: &[B::Scalar]| entries.iter().map(|entry| entry.lane(0).as_f64().abs()).fold(0.0_f64, f64::max);
        let largest = direction.with_local(largest)?;
        if shift > 0.0 {
            for unknown in 0..matrix.shape().0 {
                let unknown = [B::Index::of(unknown)];
                matrix.add(&unknown, &unknown, &[B::Scalar::every(shift)])?;
            }
            matrix.finish()?;
        }
        Ok(largest)
    }
}
