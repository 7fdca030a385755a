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
    /// Whether the numbers of the points are those of load steps, if a point is an attempt.
    is_by_step: bool,
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
        let first = match run.attempts.first() {
            Some(attempt) if unit == Unit::Attempt => attempt.step,
            _ => 1,
        };
        let is_by_step = (first..).zip(&run.attempts).all(|(number, attempt)| attempt.step == number);
        let mut loads = Self { unit, is_by_step, first, points: Vec::new(), migrations: Vec::new(), ends: Vec::new() };
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

    /// Returns true if the chart shows quantiles instead of all ranks.
    pub fn has_quantiles(&self) -> bool {
        self.points.first().is_some_and(|loads| loads.len() > MOST_LINES)
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
            Unit::Attempt if self.is_by_step => "load step",
            Unit::Attempt => "attempt at a load step",
        };
        let labels = Labels { chart, x, y: &format!("deviation of {of_what} in %") };
        let extremes = [quantile(0.0), quantile(1.0)];
        let y = range(extremes.iter().flatten().map(|&(_, y)| y).chain([0.0]));
        let last = (self.first + self.points.len().max(1) - 1) as f64;
        let ranks = deviations.first().map_or(0, |(_, ranks)| ranks.len());
        let lines: Vec<Line> = if !self.has_quantiles() {
            let of_rank = |k: usize| deviations.iter().map(|(x, ranks)| (*x, ranks[k])).collect();
            (0..ranks).map(|k| Line { name: format!("rank {}", first_micro + k), points: of_rank(k) }).collect()
        } else {
            let of_quantile = |(name, part): (&str, f64)| Line { name: name.into(), points: quantile(part) };
            [("most loaded rank", 1.0), ("median", 0.5), ("least loaded rank", 0.0)].map(of_quantile).into()
        };
        let mut frame = Chart::with_legend(labels, self.first as f64 - 0.5..last + 0.5, y, &lines);
        frame.area(&extremes[0], &extremes[1], "#e3e7ea");
        if self.has_quantiles() {
            frame.area(&quantile(0.1), &quantile(0.9), "#bed0dc");
        }
        let ends: Vec<f64> = self.ends.iter().map(|&k| (self.first + k) as f64 + 0.5).collect();
        frame.columns(&ends);
        for (k, line) in lines.iter().enumerate() {
            frame.line(line.points.iter().copied(), line_color(k), 1.5);
        }
        let moved: Vec<f64> = self.migrations.iter().map(|&k| (self.first + k) as f64 - 0.5).collect();
        frame.marks(&moved);
        frame.finish()
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

#[cfg(test)]
mod tests {
    use super::super::history::Attempt;
    use super::*;
    use crate::app::results::log::MigrationReport;

    /// Returns a run with one macro rank and these attempts: the loads of the micro ranks in each evaluation.
    fn run(attempts: &[&[&[f64]]]) -> RankRun {
        let times = |&busy: &f64| RankTimes { busy, ..RankTimes::default() };
        let of_sweep = |loads: &&[f64]| [9.0].iter().chain(*loads).map(times).collect();
        let attempt = |(k, sweeps): (usize, &&[&[f64]])| Attempt {
            step: k + 1,
            outcome: Outcome::Converged,
            sweeps: sweeps.iter().map(of_sweep).collect(),
            migrations: vec![MigrationReport { iteration: 1, ..Default::default() }; k],
        };
        RankRun { macro_ranks: 1, resumed_from: 0, attempts: attempts.iter().enumerate().map(attempt).collect() }
    }

    fn busy(times: &RankTimes) -> f64 {
        times.busy
    }

    #[test]
    fn deviations_are_relative_to_the_mean_of_the_micro_ranks() {
        let loads = Loads::of(&run(&[&[&[1.0, 3.0], &[2.0, 2.0]], &[&[0.0, 0.01], &[1.0, 4.0]]]), busy).unwrap();
        assert_eq!((loads.unit, &loads.migrations[..], &loads.ends[..]), (Unit::Evaluation, &[2][..], &[1, 3][..]));
        // An evaluation with hardly any load is omitted.
        let expected = [(1.0, vec![-50.0, 50.0]), (2.0, vec![0.0, 0.0]), (4.0, vec![-60.0, 60.0])];
        assert_eq!(loads.deviations().len(), 3);
        for ((x, found), (at, wanted)) in loads.deviations().iter().zip(&expected) {
            assert!(x == at && found.iter().zip(wanted).all(|(a, b)| (a - b).abs() < 1e-9), "{x}: {found:?}");
        }
    }

    #[test]
    fn many_evaluations_are_summed_by_step() {
        let long: Vec<&[f64]> = [&[1.0, 3.0][..], &[3.0, 1.0], &[1.0, 1.0]].into_iter().cycle().take(42).collect();
        let unequal: Vec<&[f64]> = vec![&[1.0, 3.0]; 30];
        let loads = Loads::of(&run(&[&long, &unequal]), busy).unwrap();
        assert_eq!((loads.unit, loads.is_by_step, &loads.migrations[..]), (Unit::Attempt, true, &[1][..]));
        let deviations = loads.deviations();
        assert_eq!(deviations, [(1.0, vec![0.0, 0.0]), (2.0, vec![-50.0, 50.0])]);
        let steps = vec![&long[..]; 1000];
        let all = Loads::of(&run(&steps), busy).unwrap();
        assert_eq!((all.deviations().len(), all.deviations()[0].0), (200, 3.0));
        let chart = all.draw("a", "b", 1);
        assert!(chart.contains(">1000<") && chart.len() < 20_000, "{} bytes", chart.len());
    }

    #[test]
    fn many_ranks_are_drawn_as_quantiles() {
        let of_rank: Vec<f64> = (0..9).map(|k| 6.0 + k as f64).collect();
        let chart = Loads::of(&run(&[&[&of_rank[..], &of_rank]]), busy).unwrap().draw("a", "b", 1);
        assert!(chart.contains("most loaded rank") && !chart.contains("rank 1<"), "{chart}");
        let few = Loads::of(&run(&[&[&[1.0, 2.0][..]]]), busy).unwrap().draw("a", "b", 1);
        assert!(few.contains(">rank 1<") && few.contains(">rank 2<"), "{few}");
        assert_eq!([0.0, 0.1, 0.5, 1.0].map(|part| quantile(&of_rank, part)), [6.0, 7.0, 10.0, 14.0]);
    }

    #[test]
    fn a_single_rank_and_ranks_without_load_have_no_chart() {
        assert!(Loads::of(&run(&[&[&[1.0]]]), busy).is_none());
        assert!(Loads::of(&run(&[&[&[0.0, f64::NAN]]]), busy).is_none());
        assert!(Loads::of(&run(&[]), busy).is_none());
    }
}
