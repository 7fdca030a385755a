//! Newton's method with a line search, generic over the problem and the backend.

use std::time::Instant;

use thiserror::Error;

use super::{Backend, Factorisation, MatrixOps, Scalar, SolveError, Solver, VectorOps};

/// A system of nonlinear equations `r(x) = 0` that owns its state `x`.
///
/// The state stays with the problem, in whatever form suits it; Newton sees residuals, Jacobians and directions.
pub trait NonlinearProblem<B: Backend> {
    /// Why the problem cannot be evaluated at a state (an inverted element, say). Newton takes it as "too far" where a
    /// shorter step may help.
    type Error: std::error::Error;

    /// Writes `r(x)` at the current state, all entries, and says what its norm is to be measured against.
    ///
    /// # Errors
    /// Where the residual does not exist at this state.
    fn residual(&mut self, r: &mut B::Vector) -> Result<Yardstick, Self::Error>;

    /// Writes `dr/dx` at the current state into `k`, which comes zeroed.
    ///
    /// # Errors
    /// Where it does not exist at this state.
    fn jacobian(&mut self, k: &mut B::Matrix) -> Result<(), Self::Error>;

    /// `x += a d`.
    ///
    /// # Errors
    /// Where the state cannot be moved.
    fn advance(&mut self, a: f64, d: &B::Vector) -> Result<(), Self::Error>;

    /// Remembers the state; called once, before the first iteration.
    fn save(&mut self);

    /// Takes the state back to where [`NonlinearProblem::save`] was called; called when Newton fails.
    fn restore(&mut self);
}

/// What a residual is measured against: converged when `|r| <= max(tolerance * scale, floor)`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Yardstick {
    /// The size of the terms that cancel in the residual, for example the norm of all nodal forces.
    pub scale: f64,
    /// What rounding alone leaves.
    pub floor: f64,
}

impl Yardstick {
    fn relative(self, norm: f64) -> f64 {
        if self.scale > 0.0 { norm / self.scale } else { 0.0 }
    }
}

/// When Newton stops and what it may try.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct NewtonParams {
    /// Residual relative to [`Yardstick::scale`]. Default `1e-10`.
    pub tolerance: f64,
    /// Iterations, each one factorisation. Default 50.
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
    /// The same over [`Yardstick::scale`]; 0 where the scale is 0.
    pub relative: Vec<f64>,
    /// Steps that were shortened, counted once a shortening.
    pub line_search_cuts: usize,
    /// Factorisations by Cholesky.
    pub cholesky: usize,
    /// Factorisations by LDL^T: the Jacobian was not positive definite there.
    pub ldlt: usize,
    /// Factorisations by LU.
    pub lu: usize,
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
    /// Factorisations.
    pub factor: f64,
    /// Solves.
    pub solve: f64,
}

impl NewtonReport {
    fn record(&mut self, norm: f64, yardstick: Yardstick) {
        self.residuals.push(norm);
        self.relative.push(yardstick.relative(norm));
    }

    fn count(&mut self, kind: Factorisation) {
        match kind {
            Factorisation::Cholesky => self.cholesky += 1,
            Factorisation::Ldlt => self.ldlt += 1,
            Factorisation::Lu => self.lu += 1,
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

/// The linear system that Newton works in: made once, used for every problem of the same pattern.
///
/// After a convergence the solver holds the last factorisation, for whoever can use it again.
#[derive(Debug)]
pub struct NewtonSystem<B: Backend> {
    /// `r`.
    pub residual: B::Vector,
    /// `K^-1 r`.
    pub direction: B::Vector,
    /// `K`.
    pub matrix: B::Matrix,
    /// The factors of `K`.
    pub solver: B::Solver,
}

impl<B: Backend> NewtonSystem<B>
where
    B::Reduced: Scalar,
{
    /// Vectors, matrix and solver for the pattern that `symbolic` was made from.
    ///
    /// # Errors
    /// What the backend reports when it cannot make one of them.
    pub fn new(
        context: &B::Context,
        pattern: &std::sync::Arc<super::Sparsity>,
        symbolic: &std::sync::Arc<B::Symbolic>,
    ) -> Result<Self, SolveError<B::Fault>> {
        let vector = || B::vector(context, pattern.rows()).map_err(SolveError::Fault);
        Ok(Self {
            residual: vector()?,
            direction: vector()?,
            matrix: B::matrix(context, pattern).map_err(SolveError::Fault)?,
            solver: B::solver(symbolic)?,
        })
    }

    /// Drives the residual of `problem` below its limit.
    ///
    /// # Errors
    /// [`NewtonFailure`]; the problem is restored to the state it came with.
    pub fn solve<P: NonlinearProblem<B>>(
        &mut self,
        problem: &mut P,
        params: &NewtonParams,
    ) -> Result<NewtonReport, NewtonFailure<P::Error, B::Fault>> {
        let mut report = NewtonReport::default();
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
        let (mut norm, mut yardstick) = self.evaluate(problem, report).map_err(Trial::into_error)?;
        report.record(norm, yardstick);
        loop {
            let limit = (params.tolerance * yardstick.scale).max(yardstick.floor);
            if norm <= limit {
                return Ok(());
            }
            if report.iterations == params.max_iterations {
                return Err(NewtonError::TooManyIterations { iterations: report.iterations, residual: norm, limit });
            }
            report.iterations += 1;
            self.factor_and_solve(problem, report)?;
            (norm, yardstick) = self.step(problem, params, limit, report)?;
            report.record(norm, yardstick);
        }
    }

    /// The Newton direction at the current state.
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
        report.count(factor.kind);
        let factored = Instant::now();
        self.solver.solve(&self.residual, &mut self.direction).map_err(NewtonError::Solve)?;
        report.seconds.jacobian += (assembled - start).as_secs_f64();
        report.seconds.factor += (factored - assembled).as_secs_f64();
        report.seconds.solve += factored.elapsed().as_secs_f64();
        Ok(())
    }

    /// Moves along the direction by the first step that lessens the residual enough.
    fn step<P: NonlinearProblem<B>>(
        &mut self,
        problem: &mut P,
        params: &NewtonParams,
        limit: f64,
        report: &mut NewtonReport,
    ) -> Result<(f64, Yardstick), NewtonError<P::Error, B::Fault>> {
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
                Ok((norm, yardstick))
                    if norm <= ((1.0 - params.decrease * step) * ceiling).max(limit)
                        || params.max_line_search_cuts == 0 =>
                {
                    return Ok((norm, yardstick));
                }
                Ok((norm, _)) if !last => step *= shortening(step, before, norm),
                Ok(_) => break,
                Err(Trial::NotThere(_) | Trial::NotFinite) if !last => step *= 0.5,
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
    ) -> Result<(f64, Yardstick), Trial<P::Error, B::Fault>> {
        let start = Instant::now();
        let yardstick = problem.residual(&mut self.residual).map_err(Trial::NotThere)?;
        let norm = self.residual.norm().map_err(Trial::Fault)?.as_f64();
        report.seconds.residual += start.elapsed().as_secs_f64();
        if norm.is_finite() { Ok((norm, yardstick)) } else { Err(Trial::NotFinite) }
    }
}

/// Why a trial state has no residual norm.
enum Trial<E, F> {
    NotThere(E),
    NotFinite,
    Fault(F),
}

impl<E, F> Trial<E, F> {
    fn into_error(self) -> NewtonError<E, F> {
        match self {
            Self::NotThere(error) => NewtonError::Problem(error),
            Self::NotFinite => NewtonError::NotFinite,
            Self::Fault(error) => fault(error),
        }
    }
}

fn fault<E, F>(error: F) -> NewtonError<E, F> {
    NewtonError::Solve(SolveError::Fault(error))
}

/// The factor that takes a rejected step to the minimum of the parabola through `|r|^2` at 0 and at the step, whose slope
/// at 0 is `-2 |r|^2` along an exact Newton direction; kept between 0.1 and 0.5.
fn shortening(step: f64, before: f64, after: f64) -> f64 {
    let (before, after) = (before * before, after * after);
    let curvature = after - before + 2.0 * before * step;
    (before * step / curvature).clamp(0.1, 0.5)
}

#[cfg(all(test, feature = "dense"))]
mod tests {
    use std::convert::Infallible;
    use std::sync::Arc;

    use super::*;
    use crate::backends::dense::Dense;
    use crate::las::{Backend, SolverParams, Sparsity, Symmetry};

    /// One scalar equation.
    struct Scalar1 {
        x: f64,
        saved: f64,
        r: fn(f64) -> f64,
        dr: fn(f64) -> f64,
    }

    impl NonlinearProblem<Dense> for Scalar1 {
        type Error = Infallible;

        fn residual(&mut self, r: &mut <Dense as Backend>::Vector) -> Result<Yardstick, Infallible> {
            r.set(&[0], &[(self.r)(self.x)])?;
            Ok(Yardstick { scale: 1.0, floor: 0.0 })
        }

        fn jacobian(&mut self, k: &mut <Dense as Backend>::Matrix) -> Result<(), Infallible> {
            k.add(&[0], &[0], &[(self.dr)(self.x)])
        }

        fn advance(&mut self, a: f64, d: &<Dense as Backend>::Vector) -> Result<(), Infallible> {
            let mut value = [0.0];
            d.get(&[0], &mut value)?;
            self.x += a * value[0];
            Ok(())
        }

        fn save(&mut self) {
            self.saved = self.x;
        }

        fn restore(&mut self) {
            self.x = self.saved;
        }
    }

    fn arctangent(x: f64) -> Scalar1 {
        Scalar1 { x, saved: 0.0, r: f64::atan, dr: |x| 1.0 / (1.0 + x * x) }
    }

    fn system() -> NewtonSystem<Dense> {
        let pattern = Arc::new(Sparsity::from_elements(1, [[0]]).unwrap());
        let symbolic = Dense::<f64>::analyze(&(), &pattern, &SolverParams::new(Symmetry::Definite)).unwrap();
        NewtonSystem::new(&(), &pattern, &symbolic).unwrap()
    }

    #[test]
    fn full_newton_diverges_where_the_line_search_converges() {
        // |x| > 1.3917 makes Newton on the arctangent diverge.
        let full = NewtonParams { max_line_search_cuts: 0, max_iterations: 20, ..NewtonParams::default() };
        let mut problem = arctangent(3.0);
        let failure = system().solve(&mut problem, &full).unwrap_err();
        assert_eq!(problem.x, 3.0, "the state is restored");
        assert!(!failure.report.residuals.is_empty());

        let report = system().solve(&mut problem, &NewtonParams::default()).unwrap();
        assert!(report.line_search_cuts > 0);
        assert!(problem.x.abs() < 1e-9);
        assert_eq!(report.residuals.len(), report.iterations + 1);
        assert_eq!(report.cholesky, report.iterations);
    }

    #[test]
    fn converges_quadratically_near_the_root() {
        let mut problem = Scalar1 { x: 1.5, saved: 0.0, r: |x| x * x - 2.0, dr: |x| 2.0 * x };
        let report = system().solve(&mut problem, &NewtonParams::default()).unwrap();
        assert!((problem.x - 2.0_f64.sqrt()).abs() < 1e-12);
        assert!(report.iterations <= 4);
        let r = &report.residuals;
        assert!(r[2] < 2.0 * r[1] * r[1]);
    }

    #[test]
    fn out_of_iterations_says_how_far_it_came() {
        let params = NewtonParams { max_iterations: 1, ..NewtonParams::default() };
        let mut problem = Scalar1 { x: 1.5, saved: 0.0, r: |x| x * x - 2.0, dr: |x| 2.0 * x };
        let failure = system().solve(&mut problem, &params).unwrap_err();
        match failure.reason {
            NewtonError::TooManyIterations { iterations: 1, residual, limit } => {
                assert!(residual > limit);
            }
            other => panic!("{other}"),
        }
        assert_eq!(problem.x, 1.5);
    }
}
