//! Load balancing during a run: from the measured seconds of a sweep to a migration.

use std::time::Instant;

use super::error::BalanceError;
use super::loads::Loads;
use super::plan::{MigrationPlan, Moves};
use super::planner::{Planner, plan};
use super::trigger::{Estimate, Trigger, TriggerParams};
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

    /// Records the seconds that a sweep took on this rank. Collective over the scale.
    ///
    /// # Errors
    /// Returns [`BalanceError`] if the communication fails.
    pub fn observe<C: Comm>(&mut self, scale: &C, seconds: f64) -> Result<(), BalanceError> {
        let mut sum = [seconds];
        scale.sum(&mut sum)?;
        let mean = sum[0] / scale.size() as f64;
        self.is_due |= self.trigger.observe(slowest(scale, seconds)?, mean);
        Ok(())
    }

    /// Returns true if a sweep since the last plan was so unbalanced that a migration may pay; the same on all ranks.
    pub fn is_due(&self) -> bool {
        self.is_due
    }

    /// Plans a migration of units with these weights and bytes, as [`plan`] does, and measures how long that takes;
    /// `None` if it does not pay. Collective over the scale.
    ///
    /// # Errors
    /// Returns [`BalanceError`] if the arguments or the plan are invalid, or the communication fails.
    pub fn plan<C: Comm>(
        &mut self,
        scale: &C,
        planner: &(impl Planner + ?Sized),
        weights: &[f64],
        bytes: &[u64],
    ) -> Result<Option<DueMigration>, BalanceError> {
        let start = Instant::now();
        self.is_due = false;
        let (loads, plan) = plan(scale, planner, weights, bytes)?;
        let seconds = slowest(scale, start.elapsed().as_secs_f64())?;
        let accepted = self.trigger.accept(&loads, &plan, seconds)?;
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

/// Returns the seconds of the slowest rank. Collective.
fn slowest<C: Comm>(scale: &C, seconds: f64) -> Result<f64, BalanceError> {
    let mut slowest = [seconds];
    scale.max(&mut slowest)?;
    Ok(slowest[0])
}
