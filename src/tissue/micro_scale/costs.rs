//! What each RVE cost in each sweep of a step, kept for the results if a run asks for it.

use std::sync::{Mutex, PoisonError};

use serde::{Deserialize, Serialize};

use crate::coupling::balance::Cost;

/// What an RVE cost in one sweep: one evaluation of all RVEs.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct RveCost {
    /// Its point, by its number in the whole mesh.
    pub point: u64,
    /// The number of its model in the library; `None` for one without a network.
    pub model: Option<u32>,
    /// Iterations of Newton's method.
    pub iterations: u32,
    /// Seconds of computation.
    pub seconds: f64,
}

impl RveCost {
    pub(super) fn new(point: usize, model: Option<usize>, cost: &Cost) -> Self {
        let model = model.map(|model| model as u32);
        Self { point: point as u64, model, iterations: cost.iterations as u32, seconds: cost.seconds }
    }
}

/// The costs of the sweeps since they were last taken. Behind a lock, because observers of a run have only shared access
/// to the RVEs.
#[derive(Default)]
pub(super) struct KeptCosts(Mutex<Vec<Vec<RveCost>>>);

impl KeptCosts {
    pub fn push(&mut self, sweep: Vec<RveCost>) {
        self.0.get_mut().unwrap_or_else(PoisonError::into_inner).push(sweep);
    }

    pub fn take(&self) -> Vec<Vec<RveCost>> {
        std::mem::take(&mut self.0.lock().unwrap_or_else(PoisonError::into_inner))
    }
}
