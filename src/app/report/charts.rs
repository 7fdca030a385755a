//! Charts as SVG text: lines, extension with iteration counts, stacked bars.
//!
//! Charts and pictures share one SVG writer (`svg.rs`), because the crate `plotters` cannot draw the pictures:
//! its backends round coordinates to whole pixels, write one element per segment (a picture of a network has 10 000
//! segments), and support no groups, gradients, dashes or round line ends.

use std::ops::Range;

use super::picture::color::viridis;
use super::svg::{Anchor, Svg, hex, text_width};
use super::units::{multiples, round_step, significant, tick_label};

/// Okabe and Ito's colors, distinguishable for color-blind readers.
const COLORS: [&str; 7] = ["#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9", "#3c3c3c"];
/// Attributes of the bars of iteration counts.
const PALE: &str = "fill=\"#bed0dc\"";
pub(super) const INK: &str = "fill=\"#1b2733\"";
pub(super) const AXIS: &str = "fill=\"none\" stroke=\"#1b2733\"";
const GRID: &str = "stroke=\"#dee4e8\"";

/// Size of a chart, pixels.
const SIZE: [f64; 2] = [620.0, 340.0];
/// Ends of the horizontal axis on the page, and its right end beside a second vertical axis.
const LEFT: f64 = 80.0;
const RIGHT: f64 = 608.0;
const RIGHT_OF_TWO: f64 = 558.0;
/// Ends of the vertical axes on the page, from bottom to top.
const HEIGHT: [f64; 2] = [286.0, 12.0];
/// Font size of ticks and legend, pixels.
pub(super) const SMALL: f64 = 11.3;
/// Font size of the labels of the axes, pixels.
pub(super) const LARGE: f64 = 12.1;

/// A named line.
#[derive(Clone, Debug, PartialEq)]
pub struct Line {
    /// Name in the legend.
    pub name: String,
    /// The points of the line, in order.
    pub points: Vec<(f64, f64)>,
}

/// The name of a chart and the labels of its axes.
#[derive(Clone, Copy, Debug)]
pub struct Labels<'a> {
    /// Name of the chart, for screen readers.
    pub chart: &'static str,
    /// Label of the horizontal axis.
    pub x: &'a str,
    /// Label of the left vertical axis.
    pub y: &'a str,
}

/// An axis: the numbers and the pixels at its ends, and its ticks with their labels.
pub(super) struct Axis {
    range: Range<f64>,
    pixels: [f64; 2],
    ticks: Vec<(f64, String)>,
}

impl Axis {
    /// Creates an axis with at most `most` ticks, which are at least `least_step` apart.
    pub(super) fn new(range: Range<f64>, pixels: [f64; 2], most: usize, least_step: f64) -> Self {
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
    fn of_increments(last: f64, right: f64) -> Self {
        Self::new(0.4..last + 0.6, [LEFT, right], 10, 1.0)
    }

    /// Returns the pixel coordinate of a value.
    fn place(&self, value: f64) -> f64 {
        let [from, to] = self.pixels;
        from + (value - self.range.start) / (self.range.end - self.range.start) * (to - from)
    }

    /// Draws a horizontal axis at `y`, with its ticks and labels below.
    pub(super) fn draw_horizontal(&self, svg: &mut Svg, y: f64) {
        let [left, right] = self.pixels;
        svg.path(&[[left, y], [right, y]], false, AXIS);
        for (tick, label) in &self.ticks {
            let at = self.place(*tick);
            svg.path(&[[at, y], [at, y + 5.0]], false, AXIS);
            svg.text([at, y + 19.0], SMALL, Anchor::Middle, INK, label);
        }
    }

    /// Draws a vertical axis at `x`, with its ticks and labels to the left (`side = -1`) or to the right (`side = 1`).
    fn draw_vertical(&self, svg: &mut Svg, x: f64, side: f64, label: &str) {
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

/// A chart under construction.
struct Chart {
    svg: Svg,
    x: Axis,
    y: Axis,
}

impl Chart {
    /// Draws the axes and the horizontal grid lines; also the vertical ones if `with_columns`.
    fn new(labels: Labels, x: Axis, y: Axis, with_columns: bool) -> Self {
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
    fn line(&mut self, points: impl IntoIterator<Item = (f64, f64)>, color: &str, width: f64) {
        let finite = points.into_iter().filter(|(x, y)| x.is_finite() && y.is_finite());
        let places: Vec<[f64; 2]> = finite.map(|(x, y)| [self.x.place(x), self.y.place(y)]).collect();
        if places.len() > 1 {
            self.svg.path(&places, false, &format!("fill=\"none\" stroke=\"{color}\" stroke-width=\"{width}\""));
        }
        self.svg.circles(&places, width + 1.0, &format!("fill=\"{color}\""));
    }

    /// Draws bars given as `(x, [bottom, top])`, with half width `half`, on the vertical axis `y` (`None`: the left
    /// axis).
    fn bars(&mut self, bars: impl Iterator<Item = (f64, [f64; 2])>, y: Option<&Axis>, half: f64, fill: &str) {
        let y = y.unwrap_or(&self.y);
        for (x, ends) in bars.filter(|(_, ends)| ends[1] > ends[0]) {
            let [left, right] = [self.x.place(x - half), self.x.place(x + half)];
            let [bottom, top] = ends.map(|end| y.place(end));
            self.svg.rectangle([left, top, right - left, bottom - top], fill);
        }
    }

    /// Draws the legend into the corner `[right, upper]`, unless there is only one line.
    fn legend(&mut self, lines: &[Line], [right, upper]: [bool; 2], with_bars: bool) {
        const ROW: f64 = 17.6;
        if lines.len() < 2 {
            return;
        }
        let widest = lines.iter().map(|line| text_width(&line.name, SMALL)).fold(0.0, f64::max);
        let (width, height) = (widest + 48.0, ROW * lines.len() as f64 + 13.0);
        let ([from, to], [bottom, top]) = (self.x.pixels, self.y.pixels);
        let x = if right { to - 5.0 - width } else { from + 5.0 };
        let y = if upper { top + 5.0 } else { bottom - 5.0 - height };
        self.svg.rectangle([x, y, width, height], &format!("fill=\"#fff\" fill-opacity=\".85\" {GRID}"));
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
fn range(values: impl Iterator<Item = f64>) -> Range<f64> {
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

/// Draws lines over linear axes.
pub fn lines(labels: Labels, lines: &[Line]) -> String {
    let points = || lines.iter().flat_map(|line| line.points.iter().copied());
    let x = Axis::new(range(points().map(|(x, _)| x)), [LEFT, RIGHT], 8, 0.0);
    let y = Axis::new(range(points().map(|(_, y)| y)), HEIGHT, 6, 0.0);
    let corner = emptiest_corner(lines, &x.range, &y.range);
    let mut chart = Chart::new(labels, x, y, true);
    for (line, color) in lines.iter().zip(COLORS.iter().cycle()) {
        chart.line(line.points.iter().copied(), color, 2.0);
    }
    chart.legend(lines, corner, false);
    chart.svg.finish()
}

/// Returns the corner (right, upper), about as large as a legend, that contains the fewest points of the lines.
fn emptiest_corner(lines: &[Line], x: &Range<f64>, y: &Range<f64>) -> [bool; 2] {
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

/// Draws lines with a logarithmic vertical axis; values that are not positive are omitted.
pub fn logarithmic(labels: Labels, lines: &[Line]) -> String {
    // The logarithm of a number that is not positive is not finite.
    let points = |line: &Line| line.points.iter().map(|&(x, y)| (x, y.log10())).collect::<Vec<_>>();
    let lines: Vec<Vec<(f64, f64)>> = lines.iter().map(points).collect();
    let drawn = || lines.iter().flatten().filter(|(_, y)| y.is_finite());
    let last = drawn().map(|&(x, _)| x).fold(1.0, f64::max);
    let exponents = range(drawn().map(|&(_, y)| y));
    let x = Axis::new(0.0..last + 0.2, [LEFT, RIGHT], 8, 1.0);
    let mut y = Axis::new(exponents.start.floor()..exponents.end.ceil(), HEIGHT, 13, 1.0);
    y.ticks.iter_mut().for_each(|(tick, label)| *label = format!("1e{tick}"));
    let mut chart = Chart::new(labels, x, y, false);
    let last = lines.len().saturating_sub(1).max(1) as f64;
    for (k, line) in lines.into_iter().enumerate() {
        chart.line(line, &hex(viridis(0.9 * k as f64 / last)), 1.0);
    }
    chart.svg.finish()
}

/// Draws the extension of every increment as a line (left axis) and its Newton iterations as bars (right axis) against
/// the increment number, which starts at 1.
pub fn extension_and_iterations(labels: Labels, extension: &[(f64, f64)], iterations: &[(f64, f64)]) -> String {
    let last = extension.iter().chain(iterations).map(|&(x, _)| x).fold(1.0, f64::max);
    let left = range(extension.iter().map(|&(_, y)| y).chain([0.0]));
    // The scale of the right axis keeps the bars in the lower part of the chart, below the line.
    let most = iterations.iter().map(|&(_, y)| y).fold(1.0, f64::max);
    let mut right = Axis::new(0.0..1.8 * most, HEIGHT, 6, 1.0);
    right.ticks.retain(|&(tick, _)| tick <= most + 0.5);
    let x = Axis::of_increments(last, RIGHT_OF_TWO);
    let mut chart = Chart::new(labels, x, Axis::new(left, HEIGHT, 10, 0.0), false);
    right.draw_vertical(&mut chart.svg, RIGHT_OF_TWO, 1.0, "Newton iterations (bars)");
    chart.bars(iterations.iter().map(|&(x, y)| (x, [0.0, y])), Some(&right), 0.32, PALE);
    chart.line(extension.iter().copied(), COLORS[0], 2.0);
    chart.svg.finish()
}

/// Draws stacked bars against the increment number, which starts at 1: one layer per line, in order from the bottom.
pub fn stacked_bars(labels: Labels, layers: &[Line]) -> String {
    let increments = layers.iter().map(|layer| layer.points.len()).max().unwrap_or(0);
    let height = |k: usize| layers.iter().filter_map(|layer| layer.points.get(k)).map(|&(_, y)| y).sum::<f64>();
    let top = range((0..increments).map(height).chain([0.0])).end.max(f64::MIN_POSITIVE);
    // Space above the bars for the legend, one row per layer.
    let room = 1.0 / (1.0 - (0.075 * layers.len() as f64).min(0.6));
    let last = layers.iter().flat_map(|layer| &layer.points).map(|&(x, _)| x).fold(1.0, f64::max);
    let y = Axis::new(0.0..room * top, HEIGHT, 6, 0.0);
    let mut chart = Chart::new(labels, Axis::of_increments(last, RIGHT), y, false);
    let mut bases = vec![0.0; increments];
    for (layer, color) in layers.iter().zip(COLORS.iter().cycle()) {
        let bars = layer.points.iter().zip(&mut bases).map(|(&(x, y), base)| {
            let bottom = *base;
            *base += y;
            (x, [bottom, *base])
        });
        chart.bars(bars, None, 0.36, &format!("fill=\"{color}\""));
    }
    chart.legend(layers, [false, true], true);
    chart.svg.finish()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_range_of_an_axis_contains_all_values() {
        for values in [&[0.0, 0.3][..], &[5.0], &[-3.0, -0.1], &[1e-9, 2e-9], &[0.0], &[], &[f64::NAN, 1.0]] {
            let range = range(values.iter().copied());
            assert!(range.start < range.end, "{values:?}");
            assert!(
                values.iter().all(|value| value.is_nan() || (range.start..=range.end).contains(value)),
                "{values:?}"
            );
        }
    }

    #[test]
    fn an_axis_has_the_expected_number_of_ticks_and_maps_its_ends_to_its_pixels() {
        for (range, count) in [(0.0..6.05, 7), (-6.0..6.05, 3), (0.0..25.2, 6), (0.0..30.1, 4), (1e-9..2e-9, 6)] {
            let axis = Axis::new(range.clone(), HEIGHT, if count == 7 { 8 } else { 6 }, 0.0);
            assert_eq!(axis.ticks.len(), count, "{range:?}: {:?}", axis.ticks);
            assert_eq!((axis.place(range.start), axis.place(range.end)), (HEIGHT[0], HEIGHT[1]));
        }
        let axis = Axis::new(0.0..2e-12, HEIGHT, 3, 0.0);
        assert_eq!(
            axis.ticks.iter().map(|(_, label)| label.as_str()).collect::<Vec<_>>(),
            ["0", "1.00e-12", "2.00e-12"]
        );
    }

    #[test]
    fn layers_of_bars_are_stacked() {
        let layer = |name: &str, y: f64| Line { name: name.into(), points: vec![(1.0, y), (2.0, 0.0)] };
        let labels = Labels { chart: "layers", x: "x", y: "y" };
        let svg = stacked_bars(labels, &[layer("a", 1.0), layer("b", 3.0)]);
        let number = |line: &str, key: &str| -> f64 {
            let (_, rest) = line.split_once(&format!(" {key}=\"")).unwrap();
            rest.split('"').next().unwrap().parse().unwrap()
        };
        // The samples in the legend are small, and its background has a border.
        let is_bar =
            |line: &&str| line.starts_with("<rect x") && !line.contains("stroke") && number(line, "width") > 20.0;
        let bars: Vec<&str> = svg.lines().filter(is_bar).collect();
        let [lower, upper] = bars[..] else { panic!("{svg}") };
        assert!((number(upper, "y") + number(upper, "height") - number(lower, "y")).abs() < 0.11, "{svg}");
        assert!((number(upper, "height") / number(lower, "height") - 3.0).abs() < 0.01, "{svg}");
    }

    #[test]
    fn a_chart_without_data_is_empty() {
        let labels = Labels { chart: "nothing", x: "x", y: "y" };
        let one = [Line { name: "a".into(), points: vec![(1.0, f64::NAN)] }];
        for chart in [
            lines(labels, &[]),
            lines(labels, &one),
            logarithmic(labels, &one),
            stacked_bars(labels, &[]),
            extension_and_iterations(labels, &[], &[]),
        ] {
            assert!(chart.ends_with("</svg>\n") && !chart.contains("NaN") && !chart.contains("inf"), "{chart}");
        }
    }
}
