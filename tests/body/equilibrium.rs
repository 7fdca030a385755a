//! Properties of every run: forces are in balance, results do not depend on the order of the regions, and Newton's
//! method converges quadratically.
use std::sync::Arc;

use biotissue::backends::sparse::Sparse;
use biotissue::fem::boundary::{
    BodyForce, Conditions, LoadCondition, LoadCurve, PointCondition, PointLocation, SurfaceCondition, Traction,
};
use biotissue::fem::material::{LinearElastic, Material, NeoHookean};
use biotissue::fem::mesh::{Mesh, shapes};
use biotissue::fem::point_field::FormulaField;
use biotissue::fem::reactions::{BoundaryForces, SurfaceForce};
use biotissue::fem::stepping::{StepParams, Stepper};
use biotissue::las::NewtonParams;

const SOFT: NeoHookean = NeoHookean { mu: 3.0e3, lambda: 5.0e3 };

fn prescribed(surface: &str, displacement: [Option<f64>; 3]) -> SurfaceCondition {
    SurfaceCondition { surface: surface.into(), displacement, curve: LoadCurve::Ramp }
}

fn pulled(surface: &str, value: [f64; 3]) -> Vec<Arc<dyn LoadCondition>> {
    vec![Arc::new(Traction { surface: surface.into(), value, curve: LoadCurve::Ramp })]
}

fn params() -> StepParams {
    let mut newton = NewtonParams::default();
    newton.tolerance = 1e-12;
    StepParams { count: 2, newton, ..StepParams::default() }
}

fn run(mesh: &Arc<Mesh>, conditions: &Conditions) -> Stepper<Sparse, FormulaField> {
    let field = FormulaField::uniform(SOFT, mesh);
    let mut stepper = Stepper::<Sparse, _>::new(&(), Arc::clone(mesh), conditions, field, params()).unwrap();
    stepper.run(&mut ()).unwrap();
    stepper
}

fn named<'a>(forces: &'a BoundaryForces, name: &str) -> &'a SurfaceForce {
    forces.surfaces.iter().find(|surface| surface.name == name).unwrap()
}

fn assert_near(found: [f64; 3], expected: [f64; 3], within: f64, what: &str) {
    let near = (0..3).all(|i| (found[i] - expected[i]).abs() <= within);
    assert!(near, "{what}: {found:?}, expected {expected:?} within {within:e}");
}

#[test]
fn forces_on_surfaces_with_shared_edges_sum_to_zero() {
    let mesh = Arc::new(shapes::cuboid([4, 3, 3], [1.0, 0.6, 0.5]).unwrap());
    // x0 and y0 both prescribe y on their common edge; x1 is loaded also where y0 and y1 prescribe components.
    let conditions = Conditions {
        surfaces: vec![
            prescribed("x0", [Some(0.0), Some(0.0), None]),
            prescribed("y0", [None, Some(0.0), Some(0.0)]),
            prescribed("y1", [None, None, Some(0.05)]),
        ],
        loads: pulled("x1", [800.0, 300.0, -200.0]),
        points: vec![PointCondition {
            place: PointLocation::Nearest([0.5, 0.3, 0.5]),
            displacement: [Some(0.1), None, None],
            curve: LoadCurve::Ramp,
        }],
        ..Conditions::default()
    };
    let forces = run(&mesh, &conditions).forces();
    let size = named(&forces, "x0").force[0].abs();
    assert!(size > 100.0 && forces.points[0].force[0].abs() > 1.0, "{forces:?}");
    assert_eq!((forces.points[0].force[1], forces.points[0].force[2]), (0.0, 0.0), "the point prescribes x only");
    assert_near(forces.sum(), [0.0; 3], 1e-9 * size, "sum");
    assert_eq!(named(&forces, "z1").force, [0.0; 3]);
}

#[test]
fn reactions_balance_body_forces() {
    let mesh = Arc::new(shapes::cuboid([3, 3, 3], [1.0, 0.5, 0.5]).unwrap());
    let body_force = BodyForce { region: "body".into(), value: [100.0, -400.0, 50.0], curve: LoadCurve::Ramp };
    let conditions = Conditions {
        surfaces: vec![prescribed("x0", [Some(0.0); 3])],
        loads: vec![Arc::new(body_force)],
        ..Conditions::default()
    };
    let forces = run(&mesh, &conditions).forces();
    assert_near(named(&forces, "x0").force, [-25.0, 100.0, -12.5], 1e-8, "reaction");
    assert_near(forces.sum(), [-25.0, 100.0, -12.5], 1e-8, "sum");
}

#[test]
fn a_bar_in_tension_agrees_with_the_closed_form() {
    let mesh = Arc::new(shapes::cuboid([3, 2, 2], [2.0, 0.5, 0.4]).unwrap());
    let zero = |component: usize| -> [Option<f64>; 3] { std::array::from_fn(|i| (i == component).then_some(0.0)) };
    let conditions = Conditions {
        surfaces: vec![prescribed("x0", zero(0)), prescribed("y0", zero(1)), prescribed("z0", zero(2))],
        loads: pulled("x1", [2.0e3, 0.0, 0.0]),
        ..Conditions::default()
    };
    let stepper = run(&mesh, &conditions);
    let f = stepper.state().gradients[0];
    let (stretch, across) = (f[(0, 0)], f[(1, 1)]);
    assert!(stretch > 1.1 && across < 0.99, "{f}");
    let pk1 = SOFT.evaluate(&f).unwrap().pk1;
    assert!((pk1[(0, 0)] - 2.0e3).abs() < 1e-7 && pk1[(1, 1)].abs() < 1e-7 && pk1[(2, 2)].abs() < 1e-7, "{pk1}");
    assert!(stepper.state().gradients.iter().all(|other| (other - f).norm() < 1e-12), "homogeneous");

    let forces = stepper.forces();
    let (left, right, side) = (named(&forces, "x0"), named(&forces, "x1"), named(&forces, "y1"));
    assert_near(right.force, [400.0, 0.0, 0.0], 1e-9, "traction times area");
    assert_near(left.force, [-400.0, 0.0, 0.0], 1e-7, "reaction");
    assert_near(side.force, [0.0; 3], 0.0, "free");
    assert_near(
        right.displacement,
        [2.0 * (stretch - 1.0), 0.25 * (across - 1.0), 0.2 * (across - 1.0)],
        1e-12,
        "mean displacement",
    );
    assert!((right.area - 0.2 * across * across).abs() < 1e-13);
    assert!((side.area - 0.8 * across * stretch).abs() < 1e-13);
}

#[test]
fn the_order_of_regions_does_not_matter() {
    let plain = shapes::cuboid([4, 2, 2], [1.0, 0.5, 0.5]).unwrap();
    let stiff = LinearElastic { mu: 9.0e3, lambda: 9.0e3 };
    let run = |order: [&str; 2]| {
        let soft_number = order.iter().position(|name| *name == "soft").unwrap() as u32;
        let region_of = plain.elements().iter().enumerate();
        let region_of: Vec<u32> = region_of
            .map(|(e, _)| if plain.positions(e).iter().any(|x| x[0] > 0.6) { 1 - soft_number } else { soft_number })
            .collect();
        let materials = order.map(|name| -> Box<dyn Material> {
            if name == "soft" { Box::new(SOFT) } else { Box::new(stiff) }
        });
        let mesh = Mesh::new(
            plain.nodes().to_vec(),
            plain.elements().clone(),
            region_of,
            order.map(String::from).to_vec(),
            plain.surfaces().to_vec(),
        );
        let field = FormulaField::new(Vec::from(materials), mesh.as_ref().unwrap()).unwrap();
        let force = BodyForce { region: "soft".into(), value: [0.0, 0.0, 90.0], curve: LoadCurve::Ramp };
        let conditions = Conditions {
            surfaces: vec![prescribed("x0", [Some(0.0); 3]), prescribed("x1", [Some(0.2), Some(0.1), None])],
            loads: vec![Arc::new(force)],
            ..Conditions::default()
        };
        let mut stepper =
            Stepper::<Sparse, _>::new(&(), Arc::new(mesh.unwrap()), &conditions, field, params()).unwrap();
        stepper.run(&mut ()).unwrap();
        stepper.state().displacements.clone()
    };
    assert_eq!(run(["soft", "stiff"]), run(["stiff", "soft"]), "bitwise");
}

#[test]
fn newton_converges_quadratically() {
    let mesh = Arc::new(shapes::cuboid([4, 4, 4], [1.0; 3]).unwrap());
    let conditions = Conditions {
        surfaces: vec![prescribed("x0", [Some(0.0); 3]), prescribed("x1", [Some(0.3), Some(0.2), Some(0.0)])],
        ..Conditions::default()
    };
    let field = FormulaField::uniform(SOFT, &mesh);
    let mut stepper = Stepper::<Sparse, _>::new(&(), mesh, &conditions, field, params()).unwrap();
    for report in stepper.run(&mut ()).unwrap() {
        let r = &report.solves[0].relative;
        assert!(r.len() >= 3, "{r:?}");
        for pair in r.windows(2).filter(|pair| pair[0] < 0.1 && pair[1] > 1e-13) {
            assert!(pair[1] < 10.0 * pair[0] * pair[0], "{r:?}");
        }
    }
}

#[test]
fn a_nearly_undeformed_body_converges() {
    // At strains of 1e-12, the residual cannot fall to 1e-12 of the forces: F is 1 to within these strains and contains
    // only a few of their digits.
    let mesh = Arc::new(shapes::cuboid([3, 3, 3], [1.0; 3]).unwrap());
    let conditions = Conditions {
        surfaces: vec![prescribed("x0", [Some(0.0); 3]), prescribed("x1", [Some(1e-12), Some(0.0), None])],
        ..Conditions::default()
    };
    let forces = run(&mesh, &conditions).forces();
    let force = named(&forces, "x1").force[0];
    assert!((1e-12..1e-7).contains(&force), "{force:e}");
}
