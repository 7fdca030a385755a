//! Charts as SVG text, drawn with plotters: lines, extension with iteration counts, stacked bars.

use plotters::coord::ranged1d::ValueFormatter;
use plotters::coord::types::RangedCoordf64;
use plotters::prelude::*;

use super::ReportError;
use super::units::{round_step, significant};

/// Okabe and Ito's colors, distinguishable for color-blind readers.
const COLORS: [RGBColor; 7] = [
    RGBColor(0, 114, 178),
    RGBColor(213, 94, 0),
    RGBColor(0, 158, 115),
    RGBColor(204, 121, 167),
    RGBColor(230, 159, 0),
    RGBColor(86, 180, 233),
    RGBColor(60, 60, 60),
];
const INK: RGBColor = RGBColor(27, 39, 51);
const GRID: RGBColor = RGBColor(222, 228, 232);
const PALE: RGBColor = RGBColor(190, 208, 220);
const FONT: &str = "sans-serif";

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
    /// Name of the chart, for error messages and screen readers.
    pub chart: &'static str,
    /// Label of the horizontal axis.
    pub x: &'a str,
    /// Label of the left vertical axis.
    pub y: &'a str,
}

type Area<'a> = DrawingArea<SVGBackend<'a>, plotters::coord::Shift>;
type Drawn = Result<(), DrawingAreaErrorKind<std::io::Error>>;

fn svg(labels: Labels, draw: impl FnOnce(&Area) -> Drawn) -> Result<String, ReportError> {
    const SIZE: (u32, u32) = (620, 340);
    let mut text = String::new();
    let drawn = {
        let area = SVGBackend::with_string(&mut text, SIZE).into_drawing_area();
        area.fill(&WHITE).and_then(|()| draw(&area)).and_then(|()| area.present())
    };
    drawn.map_err(|error| ReportError::Chart { chart: labels.chart, reason: error.to_string() })?;
    // The page scales its charts; the label names the chart for screen readers.
    let head = format!("<svg role=\"img\" aria-label=\"{}\" ", labels.chart);
    Ok(text.replacen("<svg ", &head, 1))
}

/// Returns an axis range that contains all values, rounded outward. It includes zero if the smallest magnitude is less
/// than half of the largest.
fn range(values: impl Iterator<Item = f64>) -> std::ops::Range<f64> {
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
///
/// # Errors
/// Returns [`ReportError::Chart`] if the chart cannot be drawn.
pub fn lines(labels: Labels, lines: &[Line]) -> Result<String, ReportError> {
    let points = || lines.iter().flat_map(|line| line.points.iter().copied());
    let (x, y) = (range(points().map(|(x, _)| x)), range(points().map(|(_, y)| y)));
    svg(labels, |area| {
        let mut chart = ChartBuilder::on(area)
            .margin(12)
            .x_label_area_size(42)
            .y_label_area_size(68)
            .build_cartesian_2d(x.clone(), y.clone())?;
        axes(&mut chart, labels)?;
        draw_lines(&mut chart, lines)?;
        if lines.len() > 1 { legend(&mut chart, emptiest_corner(lines, (&x, &y))) } else { Ok(()) }
    })
}

/// Returns the corner, about as large as a legend, that contains the fewest points of the lines.
fn emptiest_corner(lines: &[Line], axes: (&std::ops::Range<f64>, &std::ops::Range<f64>)) -> SeriesLabelPosition {
    use SeriesLabelPosition::{LowerLeft, LowerRight, UpperLeft, UpperRight};
    const WIDE: f64 = 0.35;
    const HIGH: f64 = 0.3;
    let part = |value: f64, axis: &std::ops::Range<f64>| (value - axis.start) / (axis.end - axis.start);
    let points = || lines.iter().flat_map(|line| &line.points).map(|&(x, y)| (part(x, axes.0), part(y, axes.1)));
    let inside = |right: bool, upper: bool| {
        let near = |at: f64, far_end: bool, size: f64| if far_end { at > 1.0 - size } else { at < size };
        points().filter(|&(x, y)| near(x, right, WIDE) && near(y, upper, HIGH)).count()
    };
    let corners =
        [(UpperLeft, false, true), (UpperRight, true, true), (LowerRight, true, false), (LowerLeft, false, false)];
    let emptiest = corners.into_iter().min_by_key(|&(_, right, upper)| inside(right, upper));
    emptiest.map_or(UpperLeft, |(corner, ..)| corner)
}

/// Draws lines with a logarithmic vertical axis; values that are not positive are omitted.
///
/// # Errors
/// Returns [`ReportError::Chart`] if the chart cannot be drawn.
pub fn logarithmic(labels: Labels, lines: &[Line]) -> Result<String, ReportError> {
    let lines: Vec<Line> = lines
        .iter()
        .map(|line| Line {
            name: line.name.clone(),
            points: line.points.iter().copied().filter(|&(_, y)| y > 0.0 && y.is_finite()).collect(),
        })
        .collect();
    let points = || lines.iter().flat_map(|line| line.points.iter().copied());
    let x = 0.0..points().map(|(x, _)| x).fold(1.0, f64::max) + 0.2;
    let exponents = range(points().map(|(_, y)| y.log10()));
    let y = (10f64.powf(exponents.start.floor())..10f64.powf(exponents.end.ceil())).log_scale();
    svg(labels, |area| {
        let mut chart =
            ChartBuilder::on(area).margin(12).x_label_area_size(42).y_label_area_size(68).build_cartesian_2d(x, y)?;
        chart
            .configure_mesh()
            .disable_x_mesh()
            .light_line_style(TRANSPARENT)
            .bold_line_style(GRID)
            .axis_style(INK)
            .label_style((FONT, 14, &INK))
            .axis_desc_style((FONT, 15, &INK))
            .x_desc(labels.x)
            .y_desc(labels.y)
            .x_labels(8)
            .x_label_formatter(&|x| whole(*x))
            .y_label_formatter(&|y| format!("1e{:.0}", y.log10()))
            .draw()?;
        let last = lines.len().saturating_sub(1).max(1) as f64;
        for (k, line) in lines.iter().enumerate() {
            let [r, g, b] = super::picture::color::viridis(0.9 * k as f64 / last);
            let color = RGBColor(r, g, b);
            chart.draw_series(LineSeries::new(line.points.iter().copied(), color.stroke_width(1)))?;
            chart.draw_series(line.points.iter().map(|&point| Circle::new(point, 2, color.filled())))?;
        }
        Ok(())
    })
}

type Chart<'a, 'b> = ChartContext<'a, SVGBackend<'b>, Cartesian2d<RangedCoordf64, RangedCoordf64>>;

fn axes(chart: &mut Chart, labels: Labels) -> Drawn {
    chart
        .configure_mesh()
        .light_line_style(TRANSPARENT)
        .bold_line_style(GRID)
        .axis_style(INK)
        .label_style((FONT, 14, &INK))
        .axis_desc_style((FONT, 15, &INK))
        .x_desc(labels.x)
        .y_desc(labels.y)
        .x_labels(8)
        .y_labels(6)
        .x_label_formatter(&label)
        .y_label_formatter(&label)
        .draw()
}

/// Formats a tick without the digits caused by rounding errors.
fn label(value: &f64) -> String {
    let text = RangedCoordf64::format(value);
    let text = text.strip_suffix(".0").unwrap_or(&text);
    if text.len() <= 6 { text.to_owned() } else { significant(*value) }
}

fn draw_lines(chart: &mut Chart, lines: &[Line]) -> Drawn {
    for (line, color) in lines.iter().zip(COLORS.into_iter().cycle()) {
        let points = || line.points.iter().copied().filter(|(x, y)| x.is_finite() && y.is_finite());
        chart
            .draw_series(LineSeries::new(points(), color.stroke_width(2)))?
            .label(&line.name)
            .legend(move |(x, y)| PathElement::new([(x, y), (x + 18, y)], color.stroke_width(2)));
        chart.draw_series(points().map(|point| Circle::new(point, 3, color.filled())))?;
    }
    Ok(())
}

fn legend<'a, 'b: 'a>(chart: &mut Chart<'a, 'b>, corner: SeriesLabelPosition) -> Drawn {
    chart
        .configure_series_labels()
        .position(corner)
        .label_font((FONT, 14, &INK))
        .background_style(WHITE.mix(0.85))
        .border_style(GRID)
        .draw()
}

/// Draws the extension of every increment as a line (left axis) and its Newton iterations as bars (right axis), over
/// the number of the increment, from 1.
///
/// # Errors
/// Returns [`ReportError::Chart`] if the chart cannot be drawn.
pub fn extension_and_iterations(
    labels: Labels,
    extension: &[(f64, f64)],
    iterations: &[(f64, f64)],
) -> Result<String, ReportError> {
    let last = extension.iter().chain(iterations).map(|&(x, _)| x).fold(1.0, f64::max);
    let left = range(extension.iter().map(|&(_, y)| y).chain([0.0]));
    // The scale of the right axis keeps the bars in the lower part of the chart, below the line.
    let most = iterations.iter().map(|&(_, y)| y).fold(1.0, f64::max);
    svg(labels, |area| {
        let mut chart = ChartBuilder::on(area)
            .margin(12)
            .x_label_area_size(42)
            .y_label_area_size(68)
            .right_y_label_area_size(50)
            .build_cartesian_2d(0.4..last + 0.6, left)?
            .set_secondary_coord(0.4..last + 0.6, 0.0..1.8 * most);
        chart
            .configure_mesh()
            .disable_x_mesh()
            .light_line_style(TRANSPARENT)
            .bold_line_style(GRID)
            .axis_style(INK)
            .label_style((FONT, 14, &INK))
            .axis_desc_style((FONT, 15, &INK))
            .x_desc(labels.x)
            .y_desc(labels.y)
            .x_labels(10)
            .x_label_formatter(&|x| whole(*x))
            .y_label_formatter(&label)
            .draw()?;
        chart
            .configure_secondary_axes()
            .axis_style(INK)
            .label_style((FONT, 14, &INK))
            .axis_desc_style((FONT, 15, &INK))
            .y_desc("Newton iterations (bars)")
            .y_labels(6)
            .y_label_formatter(&|y: &f64| if *y <= most + 0.5 { whole(*y) } else { String::new() })
            .draw()?;
        chart.draw_secondary_series(
            iterations.iter().map(|&(x, y)| Rectangle::new([(x - 0.32, 0.0), (x + 0.32, y)], PALE.filled())),
        )?;
        chart.draw_series(LineSeries::new(extension.iter().copied(), COLORS[0].stroke_width(2)))?;
        chart.draw_series(extension.iter().map(|&point| Circle::new(point, 3, COLORS[0].filled())))?;
        Ok(())
    })
}

fn whole(value: f64) -> String {
    if (value - value.round()).abs() < 1e-6 { format!("{value:.0}") } else { String::new() }
}

/// Draws stacked bars over the number of the increment, from 1: one layer per line, in order from the bottom.
///
/// # Errors
/// Returns [`ReportError::Chart`] if the chart cannot be drawn.
pub fn stacked_bars(labels: Labels, layers: &[Line]) -> Result<String, ReportError> {
    let increments = layers.iter().map(|layer| layer.points.len()).max().unwrap_or(0);
    let height = |k: usize| layers.iter().filter_map(|layer| layer.points.get(k)).map(|&(_, y)| y).sum::<f64>();
    let top = range((0..increments).map(height).chain([0.0]));
    // Space above the bars for the legend, one row per layer.
    let room = 1.0 / (1.0 - (0.075 * layers.len() as f64).min(0.6));
    let last = layers.iter().flat_map(|layer| &layer.points).map(|&(x, _)| x).fold(1.0, f64::max);
    svg(labels, |area| {
        let mut chart = ChartBuilder::on(area)
            .margin(12)
            .x_label_area_size(42)
            .y_label_area_size(68)
            .build_cartesian_2d(0.4..last + 0.6, 0.0..room * top.end.max(f64::MIN_POSITIVE))?;
        chart
            .configure_mesh()
            .disable_x_mesh()
            .light_line_style(TRANSPARENT)
            .bold_line_style(GRID)
            .axis_style(INK)
            .label_style((FONT, 14, &INK))
            .axis_desc_style((FONT, 15, &INK))
            .x_desc(labels.x)
            .y_desc(labels.y)
            .x_labels(10)
            .y_labels(6)
            .x_label_formatter(&|x| whole(*x))
            .y_label_formatter(&label)
            .draw()?;
        let mut base = vec![0.0; increments];
        for (layer, color) in layers.iter().zip(COLORS.into_iter().cycle()) {
            let bars = layer.points.iter().zip(&mut base).map(|(&(x, y), base)| {
                let bottom = *base;
                *base += y;
                Rectangle::new([(x - 0.36, bottom), (x + 0.36, bottom + y)], color.filled())
            });
            chart
                .draw_series(bars)?
                .label(&layer.name)
                .legend(move |(x, y)| Rectangle::new([(x + 2, y - 5), (x + 14, y + 5)], color.filled()));
        }
        if layers.len() > 1 { legend(&mut chart, SeriesLabelPosition::UpperLeft) } else { Ok(()) }
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_axis_holds_its_values() {
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
    fn nothing_to_draw_is_an_empty_chart() {
        let labels = Labels { chart: "nothing", x: "x", y: "y" };
        let one = [Line { name: "a".into(), points: vec![(1.0, f64::NAN)] }];
        for chart in [
            lines(labels, &[]),
            lines(labels, &one),
            logarithmic(labels, &one),
            stacked_bars(labels, &[]),
            extension_and_iterations(labels, &[], &[]),
        ] {
            assert!(chart.unwrap().ends_with("</svg>\n"));
        }
    }
}
