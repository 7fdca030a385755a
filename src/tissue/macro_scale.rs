//! The engineering scale of a tissue: a case in the terms of [`crate::fem`].

use thiserror::Error;

use crate::fem::boundary::{
    BodyForce, Conditions, CurveError, LoadCurve, Place, PointCondition, SurfaceCondition, SurfaceLoad,
};
use crate::fem::mesh::{Mesh, MeshError, gmsh, shapes};
use crate::fem::stepping::{StepParams, StepStart};
use crate::input::InputErrors;
use crate::tissue::case::{self, Case, CurveCase, LoadCase, MeshSource, PointPlace};

/// Why the mesh or the conditions of a case cannot be had.
#[derive(Debug, Error)]
pub enum MacroScaleError {
    /// The mesh file, or names in the case that the mesh does not know.
    #[error("{0}")]
    Input(#[from] InputErrors),
    /// A built-in shape with sizes that make no sense.
    #[error("{0}")]
    Shape(#[from] shapes::ShapeError),
    /// The mesh does not survive being scaled.
    #[error("{0}")]
    Mesh(#[from] MeshError),
    /// A load curve.
    #[error("the load curve in line {line}: {reason}")]
    Curve {
        /// Line in the case file.
        line: usize,
        /// What is wrong with it.
        reason: CurveError,
    },
}

/// Reads or makes the mesh of a case, in metres, and holds the names in the case against it. Also returns the warnings
/// of the reader.
///
/// # Errors
/// [`MacroScaleError`].
pub fn mesh(case: &Case) -> Result<(Mesh, Vec<String>), MacroScaleError> {
    let (mesh, warnings) = match &case.mesh {
        MeshSource::File(path) => {
            let read = gmsh::read(path).map_err(InputErrors::from)?;
            (read.mesh, read.warnings)
        }
        MeshSource::Box { cells, size } => (shapes::cuboid(*cells, *size)?, Vec::new()),
        MeshSource::Dogbone { element_size } => {
            (shapes::dogbone(&shapes::DogboneShape::default(), *element_size)?, Vec::new())
        }
    };
    let mesh = if case.mesh_scale == 1.0 { mesh } else { mesh.scaled(case.mesh_scale)? };
    let surfaces: Vec<String> = mesh.surface_names().map(str::to_owned).collect();
    case.check_names(mesh.regions(), &surfaces)?;
    Ok((mesh, warnings))
}

/// What a case prescribes, in metres and newtons.
///
/// # Errors
/// [`MacroScaleError::Curve`].
pub fn conditions(case: &Case) -> Result<Conditions, MacroScaleError> {
    let surfaces = case.boundaries.iter().map(|boundary| {
        Ok(SurfaceCondition {
            surface: boundary.surface.clone(),
            load: match boundary.load {
                LoadCase::Displacement(components) => SurfaceLoad::Displacement(components),
                LoadCase::Traction(traction) => SurfaceLoad::Traction(traction),
            },
            curve: curve(&boundary.curve, boundary.line)?,
        })
    });
    let points = case.points.iter().map(|point| {
        Ok(PointCondition {
            place: match point.place {
                PointPlace::At(position) => Place::Nearest(position.map(|x| x * case.mesh_scale)),
                PointPlace::Node(node) => Place::Node(node),
            },
            displacement: point.displacement,
            curve: curve(&point.curve, point.line)?,
        })
    });
    let body_forces = case.body_forces.iter().map(|force| {
        let curve = curve(&force.curve, force.line)?;
        Ok(BodyForce { region: force.region.clone(), value: force.value, curve })
    });
    Ok(Conditions {
        surfaces: surfaces.collect::<Result<_, MacroScaleError>>()?,
        points: points.collect::<Result<_, MacroScaleError>>()?,
        body_forces: body_forces.collect::<Result<_, MacroScaleError>>()?,
    })
}

fn curve(case: &CurveCase, line: usize) -> Result<LoadCurve, MacroScaleError> {
    match case {
        CurveCase::Ramp => Ok(LoadCurve::Ramp),
        CurveCase::Table(points) => LoadCurve::table(points).map_err(|reason| MacroScaleError::Curve { line, reason }),
    }
}

/// How a case is to be stepped through.
#[must_use]
pub fn step_params(case: &Case) -> StepParams {
    let mut params = StepParams {
        count: case.steps.count,
        max_cuts: case.steps.max_cuts,
        start: match case.newton.start {
            case::StepStart::Held => StepStart::Held,
            case::StepStart::Tangent => StepStart::Tangent,
        },
        ..StepParams::default()
    };
    params.solver.method = case.newton.solver;
    params.newton.tolerance = case.newton.tolerance;
    params.newton.max_iterations = case.newton.max_iterations;
    if !case.newton.line_search {
        params.newton.max_line_search_cuts = 0;
    }
    params
}
