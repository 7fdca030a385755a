//! The solver types: this version has no solver for lanes.

use super::{Batched, Failure, Matrix, Vector};
use crate::las::{Backend, FactorReport, Scalar, SolveError, SolveReport};

/// The type of the symbolic analysis; it has no values.
#[derive(Debug)]
pub enum Symbolic {}

/// The type of the solver; it has no values.
#[derive(Debug)]
pub enum Solver {}

/// Returns the error for the request of a solver, which this backend does not have.
pub(super) fn unsupported<T: Scalar, const N: usize>() -> Failure {
    SolveError::Unsupported {
        backend: Batched::<T, N>::NAME,
        what: "solver in this version",
        cure: "read each lane by las::Entries into a matrix of the backend `sparse`, and solve there",
    }
}

impl<T: Scalar, const N: usize> crate::las::Solver<Batched<T, N>> for Solver {
    fn factor(&mut self, _: &Matrix<T, N>) -> Result<FactorReport, Failure> {
        match *self {}
    }

    fn factor_definite(&mut self, _: &Matrix<T, N>) -> Result<FactorReport, Failure> {
        match *self {}
    }

    fn solve_many(&mut self, _: &[Vector<T, N>], _: &mut [Vector<T, N>]) -> Result<SolveReport, Failure> {
        match *self {}
    }
}
