//! Log entries from the reports of a step.

use crate::app::results::log::{Balance, Factorizations, LinearLog, NewtonLog, NewtonSeconds, RveLog};
use crate::fem::reactions::BoundaryForces;
use crate::las::{self, NewtonReport, SolveReport};
use crate::tissue::micro_scale::{RveCounts, RveStats};

/// The sum of all surface and point forces, and its norm divided by the largest of their norms.
pub(super) fn balance(forces: &BoundaryForces) -> Balance {
    let norm = |force: &[f64; 3]| force.iter().map(|f| f * f).sum::<f64>().sqrt();
    let all = forces.surfaces.iter().map(|s| &s.force).chain(forces.points.iter().map(|p| &p.force));
    let largest = all.map(norm).fold(0.0, f64::max);
    let force = forces.sum();
    Balance { force, relative: if largest > 0.0 { norm(&force) / largest } else { 0.0 } }
}

/// Sums the counts of the solves of a step and concatenates their residual histories; `total` is the wall time, s.
pub(super) fn newton_log(reports: &[NewtonReport], seconds: las::NewtonSeconds, total: f64) -> NewtonLog {
    let sum = |count: fn(&NewtonReport) -> usize| reports.iter().map(count).sum();
    NewtonLog {
        iterations: sum(|report| report.iterations),
        residual: reports.last().map_or(0.0, |last| last.residuals.last().copied().unwrap_or(f64::NAN)),
        residuals: reports.iter().flat_map(|report| &report.residuals).copied().collect(),
        relative: reports.iter().flat_map(|report| &report.relative).copied().collect(),
        line_search_cuts: sum(|report| report.backtracks),
        factorizations: Factorizations {
            cholesky: sum(|report| report.cholesky),
            ldlt: sum(|report| report.ldlt),
            lu: sum(|report| report.lu),
            approximate: sum(|report| report.approximate),
            kept: sum(|report| report.kept),
        },
        linear_iterations: sum(|report| report.linear_iterations),
        linear: reports.iter().flat_map(|report| &report.linear_solves).map(linear_log).collect(),
        linear_starts: Vec::new(),
        fallbacks: sum(|report| report.fallbacks),
        seconds: NewtonSeconds {
            point_field: seconds.residual,
            assembly: seconds.jacobian,
            factor: seconds.factor,
            solve: seconds.solve,
            total,
        },
    }
}

pub(super) fn linear_log(solve: &SolveReport) -> LinearLog {
    LinearLog { iterations: solve.iterations, residual: solve.residual }
}

pub(super) fn rve_log(stats: &RveStats, counts: &RveCounts) -> RveLog {
    let quantile =
        |share| stats.by_iterations.quantile(share, stats.most_iterations).map(|iterations| iterations as u64);
    RveLog {
        solves: stats.solves as u64,
        in_batches: stats.in_batches as u64,
        iterations_total: stats.iterations as u64,
        iterations_max: stats.most_iterations as u64,
        iterations_median: quantile(0.5),
        iterations_p95: quantile(0.95),
        iterations_mean: stats.iterations as f64 / stats.solves.max(1) as f64,
        cuts: stats.cuts as u64,
        indefinite: stats.indefinite as u64,
        line_search_cuts: stats.line_search_cuts as u64,
        predicted: stats.predicted as u64,
        by_cuts: stats.by_cuts as u64,
        by_regularized: stats.by_regularized as u64,
        by_relaxation: stats.by_relaxation as u64,
        relaxation_steps: stats.relaxation_steps as u64,
        verified: stats.verified as u64,
        replaced: stats.replaced as u64,
        reused: stats.reused as u64,
        seconds_cpu: stats.seconds,
        asleep: counts.asleep as u64,
        waiting: counts.waiting as u64,
        deleted: counts.deleted as u64,
    }
}
