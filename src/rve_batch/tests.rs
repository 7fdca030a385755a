//! Batches against the equilibria of single RVEs: lanes with all instructions of the machine, and the kernels for
//! graphics processors, executed on the processor.

#[cfg(feature = "cuda")]
mod device_memory;

use std::ops::RangeInclusive;
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};

use nalgebra::Matrix3;

use super::*;
#[cfg(feature = "cuda")]
use crate::backends::cuda::networks::emulation::EmulatedDevice;
use crate::backends::networks::lanes::Level;
use crate::backends::sparse::Sparse;
use crate::fiber::batch::{BatchProgress, BatchSolver};
use crate::fiber::equilibrium::{Stages, converges_to, equilibrate};
use crate::fiber::law::FiberMaterial;
use crate::fiber::network::Network;
use crate::fiber::network::generate::{delaunay, voronoi};
use crate::fiber::rve::{Rve, Sensitivities, StressScale};
use crate::fiber::workspace::Workspace;
use crate::las::conformance::Random;

type Model = RveModel<Sparse>;

fn laws() -> [Law; 4] {
    let (youngs_modulus, nonlinearity) = (1.0e7, 1.2);
    let exponential = Law::Exponential { youngs_modulus, nonlinearity };
    [
        Law::Linear { youngs_modulus },
        exponential.clone(),
        Law::ExponentialStretch { youngs_modulus, nonlinearity, transition: 1.05 },
        exponential.with_buckling(0.1, 0.02),
    ]
}

fn model(law: Law, points: usize) -> Model {
    let network = Arc::new(delaunay(points, 7).unwrap());
    let material = FiberMaterial { law, radius: 3.5e-8, density: None };
    RveModel::new(&(), network, Some(material), StressScale::FiberVolumeFraction(0.01)).unwrap()
}

/// Returns all solvers of batches that this machine has, with their names.
fn solvers(model: &Model, predicts: bool) -> Vec<(String, Box<dyn BatchSolver>)> {
    let mut solvers: Vec<(String, Box<dyn BatchSolver>)> = Vec::new();
    for level in Level::all() {
        for (name, lanes) in batches_of(model, predicts, level) {
            solvers.push((name, Box::new(lanes)));
        }
    }
    #[cfg(feature = "cuda")]
    match DeviceBatch::emulated(model, predicts, EmulatedDevice::default()) {
        Some(batch) => solvers.push(("kernels".into(), Box::new(batch))),
        None => println!("skipped: there is no C++ compiler"),
    }
    solvers
}

/// Returns the batches with these instructions, in double precision and, if it has that, in mixed precision.
fn batches_of(model: &Model, predicts: bool, level: Level) -> Vec<(String, LaneBatch)> {
    let batch = || LaneBatch::with_level(model, predicts, level).unwrap();
    let mut batches = vec![(format!("{level:?}"), batch())];
    let mixed = batch().with_single_precision();
    if mixed.lanes().has_single_precision() {
        batches.push((format!("{level:?}, mixed"), mixed));
    }
    batches
}

/// Parameters with which factors serve up to this number of further steps, also those of small networks.
fn with_chords(chord_steps: usize) -> EquilibriumParams {
    EquilibriumParams { chord_steps: Some(chord_steps), ..EquilibriumParams::default() }
}

/// Deformation gradients within `size` of the identity.
fn gradients(count: usize, size: f64, random: &mut Random) -> Vec<Matrix3<f64>> {
    (0..count).map(|_| Matrix3::identity() + Matrix3::from_fn(|_, _| size * random.signed())).collect()
}

fn near(found: &[f64], expected: &[f64], tolerance: f64) {
    let size = expected.iter().fold(0.0, |size: f64, x| size.max(x.abs()));
    for (found, expected) in found.iter().zip(expected) {
        assert!((found - expected).abs() <= tolerance * size, "{found:e} instead of {expected:e}, of {size:e}");
    }
}

/// Solves for the same increments by each batch and one by one, with and without chord steps, and compares; returns how
/// many the batches left.
fn compare(model: &Model, predicts: bool, increments: &[Vec<Matrix3<f64>>]) -> usize {
    let mut left = Vec::new();
    for chords in [0, 2] {
        for (name, mut batch) in solvers(model, predicts) {
            println!("{name}, {chords} chord steps");
            // Steps with an earlier factor are no iterations. In mixed precision, their number is not limited, and there
            // may be one iteration more. The kernels have none of them.
            let iterations = |alone: usize| match (&name[..], chords) {
                ("kernels", _) => alone..=(1 + chords) * alone,
                (name, 0) if name.contains("mixed") => alone..=alone + 1,
                (name, _) if name.contains("mixed") => 0..=alone + 1,
                _ => alone..=alone,
            };
            left.push(compare_with(&mut *batch, model, predicts, increments, &with_chords(chords), &iterations));
        }
    }
    assert!(left.iter().all(|&of_batch| of_batch == left[0]), "{left:?}");
    left[0]
}

/// Counts the RVEs that are done, the groups that began, and those that did not end.
#[derive(Default)]
struct Counted {
    done: AtomicUsize,
    begun: AtomicUsize,
    open: AtomicUsize,
}

impl BatchProgress for Counted {
    fn begin(&self, _: usize) {
        self.begun.fetch_add(1, Ordering::Relaxed);
        self.open.fetch_add(1, Ordering::Relaxed);
    }

    fn end(&self, _: usize, done: usize) {
        self.open.fetch_sub(1, Ordering::Relaxed);
        self.done.fetch_add(done, Ordering::Relaxed);
    }
}

fn compare_with(
    batch: &mut dyn BatchSolver,
    model: &Model,
    predicts: bool,
    increments: &[Vec<Matrix3<f64>>],
    params: &EquilibriumParams,
    iterations: &dyn Fn(usize) -> RangeInclusive<usize>,
) -> usize {
    let count = increments[0].len();
    let mut workspace = Workspace::new(&(), model).unwrap();
    let mut of_batch = vec![Rve::at_rest(model.network()); count];
    let mut alone = of_batch.clone();
    let mut left = 0;
    for targets in increments {
        let mut all: Vec<&mut Rve> = of_batch.iter_mut().collect();
        let progress = Counted::default();
        let solved = batch.solve(&mut all, targets, params, &progress).unwrap();
        assert_eq!(progress.done.into_inner(), solved.iter().flatten().count());
        assert_eq!(progress.open.into_inner(), 0, "groups that did not end");
        for (number, (rve, found)) in alone.iter_mut().zip(&solved).enumerate() {
            let before = rve.clone();
            let expected = equilibrate(model, rve, &targets[number], params, &mut workspace);
            let Some(found) = found else {
                let by_newton_alone = expected.as_ref().is_ok_and(|found| {
                    let report = found.report();
                    let is_definite = report.indefinite == 0 && !report.neutral;
                    report.stage == Some(Stage::Newton) && is_definite && report.iterations <= 30
                });
                let needs_more = !by_newton_alone;
                assert!(needs_more, "network {number} was left at {}", targets[number]);
                left += 1;
                drop(expected);
                assert_eq!(of_batch[number], before, "the state of a network that was left is unchanged");
                of_batch[number] = rve.clone();
                continue;
            };
            let mut expected = expected.unwrap();
            let possible = iterations(expected.report().iterations);
            assert!(possible.contains(&found.iterations), "{} of {possible:?}", found.iterations);
            assert_eq!(found.backtracks, expected.report().backtracks);
            near(found.pk1.as_slice(), expected.pk1().as_slice(), 1e-9);
            near(&[found.energy], &[expected.energy()], 1e-9);
            near(found.tangent.as_slice(), expected.tangent().unwrap().as_slice(), 1e-9);
            if predicts {
                expected.keep_sensitivities().unwrap();
            }
            drop(expected);
            let found = &of_batch[number];
            assert_eq!(found.gradient(), rve.gradient());
            near(found.interior().as_flattened(), rve.interior().as_flattened(), 1e-9);
            assert_eq!(found.sensitivities().is_some(), predicts);
            if let (Some(found), Some(expected)) = (found.sensitivities(), rve.sensitivities()) {
                let double = |of: &[Sensitivities]| of.as_flattened().iter().map(|&x| f64::from(x)).collect::<Vec<_>>();
                near(&double(found), &double(expected), 1e-5);
            }
            // Both continue from the same state.
            of_batch[number] = rve.clone();
        }
    }
    left
}

#[test]
fn batches_give_the_results_of_single_rves_with_every_law() {
    for law in laws() {
        for predicts in [false, true] {
            let mut random = Random::new(3);
            let increments = [gradients(40, 0.05, &mut random), gradients(40, 0.06, &mut random)];
            let left = compare(&model(law.clone(), 40), predicts, &increments);
            assert!(left < 20, "{left} of 80 were left with {law:?}");
        }
    }
}

#[test]
fn a_batch_leaves_what_needs_more_than_newton() {
    let law = Law::Exponential { youngs_modulus: 1.0e7, nonlinearity: 1.2 };
    let crushed = Matrix3::from_diagonal_element(0.4);
    let left = compare(&model(law, 30), true, &[vec![crushed; 3]]);
    assert_eq!(left, 3);
}

#[test]
fn a_test_of_continuation_is_that_of_single_rves() {
    let model = model(Law::Exponential { youngs_modulus: 1.0e7, nonlinearity: 1.2 }, 40);
    let params = EquilibriumParams::default();
    let mut workspace = Workspace::new(&(), &model).unwrap();
    let mut random = Random::new(5);
    let mut reached = Vec::new();
    for (number, target) in gradients(40, 0.12, &mut random).iter().enumerate() {
        let mut rve = Rve::at_rest(model.network());
        equilibrate(&model, &mut rve, target, &params, &mut workspace).unwrap();
        if number % 4 == 0 {
            // Not an equilibrium to which Newton leads.
            let mut interior = rve.interior().to_vec();
            interior[0][1] += 0.05;
            rve = Rve::restored(*target, interior, None);
        }
        reached.push(rve);
    }
    let rest = Rve::at_rest(model.network());
    for (name, mut batch) in solvers(&model, true) {
        let found = batch.converge_to(&vec![&rest; 40], &reached.iter().collect::<Vec<_>>(), &params).unwrap();
        let mut count = 0;
        for (rve, found) in reached.iter().zip(found) {
            assert_eq!(found, converges_to(&model, &rest, rve, &params.newton, &mut workspace), "{name}");
            count += usize::from(found);
        }
        assert!((20..=30).contains(&count), "{name}: {count}");
    }
}

#[test]
fn networks_of_any_shape_fit_a_batch() {
    // Floppy networks at rest have no positive definite stiffness; networks of a few nodes have hardly any interior.
    let material = |law| FiberMaterial { law, radius: 3.5e-8, density: None };
    let law = Law::Linear { youngs_modulus: 1.0e7 };
    for network in [voronoi(12, 1).unwrap(), delaunay(5, 2).unwrap()] {
        let scale = StressScale::Raw;
        let model = RveModel::new(&(), Arc::new(network), Some(material(law.clone())), scale).unwrap();
        let mut random = Random::new(8);
        compare(&model, false, &[gradients(10, 0.3, &mut random)]);
    }
}

/// Returns a network some of whose boundary nodes have several fibers, parallel ones too, or fibers to other boundary
/// nodes.
fn tangled() -> Network {
    let plain = delaunay(20, 7).unwrap();
    let is_boundary = |node: u32| plain.boundary().contains(&node);
    let (interior, boundary) = (plain.interior(), plain.boundary());
    let mut fibers = plain.fibers().to_vec();
    let ends = fibers.iter().copied().filter(|ends| ends.iter().filter(|&&node| is_boundary(node)).count() == 1);
    let parallel: Vec<[u32; 2]> = ends.step_by(5).flat_map(|[a, b]| [[b, a], [a, b]]).collect();
    fibers.extend(parallel);
    let inner = fibers.iter().copied().find(|ends| !ends.iter().any(|&node| is_boundary(node)));
    fibers.extend(inner);
    fibers.extend((0..4).map(|k| [boundary[3 * k], interior[5 * k]]));
    fibers.extend([[boundary[1], boundary[20]], [boundary[20], boundary[1]], [boundary[4], boundary[30]]]);
    Network::new("tangled", plain.nodes().to_vec(), fibers).unwrap()
}

#[test]
fn fibers_between_any_nodes_fit_a_batch() {
    for law in laws() {
        let material = FiberMaterial { law, radius: 3.5e-8, density: None };
        let model = RveModel::new(&(), Arc::new(tangled()), Some(material), StressScale::Raw).unwrap();
        let mut random = Random::new(3);
        let increments = [gradients(9, 0.03, &mut random), gradients(9, 0.05, &mut random)];
        assert!(compare(&model, true, &increments) < 9, "most are solved by the batch");
    }
}

/// Networks of this size have chord steps if nothing else is asked for: one by one and in lanes the same ones.
#[test]
fn chord_steps_are_those_of_single_rves() {
    let law = Law::Exponential { youngs_modulus: 1.0e7, nonlinearity: 1.2 };
    let model = model(law, 100);
    assert!(model.unknowns() >= 256);
    let params = EquilibriumParams::default();
    let mut random = Random::new(9);
    let increments = [gradients(9, 0.05, &mut random), gradients(9, 0.06, &mut random)];
    let mut workspace = Workspace::new(&(), &model).unwrap();
    let mut rve = Rve::at_rest(model.network());
    let report =
        equilibrate(&model, &mut rve, &increments[0][0], &params, &mut workspace).unwrap().report().newton.clone();
    assert!(report.kept > 0, "{report:?}");
    for level in Level::all() {
        let (name, mut batch) = batches_of(&model, true, level).remove(0);
        println!("{name}");
        let left = compare_with(&mut batch, &model, true, &increments, &params, &|alone| alone..=alone);
        assert!(left < 9, "{left} of 18 were left");
    }
}

/// The chord steps of the last iteration that is allowed belong to it, one by one and in lanes.
#[test]
fn the_last_iteration_has_its_chord_steps() {
    let model = model(Law::Exponential { youngs_modulus: 1.0e7, nonlinearity: 1.2 }, 60);
    let mut params = with_chords(3);
    let targets = gradients(16, 0.05, &mut Random::new(4));
    let mut workspace = Workspace::new(&(), &model).unwrap();
    for most in 1..4 {
        params.newton.max_iterations = most;
        params.stages = Stages::of(&[Stage::Newton]);
        for level in Level::all() {
            let (name, batch) = batches_of(&model, false, level).remove(0);
            let mut rves = vec![Rve::at_rest(model.network()); targets.len()];
            let solved = batch.solve(&mut rves.iter_mut().collect::<Vec<_>>(), &targets, &params);
            for (target, solved) in targets.iter().zip(solved) {
                let mut alone = Rve::at_rest(model.network());
                let alone = equilibrate(&model, &mut alone, target, &params, &mut workspace);
                assert_eq!(solved.is_some(), alone.is_ok(), "{name}, {most} iterations to {target}");
            }
        }
    }
}

#[test]
fn large_networks_are_solved_one_by_one() {
    let law = Law::Linear { youngs_modulus: 1.0e7 };
    let has_vectors = Level::all().pop().is_some_and(Level::has_vectors);
    assert_eq!(LaneBatch::new_if_faster(&model(law.clone(), 60), true).is_some(), has_vectors);
    assert!(LaneBatch::new_if_faster(&model(law, 1500), true).is_none());
}

/// With factors that serve several steps, fewer are needed.
#[test]
fn chords_replace_factors() {
    let model = model(Law::Exponential { youngs_modulus: 1.0e7, nonlinearity: 1.2 }, 60);
    let targets = gradients(24, 0.05, &mut Random::new(4));
    for (name, batch) in Level::all().into_iter().flat_map(|level| batches_of(&model, true, level)) {
        let iterations = |chords: usize| -> usize {
            let mut rves = vec![Rve::at_rest(model.network()); targets.len()];
            let mut rves: Vec<&mut Rve> = rves.iter_mut().collect();
            let solved = batch.solve(&mut rves, &targets, &with_chords(chords));
            solved.iter().flatten().map(|solved| solved.iterations).sum()
        };
        let (new, reused) = (iterations(0), iterations(2));
        assert!(reused > 0 && 4 * reused <= 3 * new, "{name}: {reused} of {new}");
    }
}

/// Returns the batches with these instructions, with and without chord steps.
fn cases_of(model: &Model, levels: &[Level]) -> Vec<(String, LaneBatch, EquilibriumParams)> {
    let with = |chords: usize| {
        let batches = levels.iter().flat_map(|&level| batches_of(model, true, level));
        batches.map(move |(name, batch)| (format!("{name}, {chords} chord steps"), batch, with_chords(chords)))
    };
    with(0).chain(with(2)).collect()
}

/// RVEs that pause, and go on beside others, have the results of a group of their own, which has no pause. Some of them
/// pause at a step that their line search then rejects.
#[test]
fn a_pause_changes_no_bit() {
    let model = model(Law::Exponential { youngs_modulus: 1.0e7, nonlinearity: 1.2 }, 60);
    let targets = gradients(64, 0.3, &mut Random::new(5));
    let solve = |batch: &LaneBatch, params: &EquilibriumParams, rves: &mut [Rve], targets: &[Matrix3<f64>]| {
        let progress = Counted::default();
        let mut rves: Vec<&mut Rve> = rves.iter_mut().collect();
        let solved = batch.solve_with_progress(&mut rves, targets, params, &progress).into_iter();
        let result =
            |found: BatchEquilibrium| (found.pk1, found.energy, found.tangent, found.iterations, found.backtracks);
        (solved.map(|solved| solved.map(result)).collect::<Vec<_>>(), progress.begun.into_inner())
    };
    for (name, batch, params) in cases_of(&model, &Level::all()) {
        let mut rves = vec![Rve::at_rest(model.network()); targets.len()];
        let (solved, groups) = solve(&batch, &params, &mut rves, &targets);
        let least = targets.len().div_ceil(batch.lanes().lanes());
        assert!(groups > least, "{name}: {groups} groups");
        assert!(solved.iter().flatten().count() > 32, "{name}: most have an equilibrium");
        assert!(solved.contains(&None), "{name}: some leave");
        for (number, target) in targets.iter().enumerate() {
            let mut rve = [Rve::at_rest(model.network())];
            let alone = solve(&batch, &params, &mut rve, &[*target]);
            assert!(alone == (vec![solved[number]], 1) && rve[0] == rves[number], "{name}, {number}");
        }
    }
}

/// The result of an RVE is the same beside any others, with any number of threads, and with any fused instructions.
#[test]
fn lanes_do_not_depend_on_their_neighbors() {
    let model = model(Law::Exponential { youngs_modulus: 1.0e7, nonlinearity: 5.0 }, 60);
    let mut random = Random::new(11);
    let count = 37;
    let targets = gradients(count, 0.15, &mut random);
    let solve = |batch: &LaneBatch, params: &EquilibriumParams, order: &[usize]| {
        let mut rves = vec![Rve::at_rest(model.network()); count];
        let mut by_order: Vec<Option<&mut Rve>> = rves.iter_mut().map(Some).collect();
        let mut chosen: Vec<&mut Rve> = order.iter().map(|&k| by_order[k].take().unwrap()).collect();
        let of_order: Vec<Matrix3<f64>> = order.iter().map(|&k| targets[k]).collect();
        let solved = batch.solve(&mut chosen, &of_order, params);
        let mut results = vec![None; count];
        for (&k, solved) in order.iter().zip(solved) {
            results[k] = solved.map(|solved| (solved.pk1, solved.energy, solved.tangent, solved.iterations));
        }
        (results, rves)
    };
    let ascending: Vec<usize> = (0..count).collect();
    for (name, batch, params) in cases_of(&model, &Level::all()) {
        let expected = solve(&batch, &params, &ascending);
        assert!(expected.0.iter().flatten().count() > 20, "most have an equilibrium");
        assert!(expected.0.iter().flatten().any(|solved| solved.3 > expected.0[0].unwrap().3), "iterations differ");
        let mut order = ascending.clone();
        for _ in 0..3 {
            (1..count).rev().for_each(|k| order.swap(k, (random.signed().abs() * (k + 1) as f64) as usize % (k + 1)));
            let pool = rayon::ThreadPoolBuilder::new().num_threads(3).build().unwrap();
            assert!(pool.install(|| solve(&batch, &params, &order)) == expected, "{name}");
        }
    }
    #[cfg(target_arch = "x86_64")]
    if let [.., Level::Avx2(_), Level::Avx512(_)] = Level::all()[..] {
        let [.., four, eight] = Level::all()[..] else { return };
        let double = |level| cases_of(&model, &[level]).into_iter().filter(|(name, ..)| !name.contains("mixed"));
        for ((name, four, params), (_, eight, _)) in double(four).zip(double(eight)) {
            let [four, eight] = [four, eight].map(|batch| solve(&batch, &params, &ascending));
            assert!(four == eight, "{name}: the lanes have other bits");
        }
    }
}
