//! The inner kernel of the factorization, which dominates its run time: sums of products of panel rows, kept in
//! registers.

use super::BLOCK;
use super::factor::Block;
use super::simd::Simd;
use crate::las::Scalar;

/// The blocks of `R` rows.
pub(super) type Rows<'a, T, const R: usize> = [&'a [Block<T>]; R];

/// Returns, for the first `R` rows of a panel, `len` blocks starting at `column`.
#[inline(always)]
pub(super) fn rows_of<T, const R: usize>(
    panel: &[Block<T>],
    width: usize,
    column: usize,
    len: usize,
) -> Rows<'_, T, R> {
    let mut rows = [&panel[..0]; R];
    for (i, row) in rows.iter_mut().enumerate() {
        let start = width * i + column;
        *row = &panel[start..start + len];
    }
    rows
}

/// Loads a block from memory.
#[inline(always)]
pub(super) fn load<T: Scalar, S: Simd<T>>(simd: S, block: &Block<T>) -> [S::Quad; BLOCK] {
    [simd.load(&block[0]), simd.load(&block[1]), simd.load(&block[2])]
}

/// Stores a block to memory.
#[inline(always)]
pub(super) fn store<T: Scalar, S: Simd<T>>(simd: S, quads: [S::Quad; BLOCK], to: &mut Block<T>) {
    for (column, quad) in to.iter_mut().zip(quads) {
        simd.store(quad, column);
    }
}

/// Returns `sums[i] - sum_k a_i[k] b[k]^T`, where `k` runs over the blocks.
#[inline(always)]
pub(super) fn subtract_products<T: Scalar, S: Simd<T>, const R: usize>(
    simd: S,
    mut sums: [[S::Quad; BLOCK]; R],
    mut a: Rows<'_, T, R>,
    b: &[Block<T>],
) -> [[S::Quad; BLOCK]; R] {
    for row in &mut a {
        *row = &row[..b.len()];
    }
    for (k, b) in b.iter().enumerate() {
        for inner in 0..BLOCK {
            let [x, y, z, _] = b[inner];
            let b = [simd.splat(x), simd.splat(y), simd.splat(z)];
            for i in 0..R {
                let a = simd.load(&a[i][k][inner]);
                for column in 0..BLOCK {
                    sums[i][column] = simd.sub_mul(sums[i][column], a, b[column]);
                }
            }
        }
    }
    sums
}
