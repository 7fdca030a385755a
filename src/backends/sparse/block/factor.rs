//! The numeric block Cholesky factorization.

use super::products::{load, rows_of, store, subtract_products};
use super::simd::{BlockScalar, Simd, SimdLevel, WithSimd};
use super::update::DescendantSupernode;
use super::{BLOCK, BlockSource, Column, Node, PartialBlock, SymbolicBlockCholesky};
use crate::backends::direct::{NotPositiveDefinite, Pivots};
use crate::las::Scalar;

/// A block: three columns.
pub(super) type Block<T> = [Column<T>; BLOCK];

/// The values of `L`, panel after panel, and scratch.
pub(in crate::backends::sparse) struct BlockCholesky<T> {
    pub(super) panels: Vec<Column<T>>,
    /// For each position, its row in the panel of the current supernode.
    pub(super) relative_rows: Vec<u32>,
    /// One or several right-hand sides in elimination order.
    pub(super) right: Vec<Column<T>>,
}

impl<T: BlockScalar> BlockCholesky<T> {
    pub(in crate::backends::sparse) fn new(analysis: &SymbolicBlockCholesky) -> Self {
        let nodes = analysis.nodes();
        Self {
            panels: vec![Column::default(); analysis.columns()],
            relative_rows: vec![0; nodes],
            right: vec![Column::default(); nodes],
        }
    }

    /// Factors the matrix with these values; of each pair of entries `(i, j)` and `(j, i)`, it reads only one. Each
    /// node has three pivot positions.
    pub(in crate::backends::sparse) fn factor(
        &mut self,
        analysis: &SymbolicBlockCholesky,
        values: &[T],
    ) -> Result<Pivots, NotPositiveDefinite> {
        self.factor_with(SimdLevel::of_machine(), analysis, values)
    }

    /// Does the same as [`Self::factor`], with the instructions of at most this level.
    pub(super) fn factor_with(
        &mut self,
        level: SimdLevel,
        analysis: &SymbolicBlockCholesky,
        values: &[T],
    ) -> Result<Pivots, NotPositiveDefinite> {
        T::dispatch(
            level,
            Factor { analysis, values, panels: &mut self.panels, relative_rows: &mut self.relative_rows },
        )
    }
}

/// The kernel of one factorization.
pub(super) struct Factor<'a, T> {
    pub(super) analysis: &'a SymbolicBlockCholesky,
    pub(super) values: &'a [T],
    pub(super) panels: &'a mut [Column<T>],
    pub(super) relative_rows: &'a mut [u32],
}

impl<T: Scalar> WithSimd<T> for Factor<'_, T> {
    type Output = Result<Pivots, NotPositiveDefinite>;

    #[inline(always)]
    fn with_simd<S: Simd<T>>(self, simd: S) -> Result<Pivots, NotPositiveDefinite> {
        let Self { analysis, values, panels, relative_rows } = self;
        let supernodes = &analysis.supernodes;
        let mut pivots = Pivots::empty();
        for s in 0..supernodes.count() {
            let (before, rest) = panels.split_at_mut(analysis.panel_start[s]);
            let panel = &mut rest[..analysis.panel_start[s + 1] - analysis.panel_start[s]];
            let (first, width) = (supernodes.first(s), supernodes.width(s));
            fill(simd, panel, analysis.sources_of(s), values);
            fill_partial(panel, analysis.partial_of(s), values);
            for (row, relative_row) in relative_rows[first..first + width].iter_mut().enumerate() {
                *relative_row = row as u32;
            }
            for (row, &position) in (width..).zip(supernodes.rows(s)) {
                relative_rows[position as usize] = row as u32;
            }
            for update in analysis.updates_of(s) {
                let from = update.from as usize;
                let earlier = DescendantSupernode {
                    width: supernodes.width(from),
                    panel: &before[analysis.panel_start[from]..analysis.panel_start[from + 1]],
                    rows: supernodes.rows(from),
                };
                earlier.subtract(simd, update.begin as usize..update.end as usize, relative_rows, panel, width);
            }
            factor_panel(simd, panel, analysis.nodes_of(s), BLOCK * first, &mut pivots)?;
        }
        Ok(pivots)
    }
}

/// Loads the values of the matrix into a panel.
#[inline(always)]
fn fill<T: Scalar, S: Simd<T>>(simd: S, panel: &mut [Column<T>], sources: &[BlockSource], values: &[T]) {
    panel.fill(Column::default());
    // The fourth value belongs to another block or is the extra one at the end of the matrix. If it is not finite, the
    // fourth lane becomes NaN, which is harmless: no operation mixes lanes and the fourth lane is never read.
    let three = simd.load(&[T::one(), T::one(), T::one(), T::zero()]);
    for source in sources {
        let mut at = source.at as usize;
        let to = source.to as usize;
        for column in &mut panel[to..to + BLOCK] {
            if let Some(four) = values[at..].first_chunk() {
                simd.store(simd.mul(simd.load(four), three), column);
            }
            at += source.stride as usize;
        }
    }
}

/// Loads the blocks that have fewer than three rows or columns.
#[inline(always)]
fn fill_partial<T: Scalar>(panel: &mut [Column<T>], partial: &[PartialBlock], values: &[T]) {
    for &PartialBlock { source, rows, columns } in partial {
        for column in 0..columns as usize {
            let at = source.at as usize + column * source.stride as usize;
            let rows = rows as usize;
            panel[source.to as usize + column][..rows].copy_from_slice(&values[at..at + rows]);
        }
    }
}

/// Factors a panel after its updates: the rows of the diagonal blocks, then the rows below, as many at a time as fit
/// into the registers.
#[inline(always)]
fn factor_panel<T: Scalar, S: Simd<T>>(
    simd: S,
    panel: &mut [Column<T>],
    nodes: &[Node],
    position: usize,
    pivots: &mut Pivots,
) -> Result<(), NotPositiveDefinite> {
    let width = nodes.len();
    let (blocks, _) = panel.as_chunks_mut::<BLOCK>();
    let mut row = 0;
    while row < width {
        let (above, rest) = blocks.split_at_mut(width * row);
        row += match width - row {
            1 => factor_rows::<T, S, 1>(simd, rest, above, nodes, position, pivots)?,
            2 => factor_rows::<T, S, 2>(simd, rest, above, nodes, position, pivots)?,
            _ => factor_rows::<T, S, 3>(simd, rest, above, nodes, position, pivots)?,
        };
    }
    let (diagonal, mut below) = blocks.split_at_mut(width * width);
    while !below.is_empty() {
        let done = match (below.len() / width).min(S::MOST_ROWS) {
            1 => eliminate::<T, S, 1>(simd, below, diagonal, width, width),
            2 => eliminate::<T, S, 2>(simd, below, diagonal, width, width),
            6 => eliminate::<T, S, 6>(simd, below, diagonal, width, width),
            _ => eliminate::<T, S, 3>(simd, below, diagonal, width, width),
        };
        below = below.split_at_mut(width * done).1;
    }
    Ok(())
}

/// Factors the next `R` rows of the diagonal blocks, which are the first of `rows`; returns `R`.
#[inline(always)]
fn factor_rows<T: Scalar, S: Simd<T>, const R: usize>(
    simd: S,
    rows: &mut [Block<T>],
    above: &[Block<T>],
    nodes: &[Node],
    position: usize,
    pivots: &mut Pivots,
) -> Result<usize, NotPositiveDefinite> {
    let width = nodes.len();
    let before = above.len() / width;
    eliminate::<T, S, R>(simd, rows, above, width, before);
    // Subtracts the products of these rows with each other, including those above the diagonal.
    for k in 0..R {
        let done = rows_of::<T, R>(rows, width, 0, before);
        let mut sums = [[simd.splat(T::zero()); BLOCK]; R];
        for i in 0..R {
            sums[i] = load(simd, &rows[width * i + before + k]);
        }
        let sums = subtract_products(simd, sums, done, done[k]);
        for i in 0..R {
            store(simd, sums[i], &mut rows[width * i + before + k]);
        }
    }
    for i in 0..R {
        let (earlier, rest) = rows.split_at_mut(width * i);
        let row = &mut rest[before..width];
        for k in 0..=i {
            let (done, at) = row.split_at_mut(k);
            let block = &mut at[0];
            let other = if k < i { &earlier[width * k + before..width * k + before + k] } else { &*done };
            let [sums] = subtract_products(simd, [load(simd, block)], [done], other);
            if k < i {
                store(simd, scaled(simd, sums, &earlier[width * k + before + k]), block);
            } else {
                store(simd, sums, block);
                let node = before + i;
                invert_diagonal(block, nodes[node].size as usize, position + BLOCK * node, pivots)?;
            }
        }
    }
    Ok(R)
}

/// Computes the first `columns` blocks of the first `R` rows, `x_c = (a_c - sum_(k < c) x_k l_ck^T) l_cc^-T`; returns
/// `R`.
#[inline(always)]
fn eliminate<T: Scalar, S: Simd<T>, const R: usize>(
    simd: S,
    rows: &mut [Block<T>],
    diagonal: &[Block<T>],
    width: usize,
    columns: usize,
) -> usize {
    for (column, l) in diagonal.chunks_exact(width).enumerate().take(columns) {
        let done = rows_of::<T, R>(rows, width, 0, column);
        let mut sums = [[simd.splat(T::zero()); BLOCK]; R];
        for i in 0..R {
            sums[i] = load(simd, &rows[width * i + column]);
        }
        let sums = subtract_products(simd, sums, done, &l[..column]);
        for i in 0..R {
            store(simd, scaled(simd, sums[i], &l[column]), &mut rows[width * i + column]);
        }
    }
    R
}

/// Returns `a inverse^T`, where `inverse` is lower triangular.
#[inline(always)]
fn scaled<T: Scalar, S: Simd<T>>(simd: S, [x, y, z]: [S::Quad; BLOCK], inverse: &Block<T>) -> [S::Quad; BLOCK] {
    let [[i00, i10, i20, _], [_, i11, i21, _], [_, _, i22, _]] = *inverse;
    let first = simd.mul(x, simd.splat(i00));
    let second = simd.add_mul(simd.mul(y, simd.splat(i11)), x, simd.splat(i10));
    let third = simd.add_mul(simd.mul(z, simd.splat(i22)), x, simd.splat(i20));
    [first, second, simd.add_mul(third, y, simd.splat(i21))]
}

/// Replaces a diagonal block by the inverse of its Cholesky factor, with zeros above the diagonal. It reads the lower
/// triangle. For a node with fewer than three unknowns, the rest becomes the identity and is not recorded as pivots.
#[inline(always)]
fn invert_diagonal<T: Scalar>(
    block: &mut Block<T>,
    size: usize,
    position: usize,
    pivots: &mut Pivots,
) -> Result<(), NotPositiveDefinite> {
    for k in size..BLOCK {
        for column in &mut block[..k] {
            column[k] = T::zero();
        }
        block[k][k] = T::one();
    }
    let mut record = |pivot: T, k: usize| {
        if k < size {
            pivots.record(pivot.as_f64(), position + k);
        }
        if pivot > T::zero() {
            Ok(T::one() / pivot.sqrt())
        } else {
            Err(NotPositiveDefinite { position: position + k })
        }
    };
    let [[a00, a10, a20, _], [_, a11, a21, _], [_, _, a22, _]] = *block;
    let i00 = record(a00, 0)?;
    let (l10, l20) = (a10 * i00, a20 * i00);
    let i11 = record(a11 - l10 * l10, 1)?;
    let l21 = (a21 - l20 * l10) * i11;
    let i22 = record(a22 - l20 * l20 - l21 * l21, 2)?;
    let i10 = -l10 * i00 * i11;
    let i21 = -l21 * i11 * i22;
    let i20 = -(l20 * i00 + l21 * i10) * i22;
    let zero = T::zero();
    *block = [[i00, i10, i20, zero], [zero, i11, i21, zero], [zero, zero, i22, zero]];
    Ok(())
}
