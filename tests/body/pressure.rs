//! Follower pressure: bodies whose deformation is known in closed form.

use std::sync::Arc;

use biotissue::backends::sparse::Sparse;
use biotissue::fem::boundary::{
    Conditions, LoadCondition, LoadCurve, PointCondition, PointLocation, Pressure, SurfaceCondition,
};
use biotissue::fem::element::ElementType;
use biotissue::fem::material::NeoHookean;
use biotissue::fem::mesh::shapes;
use biotissue::fem::point_field::FormulaField;
use biotissue::fem::stepping::{StepParams, Stepper};

const MATERIAL: NeoHookean = NeoHookean { mu: 3.0e3, lambda: 5.0e3 };

fn pressure(surface: &str, value: f64) -> Arc<dyn LoadCondition> {
    Arc::new(Pressure { surface: surface.into(), value, curve: LoadCurve::Ramp })
}

/// Under equal pressure on all sides every edge shrinks by a stretch `l` with
/// `mu (l - 1/l) + lambda ln(l^3) / l = -p l^2`.
#[test]
fn pressure_on_all_sides_compresses_uniformly() {
    for element_type in ElementType::ALL {
        let mesh = shapes::cuboid_of(element_type, [2, 1, 1], [1.0, 0.6, 0.5]).unwrap();
        let stretch: f64 = 0.8;
        let NeoHookean { mu, lambda } = MATERIAL;
        let value = -(mu * (stretch - 1.0 / stretch) + lambda * stretch.powi(3).ln() / stretch) / (stretch * stretch);
        let held = |at, displacement| PointCondition {
            place: PointLocation::Nearest(at),
            displacement,
            curve: LoadCurve::Ramp,
        };
        let conditions = Conditions {
            points: vec![
                held([0.0; 3], [Some(0.0); 3]),
                held([1.0, 0.0, 0.0], [None, Some(0.0), Some(0.0)]),
                held([0.0, 0.6, 0.0], [None, None, Some(0.0)]),
            ],
            loads: ["x0", "x1", "y0", "y1", "z0", "z1"].map(|side| pressure(side, value)).into(),
            ..Conditions::default()
        };
        let mut params = StepParams { count: 4, ..StepParams::default() };
        params.newton.tolerance = 1e-12;
        let field = FormulaField::uniform(MATERIAL, &mesh);
        let mut stepper = Stepper::<Sparse, _>::new(&(), Arc::new(mesh), &conditions, field, params).unwrap();
        stepper.run(&mut ()).unwrap();
        for (x, u) in stepper.mesh().nodes().iter().zip(&stepper.state().displacements) {
            for (x, u) in x.iter().zip(u) {
                assert!((u - (stretch - 1.0) * x).abs() < 1e-10, "{element_type:?}: {u} at {x}");
            }
        }
        let forces = stepper.forces();
        assert!(forces.sum().iter().all(|force| force.abs() < 1e-9 * value), "{:?}", forces.sum());
        assert!(forces.points.iter().flat_map(|point| point.force).all(|force| force.abs() < 1e-9 * value));
        let [side] = [forces.surfaces.iter().find(|surface| surface.name == "x1").unwrap()];
        let expected = -value * 0.6 * 0.5 * stretch * stretch;
        assert!((side.force[0] / expected - 1.0).abs() < 1e-10, "{side:?}");
    }
}

/// A thin strip, clamped at one end and pressed on its lower side, rolls up; the pressure turns with it.
#[test]
fn the_force_follows_the_surface() {
    let mesh = shapes::cuboid_of(ElementType::Hex20, [8, 1, 1], [1.0, 0.2, 0.1]).unwrap();
    let clamp = SurfaceCondition { surface: "x0".into(), displacement: [Some(0.0); 3], curve: LoadCurve::Ramp };
    let conditions = Conditions { surfaces: vec![clamp], loads: vec![pressure("z0", 4.0)], ..Conditions::default() };
    let mut params = StepParams { count: 10, ..StepParams::default() };
    params.newton.tolerance = 1e-12;
    let field = FormulaField::uniform(MATERIAL, &mesh);
    let mut stepper = Stepper::<Sparse, _>::new(&(), Arc::new(mesh), &conditions, field, params).unwrap();
    for report in stepper.run(&mut ()).unwrap() {
        let relative = &report.solves[0].relative;
        for pair in relative.windows(2).filter(|pair| pair[0] < 1e-4 && pair[1] > 1e-11) {
            assert!(pair[1] < 1e4 * pair[0] * pair[0], "{relative:?}");
        }
    }
    let forces = stepper.forces();
    let pressed = forces.surfaces.iter().find(|surface| surface.name == "z0").unwrap();
    assert!(pressed.force[2] > 0.3 && pressed.force[0] < -0.1, "{pressed:?}");
    assert!(forces.sum().iter().all(|force| force.abs() < 1e-9), "{:?}", forces.sum());
}
