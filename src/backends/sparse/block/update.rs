//! The update of a supernode by an earlier one whose columns are final.

use super::factor::Block;
use super::products::{load, rows_of, store, subtract_products};
use super::simd::Simd;
use super::{BLOCK, Column};
use crate::las::Scalar;

/// A supernode whose columns are final.
pub(super) struct DescendantSupernode<'a, T> {
    pub(super) width: usize,
    pub(super) panel: &'a [Column<T>],
    pub(super) rows: &'a [u32],
}

impl<T: Scalar> DescendantSupernode<'_, T> {
    /// Subtracts the contribution of this supernode from the panel of a later one; `reached` is the range of rows of
    /// this supernode that are columns of the later one.
    #[inline(always)]
    pub(super) fn subtract<S: Simd<T>>(
        &self,
        simd: S,
        reached: std::ops::Range<usize>,
        relative_rows: &[u32],
        target: &mut [Column<T>],
        target_width: usize,
    ) {
        let stride = BLOCK * self.width;
        let rows = &self.rows[reached.start..];
        let (blocks, _) = self.panel[stride * (self.width + reached.start)..].as_chunks::<BLOCK>();
        let columns = reached.len();
        let mut row = 0;
        while row < rows.len() {
            let group = Group { simd, width: self.width, blocks, rows, relative_rows, row };
            row += match (rows.len() - row).min(S::MOST_ROWS) {
                1 => group.subtract::<1>(columns, target, target_width),
                2 => group.subtract::<2>(columns, target, target_width),
                6 => group.subtract::<6>(columns, target, target_width),
                _ => group.subtract::<3>(columns, target, target_width),
            };
        }
    }
}

/// Rows of an earlier panel, starting at `row`.
struct Group<'a, T, S> {
    simd: S,
    width: usize,
    /// The panel, starting at the first row that is a column of the target.
    blocks: &'a [Block<T>],
    rows: &'a [u32],
    relative_rows: &'a [u32],
    row: usize,
}

impl<T: Scalar, S: Simd<T>> Group<'_, T, S> {
    /// Subtracts the products of `R` rows with the rows that are columns of the target, as far as they lie at or below
    /// its diagonal; some blocks above the diagonal are computed as well. Returns `R`.
    #[inline(always)]
    fn subtract<const R: usize>(&self, columns: usize, target: &mut [Column<T>], target_width: usize) -> usize {
        let Self { simd, width, blocks, rows, relative_rows, row } = *self;
        let mine = rows_of::<T, R>(&blocks[width * row..], width, 0, width);
        let mut to = [0; R];
        for (to, &position) in to.iter_mut().zip(&rows[row..row + R]) {
            *to = target_width * relative_rows[position as usize] as usize;
        }
        let (target, _) = target.as_chunks_mut::<BLOCK>();
        for (column, other) in blocks.chunks_exact(width).enumerate().take(columns.min(row + R)) {
            let column = relative_rows[rows[column] as usize] as usize;
            let mut sums = [[simd.splat(T::zero()); BLOCK]; R];
            for i in 0..R {
                sums[i] = load(simd, &target[to[i] + column]);
            }
            let sums = subtract_products(simd, sums, mine, other);
            for i in 0..R {
                store(simd, sums[i], &mut target[to[i] + column]);
            }
        }
        R
    }
}
