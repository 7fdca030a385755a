//! Drawing the body: colored faces, creases, the outline of the undeformed body, and the fibers near the visible
//! surface.

use std::collections::HashMap;

use nalgebra::Vector3;

use super::color::shade;
use super::view::View;
use super::{Colors, Scene};
use crate::app::report::skin::{BoundaryMesh, lines, normal};
use crate::app::report::svg::{Svg, hex};
use crate::fem::mesh::Elements;

/// Cosine of the crease angle (35 degrees): faces that meet at a larger angle form a crease.
const CREASE: f64 = 0.82;
/// Height, in pixels, below which faces are drawn without light edges.
const SMALL: f64 = 5.0;
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
fn visible(skin: &BoundaryMesh, points: &[Vector3<f64>], view: &View) -> Vec<bool> {
    skin.faces.iter().map(|face| normal(face, points).dot(&view.toward) > 0.0).collect()
}

/// Draws the visible faces from back to front, each with the creases on its edges, so that near faces cover far ones.
pub(super) fn faces(svg: &mut Svg, scene: &Scene, colors: Option<&Colors>) {
    let Scene { skin, current, view, frame, .. } = scene;
    let visible = visible(skin, current, view);
    let creases = creases(skin, current, &visible);
    let depth = |face: usize| -> f64 {
        let points = &skin.faces[face].points;
        points.iter().map(|&point| view.toward.dot(&current[point as usize])).sum::<f64>() / points.len() as f64
    };
    let mut order: Vec<(f64, usize)> =
        (0..skin.faces.len()).filter(|&face| visible[face]).map(|face| (depth(face), face)).collect();
    order.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));

    let place = |point: &u32| frame.page_position(view.project(&current[*point as usize]));
    svg.open(
        "stroke=\"#fff\" stroke-opacity=\".28\" stroke-width=\".6\" stroke-linejoin=\"round\" stroke-linecap=\"round\"",
    );
    for (_, k) in order {
        let face = &skin.faces[k];
        let plain = colors.map_or([176, 190, 197], |colors| colors.of(face.element));
        let color = hex(shade(plain, view.light(&normal(face, current))));
        let corners: Vec<[f64; 2]> = face.points.iter().map(place).collect();
        // The light edges of very small faces would wash out the colors.
        let rim =
            if height(&corners) < SMALL { format!(" stroke=\"{color}\" stroke-opacity=\"1\"") } else { String::new() };
        svg.path(&corners, true, &format!("fill=\"{color}\"{rim}"));
        if let Some(creases) = creases.get(&k) {
            let rim: Vec<_> = creases.iter().map(|edge| edge.map(|point| place(&point))).collect();
            svg.segments(&rim, "stroke=\"#1b2733\" stroke-opacity=\".75\" stroke-width=\"1\" fill=\"none\"");
        }
    }
    svg.close();
}

/// Returns twice the area of a polygon divided by its longest side or diagonal; the smallest height of a triangle.
fn height(corners: &[[f64; 2]]) -> f64 {
    let to = |k: usize| [corners[k][0] - corners[0][0], corners[k][1] - corners[0][1]];
    let areas = (1..corners.len() - 1).map(|k| to(k)[0] * to(k + 1)[1] - to(k)[1] * to(k + 1)[0]);
    let pairs = corners.iter().enumerate().flat_map(|(k, a)| corners[k + 1..].iter().map(move |b| (a, b)));
    let longest = pairs.map(|(a, b)| (b[0] - a[0]).hypot(b[1] - a[1])).fold(f64::MIN_POSITIVE, f64::max);
    areas.sum::<f64>().abs() / longest
}

/// Returns the edges to be drawn with each visible face, by the number of the face: silhouette edges and creases.
fn creases(skin: &BoundaryMesh, points: &[Vector3<f64>], visible: &[bool]) -> HashMap<usize, Vec<[u32; 2]>> {
    let mut creases: HashMap<usize, Vec<[u32; 2]>> = HashMap::new();
    for edge in &skin.edges {
        let [a, b] = edge.faces;
        if !visible[a] && !visible[b] {
            continue;
        }
        let [from, to] = [a, b].map(|face| normal(&skin.faces[face], points).try_normalize(0.0).unwrap_or_default());
        if visible[a] != visible[b] || from.dot(&to) < CREASE {
            for face in edge.faces.into_iter().filter(|&face| visible[face]) {
                creases.entry(face).or_default().push(edge.points);
            }
        }
    }
    creases
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
    edges.get(edges.len() / 2).map_or(12.0, |&edge| (0.85 * edge).clamp(7.0, 26.0))
}

/// Draws fiber lines, light with a dark rim, so that they are visible on any color.
pub(super) fn fibers(svg: &mut Svg, segments: &[[[f64; 2]; 2]]) {
    svg.open("fill=\"none\" stroke-linecap=\"round\"");
    svg.segments(segments, "stroke=\"#101820\" stroke-opacity=\".5\" stroke-width=\"2.6\"");
    svg.segments(segments, "stroke=\"#fff\" stroke-width=\"1.2\"");
    svg.close();
}
