//! The picture of a fiber network: its fibers in the reference or deformed cube, as one SVG.
//!
//! The viewpoint is chosen as for a cubic body and depends on the viewing axis only, so that pictures of one network
//! can be compared. Depth is shown in three ways: near fibers are drawn over far ones, with a light rim; they are
//! wider; and far fibers fade toward the white background. A long fiber is drawn in pieces, each at its own depth.

use std::collections::BTreeMap;

use nalgebra::{Matrix3, Vector3};

use super::body::OUTLINE;
use super::color::{AXES, mix};
use super::legend::{self, INK};
use super::view::{Frame, View};
use super::{Colors, Map};
use crate::app::report::quantity::Quantity;
use crate::app::report::svg::{Anchor, Svg, hex};

/// Number of depth layers; each is drawn over those behind it.
const LAYERS: usize = 24;
/// Fraction by which the farthest fibers fade.
const FADE: f64 = 0.55;
/// The color toward which far fibers fade.
const BACKGROUND: [u8; 3] = [255; 3];

/// The property of a fiber that its color shows.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum FiberColor<'a> {
    /// One color for all fibers.
    Plain,
    /// The direction: the colors of the axes x, y and z, mixed by the squares of its components.
    Direction,
    /// A scalar quantity of the fiber.
    Values {
        /// The name of the quantity.
        label: &'a str,
        /// The unit without prefix; empty for a dimensionless quantity.
        unit: &'static str,
        /// One value per fiber.
        values: &'a [f64],
        /// The value at rest, drawn in gray, if the quantity has one: 1 for a stretch, 0 for a force.
        rest: Option<f64>,
    },
}

/// The content and the size of a network picture.
#[derive(Clone, Copy, Debug)]
pub struct NetworkPicture<'a> {
    /// Title above the picture.
    pub title: &'a str,
    /// Text below the title.
    pub subtitle: &'a str,
    /// Positions of all nodes, in units of the unit cube.
    pub positions: &'a [[f64; 3]],
    /// The two nodes of every fiber; a fiber with a node that does not exist is omitted.
    pub fibers: &'a [[u32; 2]],
    /// The meaning of the colors.
    pub color: FiberColor<'a>,
    /// The deformation gradient of the cube around the network: the identity for a network at rest.
    pub gradient: Matrix3<f64>,
    /// The viewing axis: 0, 1, 2 for x, y, z; 2 if `None`.
    pub axis: Option<usize>,
    /// Width, pixels; it determines the height.
    pub width: u32,
}

/// A piece of a fiber on the page; layer 0 is the farthest.
struct Piece {
    layer: usize,
    ends: [[f64; 2]; 2],
    color: [u8; 3],
}

/// Draws a network as SVG.
pub fn draw_network(picture: &NetworkPicture) -> String {
    let width = f64::from(picture.width.max(480));
    let height = (0.92 * width + 100.0).round();
    let view = View::of(Vector3::from_element(1.0), picture.axis, None);
    let corners = |f: &Matrix3<f64>| -> [Vector3<f64>; 8] {
        std::array::from_fn(|k| f * Vector3::from([k & 1, k >> 1 & 1, k >> 2].map(|x| x as f64 - 0.5)))
    };
    let (rest, cube) = (corners(&Matrix3::identity()), corners(&picture.gradient));
    let deformed = picture.gradient != Matrix3::identity();
    let nodes: Vec<Vector3<f64>> = picture.positions.iter().map(|&x| x.into()).collect();
    let shown = nodes.iter().chain(&cube).chain(if deformed { &rest[..] } else { &[] });
    let frame = Frame::fit(shown.map(|x| view.project(x)), [28.0, 78.0, width - 56.0, height - 78.0 - 92.0]);

    let colors = colors(picture.color);
    let mut svg = Svg::new(width, height, &format!("{}: fiber network, {}", picture.title, picture.subtitle));
    legend::title(&mut svg, picture.title, picture.subtitle);
    let lines = Edges::of(&cube, &view);
    let place = |x: &Vector3<f64>| frame.page_position(view.project(x));
    let segments = |edges: &[[usize; 2]], of: &[Vector3<f64>; 8]| -> Vec<[[f64; 2]; 2]> {
        edges.iter().map(|edge| edge.map(|corner| place(&of[corner]))).collect()
    };
    let back = "fill=\"none\" stroke=\"#90a4ae\" stroke-width=\"1\" stroke-linecap=\"round\"";
    svg.segments(&segments(&lines.hidden, &cube), back);
    if deformed {
        svg.segments(&segments(&Edges::of(&rest, &view).all(), &rest), OUTLINE);
    }
    fibers(&mut svg, picture, &nodes, colors.as_ref(), (&view, &frame));
    let front = "fill=\"none\" stroke=\"#263238\" stroke-width=\"1.3\" stroke-linecap=\"round\"";
    svg.segments(&segments(&lines.visible, &cube), front);

    let bottom = height - 30.0;
    legend::axes(&mut svg, &view, [52.0, bottom - 10.0]);
    let mut row = bottom - 4.0;
    if deformed {
        svg.path(&[[112.0, row - 4.0], [138.0, row - 4.0]], false, OUTLINE);
        svg.text([146.0, row], 12.0, Anchor::Start, INK, "undeformed cube");
        row -= 19.0;
    }
    if picture.color == FiberColor::Direction {
        svg.text(
            [112.0, row],
            12.0,
            Anchor::Start,
            INK,
            "color: direction of the fiber, mixed from the colors of the axes",
        );
    }
    if let Some(colors) = &colors {
        legend::color_bar(&mut svg, colors, 0.0, [width - 36.0, bottom - 24.0]);
    }
    svg.finish()
}

/// Assigns colors to the values of the fibers; `None` if the color does not show values.
fn colors(color: FiberColor) -> Option<Colors> {
    let FiberColor::Values { label, unit, values, rest } = color else { return None };
    let mut colors = Colors::new(
        Quantity { name: label.into(), label: label.into(), unit, is_integer: false, values: values.into() },
        values,
    );
    colors.map = Map::Lines;
    if let Some(rest) = rest {
        let (low, high) = colors.range;
        let span = (high - rest).max(rest - low);
        colors.map = Map::About(rest);
        // If all values equal the rest value, the color bar still needs a range.
        colors.range = if span > 0.0 { (low.min(rest), high.max(rest)) } else { (rest - 0.1, rest + 0.1) };
    }
    Some(colors)
}

/// The edges of a cube, as pairs of corners.
struct Edges {
    /// The edges that meet at the corner farthest from the viewer.
    hidden: Vec<[usize; 2]>,
    visible: Vec<[usize; 2]>,
}

impl Edges {
    fn of(corners: &[Vector3<f64>; 8], view: &View) -> Self {
        let depth = |corner: &usize| view.project(&corners[*corner])[2];
        let farthest = (0..8).min_by(|a, b| depth(a).total_cmp(&depth(b))).unwrap_or(0);
        let edges =
            (0..8).flat_map(|a| [1, 2, 4].into_iter().filter(move |bit| a & bit == 0).map(move |bit| [a, a | bit]));
        let (hidden, visible) = edges.partition(|edge| edge.contains(&farthest));
        Self { hidden, visible }
    }

    fn all(&self) -> Vec<[usize; 2]> {
        [&self.hidden[..], &self.visible].concat()
    }
}

/// Draws the fibers, from back to front.
fn fibers(
    svg: &mut Svg,
    picture: &NetworkPicture,
    nodes: &[Vector3<f64>],
    colors: Option<&Colors>,
    to_page: (&View, &Frame),
) {
    let pieces = pieces(picture, nodes, colors, to_page);
    let width = line_width(picture, nodes, to_page.1.scale);
    let mut layers: Vec<Vec<Piece>> = (0..LAYERS).map(|_| Vec::new()).collect();
    for piece in pieces {
        layers[piece.layer].push(piece);
    }
    svg.open("fill=\"none\"");
    for (layer, pieces) in layers.iter().enumerate() {
        let near = (layer as f64 + 0.5) / LAYERS as f64;
        let width = width * (0.6 + 0.7 * near);
        let rims: Vec<[[f64; 2]; 2]> = pieces.iter().map(|piece| piece.ends).collect();
        svg.segments(&rims, &format!("stroke=\"#fff\" stroke-width=\"{:.2}\"", 1.9 * width + 0.3));
        let mut by_color: BTreeMap<[u8; 3], Vec<[[f64; 2]; 2]>> = BTreeMap::new();
        for piece in pieces {
            // Rounding to multiples of four is invisible and keeps the file small.
            let color = mix(piece.color, BACKGROUND, FADE * (1.0 - near)).map(|part| part & !3);
            by_color.entry(color).or_default().push(piece.ends);
        }
        for (color, segments) in by_color {
            let stroke = hex(color);
            svg.segments(
                &segments,
                &format!("stroke=\"{stroke}\" stroke-width=\"{width:.2}\" stroke-linecap=\"round\""),
            );
        }
    }
    svg.close();
}

/// Cuts the fibers into pieces, each within one depth layer.
fn pieces(
    picture: &NetworkPicture,
    nodes: &[Vector3<f64>],
    colors: Option<&Colors>,
    (view, frame): (&View, &Frame),
) -> Vec<Piece> {
    let depths = || nodes.iter().map(|x| view.project(x)[2]);
    let (far, near) = (depths().fold(f64::INFINITY, f64::min), depths().fold(f64::NEG_INFINITY, f64::max));
    let layers = LAYERS as f64 / (near - far).max(f64::MIN_POSITIVE);
    let mut pieces = Vec::new();
    for (fiber, ends) in picture.fibers.iter().enumerate() {
        let [Some(a), Some(b)] = ends.map(|node| nodes.get(node as usize)) else { continue };
        let color = match picture.color {
            FiberColor::Plain => [55, 71, 79],
            FiberColor::Direction => direction_color(b - a),
            FiberColor::Values { .. } => colors.map_or([55, 71, 79], |colors| colors.of(fiber)),
        };
        let [a, b] = [a, b].map(|x| view.project(x));
        let count = ((b[2] - a[2]).abs() * layers).ceil().max(1.0) as usize;
        let at = |part: f64| [0, 1, 2].map(|k| a[k] + part * (b[k] - a[k]));
        for piece in 0..count {
            let [from, middle, to] = [0.0, 0.5, 1.0].map(|part| at((piece as f64 + part) / count as f64));
            let layer = (((middle[2] - far) * layers) as usize).min(LAYERS - 1);
            pieces.push(Piece { layer, ends: [frame.page_position(from), frame.page_position(to)], color });
        }
    }
    pieces
}

/// Mixes the colors of the axes by the squares of the components of the direction, which add up to 1.
fn direction_color(direction: Vector3<f64>) -> [u8; 3] {
    let squares = direction.component_mul(&direction) / direction.norm_squared().max(f64::MIN_POSITIVE);
    std::array::from_fn(|c| (0..3).map(|k| squares[k] * f64::from(AXES[k][c])).sum::<f64>().round() as u8)
}

/// Returns the line width at mean depth, pixels: proportional to the mean fiber length, so that dense networks have
/// thin lines.
fn line_width(picture: &NetworkPicture, nodes: &[Vector3<f64>], scale: f64) -> f64 {
    let length = |ends: &[u32; 2]| {
        let [a, b] = ends.map(|node| nodes.get(node as usize).copied().unwrap_or_default());
        (b - a).norm()
    };
    let total: f64 = picture.fibers.iter().map(length).sum();
    (0.034 * scale * total / picture.fibers.len().max(1) as f64).clamp(0.5, 2.6)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn cross() -> ([[f64; 3]; 4], [[u32; 2]; 2]) {
        ([[-0.5, 0.0, 0.4], [0.5, 0.0, 0.4], [0.0, -0.5, -0.4], [0.0, 0.5, -0.4]], [[0, 1], [2, 3]])
    }

    fn picture<'a>(positions: &'a [[f64; 3]], fibers: &'a [[u32; 2]], color: FiberColor<'a>) -> NetworkPicture<'a> {
        let gradient = Matrix3::identity();
        NetworkPicture { title: "a <b>", subtitle: "", positions, fibers, color, gradient, axis: None, width: 600 }
    }

    #[test]
    fn fibers_are_drawn_from_back_to_front() {
        let (positions, fibers) = cross();
        let values = [2.0, 1.0];
        let color = FiberColor::Values { label: "stretch", unit: "", values: &values, rest: Some(1.0) };
        let svg = draw_network(&picture(&positions, &fibers, color));
        assert!(svg.contains("a &lt;b&gt;") && svg.contains(">stretch<"), "{svg}");
        // The stretched fiber is in front: it comes last, and is red.
        let strokes: Vec<[i64; 3]> = svg
            .lines()
            .filter(|line| line.ends_with("stroke-linecap=\"round\"/>") && line.starts_with("<path d"))
            .filter_map(|line| line.split_once("stroke=\"#").map(|(_, rest)| &rest[..6]))
            .filter_map(|hex| i64::from_str_radix(hex, 16).ok())
            .map(|rgb| [rgb >> 16, rgb >> 8 & 255, rgb & 255])
            .filter(|rgb| rgb.iter().all(|part| part % 4 == 0))
            .collect();
        let is_gray = |[r, g, b]: &[i64; 3]| (r - g).abs() < 20 && (g - b).abs() < 20;
        let first_red = strokes.iter().position(|rgb| !is_gray(rgb)).unwrap();
        assert!(first_red > 0 && strokes[first_red..].iter().all(|[r, _, b]| r > b), "{strokes:?}");
        let edge = draw_network(&NetworkPicture { fibers: &[], ..picture(&positions, &fibers, color) });
        assert!(edge.len() < svg.len() && !edge.contains("NaN") && !svg.contains("NaN"));
    }

    #[test]
    fn the_hidden_edges_meet_at_the_farthest_corner() {
        let corners: [Vector3<f64>; 8] =
            std::array::from_fn(|k| Vector3::from([k & 1, k >> 1 & 1, k >> 2].map(|x| x as f64 - 0.5)));
        let view = View::of(Vector3::from_element(1.0), None, None);
        let edges = Edges::of(&corners, &view);
        assert_eq!((edges.hidden.len(), edges.visible.len()), (3, 9));
        let common = (0..8).filter(|corner| edges.hidden.iter().all(|edge| edge.contains(corner))).collect::<Vec<_>>();
        assert_eq!(common.len(), 1);
        let depth = |corner: usize| view.project(&corners[corner])[2];
        assert!((0..8).all(|corner| depth(corner) >= depth(common[0])));
    }

    #[test]
    fn directions_along_the_axes_have_the_colors_of_the_axes() {
        for (axis, color) in AXES.into_iter().enumerate() {
            let direction = Vector3::from_fn(|k, _| if k == axis { -3.0 } else { 0.0 });
            assert_eq!(direction_color(direction), color);
        }
    }

    #[test]
    fn a_deformed_cube_is_drawn_with_its_undeformed_outline() {
        let (positions, fibers) = cross();
        let gradient = Matrix3::from_diagonal(&Vector3::new(1.5, 0.8, 0.8));
        let svg = draw_network(&NetworkPicture { gradient, ..picture(&positions, &fibers, FiberColor::Direction) });
        assert!(svg.contains("undeformed cube") && svg.contains("mixed from the colors"));
    }
}
