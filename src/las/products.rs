//! Amortized operations on matrices (table 5.2 of the thesis and what its users needed beside it): products, sums,
//! diagonals, and reading all entries. Like solving they are deliberately not zero-overhead.

use std::sync::Arc;

use super::{Backend, SolveError, Sparsity};

/// Matrix and vector.
pub trait MatVec<B: Backend> {
    /// `y = A x`.
    ///
    /// # Errors
    /// [`SolveError::Size`].
    fn mul(&self, x: &B::Vector, y: &mut B::Vector) -> Result<(), SolveError<B::Fault>>;

    /// `y = A^T x`.
    ///
    /// # Errors
    /// [`SolveError::Size`].
    fn mul_transpose(&self, x: &B::Vector, y: &mut B::Vector) -> Result<(), SolveError<B::Fault>>;

    /// `d[i] = A[i, i]`; zero where the pattern has no such entry. Of a rectangular matrix as many as its shorter side has.
    ///
    /// # Errors
    /// [`SolveError::Size`].
    fn diagonal(&self, d: &mut B::Vector) -> Result<(), SolveError<B::Fault>>;

    /// `d[i] = 1 / A[i, i]`.
    ///
    /// # Errors
    /// [`SolveError::ZeroDiagonal`] where an entry (of any lane) is zero; [`SolveError::Size`].
    fn inverse_diagonal(&self, d: &mut B::Vector) -> Result<(), SolveError<B::Fault>>;
}

/// Matrix and matrix. Patterns follow from patterns alone: an entry that cancels stays, with the value zero.
pub trait MatMat<B: Backend>: Sized {
    /// `A *= factor`.
    ///
    /// # Errors
    /// The backend's fault.
    fn scale(&mut self, factor: B::Scalar) -> Result<(), B::Fault>;

    /// `a A + b B`, with the union of both patterns.
    ///
    /// # Errors
    /// [`SolveError::Size`], [`SolveError::TooLarge`].
    fn sum(&self, a: B::Scalar, other: &Self, b: B::Scalar) -> Result<Self, SolveError<B::Fault>>;

    /// `A B`; rectangular matrices too.
    ///
    /// # Errors
    /// [`SolveError::Size`], [`SolveError::TooLarge`].
    fn product(&self, other: &Self) -> Result<Self, SolveError<B::Fault>>;

    /// `A^T`.
    ///
    /// # Errors
    /// [`SolveError::TooLarge`].
    fn transpose(&self) -> Result<Self, SolveError<B::Fault>>;
}

/// All entries of a matrix: what moving it to another backend or into a file needs.
pub trait Entries<B: Backend> {
    /// The entries that the matrix has (of this rank, on a distributed backend), zeros among them.
    ///
    /// # Errors
    /// The backend's fault.
    fn pattern(&self) -> Result<Arc<Sparsity>, B::Fault>;

    /// Calls `visit(row, column, value)` for each of them, row after row, columns ascending.
    ///
    /// # Errors
    /// The backend's fault.
    fn for_each(&self, visit: impl FnMut(usize, usize, B::Scalar)) -> Result<(), B::Fault>;
}
