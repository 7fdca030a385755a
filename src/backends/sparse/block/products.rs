//! The inner kernel of the factorization, which dominates its run time: sums of products of panel rows, kept in
//! registers.

use super::BLOCK;
use super::factor::Block;
use super::lanes::Lanes;
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
pub(super) fn load<T: Scalar, L: Lanes<T>>(lanes: L, block: &Block<T>) -> [L::Quad; BLOCK] {
    [lanes.load(&block[0]), lanes.load(&block[1]), lanes.load(&block[2])]
}

/// Stores a block to memory.
#[inline(always)]
pub(super) fn store<T: Scalar, L: Lanes<T>>(lanes: L, quads: [L::Quad; BLOCK], to: &mut Block<T>) {
    for (column, quad) in to.iter_mut().zip(quads) {
        lanes.store(quad, column);
    }
}

/// Returns `sums[i] - sum_k a_i[k] b[k]^T`, where `k` runs over the blocks.
#[inline(always)]
pub(super) fn subtract_products<T: Scalar, L: Lanes<T>, const R: usize>(
    lanes: L,
    mut sums: [[L::Quad; BLOCK]; R],
    mut a: Rows<'_, T, R>,
    b: &[Block<T>],
) -> [[L::Quad; BLOCK]; R] {
    for row in &mut a {
        *row = &row[..b.len()];
    }
    for (k, b) in b.iter().enumerate() {
        for inner in 0..BLOCK {
            let [x, y, z, _] = b[inner];
            let b = [lanes.splat(x), lanes.splat(y), lanes.splat(z)];
            for i in 0..R {
                let a = lanes.load(&a[i][k][inner]);
                for column in 0..BLOCK {
                    sums[i][column] = lanes.sub_mul(sums[i][column], a, b[column]);
                }
            }
        }
    }
    sums
}
