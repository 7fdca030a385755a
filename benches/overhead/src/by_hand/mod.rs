//! The code of a caller who uses the backends by hand: plain arrays and loops, or PETSc's functions, without any trait
//! or code of biotissue.
//!
//! It has the same semantics as LAS, except for PETSc's matrix functions, which do not check indices: negative indices
//! and entries outside the pattern are dropped, and nothing is read or written out of bounds.

pub mod csr;
pub mod cuda;
pub mod four;
pub mod full;
#[cfg(feature = "petsc")]
pub mod petsc;
pub mod slices;

/// A vector.
pub struct Column<T> {
    pub values: Vec<T>,
}

/// The verbs of a backend in memory, with the same names in every way of calling.
macro_rules! in_memory {
    ($(#[$attribute:meta])* $module:ident, $scalar:ty, $slot:ty, $matrix:ty, $norm:path, $dot:path, $axpy:path) => {
        $(#[$attribute])*
        pub mod $module {
            use super::slices;

            pub type Scalar = $scalar;
            pub type Reduced = $scalar;
            pub type Slot = $slot;
            pub type Vector = super::Column<$scalar>;
            pub type Matrix = $matrix;
            /// The return type of a call that cannot fail.
            pub type Outcome<T> = T;

            #[inline(always)]
            pub fn vector_zero(y: &mut Vector) {
                y.values.iter_mut().for_each(|entry| *entry = Scalar::default());
            }

            #[inline(always)]
            pub fn vector_add(y: &mut Vector, rows: &[i32], values: &[Scalar]) {
                slices::add(&mut y.values, rows, values);
            }

            #[inline(always)]
            pub fn vector_set(y: &mut Vector, rows: &[i32], values: &[Scalar]) {
                slices::set(&mut y.values, rows, values);
            }

            #[inline(always)]
            pub fn vector_get(y: &Vector, rows: &[i32], values: &mut [Scalar]) {
                slices::get(&y.values, rows, values);
            }

            #[inline(always)]
            pub fn vector_norm(y: &Vector) -> Reduced {
                $norm(&y.values)
            }

            #[inline(always)]
            pub fn vector_dot(x: &Vector, y: &Vector) -> Reduced {
                $dot(&x.values, &y.values)
            }

            #[inline(always)]
            pub fn vector_axpy(y: &mut Vector, a: Scalar, x: &Vector) {
                $axpy(a, &x.values, &mut y.values);
            }

            #[inline(always)]
            pub fn vector_local(y: &mut Vector, value: Scalar) {
                y.values.iter_mut().for_each(|entry| *entry = value);
            }

            #[inline(always)]
            pub fn vector_finish(_: &mut Vector) {}

            #[inline(always)]
            pub fn matrix_zero(k: &mut Matrix) {
                k.zero();
            }

            #[inline(always)]
            pub fn matrix_zero_rows(k: &mut Matrix, rows: &[i32]) {
                k.zero_rows(rows);
            }

            #[inline(always)]
            pub fn matrix_add(k: &mut Matrix, rows: &[i32], cols: &[i32], block: &[Scalar]) {
                k.add(rows, cols, block);
            }

            #[inline(always)]
            pub fn matrix_set(k: &mut Matrix, rows: &[i32], cols: &[i32], block: &[Scalar]) {
                k.set(rows, cols, block);
            }

            #[inline(always)]
            pub fn matrix_get(k: &Matrix, rows: &[i32], cols: &[i32], block: &mut [Scalar]) {
                k.get(rows, cols, block);
            }

            #[inline(always)]
            pub fn matrix_add_at(k: &mut Matrix, slots: &[Slot], block: &[Scalar]) {
                k.add_at(slots, block);
            }

            #[inline(always)]
            pub fn matrix_finish(_: &mut Matrix) {}
        }
    };
}

in_memory!(
    /// Compressed rows.
    sparse, f64, u32, super::csr::Csr<f64>, slices::norm_or_long, slices::dot_or_long, slices::axpy_or_long
);
in_memory!(
    /// Dense matrices.
    dense, f64, usize, super::full::Full, slices::norm, slices::dot, slices::axpy
);
in_memory!(
    /// Four systems at once.
    batched, super::four::Four, u32, super::csr::Csr<super::four::Four>, super::four::norm, super::four::dot, slices::axpy
);
