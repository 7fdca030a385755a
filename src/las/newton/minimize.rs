//! Regularized Newton: a minimizer for problems with a potential, for cases in which Newton's method fails.
//!
//! The Hessian `K` is shifted, `(K + s I) d = r`, by the smallest `s` of a growing sequence that makes it positive
//! definite, so that `-d` is a descent direction even if `K` is indefinite or singular. The ratio of the actual
//! reduction of the potential to the reduction predicted by the quadratic model decides whether a step is accepted, and
//! whether the next shift is larger or smaller (Nocedal and Wright, *Numerical Optimization*, 2nd ed., 2006, sections
//! 3.4 and 10.3). Near a regular minimum the shift falls to zero, and the convergence is quadratic as in Newton's
//! method.

use super::{
    Backend, MatrixOps, NewtonError, NewtonFailure, NewtonReport, NewtonSystem, NonlinearProblem, ResidualScale,
    Scalar, SolveError, Solver, Trial, VectorOps, fault,
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
    /// A step is accepted if it reduces the potential by at least this fraction of the predicted reduction. Default `1e-4`.
    pub accept: f64,
}

impl Default for RegularizedParams {
    fn default() -> Self {
        Self { max_iterations: 300, min_shift: 1e-9, max_shift: 1e12, accept: 1e-4 }
    }
}

/// The shift of the Hessian's diagonal.
#[derive(Default)]
struct Shift {
    value: f64,
    /// The largest diagonal entry of the last Hessian, by absolute value.
    diagonal: f64,
}

impl Shift {
    /// Raises the shift after a rejected step, or when the Hessian was not positive definite.
    fn raise(&mut self, params: &RegularizedParams) {
        self.value = (8.0 * self.value).max(params.min_shift * self.diagonal);
    }

    /// Adapts the shift after an accepted step. `reduction_ratio` is the actual over the predicted reduction of the
    /// potential, `residual_ratio` the residual norm after the step over the norm before. After a successful step the
    /// shift falls at least as fast as the residual, which makes the convergence quadratic.
    fn adapt(&mut self, reduction_ratio: f64, residual_ratio: f64, params: &RegularizedParams) {
        if reduction_ratio > 0.75 {
            self.value *= residual_ratio.min(0.125);
            if self.value < params.min_shift * self.diagonal {
                self.value = 0.0;
            }
        } else if reduction_ratio < 0.25 {
            self.raise(params);
        }
    }

    fn is_too_large(&self, params: &RegularizedParams) -> bool {
        let most = params.max_shift * self.diagonal;
        // If the Hessian is zero, no shift can be scaled.
        self.value.is_nan() || most.is_nan() || self.value > most || most == 0.0
    }
}

/// The current iterate.
struct Iterate {
    norm: f64,
    residual_scale: ResidualScale,
    potential: f64,
}

impl<B: Backend> NewtonSystem<B>
where
    B::Reduced: Scalar,
{
    /// Minimizes the potential of `problem` until the residual norm is below `tolerance` times the scale (or below the
    /// floor), as in [`NewtonSystem::solve`].
    ///
    /// # Errors
    /// Returns [`NewtonFailure`] if the iteration fails; the problem is restored to its initial state.
    pub fn minimize<P: Potential<B>>(
        &mut self,
        problem: &mut P,
        tolerance: f64,
        params: &RegularizedParams,
    ) -> Result<NewtonReport, NewtonFailure<P::Error, B::Fault>> {
        let mut report = NewtonReport::with_room(params.max_iterations);
        problem.save();
        match self.descend(problem, tolerance, params, &mut report) {
            Ok(()) => Ok(report),
            Err(reason) => {
                problem.restore();
                Err(NewtonFailure { reason, report: Box::new(report) })
            }
        }
    }

    fn descend<P: Potential<B>>(
        &mut self,
        problem: &mut P,
        tolerance: f64,
        params: &RegularizedParams,
        report: &mut NewtonReport,
    ) -> Result<(), NewtonError<P::Error, B::Fault>> {
        let (norm, residual_scale) = self.evaluate(problem, report).map_err(Trial::into_error)?;
        let mut iterate = Iterate { norm, residual_scale, potential: problem.potential() };
        let mut shift = Shift::default();
        report.record(norm, residual_scale);
        loop {
            let limit = (tolerance * iterate.residual_scale.scale).max(iterate.residual_scale.floor);
            if iterate.norm <= limit {
                return Ok(());
            }
            if report.iterations == params.max_iterations {
                let iterations = report.iterations;
                return Err(NewtonError::TooManyIterations { iterations, residual: iterate.norm, limit });
            }
            report.iterations += 1;
            iterate = self.regularized_step(problem, &iterate, limit, &mut shift, params, report)?;
            report.record(iterate.norm, iterate.residual_scale);
        }
    }

    /// Takes one accepted step; rejected trial steps only raise the shift.
    fn regularized_step<P: Potential<B>>(
        &mut self,
        problem: &mut P,
        here: &Iterate,
        limit: f64,
        shift: &mut Shift,
        params: &RegularizedParams,
        report: &mut NewtonReport,
    ) -> Result<Iterate, NewtonError<P::Error, B::Fault>> {
        /// Relative to the potential, a predicted reduction below this value is lost in rounding errors.
        const ROUNDING: f64 = 1e-9;
        loop {
            self.factor_shifted(problem, here, shift, params, report)?;
            let slope = self.residual.dot(&self.direction).map_err(fault)?.as_f64();
            let length = self.direction.norm().map_err(fault)?.as_f64();
            let predicted_reduction = 0.5 * (slope + shift.value * length * length);
            problem.advance(-1.0, &self.direction).map_err(NewtonError::Problem)?;
            match self.evaluate(problem, report) {
                Ok((norm, residual_scale)) => {
                    let potential = problem.potential();
                    let reduction = if predicted_reduction > ROUNDING * here.potential.abs() {
                        here.potential - potential
                    } else {
                        // Trapezoidal rule along the step.
                        0.5 * (slope + self.residual.dot(&self.direction).map_err(fault)?.as_f64())
                    };
                    if reduction > params.accept * predicted_reduction || norm <= limit {
                        shift.adapt(reduction / predicted_reduction, norm / here.norm, params);
                        return Ok(Iterate { norm, residual_scale, potential });
                    }
                }
                Err(Trial::NotFinite) => {}
                Err(Trial::Undefined(error)) if !P::is_final(&error) => {}
                Err(error) => return Err(error.into_error()),
            }
            report.line_search_cuts += 1;
            problem.advance(1.0, &self.direction).map_err(NewtonError::Problem)?;
            self.evaluate(problem, report).map_err(Trial::into_error)?;
            shift.raise(params);
            if shift.is_too_large(params) {
                return Err(NewtonError::NoDescent { iteration: report.iterations, residual: here.norm });
            }
        }
    }

    /// Factors the shifted Hessian, raising the shift until it is positive definite, and computes the direction.
    fn factor_shifted<P: Potential<B>>(
        &mut self,
        problem: &mut P,
        here: &Iterate,
        shift: &mut Shift,
        params: &RegularizedParams,
        report: &mut NewtonReport,
    ) -> Result<(), NewtonError<P::Error, B::Fault>> {
        loop {
            self.matrix.zero().map_err(fault)?;
            problem.jacobian(&mut self.matrix).map_err(NewtonError::Problem)?;
            shift.diagonal = self.shift_diagonal(shift.value).map_err(NewtonError::Solve)?;
            self.matrix.finish().map_err(fault)?;
            match self.solver.factor_definite(&self.matrix) {
                Ok(factor) => {
                    report.count(&factor);
                    break;
                }
                Err(SolveError::Indefinite { .. }) => report.indefinite += 1,
                Err(SolveError::Singular { .. } | SolveError::Inaccurate { .. }) => report.singular += 1,
                Err(error) => return Err(NewtonError::Solve(error)),
            }
            shift.raise(params);
            if shift.is_too_large(params) {
                return Err(NewtonError::NoDescent { iteration: report.iterations, residual: here.norm });
            }
            report.shifts += 1;
        }
        let solved = self.solver.solve(&self.residual, &mut self.direction).map_err(NewtonError::Solve)?;
        report.linear_iterations += solved.iterations;
        Ok(())
    }

    /// Adds `shift` to every diagonal entry of the matrix and returns the largest previous diagonal entry, by absolute
    /// value. Overwrites the direction. All ranks read the diagonal in one collective call.
    ///
    /// # Errors
    /// Returns the backend's error.
    pub fn shift_diagonal(&mut self, shift: f64) -> Result<f64, SolveError<B::Fault>> {
        let Self { matrix, direction, .. } = self;
        matrix.finish().map_err(SolveError::Fault)?;
        matrix.diagonal(direction)?;
        let largest =
            |entries: &[B::Scalar]| entries.iter().map(|entry| entry.lane(0).as_f64().abs()).fold(0.0_f64, f64::max);
        let largest = direction.with_local(largest).map_err(SolveError::Fault)?;
        if shift > 0.0 {
            for unknown in 0..matrix.shape().0 {
                let unknown = [B::Index::of(unknown)];
                matrix.add(&unknown, &unknown, &[B::Scalar::every(shift)]).map_err(SolveError::Fault)?;
            }
        }
        Ok(largest)
    }
}
