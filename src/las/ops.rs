//! Vector and matrix operations for hot loops (table 5.1 of the thesis), which assembly loops call millions of times.
//!
//! Every implementation is `#[inline(always)]`. Three rules hold for every backend:
//!
//! * A **negative index** denotes a constrained unknown: writes to it are dropped, and reads leave the caller's buffer
//!   unchanged.
//! * A **write outside the pattern** is a programming error: a `debug_assert!` fails in debug builds, and release
//!   builds drop the value (except `dense`, which stores every entry). A read outside the pattern returns zero. An
//!   index past the end and a block whose size does not match its indices are programming errors too; PETSc reports
//!   both as errors.
//! * Call [`VectorOps::finish`] or [`MatrixOps::finish`] between writing and reading, and between `add` and `set`.
//!   Serial backends do not need this, distributed backends do.
//!
//! # Errors
//! Every operation returns `Result<_, B::Fault>`. A backend that cannot fail has an uninhabited fault type, so that `?`
//! compiles to nothing. A backend that can fail (PETSc) returns its error code, which a direct call would have to check
//! as well.

use super::Backend;

/// The operations of a vector.
pub trait VectorOps<B: Backend>: Sized {
    /// Number of entries (of this rank, on a distributed backend).
    fn len(&self) -> usize;

    /// Returns true if the vector has no entries.
    #[inline(always)]
    fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// `y = 0`.
    fn zero(&mut self) -> Result<(), B::Fault>;

    /// `y[rows[i]] += values[i]`; repeated rows accumulate.
    fn add(&mut self, rows: &[B::Index], values: &[B::Scalar]) -> Result<(), B::Fault>;

    /// `y[rows[i]] = values[i]`; if a row is repeated, the last value is stored.
    fn set(&mut self, rows: &[B::Index], values: &[B::Scalar]) -> Result<(), B::Fault>;

    /// `values[i] = y[rows[i]]`.
    fn get(&self, rows: &[B::Index], values: &mut [B::Scalar]) -> Result<(), B::Fault>;

    /// Euclidean norm.
    fn norm(&self) -> Result<B::Reduced, B::Fault>;

    /// `sum_i x[i] y[i]`.
    fn dot(&self, y: &Self) -> Result<B::Reduced, B::Fault>;

    /// `y += a x`.
    fn axpy(&mut self, a: B::Scalar, x: &Self) -> Result<(), B::Fault>;

    /// Passes the local entries to `read`. The closure guarantees that the entries are restored afterwards.
    fn with_local<R>(&self, read: impl FnOnce(&[B::Scalar]) -> R) -> Result<R, B::Fault>;

    /// Passes the local entries to `write` for modification.
    fn with_local_mut<R>(&mut self, write: impl FnOnce(&mut [B::Scalar]) -> R) -> Result<R, B::Fault>;

    /// Completes pending writes.
    fn finish(&mut self) -> Result<(), B::Fault>;
}

/// The operations of a matrix. Blocks are row-major: `block[i * cols.len() + j]` belongs to `(rows[i], cols[j])`.
pub trait MatrixOps<B: Backend>: Sized {
    /// Returns the number of rows and the number of columns.
    fn shape(&self) -> (usize, usize);

    /// `A = 0`; the pattern does not change.
    fn zero(&mut self) -> Result<(), B::Fault>;

    /// Sets whole rows to zero; the pattern does not change.
    fn zero_rows(&mut self, rows: &[B::Index]) -> Result<(), B::Fault>;

    /// `A[rows[i], cols[j]] += block[i, j]`; repeated indices accumulate.
    fn add(&mut self, rows: &[B::Index], cols: &[B::Index], block: &[B::Scalar]) -> Result<(), B::Fault>;

    /// `A[rows[i], cols[j]] = block[i, j]`; if a position is repeated, the last value is stored.
    fn set(&mut self, rows: &[B::Index], cols: &[B::Index], block: &[B::Scalar]) -> Result<(), B::Fault>;

    /// `block[i, j] = A[rows[i], cols[j]]`.
    fn get(&self, rows: &[B::Index], cols: &[B::Index], block: &mut [B::Scalar]) -> Result<(), B::Fault>;

    /// Appends the positions of a block to `slots`, row by row, for [`MatrixOps::add_at`]. Repeated assembly with fixed
    /// connectivity then searches the pattern only once.
    fn locate(&self, rows: &[B::Index], cols: &[B::Index], slots: &mut Vec<B::Slot>) -> Result<(), B::Fault>;

    /// `A[slots[k]] += block[k]`; the slots come from [`MatrixOps::locate`] of this matrix or of one with the same
    /// pattern.
    fn add_at(&mut self, slots: &[B::Slot], block: &[B::Scalar]) -> Result<(), B::Fault>;

    /// Returns true if this rank stores at least one of these rows. Writes to blocks without such a row are dropped, so
    /// that the assembly need not integrate them. Serial backends store all rows.
    fn owns_any_row(&self, _rows: &[B::Index]) -> bool {
        true
    }

    /// Sets all entries to zero, adds those of `add` and completes the writes.
    fn assemble<E: From<B::Fault>>(&mut self, add: impl FnOnce(&mut Self) -> Result<(), E>) -> Result<(), E> {
        self.zero()?;
        add(self)?;
        Ok(self.finish()?)
    }

    /// Completes pending writes.
    fn finish(&mut self) -> Result<(), B::Fault>;
}
