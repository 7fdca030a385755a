//! The macro scale of a case: its mesh, boundary conditions and load steps as types of [`crate::fem`].

use std::sync::Arc;

use super::case::{
    BodyForceCase, BoundaryCase, Case, LoadCurve, LoadValue, MeshSource, PointPlace, QuadraticCase, RigidCase,
    SolverCase, SurfaceLoad, terms,
};
use super::mesh_files;
use crate::fem::assembly;
use crate::fem::boundary::{
    BodyForce, Boundary, BoundaryError, Conditions, Foundation, LoadCondition, PointCondition, PointDisplacement,
    PointLoad, PointLocation, Pressure, RigidCondition, SurfaceCondition, TimedValue, Traction,
};
use crate::fem::constraint::{ConstraintError, Constraints};
use crate::fem::mesh::shapes::{self, ShapeError};
use crate::fem::mesh::{Mesh, MeshError};
use crate::fem::stepping::{IncrementControl, StepParams};
use crate::input::{InputError, InputErrors};
use crate::las::{Forcing, SolverParams};

/// Reads or generates the mesh of a case, in meters, and checks the names in the case against it. Also returns the
/// warnings of the reader.
///
/// # Errors
/// Returns [`InputErrors`] if the mesh cannot be read, generated or scaled, or lacks a name in the case.
pub fn mesh(case: &Case) -> Result<(Mesh, Vec<String>), InputErrors> {
    let (mesh, warnings) = match &case.mesh {
        MeshSource::File(path) => {
            let read = mesh_files::read(path)?;
            (read.mesh, read.warnings)
        }
        MeshSource::Box { cells, size, element } => {
            (generated(case, shapes::cuboid_of(*element, *cells, *size))?, Vec::new())
        }
        MeshSource::Tube { cells, shape, element } => {
            (generated(case, shapes::tube(*element, *cells, shape))?, Vec::new())
        }
        MeshSource::Dogbone { element_size } => {
            (generated(case, shapes::dogbone(&shapes::DogboneShape::default(), *element_size))?, Vec::new())
        }
    };
    let mesh = match case.quadratic {
        Some(to) => quadratic(case, &mesh, to)?,
        None => mesh,
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
    Ok((with_patches(case, mesh)?, warnings))
}

/// Divides the regions with `f_bar` into patches.
fn with_patches(case: &Case, mesh: Mesh) -> Result<Mesh, InputErrors> {
    let of_mesh: Vec<Option<usize>> = mesh.regions().iter().map(|name| case.region_of(name)).collect();
    let has_f_bar = |region: u32| of_mesh[region as usize].is_some_and(|region| case.regions[region].f_bar);
    let mesh = mesh.with_patches(has_f_bar);
    let mut errors = Vec::new();
    for (number, region) in case.regions.iter().enumerate().filter(|(_, region)| region.f_bar) {
        let in_region = |&element: &u32| of_mesh[mesh.region_of()[element as usize] as usize] == Some(number);
        if !mesh.patches().iter().flatten().any(in_region) {
            let what = format!("the region \"{}\" has `f_bar`, but none of its elements can use it", region.name);
            let expected = "linear tetrahedra or hexahedra";
            let cure = "remove `f_bar`: quadratic elements need none, and wedges have none";
            errors.push(InputError::at_line(&case.file, region.line, what, expected, cure));
        }
    }
    if errors.is_empty() { Ok(mesh) } else { Err(InputErrors(errors)) }
}

/// Reports, at its line, a built-in shape that cannot be generated from the given lengths.
fn generated(case: &Case, mesh: Result<Mesh, ShapeError>) -> Result<Mesh, InputError> {
    let error = match mesh {
        Ok(mesh) => return Ok(mesh),
        Err(error) => error,
    };
    let (expected, cure) = match &error {
        ShapeError::TooManyElements(_) => (
            format!("at most {} elements", shapes::MAX_ELEMENTS),
            "choose fewer `cells`, or a greater `element_size`: it is in mesh units",
        ),
        ShapeError::ElementTooLarge { what, .. } => {
            (format!("an `element_size` below the {what} of the sample"), "correct it: it is in mesh units")
        }
        _ => ("lengths of a valid body".into(), "correct the lengths of `generate`: they are in mesh units"),
    };
    Err(InputError::at_line(&case.file, case.mesh_line, error.to_string(), expected, cure))
}

/// Returns the mesh with elements of order 2, or reports at its line why there are none.
fn quadratic(case: &Case, mesh: &Mesh, to: QuadraticCase) -> Result<Mesh, InputError> {
    let error = |what: String, cure: &str| {
        InputError::at_line(&case.file, to.line, what, "a mesh of tetrahedra and hexahedra of order 1", cure)
    };
    let mut quadratic = mesh.elements().typed().enumerate();
    if let Some((element, (of, _))) = quadratic.find(|(_, (of, _))| of.is_quadratic()) {
        let what = format!("`order = 2`, but element {element} of the mesh ({}) is of order 2 already", of.name());
        return Err(error(what, "remove `order`"));
    }
    let quadratic = match case.mesh {
        MeshSource::Tube { .. } => mesh.quadratic_between(to.hexahedra, shapes::between_on_tube),
        _ => mesh.quadratic(to.hexahedra),
    };
    quadratic.map_err(|reason| match reason {
        MeshError::NoQuadraticType { element } => {
            let what =
                format!("`order = 2`, but element {element} of the mesh is a wedge, which has no form of order 2");
            error(what, "remove `order`, or mesh the body with tetrahedra and hexahedra only")
        }
        other => error(format!("the mesh has no form of order 2: {other}"), "remove `order`"),
    })
}

/// Applies the boundary conditions of a case to its mesh.
///
/// # Errors
/// Returns [`InputErrors`] if a condition contradicts the mesh or another condition, with its line.
pub fn boundary(case: &Case, mesh: &Mesh, conditions: &Conditions) -> Result<Boundary, InputErrors> {
    let boundary = Boundary::new(mesh, conditions).map_err(|error| located(case, &error))?;
    let ends: Vec<f64> = (1..case.steps.count).map(|step| step as f64 / case.steps.count as f64).collect();
    boundary.check_finite(mesh, &ends).map_err(|error| located(case, &error))?;
    Ok(boundary)
}

/// Returns a warning if the loads do not balance at the end of the first step or of the last one, where nothing but the
/// supports of `free = "rigid"` holds the body. The run stops there, unless other forces are much greater.
pub fn imbalance(case: &Case, mesh: &Mesh, boundary: &Boundary) -> Option<String> {
    let found = |t: f64| boundary.imbalance(mesh, t).map(|imbalance| (t, imbalance));
    let (t, imbalance) = found(1.0 / case.steps.count as f64).or_else(|| found(1.0))?;
    Some(format!(
        "{}: `free = \"rigid\"` in [body]: the loads at t = {t} do not balance, they exert {imbalance} on the undeformed body, and \
         nothing holds it there: correct the loads, or hold it by a [[boundary]] or [[point]]",
        case.file.display()
    ))
}

/// Adds its line, what was expected and the cure to an error.
fn located(case: &Case, error: &BoundaryError) -> InputErrors {
    let (line, expected, cure) = match error {
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
            BoundaryError::NotFiniteAt { place, formula, .. } => (
                line_of_formula(case, place, formula.as_deref()),
                "a finite value at every node and integration point, at t = 0 and at the end of every step".into(),
                "correct the expression, or the `scale` of the mesh",
            ),
            BoundaryError::UnknownPoint { .. } | BoundaryError::UnknownComponent { .. } => {
                (None, "a component of a point condition".into(), "correct the number")
            }
            BoundaryError::UnknownSurface { name, .. } => (
                line_of(case, &format!("surface `{name}`")),
                "a surface of the mesh".into(),
                "choose one of these, or name it in the mesh as a physical group",
            ),
            BoundaryError::UnknownRegion { .. } => {
                (None, "a region of the mesh".into(), "choose one of these, or name it in the mesh as a physical group")
            }
            BoundaryError::OppositeSides { surface } => (
                line_of(case, &format!("surface `{surface}`")),
                "a plane surface, of any orientation".into(),
                "name each plane of the surface as a physical group of its own",
            ),
            BoundaryError::NotPlanar { surface, .. } => (
                line_of(case, &format!("surface `{surface}`")),
                "a plane surface, of any orientation, up to the rounding of coordinates to 6 digits".into(),
                "name each plane of the surface as a physical group of its own; if it is one plane, place its nodes more exactly",
            ),
            BoundaryError::PlaneConflict { other, .. } => (
                line_of(case, other),
                "displacements within the plane, or of 0".into(),
                "leave the component out, or remove `symmetry` from the plane",
            ),
            BoundaryError::RigidConflict { rigid, .. } => (
                line_of(case, rigid),
                "nodes whose other conditions hold only components that the rigid surface holds: displacement 0 along them, and \
                 rotation 0 about the other two axes"
                    .into(),
                "prescribe these components of `rigid` (beside a plane of symmetry along x: its displacement x and rotations y and z, \
                 all 0), or leave the nodes out of one of the two surfaces",
            ),
            BoundaryError::LeavesPlane { rigid, .. } => (
                line_of(case, rigid),
                "a rigid surface that stays in the plane: no displacement along its normal, and no rotation but about the normal"
                    .into(),
                "prescribe the components of `rigid` that leave the plane, with at least 5 digits or as expressions such as \
                 \"0.1*cos(pi/6)\", or leave the nodes out of one of the two surfaces",
            ),
            BoundaryError::RotationTooLarge { surface, .. } => (
                line_of(case, &format!("surface `{surface}`")),
                "a rotation below 2 pi rad, or all three components prescribed".into(),
                "prescribe all components of `rotation`, such as 0.0 for the others",
            ),
            BoundaryError::NotInOneElement(_) => {
                (None, "loads whose nodes belong to one element".into(), "correct the load")
            }
        };
    InputErrors::from(InputError { line, ..InputError::in_file(&case.file, error.to_string(), expected, cure) })
}

/// Returns the line of the condition at a place that has a formula, or else that of any.
fn line_of_formula(case: &Case, place: &str, formula: Option<&str>) -> Option<usize> {
    let has_formula = |values: &[&LoadValue], curve: &LoadCurve| {
        values.iter().any(|value| value.with_curve(curve).1.formula() == formula)
    };
    let boundaries = case.boundaries.iter().filter(|each| place == format!("surface `{}`", each.surface));
    let boundary = boundaries.filter(|each| has_formula(&each.load.values(), &each.curve)).map(|each| each.line).next();
    let bodies = case.body_forces.iter().filter(|each| place == format!("the body force on region `{}`", each.region));
    let body = bodies.filter(|each| has_formula(&each.value.each_ref(), &each.curve)).map(|each| each.line).next();
    boundary.or(body).or_else(|| line_of(case, place))
}

/// Checks the volume constraints of a case against its mesh; `prescribed` tells which displacement components of each node
/// are prescribed.
///
/// # Errors
/// Returns [`InputErrors`] if a constraint cannot be imposed, with its line.
pub fn check_constraints(
    case: &Case,
    mesh: &Mesh,
    conditions: &Conditions,
    prescribed: &[[bool; 3]],
) -> Result<(), InputErrors> {
    if conditions.constraints.is_empty() {
        return Ok(());
    }
    let geometry = assembly::geometry(mesh).map_err(|error| {
        let cure = "improve the mesh, or correct the `scale` of [mesh]";
        InputError::at_line(&case.file, case.mesh_line, error.to_string(), "elements of positive volume", cure)
    })?;
    let Err(error) = Constraints::new(mesh, &geometry, &conditions.constraints, prescribed) else { return Ok(()) };
    let (expected, cure) = hint_of_constraint(&error);
    let of = case.constraints.iter().find(|each| each.constraint.name == error.constraint());
    let line = of.map(|each| each.line);
    Err(InputErrors::from(InputError { line, ..InputError::in_file(&case.file, error.to_string(), expected, cure) }))
}

/// Returns what was expected of a constraint that cannot be imposed, and the cure.
pub fn hint_of_constraint(error: &ConstraintError) -> (&'static str, &'static str) {
    match error {
        ConstraintError::Unknown { .. } => {
            ("a region or surfaces of the mesh", "choose one of these, or name it in the mesh as a physical group")
        }
        ConstraintError::Open { .. } => (
            "surfaces that together are closed, with normals that point out of the body",
            "add the surfaces that close the gap to `cavity`, or correct the physical surface in the mesh",
        ),
        ConstraintError::RepeatedFace { .. } => {
            ("surfaces without common faces", "name each surface once, and only one of two surfaces that overlap")
        }
        ConstraintError::NotACavity { .. } => (
            "surfaces around a cavity, with the body outside of it",
            "name the inner surfaces; to control the volume of the body itself, constrain a `region`",
        ),
        ConstraintError::Reversed { .. } => (
            "surfaces between elements whose normals point out of the body, into the cavity",
            "reverse these physical surfaces in the mesh (Gmsh: `ReverseMesh Surface`); to control the volume of the \
             elements inside, constrain their `region`",
        ),
        ConstraintError::Target { .. } => ("a target volume above 0", "correct the curve of `volume`"),
        ConstraintError::Penalty { .. } => ("a penalty factor above 0", "correct `penalty`"),
        ConstraintError::Fixed { .. } => (
            "a volume that free displacements can change",
            "remove the constraint, or leave a surface of the volume free",
        ),
    }
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
pub fn conditions(case: &Case) -> Conditions {
    let (mut surfaces, mut loads) = (Vec::new(), Vec::<Arc<dyn LoadCondition>>::new());
    let (mut symmetry_planes, mut rigid) = (Vec::new(), Vec::new());
    for BoundaryCase { surface, load, curve, .. } in &case.boundaries {
        let surface = || surface.clone();
        match load {
            SurfaceLoad::Displacement(components) => {
                for (displacement, curve) in terms(&components.each_ref().map(Option::as_ref), curve) {
                    surfaces.push(SurfaceCondition { surface: surface(), displacement, curve });
                }
            }
            SurfaceLoad::Traction(values) => {
                for (value, curve) in forces(values, curve) {
                    loads.push(Arc::new(Traction { surface: surface(), value, curve }));
                }
            }
            SurfaceLoad::Pressure(value) => {
                let (value, curve) = value.with_curve(curve);
                loads.push(Arc::new(Pressure { surface: surface(), value, curve }));
            }
            SurfaceLoad::Foundation([normal, tangential]) => {
                loads.push(Arc::new(Foundation { surface: surface(), normal: *normal, tangential: *tangential }));
            }
            SurfaceLoad::Symmetry => symmetry_planes.push(surface()),
            SurfaceLoad::Rigid(RigidCase { reference, displacement, rotation }) => {
                let reference = reference.map(|point| point.map(|x| x * case.mesh_scale));
                let timed = |value: &LoadValue| {
                    let (value, curve) = value.with_curve(curve);
                    TimedValue { value, curve }
                };
                let [displacement, rotation] =
                    [displacement, rotation].map(|of| of.each_ref().map(|component| component.as_ref().map(timed)));
                rigid.push(RigidCondition { surface: surface(), reference, displacement, rotation });
            }
        }
    }
    let (mut points, mut point_displacements) = (Vec::new(), Vec::new());
    for (point, of) in case.points.iter().enumerate() {
        let place = match of.place {
            PointPlace::At(position) => PointLocation::Nearest(position.map(|x| x * case.mesh_scale)),
            PointPlace::Node(node) => PointLocation::Node(node),
        };
        for (displacement, curve) in terms(&of.displacement.each_ref().map(Option::as_ref), &of.curve) {
            for (component, value) in displacement.iter().enumerate() {
                let prescribed = |value| PointDisplacement { point, component, value, curve: curve.clone() };
                point_displacements.extend(value.map(prescribed));
            }
        }
        points.push(PointCondition { place, displacement: [None; 3], curve: LoadCurve::Ramp });
        for (value, curve) in of.force.iter().flat_map(|force| forces(force, &of.curve)) {
            loads.push(Arc::new(PointLoad { point, place, value, curve }));
        }
    }
    for BodyForceCase { region, value, curve, .. } in &case.body_forces {
        for (value, curve) in forces(value, curve) {
            loads.push(Arc::new(BodyForce { region: region.clone(), value, curve }));
        }
    }
    let constraints = case.constraints.iter().map(|each| each.constraint.clone()).collect();
    Conditions {
        surfaces,
        points,
        point_displacements,
        loads,
        symmetry_planes,
        rigid,
        hold_free_modes: case.hold_free_modes,
        constraints,
    }
}

/// Divides a force into terms with one curve each.
fn forces(values: &[LoadValue; 3], curve: &LoadCurve) -> impl Iterator<Item = ([f64; 3], LoadCurve)> {
    let terms = terms(&values.each_ref().map(Some), curve);
    terms.into_iter().map(|(term, curve)| (term.map(Option::unwrap_or_default), curve))
}

/// Returns the parameters of load stepping of a case.
pub fn step_params(case: &Case) -> StepParams {
    let mut params = StepParams {
        count: case.steps.count,
        max_cuts: case.steps.max_cuts,
        increments: case.steps.adaptive.map_or(IncrementControl::Halving, IncrementControl::Adaptive),
        start: case.newton.start,
        ..StepParams::default()
    };
    if let Some(SolverCase { method, fixed_tolerance }) = case.newton.solver {
        params.solver = Some(SolverParams { method, ..SolverParams::default() });
        params.newton.forcing = (!fixed_tolerance).then(Forcing::default);
    }
    params.newton.tolerance = case.newton.tolerance;
    params.newton.max_iterations = case.newton.max_iterations;
    params.newton.step_tolerance = case.newton.displacement_tolerance;
    params.newton.energy_tolerance = case.newton.energy_tolerance;
    if !case.newton.line_search {
        params.newton.max_backtracks = 0;
    }
    params
}
