//! Counts the iterations of Krylov methods for two matrices and several numbers of entries kept by an incomplete
//! factorization.
//!
//! ```text
//! cargo run --release --package studies --bin ilut [-- FOLDER]
//! ```
//!
//! prints the first table of `docs/ilut.md`. If a folder is given, the matrices are also written there as Matrix
//! Market files for `python3 studies/ilut.py FOLDER`, which repeats the test with the incomplete factorization
//! of SciPy.
//!
//! The matrices are the stiffness of a Delaunay network of 1 000 points at rest (3 000 unknowns, symmetric positive
//! definite), and convection and diffusion on a square grid of 60 by 60 (3 600 unknowns, unsymmetric).

use std::path::PathBuf;
use std::sync::Arc;

use biotissue::backends::sparse::{Matrix, Sparse};
use biotissue::fiber::law::{FiberMaterial, Law};
use biotissue::fiber::network::generate::{GeneratorParams, Kind};
use biotissue::fiber::stiffness::{self, StiffnessSlots};
use biotissue::fiber::truss::{FiberStates, Truss};
use biotissue::las::{
    Backend, Iterative, Krylov, MatrixOps, Preconditioner, Solver, SolverParams, Sparsity, Symmetry, market,
};

type Error = Box<dyn std::error::Error>;

/// Tolerance of the residual, relative to the right-hand side.
const TOLERANCE: f64 = 1e-10;
/// Drop tolerances, and the maximum numbers of entries kept per row of each factor.
const KEPT: [(f64, usize); 5] = [(1e-1, 10), (1e-2, 20), (1e-3, 40), (1e-4, 80), (0.0, usize::MAX)];

fn main() -> Result<(), Error> {
    let folder = std::env::args().nth(1).map(PathBuf::from);
    println!(
        "| matrix | unknowns, entries | ILUT(drop tolerance, fill) | entries of the factors | BiCGSTAB | GMRES(50) | CG |"
    );
    println!("|---|---|---|---|---|---|---|");
    for (name, a, definite) in [("network", network()?, true), ("convection", convection(60)?, false)] {
        if let Some(folder) = &folder {
            std::fs::create_dir_all(folder)?;
            market::write::<Sparse>(&folder.join(format!("{name}.mtx")), &a)?;
        }
        for (drop_tolerance, fill) in KEPT {
            let mut row = Row::default();
            let preconditioner = Preconditioner::Ilut { drop_tolerance, fill };
            let bicgstab = row.iterations(&a, Krylov::BiCgStab, preconditioner)?;
            let gmres = row.iterations(&a, Krylov::Gmres { restart: 50 }, preconditioner)?;
            let cg = if definite { row.iterations(&a, Krylov::Cg, preconditioner)? } else { "".into() };
            let kept = if fill == usize::MAX { "all".into() } else { fill.to_string() };
            println!(
                "| {name} | {}, {} | {drop_tolerance:e}, {kept} | {} | {bicgstab} | {gmres} | {cg} |",
                a.pattern().rows(),
                a.pattern().nnz(),
                row.entries
            );
        }
    }
    Ok(())
}

/// A row of the table.
#[derive(Default)]
struct Row {
    /// Number of entries of the factors.
    entries: usize,
}

impl Row {
    /// Returns the number of iterations for a right-hand side of ones, or "none in 1000" if the method did not
    /// converge.
    fn iterations(&mut self, a: &Matrix, krylov: Krylov, preconditioner: Preconditioner) -> Result<String, Error> {
        let method = Iterative { krylov, preconditioner, tolerance: TOLERANCE, max_iterations: 1000 };
        let params = SolverParams::new(Symmetry::None).iterative(method);
        let mut solver = Sparse::<f64>::solver(&Sparse::<f64>::analyze(&(), a.pattern(), &params)?)?;
        solver.factor(a)?;
        self.entries = solver.incomplete_entries().unwrap_or(0);
        let (b, mut x) = (vec![1.0; a.pattern().rows()].into(), vec![0.0; a.pattern().rows()].into());
        Ok(solver.solve(&b, &mut x).map_or_else(|_| "none in 1000".into(), |report| report.iterations.to_string()))
    }
}

/// Assembles the stiffness of a network at rest.
fn network() -> Result<Matrix, Error> {
    let network = Arc::new(GeneratorParams::new(Kind::Delaunay, 1).of_points(1000)?.network);
    let law = Law::Linear { youngs_modulus: 1.0e8 };
    let material = FiberMaterial { law, radius: 5.0e-8, density: None };
    let truss = Truss::new(Arc::clone(&network), Some(material))?;
    let mut states = FiberStates::default();
    truss.evaluate(network.nodes(), &mut states);
    let pattern = Arc::new(stiffness::pattern(&network)?);
    let mut a = Sparse::<f64>::matrix(&(), &pattern)?;
    StiffnessSlots::<Sparse>::locate(&(), &truss, &pattern)?.assemble(&truss, &states, &mut Vec::new(), &mut a)?;
    Ok(a)
}

/// Assembles `-laplace u + c . grad u` by central differences on a grid of `side` by `side` unknowns.
fn convection(side: i32) -> Result<Matrix, Error> {
    let at = |i: i32, j: i32| i * side + j;
    let mut neighbors = Vec::new();
    for i in 0..side {
        for j in 0..side {
            neighbors.extend([[at(i, j), at((i + 1).min(side - 1), j)], [at(i, j), at(i, (j + 1).min(side - 1))]]);
        }
    }
    let pattern = Arc::new(Sparsity::from_elements((side * side) as usize, neighbors)?);
    let mut a = Sparse::<f64>::matrix(&(), &pattern)?;
    for i in 0..side {
        for j in 0..side {
            a.add(&[at(i, j)], &[at(i, j)], &[4.0])?;
            for (k, l, value) in [(i - 1, j, -1.4), (i + 1, j, -0.6), (i, j - 1, -1.2), (i, j + 1, -0.8)] {
                if (0..side).contains(&k) && (0..side).contains(&l) {
                    a.add(&[at(i, j)], &[at(k, l)], &[value])?;
                }
            }
        }
    }
    Ok(a)
}
