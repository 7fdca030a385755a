//! Distribution of units over the ranks of the consumer.

use super::data::Distribution;

/// An algorithm that partitions units over the ranks of the consumer.
///
/// It keeps the order of units: those of one producer rank go to consecutive consumer ranks, so that each rank has few
/// neighbors.
pub trait Partitioner {
    /// Returns the consumer rank, below `consumers`, of each unit of producer rank `rank`, in the order of the units.
    fn partition(&self, distribution: &Distribution, rank: usize, consumers: usize) -> Vec<usize>;
}

/// Distributes units such that the numbers of units on all ranks, including those already held, differ by at most one
/// if possible. The first ranks receive the remainder. Units already distributed do not move.
#[derive(Clone, Copy, Debug, Default)]
pub struct EvenPartition;

impl Partitioner for EvenPartition {
    fn partition(&self, distribution: &Distribution, rank: usize, consumers: usize) -> Vec<usize> {
        let held: Vec<usize> = (0..consumers).map(|rank| distribution.held.get(rank).copied().unwrap_or(0)).collect();
        let shares = fill(&held, distribution.units());
        let to = shares.iter().enumerate().flat_map(|(rank, &share)| std::iter::repeat_n(rank, share));
        to.skip(distribution.offset(rank)).take(distribution.counts[rank]).collect()
    }
}

/// Returns the number of units for each rank such that the totals are as equal as possible.
fn fill(held: &[usize], units: usize) -> Vec<usize> {
    let below = |level: usize| held.iter().map(|&held| level.saturating_sub(held)).sum::<usize>();
    // Bisection for the highest level that the units can fill.
    let (mut level, mut beyond) = (0, held.iter().max().unwrap_or(&0) + units + 1);
    while beyond - level > 1 {
        let middle = level + (beyond - level) / 2;
        if below(middle) <= units { level = middle } else { beyond = middle }
    }
    let mut more = units - below(level);
    let share = |&held: &usize| {
        let one = usize::from(held <= level && more > 0);
        more -= one;
        level.saturating_sub(held) + one
    };
    held.iter().map(share).collect()
}

/// Distributes units by weight: cuts the sequence of all weights into one interval of equal length per rank, and
/// assigns each unit to the interval that contains its midpoint. Units already held are not taken into account. If a weight
/// is negative or not finite, or all are zero, it distributes by number as [`EvenPartition`] does.
#[derive(Clone, Copy, Debug, Default)]
pub struct WeightedPartition;

impl Partitioner for WeightedPartition {
    fn partition(&self, distribution: &Distribution, rank: usize, consumers: usize) -> Vec<usize> {
        let all = distribution.weight();
        let has_negative = distribution.weights.iter().flatten().any(|&weight| weight < 0.0);
        if all <= 0.0 || !all.is_finite() || has_negative {
            return EvenPartition.partition(distribution, rank, consumers);
        }
        // Adds in the order of the ranks, so that every rank computes the same sums.
        let mut before: f64 = distribution.weights[..rank].iter().flatten().sum();
        let place = |&weight: &f64| {
            let middle = before + 0.5 * weight;
            before += weight;
            ((middle / all * consumers as f64) as usize).min(consumers - 1)
        };
        distribution.weights[rank].iter().map(place).collect()
    }
}

/// A user-defined distribution.
impl<F: Fn(&Distribution, usize, usize) -> Vec<usize>> Partitioner for F {
    fn partition(&self, distribution: &Distribution, rank: usize, consumers: usize) -> Vec<usize> {
        self(distribution, rank, consumers)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn distribution(counts: &[usize]) -> Distribution {
        let weights = counts.iter().map(|&count| vec![1.0; count]).collect();
        Distribution { counts: counts.to_vec(), weights, held: Vec::new() }
    }

    /// Returns the number of units for each consumer rank.
    fn row(partitioner: &impl Partitioner, distribution: &Distribution, rank: usize, consumers: usize) -> Vec<usize> {
        let mut row = vec![0; consumers];
        partitioner.partition(distribution, rank, consumers).into_iter().for_each(|to| row[to] += 1);
        row
    }

    /// Tobin 2018, table 4.2.
    #[test]
    fn partitions_507_units_as_published() {
        let distribution = distribution(&[125, 122, 128, 132]);
        let rows: Vec<Vec<usize>> = (0..4).map(|rank| row(&EvenPartition, &distribution, rank, 8)).collect();
        assert_eq!(rows[0], [64, 61, 0, 0, 0, 0, 0, 0]);
        assert_eq!(rows[1], [0, 3, 64, 55, 0, 0, 0, 0]);
        assert_eq!(rows[2], [0, 0, 0, 8, 63, 57, 0, 0]);
        assert_eq!(rows[3], [0, 0, 0, 0, 0, 6, 63, 63]);
    }

    #[test]
    fn more_ranks_than_units_leave_some_without() {
        let distribution = distribution(&[2, 0, 1]);
        let rows: Vec<Vec<usize>> = (0..3).map(|rank| row(&EvenPartition, &distribution, rank, 5)).collect();
        assert_eq!(rows, [vec![1, 1, 0, 0, 0], vec![0; 5], vec![0, 0, 1, 0, 0]]);
    }

    #[test]
    fn new_units_go_to_the_ranks_with_the_fewest() {
        let with = |held: &[usize], counts: &[usize]| {
            let distribution = Distribution { held: held.to_vec(), ..distribution(counts) };
            (0..counts.len()).map(|rank| row(&EvenPartition, &distribution, rank, held.len())).collect::<Vec<_>>()
        };
        assert_eq!(with(&[6, 0], &[1, 0]), [[0, 1], [0, 0]]);
        assert_eq!(with(&[3, 1, 2], &[2, 2]), [[1, 1, 0], [0, 1, 1]]);
        assert_eq!(with(&[9, 0, 1], &[3]), [[0, 2, 1]]);
        assert_eq!(with(&[2, 2], &[0, 1]), [[0, 0], [1, 0]]);
    }

    #[test]
    fn the_sequence_is_cut_at_half_of_the_total_weight() {
        let weights = vec![vec![1.0, 1.0, 1.0], vec![3.0]];
        let distribution = Distribution { counts: vec![3, 1], weights, held: Vec::new() };
        assert_eq!(WeightedPartition.partition(&distribution, 0, 2), [0, 0, 0]);
        assert_eq!(WeightedPartition.partition(&distribution, 1, 2), [1]);
        let nothing = Distribution { counts: vec![4], weights: vec![vec![0.0; 4]], held: Vec::new() };
        assert_eq!(WeightedPartition.partition(&nothing, 0, 2), [0, 0, 1, 1]);
        for wrong in [-3.0, f64::NAN, f64::INFINITY] {
            let weights = vec![vec![5.0, wrong, 1.0, 1.0]];
            let distribution = Distribution { counts: vec![4], weights, held: Vec::new() };
            assert_eq!(WeightedPartition.partition(&distribution, 0, 2), [0, 0, 1, 1], "{wrong}");
        }
    }
}
