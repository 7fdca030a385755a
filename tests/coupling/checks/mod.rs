//! Checks for ranks of any kind. All ranks of a communicator run a check together; a check that needs more ranks than
//! there are does nothing.

pub mod balance;
pub mod random_changes;
pub mod ranks;
pub mod scales;
pub mod units;

use biotissue::las::{Comm, CommError};

pub type Outcome = Result<(), Box<dyn std::error::Error>>;

/// Returns a communicator of the first `count` ranks; `None` on all other ranks, and if there are fewer ranks.
pub fn first<C: Comm>(comm: &C, count: usize) -> Result<Option<C>, CommError> {
    if comm.size() < count {
        return Ok(None);
    }
    comm.split((comm.rank() < count).then_some(0), 0)
}
