//! Products, sums, diagonals and the traversal of all entries.

use std::sync::Arc;

use super::context::MatrixType;
use super::error::PetscError;
use super::handle::Handle;
use super::matrix::DistributedVector;
use super::session::call;
use super::{Matrix, Petsc, SolverError, Vector, ffi};
use crate::backends::checks::check_size;
use crate::las::{Backend, Entries, MatMat, MatVec, MatrixOps, SolveError, Sparsity, VectorOps};

/// Copies the part of this rank from a whole vector to a distributed vector.
pub(super) fn scatter(whole: &[f64], own: std::ops::Range<usize>, part: &DistributedVector) -> Result<(), PetscError> {
    let (raw, mut values) = (part.raw(), std::ptr::null_mut());
    // SAFETY: a live vector.
    call(|| unsafe { ffi::VecGetArray(raw, &raw mut values) })?;
    if !own.is_empty() {
        // SAFETY: this rank owns that many entries of the vector; the two memory areas are distinct.
        unsafe { std::ptr::copy_nonoverlapping(whole[own.clone()].as_ptr(), values, own.len()) };
    }
    // SAFETY: borrowed just above.
    call(|| unsafe { ffi::VecRestoreArray(raw, &raw mut values) })
}

impl Matrix {
    /// Gathers the parts of all ranks into a whole vector.
    pub(super) fn gather(&self, part: &DistributedVector, whole: &mut Vector) -> Result<(), PetscError> {
        let (raw, mut values) = (part.raw(), std::ptr::null());
        let len = whole.as_slice().len();
        let own = self.context.own_range(len).len();
        // SAFETY: a live vector.
        call(|| unsafe { ffi::VecGetArrayRead(raw, &raw mut values) })?;
        // SAFETY: this rank owns that many entries of the vector; they are read before the array is restored.
        let slice = if own == 0 { &[][..] } else { unsafe { std::slice::from_raw_parts(values, own) } };
        self.context.gather(slice, len, |row| row, whole.as_mut_slice());
        // SAFETY: borrowed above.
        call(|| unsafe { ffi::VecRestoreArrayRead(raw, &raw mut values) })
    }

    /// Computes `y = A x` or `y = A^T x`.
    fn multiply(&self, x: &Vector, y: &mut Vector, transposed: bool) -> Result<(), PetscError> {
        let a = self.raw();
        let product = |x, y| {
            // SAFETY: live objects whose sizes were checked; two vectors.
            call(|| unsafe { if transposed { ffi::MatMultTranspose(a, x, y) } else { ffi::MatMult(a, x, y) } })
        };
        if self.context.shares_vectors() {
            product(x.raw()?, y.raw()?)?;
            return y.update_ghosts();
        }
        let [right, left] = self.distributed_vectors()?;
        let (from, to) = if transposed { (left, right) } else { (right, left) };
        scatter(x.as_slice(), self.context.own_range(x.len()), from)?;
        product(from.raw(), to.raw())?;
        self.gather(to, y)
    }

    /// Returns the numbers of own entries of a product and of a vector to multiply.
    fn lens(&self) -> (usize, usize) {
        let (rows, cols) = self.shape();
        (rows, if self.is_part() { rows } else { cols })
    }

    /// Returns true if each rank holds a part of the system.
    fn is_part(&self) -> bool {
        self.context.parts().is_some()
    }

    /// Returns an error if each rank holds a part of the system.
    fn check_whole(&self) -> Result<(), PetscError> {
        if self.is_part() {
            let text = "a rank that holds a part of a matrix cannot visit the entries of all ranks".to_owned();
            return Err(PetscError::found(ffi::ERR_SUP, "", text));
        }
        Ok(())
    }

    /// Adds `A += factor other`; the pattern of `other` must be part of that of `A`.
    fn add_scaled(&mut self, factor: f64, other: ffi::Mat) -> Result<(), PetscError> {
        let raw = self.raw();
        // SAFETY: live matrices of one shape and distribution.
        call(|| unsafe { ffi::MatAXPY(raw, factor, other, ffi::SUBSET_NONZERO_PATTERN) })?;
        self.assemble()
    }

    /// Converts the matrix to the type that the context requests.
    fn into_context_type(self) -> Result<Self, PetscError> {
        if self.context.matrix_type() == MatrixType::Aij {
            return Ok(self);
        }
        let mut stored = Self::zeros(&self.context, self.pattern())?;
        stored.copy_values(&self)?;
        Ok(stored)
    }

    /// Copies the matrix that PETSc computes into a pattern that depends only on the patterns of the operands.
    fn in_pattern(&self, pattern: Sparsity, make: impl FnOnce(*mut ffi::Mat) -> ffi::Code) -> Result<Self, PetscError> {
        let mut result = Self::zeros_aij(&self.context, &Arc::new(pattern))?;
        if result.pattern().nnz() > 0 {
            let made = Handle::new(self.context.session(), make)?;
            result.add_scaled(1.0, made.raw())?;
        }
        result.into_context_type()
    }
}

impl MatVec<Petsc> for Matrix {
    fn mul(&self, x: &Vector, y: &mut Vector) -> Result<(), SolverError> {
        let (rows, cols) = self.lens();
        check_size("the vector to multiply", x.len(), cols)?;
        check_size("the product", y.len(), rows)?;
        Ok(self.multiply(x, y, false)?)
    }

    fn mul_transpose(&self, x: &Vector, y: &mut Vector) -> Result<(), SolverError> {
        let (rows, cols) = self.lens();
        check_size("the vector to multiply", x.len(), rows)?;
        check_size("the product", y.len(), cols)?;
        Ok(self.multiply(x, y, true)?)
    }

    fn diagonal(&self, d: &mut Vector) -> Result<(), SolverError> {
        let (rows, cols) = self.lens();
        check_size("the diagonal", d.len(), rows.min(cols))?;
        for (row, d) in d.as_mut_slice().iter_mut().enumerate() {
            let at = self.layout.row(row as i32).and_then(|own| own.find(row as i32));
            *d = at.map_or(0.0, |at| self.values.get(at));
        }
        if self.context.parts().is_none() {
            self.context.sum(d.as_mut_slice());
        }
        Ok(d.update_ghosts()?)
    }

    fn inverse_diagonal(&self, d: &mut Vector) -> Result<(), SolverError> {
        self.diagonal(d)?;
        if let Some(row) = self.context.first_of_parts(d.as_slice().iter().position(|&entry| entry == 0.0)) {
            return Err(SolveError::ZeroDiagonal { row });
        }
        d.as_mut_slice().iter_mut().for_each(|entry| *entry = 1.0 / *entry);
        Ok(d.update_ghosts()?)
    }
}

/// Returns the error for an operation that needs all rows of a matrix.
fn unsupported(what: &'static str) -> SolverError {
    let cure = "create the matrix in a context in which every rank has all rows (`Distribution::Copies`)";
    SolveError::Unsupported { backend: Petsc::NAME, what, cure }
}

/// With [`Distribution::Parts`](super::Distribution::Parts), sums, products and transposes are
/// [`SolveError::Unsupported`].
impl MatMat<Petsc> for Matrix {
    fn scale(&mut self, factor: f64) -> Result<(), PetscError> {
        let raw = self.raw();
        // SAFETY: a live matrix.
        call(|| unsafe { ffi::MatScale(raw, factor) })?;
        self.assemble()
    }

    fn sum(&self, a: f64, other: &Self, b: f64) -> Result<Self, SolverError> {
        if self.is_part() || other.is_part() {
            return Err(unsupported("sum of matrices of which each rank holds a part"));
        }
        check_size("the other matrix (rows)", other.shape().0, self.shape().0)?;
        check_size("the other matrix (columns)", other.shape().1, self.shape().1)?;
        let union = self.pattern().union(other.pattern()).map_err(SolveError::TooLarge)?;
        let mut sum = Self::zeros_aij(&self.context, &Arc::new(union))?;
        for (matrix, factor) in [(self, a), (other, b)] {
            if matrix.pattern().nnz() > 0 {
                let copy = matrix.to_aij()?;
                sum.add_scaled(factor, copy.as_ref().unwrap_or(matrix).raw())?;
            }
        }
        Ok(sum.into_context_type()?)
    }

    fn product(&self, other: &Self) -> Result<Self, SolverError> {
        if self.is_part() || other.is_part() {
            return Err(unsupported("product of matrices of which each rank holds a part"));
        }
        check_size("the other matrix (rows)", other.shape().0, self.shape().1)?;
        let pattern = self.pattern().product(other.pattern()).map_err(SolveError::TooLarge)?;
        let copies = (self.to_aij()?, other.to_aij()?);
        let (a, b) = (copies.0.as_ref().unwrap_or(self).raw(), copies.1.as_ref().unwrap_or(other).raw());
        // SAFETY: live matrices whose shapes fit.
        let make = |out| unsafe { ffi::MatMatMult(a, b, ffi::MAT_INITIAL_MATRIX, ffi::DEFAULT_REAL, out) };
        Ok(self.in_pattern(pattern, make)?)
    }

    fn transpose(&self) -> Result<Self, SolverError> {
        if self.is_part() {
            return Err(unsupported("transpose of a matrix of which each rank holds a part"));
        }
        let copy = self.to_aij()?;
        let a = copy.as_ref().unwrap_or(self).raw();
        // SAFETY: a live matrix.
        let make = |out| unsafe { ffi::MatTranspose(a, ffi::MAT_INITIAL_MATRIX, out) };
        Ok(self.in_pattern(self.pattern().transpose(), make)?)
    }
}

/// The entries of all ranks (collective). With [`Distribution::Parts`](super::Distribution::Parts), no rank has them:
/// both methods return an error.
impl Entries<Petsc> for Matrix {
    fn pattern(&self) -> Result<Arc<Sparsity>, PetscError> {
        self.check_whole()?;
        Ok(Arc::clone(&self.layout.pattern))
    }

    fn for_each(&self, mut visit: impl FnMut(usize, usize, f64)) -> Result<(), PetscError> {
        self.check_whole()?;
        let (pattern, mut values) = (&self.layout.pattern, self.all_values().into_iter());
        for row in 0..pattern.rows() {
            for (&column, value) in pattern.row(row).iter().zip(&mut values) {
                visit(row, column as usize, value);
            }
        }
        Ok(())
    }
}
