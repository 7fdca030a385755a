//! Exchange of unit values between producer and consumer ranks, between neighbors only.

use std::marker::PhantomData;
use std::time::{Duration, Instant};

use super::couple::{Coupling, CouplingError, MessageKind, Role};
use super::unit_map::Neighbor;
use crate::las::{Comm, CommError, Message, Payload, ReceiveRequest, SendRequest};

/// Transfers values of one type over couplings of two scales: the coupling that it was created for, its inverse, its
/// deltas and its later states. Reuses the buffers of its messages.
///
/// Each channel is a stream of its own: what one sends, only the same one of the other side receives, in the order of the
/// sends. From the 62nd channel of a coupling on, channels share the streams of earlier ones.
#[derive(Debug)]
pub struct Channel<T> {
    /// The number of the stream.
    stream: u32,
    spare: Vec<Message>,
    /// Number of bytes sent so far.
    sent: u64,
    waited: Duration,
    of: PhantomData<fn() -> T>,
}

/// A pending send of unit values.
#[must_use = "values are on their way until `finish`"]
#[derive(Debug)]
pub struct PendingSend<C: Comm> {
    sendings: Vec<C::SendRequest>,
}

/// A pending receive of unit values.
#[must_use = "values are not there until `finish_receive`"]
#[derive(Debug)]
pub struct PendingReceive<C: Comm> {
    receivings: Vec<C::ReceiveRequest>,
    /// The number of changes of the coupling when the receive was started.
    changes: u64,
}

impl<T: Payload> Channel<T> {
    /// Creates a channel and checks that both sides use the same layout. Collective over both scales: create several
    /// channels of a coupling in the same order on both.
    ///
    /// # Errors
    /// Returns [`CouplingError::Layout`] on all ranks if the layouts differ.
    pub fn new<C: Comm>(coupling: &Coupling<C>) -> Result<Self, CouplingError> {
        let local = T::layout().to_string();
        let received = coupling.exchange_roots(MessageKind::Layouts, Message::text(&local));
        let remote = received.map_err(|error| coupling.failed(error))?.to_text();
        if local != remote {
            let [producer, consumer] = coupling.names.clone();
            return Err(CouplingError::Layout { producer, consumer, local, remote });
        }
        Ok(Self {
            stream: coupling.next_channel(),
            spare: Vec::new(),
            sent: 0,
            waited: Duration::ZERO,
            of: PhantomData,
        })
    }

    /// Returns the number of bytes of values sent so far.
    pub fn sent(&self) -> u64 {
        self.sent
    }

    /// Returns the total time that receives have waited for messages to arrive; the rest of their time is copying.
    pub fn waited(&self) -> Duration {
        self.waited
    }

    /// Starts to send the values of all units of this producer rank, in their order, and returns immediately. The
    /// values are copied, so that the caller may change them, and may start further sends before this one is finished.
    ///
    /// # Errors
    /// Returns [`CouplingError`] if the arguments are invalid or the communication fails.
    pub fn start<C: Comm>(&mut self, coupling: &Coupling<C>, values: &[T]) -> Result<PendingSend<C>, CouplingError> {
        coupling.must_have(Role::Producer, values.len())?;
        let mut sendings = Vec::with_capacity(coupling.map.neighbors.len());
        for neighbor in &coupling.map.neighbors {
            let message = self.gather(&neighbor.indices, values);
            self.sent += message.len() as u64;
            let to = coupling.remote_ranks[neighbor.rank];
            let sending = coupling.comm.start_send(to, coupling.tag(MessageKind::Values(self.stream)), message);
            sendings.push(sending.map_err(|error| coupling.failed(error))?);
        }
        Ok(PendingSend { sendings })
    }

    /// Copies the values at some indices into a message.
    fn gather(&mut self, indices: &[u32], values: &[T]) -> Message {
        let mut message = self.spare.pop().unwrap_or_default();
        message.resize(size_of::<T>() * indices.len());
        match message.values_mut::<T>() {
            Some(out) => out.iter_mut().zip(indices).for_each(|(out, &index)| *out = values[index as usize]),
            // The alignment of `T` exceeds eight bytes.
            None => {
                let gathered: Vec<T> = indices.iter().map(|&index| values[index as usize]).collect();
                message.bytes_mut().copy_from_slice(bytemuck::cast_slice(&gathered));
            }
        }
        message
    }

    /// Waits until all sends are complete.
    ///
    /// # Errors
    /// Returns [`CouplingError`] if the communication fails.
    pub fn finish<C: Comm>(&mut self, coupling: &Coupling<C>, pending: PendingSend<C>) -> Result<(), CouplingError> {
        for sending in pending.sendings {
            self.spare.extend(sending.wait().map_err(|error| coupling.failed(error))?);
        }
        Ok(())
    }

    /// Sends the values of all units of this producer rank, in their order. Between processes, contiguous values for
    /// one rank are sent in place, without a copy, unless there is a time-out.
    ///
    /// # Errors
    /// Returns [`CouplingError`] if the arguments are invalid or the communication fails.
    pub fn send<C: Comm>(&mut self, coupling: &Coupling<C>, values: &[T]) -> Result<(), CouplingError> {
        coupling.must_have(Role::Producer, values.len())?;
        let neighbors = &coupling.map.neighbors;
        let scattered = neighbors.iter().filter(|neighbor| neighbor.contiguous_range().is_none());
        let messages: Vec<Message> = scattered.map(|neighbor| self.gather(&neighbor.indices, values)).collect();
        let mut gathered = messages.iter();
        let parcel = |neighbor: &Neighbor| {
            let bytes = match neighbor.contiguous_range() {
                Some(range) => bytemuck::cast_slice(&values[range]),
                None => gathered.next().map_or(&[][..], Message::bytes),
            };
            (coupling.remote_ranks[neighbor.rank], bytes)
        };
        let parcels: Vec<(usize, &[u8])> = neighbors.iter().map(parcel).collect();
        self.sent += parcels.iter().map(|(_, bytes)| bytes.len() as u64).sum::<u64>();
        let sent = coupling.comm.send_bytes(coupling.tag(MessageKind::Values(self.stream)), &parcels);
        self.spare.extend(messages);
        sent.map_err(|error| coupling.failed(error))
    }

    /// Receives the values of all units of this consumer rank, in their order.
    ///
    /// # Errors
    /// Returns [`CouplingError`] if the arguments are invalid or the communication fails.
    pub fn receive<C: Comm>(&mut self, coupling: &Coupling<C>, values: &mut [T]) -> Result<(), CouplingError> {
        coupling.must_have(Role::Consumer, values.len())?;
        for neighbor in &coupling.map.neighbors {
            let (from, tag) = (coupling.remote_ranks[neighbor.rank], coupling.tag(MessageKind::Values(self.stream)));
            let start = Instant::now();
            coupling.comm.wait_for(from, tag).map_err(|error| coupling.failed(error))?;
            self.waited += start.elapsed();
            match neighbor.contiguous_range() {
                Some(range) => coupling.comm.receive_bytes(from, tag, bytemuck::cast_slice_mut(&mut values[range])),
                None => {
                    let memory = self.spare.pop().unwrap_or_default();
                    let message = coupling.comm.receive_into(from, tag, memory);
                    message.and_then(|message| self.scatter_message(message, from, &neighbor.indices, values))
                }
            }
            .map_err(|error| coupling.failed(error))?;
        }
        Ok(())
    }

    /// Scatters the values of a message to their indices, and keeps its buffer.
    fn scatter_message(
        &mut self,
        message: Message,
        from: usize,
        indices: &[u32],
        values: &mut [T],
    ) -> Result<(), CommError> {
        let expected = size_of::<T>() * indices.len();
        if message.len() != expected {
            return Err(CommError::Size { from, found: message.len(), expected });
        }
        match message.values::<T>() {
            Some(found) => found.iter().zip(indices).for_each(|(&found, &index)| values[index as usize] = found),
            None => {
                let bytes = message.bytes().chunks_exact(size_of::<T>().max(1));
                bytes.zip(indices).for_each(|(bytes, &index)| {
                    values[index as usize] = bytemuck::pod_read_unaligned(bytes);
                });
            }
        }
        self.spare.push(message);
        Ok(())
    }

    /// Starts to receive the values of all units of this consumer rank, and returns immediately. The caller may start
    /// further receives before this one is finished. Finish receives in the order in which they were started, before
    /// any other receive, and before units are added, removed or migrated: otherwise MPI aborts the program when a
    /// message is longer than the buffer.
    ///
    /// # Errors
    /// Returns [`CouplingError`] if this rank is not on the consumer or the communication fails.
    pub fn start_receive<C: Comm>(&mut self, coupling: &Coupling<C>) -> Result<PendingReceive<C>, CouplingError> {
        coupling.must_have(Role::Consumer, coupling.units().len())?;
        let mut receivings = Vec::with_capacity(coupling.map.neighbors.len());
        for neighbor in &coupling.map.neighbors {
            let (from, len) = (coupling.remote_ranks[neighbor.rank], size_of::<T>() * neighbor.indices.len());
            let memory = self.spare.pop().unwrap_or_default();
            let receiving =
                coupling.comm.start_receive(from, coupling.tag(MessageKind::Values(self.stream)), len, memory);
            receivings.push(receiving.map_err(|error| coupling.failed(error))?);
        }
        Ok(PendingReceive { receivings, changes: coupling.map.changes })
    }

    /// Waits until all values have arrived, and stores them in the order of the units.
    ///
    /// # Errors
    /// Returns [`CouplingError`] if the arguments are invalid or the communication fails; [`CouplingError::Changed`] if
    /// units were added, removed or migrated since the start, or if the receive was started for another coupling with a
    /// different number of neighbors.
    pub fn finish_receive<C: Comm>(
        &mut self,
        coupling: &Coupling<C>,
        pending: PendingReceive<C>,
        values: &mut [T],
    ) -> Result<(), CouplingError> {
        coupling.must_have(Role::Consumer, values.len())?;
        let neighbors = &coupling.map.neighbors;
        if pending.changes != coupling.map.changes || pending.receivings.len() != neighbors.len() {
            let [producer, consumer] = coupling.names.clone();
            return Err(CouplingError::Changed { producer, consumer });
        }
        for (neighbor, receiving) in neighbors.iter().zip(pending.receivings) {
            let start = Instant::now();
            let message = receiving.wait().map_err(|error| coupling.failed(error))?;
            self.waited += start.elapsed();
            let stored = self.scatter_message(message, coupling.remote_ranks[neighbor.rank], &neighbor.indices, values);
            stored.map_err(|error| coupling.failed(error))?;
        }
        Ok(())
    }
}

impl<C: Comm> Coupling<C> {
    fn must_have(&self, role: Role, values: usize) -> Result<(), CouplingError> {
        self.must_be(role)?;
        let units = self.units().len();
        if values == units { Ok(()) } else { Err(CouplingError::Values { found: values, units }) }
    }

    /// Exchanges a message with the other side: the roots swap messages and broadcast the one received.
    fn exchange_roots(&self, kind: MessageKind, message: Message) -> Result<Message, CommError> {
        if self.local_comm.rank() > 0 {
            return self.local_comm.broadcast(0, Message::new());
        }
        let (root, tag) = (self.remote_ranks[0], self.tag(kind));
        let sending = self.comm.start_send(root, tag, message)?;
        let received = self.comm.receive(root, tag)?;
        sending.wait()?;
        self.local_comm.broadcast(0, received)
    }
}
