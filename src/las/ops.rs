//! The hot-loop verbs (table 5.1 of the thesis): what assembly loops call millions of times.
//!
//! Every implementation is `#[inline(always)]`. Three rules hold on every backend alike:
//!
//! * A **negative index** is a constrained unknown: writes to it are dropped, reads leave the caller's buffer alone.
//! * A **write outside the pattern** is a programming error: a `debug_assert!` in debug builds, dropped in release
//!   builds (`dense` has every entry, and keeps it). A read outside the pattern gives zero, the value that is there. Indices
//!   beyond the end and blocks of another size than their indices are such errors too; PETSc reports the latter.
//! * Between writing and reading, and between `add` and `set`, stands [`VectorOps::finish`] or [`MatrixOps::finish`];
//!   serial backends need neither, distributed ones do.
//!
//! # Errors
//! Every verb returns `Result<_, B::Fault>`. A backend that cannot fail has an uninhabited fault, so that `?` compiles
//! to nothing; one that can (PETSc) returns its error code, which a checked raw call would have to test as well.

use super::Backend;

/// The verbs of a vector.
pub trait VectorOps<B: Backend>: Sized {
    /// Number of entries (of this rank, on a distributed backend).
    fn len(&self) -> usize;

    /// Whether there is no entry.
    #[inline(always)]
    fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// `y = 0`.
    fn zero(&mut self) -> Result<(), B::Fault>;

    /// `y[rows[i]] += values[i]`; repeated rows accumulate.
    fn add(&mut self, rows: &[B::Index], values: &[B::Scalar]) -> Result<(), B::Fault>;

    /// `y[rows[i]] = values[i]`; of repeated rows the last counts.
    fn set(&mut self, rows: &[B::Index], values: &[B::Scalar]) -> Result<(), B::Fault>;

    /// `values[i] = y[rows[i]]`.
    fn get(&self, rows: &[B::Index], values: &mut [B::Scalar]) -> Result<(), B::Fault>;

    /// Euclidean norm.
    fn norm(&self) -> Result<B::Reduced, B::Fault>;

    /// `sum_i x[i] y[i]`.
    fn dot(&self, y: &Self) -> Result<B::Reduced, B::Fault>;

    /// `y += a x`.
    fn axpy(&mut self, a: B::Scalar, x: &Self) -> Result<(), B::Fault>;

    /// Lends the local entries for reading; a closure, so that the restore cannot be forgotten.
    fn with_local<R>(&self, read: impl FnOnce(&[B::Scalar]) -> R) -> Result<R, B::Fault>;

    /// Lends the local entries for writing.
    fn with_local_mut<R>(&mut self, write: impl FnOnce(&mut [B::Scalar]) -> R) -> Result<R, B::Fault>;

    /// Completes pending writes.
    fn finish(&mut self) -> Result<(), B::Fault>;
}

/// The verbs of a matrix. Blocks are row-major: `block[i * cols.len() + j]` belongs to `(rows[i], cols[j])`.
pub trait MatrixOps<B: Backend>: Sized {
    /// Rows and columns.
    fn shape(&self) -> (usize, usize);

    /// `A = 0`; the pattern stays.
    fn zero(&mut self) -> Result<(), B::Fault>;

    /// Zeroes whole rows; the pattern stays.
    fn zero_rows(&mut self, rows: &[B::Index]) -> Result<(), B::Fault>;

    /// `A[rows[i], cols[j]] += block[i, j]`; repeated indices accumulate.
    fn add(&mut self, rows: &[B::Index], cols: &[B::Index], block: &[B::Scalar]) -> Result<(), B::Fault>;

    /// `A[rows[i], cols[j]] = block[i, j]`; of repeated indices the last counts.
    fn set(&mut self, rows: &[B::Index], cols: &[B::Index], block: &[B::Scalar]) -> Result<(), B::Fault>;

    /// `block[i, j] = A[rows[i], cols[j]]`.
    fn get(&self, rows: &[B::Index], cols: &[B::Index], block: &mut [B::Scalar]) -> Result<(), B::Fault>;

    /// Appends the positions of a block to `slots`, row by row, for [`MatrixOps::add_at`]: an assembly that repeats
    /// with fixed connectivity searches the pattern once.
    fn locate(&self, rows: &[B::Index], cols: &[B::Index], slots: &mut Vec<B::Slot>) -> Result<(), B::Fault>;

    /// `A[slots[k]] += block[k]`; the slots come from [`MatrixOps::locate`] of this matrix or one of the same pattern.
    fn add_at(&mut self, slots: &[B::Slot], block: &[B::Scalar]) -> Result<(), B::Fault>;

    /// Whether this rank keeps one of these rows: of blocks without such rows every write is dropped, so that an assembly need
    /// not integrate them. Backends that know no ranks keep all.
    fn owns_any_row(&self, _rows: &[B::Index]) -> bool {
        true
    }

    /// Completes pending writes.
    fn finish(&mut self) -> Result<(), B::Fault>;
}
