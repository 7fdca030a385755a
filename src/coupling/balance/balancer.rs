//! Load balancing during a run: from the measured seconds of a sweep to a migration.

use std::time::Instant;

use super::error::BalanceError;
use super::loads::{Loads, UnitLoads};
use super::plan::{MigrationPlan, Moves};
use super::planner::{Planner, plan_units};
use super::trigger::{Estimate, Trigger, TriggerParams};
use super::weights::{Cost, CostHistory};
use crate::las::Comm;

/// Decides when the units of one scale move, by a [`Trigger`] that gets the times of the slowest rank: all ranks decide
/// equally. The caller moves the units ([`migrate`](super::migrate)) and updates their couplings.
#[derive(Clone, Debug)]
pub struct Balancer {
    trigger: Trigger,
    is_due: bool,
}

/// A plan that pays, to be carried out.
#[derive(Clone, Debug)]
pub struct DueMigration {
    loads: Loads,
    plan: MigrationPlan,
    estimate: Estimate,
}

impl Balancer {
    /// Creates a balancer.
    pub fn new(params: TriggerParams) -> Self {
        Self { trigger: Trigger::new(params), is_due: false }
    }

    /// Records the seconds that a sweep took on this rank, and the costs of its units, whose histories show which of them
    /// the last plan contained. Collective over the scale.
    ///
    /// # Errors
    /// Returns [`BalanceError`] if the numbers of histories and costs differ, or the communication fails.
    pub fn observe<C: Comm>(
        &mut self,
        scale: &C,
        seconds: f64,
        histories: &mut [CostHistory],
        costs: &[Cost],
    ) -> Result<(), BalanceError> {
        let (units, found) = (histories.len(), costs.len());
        if found != units {
            return Err(BalanceError::Count { rank: scale.rank(), units, found, what: "costs" });
        }
        if self.trigger.awaits_comparison() {
            let [here, elsewhere] = largest_loads(scale, histories, costs)?;
            self.trigger.compare(here, elsewhere);
        }
        let mut sum = [seconds];
        scale.sum(&mut sum)?;
        let mean = sum[0] / scale.size() as f64;
        self.is_due |= self.trigger.observe(slowest(scale, seconds)?, mean);
        Ok(())
    }

    /// Records the seconds that the exchange with other scales took in the last sweep ([`Trigger::observe_exchange`]), the
    /// same number on all ranks.
    pub fn observe_exchange(&mut self, seconds: f64) {
        self.trigger.observe_exchange(seconds);
    }

    /// Returns true if a sweep since the last plan was so unbalanced that a migration may pay; the same on all ranks.
    pub fn is_due(&self) -> bool {
        self.is_due
    }

    /// Plans a migration of units, as [`plan_units`] does, and measures how long that takes; `None` if it does not pay. Marks the units of the plan in their histories, which must migrate with them; without
    /// histories (an empty slice), the balancer does not learn what its plans achieve. Collective over the scale.
    ///
    /// # Errors
    /// Returns [`BalanceError`] if the arguments or the plan are invalid, or the communication fails.
    pub fn plan<C: Comm>(
        &mut self,
        scale: &C,
        planner: &(impl Planner + ?Sized),
        own: UnitLoads<'_>,
        histories: &mut [CostHistory],
    ) -> Result<Option<DueMigration>, BalanceError> {
        let start = Instant::now();
        self.is_due = false;
        let (loads, plan) = plan_units(scale, planner, own)?;
        let seconds = slowest(scale, start.elapsed().as_secs_f64())?;
        let accepted = self.trigger.accept(&loads, &plan, seconds)?;
        mark(histories, plan.of(scale.rank()), accepted.map(|_| scale.rank()));
        Ok(accepted.map(|estimate| DueMigration { loads, plan, estimate }))
    }

    /// Records a migration that was carried out, with the seconds that it took on this rank after the plan, those of the
    /// couplings included. Collective over the scale.
    ///
    /// # Errors
    /// Returns [`BalanceError`] if the communication fails.
    pub fn migrated<C: Comm>(&mut self, scale: &C, due: &DueMigration, seconds: f64) -> Result<(), BalanceError> {
        let seconds = slowest(scale, seconds)?;
        self.trigger.migrated(&due.loads, &due.plan, &due.estimate, seconds);
        Ok(())
    }
}

impl DueMigration {
    /// Returns the units that leave a rank.
    ///
    /// # Panics
    /// Panics if there is no such rank.
    pub fn moves(&self, rank: usize) -> &Moves {
        self.plan.of(rank)
    }

    /// Returns the number of units that move.
    pub fn units(&self) -> usize {
        self.plan.len()
    }

    /// Returns the bytes of all units that move.
    pub fn bytes(&self) -> u64 {
        let of_rank = |rank: usize| {
            let units = self.plan.of(rank).iter().flat_map(|(_, units)| units);
            units.map(|&unit| self.loads.bytes(rank, unit)).sum::<u64>()
        };
        (0..self.plan.ranks()).map(of_rank).sum()
    }

    /// Returns the load of the most loaded rank over the mean: before the migration, and as expected after it.
    pub fn max_over_mean(&self) -> [f64; 2] {
        [self.loads.max_over_mean(), self.estimate.max_over_mean]
    }
}

/// Marks the units of a plan with the rank on which they will not be: their `origin` if the plan is carried out, else the
/// rank that they would move to.
fn mark(histories: &mut [CostHistory], moves: &Moves, origin: Option<usize>) {
    histories.iter_mut().for_each(|history| history.set_other_rank(None));
    for (to, units) in moves.iter() {
        for &unit in units {
            if let Some(history) = histories.get_mut(unit as usize) {
                history.set_other_rank(Some(origin.unwrap_or(to)));
            }
        }
    }
}

/// Returns the seconds of the most loaded rank, and those that it would have if all marked units were on the other rank.
/// Collective.
fn largest_loads<C: Comm>(scale: &C, histories: &mut [CostHistory], costs: &[Cost]) -> Result<[f64; 2], BalanceError> {
    let (mut here, mut elsewhere) = (0.0, vec![0.0; scale.size()]);
    for (history, cost) in histories.iter_mut().zip(costs) {
        let other = history.take_other_rank().filter(|&rank| rank < scale.size());
        here += cost.seconds;
        elsewhere[other.unwrap_or(scale.rank())] += cost.seconds;
    }
    scale.sum(&mut elsewhere)?;
    Ok([slowest(scale, here)?, elsewhere.into_iter().fold(0.0, f64::max)])
}

/// Returns the seconds of the slowest rank. Collective.
fn slowest<C: Comm>(scale: &C, seconds: f64) -> Result<f64, BalanceError> {
    let mut slowest = [seconds];
    scale.max(&mut slowest)?;
    Ok(slowest[0])
}
