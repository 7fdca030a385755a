//! The micro scale as seen by the macro scale: sends commands and tasks, receives responses.
//!
//! Each rank of the macro scale has a shard of the elements and exchanges with their RVEs. There are two ways to solve
//! for the body:
//! - the root solves ([`BodySolve::Root`]), and the others [`follow`](super::follow): they receive the tasks of their
//!   shard from it and return the responses;
//! - all ranks solve a distributed linear system ([`BodySolve::Distributed`]). In a divided body, each rank receives the
//!   responses of its own elements, and those of its ghosts from their ranks; otherwise every rank receives all responses.

use std::collections::HashSet;
use std::path::Path;
use std::sync::{Mutex, PoisonError};
use std::time::{Duration, Instant};

use nalgebra::Matrix3;
use serde::Deserialize;

use super::TwoScaleError;
use super::balance::{MigrationReport, When};
use super::follower::{FollowerCommand, RESPONSES, SUMMARIES, TASKS, TIMES, UPDATES};
use super::piece_messages::PieceFailure;
use super::protocol::{
    Command, MICRO, RankReport, RankTimes, RveFailure, RveResponse, RveSummary, RveTask, Task, pack, unpack,
};
use super::shard::{RveUpdate, Shard};
use crate::coupling::{Scales, UnitId};
use crate::las::{Comm, Message};
use crate::tissue::micro_scale::{Piece, Sites};

/// The ranks that solve for the body.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum BodySolve {
    /// The root of the macro scale.
    Root,
    /// All ranks of the macro scale, on a backend that distributes the linear system.
    Distributed,
}

/// Connection of the macro scale to the ranks that solve RVEs.
pub(super) struct MicroProxy<'a, C: Comm> {
    pub scales: &'a Scales<C>,
    /// Index of the micro scale in `scales`.
    micro_scale: usize,
    pub body_solve: BodySolve,
    /// When the micro scale balances its load, if it does.
    balances: Option<When>,
    /// The rank of the macro scale to whose shard each element belongs; `None` if each rank knows its own RVEs alone,
    /// because the body is divided.
    pub shard_of: Option<Vec<u32>>,
    /// The RVEs of the shard of this rank; `None` before the scales are coupled.
    shard: Option<Shard<C>>,
    /// Points with RVEs, per rank of the macro scale, if the root solves for the body.
    units: Vec<Vec<u64>>,
    in_step: bool,
    /// Times per trial state and rank of the macro scale.
    iterations: Vec<Vec<RankTimes>>,
    /// The migrations of the step.
    migrations: Vec<MigrationReport>,
    /// The time up to which `between` counts.
    since: Instant,
    /// What the exchange with the RVEs took at the last trial state, on the slowest rank of this scale, s.
    exchange: Option<f64>,
    /// Times since the last trial state, to be added to those of the next one.
    between: RankTimes,
    /// The part of the time since `since` that this rank waited for pieces of a checkpoint. Behind a lock, because
    /// they are written with shared access to the field.
    waited: Mutex<RankTimes>,
}

/// What the micro scale reports at the end of an increment.
pub(super) struct EndedIncrement {
    pub summaries: Vec<RveSummary>,
    /// One entry per rank of the micro scale.
    pub reports: Vec<RankReport>,
    /// The times of all ranks of both scales, one entry per trial state.
    pub iterations: Vec<Vec<RankTimes>>,
}

impl<'a, C: Comm> MicroProxy<'a, C> {
    /// Creates a proxy without couplings; [`MicroProxy::couple`] adds them. Does not communicate.
    pub fn new(
        scales: &'a Scales<C>,
        body_solve: BodySolve,
        balances: Option<When>,
        shard_of: Option<Vec<u32>>,
    ) -> Self {
        let micro_scale = scales.find(MICRO);
        let micro_ranks = micro_scale.map_or(0, |micro_scale| scales.ranks(micro_scale).len());
        Self {
            scales,
            micro_scale: micro_scale.unwrap_or(usize::MAX),
            body_solve,
            // A single rank has nothing to balance.
            balances: balances.filter(|_| micro_ranks > 1),
            shard_of,
            shard: None,
            units: vec![Vec::new(); scales.comm().size()],
            in_step: false,
            iterations: Vec::new(),
            migrations: Vec::new(),
            since: Instant::now(),
            exchange: None,
            between: RankTimes::of_rank(scales.world().rank()),
            waited: Mutex::default(),
        }
    }

    /// Couples the scales, without RVEs.
    pub fn couple(&mut self) -> Result<(), TwoScaleError> {
        self.shard = Some(Shard::new(self.scales)?);
        Ok(())
    }

    pub fn is_coupled(&self) -> bool {
        self.shard.is_some()
    }

    /// The ranks of the micro scale.
    pub fn ranks(&self) -> &[usize] {
        self.scales.ranks(self.micro_scale)
    }

    /// Restarts the clock of the macro scale's own work.
    pub fn restart_clock(&mut self) {
        self.since = Instant::now();
    }

    /// Counts the time on the clock for `times`.
    fn read_clock(&mut self, times: &mut RankTimes) {
        let RankTimes { idle, communication, .. } =
            std::mem::take(self.waited.get_mut().unwrap_or_else(PoisonError::into_inner));
        times.busy += self.since.elapsed().as_secs_f64() - idle - communication;
        times.idle += idle;
        times.communication += communication;
    }

    /// Ends the loops of the other ranks; first reverts a step that is still open.
    pub fn complete(&self) -> Result<(), TwoScaleError> {
        if self.in_step {
            self.broadcast(&Command::Revert)?;
            self.receive()?;
        }
        self.send_to_followers(&FollowerCommand::End)?;
        self.broadcast(&Command::Complete)
    }

    /// Receives a message of the micro scale, on the ranks that solve for the body.
    fn receive(&self) -> Result<Message, TwoScaleError> {
        Ok(match self.body_solve {
            BodySolve::Root => self.scales.receive_on_root(self.micro_scale)?,
            BodySolve::Distributed => self.scales.receive(self.micro_scale)?,
        })
    }

    /// Sends a command to all ranks of the micro scale.
    pub fn broadcast(&self, command: &Command) -> Result<(), TwoScaleError> {
        Ok(self.scales.broadcast(self.micro_scale, pack(command)?)?)
    }

    fn send_to_followers(&self, command: &FollowerCommand) -> Result<(), TwoScaleError> {
        let comm = self.scales.comm();
        if comm.size() > 1 && self.body_solve == BodySolve::Root {
            comm.broadcast(0, pack(command)?)?;
        }
        Ok(())
    }

    /// Gathers one value per rank of the micro scale, in the order of ranks.
    fn gather<T: for<'de> Deserialize<'de>>(&self, times: &mut RankTimes) -> Result<Vec<T>, TwoScaleError> {
        let start = Instant::now();
        let waits = self.scales.comm().rank() == 0;
        if waits {
            self.scales.wait_for(self.micro_scale)?;
        }
        let arrived = Instant::now();
        let message = self.receive()?;
        // The other macro ranks receive the message from the root; that wait is no exchange with the micro scale.
        let received = if waits { arrived } else { Instant::now() };
        let all = message.split().ok_or(TwoScaleError::Protocol)?;
        let all = all.into_iter().map(|bytes| Ok(postcard::from_bytes(bytes)?)).collect();
        times.idle += (received - start).as_secs_f64();
        times.add_communication(received);
        all
    }

    /// Tells the micro scale how many points of the body use each model.
    pub fn send_counts(&mut self, per_model: &[usize]) -> Result<(), TwoScaleError> {
        self.broadcast(&Command::Count(per_model.iter().map(|&count| count as u64).collect()))
    }

    /// Deletes and creates RVEs on both scales.
    pub fn update_rves(&mut self, update: RveUpdate) -> Result<(), TwoScaleError> {
        let mut between = self.between.take();
        self.read_clock(&mut between);
        self.between = between;
        self.restart_clock();
        self.send_to_followers(&FollowerCommand::UpdateRves)?;
        let own = self.send_updates(update)?;
        self.broadcast(&Command::Units)?;
        self.shard.as_mut().ok_or(TwoScaleError::Protocol)?.update_rves(&own)?;
        self.between.add_communication(self.since);
        self.restart_clock();
        Ok(())
    }

    /// Sends the ranks of the other shards what they create and delete. Returns that of the shard of this rank.
    fn send_updates(&mut self, update: RveUpdate) -> Result<RveUpdate, TwoScaleError> {
        let comm = self.scales.comm();
        let Some(shard_of) = &self.shard_of else { return Ok(update) };
        let RveUpdate { deleted, created, sends_matrices } = update;
        let mut of_shards: Vec<RveUpdate> = Vec::new();
        of_shards.resize_with(comm.size(), || RveUpdate { sends_matrices, ..RveUpdate::default() });
        for new in created {
            let (_, location, _) = &new;
            of_shards[shard_of[location.element as usize] as usize].created.push(new);
        }
        if self.body_solve == BodySolve::Root {
            // Keeps the order of the shard of each rank.
            let gone: HashSet<u64> = deleted.iter().copied().collect();
            for (units, update) in self.units.iter_mut().zip(&of_shards) {
                units.retain(|unit| !gone.contains(unit));
                units.extend(update.created.iter().map(|(point, ..)| *point));
            }
            for (rank, update) in of_shards.iter_mut().enumerate().skip(1) {
                let update = RveUpdate { deleted: deleted.clone(), ..std::mem::take(update) };
                comm.send(rank, UPDATES, pack(&update)?)?;
            }
        }
        Ok(RveUpdate { deleted, ..of_shards.swap_remove(comm.rank()) })
    }

    /// Sends a task to all awake RVEs and returns their responses; those of other shards go through the rank of the
    /// shard. In a divided body, only those of this rank. `point_of` returns the point of a unit in `gradients` and `sites`.
    pub fn evaluate(
        &mut self,
        task: Task,
        gradients: &[Matrix3<f64>],
        sites: &Sites,
        point_of: impl Fn(UnitId) -> usize,
    ) -> Result<Vec<RveResponse>, TwoScaleError> {
        let comm = self.scales.comm().clone();
        let mut times = self.between.take();
        self.read_clock(&mut times);
        if self.balances.is_some_and(|when| when == When::Iteration || !self.in_step) {
            self.balance(&mut times)?;
        }
        let command = if std::mem::replace(&mut self.in_step, true) { Command::Iterate(task) } else { Command::Step };
        let start = Instant::now();
        self.send_to_followers(&FollowerCommand::Exchange)?;
        let followers = if self.body_solve == BodySolve::Root { comm.size() } else { 1 };
        let task_of = |unit: UnitId| {
            let point = point_of(unit);
            let task = if sites.is_awake(point) { task } else { Task::None };
            RveTask::new(&gradients[point], task)
        };
        for (rank, units) in self.units.iter().enumerate().take(followers).skip(1) {
            let of_shard: Vec<RveTask> = units.iter().map(|&unit| task_of(unit)).collect();
            comm.send(rank, TASKS, Message::of(&of_shard))?;
        }
        self.broadcast(&command)?;
        times.add_communication(start);
        let Some(shard) = &mut self.shard else { return Err(TwoScaleError::Protocol) };
        let mut responses = shard.exchange(|_, point| task_of(point), &mut times)?.to_vec();
        let exchange = shard.seconds_of_exchange();
        let (start, mut waited) = (Instant::now(), Duration::ZERO);
        let mut receive = |rank: usize| {
            let start = Instant::now();
            comm.wait_for(rank, RESPONSES)?;
            waited += start.elapsed();
            comm.receive(rank, RESPONSES)
        };
        let of_shards = match self.body_solve {
            BodySolve::Root => (1..comm.size()).map(&mut receive).collect::<Result<_, _>>()?,
            // The wait in this collective is short, since all ranks have just received their own responses.
            BodySolve::Distributed if comm.size() > 1 && self.shard_of.is_some() => {
                comm.gather_all(Message::of(&std::mem::take(&mut responses)))?
            }
            BodySolve::Distributed => Vec::new(),
        };
        for of_shard in of_shards {
            responses.extend_from_slice(of_shard.values::<RveResponse>().ok_or(TwoScaleError::Protocol)?);
        }
        times.idle += waited.as_secs_f64();
        times.communication += (start.elapsed() - waited).as_secs_f64();
        let others = match self.body_solve {
            BodySolve::Root => (1..comm.size()).map(|rank| comm.receive(rank, TIMES)).collect::<Result<_, _>>()?,
            BodySolve::Distributed => comm.gather_all(pack(&(times, exchange))?)?.split_off(1),
        };
        let others = others.iter().map(|message| Ok(unpack(message)?));
        let of_ranks = std::iter::once(Ok((times, exchange))).chain(others);
        let (of_ranks, exchanges): (Vec<RankTimes>, Vec<f64>) =
            of_ranks.collect::<Result<Vec<_>, TwoScaleError>>()?.into_iter().unzip();
        self.exchange = exchanges.into_iter().reduce(f64::max);
        self.iterations.push(of_ranks);
        Ok(responses)
    }

    /// Lets the micro scale migrate RVEs if that is due and pays, and updates the couplings.
    fn balance(&mut self, times: &mut RankTimes) -> Result<(), TwoScaleError> {
        let start = Instant::now();
        let exchange = self.exchange.take();
        self.broadcast(&Command::Balance(exchange))?;
        let migrated: Option<MigrationReport> = unpack(&self.receive()?)?;
        let received = Instant::now();
        times.idle += (received - start).as_secs_f64();
        if let Some(report) = migrated {
            self.send_to_followers(&FollowerCommand::ReconcileMigrated)?;
            self.shard.as_mut().ok_or(TwoScaleError::Protocol)?.reconcile_migrated()?;
            self.migrations.push(MigrationReport { iteration: self.iterations.len() + 1, ..report });
            times.balancing += received.elapsed().as_secs_f64();
        }
        Ok(())
    }

    /// Returns the migrations since the last call.
    pub fn take_migrations(&mut self) -> Vec<MigrationReport> {
        std::mem::take(&mut self.migrations)
    }

    /// Asks why RVEs found no equilibrium; returns the failure of the lowest point.
    pub fn explain(&mut self) -> Result<RveFailure, TwoScaleError> {
        self.broadcast(&Command::Explain)?;
        let failed: Vec<Option<RveFailure>> = self.gather(&mut RankTimes::default())?;
        failed.into_iter().flatten().min_by_key(|failed| failed.failure.point).ok_or(TwoScaleError::Protocol)
    }

    /// Ends an increment on the micro scale by [`Command::Commit`] or [`Command::Revert`]. Returns the summaries of the RVEs
    /// after a commit, as [`MicroProxy::evaluate`] returns responses, the report of each rank of the micro scale, and the
    /// times of all ranks of both scales per trial state.
    pub fn end_increment(&mut self, command: &Command) -> Result<EndedIncrement, TwoScaleError> {
        let converged = matches!(command, Command::Commit(_));
        if converged {
            self.send_to_followers(&FollowerCommand::Summarize)?;
        }
        self.broadcast(command)?;
        self.in_step = false;
        let mut reporting = RankTimes::default();
        let summaries = if converged { self.summaries(&mut reporting)? } else { Vec::new() };
        let mut reports: Vec<RankReport> = self.gather(&mut reporting)?;
        let mut iterations = std::mem::take(&mut self.iterations);
        if let Some(last) = iterations.last_mut().and_then(|ranks| ranks.first_mut()) {
            last.idle += reporting.idle;
            last.communication += reporting.communication;
        }
        for report in &mut reports {
            for (iteration, times) in iterations.iter_mut().zip(std::mem::take(&mut report.times)) {
                iteration.push(times);
            }
        }
        Ok(EndedIncrement { summaries, reports, iterations })
    }

    /// Receives the summaries of the RVEs after a commit; those of other shards go through the rank of the shard.
    fn summaries(&mut self, times: &mut RankTimes) -> Result<Vec<RveSummary>, TwoScaleError> {
        let Self { shard: Some(shard), scales, .. } = self else { return Err(TwoScaleError::Protocol) };
        let comm = scales.comm();
        let mut summaries = shard.receive_summaries(times)?;
        let start = Instant::now();
        let of_shards = match self.body_solve {
            BodySolve::Root => (1..comm.size()).map(|rank| comm.receive(rank, SUMMARIES)).collect::<Result<_, _>>()?,
            BodySolve::Distributed if comm.size() > 1 && self.shard_of.is_some() => {
                comm.gather_all(Message::of(&std::mem::take(&mut summaries)))?
            }
            BodySolve::Distributed => Vec::new(),
        };
        for of_shard in of_shards {
            summaries.extend_from_slice(of_shard.values::<RveSummary>().ok_or(TwoScaleError::Protocol)?);
        }
        times.add_communication(start);
        Ok(summaries)
    }

    /// Sends a command that each rank of the micro scale answers with one value; returns the values in the order of
    /// ranks. The wait counts for the next trial state.
    fn ask<T: for<'de> Deserialize<'de>>(&self, command: &Command) -> Result<Vec<T>, TwoScaleError> {
        self.broadcast(command)?;
        let mut waited = self.waited.lock().unwrap_or_else(PoisonError::into_inner);
        self.gather(&mut waited)
    }

    /// Makes each rank of the micro scale write a piece with the states of its RVEs.
    pub fn save(&self, folder: &Path, stem: &str) -> Result<Vec<Result<Option<Piece>, PieceFailure>>, TwoScaleError> {
        self.ask(&Command::Save { folder: folder.into(), stem: stem.into() })
    }

    /// Makes the ranks of the micro scale verify pieces.
    pub fn verify(&self, folder: &Path, pieces: &[Piece]) -> Result<Vec<Result<(), PieceFailure>>, TwoScaleError> {
        self.ask(&Command::Verify(folder.into(), pieces.to_vec()))
    }

    /// Makes the ranks of the micro scale restore their RVEs from pieces.
    pub fn restore(&self, folder: &Path, pieces: &[Piece]) -> Result<Vec<Result<(), String>>, TwoScaleError> {
        self.ask(&Command::Restore(folder.into(), pieces.to_vec()))
    }
}
