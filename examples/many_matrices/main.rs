//! Some two dozen matrices, each on the backend that suits it: waves in a magnetized plasma.
//!
//! ```text
//! cargo build --release --features petsc --example many_matrices
//! mpirun -n 4 target/release/examples/many_matrices
//! ```
//!
//! Codes for fusion plasmas step many coupled fields in time and hold a matrix for every coupling of two of them. Most of
//! these are only multiplied with, and a few are solved. Here the former live on `sparse`, in the memory of each process,
//! and the latter are moved to `petsc`, where all processes solve together; vectors go back and forth in every step.
//!
//! The plasma: small motions `v` around rest in a uniform magnetic field `B`, on a periodic square, with `d/dz = 0`. The
//! change of the field is given by its flux `psi` and its component `b_z`; `p` and `n` are those of pressure and density:
//!
//! ```text
//! rho dv/dt = -grad p + j x B                     j = (dy b_z, -dx b_z, -laplace psi)
//! dpsi/dt = B_y v_x - B_x v_y                     db_z/dt = B . grad v_z - B_z div v
//! dp/dt = -gamma p0 div v                         dn/dt = -div (rho v)
//! ```
//!
//! together `rho dv/dt = F w` and `dw/dt = R v`. A step is semi-implicit, as is usual for tokamaks, so that fast waves do not
//! limit it: the velocity halfway solves `(rho - dt^2/4 F R) v' = rho v + dt/2 F w`, and then `w` grows by `dt R v'` and `v`
//! becomes `2 v' - v`. Viscosity, resistivity, conduction of heat along the field and diffusion of particles follow, each by
//! a solve of its own and the same midpoint rule, so that the energy changes by exactly what these take.
//!
//! `operators.rs` has the matrices, `step.rs` the simulation, `checks.rs` what must come of it.

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
/// The backend of what is only multiplied with.
type Local = Sparse<f64>;

/// Waves along `x` and `y` on the square, and how fast the phase of a plane wave rises along them, as differences see it.
const WAVE_NUMBERS: [f64; 2] = [TAU, 2.0 * TAU];

fn seen_wave_numbers() -> [f64; 2] {
    WAVE_NUMBERS.map(|k| (k * H).sin() / H)
}

/// A standing Alfven wave in a uniform plasma where nothing dissipates: the motion is along `k x B`.
const WAVE: Case = Case {
    density: |_, _| 1.0,
    viscosity: 0.0,
    resistivity: 0.0,
    conduction: 0.0,
    diffusion: 0.0,
    start: |fields| {
        let [kx, ky] = seen_wave_numbers();
        for (v, along) in V.into_iter().zip([ky * B[2], -kx * B[2], kx * B[1] - ky * B[0]]) {
            fields[v] = on_nodes(|x, y| along * (WAVE_NUMBERS[0] * x + WAVE_NUMBERS[1] * y).cos());
        }
    },
};

/// A puff of pressure in a plasma of uneven density, with all that dissipates.
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
        // At once: to end PETSc is to wait for the other ranks, which may wait for this one.
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

/// Both cases with PETSc, and one of them without; the same on all ranks.
fn run(context: &Context) -> Result<Vec<Check>, Error> {
    let wave = simulate::<Petsc>(context, &WAVE)?;
    let puff = simulate::<Petsc>(context, &PUFF)?;
    let alone = simulate::<Local>(&(), &PUFF)?;
    let mut checks = checks::wave(&wave)?;
    checks.extend(checks::puff(&puff)?);
    checks.push(checks::same(&puff, &alone));
    if context.rank() == 0 {
        print(&puff, context.ranks(), &checks)?;
    }
    Ok(checks)
}

fn print(end: &Outcome<Petsc>, ranks: usize, checks: &[Check]) -> Result<(), Error> {
    println!("{FIELDS} fields on {NODES} nodes, {STEPS} steps; ranks that solve together: {ranks}\n");
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
            0 => "directly".into(),
            all => format!("{:.1} iterations each", all as f64 / solved.solves as f64),
        };
        line(solved.name, Petsc::NAME, 1, solved.entries, format!("solved {} times, {iterations}", solved.solves));
    }
    let count = multiplied.iter().map(|group| group.1).sum::<usize>() + end.solved.len();
    println!("together                     {:8} {count:6}\n", "");

    let (start, now) = (end.operators.energy(&end.start)?, end.operators.energy(&end.fields)?);
    println!("energy of the puff: {start:.6} at first, {now:.6} at last, {:.6} dissipated\n", end.dissipated);
    for check in checks {
        let verdict = if check.is_met() { "ok" } else { "FAILED" };
        println!("{:46} {:8.1e}   below {:5.0e}   {verdict}", check.what, check.found, check.limit);
    }
    Ok(())
}
