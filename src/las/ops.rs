//! Vector and matrix operations for hot loops (Tobin 2018, table 5.1).

use num_traits::Zero;

use super::{Backend, BlockSlots};

/// The operations of a vector in assembly loops, which call them millions of times; every implementation should be
/// `#[inline(always)]`.
///
/// # Rules
/// They also hold for [`MatrixOps`]; the [conformance suite](super::conformance) tests them.
///
/// * A **negative index** denotes a constrained unknown: a write to it is dropped, and a read leaves the caller's
///   buffer unchanged.
/// * An **index past the end**, and arguments whose lengths do not match, are programming errors: a `debug_assert!`
///   fails in debug builds, and release builds drop the value, or read zero. `petsc` returns an error for a block whose
///   size does not match its indices, and for vectors of different lengths.
/// * If each rank holds a part of the system ([`RankRows`](super::RankRows)), writes to ghost rows are dropped, and
///   norms, dot products and `finish` are collective.
/// * Call [`VectorOps::finish`] or [`MatrixOps::finish`] between writing and reading, and between `add` and `set`:
///   there `petsc` informs PETSc that the entries of a matrix changed, and a distributed backend may exchange values
///   between ranks. A serial backend does nothing. [`VectorOps::with_local_mut`] both reads and writes.
///
/// # Errors
/// Every operation returns `Result<_, B::Error>`. A backend that cannot fail has an uninhabited error type
/// ([`std::convert::Infallible`]), so that `?` compiles to nothing. A backend that can fail (PETSc) returns its error
/// code, which a direct call would have to check as well.
pub trait VectorOps<B: Backend>: Sized {
    /// Number of entries (of this rank, on a distributed backend).
    fn len(&self) -> usize;

    /// Returns true if the vector has no entries.
    #[inline(always)]
    fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// `y = 0`; pending writes are discarded.
    fn zero(&mut self) -> Result<(), B::Error>;

    /// `y[rows[i]] += values[i]`; repeated rows accumulate.
    fn add(&mut self, rows: &[B::Index], values: &[B::Scalar]) -> Result<(), B::Error>;

    /// `y[rows[i]] = values[i]`; if a row is repeated, the last value is stored.
    fn set(&mut self, rows: &[B::Index], values: &[B::Scalar]) -> Result<(), B::Error>;

    /// `values[i] = y[rows[i]]`; entries of `values` at negative rows do not change.
    fn get(&self, rows: &[B::Index], values: &mut [B::Scalar]) -> Result<(), B::Error>;

    /// Euclidean norm.
    fn norm(&self) -> Result<B::Reduced, B::Error>;

    /// `sum_i x[i] y[i]`.
    fn dot(&self, y: &Self) -> Result<B::Reduced, B::Error>;

    /// `y += a x`.
    fn axpy(&mut self, a: B::Scalar, x: &Self) -> Result<(), B::Error>;

    /// `y = a x + b y`; if `b` is zero, `y` is overwritten even if it is not finite.
    #[inline]
    fn axpby(&mut self, a: B::Scalar, x: &Self, b: B::Scalar) -> Result<(), B::Error> {
        self.with_local_mut(|y| {
            x.with_local(|x| {
                debug_assert_eq!(x.len(), y.len(), "vectors of one length");
                for (y, &x) in y.iter_mut().zip(x) {
                    *y = if b.is_zero() { a * x } else { b * *y + a * x };
                }
            })
        })?
    }

    /// `y[i] = d[i] x[i]`: the product with a diagonal matrix.
    #[inline]
    fn multiply(&mut self, d: &Self, x: &Self) -> Result<(), B::Error> {
        self.with_local_mut(|y| {
            x.with_local(|x| {
                d.with_local(|d| {
                    debug_assert!(x.len() == y.len() && d.len() == y.len(), "vectors of one length");
                    for ((y, &x), &d) in y.iter_mut().zip(x).zip(d) {
                        *y = x * d;
                    }
                })
            })
        })??
    }

    /// Passes the local entries to `read`; they are accessible only until `read` returns.
    fn with_local<R>(&self, read: impl FnOnce(&[B::Scalar]) -> R) -> Result<R, B::Error>;

    /// Passes the local entries to `write` for modification.
    fn with_local_mut<R>(&mut self, write: impl FnOnce(&mut [B::Scalar]) -> R) -> Result<R, B::Error>;

    /// Completes pending writes.
    fn finish(&mut self) -> Result<(), B::Error>;
}

/// The operations of a matrix in assembly loops, which call them millions of times; every implementation should be
/// `#[inline(always)]`.
///
/// Blocks are row-major: `block[i * cols.len() + j]` belongs to `(rows[i], cols[j])`.
///
/// # Rules
/// Those of [`VectorOps`], and:
///
/// * The pattern never changes: `zero` and `zero_rows` leave explicit zeros, and no operation adds an entry.
/// * A **write outside the pattern** is a programming error: in debug builds a `debug_assert!` fails (`add` and `set`
///   of `petsc` return an error), and release builds drop the value (except `dense`, which stores every entry). A
///   **read outside the pattern** returns zero.
/// * `get` and `finish` are collective on a distributed backend: all ranks call them. If each rank holds a part of the
///   system ([`RankRows`](super::RankRows)), `get` reads the own rows, without communication.
///
/// # Errors
/// As in [`VectorOps`].
pub trait MatrixOps<B: Backend>: Sized {
    /// Returns the number of rows and the number of columns.
    fn shape(&self) -> (usize, usize);

    /// `A = 0`, without change of the pattern; pending writes are discarded.
    fn zero(&mut self) -> Result<(), B::Error>;

    /// Sets whole rows to zero, without change of the pattern; negative rows are skipped.
    fn zero_rows(&mut self, rows: &[B::Index]) -> Result<(), B::Error>;

    /// `A[rows[i], cols[j]] += block[i, j]`; repeated indices accumulate.
    fn add(&mut self, rows: &[B::Index], cols: &[B::Index], block: &[B::Scalar]) -> Result<(), B::Error>;

    /// `A[rows[i], cols[j]] = block[i, j]`; if a position is repeated, the last value is stored.
    fn set(&mut self, rows: &[B::Index], cols: &[B::Index], block: &[B::Scalar]) -> Result<(), B::Error>;

    /// `block[i, j] = A[rows[i], cols[j]]`: zero outside the pattern; entries of `block` at negative indices do not
    /// change.
    fn get(&self, rows: &[B::Index], cols: &[B::Index], block: &mut [B::Scalar]) -> Result<(), B::Error>;

    /// Appends the positions of a block to `slots`, row by row, for [`MatrixOps::add_at`]. Repeated assembly with fixed
    /// connectivity then searches the pattern only once. Every pair of a row and a column yields one slot, also at
    /// negative indices.
    fn locate(&self, rows: &[B::Index], cols: &[B::Index], slots: &mut Vec<B::Slot>) -> Result<(), B::Error>;

    /// `A[slots[k]] += block[k]`; the slots come from [`MatrixOps::locate`] of this matrix or of one with the same
    /// pattern.
    fn add_at(&mut self, slots: &[B::Slot], block: &[B::Scalar]) -> Result<(), B::Error>;

    /// Returns the positions of many square blocks of `size` rows and columns each, for [`MatrixOps::add_blocks`].
    /// `indices` holds the `size` indices of each block in turn; negative ones are constrained unknowns.
    ///
    /// # Panics
    /// Panics in debug builds if `indices` is not a multiple of `size` long.
    fn locate_blocks(&self, size: usize, indices: &[B::Index]) -> Result<BlockSlots<B>, B::Error> {
        debug_assert!(size > 0 && indices.len().is_multiple_of(size), "the indices of whole blocks");
        let mut slots = Vec::with_capacity(size * indices.len());
        for rows in indices.chunks_exact(size.max(1)) {
            self.locate(rows, rows, &mut slots)?;
        }
        Ok(BlockSlots::new(size, slots))
    }

    /// Adds many blocks: `A[slots[k]] += block[k]` for each of them, as [`MatrixOps::add_at`] in the order of the
    /// blocks; `slots` comes from [`MatrixOps::locate_blocks`] of this matrix or of one with the same pattern.
    ///
    /// `compute(number, block)` writes all entries of a block, row by row; it returns false if the block adds nothing.
    /// A backend may call it from several threads and repeatedly for the same block. Every entry of the matrix sums its
    /// contributions in the order of the blocks, so that the result has the same bits for any number of threads.
    fn add_blocks(
        &mut self,
        slots: &BlockSlots<B>,
        compute: impl Fn(usize, &mut [B::Scalar]) -> bool + Sync,
    ) -> Result<(), B::Error> {
        let mut block = vec![B::Scalar::default(); slots.size() * slots.size()];
        for (number, slots) in slots.entries().enumerate() {
            if compute(number, &mut block) {
                self.add_at(slots, &block)?;
            }
        }
        Ok(())
    }

    /// Returns true if this rank stores at least one of these rows. Writes to blocks without such a row are dropped, so
    /// that the assembly need not integrate them. Serial backends store all rows.
    fn owns_any_row(&self, _rows: &[B::Index]) -> bool {
        true
    }

    /// Sets all entries to zero, adds those of `add` and completes the writes.
    fn assemble<E: From<B::Error>>(&mut self, add: impl FnOnce(&mut Self) -> Result<(), E>) -> Result<(), E> {
        self.zero()?;
        add(self)?;
        Ok(self.finish()?)
    }

    /// Completes pending writes.
    fn finish(&mut self) -> Result<(), B::Error>;
}
