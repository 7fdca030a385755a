//! The micro scale as seen by the macro scale: sends commands and strains, receives answers.
//!
//! Each rank of the macro scale has a part of the elements and exchanges with their RVEs. There are two ways to solve
//! for the body:
//! - the first rank solves ([`Lead::First`]), and the others [`follow`](super::follow): they receive the gradients of
//!   their part from it and return the answers;
//! - all ranks solve, in step ([`Lead::All`]), on a backend that distributes the linear system; every rank receives all
//!   answers.

use std::collections::HashSet;
use std::time::{Duration, Instant};

use nalgebra::Matrix3;

use super::TwoScaleError;
use super::follower::{ANSWERS, GRADIENTS, Order, SECONDS};
use super::protocol::{Answer, Command, Failed, MICRO, RankReport, Seconds, Strain, Task, pack};
use super::shard::{Change, Shard};
use crate::app::results::log::RankSeconds;
use crate::coupling::{Scales, UnitId};
use crate::las::{Comm, Message};
use crate::tissue::micro_scale::Sites;

/// The ranks that solve for the body.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Lead {
    /// The first rank of the macro scale.
    First,
    /// All ranks of the macro scale, in step.
    All,
}

/// Connection of the macro scale to the ranks that solve RVEs.
pub(super) struct MicroProxy<'a, C: Comm> {
    pub scales: &'a Scales<C>,
    /// Index of the micro scale in `scales`.
    below: usize,
    pub lead: Lead,
    /// The rank of the macro scale to whose part each element belongs.
    pub shard_of: Vec<u32>,
    /// The RVEs of the part of this rank; `None` before the scales are coupled.
    shard: Option<Shard<C>>,
    /// Elements with RVEs, per rank of the macro scale.
    units: Vec<Vec<u64>>,
    in_step: bool,
    /// Times per trial state and rank of the macro scale.
    iterations: Vec<Vec<Seconds>>,
    /// The time up to which `between` counts.
    since: Instant,
    /// Times since the last trial state, counted at the next one.
    between: Seconds,
}

impl<'a, C: Comm> MicroProxy<'a, C> {
    /// Does not communicate.
    pub fn new(scales: &'a Scales<C>, lead: Lead, shard_of: Vec<u32>) -> Self {
        Self {
            scales,
            below: scales.find(MICRO).unwrap_or(usize::MAX),
            lead,
            shard_of,
            shard: None,
            units: vec![Vec::new(); scales.comm().size()],
            in_step: false,
            iterations: Vec::new(),
            since: Instant::now(),
            between: Seconds::default(),
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
        self.scales.ranks(self.below)
    }

    /// Restarts the clock of the macro scale's own work.
    pub fn rest(&mut self) {
        self.since = Instant::now();
    }

    /// Ends the loops of the other ranks; rejects a step that is still open first.
    pub fn complete(&self) -> Result<(), TwoScaleError> {
        if self.in_step {
            self.broadcast(&Command::Reject)?;
            self.receive()?;
        }
        self.order(&Order::End)?;
        self.broadcast(&Command::Complete)
    }

    /// Receives a message of the micro scale, on the ranks that solve for the body.
    fn receive(&self) -> Result<Message, TwoScaleError> {
        Ok(match self.lead {
            Lead::First => self.scales.receive_on_root(self.below)?,
            Lead::All => self.scales.receive(self.below)?,
        })
    }

    /// Sends a command to all ranks of the micro scale.
    pub fn broadcast(&self, command: &Command) -> Result<(), TwoScaleError> {
        Ok(self.scales.broadcast(self.below, pack(command)?)?)
    }

    fn order(&self, order: &Order) -> Result<(), TwoScaleError> {
        let comm = self.scales.comm();
        if comm.size() > 1 && self.lead == Lead::First {
            comm.broadcast(0, pack(order)?)?;
        }
        Ok(())
    }

    /// Gathers one value per rank of the micro scale, in the order of ranks.
    fn gather<T: for<'de> serde::Deserialize<'de>>(&self, seconds: &mut Seconds) -> Result<Vec<T>, TwoScaleError> {
        let start = Instant::now();
        let waits = self.scales.comm().rank() == 0;
        if waits {
            self.scales.wait_for(self.below)?;
        }
        let arrived = Instant::now();
        let message = self.receive()?;
        // The other macro ranks receive the message from the first one; that wait is no exchange with the micro scale.
        let received = if waits { arrived } else { Instant::now() };
        let all = message.split().ok_or(TwoScaleError::Protocol)?;
        let all = all.into_iter().map(|bytes| Ok(postcard::from_bytes(bytes)?)).collect();
        seconds.idle += (received - start).as_secs_f64();
        seconds.exchanging += received.elapsed().as_secs_f64();
        all
    }

    /// Deletes and creates RVEs on both scales.
    pub fn change(&mut self, change: &Change) -> Result<(), TwoScaleError> {
        self.between.busy += self.since.elapsed().as_secs_f64();
        self.rest();
        self.order(&Order::Change(change.gone.clone(), change.new.clone()))?;
        self.broadcast(&Command::Units)?;
        let own = self.scales.comm().rank() as u32;
        let Self { shard: Some(shard), shard_of, .. } = self else { return Err(TwoScaleError::Protocol) };
        shard.change(change, |element| shard_of[element] == own)?;
        // Keeps the order of the shard of each rank.
        let gone: HashSet<u64> = change.gone.iter().copied().collect();
        for units in &mut self.units {
            units.retain(|unit| !gone.contains(unit));
        }
        for &[element, _] in &change.new {
            self.units[self.shard_of[element as usize] as usize].push(element);
        }
        self.between.exchanging += self.since.elapsed().as_secs_f64();
        self.rest();
        Ok(())
    }

    /// Sends a task to all awake RVEs and returns their answers; those of other parts go through the rank of the part.
    pub fn ask(&mut self, task: Task, gradients: &[Matrix3<f64>], sites: &Sites) -> Result<Vec<Answer>, TwoScaleError> {
        let command = if std::mem::replace(&mut self.in_step, true) { Command::Iterate } else { Command::Step };
        let comm = self.scales.comm().clone();
        let mut seconds = std::mem::take(&mut self.between);
        seconds.busy += self.since.elapsed().as_secs_f64();
        let start = Instant::now();
        self.order(&Order::Exchange)?;
        let followers = if self.lead == Lead::First { comm.size() } else { 1 };
        let strain = |unit: UnitId| {
            let task = if sites.is_awake(unit as usize) { task } else { Task::Rest };
            Strain::new(&gradients[unit as usize], task)
        };
        for (rank, units) in self.units.iter().enumerate().take(followers).skip(1) {
            let of_part: Vec<Strain> = units.iter().map(|&unit| strain(unit)).collect();
            comm.send(rank, GRADIENTS, Message::of(&of_part))?;
        }
        self.broadcast(&command)?;
        seconds.exchanging += start.elapsed().as_secs_f64();
        let Some(shard) = &mut self.shard else { return Err(TwoScaleError::Protocol) };
        let mut answers = shard.exchange(|_, element| strain(element), &mut seconds)?.to_vec();
        let (start, mut waited) = (Instant::now(), Duration::ZERO);
        let mut receive = |rank: usize| {
            let start = Instant::now();
            comm.wait_for(rank, ANSWERS)?;
            waited += start.elapsed();
            comm.receive(rank, ANSWERS)
        };
        let of_parts = match self.lead {
            Lead::First => (1..comm.size()).map(&mut receive).collect::<Result<_, _>>()?,
            // The wait in this collective is short, since all ranks have just received their own answers.
            Lead::All if comm.size() > 1 => comm.gather_all(Message::of(&std::mem::take(&mut answers)))?,
            Lead::All => Vec::new(),
        };
        for of_part in of_parts {
            answers.extend_from_slice(of_part.values::<Answer>().ok_or(TwoScaleError::Protocol)?);
        }
        seconds.idle += waited.as_secs_f64();
        seconds.exchanging += (start.elapsed() - waited).as_secs_f64();
        let all = match self.lead {
            Lead::First => (1..comm.size()).map(|rank| comm.receive(rank, SECONDS)).collect::<Result<_, _>>()?,
            Lead::All => comm.gather_all(Message::of(&seconds.numbers()))?.split_off(1),
        };
        let all = all.iter().map(|message| message.values().and_then(Seconds::of).ok_or(TwoScaleError::Protocol));
        self.iterations.push(std::iter::once(Ok(seconds)).chain(all).collect::<Result<_, _>>()?);
        Ok(answers)
    }

    /// Asks why RVEs found no equilibrium; returns the failure of the lowest element.
    pub fn explain(&mut self) -> Result<Failed, TwoScaleError> {
        self.broadcast(&Command::Explain)?;
        let failed: Vec<Option<Failed>> = self.gather(&mut Seconds::default())?;
        failed.into_iter().flatten().min_by_key(|failed| failed.failure.element).ok_or(TwoScaleError::Protocol)
    }

    /// Ends a step on the micro scale. Returns the report of each of its ranks, and the times of all ranks of both
    /// scales per trial state.
    pub fn end_step(&mut self, converged: bool) -> Result<(Vec<RankReport>, Vec<Vec<RankSeconds>>), TwoScaleError> {
        self.broadcast(&if converged { Command::Accept } else { Command::Reject })?;
        self.in_step = false;
        let mut reporting = Seconds::default();
        let mut reports: Vec<RankReport> = self.gather(&mut reporting)?;
        if let Some(last) = self.iterations.last_mut().and_then(|ranks| ranks.first_mut()) {
            last.idle += reporting.idle;
            last.exchanging += reporting.exchanging;
        }
        let above = self.scales.ranks(self.scales.own());
        let mut iterations: Vec<Vec<RankSeconds>> = std::mem::take(&mut self.iterations)
            .into_iter()
            .map(|all| all.into_iter().zip(above).map(|(seconds, &rank)| rank_seconds(rank, seconds)).collect())
            .collect();
        for (report, &rank) in reports.iter_mut().zip(self.scales.ranks(self.below)) {
            for (iteration, seconds) in iterations.iter_mut().zip(std::mem::take(&mut report.seconds)) {
                iteration.push(rank_seconds(rank, seconds));
            }
        }
        Ok((reports, iterations))
    }
}

fn rank_seconds(rank: usize, Seconds { busy, idle, exchanging }: Seconds) -> RankSeconds {
    RankSeconds { rank, busy, idle, exchanging }
}
