//! The two scales of a tissue, each on ranks of its own, coupled.
//!
//! | module | holds |
//! |---|---|
//! | `terms` | what they tell each other |
//! | `macro_side` | the engineering scale: the material of the body, asked point by point |
//! | `counterpart` | the micro scale as the engineering scale sees it: told, asked, heard |
//! | `part` | a rank of it: the elements of its part and their couplings |
//! | `links` | the couplings of the RVEs of one rank, the same on both scales |
//! | `micro_side` | the micro scale: RVEs that answer |
//! | `writers` | who writes where all ranks of the engineering scale solve, and how they agree |
//! | `partition` | which rank of the engineering scale has which element |
//!
//! The first rank of the engineering scale broadcasts whose turn it is; the micro scale follows:
//!
//! ```text
//! engineering scale                                micro scale
//! -----------------                                -----------
//! until all steps are done:                        while not complete:
//!   Newton asks: Turn::Step or Iterate               while not step_complete:
//!     send strains ------------------------------->    receive strains
//!     receive answers <----------------------------    solve all RVEs, send answers
//!   it converged: Turn::Iterate, Task::Verify ---->    make answers continue the last step
//!   strain demands RVEs: Turn::Units, create ----->    update_units; Newton asks again
//!   balanced: Turn::Accept; or not: Reject ------->   step_complete
//!   what strain deleted: Turn::Units, delete ----->   update_units
//! Turn::Complete -------------------------------->   complete
//! ```

mod counterpart;
mod follower;
mod links;
mod macro_side;
mod micro_side;
mod part;
mod partition;
mod terms;
mod writers;

use thiserror::Error;

pub use counterpart::Lead;
pub use follower::follow;
pub use macro_side::ScaleField;
pub use micro_side::run as run_micro;
pub use partition::partition;
pub use terms::{MACRO, MICRO, Seconds};
pub use writers::First;

use super::micro_scale::TissueFieldError;
use crate::coupling::{CouplingError, ScaleError};
use crate::las::CommError;

/// Why the scales do not go on together.
#[derive(Debug, Error)]
pub enum TwoScaleError {
    /// The ranks could not exchange something.
    #[error(transparent)]
    Comm(#[from] CommError),
    /// Nor the units.
    #[error(transparent)]
    Coupling(#[from] CouplingError),
    /// The scales do not fit the ranks.
    #[error(transparent)]
    Scales(#[from] ScaleError),
    /// There is no such scale.
    #[error("there is no scale {0}")]
    Scale(&'static str),
    /// A message is not what was to come.
    #[error("the scales have lost step with each other: {0}")]
    Message(#[from] postcard::Error),
    /// It is another's turn.
    #[error("the scales have lost step with each other")]
    Turn,
    /// A saved state does not fit.
    #[error("{0}")]
    State(String),
}

impl From<TwoScaleError> for TissueFieldError {
    fn from(error: TwoScaleError) -> Self {
        Self::Ranks(error.to_string())
    }
}
