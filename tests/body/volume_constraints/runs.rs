//! Runs with constraints: methods, cut steps, saved states, forces.

use std::sync::Arc;

use biotissue::backends::sparse::Sparse;
use biotissue::fem::boundary::{Conditions, LoadCurve, Pressure, SurfaceCondition};
use biotissue::fem::element::ElementType;
use biotissue::fem::equilibrium::EquilibriumError;
use biotissue::fem::material::{LinearElastic, Material, NeoHookean};
use biotissue::fem::mesh::{Mesh, shapes};
use biotissue::fem::point_field::FormulaField;
use biotissue::fem::stepping::{RestoreError, StepParams, StepStart, Stepper, SteppingError};
use biotissue::las::NewtonError;

use super::hollow_box::hollow_box;
use super::{cavity, driven, penalized, region, sheared};

type Run = Stepper<Sparse, FormulaField>;

fn started(mesh: Mesh, conditions: &Conditions, params: StepParams) -> Run {
    let field = FormulaField::uniform(NeoHookean { mu: 3.0e3, lambda: 5.0e3 }, &mesh);
    Stepper::new(&(), Arc::new(mesh), conditions, field, params).unwrap()
}

fn steps(count: usize) -> StepParams {
    StepParams { count, ..StepParams::default() }
}

/// The wall of the cavity as one constraint, driven to 1.2 of its volume.
fn inflated() -> biotissue::fem::constraint::VolumeConstraint {
    driven(cavity(&["floor", "walls"]), &[[0.0, 1.0], [1.0, 1.2]])
}

fn assert_near(one: &Run, other: &Run, tolerance: f64) {
    let (one, other) = (one.state(), other.state());
    let largest = one.displacements.as_flattened().iter().fold(0.0, |most: f64, u| most.max(u.abs()));
    for (u, v) in one.displacements.as_flattened().iter().zip(other.displacements.as_flattened()) {
        assert!((u - v).abs() < tolerance * largest, "{u} {v}");
    }
    for (a, b) in one.volumes.iter().zip(&other.volumes) {
        assert!((a.pressure - b.pressure).abs() < tolerance * a.pressure.abs(), "{a:?} {b:?}");
        assert!((a.volume / b.volume - 1.0).abs() < 1e-7 && a.target == b.target, "{a:?} {b:?}");
    }
}

#[test]
fn multiplier_and_penalty_agree_with_two_constraints_and_in_any_mixture() {
    let run = |constraints| {
        let mut run = started(hollow_box(ElementType::Wedge6), &sheared(constraints), steps(2));
        let reports = run.run(&mut ()).unwrap();
        (run, reports.iter().map(|report| report.augmentations).sum::<usize>())
    };
    let (exact, none) = run(vec![region("body"), inflated()]);
    assert_eq!(none, 0);
    assert!(exact.state().volumes.iter().all(|state| (state.volume / state.target - 1.0).abs() < 1e-9));
    assert!(exact.state().volumes.iter().all(|state| state.pressure.abs() > 10.0), "{:?}", exact.state().volumes);
    let (mixed, some) = run(vec![region("body"), penalized(inflated())]);
    assert!((2..=12).contains(&some), "{some} augmentations");
    let (penalty, _) = run(vec![penalized(region("body")), penalized(inflated())]);
    assert_near(&exact, &mixed, 1e-6);
    assert_near(&exact, &penalty, 1e-6);
}

/// A shift by a power of two is exact, so that the body does not change at all, wherever it is.
#[test]
fn volumes_do_not_depend_on_the_distance_from_the_origin() {
    let at = |shift: f64| {
        let mesh = hollow_box(ElementType::Hex8);
        let nodes = mesh.nodes().iter().map(|x| [x[0] + shift, x[1], x[2] - shift]).collect();
        let (elements, regions) = (mesh.elements().clone(), mesh.regions().to_vec());
        let mesh = Mesh::new(nodes, elements, mesh.region_of().to_vec(), regions, mesh.surfaces().to_vec()).unwrap();
        let mut params = steps(2);
        params.newton.tolerance = 1e-12;
        let mut run = started(mesh, &sheared(vec![inflated()]), params);
        run.run(&mut ()).unwrap_or_else(|error| panic!("{shift}: {error}"));
        run.state().clone()
    };
    assert_eq!(at(0.0), at(1048576.0));
}

/// The forces of a soft region are small beside those of a stiff one, which is linear and in equilibrium after one
/// iteration; the volume of the soft one still reaches its target.
#[test]
fn the_volume_of_a_soft_region_is_as_exact_as_that_of_a_stiff_one() {
    let mesh = shapes::cuboid_of(ElementType::Hex8, [4, 2, 2], [2.0, 1.0, 1.0]).unwrap();
    let region_of = (0..mesh.elements().len()).map(|element| u32::from(mesh.center(element)[0] > 1.0)).collect();
    let (nodes, elements, surfaces) = (mesh.nodes().to_vec(), mesh.elements().clone(), mesh.surfaces().to_vec());
    let mesh = Mesh::new(nodes, elements, region_of, vec!["soft".into(), "stiff".into()], surfaces).unwrap();
    let materials: Vec<Box<dyn Material>> =
        vec![Box::new(NeoHookean { mu: 3.0e3, lambda: 5.0e3 }), Box::new(LinearElastic { mu: 3.0e9, lambda: 5.0e9 })];
    let field = FormulaField::new(materials, &mesh).unwrap();
    // The ends of the stiff region are pulled apart.
    let mut conditions = sheared(vec![driven(region("soft"), &[[0.0, 1.0], [1.0, 1.1]])]);
    conditions.surfaces[0].surface = "y0".into();
    conditions.surfaces[1] = SurfaceCondition {
        surface: "y1".into(),
        displacement: [Some(0.1), Some(0.3), Some(0.0)],
        curve: LoadCurve::Ramp,
    };
    let mut params = steps(1);
    params.newton.tolerance = 1e-6;
    let mut run = Stepper::<Sparse, _>::new(&(), Arc::new(mesh), &conditions, field, params).unwrap();
    run.run(&mut ()).unwrap();
    let state = &run.state().volumes[0];
    assert!((state.volume / state.target - 1.0).abs() < 1e-6, "{state:?}");
}

#[test]
fn cut_steps_reach_the_state_of_uncut_ones() {
    for constraints in [vec![region("*"), inflated()], vec![region("*"), penalized(inflated())]] {
        let conditions = sheared(constraints);
        let mut whole = started(hollow_box(ElementType::Hex8), &conditions, steps(2));
        whole.run(&mut ()).unwrap();
        for start in [StepStart::Tangent, StepStart::Prescribed] {
            let mut params = StepParams { count: 1, start, ..StepParams::default() };
            params.newton.max_iterations = 2;
            let mut cut = started(hollow_box(ElementType::Hex8), &conditions, params);
            let report = cut.step(&mut ()).unwrap();
            assert!(report.cuts > 0, "{report:?}");
            assert_near(&whole, &cut, 1e-6);
        }
    }
}

#[test]
fn a_restored_run_continues_bit_for_bit() {
    let conditions = sheared(vec![region("body"), penalized(inflated())]);
    let mesh = || hollow_box(ElementType::Hex8).with_patches(|_| true);
    let mut whole = started(mesh(), &conditions, steps(4));
    whole.step(&mut ()).unwrap();
    whole.step(&mut ()).unwrap();
    let (saved, displacements) = (whole.saved().unwrap(), whole.state().displacements.clone());
    let mut restored = started(mesh(), &conditions, steps(4));
    restored.restore(&saved, &displacements, |_| Ok::<(), &str>(())).unwrap();
    assert_eq!(restored.state(), whole.state());
    whole.run(&mut ()).unwrap();
    restored.run(&mut ()).unwrap();
    assert_eq!(restored.state(), whole.state());
    assert_eq!(restored.forces(), whole.forces());

    let mut one_less = saved.clone();
    one_less.pressures.pop();
    let refused = restored.restore(&one_less, &displacements, |_| Ok::<(), &str>(())).unwrap_err();
    assert_eq!(refused, RestoreError::Constraints { found: 1, expected: 2 });
    let mut infinite = saved;
    infinite.pressures[1][0] = f64::INFINITY;
    let refused = restored.restore(&infinite, &displacements, |_| Ok::<(), &str>(())).unwrap_err();
    assert_eq!(refused, RestoreError::PressureNotFinite(1));
}

#[test]
fn the_pressure_in_a_cavity_adds_to_a_follower_pressure_on_its_wall() {
    let run = |pressure: f64| {
        let mut conditions = sheared(vec![inflated()]);
        for surface in ["floor", "walls"] {
            let load = Pressure { surface: surface.into(), value: pressure, curve: LoadCurve::Ramp };
            conditions.loads.push(Arc::new(load));
        }
        let mut run = started(hollow_box(ElementType::Hex8), &conditions, steps(2));
        run.run(&mut ()).unwrap();
        run
    };
    let (without, with) = (run(0.0), run(500.0));
    let [p, q] = [&without, &with].map(|run| run.state().volumes[0].pressure);
    assert!((p - q - 500.0).abs() < 1e-5 * p.abs(), "{p} {q}");
    for (one, other) in without.forces().surfaces.iter().zip(&with.forces().surfaces) {
        for (f, g) in one.force.iter().zip(other.force) {
            assert!((f - g).abs() < 1e-6 * p, "{one:?} {other:?}");
        }
    }
}

#[test]
fn forces_of_the_pressures_belong_to_surfaces_and_reactions_and_sum_to_zero() {
    // The floor of the cavity is held, so that it has reactions and pressure.
    let mut conditions = sheared(vec![inflated(), region("*")]);
    conditions.surfaces[1] = SurfaceCondition {
        surface: "floor".into(),
        displacement: [Some(0.1), None, Some(0.1)],
        curve: LoadCurve::Ramp,
    };
    let mut run = started(hollow_box(ElementType::Hex8), &conditions, steps(2));
    run.run(&mut ()).unwrap();
    let forces = run.forces();
    let named = |name: &str| forces.surfaces.iter().find(|surface| surface.name == name).unwrap();
    let largest = named("x0").force.iter().fold(0.0, |most: f64, f| most.max(f.abs()));
    assert!(largest > 100.0 && forces.sum().iter().all(|sum| sum.abs() < 1e-6 * largest), "{forces:?}");
    // The walls are free: their force is that of the pressure alone.
    let pressure = run.state().volumes[0].pressure;
    let [_, _, up] = named("walls").force;
    assert!(pressure > 0.0 && up > 0.8 * pressure && up < 1.3 * pressure, "{up} {pressure}");
}

#[test]
fn increments_end_at_the_break_points_of_targets() {
    let constraint = driven(cavity(&["floor", "walls"]), &[[0.0, 1.0], [0.3, 1.1], [1.0, 1.1]]);
    let mut conditions = sheared(vec![constraint]);
    conditions.surfaces.truncate(1);
    let mut run = started(hollow_box(ElementType::Hex8), &conditions, steps(1));
    let report = run.step(&mut ()).unwrap();
    assert_eq!(report.increments, 2);
    let state = run.state().volumes[0];
    assert!((state.target - 1.1).abs() < 1e-12 && (state.volume - 1.1).abs() < 1e-9, "{state:?}");
}

#[test]
fn augmentation_that_does_not_reach_the_target_is_an_error_that_leaves_the_last_state() {
    let params = StepParams { max_augmentations: 1, max_cuts: 1, ..steps(1) };
    let mut run = started(hollow_box(ElementType::Hex8), &sheared(vec![penalized(inflated())]), params);
    let before = run.state().clone();
    let error = run.step(&mut ()).unwrap_err();
    let SteppingError::NotConverged { reason: NewtonError::Problem(reason), .. } = error else { panic!("{error}") };
    assert!(matches!(reason, EquilibriumError::VolumeNotReached { rounds: 1, .. }), "{reason}");
    assert_eq!(run.state(), &before);
}
