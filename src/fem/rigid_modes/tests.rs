use std::sync::Arc;

use super::*;
use crate::fem::boundary::{Boundary, Conditions, Foundation};
use crate::fem::mesh::shapes;

/// Returns the error message for a box of 1 by 2 by 3 m with these prescribed components.
fn said(held: impl Fn([f64; 3]) -> [bool; 3]) -> String {
    let mesh = shapes::cuboid([2, 2, 2], [1.0, 2.0, 3.0]).unwrap();
    said_of(&mesh, held)
}

fn said_of(mesh: &Mesh, held: impl Fn([f64; 3]) -> [bool; 3]) -> String {
    let prescribed: Vec<[bool; 3]> = mesh.nodes().iter().map(|&x| held(x)).collect();
    let restraints = Restraint::of_components(mesh, &prescribed);
    check(mesh, &restraints, &[]).map_or_else(|error| error.to_string(), |()| String::new())
}

const ALL: [bool; 3] = [true; 3];
const NONE: [bool; 3] = [false; 3];

#[test]
fn a_fully_constrained_body_passes() {
    assert_eq!(said(|x| if x[0] == 0.0 { ALL } else { NONE }), "");
    // Three planes of symmetry.
    assert_eq!(said(|x| x.map(|x| x == 0.0)), "");
    // Six components at three corners.
    let minimal = |x: [f64; 3]| match x {
        [0.0, 0.0, 0.0] => ALL,
        [1.0, 0.0, 0.0] => [false, true, true],
        [0.0, 2.0, 0.0] => [false, false, true],
        _ => NONE,
    };
    assert_eq!(said(minimal), "");
}

#[test]
fn free_translations_are_named() {
    assert_eq!(said(|_| NONE), "the body is free to move in every direction and to rotate about every axis");
    assert_eq!(said(|x| if x[0] == 0.0 { [true, true, false] } else { NONE }), "the body is free to move along z");
    // A roller on one face.
    let roller = said(|x| [false, false, x[2] == 0.0]);
    assert_eq!(roller, "the body is free to move along x and y and to rotate about z");
}

#[test]
fn free_rotations_are_named_with_their_axis() {
    // All nodes of an edge: a hinge.
    let hinge = |x: [f64; 3]| if x[0] == 1.0 && x[1] == 2.0 { ALL } else { NONE };
    assert_eq!(said(hinge), "the body is free to rotate about z (the axis through (1, 2, 1.5))");
    // One corner: a ball joint.
    let joint = |x: [f64; 3]| if x == [1.0, 2.0, 3.0] { ALL } else { NONE };
    assert_eq!(said(joint), "the body is free to rotate about every axis through (1, 2, 3)");
    // Two opposite corners: an oblique hinge.
    let oblique = |x: [f64; 3]| if x == [0.0; 3] || x == [1.0, 2.0, 3.0] { ALL } else { NONE };
    let said = said(oblique);
    assert_eq!(said, "the body is free to rotate about (0.2673, 0.5345, 0.8018) (the axis through (0.5, 1, 1.5))");
}

#[test]
fn springs_support() {
    let mesh = shapes::cuboid([2, 2, 2], [1.0, 2.0, 3.0]).unwrap();
    let on = |normal, tangential| {
        let foundation = Foundation { surface: "x0".into(), normal, tangential };
        let conditions = Conditions { loads: vec![Arc::new(foundation)], ..Conditions::default() };
        let boundary = Boundary::new(&mesh, &conditions).unwrap();
        check(&mesh, &boundary.restraints(&mesh), &[]).map_or_else(|error| error.to_string(), |()| String::new())
    };
    assert_eq!(on(1.0, 1.0), "");
    assert_eq!(on(2.0, 0.0), "the body is free to move along y and z and to rotate about x");
    assert!(on(0.0, 0.1).contains("free to move along x"), "{}", on(0.0, 0.1));
    assert_eq!(on(0.0, 0.0), said(|_| NONE));
}

#[test]
fn every_part_must_be_constrained() {
    let one = shapes::cuboid([1, 1, 1], [1.0; 3]).unwrap();
    let count = one.nodes().len() as u32;
    let mut nodes = one.nodes().to_vec();
    nodes.extend(one.nodes().iter().map(|&[x, y, z]| [x + 5.0, y, z]));
    let mut elements = one.elements().clone();
    elements.extend(&one.elements().map(|node| node + count));
    let region_of = (0..elements.len()).map(|element| (element / one.elements().len()) as u32).collect();
    let mesh = Mesh::new(nodes, elements, region_of, vec!["left".into(), "right".into()], vec![]).unwrap();
    let said = said_of(&mesh, |x| if x[0] == 0.0 { ALL } else { [x[0] == 5.0, x[0] == 5.0, false] });
    assert_eq!(said, "the unconnected part of 6 elements at (5, 0, 0), region `right`, is free to move along z");
    assert_eq!(said_of(&mesh, |x| if x[0] == 0.0 || x[0] == 5.0 { ALL } else { NONE }), "");
    assert_eq!(said_of(&mesh, |_| NONE).matches("free to move in every direction").count(), 2);
}

/// The listed modes leave all prescribed components in place, and their number agrees with the rank of the equations.
#[test]
fn free_modes_leave_prescribed_components_in_place() {
    let mesh = shapes::cuboid([1, 1, 1], [1.0, 2.0, 3.0]).unwrap();
    let (mut state, mut screws) = (7_u64, 0);
    for _ in 0..500 {
        let mut random = || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (state >> 33) as usize
        };
        let mut prescribed = vec![[false; 3]; mesh.nodes().len()];
        for _ in 0..random() % 7 {
            prescribed[random() % 8][random() % 3] = true;
        }
        let prescribed = &prescribed;
        let held = |node: usize| (0..3).filter(move |&i| prescribed[node][i]).collect::<Vec<usize>>();
        let rows = (0..8).flat_map(|node| held(node).into_iter().map(move |i| (node, i)));
        let rows: Vec<Vector6<f64>> =
            rows.map(|(node, i)| equation(Vector3::ith(i, 1.0), mesh.nodes()[node].into())).collect();
        let rank = if rows.is_empty() { 0 } else { DMatrix::from_fn(rows.len(), 6, |i, j| rows[i][j]).rank(1e-9) };
        let Err(error) = check(&mesh, &Restraint::of_components(&mesh, prescribed), &[]) else {
            assert_eq!(rank, 6, "{prescribed:?}");
            continue;
        };
        let FreeModes { translations, rotations, .. } = &error.parts[0].free_modes;
        assert_eq!(translations.len() + rotations.len(), 6 - rank, "{error}: {prescribed:?}");
        screws += rotations.iter().filter(|screw| screw.pitch != 0.0).count();
        let zero = |node: usize, motion: Vector3<f64>| held(node).into_iter().all(|i| motion[i].abs() < 1e-9);
        for node in 0..8 {
            assert!(translations.iter().all(|&t| zero(node, t.into())), "{error}: {prescribed:?}");
        }
        if translations.is_empty() {
            for Screw { axis, point, pitch } in rotations {
                let (axis, point) = (Vector3::from(*axis), Vector3::from(*point));
                let motion = |node: usize| axis * *pitch + axis.cross(&(Vector3::from(mesh.nodes()[node]) - point));
                assert!((0..8).all(|node| zero(node, motion(node))), "{error}: {prescribed:?}");
            }
        }
    }
    assert!(screws > 0, "five components leave a screw as a rule");
}

/// The rank does not depend on the position or size of the body or on the number of prescribed nodes.
#[test]
fn the_result_does_not_depend_on_size_and_position() {
    for (scale, shift) in [(1e-6, 0.0), (1e6, 0.0), (1e-3, 10.0), (1.0, 1e4)] {
        let one = shapes::cuboid([3, 3, 3], [1.0, 1.0, 1.0]).unwrap();
        let nodes = one.nodes().iter().map(|x| x.map(|x| scale * x + shift)).collect();
        let elements = one.elements().clone();
        let regions = vec![0; elements.len()];
        let mesh = Mesh::new(nodes, elements, regions, vec!["body".into()], vec![]).unwrap();
        let at = |x: f64, place: f64| (x - (scale * place + shift)).abs() < 1e-3 * scale;
        let hinge = said_of(&mesh, |x| if at(x[0], 0.0) && at(x[1], 0.0) { ALL } else { NONE });
        assert!(hinge.starts_with("the body is free to rotate about z (the axis"), "{scale} {shift}: {hinge}");
        // The nodes of one small triangle suffice to constrain the whole body.
        let corner =
            |x: [f64; 3]| x.iter().filter(|&&x| at(x, 0.0)).count() >= 2 && x.iter().all(|&x| x < 0.5 * scale + shift);
        assert_eq!(said_of(&mesh, |x| if corner(x) { ALL } else { NONE }), "");
    }
}
