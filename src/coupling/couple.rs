//! Couplings: units that one scale, the producer, sends to another, the consumer. Both scales create, change and
//! reconcile a coupling collectively; each rank exchanges lists of units with its neighbors only.

use std::collections::HashSet;
use std::sync::Arc;
use std::sync::atomic::{AtomicU32, Ordering};

use thiserror::Error;

use super::data::{Distribution, UnitId};
use super::partition::Partitioner;
use super::scale::Scales;
use super::unit_map::UnitMap;
use crate::las::{Comm, CommError, Message, Tag};

/// The kind of a message within a coupling; part of its tag.
#[derive(Clone, Copy)]
pub(super) enum MessageKind {
    /// Lists of units.
    Lists,
    /// Messages between the roots of the two scales.
    Roots,
    /// Layouts of values.
    Layouts,
    /// Values of units, in the stream of this number.
    Values(u32),
}

/// The reason why an operation on a coupling failed.
#[derive(Clone, Debug, Error, PartialEq, Eq)]
pub enum CouplingError {
    /// The communication failed.
    #[error("coupling {producer} to {consumer}: {error}")]
    Comm {
        /// The producer scale.
        producer: String,
        /// The consumer scale.
        consumer: String,
        /// The communication error.
        error: CommError,
    },
    /// A rank called a function of the other side: its scale and the role that this scale does not have.
    #[error("scale {0} is not the {1} of this coupling")]
    Role(String, &'static str),
    /// No scale has this name.
    #[error("there is no scale {0}")]
    Scale(String),
    /// The producer and the consumer are the same scale.
    #[error("scale {0} cannot be coupled with itself")]
    Itself(String),
    /// A unit was added that already exists, or removed that does not exist.
    #[error("unit {0} {1}")]
    Unit(UnitId, &'static str),
    /// The distribution algorithm returned a wrong number of ranks, or a rank that does not exist.
    #[error("the partition of {units} units gives {found} ranks, the largest of them {last}; there are {ranks} ranks")]
    Partition {
        /// Units of this rank.
        units: usize,
        /// Number of ranks returned by the algorithm.
        found: usize,
        /// The largest of these ranks.
        last: usize,
        /// Number of ranks of the consumer.
        ranks: usize,
    },
    /// The number of values differs from the number of units.
    #[error("{found} values for {units} units")]
    Values {
        /// Number of values given.
        found: usize,
        /// Number of units of this rank.
        units: usize,
    },
    /// The number of weights differs from the number of new units.
    #[error("{found} weights for {units} new units")]
    Weights {
        /// Number of weights given.
        found: usize,
        /// Number of units given.
        units: usize,
    },
    /// The new order of the units is not a permutation of them.
    #[error("the order of {found} indices is not a permutation of {units} units")]
    Permutation {
        /// Number of units of this rank.
        units: usize,
        /// Number of indices given.
        found: usize,
    },
    /// The units have changed between the start and the end of a receive.
    #[error("receiving from {producer} on {consumer} was started before units changed: finish it before they change")]
    Changed {
        /// The scale that sends the values.
        producer: String,
        /// The scale that receives them.
        consumer: String,
    },
    /// The layouts of the values differ between the two sides.
    #[error("{producer} and {consumer} exchange different data: here {local}, there {remote}")]
    Layout {
        /// The producer scale.
        producer: String,
        /// The consumer scale.
        consumer: String,
        /// The layout on this side.
        local: String,
        /// The layout on the other side.
        remote: String,
    },
}

/// The streams of values of a coupling that have a tag each; others share one with an earlier stream.
const STREAMS: u32 = 61;

/// The side of a coupling.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Role {
    /// The side that owns the units.
    Producer,
    /// The side that receives them.
    Consumer,
}

/// A directed coupling: the units that a producer sends to a consumer.
#[derive(Clone, Debug)]
pub struct Coupling<C: Comm> {
    /// The communicator of all ranks of the program.
    pub(super) comm: C,
    /// Distinguishes the messages of this coupling from those of other couplings of the two scales.
    number: u32,
    /// The number of channels created so far, also for inverses and deltas; both sides count equally.
    channels: Arc<AtomicU32>,
    /// The communicator of this side.
    pub(super) local_comm: C,
    pub(super) role: Role,
    /// Names of the producer and the consumer.
    pub(super) names: [String; 2],
    /// The world ranks of the other side.
    pub(super) remote_ranks: Vec<usize>,
    pub(super) map: UnitMap,
}

/// The part of a coupling that was added last: only the new units, in the order in which they follow the old ones.
pub type Delta<C> = Coupling<C>;

impl<C: Comm> Coupling<C> {
    /// Couples two scales. Collective over both scales: all their ranks pass the same names in the same order. A
    /// producer rank passes its units and their weights (none for a weight of 1 each), a consumer rank passes none.
    /// Create several couplings of the same two scales in the same order on both.
    ///
    /// # Errors
    /// Returns [`CouplingError`] if the arguments are invalid or the communication fails.
    pub fn new(
        scales: &Scales<C>,
        producer: &str,
        consumer: &str,
        units: &[UnitId],
        weights: &[f64],
        partitioner: &impl Partitioner,
    ) -> Result<Self, CouplingError> {
        let mut coupling = Self::empty(scales, producer, consumer)?;
        match coupling.role {
            Role::Producer => drop(coupling.add(units, weights, partitioner)?),
            Role::Consumer if !(units.is_empty() && weights.is_empty()) => {
                return Err(CouplingError::Role(consumer.to_owned(), "producer"));
            }
            Role::Consumer => drop(coupling.reconcile_added()?),
        }
        Ok(coupling)
    }

    fn empty(scales: &Scales<C>, producer: &str, consumer: &str) -> Result<Self, CouplingError> {
        let find = |name: &str| scales.find(name).ok_or_else(|| CouplingError::Scale(name.to_owned()));
        let (first, second) = (find(producer)?, find(consumer)?);
        if first == second {
            return Err(CouplingError::Itself(producer.to_owned()));
        }
        let names = [producer.to_owned(), consumer.to_owned()];
        let (role, remote) = match scales.own() {
            own if own == first => (Role::Producer, second),
            own if own == second => (Role::Consumer, first),
            own => {
                return Err(CouplingError::Role(scales.name(own).to_owned(), "producer or consumer"));
            }
        };
        let (comm, number) = (scales.world().clone(), scales.next_coupling(first, second));
        let (local_comm, remote_ranks) = (scales.comm().clone(), scales.ranks(remote).to_vec());
        let (channels, map) = Default::default();
        Ok(Self { comm, number, channels, local_comm, role, names, remote_ranks, map })
    }

    /// Returns the side of this rank.
    pub fn role(&self) -> Role {
        self.role
    }

    /// Returns the units of this rank, in the order of its data.
    pub fn units(&self) -> &[UnitId] {
        &self.map.units
    }

    /// Returns the rank of the other scale that each unit exchanges with, in the order of [`units`](Self::units).
    pub fn partners(&self) -> Vec<u32> {
        let mut partners = vec![0; self.map.units.len()];
        for neighbor in &self.map.neighbors {
            neighbor.indices.iter().for_each(|&index| partners[index as usize] = neighbor.rank as u32);
        }
        partners
    }

    /// Returns the neighbors of this rank, as ranks of the other scale, and the number of units exchanged with each.
    pub fn neighbors(&self) -> impl Iterator<Item = (usize, usize)> {
        self.map.neighbors.iter().map(|neighbor| (neighbor.rank, neighbor.indices.len()))
    }

    /// Returns the coupling in the opposite direction: producer and consumer are exchanged, and every unit goes back to
    /// its origin. The result is a copy, made without communication; it does not change with later additions, removals
    /// and migrations.
    #[must_use]
    pub fn inverse(&self) -> Self {
        let role = match self.role {
            Role::Producer => Role::Consumer,
            Role::Consumer => Role::Producer,
        };
        let [producer, consumer] = self.names.clone();
        Self { role, names: [consumer, producer], ..self.clone() }
    }

    /// Adds units on the producer and returns a coupling of the new units only, for data that only they need.
    /// Collective: all producer ranks call it, with or without new units, while the consumer ranks call
    /// [`reconcile_added`](Self::reconcile_added). Pass one weight per unit, or none for a weight of 1 each. Units
    /// already distributed do not move. A coupling that [`inverse`](Self::inverse) made before this call contains only
    /// the old units; create it again.
    ///
    /// If an error occurs on one rank, the others wait for that rank; the caller must therefore end the run.
    ///
    /// The caller ensures that no other rank adds the same unit; a duplicate is detected only if both units go to the
    /// same consumer rank.
    ///
    /// # Errors
    /// Returns [`CouplingError`] if the arguments or the distribution are invalid, or the communication fails.
    pub fn add(
        &mut self,
        units: &[UnitId],
        weights: &[f64],
        partitioner: &impl Partitioner,
    ) -> Result<Delta<C>, CouplingError> {
        self.must_be(Role::Producer)?;
        let mut known: HashSet<UnitId> = self.map.units.iter().copied().collect();
        if let Some(&unit) = units.iter().find(|&&unit| !known.insert(unit)) {
            return Err(CouplingError::Unit(unit, "is in this coupling already"));
        }
        let ones = vec![1.0; units.len()];
        let weights = if weights.is_empty() { &ones } else { weights };
        if weights.len() != units.len() {
            return Err(CouplingError::Weights { found: weights.len(), units: units.len() });
        }
        let mut distribution = Distribution::assemble(&self.local_comm, weights).map_err(|error| self.failed(error))?;
        distribution.held = self.held().map_err(|error| self.failed(error))?;
        let to = partitioner.partition(&distribution, self.local_comm.rank(), self.remote_ranks.len());
        let (last, ranks) = (to.iter().copied().max().unwrap_or(0), self.remote_ranks.len());
        if to.len() != units.len() || last >= ranks {
            return Err(CouplingError::Partition { units: units.len(), found: to.len(), last, ranks });
        }
        let new = UnitMap::new(units, &to);
        self.send_new_units(&new).map_err(|error| self.failed(error))?;
        self.map.append(units, &to);
        Ok(Self { map: new, ..self.clone() })
    }

    /// Returns the number of units on each consumer rank; the result is the same on all producer ranks.
    fn held(&self) -> Result<Vec<usize>, CommError> {
        let mut held = vec![0.0; self.remote_ranks.len()];
        self.neighbors().for_each(|(rank, count)| held[rank] = count as f64);
        self.local_comm.sum(&mut held)?;
        Ok(held.into_iter().map(|count| count as usize).collect())
    }

    /// Sends the table of new units by pair of ranks to the consumer, and then the list of units to each neighbor.
    fn send_new_units(&self, new: &UnitMap) -> Result<(), CommError> {
        let rows: Vec<[u64; 3]> = new
            .neighbors
            .iter()
            .map(|neighbor| [self.local_comm.rank(), neighbor.rank, neighbor.indices.len()].map(|number| number as u64))
            .collect();
        let table = self.local_comm.gather(0, Message::of(bytemuck::cast_slice::<_, u64>(&rows)))?;
        if let Some(table) = table {
            let all: Vec<u64> = table.iter().filter_map(|row| row.values::<u64>()).flatten().copied().collect();
            self.comm.send(self.remote_ranks[0], self.tag(MessageKind::Roots), Message::of(&all))?;
        }
        for neighbor in &new.neighbors {
            let units: Vec<UnitId> = new.units_of(neighbor).collect();
            self.comm.send(self.remote_ranks[neighbor.rank], self.tag(MessageKind::Lists), Message::of(&units))?;
        }
        Ok(())
    }

    /// Receives on the consumer the units that the producer [`add`](Self::add)s; returns a coupling of the new units
    /// only.
    ///
    /// # Errors
    /// Returns [`CouplingError`] if a unit exists already or the communication fails.
    pub fn reconcile_added(&mut self) -> Result<Delta<C>, CouplingError> {
        self.must_be(Role::Consumer)?;
        let (units, ranks) = self.receive_new_units().map_err(|error| self.failed(error))?;
        let mut known: HashSet<UnitId> = self.map.units.iter().copied().collect();
        if let Some(&unit) = units.iter().find(|&&unit| !known.insert(unit)) {
            return Err(CouplingError::Unit(unit, "came twice"));
        }
        self.map.append(&units, &ranks);
        Ok(Self { map: UnitMap::new(&units, &ranks), ..self.clone() })
    }

    /// Receives the new units, ordered by producer rank, and the producer rank of each.
    fn receive_new_units(&self) -> Result<(Vec<UnitId>, Vec<usize>), CommError> {
        let table = match self.local_comm.rank() {
            0 => self.comm.receive(self.remote_ranks[0], self.tag(MessageKind::Roots))?,
            _ => Message::new(),
        };
        let table = self.local_comm.broadcast(0, table)?;
        let mine = self.local_comm.rank() as u64;
        let rows = table.values::<[u64; 3]>().unwrap_or_default();
        let (mut units, mut ranks) = (Vec::new(), Vec::new());
        for &[from, _, count] in rows.iter().filter(|&&[_, to, _]| to == mine) {
            let (from, count) = (from as usize, count as usize);
            let list = self.comm.receive(self.remote_ranks[from], self.tag(MessageKind::Lists))?;
            let size = CommError::Size { from: self.remote_ranks[from], found: list.len(), expected: 8 * count };
            let list = list.values::<UnitId>().filter(|list| list.len() == count).ok_or(size)?;
            units.extend_from_slice(list);
            ranks.resize(units.len(), from);
        }
        Ok((units, ranks))
    }

    /// Removes units of this rank on the producer. Collective: all producer ranks call it while the consumer ranks call
    /// [`reconcile_removed`](Self::reconcile_removed). The other units keep their order. Returns the previous index of
    /// each, with which the caller reorders its data: `kept.iter().map(|&index| old[index as usize])`. If units are
    /// also added, both sides perform additions and removals in the same order.
    ///
    /// # Errors
    /// Returns [`CouplingError`] if a unit does not exist or the communication fails.
    pub fn remove(&mut self, units: &[UnitId]) -> Result<Vec<u32>, CouplingError> {
        self.must_be(Role::Producer)?;
        let gone: HashSet<UnitId> = units.iter().copied().collect();
        let known: HashSet<UnitId> = self.map.units.iter().copied().collect();
        if let Some(&unit) = units.iter().find(|unit| !known.contains(unit)) {
            return Err(CouplingError::Unit(unit, "is not in this coupling"));
        }
        for neighbor in &self.map.neighbors {
            let list: Vec<UnitId> = self.map.units_of(neighbor).filter(|unit| gone.contains(unit)).collect();
            let sent =
                self.comm.send(self.remote_ranks[neighbor.rank], self.tag(MessageKind::Lists), Message::of(&list));
            sent.map_err(|error| self.failed(error))?;
        }
        Ok(self.map.remove(&gone))
    }

    /// Removes on the consumer the units that the producer [`remove`](Self::remove)s. Returns the previous index of
    /// each remaining unit.
    ///
    /// # Errors
    /// Returns [`CouplingError`] if the communication fails.
    pub fn reconcile_removed(&mut self) -> Result<Vec<u32>, CouplingError> {
        self.must_be(Role::Consumer)?;
        let mut gone = HashSet::new();
        for neighbor in &self.map.neighbors {
            let list = self.comm.receive(self.remote_ranks[neighbor.rank], self.tag(MessageKind::Lists));
            gone.extend(list.map_err(|error| self.failed(error))?.values::<UnitId>().unwrap_or_default());
        }
        Ok(self.map.remove(&gone))
    }

    /// Returns the number of units between each pair of ranks: one row per producer rank, one column per consumer rank.
    /// Collective over this side; each side computes the table from its own data, and all its ranks get the same
    /// result.
    ///
    /// # Errors
    /// Returns [`CouplingError`] if the communication fails.
    pub fn table(&self) -> Result<Vec<Vec<usize>>, CouplingError> {
        let own: Vec<u64> = self.neighbors().flat_map(|(rank, count)| [rank as u64, count as u64]).collect();
        let all = self.local_comm.gather_all(Message::of(&own)).map_err(|error| self.failed(error))?;
        let (local, remote) = (self.local_comm.size(), self.remote_ranks.len());
        let (producers, consumers) = if self.role == Role::Producer { (local, remote) } else { (remote, local) };
        let mut table = vec![vec![0; consumers]; producers];
        for (local, row) in all.iter().enumerate() {
            for &[remote, count] in row.values::<[u64; 2]>().unwrap_or_default() {
                match self.role {
                    Role::Producer => table[local][remote as usize] = count as usize,
                    Role::Consumer => table[remote as usize][local] = count as usize,
                }
            }
        }
        Ok(table)
    }

    /// Returns the number of a new channel.
    pub(super) fn next_channel(&self) -> u32 {
        self.channels.fetch_add(1, Ordering::Relaxed)
    }

    pub(super) fn tag(&self, kind: MessageKind) -> Tag {
        /// Smaller tags are reserved for messages between scales.
        const FIRST: u32 = 16;
        let kind = match kind {
            MessageKind::Lists => 0,
            MessageKind::Roots => 1,
            MessageKind::Layouts => 2,
            MessageKind::Values(stream) => 3 + stream % STREAMS,
        };
        Tag(FIRST + (3 + STREAMS) * self.number + kind)
    }

    pub(super) fn must_be(&self, role: Role) -> Result<(), CouplingError> {
        let (own, name) = match self.role {
            Role::Producer => (&self.names[0], "consumer"),
            Role::Consumer => (&self.names[1], "producer"),
        };
        if self.role == role { Ok(()) } else { Err(CouplingError::Role(own.clone(), name)) }
    }

    /// Adds the names of the scales to a communication error.
    pub(super) fn failed(&self, error: CommError) -> CouplingError {
        let [producer, consumer] = self.names.clone();
        CouplingError::Comm { producer, consumer, error }
    }
}
