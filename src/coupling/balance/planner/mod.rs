//! Planners: algorithms that assign the units of a scale to its ranks again, by their weights.

mod diffusive;
mod greedy;
mod longest_first;
#[cfg(feature = "metis")]
mod metis;

use std::cmp::Ordering;

pub use diffusive::Diffusive;
pub use greedy::Greedy;
pub use longest_first::LongestFirst;
#[cfg(feature = "metis")]
pub use metis::{Affinity, Metis};

use super::error::BalanceError;
use super::loads::{Loads, UnitLoads, max_over_mean};
use super::plan::MigrationPlan;
use crate::las::Comm;

/// An algorithm that plans a migration. Every rank computes the plan of all ranks from the same loads, and must get the
/// same one. A function of this form is a planner too.
pub trait Planner {
    /// Plans which units move where.
    ///
    /// # Errors
    /// Returns [`BalanceError`] if there is no plan.
    fn plan(&self, loads: &Loads) -> Result<MigrationPlan, BalanceError>;
}

/// A user-defined planner.
impl<F: Fn(&Loads) -> Result<MigrationPlan, BalanceError>> Planner for F {
    fn plan(&self, loads: &Loads) -> Result<MigrationPlan, BalanceError> {
        self(loads)
    }
}

/// Phase 1: gathers the loads of a scale, as [`Loads::gather`] does, and plans a migration; checks the plan. Collective
/// over the scale.
///
/// # Errors
/// Returns [`BalanceError`] if the arguments or the plan are invalid, or the communication fails.
pub fn plan<C: Comm>(
    scale: &C,
    planner: &(impl Planner + ?Sized),
    weights: &[f64],
    bytes: &[u64],
) -> Result<(Loads, MigrationPlan), BalanceError> {
    plan_units(scale, planner, UnitLoads { weights, bytes, partners: &[] })
}

/// As [`plan`], with the ranks of another scale that the units exchange with. Collective over the scale.
///
/// # Errors
/// As for [`plan`].
pub fn plan_units<C: Comm>(
    scale: &C,
    planner: &(impl Planner + ?Sized),
    own: UnitLoads<'_>,
) -> Result<(Loads, MigrationPlan), BalanceError> {
    let loads = Loads::gather_units(scale, own)?;
    let plan = planner.plan(&loads)?;
    plan.check(&loads.counts())?;
    Ok((loads, plan))
}

/// Returns the plan that takes every unit to its target, or one that moves nothing if the largest load would not fall.
fn plan_if_better(loads: &Loads, targets: &[u32]) -> Result<MigrationPlan, BalanceError> {
    let mut sums = vec![0.0; loads.ranks()];
    loads.weights().iter().zip(targets).for_each(|(weight, &to)| sums[to as usize] += weight);
    if max_over_mean(&sums) < loads.max_over_mean() {
        MigrationPlan::to_targets(loads, targets)
    } else {
        Ok(MigrationPlan::new(loads.ranks()))
    }
}

/// A load with a total order, for heaps and sorted sets.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Load(f64);

impl Eq for Load {}

impl PartialOrd for Load {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl Ord for Load {
    fn cmp(&self, other: &Self) -> Ordering {
        self.0.total_cmp(&other.0)
    }
}

#[cfg(test)]
mod tests;
