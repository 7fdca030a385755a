//! Coupling data: the units that a scale offers to others, and where they are.

use crate::las::{Comm, CommError, Message};

/// The number of a unit: the same on all ranks for as long as the unit lives, wherever it is.
pub type UnitId = u64;

/// How many units each rank of a scale holds, and what they weigh.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Distribution {
    /// By rank of the scale.
    pub counts: Vec<usize>,
    /// The weights of all units by rank; every unit weighs 1 where nothing was said.
    pub weights: Vec<Vec<f64>>,
    /// How many other units each rank of the consumer has of the coupling that these are for; empty where it has none.
    pub held: Vec<usize>,
}

impl Distribution {
    /// Assembles what the ranks of a scale hold. Called by all of them together.
    ///
    /// # Errors
    /// [`CommError`].
    pub fn assemble<C: Comm>(scale: &C, weights: &[f64]) -> Result<Self, CommError> {
        let all = scale.gather_all(Message::of(weights))?;
        let weights: Vec<Vec<f64>> =
            all.iter().map(|message| message.values::<f64>().map_or_else(Vec::new, <[f64]>::to_vec)).collect();
        Ok(Self { counts: weights.iter().map(Vec::len).collect(), weights, held: Vec::new() })
    }

    /// How many units there are.
    #[must_use]
    pub fn units(&self) -> usize {
        self.counts.iter().sum()
    }

    /// What all of them weigh.
    #[must_use]
    pub fn weight(&self) -> f64 {
        self.weights.iter().flatten().sum()
    }

    /// How many units are on the ranks before this one.
    #[must_use]
    pub fn before(&self, rank: usize) -> usize {
        self.counts[..rank].iter().sum()
    }
}
