//! Amortized matrix operations (Tobin 2018, table 5.2, with additions): products, sums, diagonals, and iteration over
//! all entries. Like the solvers, they are deliberately not zero-overhead.

use std::sync::Arc;

use num_traits::{One, Zero};

use super::{Backend, SolveError, Sparsity, Value, VectorOps};

/// Matrix-vector products and diagonals.
pub trait MatVec<B: Backend> {
    /// `y = A x`.
    ///
    /// # Errors
    /// Returns [`SolveError::Size`] if a vector does not fit the matrix.
    fn mul(&self, x: &B::Vector, y: &mut B::Vector) -> Result<(), SolveError<B::Error>>;

    /// `y = A^T x`.
    ///
    /// # Errors
    /// Returns [`SolveError::Size`] if a vector does not fit the matrix.
    fn mul_transpose(&self, x: &B::Vector, y: &mut B::Vector) -> Result<(), SolveError<B::Error>>;

    /// `d[i] = A[i, i]`; zero if the pattern has no such entry. `d` has `min(rows, cols)` entries.
    ///
    /// # Errors
    /// Returns [`SolveError::Size`] if `d` has another length.
    fn diagonal(&self, d: &mut B::Vector) -> Result<(), SolveError<B::Error>>;

    /// `d[i] = 1 / A[i, i]`. The provided implementation is for backends whose local entries of a vector are all of its
    /// entries; a backend that distributes its vectors must override it.
    ///
    /// # Errors
    /// Returns [`SolveError::ZeroDiagonal`] if a diagonal entry (of any lane) is zero, [`SolveError::Size`] if `d` has
    /// another length.
    fn inverse_diagonal(&self, d: &mut B::Vector) -> Result<(), SolveError<B::Error>> {
        self.diagonal(d)?;
        let zero = d.with_local_mut(|d: &mut [B::Scalar]| {
            let zero = d.iter().position(|d| (0..B::Scalar::LANES).any(|lane| d.lane(lane).is_zero()));
            if zero.is_none() {
                d.iter_mut().for_each(|d| *d = B::Scalar::one() / *d);
            }
            zero
        })?;
        d.finish()?;
        zero.map_or(Ok(()), |row| Err(SolveError::ZeroDiagonal { row }))
    }
}

/// Matrix-matrix operations: an extension that a backend may implement. Generic code that needs it states
/// `B: Backend<Matrix: MatMat<B>>`.
///
/// The pattern of a result depends only on the patterns of the operands: an entry that cancels is stored as an explicit
/// zero. Since the backend chooses that pattern, this trait requires [`Entries`], which returns it.
pub trait MatMat<B: Backend>: Entries<B> + Sized {
    /// `A *= factor`.
    ///
    /// # Errors
    /// Returns the backend's error.
    fn scale(&mut self, factor: B::Scalar) -> Result<(), B::Error>;

    /// `a A + b B`, with the union of both patterns.
    ///
    /// # Errors
    /// Returns [`SolveError::Size`] if the shapes differ, [`SolveError::TooLarge`] if the result has too many entries.
    fn sum(&self, a: B::Scalar, other: &Self, b: B::Scalar) -> Result<Self, SolveError<B::Error>>;

    /// `A B`; the matrices may be rectangular.
    ///
    /// # Errors
    /// Returns [`SolveError::Size`] if the shapes do not match, [`SolveError::TooLarge`] if the result has too many
    /// entries.
    fn product(&self, other: &Self) -> Result<Self, SolveError<B::Error>>;

    /// `A^T`.
    ///
    /// # Errors
    /// Returns [`SolveError::TooLarge`] if the result cannot be addressed.
    fn transpose(&self) -> Result<Self, SolveError<B::Error>>;
}

/// Access to all entries of a matrix, for transferring it to another backend or writing it to a file: an extension that
/// a backend may implement. Generic code that needs it states `B: Backend<Matrix: Entries<B>>`.
pub trait Entries<B: Backend> {
    /// The pattern of the stored entries, explicit zeros included. A distributed backend may restrict it to the entries
    /// of this rank; `petsc` returns those of all ranks.
    ///
    /// # Errors
    /// Returns the backend's error.
    fn pattern(&self) -> Result<Arc<Sparsity>, B::Error>;

    /// Calls `visit(row, column, value)` for each stored entry, row by row, in ascending order of columns.
    ///
    /// # Errors
    /// Returns the backend's error.
    fn for_each(&self, visit: impl FnMut(usize, usize, B::Scalar)) -> Result<(), B::Error>;
}
