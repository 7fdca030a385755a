//! Pressures of constraints against closed forms.

use std::sync::Arc;

use biotissue::backends::sparse::Sparse;
use biotissue::fem::boundary::{Conditions, LoadCurve, PointCondition, PointLocation};
use biotissue::fem::element::ElementType;
use biotissue::fem::material::NeoHookean;
use biotissue::fem::mesh::shapes;
use biotissue::fem::point_field::FormulaField;
use biotissue::fem::stepping::{StepParams, Stepper};

use super::sphere::sphere;
use super::{cavity, driven, penalized, prescribed, region};

/// Supports of a sphere that leave it free to expand: one node on each axis moves along this axis only.
fn on_axes() -> Vec<PointCondition> {
    let held = |axis: usize| {
        let (mut at, mut displacement) = ([0.0; 3], [Some(0.0); 3]);
        (at[axis], displacement[axis]) = (2.0, None);
        PointCondition { place: PointLocation::Nearest(at), displacement, curve: LoadCurve::Ramp }
    };
    (0..3).map(held).collect()
}

/// The pressures in the cavity of a nearly incompressible sphere of shear modulus 1 at inner stretches of 1.1, 1.5 and
/// 2.
fn inflated(n: usize) -> [f64; 3] {
    let mesh = sphere(ElementType::Hex8, n, n).with_patches(|_| true);
    let curve = [[0.0, 1.0], [0.25, 1.331], [0.5, 3.375], [1.0, 8.0]];
    let constraints = vec![driven(cavity(&["inner"]), &curve)];
    let conditions = Conditions { points: on_axes(), constraints, ..Conditions::default() };
    let field = FormulaField::uniform(NeoHookean { mu: 1.0, lambda: 1e3 }, &mesh);
    let params = StepParams { count: 4, ..StepParams::default() };
    let mut stepper = Stepper::<Sparse, _>::new(&(), Arc::new(mesh), &conditions, field, params).unwrap();
    let mut pressures = Vec::new();
    while stepper.completed_steps() < 4 {
        stepper.step(&mut ()).unwrap();
        pressures.push(stepper.state().volumes[0].pressure);
    }
    [pressures[0], pressures[1], pressures[3]]
}

/// The pressure in an incompressible thick sphere of radii 1 and 2 over the shear modulus, at the three stretches (A.
/// E. Green and W. Zerna, *Theoretical Elasticity*, 1968, section 3.10).
const THICK_SPHERE: [f64; 3] = [0.287_154_85, 0.755_433_12, 0.806_926_60];

/// The pressures converge with the square of the element size; with 6 x 4^3 elements, they are 2 to 4 % too high, and
/// the extrapolation from 2 and 4 elements per edge is within 0.3 %.
#[test]
fn the_pressure_in_a_driven_cavity_is_that_of_a_thick_sphere() {
    let (coarse, fine) = (inflated(2), inflated(4));
    for ((coarse, fine), expected) in coarse.into_iter().zip(fine).zip(THICK_SPHERE) {
        let extrapolated = fine + (fine - coarse) / 3.0;
        assert!((fine / expected - 1.0).abs() < 0.045, "{fine} {expected}");
        assert!((extrapolated / expected - 1.0).abs() < 0.004, "{coarse} {fine} {extrapolated} {expected}");
    }
}

#[test]
fn uniaxial_tension_at_constant_volume_has_the_pressure_without_lateral_stress() {
    const MU: f64 = 3.0e3;
    for element_type in [ElementType::Tet4, ElementType::Hex8, ElementType::Wedge6, ElementType::Tet10] {
        for is_penalized in [false, true] {
            let mesh = Arc::new(shapes::cuboid_of(element_type, [2, 2, 2], [1.0, 0.5, 0.5]).unwrap());
            let surfaces = vec![
                prescribed("x0", [Some(0.0), None, None]),
                prescribed("y0", [None, Some(0.0), None]),
                prescribed("z0", [None, None, Some(0.0)]),
                prescribed("x1", [Some(0.6), None, None]),
            ];
            let constraint = if is_penalized { penalized(region("body")) } else { region("*") };
            let conditions = Conditions { surfaces, constraints: vec![constraint], ..Conditions::default() };
            let field = FormulaField::uniform(NeoHookean { mu: MU, lambda: 2.0 * MU }, &mesh);
            let params = StepParams { count: 3, ..StepParams::default() };
            let mut stepper = Stepper::<Sparse, _>::new(&(), mesh, &conditions, field, params).unwrap();
            for report in stepper.run(&mut ()).unwrap() {
                assert_eq!(report.augmentations > 0, is_penalized);
                let stretch = 1.0 + 0.6 * report.t;
                let r = &report.solves[0].relative;
                let [before, last] = [r[r.len() - 2], r[r.len() - 1]];
                assert!(last < 100.0 * before * before + 1e-12, "stretch {stretch}: {r:?}");
            }
            let stretch: f64 = 1.6;
            let pressure = MU * (1.0 / stretch - 1.0);
            let found = stepper.state().volumes[0];
            assert!((found.pressure / pressure - 1.0).abs() < 1e-7, "{found:?} {pressure}");
            assert!((found.volume / 0.25 - 1.0).abs() < 1e-8, "{found:?}");
            let traction = MU * (stretch - stretch.powi(-2));
            let forces = stepper.forces();
            let x1 = forces.surfaces.iter().find(|surface| surface.name == "x1").unwrap();
            assert!((x1.force[0] / (0.25 * traction) - 1.0).abs() < 1e-7, "{x1:?} {traction}");
        }
    }
}
