//! The loads of all ranks of a scale: what a planner knows.

use std::collections::HashMap;

use super::error::BalanceError;
use super::plan::MigrationPlan;
use crate::las::{Comm, Message};

/// What a rank knows of its units ahead of a plan; each array has one value per unit, or none.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct UnitLoads<'a> {
    /// What each unit is expected to cost.
    pub weights: &'a [f64],
    /// The number of bytes that a migration of each unit would send; empty if it is unknown.
    pub bytes: &'a [u64],
    /// The rank of another scale that each unit exchanges with ([`Coupling::partners`](crate::coupling::Coupling::partners));
    /// empty if it is unknown.
    pub partners: &'a [u32],
}

/// The weight of every unit of a scale, by rank, and optionally its size in bytes and the rank of another scale that it
/// exchanges with.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Loads {
    /// Weights of the units of all ranks, one rank after the other.
    weights: Vec<f64>,
    /// Sizes of the units; empty if they are unknown.
    bytes: Vec<u64>,
    /// The rank of another scale that each unit exchanges with; empty if they are unknown.
    partners: Vec<u32>,
    /// The position of the first unit of each rank, and the number of all units.
    offsets: Vec<usize>,
}

impl Loads {
    /// Creates the loads from the weights of the units of each rank. A unit whose weight is NaN has an unknown weight
    /// and gets the mean of the known ones, or 1 if none is known.
    ///
    /// # Errors
    /// Returns [`BalanceError::Weight`] if a weight is negative or infinite.
    pub fn new(weights: &[Vec<f64>]) -> Result<Self, BalanceError> {
        let mut loads = Self { offsets: vec![0], ..Self::default() };
        weights.iter().try_for_each(|weights| loads.push(weights))?;
        loads.fill_unknown();
        Ok(loads)
    }

    /// Sets the number of bytes that a migration of each unit would send, in the order of [`weights`](Self::weights).
    ///
    /// # Errors
    /// Returns [`BalanceError::Sizes`] if their number is not that of the units.
    pub fn with_bytes(self, bytes: Vec<u64>) -> Result<Self, BalanceError> {
        let (units, found) = (self.units(), bytes.len());
        if found != units {
            return Err(BalanceError::Sizes { units, found });
        }
        Ok(Self { bytes, ..self })
    }

    /// Sets the rank of another scale that each unit exchanges with, in the order of [`weights`](Self::weights).
    ///
    /// # Errors
    /// Returns [`BalanceError::Partners`] if their number is not that of the units.
    pub fn with_partners(self, partners: Vec<u32>) -> Result<Self, BalanceError> {
        let (units, found) = (self.units(), partners.len());
        if found != units {
            return Err(BalanceError::Partners { units, found });
        }
        Ok(Self { partners, ..self })
    }

    /// Gathers the weights of all units of a scale; each rank passes those of its units, as for [`new`](Self::new), and
    /// the number of bytes that a migration of each unit would send, or none. Collective over the scale.
    ///
    /// # Errors
    /// Returns [`BalanceError`] on all ranks if a weight is negative or infinite, if a rank passes another number of
    /// sizes than weights, or if the communication fails.
    pub fn gather<C: Comm>(scale: &C, weights: &[f64], bytes: &[u64]) -> Result<Self, BalanceError> {
        Self::gather_units(scale, UnitLoads { weights, bytes, partners: &[] })
    }

    /// As [`gather`](Self::gather), with the ranks of another scale that the units exchange with. Collective over the scale.
    ///
    /// # Errors
    /// As for [`gather`](Self::gather), also if a rank passes another number of partners than weights.
    pub fn gather_units<C: Comm>(scale: &C, own: UnitLoads<'_>) -> Result<Self, BalanceError> {
        let UnitLoads { weights, bytes, partners } = own;
        let own = Message::join(vec![Message::of(weights), Message::of(bytes), Message::of(partners)]);
        let mut loads = Self { offsets: vec![0], ..Self::default() };
        let mut counts = Vec::with_capacity(scale.size());
        for message in &scale.gather_all(own)? {
            let parts = message.split().unwrap_or_default();
            let part = |at: usize| parts.get(at).copied().unwrap_or_default();
            loads.push(bytemuck::try_cast_slice(part(0)).unwrap_or_default())?;
            let bytes: &[u64] = bytemuck::try_cast_slice(part(1)).unwrap_or_default();
            let partners: &[u32] = bytemuck::try_cast_slice(part(2)).unwrap_or_default();
            loads.bytes.extend_from_slice(bytes);
            loads.partners.extend_from_slice(partners);
            counts.push([bytes.len(), partners.len()]);
        }
        loads.check_counts(&counts)?;
        loads.fill_unknown();
        Ok(loads)
    }

    /// Checks that each rank passed as many sizes and partners as weights, or that no rank passed any.
    fn check_counts(&self, of_ranks: &[[usize; 2]]) -> Result<(), BalanceError> {
        for (at, (known, what)) in
            [(self.bytes.len(), "sizes"), (self.partners.len(), "partners")].into_iter().enumerate()
        {
            let mut counts = self.counts().into_iter().zip(of_ranks).enumerate();
            if known > 0
                && let Some((rank, (units, found))) = counts.find(|(_, (units, found))| *units != found[at])
            {
                return Err(BalanceError::Count { rank, units, found: found[at], what });
            }
        }
        Ok(())
    }

    fn push(&mut self, weights: &[f64]) -> Result<(), BalanceError> {
        if let Some(unit) = weights.iter().position(|&weight| weight < 0.0 || weight.is_infinite()) {
            return Err(BalanceError::Weight { rank: self.ranks(), unit, weight: weights[unit] });
        }
        self.weights.extend_from_slice(weights);
        self.offsets.push(self.weights.len());
        Ok(())
    }

    fn fill_unknown(&mut self) {
        let known = self.weights.iter().filter(|weight| !weight.is_nan());
        let (sum, count) = known.fold((0.0, 0_usize), |(sum, count), weight| (sum + weight, count + 1));
        let mean = if count > 0 { sum / count as f64 } else { 1.0 };
        self.weights.iter_mut().filter(|weight| weight.is_nan()).for_each(|weight| *weight = mean);
    }

    /// Returns the number of ranks.
    pub fn ranks(&self) -> usize {
        self.offsets.len().saturating_sub(1)
    }

    /// Returns the number of units of all ranks.
    pub fn units(&self) -> usize {
        self.weights.len()
    }

    /// Returns the weights of the units of a rank.
    pub fn of(&self, rank: usize) -> &[f64] {
        &self.weights[self.offsets[rank]..self.offsets[rank + 1]]
    }

    /// Returns the weights of the units of all ranks, one rank after the other.
    pub fn weights(&self) -> &[f64] {
        &self.weights
    }

    /// Returns the rank of every unit, in the order of [`weights`](Self::weights).
    pub fn rank_of_units(&self) -> Vec<u32> {
        let ranks = self.offsets.windows(2).zip(0_u32..);
        ranks.flat_map(|(ends, rank)| std::iter::repeat_n(rank, ends[1] - ends[0])).collect()
    }

    /// Returns the number of units of each rank.
    pub fn counts(&self) -> Vec<usize> {
        self.offsets.windows(2).map(|ends| ends[1] - ends[0]).collect()
    }

    /// Returns the weight of each rank.
    pub fn sums(&self) -> Vec<f64> {
        (0..self.ranks()).map(|rank| self.of(rank).iter().sum()).collect()
    }

    /// Returns the weight of all units.
    pub fn total(&self) -> f64 {
        self.sums().iter().sum()
    }

    /// Returns the weight of the most loaded rank over the mean of all ranks; 1 if no unit has any weight.
    pub fn max_over_mean(&self) -> f64 {
        max_over_mean(&self.sums())
    }

    /// Returns the number of bytes of a unit; 0 if the sizes are unknown.
    pub fn bytes(&self, rank: usize, unit: u32) -> u64 {
        self.bytes.get(self.offsets[rank] + unit as usize).copied().unwrap_or(0)
    }

    /// Returns the rank of another scale that each unit exchanges with, in the order of [`weights`](Self::weights); empty if
    /// they are unknown.
    pub fn partners(&self) -> &[u32] {
        &self.partners
    }

    /// Returns the largest number of ranks of this scale that a rank of the other scale exchanges with; 0 if the partners of
    /// the units are unknown.
    pub fn most_neighbors(&self) -> usize {
        // For each partner, the rank that was counted last, and the number of those counted.
        let mut counted: HashMap<u32, (usize, usize)> = HashMap::new();
        for (rank, ends) in self.offsets.windows(2).enumerate() {
            let partners = self.partners.get(ends[0]..ends[1]).unwrap_or_default();
            for same in partners.chunk_by(|a, b| a == b) {
                let (last, count) = counted.entry(same[0]).or_insert((usize::MAX, 0));
                if *last != rank {
                    (*last, *count) = (rank, *count + 1);
                }
            }
        }
        counted.into_values().map(|(_, count)| count).max().unwrap_or(0)
    }

    /// Returns the loads after the units have migrated, in the order of [`MigrationPlan::sequence_after`].
    ///
    /// # Errors
    /// Returns [`BalanceError`] if the plan does not fit.
    pub fn after(&self, plan: &MigrationPlan) -> Result<Self, BalanceError> {
        let (positions, counts) = plan.sequence_after(&self.counts())?;
        let mut after = Self { offsets: vec![0], ..Self::default() };
        after.weights.extend(positions.iter().map(|&at| self.weights[at]));
        after.bytes.extend(positions.iter().filter_map(|&at| self.bytes.get(at)));
        after.partners.extend(positions.iter().filter_map(|&at| self.partners.get(at)));
        let mut end = 0;
        after.offsets.extend(counts.into_iter().map(|count| {
            end += count;
            end
        }));
        Ok(after)
    }
}

/// Returns the largest of the loads over their mean; 1 if they are all zero.
pub fn max_over_mean(loads: &[f64]) -> f64 {
    let (sum, max) = loads.iter().fold((0.0, 0.0_f64), |(sum, max), &load| (sum + load, max.max(load)));
    if sum > 0.0 { max * loads.len() as f64 / sum } else { 1.0 }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::coupling::balance::Moves;
    use crate::coupling::thread;

    #[test]
    fn unknown_weights_are_the_mean_of_the_known_ones() {
        let loads = Loads::new(&[vec![1.0, f64::NAN], vec![], vec![3.0]]).unwrap();
        assert_eq!((loads.sums(), loads.total(), loads.counts()), (vec![3.0, 0.0, 3.0], 6.0, vec![2, 0, 1]));
        assert_eq!((loads.max_over_mean(), loads.rank_of_units()), (1.5, vec![0, 0, 2]));
        assert_eq!(Loads::new(&[vec![f64::NAN; 2]]).unwrap().total(), 2.0);
        assert_eq!(Loads::new(&[vec![0.0], vec![]]).unwrap().max_over_mean(), 1.0);
        let error = Loads::new(&[vec![], vec![1.0, -2.0]]).map_err(|error| error.to_string());
        assert_eq!(error, Err("the weight of unit 1 of rank 1 is -2; it must be finite and not negative".into()));
    }

    #[test]
    fn loads_after_a_migration_are_in_the_order_of_the_data() {
        let loads = Loads::new(&[vec![1.0, 2.0, 3.0], vec![4.0], vec![5.0]]).unwrap();
        let mut plan = MigrationPlan::new(3);
        plan.set(0, Moves::default().with(&[1], 2));
        plan.set(1, Moves::default().with(&[0], 2));
        let after = Loads::new(&[vec![1.0, 3.0], vec![], vec![5.0, 2.0, 4.0]]).unwrap();
        assert_eq!(loads.after(&plan), Ok(after));
        assert!(matches!(loads.after(&MigrationPlan::new(2)), Err(BalanceError::Ranks { found: 2, ranks: 3 })));
    }

    #[test]
    fn neighbors_of_the_busiest_partner_are_counted_once() {
        let loads = Loads::new(&[vec![1.0; 3], vec![1.0; 2], vec![]]).unwrap();
        assert_eq!(loads.most_neighbors(), 0);
        let partners = vec![9, 7, 9, 9, 9];
        assert!(matches!(loads.clone().with_partners(vec![7]), Err(BalanceError::Partners { units: 5, found: 1 })));
        let loads = loads.with_partners(partners.clone()).unwrap();
        assert_eq!((loads.partners(), loads.most_neighbors()), (&partners[..], 2));
        let mut plan = MigrationPlan::new(3);
        plan.set(1, Moves::default().with(&[1], 2));
        assert_eq!(loads.after(&plan).unwrap().most_neighbors(), 3);
        let gathered = thread::run(3, |comm| {
            let partners = [&[9, 7, 9][..], &[9, 9], &[]][comm.rank()];
            let weights = [1.0; 3];
            Loads::gather_units(&comm, UnitLoads { weights: &weights[..partners.len()], bytes: &[], partners })
        });
        assert!(gathered.unwrap().iter().all(|gathered| *gathered == loads));
    }

    #[test]
    fn all_ranks_gather_the_same_loads() {
        let loads = thread::run(3, |comm| {
            let own: &[f64] = [&[1.0, 2.0][..], &[], &[3.0]][comm.rank()];
            let bytes: &[u64] = [&[8, 9][..], &[], &[7]][comm.rank()];
            Loads::gather(&comm, own, bytes)
        });
        let loads = loads.unwrap();
        let expected = Loads::new(&[vec![1.0, 2.0], vec![], vec![3.0]]).unwrap();
        let short = expected.clone().with_bytes(vec![8, 9]);
        assert_eq!(short, Err(BalanceError::Sizes { units: 3, found: 2 }));
        let expected = expected.with_bytes(vec![8, 9, 7]).unwrap();
        assert!(loads.iter().all(|loads| *loads == expected), "{loads:?}");
        assert_eq!((loads[0].bytes(0, 1), loads[0].bytes(2, 0)), (9, 7));
        let failed = thread::run(2, |comm| Loads::gather(&comm, &[1.0, 1.0], &[1, 2][..1 + comm.rank()]));
        assert_eq!(failed.unwrap_err().reason, "rank 0 has 2 units, but 1 sizes were given");
        let failed = thread::run(2, |comm| Loads::gather(&comm, &[1.0], &[1][..comm.rank()]));
        assert_eq!(failed.unwrap_err().reason, "rank 0 has 1 units, but 0 sizes were given");
    }
}
