//! Contiguous intervals of the sequence of all units.

use super::super::error::BalanceError;
use super::super::loads::Loads;
use super::super::plan::MigrationPlan;
use super::{Planner, plan_if_better};

/// Keeps the order of the units over the ranks: each rank gets an interval of the sequence of all units, so that units
/// move along the sequence and a rank keeps few neighbors in other scales. This is the greedy plan of table 4.3 of the
/// reference text. The largest load is the least that intervals allow, to 1e-4 of the mean; within this limit, the
/// intervals end as near as possible to equal shares of the total weight. Cost: O(n + p log n) for n units on p ranks.
///
/// A rank may get no unit, also where another plan with the same largest load would give it one: a unit heavier than two
/// mean loads takes the shares of its neighbors. The weights 5, 5, 1, 1 and 1 on four ranks become (5), (), (5), (1, 1, 1).
///
/// Reference: A. Pınar, C. Aykanat, *Fast optimal load balancing algorithms for 1D partitioning*, Journal of Parallel
/// and Distributed Computing 64 (2004), 974-996.
#[derive(Clone, Copy, Debug, Default)]
pub struct Greedy;

impl Planner for Greedy {
    fn plan(&self, loads: &Loads) -> Result<MigrationPlan, BalanceError> {
        let sequence = Sequence::new(loads.weights());
        let (ranks, total) = (loads.ranks(), sequence.total());
        if total <= 0.0 {
            return Ok(MigrationPlan::new(ranks));
        }
        let limit = sequence.least_limit(ranks, loads.max_over_mean() * total / ranks as f64);
        let ends = sequence.ends(ranks, limit);
        let mut targets = Vec::with_capacity(loads.units());
        for (rank, end) in (0_u32..).zip(ends) {
            targets.resize(end.max(targets.len()), rank);
        }
        plan_if_better(loads, &targets)
    }
}

/// The sequence of all units, by the sums of their weights.
struct Sequence {
    /// The weight of all units before each unit, and of all units.
    sums: Vec<f64>,
    largest: f64,
}

impl Sequence {
    fn new(weights: &[f64]) -> Self {
        let mut sum = 0.0;
        let add = |weight: &f64| {
            sum += weight;
            sum
        };
        let sums = [0.0].into_iter().chain(weights.iter().map(add)).collect();
        Self { sums, largest: weights.iter().copied().fold(0.0, f64::max) }
    }

    fn total(&self) -> f64 {
        self.sums.last().copied().unwrap_or(0.0)
    }

    /// Returns the end of the longest interval from `start` whose weight is at most `limit`.
    fn reach(&self, start: usize, limit: f64) -> usize {
        let most = self.sums[start] + limit;
        (start + self.sums[start..].partition_point(|&sum| sum <= most)).saturating_sub(1)
    }

    /// Returns the least limit, to 1e-4 of the mean, below which `ranks` intervals can stay; `present` is feasible.
    fn least_limit(&self, ranks: usize, present: f64) -> f64 {
        let mean = self.total() / ranks as f64;
        let is_feasible = |limit: f64| {
            let end = (0..ranks).try_fold(0, |start, _| {
                let end = self.reach(start, limit);
                if end + 1 == self.sums.len() { Err(()) } else { Ok(end) }
            });
            end.is_err()
        };
        // Rounding errors of the sums must not make the interval of one unit too heavy.
        let slack = 1.0 + 1e-12;
        let (mut below, mut limit) = (mean.max(self.largest), (mean + self.largest).min(present) * slack);
        if is_feasible(below * slack) {
            return below * slack;
        }
        while limit - below > 1e-4 * mean {
            let middle = 0.5 * (below + limit);
            if is_feasible(middle) { limit = middle } else { below = middle }
        }
        limit
    }

    /// Returns the ends of the intervals, of at most `limit` each.
    fn ends(&self, ranks: usize, limit: f64) -> Vec<usize> {
        let units = self.sums.len() - 1;
        // The first end of each interval at which the others can take the rest.
        let mut first = vec![units; ranks];
        for rank in (0..ranks.saturating_sub(1)).rev() {
            let end = first[rank + 1];
            first[rank] = self.sums[..=end].partition_point(|&sum| sum < self.sums[end] - limit);
        }
        let mut start = 0;
        let end = |rank: usize| {
            let share = self.total() * (rank + 1) as f64 / ranks as f64;
            let above = self.sums.partition_point(|&sum| sum < share).min(units);
            let is_nearer_below = above > 0 && share - self.sums[above - 1] <= self.sums[above] - share;
            let nearest = if is_nearer_below { above - 1 } else { above };
            let last = self.reach(start, limit).max(start);
            start = nearest.max(first[rank]).max(start).min(last);
            if rank + 1 == ranks {
                start = units;
            }
            start
        };
        (0..ranks).map(end).collect()
    }
}
