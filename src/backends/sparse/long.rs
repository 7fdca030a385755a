//! Norms, dot products, sums and entrywise products of vectors: short ones are inlined loops, long ones run on all threads.
//!
//! Long vectors are summed in chunks of a fixed size, whose sums are added in order: the result does not depend on the
//! number of threads.

use crate::backends::local;
use crate::las::Scalar;
use crate::parallel;

/// The number of entries from which a vector is long.
const LONG: usize = 1 << 15;

/// The number of entries of a chunk.
const CHUNK: usize = 1 << 13;

/// Returns `sum_i x[i] y[i]`.
#[inline(always)]
pub(super) fn dot<T: Scalar>(x: &[T], y: &[T]) -> T {
    if x.len() < LONG { local::dot(x, y) } else { long_dot(x, y) }
}

/// Returns the Euclidean norm, scaled if the sum of squares leaves the range of the scalar.
#[inline(always)]
pub(super) fn norm<T: Scalar>(x: &[T]) -> T {
    if x.len() < LONG { local::norm(x) } else { long_norm(x) }
}

/// Returns true if all entries are finite.
pub(super) fn all_finite<T: Scalar>(x: &[T]) -> bool {
    if x.len() < LONG {
        return local::all_finite(x);
    }
    parallel::map(x.chunks(CHUNK), local::all_finite).into_iter().all(|finite| finite)
}

/// Adds `y += a x`.
#[inline(always)]
pub(super) fn axpy<T: Scalar>(a: T, x: &[T], y: &mut [T]) {
    if x.len() < LONG {
        local::axpy(a, x, y);
    } else {
        long_axpy(a, x, y);
    }
}

/// Computes `y = a x + b y`; if `b` is zero, `y` is overwritten even if it is not finite.
#[inline]
pub(super) fn axpby<T: Scalar>(a: T, x: &[T], b: T, y: &mut [T]) {
    if x.len() < LONG {
        local::axpby(a, x, b, y);
    } else {
        long_axpby(a, x, b, y);
    }
}

/// Computes `y[i] = d[i] x[i]`.
#[inline]
pub(super) fn multiply<T: Scalar>(d: &[T], x: &[T], y: &mut [T]) {
    if x.len() < LONG {
        local::multiply(d, x, y);
    } else {
        long_multiply(d, x, y);
    }
}

#[cold]
#[inline(never)]
fn long_dot<T: Scalar>(x: &[T], y: &[T]) -> T {
    debug_assert_eq!(x.len(), y.len(), "vectors of one length");
    parallel::map(x.chunks(CHUNK).zip(y.chunks(CHUNK)), |(x, y)| local::dot(x, y)).into_iter().sum()
}

#[cold]
#[inline(never)]
fn long_norm<T: Scalar>(x: &[T]) -> T {
    let squares: T = parallel::map(x.chunks(CHUNK), |x| local::dot(x, x)).into_iter().sum();
    if local::is_in_range(squares) { squares.sqrt() } else { local::scaled_norm(x) }
}

#[cold]
#[inline(never)]
fn long_axpy<T: Scalar>(a: T, x: &[T], y: &mut [T]) {
    debug_assert_eq!(x.len(), y.len(), "vectors of one length");
    parallel::map(x.chunks(CHUNK).zip(y.chunks_mut(CHUNK)), |(x, y)| local::axpy(a, x, y));
}

#[cold]
#[inline(never)]
fn long_axpby<T: Scalar>(a: T, x: &[T], b: T, y: &mut [T]) {
    debug_assert_eq!(x.len(), y.len(), "vectors of one length");
    parallel::map(x.chunks(CHUNK).zip(y.chunks_mut(CHUNK)), |(x, y)| local::axpby(a, x, b, y));
}

#[cold]
#[inline(never)]
fn long_multiply<T: Scalar>(d: &[T], x: &[T], y: &mut [T]) {
    debug_assert!(x.len() == y.len() && d.len() == y.len(), "vectors of one length");
    let factors = d.chunks(CHUNK).zip(x.chunks(CHUNK));
    parallel::map(factors.zip(y.chunks_mut(CHUNK)), |((d, x), y)| local::multiply(d, x, y));
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use crate::backends::sparse::{Matrix, Sparse, Vector};
    use crate::las::{MatVec, MatrixOps, Sparsity, VectorOps};
    use crate::parallel::tests::on_pools;

    /// Numbers whose sum depends on the order.
    fn vector(len: usize, seed: u64) -> Vector {
        let mut random = crate::las::conformance::Random::new(seed);
        (0..len).map(|_| random.signed()).collect::<Vec<f64>>().into()
    }

    #[test]
    fn long_vectors_have_the_same_bits_on_any_number_of_threads() {
        for len in [100, super::LONG - 1, super::LONG, 300_001] {
            let (x, y) = (vector(len, 1), vector(len, 2));
            let results = on_pools(|| {
                let mut sum = y.clone();
                VectorOps::<Sparse>::axpy(&mut sum, 0.3, &x).unwrap();
                let reduced: [f64; 3] =
                    [VectorOps::<Sparse>::dot(&x, &y), VectorOps::<Sparse>::norm(&x), VectorOps::<Sparse>::norm(&sum)]
                        .map(Result::unwrap);
                let (mut combined, mut product) = (y.clone(), y.clone());
                VectorOps::<Sparse>::axpby(&mut combined, 0.3, &x, -0.7).unwrap();
                VectorOps::<Sparse>::multiply(&mut product, &x, &y).unwrap();
                let mut overwritten: Vector = vec![f64::NAN; len].into();
                VectorOps::<Sparse>::axpby(&mut overwritten, 0.3, &x, 0.0).unwrap();
                (reduced.map(f64::to_bits), [sum, combined, product, overwritten])
            });
            assert!(results[0] == results[1] && results[0] == results[2], "{len} entries");
            let ([dot, norm, _], [sum, combined, product, overwritten]) = &results[0];
            let (x, y) = (x.as_slice(), y.as_slice());
            let plain: f64 = x.iter().zip(y).map(|(x, y)| x * y).sum();
            assert!((f64::from_bits(*dot) - plain).abs() < 1e-10, "{len} entries: {plain}");
            let squares: f64 = x.iter().map(|x| x * x).sum();
            assert!((f64::from_bits(*norm) - squares.sqrt()).abs() < 1e-10);
            let is = |of: &Vector, entry: fn(f64, f64) -> f64| {
                of.as_slice().iter().zip(x.iter().zip(y)).all(|(of, (x, y))| *of == entry(*x, *y))
            };
            assert!(is(sum, |x, y| y + 0.3 * x) && is(combined, |x, y| -0.7 * y + 0.3 * x));
            assert!(is(product, |x, y| y * x) && is(overwritten, |x, _| 0.3 * x));
        }
    }

    #[test]
    fn norms_of_long_vectors_are_scaled() {
        let x: Vector = vec![1e200; 1 << 16].into();
        assert!((VectorOps::<Sparse>::norm(&x).unwrap() - 256e200).abs() < 1e186);
    }

    #[test]
    fn products_with_large_matrices_have_the_same_bits_on_any_number_of_threads() {
        let n = 60_000;
        let elements = (0..n as i32 - 40).map(|k| [k, k + 3, k + 40]);
        let pattern = Arc::new(Sparsity::from_elements(n, elements).unwrap());
        let mut a = Matrix::zeros(&pattern);
        a.values_mut().copy_from_slice(vector(pattern.nnz(), 3).as_slice());
        let x = vector(n, 4);
        let results = on_pools(|| {
            let mut y = vector(n, 5);
            MatVec::<Sparse>::mul(&a, &x, &mut y).unwrap();
            y
        });
        assert!(results[0] == results[1] && results[0] == results[2]);
        for row in (0..n).step_by(977) {
            let columns: Vec<i32> = pattern.row(row).iter().map(|&column| column as i32).collect();
            let mut entries = vec![0.0; columns.len()];
            MatrixOps::<Sparse>::get(&a, &[row as i32], &columns, &mut entries).unwrap();
            let products = entries.iter().zip(&columns).map(|(entry, &column)| entry * x.as_slice()[column as usize]);
            assert_eq!(results[1].as_slice()[row], products.fold(0.0, |sum, product| sum + product));
        }
    }
}
