//! Exchange: values of units from the ranks that have them to those that get them, between neighbors only.

use std::marker::PhantomData;
use std::time::{Duration, Instant};

use super::couple::{About, Coupling, CouplingError, Role};
use super::links::Neighbor;
use crate::las::{Comm, CommError, Message, Payload, Receiving, Sending, Tag};

/// Carries values of one kind over couplings of two scales: the one that it was made for, its inverse, its deltas and what it
/// becomes later. Keeps the memory of its messages.
#[derive(Debug)]
pub struct Channel<T> {
    spare: Vec<Message>,
    /// Bytes that were sent so far.
    sent: u64,
    waited: Duration,
    of: PhantomData<fn() -> T>,
}

/// Values on their way.
#[must_use = "values are on their way until `finish`"]
#[derive(Debug)]
pub struct Underway<C: Comm> {
    sendings: Vec<C::Sending>,
}

/// Values that are to come.
#[must_use = "values are not there until `finish_receive`"]
#[derive(Debug)]
pub struct Arriving<C: Comm> {
    receivings: Vec<C::Receiving>,
    /// How often units had come or gone when they were started.
    changes: u64,
}

impl<T: Payload> Channel<T> {
    /// Checks that both sides of a coupling mean the same. Called by all ranks of both together.
    ///
    /// # Errors
    /// [`CouplingError::Layout`] on all ranks where they do not.
    pub fn new<C: Comm>(coupling: &Coupling<C>) -> Result<Self, CouplingError> {
        let here = T::layout().to_string();
        let there = coupling.other_side(About::Layouts, Message::text(&here))?.to_text();
        if here != there {
            let [producer, consumer] = coupling.names();
            return Err(CouplingError::Layout { producer, consumer, here, there });
        }
        Ok(Self { spare: Vec::new(), sent: 0, waited: Duration::ZERO, of: PhantomData })
    }

    /// Bytes of values that were sent so far.
    #[must_use]
    pub fn sent(&self) -> u64 {
        self.sent
    }

    /// How long receiving has waited so far for messages that had not come: the rest of its time is copying.
    #[must_use]
    pub fn waited(&self) -> Duration {
        self.waited
    }

    /// Starts to send the values of all units of this rank, in their order, on the producer. Work goes on beside it: the
    /// values are copied and may change at once, and more may be started before this is finished.
    ///
    /// # Errors
    /// [`CouplingError`].
    pub fn start<C: Comm>(&mut self, coupling: &Coupling<C>, values: &[T]) -> Result<Underway<C>, CouplingError> {
        coupling.must_have(Role::Producer, values.len())?;
        let mut sendings = Vec::with_capacity(coupling.links.neighbors.len());
        for neighbor in &coupling.links.neighbors {
            let message = self.gather(&neighbor.places, values);
            self.sent += message.len() as u64;
            let to = coupling.there[neighbor.rank];
            let sending = coupling.comm.start_send(to, coupling.tag(About::Values), message);
            sendings.push(sending.map_err(|error| coupling.failed(error))?);
        }
        Ok(Underway { sendings })
    }

    /// The values at some places.
    fn gather(&mut self, places: &[u32], values: &[T]) -> Message {
        let mut message = self.spare.pop().unwrap_or_default();
        message.resize(size_of::<T>() * places.len());
        match message.values_mut::<T>() {
            Some(out) => out.iter_mut().zip(places).for_each(|(out, &place)| *out = values[place as usize]),
            // A type that asks for more than words of eight bytes.
            None => {
                let gathered: Vec<T> = places.iter().map(|&place| values[place as usize]).collect();
                message.bytes_mut().copy_from_slice(bytemuck::cast_slice(&gathered));
            }
        }
        message
    }

    /// Waits until all values are out of this rank's hands.
    ///
    /// # Errors
    /// [`CouplingError`].
    pub fn finish<C: Comm>(&mut self, coupling: &Coupling<C>, underway: Underway<C>) -> Result<(), CouplingError> {
        for sending in underway.sendings {
            self.spare.extend(sending.wait().map_err(|error| coupling.failed(error))?);
        }
        Ok(())
    }

    /// Sends the values of all units of this rank, in their order, on the producer. Between processes, values that go to one
    /// rank and lie one behind the other are sent from where they are, without a copy, unless there is a time-out.
    ///
    /// # Errors
    /// [`CouplingError`].
    pub fn send<C: Comm>(&mut self, coupling: &Coupling<C>, values: &[T]) -> Result<(), CouplingError> {
        coupling.must_have(Role::Producer, values.len())?;
        let neighbors = &coupling.links.neighbors;
        let scattered = neighbors.iter().filter(|neighbor| neighbor.run().is_none());
        let messages: Vec<Message> = scattered.map(|neighbor| self.gather(&neighbor.places, values)).collect();
        let mut gathered = messages.iter();
        let parcel = |neighbor: &Neighbor| {
            let bytes = match neighbor.run() {
                Some(run) => bytemuck::cast_slice(&values[run]),
                None => gathered.next().map_or(&[][..], Message::bytes),
            };
            (coupling.there[neighbor.rank], bytes)
        };
        let parcels: Vec<(usize, &[u8])> = neighbors.iter().map(parcel).collect();
        self.sent += parcels.iter().map(|(_, bytes)| bytes.len() as u64).sum::<u64>();
        let sent = coupling.comm.send_bytes(coupling.tag(About::Values), &parcels);
        self.spare.extend(messages);
        sent.map_err(|error| coupling.failed(error))
    }

    /// Gets the values of all units of this rank, in their order, on the consumer.
    ///
    /// # Errors
    /// [`CouplingError`].
    pub fn receive<C: Comm>(&mut self, coupling: &Coupling<C>, values: &mut [T]) -> Result<(), CouplingError> {
        coupling.must_have(Role::Consumer, values.len())?;
        for neighbor in &coupling.links.neighbors {
            let (from, tag) = (coupling.there[neighbor.rank], coupling.tag(About::Values));
            let start = Instant::now();
            coupling.comm.wait_for(from, tag).map_err(|error| coupling.failed(error))?;
            self.waited += start.elapsed();
            match neighbor.run() {
                Some(run) => coupling.comm.receive_bytes(from, tag, bytemuck::cast_slice_mut(&mut values[run])),
                None => self.scatter(coupling, neighbor, values),
            }
            .map_err(|error| coupling.failed(error))?;
        }
        Ok(())
    }

    /// Gets values whose places are not one behind the other.
    fn scatter<C: Comm>(
        &mut self,
        coupling: &Coupling<C>,
        Neighbor { rank, places }: &Neighbor,
        values: &mut [T],
    ) -> Result<(), CommError> {
        let from = coupling.there[*rank];
        let memory = self.spare.pop().unwrap_or_default();
        let message = coupling.comm.receive_into(from, coupling.tag(About::Values), memory)?;
        self.put(message, from, places, values)
    }

    /// Puts the values of a message where they belong, and keeps its memory.
    fn put(&mut self, message: Message, from: usize, places: &[u32], values: &mut [T]) -> Result<(), CommError> {
        let expected = size_of::<T>() * places.len();
        if message.len() != expected {
            return Err(CommError::Size { from, found: message.len(), expected });
        }
        match message.values::<T>() {
            Some(found) => found.iter().zip(places).for_each(|(&found, &place)| values[place as usize] = found),
            None => {
                let bytes = message.bytes().chunks_exact(size_of::<T>().max(1));
                bytes.zip(places).for_each(|(bytes, &place)| {
                    values[place as usize] = bytemuck::pod_read_unaligned(bytes);
                });
            }
        }
        self.spare.push(message);
        Ok(())
    }

    /// Gets ready for the values of all units of this rank, on the consumer: they come in while it works. More may be started
    /// before this is finished; what was started first is to be finished first, before anything else is received, and before
    /// units come or go: between processes, MPI ends the program where a message is longer than what was waited for.
    ///
    /// # Errors
    /// [`CouplingError`].
    pub fn start_receive<C: Comm>(&mut self, coupling: &Coupling<C>) -> Result<Arriving<C>, CouplingError> {
        coupling.must_have(Role::Consumer, coupling.units().len())?;
        let mut receivings = Vec::with_capacity(coupling.links.neighbors.len());
        for neighbor in &coupling.links.neighbors {
            let (from, len) = (coupling.there[neighbor.rank], size_of::<T>() * neighbor.places.len());
            let memory = self.spare.pop().unwrap_or_default();
            let receiving = coupling.comm.start_receive(from, coupling.tag(About::Values), len, memory);
            receivings.push(receiving.map_err(|error| coupling.failed(error))?);
        }
        Ok(Arriving { receivings, changes: coupling.links.changes })
    }

    /// Waits until all values are there, and puts them in the order of the units.
    ///
    /// # Errors
    /// [`CouplingError`]; [`CouplingError::Changed`] where units have come or gone since this was started, or where it was
    /// started for another coupling that has other neighbors.
    pub fn finish_receive<C: Comm>(
        &mut self,
        coupling: &Coupling<C>,
        arriving: Arriving<C>,
        values: &mut [T],
    ) -> Result<(), CouplingError> {
        coupling.must_have(Role::Consumer, values.len())?;
        let neighbors = &coupling.links.neighbors;
        if arriving.changes != coupling.links.changes || arriving.receivings.len() != neighbors.len() {
            let [producer, consumer] = coupling.names();
            return Err(CouplingError::Changed { producer, consumer });
        }
        for (neighbor, receiving) in neighbors.iter().zip(arriving.receivings) {
            let start = Instant::now();
            let message = receiving.wait().map_err(|error| coupling.failed(error))?;
            self.waited += start.elapsed();
            let put = self.put(message, coupling.there[neighbor.rank], &neighbor.places, values);
            put.map_err(|error| coupling.failed(error))?;
        }
        Ok(())
    }
}

impl<C: Comm> Coupling<C> {
    fn must_have(&self, role: Role, values: usize) -> Result<(), CouplingError> {
        let units = self.units().len();
        if self.role != role {
            let [producer, consumer] = self.names();
            return Err(match role {
                Role::Producer => CouplingError::Role { scale: consumer, role: "producer" },
                Role::Consumer => CouplingError::Role { scale: producer, role: "consumer" },
            });
        }
        if values == units { Ok(()) } else { Err(CouplingError::Values { found: values, units }) }
    }

    /// What the other side says, while this one says something to it.
    fn other_side(&self, about: About, message: Message) -> Result<Message, CouplingError> {
        self.trade(self.tag(about), message).map_err(|error| self.failed(error))
    }

    fn trade(&self, tag: Tag, message: Message) -> Result<Message, CommError> {
        let is_first = self.comm.rank() == self.here[0];
        let found = if is_first {
            let sending = self.comm.start_send(self.there[0], tag, message)?;
            let found = self.comm.receive(self.there[0], tag)?;
            sending.wait()?;
            found
        } else {
            Message::new()
        };
        self.own_side().broadcast(0, found)
    }
}
