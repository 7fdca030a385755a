//! Equilibria of many RVEs of one model at once: the interface of a solver that has another processor at its disposal.

use nalgebra::Matrix3;

use super::equilibrium::EquilibriumParams;
use super::homogenize::Tangent;
use super::rve::Rve;

/// An RVE in equilibrium.
#[derive(Clone, Copy, Debug)]
pub struct BatchEquilibrium {
    /// First Piola-Kirchhoff stress, Pa.
    pub pk1: Matrix3<f64>,
    /// Strain energy per reference volume, J/m^3.
    pub energy: f64,
    /// `dP/dF`, Pa.
    pub tangent: Tangent,
    /// Newton iterations.
    pub iterations: usize,
    /// Steps that the line search shortened.
    pub backtracks: usize,
    /// Processor time of this RVE, in seconds, if the solver knows it.
    pub seconds: Option<f64>,
}

/// Receives the progress of a batch, from any thread.
pub trait BatchProgress: Sync {
    /// The solution of a group of RVEs begins, of which the first in the batch has the number `first`. An RVE that takes
    /// long may be in several groups, one after the other.
    fn begin(&self, first: usize);

    /// The solution of the group ended, with so many of its RVEs done.
    fn end(&self, first: usize, done: usize);
}

/// Ignores progress.
impl BatchProgress for () {
    fn begin(&self, _: usize) {}

    fn end(&self, _: usize, _: usize) {}
}

/// Solves for the equilibria of many RVEs of one model.
///
/// Whatever it solves has the result of [`equilibrate`](super::equilibrium::equilibrate) to rounding errors, and the
/// result of an RVE does not depend on the others, nor on their order. What it does not solve, it leaves to `equilibrate`.
/// RVEs come in descending order of their expected iterations, so that those that are solved together take about equally
/// many.
pub trait BatchSolver: Send {
    /// Brings RVEs to equilibrium at these deformation gradients, one for each. An RVE for which the result is `None` is
    /// unchanged: it needs more than Newton's method, or its state does not belong to the model. Tells `progress` of each
    /// group of RVEs that it solves at once.
    ///
    /// # Errors
    /// Returns the reason why nothing can be solved; the RVEs are then unchanged or in equilibrium at their gradients.
    fn solve(
        &mut self,
        rves: &mut [&mut Rve],
        targets: &[Matrix3<f64>],
        params: &EquilibriumParams,
        progress: &dyn BatchProgress,
    ) -> Result<Vec<Option<BatchEquilibrium>>, String>;

    /// Bytes of memory of this process for each thread that solves.
    fn bytes_per_thread(&self) -> usize {
        0
    }

    /// Number of RVEs that are solved at once and share their time, whether the group is full or not; 1 if they do not.
    fn group(&self) -> usize {
        1
    }

    /// Returns for each RVE whether Newton evidently leads from the state in `from`, moved affinely, to the equilibrium in
    /// `reached`; see [`converges_to`](super::equilibrium::converges_to).
    ///
    /// # Errors
    /// Returns the reason why nothing can be tested.
    fn converge_to(&mut self, from: &[&Rve], reached: &[&Rve], params: &EquilibriumParams)
    -> Result<Vec<bool>, String>;
}
