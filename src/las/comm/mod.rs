//! Ranks: programs, or threads of one, that run side by side, each with its own data, and exchange messages.
//!
//! [`Comm`] is what a backend of ranks gives: point-to-point messages and a way to split. What all ranks of a communicator do
//! together (`barrier`, `broadcast`, `gather`, `sum`, `agree`) is written on top of that, once. Sums are taken in the order of
//! the ranks, so that they are the same in every run, bit for bit.
//!
//! A rank that fails ends all others: where ranks are threads, their calls return [`CommError::Ended`] with its number and its
//! words; processes are ended as they are.

mod collectives;
mod message;
mod payload;

use std::time::Duration;

use thiserror::Error;

pub use message::Message;
pub use payload::{Layout, Payload};

/// What a message is about: messages of one tag from one rank arrive in the order in which they were sent.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct Tag(pub(crate) u32);

impl Tag {
    /// What all ranks do together.
    pub(crate) const TOGETHER: Self = Self(0);
    /// A tag of a user, who has a communicator of his own ([`Comm::duplicate`]).
    #[must_use]
    pub const fn of(number: u16) -> Self {
        Self(1 + number as u32)
    }
}

/// Why ranks could not exchange something.
#[derive(Clone, Debug, Error, PartialEq, Eq)]
pub enum CommError {
    /// Another rank failed, and all end with it.
    #[error("rank {rank} failed: {reason}")]
    Ended {
        /// Its number among all ranks of the program.
        rank: usize,
        /// What it said.
        reason: String,
    },
    /// Nobody answered in time.
    #[error("no message from rank {from} in {} s", .waited.as_secs_f64())]
    TimeOut {
        /// Who should have.
        from: usize,
        /// How long was waited.
        waited: Duration,
    },
    /// Nobody took a message in time.
    #[error("rank {to} has taken no message for {} s", .waited.as_secs_f64())]
    NotTaken {
        /// Who should have.
        to: usize,
        /// How long was waited.
        waited: Duration,
    },
    /// A message is not what was waited for.
    #[error("a message of {found} bytes from rank {from}, where {expected} were to come")]
    Size {
        /// Who sent it.
        from: usize,
        /// Its bytes.
        found: usize,
        /// Those that were to come.
        expected: usize,
    },
    /// There is no such rank.
    #[error("there is no rank {rank} among {size}")]
    Rank {
        /// The number.
        rank: usize,
        /// How many there are.
        size: usize,
    },
    /// What the library of the ranks reports.
    #[error("{0}")]
    Library(String),
}

/// A message on its way.
pub trait Sending {
    /// Waits until the message is out of this rank's hands, and gives back its memory if it is here.
    ///
    /// # Errors
    /// [`CommError`].
    fn wait(self) -> Result<Option<Message>, CommError>;
}

/// A message that is to come.
pub trait Receiving {
    /// Waits until it is there.
    ///
    /// # Errors
    /// [`CommError`]; [`CommError::Size`] where it is longer or shorter than was said.
    fn wait(self) -> Result<Message, CommError>;
}

/// A group of ranks.
///
/// Cheap to clone; the clone is the same group.
pub trait Comm: Clone + Send + 'static {
    /// A message on its way.
    type Sending: Sending;
    /// A message that is to come.
    type Receiving: Receiving;

    /// The number of this rank, from 0.
    fn rank(&self) -> usize;

    /// How many ranks there are.
    fn size(&self) -> usize;

    /// Hands a message over to be sent, and returns at once.
    ///
    /// # Errors
    /// [`CommError::Rank`], [`CommError::Ended`].
    fn start_send(&self, to: usize, tag: Tag, message: Message) -> Result<Self::Sending, CommError>;

    /// Waits for the next message of a rank.
    ///
    /// # Errors
    /// [`CommError::Rank`], [`CommError::Ended`], [`CommError::TimeOut`].
    fn receive(&self, from: usize, tag: Tag) -> Result<Message, CommError>;

    /// Waits until the next message of a rank has come, and leaves it where it is: who waits before receiving knows how much
    /// of the time was waiting.
    ///
    /// # Errors
    /// As for [`receive`](Self::receive).
    fn wait_for(&self, from: usize, tag: Tag) -> Result<(), CommError>;

    /// As [`receive`](Self::receive), into memory that the caller has left where that helps.
    ///
    /// # Errors
    /// As for [`receive`](Self::receive).
    fn receive_into(&self, from: usize, tag: Tag, memory: Message) -> Result<Message, CommError> {
        drop(memory);
        self.receive(from, tag)
    }

    /// Gets ready for the next message of a rank, of `len` bytes, and returns at once: it comes in while this rank works, into
    /// memory that the caller has left where that helps. What was started first is to be waited for first, and before anything
    /// else of that rank and tag is received.
    ///
    /// # Errors
    /// [`CommError::Rank`].
    fn start_receive(&self, from: usize, tag: Tag, len: usize, memory: Message) -> Result<Self::Receiving, CommError>;

    /// Whether a message of a rank has come.
    ///
    /// # Errors
    /// [`CommError::Rank`], [`CommError::Ended`].
    fn is_there(&self, from: usize, tag: Tag) -> Result<bool, CommError>;

    /// Splits the ranks by color; no color, no group. Those of a group are numbered in the order of their `place`s, and as
    /// before where these are the same. Called by all ranks together.
    ///
    /// # Errors
    /// [`CommError`].
    fn split(&self, color: Option<usize>, place: usize) -> Result<Option<Self>, CommError>;

    /// The same ranks, with messages apart from those of this group, which wait as long as `time_out` says; `None` for ever.
    /// Called by all ranks together.
    ///
    /// # Errors
    /// [`CommError`].
    fn duplicate(&self, time_out: Option<Duration>) -> Result<Self, CommError>;

    /// Sends, and waits until the message is out of this rank's hands.
    ///
    /// # Errors
    /// As for [`start_send`](Self::start_send).
    fn send(&self, to: usize, tag: Tag, message: Message) -> Result<(), CommError> {
        self.start_send(to, tag, message)?.wait().map(drop)
    }

    /// Sends bytes from where they lie, each to its rank, and waits until all are out of this rank's hands.
    ///
    /// # Errors
    /// As for [`start_send`](Self::start_send).
    fn send_bytes(&self, tag: Tag, parcels: &[(usize, &[u8])]) -> Result<(), CommError> {
        let start = |&(to, bytes): &(usize, &[u8])| self.start_send(to, tag, Message::of(bytes));
        let sendings: Vec<Self::Sending> = parcels.iter().map(start).collect::<Result<_, _>>()?;
        sendings.into_iter().try_for_each(|sending| sending.wait().map(drop))
    }

    /// Waits for the next message of a rank, which is to fill `bytes`.
    ///
    /// # Errors
    /// As for [`receive`](Self::receive); [`CommError::Size`] where the message is longer or shorter.
    fn receive_bytes(&self, from: usize, tag: Tag, bytes: &mut [u8]) -> Result<(), CommError> {
        let message = self.receive(from, tag)?;
        if message.len() != bytes.len() {
            return Err(CommError::Size { from, found: message.len(), expected: bytes.len() });
        }
        bytes.copy_from_slice(message.bytes());
        Ok(())
    }

    /// Waits for all ranks.
    ///
    /// # Errors
    /// [`CommError`].
    fn barrier(&self) -> Result<(), CommError> {
        collectives::barrier(self)
    }

    /// Everybody gets the message of `root`.
    ///
    /// # Errors
    /// [`CommError`].
    fn broadcast(&self, root: usize, message: Message) -> Result<Message, CommError> {
        collectives::broadcast(self, root, message)
    }

    /// `root` gets the messages of all ranks in their order; the others get nothing.
    ///
    /// # Errors
    /// [`CommError`].
    fn gather(&self, root: usize, message: Message) -> Result<Option<Vec<Message>>, CommError> {
        collectives::gather(self, root, message)
    }

    /// Everybody gets the messages of all ranks in their order.
    ///
    /// # Errors
    /// [`CommError`].
    fn gather_all(&self, message: Message) -> Result<Vec<Message>, CommError> {
        collectives::gather_all(self, message)
    }

    /// The sum over all ranks, entry by entry, in the order of the ranks.
    ///
    /// # Errors
    /// [`CommError`].
    fn sum(&self, values: &mut [f64]) -> Result<(), CommError> {
        collectives::reduce(self, values, |sum, value| *sum += value)
    }

    /// The largest over all ranks, entry by entry; NaN where one has NaN.
    ///
    /// # Errors
    /// [`CommError`].
    fn max(&self, values: &mut [f64]) -> Result<(), CommError> {
        collectives::reduce(self, values, |largest, value| {
            if value > *largest || value.is_nan() {
                *largest = value;
            }
        })
    }

    /// The same outcome for all ranks: what was found where all succeeded, else the first rank's failure in its words. To be
    /// called by all before any of them returns with an error that the others do not see.
    ///
    /// # Errors
    /// [`Disagreement::Failed`] on all ranks where one failed.
    fn agree<T, E: std::fmt::Display>(&self, outcome: Result<T, E>) -> Result<T, Disagreement<E>> {
        collectives::agree(self, outcome)
    }
}

/// Why ranks do not go on together.
#[derive(Debug, Error)]
pub enum Disagreement<E> {
    /// This rank failed; the others know.
    #[error("{0}")]
    Own(E),
    /// Another rank failed.
    #[error("rank {rank} failed: {reason}")]
    Failed {
        /// The first that did.
        rank: usize,
        /// Its words.
        reason: String,
    },
    /// They could not even exchange that.
    #[error(transparent)]
    Comm(#[from] CommError),
}
