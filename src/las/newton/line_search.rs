//! Backtracking line search on the norm of the residual.
//!
//! With the Jacobian `K` at the iterate `x` and the Newton direction `d = K^-1 r`, the function `phi(a) = |r(x - a d)|`
//! of the step length `a` has the slope `phi'(0) = -|r(x)|`. The step length is accepted if it satisfies the
//! sufficient-decrease (Armijo) condition `phi(a) <= phi(0) + c a phi'(0)`, which here reads
//!
//! ```text
//! |r(x - a d)| <= (1 - c a) |r(x)|
//! ```
//!
//! (J. Nocedal and S. J. Wright, *Numerical Optimization*, 2nd ed., 2006, section 3.1, and section 11.2 for nonlinear
//! equations), with the constant `c` of [`NewtonParams::sufficient_decrease`]. The nonmonotone variant replaces
//! `|r(x)|` by the maximum over the last iterates, [`NewtonParams::nonmonotone_memory`] in number:
//!
//! ```text
//! |r(x_k - a d)| <= (1 - c a) max_j |r(x_(k-j))|,  0 <= j < memory
//! ```
//!
//! (L. Grippo, F. Lampariello and S. Lucidi, SIAM J. Numer. Anal. 23 (1986) 707, who take the slope at `x_k` for the
//! decrease; here the decrease too is relative to the maximum). A step that converges is always accepted.

use super::{
    Backend, Evaluation, NewtonError, NewtonParams, NewtonReport, NewtonSystem, NonlinearProblem, is_recoverable,
};
use crate::las::Scalar;

impl<B: Backend<Reduced: Scalar>> NewtonSystem<B> {
    /// Takes the step `-a d` with the first step length of a sequence `1 = a_0 > a_1 > ...` that satisfies the
    /// sufficient-decrease condition, or whose residual norm is within `limit`.
    ///
    /// # Errors
    /// Returns [`NewtonError::LineSearch`] if [`NewtonParams::max_backtracks`] reductions of the step length do not
    /// suffice.
    pub(super) fn line_search<P: NonlinearProblem<B>>(
        &mut self,
        problem: &mut P,
        params: &NewtonParams,
        limit: f64,
        report: &mut NewtonReport,
    ) -> Evaluation<B, P> {
        let recent = &report.residuals[report.residuals.len().saturating_sub(params.nonmonotone_memory.max(1))..];
        let (current, largest) = recent.iter().fold((0.0, 0.0_f64), |(_, largest), &norm| (norm, largest.max(norm)));
        let (mut position, mut step) = (0.0, 1.0);
        for backtrack in 0..=params.max_backtracks {
            self.advance(problem, position - step)?;
            position = step;
            let is_last = backtrack == params.max_backtracks;
            let factor = match self.evaluate(problem, report) {
                Ok(mut trial)
                    if trial.norm <= ((1.0 - params.sufficient_decrease * step) * largest).max(limit)
                        || params.max_backtracks == 0 =>
                {
                    trial.step = step;
                    return Ok(trial);
                }
                Ok(trial) => backtracking_factor(step, current, trial.norm),
                Err(NewtonError::NotFinite) => 0.5,
                Err(error) if !is_last && is_recoverable::<B, P>(&error) => 0.5,
                Err(error) => return Err(error),
            };
            if !is_last {
                step *= factor;
                report.backtracks += 1;
            }
        }
        Err(NewtonError::LineSearch { iteration: report.iterations, residual: current, step })
    }
}

/// The factor that reduces a rejected step length `a` to the minimizer of the parabola that interpolates `phi^2` at 0
/// and `a`, with its slope `-2 phi(0)^2` at 0 (Nocedal and Wright, section 3.5). It is limited to [0.1, 0.5] (Dennis
/// and Schnabel, *Numerical Methods for Unconstrained Optimization and Nonlinear Equations*, 1996, algorithm A6.3.1).
fn backtracking_factor(step: f64, current: f64, trial: f64) -> f64 {
    let (current, trial) = (current * current, trial * trial);
    (current * step / (trial - current + 2.0 * current * step)).clamp(0.1, 0.5)
}

#[cfg(test)]
mod tests {
    use super::backtracking_factor;

    #[test]
    fn interpolation_finds_the_minimizer_of_a_parabola() {
        // phi^2 = f (1 - 2 a + c a^2) has its minimum at a = 1 / c.
        let factor = |step: f64, c: f64| {
            let square = 1.0 - 2.0 * step + c * step * step;
            backtracking_factor(step, 3.0, 3.0 * square.sqrt())
        };
        assert!((factor(1.0, 4.0) - 0.25).abs() < 1e-14);
        assert!((factor(0.5, 5.0) - 0.4).abs() < 1e-14);
        assert_eq!([factor(1.0, 1.5), factor(1.0, 100.0)], [0.5, 0.1]);
    }
}
