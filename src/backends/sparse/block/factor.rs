//! The numeric factorisation by blocks.

use super::lanes::{BlockScalar, Kernel, Lanes};
use super::{BLOCK, BlockAnalysis, Column, Source};
use crate::backends::direct::Pivots;
use crate::las::Scalar;

/// Three columns: a block.
pub(super) type Block<T> = [Column<T>; BLOCK];

/// Values of `L`, panel after panel, and scratch.
pub(in crate::backends::sparse) struct BlockCholesky<T> {
    pub(super) panels: Vec<Column<T>>,
    /// Where the rows of the supernode at work stand in its panel, by position.
    pub(super) place: Vec<u32>,
    /// A right-hand side in the order of elimination, or several.
    pub(super) right: Vec<Column<T>>,
}

impl<T: BlockScalar> BlockCholesky<T> {
    pub(in crate::backends::sparse) fn new(analysis: &BlockAnalysis) -> Self {
        let nodes = analysis.nodes();
        Self {
            panels: vec![Column::default(); analysis.columns()],
            place: vec![0; nodes],
            right: vec![Column::default(); nodes],
        }
    }

    /// Factors the matrix of these values, of which one of two mirrored ones is read; fails with the position, counted in
    /// unknowns, of the first pivot that is not positive.
    pub(in crate::backends::sparse) fn factor(
        &mut self,
        analysis: &BlockAnalysis,
        values: &[T],
    ) -> Result<Pivots, usize> {
        T::dispatch(Factor { analysis, values, panels: &mut self.panels, place: &mut self.place })
    }
}

/// One factorisation.
pub(super) struct Factor<'a, T> {
    pub(super) analysis: &'a BlockAnalysis,
    pub(super) values: &'a [T],
    pub(super) panels: &'a mut [Column<T>],
    pub(super) place: &'a mut [u32],
}

impl<T: Scalar> Kernel<T> for Factor<'_, T> {
    type Output = Result<Pivots, usize>;

    #[inline(always)]
    fn run<L: Lanes<T>>(self, lanes: L) -> Result<Pivots, usize> {
        let Self { analysis, values, panels, place } = self;
        let supernodes = &analysis.supernodes;
        let mut pivots = Pivots::none();
        for s in 0..supernodes.count() {
            let (before, rest) = panels.split_at_mut(analysis.panel_start[s]);
            let panel = &mut rest[..analysis.panel_start[s + 1] - analysis.panel_start[s]];
            let (first, width) = (supernodes.first(s), supernodes.width(s));
            fill(lanes, panel, analysis.sources_of(s), values);
            for (row, place) in place[first..first + width].iter_mut().enumerate() {
                *place = row as u32;
            }
            for (row, &position) in (width..).zip(supernodes.rows(s)) {
                place[position as usize] = row as u32;
            }
            for update in analysis.updates_of(s) {
                let from = update.from as usize;
                let earlier = Earlier {
                    width: supernodes.width(from),
                    panel: &before[analysis.panel_start[from]..analysis.panel_start[from + 1]],
                    rows: supernodes.rows(from),
                };
                earlier.subtract(lanes, update.begin as usize..update.end as usize, place, panel, width);
            }
            factor_panel(lanes, panel, width, BLOCK * first, &mut pivots)?;
        }
        Ok(pivots)
    }
}

/// Takes the values of the matrix.
#[inline(always)]
fn fill<T: Scalar, L: Lanes<T>>(lanes: L, panel: &mut [Column<T>], sources: &[Source], values: &[T]) {
    panel.fill(Column::default());
    // The fourth value belongs to another block, or is the one behind the matrix. Should that not be finite, it leaves its
    // trace in the fourth lane, which nothing reads: no operation mixes lanes.
    let three = lanes.load(&[T::one(), T::one(), T::one(), T::zero()]);
    for source in sources {
        let mut at = source.at as usize;
        let to = source.to as usize;
        for column in &mut panel[to..to + BLOCK] {
            if let Some(four) = values[at..].first_chunk() {
                lanes.store(lanes.mul(lanes.load(four), three), column);
            }
            at += source.stride as usize;
        }
    }
}

/// A supernode whose columns are final.
struct Earlier<'a, T> {
    width: usize,
    panel: &'a [Column<T>],
    rows: &'a [u32],
}

impl<T: Scalar> Earlier<'_, T> {
    /// Subtracts from a later panel what elimination of this supernode leaves there; `reached` are the rows here that are
    /// columns there.
    #[inline(always)]
    fn subtract<L: Lanes<T>>(
        &self,
        lanes: L,
        reached: std::ops::Range<usize>,
        place: &[u32],
        target: &mut [Column<T>],
        target_width: usize,
    ) {
        let stride = BLOCK * self.width;
        let rows = &self.rows[reached.start..];
        let (blocks, _) = self.panel[stride * (self.width + reached.start)..].as_chunks::<BLOCK>();
        let columns = reached.len();
        let mut row = 0;
        while row < rows.len() {
            let group = Group { lanes, width: self.width, blocks, rows, place, row };
            row += match rows.len() - row {
                1 => group.subtract::<1>(columns, target, target_width),
                2 => group.subtract::<2>(columns, target, target_width),
                _ => group.subtract::<3>(columns, target, target_width),
            };
        }
    }
}

/// Some rows of an earlier panel, from `row` on.
struct Group<'a, T, L> {
    lanes: L,
    width: usize,
    /// The panel from the first row that reaches the target.
    blocks: &'a [Block<T>],
    rows: &'a [u32],
    place: &'a [u32],
    row: usize,
}

impl<T: Scalar, L: Lanes<T>> Group<'_, T, L> {
    /// For `R` rows: all their products with the rows that are columns of the target, as far as they lie at or below its
    /// diagonal; some above it come along. Returns `R`.
    #[inline(always)]
    fn subtract<const R: usize>(&self, columns: usize, target: &mut [Column<T>], target_width: usize) -> usize {
        let Self { lanes, width, blocks, rows, place, row } = *self;
        let mine: [&[Block<T>]; R] = std::array::from_fn(|i| &blocks[width * (row + i)..width * (row + i + 1)]);
        let to: [usize; R] = std::array::from_fn(|i| target_width * place[rows[row + i] as usize] as usize);
        let (target, _) = target.as_chunks_mut::<BLOCK>();
        for (column, other) in blocks.chunks_exact(width).enumerate().take(columns.min(row + R)) {
            let place = place[rows[column] as usize] as usize;
            let sums = std::array::from_fn(|i| target[to[i] + place].map(|c| lanes.load(&c)));
            let sums = subtract_products(lanes, sums, mine, other);
            for i in 0..R {
                store(lanes, sums[i], &mut target[to[i] + place]);
            }
        }
        R
    }
}

/// `sums[i] - sum_k a_i[k] b[k]^T` by blocks `k`.
#[inline(always)]
fn subtract_products<T: Scalar, L: Lanes<T>, const R: usize>(
    lanes: L,
    mut sums: [[L::Quad; BLOCK]; R],
    a: [&[Block<T>]; R],
    b: &[Block<T>],
) -> [[L::Quad; BLOCK]; R] {
    let a = a.map(|row| &row[..b.len()]);
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

/// Factors a panel whose updates are done: the rows of its diagonal blocks, then those below, three at a time.
#[inline(always)]
fn factor_panel<T: Scalar, L: Lanes<T>>(
    lanes: L,
    panel: &mut [Column<T>],
    width: usize,
    position: usize,
    pivots: &mut Pivots,
) -> Result<(), usize> {
    let (blocks, _) = panel.as_chunks_mut::<BLOCK>();
    let mut row = 0;
    while row < width {
        let (above, rest) = blocks.split_at_mut(width * row);
        row += match width - row {
            1 => factor_rows::<T, L, 1>(lanes, rest, above, width, position, pivots)?,
            2 => factor_rows::<T, L, 2>(lanes, rest, above, width, position, pivots)?,
            _ => factor_rows::<T, L, 3>(lanes, rest, above, width, position, pivots)?,
        };
    }
    let (diagonal, below) = blocks.split_at_mut(width * width);
    let (triples, rest) = below.split_at_mut(below.len() / (3 * width) * 3 * width);
    for rows in triples.chunks_exact_mut(3 * width) {
        eliminate::<T, L, 3>(lanes, rows, diagonal, width, width);
    }
    match rest.len() / width {
        1 => eliminate::<T, L, 1>(lanes, rest, diagonal, width, width),
        2 => eliminate::<T, L, 2>(lanes, rest, diagonal, width, width),
        _ => {}
    }
    Ok(())
}

/// Factors the next `R` rows of the diagonal blocks, the first of `rows`; returns `R`.
#[inline(always)]
fn factor_rows<T: Scalar, L: Lanes<T>, const R: usize>(
    lanes: L,
    rows: &mut [Block<T>],
    above: &[Block<T>],
    width: usize,
    position: usize,
    pivots: &mut Pivots,
) -> Result<usize, usize> {
    let before = above.len() / width;
    eliminate::<T, L, R>(lanes, rows, above, width, before);
    // The products of these rows with each other, those above the diagonal along with the rest.
    for k in 0..R {
        let done: [&[Block<T>]; R] = std::array::from_fn(|i| &rows[width * i..width * i + before]);
        let sums = std::array::from_fn(|i| rows[width * i + before + k].map(|c| lanes.load(&c)));
        let sums = subtract_products(lanes, sums, done, done[k]);
        for (i, sums) in sums.into_iter().enumerate() {
            store(lanes, sums, &mut rows[width * i + before + k]);
        }
    }
    for i in 0..R {
        let (earlier, rest) = rows.split_at_mut(width * i);
        let row = &mut rest[before..width];
        for k in 0..=i {
            let (done, at) = row.split_at_mut(k);
            let block = &mut at[0];
            let other = if k < i { &earlier[width * k + before..width * k + before + k] } else { &*done };
            let [sums] = subtract_products(lanes, [block.map(|c| lanes.load(&c))], [done], other);
            if k < i {
                scale(lanes, sums, &earlier[width * k + before + k], block);
            } else {
                store(lanes, sums, block);
                invert_diagonal(block, position + BLOCK * (before + i), pivots)?;
            }
        }
    }
    Ok(R)
}

/// Solves `R` rows for their first `columns` blocks: `x_c = (a_c - sum_(k < c) x_k l_ck^T) l_cc^-T`.
#[inline(always)]
fn eliminate<T: Scalar, L: Lanes<T>, const R: usize>(
    lanes: L,
    rows: &mut [Block<T>],
    diagonal: &[Block<T>],
    width: usize,
    columns: usize,
) {
    for (column, l) in diagonal.chunks_exact(width).enumerate().take(columns) {
        let done: [&[Block<T>]; R] = std::array::from_fn(|i| &rows[width * i..width * i + column]);
        let sums = std::array::from_fn(|i| rows[width * i + column].map(|c| lanes.load(&c)));
        let sums = subtract_products(lanes, sums, done, &l[..column]);
        for (i, sums) in sums.into_iter().enumerate() {
            scale(lanes, sums, &l[column], &mut rows[width * i + column]);
        }
    }
}

#[inline(always)]
fn store<T: Scalar, L: Lanes<T>>(lanes: L, quads: [L::Quad; BLOCK], to: &mut Block<T>) {
    for (column, quad) in to.iter_mut().zip(quads) {
        lanes.store(quad, column);
    }
}

/// `to = a inverse^T` for a lower triangular block.
#[inline(always)]
fn scale<T: Scalar, L: Lanes<T>>(lanes: L, [x, y, z]: [L::Quad; BLOCK], inverse: &Block<T>, to: &mut Block<T>) {
    let [[i00, i10, i20, _], [_, i11, i21, _], [_, _, i22, _]] = *inverse;
    let first = lanes.mul(x, lanes.splat(i00));
    let second = lanes.add_mul(lanes.mul(y, lanes.splat(i11)), x, lanes.splat(i10));
    let third = lanes.add_mul(lanes.mul(z, lanes.splat(i22)), x, lanes.splat(i20));
    let third = lanes.add_mul(third, y, lanes.splat(i21));
    store(lanes, [first, second, third], to);
}

/// Replaces the lower triangle of a diagonal block by the inverse of its Cholesky factor, zeros above.
#[inline(always)]
fn invert_diagonal<T: Scalar>(block: &mut Block<T>, position: usize, pivots: &mut Pivots) -> Result<(), usize> {
    let mut see = |pivot: T, k: usize| {
        pivots.see(pivot.as_f64(), position + k);
        if pivot > T::zero() { Ok(T::one() / pivot.sqrt()) } else { Err(position + k) }
    };
    let [[a00, a10, a20, _], [_, a11, a21, _], [_, _, a22, _]] = *block;
    let i00 = see(a00, 0)?;
    let (l10, l20) = (a10 * i00, a20 * i00);
    let i11 = see(a11 - l10 * l10, 1)?;
    let l21 = (a21 - l20 * l10) * i11;
    let i22 = see(a22 - l20 * l20 - l21 * l21, 2)?;
    let i10 = -l10 * i00 * i11;
    let i21 = -l21 * i11 * i22;
    let i20 = -(l20 * i00 + l21 * i10) * i22;
    let zero = T::zero();
    *block = [[i00, i10, i20, zero], [zero, i11, i21, zero], [zero, zero, i22, zero]];
    Ok(())
}
