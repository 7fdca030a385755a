//! The other ranks of the macro scale if its root solves for the body: each exchanges with the RVEs of its shard.

use std::time::Instant;

use serde::{Deserialize, Serialize};

use super::TwoScaleError;
use super::protocol::{RankTimes, RveTask, pack, unpack};
use super::shard::{RveUpdate, Shard};
use crate::coupling::Scales;
use crate::las::{Comm, Message, Tag};

/// Tasks to the rank of a shard, and responses from it.
pub(super) const TASKS: Tag = Tag::of(0);
pub(super) const RESPONSES: Tag = Tag::of(1);
/// The times of the rank of a shard.
pub(super) const TIMES: Tag = Tag::of(2);
/// Summaries of the RVEs of a shard.
pub(super) const SUMMARIES: Tag = Tag::of(5);
/// New and deleted RVEs of a shard.
pub(super) const UPDATES: Tag = Tag::of(6);

/// A command of the root of the macro scale to the others.
#[derive(Serialize, Deserialize)]
pub(super) enum FollowerCommand {
    /// Delete and create the RVEs of an [`RveUpdate`] that comes for each rank.
    UpdateRves,
    /// Update the couplings after RVEs have migrated between ranks of the micro scale.
    ReconcileMigrated,
    /// Receive tasks, exchange with the RVEs, and return the responses.
    Exchange,
    /// Return the summaries of the RVEs, which were committed.
    Summarize,
    /// End of the run.
    End,
}

/// The main function of the ranks of the macro scale other than the root: carries out the commands of the root.
///
/// # Errors
/// Returns [`TwoScaleError`] if communication fails or a message does not follow the protocol.
pub fn follow<C: Comm>(scales: &Scales<C>) -> Result<(), TwoScaleError> {
    let comm = scales.comm();
    let mut shard = Shard::new(scales)?;
    let mut times = RankTimes::of_rank(scales.world().rank());
    loop {
        let waiting = Instant::now();
        match unpack(&comm.broadcast(0, Message::new())?)? {
            FollowerCommand::UpdateRves => {
                comm.wait_for(0, UPDATES)?;
                times.idle += waiting.elapsed().as_secs_f64();
                let start = Instant::now();
                let update: RveUpdate = unpack(&comm.receive(0, UPDATES)?)?;
                shard.update_rves(&update)?;
                times.add_communication(start);
            }
            FollowerCommand::ReconcileMigrated => {
                times.idle += waiting.elapsed().as_secs_f64();
                let start = Instant::now();
                shard.reconcile_migrated()?;
                times.balancing += start.elapsed().as_secs_f64();
            }
            FollowerCommand::Exchange => {
                comm.wait_for(0, TASKS)?;
                times.idle += waiting.elapsed().as_secs_f64();
                let start = Instant::now();
                let tasks = comm.receive(0, TASKS)?;
                times.add_communication(start);
                let tasks = tasks.values::<RveTask>().ok_or(TwoScaleError::Protocol)?;
                if tasks.len() != shard.points().len() {
                    return Err(TwoScaleError::Protocol);
                }
                let responses = shard.exchange(|number, _| tasks[number], &mut times)?;
                let start = Instant::now();
                comm.send(0, RESPONSES, Message::of(responses))?;
                times.add_communication(start);
                comm.send(0, TIMES, pack(&(times.take(), shard.seconds_of_exchange()))?)?;
            }
            FollowerCommand::Summarize => {
                times.idle += waiting.elapsed().as_secs_f64();
                let summaries = shard.receive_summaries(&mut times)?;
                let start = Instant::now();
                comm.send(0, SUMMARIES, Message::of(&summaries))?;
                times.add_communication(start);
            }
            FollowerCommand::End => return Ok(()),
        }
    }
}
