//! Simulates waves in a magnetized plasma with about two dozen matrices, each on the backend that suits it.
//!
//! ```text
//! cargo build --release --features petsc --example many_matrices
//! mpirun -n 4 target/release/examples/many_matrices
//! ```
//!
//! Fusion-plasma codes advance many coupled fields in time and store a matrix for every coupling of two fields. Most of
//! these matrices are used only in products; a few are used in linear solves. In this example the former are on
//! `sparse`, in the memory of each process, and the latter are transferred to `petsc`, where all processes solve
//! together; vectors are transferred in both directions in every step.
//!
//! The model describes small motions `v` of a plasma around rest in a uniform magnetic field `B`, on a periodic square,
//! with `d/dz = 0`. The perturbation of the field is given by its flux `psi` and its component `b_z`; `p` and `n` are
//! the perturbations of pressure and density. All quantities are dimensionless:
//!
//! ```text
//! rho dv/dt = -grad p + j x B                     j = (dy b_z, -dx b_z, -laplace psi)
//! dpsi/dt = B_y v_x - B_x v_y                     db_z/dt = B . grad v_z - B_z div v
//! dp/dt = -gamma p0 div v                         dn/dt = -div (rho v)
//! ```
//!
//! In short, `rho dv/dt = F w` and `dw/dt = R v`. A time step is semi-implicit, as is usual for tokamaks, so that fast
//! waves do not limit its length: the velocity `v'` at half the step solves `(rho - dt^2/4 F R) v' = rho v + dt/2 F w`;
//! then `w` increases by `dt R v'`, and `v` becomes `2 v' - v`. Viscosity, resistivity, heat conduction along the field
//! and diffusion of particles follow, each with its own solve by the same midpoint rule, so that the energy changes by
//! exactly the dissipated amount.
//!
//! `operators.rs` contains the matrices, `step.rs` the simulation, `checks.rs` the checks of the results.

mod checks;
mod operators;
mod step;

use std::f64::consts::TAU;
use std::process::ExitCode;

use biotissue::backends::petsc::{Context, Petsc};
use biotissue::backends::sparse::Sparse;
use biotissue::las::Backend;

use checks::Check;
use operators::{B, H, NODES, P, V, on_nodes};
use step::{Case, FIELDS, Outcome, STEPS, simulate};

type Error = Box<dyn std::error::Error>;
/// The backend of the matrices that are used only in products.
type Local = Sparse<f64>;

/// Wave numbers of the wave along `x` and `y`.
const WAVE_NUMBERS: [f64; 2] = [TAU, 2.0 * TAU];

/// Returns the wave numbers that central differences give for the wave.
fn numerical_wave_numbers() -> [f64; 2] {
    WAVE_NUMBERS.map(|k| (k * H).sin() / H)
}

/// A standing Alfven wave in a uniform plasma without dissipation: the motion is along `k x B`.
const WAVE: Case = Case {
    density: |_, _| 1.0,
    viscosity: 0.0,
    resistivity: 0.0,
    conduction: 0.0,
    diffusion: 0.0,
    start: |fields| {
        let [kx, ky] = numerical_wave_numbers();
        for (v, along) in V.into_iter().zip([ky * B[2], -kx * B[2], kx * B[1] - ky * B[0]]) {
            fields[v] = on_nodes(|x, y| along * (WAVE_NUMBERS[0] * x + WAVE_NUMBERS[1] * y).cos());
        }
    },
};

/// A pressure pulse in a plasma of nonuniform density, with all dissipative processes.
const PUFF: Case = Case {
    density: |x, y| 1.0 + 0.5 * (TAU * x).sin() * (TAU * y).cos(),
    viscosity: 2e-3,
    resistivity: 1e-3,
    conduction: 2e-2,
    diffusion: 1e-3,
    start: |fields| fields[P] = on_nodes(|x, y| (-50.0 * ((x - 0.5).powi(2) + (y - 0.5).powi(2))).exp()),
};

fn main() -> ExitCode {
    let context = match Context::world() {
        Ok(context) => context,
        Err(error) => {
            eprintln!("error: {error}");
            return ExitCode::FAILURE;
        }
    };
    let checks = run(&context).unwrap_or_else(|error| {
        eprintln!("error: {error}");
        // Exits without finalizing PETSc, which would wait for the other ranks; they may be waiting for this one.
        std::process::exit(1)
    });
    let failed: Vec<_> = checks.iter().filter(|check| !check.is_met()).map(|check| check.what).collect();
    if failed.is_empty() {
        return ExitCode::SUCCESS;
    }
    if context.rank() == 0 {
        eprintln!("error: {} of {} checks failed: {}", failed.len(), checks.len(), failed.join("; "));
    }
    ExitCode::FAILURE
}

/// Runs both cases on PETSc, and one of them also without PETSc; returns the same checks on all ranks.
fn run(context: &Context) -> Result<Vec<Check>, Error> {
    let wave = simulate::<Petsc>(context, &WAVE)?;
    let puff = simulate::<Petsc>(context, &PUFF)?;
    let alone = simulate::<Local>(&(), &PUFF)?;
    let mut checks = checks::wave(&wave)?;
    checks.extend(checks::puff(&puff)?);
    checks.push(checks::difference(&puff, &alone));
    if context.rank() == 0 {
        print(&puff, context.ranks(), &checks)?;
    }
    Ok(checks)
}

/// Prints the table of the matrices, the energy balance of the puff, and the checks.
fn print(end: &Outcome<Petsc>, ranks: usize, checks: &[Check]) -> Result<(), Error> {
    println!("{FIELDS} fields on {NODES} nodes, {STEPS} steps; {ranks} ranks for the linear solves\n");
    println!("matrices                     backend   count   entries   use");
    let line = |what: &str, backend: &str, count: usize, entries: usize, used: String| {
        println!("{what:28} {backend:8} {count:6} {entries:9}   {used}");
    };
    let multiplied = end.operators.groups();
    for &(what, count, entries) in &multiplied {
        line(what, Local::NAME, count, entries, "multiplied".into());
    }
    for solved in &end.solved {
        let iterations = match solved.iterations {
            0 => "direct".into(),
            all => format!("{:.1} iterations each", all as f64 / solved.solves as f64),
        };
        line(solved.name, Petsc::NAME, 1, solved.entries, format!("solved {} times, {iterations}", solved.solves));
    }
    let count = multiplied.iter().map(|group| group.1).sum::<usize>() + end.solved.len();
    println!("total                        {:8} {count:6}\n", "");

    let (start, now) = (end.operators.energy(&end.start)?, end.operators.energy(&end.fields)?);
    println!("energy of the puff: {start:.6} at the start, {now:.6} at the end, {:.6} dissipated\n", end.dissipated);
    for check in checks {
        let verdict = if check.is_met() { "ok" } else { "FAILED" };
        println!("{:48} {:8.1e}   below {:5.0e}   {verdict}", check.what, check.found, check.limit);
    }
    Ok(())
}
