//! The part of the page on the ranks: how they spent their time, and how evenly they shared the work.

use super::figures::Figure;
use crate::app::report::directory::Directory;
use crate::app::report::ranks::columns::{of_scale, seconds_of};
use crate::app::report::ranks::deviation::{Loads, Unit};
use crate::app::report::ranks::history::RankRun;
use crate::app::report::ranks::status;
use crate::app::report::ranks::timeline::{Segment, Status, Timeline};
use crate::app::report::units::{escape, quantity, significant};
use crate::app::results::log::{RankTimes, ScaleLog, ScalesLog};

/// Most runs of a directory, from the last one, that are drawn.
const MOST_RUNS: usize = 4;

/// Name of the chart of the status of the ranks, and start of the names of further ones.
pub(super) const STATUS: &str = "rank-status";

/// Draws the charts of the last runs on several ranks.
pub(super) fn figures(directory: &Directory) -> Vec<Figure> {
    let runs = &directory.rank_runs;
    let first = runs.len().saturating_sub(MOST_RUNS);
    let of_run = |(k, run)| {
        let name = |what: &str| if k == 0 { what.to_owned() } else { format!("{what}-{}", k + 1) };
        let charts = [
            status(run).map(|(caption, svg)| (name(STATUS), caption, svg)),
            seconds(run).map(|(caption, svg)| (name("rank-seconds"), caption, svg)),
            iterations(run).map(|(caption, svg)| (name("rank-iterations"), caption, svg)),
        ];
        charts.into_iter().flatten().map(|(name, caption, svg)| Figure { name, caption: caption + &of(run), svg })
    };
    runs.iter().enumerate().skip(first).flat_map(of_run).collect()
}

/// Returns the end of a caption, which names the run.
fn of(run: &RankRun) -> String {
    let (above, all) = (run.first_micro(), run.ranks());
    match run.resumed_from {
        0 => format!(" Run on {above} + {} ranks.", all - above),
        step => format!(" Run on {above} + {} ranks, resumed after step {step}.", all - above),
    }
}

fn status(run: &RankRun) -> Option<(String, String)> {
    let timeline = Timeline::of(run);
    let chart = status::draw(&timeline, run.first_micro())?;
    let (above, below) = timeline.ranks.split_at(run.first_micro());
    let share = |ranks: &[Vec<Segment>], status| percent(seconds_of(&of_scale(ranks), status) / timeline.seconds);
    let mut caption = format!(
        "Status of the ranks over wall time. The upper band of each scale is idle where at least one of its ranks waits for \
         a message, otherwise balancing where one of them plans or carries out a migration, and busy elsewhere. \
         Some rank of the macro scale is idle for {} of the wall time, some rank of the micro scale for {}; the micro scale \
         balances for {}.",
        share(above, Status::Idle),
        share(below, Status::Idle),
        share(below, Status::Balancing),
    );
    if chart.is_grouped {
        caption.push_str(" A band of several ranks shows their mean.");
    }
    caption.push_str(
        " Where several statuses share a column of pixels, it is divided in proportion. The log has the durations of each \
         evaluation and rank; their order within an evaluation is that of the protocol: all micro ranks start to compute \
         together, and the slowest one waits only before. The log does not say which part of an exchange follows the \
         computation: all of it is drawn before.",
    );
    Some((caption, chart.svg))
}

fn seconds(run: &RankRun) -> Option<(String, String)> {
    let loads = Loads::of(run, |times: &RankTimes| times.busy)?;
    let svg = loads.draw("deviation of seconds", "the seconds", run.first_micro());
    Some((deviation("computing time", &loads), svg))
}

/// RVEs move so that the seconds of the ranks become equal; iterations in networks of different sizes take different times.
fn iterations(run: &RankRun) -> Option<(String, String)> {
    let loads = Loads::of(run, |times: &RankTimes| times.iterations as f64)?;
    let svg = loads.draw("deviation of iterations", "the iterations", run.first_micro());
    let note =
        " The default balancing makes the seconds equal, not the iterations, which take longer in larger networks.";
    Some((deviation("number of Newton iterations of the RVEs", &loads) + note, svg))
}

fn deviation(what: &str, loads: &Loads) -> String {
    let quantiles = if loads.has_quantiles() { ", that of eight tenths of them blue" } else { "" };
    let per = match loads.unit {
        Unit::Evaluation => "evaluation (vertical lines: ends of load steps)",
        Unit::Attempt => "load step",
    };
    format!(
        "Deviation of the {what} of each micro rank from their mean, per {per}; the range of all ranks is gray{quantiles}. Triangles \
         mark migrations of RVEs. Points with less than a twentieth of the mean load are omitted."
    )
}

/// Formats a share.
fn percent(share: f64) -> String {
    if share.is_finite() { format!("{:.1}\u{a0}%", 100.0 * share) } else { "\u{2013}".into() }
}

/// Returns the table of how the ranks shared the work of each step; empty for runs in one process.
pub(super) fn table(directory: &Directory) -> String {
    let steps: Vec<(usize, &ScalesLog)> =
        directory.steps.iter().filter_map(|step| Some((step.step, step.scales.as_deref()?))).collect();
    if steps.is_empty() {
        return String::new();
    }
    let columns = [
        "step",
        "evaluations",
        "macro: some rank idle",
        "mean idle",
        "max/mean",
        "micro: some rank idle",
        "mean idle",
        "max/mean",
        "migrations",
        "RVEs moved",
        "moved data",
        "seconds balancing",
        "skill",
    ];
    let mut html = format!("<p>{}</p>\n<div class=\"scroll wide\"><table class=\"words\"><thead><tr>", escape(TABLE));
    columns.iter().for_each(|column| html.push_str(&format!("<th>{column}</th>")));
    html.push_str("</tr></thead>\n<tbody>\n");
    steps.iter().for_each(|(step, scales)| html.push_str(&row(&step.to_string(), scales)));
    html.push_str("</tbody><tfoot>\n");
    html.push_str(&row("total", &ScalesLog::total(steps.iter().map(|(_, scales)| *scales))));
    html + "</tfoot></table></div>\n"
}

const TABLE: &str = "How evenly the ranks of each scale shared its work. An evaluation of all RVEs lasts as long as the \
    slowest rank of the scale computes. Of this time, \u{201c}some rank idle\u{201d} is the share after the first rank has \
    finished, and \u{201c}mean idle\u{201d} the share that a rank waits on average; a scale that waits for the other one is \
    not counted as idle here. \u{201c}max/mean\u{201d} is the load of the most loaded rank over the mean; 1 is perfect \
    balance. \u{201c}skill\u{201d} is the rank correlation of the expected and the measured costs of the RVEs: 1 if their \
    order was foreseen, 0 if the forecast was worth nothing; in the total, the mean.";

fn row(name: &str, scales: &ScalesLog) -> String {
    let of_scale = |scale: &ScaleLog| {
        let ratio = if scale.max_over_mean > 0.0 { significant(scale.max_over_mean) } else { "\u{2013}".into() };
        [percent(scale.idle_any), percent(scale.idle_mean), ratio]
    };
    let mut cells = vec![name.to_owned(), scales.micro_scale.sweeps.to_string()];
    cells.extend(of_scale(&scales.macro_scale));
    cells.extend(of_scale(&scales.micro_scale));
    cells.extend([
        scales.migrations.to_string(),
        scales.moved.to_string(),
        quantity(scales.bytes as f64, "B"),
        significant(scales.seconds_balancing),
        scales.skill.map_or_else(|| "\u{2013}".into(), |skill| format!("{skill:.2}")),
    ]);
    format!("<tr><td>{}</td></tr>\n", cells.join("</td><td>"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_step_without_times_has_a_row_without_ratios() {
        // Both ratios, and the skill.
        let row = |scales: &ScalesLog| row("1", scales);
        assert_eq!(row(&ScalesLog::default()).matches("<td>\u{2013}</td>").count(), 3);
        assert_eq!(row(&ScalesLog::total([&ScalesLog::default()])).matches("<td>\u{2013}</td>").count(), 3);
    }
}
