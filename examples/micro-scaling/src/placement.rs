//! Which rank has which RVEs, and their order there.

use biotissue::coupling::balance::{BalanceError, Loads, MigrationPlan};
use biotissue::coupling::{Distribution, EvenPartition, Partitioner};

/// The RVEs of every micro rank.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Placement {
    /// RVEs, one rank after the other.
    units: Vec<u32>,
    /// The position of the first RVE of each rank, and the number of all.
    offsets: Vec<usize>,
}

impl Placement {
    /// Places RVEs as a run does at its start: consecutive ones on each rank, equal numbers up to one.
    pub fn even(units: usize, ranks: usize) -> Self {
        let distribution = Distribution { counts: vec![units], weights: Vec::new(), held: Vec::new() };
        let mut counts = vec![0; ranks];
        EvenPartition.partition(&distribution, 0, ranks).into_iter().for_each(|rank| counts[rank] += 1);
        Self { units: (0..units as u32).collect(), offsets: offsets(&counts) }
    }

    /// Returns the number of ranks.
    pub fn ranks(&self) -> usize {
        self.offsets.len() - 1
    }

    /// Returns the RVEs of a rank.
    pub fn of(&self, rank: usize) -> &[u32] {
        &self.units[self.offsets[rank]..self.offsets[rank + 1]]
    }

    /// Returns the RVEs of every rank.
    pub fn iter(&self) -> impl Iterator<Item = &[u32]> {
        (0..self.ranks()).map(|rank| self.of(rank))
    }

    /// Returns the loads of all ranks for a planner; each RVE has a state of `bytes`. With a number of macro ranks, it
    /// exchanges with one of them, as in [`macro_neighbors`](Self::macro_neighbors).
    ///
    /// # Errors
    /// Returns [`BalanceError`] if a weight is invalid.
    pub fn loads(
        &self,
        weight: impl Fn(usize) -> f64,
        bytes: u64,
        macro_ranks: Option<usize>,
    ) -> Result<Loads, BalanceError> {
        let of_rank = |units: &[u32]| units.iter().map(|&unit| weight(unit as usize)).collect();
        let weights: Vec<Vec<f64>> = self.iter().map(of_rank).collect();
        let loads = Loads::new(&weights)?.with_bytes(vec![bytes; self.units.len()])?;
        let Some(ranks) = macro_ranks else { return Ok(loads) };
        let units = self.units.len().max(1);
        loads.with_partners(self.units.iter().map(|&unit| (unit as usize * ranks / units) as u32).collect())
    }

    /// Moves RVEs by a plan; afterwards they have the order of [`MigrationPlan::sequence_after`].
    ///
    /// # Errors
    /// Returns [`BalanceError`] if the plan does not fit.
    pub fn migrate(&mut self, plan: &MigrationPlan) -> Result<(), BalanceError> {
        let counts: Vec<usize> = self.offsets.windows(2).map(|ends| ends[1] - ends[0]).collect();
        let (sequence, counts) = plan.sequence_after(&counts)?;
        self.units = sequence.into_iter().map(|at| self.units[at]).collect();
        self.offsets = offsets(&counts);
        Ok(())
    }

    /// Returns the largest number of micro ranks that a macro rank exchanges with, if each of `ranks` macro ranks has the
    /// same share of consecutive RVEs.
    pub fn macro_neighbors(&self, ranks: usize) -> usize {
        let units = self.units.len().max(1);
        // For each macro rank, the micro rank that was counted last, and the number of those counted.
        let (mut last, mut neighbors) = (vec![usize::MAX; ranks], vec![0; ranks]);
        for (micro, own) in self.iter().enumerate() {
            for &unit in own {
                let rank = unit as usize * ranks / units;
                if last[rank] != micro {
                    (last[rank], neighbors[rank]) = (micro, neighbors[rank] + 1);
                }
            }
        }
        neighbors.into_iter().max().unwrap_or(0)
    }
}

/// Returns the sums of the counts before each rank, and of all.
fn offsets(counts: &[usize]) -> Vec<usize> {
    let ends = counts.iter().scan(0, |end, count| {
        *end += count;
        Some(*end)
    });
    [0].into_iter().chain(ends).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use biotissue::coupling::balance::Moves;

    #[test]
    fn rves_migrate_in_the_order_of_the_library() {
        let mut placement = Placement::even(8, 3);
        let of = |placement: &Placement| -> Vec<Vec<u32>> { placement.iter().map(<[u32]>::to_vec).collect() };
        assert_eq!(of(&placement), [vec![0, 1, 2], vec![3, 4, 5], vec![6, 7]]);
        // Macro rank 0 has 0 to 3, macro rank 1 has 4 to 7.
        assert_eq!((placement.macro_neighbors(1), placement.macro_neighbors(2)), (3, 2));
        let mut plan = MigrationPlan::new(3);
        plan.set(0, Moves::default().with(&[1], 2));
        plan.set(1, Moves::default().with(&[0, 2], 2));
        let loads = placement.loads(|unit| unit as f64, 4, Some(2)).unwrap();
        placement.migrate(&plan).unwrap();
        assert_eq!(of(&placement), [vec![0, 2], vec![4], vec![6, 7, 1, 3, 5]]);
        assert_eq!((loads.most_neighbors(), loads.after(&plan).unwrap().most_neighbors()), (2, 2));
        assert_eq!(placement.loads(|unit| unit as f64, 4, Some(2)), loads.after(&plan));
        assert_eq!(placement.macro_neighbors(2), 2);
        assert_eq!(placement.macro_neighbors(8), 1);
    }
}
