//! Schemes of load balancing, with the library's own weights, planners and trigger.

use std::collections::HashMap;
use std::time::Instant;

use biotissue::coupling::balance::{
    BalanceError, Cost, CostHistory, Diffusive, Greedy, Iterations, Loads, LongestFirst, MigrationPlan, Planner,
    Predictor, Quantity, SKILL_SAMPLE, Trigger, TriggerParams, Weights, rank_correlation,
};
use clap::ValueEnum;

use super::{Case, Run};

/// How the micro ranks balance their load.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Scheme {
    /// RVEs stay where they are.
    Nothing,
    /// The reference text: at the end of every step, a greedy plan by the mean iterations since the last migration.
    Text,
    /// The default of `biotissue run`: before every sweep, if that pays, single RVEs by predicted seconds.
    Default,
    /// The seconds of the next sweep are known, RVEs move without cost: longest processing time first.
    Oracle,
}

impl Scheme {
    /// Its name in tables.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Nothing => "nothing",
            Self::Text => "text",
            Self::Default => "default",
            Self::Oracle => "oracle",
        }
    }
}

/// A scheme and what it has learned.
pub struct Balancer<'a> {
    case: &'a Case<'a>,
    scheme: Scheme,
    predictor: Predictor,
    trigger: Trigger,
    is_due: bool,
    /// The RVEs of the last plan and the ranks where they would be if it had been declined or, respectively, carried out.
    elsewhere: Vec<(u32, usize)>,
    /// The largest number of ranks that a rank exchanges the costs of these RVEs with.
    links: usize,
}

impl<'a> Balancer<'a> {
    pub fn new(case: &'a Case<'a>, scheme: Scheme) -> Self {
        // As in `biotissue run`, the last class is that of RVEs without a network.
        let predictor = Predictor::new(Quantity::Seconds, case.replicas.recording.networks() + 1);
        let trigger = Trigger::new(TriggerParams::default());
        Self { case, scheme, predictor, trigger, is_due: false, elsewhere: Vec::new(), links: 0 }
    }

    /// Balances ahead of a sweep.
    pub fn before_sweep(&mut self, run: &mut Run, sweep: usize) -> Result<(), BalanceError> {
        match self.scheme {
            Scheme::Nothing => Ok(()),
            Scheme::Text if sweep > 0 && self.case.replicas.recording.starts_step(sweep) => self.by_the_text(run),
            Scheme::Default if std::mem::take(&mut self.is_due) => self.if_it_pays(run),
            Scheme::Text | Scheme::Default => Ok(()),
            Scheme::Oracle => {
                let seconds = |unit: usize| run.samples[unit].map_or(0.0, |sample| sample.seconds);
                let loads = run.placement.loads(seconds, 0, None)?;
                run.placement.migrate(&LongestFirst { stay: 0.0 }.plan(&loads)?)
            }
        }
    }

    fn by_the_text(&self, run: &mut Run) -> Result<(), BalanceError> {
        let loads = self.loads(run, &Iterations, false)?;
        let plan = Self::timed(self.case, run, || Greedy.plan(&loads))?;
        if !plan.is_empty() {
            self.migrate(run, &loads, &plan)?;
        }
        Ok(())
    }

    fn if_it_pays(&mut self, run: &mut Run) -> Result<(), BalanceError> {
        let before = run.totals.balancing();
        let loads = self.loads(run, &self.predictor, true)?;
        let plan = Self::timed(self.case, run, || Diffusive::default().plan(&loads))?;
        let planned = run.totals.balancing();
        let accepted = self.trigger.accept(&loads, &plan, planned - before)?;
        self.elsewhere.clear();
        self.links = Self::most_messages(&plan).0;
        for (rank, units) in run.placement.iter().enumerate() {
            let other = |to: usize| if accepted.is_some() { rank } else { to };
            let moves = plan.of(rank).iter();
            self.elsewhere
                .extend(moves.flat_map(|(to, moved)| moved.iter().map(move |&at| (units[at as usize], other(to)))));
        }
        if let Some(estimate) = accepted {
            self.migrate(run, &loads, &plan)?;
            self.trigger.migrated(&loads, &plan, &estimate, run.totals.balancing() - planned);
        }
        Ok(())
    }

    /// Gathers the loads of all ranks, 16 bytes per RVE, or 20 with the macro rank of each, and the lengths of the three
    /// parts of each message.
    fn loads(&self, run: &mut Run, weights: &impl Weights, with_partners: bool) -> Result<Loads, BalanceError> {
        let Case { machine, local, ranks, macro_ranks, .. } = self.case;
        let per_rve = if with_partners { 20 } else { 16 };
        let bytes = per_rve * run.histories.len() as u64 + 32 * *ranks as u64;
        run.totals.planning += machine.gather_all(*ranks, bytes) + machine.core * local.gather;
        run.totals.plans += 1;
        // An RVE that does not exist has no weight; one that is about to be created is not known to the planner.
        let weight = |unit: usize| if run.existed[unit] { weights.weight(&run.histories[unit]) } else { 0.0 };
        run.placement.loads(weight, self.case.state_bytes, with_partners.then_some(*macro_ranks))
    }

    /// Calls a planner, as every rank does, and measures its seconds.
    fn timed<T>(case: &Case, run: &mut Run, plan: impl FnOnce() -> Result<T, BalanceError>) -> Result<T, BalanceError> {
        let start = Instant::now();
        let planned = plan()?;
        run.totals.planning += case.machine.core * start.elapsed().as_secs_f64();
        Ok(planned)
    }

    /// Moves RVEs. The busiest rank sends and receives the most bytes; the coupling is updated by one more message
    /// between each pair of ranks, and one from each micro rank to each of its macro ranks.
    fn migrate(&self, run: &mut Run, loads: &Loads, plan: &MigrationPlan) -> Result<(), BalanceError> {
        let Case { machine, local, ranks, macro_ranks, .. } = self.case;
        let (most, targets) = Self::most_messages(plan);
        run.totals.synchronizing += machine.core * local.migrate
            + machine.gather_all(*ranks, 0)
            + machine.gather_all(*ranks, 8 * targets)
            + machine.messages(2 * most, plan.bytes(loads))
            + machine.messages(run.neighbors, 0);
        run.placement.migrate(plan)?;
        run.neighbors = run.placement.macro_neighbors(*macro_ranks);
        run.histories.iter_mut().for_each(CostHistory::restart);
        run.totals.migrations += 1;
        run.totals.moved += plan.len();
        Ok(())
    }

    /// Returns the largest number of ranks that a rank exchanges RVEs with, and the number of all pairs of such ranks.
    fn most_messages(plan: &MigrationPlan) -> (usize, u64) {
        let (mut messages, mut targets) = (vec![0; plan.ranks()], 0);
        for rank in 0..plan.ranks() {
            for (to, _) in plan.of(rank).iter() {
                messages[rank] += 1;
                messages[to] += 1;
                targets += 1;
            }
        }
        (messages.into_iter().max().unwrap_or(0), targets)
    }

    /// Learns from the costs of a sweep, in which the ranks took `busy` seconds.
    pub fn after_sweep(&mut self, run: &mut Run, sweep: usize, busy: &[f64]) {
        if self.scheme != Scheme::Default {
            return;
        }
        let Case { machine, local, ranks, .. } = self.case;
        let recording = self.case.replicas.recording;
        if sweep + 1 == self.case.sweeps || recording.starts_step(sweep + 1) {
            // Every rank computes the skill of the weights for the log of the step.
            let stride = run.samples.len().div_ceil(SKILL_SAMPLE).max(1);
            let units = (0..run.samples.len()).step_by(stride).filter_map(|unit| Some((unit, run.cost(unit)?)));
            let (weights, costs): (Vec<f64>, Vec<f64>) =
                units.map(|(unit, cost)| (self.predictor.weight(&run.histories[unit]), cost.seconds)).unzip();
            let start = Instant::now();
            let _ = rank_correlation(&weights, &costs);
            let seconds = start.elapsed().as_secs_f64();
            run.totals.observing += machine.reduce(*ranks, 8) + machine.gather_all(*ranks, 16 * weights.len() as u64);
            run.totals.observing += machine.core * seconds;
        }
        let sums = self.learn(run);
        // The sums of the predictor, then the sum and the maximum of the seconds.
        let of_values = |values: usize| machine.reduce(*ranks, 8 * values as u64);
        run.totals.observing += machine.core * local.record + of_values(sums) + 2.0 * of_values(1);
        self.trigger.observe_exchange(run.exchange());
        if self.trigger.awaits_comparison() {
            run.totals.observing += machine.messages(self.links, 8 * self.links as u64) + of_values(2);
            self.compare(run);
        }
        let sum = sum_over_ranks(busy.iter().map(|&seconds| vec![seconds]).collect());
        let slowest = busy.iter().copied().fold(0.0, f64::max);
        self.is_due |= self.trigger.observe(slowest, sum[0] / *ranks as f64);
    }

    /// Compares the loads with those that the ranks would have if the RVEs of the last plan were on the other rank.
    fn compare(&mut self, run: &Run) {
        let other: HashMap<u32, usize> = self.elsewhere.drain(..).collect();
        let (mut here, mut elsewhere) = (0.0_f64, vec![0.0; run.case.ranks]);
        for (rank, units) in run.placement.iter().enumerate() {
            let mut own = 0.0;
            for &unit in units {
                let seconds = run.samples[unit as usize].map_or(0.0, |sample| sample.seconds);
                own += seconds;
                elsewhere[other.get(&unit).copied().unwrap_or(rank)] += seconds;
            }
            here = here.max(own);
        }
        self.trigger.compare(here, elsewhere.into_iter().fold(0.0, f64::max));
    }

    /// Learns on every rank, and adds the sums as `Comm::sum` does; returns their number.
    fn learn(&mut self, run: &Run) -> usize {
        let mut of_ranks: Vec<Vec<f64>> = Vec::new();
        for units in run.placement.iter() {
            let existing =
                units.iter().filter_map(|&unit| Some((run.histories[unit as usize], run.cost(unit as usize)?)));
            let (histories, costs): (Vec<CostHistory>, Vec<Cost>) = existing.unzip();
            self.predictor.learn(&histories, &costs);
            of_ranks.push(self.predictor.take_sums());
        }
        let sums = sum_over_ranks(of_ranks);
        self.predictor.add_sums(&sums);
        sums.len()
    }
}

/// Adds the values of all ranks along the tree of `Comm::sum`.
fn sum_over_ranks(mut values: Vec<Vec<f64>>) -> Vec<f64> {
    let mut distance = 1;
    while distance < values.len() {
        for rank in (0..values.len() - distance).step_by(2 * distance) {
            let other = std::mem::take(&mut values[rank + distance]);
            values[rank].iter_mut().zip(other).for_each(|(sum, value)| *sum += value);
        }
        distance *= 2;
    }
    values.into_iter().next().unwrap_or_default()
}
