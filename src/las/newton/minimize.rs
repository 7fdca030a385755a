//! Regularized Newton: a minimizer for problems that have a potential, where plain Newton finds no way.
//!
//! The Hessian `K` is shifted, `(K + s I) d = r`, by the smallest `s` of a growing sequence that makes it positive
//! definite, so that `-d` descends whether `K` is indefinite, singular or both. The ratio of the actual reduction of the
//! potential to the one that the quadratic model predicts decides whether a step is accepted, and whether the next shift is
//! larger or smaller (Nocedal and
//! Wright, *Numerical Optimization*, 2nd ed., 2006, sections 3.4 and 10.3). Near a regular minimum the shift falls to
//! zero and the convergence is Newton's own.

use super::{
    Backend, MatrixOps, NewtonError, NewtonFailure, NewtonReport, NewtonSystem, NonlinearProblem, ResidualScale,
    Scalar, SolveError, Solver, Trial, VectorOps, fault,
};
use crate::las::{Index, MatVec, Value};

/// A nonlinear problem whose residual is the gradient of a potential.
pub trait Potential<B: Backend>: NonlinearProblem<B> {
    /// The potential at the state of the last [`NonlinearProblem::residual`], up to a constant.
    fn potential(&mut self) -> f64;
}

/// What a regularized Newton may cost.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct RegularizedParams {
    /// Steps taken. Default 300.
    pub max_iterations: usize,
    /// The smallest shift other than zero, over the largest diagonal entry of the Hessian. Default `1e-9`.
    pub least_shift: f64,
    /// The shift at which the search is given up, over the same. Default `1e12`.
    pub most_shift: f64,
    /// A step is accepted if it reduces the potential by at least this fraction of the predicted reduction. Default `1e-4`.
    pub accept: f64,
}

impl Default for RegularizedParams {
    fn default() -> Self {
        Self { max_iterations: 300, least_shift: 1e-9, most_shift: 1e12, accept: 1e-4 }
    }
}

/// The shift of the Hessian's diagonal and the size it is measured by.
#[derive(Default)]
struct Shift {
    value: f64,
    /// The largest diagonal entry of the last Hessian, by absolute value.
    diagonal: f64,
}

impl Shift {
    /// Raises the shift after a rejected step, or when the Hessian was not positive definite.
    fn raise(&mut self, params: &RegularizedParams) {
        self.value = (8.0 * self.value).max(params.least_shift * self.diagonal);
    }

    /// Adapts the shift after an accepted step. `reduction_ratio` is the actual over the predicted reduction of the potential,
    /// `residual_ratio` the residual norm after the step over that before. The shift falls at least as fast as the residual,
    /// which makes the convergence quadratic.
    fn adapt(&mut self, reduction_ratio: f64, residual_ratio: f64, params: &RegularizedParams) {
        if reduction_ratio > 0.75 {
            self.value *= residual_ratio.min(0.125);
            if self.value < params.least_shift * self.diagonal {
                self.value = 0.0;
            }
        } else if reduction_ratio < 0.25 {
            self.raise(params);
        }
    }

    fn is_too_large(&self, params: &RegularizedParams) -> bool {
        let most = params.most_shift * self.diagonal;
        // A Hessian of zeros has no measure for a shift.
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
    /// Descends in the potential of `problem` until its residual is below `tolerance` times the scale (or below the
    /// floor), as [`NewtonSystem::solve`] measures it.
    ///
    /// # Errors
    /// [`NewtonFailure`]; the problem is restored to the state it came with.
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
        /// A reduction below this fraction of the potential is not resolved by its rounding.
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
                        // The trapezoidal rule along the step.
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

    /// The direction of the shifted Hessian, the shift raised until a Cholesky factor exists.
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

    /// Adds `shift` to every diagonal entry of the matrix; returns the largest, by absolute value,
    /// that there was before. The direction serves as scratch: all ranks read the diagonal together, once.
    ///
    /// # Errors
    /// What the backend reports.
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
