//! Determines how many random networks reach equilibrium under random deformations, by which stage of the solver, and
//! at what cost.
//!
//! ```text
//! cargo run --release --package studies --bin robustness [-- --networks 100 --gradients 20 --seconds 3000]
//! ```
//!
//! prints the tables of `docs/robustness.md`: how many cases are solved, how many of the equilibria are stable or
//! neutral (floppy at rest), and how many were found after leaving a saddle point; each of the latter is listed.
//! Networks, deformation gradients and results are the same in every run. A case that has not started within the time
//! limit is not counted.
//!
//! Half of the networks are Delaunay networks, solved by all stages. The other half are Voronoi networks, which are
//! floppy; they are solved by dynamic relaxation followed by regularized Newton. Both kinds have three strengths of
//! alignment and 200 to 3 000 nodes.
//!
//! With `--lanes`, `--mixed` (lanes with factors of single precision) or `--cuda` (a graphics processor; needs the feature
//! `cuda`), it compares the same cases, solved by all stages, in batches and one by one: `batches.rs`.

mod batches;

use std::collections::BTreeMap;
use std::sync::Arc;
use std::time::Instant;

use biotissue::backends::sparse::Sparse;
use biotissue::fiber::batch::BatchSolver;
use biotissue::fiber::equilibrium::{
    EquilibriumParams, EquilibriumReport, RveError, Stage, StageError, Stages, equilibrate,
};
use biotissue::fiber::law::{FiberMaterial, Law};
use biotissue::fiber::network::Network;
use biotissue::fiber::network::generate::{Alignment, GeneratorParams, Kind};
use biotissue::fiber::rve::{Rve, RveModel, StressScale};
use biotissue::fiber::workspace::Workspace;
use biotissue::rve_batch::LaneBatch;
use nalgebra::{Matrix3, Rotation3};
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{RngCore, SeedableRng};
use rayon::prelude::*;

type Error = Box<dyn std::error::Error>;

/// Strengths of alignment; 0 is an isotropic network.
const STRENGTHS: [f64; 3] = [0.0, 0.4, 0.7];

/// A network with the parameters of its generation.
struct Subject {
    kind: Kind,
    strength: f64,
    seed: u64,
    network: Arc<Network>,
}

/// The result of one deformation of a network.
struct Outcome {
    kind: Kind,
    strength: f64,
    seed: u64,
    nodes: usize,
    gradient: Matrix3<f64>,
    report: EquilibriumReport,
    seconds: f64,
    /// Whether a stage found an unstable equilibrium and could not continue from there.
    rejected: bool,
    /// The reason for the failure, if the case is not solved.
    cause: Option<String>,
    /// The result of a second attempt with all stages, if the first attempt had only some of them and failed.
    all_stages: Option<String>,
}

fn main() -> Result<(), Error> {
    let networks = argument("--networks", 100)?;
    let gradients = argument("--gradients", 20)?;
    let budget = argument("--seconds", 3000)? as f64;
    let start = Instant::now();
    let subjects = (0..networks).into_par_iter().map(subject).collect::<Result<Vec<_>, _>>()?;
    let has = |option: &str| std::env::args().any(|argument| argument == option);
    if has("--lanes") || has("--mixed") {
        return Ok(batches::compare(&subjects, gradients, |model| {
            let batch = LaneBatch::new(model, true).ok_or("this machine has no lanes")?;
            Ok(Box::new(if has("--mixed") { batch.with_single_precision() } else { batch }))
        })?);
    }
    if has("--cuda") {
        return Ok(batches::compare(&subjects, gradients, on_device)?);
    }
    let outcomes = subjects
        .par_iter()
        .map(|subject| deform(subject, gradients, || start.elapsed().as_secs_f64() < budget))
        .collect::<Result<Vec<_>, String>>()?
        .concat_all();
    println!(
        "{} of {} cases tried, {:.0} s on {} threads.\n",
        outcomes.len(),
        networks * gradients,
        start.elapsed().as_secs_f64(),
        rayon::current_num_threads()
    );
    by_network(&outcomes);
    by_stability(&outcomes);
    by_stage(&outcomes);
    saddles(&outcomes);
    causes(&outcomes);
    Ok(())
}

#[cfg(feature = "cuda")]
fn on_device(model: &RveModel<Sparse>) -> Result<Box<dyn BatchSolver>, String> {
    use biotissue::{backends::cuda::Device, rve_batch::DeviceBatch};

    let batch = Device::open(0).and_then(|device| DeviceBatch::new(&device, model, true));
    let batch = batch.map_err(|error| error.to_string())?.ok_or("the device does not know the law")?;
    Ok(Box::new(batch))
}

#[cfg(not(feature = "cuda"))]
fn on_device(_: &RveModel<Sparse>) -> Result<Box<dyn BatchSolver>, String> {
    Err("this build has no support for graphics processors: add `--features cuda`".into())
}

/// Concatenation of lists.
trait ConcatAll<T> {
    fn concat_all(self) -> Vec<T>;
}

impl<T> ConcatAll<T> for Vec<Vec<T>> {
    fn concat_all(self) -> Vec<T> {
        self.into_iter().flatten().collect()
    }
}

/// Returns the number that follows the option `name`, or `default` without the option.
fn argument(name: &str, default: usize) -> Result<usize, Error> {
    let arguments: Vec<String> = std::env::args().collect();
    match arguments.iter().position(|argument| argument == name) {
        None => Ok(default),
        Some(at) => Ok(arguments.get(at + 1).ok_or(format!("{name} needs a number"))?.parse()?),
    }
}

/// Returns a random number in `[0, 1)`.
fn uniform(random: &mut ChaCha8Rng) -> f64 {
    (random.next_u64() >> 11) as f64 / (1u64 << 53) as f64
}

/// Generates a network. The number determines its kind, strength of alignment and size (evenly spaced on a logarithmic
/// scale).
fn subject(number: usize) -> Result<Subject, String> {
    let kind = Kind::ALL[number % 2];
    let strength = STRENGTHS[number / 2 % 3];
    let seed = number as u64 + 1;
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let mut generator = GeneratorParams::new(kind, seed);
    if strength > 0.0 {
        let direction = [(); 3].map(|()| uniform(&mut random) - 0.5);
        generator.alignment = Some(Alignment::new(direction, strength).map_err(|error| error.to_string())?);
    }
    let nodes = 200.0 * 15.0_f64.powf((number / 6 % 16) as f64 / 15.0);
    let made = generator.of_nodes(nodes.round() as usize).map_err(|error| error.to_string())?;
    Ok(Subject { kind, strength, seed, network: Arc::new(made.network) })
}

/// Returns a random deformation gradient: principal stretches between 0.7 and 1.6 along random axes, and a random
/// rotation.
fn random_gradient(random: &mut ChaCha8Rng) -> Matrix3<f64> {
    let mut rotation = || {
        let [a, b, c] = [(); 3].map(|()| uniform(random) * std::f64::consts::TAU);
        Rotation3::from_euler_angles(a, b, c).into_inner()
    };
    let (axes, turn) = (rotation(), rotation());
    let stretches = [(); 3].map(|()| 0.7 + 0.9 * uniform(random));
    turn * axes * Matrix3::from_diagonal(&stretches.into()) * axes.transpose()
}

/// Returns the random deformation gradients of a network.
fn random_gradients(subject: &Subject, count: usize) -> impl Iterator<Item = Matrix3<f64>> {
    let mut random = ChaCha8Rng::seed_from_u64(1000 + subject.seed);
    (0..count).map(move |_| random_gradient(&mut random))
}

fn model(subject: &Subject) -> Result<RveModel<Sparse>, String> {
    let law = Law::Exponential { youngs_modulus: 1.0e8, nonlinearity: 1.2 };
    let material = FiberMaterial { law, radius: 5.0e-8, density: None };
    let scale = StressScale::FiberVolumeFraction(0.003);
    RveModel::new(&(), Arc::clone(&subject.network), Some(material), scale).map_err(|error| error.to_string())
}

/// Solves a network for `gradients` random deformation gradients, as long as `in_time` returns true.
fn deform(subject: &Subject, gradients: usize, in_time: impl Fn() -> bool) -> Result<Vec<Outcome>, String> {
    let model = model(subject)?;
    let mut workspace = Workspace::new(&(), &model).map_err(|error| error.to_string())?;
    let tried = random_gradients(subject, gradients).take_while(|_| in_time());
    Ok(tried.map(|gradient| solve(subject, &model, &gradient, &mut workspace)).collect())
}

/// Solves one case; measures the time of the first attempt.
fn solve(
    subject: &Subject,
    model: &RveModel<Sparse>,
    gradient: &Matrix3<f64>,
    workspace: &mut Workspace<Sparse>,
) -> Outcome {
    let mut params = EquilibriumParams::default();
    if subject.kind == Kind::Voronoi {
        params.stages = Stages::of(&[Stage::Relaxation]);
    }
    let start = Instant::now();
    let (report, cause, rejected) = attempt(subject, model, gradient, &params, workspace);
    let seconds = start.elapsed().as_secs_f64();
    let all_stages = (cause.is_some() && subject.kind == Kind::Voronoi).then(|| {
        let (report, cause, _) = attempt(subject, model, gradient, &EquilibriumParams::default(), workspace);
        match (report.stage, cause) {
            (Some(stage), None) => format!("reached by {stage} after {} iterations", report.iterations),
            (_, cause) => cause.unwrap_or_default(),
        }
    });
    let nodes = subject.network.nodes().len();
    let Subject { kind, strength, seed, .. } = *subject;
    Outcome { kind, strength, seed, nodes, gradient: *gradient, report, seconds, rejected, cause, all_stages }
}

/// Solves from rest at the gradient, with the tangent. Returns the report, the reason for a failure, and whether an
/// unstable equilibrium was rejected.
fn attempt(
    subject: &Subject,
    model: &RveModel<Sparse>,
    gradient: &Matrix3<f64>,
    params: &EquilibriumParams,
    workspace: &mut Workspace<Sparse>,
) -> (EquilibriumReport, Option<String>, bool) {
    let mut rve = Rve::at_rest(&subject.network);
    match equilibrate(model, &mut rve, gradient, params, workspace) {
        Ok(mut solved) => {
            let cause = solved.tangent().err().map(|error| error.to_string());
            (solved.into_report(), cause, false)
        }
        Err(RveError::NotConverged { failures, report }) => {
            let causes: Vec<String> = failures.iter().map(ToString::to_string).collect();
            let rejected = failures.iter().any(|failure| matches!(failure.reason, StageError::Unstable(_)));
            (*report, Some(causes.join("; ")), rejected)
        }
        Err(error) => (EquilibriumReport::default(), Some(error.to_string()), false),
    }
}

/// Prints the numbers of cases and of solved cases by kind and strength of alignment.
fn by_network(outcomes: &[Outcome]) {
    println!("| network | strength of alignment | nodes | cases | solved | |\n|---|---|---|---|---|---|");
    for kind in Kind::ALL {
        for strength in STRENGTHS {
            let of: Vec<&Outcome> = outcomes.iter().filter(|o| (o.kind, o.strength) == (kind, strength)).collect();
            let done = of.iter().filter(|o| o.cause.is_none()).count();
            let [least, most] = [of.iter().map(|o| o.nodes).min(), of.iter().map(|o| o.nodes).max()];
            println!(
                "| {} | {strength} | {} to {} | {} | {done} | {:.1} % |",
                kind.name(),
                least.unwrap_or(0),
                most.unwrap_or(0),
                of.len(),
                100.0 * done as f64 / of.len().max(1) as f64
            );
        }
    }
    println!();
}

/// Prints the numbers of stable, neutral and rejected equilibria by kind.
fn by_stability(outcomes: &[Outcome]) {
    println!("| network | solved | stable | neutral | solved after leaving a saddle point | unstable, rejected |");
    println!("|---|---|---|---|---|---|");
    for kind in Kind::ALL {
        let count = |is: &dyn Fn(&Outcome) -> bool| outcomes.iter().filter(|o| o.kind == kind && is(o)).count();
        let done = |o: &Outcome| o.cause.is_none();
        println!(
            "| {} | {} | {} | {} | {} | {} |",
            kind.name(),
            count(&done),
            count(&|o| done(o) && !o.report.neutral && o.report.negative_pivots == Some(0)),
            count(&|o| done(o) && o.report.neutral),
            count(&|o| done(o) && o.report.saddles > 0),
            count(&|o| o.rejected)
        );
    }
    println!();
}

/// Prints the cases in which a stage found a saddle point first.
fn saddles(outcomes: &[Outcome]) {
    let cases: Vec<&Outcome> = outcomes.iter().filter(|o| o.report.saddles > 0).collect();
    println!("{} cases with saddle points:\n", cases.len());
    for o in cases {
        println!(
            "- {} {} (strength {}, {} nodes), F = {:?}: {} saddle points left, \
             {:?} negative pivots at the end, {} iterations",
            o.kind.name(),
            o.seed,
            o.strength,
            o.nodes,
            o.gradient.transpose().as_slice(),
            o.report.saddles,
            o.report.negative_pivots,
            o.report.iterations
        );
    }
    println!();
}

/// Prints iterations, relaxation steps and times of the solved cases by kind and stage.
fn by_stage(outcomes: &[Outcome]) {
    println!(
        "| network | solved by | cases | iterations: median, 90 %, maximum | steps of relaxation: median, maximum | seconds: median, maximum |"
    );
    println!("|---|---|---|---|---|---|");
    for kind in Kind::ALL {
        for stage in Stage::ALL {
            let of: Vec<&Outcome> = outcomes
                .iter()
                .filter(|o| o.kind == kind && o.cause.is_none() && o.report.stage == Some(stage))
                .collect();
            if of.is_empty() {
                continue;
            }
            let sorted = |number: &dyn Fn(&Outcome) -> f64| {
                let mut numbers: Vec<f64> = of.iter().map(|o| number(o)).collect();
                numbers.sort_by(f64::total_cmp);
                numbers
            };
            let iterations = sorted(&|o| o.report.iterations as f64);
            let steps = sorted(&|o| o.report.relaxation.steps as f64);
            let seconds = sorted(&|o| o.seconds);
            let (median, percentile_90, last) = (of.len() / 2, of.len() * 9 / 10, of.len() - 1);
            println!(
                "| {} | {stage} | {} | {}, {}, {} | {}, {} | {:.3}, {:.2} |",
                kind.name(),
                of.len(),
                iterations[median],
                iterations[percentile_90],
                iterations[last],
                steps[median],
                steps[last],
                seconds[median],
                seconds[last]
            );
        }
    }
    println!();
}

/// Prints the unsolved cases with their causes.
fn causes(outcomes: &[Outcome]) {
    let failed: BTreeMap<(u64, usize), &Outcome> =
        outcomes.iter().enumerate().filter(|(_, o)| o.cause.is_some()).map(|(k, o)| ((o.seed, k), o)).collect();
    println!("{} unsolved cases, each with its cause:\n", failed.len());
    for outcome in failed.values() {
        let Some(cause) = &outcome.cause else { continue };
        println!(
            "- {} {} (strength {}, {} nodes), det F = {:.2}, {:.1} s: {cause}",
            outcome.kind.name(),
            outcome.seed,
            outcome.strength,
            outcome.nodes,
            outcome.gradient.determinant(),
            outcome.seconds
        );
        if let Some(all_stages) = &outcome.all_stages {
            println!("  With all stages: {all_stages}.");
        }
    }
}
