//! Drawing the body: which faces are visible, the outline of the undeformed body, and the fibers near the visible surface.

use std::collections::HashMap;

use nalgebra::Vector3;

use super::Scene;
use super::view::View;
use crate::app::report::skin::{BoundaryMesh, lines, normal};
use crate::app::report::svg::Svg;
use crate::fem::mesh::Elements;

/// Edge length, in pixels, of the squares in each of which at most one fiber line is centered.
const FIBER_SPACING: f64 = 9.0;

/// Returns the elements behind the visible faces, without repetition.
pub(super) fn visible_elements(scene: &Scene) -> Vec<usize> {
    let mut elements: Vec<usize> = visible(&scene.skin, &scene.current, &scene.view)
        .iter()
        .zip(&scene.skin.faces)
        .filter(|(visible, _)| **visible)
        .map(|(_, face)| face.element)
        .collect();
    elements.sort_unstable();
    elements.dedup();
    elements
}

/// Returns, for every face, whether it faces the viewer.
pub(super) fn visible(skin: &BoundaryMesh, points: &[Vector3<f64>], view: &View) -> Vec<bool> {
    skin.faces.iter().map(|face| normal(face, points).dot(&view.toward) > 0.0).collect()
}

/// Draws the silhouette of the undeformed body.
pub(super) fn outline(svg: &mut Svg, scene: &Scene) {
    let Scene { skin, reference, view, frame, .. } = scene;
    let visible = visible(skin, reference, view);
    let rim: Vec<[u32; 2]> = skin
        .edges
        .iter()
        .filter(|edge| visible[edge.faces[0]] != visible[edge.faces[1]])
        .map(|edge| edge.points)
        .collect();
    svg.open(OUTLINE);
    for line in lines(&rim) {
        let places: Vec<_> =
            line.iter().map(|&point| frame.page_position(view.project(&reference[point as usize]))).collect();
        svg.path(&places, false, "");
    }
    svg.close();
}

/// Attributes of the undeformed outline, in the picture and in its legend.
pub(super) const OUTLINE: &str = "fill=\"none\" stroke=\"#37474f\" stroke-width=\".9\" stroke-opacity=\".8\" \
                                  stroke-dasharray=\"5 3\" stroke-linejoin=\"round\"";

/// Returns the fiber directions of `elements` as lines on the page, each centered at its element. `mesh` contains the
/// nodes of all elements; `directions` and `alignment` have one entry per element of the mesh.
pub(super) fn fiber_lines(
    scene: &Scene,
    elements: &[usize],
    mesh: &Elements,
    directions: &[[f64; 3]],
    alignment: Option<&[f64]>,
) -> Vec<[[f64; 2]; 2]> {
    let length = fiber_length(scene);
    let strongest = elements
        .iter()
        .filter_map(|&element| alignment?.get(element).copied())
        .filter(|strength| strength.is_finite())
        .fold(0.0, f64::max);
    let strength = |element: usize| match alignment.and_then(|all| all.get(element)) {
        Some(&own) if strongest > 0.0 => (own / strongest).clamp(0.0, 1.0),
        _ => 1.0,
    };
    let mut taken: HashMap<[i64; 2], ()> = HashMap::new();
    let mut drawn = Vec::new();
    for &element in elements {
        let (Some((_, nodes)), Some(direction)) = (mesh.get(element), directions.get(element)) else { continue };
        let Some(direction) = Vector3::from(*direction).try_normalize(1e-12) else { continue };
        let middle = nodes.iter().map(|&node| scene.current[node as usize]).sum::<Vector3<f64>>() / nodes.len() as f64;
        let [x, y] = scene.frame.page_position(scene.view.project(&middle));
        let cell = [x, y].map(|place| (place / FIBER_SPACING).floor() as i64);
        if taken.insert(cell, ()).is_some() {
            continue;
        }
        let half = 0.5 * length * (0.35 + 0.65 * strength(element));
        let [across, up, _] = scene.view.project(&direction);
        let (dx, dy) = (half * across, -half * up);
        drawn.push([[x - dx, y - dy], [x + dx, y + dy]]);
    }
    drawn
}

/// Returns the length, in pixels, of the longest fiber line: about the distance between the centers of neighboring
/// faces.
fn fiber_length(scene: &Scene) -> f64 {
    edge_length(scene).map_or(12.0, |edge| (0.85 * edge).clamp(7.0, 26.0))
}

/// Returns the median length of the edges of the surface, pixels.
pub(super) fn edge_length(scene: &Scene) -> Option<f64> {
    let mut edges: Vec<f64> = scene
        .skin
        .edges
        .iter()
        .map(|edge| {
            let [a, b] = edge.points.map(|point| scene.current[point as usize]);
            (a - b).norm() * scene.frame.scale
        })
        .collect();
    edges.sort_by(f64::total_cmp);
    edges.get(edges.len() / 2).copied()
}

/// Draws fiber lines, light with a dark rim, so that they are visible on any color.
pub(super) fn fibers(svg: &mut Svg, segments: &[[[f64; 2]; 2]]) {
    svg.open("fill=\"none\" stroke-linecap=\"round\"");
    svg.segments(segments, "stroke=\"#101820\" stroke-opacity=\".5\" stroke-width=\"2.6\"");
    svg.segments(segments, "stroke=\"#fff\" stroke-width=\"1.2\"");
    svg.close();
}
