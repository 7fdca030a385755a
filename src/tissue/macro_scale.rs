//! The macro scale of a tissue: translates a case to the types of [`crate::fem`].

use std::sync::Arc;

use thiserror::Error;

use crate::app::case::{self, Case, CurveCase, LoadCase, MeshSource, PointPlace};
use crate::fem::boundary::{
    BodyForce, Boundary, BoundaryError, Conditions, CurveError, LoadCondition, LoadCurve, PointCondition,
    PointLocation, SurfaceCondition, Traction,
};
use crate::fem::mesh::shapes::{self, ShapeError};
use crate::fem::mesh::{Mesh, gmsh};
use crate::fem::stepping::{StepParams, StepStart};
use crate::input::{InputError, InputErrors};

/// The reason why the mesh or the boundary conditions of a case cannot be created.
#[derive(Debug, Error)]
pub enum MacroScaleError {
    /// The mesh file has errors, or the case uses names that the mesh does not have.
    #[error(transparent)]
    Input(#[from] InputErrors),
    /// A load curve is invalid.
    #[error("the load curve in line {line}: {reason}")]
    Curve {
        /// Line in the case file.
        line: usize,
        /// The error in the curve.
        reason: CurveError,
    },
}

/// Reads or generates the mesh of a case, in meters, and checks the names in the case against it. Also returns the
/// warnings of the reader.
///
/// # Errors
/// Returns [`MacroScaleError::Input`] if the mesh cannot be read, generated or scaled, or lacks a name in the case.
pub fn mesh(case: &Case) -> Result<(Mesh, Vec<String>), MacroScaleError> {
    let (mesh, warnings) = match &case.mesh {
        MeshSource::File(path) => {
            let read = gmsh::read(path).map_err(InputErrors::from)?;
            (read.mesh, read.warnings)
        }
        MeshSource::Box { cells, size } => {
            (shapes::cuboid(*cells, *size).map_err(|error| not_made(case, &error))?, Vec::new())
        }
        MeshSource::Dogbone { element_size } => {
            let shape = shapes::DogboneShape::default();
            (shapes::dogbone(&shape, *element_size).map_err(|error| not_made(case, &error))?, Vec::new())
        }
    };
    let mesh = match case.mesh_scale {
        1.0 => mesh,
        scale => mesh.scaled(scale).map_err(|error| {
            let what = format!("the mesh cannot be scaled by {scale:e}: {error}");
            let cure = "`scale` is the length of one mesh unit in m: correct it";
            InputErrors::from(InputError::at_line(&case.file, case.mesh_line, what, "a mesh of finite size", cure))
        })?,
    };
    let surfaces: Vec<String> = mesh.surface_names().map(str::to_owned).collect();
    case.check_names(mesh.regions(), &surfaces)?;
    Ok((mesh, warnings))
}

/// The error for a built-in shape that cannot be generated from the given lengths.
fn not_made(case: &Case, error: &ShapeError) -> InputErrors {
    let (expected, cure) = match error {
        ShapeError::TooManyElements { .. } => (
            format!("at most {} elements", shapes::MAX_ELEMENTS),
            "choose fewer `cells`, or a greater `element_size`: it is in mesh units",
        ),
        ShapeError::ElementTooLarge { what, .. } => {
            (format!("an `element_size` below the {what} of the sample"), "correct it: it is in mesh units")
        }
        _ => ("lengths that make a body".into(), "correct the lengths of `generate`: they are in mesh units"),
    };
    InputError::at_line(&case.file, case.mesh_line, error.to_string(), expected, cure).into()
}

/// Applies the boundary conditions of a case to its mesh.
///
/// # Errors
/// Returns [`MacroScaleError::Input`] if a condition contradicts the mesh or another condition, with its line.
pub fn boundary(case: &Case, mesh: &Mesh, conditions: &Conditions) -> Result<Boundary, MacroScaleError> {
    Boundary::new(mesh, conditions).map_err(|error| {
        let (line, expected, cure) = match &error {
            BoundaryError::UnknownNode { node, nodes } => {
                let point = case.points.iter().find(|point| point.place == PointPlace::Node(*node));
                let expected = format!("a node from 0 to {}", nodes.saturating_sub(1));
                (point.map(|point| point.line), expected, "correct `node`, or give the position of the node by `at`")
            }
            BoundaryError::Conflict { second, .. } => (
                line_of(case, second),
                "each displacement component of a node prescribed once, or alike".into(),
                "the two surfaces or points share a node: leave the component out of one of the two",
            ),
            BoundaryError::NotFinite { place, .. } => {
                (line_of(case, place), "finite numbers".into(), "correct the number, or the `scale` of the mesh")
            }
            BoundaryError::UnknownSurface { name, .. } => (
                line_of(case, &format!("surface `{name}`")),
                "a surface of the mesh".into(),
                "choose one of these, or name it in the mesh as a physical group",
            ),
            BoundaryError::UnknownRegion { .. } => {
                (None, "a region of the mesh".into(), "choose one of these, or name it in the mesh as a physical group")
            }
            BoundaryError::NotInOneElement { .. } => {
                (None, "loads whose nodes belong to one element".into(), "correct the load")
            }
        };
        let error = InputError { line, ..InputError::in_file(&case.file, error.to_string(), expected, cure) };
        InputErrors::from(error).into()
    })
}

/// Returns the line of a condition, given its description in a [`BoundaryError`].
fn line_of(case: &Case, place: &str) -> Option<usize> {
    let number = |prefix: &str| place.strip_prefix(prefix)?.parse::<usize>().ok()?.checked_sub(1);
    if let Some(point) = number("point condition ") {
        return case.points.get(point).map(|point| point.line);
    }
    if let Some(region) = place.strip_prefix("the body force on region `").and_then(|rest| rest.strip_suffix('`')) {
        return case.body_forces.iter().rfind(|force| force.region == region).map(|force| force.line);
    }
    let name = place.strip_prefix("surface `")?.strip_suffix('`')?;
    case.boundaries.iter().rfind(|boundary| boundary.surface == name).map(|boundary| boundary.line)
}

/// Returns the boundary conditions of a case, in meters and newtons.
///
/// # Errors
/// Returns [`MacroScaleError::Curve`] if a load curve is invalid.
pub fn conditions(case: &Case) -> Result<Conditions, MacroScaleError> {
    let (mut surfaces, mut loads) = (Vec::new(), Vec::<Arc<dyn LoadCondition>>::new());
    for boundary in &case.boundaries {
        let (surface, curve) = (boundary.surface.clone(), curve(&boundary.curve, boundary.line)?);
        match boundary.load {
            LoadCase::Displacement(displacement) => surfaces.push(SurfaceCondition { surface, displacement, curve }),
            LoadCase::Traction(value) => loads.push(Arc::new(Traction { surface, value, curve })),
        }
    }
    let points = case.points.iter().map(|point| {
        Ok(PointCondition {
            place: match point.place {
                PointPlace::At(position) => PointLocation::Nearest(position.map(|x| x * case.mesh_scale)),
                PointPlace::Node(node) => PointLocation::Node(node),
            },
            displacement: point.displacement,
            curve: curve(&point.curve, point.line)?,
        })
    });
    for force in &case.body_forces {
        let curve = curve(&force.curve, force.line)?;
        loads.push(Arc::new(BodyForce { region: force.region.clone(), value: force.value, curve }));
    }
    Ok(Conditions { surfaces, points: points.collect::<Result<_, MacroScaleError>>()?, loads })
}

fn curve(case: &CurveCase, line: usize) -> Result<LoadCurve, MacroScaleError> {
    match case {
        CurveCase::Ramp => Ok(LoadCurve::Ramp),
        CurveCase::Table(points) => LoadCurve::table(points).map_err(|reason| MacroScaleError::Curve { line, reason }),
    }
}

/// Returns the parameters of load stepping of a case.
#[must_use]
pub fn step_params(case: &Case) -> StepParams {
    let mut params = StepParams {
        count: case.steps.count,
        max_cuts: case.steps.max_cuts,
        start: match case.newton.start {
            case::StepStart::Held => StepStart::Prescribed,
            case::StepStart::Tangent => StepStart::Tangent,
        },
        ..StepParams::default()
    };
    params.solver.method = case.newton.solver;
    params.newton.tolerance = case.newton.tolerance;
    params.newton.max_iterations = case.newton.max_iterations;
    if !case.newton.line_search {
        params.newton.max_backtracks = 0;
    }
    params
}
