//! Newton's method with a line search, generic over the problem and the backend.

mod curvature;
mod minimize;
mod problem;
mod report;
#[cfg(all(test, feature = "dense"))]
mod tests;

use std::sync::Arc;
use std::time::Instant;

pub use curvature::{Curvature, SaddleExit};
pub use minimize::{Potential, RegularizedParams};
pub use problem::{NonlinearProblem, ResidualScale};
pub use report::{NewtonError, NewtonFailure, NewtonParams, NewtonReport, NewtonSeconds};

use super::{Backend, MatrixOps, Scalar, SolveError, Solver, Sparsity, VectorOps};

/// The linear system of a Newton iteration, created once and reused for all problems with the same sparsity pattern.
///
/// After convergence the solver still holds the last factorization, which callers may reuse.
#[derive(Debug)]
pub struct NewtonSystem<B: Backend> {
    /// The residual `r`.
    pub residual: B::Vector,
    /// The Newton direction `K^-1 r`.
    pub direction: B::Vector,
    /// The Jacobian `K`.
    pub matrix: B::Matrix,
    /// The factorization of `K`.
    pub solver: B::Solver,
}

impl<B: Backend> NewtonSystem<B>
where
    B::Reduced: Scalar,
{
    /// Creates vectors, matrix and solver for the pattern that `symbolic` was computed from.
    ///
    /// # Errors
    /// Returns the backend's error if it cannot create one of them.
    pub fn new(
        context: &B::Context,
        pattern: &Arc<Sparsity>,
        symbolic: &Arc<B::Symbolic>,
    ) -> Result<Self, SolveError<B::Fault>> {
        let vector = || B::vector(context, pattern.rows()).map_err(SolveError::Fault);
        Ok(Self {
            residual: vector()?,
            direction: vector()?,
            matrix: B::matrix(context, pattern).map_err(SolveError::Fault)?,
            solver: B::solver(symbolic)?,
        })
    }

    /// Iterates until the residual norm of `problem` is below its limit.
    ///
    /// # Errors
    /// Returns [`NewtonFailure`] if the iteration fails; the problem is restored to its initial state.
    pub fn solve<P: NonlinearProblem<B>>(
        &mut self,
        problem: &mut P,
        params: &NewtonParams,
    ) -> Result<NewtonReport, NewtonFailure<P::Error, B::Fault>> {
        let mut report = NewtonReport::with_room(params.max_iterations);
        problem.save();
        match self.iterate(problem, params, &mut report) {
            Ok(()) => Ok(report),
            Err(reason) => {
                problem.restore();
                Err(NewtonFailure { reason, report: Box::new(report) })
            }
        }
    }

    fn iterate<P: NonlinearProblem<B>>(
        &mut self,
        problem: &mut P,
        params: &NewtonParams,
        report: &mut NewtonReport,
    ) -> Result<(), NewtonError<P::Error, B::Fault>> {
        let (mut norm, mut residual_scale) = self.evaluate(problem, report).map_err(Trial::into_error)?;
        report.record(norm, residual_scale);
        loop {
            let limit = (params.tolerance * residual_scale.scale).max(residual_scale.floor);
            if norm <= limit {
                return Ok(());
            }
            if report.iterations == params.max_iterations {
                return Err(NewtonError::TooManyIterations { iterations: report.iterations, residual: norm, limit });
            }
            report.iterations += 1;
            self.factor_and_solve(problem, report)?;
            (norm, residual_scale) = self.step(problem, params, limit, report)?;
            report.record(norm, residual_scale);
        }
    }

    /// Computes the Newton direction at the current state.
    fn factor_and_solve<P: NonlinearProblem<B>>(
        &mut self,
        problem: &mut P,
        report: &mut NewtonReport,
    ) -> Result<(), NewtonError<P::Error, B::Fault>> {
        let start = Instant::now();
        self.matrix.zero().map_err(fault)?;
        problem.jacobian(&mut self.matrix).map_err(NewtonError::Problem)?;
        self.matrix.finish().map_err(fault)?;
        let assembled = Instant::now();
        let factor = self.solver.factor(&self.matrix).map_err(NewtonError::Solve)?;
        report.count(&factor);
        let factored = Instant::now();
        let solved = self.solver.solve(&self.residual, &mut self.direction).map_err(NewtonError::Solve)?;
        report.linear_iterations += solved.iterations;
        report.seconds.jacobian += (assembled - start).as_secs_f64();
        report.seconds.factor += (factored - assembled).as_secs_f64();
        report.seconds.solve += factored.elapsed().as_secs_f64();
        Ok(())
    }

    /// Takes the first step along the direction that reduces the residual sufficiently (backtracking line search).
    fn step<P: NonlinearProblem<B>>(
        &mut self,
        problem: &mut P,
        params: &NewtonParams,
        limit: f64,
        report: &mut NewtonReport,
    ) -> Result<(f64, ResidualScale), NewtonError<P::Error, B::Fault>> {
        let recent = &report.residuals[report.residuals.len().saturating_sub(params.memory.max(1))..];
        let (before, ceiling) = recent.iter().fold((0.0, 0.0_f64), |(_, most), &norm| (norm, most.max(norm)));
        let mut step = 1.0;
        let mut taken = 0.0;
        for cut in 0..=params.max_line_search_cuts {
            problem.advance(taken - step, &self.direction).map_err(NewtonError::Problem)?;
            taken = step;
            let trial = self.evaluate(problem, report);
            let last = cut == params.max_line_search_cuts;
            match trial {
                Ok((norm, residual_scale))
                    if norm <= ((1.0 - params.decrease * step) * ceiling).max(limit)
                        || params.max_line_search_cuts == 0 =>
                {
                    return Ok((norm, residual_scale));
                }
                Ok((norm, _)) if !last => step *= shortening(step, before, norm),
                Ok(_) => break,
                Err(Trial::Undefined(error)) if !last && !P::is_final(&error) => step *= 0.5,
                Err(Trial::NotFinite) if !last => step *= 0.5,
                Err(Trial::NotFinite) => break,
                Err(error) => return Err(error.into_error()),
            }
            report.line_search_cuts += 1;
        }
        Err(NewtonError::LineSearch { iteration: report.iterations, residual: before, step: taken })
    }

    fn evaluate<P: NonlinearProblem<B>>(
        &mut self,
        problem: &mut P,
        report: &mut NewtonReport,
    ) -> Result<(f64, ResidualScale), Trial<P::Error, B::Fault>> {
        let start = Instant::now();
        let residual_scale = problem.residual(&mut self.residual).map_err(Trial::Undefined)?;
        let norm = self.residual.norm().map_err(Trial::Fault)?.as_f64();
        report.seconds.residual += start.elapsed().as_secs_f64();
        // With an infinite scale every residual would count as converged.
        if norm.is_finite() && residual_scale.scale.is_finite() {
            Ok((norm, residual_scale))
        } else {
            Err(Trial::NotFinite)
        }
    }
}

/// The reason why a trial state has no finite residual norm.
enum Trial<E, F> {
    Undefined(E),
    NotFinite,
    Fault(F),
}

impl<E, F> Trial<E, F> {
    fn into_error(self) -> NewtonError<E, F> {
        match self {
            Self::Undefined(error) => NewtonError::Problem(error),
            Self::NotFinite => NewtonError::NotFinite,
            Self::Fault(error) => fault(error),
        }
    }
}

fn fault<E, F>(error: F) -> NewtonError<E, F> {
    NewtonError::Solve(SolveError::Fault(error))
}

/// The factor that reduces a rejected step to the minimizer of the parabola that interpolates `|r|^2` at 0 and at the
/// step, with the slope `-2 |r|^2` at 0 of an exact Newton direction; limited to [0.1, 0.5].
fn shortening(step: f64, before: f64, after: f64) -> f64 {
    let (before, after) = (before * before, after * after);
    let curvature = after - before + 2.0 * before * step;
    (before * step / curvature).clamp(0.1, 0.5)
}
