//! Newton's method with a line search, generic over the problem and the backend.
//!
//! An iteration solves `K d = r` with the Jacobian `K` at the current iterate `x` and takes the step `x <- x - a d`
//! with the step length `a` of a backtracking line search (J. Nocedal and S. J. Wright, *Numerical Optimization*, 2nd
//! ed., 2006, section 11.2; J. E. Dennis and R. B. Schnabel, *Numerical Methods for Unconstrained Optimization and
//! Nonlinear Equations*, 1996, chapter 6). It stops when `|r| <= max(tolerance * scale, floor)`, with the scale and the
//! floor of [`ResidualScale`] and Euclidean norms, and if [`NewtonParams`] asks for it, only after a small step. An
//! iteration may take further steps with its factorization ([`NewtonParams::chord_steps`]). Scalar constraints of the
//! problem border the linear system ([`Border`]).

mod border;
mod chord;
mod curvature;
mod forcing;
mod line_search;
mod minimize;
mod problem;
mod report;
#[cfg(all(test, feature = "dense"))]
mod tests;

use std::sync::Arc;
use std::time::Instant;

pub use border::Border;
pub use curvature::{Curvature, SaddleExit};
pub use forcing::Forcing;
pub use minimize::{Potential, RegularizedParams};
pub use problem::{NonlinearProblem, ResidualScale};
pub use report::{NewtonError, NewtonFailure, NewtonParams, NewtonReport, NewtonSeconds};

use super::{Backend, FactorReport, MatrixOps, Scalar, SolveError, SolveReport, Solver, Sparsity, VectorOps};

/// The linear system of a Newton iteration, created once and reused for all problems with the same sparsity pattern.
///
/// An iteration solves `K d = r` with the residual `r` and the Jacobian `K = dr/dx`, and takes the step `x <- x - a d`:
/// it calls [`NonlinearProblem::advance`] with a negative factor. A line search finds the step length `a`. After
/// convergence the solver still holds the last factorization, which callers may reuse.
///
/// ```
/// # #[cfg(feature = "sparse")] {
/// use std::convert::Infallible;
/// use std::sync::Arc;
/// use biotissue::backends::sparse::{Matrix, Sparse, Vector};
/// use biotissue::las::{
///     Backend, MatrixOps, NewtonParams, NewtonSystem, NonlinearProblem, ResidualScale, SolverParams, Sparsity,
///     Symmetry, VectorOps,
/// };
///
/// /// A spring whose force is the cube of its extension `x`, under a load.
/// struct Spring {
///     x: f64,
///     saved: f64,
///     load: f64,
/// }
///
/// impl NonlinearProblem<Sparse> for Spring {
///     type Error = Infallible;
///
///     fn residual(&mut self, r: &mut Vector) -> Result<ResidualScale, Infallible> {
///         r.set(&[0], &[self.x.powi(3) - self.load])?;
///         r.finish()?;
///         Ok(ResidualScale { scale: self.load, floor: 1e-14 })
///     }
///
///     fn jacobian(&mut self, k: &mut Matrix) -> Result<(), Infallible> {
///         k.add(&[0], &[0], &[3.0 * self.x.powi(2)])?;
///         k.finish()
///     }
///
///     fn advance(&mut self, a: f64, d: &Vector) -> Result<(), Infallible> {
///         self.x += a * d.as_slice()[0];
///         Ok(())
///     }
///
///     fn save(&mut self) {
///         self.saved = self.x;
///     }
///
///     fn restore(&mut self) {
///         self.x = self.saved;
///     }
/// }
///
/// let pattern = Arc::new(Sparsity::full(1, 1));
/// let symbolic = Sparse::<f64>::analyze(&(), &pattern, &SolverParams::new(Symmetry::Definite))?;
/// let mut system = NewtonSystem::<Sparse>::new(&(), &pattern, &symbolic)?;
/// let mut spring = Spring { x: 1.0, saved: 1.0, load: 8.0 };
/// let report = system.solve(&mut spring, &NewtonParams::default())?;
/// assert!((spring.x - 2.0).abs() < 1e-9 && report.iterations < 10);
/// # }
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
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
    /// The constraints and their multipliers.
    pub border: Border<B>,
    /// Whether the next preparation of the solver must not depend on earlier matrices.
    starts_anew: bool,
}

impl<B: Backend<Reduced: Scalar>> NewtonSystem<B> {
    /// Creates vectors, matrix and solver for the pattern that `symbolic` was computed from.
    ///
    /// # Errors
    /// Returns the backend's error if it cannot create one of them.
    pub fn new(
        context: &B::Context,
        pattern: &Arc<Sparsity>,
        symbolic: &Arc<B::Symbolic>,
    ) -> Result<Self, SolveError<B::Error>> {
        Ok(Self {
            residual: B::vector(context, pattern.rows())?,
            direction: B::vector(context, pattern.rows())?,
            matrix: B::matrix(context, pattern)?,
            solver: B::solver(symbolic)?,
            border: Border::empty(),
            starts_anew: true,
        })
    }

    /// Creates a system like [`NewtonSystem::new`], for problems with this number of constraints.
    ///
    /// # Errors
    /// As for [`NewtonSystem::new`].
    pub fn bordered(
        context: &B::Context,
        pattern: &Arc<Sparsity>,
        symbolic: &Arc<B::Symbolic>,
        constraints: usize,
    ) -> Result<Self, SolveError<B::Error>> {
        let border = Border::new(context, pattern.rows(), constraints)?;
        Ok(Self { border, ..Self::new(context, pattern, symbolic)? })
    }

    /// Solves `problem` by Newton's method with a line search, until the residual norm is at most
    /// [`ResidualScale::limit`].
    ///
    /// # Errors
    /// Returns [`NewtonFailure`] if the iteration fails; the problem is restored to its initial state.
    ///
    /// # Panics
    /// Panics if the system was created for another number of constraints.
    pub fn solve<P: NonlinearProblem<B>>(
        &mut self,
        problem: &mut P,
        params: &NewtonParams,
    ) -> Result<NewtonReport, NewtonFailure<P::Error, B::Error>> {
        self.solve_watched(problem, params, &mut |_| ())
    }

    /// Solves `problem` like [`NewtonSystem::solve`], and calls `watch` before every iteration.
    ///
    /// # Errors
    /// As for [`NewtonSystem::solve`].
    ///
    /// # Panics
    /// As for [`NewtonSystem::solve`].
    pub fn solve_watched<P: NonlinearProblem<B>>(
        &mut self,
        problem: &mut P,
        params: &NewtonParams,
        watch: &mut dyn FnMut(&NewtonReport),
    ) -> Result<NewtonReport, NewtonFailure<P::Error, B::Error>> {
        assert_eq!(problem.constraints(), self.border.len(), "the system has as many constraints as the problem");
        let starts_settled = !params.has_step_criteria() || problem.state_scale().is_none();
        let mut forcing = params.forcing.map(forcing::Sequence::new);
        self.iterate(
            problem,
            params.tolerance,
            params.max_iterations,
            starts_settled,
            |system, problem, iterate, limit, report| {
                watch(report);
                if let Some(forcing) = &mut forcing {
                    system.set_tolerance(forcing.next(iterate.norm, limit));
                }
                if params.reuse_factorization && report.iterations == 1 && !system.starts_anew {
                    system.reuse_factorization(problem, report)?;
                } else {
                    system.compute_direction(problem, params.keep_preconditioner, report)?;
                }
                let work = system.work(params)?;
                let next = system.line_search(problem, params, limit, report)?;
                let next = system.settled(problem, params, next, work)?;
                system.take_chord_steps(problem, params, iterate.norm, next, report)
            },
        )
    }

    /// Returns the work `|d . r| + |dp . c|` of the step along the direction, if it is a criterion of convergence.
    fn work(&self, params: &NewtonParams) -> Result<f64, B::Error> {
        if !params.has_step_criteria() {
            return Ok(0.0);
        }
        Ok(self.residual_dot_direction()?.abs() + self.border.work())
    }

    /// Judges whether the step to this iterate and its work are small. `work` is that before the step.
    fn settled<P: NonlinearProblem<B>>(
        &self,
        problem: &P,
        params: &NewtonParams,
        iterate: Iterate,
        work: f64,
    ) -> Evaluation<B, P> {
        let Some(scale) = problem.state_scale().filter(|_| params.has_step_criteria()) else { return Ok(iterate) };
        let Iterate { step, residual_scale, .. } = iterate;
        let length = step * self.direction.norm()?.as_f64();
        let is_small = |value: f64, tolerance: Option<f64>, scale: f64| tolerance.is_none_or(|of| value <= of * scale);
        let settled = is_small(length, params.step_tolerance, scale)
            && is_small((step * work).abs(), params.energy_tolerance, scale * residual_scale.scale);
        Ok(Iterate { settled, ..iterate })
    }

    /// Repeats `step` until the iterate that it returns has converged. `step` gets the current iterate and the limit of
    /// its residual norm. Without `starts_settled`, it is called at least once.
    fn iterate<P: NonlinearProblem<B>>(
        &mut self,
        problem: &mut P,
        tolerance: f64,
        max_iterations: usize,
        starts_settled: bool,
        mut step: impl FnMut(&mut Self, &mut P, &Iterate, f64, &mut NewtonReport) -> Evaluation<B, P>,
    ) -> Result<NewtonReport, NewtonFailure<P::Error, B::Error>> {
        let mut report = NewtonReport::with_capacity(max_iterations);
        problem.save();
        let outcome: Result<(), Failure<B, P>> = (|| {
            let mut iterate = self.evaluate(problem, &mut report)?;
            // No step has been taken that could be judged.
            iterate.settled = starts_settled;
            loop {
                report.record(&iterate);
                let (iterations, residual) = (report.iterations, iterate.norm);
                let limit = iterate.residual_scale.limit(tolerance);
                if residual <= limit && iterate.settled && problem.is_settled(tolerance) {
                    return Ok(());
                }
                if iterations == max_iterations && residual <= limit {
                    return Err(NewtonError::StillMoving { iterations, residual });
                }
                if iterations == max_iterations {
                    return Err(NewtonError::TooManyIterations { iterations, residual, limit });
                }
                report.iterations += 1;
                iterate = step(self, problem, &iterate, limit, &mut report)?;
            }
        })();
        match outcome {
            Ok(()) => Ok(report),
            Err(reason) => {
                problem.restore();
                Err(NewtonFailure { reason, report: Box::new(report) })
            }
        }
    }

    /// Computes the Newton direction `d = K^-1 r` at the current iterate.
    fn compute_direction<P: NonlinearProblem<B>>(
        &mut self,
        problem: &mut P,
        keeps_preconditioner: bool,
        report: &mut NewtonReport,
    ) -> Result<(), Failure<B, P>> {
        let start = Instant::now();
        self.assemble(problem)?;
        let assembled = Instant::now();
        report.count(&self.prepare(keeps_preconditioner)?);
        let factored = Instant::now();
        if !self.border.is_empty() {
            problem.border(&mut self.border).map_err(NewtonError::Problem)?;
        }
        report.count_solve(&self.solve_linear()?);
        report.seconds.jacobian += (assembled - start).as_secs_f64();
        report.seconds.factor += (factored - assembled).as_secs_f64();
        report.seconds.solve += factored.elapsed().as_secs_f64();
        Ok(())
    }

    /// Computes the direction at the current iterate with the factorization of an earlier Jacobian.
    fn reuse_factorization<P: NonlinearProblem<B>>(
        &mut self,
        problem: &mut P,
        report: &mut NewtonReport,
    ) -> Result<(), Failure<B, P>> {
        let start = Instant::now();
        if !self.border.is_empty() {
            problem.border(&mut self.border).map_err(NewtonError::Problem)?;
        }
        report.kept += 1;
        report.count_solve(&self.solve_linear()?);
        report.seconds.solve += start.elapsed().as_secs_f64();
        Ok(())
    }

    /// Prepares the solver for the matrix. With `keeps_preconditioner` an iterative method may keep the preconditioner of
    /// an earlier matrix ([`Solver::update`]), except for the first matrix after [`NewtonSystem::start_anew`].
    ///
    /// # Errors
    /// Returns the error of the solver.
    pub fn prepare(&mut self, keeps_preconditioner: bool) -> Result<FactorReport, SolveError<B::Error>> {
        let starts_anew = std::mem::replace(&mut self.starts_anew, false);
        if keeps_preconditioner && !starts_anew {
            self.solver.update(&self.matrix)
        } else {
            self.solver.factor(&self.matrix)
        }
    }

    /// Makes the next solutions independent of all matrices so far.
    pub fn start_anew(&mut self) {
        self.starts_anew = true;
    }

    /// Sets the relative residual to which an iterative method solves the next systems. With constraints, the systems
    /// of the gradients are solved to a smaller one, because their solutions times the multipliers may cancel.
    pub fn set_tolerance(&mut self, tolerance: f64) {
        /// The least relative residual that rounding errors allow.
        const LEAST: f64 = 1e-13;
        let factor = if self.border.is_empty() { 1.0 } else { 1e-2 };
        self.solver.set_tolerance((factor * tolerance).max(LEAST));
    }

    /// Solves the linear system with the factorization of the matrix: `residual` gives `direction`. With constraints,
    /// [`Border::residuals`], the gradients and the compliances give [`Border::increments`] as well.
    ///
    /// # Errors
    /// Returns the error of the solver, or [`SolveError::SingularBorder`].
    pub fn solve_linear(&mut self) -> Result<SolveReport, SolveError<B::Error>> {
        let Self { residual, direction, solver, border, .. } = self;
        if border.is_empty() { solver.solve(residual, direction) } else { border.solve(solver, residual, direction) }
    }

    /// Assembles the Jacobian at the current state.
    fn assemble<P: NonlinearProblem<B>>(&mut self, problem: &mut P) -> Result<(), Failure<B, P>> {
        self.matrix.assemble(|k| problem.jacobian(k).map_err(NewtonError::Problem))
    }

    /// Evaluates the residual and its norm at the current state.
    fn evaluate<P: NonlinearProblem<B>>(&mut self, problem: &mut P, report: &mut NewtonReport) -> Evaluation<B, P> {
        let start = Instant::now();
        let residual_scale = problem.residual(&mut self.residual).map_err(NewtonError::Problem)?;
        let mut norm = self.residual.norm()?.as_f64();
        if !self.border.is_empty() {
            problem.constraint_residuals(&mut self.border.residuals);
            norm = self.border.residuals.iter().map(|c| c * c).sum::<f64>().sqrt().hypot(norm);
        }
        report.seconds.residual += start.elapsed().as_secs_f64();
        // With an infinite scale every residual would count as converged.
        if norm.is_finite() && residual_scale.scale.is_finite() {
            Ok(Iterate { norm, residual_scale, step: 1.0, settled: true })
        } else {
            Err(NewtonError::NotFinite)
        }
    }

    /// Moves the state by `a` times the direction.
    fn advance<P: NonlinearProblem<B>>(&self, problem: &mut P, a: f64) -> Result<(), Failure<B, P>> {
        if !self.border.is_empty() {
            problem.advance_multipliers(a, &self.border.increments);
        }
        problem.advance(a, &self.direction).map_err(NewtonError::Problem)
    }

    /// The product `r . d` of residual and direction.
    fn residual_dot_direction(&self) -> Result<f64, B::Error> {
        Ok(self.residual.dot(&self.direction)?.as_f64())
    }
}

/// A state with a finite residual norm.
struct Iterate {
    norm: f64,
    residual_scale: ResidualScale,
    /// The accepted step length of the line search.
    step: f64,
    /// False if a criterion other than the residual is not met.
    settled: bool,
}

type Evaluation<B, P> = Result<Iterate, Failure<B, P>>;

/// The error of Newton's method, of the problem or of the backend.
type Failure<B, P> = NewtonError<<P as NonlinearProblem<B>>::Error, <B as Backend>::Error>;

/// Returns true if a state cannot be evaluated for a reason that a shorter step may avoid.
fn is_recoverable<B: Backend, P: NonlinearProblem<B>>(error: &Failure<B, P>) -> bool {
    match error {
        NewtonError::NotFinite => true,
        NewtonError::Problem(error) => !P::is_final(error),
        _ => false,
    }
}
