//! The built-in tube under internal pressure in plane strain, compared with the solution of Lame for small strains (S.
//! P. Timoshenko and J. N. Goodier, *Theory of Elasticity*, chapter 4).

use std::sync::Arc;

use biotissue::backends::sparse::Sparse;
use biotissue::fem::boundary::{Conditions, LoadCurve, PointCondition, PointLocation, Pressure, SurfaceCondition};
use biotissue::fem::element::ElementType;
use biotissue::fem::material::NeoHookean;
use biotissue::fem::mesh::shapes::{TubeShape, between_on_tube, tube};
use biotissue::fem::mesh::{Mesh, QuadraticHexahedron};
use biotissue::fem::point_field::FormulaField;
use biotissue::fem::stepping::{StepParams, Stepper};

const SHAPE: TubeShape = TubeShape { inner_radius: 1.0, outer_radius: 1.5, length: 0.5 };
const MU: f64 = 1.0e3;
const NU: f64 = 0.3;

fn mesh(element_type: ElementType, [through, around, along]: [usize; 3]) -> Mesh {
    let linear = tube(element_type, [through, around, along], &SHAPE).unwrap();
    match element_type {
        ElementType::Tet10 | ElementType::Hex20 => {
            linear.quadratic_between(QuadraticHexahedron::Serendipity, between_on_tube).unwrap()
        }
        ElementType::Hex27 => linear.quadratic_between(QuadraticHexahedron::Triquadratic, between_on_tube).unwrap(),
        _ => linear,
    }
}

/// Returns the radial displacement of the inner surface: `(1 + nu) / E a p / (b^2 - a^2) ((1 - 2 nu) a^2 + b^2)`.
fn exact(pressure: f64) -> f64 {
    let [a, b] = [SHAPE.inner_radius, SHAPE.outer_radius];
    pressure / (2.0 * MU) * a / (b * b - a * a) * ((1.0 - 2.0 * NU) * a * a + b * b)
}

/// Returns the error of the mean displacement of the inner surface, relative to the solution of Lame. The supports in
/// the plane only prevent rigid motions, and exert no forces.
fn error(mesh: Mesh, pressure: f64) -> f64 {
    let held = |surface: &str| SurfaceCondition {
        surface: surface.into(),
        displacement: [None, None, Some(0.0)],
        curve: LoadCurve::Ramp,
    };
    let point =
        |at, displacement| PointCondition { place: PointLocation::Nearest(at), displacement, curve: LoadCurve::Ramp };
    let load = Pressure { surface: "inner".into(), value: pressure, curve: LoadCurve::Ramp };
    let conditions = Conditions {
        surfaces: vec![held("z0"), held("z1")],
        points: vec![
            point([1.0, 0.0, 0.0], [None, Some(0.0), None]),
            point([-1.0, 0.0, 0.0], [None, Some(0.0), None]),
            point([0.0, 1.0, 0.0], [Some(0.0), None, None]),
        ],
        loads: vec![Arc::new(load)],
        ..Conditions::default()
    };
    let field = FormulaField::uniform(NeoHookean { mu: MU, lambda: 2.0 * MU * NU / (1.0 - 2.0 * NU) }, &mesh);
    let params = StepParams { count: 1, ..StepParams::default() };
    let mut stepper = Stepper::<Sparse, _>::new(&(), Arc::new(mesh), &conditions, field, params).unwrap();
    stepper.run(&mut ()).unwrap();
    let forces = stepper.forces();
    let size = pressure * SHAPE.inner_radius * SHAPE.length;
    for force in forces.points.iter().flat_map(|point| [point.force[0], point.force[1]]) {
        assert!(force.abs() < 1e-6 * size, "{force:e} N");
    }
    let nodes = stepper.mesh().surface("inner").unwrap().nodes();
    let radial = |&node: &u32| {
        let (x, u) = (stepper.mesh().nodes()[node as usize], stepper.state().displacements[node as usize]);
        (u[0] * x[0] + u[1] * x[1]) / x[0].hypot(x[1])
    };
    let found = nodes.iter().map(radial).sum::<f64>() / nodes.len() as f64;
    (found / exact(pressure) - 1.0).abs()
}

/// The error of linear elements is of the order of `h^2`, that of quadratic ones of `h^3` or less.
#[test]
fn a_tube_under_pressure_expands_as_the_solution_of_lame() {
    for element_type in ElementType::ALL {
        let (sizes, order, bound) = match element_type.is_quadratic() {
            false => ([[2, 16, 1], [4, 32, 2]], 2.0, 0.02),
            true => ([[2, 12, 1], [4, 24, 2]], 3.0, 1e-4),
        };
        let [coarse, fine] = sizes.map(|size| error(mesh(element_type, size), 1e-6 * MU));
        let rate = (coarse / fine).log2();
        assert!(
            fine < bound && rate > order - 0.25,
            "{element_type:?}: errors {coarse:e} and {fine:e}, rate {rate:.2}"
        );
    }
}
