//! Ranks: processes, or threads of one process, that run concurrently on separate data and exchange messages.
//!
//! A communication backend implements point-to-point messages, `split` and `duplicate` of [`Comm`]. The collectives
//! (`barrier`, `broadcast`, `gather`, `gather_all`) have default implementations by point-to-point messages, which a
//! backend overrides if its library has its own. Sums are taken along a fixed tree of the ranks, so that they are bitwise
//! reproducible.
//!
//! If a rank fails, all other ranks end too: if the ranks are threads, their calls return [`CommError::Ended`] with the
//! number and the error message of the failed rank; processes are aborted.

pub(crate) mod collectives;
mod message;
mod payload;

use std::time::Duration;

use thiserror::Error;

pub use message::Message;
pub use payload::{Layout, Payload};

/// The tag of a message. Messages with the same tag from the same rank arrive in the order in which they were sent.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct Tag(pub(crate) u32);

impl Tag {
    /// The tag of the collectives.
    pub(crate) const COLLECTIVE: Self = Self(0);
    /// The tag of units that migrate between the ranks of a scale, beyond all user tags.
    pub(crate) const MIGRATION: Self = Self(2 + u16::MAX as u32);

    /// A user tag, for use on a communicator of the user's own ([`Comm::duplicate`]).
    pub const fn of(number: u16) -> Self {
        Self(1 + number as u32)
    }
}

/// The reason why a communication failed.
#[derive(Clone, Debug, Error, PartialEq, Eq)]
pub enum CommError {
    /// Another rank failed, and all ranks end.
    #[error("rank {rank} failed: {reason}")]
    Ended {
        /// The failed rank, among all ranks of the program.
        rank: usize,
        /// Its error message.
        reason: String,
    },
    /// No message arrived before the time-out.
    #[error("no message from rank {from} within {} s", .waited.as_secs_f64())]
    TimeOut {
        /// The rank whose message is missing.
        from: usize,
        /// The waiting time.
        waited: Duration,
    },
    /// The receiver took no message before the time-out.
    #[error("rank {to} received no message within {} s", .waited.as_secs_f64())]
    SendTimeOut {
        /// The rank that should have received it.
        to: usize,
        /// The waiting time.
        waited: Duration,
    },
    /// The message has another size than expected.
    #[error("a message of {found} bytes from rank {from}; expected {expected}")]
    Size {
        /// The sender.
        from: usize,
        /// Size of the message in bytes.
        found: usize,
        /// Expected size in bytes.
        expected: usize,
    },
    /// A collective message cannot be split into the messages of the ranks.
    #[error("a message of {found} bytes from rank {from} is not a sequence of messages")]
    Malformed {
        /// The sender.
        from: usize,
        /// Size of the message in bytes.
        found: usize,
    },
    /// The rank does not exist.
    #[error("there is no rank {rank} among {size}")]
    Rank {
        /// The rank requested.
        rank: usize,
        /// Number of ranks of the communicator.
        size: usize,
    },
    /// The communication library reported an error.
    #[error("{0}")]
    Library(String),
}

/// A pending send.
pub trait SendRequest {
    /// Waits until the send is complete and the buffer is free; returns the buffer if it is still on this rank.
    ///
    /// # Errors
    /// Returns [`CommError`] if the send fails.
    fn wait(self) -> Result<Option<Message>, CommError>;
}

/// A pending receive.
pub trait ReceiveRequest {
    /// Waits until the message has arrived.
    ///
    /// # Errors
    /// Returns [`CommError`] if the receive fails; [`CommError::Size`] if the message does not have the announced
    /// length.
    fn wait(self) -> Result<Message, CommError>;
}

/// A communicator: a group of ranks that exchange messages.
///
/// Cloning is inexpensive; the clone denotes the same communicator.
pub trait Comm: Clone + Send + 'static {
    /// A pending send.
    type SendRequest: SendRequest;
    /// A pending receive.
    type ReceiveRequest: ReceiveRequest;

    /// Returns the rank of the caller, from 0.
    fn rank(&self) -> usize;

    /// Returns the number of ranks.
    fn size(&self) -> usize;

    /// Starts a send and returns immediately.
    ///
    /// # Errors
    /// Returns [`CommError::Rank`] if the rank does not exist, [`CommError::Ended`] if another rank failed.
    fn start_send(&self, to: usize, tag: Tag, message: Message) -> Result<Self::SendRequest, CommError>;

    /// Receives the next message from a rank; blocks until it arrives.
    ///
    /// # Errors
    /// Returns [`CommError::Rank`], [`CommError::Ended`], [`CommError::TimeOut`].
    fn receive(&self, from: usize, tag: Tag) -> Result<Message, CommError>;

    /// Waits until the next message from a rank has arrived, without receiving it. A caller can thus measure the
    /// waiting time separately.
    ///
    /// # Errors
    /// Returns the errors of [`receive`](Self::receive).
    fn wait_for(&self, from: usize, tag: Tag) -> Result<(), CommError>;

    /// Receives as [`receive`](Self::receive) does; may reuse the buffer `memory`.
    ///
    /// # Errors
    /// Returns the errors of [`receive`](Self::receive).
    fn receive_into(&self, from: usize, tag: Tag, memory: Message) -> Result<Message, CommError> {
        drop(memory);
        self.receive(from, tag)
    }

    /// Starts the receive of the next message from a rank, of `len` bytes, and returns immediately; may reuse the
    /// buffer `memory`. Complete pending receives in the order in which they were started, and before any other receive
    /// from the same rank with the same tag.
    ///
    /// # Errors
    /// Returns [`CommError::Rank`] if the rank does not exist.
    fn start_receive(
        &self,
        from: usize,
        tag: Tag,
        len: usize,
        memory: Message,
    ) -> Result<Self::ReceiveRequest, CommError>;

    /// Returns true if a message from a rank has arrived.
    ///
    /// # Errors
    /// Returns [`CommError::Rank`], [`CommError::Ended`].
    fn probe(&self, from: usize, tag: Tag) -> Result<bool, CommError>;

    /// Splits the communicator into one per color; a rank without a color gets `None`. The ranks of a new communicator
    /// are ordered by `key`, and by their previous rank if the keys are equal. Collective.
    ///
    /// # Errors
    /// Returns [`CommError`] if the communication fails.
    fn split(&self, color: Option<usize>, key: usize) -> Result<Option<Self>, CommError>;

    /// Creates a communicator of the same ranks whose messages are separate from those of this one. Its calls wait at
    /// most `time_out`, or indefinitely if it is `None`. Collective.
    ///
    /// # Errors
    /// Returns [`CommError`] if the communication fails.
    fn duplicate(&self, time_out: Option<Duration>) -> Result<Self, CommError>;

    /// Sends a message and waits until the send is complete.
    ///
    /// # Errors
    /// Returns the errors of [`start_send`](Self::start_send) and [`SendRequest::wait`].
    fn send(&self, to: usize, tag: Tag, message: Message) -> Result<(), CommError> {
        self.start_send(to, tag, message)?.wait().map(drop)
    }

    /// Sends byte slices, each to its rank, and waits until all sends are complete. An implementation may send them
    /// without a copy.
    ///
    /// # Errors
    /// Returns the errors of [`start_send`](Self::start_send) and [`SendRequest::wait`].
    fn send_bytes(&self, tag: Tag, parcels: &[(usize, &[u8])]) -> Result<(), CommError> {
        let start = |&(to, bytes): &(usize, &[u8])| self.start_send(to, tag, Message::of(bytes));
        let sendings: Vec<Self::SendRequest> = parcels.iter().map(start).collect::<Result<_, _>>()?;
        sendings.into_iter().try_for_each(|sending| sending.wait().map(drop))
    }

    /// Receives the next message from a rank into `bytes`.
    ///
    /// # Errors
    /// Returns the errors of [`receive`](Self::receive), and [`CommError::Size`] if the message does not have the
    /// length of `bytes`.
    fn receive_bytes(&self, from: usize, tag: Tag, bytes: &mut [u8]) -> Result<(), CommError> {
        let message = self.receive(from, tag)?;
        if message.len() != bytes.len() {
            return Err(CommError::Size { from, found: message.len(), expected: bytes.len() });
        }
        bytes.copy_from_slice(message.bytes());
        Ok(())
    }

    /// Waits until all ranks have called this function. Collective.
    ///
    /// # Errors
    /// Returns [`CommError`] if the communication fails.
    fn barrier(&self) -> Result<(), CommError> {
        collectives::barrier(self)
    }

    /// Returns the message of `root` on all ranks. Collective.
    ///
    /// # Errors
    /// Returns [`CommError`] if the communication fails.
    fn broadcast(&self, root: usize, message: Message) -> Result<Message, CommError> {
        collectives::broadcast(self, root, message)
    }

    /// Returns the messages of all ranks on `root`, ordered by rank, and `None` on the other ranks. Collective: the
    /// other ranks may also wait until all ranks have called it.
    ///
    /// # Errors
    /// Returns [`CommError`] if the communication fails.
    fn gather(&self, root: usize, message: Message) -> Result<Option<Vec<Message>>, CommError> {
        collectives::gather(self, root, message)
    }

    /// Returns the messages of all ranks, ordered by rank, on all ranks. Collective.
    ///
    /// # Errors
    /// Returns [`CommError`] if the communication fails.
    fn gather_all(&self, message: Message) -> Result<Vec<Message>, CommError> {
        collectives::gather_all(self, message)
    }

    /// Replaces each entry by its sum over all ranks, added along a tree that depends on nothing but the number of ranks.
    /// Collective.
    ///
    /// # Errors
    /// Returns [`CommError`] if the communication fails.
    fn sum(&self, values: &mut [f64]) -> Result<(), CommError> {
        collectives::reduce(self, values, |sum, value| *sum += value)
    }

    /// Replaces each entry by its maximum over all ranks; NaN if any rank has NaN. Collective.
    ///
    /// # Errors
    /// Returns [`CommError`] if the communication fails.
    fn max(&self, values: &mut [f64]) -> Result<(), CommError> {
        collectives::reduce(self, values, |largest, value| {
            if value > *largest || value.is_nan() {
                *largest = value;
            }
        })
    }

    /// Exchanges the outcomes of all ranks: returns the value of this rank if all ranks succeeded, and an error on
    /// every rank otherwise. Call it on all ranks before one of them returns an error that the others do not know.
    /// Collective.
    ///
    /// # Errors
    /// Returns [`Disagreement::Own`] on the ranks that failed and [`Disagreement::Failed`] on the others;
    /// [`Disagreement::Comm`] if the communication fails.
    fn agree<T, E: std::fmt::Display>(&self, outcome: Result<T, E>) -> Result<T, Disagreement<E>> {
        collectives::agree(self, outcome)
    }
}

/// The reason why ranks do not continue together.
#[derive(Debug, Error)]
pub enum Disagreement<E> {
    /// This rank failed; the other ranks know of the failure.
    #[error("{0}")]
    Own(E),
    /// Another rank failed.
    #[error("rank {rank} failed: {reason}")]
    Failed {
        /// The lowest of the ranks that failed.
        rank: usize,
        /// Its error message.
        reason: String,
    },
    /// The outcomes could not be exchanged.
    #[error(transparent)]
    Comm(#[from] CommError),
}
