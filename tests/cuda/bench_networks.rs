//! Times the equilibria of many RVEs on the device beside those on all cores of the processor.
//!
//! "Cold" RVEs go from rest to a strain of 10 %, "warm" ones from there by another 1 %; each has its own direction. Times
//! contain the transfer of deformation gradients and results; "with states" also that of the states. Operations and bytes
//! per second count the factorizations of the cold increment alone. `BIOTISSUE_NETWORKS` is a folder with the published
//! `Network_2_7.txt`; without it, only generated networks are measured.

use std::path::Path;
use std::sync::Arc;
use std::time::Instant;

use biotissue::backends::cuda::Device;
use biotissue::backends::networks::Status;
use biotissue::backends::sparse::Sparse;
use biotissue::fiber::batch::BatchSolver;
use biotissue::fiber::equilibrium::{EquilibriumParams, equilibrate};
use biotissue::fiber::homogenize::Tangent;
use biotissue::fiber::law::{FiberMaterial, Law};
use biotissue::fiber::network::generate::delaunay;
use biotissue::fiber::network::{Network, file};
use biotissue::fiber::rve::{Rve, RveModel, StressScale};
use biotissue::fiber::workspace::Workspace;
use biotissue::las::conformance::Random;
use biotissue::rve_batch::{DeviceBatch, LaneBatch};
use nalgebra::{Matrix3, Vector3};
use rayon::prelude::*;

type Outcome<T> = Result<T, Box<dyn std::error::Error>>;

/// The stress and the tangent of an RVE.
type Response = [f64; 90];

/// The deformation gradients of network `number` after the cold and after the warm increment.
pub fn targets(number: usize) -> [Matrix3<f64>; 2] {
    let mut random = Random::new(number as u64);
    let mut matrix = || Matrix3::from_fn(|_, _| random.signed());
    let cold = Matrix3::from_diagonal(&Vector3::new(1.1, 0.97, 0.97)) + 0.01 * matrix();
    let direction = matrix();
    [cold, cold + direction * (0.01 / direction.norm())]
}

fn rows(gradient: &Matrix3<f64>) -> [f64; 9] {
    std::array::from_fn(|k| gradient[(k / 3, k % 3)])
}

fn response(pk1: &Matrix3<f64>, tangent: &Tangent) -> Response {
    let mut values = [0.0; 90];
    values[..9].copy_from_slice(pk1.as_slice());
    values[9..].copy_from_slice(tangent.as_slice());
    values
}

/// Returns the seconds of the cold and the warm increment on all cores, and the responses after both.
fn on_processor(model: &RveModel<Sparse>, count: usize) -> ([f64; 2], Vec<Response>) {
    let mut rves: Vec<Rve> = vec![Rve::at_rest(model.network()); count];
    let params = EquilibriumParams::default();
    let mut seconds = [0.0; 2];
    let mut responses = Vec::new();
    for (increment, seconds) in seconds.iter_mut().enumerate() {
        let solve = |workspace: &mut Workspace<Sparse>, (number, rve): (usize, &mut Rve)| {
            let mut solved = equilibrate(model, rve, &targets(number)[increment], &params, workspace).unwrap();
            let values = response(&solved.pk1(), &solved.tangent().unwrap());
            solved.keep_sensitivities().unwrap();
            values
        };
        let start = Instant::now();
        let workspace = || Workspace::new(&(), model).unwrap();
        responses = rves.par_iter_mut().enumerate().map_init(workspace, solve).collect();
        *seconds = start.elapsed().as_secs_f64();
    }
    (seconds, responses)
}

/// Returns the largest deviation of stresses and tangents, relative to the largest component of each.
fn deviation(found: &[Response], expected: &[Response]) -> f64 {
    let mut worst = 0.0_f64;
    for (found, expected) in found.iter().zip(expected) {
        for part in [0..9, 9..90] {
            let size = expected[part.clone()].iter().fold(0.0_f64, |size, x| size.max(x.abs()));
            for k in part {
                worst = worst.max((found[k] - expected[k]).abs() / size);
            }
        }
    }
    worst
}

/// The increments of many networks from rest, with states that stay on the device.
pub struct OnDevice {
    pub seconds: [f64; 2],
    /// Mean iterations of each increment.
    pub iterations: [f64; 2],
    /// Networks that need more than Newton's method.
    left: usize,
}

pub fn on_device(batch: &mut DeviceBatch, model: &RveModel<Sparse>, goals: &[[Matrix3<f64>; 2]]) -> Outcome<OnDevice> {
    let params = batch.params(&EquilibriumParams::default()).ok_or("no Newton's method")?;
    let rest = Rve::at_rest(model.network());
    let count = goals.len();
    let mut outcome = OnDevice { seconds: [0.0; 2], iterations: [0.0; 2], left: 0 };
    batch.networks().set_states(count, |states| {
        states.gradients.fill(rows(rest.gradient()));
        states.predicts.fill(0.0);
        let rest = rest.interior().as_flattened();
        states.positions.par_chunks_mut(rest.len()).for_each(|place| place.copy_from_slice(rest));
    })?;
    for increment in 0..2 {
        let targets: Vec<[f64; 9]> = goals.iter().map(|goals| rows(&goals[increment])).collect();
        let start = Instant::now();
        let results = batch.networks().solve(&targets, &params)?;
        outcome.seconds[increment] = start.elapsed().as_secs_f64();
        let iterations: usize = results.iter().map(|result| result.iterations()).sum();
        outcome.iterations[increment] = iterations as f64 / count as f64;
        outcome.left += results.iter().filter(|result| result.status() != Status::Converged).count();
    }
    Ok(outcome)
}

/// Solves for both increments with the states of single RVEs; returns the seconds of each and the last responses.
fn with_states(
    batch: &mut dyn BatchSolver,
    model: &RveModel<Sparse>,
    goals: &[[Matrix3<f64>; 2]],
) -> Outcome<([f64; 2], Vec<Response>)> {
    let mut rves = vec![Rve::at_rest(model.network()); goals.len()];
    let (mut seconds, mut responses) = ([0.0; 2], Vec::new());
    for (increment, seconds) in seconds.iter_mut().enumerate() {
        let targets: Vec<Matrix3<f64>> = goals.iter().map(|goals| goals[increment]).collect();
        let mut all: Vec<&mut Rve> = rves.iter_mut().collect();
        let start = Instant::now();
        let solved = batch.solve(&mut all, &targets, &EquilibriumParams::default(), &())?;
        *seconds = start.elapsed().as_secs_f64();
        responses = solved.iter().flatten().map(|solved| response(&solved.pk1, &solved.tangent)).collect();
    }
    Ok((seconds, responses))
}

fn measure(device: &Device, name: &str, network: Network, counts: &[usize]) -> Outcome<()> {
    let law = Law::Exponential { youngs_modulus: 1.0e7, nonlinearity: 1.2 };
    let material = FiberMaterial { law, radius: 3.5e-8, density: None };
    let scale = StressScale::FiberVolumeFraction(0.01);
    let model = RveModel::<Sparse>::new(&(), Arc::new(network), Some(material), scale)?;
    let mut batch = DeviceBatch::new(device, &model, true)?.ok_or("no such law on the device")?;
    let (operations, bytes) = (batch.operations(), batch.networks().bytes_of_factorization());
    println!(
        "\n{name}: {} unknowns, {} fibers; {:.2} MFLOP and {:.2} MB a factorization; {:.1} kB a network, and {:.0} kB \
         while it is solved\n",
        model.unknowns(),
        model.truss().ends().len(),
        1e-6 * operations,
        1e-6 * bytes,
        1e-3 * batch.networks().bytes_per_network() as f64,
        1e-3 * batch.networks().bytes_per_thread() as f64,
    );
    println!(
        "| networks | cold /s | warm /s | iterations | TFLOP/s | TB/s | with states: cold /s | warm /s | deviation |"
    );
    println!("|---:|---:|---:|---|---:|---:|---:|---:|---:|");
    let cores = rayon::current_num_threads();
    let sample = ((4e8 / operations) as usize * cores / 8).clamp(64, 8_000);
    let (seconds, expected) = on_processor(&model, sample);
    let of = |count: usize, seconds: [f64; 2]| seconds.map(|seconds| count as f64 / seconds);
    let [cold, warm] = of(sample, seconds);
    println!("| {sample} on {cores} cores | {cold:.0} | {warm:.0} | | | | | | |");
    if let Some(mut lanes) = LaneBatch::new(&model, true) {
        // Enough groups for all threads; the goals are those of the first networks.
        let count = (8 * sample).next_multiple_of(8 * cores);
        let goals: Vec<[Matrix3<f64>; 2]> = (0..count).into_par_iter().map(targets).collect();
        let (seconds, responses) = with_states(&mut lanes, &model, &goals)?;
        let [cold, warm] = of(count, seconds);
        let deviation = deviation(&responses, &expected);
        println!("| {count} in lanes on {cores} cores | | | | | | {cold:.0} | {warm:.0} | {deviation:.0e} |");
    }
    for &count in counts {
        let goals: Vec<[Matrix3<f64>; 2]> = (0..count).into_par_iter().map(targets).collect();
        // The first time allocates memory.
        on_device(&mut batch, &model, &goals)?;
        let resident = on_device(&mut batch, &model, &goals)?;
        let [cold, warm] = of(count, resident.seconds);
        let factorizations = (resident.iterations[0] + 1.0) * cold;
        let [first, second] = resident.iterations;
        print!(
            "| {count} | {cold:.0} | {warm:.0} | {first:.2}, {second:.2} | {:.2} | {:.2} |",
            1e-12 * factorizations * operations,
            1e-12 * factorizations * bytes
        );
        if count <= 50_000 {
            let (seconds, responses) = with_states(&mut batch, &model, &goals)?;
            let [cold, warm] = of(count, seconds);
            println!(" {cold:.0} | {warm:.0} | {:.0e} |", deviation(&responses, &expected));
        } else {
            println!(" | | |");
        }
        if resident.left > 0 {
            println!("{} increments of {count} networks need more than Newton's method", resident.left);
        }
    }
    Ok(())
}

/// Prints the tables.
pub fn run(device: &Device) {
    if let Some(folder) = std::env::var_os("BIOTISSUE_NETWORKS") {
        let network = file::read(&Path::new(&folder).join("Network_2_7.txt")).unwrap().network;
        measure(device, "Network_2_7", network, &[250, 500, 1_000, 10_000, 33_792, 202_752, 405_504]).unwrap();
    }
    measure(device, "Delaunay 300", delaunay(300, 1).unwrap(), &[1_000, 10_000, 33_792, 67_584, 202_752]).unwrap();
    measure(device, "Delaunay 1000", delaunay(1000, 1).unwrap(), &[1_000, 10_000]).unwrap();
}
