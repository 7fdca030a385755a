//! The choice between a direct and an iterative solver, from the sparsity pattern.

use std::fmt;

use super::{Iterative, Krylov, Method, Preconditioner, SolverParams, Symmetry};
use crate::las::Sparsity;

/// Seconds per floating-point operation of a Cholesky factorization on one core.
const DIRECT: f64 = 1.0 / 2e10;

/// How many times as long as Cholesky the factorization of an unsymmetric matrix takes: twice the operations, with
/// pivoting.
const UNSYMMETRIC: f64 = 5.0;

/// Seconds per entry of the matrix to set up the hierarchy of multigrid, on one core.
const SETUP: f64 = 7e-8;

/// Seconds per entry of the matrix to solve one system by multigrid, on one core: a V-cycle and a product take about 3 ns
/// per entry, and 20 of them reach a relative residual of 1e-8 where the problem is not too hard.
const SOLVE: f64 = 6e-8;

/// The iterative solver has to be faster by this factor: the direct one does not depend on the condition of the matrix.
const ADVANTAGE: f64 = 2.0;

/// The solver of a linear system by its size.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "app", derive(serde::Serialize, serde::Deserialize))]
pub struct SolverChoice {
    /// The chosen method.
    pub method: Method,
    /// Number of unknowns.
    pub unknowns: usize,
    /// Estimated number of floating-point operations of a factorization.
    pub operations: f64,
    /// Estimated seconds of a direct and of an iterative solution on one core.
    pub seconds: [f64; 2],
    has_multigrid: bool,
}

impl SolverChoice {
    /// Chooses the method for matrices with this pattern and symmetry and this number of right-hand sides per matrix:
    /// direct, or conjugate gradients (GMRES unless the matrix is declared definite) with algebraic multigrid.
    /// `has_multigrid` tells whether the backend has it
    /// ([`Backend::HAS_MULTIGRID`](crate::las::Backend::HAS_MULTIGRID)).
    ///
    /// Takes time proportional to the number of entries.
    pub fn new(pattern: &Sparsity, symmetry: Symmetry, right_hand_sides: usize, has_multigrid: bool) -> Self {
        let first: Vec<u32> = (0..=pattern.rows() as u32).collect();
        Self::by_blocks((pattern, &first), symmetry, right_hand_sides, has_multigrid)
    }

    /// As [`SolverChoice::new`], for matrices whose pattern consists of full blocks: row and column `k` of the given
    /// pattern stand for the unknowns from `first[k]` to before `first[k + 1]`, as in [`Sparsity::expanded`].
    ///
    /// # Panics
    /// Panics if `first` has fewer than one entry per row and one more.
    pub fn by_blocks(
        (blocks, first): (&Sparsity, &[u32]),
        symmetry: Symmetry,
        right_hand_sides: usize,
        has_multigrid: bool,
    ) -> Self {
        let size = |block: u32| (first[block as usize + 1] - first[block as usize]) as f64;
        let operations = operations(blocks, size);
        let of_row = |row: u32| size(row) * blocks.row(row as usize).iter().map(|&column| size(column)).sum::<f64>();
        let entries: f64 = (0..blocks.rows() as u32).map(of_row).sum();
        let of_symmetry = if symmetry == Symmetry::None { UNSYMMETRIC } else { 1.0 };
        let direct = DIRECT * operations * of_symmetry;
        let iterative = entries * (SETUP + SOLVE * right_hand_sides.max(1) as f64);
        // A symmetric matrix may be indefinite.
        let krylov = if symmetry == Symmetry::Definite { Krylov::Cg } else { Krylov::Gmres { restart: 30 } };
        let method = if !has_multigrid || direct <= ADVANTAGE * iterative {
            Method::Direct
        } else {
            let preconditioner = Preconditioner::Multigrid;
            Method::Iterative(Iterative { krylov, preconditioner, tolerance: 1e-10, max_iterations: 300 })
        };
        Self {
            method,
            unknowns: first[blocks.rows()] as usize,
            operations,
            seconds: [direct, iterative],
            has_multigrid,
        }
    }

    /// Returns solver parameters with the chosen method, which falls back to the direct one.
    pub fn params(&self, symmetry: Symmetry) -> SolverParams {
        SolverParams { method: self.method, fallback: true, ..SolverParams::new(symmetry) }
    }
}

/// One line: the method and the reason for it.
impl fmt::Display for SolverChoice {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { seconds: [direct, iterative], .. } = *self;
        let (direct, iterative) = (seconds(direct), seconds(iterative));
        match self.method {
            Method::Direct if !self.has_multigrid => {
                write!(f, "direct: estimated {direct} per system; this backend has no multigrid")
            }
            Method::Direct => {
                let [of_direct, of_iterative] = self.seconds;
                let why = if of_iterative < of_direct { ", less than twice as fast" } else { "" };
                write!(f, "direct: estimated {direct} per system, multigrid {iterative}{why}")
            }
            Method::Iterative(Iterative { krylov, .. }) => {
                let method = if krylov == Krylov::Cg { "conjugate gradients" } else { "GMRES" };
                write!(f, "{method} with multigrid: estimated {iterative} per system, a direct solver {direct}")
            }
        }
    }
}

/// Returns a time with one or two digits.
fn seconds(value: f64) -> String {
    match value {
        _ if value < 1e-3 => "less than 1 ms".into(),
        _ if value < 0.1 => format!("{:.0} ms", 1e3 * value),
        _ if value < 10.0 => format!("{value:.1} s"),
        _ => format!("{value:.0} s"),
    }
}

/// Estimates the number of operations of a Cholesky factorization in a good order; row `k` stands for `size(k)`
/// unknowns.
///
/// The breadth-first levels from a node at the end of the body are separators. Eliminating levels one after the other
/// takes about `7/3 w^3` operations for every level of `w` unknowns; a body that is about as long as it is wide is
/// better divided into halves again and again, and the last separator takes most of the work, about `w^3/3` with its
/// width `w`. Levels of a box from a corner are diagonal planes, wider than the separator.
fn operations(pattern: &Sparsity, size: impl Fn(u32) -> f64) -> f64 {
    let mut estimate = 0.0;
    let mut visited = vec![false; pattern.rows()];
    for start in 0..pattern.rows() {
        if !visited[start] {
            let first = levels(pattern, start, &mut visited);
            let end = first.last().and_then(|level| level.first()).map_or(start, |&row| row as usize);
            first.iter().flatten().for_each(|&row| visited[row as usize] = false);
            let levels = levels(pattern, end, &mut visited);
            let widths: Vec<f64> = levels.iter().map(|level| level.iter().map(|&row| size(row)).sum()).collect();
            estimate += of_component(&widths);
        }
    }
    estimate
}

/// Estimates the operations of a connected component from the number of unknowns in its levels.
fn of_component(widths: &[f64]) -> f64 {
    let banded: f64 = widths.iter().map(|w| 7.0 / 3.0 * w.powi(3)).sum();
    let mut sorted = widths.to_vec();
    sorted.sort_by(f64::total_cmp);
    let median = sorted.get(sorted.len() / 2).copied().unwrap_or(0.0);
    let dissected = DISSECTED * median.powi(3) * (widths.len() as f64 * median / (median.powf(1.5))).max(1.0);
    banded.min(dissected)
}

/// Operations of nested dissection over the cube of the width of the largest separator.
const DISSECTED: f64 = 15.0;

/// Returns the breadth-first levels from a row.
fn levels(pattern: &Sparsity, start: usize, visited: &mut [bool]) -> Vec<Vec<u32>> {
    visited[start] = true;
    let mut levels = vec![vec![start as u32]];
    while let Some(level) = levels.last() {
        let mut next = Vec::new();
        for &row in level {
            for &column in pattern.row(row as usize) {
                if !std::mem::replace(&mut visited[column as usize], true) {
                    next.push(column);
                }
            }
        }
        if next.is_empty() {
            break;
        }
        levels.push(next);
    }
    levels
}

#[cfg(test)]
mod tests;
