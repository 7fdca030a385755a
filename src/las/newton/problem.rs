//! The interface of a nonlinear problem, which owns its state.

use crate::las::Backend;

/// A system of nonlinear equations `r(x) = 0` that owns its state `x`.
///
/// The problem stores its state in any form; Newton's method uses only residuals, Jacobians and directions.
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

    /// Returns the size of the change of the state that steps are compared with
    /// ([`NewtonParams::step_tolerance`](super::NewtonParams::step_tolerance)), for example the norm of the displacement
    /// since the last converged state. The default, `None`, makes these criteria true.
    fn state_scale(&self) -> Option<f64> {
        None
    }

    /// Returns true if the error does not depend on the state, so that a shorter step cannot help.
    fn is_final(_: &Self::Error) -> bool {
        false
    }

    /// Saves the state; called once, before the first iteration.
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
