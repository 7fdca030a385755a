//! Errors of load balancing.

use thiserror::Error;

use crate::las::{CommError, Disagreement};

/// The reason why units cannot be balanced or migrated.
#[derive(Clone, Debug, Error, PartialEq)]
pub enum BalanceError {
    /// The communication failed.
    #[error(transparent)]
    Comm(#[from] CommError),
    /// A weight is negative or infinite.
    #[error("the weight of unit {unit} of rank {rank} is {weight}; it must be finite and not negative")]
    Weight {
        /// The rank of the unit.
        rank: usize,
        /// The index of the unit on this rank.
        unit: usize,
        /// Its weight.
        weight: f64,
    },
    /// The number of entries for the units of a rank is wrong.
    #[error("rank {rank} has {units} units, but {found} {what} were given")]
    Count {
        /// The rank.
        rank: usize,
        /// Number of units of this rank.
        units: usize,
        /// Number of entries given.
        found: usize,
        /// What was given.
        what: &'static str,
    },
    /// The number of sizes is not that of the units of all ranks.
    #[error("the scale has {units} units, but {found} sizes were given")]
    Sizes {
        /// Number of units of all ranks.
        units: usize,
        /// Number of sizes given.
        found: usize,
    },
    /// The number of partners is not that of the units of all ranks.
    #[error("the scale has {units} units, but {found} ranks that they exchange with were given")]
    Partners {
        /// Number of units of all ranks.
        units: usize,
        /// Number of ranks given.
        found: usize,
    },
    /// The migration plan is for another number of ranks.
    #[error("the migration plan is for {found} ranks; the scale has {ranks}")]
    Ranks {
        /// Number of ranks in the plan.
        found: usize,
        /// Number of ranks of the scale.
        ranks: usize,
    },
    /// The migration plan is invalid.
    #[error("migration plan of rank {rank}: {error}")]
    Plan {
        /// The rank whose units the plan moves.
        rank: usize,
        /// The first error found.
        error: MoveError,
    },
    /// A planner made no plan.
    #[error("planner {planner}: {reason}")]
    Planner {
        /// The name of the planner.
        planner: &'static str,
        /// Its error message.
        reason: String,
    },
    /// Another rank of the scale found an error.
    #[error("rank {rank} failed: {reason}")]
    Failed {
        /// The lowest of the ranks that failed.
        rank: usize,
        /// Its error message.
        reason: String,
    },
}

/// The reason why the moves of a rank are invalid.
#[derive(Clone, Copy, Debug, Error, PartialEq, Eq)]
pub enum MoveError {
    /// A unit does not exist.
    #[error("there is no unit {unit} among {units}")]
    Unit {
        /// The index of the unit.
        unit: u32,
        /// Number of units of the rank.
        units: usize,
    },
    /// A unit is moved twice.
    #[error("unit {unit} is moved twice")]
    Twice {
        /// The index of the unit.
        unit: u32,
    },
    /// The target does not exist.
    #[error("there is no rank {to} among {ranks}")]
    Rank {
        /// The target.
        to: usize,
        /// Number of ranks of the scale.
        ranks: usize,
    },
    /// The target is the rank of the unit itself.
    #[error("unit {unit} is moved to the rank that it is on")]
    Itself {
        /// The index of the unit.
        unit: u32,
    },
}

impl From<Disagreement<BalanceError>> for BalanceError {
    fn from(error: Disagreement<BalanceError>) -> Self {
        match error {
            Disagreement::Own(error) => error,
            Disagreement::Failed { rank, reason } => Self::Failed { rank, reason },
            Disagreement::Comm(error) => error.into(),
        }
    }
}
