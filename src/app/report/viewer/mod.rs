//! The body of the page in three dimensions, and selected networks before and after loading: numbers of the result
//! directory, and scripts that draw them by WebGL 2 without any other file.
//!
//! The scripts are in `js`, one file per subject; [`html`] joins them: 1 000 lines, 49 kB of a page. three.js or vtk.js would
//! add several hundred kilobytes to every page and to the sources, and need code for what they do not have: cuts through
//! tetrahedra, values within an element, lines of the mesh that a triangulated face does not have. Without WebGL 2 or
//! without scripts, the page shows the still picture.

mod body;
mod decimate;
mod networks;
mod pack;
mod steps;

use std::collections::HashSet;
use std::fmt::Write;

use nalgebra::Vector3;
use serde::Serialize;

use self::body::Body;
use self::networks::NetworkPage;
use self::pack::{Packed, integers, pack};
use self::steps::{Field, Step, Steps};
use super::ReportError;
use super::directory::Directory;
use super::extension::deformed;
use super::picture::PictureOptions;
use super::picture::view::View;
use super::units::{escape, prefix};
use crate::app::results::Fields;

/// Most fiber directions that are drawn.
const MOST_GLYPHS: usize = 3000;

/// The style of the viewer.
pub(super) const STYLE: &str = include_str!("viewer.css");

/// The scripts, in the order of their dependencies.
const SCRIPTS: [&str; 7] = [
    include_str!("js/data.js"),
    include_str!("js/gl.js"),
    include_str!("js/camera.js"),
    include_str!("js/cut.js"),
    include_str!("js/body.js"),
    include_str!("js/networks.js"),
    include_str!("js/page.js"),
];

/// All numbers of the page in three dimensions; read by `js/page.js`.
#[derive(Serialize)]
#[serde(rename_all = "camelCase")]
struct Data {
    /// Directions to the right, up and toward the viewer.
    view: [[f64; 3]; 3],
    /// The box around the deformed body at the last step and the undeformed one.
    #[serde(rename = "box")]
    bounds: Bounds,
    center: [f64; 3],
    radius: f64,
    length: Unit,
    reference: Packed,
    triangles: String,
    behind: String,
    elements: String,
    edges: String,
    mesh_edges: usize,
    tetrahedra: String,
    /// The triangles at which fiber directions are drawn, and the length of the longest line, m.
    glyphs: String,
    glyph_length: f64,
    fields: Vec<Field>,
    displacement_range: [f64; 2],
    steps: Vec<Step>,
    /// The place of the step that is shown first.
    start: usize,
    /// True for a body in pieces, whose elements have other numbers than in its mesh.
    renumbered: bool,
    networks: NetworkPage,
}

#[derive(Serialize)]
struct Bounds {
    low: [f64; 3],
    high: [f64; 3],
}

/// A unit with its prefix, and the factor to it from m.
#[derive(Serialize)]
struct Unit {
    unit: String,
    factor: f64,
}

/// Returns the part of the page with body and networks, and with the scripts that draw them; `picture` is the still
/// picture, `last` are the fields of the last step. Empty if the body has no fields that can be read.
///
/// # Errors
/// Returns [`ReportError`] if a file is damaged.
pub(super) fn html(
    directory: &Directory,
    last: &Fields,
    options: &PictureOptions,
    picture: &str,
) -> Result<String, ReportError> {
    let body = Body::of(last);
    let glyphs = glyphs(last, &body);
    let of_glyphs: Vec<u32> =
        glyphs.iter().map(|&triangle| body.elements[body.behind[triangle as usize] as usize]).collect();
    let steps = steps::collect(directory, &body, last, &of_glyphs, options.step)?;
    let networks = networks::collect(directory)?;
    let notes = notes(directory, &body, &steps, &networks, last);
    let data = data(directory, last, options, &body, &glyphs, steps, networks);
    let json = serde_json::to_string(&data).unwrap_or_default();
    let mut html = format!("<noscript id=\"still\"><figure class=\"picture\">{picture}</figure></noscript>\n");
    let _ = writeln!(html, "{}<figcaption>{}</figcaption>\n</figure>", include_str!("viewer.html"), escape(&notes[0]));
    let _ =
        writeln!(html, "{}<figcaption>{}</figcaption>\n</figure>", include_str!("networks.html"), escape(&notes[1]));
    // No text of the data ends the element or begins a comment.
    let json = json.replace('<', "\\u003c");
    let _ = writeln!(html, "<script type=\"application/json\" id=\"viewer-data\">{json}</script>");
    let _ = writeln!(html, "<script>\n\"use strict\";\n(() => {{\n{}}})();\n</script>", SCRIPTS.concat());
    Ok(html)
}

fn data(
    directory: &Directory,
    last: &Fields,
    options: &PictureOptions,
    body: &Body,
    glyphs: &[u32],
    steps: Steps,
    networks: NetworkPage,
) -> Data {
    let current: Vec<[f64; 3]> = deformed(last).collect();
    let place = |points: &[[f64; 3]]| body.nodes.iter().map(|&node| points[node as usize]).collect::<Vec<_>>();
    let (rest, moved) = (place(&last.points), place(&current));
    let bounds = bounds(rest.iter().chain(&moved));
    let of_rest = self::bounds(rest.iter());
    let [low, high] = [bounds.low, bounds.high].map(Vector3::from);
    let edges = Vector3::from(of_rest.high) - Vector3::from(of_rest.low);
    let view = View::of(edges, options.axis, options.toward);
    let (power, name) = prefix(edges.max());
    let wanted = options.step.or_else(|| directory.fields.last().and_then(|entry| entry.step()));
    let start = wanted.and_then(|wanted| steps.steps.iter().rposition(|step| step.step == Some(wanted)));
    Data {
        view: [view.right, view.up, view.toward].map(Into::into),
        center: ((low + high) / 2.0).into(),
        radius: ((high - low).norm() / 2.0).max(f64::MIN_POSITIVE),
        bounds,
        length: Unit { unit: format!("{name}m"), factor: 1.0 / power },
        reference: pack(&rest),
        triangles: integers(body.triangles.iter().flatten().copied()),
        behind: integers(body.behind.iter().copied()),
        elements: integers(body.elements.iter().copied()),
        edges: integers(body.edges.iter().flatten().copied()),
        mesh_edges: body.mesh_edges,
        tetrahedra: integers(body.tetrahedra.iter().flat_map(|&([a, b, c, d], element)| [a, b, c, d, element])),
        glyphs: integers(glyphs.iter().copied()),
        glyph_length: 0.85 * glyph_spacing(last, body, glyphs.len()),
        fields: steps.fields,
        displacement_range: steps.displacement_range,
        start: start.unwrap_or(steps.steps.len().saturating_sub(1)),
        steps: steps.steps,
        renumbered: directory.fields.last().is_some_and(|entry| entry.file.ends_with(".pvtu")),
        networks,
    }
}

fn bounds<'a>(points: impl Iterator<Item = &'a [f64; 3]>) -> Bounds {
    let start = Bounds { low: [f64::INFINITY; 3], high: [f64::NEG_INFINITY; 3] };
    points.fold(start, |Bounds { low, high }, point| Bounds {
        low: std::array::from_fn(|k| low[k].min(point[k])),
        high: std::array::from_fn(|k| high[k].max(point[k])),
    })
}

/// Returns the area of the surface.
fn area(last: &Fields, body: &Body) -> f64 {
    let at = |vertex: u32| Vector3::from(last.points[body.nodes[vertex as usize] as usize]);
    let of_triangle = |[a, b, c]: &[u32; 3]| (at(*b) - at(*a)).cross(&(at(*c) - at(*a))).norm() / 2.0;
    body.triangles.iter().map(of_triangle).sum()
}

/// Returns the mean distance between fiber lines on the surface.
fn glyph_spacing(last: &Fields, body: &Body, count: usize) -> f64 {
    (area(last, body) / count.max(1) as f64).sqrt()
}

/// Chooses triangles of elements with fibers, at most one in each cell of a grid.
fn glyphs(last: &Fields, body: &Body) -> Vec<u32> {
    let Some(directions) = last.cell_vector("fiber_direction") else { return Vec::new() };
    let has_fibers = |element: u32| directions.get(element as usize).is_some_and(|d| d.iter().any(|&part| part != 0.0));
    let spacing = (area(last, body) / MOST_GLYPHS as f64).sqrt();
    let mut met: HashSet<[i64; 3]> = HashSet::new();
    let mut of_elements: HashSet<u32> = HashSet::new();
    let mut chosen = Vec::new();
    for (number, (triangle, &behind)) in (0..).zip(body.triangles.iter().zip(&body.behind)) {
        let corner = |k: usize| last.points[body.nodes[triangle[k] as usize] as usize];
        let center: [f64; 3] = std::array::from_fn(|axis| (0..3).map(|k| corner(k)[axis]).sum::<f64>() / 3.0);
        let cell = center.map(|x| (x / spacing).floor() as i64);
        // A face of several triangles shows the direction of its element once.
        if has_fibers(body.elements[behind as usize]) && of_elements.insert(behind) && met.insert(cell) {
            chosen.push(number);
        }
    }
    chosen.into_iter().take(2 * MOST_GLYPHS).collect()
}

/// Returns the captions of the body and of the networks, which say what was left out.
fn notes(directory: &Directory, body: &Body, steps: &Steps, networks: &NetworkPage, last: &Fields) -> [String; 2] {
    let mut note = String::from(
        "Drag to turn, click and use the wheel to zoom, shift and drag to move. Displacements are not exaggerated. Colors of \
         stresses, strains and stretches are averages at the nodes, within each region.",
    );
    if let Some(before) = body.reduced_from {
        let after = body.triangles.len();
        let _ = write!(note, " Reduced surface: {after} of {before} triangles.");
    }
    if body.tetrahedra.is_empty() {
        let _ = write!(
            note,
            " A clip shows the surface from inside: of {} elements, the page holds the surface.",
            last.elements.len()
        );
    }
    if steps.omitted > 0 {
        let all = directory.fields.len();
        let _ = write!(note, " The page holds {} of {all} steps.", steps.steps.len());
    }
    let mut of_networks = String::from("The network follows the step of the body above.");
    if networks.networks.len() < networks.of {
        let _ = write!(of_networks, " The page holds {} of {} networks.", networks.networks.len(), networks.of);
    }
    if networks.networks.iter().any(|network| network.reference.is_none()) {
        of_networks.push_str(" Network files of earlier versions do not contain the nodes before loading.");
    }
    [note, of_networks]
}
