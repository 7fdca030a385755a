//! The frame of a chart: axes, grid, legend, and what is drawn in it.

use std::ops::Range;

use super::super::svg::{Anchor, Svg, text_width};
use super::super::units::{multiples, round_step, significant, tick_label};
use super::{Labels, Line};

/// Okabe and Ito's colors, distinguishable for color-blind readers.
pub(super) const COLORS: [&str; 7] = ["#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9", "#3c3c3c"];
pub(in crate::app::report) const INK: &str = "fill=\"#1b2733\"";
pub(in crate::app::report) const AXIS: &str = "fill=\"none\" stroke=\"#1b2733\"";
const GRID: &str = "stroke=\"#dee4e8\"";

/// Size of a chart, pixels.
const SIZE: [f64; 2] = [620.0, 340.0];
/// Ends of the horizontal axis on the page, and its right end beside a second vertical axis.
pub(super) const LEFT: f64 = 80.0;
pub(super) const RIGHT: f64 = 608.0;
pub(super) const RIGHT_OF_TWO: f64 = 558.0;
/// Ends of the vertical axes on the page, from bottom to top.
pub(super) const HEIGHT: [f64; 2] = [286.0, 12.0];
/// Font size of ticks and legend, pixels.
pub(in crate::app::report) const SMALL: f64 = 11.3;
/// Font size of the labels of the axes, pixels.
pub(in crate::app::report) const LARGE: f64 = 12.1;

/// An axis: the numbers and the pixels at its ends, and its ticks with their labels.
pub(in crate::app::report) struct Axis {
    pub(super) range: Range<f64>,
    pixels: [f64; 2],
    pub(super) ticks: Vec<(f64, String)>,
}

impl Axis {
    /// Creates an axis with at most `most` ticks, which are at least `least_step` apart.
    pub(in crate::app::report) fn new(range: Range<f64>, pixels: [f64; 2], most: usize, least_step: f64) -> Self {
        let step = round_step((range.end - range.start) / (most + 1) as f64).max(least_step);
        let mut ticks = multiples(step, range.start, range.end);
        if ticks.len() > most {
            ticks = multiples(round_step(1.01 * step), range.start, range.end);
        }
        let label = |tick: f64| Some(tick_label(tick, &ticks)).filter(|label| label.len() <= 6);
        let labeled = ticks.iter().map(|&tick| (tick, label(tick).unwrap_or_else(|| significant(tick)))).collect();
        Self { range, pixels, ticks: labeled }
    }

    /// Creates an axis for the increment numbers 1 to `last`, with space for half a bar at both ends.
    pub(super) fn of_increments(last: f64, right: f64) -> Self {
        Self::new(0.4..last + 0.6, [LEFT, right], 10, 1.0)
    }

    /// Returns the pixel coordinate of a value.
    pub(super) fn place(&self, value: f64) -> f64 {
        let [from, to] = self.pixels;
        from + (value - self.range.start) / (self.range.end - self.range.start) * (to - from)
    }

    /// Draws a horizontal axis at `y`, with its ticks and labels below.
    pub(in crate::app::report) fn draw_horizontal(&self, svg: &mut Svg, y: f64) {
        let [left, right] = self.pixels;
        svg.path(&[[left, y], [right, y]], false, AXIS);
        for (tick, label) in &self.ticks {
            let at = self.place(*tick);
            svg.path(&[[at, y], [at, y + 5.0]], false, AXIS);
            svg.text([at, y + 19.0], SMALL, Anchor::Middle, INK, label);
        }
    }

    /// Draws a vertical axis at `x`, with its ticks and labels to the left (`side = -1`) or to the right (`side = 1`).
    pub(super) fn draw_vertical(&self, svg: &mut Svg, x: f64, side: f64, label: &str) {
        let [bottom, top] = self.pixels;
        svg.path(&[[x, top], [x, bottom]], false, AXIS);
        let anchor = if side < 0.0 { Anchor::End } else { Anchor::Start };
        for (tick, label) in self.ticks.iter().filter(|(_, label)| !label.is_empty()) {
            let y = self.place(*tick);
            svg.path(&[[x, y], [x + 5.0 * side, y]], false, AXIS);
            svg.text([x + 10.0 * side, y + 4.0], SMALL, anchor, INK, label);
        }
        let [x, y] = [if side < 0.0 { 21.0 } else { SIZE[0] - 21.0 }, (bottom + top) / 2.0];
        let turned = format!("{INK} transform=\"rotate({} {x} {y})\"", 90.0 * side);
        svg.text([x, y], LARGE, Anchor::Middle, &turned, label);
    }
}

/// Most points of a line that are drawn: with more, they would touch.
const MOST_POINTS: usize = 100;

/// A chart under construction.
pub(in crate::app::report) struct Chart {
    pub(super) svg: Svg,
    x: Axis,
    y: Axis,
}

impl Chart {
    /// Draws the axes and the horizontal grid lines; also the vertical ones if `with_columns`.
    pub(super) fn new(labels: Labels, x: Axis, y: Axis, with_columns: bool) -> Self {
        let mut svg = Svg::new(SIZE[0], SIZE[1], labels.chart);
        let ([left, right], [bottom, top]) = (x.pixels, y.pixels);
        let mut grid: Vec<[[f64; 2]; 2]> =
            y.ticks.iter().map(|(tick, _)| y.place(*tick)).map(|at| [[left, at], [right, at]]).collect();
        if with_columns {
            grid.extend(x.ticks.iter().map(|(tick, _)| x.place(*tick)).map(|at| [[at, bottom], [at, top]]));
        }
        svg.segments(&grid, GRID);
        y.draw_vertical(&mut svg, left, -1.0, labels.y);
        x.draw_horizontal(&mut svg, bottom);
        svg.text([(left + right) / 2.0, SIZE[1] - 15.0], LARGE, Anchor::Middle, INK, labels.x);
        Self { svg, x, y }
    }

    /// Draws a line and its points; points with a coordinate that is not finite are omitted.
    pub(in crate::app::report) fn line(
        &mut self,
        points: impl IntoIterator<Item = (f64, f64)>,
        color: &str,
        width: f64,
    ) {
        let finite = points.into_iter().filter(|(x, y)| x.is_finite() && y.is_finite());
        let places: Vec<[f64; 2]> = finite.map(|(x, y)| [self.x.place(x), self.y.place(y)]).collect();
        if places.len() > 1 {
            self.svg.path(&places, false, &format!("fill=\"none\" stroke=\"{color}\" stroke-width=\"{width}\""));
        }
        if places.len() <= MOST_POINTS {
            self.svg.circles(&places, width + 1.0, &format!("fill=\"{color}\""));
        }
    }

    /// Creates a chart of numbered points with a given range of values, and the legend of its lines to its right.
    pub(in crate::app::report) fn with_legend(labels: Labels, x: Range<f64>, y: Range<f64>, lines: &[Line]) -> Self {
        let right = RIGHT - legend_size(lines)[0];
        let x = Axis::new(x, [LEFT, right], 10, 1.0);
        let mut chart = Self::new(labels, x, Axis::new(y, HEIGHT, 6, 0.0), false);
        chart.legend_at(lines, [right + 6.0, HEIGHT[1]], false);
        chart
    }

    /// Draws vertical lines over the whole height.
    pub(in crate::app::report) fn columns(&mut self, places: &[f64]) {
        let [bottom, top] = self.y.pixels;
        let lines: Vec<_> = places.iter().map(|&x| self.x.place(x)).map(|x| [[x, bottom], [x, top]]).collect();
        self.svg.segments(&lines, "stroke=\"#7b8a94\"");
    }

    /// Fills the area between two lines with the same horizontal coordinates.
    pub(in crate::app::report) fn area(&mut self, lower: &[(f64, f64)], upper: &[(f64, f64)], color: &str) {
        let around = lower.iter().chain(upper.iter().rev());
        let places: Vec<[f64; 2]> = around.map(|&(x, y)| [self.x.place(x), self.y.place(y)]).collect();
        if lower.len() > 1 {
            self.svg.path(&places, true, &format!("fill=\"{color}\""));
        }
    }

    /// Marks places at the upper edge; marks that would nearly coincide are drawn once.
    pub(in crate::app::report) fn marks(&mut self, places: &[f64]) {
        let top = self.y.pixels[1];
        let places: Vec<f64> = apart(places.iter().map(|&x| self.x.place(x)), 6.0).collect();
        places.into_iter().for_each(|x| mark(&mut self.svg, [x, top + 8.0]));
    }

    /// Returns the chart.
    pub(in crate::app::report) fn finish(self) -> String {
        self.svg.finish()
    }

    /// Draws bars given as `(x, [bottom, top])`, with half width `half`, on the vertical axis `y` (`None`: the left
    /// axis).
    pub(super) fn bars(
        &mut self,
        bars: impl Iterator<Item = (f64, [f64; 2])>,
        y: Option<&Axis>,
        half: f64,
        fill: &str,
    ) {
        let y = y.unwrap_or(&self.y);
        for (x, ends) in bars.filter(|(_, ends)| ends[1] > ends[0]) {
            let [left, right] = [self.x.place(x - half), self.x.place(x + half)];
            let [bottom, top] = ends.map(|end| y.place(end));
            self.svg.rectangle([left, top, right - left, bottom - top], fill);
        }
    }

    /// Draws the legend into the corner `[right, upper]`, unless there is only one line.
    pub(super) fn legend(&mut self, lines: &[Line], [right, upper]: [bool; 2], with_bars: bool) {
        if lines.len() < 2 {
            return;
        }
        let [width, height] = legend_size(lines);
        let ([from, to], [bottom, top]) = (self.x.pixels, self.y.pixels);
        let x = if right { to - 5.0 - width } else { from + 5.0 };
        let y = if upper { top + 5.0 } else { bottom - 5.0 - height };
        self.svg.rectangle([x, y, width, height], &format!("fill=\"#fff\" fill-opacity=\".85\" {GRID}"));
        self.legend_at(lines, [x, y], with_bars);
    }

    /// Draws the rows of a legend from a place to the right and downward.
    fn legend_at(&mut self, lines: &[Line], [x, y]: [f64; 2], with_bars: bool) {
        for (k, (line, color)) in lines.iter().zip(COLORS.iter().cycle()).enumerate() {
            let middle = y + 15.0 + ROW * k as f64;
            if with_bars {
                self.svg.rectangle([x + 12.0, middle - 5.0, 12.0, 10.0], &format!("fill=\"{color}\""));
            } else {
                let sample = [[x + 10.0, middle], [x + 28.0, middle]];
                self.svg.path(&sample, false, &format!("stroke=\"{color}\" stroke-width=\"2\""));
            }
            self.svg.text([x + 40.0, middle + 4.0], SMALL, Anchor::Start, INK, &line.name);
        }
    }
}

/// Returns an axis range that contains all values, rounded outward. It includes zero if the smallest magnitude is less
/// than half of the largest.
pub(in crate::app::report) fn range(values: impl Iterator<Item = f64>) -> Range<f64> {
    let finite = values.filter(|value| value.is_finite());
    let (low, high) = finite.fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), value| (a.min(value), b.max(value)));
    if low > high {
        return 0.0..1.0;
    }
    let (low, high) = if low > 0.0 && low < 0.5 * high { (0.0, high) } else { (low, high) };
    let (low, high) = if high < 0.0 && high > 0.5 * low { (low, 0.0) } else { (low, high) };
    let step = round_step((high - low) / 10.0);
    if step == 0.0 {
        let margin = if low == 0.0 { 1.0 } else { 0.1 * low.abs() };
        return low - margin..high + margin;
    }
    // A small margin, so that a line along the upper edge is fully visible.
    ((low / step + 1e-9).floor() * step)..((high / step - 1e-9).ceil() * step + 0.05 * step)
}

/// Height of a row of a legend, pixels.
const ROW: f64 = 17.6;

/// Returns width and height of a legend, pixels.
fn legend_size(lines: &[Line]) -> [f64; 2] {
    let widest = lines.iter().map(|line| text_width(&line.name, SMALL)).fold(0.0, f64::max);
    [widest + 48.0, ROW * lines.len() as f64 + 13.0]
}

/// Draws a triangle that points down to a place: the mark of a migration.
pub(in crate::app::report) fn mark(svg: &mut Svg, [x, y]: [f64; 2]) {
    svg.path(&[[x - 4.5, y - 9.0], [x + 4.5, y - 9.0], [x, y]], true, &format!("fill=\"{}\"", COLORS[0]));
}

/// Returns the first of ascending places, and each further one at a distance from the last one returned.
pub(in crate::app::report) fn apart(places: impl Iterator<Item = f64>, distance: f64) -> impl Iterator<Item = f64> {
    let mut last = f64::NEG_INFINITY;
    places.filter(move |&place| {
        let is_apart = place - last >= distance;
        last = if is_apart { place } else { last };
        is_apart
    })
}

/// Returns the color of a line by its number.
pub(in crate::app::report) fn line_color(number: usize) -> &'static str {
    COLORS[number % COLORS.len()]
}

/// Returns the corner (right, upper), about as large as a legend, that contains the fewest points of the lines.
pub(super) fn emptiest_corner(lines: &[Line], x: &Range<f64>, y: &Range<f64>) -> [bool; 2] {
    const WIDE: f64 = 0.35;
    const HIGH: f64 = 0.3;
    let near = |value: f64, axis: &Range<f64>, far_end: bool, size: f64| {
        let part = (value - axis.start) / (axis.end - axis.start);
        if far_end { part > 1.0 - size } else { part < size }
    };
    let points = || lines.iter().flat_map(|line| &line.points);
    let inside = |&[right, upper]: &[bool; 2]| {
        points().filter(|(px, py)| near(*px, x, right, WIDE) && near(*py, y, upper, HIGH)).count()
    };
    let corners = [[false, true], [true, true], [true, false], [false, false]];
    corners.into_iter().min_by_key(inside).unwrap_or([false, true])
}
