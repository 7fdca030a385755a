//! The visible faces of the body, from back to front, with the lines of the mesh.
//!
//! Values at the nodes are linear within a triangle, so that a linear gradient of SVG shows them exactly.

use std::collections::HashMap;

use nalgebra::Vector3;

use super::body::{edge_length, visible};
use super::color::shade;
use super::{Colors, Scene};
use crate::app::report::nodal::NodalAverages;
use crate::app::report::skin::{BoundaryMesh, Face, normal};
use crate::app::report::svg::{Svg, hex};

/// Cosine of the crease angle (35 degrees): faces that meet at a larger angle form a crease.
const CREASE: f64 = 0.82;
/// Median length of the edges, in pixels, below which the lines of the mesh would cover the colors.
const SHORT: f64 = 4.0;
/// Part of the range of colors below which a triangle has one color.
const UNIFORM: f64 = 0.015;
/// Number of brightnesses that gradients have.
const LIGHTS: u8 = 7;
const MESH_LINE: &str = "stroke=\"#fff\" stroke-opacity=\".34\" stroke-width=\".7\" fill=\"none\"";
const CREASE_LINE: &str = "stroke=\"#1b2733\" stroke-opacity=\".75\" stroke-width=\"1\" fill=\"none\"";

/// A line to be drawn with a face: its ends, and whether it is a crease or a part of the silhouette.
type Line = ([u32; 2], bool);

/// Draws the visible faces from back to front, each with the lines on its edges, so that near faces cover far ones.
/// `averages` are the values at the nodes; without them, each face has the color of its element.
pub(super) fn draw(svg: &mut Svg, scene: &Scene, colors: Option<&Colors>, averages: Option<&NodalAverages>) {
    let Scene { skin, current, view, frame, .. } = scene;
    let visible = visible(skin, current, view);
    let depth = |face: usize| -> f64 {
        let points = &skin.faces[face].points;
        points.iter().map(|&point| view.toward.dot(&current[point as usize])).sum::<f64>() / points.len() as f64
    };
    let mut order: Vec<(f64, usize)> =
        (0..skin.faces.len()).filter(|&face| visible[face]).map(|face| (depth(face), face)).collect();
    order.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
    let lines = lines(skin, current, &visible, &order);
    let has_mesh = edge_length(scene).is_some_and(|length| length >= SHORT);

    if let (Some(colors), Some(_)) = (colors, averages) {
        let (low, high) = colors.range;
        for light in 0..LIGHTS {
            let stops = (0..=20_u8).map(|k| low + f64::from(k) / 20.0 * (high - low));
            let stops: Vec<[u8; 3]> = stops.map(|value| shade(colors.at(value), brightness(light))).collect();
            svg.gradient(&format!("m{light}"), stops.into_iter());
        }
    }
    let place = |point: u32| {
        let [x, y] = frame.page_position(view.project(&current[point as usize]));
        [x, y]
    };
    svg.open("stroke-width=\".6\" stroke-linejoin=\"round\" stroke-linecap=\"round\"");
    let mut gradients = 0;
    for (_, k) in order {
        let face = &skin.faces[k];
        let light = view.light(&normal(face, current));
        match (colors, averages) {
            (Some(colors), Some(averages)) => smooth(svg, face, &place, light, (colors, averages), &mut gradients),
            _ => {
                let plain = colors.map_or([176, 190, 197], |colors| colors.of(face.element));
                let corners: Vec<[f64; 2]> = face.points.iter().map(|&point| place(point)).collect();
                svg.path(&corners, true, &flat(shade(plain, light)));
            }
        }
        let of_face = lines.get(&k).map(Vec::as_slice).unwrap_or_default();
        let drawn = |is_crease: bool| -> Vec<[[f64; 2]; 2]> {
            let own = of_face.iter().filter(|(_, crease)| *crease == is_crease);
            own.map(|(ends, _)| ends.map(&place)).collect()
        };
        if has_mesh {
            svg.segments(&drawn(false), MESH_LINE);
        }
        svg.segments(&drawn(true), CREASE_LINE);
    }
    svg.close();
}

/// The attributes of a face of one color; its rim covers the gap to its neighbors.
fn flat(color: [u8; 3]) -> String {
    let color = hex(color);
    format!("fill=\"{color}\" stroke=\"{color}\"")
}

/// Returns one of the brightnesses of gradients, from 0.82 to 1.
fn brightness(light: u8) -> f64 {
    0.82 + 0.18 * f64::from(light) / f64::from(LIGHTS - 1)
}

/// Draws a face with the values at its nodes, in triangles.
fn smooth(
    svg: &mut Svg,
    face: &Face,
    place: &impl Fn(u32) -> [f64; 2],
    light: f64,
    (colors, averages): (&Colors, &NodalAverages),
    gradients: &mut usize,
) {
    let (low, high) = colors.range;
    let span = high - low;
    let nodes: Vec<([f64; 2], f64)> =
        face.points.iter().map(|&point| (place(point), averages.at(point, face.element))).collect();
    let extent = nodes.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), (_, v)| (a.min(*v), b.max(*v)));
    if extent.1 - extent.0 < UNIFORM * span || !(extent.1 - extent.0).is_finite() {
        let mean = nodes.iter().map(|(_, value)| value).sum::<f64>() / nodes.len() as f64;
        let corners: Vec<[f64; 2]> = nodes.iter().map(|(place, _)| *place).collect();
        return svg.path(&corners, true, &flat(shade(colors.at(mean), light)));
    }
    for k in 1..nodes.len() - 1 {
        let triangle = [nodes[0], nodes[k], nodes[k + 1]];
        let corners = triangle.map(|(place, _)| place);
        let Some([from, to]) = isolines(triangle, colors.range) else {
            let mean = triangle.iter().map(|(_, value)| value).sum::<f64>() / 3.0;
            svg.path(&corners, true, &flat(shade(colors.at(mean), light)));
            continue;
        };
        let level = ((light - 0.82) / 0.18 * f64::from(LIGHTS - 1)).round().clamp(0.0, f64::from(LIGHTS - 1));
        let name = format!("g{gradients}");
        *gradients += 1;
        svg.gradient_like(&name, &format!("m{level}"), from, to);
        svg.path(&corners, true, &format!("fill=\"url(#{name})\" stroke=\"url(#{name})\""));
    }
}

/// Returns a point of the page with the lowest value of the range and, along the gradient of the values in a triangle, one
/// with the highest value; `None` if the triangle is too thin or its values are equal.
fn isolines([(p, a), (q, b), (r, c)]: [([f64; 2], f64); 3], (low, high): (f64, f64)) -> Option<[[f64; 2]; 2]> {
    let (e, f) = ([q[0] - p[0], q[1] - p[1]], [r[0] - p[0], r[1] - p[1]]);
    let area = e[0] * f[1] - e[1] * f[0];
    if area.abs() < 0.5 {
        return None;
    }
    let slope = [((b - a) * f[1] - (c - a) * e[1]) / area, ((c - a) * e[0] - (b - a) * f[0]) / area];
    let square = slope[0] * slope[0] + slope[1] * slope[1];
    let at = |value: f64| [0, 1].map(|k| p[k] + (value - a) / square * slope[k]);
    let ends = [at(low), at(high)];
    ends.iter().flatten().all(|x| x.abs() < 1e6).then_some(ends)
}

/// Returns the lines to be drawn with each visible face, by the number of the face. A line between two visible faces is drawn
/// with the nearer one, which would cover half of it otherwise.
fn lines(
    skin: &BoundaryMesh,
    points: &[Vector3<f64>],
    visible: &[bool],
    order: &[(f64, usize)],
) -> HashMap<usize, Vec<Line>> {
    let rank: HashMap<usize, usize> = order.iter().enumerate().map(|(rank, &(_, face))| (face, rank)).collect();
    let mut lines: HashMap<usize, Vec<Line>> = HashMap::new();
    for edge in &skin.edges {
        let [a, b] = edge.faces;
        let [from, to] = [a, b].map(|face| normal(&skin.faces[face], points).try_normalize(0.0).unwrap_or_default());
        let is_crease = visible[a] != visible[b] || from.dot(&to) < CREASE;
        if let Some(&last) = edge.faces.iter().filter(|face| visible[**face]).max_by_key(|face| rank.get(face)) {
            lines.entry(last).or_default().push((edge.points, is_crease));
        }
    }
    lines
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Every edge of a visible face is drawn once, with the nearer one of its visible faces; the silhouette and the edges of the
    /// cube are creases, the diagonals of its sides are not.
    #[test]
    fn lines_are_complete() {
        let points: Vec<_> =
            (0..8).map(|k| Vector3::new((k & 1) as f64, (k >> 1 & 1) as f64, (k >> 2) as f64)).collect();
        let elements = vec![[0, 1, 3, 7], [0, 3, 2, 7], [0, 2, 6, 7], [0, 6, 4, 7], [0, 4, 5, 7], [0, 5, 1, 7]];
        let skin = BoundaryMesh::of(&elements.into());
        let toward = Vector3::new(1.0, 0.7, 0.4);
        let visible: Vec<bool> = skin.faces.iter().map(|face| normal(face, &points).dot(&toward) > 0.0).collect();
        let mut order: Vec<(f64, usize)> =
            (0..12).filter(|&face| visible[face]).map(|face| (face as f64, face)).collect();
        order.reverse();
        let drawn = lines(&skin, &points, &visible, &order);
        let mut all: Vec<Line> = drawn.values().flatten().copied().collect();
        all.iter_mut().for_each(|(ends, _)| ends.sort_unstable());
        all.sort_unstable();
        // Three sides of four edges and a diagonal each; three of the edges belong to two of them.
        assert_eq!((all.len(), all.iter().filter(|(_, is_crease)| *is_crease).count()), (12, 9));
        all.dedup();
        assert_eq!(all.len(), 12);
        for edge in &skin.edges {
            let faces: Vec<usize> = edge.faces.into_iter().filter(|&face| visible[face]).collect();
            let with = faces
                .iter()
                .filter(|face| drawn.get(face).is_some_and(|of| of.iter().any(|line| line.0 == edge.points)));
            assert_eq!(with.copied().min(), faces.into_iter().min(), "the last one in the order");
        }
    }

    #[test]
    fn gradients_end_where_the_range_ends() {
        // The value is 2 x + 1.
        let triangle = [([1.0, 0.0], 3.0), ([3.0, 0.0], 7.0), ([1.0, 5.0], 3.0)];
        let [from, to] = isolines(triangle, (1.0, 9.0)).unwrap();
        assert!(
            (from[0].abs() + from[1].abs()) < 1e-12 && (to[0] - 4.0).abs() + to[1].abs() < 1e-12,
            "{from:?} {to:?}"
        );
        assert_eq!(isolines([triangle[0], triangle[0], triangle[2]], (1.0, 9.0)), None);
    }
}
