//! The mobility of every node in the null space of a positive semidefinite stiffness `K`.
//!
//! The method is inverse iteration: `P = s (K + s I)^-1` with a tiny `s` preserves the null space and scales other
//! eigenvectors by about `s / lambda`, with their eigenvalue `lambda`. Applied to as many random vectors as there are
//! zero modes, followed by orthonormalization, it gives a basis of the null space; the mobility of a node is the sum of
//! squares of its components. If the basis would be too large, the mobilities are estimated: for a vector `z` of random
//! signs, the expectation of `|(P z)_a|^2` is the trace of the projector's block of node `a`.
//!
//! Reference for the estimate: C. Bekas, E. Kokiopoulou, Y. Saad, *An estimator for the diagonal of a matrix*, Applied
//! Numerical Mathematics 57 (2007), 1214-1229.

use nalgebra::{Cholesky, DMatrix};

use crate::las::{Backend, RealBackend, SolveError, Solver, VectorOps};

/// Maximum number of zero modes for which a basis is computed.
const MAX_BASIS: usize = 400;
/// Number of random vectors of the estimate, whose relative standard deviation is about `sqrt(2 / (r PROBES))` for a
/// node that moves in `r` directions.
const PROBES: usize = 64;
/// Number of right-hand sides per solve.
const BATCH: usize = 16;
/// Number of inverse iterations. Each damps the components outside the null space by a factor of at least a thousand if
/// the smallest nonzero eigenvalue of the stiffness is a thousand times the shift.
const ITERATIONS: usize = 4;

/// Returns the mobility of every interior node, and whether it is an estimate; `solver` contains the factorization of
/// `K + shift I`, and `modes` is the number of zero modes.
pub(super) fn mobilities<B: RealBackend>(
    context: &B::Context,
    solver: &mut B::Solver,
    unknowns: usize,
    modes: usize,
    shift: f64,
) -> Result<(Vec<f64>, bool), SolveError<B::Error>> {
    let estimated = modes > MAX_BASIS;
    let mut columns = random_signs(unknowns, if estimated { PROBES } else { modes });
    let mut vectors = BatchVectors::<B>::new(context, unknowns)?;
    if estimated {
        for _ in 0..2 {
            vectors.project(solver, &mut columns, shift)?;
        }
    } else {
        for _ in 0..ITERATIONS {
            vectors.project(solver, &mut columns, shift)?;
            orthonormalize(&mut columns);
        }
    }
    let mut mobility: Vec<f64> =
        (0..unknowns / 3).map(|node| columns.rows(3 * node, 3).iter().map(|x| x * x).sum()).collect();
    if estimated {
        // The sum of the mobilities is known: scaling to it removes the part of the error that all nodes share.
        let sum: f64 = mobility.iter().sum();
        mobility.iter_mut().for_each(|mobility| *mobility *= modes as f64 / sum);
    }
    Ok((mobility, estimated))
}

/// Right-hand sides and solutions for the solver.
struct BatchVectors<B: Backend> {
    right: Vec<B::Vector>,
    left: Vec<B::Vector>,
}

impl<B: RealBackend> BatchVectors<B> {
    fn new(context: &B::Context, unknowns: usize) -> Result<Self, SolveError<B::Error>> {
        let vectors = || (0..BATCH).map(|_| B::vector(context, unknowns)).collect::<Result<_, _>>();
        Ok(Self { right: vectors()?, left: vectors()? })
    }

    /// Computes `X <- s (K + s I)^-1 X`, column by column.
    fn project(
        &mut self,
        solver: &mut B::Solver,
        columns: &mut DMatrix<f64>,
        shift: f64,
    ) -> Result<(), SolveError<B::Error>> {
        let unknowns = columns.nrows();
        for batch in columns.as_mut_slice().chunks_mut(BATCH * unknowns) {
            let count = batch.len() / unknowns;
            for (right, column) in self.right.iter_mut().zip(batch.chunks_exact(unknowns)) {
                right.with_local_mut(|right| right.copy_from_slice(column))?;
                right.finish()?;
            }
            solver.solve_many(&self.right[..count], &mut self.left[..count])?;
            for (left, column) in self.left.iter().zip(batch.chunks_exact_mut(unknowns)) {
                let scale = |left: &[f64]| column.iter_mut().zip(left).for_each(|(x, y)| *x = shift * y);
                left.with_local(scale)?;
            }
        }
        Ok(())
    }
}

/// Orthonormalizes the columns by a Cholesky factorization of their Gram matrix, twice, since one pass loses half of
/// the digits.
fn orthonormalize(columns: &mut DMatrix<f64>) {
    for _ in 0..2 {
        let gram = columns.tr_mul(columns);
        match Cholesky::new(gram).and_then(|factor| factor.l().try_inverse()) {
            Some(inverse) => *columns = &*columns * inverse.transpose(),
            // The columns are nearly dependent: QR is slower but always succeeds.
            None => *columns = columns.clone().qr().q(),
        }
    }
}

/// Returns columns of random signs, always the same ones.
fn random_signs(rows: usize, columns: usize) -> DMatrix<f64> {
    let mut state = 0x5eed_u64;
    DMatrix::from_fn(rows, columns, |_, _| if crate::las::splitmix64(&mut state) & 1 == 0 { 1.0 } else { -1.0 })
}
