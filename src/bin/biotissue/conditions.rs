//! The boundary conditions of a case on its mesh, in the plan of `biotissue check`.

use biotissue::app::case::{Case, LoadValue, PointCase, PointPlace, SurfaceLoad};
use biotissue::app::{LoadOf, LoadSize};
use biotissue::fem::constraint::ConstrainedVolume;
use biotissue::fem::mesh::Mesh;
use serde::Serialize;

/// A boundary condition or a load, and where it acts.
#[derive(Serialize)]
pub struct ConditionPlan {
    /// What it prescribes, such as `displacement x 0.001, y 0 m, 5.0 % of the longest edge`.
    condition: String,
    /// A surface, a node or a region.
    place: String,
    /// Number of faces, of a surface.
    #[serde(skip_serializing_if = "Option::is_none")]
    faces: Option<usize>,
    /// Area of a surface, m^2.
    #[serde(skip_serializing_if = "Option::is_none")]
    area: Option<f64>,
    /// The size of a traction, pressure or body force.
    #[serde(skip_serializing_if = "Option::is_none")]
    load: Option<LoadSize>,
}

impl ConditionPlan {
    /// Returns the line of the plan.
    pub fn text(&self) -> String {
        let Self { condition, place, faces, area, load } = self;
        let size = match (faces, area) {
            (Some(faces), Some(area)) => format!(" ({faces} faces, {area:.4e} m^2)"),
            _ => String::new(),
        };
        let load = load.as_ref().map_or(String::new(), |load| format!(", {}", load.text()));
        format!("condition  {place}{size}: {condition}{load}")
    }
}

/// Returns the conditions of a case with the sizes of its loads, and the surfaces without one.
pub fn conditions(case: &Case, mesh: &Mesh, loads: &[LoadSize]) -> (Vec<ConditionPlan>, Vec<String>) {
    let [low, high] = mesh.bounding_box();
    let edge = (0..3).map(|axis| high[axis] - low[axis]).fold(0.0, f64::max);
    let size_of = |of: LoadOf| loads.iter().find(|load| load.of == of).cloned();
    let on_surfaces = case.boundaries.iter().enumerate().filter_map(|(number, boundary)| {
        let surface = mesh.surfaces().iter().find(|surface| surface.name == boundary.surface)?;
        Some(ConditionPlan {
            condition: of_surface(&boundary.load, edge),
            place: format!("surface \"{}\"", boundary.surface),
            faces: Some(surface.faces.len()),
            area: Some(mesh.surface_area(surface)),
            load: size_of(LoadOf::Boundary(number)),
        })
    });
    let elsewhere = |condition: String, place: String, load: Option<LoadSize>| ConditionPlan {
        condition,
        place,
        faces: None,
        area: None,
        load,
    };
    let on_points = case.points.iter().enumerate().map(|(number, point)| {
        elsewhere(of_point(point, edge), node(case, mesh, point), size_of(LoadOf::Point(number)))
    });
    let on_regions = case.body_forces.iter().enumerate().map(|(number, force)| {
        let components = force.value.each_ref().map(|value| !value.is_zero());
        let (condition, place) = (format!("body force {}", listed(components)), format!("region \"{}\"", force.region));
        elsewhere(condition, place, size_of(LoadOf::BodyForce(number)))
    });
    let walls = case.constraints.iter().filter_map(|each| match &each.constraint.of {
        ConstrainedVolume::Cavity(surfaces) => Some(surfaces),
        ConstrainedVolume::Region(_) => None,
    });
    let named: Vec<&String> = case.boundaries.iter().map(|each| &each.surface).chain(walls.flatten()).collect();
    let free =
        mesh.surface_names().filter(|name| !named.iter().any(|other| other == name)).map(str::to_owned).collect();
    (on_surfaces.chain(on_points).chain(on_regions).collect(), free)
}

/// Describes what acts on a surface of a body with this longest edge, m.
fn of_surface(load: &SurfaceLoad, edge: f64) -> String {
    match load {
        SurfaceLoad::Displacement(components) => displacement(components, edge),
        SurfaceLoad::Traction(values) => {
            format!("traction {}", listed(values.each_ref().map(|value| !value.is_zero())))
        }
        SurfaceLoad::Pressure(_) => "pressure, which follows the surface".into(),
        SurfaceLoad::Foundation(_) => "elastic foundation".into(),
        SurfaceLoad::Symmetry => "plane of symmetry".into(),
        SurfaceLoad::Rigid(rigid) => {
            let rotation = values(&rigid.rotation, "rad");
            format!("rigid; {}; rotation {rotation}", displacement(&rigid.displacement, edge))
        }
    }
}

fn of_point(point: &PointCase, edge: f64) -> String {
    let is_moved = point.displacement.iter().any(Option::is_some);
    let force = point.force.as_ref().map_or([false; 3], |force| force.each_ref().map(|value| !value.is_zero()));
    let moved = is_moved.then(|| displacement(&point.displacement, edge));
    let pulled = force.contains(&true).then(|| format!("force {}", listed(force)));
    moved.into_iter().chain(pulled).collect::<Vec<_>>().join("; ")
}

/// Describes prescribed displacements, m, and the largest number among them relative to the longest edge of the body.
fn displacement(components: &[Option<LoadValue>; 3], edge: f64) -> String {
    let numbers = components.iter().flatten().filter_map(|value| match value {
        LoadValue::Number(number) => Some(number.abs()),
        LoadValue::Expression(_) => None,
    });
    let largest = numbers.fold(0.0, f64::max);
    let share =
        if largest > 0.0 { format!(", {:.1} % of the longest edge", 100.0 * largest / edge) } else { String::new() };
    format!("displacement {}{share}", values(components, "m"))
}

/// Lists components with their values, such as `x 0.1, z "t^2" m`.
fn values(components: &[Option<LoadValue>; 3], unit: &str) -> String {
    let value = |(name, value): (&str, &Option<LoadValue>)| match value.as_ref()? {
        LoadValue::Number(number) => Some(format!("{name} {number}")),
        LoadValue::Expression(expression) => Some(format!("{name} {:?}", expression.text())),
    };
    let given: Vec<String> = ["x", "y", "z"].into_iter().zip(components).filter_map(value).collect();
    if given.is_empty() { "free".into() } else { format!("{} {unit}", given.join(", ")) }
}

fn node(case: &Case, mesh: &Mesh, point: &PointCase) -> String {
    let node = match point.place {
        PointPlace::At(position) => mesh.nearest_node(position.map(|x| x * case.mesh_scale)).0,
        PointPlace::Node(node) => node,
    };
    let [x, y, z] = mesh.nodes().get(node).copied().unwrap_or_default();
    format!("node {node} at ({x:.4e}, {y:.4e}, {z:.4e}) m")
}

/// Names the components that are true, such as `x, z`.
fn listed(components: [bool; 3]) -> String {
    let names: Vec<&str> =
        ["x", "y", "z"].into_iter().zip(components).filter(|(_, is)| *is).map(|(name, _)| name).collect();
    if names.is_empty() { "free".into() } else { names.join(", ") }
}
