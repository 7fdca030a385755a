//! The picture of a body: its deformed shape (never exaggerated) colored by a field, with its fiber directions and the
//! outline of the undeformed shape; one self-contained SVG.
//!
//! The view is a parallel projection slightly from above and from the side, with the longest axis of the body across
//! the page. Visible faces are drawn from back to front. Each fiber line shows the direction of an element behind a
//! visible face, with the same foreshortening as the body.

mod body;
pub(crate) mod color;
mod faces;
mod legend;
mod network;
pub(super) mod view;

pub use self::network::{FiberColor, NetworkPicture, draw_network};

use std::path::Path;

use nalgebra::Vector3;

use self::view::{Frame, View};
use super::ReportError;
use super::directory::Directory;
use super::extension::{Kind, deformed};
use super::nodal::NodalAverages;
use super::quantity::Quantity;
use super::skin::BoundaryMesh;
use super::svg::Svg;
use super::units::significant;
use crate::app::results::Fields;
use crate::app::results::collection::Entry;

/// Width of the legend below a body, with and without the meaning of the fiber lines, pixels.
const LEGEND_WITH_FIBERS: f64 = 900.0;
const LEGEND: f64 = 720.0;

/// The content and the size of a picture.
#[derive(Clone, Debug, PartialEq)]
pub struct PictureOptions {
    /// The load step; if `None`, the last one with fields.
    pub step: Option<usize>,
    /// The field that defines the color; if `None`, von Mises stress or the first available field.
    pub field: Option<String>,
    /// The viewing axis: 0, 1, 2 for x, y, z; if `None`, the shortest edge of the body.
    pub axis: Option<usize>,
    /// The direction from the body to the viewer; it replaces `axis`.
    pub toward: Option<[f64; 3]>,
    /// The values at the ends of the color map, in the unit of the field; if `None`, those of the elements drawn.
    pub range: Option<[f64; 2]>,
    /// Maximum width, pixels; reduced if the body needs less.
    pub width: u32,
    /// Maximum height, pixels; reduced if the body needs less.
    pub height: u32,
}

impl Default for PictureOptions {
    fn default() -> Self {
        Self { step: None, field: None, axis: None, toward: None, range: None, width: 1200, height: 640 }
    }
}

/// The body in space and its projection onto the page.
#[derive(Clone, Debug)]
struct Scene {
    skin: BoundaryMesh,
    reference: Vec<Vector3<f64>>,
    current: Vec<Vector3<f64>>,
    view: View,
    frame: Frame,
}

/// The assignment of colors to values.
#[derive(Clone, Debug)]
struct Colors {
    quantity: Quantity,
    /// The values at the ends of the color map.
    range: (f64, f64),
    /// The smallest and the largest value drawn.
    extremes: (f64, f64),
    /// True if the range leaves out the outermost values, rather than being that of an option.
    is_trimmed: bool,
    map: Map,
}

/// The color map for a range of values.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Map {
    /// For faces: viridis.
    Faces,
    /// For lines on white: viridis without its light end.
    Lines,
    /// For lines of a quantity with this rest value: gray at the rest value, red above, blue below, symmetric about it.
    About(f64),
}

impl Colors {
    /// Takes the range of colors from the values that are drawn.
    fn new(quantity: Quantity, drawn: &[f64]) -> Self {
        let finite = drawn.iter().copied().filter(|value| value.is_finite());
        let extremes = finite.fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), value| (a.min(value), b.max(value)));
        Self { quantity, range: color::range(drawn), extremes, is_trimmed: true, map: Map::Faces }
    }

    /// Uses this range of values instead.
    fn within(mut self, range: Option<[f64; 2]>) -> Self {
        if let Some([low, high]) = range {
            (self.range, self.is_trimmed) = ((low, high), false);
        }
        self
    }

    fn of(&self, element: usize) -> [u8; 3] {
        self.at(self.quantity.values.get(element).copied().unwrap_or(f64::NAN))
    }

    /// Returns the color of a value; gray if there is none.
    fn at(&self, value: f64) -> [u8; 3] {
        /// The gray of the page's view of the body.
        const MISSING: [u8; 3] = [158, 168, 179];
        let (low, high) = self.range;
        if value.is_nan() {
            return MISSING;
        }
        match self.map {
            Map::Faces => color::viridis((value - low) / (high - low)),
            Map::Lines => color::viridis(0.87 * (value - low) / (high - low)),
            Map::About(rest) => color::diverging((value - rest) / (high - rest).max(rest - low)),
        }
    }
}

/// Draws the body of a result directory as SVG.
///
/// # Errors
/// Returns [`ReportError`] if the directory has no fields, no fields of the requested step, or not the requested field.
pub fn draw(dir: &Path, options: &PictureOptions) -> Result<String, ReportError> {
    draw_from(&Directory::open(dir)?, options)
}

/// Draws the body of a result directory that was already read; see [`draw`].
///
/// # Errors
/// See [`draw`].
pub fn draw_from(directory: &Directory, options: &PictureOptions) -> Result<String, ReportError> {
    let entry = directory.field_file(options.step)?;
    let fields = directory.read_fields(entry)?;
    let quantity = Quantity::find(&fields, options.field.as_deref())?;
    let extension = directory.extension_at(entry, &fields);
    Ok(compose(&directory.title(), &state(entry, extension), &fields, quantity, options))
}

/// Formats the state: `step 3 · t = 0.3 · extension 12.5 %`.
fn state(entry: &Entry, extension: Option<(Kind, f64)>) -> String {
    let step = entry.step().map(|step| format!("step {step}"));
    let extension = extension.map(|(kind, extension)| {
        let name = if kind == Kind::Shear { "shear" } else { "extension" };
        let extension = if extension.abs() < 1e-9 { 0.0 } else { extension };
        format!("{name} {}\u{a0}%", significant(100.0 * extension))
    });
    let parts = [step, Some(format!("t\u{a0}=\u{a0}{}", significant(entry.time))), extension];
    parts.into_iter().flatten().collect::<Vec<_>>().join("  \u{b7}  ")
}

fn compose(title: &str, state: &str, fields: &Fields, quantity: Option<Quantity>, options: &PictureOptions) -> String {
    let (width, most) = (f64::from(options.width.max(480)), f64::from(options.height.max(300)));
    let room = |[width, height]: [f64; 2]| [28.0, 82.0, width - 56.0, height - 82.0 - 96.0];
    let mut scene = scene(fields, options);
    scene.fit(room([width, most]));
    // Beside or above a body that fills the other direction, the page would be empty. The legend needs a width too.
    let legend = if fields.cell_vector("fiber_direction").is_some() { LEGEND_WITH_FIBERS } else { LEGEND };
    let height = most - (scene.frame.unused_height - 10.0).max(0.0).floor();
    let width = (width - scene.frame.unused_width.floor()).max(legend.min(width));
    scene.fit(room([width, height]));
    let seen = body::visible_elements(&scene);
    let averages = quantity.as_ref().filter(|quantity| !quantity.is_integer);
    let averages = averages.map(|quantity| NodalAverages::of(fields, &quantity.values));
    let colors = quantity.map(|quantity| {
        let drawn = drawn_values(&quantity, averages.as_ref(), &seen, fields);
        Colors::new(quantity, &drawn).within(options.range)
    });

    let mut svg = Svg::new(width, height, &format!("{title}: the deformed body, {state}"));
    legend::title(&mut svg, title, state);
    faces::draw(&mut svg, &scene, colors.as_ref(), averages.as_ref());
    body::outline(&mut svg, &scene);
    let alignment = fields.cell_scalar("fiber_alignment");
    let fibers = fields
        .cell_vector("fiber_direction")
        .map(|directions| body::fiber_lines(&scene, &seen, &fields.elements, directions, alignment))
        .unwrap_or_default();
    body::fibers(&mut svg, &fibers);

    let bottom = height - 30.0;
    legend::axes(&mut svg, &scene.view, [52.0, bottom - 6.0]);
    let right = legend::scale_bar(&mut svg, &scene, [112.0, bottom]);
    let meaning = (!fibers.is_empty()).then_some(match alignment {
        Some(_) => "mean fiber direction, longer where aligned",
        None => "mean fiber direction",
    });
    let right = legend::lines(&mut svg, [right + 36.0, bottom], meaning);
    if let Some(colors) = &colors {
        legend::color_bar(&mut svg, colors, right, [width - 36.0, bottom - 24.0]);
    }
    svg.finish()
}

/// Returns the values that colors stand for: the averages at the nodes of these elements, or the values of the elements.
fn drawn_values(
    quantity: &Quantity,
    averages: Option<&NodalAverages>,
    elements: &[usize],
    fields: &Fields,
) -> Vec<f64> {
    match averages {
        None => elements.iter().filter_map(|&element| quantity.values.get(element).copied()).collect(),
        Some(averages) => {
            let of_element =
                |&element: &usize| fields.elements[element].iter().map(move |&node| averages.at(node, element));
            elements.iter().flat_map(of_element).collect()
        }
    }
}

fn scene(fields: &Fields, options: &PictureOptions) -> Scene {
    let reference: Vec<Vector3<f64>> = fields.points.iter().map(|&point| point.into()).collect();
    let current: Vec<Vector3<f64>> = deformed(fields).map(Vector3::from).collect();
    let skin = BoundaryMesh::of(&fields.elements);
    let first = reference.first().copied().unwrap_or_default();
    let (low, high) = reference.iter().fold((first, first), |(low, high), point| (low.inf(point), high.sup(point)));
    let view = View::of(high - low, options.axis, options.toward);
    Scene { skin, reference, current, view, frame: Frame::default() }
}

impl Scene {
    /// Fits the deformed and the undeformed body into a rectangle of the page (left, top, width, height).
    fn fit(&mut self, room: [f64; 4]) {
        // Only boundary points: a mesh file may have points that no element uses.
        let rim = self.skin.faces.iter().flat_map(|face| &face.points).map(|&point| point as usize);
        let both = rim.flat_map(|point| [&self.reference[point], &self.current[point]]);
        self.frame = Frame::fit(both.map(|point| self.view.project(point)), room);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns a unit cube made of eight smaller cubes, with shear strain 0.25.
    fn cube() -> Fields {
        let node = |i: usize, j: usize, k: usize| (i + 3 * (j + 3 * k)) as u32;
        let half = |k: usize| k as f64 / 2.0;
        let points: Vec<[f64; 3]> = (0..27).map(|n| [half(n % 3), half(n / 3 % 3), half(n / 9)]).collect();
        let mut elements = Vec::new();
        for c in 0..8 {
            let corner = |a: usize| node((c & 1) + (a & 1), (c >> 1 & 1) + (a >> 1 & 1), (c >> 2) + (a >> 2));
            for tet in [[0, 1, 3, 7], [0, 3, 2, 7], [0, 2, 6, 7], [0, 6, 4, 7], [0, 4, 5, 7], [0, 5, 1, 7]] {
                elements.push(tet.map(corner));
            }
        }
        let displacement = points.iter().map(|point| [0.25 * point[1], 0.0, 0.0]).collect();
        let energy = (0..elements.len()).map(|element| element as f64).collect();
        Fields {
            points,
            elements: elements.into(),
            point_vectors: vec![("displacement".into(), displacement)],
            cell_scalars: vec![("energy_density".into(), energy)],
            ..Fields::default()
        }
    }

    #[test]
    fn the_three_sides_of_a_cube_that_face_the_viewer_are_drawn() {
        let fields = cube();
        let mut scene = scene(&fields, &PictureOptions::default());
        scene.fit([0.0, 0.0, 100.0, 100.0]);
        let colors = Colors::new(Quantity::find(&fields, None).unwrap().unwrap(), &[0.0, 1.0]);
        let mut svg = Svg::new(100.0, 100.0, "");
        faces::draw(&mut svg, &scene, Some(&colors), None);
        assert_eq!(svg.finish().matches("z\" fill=").count(), 3 * 8);

        let depth = |point: Vector3<f64>| scene.view.project(&point)[2];
        let middle = depth(scene.current.iter().sum::<Vector3<f64>>() / 27.0);
        for element in body::visible_elements(&scene) {
            let nearest = fields.elements[element].iter().map(|&node| depth(scene.current[node as usize]));
            assert!(nearest.fold(f64::MIN, f64::max) > middle, "element {element}");
        }
    }

    #[test]
    fn colors_follow_the_field_of_the_element() {
        let fields = cube();
        let quantity = Quantity::find(&fields, Some("energy_density")).unwrap().unwrap();
        let colors = Colors::new(quantity, &[10.0, 20.0, 30.0]);
        assert_eq!((colors.range, colors.extremes), ((10.0, 30.0), (10.0, 30.0)));
        assert_eq!([10, 20, 30].map(|e| colors.of(e)), [0.0, 0.5, 1.0].map(color::viridis));
        assert!(Quantity::find(&Fields::default(), None).unwrap().is_none());
    }

    #[test]
    fn a_fiber_line_shows_direction_and_alignment() {
        let fields = cube();
        let mut scene = scene(&fields, &PictureOptions { axis: Some(2), ..PictureOptions::default() });
        scene.fit([0.0, 0.0, 300.0, 300.0]);
        let directions = vec![[0.0, 3.0, 0.0]; fields.elements.len()];
        let seen = body::visible_elements(&scene);
        let length = |[[ax, ay], [bx, by]]: &[[f64; 2]; 2]| (bx - ax).hypot(by - ay);
        let lines =
            |alignment: &[f64]| body::fiber_lines(&scene, &seen, &fields.elements, &directions, Some(alignment));
        let mut alignment = vec![0.0; fields.elements.len()];
        alignment[seen[0]] = 0.5;
        let mixed = lines(&alignment);
        assert!(length(&mixed[0]) > 2.0 * length(&mixed[1]), "{mixed:?}");
        for [[ax, ay], [bx, by]] in mixed {
            assert!((bx - ax).abs() < 1e-12 && by < ay, "y points up the page");
        }
        let none = vec![[0.0; 3]; fields.elements.len()];
        assert!(body::fiber_lines(&scene, &seen, &fields.elements, &none, None).is_empty());
    }
}
