//! When to balance.

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

/// The weight of former measurements relative to the next one.
const FORGETTING: f64 = 0.5;

/// As `FORGETTING`, for quantities that compare two sweeps: one comparison says little if costs are random.
const MEMORY: f64 = 0.8;

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
    /// ([`TriggerParams::always`]), which is then to be carried out. `None` declines the plan. `seconds` is the time that planning took.
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
        self.exchange.more_neighbors += estimate.more_neighbors;
        self.cool_down = self.params.cool_down;
    }
}

/// How the seconds of the exchange with other scales depend on the number of ranks that the busiest of their ranks
/// exchanges with: in proportion, until a migration shows how much of the exchange the messages are.
#[derive(Clone, Debug, Default)]
struct ExchangeGrowth {
    /// Seconds of the exchange, a mean that forgets, since the last migration.
    seconds: Option<f64>,
    /// By how many the neighbors have become more since the last exchange.
    more_neighbors: f64,
    /// Squares of the numbers by which former migrations changed the neighbors, and products with the changes of the
    /// seconds: sums that forget.
    squares: f64,
    products: f64,
}

impl ExchangeGrowth {
    fn observe(&mut self, seconds: f64) {
        let more = std::mem::take(&mut self.more_neighbors);
        // A migration before the first exchange shows nothing.
        let Some(before) = self.seconds else {
            self.seconds = Some(seconds);
            return;
        };
        if more == 0.0 {
            self.seconds = Some(FORGETTING * before + (1.0 - FORGETTING) * seconds);
            return;
        }
        self.squares = MEMORY * self.squares + more * more;
        self.products = MEMORY * self.products + more * (seconds - before);
        self.seconds = Some(seconds);
    }

    /// By how many seconds the exchange becomes longer with `more` neighbors.
    fn growth(&self, neighbors: f64, more: f64) -> f64 {
        let per_neighbor = match self.seconds {
            _ if self.squares > 0.0 => (self.products / self.squares).max(0.0),
            Some(seconds) if neighbors > 0.0 => seconds / neighbors,
            _ => 0.0,
        };
        per_neighbor * more.max(0.0)
    }
}

/// The savings that former plans promised, and those that they achieved, as fractions of the largest load: sums that
/// forget.
#[derive(Clone, Debug, Default)]
struct Savings {
    promised: f64,
    achieved: f64,
}

impl Savings {
    fn measure(&mut self, promised: f64, achieved: f64) {
        if self.promised == 0.0 {
            // Before the first comparison, plans are expected to achieve what they promise.
            (self.promised, self.achieved) = (promised, promised);
        }
        self.promised = MEMORY * self.promised + promised;
        self.achieved = MEMORY * self.achieved + achieved;
    }

    /// The fraction of the promised savings that was achieved, from -1 to 1.
    fn achieved(&self) -> f64 {
        if self.promised > 0.0 { (self.achieved / self.promised).clamp(-1.0, 1.0) } else { 1.0 }
    }
}

/// What planning costs, and what it is worth.
#[derive(Clone, Debug)]
struct Planning {
    /// Seconds, a mean that forgets; zero until a plan is measured.
    seconds: f64,
    /// The fraction of the largest possible savings by which former plans were better than none.
    worth: f64,
    /// The largest possible saving of the next plan, s.
    possible: f64,
}

impl Default for Planning {
    fn default() -> Self {
        Self { seconds: 0.0, worth: 1.0, possible: 0.0 }
    }
}

impl Planning {
    /// Returns true if a plan that may save up to `possible` seconds is expected to save what it costs to make.
    fn pays(&mut self, possible: f64) -> bool {
        self.possible = possible;
        let pays = self.worth * possible >= self.seconds;
        if !pays {
            self.worth = (1.1 * self.worth).min(1.0);
        }
        pays
    }

    /// Records the seconds of a plan, and by how many it is expected to shorten the run.
    fn measure(&mut self, seconds: f64, saved: f64) {
        /// A plan always pays if it takes less than this part of the largest possible saving.
        const LEAST: f64 = 1e-3;
        let former = if self.seconds > 0.0 { self.seconds } else { seconds };
        self.seconds = FORGETTING * former + (1.0 - FORGETTING) * seconds;
        let worth = if self.possible > 0.0 { (saved / self.possible).clamp(0.0, 1.0) } else { 0.0 };
        self.worth = (FORGETTING * self.worth + (1.0 - FORGETTING) * worth).max(LEAST);
    }
}

/// Seconds per migration and per byte: the line of least squares through the measurements and two points of the first
/// estimate.
#[derive(Clone, Debug)]
struct MigrationCost {
    /// Weighted sums of 1, bytes, squared bytes, seconds, and bytes times seconds.
    sums: [f64; 5],
}

impl MigrationCost {
    fn new(per_migration: f64, per_byte: f64) -> Self {
        /// The size for which the first estimate is as certain as for no bytes.
        const BYTES: f64 = 1e6;
        let mut cost = Self { sums: [0.0; 5] };
        cost.add(0.0, per_migration);
        cost.add(BYTES, per_migration + per_byte * BYTES);
        cost
    }

    fn add(&mut self, bytes: f64, seconds: f64) {
        let terms = [1.0, bytes, bytes * bytes, seconds, bytes * seconds];
        self.sums.iter_mut().zip(terms).for_each(|(sum, term)| *sum += term);
    }

    fn measure(&mut self, bytes: u64, seconds: f64) {
        self.sums.iter_mut().for_each(|sum| *sum *= FORGETTING);
        self.add(bytes as f64, seconds);
    }

    fn seconds(&self, bytes: u64) -> f64 {
        let [count, x, xx, y, xy] = self.sums;
        let spread = count * xx - x * x;
        let per_byte = if spread > 1e-9 * count * xx { ((count * xy - x * y) / spread).max(0.0) } else { 0.0 };
        let per_migration = (y - per_byte * x) / count;
        if per_migration < 0.0 { xy / xx * bytes as f64 } else { per_migration + per_byte * bytes as f64 }
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

    #[test]
    fn seconds_per_byte_are_measured() {
        let mut cost = MigrationCost::new(0.01, 2e-9);
        assert!((cost.seconds(1_000_000_000) - 2.01).abs() < 1e-6);
        for bytes in [1_000_000, 5_000_000, 2_000_000, 9_000_000, 3_000_000, 7_000_000, 4_000_000, 1_000_000_u64] {
            cost.measure(bytes, 0.5 + 1e-7 * bytes as f64);
        }
        assert!((cost.seconds(6_000_000) - 1.1).abs() < 0.05, "{}", cost.seconds(6_000_000));
        let mut falling = MigrationCost::new(0.0, 0.0);
        (0..40).for_each(|k| falling.measure(1000 * (1 + k % 2), (2 - k % 2) as f64));
        assert!((1.0..=2.0).contains(&falling.seconds(10_000)), "never less for more bytes");
    }
}
