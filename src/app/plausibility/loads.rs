//! The loads of a case, each with the strain that it would cause in a uniform body.

use std::collections::{HashMap, HashSet};

use super::load_size::{LoadOf, LoadSize, regions_behind, softest_in};
use super::{Stiffness, short};
use crate::app::case::{Case, LoadCurve, LoadValue, PointCase, PointPlace, RigidCase, SurfaceLoad};
use crate::fem::boundary::centroid;
use crate::fem::mesh::Mesh;

/// A load and the strain that it would cause.
pub(super) struct Load {
    pub line: usize,
    pub strain: f64,
    /// The size of a traction, pressure, point force or body force.
    pub size: Option<LoadSize>,
    /// The warning if the strain is too large.
    pub message: String,
}

pub(super) fn loads(case: &Case, mesh: &Mesh, edge: f64, stiffnesses: &[Stiffness]) -> Vec<Load> {
    let displacement = |line: usize, place: &str, most: f64| {
        let message = format!(
            "the displacement of {place} is {} m, and the longest edge of the body {} m: are both in m? `scale` of [mesh] is \
             the length of a mesh unit in m",
            short(most),
            short(edge)
        );
        Load { line, strain: most / edge, size: None, message }
    };
    let loaded = loaded_points(case, mesh);
    let area = if loaded.is_empty() { f64::NAN } else { mesh.volume() / edge };
    let force = |line: usize, of: LoadOf, what: &str, most: f64, soft: Option<&Stiffness>| {
        let soft = soft?;
        // What multiplies the load to give a stress.
        let (unit, factor, over, question) = match of {
            LoadOf::Boundary(_) => ("Pa", 1.0, String::new(), "are both in Pa?"),
            LoadOf::BodyForce(_) => ("N/m^3", edge, format!(" over {} m", short(edge)), "are both in Pa?"),
            LoadOf::Point(_) => {
                let over = format!(" on {} m^2, the mean cross-section of the body", short(area));
                ("N", 1.0 / area, over, "is the force in N, and the modulus in Pa?")
            }
        };
        let strain = most * factor / soft.total();
        let message = format!(
            "{what} is {} {unit}{over}, {} times the stiffness of the region \"{}\", about {} Pa: {question}",
            short(most),
            short(strain),
            case.regions[soft.region].name,
            short(soft.total())
        );
        let size = (soft.total() > 0.0).then(|| LoadSize {
            of,
            largest: most,
            unit,
            softest_region: case.regions[soft.region].name.clone(),
            stiffness: soft.total(),
            ratio: strain,
        });
        Some(Load { line, strain, size, message })
    };
    let rotations = case.boundaries.iter().filter_map(|boundary| {
        let SurfaceLoad::Rigid(rigid) = &boundary.load else { return None };
        let components: Vec<&LoadValue> = rigid.rotation.iter().flatten().collect();
        let most = greatest(&components, &boundary.curve, || reference_of(case, mesh, &boundary.surface, rigid));
        let message = format!(
            "the rotation of surface \"{}\" is {} rad, {} turns: is it in rad?",
            boundary.surface,
            short(most),
            short(most / std::f64::consts::TAU)
        );
        Some(Load { line: boundary.line, strain: most, size: None, message })
    });
    let boundaries = case.boundaries.iter().enumerate().filter_map(|(number, boundary)| {
        let of_surface = |what: &str, most: f64| {
            let behind = regions_behind(mesh, &boundary.surface);
            let soft = softest_in(stiffnesses, case, mesh, |region| behind[region]);
            force(boundary.line, LoadOf::Boundary(number), what, most, soft)
        };
        let place = format!("surface \"{}\"", boundary.surface);
        let most = greatest(&boundary.load.values(), &boundary.curve, || nodes_of(mesh, &boundary.surface));
        match &boundary.load {
            SurfaceLoad::Displacement(_) => Some(displacement(boundary.line, &place, most)),
            SurfaceLoad::Traction(_) => of_surface(&format!("the traction on {place}"), most),
            SurfaceLoad::Pressure(_) => of_surface(&format!("the pressure on {place}"), most),
            SurfaceLoad::Rigid(rigid) => {
                let components: Vec<&LoadValue> = rigid.displacement.iter().flatten().collect();
                let reference = || reference_of(case, mesh, &boundary.surface, rigid);
                Some(displacement(boundary.line, &place, greatest(&components, &boundary.curve, reference)))
            }
            SurfaceLoad::Foundation(_) | SurfaceLoad::Symmetry => None,
        }
    });
    let points = case.points.iter().map(|point| {
        let components: Vec<&LoadValue> = point.displacement.iter().flatten().collect();
        let most = greatest(&components, &point.curve, || position_of(mesh, node_of(case, mesh, point)));
        displacement(point.line, "this point", most)
    });
    let point_forces = loaded.iter().filter_map(|LoadedPoint { number, node, regions }| {
        let point = &case.points[*number];
        let most = greatest(&point.force.as_ref()?.each_ref(), &point.curve, || position_of(mesh, *node));
        let soft = softest_in(stiffnesses, case, mesh, |region| regions.contains(&(region as u32)));
        let number = *number;
        force(point.line, LoadOf::Point(number), "the force on this point", most, soft)
    });
    let forces = case.body_forces.iter().enumerate().filter_map(|(number, body)| {
        let most = greatest(&body.value.each_ref(), &body.curve, || mesh.nodes().to_vec());
        let is_in = |region: usize| body.region == "*" || body.region == mesh.regions()[region];
        let soft = softest_in(stiffnesses, case, mesh, is_in);
        force(body.line, LoadOf::BodyForce(number), "the body force", most, soft)
    });
    boundaries.chain(rotations).chain(points).chain(point_forces).chain(forces).collect()
}

/// A point with a force.
struct LoadedPoint {
    /// Its number in the case.
    number: usize,
    node: u32,
    /// The regions of the elements around the node.
    regions: HashSet<u32>,
}

fn loaded_points(case: &Case, mesh: &Mesh) -> Vec<LoadedPoint> {
    let points = case.points.iter().enumerate().filter(|(_, point)| point.force.is_some());
    let mut loaded: Vec<LoadedPoint> = points
        .map(|(number, point)| LoadedPoint { number, node: node_of(case, mesh, point), regions: HashSet::new() })
        .collect();
    let mut regions: HashMap<u32, HashSet<u32>> = loaded.iter().map(|point| (point.node, HashSet::new())).collect();
    if !loaded.is_empty() {
        for (nodes, &region) in mesh.elements().iter().zip(mesh.region_of()) {
            for node in nodes {
                if let Some(regions) = regions.get_mut(node) {
                    regions.insert(region);
                }
            }
        }
    }
    loaded.iter_mut().for_each(|point| point.regions = regions.get(&point.node).cloned().unwrap_or_default());
    loaded
}

/// Returns the node of a point.
fn node_of(case: &Case, mesh: &Mesh, point: &PointCase) -> u32 {
    let node = match point.place {
        PointPlace::At(position) => mesh.nearest_node(position.map(|x| x * case.mesh_scale)).0,
        PointPlace::Node(node) => node,
    };
    node as u32
}

fn position_of(mesh: &Mesh, node: u32) -> Vec<[f64; 3]> {
    mesh.nodes().get(node as usize).copied().into_iter().collect()
}

/// Returns the positions of the nodes of a surface.
fn nodes_of(mesh: &Mesh, surface: &str) -> Vec<[f64; 3]> {
    let surface = mesh.surfaces().iter().find(|other| other.name == surface);
    surface.map_or_else(Vec::new, |surface| mesh.positions_of(&surface.nodes()))
}

/// Returns the reference point of a rigid surface, m.
fn reference_of(case: &Case, mesh: &Mesh, surface: &str, rigid: &RigidCase) -> Vec<[f64; 3]> {
    let given = rigid.reference.map(|point| point.map(|x| x * case.mesh_scale));
    let surface = mesh.surfaces().iter().find(|other| other.name == surface);
    given.or_else(|| surface.map(|surface| centroid(mesh, surface))).into_iter().collect()
}

/// Pseudo-times at which the magnitude of an expression is sampled.
const SAMPLES: [f64; 5] = [0.0, 0.25, 0.5, 0.75, 1.0];

/// The largest absolute value of a load; expressions are sampled at these positions where they are finite.
fn greatest(values: &[&LoadValue], curve: &LoadCurve, positions: impl FnOnce() -> Vec<[f64; 3]>) -> f64 {
    let terms: Vec<(f64, LoadCurve)> = values.iter().map(|value| value.with_curve(curve)).collect();
    let is_function = |(_, curve): &(f64, LoadCurve)| matches!(curve, LoadCurve::Function(_));
    let positions = if terms.iter().any(is_function) { positions() } else { Vec::new() };
    let most = |(value, curve): &(f64, LoadCurve)| value.abs() * peak(curve, &positions);
    terms.iter().map(most).fold(0.0, f64::max)
}

/// The largest absolute factor of a curve.
fn peak(curve: &LoadCurve, positions: &[[f64; 3]]) -> f64 {
    match curve {
        LoadCurve::Function(function) => {
            // A body force may be infinite at a node: it acts at integration points.
            let at =
                |t: f64| positions.iter().map(move |&x| function.factor(t, x).abs()).filter(|value| value.is_finite());
            SAMPLES.into_iter().flat_map(at).fold(0.0, f64::max)
        }
        LoadCurve::Ramp => 1.0,
        LoadCurve::Table(table) => table.points().iter().fold(0.0, |most: f64, [_, factor]| most.max(factor.abs())),
    }
}
