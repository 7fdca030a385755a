//! How much every node moves in the null space of a positive semidefinite stiffness `K`.
//!
//! `P = s (K + s I)^-1` with a tiny `s` keeps what lies in the null space and shrinks the rest by `s / lambda`: inverse
//! iteration. Applied to as many random vectors as there are zero modes, and made orthonormal, it gives a basis of the
//! null space; the mobility of a node is the sum of squares of its components. Where a basis would be too large,
//! mobilities are estimated: for random signs `z` the expectation of `|(P z)_a|^2` is the trace of the node's block of `P`.
//!
//! Reference for the estimate: C. Bekas, E. Kokiopoulou, Y. Saad, *An estimator for the diagonal of a matrix*, Applied
//! Numerical Mathematics 57 (2007), 1214-1229.

use nalgebra::{Cholesky, DMatrix};

use crate::las::{Backend, SolveError, Solver, VectorOps};

/// The most zero modes of which a basis is made.
const LARGEST_BASIS: usize = 400;
/// Random vectors of the estimate: its standard deviation is about `sqrt(2 / (3 PROBES))`.
const PROBES: usize = 64;
/// Right-hand sides at a time.
const BATCH: usize = 16;
/// Inverse iterations: each shrinks what is not of the null space by at least a thousand where the network's least
/// stiffness that is not zero is a thousand times the shift.
const ITERATIONS: usize = 4;

/// The mobility of every node, and whether it is an estimate; `solver` holds the factor of `K + shift I`.
pub(super) fn mobilities<B: Backend<Scalar = f64>>(
    context: &B::Context,
    solver: &mut B::Solver,
    unknowns: usize,
    modes: usize,
    shift: f64,
) -> Result<(Vec<f64>, bool), SolveError<B::Fault>> {
    let estimated = modes > LARGEST_BASIS;
    let mut columns = random_signs(unknowns, if estimated { PROBES } else { modes });
    let mut room = Room::<B>::new(context, unknowns)?;
    if estimated {
        for _ in 0..2 {
            room.project(solver, &mut columns, shift)?;
        }
    } else {
        for _ in 0..ITERATIONS {
            room.project(solver, &mut columns, shift)?;
            orthonormalize(&mut columns);
        }
    }
    let mut mobility: Vec<f64> =
        (0..unknowns / 3).map(|node| columns.rows(3 * node, 3).iter().map(|x| x * x).sum()).collect();
    if estimated {
        // The sum is known: scaling to it takes out the part of the error that all nodes have in common.
        let sum: f64 = mobility.iter().sum();
        mobility.iter_mut().for_each(|mobility| *mobility *= modes as f64 / sum);
    }
    Ok((mobility, estimated))
}

/// Vectors for the solver to work on.
struct Room<B: Backend> {
    right: Vec<B::Vector>,
    left: Vec<B::Vector>,
}

impl<B: Backend<Scalar = f64>> Room<B> {
    fn new(context: &B::Context, unknowns: usize) -> Result<Self, SolveError<B::Fault>> {
        let vectors = || -> Result<Vec<B::Vector>, SolveError<B::Fault>> {
            (0..BATCH).map(|_| B::vector(context, unknowns).map_err(SolveError::Fault)).collect()
        };
        Ok(Self { right: vectors()?, left: vectors()? })
    }

    /// `X <- s (K + s I)^-1 X`, column by column.
    fn project(
        &mut self,
        solver: &mut B::Solver,
        columns: &mut DMatrix<f64>,
        shift: f64,
    ) -> Result<(), SolveError<B::Fault>> {
        let unknowns = columns.nrows();
        for batch in columns.as_mut_slice().chunks_mut(BATCH * unknowns) {
            let count = batch.len() / unknowns;
            for (right, column) in self.right.iter_mut().zip(batch.chunks_exact(unknowns)) {
                right.with_local_mut(|right| right.copy_from_slice(column)).map_err(SolveError::Fault)?;
                right.finish().map_err(SolveError::Fault)?;
            }
            solver.solve_many(&self.right[..count], &mut self.left[..count])?;
            for (left, column) in self.left.iter().zip(batch.chunks_exact_mut(unknowns)) {
                let scale = |left: &[f64]| column.iter_mut().zip(left).for_each(|(x, y)| *x = shift * y);
                left.with_local(scale).map_err(SolveError::Fault)?;
            }
        }
        Ok(())
    }
}

/// Makes the columns orthonormal: by Cholesky of their Gram matrix, twice, since once loses half of the digits.
fn orthonormalize(columns: &mut DMatrix<f64>) {
    for _ in 0..2 {
        let gram = columns.tr_mul(columns);
        match Cholesky::new(gram).and_then(|factor| factor.l().try_inverse()) {
            Some(inverse) => *columns = &*columns * inverse.transpose(),
            // Nearly dependent columns: slower, but nothing stops it.
            None => *columns = columns.clone().qr().q(),
        }
    }
}

/// Columns of random signs by SplitMix64, whose sequence never changes (Steele, Lea and Flood, OOPSLA 2014).
fn random_signs(rows: usize, columns: usize) -> DMatrix<f64> {
    let mut state = 0x5eed_u64;
    DMatrix::from_fn(rows, columns, |_, _| {
        state = state.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = state;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        if (z ^ (z >> 31)) & 1 == 0 { 1.0 } else { -1.0 }
    })
}
