//! Operations on 3x3 blocks of lanes, stored row by row; the inverse of a Cholesky factor as xx, yx, yy, zx, zy, zz.
//!
//! Sums are added up with the sign changed, `-a + b c + ...` instead of `a - b c - ...`: for a difference, compilers
//! change the signs of factors, which takes the units of the multiply-adds. The bits are the same.

use super::simd::{Lanes, Simd};

/// A 3x3 block.
pub(super) type Block<S> = [Lanes<S>; 9];
/// A lower triangle.
pub(super) type Triangle<S> = [Lanes<S>; 6];
/// The numbers of a node.
pub(super) type Node<S> = [Lanes<S>; 3];

/// `sum += a b^T`
#[inline(always)]
pub(super) fn add_product<S: Simd>(sum: &mut Block<S>, a: &Block<S>, b: &Block<S>) {
    for s in 0..3 {
        for p in 0..3 {
            sum[3 * p].add_product(a[3 * p + s], b[s]);
            sum[3 * p + 1].add_product(a[3 * p + s], b[3 + s]);
            sum[3 * p + 2].add_product(a[3 * p + s], b[6 + s]);
        }
    }
}

/// The lower triangle of `sum += b b^T`.
#[inline(always)]
pub(super) fn add_square<S: Simd>(sum: &mut Triangle<S>, b: &Block<S>) {
    for s in 0..3 {
        sum[0].add_product(b[s], b[s]);
        sum[1].add_product(b[3 + s], b[s]);
        sum[2].add_product(b[3 + s], b[3 + s]);
        sum[3].add_product(b[6 + s], b[s]);
        sum[4].add_product(b[6 + s], b[3 + s]);
        sum[5].add_product(b[6 + s], b[6 + s]);
    }
}

/// `y += b x`
#[inline(always)]
pub(super) fn add_image<S: Simd>(y: &mut Node<S>, b: &Block<S>, x: &Node<S>) {
    for s in 0..3 {
        y[0].add_product(b[s], x[s]);
        y[1].add_product(b[3 + s], x[s]);
        y[2].add_product(b[6 + s], x[s]);
    }
}

/// `y += b^T x`
#[inline(always)]
pub(super) fn add_transposed_image<S: Simd>(y: &mut Node<S>, b: &Block<S>, x: &Node<S>) {
    for s in 0..3 {
        y[0].add_product(b[3 * s], x[s]);
        y[1].add_product(b[3 * s + 1], x[s]);
        y[2].add_product(b[3 * s + 2], x[s]);
    }
}

/// Changes the signs.
#[inline(always)]
pub(super) fn negated<S: Simd, const N: usize>(mut numbers: [Lanes<S>; N]) -> [Lanes<S>; N] {
    for k in 0..N {
        numbers[k] = -numbers[k];
    }
    numbers
}

/// Multiplies the rows of a block by the transpose of the inverse of a factor.
#[inline(always)]
pub(super) fn scale_rows<S: Simd>(block: &mut Block<S>, i: &Triangle<S>) {
    for p in 0..3 {
        let (x, y, z) = (block[3 * p], block[3 * p + 1], block[3 * p + 2]);
        block[3 * p] = x * i[0];
        block[3 * p + 1] = x.mul_add(i[1], y * i[2]);
        block[3 * p + 2] = x.mul_add(i[3], y.mul_add(i[4], z * i[5]));
    }
}

/// Multiplies by the inverse of a factor.
#[inline(always)]
pub(super) fn multiply_inverse<S: Simd>(i: &Triangle<S>, y: &mut Node<S>) {
    y[2] = i[3].mul_add(y[0], i[4].mul_add(y[1], i[5] * y[2]));
    y[1] = i[1].mul_add(y[0], i[2] * y[1]);
    y[0] = i[0] * y[0];
}

/// Multiplies by the transpose of the inverse of a factor.
#[inline(always)]
pub(super) fn multiply_transposed_inverse<S: Simd>(i: &Triangle<S>, x: &mut Node<S>) {
    x[0] = i[0].mul_add(x[0], i[1].mul_add(x[1], i[3] * x[2]));
    x[1] = i[2].mul_add(x[1], i[4] * x[2]);
    x[2] = i[5] * x[2];
}

/// Multiplies a symmetric block, given by its lower triangle.
#[inline(always)]
pub(super) fn multiply_symmetric<S: Simd>(k: &Triangle<S>, v: &Node<S>) -> Node<S> {
    [
        k[0].mul_add(v[0], k[1].mul_add(v[1], k[3] * v[2])),
        k[1].mul_add(v[0], k[2].mul_add(v[1], k[4] * v[2])),
        k[3].mul_add(v[0], k[4].mul_add(v[1], k[5] * v[2])),
    ]
}
