//! Times of one RVE by phase on one core, compared with other direct solvers for the same stiffness. All solvers are
//! interleaved in one process; the output is a table in Markdown.
//!
//! `bash benches/comparison/run.sh` builds and runs the program with its dependencies; the arguments are parts of the
//! names of the networks to run. Published networks are read from the folder given by `BIOTISSUE_NETWORKS`. Every time
//! is the minimum of many repetitions, because other load on the machine can only increase a time.

mod cholmod;
mod lanes;
mod memory;
mod ours;
mod phases;
mod plain_faer;
mod system;

use std::path::PathBuf;
use std::sync::Arc;
use std::time::Instant;

use biotissue::fiber::law::{FiberMaterial, Law};
use biotissue::fiber::network::{Network, file, generate};
use biotissue::fiber::rve::{RveModel, StressScale};
use nalgebra::Matrix3;

use system::{Contender, System};

/// Number of right-hand sides of a tangent.
const MODES: usize = 6;

fn main() {
    let wanted: Vec<String> = std::env::args().skip(1).collect();
    let is_wanted = |name: &str| wanted.is_empty() || wanted.iter().any(|part| name.contains(part));
    for (name, make) in NETWORKS.iter().filter(|(name, _)| is_wanted(name)) {
        match make() {
            Some(model) => compare(name, model),
            None => println!("{name}: not there; name its folder in BIOTISSUE_NETWORKS\n"),
        }
    }
}

type Make = fn() -> Option<RveModel<biotissue::backends::sparse::Sparse>>;

const NETWORKS: [(&str, Make); 5] = [
    ("Network_2_7", || published("Network_2_7.txt")),
    ("delaunay-300", || Some(collagen(generate::delaunay(300, 1).expect("enough points")))),
    ("delaunay-1000", || Some(collagen(generate::delaunay(1000, 1).expect("enough points")))),
    ("delaunay-3000", || Some(collagen(generate::delaunay(3000, 1).expect("enough points")))),
    ("del_4450", || published("del_4450seedL5_new_1.txt")),
];

fn published(name: &str) -> Option<RveModel<biotissue::backends::sparse::Sparse>> {
    let folder = PathBuf::from(std::env::var_os("BIOTISSUE_NETWORKS")?);
    let network = file::read(&folder.join(name)).ok()?.network;
    RveModel::new(&(), Arc::new(network), None, StressScale::Raw).ok()
}

fn collagen(network: Network) -> RveModel<biotissue::backends::sparse::Sparse> {
    let law = Law::Exponential { youngs_modulus: 1.0e8, nonlinearity: 1.2 };
    let material = FiberMaterial { law, radius: 5.0e-8, density: None };
    RveModel::new(&(), Arc::new(network), Some(material), StressScale::Raw).expect("a sound material")
}

/// For `Network_2_7` the deformation at which MuMFiM recorded its times, about 1 %; for other networks a larger one.
#[rustfmt::skip]
fn deformation(name: &str) -> Matrix3<f64> {
    if name == "Network_2_7" {
        return Matrix3::new(
            0.999819, -0.000293362, 0.000371752,
            0.000360323, 1.01319, 0.000355325,
            -0.000570166, 0.000635382, 0.999488,
        );
    }
    Matrix3::new(
        1.05, 0.01, 0.0,
        0.0, 0.99, 0.02,
        0.0, 0.0, 1.0,
    )
}

fn compare(name: &str, model: RveModel<biotissue::backends::sparse::Sparse>) {
    let mut system = System::new(name, model, deformation(name));
    phases::print(&mut system);
    let mut contenders: Vec<Box<dyn Contender>> = ours::all(&system);
    if let Some(lanes) = lanes::SideBySide::<4>::new(&system) {
        contenders.push(Box::new(lanes));
    }
    if let Some(lanes) = lanes::SideBySide::<8>::new(&system) {
        contenders.push(Box::new(lanes));
    }
    contenders.push(Box::new(plain_faer::PlainFaer::in_our_order(&system, MODES)));
    contenders.push(Box::new(plain_faer::PlainFaer::new(&system, MODES)));
    for ordering in [cholmod::Ordering::Amd, cholmod::Ordering::Metis] {
        match cholmod::Cholmod::new(&system, ordering) {
            Some(contender) => contenders.push(Box::new(contender)),
            None => println!("CHOLMOD cannot analyze with this ordering"),
        }
    }
    let n = system.pattern.rows();
    let right: Vec<f64> = (0..n * MODES).map(|k| ((k * 7919) % 1000) as f64 / 500.0 - 1.0).collect();
    let mut solution = vec![0.0; right.len()];
    let mut best = vec![[f64::INFINITY; 3]; contenders.len()];
    for contender in &mut contenders {
        contender.factor();
        contender.solve(MODES, &right, &mut solution);
        for (b, x) in right.chunks_exact(n).zip(solution.chunks_exact(n)) {
            assert!(system.residual(b, x) < 1e-6, "{} solves", contender.name());
        }
    }
    let start = Instant::now();
    let mut rounds = 0;
    while rounds < 10 || start.elapsed().as_secs_f64() < 4.0 {
        for (contender, best) in contenders.iter_mut().zip(&mut best) {
            // One factorization that is not timed, so that no solver starts with the caches filled by another one.
            contender.factor();
            let begin = Instant::now();
            contender.factor();
            let factored = Instant::now();
            contender.solve(1, &right, &mut solution);
            let solved = Instant::now();
            contender.solve(MODES, &right, &mut solution);
            let times = [factored - begin, solved - factored, solved.elapsed()];
            let systems = contender.systems() as f64;
            best.iter_mut().zip(times).for_each(|(best, time)| *best = best.min(time.as_secs_f64() / systems));
        }
        rounds += 1;
    }
    println!("| solver | MFLOP | factor | solve | solve, {MODES} right-hand sides |\n|---|---|---|---|---|");
    for (contender, [factor, one, several]) in contenders.iter().zip(best) {
        let operations = contender.operations().map_or_else(String::new, |count| format!("{:.1}", 1e-6 * count));
        let [factor, one, several] = [factor, one, several].map(|seconds| 1e3 * seconds);
        println!("| {} | {operations} | {factor:.4} | {one:.4} | {several:.4} |", contender.name());
    }
    println!();
}
