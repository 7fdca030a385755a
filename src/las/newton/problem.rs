//! The interface of a nonlinear problem, which owns its state.

use super::Border;
use crate::las::Backend;

/// A system of nonlinear equations `r(x) = 0` that owns its state `x`.
///
/// The problem stores its state in any form; Newton's method uses only residuals, Jacobians and directions.
///
/// # Constraints
/// A problem may have `m` scalar constraints with multipliers `p`, `r(x, p) = 0` and `c(x, p) = 0`, whose linearization
/// is the bordered system of [`Border`]. The problem scales constraints and multipliers such that `c` has the unit of
/// `r`: the norm of the residual is then `sqrt(|r|^2 + |c|^2)`. The factors must not change during a solve, or the line
/// search would compare different norms.
pub trait NonlinearProblem<B: Backend> {
    /// The reason why the problem cannot be evaluated at a state (an inverted element, for example). Newton then
    /// shortens the step if possible.
    type Error: std::error::Error;

    /// Writes all entries of `r(x)` at the current state and returns the scale of the residual.
    ///
    /// # Errors
    /// Returns an error if the residual is undefined at this state.
    fn residual(&mut self, r: &mut B::Vector) -> Result<ResidualScale, Self::Error>;

    /// Adds `dr/dx` at the current state to `k`, which the caller has set to zero.
    ///
    /// # Errors
    /// Returns an error if the Jacobian is undefined at this state.
    fn jacobian(&mut self, k: &mut B::Matrix) -> Result<(), Self::Error>;

    /// `x += a d`.
    ///
    /// # Errors
    /// Returns an error if the state cannot be updated.
    fn advance(&mut self, a: f64, d: &B::Vector) -> Result<(), Self::Error>;

    /// Returns the number of constraints, which must be that of the system ([`NewtonSystem::bordered`]). The default is
    /// none.
    ///
    /// [`NewtonSystem::bordered`]: super::NewtonSystem::bordered
    fn constraints(&self) -> usize {
        0
    }

    /// Writes `c(x, p)` at the state of the last [`NonlinearProblem::residual`], whose scale and floor include the
    /// constraints. Called only if there are constraints.
    fn constraint_residuals(&self, c: &mut [f64]) {
        let _ = c;
    }

    /// Writes the gradients and compliances of the constraints at the state of the last
    /// [`NonlinearProblem::residual`]. Called only if there are constraints.
    ///
    /// # Errors
    /// Returns an error if the gradients are undefined at this state.
    fn border(&mut self, border: &mut Border<B>) -> Result<(), Self::Error> {
        let _ = border;
        Ok(())
    }

    /// `p += a dp`. Called only if there are constraints.
    fn advance_multipliers(&mut self, a: f64, dp: &[f64]) {
        let _ = (a, dp);
    }

    /// Returns the size of the change of the state that steps are compared with
    /// ([`NewtonParams::step_tolerance`](super::NewtonParams::step_tolerance)), for example the norm of the
    /// displacement since the last converged state. The default, `None`, makes these criteria true.
    fn state_scale(&self) -> Option<f64> {
        None
    }

    /// Returns true if what the residual norm does not measure has converged too, at the last state at which the
    /// residual was evaluated: a constraint whose error is small as a force may still be large by its own measure.
    /// Otherwise the iteration goes on. The default is true.
    fn is_settled(&self, tolerance: f64) -> bool {
        let _ = tolerance;
        true
    }

    /// Returns true if the error does not depend on the state, so that a shorter step cannot help.
    fn is_final(_: &Self::Error) -> bool {
        false
    }

    /// Saves the state, multipliers included; called once, before the first iteration.
    fn save(&mut self);

    /// Restores the state saved by [`NonlinearProblem::save`]; called if Newton fails.
    fn restore(&mut self);
}

/// The scale of a residual. The iteration has converged if `|r|` is not above [`ResidualScale::limit`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ResidualScale {
    /// The size of the terms that cancel in the residual, for example the norm of all nodal forces.
    pub scale: f64,
    /// The residual norm caused by rounding errors alone.
    pub floor: f64,
}

impl ResidualScale {
    /// The residual norm at which the iteration has converged: `max(tolerance * scale, floor)`.
    pub fn limit(self, tolerance: f64) -> f64 {
        (tolerance * self.scale).max(self.floor)
    }

    pub(super) fn relative(self, norm: f64) -> f64 {
        if self.scale > 0.0 { norm / self.scale } else { 0.0 }
    }
}
