//! The collectives of MPI, in their nonblocking form: a waiting rank polls them like messages, so that it does not take
//! a core from working ranks.
//!
//! The default implementations by messages are used in two cases:
//! * The communicator has a time-out. The error names the rank whose message is missing, which MPI does not report;
//!   and MPI can neither cancel nor free a collective that has not completed.
//! * The data is too long for the 32 bits in which MPI counts bytes.
//!
//! Reductions are not left to MPI: it fixes neither the order of a sum nor the maximum of NaN.

use mpi::Count;
use mpi::collective::{CommunicatorCollectives, Root};
use mpi::datatype::PartitionMut;
use mpi::request::{Request, Scope, scope};
use mpi::topology::Communicator;

use super::MpiComm;
use super::requests::poll;
use crate::las::comm::collectives as by_messages;
use crate::las::{Comm, CommError, Message};

pub(super) fn barrier(comm: &MpiComm) -> Result<(), CommError> {
    if comm.has_time_out { by_messages::barrier(comm) } else { complete(comm.communicator().immediate_barrier()) }
}

/// Broadcasts the length, and then the content.
pub(super) fn broadcast(comm: &MpiComm, root: usize, mut message: Message) -> Result<Message, CommError> {
    let process = comm.communicator().process_at_rank(comm.known(root)?);
    if comm.has_time_out {
        return by_messages::broadcast(comm, root, message);
    }
    let mut len = message.len();
    scope(|scope| complete(process.immediate_broadcast_into(scope, &mut len)))?;
    if Count::try_from(len).is_err() {
        return by_messages::broadcast(comm, root, message);
    }
    message.resize(len);
    scope(|scope| complete(process.immediate_broadcast_into(scope, message.bytes_mut())))?;
    Ok(message)
}

pub(super) fn gather(comm: &MpiComm, root: usize, message: Message) -> Result<Option<Vec<Message>>, CommError> {
    let process = comm.communicator().process_at_rank(comm.known(root)?);
    let Some(mut gathered) = Gathered::new(comm, &message, comm.rank() == root)? else {
        return by_messages::gather(comm, root, message);
    };
    if comm.rank() != root {
        scope(|scope| complete(process.immediate_gather_varcount_into(scope, message.bytes())))?;
        return Ok(None);
    }
    let mut parts = gathered.parts();
    scope(|scope| complete(process.immediate_gather_varcount_into_root(scope, message.bytes(), &mut parts)))?;
    Ok(Some(gathered.into_messages()))
}

pub(super) fn gather_all(comm: &MpiComm, message: Message) -> Result<Vec<Message>, CommError> {
    let Some(mut gathered) = Gathered::new(comm, &message, true)? else {
        return by_messages::gather_all(comm, message);
    };
    let mut parts = gathered.parts();
    let group = comm.communicator();
    scope(|scope| complete(group.immediate_all_gather_varcount_into(scope, message.bytes(), &mut parts)))?;
    Ok(gathered.into_messages())
}

/// Memory for the messages of all ranks, one after the other.
struct Gathered {
    bytes: Vec<u8>,
    counts: Vec<Count>,
    offsets: Vec<Count>,
}

impl Gathered {
    /// Exchanges the lengths of the messages, so that all ranks make the same choice; `None` if the messages must be
    /// gathered without MPI's collective. Allocates the memory if this rank `receives` them.
    fn new(comm: &MpiComm, message: &Message, receives: bool) -> Result<Option<Self>, CommError> {
        if comm.has_time_out {
            return Ok(None);
        }
        let (own, mut lens) = (message.len(), vec![0_usize; comm.size()]);
        scope(|scope| complete(comm.communicator().immediate_all_gather_into(scope, &own, &mut lens[..])))?;
        let total: usize = lens.iter().sum();
        if Count::try_from(total).is_err() {
            return Ok(None);
        }
        let counts: Vec<Count> = lens.iter().map(|&len| len as Count).collect();
        let offset = |end: &mut Count, &count: &Count| {
            *end += count;
            Some(*end - count)
        };
        let offsets = counts.iter().scan(0, offset).collect();
        // At least one byte, because the address of an empty vector is that of `MPI_IN_PLACE` in Open MPI.
        let bytes = if receives { vec![0; total.max(1)] } else { Vec::new() };
        Ok(Some(Self { bytes, counts, offsets }))
    }

    fn parts(&mut self) -> PartitionMut<'_, [u8], &[Count], &[Count]> {
        PartitionMut::new(&mut self.bytes[..], &self.counts[..], &self.offsets[..])
    }

    fn into_messages(self) -> Vec<Message> {
        let part = |(&offset, &count): (&Count, &Count)| &self.bytes[offset as usize..(offset + count) as usize];
        self.offsets.iter().zip(&self.counts).map(part).map(Message::of).collect()
    }
}

/// Polls a collective until it is complete.
fn complete<'a, D: ?Sized, S: Scope<'a>>(request: Request<'a, D, S>) -> Result<(), CommError> {
    let mut pending = Some(request);
    // Without a time-out, polling does not fail, and no rank is named.
    poll(0, None, || {
        pending = pending.take().and_then(|request| request.test().err());
        Ok(pending.is_none().then_some(()))
    })
}
