//! Further steps with the factorization of an iteration.
//!
//! Near a solution, the error of a step with an earlier Jacobian (a chord step) is about the product of the distances of
//! its start and of that Jacobian's state from the solution (C. T. Kelley, *Iterative Methods for Linear and Nonlinear
//! Equations*, SIAM, 1995, section 5.4). It costs a solution and an evaluation of the residual, but no assembly and no
//! factorization.

use super::{
    Backend, Evaluation, Iterate, NewtonError, NewtonParams, NewtonReport, NewtonSystem, NonlinearProblem,
    is_recoverable,
};
use crate::las::{Scalar, SolveError};

impl<B: Backend<Reduced: Scalar>> NewtonSystem<B> {
    /// Takes up to [`NewtonParams::chord_steps`] steps from `iterate`; `before` is the residual norm before the step that
    /// led there. A step that does not reduce the residual is taken back.
    pub(super) fn take_chord_steps<P: NonlinearProblem<B>>(
        &mut self,
        problem: &mut P,
        params: &NewtonParams,
        mut before: f64,
        mut iterate: Iterate,
        report: &mut NewtonReport,
    ) -> Evaluation<B, P> {
        for _ in 0..params.chord_steps {
            let limit = iterate.residual_scale.limit(params.tolerance);
            let pays = iterate.step == 1.0 && iterate.norm <= NewtonParams::CHORD_SHARE * before;
            if !pays || iterate.norm <= limit {
                break;
            }
            match self.reuse_factorization(problem, report) {
                // A new factorization may serve where this one does not.
                Err(NewtonError::Solve(error)) if !matches!(error, SolveError::Backend(_)) => break,
                outcome => outcome?,
            }
            let work = self.work(params)?;
            self.advance(problem, -1.0)?;
            match self.evaluate(problem, report) {
                Ok(next) if next.norm <= ((1.0 - params.sufficient_decrease) * iterate.norm).max(limit) => {
                    before = iterate.norm;
                    iterate = self.settled(problem, params, next, work)?;
                }
                Err(error) if !is_recoverable::<B, P>(&error) => return Err(error),
                _ => {
                    self.advance(problem, 1.0)?;
                    let back = self.evaluate(problem, report)?;
                    return Ok(Iterate { settled: iterate.settled, ..back });
                }
            }
        }
        Ok(iterate)
    }
}

#[cfg(all(test, feature = "dense"))]
mod tests {
    use super::*;
    use crate::las::newton::tests::{arctangent, equation, system};

    fn params(chord_steps: usize) -> NewtonParams {
        NewtonParams { chord_steps, ..NewtonParams::default() }
    }

    #[test]
    fn chord_steps_replace_factorizations() {
        let parabola = || equation(1.45, |x| x * x - 2.0, |x| 2.0 * x);
        let newton = system().solve(&mut parabola(), &params(0)).unwrap();
        for chord_steps in [1, 2, 3] {
            let mut problem = parabola();
            let report = system().solve(&mut problem, &params(chord_steps)).unwrap();
            assert!((problem.x - 2.0_f64.sqrt()).abs() < 1e-10);
            assert!(report.iterations < newton.iterations, "{} of {}", report.iterations, newton.iterations);
            assert!((1..=chord_steps * report.iterations).contains(&report.kept), "{report:?}");
            assert_eq!((report.cholesky, report.residuals.len()), (report.iterations, report.iterations + 1));
        }
    }

    #[test]
    fn a_step_that_leaves_much_of_the_residual_has_no_chord_steps() {
        // The first step on the arctangent leaves 0.18 of the residual.
        let report = system().solve(&mut arctangent(0.5), &NewtonParams { tolerance: 0.1, ..params(9) }).unwrap();
        assert_eq!((report.iterations, report.kept), (1, 0));
        let report = system().solve(&mut arctangent(0.5), &NewtonParams { tolerance: 0.01, ..params(9) }).unwrap();
        assert_eq!((report.iterations, report.kept), (2, 0));
    }

    /// The full steps 2 -> 1 -> 0 have the residuals 4, 0.25 and 0; the chord step from 1 ends at 15 / 16.
    #[test]
    fn a_chord_step_that_does_not_reduce_the_residual_is_taken_back() {
        fn slope(x: f64) -> f64 {
            if x > 1.5 { 4.0 } else { 0.25 }
        }
        fn steep(x: f64) -> f64 {
            if x > 1.5 { 4.0 } else { 0.25 * x }
        }
        let rises: fn(f64) -> f64 = |x| if x == 0.9375 { 3.0 } else { steep(x) };
        let is_undefined: fn(f64) -> f64 = |x| if x == 0.9375 { f64::NAN } else { steep(x) };
        for residual in [rises, is_undefined] {
            let mut problem = equation(2.0, residual, slope);
            let report = system().solve(&mut problem, &params(2)).unwrap();
            assert_eq!((problem.x, report.residuals, report.kept), (0.0, vec![4.0, 0.25, 0.0], 1));
        }
    }

    #[test]
    fn the_criteria_of_a_step_judge_the_last_chord_step() {
        // The steps from 0.3 are 0.318, and with its derivative 0.0193 and 0.0017.
        let iterations = |step_tolerance| {
            let params = NewtonParams { tolerance: 1e-3, step_tolerance: Some(step_tolerance), ..params(2) };
            let mut problem = arctangent(0.3);
            problem.state_scale = Some(1.0);
            let report = system().solve(&mut problem, &params).unwrap();
            (report.iterations, report.kept)
        };
        assert_eq!(iterations(0.01), (1, 2));
        assert_eq!(iterations(0.001), (2, 2));
    }
}
