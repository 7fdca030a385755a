//! Element types: patch tests, rotated frames, and agreement with each other.

use std::sync::Arc;

use biotissue::backends::sparse::Sparse;
use biotissue::fem::boundary::{Conditions, LoadCurve, PointCondition, PointLocation, SurfaceCondition, Traction};
use biotissue::fem::element::ElementType;
use biotissue::fem::material::NeoHookean;
use biotissue::fem::mesh::{Mesh, shapes};
use biotissue::fem::point_field::FormulaField;
use biotissue::fem::stepping::{StepParams, Stepper};
use biotissue::las::NewtonParams;
use nalgebra::{Matrix3, Rotation3, Vector3};

const MATERIAL: NeoHookean = NeoHookean { mu: 3.0e3, lambda: 5.0e3 };

/// The unit cube, whose inner corners are moved; the nodes between corners stay at their centers.
fn distorted(element_type: ElementType, cells: usize) -> Mesh {
    let linear = match element_type {
        ElementType::Tet10 => ElementType::Tet4,
        ElementType::Hex20 | ElementType::Hex27 => ElementType::Hex8,
        other => other,
    };
    let regular = shapes::cuboid_of(linear, [cells; 3], [1.0; 3]).unwrap();
    let is_inner = |x: &[f64; 3]| x.iter().all(|&c| c > 1e-9 && c < 1.0 - 1e-9);
    let nodes = regular.nodes().iter().map(|&x| {
        let wave = |i: usize| (7.0 * x[i] + 11.0 * x[(i + 1) % 3] + 5.0 * x[(i + 2) % 3]).sin();
        let by = if is_inner(&x) { 0.15 / cells as f64 } else { 0.0 };
        std::array::from_fn(|i| x[i] + by * wave(i))
    });
    let (elements, regions) = (regular.elements().clone(), regular.regions().to_vec());
    let mesh = Mesh::new(nodes.collect(), elements, regular.region_of().to_vec(), regions, regular.surfaces().to_vec())
        .unwrap();
    match element_type {
        ElementType::Tet10 | ElementType::Hex20 => mesh.quadratic(Default::default()).unwrap(),
        ElementType::Hex27 => mesh.quadratic(biotissue::fem::mesh::QuadraticHexahedron::Triquadratic).unwrap(),
        _ => mesh,
    }
}

fn params() -> StepParams {
    let mut newton = NewtonParams::default();
    newton.tolerance = 1e-13;
    StepParams { count: 2, newton, ..StepParams::default() }
}

#[test]
fn the_patch_test_is_exact() {
    for element_type in ElementType::ALL {
        let mesh = distorted(element_type, 3);
        let f = Matrix3::new(1.2, 0.3, -0.1, 0.05, 0.9, 0.2, -0.2, 0.1, 1.1);
        let exact: Vec<[f64; 3]> =
            mesh.nodes().iter().map(|&x| ((f - Matrix3::identity()) * Vector3::from(x)).into()).collect();
        let on_boundary = |x: &[f64; 3]| x.iter().any(|&c| c == 0.0 || c == 1.0);
        let prescribed = (0..exact.len()).filter(|&a| on_boundary(&mesh.nodes()[a])).map(|a| PointCondition {
            place: PointLocation::Node(a),
            displacement: exact[a].map(Some),
            curve: LoadCurve::Ramp,
        });
        let conditions = Conditions { points: prescribed.collect(), ..Conditions::default() };
        let field = FormulaField::uniform(MATERIAL, &mesh);
        let mut stepper = Stepper::<Sparse, _>::new(&(), Arc::new(mesh), &conditions, field, params()).unwrap();
        stepper.run(&mut ()).unwrap();
        assert!(stepper.unknowns() >= 3 * 8);
        let displacements = &stepper.state().displacements;
        for (u, exact) in displacements.iter().flatten().zip(exact.iter().flatten()) {
            assert!((u - exact).abs() < 1e-12, "{element_type:?}: {u} {exact}");
        }
        for gradient in &stepper.state().gradients {
            assert!((gradient - f).norm() < 1e-11, "{element_type:?}: {gradient}");
        }
    }
}

/// A box pulled and sheared at one end by a dead traction, in the given frame. Returns the displacements of all nodes.
fn pulled(element_type: ElementType, frame: &Rotation3<f64>) -> Vec<Vector3<f64>> {
    let plain = shapes::cuboid_of(element_type, [2, 2, 2], [1.0, 0.6, 0.5]).unwrap();
    let nodes = plain.nodes().iter().map(|&x| (frame * Vector3::from(x)).into()).collect();
    let mesh = Mesh::new(
        nodes,
        plain.elements().clone(),
        plain.region_of().to_vec(),
        plain.regions().to_vec(),
        plain.surfaces().to_vec(),
    );
    let mesh = Arc::new(mesh.unwrap());
    let clamped = SurfaceCondition { surface: "x0".into(), displacement: [Some(0.0); 3], curve: LoadCurve::Ramp };
    let value = (frame * Vector3::new(700.0, 150.0, -200.0)).into();
    let traction = Traction { surface: "x1".into(), value, curve: LoadCurve::Ramp };
    let conditions = Conditions { surfaces: vec![clamped], loads: vec![Arc::new(traction)], ..Conditions::default() };
    let field = FormulaField::uniform(MATERIAL, &mesh);
    let mut stepper = Stepper::<Sparse, _>::new(&(), mesh, &conditions, field, params()).unwrap();
    stepper.run(&mut ()).unwrap();
    stepper.state().displacements.iter().map(|&u| Vector3::from(u)).collect()
}

#[test]
fn results_do_not_depend_on_the_frame() {
    let turned = Rotation3::from_euler_angles(0.7, -0.4, 1.9);
    for element_type in ElementType::ALL {
        let (plain, rotated) = (pulled(element_type, &Rotation3::identity()), pulled(element_type, &turned));
        assert!(plain.iter().map(Vector3::norm).fold(0.0, f64::max) > 0.05);
        for (u, v) in plain.iter().zip(&rotated) {
            assert!((turned * u - v).norm() < 1e-11, "{element_type:?}: {u} {v}");
        }
    }
}

/// All element types approximate the same solution: the quadratic ones agree better than the linear ones.
#[test]
fn element_types_agree() {
    let end = |element_type: ElementType| {
        let plain = shapes::cuboid_of(element_type, [2, 2, 2], [1.0, 0.6, 0.5]).unwrap();
        let (corner, _) = plain.nearest_node([1.0, 0.6, 0.5]);
        pulled(element_type, &Rotation3::identity())[corner]
    };
    let best = end(ElementType::Hex27);
    let error = |element_type| (end(element_type) - best).norm() / best.norm();
    for (element_type, bound) in [
        (ElementType::Hex20, 0.01),
        (ElementType::Tet10, 0.02),
        (ElementType::Hex8, 0.15),
        (ElementType::Wedge6, 0.2),
        (ElementType::Tet4, 0.3),
    ] {
        let error = error(element_type);
        assert!(error < bound, "{element_type:?}: {error}");
    }
}
