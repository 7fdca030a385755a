//! Longest processing time first.

use std::cmp::Reverse;
use std::collections::BinaryHeap;

use super::super::error::BalanceError;
use super::super::loads::Loads;
use super::super::plan::MigrationPlan;
use super::{Load, Planner, plan_if_better};

/// Assigns the units, heaviest first, to the rank that has the least load so far (longest processing time first, LPT).
/// The largest load is at most 4/3 of the least possible one, plus `stay`. Cost: O(n log n) for n units.
///
/// Reference: R. L. Graham, *Bounds on multiprocessing timing anomalies*, SIAM Journal on Applied Mathematics 17
/// (1969), 416-429.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LongestFirst {
    /// A unit stays on its rank if the load of this rank exceeds the least one by at most this fraction of the mean. At
    /// zero, only equal loads keep a unit, and nearly all units move.
    pub stay: f64,
}

impl Default for LongestFirst {
    fn default() -> Self {
        Self { stay: 0.02 }
    }
}

impl Planner for LongestFirst {
    fn plan(&self, loads: &Loads) -> Result<MigrationPlan, BalanceError> {
        let (weights, rank_of) = (loads.weights(), loads.rank_of_units());
        let mut order: Vec<u32> = (0..weights.len() as u32).collect();
        // The sort is stable: units of equal weight keep their order.
        order.sort_by(|&a, &b| weights[b as usize].total_cmp(&weights[a as usize]));
        let stay = self.stay * loads.total() / loads.ranks().max(1) as f64;
        let mut sums = vec![0.0; loads.ranks()];
        // An entry is outdated if the rank has got units since.
        let mut least: BinaryHeap<Reverse<(Load, u32)>> =
            (0..loads.ranks() as u32).map(|rank| Reverse((Load(0.0), rank))).collect();
        let mut targets = rank_of.clone();
        for unit in order {
            while least.peek().is_some_and(|Reverse((load, rank))| load.0 < sums[*rank as usize]) {
                least.pop();
            }
            let Some(&Reverse((Load(minimum), rank))) = least.peek() else { break };
            let present = rank_of[unit as usize];
            let to = if sums[present as usize] <= minimum + stay { present } else { rank };
            targets[unit as usize] = to;
            sums[to as usize] += weights[unit as usize];
            least.push(Reverse((Load(sums[to as usize]), to)));
        }
        plan_if_better(loads, &targets)
    }
}
