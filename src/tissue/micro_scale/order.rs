//! The order in which the threads of a rank take its RVEs: the longest first, so that no thread starts a long one when the
//! others are done. Results do not depend on it.

use super::units::Units;
use crate::coupling::balance::{CostHistory, Weights};
use crate::las::RealBackend;
use crate::parallel;

/// What the RVEs of a rank are expected to cost in the next sweep. A new RVE comes before all others.
#[derive(Debug)]
pub(super) struct Order {
    /// The seconds of each RVE, if there are several threads.
    seconds: Option<Vec<f64>>,
    /// A measure of the iterations of each RVE.
    iterations: Vec<f64>,
}

impl<B: RealBackend> Units<B> {
    /// Returns the expected costs of all RVEs. Their seconds are those of the predictor of this rank, which learns from
    /// what its own RVEs cost, without communication.
    pub(super) fn expected_order(&self) -> Order {
        let or_new = |history: &CostHistory, expected: f64| if history.sweeps == 0 { f64::INFINITY } else { expected };
        let seconds = |history| or_new(history, self.predictor.weight(history));
        let iterations = |history: &CostHistory| or_new(history, history.smooth_iterations);
        Order {
            seconds: (parallel::threads() > 1).then(|| self.histories.iter().map(seconds).collect()),
            iterations: self.histories.iter().map(iterations).collect(),
        }
    }

    /// Learns what RVEs cost from the last [`Units::solve`], which the histories do not contain yet. A single thread does
    /// without seconds.
    pub fn learn_costs(&mut self) {
        if parallel::threads() > 1 {
            self.predictor.learn(&self.histories, &self.costs);
            let sums = self.predictor.take_sums();
            self.predictor.add_sums(&sums);
        }
    }
}

impl Order {
    /// Returns the numbers of all RVEs, those with the most seconds first.
    pub fn longest_first(&self) -> Vec<usize> {
        let mut order: Vec<usize> = (0..self.iterations.len()).collect();
        if let Some(seconds) = &self.seconds {
            order.sort_by(|&a, &b| seconds[b].total_cmp(&seconds[a]));
        }
        order
    }

    /// Sorts RVEs, given by `number`, by their iterations, the most first: vector lanes wait for those of their group that
    /// take more iterations.
    pub fn by_iterations<T>(&self, rves: &mut [T], number: impl Fn(&T) -> usize) {
        let iterations = |rve: &T| self.iterations[number(rve)];
        rves.sort_by(|a, b| iterations(b).total_cmp(&iterations(a)));
    }

    /// Returns the sum of the seconds of RVEs; zero on a single thread.
    pub fn seconds_of(&self, numbers: impl Iterator<Item = usize>) -> f64 {
        self.seconds.as_ref().map_or(0.0, |seconds| numbers.map(|number| seconds[number]).sum())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rves_are_ordered_by_what_they_are_expected_to_cost() {
        let mut order =
            Order { seconds: Some(vec![1.0, 3.0, f64::INFINITY, 2.0]), iterations: vec![4.0, 1.0, 2.0, 3.0] };
        assert_eq!(order.longest_first(), [2, 1, 3, 0]);
        let mut rves = [3, 2, 1, 0];
        order.by_iterations(&mut rves, |&number| number);
        assert_eq!(rves, [0, 3, 2, 1]);
        assert_eq!(order.seconds_of([0, 3].into_iter()), 3.0);
        order.seconds = None;
        assert_eq!((order.longest_first(), order.seconds_of([0].into_iter())), (vec![0, 1, 2, 3], 0.0));
    }
}
