//! The matrix of type AIJ or BAIJ; each rank stores the rows that it owns.

use std::cell::OnceCell;
use std::ffi::CStr;
use std::sync::Arc;

use super::context::{Context, MatrixType};
use super::error::PetscError;
use super::ffi;
use super::handle::Handle;
use super::layout::Layout;
use super::session::call;
use super::vector::count;
use crate::las::Sparsity;

/// A matrix of PETSc's type AIJ or BAIJ over a fixed pattern. On several ranks, each rank stores the rows that it owns
/// and ignores contributions to other rows.
///
/// With [`Distribution::Parts`](super::Distribution::Parts), the matrix is of type AIJ; its pattern and all indices use
/// the local numbers of the rank. Reading gives zeros for ghost rows and is not collective. Sums, products and
/// transposes of matrices, and the traversal of all entries, are not supported.
#[derive(Debug)]
pub struct Matrix {
    pub(super) layout: Layout,
    pub(super) context: Context,
    pub(super) handle: Handle<ffi::_p_Mat>,
    pub(super) values: Values,
    parts: OnceCell<[DistributedVector; 2]>,
}

/// The arrays of the diagonal and the off-diagonal part on this rank.
#[derive(Debug)]
pub(super) struct Values {
    diagonal: Array,
    off: Array,
    blocked: bool,
}

#[derive(Debug)]
struct Array {
    /// Owned by the enclosing matrix.
    block: ffi::Mat,
    values: *mut f64,
    len: usize,
}

// SAFETY: memory of the matrix that owns it, reached in no other way.
unsafe impl Send for Values {}

/// A distributed vector, of which each rank stores its part.
pub(super) type DistributedVector = Handle<ffi::_p_Vec>;

const AIJ: &CStr = c"aij";
const BAIJ: &CStr = c"baij";

impl Matrix {
    /// Creates a zero matrix of the type that the context requests and the pattern allows.
    pub(super) fn zeros(context: &Context, pattern: &Arc<Sparsity>) -> Result<Self, PetscError> {
        let (mut layout, blocks) = Self::checked_layout(context, pattern)?;
        if context.matrix_type() == MatrixType::Baij && context.parts().is_none() {
            layout.block = blocks;
        }
        Self::of_layout(context, layout, blocks)
    }

    /// Creates a zero matrix of type AIJ.
    pub(super) fn zeros_aij(context: &Context, pattern: &Arc<Sparsity>) -> Result<Self, PetscError> {
        let (layout, blocks) = Self::checked_layout(context, pattern)?;
        Self::of_layout(context, layout, blocks)
    }

    /// Returns the layout of a pattern and the block size, on which all ranks agree.
    fn checked_layout(context: &Context, pattern: &Arc<Sparsity>) -> Result<(Layout, usize), PetscError> {
        context.agree(context.parts().map_or(Ok(()), |parts| parts.check_pattern(pattern)))?;
        let layout = Layout::new(context, pattern);
        let has_blocks = context.holds_for_all(layout.has_blocks(context.block()));
        Ok((layout, if has_blocks { context.block() } else { 1 }))
    }

    fn of_layout(context: &Context, layout: Layout, blocks: usize) -> Result<Self, PetscError> {
        let comm = context.comm();
        // SAFETY: PETSc is initialized and the communicator live.
        let handle = Handle::new(context.session(), |out| unsafe { ffi::MatCreate(comm, out) })?;
        let (raw, kind) = (handle.raw(), if layout.block > 1 { BAIJ } else { AIJ });
        let [own_rows, own_cols, size] = [layout.rows.len(), layout.cols.len(), blocks].map(|size| size as i32);
        let (rows, cols) = layout.shape_of_all();
        let (rows, cols) = (count(rows)?, count(cols)?);
        let (starts, columns) = layout.compressed();
        // SAFETY: a live matrix; arrays of the sizes that a checked pattern has, which PETSc copies.
        call(|| unsafe { ffi::MatSetSizes(raw, own_rows, own_cols, rows, cols) })?;
        call(|| unsafe { ffi::MatSetType(raw, kind.as_ptr()) })?;
        call(|| unsafe { ffi::MatSetBlockSize(raw, size) })?;
        let (starts, columns, zeros) = (starts.as_ptr(), columns.as_ptr(), std::ptr::null());
        // The functions for other types than that of the matrix do nothing.
        if layout.block > 1 {
            call(|| unsafe { ffi::MatSeqBAIJSetPreallocationCSR(raw, size, starts, columns, zeros) })?;
            call(|| unsafe { ffi::MatMPIBAIJSetPreallocationCSR(raw, size, starts, columns, zeros) })?;
        } else {
            call(|| unsafe { ffi::MatSeqAIJSetPreallocationCSR(raw, starts, columns, zeros) })?;
            call(|| unsafe { ffi::MatMPIAIJSetPreallocationCSR(raw, starts, columns, zeros) })?;
        }
        call(|| unsafe { ffi::MatSetOption(raw, ffi::MAT_IGNORE_OFF_PROC_ENTRIES, ffi::TRUE) })?;
        call(|| unsafe { ffi::MatSetOption(raw, ffi::MAT_NEW_NONZERO_LOCATIONS, ffi::FALSE) })?;
        let values = Values::of(raw, &layout, context)?;
        Ok(Self { layout, context: context.clone(), handle, values, parts: OnceCell::new() })
    }

    /// Returns the storage format.
    pub fn matrix_type(&self) -> MatrixType {
        if self.layout.block > 1 { MatrixType::Baij } else { MatrixType::Aij }
    }

    /// Returns the sparsity pattern.
    #[inline(always)]
    pub fn pattern(&self) -> &Arc<Sparsity> {
        &self.layout.pattern
    }

    /// Returns the `Mat`, for PETSc functions that this crate does not call; it lives as long as this matrix. The
    /// caller must not change its nonzero pattern or its type.
    pub fn as_ptr(&self) -> *mut std::ffi::c_void {
        self.raw().cast()
    }

    /// Returns the `Mat`.
    pub(super) fn raw(&self) -> ffi::Mat {
        self.handle.raw()
    }

    /// Informs PETSc that values may have changed.
    pub(super) fn assemble(&mut self) -> Result<(), PetscError> {
        let (raw, kind) = (self.raw(), ffi::MAT_FINAL_ASSEMBLY);
        // SAFETY: a live matrix.
        call(|| unsafe { ffi::MatAssemblyBegin(raw, kind) })?;
        // SAFETY: begun just now.
        call(|| unsafe { ffi::MatAssemblyEnd(raw, kind) })?;
        self.values.invalidate_values()
    }

    /// Copies the values of a matrix with the same pattern.
    pub(super) fn copy_values(&mut self, from: &Self) -> Result<(), PetscError> {
        if self.layout.block == from.layout.block {
            for (to, from) in self.values.slices_mut().into_iter().zip(from.values.slices()) {
                to.copy_from_slice(from);
            }
        } else {
            for row in self.layout.rows.clone() {
                let (Some(to), Some(source)) = (self.layout.row(row as i32), from.layout.row(row as i32)) else {
                    continue;
                };
                for position in 0..to.columns.len() {
                    if let Some(value) = self.values.get_mut(to.at(position)) {
                        *value = from.values.get(source.at(position));
                    }
                }
            }
        }
        self.assemble()
    }

    /// Returns a copy of type AIJ; `None` if the matrix already has that type.
    pub(super) fn to_aij(&self) -> Result<Option<Self>, PetscError> {
        if self.layout.block == 1 {
            return Ok(None);
        }
        let mut copy = Self::zeros_aij(&self.context, self.pattern())?;
        copy.copy_values(self)?;
        Ok(Some(copy))
    }

    /// Returns two distributed vectors: one for the columns (a factor of the product), one for the rows (the product).
    pub(super) fn distributed_vectors(&self) -> Result<&[DistributedVector; 2], PetscError> {
        if let Some(parts) = self.parts.get() {
            return Ok(parts);
        }
        let (raw, session) = (self.raw(), self.context.session());
        // SAFETY: a live matrix; null asks for no vector.
        let right = Handle::new(session, |out| unsafe { ffi::MatCreateVecs(raw, out, std::ptr::null_mut()) })?;
        // SAFETY: as above.
        let left = Handle::new(session, |out| unsafe { ffi::MatCreateVecs(raw, std::ptr::null_mut(), out) })?;
        Ok(self.parts.get_or_init(|| [right, left]))
    }

    /// Gathers the values of all ranks in the order of the pattern.
    pub(super) fn all_values(&self) -> Vec<f64> {
        let layout = &self.layout;
        let mut own = Vec::with_capacity(layout.entries());
        for row in layout.rows.clone() {
            if let Some(row) = layout.row(row as i32) {
                own.extend((0..row.columns.len()).map(|position| self.values.get(row.at(position))));
            }
        }
        let mut whole = vec![0.0; layout.pattern.nnz()];
        let start = |row: usize| layout.pattern.row_offsets()[row] as usize;
        self.context.gather(&own, layout.pattern.rows(), start, &mut whole);
        whole
    }
}

impl Values {
    fn of(raw: ffi::Mat, layout: &Layout, context: &Context) -> Result<Self, PetscError> {
        let (mut diagonal, mut off, mut columns) = (raw, std::ptr::null_mut(), std::ptr::null());
        let (blocked, inside) = (layout.block > 1, layout.diagonal);
        if !context.is_single_rank() {
            let get = if blocked { ffi::MatMPIBAIJGetSeqBAIJ } else { ffi::MatMPIAIJGetSeqAIJ };
            // SAFETY: a live matrix of type mpiaij or mpibaij; both blocks belong to it.
            call(|| unsafe { get(raw, &raw mut diagonal, &raw mut off, &raw mut columns) })?;
        }
        let array = |block, len| Array { block, values: std::ptr::null_mut(), len };
        let (diagonal, off) = (array(diagonal, inside), array(off, layout.entries() - inside));
        let mut values = Self { diagonal, off, blocked };
        values.invalidate_values()?;
        Ok(values)
    }

    /// Informs PETSc that values may have changed, and locates the arrays.
    fn invalidate_values(&mut self) -> Result<(), PetscError> {
        let (get, restore) = if self.blocked {
            (ffi::MatSeqBAIJGetArray as ffi::Array, ffi::MatSeqBAIJRestoreArray as ffi::Array)
        } else {
            (ffi::MatSeqAIJGetArray as ffi::Array, ffi::MatSeqAIJRestoreArray as ffi::Array)
        };
        for array in [&mut self.diagonal, &mut self.off] {
            let (block, mut values) = (array.block, std::ptr::null_mut());
            if block.is_null() {
                continue;
            }
            // SAFETY: a live matrix of type seqaij or seqbaij.
            call(|| unsafe { get(block, &raw mut values) })?;
            array.values = values;
            // SAFETY: borrowed just above. The array does not move: entries are never added.
            call(|| unsafe { restore(block, &raw mut values) })?;
        }
        Ok(())
    }

    /// Returns both arrays.
    #[inline(always)]
    pub(super) fn slices(&self) -> [&[f64]; 2] {
        [&self.diagonal, &self.off].map(|array| {
            if array.len == 0 {
                return &[][..];
            }
            // SAFETY: as many entries as the layout counts, which is what PETSc was told to allocate; they belong to
            // the enclosing matrix, and are written only while it is borrowed exclusively.
            unsafe { std::slice::from_raw_parts(array.values, array.len) }
        })
    }

    /// Returns both arrays, mutably.
    #[inline(always)]
    pub(super) fn slices_mut(&mut self) -> [&mut [f64]; 2] {
        [&mut self.diagonal, &mut self.off].map(|array| {
            if array.len == 0 {
                return &mut [][..];
            }
            // SAFETY: as above, and `self` is borrowed exclusively; the two arrays do not overlap.
            unsafe { std::slice::from_raw_parts_mut(array.values, array.len) }
        })
    }

    /// Returns the value at an array index computed by the layout.
    #[inline(always)]
    pub(super) fn get(&self, at: usize) -> f64 {
        let [diagonal, off] = self.slices();
        diagonal.get(at).or_else(|| off.get(at.wrapping_sub(diagonal.len()))).copied().unwrap_or(0.0)
    }

    /// Returns the value at an array index for modification; `None` if the index is out of range.
    #[inline(always)]
    pub(super) fn get_mut(&mut self, at: usize) -> Option<&mut f64> {
        let [diagonal, off] = self.slices_mut();
        let inside = diagonal.len();
        if at < inside { diagonal.get_mut(at) } else { off.get_mut(at - inside) }
    }
}
