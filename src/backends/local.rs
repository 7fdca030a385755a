//! The vector operations on slices, and the search for a column in a row: shared by all backends whose entries are in
//! the memory of this process.
//!
//! Indices are `i32`. A negative index denotes a constrained unknown; as a `usize` it is larger than any length, so
//! that a single comparison with the length detects both negative and out-of-range indices.
#![cfg_attr(
    not(feature = "sparse"),
    allow(dead_code, unused_imports, unused_macros, reason = "some backends need only a part")
)]

use crate::las::{Scalar, Value};

/// The number of partial sums: independent chains that the compiler can keep in one or two vector registers.
const PARTIAL_SUMS: usize = 8;

/// Sets `y = 0`. It avoids `fill`, which the standard library turns into a memset only for types known to be trivial.
#[inline(always)]
pub(super) fn zero<T: Value>(y: &mut [T]) {
    let zero = T::zero();
    y.iter_mut().for_each(|value| *value = zero);
}

/// Adds: `y[rows[i]] += values[i]`.
#[inline(always)]
pub(super) fn add<T: Value>(y: &mut [T], rows: &[i32], values: &[T]) {
    add_below(y.len(), y, rows, values);
}

/// Does the same as [`add`], but also drops writes to the rows from the end of `y` to `held`.
#[inline(always)]
pub(super) fn add_below<T: Value>(held: usize, y: &mut [T], rows: &[i32], values: &[T]) {
    debug_assert_eq!(rows.len(), values.len(), "one value per row");
    for (&row, &value) in rows.iter().zip(values) {
        match y.get_mut(row as usize) {
            Some(entry) => *entry += value,
            None => debug_assert!(row < 0 || (row as usize) < held, "row {row} of a vector of {held}"),
        }
    }
}

/// Sets `y[rows[i]] = values[i]`.
#[inline(always)]
pub(super) fn set<T: Value>(y: &mut [T], rows: &[i32], values: &[T]) {
    set_below(y.len(), y, rows, values);
}

/// Does the same as [`set`], but also drops writes to the rows from the end of `y` to `held`.
#[inline(always)]
pub(super) fn set_below<T: Value>(held: usize, y: &mut [T], rows: &[i32], values: &[T]) {
    debug_assert_eq!(rows.len(), values.len(), "one value per row");
    for (&row, &value) in rows.iter().zip(values) {
        match y.get_mut(row as usize) {
            Some(entry) => *entry = value,
            None => debug_assert!(row < 0 || (row as usize) < held, "row {row} of a vector of {held}"),
        }
    }
}

/// Reads `values[i] = y[rows[i]]`.
#[inline(always)]
pub(super) fn get<T: Value>(y: &[T], rows: &[i32], values: &mut [T]) {
    debug_assert_eq!(rows.len(), values.len(), "one value per row");
    for (&row, value) in rows.iter().zip(values) {
        match y.get(row as usize) {
            Some(&entry) => *value = entry,
            None => {
                debug_assert!(row < 0, "row {row} of a vector of {}", y.len());
                if row >= 0 {
                    *value = T::zero();
                }
            }
        }
    }
}

/// Returns `sum_i x[i] y[i]`.
#[inline(always)]
pub(super) fn dot<T: Scalar>(x: &[T], y: &[T]) -> T {
    debug_assert_eq!(x.len(), y.len(), "vectors of one length");
    let mut sums = [T::zero(); PARTIAL_SUMS];
    let (x_body, x_tail) = x.as_chunks::<PARTIAL_SUMS>();
    let (y_body, y_tail) = y.as_chunks::<PARTIAL_SUMS>();
    for (x, y) in x_body.iter().zip(y_body) {
        for k in 0..PARTIAL_SUMS {
            sums[k] += x[k] * y[k];
        }
    }
    for (k, (&x, &y)) in x_tail.iter().zip(y_tail).enumerate() {
        sums[k] += x * y;
    }
    sums.into_iter().sum()
}

/// The position that denotes a column not contained in the row; it is beyond the end of every row.
pub(super) const NOT_FOUND: usize = usize::MAX;

/// Returns the position of a column in a row. A negative column is larger than any column as a `u32` and therefore not
/// found.
///
/// The unknowns of a node are consecutive both in the block and in the row; therefore the position after the last one
/// found is tried before the row is searched.
#[inline(always)]
pub(super) fn find(columns: &[u32], next: &mut usize, column: i32) -> usize {
    let column = column as u32;
    let mut position = *next;
    if columns.get(position) != Some(&column) {
        match columns.binary_search(&column) {
            Ok(found) => position = found,
            Err(_) => return NOT_FOUND,
        }
    }
    *next = position + 1;
    position
}

/// Returns the Euclidean norm, scaled if the sum of squares leaves the range of the scalar.
#[inline(always)]
pub(super) fn norm<T: Scalar>(x: &[T]) -> T {
    let squares = dot(x, x);
    if is_in_range(squares) { squares.sqrt() } else { scaled_norm(x) }
}

/// Returns true if a sum of squares neither underflowed nor overflowed.
#[inline(always)]
pub(super) fn is_in_range<T: Scalar>(squares: T) -> bool {
    squares >= T::min_positive_value() && squares <= T::max_value()
}

#[cold]
pub(super) fn scaled_norm<T: Scalar>(x: &[T]) -> T {
    let largest = x.iter().fold(T::zero(), |largest, &v| if v.is_nan() { v } else { largest.max(v.abs()) });
    if largest.is_zero() || !largest.is_finite() || x.iter().any(|v| v.is_nan()) {
        return x.iter().fold(T::zero(), |sum, &v| sum + v.abs());
    }
    let sum: T = x.iter().map(|&v| (v / largest) * (v / largest)).sum();
    largest * sum.sqrt()
}

/// Adds `y += a x`.
#[inline(always)]
pub(super) fn axpy<T: Value>(a: T, x: &[T], y: &mut [T]) {
    debug_assert_eq!(x.len(), y.len(), "vectors of one length");
    for (y, &x) in y.iter_mut().zip(x) {
        *y += a * x;
    }
}

/// Computes `y = a x + b y`; if `b` is zero, `y` is overwritten even if it is not finite.
#[inline]
pub(crate) fn axpby<T: num_traits::Num + Copy>(a: T, x: &[T], b: T, y: &mut [T]) {
    debug_assert_eq!(x.len(), y.len(), "vectors of one length");
    for (y, &x) in y.iter_mut().zip(x) {
        *y = if b.is_zero() { a * x } else { b * *y + a * x };
    }
}

/// Computes `y[i] = d[i] x[i]`.
#[inline]
pub(crate) fn multiply<T: num_traits::Num + Copy>(d: &[T], x: &[T], y: &mut [T]) {
    debug_assert!(x.len() == y.len() && d.len() == y.len(), "vectors of one length");
    for ((y, &x), &d) in y.iter_mut().zip(x).zip(d) {
        *y = x * d;
    }
}

/// Returns true if every value is finite; it has no branch per value and so runs at memory bandwidth.
#[inline]
pub(super) fn all_finite<T: Scalar>(values: &[T]) -> bool {
    // Zero times a value that is not finite is NaN, and remains NaN in a sum.
    let mut sums = [T::zero(); PARTIAL_SUMS];
    let (body, tail) = values.as_chunks::<PARTIAL_SUMS>();
    for values in body {
        for k in 0..PARTIAL_SUMS {
            sums[k] += T::zero() * values[k];
        }
    }
    for (sum, &value) in sums.iter_mut().zip(tail) {
        *sum += T::zero() * value;
    }
    sums.into_iter().sum::<T>().is_zero()
}

/// Defines a vector in one contiguous array. Each backend with such vectors needs a type of its own, because the type
/// of a vector determines the backend of its methods.
macro_rules! contiguous_vector {
    () => {
        /// A vector in one contiguous array.
        #[derive(Clone, Debug, Default, PartialEq)]
        pub struct Vector<T = f64> {
            pub(in crate::backends) values: Vec<T>,
        }

        impl<T> Vector<T> {
            /// Returns the entries.
            #[inline(always)]
            pub fn as_slice(&self) -> &[T] {
                &self.values
            }

            /// Returns the entries, mutably.
            #[inline(always)]
            pub fn as_mut_slice(&mut self) -> &mut [T] {
                &mut self.values
            }
        }

        impl<T> From<Vec<T>> for Vector<T> {
            fn from(values: Vec<T>) -> Self {
                Self { values }
            }
        }

        impl<T> From<Vector<T>> for Vec<T> {
            fn from(vector: Vector<T>) -> Self {
                vector.values
            }
        }
    };
}

/// Implements the operations of a vector by its methods `as_slice` and `as_mut_slice`. The short form is for backends
/// that cannot fail; `norm`, `dot` and `axpy` are functions of slices. The long form takes the error type and the bodies of
/// three operations.
macro_rules! impl_vector_ops {
    (
        [$($generics:tt)*] $backend:ty, $vector:ty, $value:ty, $reduced:ty,
        norm: $norm:path, dot: $dot:path, axpy: $add_multiple:path
        $(, axpby: $combine:path, multiply: $multiply:path)?
    ) => {
        $crate::backends::local::impl_vector_ops!(
            [$($generics)*] $backend, $vector, $value, $reduced, ::std::convert::Infallible,
            norm(x): Ok($norm(x.as_slice())),
            dot(x, y): Ok($dot(x.as_slice(), y.as_slice())),
            axpy(a, x, y): {
                $add_multiple(a, x.as_slice(), y.as_mut_slice());
                Ok(())
            }
            $(, axpby: $combine, multiply: $multiply)?
        );
    };
    (
        [$($generics:tt)*] $backend:ty, $vector:ty, $value:ty, $reduced:ty, $error:ty,
        norm($norm_x:ident): $norm:expr,
        dot($dot_x:ident, $dot_y:ident): $dot:expr,
        axpy($axpy_a:ident, $axpy_x:ident, $axpy_y:ident): $axpy:expr
        $(, axpby: $combine:path, multiply: $multiply:path)?
    ) => {
        impl<$($generics)*> $crate::las::VectorOps<$backend> for $vector {
            #[inline(always)]
            fn len(&self) -> usize {
                self.as_slice().len()
            }

            #[inline(always)]
            fn zero(&mut self) -> Result<(), $error> {
                $crate::backends::local::zero(self.as_mut_slice());
                Ok(())
            }

            #[inline(always)]
            fn add(&mut self, rows: &[i32], values: &[$value]) -> Result<(), $error> {
                $crate::backends::local::add(self.as_mut_slice(), rows, values);
                Ok(())
            }

            #[inline(always)]
            fn set(&mut self, rows: &[i32], values: &[$value]) -> Result<(), $error> {
                $crate::backends::local::set(self.as_mut_slice(), rows, values);
                Ok(())
            }

            #[inline(always)]
            fn get(&self, rows: &[i32], values: &mut [$value]) -> Result<(), $error> {
                $crate::backends::local::get(self.as_slice(), rows, values);
                Ok(())
            }

            #[inline(always)]
            fn norm(&self) -> Result<$reduced, $error> {
                let $norm_x = self;
                $norm
            }

            #[inline(always)]
            fn dot(&self, $dot_y: &Self) -> Result<$reduced, $error> {
                let $dot_x = self;
                $dot
            }

            #[inline(always)]
            fn axpy(&mut self, $axpy_a: $value, $axpy_x: &Self) -> Result<(), $error> {
                let $axpy_y = self;
                $axpy
            }

            $(
                #[inline]
                fn axpby(&mut self, a: $value, x: &Self, b: $value) -> Result<(), $error> {
                    $combine(a, x.as_slice(), b, self.as_mut_slice());
                    Ok(())
                }

                #[inline]
                fn multiply(&mut self, d: &Self, x: &Self) -> Result<(), $error> {
                    $multiply(d.as_slice(), x.as_slice(), self.as_mut_slice());
                    Ok(())
                }
            )?

            #[inline(always)]
            fn with_local<R>(&self, read: impl FnOnce(&[$value]) -> R) -> Result<R, $error> {
                Ok(read(self.as_slice()))
            }

            #[inline(always)]
            fn with_local_mut<R>(&mut self, write: impl FnOnce(&mut [$value]) -> R) -> Result<R, $error> {
                Ok(write(self.as_mut_slice()))
            }

            #[inline(always)]
            fn finish(&mut self) -> Result<(), $error> {
                Ok(())
            }
        }
    };
}

pub(super) use {contiguous_vector, impl_vector_ops};

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn norm_is_finite_if_squares_leave_the_range() {
        assert!((norm(&[3e200_f64, 4e200]) - 5e200).abs() < 1e186);
        assert!((norm(&[3e-200_f64, 4e-200]) - 5e-200).abs() < 1e-214);
        assert_eq!(norm::<f64>(&[]), 0.0);
        assert_eq!(norm(&[0.0, 0.0]), 0.0);
        assert!(norm(&[1.0, f64::NAN, 2.0]).is_nan());
        assert_eq!(norm(&[1.0, f64::NEG_INFINITY]), f64::INFINITY);
    }

    #[test]
    fn a_single_nonfinite_value_is_detected() {
        let mut values = [1.0_f32; 37];
        assert!(all_finite(&values));
        for bad in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
            for at in 0..values.len() {
                values[at] = bad;
                assert!(!all_finite(&values));
                values[at] = 1.0;
            }
        }
    }
}
