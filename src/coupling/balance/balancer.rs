//! Load balancing during a run: from the measured seconds of a sweep to a migration.

use std::collections::BTreeMap;
use std::time::Instant;

use super::error::BalanceError;
use super::loads::{Loads, UnitLoads};
use super::plan::{MigrationPlan, Moves};
use super::planner::{Planner, plan_units};
use super::trigger::{Estimate, Trigger, TriggerParams};
use super::weights::{Cost, CostHistory, check_count};
use crate::las::{Comm, Message, SendRequest, Tag};

/// Decides when the units of one scale move, by a [`Trigger`] that gets the times of the slowest rank: all ranks decide
/// equally. The caller moves the units ([`migrate`](super::migrate)) and updates their couplings.
///
/// # Example: cells some of which cost more, for one sweep after the other
///
/// The histories are data of the cells: they move with them.
///
/// ```
/// use std::time::Instant;
/// use biotissue::coupling::balance::{
///     Balancer, Cost, CostHistory, LongestFirst, Seconds, TriggerParams, UnitLoads, Weights, migrate, record,
/// };
/// use biotissue::coupling::{Comm, Message, thread};
///
/// let counts = thread::run(2, |cells| -> Result<usize, Box<dyn std::error::Error>> {
///     // The cells 0 to 3 of the first rank cost 3 s each, the cells 4 to 7 of the second one 1 s.
///     let first = 4 * cells.rank() as u64;
///     let mut units: Vec<u64> = (first..first + 4).collect();
///     let mut histories = vec![CostHistory::new(0); units.len()];
///     let (mut weights, mut balancer) = (Seconds, Balancer::new(TriggerParams::default()));
///     for _sweep in 0..3 {
///         // A code measures these.
///         let costs: Vec<Cost> = units
///             .iter()
///             .map(|&unit| Cost { seconds: if unit < 4 { 3.0 } else { 1.0 }, ..Cost::default() })
///             .collect();
///         let seconds = costs.iter().map(|cost| cost.seconds).sum();
///         record(&cells, &mut weights, &mut histories, &costs)?;
///         balancer.observe(&cells, seconds, &mut histories, &costs)?;
///         if !balancer.is_due() {
///             continue;
///         }
///         let expected: Vec<f64> = histories.iter().map(|history| weights.weight(history)).collect();
///         let own = UnitLoads { weights: &expected, ..UnitLoads::default() };
///         let Some(due) = balancer.plan(&cells, &LongestFirst::default(), own, &mut histories)? else { continue };
///         let start = Instant::now();
///         let moves = due.moves(cells.rank());
///         let (migration, arrived) = migrate(&cells, moves, &units, |cell| {
///             Message::join(vec![Message::of(&[units[cell]]), Message::of(&[histories[cell]])])
///         })?;
///         let (mut new_units, mut new_histories) = (Vec::new(), Vec::new());
///         for cell in &arrived {
///             let parts = cell.split().ok_or("a cell has another form")?;
///             new_units.extend_from_slice(Message::of(parts[0]).values::<u64>().ok_or("no number")?);
///             new_histories.extend_from_slice(Message::of(parts[1]).values::<CostHistory>().ok_or("no history")?);
///         }
///         units = migration.apply(units, new_units)?;
///         histories = migration.apply(histories, new_histories)?;
///         histories.iter_mut().for_each(CostHistory::restart);
///         // Here, update every coupling of the cells: `coupling.migrate(&migration)`.
///         balancer.migrated(&cells, &due, start.elapsed().as_secs_f64())?;
///     }
///     Ok(units.iter().filter(|&&unit| unit < 4).count())
/// })?;
/// assert_eq!(counts, [2, 2]); // each rank has two of the expensive cells
/// # Ok::<(), thread::Failed>(())
/// ```
#[derive(Clone, Debug)]
pub struct Balancer {
    trigger: Trigger,
    is_due: bool,
    /// The last plan, until it is compared.
    links: Links,
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
        Self { trigger: Trigger::new(params), is_due: false, links: Links::default() }
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
        check_count(scale, histories.len(), costs.len(), "costs")?;
        if self.trigger.awaits_comparison() {
            let [here, elsewhere] = std::mem::take(&mut self.links).largest_loads(scale, histories, costs)?;
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

    /// Plans a migration of units, as [`plan_units`] does, and measures how long that takes; `None` if it does not pay. Marks
    /// the units of the plan in their histories, which must migrate with them. Collective over the scale.
    ///
    /// # Errors
    /// Returns [`BalanceError`] if the arguments or the plan are invalid, the histories are not as many as the weights, or the
    /// communication fails.
    pub fn plan<C: Comm>(
        &mut self,
        scale: &C,
        planner: &(impl Planner + ?Sized),
        own: UnitLoads<'_>,
        histories: &mut [CostHistory],
    ) -> Result<Option<DueMigration>, BalanceError> {
        check_count(scale, own.weights.len(), histories.len(), "histories")?;
        let start = Instant::now();
        self.is_due = false;
        let (loads, plan) = plan_units(scale, planner, own)?;
        let seconds = slowest(scale, start.elapsed().as_secs_f64())?;
        let accepted = self.trigger.accept(&loads, &plan, seconds)?;
        self.links = Links::of_plan(&plan, scale.rank(), accepted.is_some());
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

/// The ranks on which marked units of this rank would otherwise be, and those that have units which would be here.
#[derive(Clone, Debug, Default)]
struct Links {
    others: Vec<usize>,
    from: Vec<usize>,
}

impl Links {
    fn of_plan(plan: &MigrationPlan, rank: usize, is_carried_out: bool) -> Self {
        let targets = plan.of(rank).iter().map(|(to, _)| to).collect();
        let moves_here = |from: &usize| plan.of(*from).iter().any(|(to, _)| to == rank);
        let origins = (0..plan.ranks()).filter(moves_here).collect();
        if is_carried_out { Self { others: origins, from: targets } } else { Self { others: targets, from: origins } }
    }

    /// Returns the seconds of the most loaded rank, and those that it would have if all marked units were on the other
    /// rank. Collective.
    fn largest_loads<C: Comm>(
        self,
        scale: &C,
        histories: &mut [CostHistory],
        costs: &[Cost],
    ) -> Result<[f64; 2], BalanceError> {
        let (mut here, mut stays, mut of_others) = (0.0, 0.0, BTreeMap::new());
        for (history, cost) in histories.iter_mut().zip(costs) {
            here += cost.seconds;
            match history.take_other_rank() {
                Some(rank) => *of_others.entry(rank).or_insert(0.0) += cost.seconds,
                None => stays += cost.seconds,
            }
        }
        let message = |rank: &usize| Message::of(&[of_others.get(rank).copied().unwrap_or(0.0)]);
        let sendings = self.others.iter().map(|rank| scale.start_send(*rank, Tag::MIGRATION, message(rank)));
        let sendings: Vec<_> = sendings.collect::<Result<_, _>>()?;
        for from in self.from {
            let seconds = scale.receive(from, Tag::MIGRATION)?;
            stays += seconds.values::<f64>().and_then(<[f64]>::first).copied().unwrap_or(0.0);
        }
        sendings.into_iter().try_for_each(|sending| sending.wait().map(drop))?;
        let mut largest = [here, stays];
        scale.max(&mut largest)?;
        Ok(largest)
    }
}

/// Returns the seconds of the slowest rank. Collective.
fn slowest<C: Comm>(scale: &C, seconds: f64) -> Result<f64, BalanceError> {
    let mut slowest = [seconds];
    scale.max(&mut slowest)?;
    Ok(slowest[0])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::coupling::balance::{Migration, migrate};
    use crate::coupling::thread;

    /// Rank 0 has units of 1, 2 and 4 s, rank 1 one of 8 s, rank 2 none. The unit of 4 s moves from rank 0 to rank 2, and
    /// that of 8 s from rank 1 to rank 0.
    #[test]
    fn loads_are_compared_with_those_where_the_plan_is_declined_or_carried_out() {
        let seconds = [&[1.0, 2.0, 4.0][..], &[8.0], &[]];
        let mut plan = MigrationPlan::new(3);
        plan.set(0, Moves::default().with(&[2], 2));
        plan.set(1, Moves::default().with(&[0], 0));
        let compared = thread::run(3, |comm| {
            let rank = comm.rank();
            let cost = |&seconds: &f64| Cost { seconds, ..Cost::default() };
            let costs: Vec<Cost> = seconds[rank].iter().map(cost).collect();
            let mut histories = vec![CostHistory::default(); costs.len()];
            mark(&mut histories, plan.of(rank), None);
            let declined = Links::of_plan(&plan, rank, false).largest_loads(&comm, &mut histories, &costs)?;
            assert!(histories.iter_mut().all(|history| history.take_other_rank().is_none()), "marks are used once");

            mark(&mut histories, plan.of(rank), Some(rank));
            let names: Vec<u64> = (0..costs.len() as u64).collect();
            let pack = |at: usize| Message::of(&[histories[at]]);
            let (migration, arrived) = migrate(&comm, plan.of(rank), &names, pack)?;
            let arrived = arrived.iter().filter_map(|message| message.values::<CostHistory>()).flatten().copied();
            let mut histories = migration.apply(histories.clone(), arrived.collect())?;
            let moved = |costs: &[f64], migration: &Migration| {
                let from = migration.arrived().iter().map(|origin| cost(&seconds[origin.rank][origin.index as usize]));
                migration.apply(costs.iter().map(cost).collect(), from.collect())
            };
            let costs = moved(seconds[rank], &migration)?;
            let carried_out = Links::of_plan(&plan, rank, true).largest_loads(&comm, &mut histories, &costs)?;
            Ok::<_, BalanceError>([declined, carried_out])
        });
        // 7, 8 and 0 s where they are; 11, 0 and 4 s after the plan.
        assert_eq!(compared.unwrap(), [[[8.0, 11.0], [11.0, 8.0]]; 3]);
    }
}
