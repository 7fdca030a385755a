//! Annotations around the body: title, color bar, scale bar, axes, and the legend of the lines.

use super::body::{OUTLINE, fibers};
use super::color::AXES;
use super::view::View;
use super::{Colors, Scene};
use crate::app::report::svg::{Anchor, Svg, hex};
use crate::app::report::units::{prefix, quantity, round_step, tick_label, ticks};

pub(super) const INK: &str = "fill=\"#1b2733\"";
pub(super) const SOFT: &str = "fill=\"#546e7a\"";

/// Draws the title and, below it, the line with step, time and extension.
pub(super) fn title(svg: &mut Svg, title: &str, state: &str) {
    svg.title([28.0, 38.0], 21.0, &format!("{INK} font-weight=\"600\""), title);
    svg.title([28.0, 60.0], 14.0, SOFT, state);
}

/// Draws the color bar with its ticks; its right end is at `right`, and its left end not left of `least`.
pub(super) fn color_bar(svg: &mut Svg, colors: &Colors, least: f64, [right, top]: [f64; 2]) {
    const WIDTH: f64 = 320.0;
    const LEAST_WIDTH: f64 = 160.0;
    const HEIGHT: f64 = 12.0;
    const STOPS: u8 = 20;
    let left = (right - WIDTH).max(least).min(right - LEAST_WIDTH);
    let width = right - left;
    let (low, high) = colors.range;
    let (power, prefix) = if colors.quantity.unit.is_empty() { (1.0, "") } else { prefix(low.abs().max(high.abs())) };
    let unit = format!("{prefix}{}", colors.quantity.unit);
    let label = match unit.as_str() {
        "" => colors.quantity.label.clone(),
        unit => format!("{} in {unit}", colors.quantity.label),
    };
    svg.text([left, top - 8.0], 13.0, Anchor::Start, INK, &label);
    svg.gradient("map", (0..=STOPS).map(|k| colors.at(low + f64::from(k) / f64::from(STOPS) * (high - low))));
    svg.rectangle([left, top, width, HEIGHT], "fill=\"url(#map)\"");
    let ticks = ticks(low / power, high / power, 5);
    for &tick in &ticks {
        let x = left + width * (tick * power - low) / (high - low);
        svg.path(&[[x, top + HEIGHT], [x, top + HEIGHT + 4.0]], false, "stroke=\"#1b2733\"");
        svg.text([x, top + HEIGHT + 17.0], 12.0, Anchor::Middle, INK, &tick_label(tick, &ticks));
    }
    let (least, most) = colors.extremes;
    if least < low || most > high {
        let words = format!(
            "{}all: {} to {}",
            if colors.is_trimmed { "without the outermost 1 %; " } else { "" },
            quantity(least, colors.quantity.unit),
            quantity(most, colors.quantity.unit)
        );
        svg.text([right, top + HEIGHT + 32.0], 11.0, Anchor::End, SOFT, &words);
    }
}

/// Draws a scale bar of a round length and returns the position of its right end.
pub(super) fn scale_bar(svg: &mut Svg, scene: &Scene, [left, baseline]: [f64; 2]) -> f64 {
    let length = round_step(80.0 / scene.frame.scale);
    let width = length * scene.frame.scale;
    let (y, right) = (baseline - 4.0, left + width);
    let bar = [[left, y - 5.0], [left, y], [right, y], [right, y - 5.0]];
    svg.path(&bar, false, "fill=\"none\" stroke=\"#1b2733\" stroke-width=\"1.5\"");
    let (power, prefix) = prefix(length);
    let words = format!("{}\u{a0}{prefix}m", (length / power).round());
    svg.text([left + width / 2.0, y - 9.0], 12.0, Anchor::Middle, INK, &words);
    right
}

/// Draws the directions of x, y and z.
pub(super) fn axes(svg: &mut Svg, view: &View, [x, y]: [f64; 2]) {
    const LENGTH: f64 = 26.0;
    let mut arms: Vec<(usize, [f64; 3])> =
        (0..3).map(|axis| (axis, [view.right[axis], view.up[axis], view.toward[axis]])).collect();
    arms.sort_by(|a, b| a.1[2].total_cmp(&b.1[2]));
    for (axis, [across, up, _]) in arms {
        let end = [x + LENGTH * across, y - LENGTH * up];
        let color = hex(AXES[axis]);
        svg.path(&[[x, y], end], false, &format!("stroke=\"{color}\" stroke-width=\"2\" stroke-linecap=\"round\""));
        let place = [x + (LENGTH + 8.0) * across, y - (LENGTH + 8.0) * up + 4.0];
        let bold = format!("fill=\"{color}\" font-weight=\"600\"");
        svg.text(place, 12.0, Anchor::Middle, &bold, ["x", "y", "z"][axis]);
    }
}

/// Draws the legend of the outline and the fiber lines, and returns the position of its right end.
pub(super) fn lines(svg: &mut Svg, [left, baseline]: [f64; 2], with_fibers: Option<&str>) -> f64 {
    const OUTLINED: &str = "undeformed";
    /// About the width of a letter, and the distance to what follows.
    const LETTER: f64 = 6.2;
    const GAP: f64 = 24.0;
    let sample = |row: f64| [[left, baseline - 4.0 - row], [left + 26.0, baseline - 4.0 - row]];
    let at = |row: f64| [left + 34.0, baseline - row];
    svg.path(&sample(0.0), false, OUTLINE);
    svg.text(at(0.0), 12.0, Anchor::Start, INK, OUTLINED);
    if let Some(meaning) = with_fibers {
        fibers(svg, &[sample(19.0)]);
        svg.text(at(19.0), 12.0, Anchor::Start, INK, meaning);
    }
    let letters = OUTLINED.len().max(with_fibers.map_or(0, str::len));
    at(0.0)[0] + LETTER * letters as f64 + GAP
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::app::report::quantity::Quantity;
    use crate::app::results::Fields;

    #[test]
    fn the_color_bar_leaves_the_legend_of_the_lines_its_room() {
        let meaning = "mean fiber direction, longer where aligned";
        let mut svg = Svg::new(600.0, 400.0, "");
        let right = lines(&mut svg, [200.0, 370.0], Some(meaning));
        // Letters of 12 pixels are 6.6 pixels wide on average in a wide font, DejaVu Sans.
        assert!(right >= 234.0 + 6.6 * meaning.len() as f64, "{right}");

        let fields = Fields { cell_scalars: vec![("energy_density".into(), vec![0.0, 1.0])], ..Fields::default() };
        let colors = Colors::new(Quantity::find(&fields, None).unwrap().unwrap(), &[0.0, 1.0]);
        for (least, left) in [(300.0, 480.0), (520.0, 520.0)] {
            let mut svg = Svg::new(900.0, 400.0, "");
            color_bar(&mut svg, &colors, least, [800.0, 340.0]);
            let bar = format!("x=\"{left}\" y=\"340\"");
            let drawn = svg.finish();
            assert!(drawn.contains(&bar), "{bar}: {drawn}");
        }
    }
}
