//! The tangent of the body, with F-bar and with loads that depend on the displacements, is the derivative of the
//! residual for every element type.

use std::sync::Arc;

use biotissue::backends::sparse::Sparse;
use biotissue::fem::assembly::{Assembler, Unknowns, geometry};
use biotissue::fem::boundary::{
    Boundary, Conditions, Foundation, LoadCurve, LoadFunction, PointCondition, PointLocation, Pressure, RigidCondition,
    SurfaceCondition, Traction,
};
use biotissue::fem::element::ElementType;
use biotissue::fem::equilibrium::Equilibrium;
use biotissue::fem::material::NeoHookean;
use biotissue::fem::mesh::{Mesh, shapes};
use biotissue::fem::point_field::FormulaField;
use biotissue::las::{Backend, MatrixOps, NonlinearProblem, VectorOps};
use nalgebra::{Rotation3, Vector3};

use crate::meshes::mixed;

/// Compares all entries of the tangent at a deformed state at pseudo-time 0.7 with central differences of the residual.
/// `tolerance` is in N/m.
pub fn assert_tangent_is_the_derivative(mesh: Mesh, material: NeoHookean, conditions: &Conditions, tolerance: f64) {
    let mesh = Arc::new(mesh);
    let nodes = mesh.nodes().len();
    let boundary = Boundary::new(&mesh, conditions).unwrap();
    let prescribed = boundary.prescribed_mask(nodes);
    let unknowns = Unknowns::new(nodes, |node, component| prescribed[node][component])
        .unwrap()
        .with_kinematics(boundary.kinematics(), &boundary.prescribed_of_rigid_surfaces())
        .unwrap();
    let mut k = Sparse::matrix(&(), &Arc::new(unknowns.pattern(&mesh).unwrap())).unwrap();
    let mut assembler = Assembler::<Sparse>::new(geometry(&mesh).unwrap(), &unknowns, &k).unwrap();
    assembler.locate_loads(boundary.loads(), &k).unwrap();
    let field = FormulaField::uniform(material, &mesh);
    let mut body = Equilibrium::<Sparse, _>::new(mesh, boundary, assembler, field).unwrap();
    let n = unknowns.free();
    let rows: Vec<i32> = (0..n as i32).collect();
    let vector = |values: &dyn Fn(usize) -> f64| {
        let mut vector = Sparse::vector(&(), n).unwrap();
        vector.set(&rows, &(0..n).map(values).collect::<Vec<f64>>()).unwrap();
        vector
    };
    let residual = |body: &mut Equilibrium<Sparse, FormulaField>| {
        let mut r = vector(&|_| 0.0);
        body.residual(&mut r).unwrap();
        let mut values = vec![0.0; n];
        r.get(&rows, &mut values).unwrap();
        values
    };
    body.begin_step(0.7);
    body.advance(1.0, &vector(&|j| 0.01 * (7.0 * j as f64).sin())).unwrap();
    residual(&mut body);
    body.jacobian(&mut k).unwrap();
    k.finish().unwrap();
    let h = 1e-6;
    for column in 0..n {
        let along = vector(&|j| if j == column { 1.0 } else { 0.0 });
        body.advance(h, &along).unwrap();
        let up = residual(&mut body);
        body.advance(-2.0 * h, &along).unwrap();
        let down = residual(&mut body);
        body.advance(h, &along).unwrap();
        let mut entries = vec![0.0; n];
        k.get(&rows, &[column as i32], &mut entries).unwrap();
        for (row, entry) in entries.into_iter().enumerate() {
            let slope = (up[row] - down[row]) / (2.0 * h);
            assert!((slope - entry).abs() < tolerance, "({row}, {column}): {entry}, slope {slope}: {conditions:?}");
        }
    }
}

/// A factor that depends on the pseudo-time and the position.
#[derive(Debug)]
struct Hydrostatic;

impl LoadFunction for Hydrostatic {
    fn factor(&self, t: f64, [x, y, z]: [f64; 3]) -> f64 {
        t * (1.0 + 0.5 * x - 0.7 * y * z)
    }
}

/// Pressure, traction and foundation of the library, with a factor that depends on the position.
fn conditions() -> Conditions {
    let curve = LoadCurve::Function(Arc::new(Hydrostatic));
    let clamp = SurfaceCondition { surface: "x0".into(), displacement: [Some(0.0); 3], curve: LoadCurve::Ramp };
    Conditions {
        surfaces: vec![clamp],
        loads: vec![
            Arc::new(Pressure { surface: "z1".into(), value: 30.0, curve: curve.clone() }),
            Arc::new(Traction { surface: "y1".into(), value: [1.0, -2.0, 3.0], curve }),
            Arc::new(Foundation { surface: "x1".into(), normal: 40.0, tangential: 15.0 }),
        ],
        ..Conditions::default()
    }
}

#[test]
fn the_tangent_is_the_derivative_of_the_residual_for_every_element_type() {
    let material = NeoHookean { mu: 30.0, lambda: 50.0 };
    for element_type in ElementType::ALL {
        let cells = if element_type == ElementType::Tet10 { [1, 1, 1] } else { [2, 1, 1] };
        let mesh = shapes::cuboid_of(element_type, cells, [1.0, 0.7, 0.5]).unwrap();
        assert_tangent_is_the_derivative(mesh.clone(), material, &conditions(), 1e-6);
        let patched = mesh.with_patches(|_| true);
        if !patched.patches().is_empty() {
            assert_tangent_is_the_derivative(patched, material, &conditions(), 1e-6);
        }
    }
}

#[test]
fn the_tangent_of_a_mixed_body_is_the_derivative_of_the_residual() {
    let mesh = mixed().with_patches(|_| true);
    let held = (0..mesh.nodes().len()).filter(|&node| mesh.nodes()[node][2] < 0.4 || mesh.nodes()[node][0] > 0.9);
    let points = held.map(|node| PointCondition {
        place: PointLocation::Node(node),
        displacement: [Some(0.0); 3],
        curve: LoadCurve::Ramp,
    });
    let conditions = Conditions { points: points.collect(), ..Conditions::default() };
    assert_tangent_is_the_derivative(mesh, NeoHookean { mu: 30.0, lambda: 500.0 }, &conditions, 1e-6);
}

/// A plane of symmetry that is inclined to the axes, and a rigid surface that turns about a given axis and is free
/// otherwise, with loads on both.
#[test]
fn the_tangent_with_frames_and_rigid_surfaces_is_the_derivative_of_the_residual() {
    let material = NeoHookean { mu: 30.0, lambda: 50.0 };
    let frame = Rotation3::from_euler_angles(0.4, -0.7, 1.1);
    for element_type in ElementType::ALL {
        let cells = if element_type == ElementType::Tet10 { [1, 1, 1] } else { [2, 1, 1] };
        let straight = shapes::cuboid_of(element_type, cells, [1.0, 0.7, 0.5]).unwrap();
        let nodes = straight.nodes().iter().map(|&x| (frame * Vector3::from(x)).into()).collect();
        let (elements, regions) = (straight.elements().clone(), straight.regions().to_vec());
        let region_of = straight.region_of().to_vec();
        let mesh = Mesh::new(nodes, elements, region_of, regions, straight.surfaces().to_vec()).unwrap();
        let turned = RigidCondition {
            surface: "x1".into(),
            reference: Some([0.9, 0.2, -0.3]),
            displacement: [Some(0.1.into()), None, None],
            rotation: [None, Some(0.8.into()), None],
        };
        let conditions = Conditions {
            symmetry_planes: vec!["x0".into()],
            rigid: vec![turned],
            loads: conditions().loads,
            ..Conditions::default()
        };
        assert_tangent_is_the_derivative(mesh.clone(), material, &conditions, 1e-6);
        let patched = mesh.with_patches(|_| true);
        if !patched.patches().is_empty() {
            assert_tangent_is_the_derivative(patched, material, &conditions, 1e-6);
        }
    }
}
