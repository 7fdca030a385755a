//! Phase 3: the couplings of a scale whose units migrated are updated on both sides.
//!
//! After algorithm 4.1 of the reference text, with two differences. First, the order in which a pair of ranks exchanges
//! its units depends on the former ranks and positions only, not on the order of the data, so that both sides know it
//! without further messages. Second, each rank that a unit left informs the ranks of the other scale: these are
//! neighbors already, so that they know from which ranks to receive.

use std::collections::HashMap;

use bytemuck::{Pod, Zeroable};

use super::super::couple::{Coupling, CouplingError, MessageKind};
use super::super::data::UnitId;
use super::super::unit_map::MigratedUnit;
use super::migrate::{Migration, Origin};
use crate::las::{Comm, CommError, Message, SendRequest, Tag};

/// What the former rank of a unit sends to the new one.
#[derive(Clone, Copy, Pod, Zeroable)]
#[repr(C)]
struct Departure {
    unit: UnitId,
    /// The index in the coupling of the former rank.
    index: u32,
    /// The rank of the other scale that the unit is exchanged with, and the position in this exchange.
    remote: u32,
    position: u32,
    unused: u32,
}

/// The place of a unit in the exchange: the number of the neighbor, and the position among the units exchanged with it.
#[derive(Clone, Copy, Default)]
struct Place {
    neighbor: usize,
    position: u32,
}

impl<C: Comm> Coupling<C> {
    /// Updates this coupling on the scale whose units migrated. Collective: all ranks of this scale call it while those
    /// of the other scale call [`reconcile_migrated`](Self::reconcile_migrated); either of them may be the producer.
    /// Call it once for each coupling of the units, and create [inverses](Self::inverse) again.
    ///
    /// The units of the coupling may be some of those that migrated, in any order. Afterwards they have the order of
    /// the migrated data, so that values of all units need no further permutation. Returns the origin of each unit:
    /// the index is that in the coupling of the former rank.
    ///
    /// If an error occurs on one rank, the others wait for that rank; the caller must therefore end the run.
    ///
    /// # Errors
    /// Returns [`CouplingError`] if a unit of the coupling is not among those of the migration, or the communication
    /// fails.
    pub fn migrate(&mut self, migration: &Migration) -> Result<Vec<Origin>, CouplingError> {
        let index_of = self.indices_of(&migration.units)?;
        let stayed: Vec<u32> = migration.stayed().iter().filter_map(|&index| index_of[index as usize]).collect();
        let arrived = self.exchange_departures(migration, &index_of).map_err(|error| self.failed(error))?;
        let rank = self.local_comm.rank();
        let mut origins: Vec<Origin> = stayed.iter().map(|&index| Origin { rank, index }).collect();
        origins.extend(arrived.iter().map(|(_, origin)| *origin));
        let arrived: Vec<MigratedUnit> = arrived.into_iter().map(|(unit, _)| unit).collect();
        self.map.migrate(&stayed, &arrived);
        Ok(origins)
    }

    /// Returns the index in this coupling of each unit of the migrated data; `None` for units of other couplings.
    fn indices_of(&self, data: &[UnitId]) -> Result<Vec<Option<u32>>, CouplingError> {
        if data == self.units() {
            return Ok((0..data.len() as u32).map(Some).collect());
        }
        let mut own: HashMap<UnitId, u32> = self.units().iter().copied().zip(0..).collect();
        let index_of = data.iter().map(|unit| own.remove(unit)).collect();
        match own.into_keys().min() {
            Some(unit) => Err(CouplingError::Unit(unit, "is not among the units of this migration")),
            None => Ok(index_of),
        }
    }

    /// Sends the units that left this rank to their new ranks, and their new ranks to the other scale. Returns the
    /// units that arrived, with their origins, in the order of the migrated data.
    fn exchange_departures(
        &self,
        migration: &Migration,
        index_of: &[Option<u32>],
    ) -> Result<Vec<(MigratedUnit, Origin)>, CommError> {
        let places = self.places();
        let mut relocated = vec![Vec::new(); self.map.neighbors.len()];
        let mut sendings = Vec::new();
        for (to, moved) in migration.moves().iter() {
            let mut departures = Vec::with_capacity(moved.len());
            for index in moved.iter().filter_map(|&unit| index_of[unit as usize]) {
                let Place { neighbor, position } = places[index as usize];
                let (unit, remote) = (self.map.units[index as usize], self.map.neighbors[neighbor].rank as u32);
                relocated[neighbor].push([position, to as u32]);
                departures.push(Departure { unit, index, remote, position, unused: 0 });
            }
            sendings.push(self.local_comm.start_send(to, Tag::MIGRATION, Message::of(&departures))?);
        }
        for (neighbor, relocated) in self.map.neighbors.iter().zip(relocated) {
            let (to, tag) = (self.remote_ranks[neighbor.rank], self.tag(MessageKind::Lists));
            sendings.push(self.comm.start_send(to, tag, Message::of(&relocated))?);
        }
        let mut senders: Vec<usize> = migration.arrived().iter().map(|origin| origin.rank).collect();
        senders.dedup();
        let mut arrived = Vec::new();
        for origin in senders {
            let message = self.local_comm.receive(origin, Tag::MIGRATION)?;
            let invalid = CommError::Malformed { from: origin, found: message.len() };
            for &Departure { unit, index, remote, position, .. } in message.values().ok_or(invalid)? {
                let remote = remote as usize;
                arrived.push((MigratedUnit { unit, origin, remote, position }, Origin { rank: origin, index }));
            }
        }
        sendings.into_iter().try_for_each(|sending| sending.wait().map(drop))?;
        Ok(arrived)
    }

    /// Returns the place of each unit in the exchange.
    fn places(&self) -> Vec<Place> {
        let mut places = vec![Place::default(); self.units().len()];
        for (neighbor, list) in self.map.neighbors.iter().enumerate() {
            for (position, &index) in (0..).zip(&list.indices) {
                places[index as usize] = Place { neighbor, position };
            }
        }
        places
    }

    /// Updates this coupling on the scale whose units stay, while the other scale calls [`migrate`](Self::migrate).
    /// The data of this rank keeps its order; create [inverses](Self::inverse) again.
    ///
    /// # Errors
    /// Returns [`CouplingError`] if the communication fails.
    pub fn reconcile_migrated(&mut self) -> Result<(), CouplingError> {
        let mut moved = Vec::new();
        for neighbor in &self.map.neighbors {
            let (from, tag) = (self.remote_ranks[neighbor.rank], self.tag(MessageKind::Lists));
            let list = self.comm.receive(from, tag).map_err(|error| self.failed(error))?;
            let invalid = || self.failed(CommError::Malformed { from, found: list.len() });
            for &[position, to] in list.values::<[u32; 2]>().ok_or_else(invalid)? {
                if to as usize >= self.remote_ranks.len() {
                    return Err(invalid());
                }
                moved.push((neighbor.rank, position, to as usize));
            }
        }
        let found = moved.len();
        let relocated = self.map.relocate(&moved);
        relocated.ok_or_else(|| self.failed(CommError::Malformed { from: self.remote_ranks[0], found }))
    }

    /// Hands the permutation of the exchange over to the caller: afterwards the order of the data is that of the
    /// exchange, so that the units of each neighbor are contiguous, neighbors in the order of their ranks, and values
    /// are sent and received in place. Returns the previous index of each unit, with which the caller reorders its
    /// data: `order.iter().map(|&index| old[index as usize])`. Needs no communication; the other side does not change.
    #[must_use = "the data must be reordered"]
    pub fn take_permutation(&mut self) -> Vec<u32> {
        let order = self.map.exchange_order();
        self.map.reorder(&order);
        order
    }

    /// Reorders the units of this rank as the caller has reordered its data, for example by the
    /// [permutation](Self::take_permutation) of another coupling of the same units: `order` contains the previous index
    /// of each unit. Needs no communication.
    ///
    /// # Errors
    /// Returns [`CouplingError::Permutation`] if `order` is not a permutation of the units of this rank.
    pub fn reorder(&mut self, order: &[u32]) -> Result<(), CouplingError> {
        let units = self.units().len();
        let mut sorted = order.to_vec();
        sorted.sort_unstable();
        if !sorted.into_iter().eq(0..units as u32) {
            return Err(CouplingError::Permutation { units, found: order.len() });
        }
        self.map.reorder(order);
        Ok(())
    }
}
