//! Boxes under follower pressure, compared with the numbers that scikit-fem gives for the same discrete problems:
//! `tests/data/reference/pressed_boxes.py` states them and writes the file.

use std::sync::Arc;

use biotissue::backends::sparse::Sparse;
use biotissue::fem::boundary::{Conditions, LoadCurve, Pressure, SurfaceCondition};
use biotissue::fem::element::ElementType;
use biotissue::fem::material::NeoHookean;
use biotissue::fem::mesh::{Mesh, QuadraticHexahedron, shapes};
use biotissue::fem::point_field::FormulaField;
use biotissue::fem::stepping::{StepParams, Stepper};

use crate::meshes::moved;

const STORED: &str = include_str!("../data/reference/pressed_boxes.csv");

/// The box of the script, and its node at the corner (0.5, 1, 1) of the regular grid.
fn pressed_box(element_type: ElementType) -> (Mesh, usize) {
    let linear = match element_type {
        ElementType::Tet4 | ElementType::Tet10 => ElementType::Tet4,
        _ => ElementType::Hex8,
    };
    let regular = shapes::cuboid_of(linear, [2, 2, 2], [1.0; 3]).unwrap();
    let (corner, _) = regular.nearest_node([0.5, 1.0, 1.0]);
    let mesh = moved(&regular, |&[x, y, z]| {
        let bubble = 16.0 * x * (1.0 - x) * y * (1.0 - y);
        [x + 0.05 * bubble * z * (1.0 - z), 0.9 * y - 0.04 * bubble * (1.0 - z), 0.8 * z + 0.06 * bubble]
    });
    let mesh = match element_type {
        ElementType::Tet10 | ElementType::Hex20 => mesh.quadratic(QuadraticHexahedron::Serendipity).unwrap(),
        ElementType::Hex27 => mesh.quadratic(QuadraticHexahedron::Triquadratic).unwrap(),
        _ => mesh,
    };
    (mesh, corner)
}

/// Returns the forces of the supports at `x0` and `x1`, and the displacement of a node.
fn solve(mesh: Mesh, node: usize) -> [f64; 9] {
    let held = |surface: &str, displacement: [f64; 3]| SurfaceCondition {
        surface: surface.into(),
        displacement: displacement.map(Some),
        curve: LoadCurve::Ramp,
    };
    let pressure = Pressure { surface: "z1".into(), value: 0.8, curve: LoadCurve::Ramp };
    let conditions = Conditions {
        surfaces: vec![held("x0", [0.0; 3]), held("x1", [0.15, 0.05, -0.1])],
        loads: vec![Arc::new(pressure)],
        ..Conditions::default()
    };
    let mut params = StepParams { count: 2, ..StepParams::default() };
    params.newton.tolerance = 1e-14;
    let field = FormulaField::uniform(NeoHookean { mu: 3.0, lambda: 5.0 }, &mesh);
    let mut stepper = Stepper::<Sparse, _>::new(&(), Arc::new(mesh), &conditions, field, params).unwrap();
    stepper.run(&mut ()).unwrap();
    let forces = stepper.forces();
    let force = |name: &str| forces.surfaces.iter().find(|surface| surface.name == name).unwrap().force;
    [force("x0"), force("x1"), stepper.state().displacements[node]].concat().try_into().unwrap()
}

#[test]
fn pressed_boxes_agree_with_scikit_fem() {
    let lines: Vec<&str> = STORED.lines().skip(1).collect();
    assert_eq!(lines.len(), 5);
    for line in lines {
        let (name, values) = line.split_once(',').unwrap();
        let element_type = ElementType::ALL.into_iter().find(|element_type| element_type.name() == name).unwrap();
        let expected: Vec<f64> = values.split(',').map(|value| value.parse().unwrap()).collect();
        let (mesh, corner) = pressed_box(element_type);
        let found = solve(mesh, corner);
        assert_eq!(expected.len(), found.len());
        for quantities in [0..6, 6..9] {
            let size = expected[quantities.clone()].iter().fold(0.0_f64, |size, value| size.max(value.abs()));
            for k in quantities {
                let error = (found[k] - expected[k]).abs() / size;
                assert!(error < 1e-10, "{name}, column {k}: {} instead of {}", found[k], expected[k]);
            }
        }
    }
}
