//! Phase 2: units move between the ranks of a scale, point to point.

use super::super::data::UnitId;
use super::error::BalanceError;
use super::plan::Moves;
use crate::las::{Comm, CommError, Message, SendRequest, Tag};

/// Where a unit was before a migration.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Origin {
    /// Its rank in the scale.
    pub rank: usize,
    /// Its index in the data of this rank.
    pub index: u32,
}

/// What a migration changed on one rank. The data of the rank afterwards consists of the units that stayed, in their
/// order, and those that arrived, ordered by origin rank and index; [`apply`](Self::apply) puts any data of the units
/// into this order.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Migration {
    /// This rank.
    rank: usize,
    /// The units of this rank before the migration.
    pub(super) units: Vec<UnitId>,
    pub(super) moves: Moves,
    stayed: Vec<u32>,
    arrived: Vec<Origin>,
}

impl Migration {
    /// Informs the ranks of a scale about a migration by the user's own means: each rank passes the moves of its units,
    /// and the units that it had before. Collective over the scale; each rank sends to the targets of its moves only.
    /// If the data has another order than described above, [`Coupling::reorder`](super::super::Coupling::reorder) the
    /// couplings after their synchronization.
    ///
    /// # Errors
    /// Returns [`BalanceError`] on all ranks if the moves of one of them are invalid, or if the communication fails.
    pub fn announce<C: Comm>(scale: &C, moves: &Moves, units: &[UnitId]) -> Result<Self, BalanceError> {
        let received = exchange(scale, moves, units.len(), Message::of)?;
        let mut arrived = Vec::new();
        for (rank, message) in received {
            let indices = message.values::<u32>().ok_or(CommError::Malformed { from: rank, found: message.len() })?;
            arrived.extend(indices.iter().map(|&index| Origin { rank, index }));
        }
        Ok(Self::new(scale.rank(), moves, units, arrived))
    }

    fn new(rank: usize, moves: &Moves, units: &[UnitId], arrived: Vec<Origin>) -> Self {
        Self { rank, units: units.to_vec(), moves: moves.clone(), stayed: moves.stayed(units.len()), arrived }
    }

    /// Returns the former indices of the units that stayed on this rank, in ascending order.
    pub fn stayed(&self) -> &[u32] {
        &self.stayed
    }

    /// Returns the origins of the units that arrived, ordered by rank and index.
    pub fn arrived(&self) -> &[Origin] {
        &self.arrived
    }

    /// Returns the moves of the units that left this rank.
    pub fn moves(&self) -> &Moves {
        &self.moves
    }

    /// Returns the data of the units of this rank after the migration, from the data of the former units and of those
    /// that [`arrived`](Self::arrived), in this order.
    ///
    /// # Errors
    /// Returns [`BalanceError::Count`] if the lengths do not fit.
    pub fn apply<T>(&self, former: Vec<T>, arrived: Vec<T>) -> Result<Vec<T>, BalanceError> {
        let check = |found: usize, units: usize, what| {
            if found == units { Ok(()) } else { Err(BalanceError::Count { rank: self.rank, units, found, what }) }
        };
        check(former.len(), self.units.len(), "values of former units")?;
        check(arrived.len(), self.arrived.len(), "values of arrived units")?;
        let mut stayed = self.stayed.iter().peekable();
        let is_stayed = |&(index, _): &(u32, T)| stayed.next_if(|&&next| next == index).is_some();
        let kept = (0_u32..).zip(former).filter(is_stayed).map(|(_, value)| value);
        Ok(kept.chain(arrived).collect())
    }
}

/// Moves units between the ranks of a scale: each rank passes the moves of its units, and all its units. `pack`
/// serializes the unit at an index. Collective over the scale; only ranks between which units move exchange messages,
/// one per pair. Returns what changed, and the data of the units that [arrived](Migration::arrived), in this order.
///
/// # Errors
/// Returns [`BalanceError`] on all ranks, before any unit moves, if the moves of one of them are invalid; otherwise if
/// the communication fails.
pub fn migrate<C: Comm>(
    scale: &C,
    moves: &Moves,
    units: &[UnitId],
    mut pack: impl FnMut(usize) -> Message,
) -> Result<(Migration, Vec<Message>), BalanceError> {
    let parcel = |indices: &[u32]| {
        let data = indices.iter().map(|&index| pack(index as usize));
        Message::join([Message::of(indices)].into_iter().chain(data).collect())
    };
    let received = exchange(scale, moves, units.len(), parcel)?;
    let (mut arrived, mut data) = (Vec::new(), Vec::new());
    for (rank, message) in received {
        let invalid = || CommError::Malformed { from: rank, found: message.len() };
        let parts = message.split().ok_or_else(invalid)?;
        let (indices, parts) = parts.split_first().ok_or_else(invalid)?;
        let indices: &[u32] = bytemuck::try_cast_slice(indices).map_err(|_| invalid())?;
        if indices.len() != parts.len() {
            return Err(invalid().into());
        }
        arrived.extend(indices.iter().map(|&index| Origin { rank, index }));
        data.extend(parts.iter().map(|part| Message::of(part)));
    }
    Ok((Migration::new(scale.rank(), moves, units, arrived), data))
}

/// Sends one message to each target of the moves; returns the messages received, ordered by rank.
fn exchange<C: Comm>(
    scale: &C,
    moves: &Moves,
    units: usize,
    mut message: impl FnMut(&[u32]) -> Message,
) -> Result<Vec<(usize, Message)>, BalanceError> {
    let rank = scale.rank();
    let checked = moves.check(rank, units, scale.size()).map_err(|error| BalanceError::Plan { rank, error });
    scale.agree(checked)?;
    let targets: Vec<u64> = moves.iter().map(|(to, _)| to as u64).collect();
    let all = scale.gather_all(Message::of(&targets))?;
    let mut sendings = Vec::with_capacity(targets.len());
    for (to, units) in moves.iter() {
        sendings.push(scale.start_send(to, Tag::MIGRATION, message(units))?);
    }
    let sends_here =
        |targets: &Message| targets.values::<u64>().is_some_and(|targets| targets.contains(&(rank as u64)));
    let mut received = Vec::new();
    for (from, _) in all.iter().enumerate().filter(|(_, targets)| sends_here(targets)) {
        received.push((from, scale.receive(from, Tag::MIGRATION)?));
    }
    sendings.into_iter().try_for_each(|sending| sending.wait().map(drop))?;
    Ok(received)
}
