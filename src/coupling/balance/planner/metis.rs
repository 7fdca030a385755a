//! Graph partitioning by METIS.

use std::cmp::Reverse;
use std::collections::BTreeMap;

use super::super::error::BalanceError;
use super::super::loads::Loads;
use super::super::plan::MigrationPlan;
use super::{Diffusive, Planner, plan_if_better};
use crate::coupling::couple::{Coupling, CouplingError};
use crate::las::{Comm, Message};

/// Which units should be on the same rank: a graph of all units of a scale, numbered one rank after the other.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Affinity {
    near: Vec<Vec<u32>>,
}

impl Affinity {
    /// Creates the graph from the neighbors of each unit. Each neighbor must also list the unit.
    pub fn new(near: Vec<Vec<u32>>) -> Self {
        Self { near }
    }

    /// Links the units of each group, in their order. `groups` contains the group of every unit, such as the rank of
    /// the other scale that it is exchanged with.
    pub fn of_groups(groups: &[u32]) -> Self {
        let mut near = vec![Vec::new(); groups.len()];
        let mut last = BTreeMap::new();
        for (unit, group) in (0_u32..).zip(groups) {
            if let Some(before) = last.insert(group, unit) {
                near[before as usize].push(unit);
                near[unit as usize].push(before);
            }
        }
        Self { near }
    }

    /// Links the units of a coupling that are exchanged with the same rank of the other scale. Collective over this
    /// side.
    ///
    /// # Errors
    /// Returns [`CouplingError`] if the communication fails.
    pub fn of_coupling<C: Comm>(coupling: &Coupling<C>) -> Result<Self, CouplingError> {
        let all = coupling
            .local_comm
            .gather_all(Message::of(&coupling.partners()))
            .map_err(|error| coupling.failed(error))?;
        let groups: Vec<u32> = all.iter().filter_map(|message| message.values::<u32>()).flatten().copied().collect();
        Ok(Self::of_groups(&groups))
    }
}

/// Partitions the graph of the units into parts of equal weight with few edges between them, gives each part to the
/// rank that has most of its weight, and moves single units until max/mean is below the tolerance. Cost: O(n log p) for
/// n units on p ranks, with a larger factor than the other planners; METIS runs on every rank.
#[derive(Clone, Debug, PartialEq)]
pub struct Metis {
    /// The graph of the units; `None` links each unit with the next one that has the same partner
    /// ([`Loads::partners`]), or with the next one if partners are unknown.
    pub affinity: Option<Affinity>,
    /// The value of max/mean that suffices.
    pub tolerance: f64,
}

impl Default for Metis {
    fn default() -> Self {
        Self { affinity: None, tolerance: 1.02 }
    }
}

impl Planner for Metis {
    fn plan(&self, loads: &Loads) -> Result<MigrationPlan, BalanceError> {
        let (weights, total, ranks) = (loads.weights(), loads.total(), loads.ranks());
        if total <= 0.0 || ranks < 2 {
            return Ok(MigrationPlan::new(ranks));
        }
        let of_partners;
        let near = match &self.affinity {
            Some(affinity) if affinity.near.len() == weights.len() => &affinity.near,
            Some(Affinity { near }) => {
                let (units, found) = (weights.len(), near.len());
                return Err(BalanceError::Count { rank: 0, units, found, what: "units of the affinity graph" });
            }
            None => {
                let one_group = vec![0; weights.len()];
                let is_known = loads.partners().len() == weights.len();
                of_partners = Affinity::of_groups(if is_known { loads.partners() } else { &one_group });
                &of_partners.near
            }
        };
        // METIS takes integers, whose sum must fit into 32 bits.
        const SUM: f64 = (1 << 30) as f64;
        let integers: Vec<i32> = weights.iter().map(|weight| (weight / total * SUM).round() as i32).collect();
        let parts = crate::backends::metis::partition_weighted(near, &integers, ranks);
        let parts = parts.map_err(|reason| BalanceError::Planner { planner: "metis", reason })?;
        let mut targets = relabel(&parts, &loads.rank_of_units(), weights, ranks);
        Diffusive { tolerance: self.tolerance }.refine(weights, ranks, &mut targets);
        plan_if_better(loads, &targets)
    }
}

/// Gives each part to a rank, such that much weight stays where it is: pairs of part and rank in the order of their
/// common weight.
fn relabel(parts: &[u32], rank_of: &[u32], weights: &[f64], ranks: usize) -> Vec<u32> {
    let mut common = BTreeMap::new();
    for ((&part, &rank), weight) in parts.iter().zip(rank_of).zip(weights) {
        *common.entry((part, rank)).or_insert(0.0) += weight;
    }
    let mut pairs: Vec<((u32, u32), f64)> = common.into_iter().collect();
    pairs.sort_by_key(|&(pair, weight)| (Reverse(super::Load(weight)), pair));
    let (mut rank_of_part, mut is_taken) = (vec![None; ranks], vec![false; ranks]);
    for ((part, rank), _) in pairs {
        if rank_of_part[part as usize].is_none() && !is_taken[rank as usize] {
            rank_of_part[part as usize] = Some(rank);
            is_taken[rank as usize] = true;
        }
    }
    let mut free = (0..ranks as u32).filter(|&rank| !is_taken[rank as usize]);
    let label: Vec<u32> = rank_of_part.into_iter().map(|rank| rank.or_else(|| free.next()).unwrap_or(0)).collect();
    parts.iter().map(|&part| label[part as usize]).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parts_stay_where_most_of_their_weight_is() {
        let parts = [2, 2, 0, 0, 1, 1];
        assert_eq!(relabel(&parts, &[0, 0, 1, 1, 2, 0], &[1.0; 6], 4), [0, 0, 1, 1, 2, 2]);
        assert_eq!(relabel(&parts, &[0, 0, 0, 0, 0, 0], &[1.0, 1.0, 2.0, 2.0, 1.0, 1.0], 3), [2, 2, 0, 0, 1, 1]);
    }

    /// A heavy unit leaves the other ranks to all others, and no rank is empty without need.
    #[test]
    fn few_or_heavy_units_are_divided_among_all_ranks() {
        let most = |weights: &[Vec<f64>]| {
            let loads = Loads::new(weights).unwrap();
            let after = loads.after(&Metis::default().plan(&loads).unwrap()).unwrap();
            after.sums().into_iter().fold(0.0, f64::max)
        };
        let crowded = |own: Vec<f64>, ranks: usize| -> Vec<Vec<f64>> {
            std::iter::once(own).chain((1..ranks).map(|_| Vec::new())).collect()
        };
        assert_eq!(most(&crowded(vec![3.0, 1.0, 2.0], 8)), 3.0);
        assert_eq!(most(&crowded([vec![50.0], vec![1.0; 70]].concat(), 8)), 50.0);
        assert!(most(&crowded([vec![1e6; 4], vec![1.0; 4]].concat(), 4)) <= 1.02e6);
    }

    #[test]
    fn units_of_a_group_stay_together() {
        // Group 0 is too heavy for one rank; its lightest units join the other group.
        let loads = Loads::new(&[vec![1.0; 12], vec![0.5; 8]]).unwrap();
        let groups: Vec<u32> = (0..20).map(|unit| u32::from(unit >= 12)).collect();
        let metis = Metis { affinity: Some(Affinity::of_groups(&groups)), ..Metis::default() };
        let plan = metis.plan(&loads).unwrap();
        assert!(loads.after(&plan).unwrap().max_over_mean() < 1.03, "{plan}");
        assert!(plan.len() <= 4, "{plan}");
        let short = Metis { affinity: Some(Affinity::of_groups(&[0])), ..Metis::default() };
        assert!(short.plan(&loads).is_err());
        assert!(Metis { affinity: Some(Affinity::new(vec![vec![20]; 20])), ..metis }.plan(&loads).is_err());
    }
}
