//! Element types: patch tests, rotated frames, and agreement with each other.

use std::sync::Arc;

use biotissue::backends::sparse::Sparse;
use biotissue::fem::boundary::{
    BodyForce, Conditions, LoadCurve, PointCondition, PointLocation, SurfaceCondition, Traction,
};
use biotissue::fem::element::ElementType;
use biotissue::fem::material::NeoHookean;
use biotissue::fem::mesh::{Mesh, shapes};
use biotissue::fem::point_field::FormulaField;
use biotissue::fem::stepping::{StepParams, Stepper};
use biotissue::las::NewtonParams;
use nalgebra::{Matrix3, Rotation3, Vector3};

use crate::meshes::{distorted, is_on_boundary_of_mixed, mixed, moved};

const MATERIAL: NeoHookean = NeoHookean { mu: 3.0e3, lambda: 5.0e3 };

fn params() -> StepParams {
    let mut newton = NewtonParams::default();
    newton.tolerance = 1e-13;
    StepParams { count: 2, newton, ..StepParams::default() }
}

/// The meshes of the patch test: all element types, patches of the F-bar method, and a mixed body.
fn meshes(cells: usize) -> Vec<(String, Mesh)> {
    let plain = ElementType::ALL.map(|element_type| (element_type.name().into(), distorted(element_type, cells)));
    let patches = [ElementType::Tet4, ElementType::Hex8].map(|element_type| {
        let mesh = distorted(element_type, cells).with_patches(|_| true);
        (format!("{} with F-bar", element_type.name()), mesh)
    });
    let mixed = [("mixed".into(), mixed()), ("mixed with F-bar".into(), mixed().with_patches(|_| true))];
    plain.into_iter().chain(patches).chain(mixed).collect()
}

#[test]
fn the_patch_test_is_exact() {
    for (name, mesh) in meshes(3) {
        let f = Matrix3::new(1.2, 0.3, -0.1, 0.05, 0.9, 0.2, -0.2, 0.1, 1.1);
        let exact: Vec<[f64; 3]> =
            mesh.nodes().iter().map(|&x| ((f - Matrix3::identity()) * Vector3::from(x)).into()).collect();
        let on_boundary = |x: &[f64; 3]| match name.starts_with("mixed") {
            true => is_on_boundary_of_mixed(x),
            false => x.iter().any(|&c| c == 0.0 || c == 1.0),
        };
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
            assert!((u - exact).abs() < 1e-12, "{name}: {u} {exact}");
        }
        for gradient in &stepper.state().gradients {
            assert!((gradient - f).norm() < 1e-11, "{name}: {gradient}");
        }
    }
}

/// Returns the displacements of all nodes of a body of unit size in the given frame, clamped in the plane `z = 0` and
/// loaded by a body force.
fn bent(mesh: &Mesh, frame: &Rotation3<f64>) -> Vec<Vector3<f64>> {
    let clamped = (0..mesh.nodes().len()).filter(|&node| mesh.nodes()[node][2] == 0.0).map(|node| PointCondition {
        place: PointLocation::Node(node),
        displacement: [Some(0.0); 3],
        curve: LoadCurve::Ramp,
    });
    let value = (frame * Vector3::new(700.0, 150.0, -200.0)).into();
    let force = BodyForce { region: "*".into(), value, curve: LoadCurve::Ramp };
    let points = clamped.collect();
    let conditions = Conditions { points, loads: vec![Arc::new(force)], ..Conditions::default() };
    let turned = moved(mesh, |&x| (frame * Vector3::from(x)).into());
    let turned = Arc::new(if mesh.patches().is_empty() { turned } else { turned.with_patches(|_| true) });
    assert_eq!(mesh.patches(), turned.patches());
    let field = FormulaField::uniform(MATERIAL, &turned);
    let mut stepper = Stepper::<Sparse, _>::new(&(), turned, &conditions, field, params()).unwrap();
    stepper.run(&mut ()).unwrap();
    stepper.state().displacements.iter().map(|&u| Vector3::from(u)).collect()
}

#[test]
fn results_do_not_depend_on_the_frame() {
    let turned = Rotation3::from_euler_angles(0.7, -0.4, 1.9);
    for (name, mesh) in meshes(2) {
        let (plain, rotated) = (bent(&mesh, &Rotation3::identity()), bent(&mesh, &turned));
        assert!(plain.iter().map(Vector3::norm).fold(0.0, f64::max) > 0.05, "{name}");
        for (u, v) in plain.iter().zip(&rotated) {
            assert!((turned * u - v).norm() < 1e-11, "{name}: {u} {v}");
        }
    }
}

/// Returns the displacements of all nodes of a box that a dead traction pulls and shears at one end.
fn pulled(element_type: ElementType) -> Vec<Vector3<f64>> {
    let mesh = Arc::new(shapes::cuboid_of(element_type, [2, 2, 2], [1.0, 0.6, 0.5]).unwrap());
    let clamped = SurfaceCondition { surface: "x0".into(), displacement: [Some(0.0); 3], curve: LoadCurve::Ramp };
    let traction = Traction { surface: "x1".into(), value: [700.0, 150.0, -200.0], curve: LoadCurve::Ramp };
    let conditions = Conditions { surfaces: vec![clamped], loads: vec![Arc::new(traction)], ..Conditions::default() };
    let field = FormulaField::uniform(MATERIAL, &mesh);
    let mut stepper = Stepper::<Sparse, _>::new(&(), mesh, &conditions, field, params()).unwrap();
    stepper.run(&mut ()).unwrap();
    stepper.state().displacements.iter().map(|&u| Vector3::from(u)).collect()
}

/// All element types approximate the same solution: the quadratic ones agree better than the linear ones.
#[test]
fn element_types_agree() {
    let end = |element_type: ElementType| {
        let plain = shapes::cuboid_of(element_type, [2, 2, 2], [1.0, 0.6, 0.5]).unwrap();
        let (corner, _) = plain.nearest_node([1.0, 0.6, 0.5]);
        pulled(element_type)[corner]
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
