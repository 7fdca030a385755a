//! Least movement: from overloaded to underloaded ranks only.

use std::cmp::Reverse;
use std::collections::{BTreeSet, BinaryHeap, HashMap};

use super::super::error::BalanceError;
use super::super::loads::Loads;
use super::super::plan::MigrationPlan;
use super::{Load, Planner, plan_if_better};

/// Moves as few units as possible: each step takes a unit of the most loaded rank to the least loaded one, namely the
/// heaviest unit that leaves the one above the mean and the other below, or else the lightest. Ends as soon as max/mean
/// is below the tolerance, or no such step lowers the largest load, which is therefore never higher than at present.
/// Cost: O(n + p + m log n) for n units on p ranks, of which m are on overloaded ranks.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Diffusive {
    /// The value of max/mean that suffices.
    pub tolerance: f64,
}

impl Default for Diffusive {
    fn default() -> Self {
        Self { tolerance: 1.02 }
    }
}

impl Planner for Diffusive {
    fn plan(&self, loads: &Loads) -> Result<MigrationPlan, BalanceError> {
        let mut targets = loads.rank_of_units();
        self.refine(loads.weights(), loads.ranks(), &mut targets);
        plan_if_better(loads, &targets)
    }
}

impl Diffusive {
    /// Improves the assignment of units to ranks.
    pub(super) fn refine(&self, weights: &[f64], ranks: usize, targets: &mut [u32]) {
        let mut state = State::new(weights, ranks, targets);
        let mean = state.sums.iter().sum::<f64>() / ranks.max(1) as f64;
        while let (Some(from), Some(to)) = (state.most_loaded(), state.least_loaded()) {
            let (most, least) = (state.sums[from], state.sums[to]);
            if most <= self.tolerance * mean {
                break;
            }
            let fitting = (most - mean).min(mean - least).max(0.0);
            let Some(unit) = state.take_unit(from, fitting, most - least) else { break };
            targets[unit as usize] = to as u32;
            state.add(from, -weights[unit as usize]);
            state.add(to, weights[unit as usize]);
        }
    }
}

/// The loads of the ranks while units move, and the units that have not moved yet.
struct State<'a> {
    weights: &'a [f64],
    sums: Vec<f64>,
    /// The ranks by load. An entry is outdated if the load of the rank has changed since.
    most: BinaryHeap<(Load, Reverse<u32>)>,
    least: BinaryHeap<Reverse<(Load, u32)>>,
    /// The units, one rank after the other, and the position of the first of each rank.
    units: Vec<u32>,
    offsets: Vec<usize>,
    /// The remaining units of the ranks from which units have moved, by weight.
    remaining: HashMap<usize, BTreeSet<(Load, Reverse<u32>)>>,
}

impl<'a> State<'a> {
    fn new(weights: &'a [f64], ranks: usize, rank_of: &[u32]) -> Self {
        let mut sums = vec![0.0; ranks];
        let mut offsets = vec![0; ranks + 1];
        for (weight, &rank) in weights.iter().zip(rank_of) {
            sums[rank as usize] += weight;
            offsets[rank as usize + 1] += 1;
        }
        (0..ranks).for_each(|rank| offsets[rank + 1] += offsets[rank]);
        let (mut units, mut next) = (vec![0; weights.len()], offsets.clone());
        for (unit, &rank) in (0_u32..).zip(rank_of) {
            units[next[rank as usize]] = unit;
            next[rank as usize] += 1;
        }
        let loads = || (0_u32..).zip(&sums).map(|(rank, &sum)| (Load(sum), rank));
        let most = loads().map(|(load, rank)| (load, Reverse(rank))).collect();
        let least = loads().map(Reverse).collect();
        Self { weights, sums, most, least, units, offsets, remaining: HashMap::new() }
    }

    fn most_loaded(&mut self) -> Option<usize> {
        while let Some(&(Load(load), Reverse(rank))) = self.most.peek() {
            if load == self.sums[rank as usize] {
                return Some(rank as usize);
            }
            self.most.pop();
        }
        None
    }

    fn least_loaded(&mut self) -> Option<usize> {
        while let Some(&Reverse((Load(load), rank))) = self.least.peek() {
            if load == self.sums[rank as usize] {
                return Some(rank as usize);
            }
            self.least.pop();
        }
        None
    }

    fn add(&mut self, rank: usize, weight: f64) {
        self.sums[rank] += weight;
        let (load, rank) = (Load(self.sums[rank]), rank as u32);
        self.most.push((load, Reverse(rank)));
        self.least.push(Reverse((load, rank)));
    }

    /// Takes from a rank the heaviest unit of at most `fitting`, or else the lightest one below `gap`; units without
    /// weight do not move.
    fn take_unit(&mut self, rank: usize, fitting: f64, gap: f64) -> Option<u32> {
        let (weights, own) = (self.weights, &self.units[self.offsets[rank]..self.offsets[rank + 1]]);
        let by_weight = || own.iter().map(|&unit| (Load(weights[unit as usize]), Reverse(unit))).collect();
        let units = self.remaining.entry(rank).or_insert_with(by_weight);
        let end = (Load(fitting), Reverse(0));
        let heaviest = units.range(..=end).next_back().filter(|(weight, _)| weight.0 > 0.0);
        // Weights far below the load would not change it.
        let lightest = || units.range(end..).find(|(weight, _)| weight.0 < gap && weight.0 > 0.0);
        let unit = *heaviest.or_else(lightest)?;
        units.remove(&unit);
        Some(unit.1.0)
    }
}
