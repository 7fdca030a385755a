//! Solves the Poisson equation and linear elasticity on finer and finer meshes of a cube by conjugate gradients with
//! algebraic multigrid.
//!
//! The number of iterations hardly grows with the number of unknowns. Elasticity passes its near null space, the six
//! rigid motions; the Poisson equation needs none, because the default is constant.
//!
//! ```sh
//! cargo run --release --example multigrid -- 8 16 32
//! ```
//!
//! prints a table for these numbers of cells along a side.

use std::error::Error;
use std::sync::Arc;
use std::time::Instant;

use biotissue::backends::sparse::multigrid::{Multigrid, MultigridParams};
use biotissue::backends::sparse::{Matrix, Sparse, Vector};
use biotissue::fem::assembly::{Assembler, Unknowns, geometry};
use biotissue::fem::material::{Material, NeoHookean};
use biotissue::fem::mesh::shapes;
use biotissue::fem::point_field::PointResponses;
use biotissue::las::{Backend, Iterative, Krylov, MatrixOps, Preconditioner, Solver, SolverParams, Sparsity, Symmetry};
use nalgebra::Matrix3;

/// The displacement at a position.
type Motion = fn(&[f64; 3]) -> [f64; 3];

/// A linear system and the vectors of its near null space.
struct System {
    matrix: Matrix,
    near_null_space: Vec<Vec<f64>>,
}

/// The seven-point Laplacian inside a cube of `cells` cells a side, zero on its surface.
fn poisson(cells: i32) -> Result<System, Box<dyn Error>> {
    let side = cells - 1;
    let at = |[i, j, k]: [i32; 3]| (i * side + j) * side + k;
    let points = || (0..side.pow(3)).map(|n| [n / (side * side), n / side % side, n % side]);
    let edges: Vec<[i32; 2]> = points()
        .flat_map(|p| {
            (0..3).filter(move |&d| p[d] + 1 < side).map(move |d| {
                let mut next = p;
                next[d] += 1;
                [p, next]
            })
        })
        .map(|pair| pair.map(at))
        .collect();
    let pattern = Arc::new(Sparsity::from_elements(side.pow(3) as usize, edges.iter().copied())?);
    let mut matrix = Sparse::<f64>::matrix(&(), &pattern)?;
    for p in points() {
        matrix.add(&[at(p)], &[at(p)], &[6.0])?;
    }
    for edge in &edges {
        matrix.add(edge, edge, &[0.0, -1.0, -1.0, 0.0])?;
    }
    Ok(System { matrix, near_null_space: Vec::new() })
}

/// The stiffness of a cube of `cells` cells a side, six linear tetrahedra each, clamped at `x = 0`.
fn elasticity(cells: i32) -> Result<System, Box<dyn Error>> {
    let mesh = shapes::cuboid([cells as usize; 3], [1.0; 3])?;
    let nodes = mesh.nodes();
    let unknowns = Unknowns::new(nodes.len(), |node, _| nodes[node][0] == 0.0)?;
    let mut matrix = Sparse::<f64>::matrix(&(), &Arc::new(unknowns.pattern(&mesh)?))?;
    let assembler = Assembler::<Sparse>::new(geometry(&mesh)?, &unknowns, &matrix)?;
    let mut responses = PointResponses::zeros(mesh.points().len());
    responses.tangent.fill(NeoHookean { mu: 1.0, lambda: 1.5 }.evaluate(&Matrix3::identity())?.tangent);
    assembler.stiffness(&vec![[0.0; 3]; nodes.len()], &[], &responses, &mut matrix)?;
    let motions: [Motion; 6] = [
        |_| [1.0, 0.0, 0.0],
        |_| [0.0, 1.0, 0.0],
        |_| [0.0, 0.0, 1.0],
        |x| [0.0, -x[2], x[1]],
        |x| [x[2], 0.0, -x[0]],
        |x| [-x[1], x[0], 0.0],
    ];
    let of_free = |motion: Motion| -> Vec<f64> {
        let displacements = nodes.iter().flat_map(motion);
        let numbered = unknowns.equation_numbers().iter().zip(displacements);
        numbered.filter(|(number, _)| **number >= 0).map(|(_, displacement)| displacement).collect()
    };
    Ok(System { matrix, near_null_space: motions.map(of_free).into() })
}

/// Solves a system with a constant right-hand side and prints a row of the table.
fn solve(name: &str, System { matrix, near_null_space }: &System) -> Result<(), Box<dyn Error>> {
    let (pattern, n) = (matrix.pattern(), matrix.pattern().rows());
    let cg = Iterative { preconditioner: Preconditioner::Multigrid, tolerance: 1e-8, ..Iterative::new(Krylov::Cg) };
    let params = SolverParams::new(Symmetry::Definite).iterative(cg);
    let start = Instant::now();
    let mut solver = Sparse::solver(&Sparse::<f64>::analyze(&(), pattern, &params)?)?;
    solver.set_near_null_space(near_null_space)?;
    solver.factor(matrix)?;
    let (setup, start) = (start.elapsed().as_secs_f64(), Instant::now());
    let (b, mut x): (Vector, Vector) = (vec![1.0; n].into(), vec![0.0; n].into());
    let iterations = solver.solve(&b, &mut x)?.iterations;
    let solution = start.elapsed().as_secs_f64();

    // The hierarchy on its own, for its size.
    let mut multigrid = Multigrid::new(pattern, Symmetry::Definite, MultigridParams::default())?;
    multigrid.set_near_null_space(near_null_space)?;
    multigrid.set_up(matrix)?;
    let (levels, complexity) = (multigrid.levels().len(), multigrid.operator_complexity());
    println!("{name:<12}{n:>10}{levels:>8}{complexity:>12.2}{iterations:>12}{setup:>10.3} s{solution:>12.3} s");
    Ok(())
}

fn main() -> Result<(), Box<dyn Error>> {
    let mut cells = std::env::args().skip(1).map(|cells| cells.parse()).collect::<Result<Vec<i32>, _>>()?;
    if cells.is_empty() {
        cells = vec![8, 16, 32];
    }
    println!(
        "{:<12}{:>10}{:>8}{:>12}{:>12}{:>12}{:>14}",
        "", "unknowns", "levels", "complexity", "iterations", "setup", "solution"
    );
    for &cells in &cells {
        solve("Poisson", &poisson(cells.max(2))?)?;
        solve("elasticity", &elasticity(cells.max(1))?)?;
    }
    Ok(())
}
