//! What an observer of a run is told.

use super::results::log::{Cut, Step};
use crate::fem::stepping::Iterating;

/// An observer of the progress of a run.
pub trait Progress {
    /// Called after a load step has converged.
    fn converged(&mut self, step: &Step);

    /// Called after an attempt has failed; the increment is then halved, if there are halvings left.
    fn failed(&mut self, cut: &Cut);

    /// Called before every iteration of Newton's method of the body.
    fn iterating(&mut self, iteration: &Iterating<'_>) {
        let _ = iteration;
    }

    /// Called after a checkpoint of a load step has been written.
    fn saved(&mut self, step: usize) {
        let _ = step;
    }

    /// Returns true if the run is to end before its next load step, with a checkpoint.
    fn is_interrupted(&self) -> bool {
        false
    }
}

/// Ignores progress.
impl Progress for () {
    fn converged(&mut self, _: &Step) {}

    fn failed(&mut self, _: &Cut) {}
}
