//! Times the equilibria of many RVEs on a graphics processor beside those on all cores of the processor.
//!
//! `cargo run --release --features cuda --example device_rves -- [NETWORK FILES] [--most N]`. Besides the given networks it
//! takes generated ones. "Cold" RVEs go from rest to a strain of 10 %, "warm" ones from there by another 1 %; each has its
//! own direction. Times contain the transfer of deformation gradients and results; "with states" also that of the states.

use std::error::Error;
use std::path::Path;
use std::sync::Arc;
use std::time::Instant;

use biotissue::backends::cuda::Device;
use biotissue::backends::cuda::networks::Status;
use biotissue::backends::sparse::Sparse;
use biotissue::device::RveBatch;
use biotissue::fiber::equilibrium::{EquilibriumParams, equilibrate};
use biotissue::fiber::law::{FiberMaterial, Law};
use biotissue::fiber::network::generate::{delaunay, voronoi};
use biotissue::fiber::network::{Network, file};
use biotissue::fiber::rve::{Rve, RveModel, StressScale};
use biotissue::fiber::workspace::Workspace;
use nalgebra::Matrix3;
use rayon::prelude::*;

type Result<T, E = Box<dyn Error>> = std::result::Result<T, E>;

/// The deformation gradients of network `number` after the cold and after the warm increment.
fn targets(number: usize) -> [Matrix3<f64>; 2] {
    let mut state = number as u64;
    let mut random = || {
        state = state.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = state;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        (z ^ (z >> 31)) as f64 / 2.0_f64.powi(63) - 1.0
    };
    let cold =
        Matrix3::from_diagonal(&nalgebra::Vector3::new(1.1, 0.97, 0.97)) + Matrix3::from_fn(|_, _| 0.01 * random());
    let direction = Matrix3::from_fn(|_, _| random());
    [cold, cold + direction * (0.01 / direction.norm())]
}

fn rows(gradient: &Matrix3<f64>) -> [f64; 9] {
    std::array::from_fn(|k| gradient[(k / 3, k % 3)])
}

/// Seconds of the cold and the warm increment on all cores.
fn on_processor(
    model: &RveModel<Sparse>,
    count: usize,
    params: &EquilibriumParams,
) -> Result<([f64; 2], Vec<[f64; 90]>)> {
    let mut rves: Vec<Rve> = vec![Rve::at_rest(model.network()); count];
    let mut seconds = [0.0; 2];
    let mut responses = Vec::new();
    for increment in 0..2 {
        let start = Instant::now();
        let solved: Vec<Option<[f64; 90]>> = rves
            .par_iter_mut()
            .enumerate()
            .map_init(
                || Workspace::new(&(), model),
                |workspace, (number, rve)| {
                    let workspace = workspace.as_mut().ok()?;
                    let mut solved = equilibrate(model, rve, &targets(number)[increment], params, workspace).ok()?;
                    let mut values = [0.0; 90];
                    values[..9].copy_from_slice(solved.pk1().as_slice());
                    values[9..].copy_from_slice(solved.tangent().ok()?.as_slice());
                    solved.keep_sensitivities().ok()?;
                    Some(values)
                },
            )
            .collect();
        seconds[increment] = start.elapsed().as_secs_f64();
        responses = solved.into_iter().map(|values| values.unwrap_or([f64::NAN; 90])).collect();
    }
    Ok((seconds, responses))
}

fn measure(device: &Device, name: &str, network: Network, most: usize) -> Result<()> {
    let law = Law::Exponential { youngs_modulus: 1.0e7, nonlinearity: 1.2 };
    let material = FiberMaterial { law, radius: 3.5e-8, density: None };
    let scale = StressScale::FiberVolumeFraction(0.01);
    let model = RveModel::<Sparse>::new(&(), Arc::new(network), Some(material), scale)?;
    let params = EquilibriumParams::default();
    let Some(mut batch) = RveBatch::new(device, &model, true)? else { return Err("no such law on the device".into()) };
    let batch_params = batch.params(&params).ok_or("no Newton's method")?;
    println!(
        "\n{name}: {} unknowns, {} fibers, {:.2} MFLOP and {:.2} MB a factorization, {:.0} kB a state, {:.0} kB a thread",
        model.unknowns(),
        model.truss().ends().len(),
        1e-6 * batch.operations(),
        1e-6 * batch.networks().bytes_of_factorization(),
        1e-3 * batch.networks().bytes_per_network() as f64,
        1e-3 * batch.networks().bytes_per_thread() as f64,
    );
    let sample = (400_000_000.0 / batch.operations()) as usize * rayon::current_num_threads() / 8;
    let sample = sample.clamp(64, 8_000);
    let (seconds, expected) = on_processor(&model, sample, &params)?;
    let per_second = |count: usize, seconds: f64| count as f64 / seconds;
    println!(
        "  {} cores: cold {:9.0}/s, warm {:9.0}/s",
        rayon::current_num_threads(),
        per_second(sample, seconds[0]),
        per_second(sample, seconds[1])
    );
    let rest = Rve::at_rest(model.network());
    let mut count = 1000;
    loop {
        let wanted = count;
        count = batch.networks().fitting(wanted)?;
        let goals: Vec<[Matrix3<f64>; 2]> = (0..count).into_par_iter().map(targets).collect();
        let of_increment = |k: usize| goals.iter().map(|goals| rows(&goals[k])).collect::<Vec<_>>();
        let increments = [of_increment(0), of_increment(1)];
        let mut line = format!("  {count:7}:");
        let mut best = [f64::INFINITY; 2];
        let mut report = Vec::new();
        for _ in 0..2 {
            batch.networks().set_states(count, |states| {
                states.gradients.fill(rows(rest.gradient()));
                states.predicts.fill(0.0);
                let positions = states.positions.par_chunks_mut(rest.interior().as_flattened().len());
                positions.for_each(|place| place.copy_from_slice(rest.interior().as_flattened()));
            })?;
            report.clear();
            for (increment, targets) in increments.iter().enumerate() {
                device.synchronize()?;
                let start = Instant::now();
                let results = batch.networks().solve(targets, &batch_params)?;
                best[increment] = best[increment].min(start.elapsed().as_secs_f64());
                let converged = results.iter().filter(|result| result.status() == Status::Converged).count();
                let iterations: usize = results.iter().map(|result| result.iterations()).sum();
                report.push((count - converged, iterations as f64 / count as f64));
            }
        }
        for (increment, kind) in ["cold", "warm"].into_iter().enumerate() {
            let (left, iterations) = report[increment];
            let rate = per_second(count, best[increment]);
            let factorizations = (iterations + 1.0) * rate;
            line += &format!(
                " {kind} {rate:9.0}/s ({iterations:.2} iterations, {left} left, {:.2} TFLOP/s, {:.2} TB/s)",
                1e-12 * factorizations * batch.operations(),
                1e-12 * factorizations * batch.networks().bytes_of_factorization(),
            );
        }
        // With the states of single RVEs.
        let mut rves = vec![rest.clone(); count];
        let mut seconds = [0.0; 2];
        let mut worst: f64 = 0.0;
        for increment in 0..2 {
            let targets: Vec<Matrix3<f64>> = goals.iter().map(|goals| goals[increment]).collect();
            let mut all: Vec<&mut Rve> = rves.iter_mut().collect();
            let start = Instant::now();
            let solved = batch.solve(&mut all, &targets, &params)?;
            seconds[increment] = start.elapsed().as_secs_f64();
            if increment == 1 {
                for (found, expected) in solved.iter().zip(&expected) {
                    let Some(found) = found else { continue };
                    let values = found.pk1.as_slice().iter().chain(found.tangent.as_slice());
                    for (found, part) in [(0..9), (9..90)]
                        .into_iter()
                        .flat_map(|range| {
                            let size = expected[range.clone()].iter().fold(0.0_f64, |size, x| size.max(x.abs()));
                            range.map(move |k| (k, size))
                        })
                        .zip(values)
                        .map(|((k, size), found)| (found - expected[k], size))
                    {
                        worst = worst.max(found.abs() / part);
                    }
                }
            }
        }
        line += &format!(
            "; with states cold {:9.0}/s, warm {:9.0}/s; worst deviation {worst:.1e}",
            per_second(count, seconds[0]),
            per_second(count, seconds[1])
        );
        println!("{line}");
        if count >= most || count < wanted {
            return Ok(());
        }
        count = if count < 10_000 {
            10_000
        } else if count < 50_000 {
            50_000
        } else {
            200_000
        };
    }
}

fn main() -> Result<()> {
    let mut arguments: Vec<String> = std::env::args().skip(1).collect();
    let mut most = 200_000;
    if let Some(at) = arguments.iter().position(|argument| argument == "--most") {
        most = arguments.get(at + 1).ok_or("--most needs a number")?.parse()?;
        arguments.drain(at..at + 2);
    }
    let device = Device::open(0)?;
    let (free, all) = device.memory()?;
    println!("{}: {:.0} GB, {:.0} GB free", device.name()?, 1e-9 * all as f64, 1e-9 * free as f64);
    for path in &arguments {
        let network = file::read(Path::new(path))?.network;
        measure(&device, path, network, most)?;
    }
    measure(&device, "Delaunay 300", delaunay(300, 1)?, most)?;
    measure(&device, "Delaunay 1000", delaunay(1000, 1)?, most.min(50_000))?;
    measure(&device, "Voronoi 300", voronoi(300, 1)?, most.min(50_000))
}
