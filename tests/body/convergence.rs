//! Homogeneous exact solutions are reproduced exactly; smooth ones are approximated with the convergence rates of
//! linear elements.
use std::f64::consts::PI;
use std::sync::Arc;

use biotissue::backends::sparse::Sparse;
use biotissue::fem::boundary::{
    BodyForce, Conditions, LoadCondition, LoadCurve, PointCondition, PointLocation, SurfaceCondition,
};
use biotissue::fem::element::geometry;
use biotissue::fem::element::reference::Tet4;
use biotissue::fem::material::{LinearElastic, NeoHookean};
use biotissue::fem::mesh::{Mesh, shapes};
use biotissue::fem::point_field::FormulaField;
use biotissue::fem::stepping::{StepParams, Stepper};
use biotissue::las::NewtonParams;
use nalgebra::{Matrix3, Vector3};

/// Returns the unit cube divided into `n^3` cells, with one region per element and interior nodes moved off the grid by
/// up to `distortion` cells.
fn cube(n: usize, distortion: f64) -> Mesh {
    let regular = shapes::cuboid([n; 3], [1.0; 3]).unwrap();
    let inside = |x: &[f64; 3]| x.iter().all(|&c| c > 1e-9 && c < 1.0 - 1e-9);
    let nodes = regular.nodes().iter().map(|&x| {
        let wave = |i: usize| (7.0 * x[i] + 11.0 * x[(i + 1) % 3] + 5.0 * x[(i + 2) % 3]).sin();
        let by = if inside(&x) { distortion / n as f64 } else { 0.0 };
        std::array::from_fn(|i| x[i] + by * wave(i))
    });
    let count = regular.elements().len();
    Mesh::new(
        nodes.collect(),
        regular.elements().clone(),
        (0..count as u32).collect(),
        (0..count).map(|e| format!("e{e}")).collect(),
        regular.surfaces().to_vec(),
    )
    .unwrap()
}

#[test]
fn the_patch_test_is_exact() {
    let mesh = cube(3, 0.2);
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
    let mut newton = NewtonParams::default();
    newton.tolerance = 1e-13;
    let params = StepParams { count: 2, newton, ..StepParams::default() };
    let field = FormulaField::uniform(NeoHookean { mu: 3.0e3, lambda: 5.0e3 }, &mesh);
    let mut stepper = Stepper::<Sparse, _>::new(&(), Arc::new(mesh), &conditions, field, params).unwrap();
    stepper.run(&mut ()).unwrap();
    assert_eq!(stepper.unknowns(), 3 * 8);
    for (u, exact) in stepper.state().displacements.iter().zip(&exact) {
        for i in 0..3 {
            assert!((u[i] - exact[i]).abs() < 1e-12, "{u:?}, exact {exact:?}");
        }
    }
    for found in &stepper.state().gradients {
        assert!((found - f).norm() < 1e-12, "{found}");
    }
}

const MATERIAL: LinearElastic = LinearElastic { mu: 1.0, lambda: 1.5 };
/// Amplitudes of the exact displacement `u_i = AMPLITUDE_i sin(pi x) sin(pi y) sin(pi z)`, which is zero on all faces
/// of the unit cube.
const AMPLITUDE: [f64; 3] = [1.0, -0.5, 0.7];

fn exact(x: &[f64; 3]) -> Vector3<f64> {
    Vector3::from(AMPLITUDE) * x.iter().map(|c| (PI * c).sin()).product::<f64>()
}

fn exact_gradient(x: &[f64; 3]) -> Matrix3<f64> {
    let (s, c) = (x.map(|x| (PI * x).sin()), x.map(|x| (PI * x).cos()));
    let slope = Vector3::new(c[0] * s[1] * s[2], s[0] * c[1] * s[2], s[0] * s[1] * c[2]) * PI;
    Vector3::from(AMPLITUDE) * slope.transpose()
}

/// Returns the body force `-div sigma = -mu lap(u) - (lambda + mu) grad(div u)` of the exact displacement.
fn body_force(x: &[f64; 3]) -> [f64; 3] {
    let (s, c) = (x.map(|x| (PI * x).sin()), x.map(|x| (PI * x).cos()));
    let product = s[0] * s[1] * s[2];
    let second = |i: usize, j: usize| PI * PI * if i == j { -product } else { c[i] * c[j] * s[3 - i - j] };
    std::array::from_fn(|i| {
        let gradient_of_divergence: f64 = (0..3).map(|j| AMPLITUDE[j] * second(i, j)).sum();
        3.0 * PI * PI * MATERIAL.mu * AMPLITUDE[i] * product - (MATERIAL.lambda + MATERIAL.mu) * gradient_of_divergence
    })
}

/// Returns the L2 norms of the errors of the displacements and of their gradients.
fn errors(n: usize) -> [f64; 2] {
    let mesh = Arc::new(cube(n, 0.1));
    let zero =
        |name: &str| SurfaceCondition { surface: name.into(), displacement: [Some(0.0); 3], curve: LoadCurve::Ramp };
    let loads = (0..mesh.elements().len()).map(|e| {
        let force = BodyForce { region: format!("e{e}"), value: body_force(&mesh.center(e)), curve: LoadCurve::Ramp };
        Arc::new(force) as Arc<dyn LoadCondition>
    });
    let conditions = Conditions {
        surfaces: ["x0", "x1", "y0", "y1", "z0", "z1"].map(zero).to_vec(),
        loads: loads.collect(),
        ..Conditions::default()
    };
    let field = FormulaField::uniform(MATERIAL, &mesh);
    let params = StepParams { count: 1, ..StepParams::default() };
    let mut stepper = Stepper::<Sparse, _>::new(&(), Arc::clone(&mesh), &conditions, field, params).unwrap();
    let reports = stepper.run(&mut ()).unwrap();
    assert_eq!(reports[0].iterations(), 0, "a linear problem is solved by the linear first guess");

    // The quadrature rule with four points, exact for quadratic functions: barycentric coordinates (5 - sqrt 5)/20 and
    // (5 + 3 sqrt 5)/20.
    let (near, far) = (0.138_196_601_125_010_5, 0.585_410_196_624_968_5);
    let (mut values, mut slopes) = (0.0, 0.0);
    for (e, nodes) in mesh.elements().iter().enumerate() {
        let corners: [[f64; 3]; 4] = mesh.positions(e).try_into().unwrap();
        let [element] = geometry::<Tet4, 4, 1>(&corners).unwrap();
        let u = std::array::from_fn(|a| stepper.state().displacements[nodes[a] as usize]);
        let gradient = element.displacement_gradient(&u);
        for q in 0..4 {
            let weight = |a: usize| if a == q { far } else { near };
            let at =
                |v: &[[f64; 3]; 4]| -> [f64; 3] { std::array::from_fn(|i| (0..4).map(|a| weight(a) * v[a][i]).sum()) };
            let x = at(&corners);
            values += element.volume / 4.0 * (exact(&x) - Vector3::from(at(&u))).norm_squared();
            slopes += element.volume / 4.0 * (exact_gradient(&x) - gradient).norm_squared();
        }
    }
    [values.sqrt(), slopes.sqrt()]
}

#[test]
fn smooth_solutions_converge_at_the_rates_of_linear_elements() {
    let (coarse, fine) = (errors(8), errors(16));
    let [value_rate, slope_rate] = [0, 1].map(|k| (coarse[k] / fine[k]).log2());
    println!("errors {coarse:?} {fine:?}, rates {value_rate:.3} {slope_rate:.3}");
    assert!((1.85..2.15).contains(&value_rate), "L2 error of the displacement: h^{value_rate:.3}");
    assert!((0.93..1.10).contains(&slope_rate), "L2 error of the gradient: h^{slope_rate:.3}");
}
