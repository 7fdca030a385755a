//! The deviation of the loads of the micro ranks from their mean, after figures 4.7 and 4.8 of the reference text.

use super::super::charts::{Chart, Labels, Line, line_color, range};
use super::history::{Outcome, RankRun};
use crate::app::results::log::RankTimes;

/// Most evaluations that are drawn one by one; of more, each point of the chart is an attempt at a load step.
const MOST_SWEEPS: usize = 60;
/// Most points of a line; further ones are merged.
const MOST_POINTS: usize = 200;
/// Most ranks with a line of their own; of more, quantiles are drawn.
const MOST_LINES: usize = 7;
/// Loads below this part of the mean load are omitted: what little a scale does is rarely spread evenly, nor need it be.
const SMALL_LOAD: f64 = 0.05;

/// What a point of the charts stands for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Unit {
    /// One evaluation of all RVEs.
    Evaluation,
    /// An attempt at a load step.
    Attempt,
}

/// The loads of the ranks of the micro scale.
#[derive(Clone, Debug, PartialEq)]
pub struct Loads {
    /// What a point stands for.
    pub unit: Unit,
    /// Number of the first point.
    first: usize,
    /// The load of each rank, point by point.
    points: Vec<Vec<f64>>,
    /// The points before which RVEs have moved.
    migrations: Vec<usize>,
    /// The points after which a load step ends, if a point is an evaluation.
    ends: Vec<usize>,
}

impl Loads {
    /// Collects the loads of a run, of which `load` returns that of a rank in an evaluation. Returns `None` if the micro
    /// scale has a single rank or no load.
    pub fn of(run: &RankRun, load: impl Fn(&RankTimes) -> f64) -> Option<Self> {
        let first_micro = run.first_micro();
        let ranks = run.ranks().saturating_sub(first_micro);
        let of_sweep = |sweep: &Vec<RankTimes>| -> Vec<f64> {
            let of_rank = |k: usize| sweep.get(first_micro + k).map_or(0.0, &load);
            (0..ranks).map(of_rank).map(|load| if load.is_finite() { load.max(0.0) } else { 0.0 }).collect()
        };
        let unit = if run.sweeps().count() <= MOST_SWEEPS { Unit::Evaluation } else { Unit::Attempt };
        let first = if unit == Unit::Evaluation { 1 } else { run.resumed_from + 1 };
        let mut loads = Self { unit, first, points: Vec::new(), migrations: Vec::new(), ends: Vec::new() };
        for attempt in &run.attempts {
            let of_attempt = loads.points.len();
            loads.points.extend(attempt.sweeps.iter().map(of_sweep));
            let moved = attempt.migrations.iter().map(|migration| of_attempt + migration.iteration.max(1) - 1);
            match unit {
                Unit::Evaluation => {
                    loads.migrations.extend(moved);
                    loads.ends.extend((attempt.outcome == Outcome::Converged).then_some(loads.points.len() - 1));
                }
                Unit::Attempt => {
                    merge(&mut loads.points, of_attempt);
                    loads.migrations.extend((!attempt.migrations.is_empty()).then_some(of_attempt));
                }
            }
        }
        let has_load = loads.points.iter().flatten().any(|&load| load > 0.0);
        (ranks > 1 && has_load).then_some(loads)
    }

    /// Returns the deviations of all ranks from their mean in percent of it, at each point that is drawn.
    fn deviations(&self) -> Vec<(f64, Vec<f64>)> {
        let size = self.points.len().div_ceil(MOST_POINTS);
        let mean = |loads: &[f64]| loads.iter().sum::<f64>() / loads.len() as f64;
        let all = self.points.iter().map(|loads| mean(loads)).sum::<f64>() / self.points.len() as f64;
        let of_points = |(k, points): (usize, &[Vec<f64>])| {
            let mut sum = points.to_vec();
            merge(&mut sum, 0);
            let loads = sum.pop()?;
            let mean = mean(&loads);
            let place = (self.first + k * size) as f64 + (points.len() - 1) as f64 / 2.0;
            let of_rank = |load: &f64| 100.0 * (load / mean - 1.0);
            let counts = mean > SMALL_LOAD * all * points.len() as f64;
            counts.then(|| (place, loads.iter().map(of_rank).collect()))
        };
        self.points.chunks(size.max(1)).enumerate().filter_map(of_points).collect()
    }

    /// Draws the deviations: the range of all ranks, and in it a line per rank, or quantiles of many ranks. `first_micro`
    /// is the number of the first rank.
    pub fn draw(&self, chart: &'static str, of_what: &str, first_micro: usize) -> String {
        let deviations = self.deviations();
        let quantile = |part: f64| -> Vec<(f64, f64)> {
            let at = |(x, ranks): &(f64, Vec<f64>)| (*x, quantile(ranks, part));
            deviations.iter().map(at).collect()
        };
        let x = match self.unit {
            Unit::Evaluation => "evaluation of all RVEs",
            Unit::Attempt => "load step",
        };
        let labels = Labels { chart, x, y: &format!("deviation of {of_what} in %") };
        let extremes = [quantile(0.0), quantile(1.0)];
        let y = range(extremes.iter().flatten().map(|&(_, y)| y).chain([0.0]));
        let last = (self.first + self.points.len().max(1) - 1) as f64;
        let mut frame = Chart::over(labels, self.first as f64 - 0.5..last + 0.5, y);
        let ends: Vec<f64> = self.ends.iter().map(|&k| (self.first + k) as f64 + 0.5).collect();
        frame.columns(&ends);
        frame.area(&extremes[0], &extremes[1], "#e3e7ea");
        let ranks = deviations.first().map_or(0, |(_, ranks)| ranks.len());
        let lines: Vec<Line> = if ranks <= MOST_LINES {
            let of_rank = |k: usize| deviations.iter().map(|(x, ranks)| (*x, ranks[k])).collect();
            (0..ranks).map(|k| Line { name: format!("rank {}", first_micro + k), points: of_rank(k) }).collect()
        } else {
            frame.area(&quantile(0.1), &quantile(0.9), "#bed0dc");
            let of_quantile = |(name, part): (&str, f64)| Line { name: name.into(), points: quantile(part) };
            [("most loaded rank", 1.0), ("least loaded rank", 0.0), ("median", 0.5)].map(of_quantile).into()
        };
        for (k, line) in lines.iter().enumerate() {
            frame.line(line.points.iter().copied(), line_color(k), 1.5);
        }
        let moved: Vec<f64> = self.migrations.iter().map(|&k| (self.first + k) as f64 - 0.5).collect();
        frame.marks(&moved);
        frame.finish(&lines)
    }
}

/// Replaces the points from `first` by their sum, if there are any.
fn merge(points: &mut Vec<Vec<f64>>, first: usize) {
    let others = points.split_off((first + 1).min(points.len()));
    if let Some(sum) = points.get_mut(first) {
        others.iter().for_each(|loads| sum.iter_mut().zip(loads).for_each(|(sum, load)| *sum += load));
    }
}

/// Returns the value that this part of the values does not exceed.
fn quantile(values: &[f64], part: f64) -> f64 {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    let at = part * sorted.len().saturating_sub(1) as f64;
    sorted.get(at.round() as usize).copied().unwrap_or(f64::NAN)
}
