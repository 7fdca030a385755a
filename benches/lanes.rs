//! RVEs a second of processor time on one core, one by one and in the lanes of vector registers; and the factorizations of
//! the backend `batched`, which uses the same lanes.
//!
//! Run by `cargo bench --package benches --bench lanes`, with `BIOTISSUE_NETWORKS` set to the folder of the published
//! networks; without it only generated networks are timed. Each network is pulled from rest to about 10 % ("cold"), then
//! by 1 % more ("warm"), each time with stress and tangent. `docs/kernel.md` lists the table.

use std::path::Path;
use std::sync::Arc;

use biotissue::backends::batched::{self, Batched, Lanes};
use biotissue::backends::networks::lanes::{Level, Phase, PhaseTimes};
use biotissue::backends::sparse::Sparse;
use biotissue::fiber::batch::BatchEquilibrium;
use biotissue::fiber::equilibrium::{EquilibriumParams, equilibrate};
use biotissue::fiber::homogenize::Tangent;
use biotissue::fiber::law::{FiberMaterial, Law};
use biotissue::fiber::network::{Network, file, generate};
use biotissue::fiber::rve::{Rve, RveModel, StressScale};
use biotissue::fiber::workspace::Workspace;
use biotissue::las::{Backend, Solver, SolverParams, Sparsity, Symmetry};
use biotissue::rve_batch::LaneBatch;
use nalgebra::Matrix3;
use rustix::time::{ClockId, clock_gettime};

type Model = RveModel<Sparse>;

/// Processor time of this thread, on which other programs have little influence.
fn processor_seconds() -> f64 {
    let now = clock_gettime(ClockId::ThreadCPUTime);
    now.tv_sec as f64 + 1e-9 * now.tv_nsec as f64
}

/// Repetitions, of which the median counts.
const REPETITIONS: usize = 5;

/// The deformation gradients of an RVE: about 10 % in a direction of its own, and 1 % more.
fn targets(number: usize) -> [Matrix3<f64>; 2] {
    let mut state = number as u64 + 1;
    let mut random = || {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 11) as f64 / (1_u64 << 53) as f64 - 0.5
    };
    let mut gradient = |size: f64| Matrix3::from_fn(|_, _| size * random());
    let cold = Matrix3::from_diagonal(&[1.1, 0.97, 0.97].into()) + gradient(0.02);
    [cold, cold + gradient(0.02)]
}

/// What the increments of all RVEs took.
#[derive(Clone, Default)]
struct Outcome {
    /// Seconds, cold and warm.
    seconds: [f64; 2],
    iterations: [usize; 2],
    /// The share of the operations of a group that its lanes would repeat because others are not done, cold and warm.
    waiting: [f64; 2],
    /// RVEs that the batch left.
    left: usize,
    tangents: Vec<Tangent>,
}

fn one_by_one(model: &Model, goals: &[[Matrix3<f64>; 2]]) -> Outcome {
    let params = EquilibriumParams::default();
    let mut workspace = Workspace::new(&(), model).expect("a workspace");
    let mut rves = vec![Rve::at_rest(model.network()); goals.len()];
    let mut outcome = Outcome::default();
    for increment in 0..2 {
        outcome.tangents.clear();
        let start = processor_seconds();
        for (rve, goals) in rves.iter_mut().zip(goals) {
            let solved = equilibrate(model, rve, &goals[increment], &params, &mut workspace);
            let mut solved = solved.expect("the networks of the bench converge");
            outcome.iterations[increment] += solved.report().iterations;
            outcome.tangents.push(solved.tangent().expect("its stiffness is regular"));
            solved.keep_sensitivities().expect("its stiffness is regular");
        }
        outcome.seconds[increment] = processor_seconds() - start;
    }
    outcome
}

fn in_lanes(batch: &LaneBatch, model: &Model, goals: &[[Matrix3<f64>; 2]]) -> Outcome {
    let params = EquilibriumParams::default();
    let mut rves = vec![Rve::at_rest(model.network()); goals.len()];
    let mut outcome = Outcome::default();
    for increment in 0..2 {
        let targets: Vec<Matrix3<f64>> = goals.iter().map(|goals| goals[increment]).collect();
        let mut all: Vec<&mut Rve> = rves.iter_mut().collect();
        let start = processor_seconds();
        let solved = batch.solve(&mut all, &targets, &params);
        outcome.seconds[increment] = processor_seconds() - start;
        outcome.left += solved.iter().filter(|solved| solved.is_none()).count();
        outcome.iterations[increment] = solved.iter().flatten().map(|solved| solved.iterations).sum();
        outcome.waiting[increment] = waiting(&solved, batch.lanes().lanes());
        outcome.tangents = solved.iter().flatten().map(|solved| solved.tangent).collect();
    }
    outcome
}

/// Returns the microseconds of an RVE by phase, warm.
fn by_phase(batch: &LaneBatch, model: &Model, goals: &[[Matrix3<f64>; 2]]) -> Vec<f64> {
    let params = EquilibriumParams::default();
    let mut rves = vec![Rve::at_rest(model.network()); goals.len()];
    let mut all: Vec<&mut Rve> = rves.iter_mut().collect();
    let mut times = PhaseTimes::default();
    for increment in 0..2 {
        let targets: Vec<Matrix3<f64>> = goals.iter().map(|goals| goals[increment]).collect();
        times = PhaseTimes::default();
        batch.solve_timed(&mut all, &targets, &params, &mut times);
    }
    Phase::ALL.iter().map(|&phase| 1e6 * times.seconds(phase) / goals.len() as f64).collect()
}

/// Prints the medians of the phases of each batch, in microseconds of an RVE.
fn print_phases(batches: &[(&str, LaneBatch)], model: &Model, goals: &[[Matrix3<f64>; 2]]) {
    println!(
        "\n| us of an RVE, warm | start | forces | factor | step | tangent | end |\n|---|---:|---:|---:|---:|---:|---:|"
    );
    for (name, batch) in batches {
        let runs: Vec<Vec<f64>> = (0..REPETITIONS).map(|_| by_phase(batch, model, goals)).collect();
        let median = |phase: usize| {
            let mut times: Vec<f64> = runs.iter().map(|run| run[phase]).collect();
            times.sort_by(f64::total_cmp);
            format!("{:.1}", times[REPETITIONS / 2])
        };
        let times: Vec<String> = (0..Phase::ALL.len()).map(median).collect();
        println!("| {name} | {} |", times.join(" | "));
    }
}

/// Returns the share of factorizations that lanes would repeat while they wait for others of their group, if none paused.
fn waiting(solved: &[Option<BatchEquilibrium>], lanes: usize) -> f64 {
    let factorizations = |solved: &Option<BatchEquilibrium>| solved.as_ref().map_or(0, |solved| solved.iterations + 1);
    let needed: usize = solved.iter().map(factorizations).sum();
    let of_group = |group: &[_]| lanes * group.iter().map(factorizations).max().unwrap_or(0);
    1.0 - needed as f64 / solved.chunks(lanes).map(of_group).sum::<usize>().max(1) as f64
}

/// Returns the outcome with the medians of the seconds of several repetitions.
fn median(run: impl Fn() -> Outcome) -> Outcome {
    let runs: Vec<Outcome> = (0..REPETITIONS).map(|_| run()).collect();
    let median = |increment: usize| {
        let mut seconds: Vec<f64> = runs.iter().map(|run| run.seconds[increment]).collect();
        seconds.sort_by(f64::total_cmp);
        seconds[REPETITIONS / 2]
    };
    Outcome { seconds: [median(0), median(1)], ..runs[0].clone() }
}

fn print(name: &str, count: usize, operations: f64, outcome: &Outcome, expected: &Outcome) {
    let [cold, warm] = outcome.seconds.map(|seconds| count as f64 / seconds);
    // Each equilibrium is factored once more, for its stability and tangent.
    let [first, second] = outcome.iterations.map(|iterations| iterations as f64 / count as f64 + 1.0);
    let worst = outcome.tangents.iter().zip(&expected.tangents);
    let worst = worst.map(|(found, expected)| (found - expected).amax() / expected.amax()).fold(0.0, f64::max);
    println!(
        "| {name} | {cold:.0} | {warm:.0} | {first:.2}, {second:.2} | {:.1} | {:.0} %, {:.0} % | {worst:.0e} | {} |",
        1e-9 * second * warm * operations,
        100.0 * outcome.waiting[0],
        100.0 * outcome.waiting[1],
        outcome.left
    );
}

fn measure(name: &str, network: Network, count: usize) {
    let law = Law::Exponential { youngs_modulus: 1.0e7, nonlinearity: 1.2 };
    let material = FiberMaterial { law, radius: 3.5e-8, density: None };
    let scale = StressScale::FiberVolumeFraction(0.01);
    let model = Model::new(&(), Arc::new(network), Some(material), scale).expect("a model");
    let fibers = model.truss().ends().len();
    let goals: Vec<[Matrix3<f64>; 2]> = (0..count).map(targets).collect();
    let with_level = |level| Some((name_of(level), LaneBatch::with_level(&model, true, level)?));
    let mut batches: Vec<(&str, LaneBatch)> = Level::all().into_iter().filter_map(with_level).collect();
    let mixed = LaneBatch::new(&model, true).map(LaneBatch::with_single_precision);
    batches.extend(mixed.filter(|batch| batch.lanes().has_single_precision()).map(|batch| ("8 lanes, mixed", batch)));
    let Some((_, any)) = batches.first() else { return };
    let operations = any.lanes().operations();
    let mut memory: Vec<String> =
        batches.iter().map(|(_, batch)| format!("{:.0}", 1e-3 * batch.lanes().bytes_per_lane() as f64)).collect();
    memory.dedup();
    println!(
        "\n{name}: {} unknowns, {fibers} fibers, {:.2} MFLOP a factorization, {count} RVEs; {} kB a lane",
        model.unknowns(),
        1e-6 * operations,
        memory.join(", mixed ")
    );
    println!(
        "\n| one core | cold /s | warm /s | factorizations | GFLOP/s of them, warm | lanes would wait | deviation | left |\n|---|---:|---:|---|---:|---|---|---:|"
    );
    let expected = median(|| one_by_one(&model, &goals));
    print("one by one", count, operations, &expected, &expected);
    for (name, batch) in &batches {
        print(name, count, operations, &median(|| in_lanes(batch, &model, &goals)), &expected);
    }
    print_phases(&batches, &model, &goals);
}

fn name_of(level: Level) -> &'static str {
    match level {
        #[cfg(not(target_arch = "x86_64"))]
        Level::Portable => "4 lanes, any machine",
        #[cfg(target_arch = "x86_64")]
        Level::Avx2(_) => "4 lanes, AVX2",
        #[cfg(target_arch = "x86_64")]
        Level::Avx512(_) => "8 lanes, AVX-512",
    }
}

/// Returns a positive definite matrix with the pattern of the stiffness of a network, one in each lane.
fn stiffness<const N: usize>(pattern: &Arc<Sparsity>) -> batched::Matrix<f64, N> {
    let mut matrix = batched::Matrix::zeros(pattern);
    let entries =
        (0..pattern.rows()).flat_map(|row| pattern.row(row).iter().map(move |&column| (row, column as usize)));
    for (value, (row, column)) in matrix.values_mut().iter_mut().zip(entries) {
        let neighbors = pattern.row(row).len() as f64;
        let entry = |lane: usize| {
            if row == column { neighbors + lane as f64 } else { -1.0 / (1.0 + (row.abs_diff(column) % 7) as f64) }
        };
        *value = Lanes(std::array::from_fn(entry));
    }
    matrix
}

/// Returns the median of the seconds of a factorization or solve of each lane.
fn seconds_of_each<const N: usize>(mut action: impl FnMut()) -> f64 {
    let mut seconds: Vec<f64> = (0..101)
        .map(|_| {
            let start = processor_seconds();
            action();
            (processor_seconds() - start) / N as f64
        })
        .collect();
    seconds.sort_by(f64::total_cmp);
    seconds[seconds.len() / 2]
}

/// Prints the times of the factorizations and solves of the backend `batched`, `N` systems at once.
fn measure_batched<const N: usize>(pattern: &Arc<Sparsity>, operations: f64) {
    let params = SolverParams::new(Symmetry::Definite);
    let symbolic = Batched::<f64, N>::analyze(&(), pattern, &params).expect("a symmetric pattern");
    let mut solver = Batched::<f64, N>::solver(&symbolic).expect("a direct solver");
    let matrix = stiffness::<N>(pattern);
    let factor = seconds_of_each::<N>(|| {
        solver.factor(&matrix).expect("a definite matrix");
    });
    let (b, mut x) = (vec![Lanes([1.0; N]); pattern.rows()].into(), vec![Lanes([0.0; N]); pattern.rows()].into());
    let solve = seconds_of_each::<N>(|| {
        solver.solve(&b, &mut x).expect("a factorization");
    });
    let how = if symbolic.uses_vectors() { "side by side" } else { "one by one (`sparse`)" };
    println!("| {N}, {how} | {:.1} | {:.1} | {:.1} |", 1e6 * factor, 1e-9 * operations / factor, 1e6 * solve);
}

fn measure_factorizations(name: &str, network: &Network) {
    let mut unknown = vec![-1_i32; network.nodes().len()];
    (0..).zip(network.interior()).for_each(|(place, &node)| unknown[node as usize] = 3 * place);
    let three = |first: i32| [first, first + 1, first + 2].map(|unknown| if first < 0 { -1 } else { unknown });
    let elements = network.fibers().iter().map(|ends| ends.map(|node| three(unknown[node as usize])).concat());
    let pattern = Sparsity::from_elements(3 * network.interior().len(), elements.collect::<Vec<_>>());
    let pattern = Arc::new(pattern.expect("a small network"));
    let single =
        Sparse::<f64>::analyze(&(), &pattern, &SolverParams::new(Symmetry::Definite)).expect("a symmetric pattern");
    let operations = single.operations().unwrap_or(0.0);
    println!("\n{name}: backend `batched`, {:.2} MFLOP a factorization", 1e-6 * operations);
    println!("\n| lanes | factor, us | GFLOP/s | solve, us |\n|---|---:|---:|---:|");
    measure_batched::<1>(&pattern, operations);
    measure_batched::<4>(&pattern, operations);
    measure_batched::<8>(&pattern, operations);
}

fn main() {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build().expect("a thread");
    pool.install(|| {
        if let Some(folder) = std::env::var_os("BIOTISSUE_NETWORKS") {
            match file::read(&Path::new(&folder).join("Network_2_7.txt")) {
                Ok(read) => {
                    measure_factorizations("`Network_2_7`", &read.network);
                    measure("`Network_2_7`", read.network, 1024);
                }
                Err(error) => eprintln!("{error}"),
            }
        }
        for points in [300, 1000] {
            measure_factorizations(&format!("Delaunay {points}"), &generate::delaunay(points, 1).expect("a network"));
        }
        measure("Delaunay 300", generate::delaunay(300, 1).expect("a network"), 128);
        measure("Voronoi 300", generate::voronoi(300, 1).expect("a network"), 128);
        measure("Delaunay 1000", generate::delaunay(1000, 1).expect("a network"), 16);
    });
}
