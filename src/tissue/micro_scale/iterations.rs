//! How many Newton iterations the solves of RVEs took.

use serde::{Deserialize, Serialize};

/// Numbers of solves by their Newton iterations: each number up to 23 by itself, larger ones in ranges.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct IterationCounts([u32; 32]);

/// Numbers of iterations that are counted by themselves.
const EXACT: usize = 24;

/// The last number of iterations in each range.
const ENDS: [usize; 8] = [31, 47, 63, 95, 127, 191, 383, usize::MAX];

impl IterationCounts {
    /// The count of one solve.
    pub fn one(iterations: usize) -> Self {
        let mut one = Self::default();
        one.count(iterations);
        one
    }

    /// Counts a solve.
    pub fn count(&mut self, iterations: usize) {
        let range = if iterations < EXACT { iterations } else { EXACT + ENDS.partition_point(|&end| end < iterations) };
        self.0[range] = self.0[range].saturating_add(1);
    }

    /// Adds other counts.
    #[must_use]
    pub fn merge(mut self, other: Self) -> Self {
        self.0.iter_mut().zip(other.0).for_each(|(sum, other)| *sum = sum.saturating_add(other));
        self
    }

    /// Returns the number of iterations that this share of the solves did not exceed; of a range its end, but no more than
    /// `most`. `None` without solves.
    pub fn quantile(&self, share: f64, most: usize) -> Option<usize> {
        let solves: u64 = self.0.iter().map(|&count| u64::from(count)).sum();
        let needed = ((share * solves as f64).ceil() as u64).max(1);
        let mut sum = 0;
        let range = self.0.iter().position(|&count| {
            sum += u64::from(count);
            sum >= needed
        })?;
        Some(if range < EXACT { range } else { ENDS[range - EXACT].min(most) })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quantiles_are_exact_for_few_iterations() {
        let mut counts = IterationCounts::default();
        assert_eq!(counts.quantile(0.5, 0), None);
        (1..=20).for_each(|iterations| counts.count(iterations));
        assert_eq!([0.0, 0.5, 0.95, 1.0].map(|share| counts.quantile(share, 20)), [1, 10, 19, 20].map(Some));
        let many = [23, 24, 31, 32, 100, 5000].map(IterationCounts::one);
        assert_eq!(many.map(|one| one.quantile(0.5, 6000)), [23, 31, 31, 47, 127, 6000].map(Some));
        let sum = many.into_iter().fold(counts, IterationCounts::merge);
        assert_eq!(sum.quantile(1.0, 5000), Some(5000));
        assert_eq!(sum.quantile(0.5, 5000), Some(13));
    }
}
