//! Constraints that cannot be imposed.

use std::sync::Arc;

use biotissue::backends::sparse::Sparse;
use biotissue::fem::boundary::Conditions;
use biotissue::fem::constraint::{ConstraintError, ConstraintMethod, OpenEdge, VolumeConstraint};
use biotissue::fem::element::{ElementType, FaceType};
use biotissue::fem::material::NeoHookean;
use biotissue::fem::mesh::{Faces, Mesh, Surface, shapes};
use biotissue::fem::point_field::FormulaField;
use biotissue::fem::stepping::{SetupError, StepParams, Stepper, SteppingError};
use biotissue::las::{NewtonError, SolveError};

use super::hollow_box::hollow_box;
use super::{cavity, driven, prescribed, region, sheared};

fn refused(conditions: &Conditions) -> ConstraintError {
    refused_on(hollow_box(ElementType::Hex8), conditions)
}

fn refused_on(mesh: Mesh, conditions: &Conditions) -> ConstraintError {
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

/// A box of 3 x 3 x 3 cells whose middle cell is the region `filling`. The surfaces `floor` (its lower side) and
/// `walls` lie between elements; of their six faces, numbered as those of a hexahedron, the `reversed` ones have normals that
/// point out of the cell, into the body.
fn filled_box(reversed: &[usize]) -> Mesh {
    let whole = shapes::cuboid_of(ElementType::Hex8, [3; 3], [3.0; 3]).unwrap();
    let middle = (0..27).find(|&element| whole.center(element).iter().all(|x| *x > 1.0 && *x < 2.0)).unwrap();
    let (mut floor, mut walls) = (Faces::default(), Faces::default());
    for (number, face) in ElementType::Hex8.faces().iter().enumerate() {
        let mut nodes: Vec<u32> = face.nodes.iter().map(|&local| whole.elements()[middle][local]).collect();
        let is_floor = nodes.iter().all(|&node| whole.nodes()[node as usize][2] == 1.0);
        if !reversed.contains(&number) {
            nodes.reverse();
        }
        if is_floor { floor.push(FaceType::Quad4, &nodes) } else { walls.push(FaceType::Quad4, &nodes) }
    }
    let mut surfaces = whole.surfaces().to_vec();
    let named = |name: &str, faces| Surface { name: name.into(), faces };
    surfaces.extend([named("floor", floor), named("walls", walls)]);
    let mut region_of = vec![0; 27];
    region_of[middle] = 1;
    let regions = vec!["body".into(), "filling".into()];
    Mesh::new(whole.nodes().to_vec(), whole.elements().clone(), region_of, regions, surfaces).unwrap()
}

/// A mesh orients the faces on its boundary by itself, but not those between elements.
#[test]
fn a_reversed_face_between_elements_names_its_edges() {
    let conditions = sheared(vec![cavity(&["floor", "walls"])]);
    for face in 0..6 {
        let mesh = filled_box(&[face]);
        let faces = [&mesh.surface("floor").unwrap().faces, &mesh.surface("walls").unwrap().faces];
        let of_cell = ElementType::Hex8.faces();
        let middle = mesh.elements_in(1).next().unwrap();
        let nodes: Vec<u32> = of_cell[face].nodes.iter().map(|&local| mesh.elements()[middle][local]).collect();
        assert!(faces.iter().any(|faces| faces.iter().any(|other| *other == nodes[..])));
        let error = refused_on(mesh, &conditions);
        let ConstraintError::Open { edges, count: 4, .. } = &error else { panic!("{error}") };
        assert_eq!(edges.len(), 3);
        let is_of_face = |edge: &OpenEdge| edge.faces == 2 && edge.nodes.iter().all(|node| nodes.contains(node));
        assert!(edges.iter().all(is_of_face), "{nodes:?}: {error}");
        assert!(error.to_string().contains(" has 2 faces that do not continue each other, "), "{error}");
    }
}

#[test]
fn reversed_surfaces_between_elements_are_named() {
    let conditions = sheared(vec![cavity(&["floor", "walls"])]);
    let error = refused_on(filled_box(&[0, 1, 2, 3, 4, 5]), &conditions);
    let ConstraintError::Reversed { surfaces, volume, .. } = &error else { panic!("{error}") };
    assert_eq!(*surfaces, ["floor", "walls"]);
    assert!((volume - 1.0).abs() < 1e-14);
    let expected = "constraint `floor`: the normals of `floor`, `walls` all point out of the enclosed 1.0000e0 m^3, not \
                    into them";
    assert_eq!(error.to_string(), expected);
    // The surfaces around this body are not reversed: they are the wrong ones.
    let around = sheared(vec![cavity(&["x0", "x1", "y0", "y1", "z0", "z1"])]);
    let error = refused_on(filled_box(&[]), &around);
    assert_eq!(error, ConstraintError::NotACavity { constraint: "x0".into(), volume: -27.0 });

    // With the normals into the cell, its volume is constrained.
    let mesh = filled_box(&[]);
    let field = FormulaField::uniform(NeoHookean { mu: 3.0, lambda: 5.0 }, &mesh);
    let stepper = Stepper::<Sparse, _>::new(&(), Arc::new(mesh), &conditions, field, StepParams::default()).unwrap();
    assert!((stepper.state().volumes[0].volume - 1.0).abs() < 1e-14);

    // The faces on a boundary cannot be reversed.
    let hollow = hollow_box(ElementType::Hex8);
    let mut surfaces = hollow.surfaces().to_vec();
    for Surface { faces, .. } in &mut surfaces {
        (0..faces.len()).for_each(|face| faces[face].reverse());
    }
    let (elements, region_of) = (hollow.elements().clone(), hollow.region_of().to_vec());
    let again = Mesh::new(hollow.nodes().to_vec(), elements, region_of, hollow.regions().to_vec(), surfaces).unwrap();
    let field = FormulaField::uniform(NeoHookean { mu: 3.0, lambda: 5.0 }, &again);
    let stepper = Stepper::<Sparse, _>::new(&(), Arc::new(again), &conditions, field, StepParams::default()).unwrap();
    assert!((stepper.state().volumes[0].volume - 1.0).abs() < 1e-14);
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
