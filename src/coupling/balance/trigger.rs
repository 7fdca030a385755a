//! When to balance.

mod measured;

use self::measured::{ExchangeGrowth, MigrationCost, Planning, Savings};
use super::error::BalanceError;
use super::loads::Loads;
use super::plan::MigrationPlan;

/// Parameters of a [`Trigger`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TriggerParams {
    /// The value of max/mean from which on a sweep counts as unbalanced.
    pub threshold: f64,
    /// Number of consecutive unbalanced sweeps after which a migration is due.
    pub sweeps: usize,
    /// Number of sweeps after a migration that do not count.
    pub cool_down: usize,
    /// Number of sweeps for which a migration is expected to be of use.
    pub horizon: f64,
    /// Whether every plan is carried out that is expected to lower the largest load, whatever it gains and costs.
    pub always: bool,
    /// Estimate of the seconds that a migration takes, until one is measured.
    pub seconds_per_migration: f64,
    /// Estimate of the seconds per byte that the busiest rank sends and receives, until a migration is measured.
    pub seconds_per_byte: f64,
}

/// Every sweep may lead to a migration, because one that does not pay is declined. Loads that drift then stay within 5 % of
/// a perfect balance, where three unbalanced sweeps with max/mean of 1.35 leave 19 % (`docs/coupling.md`).
impl Default for TriggerParams {
    fn default() -> Self {
        Self {
            threshold: 1.03,
            sweeps: 1,
            cool_down: 0,
            horizon: 10.0,
            always: false,
            seconds_per_migration: 1e-2,
            seconds_per_byte: 2e-9,
        }
    }
}

/// What a plan is expected to gain and to cost.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Estimate {
    /// Seconds by which the sweeps of the horizon become shorter.
    pub gain: f64,
    /// Seconds that the migration takes.
    pub cost: f64,
    /// The value of max/mean that the plan leaves.
    pub max_over_mean: f64,
    /// By how many more ranks the busiest rank of another scale exchanges with this one; negative if they are fewer.
    pub more_neighbors: f64,
}

impl Estimate {
    /// Returns true if the plan should be carried out.
    pub fn pays(&self) -> bool {
        self.gain > self.cost
    }
}

/// Decides when a migration is due, and whether a plan pays. All ranks of a scale call it with the same numbers, and
/// decide equally; [`Balancer`](super::Balancer) sees to that.
///
/// Planning has its price even if the plan is declined. No migration is due while the largest possible saving, reduced by
/// the fraction of it that former plans were worth, is less than the measured time of planning (unless every plan is
/// carried out, [`TriggerParams::always`]).
///
/// What a plan promises is compared with what it achieves, whether it was carried out or declined: once the costs of the
/// next sweep are known, so is the load of every rank with and without the plan ([`compare`](Self::compare)). A decline of
/// max/mean after a migration would not tell, because migrations follow unusually unbalanced sweeps, after which max/mean
/// declines on its own.
#[derive(Clone, Debug)]
pub struct Trigger {
    params: TriggerParams,
    /// Number of consecutive unbalanced sweeps.
    unbalanced: usize,
    /// Number of further sweeps that do not count.
    cool_down: usize,
    /// Seconds of the last sweep on the slowest rank.
    sweep_seconds: f64,
    planning: Planning,
    cost: MigrationCost,
    exchange: ExchangeGrowth,
    savings: Savings,
    /// The last plan, until it is compared.
    promise: Option<Promise>,
}

/// What a plan promises.
#[derive(Clone, Copy, Debug)]
struct Promise {
    /// The fraction of the largest load that it saves.
    saving: f64,
    is_carried_out: bool,
}

impl Trigger {
    /// Creates a trigger.
    pub fn new(params: TriggerParams) -> Self {
        let cost = MigrationCost::new(params.seconds_per_migration, params.seconds_per_byte);
        Self {
            params,
            unbalanced: 0,
            cool_down: 0,
            sweep_seconds: 0.0,
            planning: Planning::default(),
            cost,
            exchange: ExchangeGrowth::default(),
            savings: Savings::default(),
            promise: None,
        }
    }

    /// Records the seconds that a sweep took on the slowest rank, and on the mean of all; returns true if a migration is due.
    /// If its plan is not carried out, the next one is due after as many unbalanced sweeps.
    pub fn observe(&mut self, slowest: f64, mean: f64) -> bool {
        let max_over_mean = if mean > 0.0 { slowest / mean } else { 1.0 };
        self.sweep_seconds = slowest;
        if self.cool_down > 0 {
            self.cool_down -= 1;
            return false;
        }
        self.unbalanced = if max_over_mean >= self.params.threshold { self.unbalanced + 1 } else { 0 };
        let is_due = self.unbalanced >= self.params.sweeps.max(1);
        if !is_due {
            return false;
        }
        self.unbalanced = 0;
        self.planning.pays(self.saving(1.0 - 1.0 / max_over_mean)) || self.params.always
    }

    /// Seconds that the sweeps of the horizon save if a plan lowers the largest load by this fraction.
    fn saving(&self, fraction: f64) -> f64 {
        self.params.horizon * self.sweep_seconds * fraction
    }

    /// Records the seconds that the exchange with the other scales took in a sweep, on the slowest of their ranks. Call it
    /// before the next plan. A unit that moves may make a rank of another scale exchange with one more rank, in every later
    /// sweep. Plans count that if this is called and the [partners](super::UnitLoads::partners) of the units are known.
    pub fn observe_exchange(&mut self, seconds: f64) {
        self.exchange.observe(seconds);
    }

    /// Returns true if the costs of the next sweep show what the last plan achieves or, if it was declined, would achieve.
    pub fn awaits_comparison(&self) -> bool {
        self.promise.is_some()
    }

    /// Records what the last plan achieved in a sweep after it: the largest load of the ranks with the units where they
    /// are, and the largest load if the units of the plan were on the other rank, where they would be if the plan had been
    /// carried out or, respectively, declined.
    pub fn compare(&mut self, here: f64, elsewhere: f64) {
        let Some(Promise { saving, is_carried_out }) = self.promise.take() else { return };
        let [without, with] = if is_carried_out { [elsewhere, here] } else { [here, elsewhere] };
        if without > 0.0 {
            self.savings.measure(saving, 1.0 - with / without);
        }
    }

    /// Estimates what a plan gains and costs, from the duration of the last sweep on the slowest rank. The gain is what the
    /// plan promises times the fraction that former plans achieved of theirs, negative if they made the largest load
    /// larger. The cost is that of the migration, and of the exchange that becomes longer in the sweeps of the horizon; the
    /// time of planning is spent already.
    ///
    /// # Errors
    /// Returns [`BalanceError`] if the plan does not fit the loads.
    pub fn estimate(&self, loads: &Loads, plan: &MigrationPlan) -> Result<Estimate, BalanceError> {
        let loads_after = loads.after(plan)?;
        let (after, neighbors) = (loads_after.max_over_mean(), loads.most_neighbors() as f64);
        let more_neighbors = loads_after.most_neighbors() as f64 - neighbors;
        let promised = self.saving(1.0 - after / loads.max_over_mean());
        // A plan that promises a loss is not expected to gain because former plans failed.
        let gain = if promised > 0.0 { self.savings.achieved() * promised } else { promised };
        let longer_exchange = self.params.horizon * self.exchange.growth(neighbors, more_neighbors);
        let cost = self.cost.seconds(plan.bytes(loads)) + longer_exchange;
        Ok(Estimate { gain, cost, max_over_mean: after, more_neighbors })
    }

    /// Returns the [estimate](Self::estimate) of a plan that moves units and [pays](Estimate::pays) or need not pay
    /// ([`TriggerParams::always`]), which is then to be carried out. `None` declines the plan. `seconds` is the time that
    /// planning took.
    ///
    /// # Errors
    /// Returns [`BalanceError`] if the plan does not fit the loads.
    pub fn accept(
        &mut self,
        loads: &Loads,
        plan: &MigrationPlan,
        seconds: f64,
    ) -> Result<Option<Estimate>, BalanceError> {
        let estimate = self.estimate(loads, plan)?;
        let saving = 1.0 - estimate.max_over_mean / loads.max_over_mean();
        let is_accepted = !plan.is_empty() && saving > 0.0 && (self.params.always || estimate.pays());
        let accepted = is_accepted.then_some(estimate);
        self.planning.measure(seconds, accepted.map_or(0.0, |estimate| estimate.gain - estimate.cost));
        self.promise = (saving > 0.0).then_some(Promise { saving, is_carried_out: accepted.is_some() });
        Ok(accepted)
    }

    /// Records a migration that was carried out, with the measured seconds that its phases took after the plan, and
    /// starts the cool-down.
    pub fn migrated(&mut self, loads: &Loads, plan: &MigrationPlan, estimate: &Estimate, seconds: f64) {
        self.cost.measure(plan.bytes(loads), seconds);
        self.exchange.changed(estimate.more_neighbors);
        self.cool_down = self.params.cool_down;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::coupling::balance::{Diffusive, Moves, Planner};

    #[test]
    fn a_migration_is_due_after_three_unbalanced_sweeps() {
        let mut trigger = Trigger::new(patient());
        let due =
            [1.4, 1.4, 1.2, 1.5, 1.35, 1.4, 1.4, 1.4, 1.4].map(|max_over_mean| observe(&mut trigger, max_over_mean));
        assert_eq!(due, [false, false, false, false, false, true, false, false, true]);
    }

    /// A sweep with this max/mean, in which the slowest rank takes a second.
    fn observe(trigger: &mut Trigger, max_over_mean: f64) -> bool {
        trigger.observe(1.0, 1.0 / max_over_mean)
    }

    fn patient() -> TriggerParams {
        TriggerParams { threshold: 1.35, sweeps: 3, cool_down: 3, ..TriggerParams::default() }
    }

    fn unbalanced() -> (Loads, MigrationPlan) {
        let loads = Loads::new(&[vec![1.0; 30], vec![1.0; 10]]).unwrap();
        let plan = Diffusive { tolerance: 1.0 }.plan(&loads).unwrap();
        (loads, plan)
    }

    #[test]
    fn sweeps_of_the_cool_down_do_not_count() {
        let (loads, plan) = unbalanced();
        let mut trigger = Trigger::new(TriggerParams { sweeps: 1, cool_down: 2, ..patient() });
        assert!(observe(&mut trigger, 1.5));
        let estimate = trigger.estimate(&loads, &plan).unwrap();
        trigger.migrated(&loads, &plan, &estimate, 0.1);
        assert_eq!([1.5, 1.5, 1.5].map(|value| observe(&mut trigger, value)), [false, false, true]);
    }

    #[test]
    fn a_plan_pays_if_the_sweeps_of_the_horizon_save_more_than_it_costs() {
        let (loads, plan) = unbalanced();
        let mut trigger = Trigger::new(TriggerParams { horizon: 6.0, ..TriggerParams::default() });
        // From 30 to 20: a third of six sweeps.
        trigger.observe(0.3, 0.2);
        let estimate = trigger.estimate(&loads, &plan).unwrap();
        assert!((estimate.gain - 0.6).abs() < 1e-12 && (estimate.cost - 0.01).abs() < 1e-9, "{estimate:?}");
        assert_eq!(trigger.accept(&loads, &plan, 0.0).unwrap(), Some(estimate));
        assert_eq!(trigger.accept(&loads, &MigrationPlan::new(2), 0.0).unwrap(), None, "nothing moves");
        trigger.observe(0.004, 0.0025);
        assert_eq!(trigger.accept(&loads, &plan, 0.0).unwrap(), None);
        // Migrations turn out to take a second.
        trigger.observe(0.3, 0.2);
        (0..6).for_each(|_| trigger.migrated(&loads, &plan, &estimate, 1.0));
        assert_eq!(trigger.accept(&loads, &plan, 0.0).unwrap(), None);
        // A plan that raises the largest load is never carried out.
        let mut worse = MigrationPlan::new(2);
        worse.set(1, Moves::default().with(&[0, 1], 0));
        let mut trigger = Trigger::new(TriggerParams { always: true, ..TriggerParams::default() });
        assert_eq!(trigger.accept(&loads, &worse, 0.0).unwrap(), None);
        assert!(trigger.observe(1e-9, 2e-9 / 3.0) && trigger.accept(&loads, &plan, 1.0).unwrap().is_some());
        assert_eq!(trigger.accept(&loads, &MigrationPlan::new(2), 0.0).unwrap(), None, "nothing moves");
    }

    #[test]
    fn planning_that_costs_more_than_it_may_save_is_left_out() {
        let (loads, plan) = unbalanced();
        let mut trigger = Trigger::new(TriggerParams::default());
        // Ten sweeps of a millisecond that are a third too long: at most 3.3 ms.
        let short = |trigger: &mut Trigger| trigger.observe(1e-3, 2e-3 / 3.0);
        assert!(short(&mut trigger), "the cost of planning is not known yet");
        assert_eq!(trigger.accept(&loads, &plan, 4e-3).unwrap(), None);
        assert!((0..100).all(|_| !short(&mut trigger)));
        assert!(trigger.observe(1e-2, 2e-2 / 3.0), "longer sweeps save more");
    }

    #[test]
    fn plans_that_are_always_declined_become_rare() {
        let (loads, nothing) = (unbalanced().0, MigrationPlan::new(2));
        let mut trigger = Trigger::new(TriggerParams::default());
        let mut plans = 0;
        // A plan may save 3.3 s, and costs 0.1 s.
        for _ in 0..200 {
            if trigger.observe(1.0, 2.0 / 3.0) {
                plans += 1;
                assert_eq!(trigger.accept(&loads, &nothing, 0.1).unwrap(), None);
            }
        }
        assert!((10..40).contains(&plans), "{plans}");
    }

    /// One partner exchanges with one rank, and with two after the plan.
    #[test]
    fn a_longer_exchange_is_part_of_the_cost() {
        let loads = Loads::new(&[vec![1.0; 30], vec![]]).unwrap().with_partners(vec![0; 30]).unwrap();
        let plan = Diffusive { tolerance: 1.0 }.plan(&loads).unwrap();
        let longer_after_a_migration = {
            let mut trigger = Trigger::new(TriggerParams::default());
            let estimate = trigger.estimate(&loads, &plan).unwrap();
            trigger.migrated(&loads, &plan, &estimate, 0.01);
            trigger.observe_exchange(0.5);
            (trigger.estimate(&loads, &plan).unwrap().cost - 0.01) / 10.0
        };
        assert!((longer_after_a_migration - 0.5).abs() < 1e-3, "no exchange before the migration is known");
        let mut trigger = Trigger::new(TriggerParams::default());
        let longer = |trigger: &Trigger| (trigger.estimate(&loads, &plan).unwrap().cost - 0.01) / 10.0;
        assert!(longer(&trigger).abs() < 1e-12, "the exchange is not measured");
        trigger.observe_exchange(0.5);
        assert!((longer(&trigger) - 0.5).abs() < 1e-12, "twice as long with twice the messages");
        let estimate = trigger.estimate(&loads, &plan).unwrap();
        assert_eq!(estimate.more_neighbors, 1.0);
        trigger.migrated(&loads, &plan, &estimate, 0.01);
        trigger.observe_exchange(0.6);
        assert!((longer(&trigger) - 0.1).abs() < 1e-3, "as measured: {}", longer(&trigger));
    }

    /// A plan promises a third of the largest load.
    #[test]
    fn plans_are_worth_what_former_ones_achieved() {
        let (loads, plan) = unbalanced();
        let mut trigger = Trigger::new(TriggerParams::default());
        let gain = |trigger: &Trigger| trigger.estimate(&loads, &plan).unwrap().gain;
        observe(&mut trigger, 1.5);
        assert!((gain(&trigger) - 10.0 / 3.0).abs() < 1e-12 && !trigger.awaits_comparison());
        // Carried out, but the largest load would have been as low without the plan, although max/mean declines.
        let estimate = trigger.accept(&loads, &plan, 0.0).unwrap().unwrap();
        assert!(trigger.awaits_comparison());
        trigger.migrated(&loads, &plan, &estimate, 0.0);
        observe(&mut trigger, 1.1);
        trigger.compare(20.0, 20.0);
        observe(&mut trigger, 1.5);
        assert!((gain(&trigger) - 0.8 / 1.8 * 10.0 / 3.0).abs() < 1e-12 && !trigger.awaits_comparison());
        // Plans that make the largest load larger are declined, and compared nevertheless.
        let declined = (0..20).find(|_| {
            let accepted = trigger.accept(&loads, &plan, 0.0).unwrap().is_some();
            if accepted {
                trigger.compare(25.0, 20.0)
            } else {
                trigger.compare(20.0, 25.0)
            }
            !accepted
        });
        assert!(declined.is_some() && gain(&trigger) < 0.0, "{}", gain(&trigger));
        let accepted = (0..20).find(|_| {
            let accepted = trigger.accept(&loads, &plan, 0.0).unwrap().is_some();
            if !accepted {
                trigger.compare(30.0, 20.0);
            }
            accepted
        });
        assert!(accepted.is_some(), "it learns from declined plans that costs persist again");
    }
}
