//! Whether a stationary point is a minimum of the potential, and the way off one that is not.
//!
//! Newton solves `r = 0` and does not ask of what kind the solution is. Where `r` is the gradient of a potential, the
//! stable solutions are its minima, where the Hessian `K` is positive semi-definite; at any other stationary point `K`
//! has a direction `p` of negative curvature, `p . K p < 0`, along which the potential falls to both sides (Nocedal and
//! Wright, *Numerical Optimization*, 2nd ed., 2006, sections 2.1 and 3.4). A Cholesky factorization tells the two apart.

use super::{
    Backend, MatrixOps, NewtonError, NewtonReport, NewtonSystem, NonlinearProblem, Potential, Scalar, SolveError,
    Solver, Trial, VectorOps, fault,
};
use crate::las::{Factorization, Value};

/// Eigenvalues above minus this part of the largest diagonal entry count as zero: what is left of a residual (relative to
/// all forces) leaves forces in motions that nothing resists, and so a curvature of either sign.
///
/// With the usual tolerance of 1e-10 it is 1e-9: far above rounding, far below the stiffness of anything that resists.
fn neutral(tolerance: f64) -> f64 {
    (10.0 * tolerance).clamp(1e-9, 1e-3)
}

/// A Cholesky factor with a pivot below this part of the largest is one of a matrix that is singular but for rounding.
const ROUNDING: f64 = 1e-12;

/// The Hessian of a potential at a stationary point, as far as its factorization shows it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Curvature {
    /// It is positive definite, so that the point is a minimum. The solver holds its factor.
    Definite,
    /// It is positive definite only with ten times the tolerance of the residual (and at least 1e-9) of its largest
    /// diagonal entry added to the diagonal: there are motions that nothing resists.
    Neutral,
    /// It is indefinite: the point is a saddle point or a maximum.
    Indefinite {
        /// How many of its eigenvalues are negative even with that added, counted by the negative pivots of LDL^T; `None`
        /// where the solver does not count them.
        negative_pivots: Option<usize>,
    },
    /// The solver cannot tell: it factors by LU alone.
    Unknown,
}

/// What came of an attempt to leave a saddle point.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Departure {
    /// The potential is lower than it was, and the residual is above its limit: a descent can begin.
    Downhill,
    /// The residual stays within its limit, or the potential does not fall, as far as the curvature is negative: the point
    /// cannot be told from one at which motions are free.
    AtRest,
}

/// A point on the way down from a saddle point.
struct Step {
    length: f64,
    potential: f64,
    norm: f64,
}

/// Two shifts of the Hessian, of which the larger makes it positive definite and the smaller does not.
struct Bracket {
    least: f64,
    most: f64,
}

impl<B: Backend> NewtonSystem<B>
where
    B::Reduced: Scalar,
{
    /// What the Hessian is like at the state that was evaluated last, where the residual is within `tolerance` of its scale.
    /// The solver then holds the factor of the Hessian
    /// where that is [`Curvature::Definite`], and no factor that is of use where it is not.
    ///
    /// An iterative solver shows no more than its preconditioner does ([`Solver::factor_definite`]).
    ///
    /// # Errors
    /// [`NewtonError::Problem`], and [`NewtonError::Solve`] for failures that say nothing of the Hessian.
    pub fn curvature<P: NonlinearProblem<B>>(
        &mut self,
        problem: &mut P,
        tolerance: f64,
    ) -> Result<Curvature, NewtonError<P::Error, B::Fault>> {
        if self.matrix.shape().0 == 0 {
            return Ok(Curvature::Definite);
        }
        self.assemble(problem)?;
        self.matrix.finish().map_err(fault)?;
        match self.solver.factor_definite(&self.matrix) {
            Ok(factor) if factor.kind == Factorization::Lu && factor.negative_pivots.is_none() => {
                return Ok(Curvature::Unknown);
            }
            Ok(factor) if factor.kind == Factorization::Approximate || factor.pivot_ratio >= ROUNDING => {
                return Ok(Curvature::Definite);
            }
            Err(SolveError::Unsupported { .. }) => return Ok(Curvature::Unknown),
            outcome => refused(outcome)?,
        };
        let stiffest = self.stiffest(problem)?;
        if self.is_definite(problem, neutral(tolerance) * stiffest)? {
            return Ok(Curvature::Neutral);
        }
        let negative_pivots = match self.solver.factor(&self.matrix) {
            Ok(factor) => factor.negative_pivots,
            outcome => {
                refused(outcome)?;
                None
            }
        };
        Ok(Curvature::Indefinite { negative_pivots })
    }

    /// Moves the state off a saddle point along a direction of negative curvature, as far as the potential falls.
    ///
    /// The direction comes from inverse iteration with the Hessian shifted until it is just positive definite, from a
    /// start that is the same every time: where a symmetry leaves the choice between two sides, it is the same side.
    ///
    /// # Errors
    /// As for [`NewtonSystem::curvature`].
    pub fn leave_saddle<P: Potential<B>>(
        &mut self,
        problem: &mut P,
        tolerance: f64,
        report: &mut NewtonReport,
    ) -> Result<Departure, NewtonError<P::Error, B::Fault>> {
        let Some(curvature) = self.negative_curvature(problem, tolerance)? else { return Ok(Departure::AtRest) };
        let (norm, residual_scale) = self.evaluate(problem, report).map_err(Trial::into_error)?;
        let limit = (tolerance * residual_scale.scale).max(residual_scale.floor);
        let start = Step { length: 0.0, potential: problem.potential(), norm };
        for side in [1.0, -1.0] {
            let reached = self.walk(problem, &start, side, limit / curvature.abs(), report)?;
            if reached.length > 0.0 {
                return Ok(if reached.norm > limit { Departure::Downhill } else { Departure::AtRest });
            }
        }
        Ok(Departure::AtRest)
    }

    /// The longest of a growing sequence of steps along the direction up to which the potential falls. `first` is the
    /// step at which the residual of a quadratic potential reaches its limit.
    fn walk<P: Potential<B>>(
        &mut self,
        problem: &mut P,
        start: &Step,
        side: f64,
        first: f64,
        report: &mut NewtonReport,
    ) -> Result<Step, NewtonError<P::Error, B::Fault>> {
        /// From rounding to the size of anything.
        const MOST_STEPS: u32 = 60;
        const GROWTH: f64 = 4.0;
        let mut reached = Step { ..*start };
        let mut length = if first > 0.0 && first.is_finite() { 10.0 * first } else { f64::EPSILON };
        for _ in 0..MOST_STEPS {
            problem.advance(side * (length - reached.length), &self.direction).map_err(NewtonError::Problem)?;
            let falls = match self.evaluate(problem, report) {
                Ok((norm, _)) => {
                    let slope = side * self.residual.dot(&self.direction).map_err(fault)?.as_f64();
                    let step = Step { length, potential: problem.potential(), norm };
                    // Short steps change the potential by less than its rounding; the slope tells more.
                    (slope < 0.0 && step.potential <= reached.potential + 1e-12 * reached.potential.abs())
                        .then_some(step)
                }
                Err(Trial::NotFinite) => None,
                Err(Trial::Undefined(error)) if !P::is_final(&error) => None,
                Err(error) => return Err(error.into_error()),
            };
            let Some(step) = falls else {
                problem.advance(side * (reached.length - length), &self.direction).map_err(NewtonError::Problem)?;
                self.evaluate(problem, report).map_err(Trial::into_error)?;
                break;
            };
            reached = step;
            length *= GROWTH;
        }
        Ok(reached)
    }

    /// A direction of unit length along which the Hessian has this negative curvature, in `direction`; `None` where the
    /// Hessian has none that its factorizations show.
    fn negative_curvature<P: NonlinearProblem<B>>(
        &mut self,
        problem: &mut P,
        tolerance: f64,
    ) -> Result<Option<f64>, NewtonError<P::Error, B::Fault>> {
        const MOST_ITERATIONS: u32 = 100;
        let Some(Bracket { least, most: shift }) = self.bracket(problem, tolerance)? else { return Ok(None) };
        // Without any symmetry that the Hessian may have.
        let spread = |x: &mut [B::Scalar]| {
            x.iter_mut().enumerate().for_each(|(k, x)| *x = B::Scalar::every((k as f64 + 1.0).sqrt().fract() - 0.3));
        };
        self.direction.with_local_mut(spread).map_err(fault)?;
        self.direction.finish().map_err(fault)?;
        for _ in 0..MOST_ITERATIONS {
            let length = self.direction.norm().map_err(fault)?.as_f64();
            self.residual.zero().map_err(fault)?;
            self.residual.axpy(B::Scalar::every(1.0 / length), &self.direction).map_err(fault)?;
            self.solver.solve(&self.residual, &mut self.direction).map_err(NewtonError::Solve)?;
            // The Rayleigh quotient of the solution, whose product with the shifted Hessian is the unit vector solved for.
            let length = self.direction.norm().map_err(fault)?.as_f64();
            let quotient = self.residual.dot(&self.direction).map_err(fault)?.as_f64() / (length * length) - shift;
            if quotient <= -0.5 * least {
                self.residual.zero().map_err(fault)?;
                self.residual.axpy(B::Scalar::every(1.0 / length), &self.direction).map_err(fault)?;
                std::mem::swap(&mut self.residual, &mut self.direction);
                return Ok(Some(quotient));
            }
        }
        Ok(None)
    }

    /// Two numbers not far from each other with minus the lowest eigenvalue between them; the solver then holds the factor
    /// of the Hessian shifted by the larger one.
    fn bracket<P: NonlinearProblem<B>>(
        &mut self,
        problem: &mut P,
        tolerance: f64,
    ) -> Result<Option<Bracket>, NewtonError<P::Error, B::Fault>> {
        let stiffest = self.stiffest(problem)?;
        let mut least = neutral(tolerance) * stiffest;
        let mut most = 8.0 * least;
        while !self.is_definite(problem, most)? {
            (least, most) = (most, 8.0 * most);
            if most.is_nan() || most >= 1e9 * stiffest {
                return Ok(None);
            }
        }
        for _ in 0..3 {
            let middle = (least * most).sqrt();
            *(if self.is_definite(problem, middle)? { &mut most } else { &mut least }) = middle;
        }
        Ok(self.is_definite(problem, most)?.then_some(Bracket { least, most }))
    }

    /// The largest diagonal entry of the Hessian, by absolute value.
    fn stiffest<P: NonlinearProblem<B>>(&mut self, problem: &mut P) -> Result<f64, NewtonError<P::Error, B::Fault>> {
        self.assemble(problem)?;
        let stiffest = self.shift_diagonal(0.0).map_err(NewtonError::Solve)?;
        self.matrix.finish().map_err(fault)?;
        Ok(stiffest)
    }

    /// Whether the Hessian with its diagonal shifted has a Cholesky factor, or would have but for rounding.
    fn is_definite<P: NonlinearProblem<B>>(
        &mut self,
        problem: &mut P,
        shift: f64,
    ) -> Result<bool, NewtonError<P::Error, B::Fault>> {
        self.assemble(problem)?;
        self.shift_diagonal(shift).map_err(NewtonError::Solve)?;
        self.matrix.finish().map_err(fault)?;
        match self.solver.factor_definite(&self.matrix) {
            Ok(_) | Err(SolveError::Singular { .. }) => Ok(true),
            outcome => refused(outcome).map(|()| false),
        }
    }

    fn assemble<P: NonlinearProblem<B>>(&mut self, problem: &mut P) -> Result<(), NewtonError<P::Error, B::Fault>> {
        self.matrix.zero().map_err(fault)?;
        problem.jacobian(&mut self.matrix).map_err(NewtonError::Problem)
    }
}

/// Lets those outcomes of a factorization pass that are of the matrix.
fn refused<T, E, F>(outcome: Result<T, SolveError<F>>) -> Result<(), NewtonError<E, F>> {
    match outcome {
        Ok(_) | Err(SolveError::Indefinite { .. } | SolveError::Singular { .. } | SolveError::Inaccurate { .. }) => {
            Ok(())
        }
        Err(error) => Err(NewtonError::Solve(error)),
    }
}
