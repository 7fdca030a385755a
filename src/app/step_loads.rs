//! The loads that expressions give at the ends of the load steps.

use super::case::{Case, LoadCurve, LoadValue};
use crate::fem::boundary::Boundary;
use crate::fem::kinematics::RigidMotion;
use crate::fem::mesh::Mesh;
use crate::input::{InputError, InputErrors};

/// The values of a boundary, point or body force with their curve, and the line of the case.
type Values<'a> = (usize, Vec<&'a LoadValue>, &'a LoadCurve);

/// Checks that forces and prescribed displacements are finite at the end of each load step. The undeformed body and the
/// last step were checked with the conditions themselves.
///
/// # Errors
/// Returns the first load that is not finite, with its line.
pub(super) fn check(case: &Case, mesh: &Mesh, boundary: &Boundary) -> Result<(), InputErrors> {
    let boundaries = case.boundaries.iter().map(|each| (each.line, each.load.values(), &each.curve));
    let points = case.points.iter().map(|each| (each.line, each.values(), &each.curve));
    let bodies = case.body_forces.iter().map(|each| (each.line, each.value.iter().collect(), &each.curve));
    let depends_on_time = |(_, values, curve): &Values<'_>| {
        matches!(curve, LoadCurve::Function(_)) || values.iter().any(|value| value.contains_time())
    };
    let loads: Vec<Values<'_>> = boundaries.chain(points).chain(bodies).filter(depends_on_time).collect();
    if loads.is_empty() {
        return Ok(());
    }
    let rest = vec![[0.0; 3]; mesh.nodes().len()];
    let (mut forces, mut displacements) = (rest.clone(), rest.clone());
    let mut motions = vec![RigidMotion::default(); boundary.kinematics().rigid_surfaces().len()];
    for step in 1..case.steps.count {
        let t = step as f64 / case.steps.count as f64;
        boundary.external_forces(t, &rest, &mut forces);
        boundary.apply_prescribed(t, &mut displacements, &mut motions);
        let mut all = forces.as_flattened().iter().chain(displacements.as_flattened());
        if !all.all(|value| value.is_finite()) {
            let line = loads.iter().find(|load| is_infinite(load, t, mesh)).map(|(line, ..)| *line);
            let problem = format!("a load is not finite at t = {t}, the end of step {step}");
            let (expected, cure) = ("a finite value at the end of every step", "correct the expression");
            return Err(InputError { line, ..InputError::in_file(&case.file, problem, expected, cure) }.into());
        }
    }
    Ok(())
}

/// Returns true if a load is not finite at some node of the mesh.
fn is_infinite((_, values, curve): &Values<'_>, t: f64, mesh: &Mesh) -> bool {
    values
        .iter()
        .map(|value| value.with_curve(curve))
        .any(|(value, curve)| mesh.nodes().iter().any(|&x| !(value * curve.factor(t, x)).is_finite()))
}
