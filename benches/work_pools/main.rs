//! Two ways to share the RVEs of a node among its cores: threads of one process take them from a queue, or processes of
//! one thread each take them from a window of memory that they share. Measured are the parts that differ, on the same
//! RVEs in turn: taking an RVE, reading its state and writing it back, the whole sweep, and the memory of each.
//!
//! Run by `cargo bench --package benches --features mpi --bench work_pools`, which starts itself on two processes (the
//! environment variable `MPIRUN` selects a launcher other than `mpirun`). `BIOTISSUE_NETWORKS` is the folder of the published
//! networks; without it only a generated network is timed. Without `--bench` everything runs once with few RVEs.
//!
//! The window is as fast as it can be: states are copied as they are in memory, only those that the next solution starts
//! from, and every process has the data of all networks already.

#[path = "../../tests/support/counting.rs"]
mod counting;
#[path = "../../tests/support/launcher.rs"]
mod launcher;
mod pools;
mod window;

use std::path::PathBuf;
use std::process::ExitCode;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Instant;

use biotissue::backends::comm::mpi::{self as processes, MpiComm};
use biotissue::backends::sparse::Sparse;
use biotissue::fiber::law::{FiberMaterial, Law};
use biotissue::fiber::network::{Network, file, generate};
use biotissue::fiber::rve::{RveModel, StressScale};
use biotissue::las::{Comm, CommError};

use pools::{Body, Parts};
use window::Window;

#[global_allocator]
static ALLOCATOR: counting::Counting = counting::Counting;

type Error = Box<dyn std::error::Error>;

/// Number of threads of the one pool, and of processes of the other.
const CORES: usize = 2;

/// The environment variable that marks the started processes.
const LAUNCHED: &str = "BIOTISSUE_WORK_POOLS_BENCH";

/// The size of the measurement.
#[derive(Clone, Copy)]
struct Extent {
    rves: usize,
    repetitions: usize,
    /// Number of times that each core takes an RVE without solving it.
    takes: usize,
}

fn main() -> ExitCode {
    let is_whole = std::env::args().any(|word| word == "--bench");
    let (rves, repetitions, takes) = if is_whole { (200, 21, 200_000) } else { (6, 1, 100) };
    let extent = Extent { rves, repetitions, takes };
    if std::env::var_os(LAUNCHED).is_some() {
        processes::run(|comm| measure(&comm, extent), |_| 1);
        return ExitCode::SUCCESS;
    }
    match launch() {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("error: {error}");
            ExitCode::FAILURE
        }
    }
}

/// Starts the measurement on processes that may use all cores.
fn launch() -> Result<(), Error> {
    let mut command = launcher::Launcher::find()?.command(CORES, 1200)?;
    command
        .args(std::env::args().skip(1))
        .env(LAUNCHED, "1")
        .env("RAYON_NUM_THREADS", "1")
        .env("OMPI_MCA_hwloc_base_binding_policy", "none");
    let status = command.status()?;
    if status.success() { Ok(()) } else { Err(format!("{command:?}: {status}").into()) }
}

fn measure(comm: &MpiComm, extent: Extent) -> Result<(), Error> {
    let cores = std::thread::available_parallelism()?.get();
    if cores < CORES {
        return Err(format!("{cores} core; the measurement needs {CORES}").into());
    }
    let is_first = comm.rank() == 0;
    if is_first {
        println!("## Taking an RVE, {CORES} cores at once\n\n| by | ns |\n|---|---|");
        println!("| `AtomicU64` of one process | {:.0} |", by_atomic(extent.takes));
        println!("| a queue behind a lock, of one process | {:.0} |", by_queue(extent.takes));
    }
    let by_window = by_window(comm, extent.takes)?;
    if is_first {
        println!("| `MPI_Fetch_and_op` on a shared window | {by_window:.0} |");
        private_bytes().iter().for_each(|bytes| println!("\nA process without RVEs has {:.1} MB.", 1e-6 * bytes));
    }
    for (name, network, material) in networks()? {
        if is_first {
            println!("\n## {name}\n");
        }
        sweeps(comm, extent, network, material)?;
    }
    Ok(())
}

/// The name of a network, the network, and the material of its fibers if its file does not have one.
type NamedNetwork = (&'static str, Network, Option<FiberMaterial>);

fn networks() -> Result<Vec<NamedNetwork>, Error> {
    let law = Law::Exponential { youngs_modulus: 1.0e8, nonlinearity: 1.2 };
    let collagen = FiberMaterial { law, radius: 5.0e-8, density: None };
    let mut networks = Vec::new();
    if let Some(folder) = std::env::var_os("BIOTISSUE_NETWORKS") {
        let path = PathBuf::from(folder).join("Network_2_7.txt");
        networks.push(("Network_2_7", file::read(&path)?.network, None));
    }
    networks.push(("Delaunay, 300 points", generate::delaunay(300, 1)?, Some(collagen)));
    Ok(networks)
}

/// Returns the private memory of this process in bytes; `None` where the system does not tell.
fn private_bytes() -> Option<f64> {
    let text = std::fs::read_to_string("/proc/self/smaps_rollup").ok()?;
    let line = text.lines().find(|line| line.starts_with("Private_Dirty:"))?;
    Some(1024.0 * line.split_whitespace().nth(1)?.parse::<f64>().ok()?)
}

/// Returns the nanoseconds of one of `takes` calls of `take` on each of two threads.
fn of_threads(takes: usize, take: impl Fn() -> u64 + Sync) -> f64 {
    let start = Instant::now();
    std::thread::scope(|scope| {
        (0..CORES).for_each(|_| {
            scope.spawn(|| {
                (0..takes).for_each(|_| {
                    std::hint::black_box(take());
                })
            });
        });
    });
    1e9 * start.elapsed().as_secs_f64() / takes as f64
}

fn by_atomic(takes: usize) -> f64 {
    let next = AtomicU64::new(0);
    let time = of_threads(takes, || next.fetch_add(1, Ordering::Relaxed));
    assert_eq!(next.into_inner(), (CORES * takes) as u64);
    time
}

fn by_queue(takes: usize) -> f64 {
    let queue = std::sync::Mutex::new(0..(CORES * takes) as u64);
    of_threads(takes, || queue.lock().ok().and_then(|mut queue| queue.next()).unwrap_or(0))
}

fn by_window(comm: &MpiComm, takes: usize) -> Result<f64, CommError> {
    let window = Window::new(comm.rank(), size_of::<u64>());
    comm.barrier()?;
    let start = Instant::now();
    (0..takes).for_each(|_| {
        std::hint::black_box(window.fetch_add());
    });
    let mut seconds = [start.elapsed().as_secs_f64()];
    comm.max(&mut seconds)?;
    assert_eq!(window.fetch_add() / takes as u64, CORES as u64, "no number was taken twice");
    comm.barrier()?;
    Ok(1e9 * seconds[0] / takes as f64)
}

fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    values[values.len() / 2]
}

/// Times sweeps of both pools in turn, so that both see the same load of the machine.
fn sweeps(comm: &MpiComm, extent: Extent, network: Network, material: Option<FiberMaterial>) -> Result<(), Error> {
    let (start, before) = (Instant::now(), counting::in_use());
    let model = RveModel::<Sparse>::new(&(), Arc::new(network), material, StressScale::Raw)?;
    let (setup, of_model) = (start.elapsed().as_secs_f64(), counting::in_use() - before);
    let before = counting::in_use();
    let workspace = pools::used_workspace(&model)?;
    let of_workspace = counting::in_use() - before;
    drop(workspace);

    let body = Body::new(&model, extent.rves)?;
    let window = body.window(comm.rank());
    let (mut by_threads, mut by_window) = (Vec::new(), Vec::new());
    let mut parts = [Parts::default(); 2];
    // The first repetition is a warm-up.
    for repetition in 0..=extent.repetitions {
        if comm.rank() == 0 {
            window.set_counter(u64::MAX);
        }
        comm.barrier()?;
        let threads = if comm.rank() == 0 {
            let parts = body.sweep_on_threads(CORES)?;
            window.set_counter(0);
            parts
        } else {
            window.wait_for_zero();
            Parts::default()
        };
        let processes = body.sweep_on_window(comm, &window)?;
        if repetition > 0 {
            by_threads.push(threads.sweep);
            by_window.push(processes.sweep);
            parts = [parts[0].add(threads), parts[1].add(processes)];
        }
    }
    if comm.rank() == 0 {
        let count = (extent.rves * extent.repetitions) as f64;
        let micro = |seconds: f64| format!("{:.2}", 1e6 * seconds / count);
        println!("| | take, us | read, us | solve, us | write, us | processor time, us | {} RVEs, ms |", extent.rves);
        println!("|---|---|---|---|---|---|---|");
        for (name, parts, times) in [("threads", parts[0], by_threads), ("processes, window", parts[1], by_window)] {
            let Parts { take, read, solve, write, processor, .. } = parts;
            let [take, read, solve, write, processor] = [take, read, solve, write, processor].map(micro);
            println!("| {name} | {take} | {read} | {solve} | {write} | {processor} | {:.1} |", 1e3 * median(times));
        }
        println!("\nA state has {} bytes in the window.", body.state_bytes());
        println!(
            "The network with its analysis: {:.0} kB, set up in {:.2} ms; a workspace: {:.0} kB.",
            1e-3 * of_model as f64,
            1e3 * setup,
            1e-3 * of_workspace as f64
        );
    }
    Ok(())
}
