//! How many random networks, deformed at random, come to equilibrium, by which stage, and at what cost.
//!
//! ```text
//! cargo run --release --example robustness [-- --networks 100 --gradients 20 --seconds 1800]
//! ```
//!
//! prints the tables of `docs/robustness.md`. The networks, gradients and answers are the same on every run; a case that
//! has not begun when the time is up counts as not tried.

use std::collections::BTreeMap;
use std::sync::Arc;
use std::time::Instant;

use biotissue::backends::sparse::Sparse;
use biotissue::fiber::equilibrium::{EquilibriumParams, RveError, Stage, equilibrate};
use biotissue::fiber::homogenise;
use biotissue::fiber::law::{FiberMaterial, Law};
use biotissue::fiber::network::Network;
use biotissue::fiber::network::generate::Delaunay;
use biotissue::fiber::rve::{Rve, RveModel, StressScale};
use biotissue::fiber::workspace::Workspace;
use nalgebra::{Matrix3, Rotation3};
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{RngCore, SeedableRng};
use rayon::prelude::*;

struct Case {
    kind: String,
    network: Arc<Network>,
}

struct Outcome {
    kind: String,
    gradient: Matrix3<f64>,
    stage: Option<Stage>,
    iterations: usize,
    steps: usize,
    seconds: f64,
    cause: Option<String>,
}

fn uniform(random: &mut ChaCha8Rng) -> f64 {
    (random.next_u64() >> 11) as f64 / (1u64 << 53) as f64
}

/// Principal stretches between 0.7 and 1.6 along random axes, and a random rotation.
fn random_gradient(random: &mut ChaCha8Rng) -> Matrix3<f64> {
    let mut rotation = || {
        let [a, b, c] = [(); 3].map(|()| uniform(random) * std::f64::consts::TAU);
        Rotation3::from_euler_angles(a, b, c).into_inner()
    };
    let (axes, turn) = (rotation(), rotation());
    let stretches = [(); 3].map(|()| 0.7 + 0.9 * uniform(random));
    turn * axes * Matrix3::from_diagonal(&stretches.into()) * axes.transpose()
}

fn main() {
    let arguments: Vec<String> = std::env::args().collect();
    let number = |name: &str, default: usize| {
        let at = arguments.iter().position(|a| a == name);
        at.and_then(|at| arguments.get(at + 1)).and_then(|n| n.parse().ok()).unwrap_or(default)
    };
    let (networks, gradients, budget) =
        (number("--networks", 100), number("--gradients", 20), number("--seconds", 1800));
    let started = Instant::now();
    let cases: Vec<Case> = (0..networks)
        .map(|k| {
            let points = 60 + 140 * (k % 5);
            let network = Delaunay::new(points, k as u64 + 1).generate().unwrap();
            Case { kind: "delaunay".into(), network: Arc::new(network) }
        })
        .collect();
    let outcomes: Vec<Outcome> = cases
        .par_iter()
        .enumerate()
        .flat_map_iter(|(k, case)| {
            let mut random = ChaCha8Rng::seed_from_u64(1000 + k as u64);
            let law = Law::Exponential { youngs_modulus: 1.0e8, nonlinearity: 1.2 };
            let material = FiberMaterial { law, radius: 5.0e-8, density: None };
            let model = RveModel::<Sparse>::new(
                &(),
                Arc::clone(&case.network),
                Some(material),
                StressScale::FiberVolumeFraction(0.003),
            )
            .unwrap();
            let mut workspace = Workspace::new(&(), &model).unwrap();
            (0..gradients)
                .filter_map(|_| {
                    let gradient = random_gradient(&mut random);
                    (started.elapsed().as_secs() < budget as u64).then(|| solve(case, &model, gradient, &mut workspace))
                })
                .collect::<Vec<_>>()
        })
        .collect();
    let mut stages: BTreeMap<String, usize> = BTreeMap::new();
    for o in &outcomes {
        *stages.entry(o.stage.map_or("none".into(), |s| s.to_string())).or_default() += 1;
    }
    println!("{} cases, {:.1} s, {stages:?}", outcomes.len(), started.elapsed().as_secs_f64());
    for s in Stage::ALL {
        let of: Vec<_> = outcomes.iter().filter(|o| o.stage == Some(s)).collect();
        let n = of.len().max(1) as f64;
        println!(
            "{s}: {} mean its {:.1} max {} steps {:.0} seconds {:.4}",
            of.len(),
            of.iter().map(|o| o.iterations).sum::<usize>() as f64 / n,
            of.iter().map(|o| o.iterations).max().unwrap_or(0),
            of.iter().map(|o| o.steps).sum::<usize>() as f64 / n,
            of.iter().map(|o| o.seconds).sum::<f64>() / n
        );
    }
    for o in outcomes.iter().filter(|o| o.cause.is_some()) {
        println!(
            "{} {:.3} {:.3}s its {} steps {}: {}",
            o.kind,
            o.gradient.determinant(),
            o.seconds,
            o.iterations,
            o.steps,
            o.cause.as_ref().unwrap()
        );
    }
}

fn solve(case: &Case, model: &RveModel<Sparse>, gradient: Matrix3<f64>, workspace: &mut Workspace<Sparse>) -> Outcome {
    let start = Instant::now();
    let mut rve = Rve::at_rest(&case.network);
    let result = equilibrate(model, &mut rve, &gradient, &EquilibriumParams::default(), workspace);
    let (report, cause) = match result {
        Ok(report) => {
            let pk1 = homogenise::pk1(model, workspace);
            let tangent = homogenise::tangent(model, &rve, &pk1, workspace);
            (report, tangent.err().map(|e| e.to_string()))
        }
        Err(RveError::NotConverged { failures, report }) => {
            let text = failures.iter().map(ToString::to_string).collect::<Vec<_>>().join("; ");
            (*report, Some(text))
        }
        Err(error) => (Default::default(), Some(error.to_string())),
    };
    Outcome {
        kind: case.kind.clone(),
        gradient,
        stage: report.stage,
        iterations: report.iterations,
        steps: report.relaxation.steps,
        seconds: start.elapsed().as_secs_f64(),
        cause,
    }
}
