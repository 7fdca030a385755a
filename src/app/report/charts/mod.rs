//! Charts as SVG text: lines, extension with iteration counts, stacked bars.
//!
//! Charts and pictures share one SVG writer (`svg.rs`), because the crate `plotters` cannot draw the pictures:
//! its backends round coordinates to whole pixels, write one element per segment (a picture of a network has 10 000
//! segments), and support no groups, gradients, dashes or round line ends.

mod frame;

use super::picture::color::viridis;
use super::svg::hex;
pub(super) use frame::{AXIS, Axis, Chart, INK, LARGE, SMALL, apart, line_color, mark, range};
use frame::{COLORS, HEIGHT, LEFT, RIGHT, RIGHT_OF_TWO, emptiest_corner};

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

/// Attributes of the bars of iteration counts.
const PALE: &str = "fill=\"#bed0dc\"";

/// Draws lines over linear axes. Where all horizontal coordinates are whole, such as numbers of load steps, so are the ticks.
pub fn lines(labels: Labels, lines: &[Line]) -> String {
    let points = || lines.iter().flat_map(|line| line.points.iter().copied());
    let least_step = if points().all(|(x, _)| x.fract() == 0.0) { 1.0 } else { 0.0 };
    let x = Axis::new(range(points().map(|(x, _)| x)), [LEFT, RIGHT], 8, least_step);
    let y = Axis::new(range(points().map(|(_, y)| y)), HEIGHT, 6, 0.0);
    let corner = emptiest_corner(lines, &x.range, &y.range);
    let mut chart = Chart::new(labels, x, y, true);
    for (line, color) in lines.iter().zip(COLORS.iter().cycle()) {
        chart.line(line.points.iter().copied(), color, 2.0);
    }
    chart.legend(lines, corner, false);
    chart.svg.finish()
}

/// Draws lines of numbers of very different sizes: the vertical axis is logarithmic, and values that are not positive are
/// omitted.
pub fn lines_by_magnitude(labels: Labels, lines: &[Line]) -> String {
    let logarithm = |line: &Line| {
        let points = line.points.iter().map(|&(x, y)| (x, y.log10())).filter(|(_, y)| y.is_finite()).collect();
        Line { name: line.name.clone(), points }
    };
    let lines: Vec<Line> = lines.iter().map(logarithm).collect();
    let points = || lines.iter().flat_map(|line| line.points.iter().copied());
    let exponents = range(points().map(|(_, y)| y));
    let x = Axis::new(range(points().map(|(x, _)| x)), [LEFT, RIGHT], 8, 1.0);
    let mut y = Axis::new(exponents.start.floor()..exponents.end.ceil(), HEIGHT, 6, 1.0);
    y.ticks.iter_mut().for_each(|(tick, label)| *label = 10f64.powi(*tick as i32).to_string());
    let corner = emptiest_corner(&lines, &x.range, &y.range);
    let mut chart = Chart::new(labels, x, y, true);
    for (line, color) in lines.iter().zip(COLORS.iter().cycle()) {
        chart.line(line.points.iter().copied(), color, 2.0);
    }
    chart.legend(&lines, corner, false);
    chart.svg.finish()
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
    fn ticks_of_whole_numbers_are_whole() {
        let labels = Labels { chart: "iterations", x: "load step", y: "iterations" };
        let ticks = |points: &[(f64, f64)]| {
            let svg = lines(labels, &[Line { name: "mean".into(), points: points.to_vec() }]);
            svg.contains(">1.2<")
        };
        assert!(!ticks(&[(1.0, 3.0), (2.0, 4.0)]));
        assert!(ticks(&[(1.0, 3.0), (1.5, 3.5), (2.0, 4.0)]));
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
    fn magnitudes_have_the_same_distance() {
        let line = Line { name: "a".into(), points: [(1.0, 2.0), (2.0, 20.0), (3.0, 200.0)].to_vec() };
        let svg = lines_by_magnitude(Labels { chart: "sizes", x: "x", y: "y" }, &[line]);
        for label in [">1<", ">10<", ">100<", ">1000<"] {
            assert!(svg.contains(label), "{label}: {svg}");
        }
        let drawn = svg.lines().find(|text| text.contains(COLORS[0])).unwrap();
        let path = drawn.split('"').find(|text| text.starts_with('M')).unwrap();
        let numbers: Vec<f64> =
            path.split(|c: char| !c.is_ascii_digit() && c != '.').filter_map(|n| n.parse().ok()).collect();
        let [_, a, _, b, _, c] = numbers[..] else { panic!("{path}") };
        assert!(a > b && (a - b - (b - c)).abs() < 0.11, "{path}");
    }

    #[test]
    fn a_chart_without_data_is_empty() {
        let labels = Labels { chart: "nothing", x: "x", y: "y" };
        let one = [Line { name: "a".into(), points: vec![(1.0, f64::NAN)] }];
        for chart in [
            lines(labels, &[]),
            lines(labels, &one),
            logarithmic(labels, &one),
            lines_by_magnitude(labels, &one),
            stacked_bars(labels, &[]),
            extension_and_iterations(labels, &[], &[]),
        ] {
            assert!(chart.ends_with("</svg>\n") && !chart.contains("NaN") && !chart.contains("inf"), "{chart}");
        }
    }
}
