//! Constraints that cannot be imposed.

use std::sync::Arc;

use biotissue::backends::sparse::Sparse;
use biotissue::fem::boundary::Conditions;
use biotissue::fem::constraint::{ConstraintError, ConstraintMethod, VolumeConstraint};
use biotissue::fem::element::ElementType;
use biotissue::fem::material::NeoHookean;
use biotissue::fem::mesh::shapes;
use biotissue::fem::point_field::FormulaField;
use biotissue::fem::stepping::{SetupError, StepParams, Stepper, SteppingError};
use biotissue::las::{NewtonError, SolveError};

use super::hollow_box::hollow_box;
use super::{cavity, driven, prescribed, region, sheared};

fn refused(conditions: &Conditions) -> ConstraintError {
    let mesh = hollow_box(ElementType::Hex8);
    let field = FormulaField::uniform(NeoHookean { mu: 3.0, lambda: 5.0 }, &mesh);
    match Stepper::<Sparse, _>::new(&(), Arc::new(mesh), conditions, field, StepParams::default()) {
        Err(SetupError::Constraint(error)) => error,
        Err(other) => panic!("{other}"),
        Ok(_) => panic!("accepted"),
    }
}

#[test]
fn open_cavities_name_their_edges() {
    let error = refused(&sheared(vec![cavity(&["floor"])]));
    let ConstraintError::Open { edges, count: 4, .. } = &error else { panic!("{error}") };
    assert_eq!(edges.len(), 3);
    let text = error.to_string();
    assert!(
        text.starts_with("constraint `floor`: the surfaces of the cavity are not closed: the edge from node ")
            && text.contains("(1.0000e0, 1.0000e0, 1.0000e0)")
            && text.ends_with("has only one face, and 1 more"),
        "{text}"
    );
    // A surface given twice would count its volume twice.
    let error = refused(&sheared(vec![cavity(&["floor", "walls", "floor"])]));
    assert!(matches!(&error, ConstraintError::RepeatedFace { nodes, .. } if nodes.len() == 4), "{error}");
}

#[test]
fn surfaces_around_the_body_enclose_no_cavity() {
    let error = refused(&sheared(vec![cavity(&["x0", "x1", "y0", "y1", "z0", "z1"])]));
    assert_eq!(error, ConstraintError::NotACavity { constraint: "x0".into(), volume: -27.0 });
}

#[test]
fn wrong_names_targets_and_penalties_are_refused() {
    let error = refused(&sheared(vec![cavity(&["lumen"])]));
    assert!(
        error.to_string().starts_with("constraint `lumen`: the mesh has no surface `lumen`; it has x0, "),
        "{error}"
    );
    let error = refused(&sheared(vec![region("bdy")]));
    assert!(error.to_string().contains("the mesh has no region `bdy`; it has body"), "{error}");
    let error = refused(&sheared(vec![driven(region("body"), &[[0.0, 1.0], [0.5, 0.0]])]));
    assert_eq!(error, ConstraintError::Target { constraint: "body".into(), t: 0.5, factor: 0.0 });
    let constraint = VolumeConstraint { method: ConstraintMethod::Penalty { factor: -1.0 }, ..region("body") };
    assert!(matches!(refused(&sheared(vec![constraint])), ConstraintError::Penalty { factor: -1.0, .. }));
}

#[test]
fn volumes_that_no_free_displacement_changes_are_refused() {
    let all = ["x0", "x1", "y0", "y1", "z0", "z1", "floor", "walls"];
    let surfaces = all.map(|name| prescribed(name, [Some(0.0); 3])).to_vec();
    let constraints = vec![cavity(&["floor", "walls"])];
    let conditions = Conditions { surfaces, constraints, ..Conditions::default() };
    // A region whose surface is held keeps its volume, although the nodes inside are free.
    let mesh = shapes::cuboid_of(ElementType::Hex8, [3; 3], [1.0; 3]).unwrap();
    let surfaces = all[..6].iter().map(|name| prescribed(name, [Some(0.0); 3])).collect();
    let inside = Conditions { surfaces, constraints: vec![region("*")], ..Conditions::default() };
    let field = FormulaField::uniform(NeoHookean { mu: 3.0, lambda: 5.0 }, &mesh);
    let error = Stepper::<Sparse, _>::new(&(), Arc::new(mesh), &inside, field, StepParams::default()).err();
    assert_eq!(error, Some(SetupError::Constraint(ConstraintError::Fixed { constraint: "*".into() })));
    assert_eq!(refused(&conditions), ConstraintError::Fixed { constraint: "floor".into() });
}

#[test]
fn two_constraints_on_one_volume_are_singular() {
    let mesh = hollow_box(ElementType::Hex8);
    let field = FormulaField::uniform(NeoHookean { mu: 3.0, lambda: 5.0 }, &mesh);
    let conditions = sheared(vec![region("body"), VolumeConstraint { name: "twice".into(), ..region("*") }]);
    let mut stepper =
        Stepper::<Sparse, _>::new(&(), Arc::new(mesh), &conditions, field, StepParams::default()).unwrap();
    let error = stepper.run(&mut ()).unwrap_err();
    let SteppingError::NotConverged { reason: NewtonError::Solve(reason), .. } = error else { panic!("{error}") };
    assert!(matches!(reason, SolveError::SingularBorder { .. }), "{reason}");
}
