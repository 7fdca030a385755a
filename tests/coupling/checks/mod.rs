//! What ranks of any kind must do. All ranks of a communicator run a check together; one that needs more of them than
//! there are does nothing.

pub mod lives;
pub mod ranks;
pub mod scales;
pub mod units;

use biotissue::las::{Comm, CommError};

pub type Outcome = Result<(), Box<dyn std::error::Error>>;

/// The first `count` ranks as a group of their own; nothing on the others, nor where there are not so many.
pub fn first<C: Comm>(comm: &C, count: usize) -> Result<Option<C>, CommError> {
    if comm.size() < count {
        return Ok(None);
    }
    comm.split((comm.rank() < count).then_some(0), 0)
}
