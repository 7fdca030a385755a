//! Coupling of the two scales of a tissue, each on its own ranks.
//!
//! | module | holds |
//! |---|---|
//! | `protocol` | the messages between the scales |
//! | `macro_side` | the macro scale: a material that gets its stress from RVEs on other ranks |
//! | `micro_proxy` | the micro scale as seen by the macro scale: sends commands and tasks, receives responses |
//! | `divided` | a body of which each macro rank holds a part: its RVEs, and the responses of its ghosts |
//! | `shard` | the elements of one macro rank and the couplings of their RVEs |
//! | `channels` | the couplings of the RVEs of one rank, the same on both scales |
//! | `micro_side` | the micro scale: solves its RVEs and sends the responses |
//! | `balance` | moves RVEs between the ranks of the micro scale |
//! | `progress` | what the RVEs of all ranks do, for a report of progress |
//! | `partition` | assigns elements to macro ranks |
//!
//! The root of the macro scale broadcasts a command; the micro scale carries it out:
//!
//! ```text
//! macro scale                                      micro scale
//! -----------                                      -----------
//! until all steps are complete:                    while not complete:
//! a migration may be due: Command::Balance ----->   plan; if it pays, migrate RVEs, and both update their couplings
//!   Newton evaluates: Command::Step or Iterate       while not step_complete:
//!     send tasks ------------------------------>       receive tasks
//!     receive responses <-----------------------       solve all RVEs, send responses
//!   Newton converged: Iterate, Task::Verify --->       verify that responses continue the last step
//!   strain creates RVEs: Command::Units ------->       update units; Newton evaluates again
//!   converged: Command::Commit; else Revert --->     step_complete
//!   strain deletes RVEs: Command::Units ------->     update units
//! a checkpoint is due: Command::Save ---------->   each rank writes the states of its RVEs to a piece
//! Command::Complete --------------------------->   complete
//! ```

mod balance;
mod channels;
mod divided;
mod follower;
mod macro_side;
mod micro_proxy;
mod micro_side;
mod partition;
mod progress;
mod protocol;
mod shard;

use thiserror::Error;

pub use balance::{BalanceParams, BalanceReport, MigrationReport, PlannerName, WeightsName, When};
pub use follower::follow;
pub use macro_side::ScaleField;
pub use micro_proxy::BodySolve;
pub use micro_side::{MicroOutput, run as run_micro};
pub use partition::partition;
pub use progress::ProgressChannel;
pub use protocol::{MACRO, MICRO, RankTimes};
#[cfg(feature = "app")]
pub(crate) use protocol::{pack, unpack};

use super::micro_scale::{MovingError, TissueFieldError};
use crate::coupling::balance::BalanceError;
use crate::coupling::{CouplingError, ScaleError};
use crate::las::CommError;

/// Errors of the exchange between the scales.
#[derive(Debug, Error)]
pub enum TwoScaleError {
    /// Communication between ranks failed.
    #[error(transparent)]
    Comm(#[from] CommError),
    /// The coupling of the RVEs failed.
    #[error(transparent)]
    Coupling(#[from] CouplingError),
    /// The ranks cannot be divided among the scales, or a scale did not send or receive in time.
    #[error(transparent)]
    Scales(#[from] ScaleError),
    /// The load of the micro scale cannot be balanced.
    #[error("load balancing: {0}")]
    Balance(#[from] BalanceError),
    /// An RVE cannot move to another rank.
    #[error("an RVE cannot move to another rank: {0}")]
    Moving(#[from] MovingError),
    /// No scale has this name.
    #[error("there is no scale {0}")]
    Scale(&'static str),
    /// A message cannot be decoded.
    #[error("the scales are out of step: {0}")]
    Message(#[from] postcard::Error),
    /// A message holds another command or another number of values than the protocol expects at this point.
    #[error("the scales are out of step: a message of another kind was expected")]
    Protocol,
}

impl From<TwoScaleError> for TissueFieldError {
    fn from(error: TwoScaleError) -> Self {
        Self::Ranks(error.to_string())
    }
}
