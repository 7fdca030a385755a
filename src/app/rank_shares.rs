//! How the ranks share the work of a step.

use crate::app::results::log::{RankTimes, ScaleLog, ScalesLog};
use crate::tissue::two_scale::BalanceReport;

/// Collects the times and migrations of a step with its cuts.
#[derive(Default)]
pub struct RankShares {
    /// Number of ranks of the macro scale.
    macro_ranks: usize,
    /// The times of the ranks of both scales in each sweep.
    sweeps: Vec<Vec<RankTimes>>,
    balance: BalanceReport,
}

impl RankShares {
    /// Adds the times and migrations of an attempt at an increment.
    pub fn add(&mut self, macro_ranks: usize, sweeps: Vec<Vec<RankTimes>>, balance: &BalanceReport) {
        self.macro_ranks = macro_ranks;
        self.sweeps.extend(sweeps);
        self.balance.migrations.extend_from_slice(&balance.migrations);
        self.balance.skill = balance.skill.or(self.balance.skill);
    }

    /// Returns the summary since the last call; `None` for a run in one process.
    pub fn take(&mut self) -> Option<ScalesLog> {
        let Self { macro_ranks, sweeps, balance } = std::mem::take(self);
        if sweeps.is_empty() {
            return None;
        }
        let busy = |ranks: &[RankTimes]| ranks.iter().map(|times| times.busy).collect();
        let split = |ranks: &'_ Vec<RankTimes>| ranks.len().min(macro_ranks);
        let mut balancing = vec![0.0; sweeps.iter().map(Vec::len).max().unwrap_or(0)];
        for ranks in &sweeps {
            balancing.iter_mut().zip(ranks).for_each(|(sum, times)| *sum += times.balancing);
        }
        Some(ScalesLog {
            macro_scale: ScaleLog::of(sweeps.iter().map(|ranks| busy(&ranks[..split(ranks)]))),
            micro_scale: ScaleLog::of(sweeps.iter().map(|ranks| busy(&ranks[split(ranks)..]))),
            migrations: balance.migrations.len(),
            moved: balance.migrations.iter().map(|migration| migration.units).sum(),
            bytes: balance.migrations.iter().map(|migration| migration.bytes).sum(),
            seconds_balancing: balancing.into_iter().fold(0.0, f64::max),
            skill: balance.skill,
        })
    }
}
