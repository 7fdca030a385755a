//! The micro scale: creates and deletes RVEs on command of the macro scale, solves them, and sends the responses.

use std::collections::HashSet;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Instant;

use serde::Serialize;

use super::TwoScaleError;
use super::balance::{BalanceParams, MigrationReport, RveBalancer, RveWeights};
use super::channels::Channels;
use super::piece_messages::PieceFailure;
use super::progress::{ProgressChannel, ProgressSender};
use super::protocol::{
    Command, MACRO, NewMatrix, NewRve, RankReport, RankTimes, RveFailure, RveResponse, RveSummary, RveTask, Task, pack,
    unpack,
};
use crate::coupling::Scales;
use crate::coupling::balance::{Planner, Weights};
use crate::las::{Backend, Comm, Message, RealBackend};
use crate::tissue::materials::ElementSelection;
use crate::tissue::micro_scale::pieces;
use crate::tissue::micro_scale::{Library, Piece, PointFailure, SerializeIter, UnitState, Units};

/// What a rank of the micro scale sends to the macro scale for the results.
#[derive(Clone, Debug)]
pub struct MicroOutput {
    /// The elements whose deformed networks are sent.
    pub networks: ElementSelection,
    /// Whether the costs of all RVEs in every sweep are sent.
    pub costs: bool,
}

/// The main function of the micro scale on one rank. With `balance`, the ranks balance their load;
/// [`ScaleField::new`](super::ScaleField::new) gets its `when`.
/// With `progress`, the root of the macro scale gets to know the progress of the RVEs, if it calls
/// [`ScaleField::receive_progress`](super::ScaleField::receive_progress).
///
/// # Errors
/// Returns [`TwoScaleError`] if communication fails or a message does not follow the protocol.
pub fn run<C: Comm, B: RealBackend, P: Planner, W: RveWeights>(
    scales: &Scales<C>,
    library: Library<B>,
    output: MicroOutput,
    balance: Option<BalanceParams<P, W>>,
    progress: Option<&ProgressChannel<C>>,
) -> Result<(), TwoScaleError> {
    let macro_scale = scales.find(MACRO).ok_or(TwoScaleError::Scale(MACRO))?;
    let channels = Channels::new(scales)?;
    let between = RankTimes::of_rank(scales.world().rank());
    let balancer =
        balance.filter(|_| scales.comm().size() > 1).map(|params| RveBalancer::new(params, library.models().len()));
    let (mut units, (tasks, failed, times)) = (Units::new(library), Default::default());
    if output.costs {
        units.keep_costs();
    }
    let networks = output.networks;
    let activity = Arc::clone(units.activity());
    let sender = progress.map(|channel| ProgressSender::start(channel, scales, activity)).transpose()?;
    MicroSide { scales, macro_scale, networks, units, channels, balancer, tasks, failed, times, between }.run()?;
    sender.map_or(Ok(()), ProgressSender::end)
}

/// The RVEs of a rank and their couplings.
struct MicroSide<'a, C: Comm, B: Backend, P, V> {
    scales: &'a Scales<C>,
    /// Index of the macro scale in `scales`.
    macro_scale: usize,
    /// The elements whose deformed networks are part of the output.
    networks: ElementSelection,
    units: Units<B>,
    channels: Channels<C>,
    balancer: Option<RveBalancer<P, V>>,
    /// The last tasks received, in the order of the units.
    tasks: Vec<RveTask>,
    failed: Option<PointFailure>,
    /// Times per trial state of the step.
    times: Vec<RankTimes>,
    /// Times since the last responses were sent, to be added to those of the next trial state.
    between: RankTimes,
}

impl<C: Comm, B: RealBackend, P: Planner, V: Weights> MicroSide<'_, C, B, P, V> {
    fn run(mut self) -> Result<(), TwoScaleError> {
        let mut complete = false;
        while !complete {
            match self.command()? {
                Command::Count(counts) => {
                    let counts: Vec<usize> = counts.into_iter().map(|count| count as usize).collect();
                    self.units.use_lanes(&counts);
                }
                Command::Units => self.update_units()?,
                Command::Balance(exchange) => self.balance(exchange)?,
                Command::Step => {
                    let mut task = Some(Task::Solve);
                    while let Some(of_trial_state) = task {
                        self.carry_out_tasks(of_trial_state)?;
                        task = self.commands_of_step()?;
                    }
                }
                Command::Complete => complete = true,
                between => self.between_steps(between)?,
            }
        }
        Ok(())
    }

    /// Carries out commands after the responses; returns the task at another trial state of the step if the macro scale
    /// asks for one.
    fn commands_of_step(&mut self) -> Result<Option<Task>, TwoScaleError> {
        loop {
            match self.command()? {
                Command::Iterate(task) => return Ok(Some(task)),
                Command::Balance(exchange) => self.balance(exchange)?,
                // The strain demands new RVEs; the macro scale then solves for equilibrium again.
                Command::Units => self.update_units()?,
                Command::Explain => self.explain()?,
                over => {
                    self.between_steps(over)?;
                    return Ok(None);
                }
            }
        }
    }

    fn between_steps(&mut self, command: Command) -> Result<(), TwoScaleError> {
        match command {
            Command::Commit(ends_step) => self.end_increment(Some(ends_step)),
            Command::Revert => self.end_increment(None),
            Command::Save { folder, stem } => self.save(&PathBuf::from(folder), &stem),
            Command::Verify(folder, pieces) => self.verify(&PathBuf::from(folder), &pieces),
            Command::Restore(folder, pieces) => self.restore(&PathBuf::from(folder), &pieces),
            _ => Err(TwoScaleError::Protocol),
        }
    }

    fn command(&mut self) -> Result<Command, TwoScaleError> {
        let start = Instant::now();
        let message = self.scales.receive(self.macro_scale)?;
        self.between.idle += start.elapsed().as_secs_f64();
        Ok(unpack(&message)?)
    }

    /// Deletes RVEs, then creates new ones at rest, as the macro scale commands.
    fn update_units(&mut self) -> Result<(), TwoScaleError> {
        let start = Instant::now();
        let before = self.channels.to_micro.units().to_vec();
        let kept = self.channels.to_micro.reconcile_removed()?;
        let kept: HashSet<u64> = kept.into_iter().map(|place| before[place as usize]).collect();
        let deleted = before.into_iter().filter(|unit| !kept.contains(unit)).map(|unit| unit as usize).collect();
        self.units.remove(&deleted);
        let delta = self.channels.to_micro.reconcile_added()?;
        let mut new_rves = vec![NewRve::NONE; delta.units().len()];
        self.channels.new_rves.receive(&delta, &mut new_rves)?;
        let mut matrices = Vec::new();
        if self.units.library().sends_matrices() {
            matrices.resize(new_rves.len(), NewMatrix::NONE);
            self.channels.new_matrices.receive(&delta, &mut matrices)?;
        }
        for (number, (&point, new_rve)) in delta.units().iter().zip(new_rves).enumerate() {
            let point = point as usize;
            let material = new_rve.material(matrices.get(number).unwrap_or(&NewMatrix::NONE))?;
            let region = material.region;
            let material = self.units.library().received(point, material);
            let (network, matrix) = material.ok_or(TwoScaleError::Materials(new_rve.location()))?;
            self.units.add((point, new_rve.location(), region), network, matrix);
        }
        self.channels.to_macro = self.channels.to_micro.inverse();
        self.between.add_communication(start);
        Ok(())
    }

    /// Migrates RVEs if that is due and pays.
    fn balance(&mut self, exchange: Option<f64>) -> Result<(), TwoScaleError> {
        let start = Instant::now();
        let scale = self.scales.comm();
        let due = match &mut self.balancer {
            Some(balancer) => balancer.plan(scale, &mut self.units, &self.channels.to_micro.partners(), exchange)?,
            None => None,
        };
        self.scales.broadcast(self.macro_scale, pack(&due.as_ref().map(MigrationReport::new))?)?;
        if let (Some(balancer), Some(due)) = (&mut self.balancer, due) {
            let start = Instant::now();
            let migration = balancer.migrate(scale, &mut self.units, &due)?;
            self.channels.to_micro.migrate(&migration)?;
            self.channels.to_macro = self.channels.to_micro.inverse();
            balancer.migrated(scale, &due, start.elapsed().as_secs_f64())?;
        }
        self.between.balancing += start.elapsed().as_secs_f64();
        Ok(())
    }

    /// Receives a task for every RVE, `task` for those that are awake, carries them out, and sends the responses.
    fn carry_out_tasks(&mut self, task: Task) -> Result<(), TwoScaleError> {
        self.tasks.resize(self.units.len(), RveTask { gradient: [0.0; 9], task: Task::None as u64 });
        let (start, before) = (Instant::now(), self.channels.tasks.waited());
        self.channels.tasks.receive(&self.channels.to_micro, &mut self.tasks)?;
        let (received, waited) = (Instant::now(), self.channels.tasks.waited() - before);
        let tasks = &self.tasks;
        let outcome = match task {
            Task::Verify => self.units.verify(&|number, _| tasks[number].for_task(Task::Verify)),
            _ => self.units.solve(&|number, _| tasks[number].for_task(Task::Solve)).map(|()| Vec::new()),
        };
        let (replaced, failed) = match outcome {
            Ok(replaced) => (replaced, None),
            Err(failure) => (Vec::new(), Some(failure)),
        };
        let solved = Instant::now();
        let is_replaced = |number: usize| replaced.binary_search(&number).is_ok();
        let responses = self.units.responses().enumerate().map(|(number, (point, response))| {
            RveResponse::new(point, response.filter(|_| failed.is_none()), is_replaced(number))
        });
        let responses: Vec<RveResponse> = responses.collect();
        self.failed = failed;
        self.channels.responses.send(&self.channels.to_macro, &responses)?;
        let sent = Instant::now();
        let busy = (solved - received).as_secs_f64();
        // Verifications are rare, and their costs say little about those of the next solves.
        if let (Task::Solve, Some(balancer)) = (task, &mut self.balancer) {
            balancer.observe(self.scales.comm(), &mut self.units, busy)?;
        } else if task == Task::Solve {
            self.units.record_costs();
        }
        let mut times = self.between.take();
        times.busy += busy;
        // Above all, the other ranks of the scale are not ready.
        times.idle += (waited + sent.elapsed()).as_secs_f64();
        times.communication += (received - start - waited + (sent - solved)).as_secs_f64();
        times.rves = self.units.len();
        if task == Task::Solve {
            times.iterations = self.units.costs().iter().map(|cost| cost.iterations as usize).sum();
        }
        self.times.push(times);
        Ok(())
    }

    /// Sends the macro scale the failure of the lowest point with one on each rank of this scale.
    fn explain(&mut self) -> Result<(), TwoScaleError> {
        let start = Instant::now();
        let failed = self.failed.take().map(|failure| {
            let start = self.units.take_failed_rve().map(|failed| {
                let mut gradient = [0.0; 9];
                gradient.copy_from_slice(failed.dump.target.as_slice());
                let state = UnitState { rve: Some(failed.dump.start), response: None, iterations: 0 };
                (failed.network, state, gradient)
            });
            RveFailure { failure, start }
        });
        // `Units` reverts on the rank of the failed RVE; the other ranks revert too, so that the start of the next
        // trial state does not depend on the distribution of RVEs.
        self.units.revert();
        self.gather_to_macro(pack(&failed)?)?;
        self.between.add_communication(start);
        Ok(())
    }

    /// Commits an increment, with which the load step ends if `commit` is true, or reverts it, and sends the report of this
    /// rank to the macro scale. The time for that counts for the next increment.
    fn end_increment(&mut self, commit: Option<bool>) -> Result<(), TwoScaleError> {
        let start = Instant::now();
        let converged = commit.is_some();
        match commit {
            Some(ends_step) => self.units.commit(ends_step),
            None => self.units.revert(),
        }
        let summaries = if converged { self.units.summaries() } else { Vec::new() };
        let times = std::mem::take(&mut self.times);
        let skill = match &self.balancer {
            Some(balancer) if converged => balancer.skill(self.scales.comm())?,
            _ => None,
        };
        let summarized = Instant::now();
        if converged {
            let (rank, points) = (self.scales.world().rank(), self.units.points());
            let summaries = points.iter().zip(&summaries);
            let summaries: Vec<RveSummary> =
                summaries.map(|(&point, summary)| RveSummary::new(point, rank, summary.as_ref())).collect();
            self.channels.summaries.send(&self.channels.to_macro, &summaries)?;
        }
        let outputs = if converged { self.output_units() } else { Vec::new() };
        let network = |&number: &usize| (self.units.points()[number] as u64, self.units.deformed_network(number));
        let report = RankReport {
            stats: self.units.take_stats(),
            bytes: self.units.bytes(),
            times,
            costs: self.units.take_costs(),
            skill,
            networks: SerializeIter(|| outputs.iter().map(network)),
        };
        self.gather_to_macro(pack(&report)?)?;
        self.between.busy += (summarized - start).as_secs_f64();
        self.between.add_communication(summarized);
        Ok(())
    }

    /// The units whose deformed networks are part of the output.
    fn output_units(&self) -> Vec<usize> {
        let is_output = |number: &usize| self.networks.contains(self.units.location(*number).element as usize);
        (0..self.units.len()).filter(is_output).collect()
    }

    /// Gathers a message of every rank of this scale and sends them to the macro scale, in the order of ranks.
    fn gather_to_macro(&self, message: Message) -> Result<(), TwoScaleError> {
        let all = self.scales.comm().gather(0, message)?;
        Ok(self.scales.broadcast(self.macro_scale, Message::join(all.unwrap_or_default()))?)
    }

    /// Writes the piece of this rank and sends its description to the macro scale.
    fn save(&mut self, folder: &Path, stem: &str) -> Result<(), TwoScaleError> {
        let saved = self.timed(|side| side.units.write_piece(folder, stem, side.scales.comm().rank()));
        self.reply(&saved.map_err(PieceFailure::from))
    }

    /// Verifies the share of this rank of the pieces.
    fn verify(&mut self, folder: &Path, saved: &[Piece]) -> Result<(), TwoScaleError> {
        let (rank, ranks) = (self.scales.comm().rank(), self.scales.comm().size());
        let verified = self.timed(|_| pieces::verify_all(folder, saved.iter().skip(rank).step_by(ranks)));
        self.reply(&verified.map_err(PieceFailure::from))
    }

    /// Restores the RVEs of this rank; reports an error as text, since all pieces were verified.
    fn restore(&mut self, folder: &Path, saved: &[Piece]) -> Result<(), TwoScaleError> {
        let restored = self.timed(|side| side.units.restore(folder, saved));
        self.reply(&restored.map_err(|error| error.to_string()))
    }

    /// Calls `work` and counts its time as work.
    fn timed<T>(&mut self, work: impl FnOnce(&mut Self) -> T) -> T {
        let start = Instant::now();
        let outcome = work(self);
        self.between.busy += start.elapsed().as_secs_f64();
        outcome
    }

    /// Sends the outcome on this rank to the macro scale.
    fn reply(&mut self, outcome: &impl Serialize) -> Result<(), TwoScaleError> {
        let start = Instant::now();
        self.gather_to_macro(pack(outcome)?)?;
        self.between.add_communication(start);
        Ok(())
    }
}
