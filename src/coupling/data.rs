//! Coupling data: the units of a scale and their distribution over its ranks.

use crate::las::{Comm, CommError, Message};

/// The number of a unit: the same on all ranks during the lifetime of the unit, regardless of its location.
pub type UnitId = u64;

/// The number of units on each rank of a scale, and their weights.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Distribution {
    /// Number of units, by rank of the scale.
    pub counts: Vec<usize>,
    /// Weights of the units, by rank; 1 for every unit if the caller gave none.
    pub weights: Vec<Vec<f64>>,
    /// Number of units that each rank of the consumer already holds in this coupling; may be empty if all hold none.
    pub held: Vec<usize>,
}

impl Distribution {
    /// Gathers the weights of all units of a scale. Collective over the scale.
    ///
    /// # Errors
    /// Returns [`CommError`] if the communication fails.
    pub fn assemble<C: Comm>(scale: &C, weights: &[f64]) -> Result<Self, CommError> {
        let all = scale.gather_all(Message::of(weights))?;
        let weights: Vec<Vec<f64>> =
            all.iter().map(|message| message.values::<f64>().map_or_else(Vec::new, <[f64]>::to_vec)).collect();
        Ok(Self { counts: weights.iter().map(Vec::len).collect(), weights, held: Vec::new() })
    }

    /// Returns the total number of units.
    pub fn units(&self) -> usize {
        self.counts.iter().sum()
    }

    /// Returns the total weight of all units.
    pub fn weight(&self) -> f64 {
        self.weights.iter().flatten().sum()
    }

    /// Returns the number of units on all ranks below `rank`.
    pub fn offset(&self, rank: usize) -> usize {
        self.counts[..rank].iter().sum()
    }
}
