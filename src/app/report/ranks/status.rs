//! The status of all ranks over wall time, after figures 4.6 and 4.9 of the reference text.

use std::fmt::Write;
use std::ops::Range;

use super::super::charts::{AXIS, Axis, INK, LARGE, SMALL, apart, mark};
use super::super::svg::{Anchor, Svg, text_width};
use super::super::units::round_step;
use super::columns::{Columns, groups, of_scale};
use super::history::Outcome;
use super::timeline::{Segment, Status, Timeline};

/// Colors of Okabe and Ito, distinguishable for color-blind readers, in the order of [`Status::ALL`].
const COLORS: [&str; 4] = ["#009e73", "#56b4e9", "#0072b2", "#e69f00"];
const NAMES: [&str; 4] = ["busy", "exchanging", "balancing", "idle"];
const UNRECORDED: &str = "fill=\"#e3e7ea\"";
const FAILED: &str = "stroke=\"#b3261e\" stroke-dasharray=\"3 2\"";

const WIDTH: f64 = 1240.0;
const LEFT: f64 = 104.0;
/// Width of the bands, a multiple of all widths of a column.
const BANDS: usize = 1104;
/// Most ranks of a scale with a band each; more share bands.
const MOST_RANKS: usize = 32;
/// Number of bands that they share at most.
const SHARED_BANDS: usize = 16;
/// Most ends of steps that are drawn across the bands; more would cover them.
const MOST_LINES: usize = 60;
/// Most numbers of steps.
const MOST_NUMBERS: usize = 35;
/// Size of the file beyond which columns become wider, bytes.
const MOST_BYTES: usize = 220_000;
/// Height of the band of a whole scale.
const SCALE_BAND: usize = 16;

/// A chart of the ranks, and whether some of its bands show several ranks.
pub(in crate::app::report) struct StatusChart {
    pub svg: String,
    pub is_grouped: bool,
}

/// Draws the status of all ranks of a run; the ranks from `first_micro` are the micro scale. Returns `None` if no time is
/// recorded.
pub(in crate::app::report) fn draw(timeline: &Timeline, first_micro: usize) -> Option<StatusChart> {
    if timeline.seconds.is_nan() || timeline.seconds <= 0.0 {
        return None;
    }
    let mut svg = String::new();
    for column in [1, 2, 3, 4, 6, 8, 12] {
        svg = draw_columns(timeline, first_micro, column);
        if svg.len() <= MOST_BYTES {
            break;
        }
    }
    let ranks = timeline.ranks.len();
    Some(StatusChart { svg, is_grouped: first_micro.max(ranks - first_micro.min(ranks)) > MOST_RANKS })
}

/// Draws the chart with columns of so many pixels.
fn draw_columns(timeline: &Timeline, first_micro: usize, column: usize) -> String {
    let scales = [("macro scale", 0..first_micro), ("micro scale", first_micro..timeline.ranks.len())];
    let bands: usize = scales.iter().map(|(_, ranks)| bands_of(ranks.clone()).len()).sum();
    let height =
        [(12, 14), (21, 13), (33, 10)].into_iter().find(|&(most, _)| bands <= most).map_or(7, |(_, height)| height);
    let (top, bottom) = (66, 66 + bands * (height + 1) + 2 * (SCALE_BAND + 4) + 40);
    let mut svg = Svg::new(WIDTH, bottom as f64 + 46.0, "status of the ranks");
    legend(&mut svg, timeline);
    let chart = Bands { timeline, height, column };
    let mut y = top;
    for (name, ranks) in scales {
        if name == "micro scale" {
            let x = |time: f64| LEFT + time / timeline.seconds * BANDS as f64;
            migrations(&mut svg, &timeline.migrations.iter().map(|&time| x(time)).collect::<Vec<_>>(), y as f64);
        }
        y = chart.draw_scale(&mut svg, name, ranks, y) + 22;
    }
    ends(&mut svg, timeline, [top as f64 - 4.0, bottom as f64]);
    time_axis(&mut svg, timeline.seconds, bottom as f64);
    svg.finish()
}

/// Returns the ranks of each band of a scale.
fn bands_of(ranks: Range<usize>) -> Vec<Range<usize>> {
    let most = if ranks.len() > MOST_RANKS { SHARED_BANDS } else { MOST_RANKS };
    groups(ranks, most)
}

/// The bands of a chart.
struct Bands<'a> {
    timeline: &'a Timeline,
    /// Height of the band of a rank, pixels.
    height: usize,
    /// Width of a column, pixels.
    column: usize,
}

impl Bands<'_> {
    /// Draws the bands of a scale from `y` downward: one for the whole scale, then its ranks. Returns the lower end.
    fn draw_scale(&self, svg: &mut Svg, name: &str, ranks: Range<usize>, y: usize) -> usize {
        let label = |svg: &mut Svg, y: f64, size: f64, text: &str| {
            svg.text([LEFT - 8.0, y], size, Anchor::End, INK, text);
        };
        let of_ranks = &self.timeline.ranks[ranks.clone()];
        label(svg, y as f64 + 12.0, LARGE, name);
        self.band(svg, &[of_scale(of_ranks)], y, SCALE_BAND);
        let mut y = y + SCALE_BAND + 4;
        let bands = bands_of(ranks);
        // Labels need 11 pixels.
        let every = 11usize.div_ceil(self.height + 1);
        for (k, group) in bands.into_iter().enumerate() {
            if k.is_multiple_of(every) {
                let (first, last) = (group.start, group.end - 1);
                let text = if first == last { format!("rank {first}") } else { format!("ranks {first}\u{2013}{last}") };
                label(svg, (y + self.height / 2) as f64 + 4.0, SMALL, &text);
            }
            self.band(svg, &self.timeline.ranks[group], y, self.height);
            y += self.height + 1;
        }
        y
    }

    /// Draws a band: in each column, the shares of all statuses are stacked.
    fn band(&self, svg: &mut Svg, ranks: &[Vec<Segment>], y: usize, height: usize) {
        svg.rectangle([LEFT, y as f64, BANDS as f64, height as f64], UNRECORDED);
        let columns = Columns::of(ranks, self.timeline.seconds, BANDS / self.column);
        // From the top of the stack, so that each status covers those above it.
        for status in Status::ALL.into_iter().rev() {
            let below = (status as usize).checked_sub(1).map(|k| columns.levels(Status::ALL[k], 2 * height));
            let levels = columns.levels(status, 2 * height);
            if below.as_ref() != Some(&levels) {
                let path = outline(&levels, self.column, y + height);
                svg.data(&path, &format!("fill=\"{}\" shape-rendering=\"crispEdges\"", COLORS[status as usize]));
            }
        }
    }
}

/// Returns the path around columns of these heights, in half pixels, on a base line.
fn outline(levels: &[usize], width: usize, base: usize) -> String {
    let mut path = format!("M{LEFT} {base}");
    let (mut level, mut pending) = (0, 0);
    for &next in levels {
        if next != level {
            if pending > 0 {
                let _ = write!(path, "h{pending}");
            }
            let _ = write!(path, "v{}", (level as f64 - next as f64) / 2.0);
            (level, pending) = (next, 0);
        }
        pending += width;
    }
    if pending > 0 {
        let _ = write!(path, "h{pending}");
    }
    if level > 0 {
        let _ = write!(path, "v{}", level as f64 / 2.0);
    }
    path + "z"
}

fn legend(svg: &mut Svg, timeline: &Timeline) {
    const Y: f64 = 20.0;
    let mut x = LEFT;
    let mut entry = |svg: &mut Svg, name: &str, draw: &dyn Fn(&mut Svg, f64)| {
        draw(svg, x);
        svg.text([x + 18.0, Y + 4.0], SMALL, Anchor::Start, INK, name);
        x += 42.0 + text_width(name, SMALL);
    };
    let patch = |fill: String| move |svg: &mut Svg, x: f64| svg.rectangle([x, Y - 6.0, 12.0, 12.0], &fill);
    for (name, color) in NAMES.iter().zip(COLORS) {
        entry(svg, name, &patch(format!("fill=\"{color}\"")));
    }
    entry(svg, "not recorded", &patch(UNRECORDED.into()));
    entry(svg, "end of a load step", &|svg, x| svg.path(&[[x + 6.0, Y - 8.0], [x + 6.0, Y + 8.0]], false, AXIS));
    if timeline.ends.iter().any(|end| end.outcome == Outcome::Failed) {
        let line = |svg: &mut Svg, x: f64| svg.path(&[[x + 6.0, Y - 8.0], [x + 6.0, Y + 8.0]], false, FAILED);
        entry(svg, "failed attempt", &line);
    }
    if !timeline.migrations.is_empty() {
        entry(svg, "migration", &|svg, x| mark(svg, [x + 6.0, Y + 5.0]));
    }
}

/// Draws marks of migrations above `y`; marks that would nearly coincide are drawn once.
fn migrations(svg: &mut Svg, places: &[f64], y: f64) {
    for x in apart(places.iter().copied(), 6.0) {
        mark(svg, [x, y - 2.0]);
    }
}

/// Draws the ends of load steps and of failed attempts, across the bands unless there are too many.
fn ends(svg: &mut Svg, timeline: &Timeline, [top, bottom]: [f64; 2]) {
    let x = |time: f64| LEFT + time / timeline.seconds * BANDS as f64;
    let of = |outcome: Outcome| timeline.ends.iter().filter(move |end| end.outcome == outcome);
    let lines = |outcome: Outcome| -> Vec<[[f64; 2]; 2]> {
        let places: Vec<f64> = apart(of(outcome).map(|end| x(end.time)), 3.0).collect();
        let to = if places.len() > MOST_LINES { top + 4.0 } else { bottom };
        places.into_iter().map(|x| [[x, top], [x, to]]).collect()
    };
    svg.segments(&lines(Outcome::Failed), FAILED);
    svg.segments(&lines(Outcome::Converged), "stroke=\"#1b2733\"");
    let count = of(Outcome::Converged).count();
    let every = round_step(count as f64 / MOST_NUMBERS as f64).max(1.0) as usize;
    let mut free = f64::NEG_INFINITY;
    for end in of(Outcome::Converged).filter(|end| end.step.is_multiple_of(every)) {
        let (at, text) = (x(end.time), end.step.to_string());
        let half = text_width(&text, SMALL) / 2.0;
        if at - half >= free {
            svg.text([at, top - 5.0], SMALL, Anchor::Middle, INK, &text);
            free = at + half + 5.0;
        }
    }
    svg.text([LEFT - 8.0, top - 5.0], SMALL, Anchor::End, INK, "end of step");
}

fn time_axis(svg: &mut Svg, seconds: f64, y: f64) {
    let axis = Axis::new(0.0..seconds, [LEFT, LEFT + BANDS as f64], 12, 0.0);
    axis.draw_horizontal(svg, y);
    svg.text([LEFT + BANDS as f64 / 2.0, y + 38.0], LARGE, Anchor::Middle, INK, "wall time in s");
}

#[cfg(test)]
mod tests {
    use super::super::timeline::AttemptEnd;
    use super::*;

    /// Returns a run of ranks that compute and wait in turn, with a step after every tenth sweep.
    fn timeline(ranks: usize, sweeps: usize) -> Timeline {
        let of_rank = |rank: usize| {
            let share = 0.3 + 0.5 * ((rank * 7919) % 101) as f64 / 101.0;
            let of_sweep = |k: usize| {
                let [start, middle, end] = [0.0, share + 0.1 * ((k * 31) % 7) as f64 / 7.0, 1.0].map(|t| k as f64 + t);
                let segment = |start, end, status| Segment { start, end, status };
                [segment(start, middle, Status::Busy), segment(middle, end, Status::Idle)]
            };
            (0..sweeps).flat_map(of_sweep).collect()
        };
        let end = |k: usize| {
            let outcome = if k == 1 { Outcome::Failed } else { Outcome::Converged };
            AttemptEnd { time: 10.0 * k as f64, step: k, outcome }
        };
        Timeline {
            ranks: (0..ranks).map(of_rank).collect(),
            ends: (1..=sweeps / 10).map(end).collect(),
            migrations: (0..sweeps / 10).map(|k| 10.0 * k as f64 + 1.0).collect(),
            seconds: sweeps as f64,
        }
    }

    #[test]
    fn a_few_ranks_have_a_band_each_and_marks() {
        let chart = draw(&timeline(4, 30), 1).unwrap();
        assert!(!chart.is_grouped);
        for words in ["macro scale", "micro scale", ">rank 3<", "failed attempt", "migration", "wall time in s", ">30<"]
        {
            assert!(chart.svg.contains(words), "{words}");
        }
        // A band of each rank and of each scale on gray, and the sample of gray in the legend.
        assert_eq!(chart.svg.matches(UNRECORDED).count(), 4 + 2 + 1);
        let triangles = chart.svg.lines().filter(|line| line.starts_with("<path") && line.contains(COLORS[2])).count();
        assert_eq!(triangles, 3 + 1);
        assert_eq!(chart.svg.matches("stroke-dasharray").count(), 1 + 1);
    }

    #[test]
    fn many_ranks_and_sweeps_give_a_small_chart() {
        for (ranks, sweeps) in [(64, 300), (64, 1000), (64, 5000), (1000, 400)] {
            let chart = draw(&timeline(ranks, sweeps), 1).unwrap();
            assert!(chart.svg.len() < 300_000, "{ranks} {sweeps}: {} bytes", chart.svg.len());
            assert!(chart.is_grouped && chart.svg.contains(">ranks 1\u{2013}"), "{ranks} {sweeps}");
        }
    }

    #[test]
    fn a_column_is_as_high_as_its_share() {
        assert_eq!(outline(&[0, 0, 4, 4, 1, 0], 2, 50), "M104 50h4v-2h4v1.5h2v0.5h2z");
        assert_eq!(outline(&[2], 3, 9), "M104 9v-1h3v1z");
    }

    #[test]
    fn a_run_without_times_has_no_chart() {
        assert!(draw(&Timeline::default(), 0).is_none());
        assert!(draw(&Timeline { ranks: vec![Vec::new(); 3], ..Timeline::default() }, 1).is_none());
    }
}
