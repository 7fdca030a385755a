//! PETSc called by hand: vectors through the array of `VecGetArray`, matrices through PETSc's functions, with every
//! return code tested.
#![allow(unsafe_code, reason = "calls PETSc by hand, to compare")]

use std::ffi::{c_int, c_void};

use super::slices;

pub type Scalar = f64;
pub type Reduced = f64;
pub type Slot = u32;
/// A nonzero return code is an error.
pub type Outcome<T> = Result<T, i32>;

const INSERT_VALUES: c_int = 1;
const ADD_VALUES: c_int = 2;
const FINAL_ASSEMBLY: c_int = 0;

unsafe extern "C" {
    fn VecDot(x: *mut c_void, y: *mut c_void, dot: *mut f64) -> c_int;
    fn VecAXPY(y: *mut c_void, a: f64, x: *mut c_void) -> c_int;
    fn MatSetValues(
        mat: *mut c_void,
        m: c_int,
        rows: *const c_int,
        n: c_int,
        cols: *const c_int,
        values: *const f64,
        mode: c_int,
    ) -> c_int;
    fn MatGetValues(
        mat: *mut c_void,
        m: c_int,
        rows: *const c_int,
        n: c_int,
        cols: *const c_int,
        values: *mut f64,
    ) -> c_int;
    fn MatZeroEntries(mat: *mut c_void) -> c_int;
    fn MatZeroRows(
        mat: *mut c_void,
        count: c_int,
        rows: *const c_int,
        diagonal: f64,
        x: *mut c_void,
        b: *mut c_void,
    ) -> c_int;
    fn MatSetOption(mat: *mut c_void, option: c_int, on: c_int) -> c_int;
    fn MatAssemblyBegin(mat: *mut c_void, kind: c_int) -> c_int;
    fn MatAssemblyEnd(mat: *mut c_void, kind: c_int) -> c_int;
}

/// A `Vec`, and the array from `VecGetArray`.
pub struct Vector {
    pub vec: *mut c_void,
    pub array: *mut f64,
    pub len: usize,
}

/// A `Mat`, and the array from `MatSeqAIJGetArray`.
pub struct Matrix {
    pub mat: *mut c_void,
    pub array: *mut f64,
    pub len: usize,
}

impl Matrix {
    /// Sets the option that keeps the entries of zeroed rows in the sparsity pattern, as in LAS.
    pub fn keep_pattern(self) -> Outcome<Self> {
        /// `MAT_KEEP_NONZERO_PATTERN`.
        const KEEP_PATTERN: c_int = 6;
        // SAFETY: a live matrix.
        checked(unsafe { MatSetOption(self.mat, KEEP_PATTERN, 1) })?;
        Ok(self)
    }
}

fn checked(code: c_int) -> Outcome<()> {
    if code == 0 { Ok(()) } else { Err(code) }
}

impl Vector {
    #[inline(always)]
    fn values(&self) -> &[f64] {
        if self.len == 0 {
            return &[];
        }
        // SAFETY: `len` numbers that are not written through another pointer.
        unsafe { std::slice::from_raw_parts(self.array, self.len) }
    }

    #[inline(always)]
    fn values_mut(&mut self) -> &mut [f64] {
        if self.len == 0 {
            return &mut [];
        }
        // SAFETY: as above, and borrowed exclusively.
        unsafe { std::slice::from_raw_parts_mut(self.array, self.len) }
    }
}

/// Calls PETSc, which reports vectors of different lengths.
#[cold]
#[inline(never)]
fn dot_by_petsc(x: &Vector, y: &Vector) -> Outcome<f64> {
    let mut dot = 0.0;
    // SAFETY: live vectors.
    checked(unsafe { VecDot(x.vec, y.vec, &raw mut dot) })?;
    Ok(dot)
}

#[cold]
#[inline(never)]
fn axpy_by_petsc(y: &mut Vector, a: f64, x: &Vector) -> Outcome<()> {
    // SAFETY: two distinct live vectors.
    checked(unsafe { VecAXPY(y.vec, a, x.vec) })
}

#[inline(always)]
pub fn vector_zero(y: &mut Vector) -> Outcome<()> {
    y.values_mut().fill(0.0);
    Ok(())
}

#[inline(always)]
pub fn vector_add(y: &mut Vector, rows: &[i32], values: &[f64]) -> Outcome<()> {
    slices::add(y.values_mut(), rows, values);
    Ok(())
}

#[inline(always)]
pub fn vector_set(y: &mut Vector, rows: &[i32], values: &[f64]) -> Outcome<()> {
    slices::set(y.values_mut(), rows, values);
    Ok(())
}

#[inline(always)]
pub fn vector_get(y: &Vector, rows: &[i32], values: &mut [f64]) -> Outcome<()> {
    slices::get(y.values(), rows, values);
    Ok(())
}

#[inline(always)]
pub fn vector_norm(y: &Vector) -> Outcome<f64> {
    Ok(slices::norm(y.values()))
}

#[inline(always)]
pub fn vector_dot(x: &Vector, y: &Vector) -> Outcome<f64> {
    if x.len != y.len {
        return dot_by_petsc(x, y);
    }
    Ok(slices::dot(x.values(), y.values()))
}

#[inline(always)]
pub fn vector_axpy(y: &mut Vector, a: f64, x: &Vector) -> Outcome<()> {
    if x.len != y.len {
        return axpy_by_petsc(y, a, x);
    }
    slices::axpy(a, x.values(), y.values_mut());
    Ok(())
}

#[inline(always)]
pub fn vector_local(y: &mut Vector, value: f64) -> Outcome<()> {
    y.values_mut().iter_mut().for_each(|entry| *entry = value);
    Ok(())
}

#[inline(always)]
pub fn vector_finish(_: &mut Vector) -> Outcome<()> {
    Ok(())
}

#[inline(always)]
pub fn matrix_zero(k: &mut Matrix) -> Outcome<()> {
    // SAFETY: a live matrix.
    checked(unsafe { MatZeroEntries(k.mat) })
}

#[inline(always)]
pub fn matrix_zero_rows(k: &mut Matrix, rows: &[i32]) -> Outcome<()> {
    let null = std::ptr::null_mut();
    // SAFETY: a live matrix, rows in range; no solution and no right-hand side are passed.
    checked(unsafe { MatZeroRows(k.mat, rows.len() as i32, rows.as_ptr(), 0.0, null, null) })
}

#[inline(always)]
pub fn matrix_add(k: &mut Matrix, rows: &[i32], cols: &[i32], block: &[f64]) -> Outcome<()> {
    let (m, n) = (rows.len() as i32, cols.len() as i32);
    // SAFETY: a live matrix; the caller guarantees indices in range and one value per pair.
    checked(unsafe { MatSetValues(k.mat, m, rows.as_ptr(), n, cols.as_ptr(), block.as_ptr(), ADD_VALUES) })
}

#[inline(always)]
pub fn matrix_set(k: &mut Matrix, rows: &[i32], cols: &[i32], block: &[f64]) -> Outcome<()> {
    let (m, n) = (rows.len() as i32, cols.len() as i32);
    // SAFETY: as above.
    checked(unsafe { MatSetValues(k.mat, m, rows.as_ptr(), n, cols.as_ptr(), block.as_ptr(), INSERT_VALUES) })
}

#[inline(always)]
pub fn matrix_get(k: &Matrix, rows: &[i32], cols: &[i32], block: &mut [f64]) -> Outcome<()> {
    let (m, n) = (rows.len() as i32, cols.len() as i32);
    // SAFETY: as above.
    checked(unsafe { MatGetValues(k.mat, m, rows.as_ptr(), n, cols.as_ptr(), block.as_mut_ptr()) })
}

#[inline(always)]
pub fn matrix_add_at(k: &mut Matrix, slots: &[u32], block: &[f64]) -> Outcome<()> {
    let values: &mut [f64] = if k.len == 0 {
        &mut []
    } else {
        // SAFETY: `len` entries of the matrix, borrowed exclusively.
        unsafe { std::slice::from_raw_parts_mut(k.array, k.len) }
    };
    for (&slot, &value) in slots.iter().zip(block) {
        if let Some(entry) = values.get_mut(slot as usize) {
            *entry += value;
        }
    }
    Ok(())
}

#[inline(always)]
pub fn matrix_finish(k: &mut Matrix) -> Outcome<()> {
    // SAFETY: a live matrix.
    checked(unsafe { MatAssemblyBegin(k.mat, FINAL_ASSEMBLY) })?;
    // SAFETY: the assembly was begun in the call above.
    checked(unsafe { MatAssemblyEnd(k.mat, FINAL_ASSEMBLY) })
}
