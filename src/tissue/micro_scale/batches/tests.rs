//! Fields whose RVEs are solved in batches, in lanes or by kernels that run on the processor, against fields without.

use std::path::Path;
use std::sync::{Arc, mpsc};

use nalgebra::Matrix3;

use crate::backends::sparse::Sparse;
use crate::fem::mesh::shapes::cuboid;
use crate::fem::point_field::{PointField, PointResponses};
use crate::fiber::batch::{BatchEquilibrium, BatchProgress, BatchSolver};
use crate::fiber::equilibrium::{EquilibriumParams, Stage};
use crate::fiber::rve::{Rve, RveModel, StressScale};
use crate::las::conformance::Random;
use crate::rve_batch::LaneBatch;
use crate::tissue::materials::{
    FiberRve, LaneUse, Materials, NetworkAssignment, Region, RegionMaterial, RveLifecycle, RveParams,
};
use crate::tissue::micro_scale::{Activity, RveProgress, TissueField, TissueFieldError, TissueMaterial};

const ELEMENTS: usize = 48;

/// Returns the material of a body with a network in each of its elements.
fn field(predictor: bool) -> TissueField<Sparse> {
    let network = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/networks/frozen.txt");
    let rve = FiberRve {
        networks: vec![network],
        assignment: NetworkAssignment::Cycle,
        seed: 0,
        scale: StressScale::Raw.into(),
        law: None,
        matrix: None,
        lifecycle: RveLifecycle::default(),
    };
    let region = Region { name: "*".into(), material: RegionMaterial::FiberRve(rve) };
    let materials =
        Materials { regions: vec![region], rve: RveParams { predictor, lanes: LaneUse::Off, ..RveParams::default() } };
    TissueField::new((), materials, &cuboid([2, 2, 2], [1.0; 3]).unwrap()).unwrap().0
}

fn responses(out: &PointResponses) -> Vec<f64> {
    out.pk1.iter().flat_map(|pk1| pk1.as_slice().to_vec()).collect()
}

fn gradients(size: f64, seed: u64) -> Vec<Matrix3<f64>> {
    let mut random = Random::new(seed);
    (0..ELEMENTS).map(|_| Matrix3::identity() + Matrix3::from_fn(|_, _| size * random.signed())).collect()
}

type Make = fn(&RveModel<Sparse>, bool) -> Option<Box<dyn BatchSolver>>;

#[test]
fn fields_with_lanes_agree_with_those_without_through_load_steps() {
    compare(
        |model, predictor| {
            let batch = LaneBatch::new(model, predictor)?;
            Some(Box::new(batch))
        },
        0,
    );
}

#[test]
fn fields_in_mixed_precision_agree_with_those_without_lanes() {
    compare(|model, predictor| Some(Box::new(LaneBatch::new(model, predictor)?.with_single_precision())), 2);
}

#[cfg(feature = "cuda")]
#[test]
fn fields_with_kernels_agree_with_those_without_through_load_steps() {
    use crate::backends::cuda::networks::emulation::EmulatedDevice;
    use crate::rve_batch::DeviceBatch;

    compare(
        |model, predictor| {
            let batch = DeviceBatch::emulated(model, predictor, EmulatedDevice::default());
            if batch.is_none() {
                println!("skipped: there is no C++ compiler");
            }
            Some(Box::new(batch?))
        },
        0,
    );
}

/// Compares a field with batches that `make` returns, if it returns any, with one without. In a step, their numbers of
/// iterations may differ by `other`.
fn compare(make: Make, other: usize) {
    for predictor in [false, true] {
        let (mut alone, mut batched) = (field(predictor), field(predictor));
        let mut has_batches = true;
        batched
            .solve_in_batches(|model| {
                let batch = make(model, predictor);
                has_batches &= batch.is_some();
                Ok::<_, ()>(batch)
            })
            .unwrap();
        if !has_batches {
            return;
        }
        let (mut of_alone, mut of_batched) = (PointResponses::default(), PointResponses::default());
        for (step, is_kept) in [true, false, true, true].into_iter().enumerate() {
            for iteration in 0..3 {
                let targets = gradients(0.02 * (step as f64 + 1.0), 7 * step as u64 + iteration);
                alone.update(&targets, &mut of_alone).unwrap();
                batched.update(&targets, &mut of_batched).unwrap();
                let (found, expected) = (responses(&of_batched), responses(&of_alone));
                let size = expected.iter().fold(0.0_f64, |size, x| size.max(x.abs()));
                for (found, expected) in found.iter().zip(&expected) {
                    assert!((found - expected).abs() <= 1e-9 * size, "{found:e} instead of {expected:e}");
                }
            }
            let converged = gradients(0.02 * (step as f64 + 1.0), 7 * step as u64 + 2);
            let replaced = alone.verify(&converged, &mut of_alone).unwrap();
            assert_eq!(batched.verify(&converged, &mut of_batched).unwrap(), replaced);
            let (found, expected) = (batched.take_stats(), alone.take_stats());
            assert_eq!(found.solves, expected.solves);
            let (found_iterations, iterations) = (found.iterations, expected.iterations);
            assert!(found_iterations.abs_diff(iterations) <= other, "{found_iterations} instead of {iterations}");
            assert_eq!((found.verified, found.replaced), (expected.verified, expected.replaced));
            assert_eq!((found.predicted, found.reused), (expected.predicted, expected.reused));
            assert!(found.in_batches > ELEMENTS && expected.in_batches == 0, "{}", found.in_batches);
            for field in [&mut alone, &mut batched] {
                if is_kept { field.commit(true).unwrap() } else { field.revert().unwrap() }
            }
        }
    }
}

/// A solver that reports the gradients of its RVEs, in their order, and leaves all of them.
struct Reporting(mpsc::Sender<Vec<Matrix3<f64>>>);

impl BatchSolver for Reporting {
    fn solve(
        &mut self,
        _: &mut [&mut Rve],
        targets: &[Matrix3<f64>],
        _: &EquilibriumParams,
        _: &dyn BatchProgress,
    ) -> Result<Vec<Option<BatchEquilibrium>>, String> {
        self.0.send(targets.to_vec()).unwrap();
        Ok(vec![None; targets.len()])
    }

    fn converge_to(&mut self, from: &[&Rve], _: &[&Rve], _: &EquilibriumParams) -> Result<Vec<bool>, String> {
        Ok(vec![false; from.len()])
    }
}

/// The expected iterations order the RVEs of a batch, and the expected seconds those that are solved one by one.
#[test]
fn the_longest_rves_come_first() {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(2).build().unwrap();
    pool.install(|| {
        let mut field = field(true);
        let (sender, reports) = mpsc::channel();
        let reporting = move |_: &_| Some(Box::new(Reporting(sender.clone())) as Box<dyn BatchSolver>);
        field.solve_in_batches(|model| Ok::<_, ()>(reporting(model))).unwrap();
        let targets = [1, 2].map(|seed| gradients(0.01, seed));
        field.update(&targets[0], &mut PointResponses::default()).unwrap();
        assert!(reports.recv().unwrap() == targets[0], "all RVEs are new");
        for (number, history) in field.units.histories.iter_mut().enumerate() {
            history.smooth_iterations = (7 * number % ELEMENTS) as f64;
            history.seconds = 1e-3 * (1 + 11 * number % ELEMENTS) as f64;
            history.smooth_seconds = history.seconds.ln();
        }
        field.units.histories[5].sweeps = 0;
        let mut by_seconds: Vec<usize> = (0..ELEMENTS).filter(|&number| number != 5).collect();
        by_seconds.sort_by_key(|&number| std::cmp::Reverse(11 * number % ELEMENTS));
        by_seconds.insert(0, 5);
        assert_eq!(field.units.expected_order().longest_first(), by_seconds);
        field.update(&targets[1], &mut PointResponses::default()).unwrap();
        let mut by_iterations: Vec<usize> = (0..ELEMENTS).filter(|&number| number != 5).collect();
        by_iterations.sort_by_key(|&number| std::cmp::Reverse(7 * number % ELEMENTS));
        by_iterations.insert(0, 5);
        let expected: Vec<Matrix3<f64>> = by_iterations.into_iter().map(|number| targets[1][number]).collect();
        assert!(reports.recv().unwrap() == expected);
    });
}

/// Groups of lanes hold other RVEs in another order, and the last group is not full.
#[test]
fn lanes_give_the_same_bits_in_any_order() {
    let in_precision = |batch: LaneBatch, mixed| if mixed { batch.with_single_precision() } else { batch };
    let solved = |mixed, threads, expect: fn(usize) -> usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| {
            let mut field = field(true);
            let lanes = |model: &_| LaneBatch::new(model, true).map(|batch| in_precision(batch, mixed));
            let lanes = |model: &_| lanes(model).map(|batch| Box::new(batch) as Box<dyn BatchSolver>);
            field.solve_in_batches(|model| Ok::<_, ()>(lanes(model))).unwrap();
            let (mut out, mut all, mut targets) = (PointResponses::default(), Vec::new(), gradients(0.02, 1));
            for seed in 2..5 {
                for (number, history) in field.units.histories.iter_mut().enumerate() {
                    history.smooth_iterations = expect(number) as f64;
                }
                field.update(&targets, &mut out).unwrap();
                all.push(out.clone());
                let next = gradients(0.02 * seed as f64, seed);
                targets[..ELEMENTS - 5].copy_from_slice(&next[..ELEMENTS - 5]);
            }
            let in_batches = field.take_stats().in_batches;
            let fibers = field.units.units.iter().filter_map(|unit| unit.fibers.as_ref());
            let positions: Vec<_> = fibers.map(|fibers| fibers.current.interior().to_vec()).collect();
            (all, positions, in_batches)
        })
    };
    for mixed in [false, true] {
        let expected = solved(mixed, 1, |_| 0);
        for threads in [1, 3] {
            let expects: [fn(usize) -> usize; 2] = [|number| 7 * number % ELEMENTS, |number| number];
            for expect in expects {
                assert!(solved(mixed, threads, expect) == expected, "{threads} threads");
            }
        }
    }
}

/// A solver whose device fails.
struct Broken;

impl BatchSolver for Broken {
    fn solve(
        &mut self,
        _: &mut [&mut Rve],
        _: &[Matrix3<f64>],
        _: &EquilibriumParams,
        _: &dyn BatchProgress,
    ) -> Result<Vec<Option<BatchEquilibrium>>, String> {
        Err("the device fell off the bus".into())
    }

    fn converge_to(&mut self, _: &[&Rve], _: &[&Rve], _: &EquilibriumParams) -> Result<Vec<bool>, String> {
        Err("the device fell off the bus".into())
    }
}

/// A solver that reports three RVEs as done before it leaves all of them.
struct Leaving(Arc<Activity>, mpsc::Sender<Option<RveProgress>>);

impl BatchSolver for Leaving {
    fn solve(
        &mut self,
        rves: &mut [&mut Rve],
        _: &[Matrix3<f64>],
        _: &EquilibriumParams,
        progress: &dyn BatchProgress,
    ) -> Result<Vec<Option<BatchEquilibrium>>, String> {
        for (first, done) in [(0, 1), (20, 2)] {
            progress.begin(first);
            self.1.send(self.0.progress()).unwrap();
            progress.end(first, done);
        }
        self.1.send(self.0.progress()).unwrap();
        Ok(vec![None; rves.len()])
    }

    fn converge_to(&mut self, from: &[&Rve], _: &[&Rve], _: &EquilibriumParams) -> Result<Vec<bool>, String> {
        self.1.send(self.0.progress()).unwrap();
        Ok(vec![false; from.len()])
    }
}

#[test]
fn batches_report_their_progress() {
    let mut field = field(true);
    let activity = Arc::clone(field.units.activity());
    let (sender, reports) = mpsc::channel();
    let of_solver = Arc::clone(&activity);
    let leaving = move |_: &_| Some(Box::new(Leaving(of_solver.clone(), sender.clone())) as Box<dyn BatchSolver>);
    field.solve_in_batches(|model| Ok::<_, ()>(leaving(model))).unwrap();
    // The second solution starts from a trial state, so that its equilibrium is verified.
    let targets = [1, 2].map(|seed| gradients(0.01, seed));
    for targets in &targets {
        field.update(targets, &mut PointResponses::default()).unwrap();
        for (first, done) in [(0, 0), (20, 1)] {
            let progress = reports.try_recv().unwrap().unwrap();
            let slowest = progress.slowest.unwrap();
            assert_eq!((progress.done, slowest.point.element, slowest.stage), (done, first, Some(Stage::Newton)));
        }
        let expected = RveProgress { rves: ELEMENTS, done: 3, slowest: None };
        assert_eq!(reports.try_recv().unwrap(), Some(expected));
    }
    field.verify(&targets[1], &mut PointResponses::default()).unwrap();
    assert_eq!(reports.try_recv().unwrap(), Some(RveProgress { rves: ELEMENTS, done: 0, slowest: None }));
    assert_eq!(activity.progress(), None);
}

#[test]
fn the_failure_of_a_device_ends_the_update_and_reverts_it() {
    let mut field = field(true);
    field.update(&gradients(0.01, 1), &mut PointResponses::default()).unwrap();
    field.commit(true).unwrap();
    field.solve_in_batches(|_| Ok::<_, ()>(Some(Box::new(Broken) as Box<dyn BatchSolver>))).unwrap();
    let outcome = field.update(&gradients(0.02, 2), &mut PointResponses::default());
    let Err(TissueFieldError::Point(failure)) = outcome else { panic!("{outcome:?}") };
    assert!(failure.reason.ends_with("failed: the device fell off the bus"), "{failure}");
    assert!(TissueField::<Sparse>::is_final(&TissueFieldError::Point(failure)), "no shorter step helps");
    let lanes = |model: &_| LaneBatch::new(model, true).map(|batch| Box::new(batch) as Box<dyn BatchSolver>);
    field.solve_in_batches(|model| Ok::<_, ()>(lanes(model))).unwrap();
    field.update(&gradients(0.02, 2), &mut PointResponses::default()).unwrap();
}
