//! A run on any number of micro ranks, sweep by sweep, in which RVEs take their recorded seconds.

mod balancer;
#[cfg(test)]
mod tests;
mod totals;

use biotissue::coupling::balance::{BalanceError, Cost, CostHistory};

use self::balancer::Balancer;
pub use self::balancer::Scheme;
pub use self::totals::Totals;
use crate::machine::{Machine, MacroModel};
use crate::mirror::LocalSeconds;
use crate::placement::Placement;
use crate::pool;
use crate::recording::Sample;
use crate::replicas::Replicas;

/// Bytes that the macro scale sends for an RVE in an iteration, and receives: `RveTask` and `RveResponse`.
const EXCHANGED_BYTES: u64 = 80 + 744;

/// What is simulated.
#[derive(Clone, Copy, Debug)]
pub struct Case<'a> {
    /// The RVEs.
    pub replicas: Replicas<'a>,
    /// Number of micro ranks.
    pub ranks: usize,
    /// Threads of each micro rank.
    pub threads: usize,
    /// Number of macro ranks.
    pub macro_ranks: usize,
    /// Number of sweeps, from the first recorded one.
    pub sweeps: usize,
    /// The network between the ranks.
    pub machine: Machine,
    /// The time of the macro scale.
    pub macro_model: MacroModel,
    /// Bytes of the state of an RVE.
    pub state_bytes: u64,
    /// What a rank computes in the collectives of load balancing.
    pub local: LocalSeconds,
}

/// Simulates a run; returns the sums over its sweeps.
///
/// # Errors
/// Returns [`BalanceError`] if a planner fails.
pub fn simulate(case: &Case, scheme: Scheme) -> Result<Totals, BalanceError> {
    simulate_with(case, scheme, |_| {})
}

/// As [`simulate`]; passes the seconds of all ranks in each sweep to `observe`.
fn simulate_with(case: &Case, scheme: Scheme, mut observe: impl FnMut(&[f64])) -> Result<Totals, BalanceError> {
    let mut run = Run::new(case);
    let mut balancer = Balancer::new(case, scheme);
    for sweep in 0..case.sweeps {
        run.samples = (0..case.replicas.units).map(|unit| case.replicas.sample(unit, sweep)).collect();
        balancer.before_sweep(&mut run, sweep)?;
        let busy = run.compute();
        observe(&busy);
        run.totals.solution += case.macro_model.seconds(case.replicas.units, case.macro_ranks);
        run.totals.exchange += run.exchange();
        balancer.after_sweep(&mut run, sweep, &busy);
        run.record();
    }
    Ok(run.totals)
}

/// The state of a run.
struct Run<'a> {
    case: &'a Case<'a>,
    placement: Placement,
    histories: Vec<CostHistory>,
    /// What the RVEs cost in this sweep.
    samples: Vec<Option<Sample>>,
    /// Whether each RVE existed in the last sweep.
    existed: Vec<bool>,
    /// The largest number of micro ranks that a macro rank exchanges with.
    neighbors: usize,
    totals: Totals,
}

impl<'a> Run<'a> {
    fn new(case: &'a Case<'a>) -> Self {
        let units = case.replicas.units;
        let placement = Placement::even(units, case.ranks);
        Self {
            case,
            neighbors: placement.macro_neighbors(case.macro_ranks),
            placement,
            histories: (0..units).map(|unit| CostHistory::new(case.replicas.class(unit))).collect(),
            samples: Vec::new(),
            existed: vec![false; units],
            totals: Totals::default(),
        }
    }

    /// Returns the seconds of every rank in this sweep, and adds up their shares.
    fn compute(&mut self) -> Vec<f64> {
        let seconds = |unit: u32| self.samples[unit as usize].map(|sample| sample.seconds);
        let of_rank = |units: &[u32]| {
            if self.case.threads == 1 {
                return units.iter().filter_map(|&unit| seconds(unit)).sum();
            }
            pool::seconds(self.case.threads, self.longest_first(units).into_iter().filter_map(seconds))
        };
        let busy: Vec<f64> = self.placement.iter().map(of_rank).collect();
        let all = self.samples.iter().flatten().map(|sample| sample.seconds);
        let (sum, largest) = all.fold((0.0, 0.0_f64), |(sum, largest), s| (sum + s, largest.max(s)));
        self.totals.add_sweep(&busy, sum / (self.case.ranks * self.case.threads) as f64, largest);
        busy
    }

    /// Returns the order in which the threads of a rank take its RVEs, as `biotissue` does: the longest first, by the
    /// sweeps before; new ones before all others.
    fn longest_first(&self, units: &[u32]) -> Vec<u32> {
        let expected = |unit: u32| {
            let history = &self.histories[unit as usize];
            if history.sweeps == 0 { f64::INFINITY } else { history.smooth_seconds }
        };
        let mut order = units.to_vec();
        order.sort_by(|&a, &b| expected(b).total_cmp(&expected(a)));
        order
    }

    /// Returns the seconds of the exchange with the macro scale: a command to all ranks, then one message to and one from
    /// each neighbor of the busiest macro rank.
    fn exchange(&self) -> f64 {
        let Case { machine, ranks, macro_ranks, replicas, .. } = self.case;
        let units = replicas.units.div_ceil(*macro_ranks) as u64;
        machine.tree(*ranks, 0) + machine.messages(2 * self.neighbors, EXCHANGED_BYTES * units)
    }

    /// Returns what an RVE cost in this sweep.
    fn cost(&self, unit: usize) -> Option<Cost> {
        let Sample { iterations, seconds } = self.samples[unit]?;
        Some(Cost { iterations: iterations.into(), seconds, ..Cost::default() })
    }

    /// Appends the costs of this sweep to the histories.
    fn record(&mut self) {
        for unit in 0..self.histories.len() {
            let cost = self.cost(unit);
            if let Some(cost) = &cost {
                self.histories[unit].record(cost);
            }
            self.existed[unit] = cost.is_some();
        }
    }
}
