//! Solves the equilibrium of a network of a hundred thousand fibers on PETSc, on any number of ranks.
//!
//! ```text
//! cargo build --release --no-default-features --features petsc,generate --example large_network
//! mpirun -n 1 target/release/examples/large_network --keep stress.txt
//! mpirun -n 4 target/release/examples/large_network --against stress.txt
//! ```
//!
//! The program prints the stress and the times of all phases. `--points N` (15 000) sets the size of the network,
//! `--parts N` (2) the number of increments, `--seconds N` (900) the time limit: the program fails if the limit is
//! exceeded before an increment starts. With `--keep FILE` it writes the stress; with `--against FILE` it fails if the
//! stress differs from the file by 1e-9 or more, relative to its largest entry.

use std::sync::Arc;
use std::time::Instant;

use biotissue::backends::petsc::{Context, Petsc};
use biotissue::fiber::equilibrium::{EquilibriumParams, equilibrate};
use biotissue::fiber::law::{FiberMaterial, Law};
use biotissue::fiber::network::generate;
use biotissue::fiber::rve::{Rve, RveModel, StressScale};
use biotissue::fiber::workspace::Workspace;
use mpi::topology::SimpleCommunicator;
use mpi::traits::{Communicator, Root};
use nalgebra::Matrix3;

type Error = Box<dyn std::error::Error>;

fn main() -> Result<(), Error> {
    let start = Instant::now();
    let (points, parts) = (number("--points", 15_000)?, number("--parts", 2)?.max(1));
    let budget = number("--seconds", 900)? as f64;
    let context = Context::world()?;
    let print = |text: String| {
        if context.rank() == 0 {
            println!("{text}");
        }
    };
    let network = Arc::new(generate::delaunay(points, 1)?);
    print(format!("{} ranks", context.ranks()));
    print(format!(
        "{} nodes, {} fibers, {} unknowns: generated in {:.1} s",
        network.nodes().len(),
        network.fibers().len(),
        3 * network.interior().len(),
        start.elapsed().as_secs_f64()
    ));
    let law = Law::Exponential { youngs_modulus: 1.0e8, nonlinearity: 1.2 };
    let material = FiberMaterial { law, radius: 5.0e-8, density: None };
    let scale = StressScale::FiberVolumeFraction(0.003);
    let model = RveModel::<Petsc>::new(&context, Arc::clone(&network), Some(material), scale)?;
    let mut workspace = Workspace::new(&context, &model)?;
    let mut rve = Rve::at_rest(&network);
    let f = Matrix3::new(1.1, 0.05, 0.0, 0.0, 0.95, 0.02, 0.0, 0.0, 1.0);
    let mut pk1 = Matrix3::zeros();
    for part in 1..=parts {
        let spent = seconds_of_all(&start);
        if spent > budget {
            return Err(format!("{} of {parts} increments took {spent:.0} s, more than the limit", part - 1).into());
        }
        let gradient = Matrix3::identity() + (f - Matrix3::identity()) * (part as f64 / parts as f64);
        let before = Instant::now();
        let solved = equilibrate(&model, &mut rve, &gradient, &EquilibriumParams::default(), &mut workspace)?;
        pk1 = solved.pk1();
        let report = solved.report();
        let seconds = report.newton.seconds;
        print(format!(
            "increment {part}: {} iterations in {:.1} s (factorizations {:.1} s, solutions {:.2} s, assembly {:.2} s)",
            report.iterations,
            before.elapsed().as_secs_f64(),
            seconds.factor,
            seconds.solve,
            seconds.jacobian
        ));
    }
    for row in pk1.row_iter() {
        print(format!("P = {:22.14e} {:22.14e} {:22.14e} Pa", row[0], row[1], row[2]));
    }
    print(format!("total: {:.1} s", start.elapsed().as_secs_f64()));
    if let (Some(file), 0) = (argument("--keep"), context.rank()) {
        let lines: Vec<String> = pk1.iter().map(|p| format!("{p:e}\n")).collect();
        std::fs::write(&file, lines.concat()).map_err(|error| format!("{file}: {error}"))?;
    }
    if let Some(file) = argument("--against") {
        let difference = (pk1 - read(&file)?).amax() / pk1.amax();
        print(format!("difference from {file}: {difference:.1e}"));
        // NaN is an error, too.
        if difference.is_nan() || difference >= 1e-9 {
            return Err(format!("the stress differs from that of {file}").into());
        }
    }
    Ok(())
}

/// Returns the seconds since `start` on rank 0, so that all ranks make the same decision. Collective.
fn seconds_of_all(start: &Instant) -> f64 {
    let mut seconds = start.elapsed().as_secs_f64();
    SimpleCommunicator::world().process_at_rank(0).broadcast_into(&mut seconds);
    seconds
}

/// Returns the argument that follows a flag.
fn argument(flag: &str) -> Option<String> {
    std::env::args().skip_while(|argument| argument != flag).nth(1)
}

/// Returns the number that follows a flag, or `default` without the flag.
fn number(flag: &str, default: usize) -> Result<usize, Error> {
    argument(flag).map_or(Ok(default), |text| text.parse().map_err(|_| format!("{flag} {text}: not a number").into()))
}

/// Reads a stress from a file of nine lines, column by column.
fn read(file: &str) -> Result<Matrix3<f64>, Error> {
    let text = std::fs::read_to_string(file).map_err(|error| format!("{file}: {error}"))?;
    let values = text.lines().map(str::parse).collect::<Result<Vec<f64>, _>>();
    match values {
        Ok(values) if values.len() == 9 => Ok(Matrix3::from_column_slice(&values)),
        _ => Err(format!("{file}: nine numbers, one per line, are expected").into()),
    }
}
