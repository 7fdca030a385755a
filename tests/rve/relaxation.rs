//! Damped dynamic relaxation finds the equilibria that Newton finds, and satisfies the balance of energy.
use crate::support;
use std::sync::Arc;

use crate::support::Bench;
use biotissue::backends::sparse::Sparse;
use biotissue::fiber::dynamic_relaxation::{Masses, RelaxationError};
use biotissue::fiber::equilibrium::{RveError, Stage, StageError, Stages};
use biotissue::fiber::network::Network;
use nalgebra::Matrix3;

fn relaxing(network: &Arc<Network>, masses: Masses) -> Bench<Sparse> {
    let mut bench = Bench::new(network, Some(support::laws()[1].clone()));
    bench.params = bench.params.with_stages(Stages::of(&[Stage::Relaxation]));
    bench.params.relaxation.masses = masses;
    bench.params.newton.tolerance = 1e-9;
    bench
}

fn stretched() -> Matrix3<f64> {
    Matrix3::new(1.2, 0.05, 0.0, 0.0, 0.95, 0.02, 0.0, 0.0, 1.0)
}

/// With `--nocapture`, the test prints the cost of both methods.
#[test]
fn relaxation_finds_the_equilibria_of_newton() {
    let mut networks = support::dogbone_library();
    networks.push(support::frozen());
    networks.extend(support::published("Network_2_7.txt"));
    for network in &networks {
        let mut newton = Bench::<Sparse>::new(network, Some(support::laws()[1].clone()));
        newton.params.newton.tolerance = 1e-9;
        let mut rve = newton.at_rest();
        let clock = std::time::Instant::now();
        let iterations = newton.solve(&mut rve, &stretched()).unwrap().iterations;
        let by_newton = clock.elapsed();

        for masses in [Masses::Stiffness, Masses::Density] {
            let mut relaxed = relaxing(network, masses);
            let mut rve = relaxed.at_rest();
            let clock = std::time::Instant::now();
            let report = relaxed.solve(&mut rve, &stretched()).unwrap();
            let by_relaxation = clock.elapsed();
            assert_eq!((report.stage, report.iterations), (Some(Stage::Relaxation), 0));
            let left = *report.newton.relative.last().unwrap();
            assert!(left > 0.0 && left <= 1e-9 && left == report.relaxation.relative, "{left:.1e}");
            let difference = (relaxed.pk1() - newton.pk1()).amax() / newton.pk1().amax();
            println!(
                "{}: Newton {iterations} iterations in {by_newton:.1?}, relaxation ({masses:?}) {} steps in \
                 {by_relaxation:.1?}; stresses differ by {difference:.1e}, energies by {:.1e}",
                network.name(),
                report.relaxation.steps,
                report.relaxation.energies.error(),
            );
            assert!(difference < 1e-6, "{}: {difference:.1e}", network.name());
            assert!(report.relaxation.energies.error() < 0.01);
        }
    }
}

#[test]
fn too_few_steps_are_an_error_with_the_residual() {
    let mut bench = relaxing(&support::frozen(), Masses::Stiffness);
    bench.params.relaxation.max_steps = 100;
    let mut rve = bench.at_rest();
    let before = rve.clone();
    let error = bench.solve(&mut rve, &stretched()).unwrap_err();
    assert_eq!(rve, before, "a failure does not change the state");
    let RveError::NotConverged { failures, .. } = &error else { panic!("{error}") };
    let StageError::Relaxation(RelaxationError::TooManySteps { steps: 100, residual, limit }) = failures[0].reason
    else {
        panic!("{error}")
    };
    assert!(residual > limit, "{error}");
}

#[test]
fn an_unstable_time_step_violates_the_energy_balance_and_is_halved() {
    let mut bench = relaxing(&support::frozen(), Masses::Stiffness);
    bench.params.relaxation.safety = 4.0;
    let mut rve = bench.at_rest();
    let report = bench.solve(&mut rve, &stretched()).unwrap();
    assert!(report.relaxation.repeats > 0 && report.relaxation.energies.error() < 0.01, "{report:?}");

    bench.params.relaxation.max_repeats = 0;
    let error = bench.solve(&mut bench.at_rest(), &stretched()).unwrap_err();
    let RveError::NotConverged { failures, .. } = &error else { panic!("{error}") };
    let reason = &failures[0].reason;
    assert!(matches!(reason, StageError::Relaxation(RelaxationError::EnergyBalance { .. })), "{error}");
}
