//! What Newton solves: a problem that owns its state.

use crate::las::Backend;

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
    fn residual(&mut self, r: &mut B::Vector) -> Result<ResidualScale, Self::Error>;

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

    /// Whether an error is not of the state, so that no shorter step can help.
    fn is_final(_: &Self::Error) -> bool {
        false
    }

    /// Remembers the state; called once, before the first iteration.
    fn save(&mut self);

    /// Takes the state back to where [`NonlinearProblem::save`] was called; called when Newton fails.
    fn restore(&mut self);
}

/// What a residual is measured against: converged when `|r| <= max(tolerance * scale, floor)`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ResidualScale {
    /// The size of the terms that cancel in the residual, for example the norm of all nodal forces.
    pub scale: f64,
    /// What rounding alone leaves.
    pub floor: f64,
}

impl ResidualScale {
    pub(super) fn relative(self, norm: f64) -> f64 {
        if self.scale > 0.0 { norm / self.scale } else { 0.0 }
    }
}
