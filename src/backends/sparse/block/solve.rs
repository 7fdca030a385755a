//! The triangular solves with the block Cholesky factor.

use super::factor::{Block, BlockCholesky};
use super::simd::{BlockScalar, QUAD_LEN, Simd, SimdLevel, WithSimd};
use super::{BLOCK, Column, SymbolicBlockCholesky};
use crate::backends::sparse::Vector;
use crate::las::Scalar;

/// The largest number of quads (groups of four) of right-hand sides solved at once.
const MOST_QUADS: usize = 2;

impl<T: BlockScalar> BlockCholesky<T> {
    /// Allocates room for `count` right-hand sides.
    pub(in crate::backends::sparse) fn reserve(&mut self, analysis: &SymbolicBlockCholesky, count: usize) {
        let quads = if count < 2 { 0 } else { count.div_ceil(QUAD_LEN).min(MOST_QUADS) };
        let len = analysis.nodes() * (BLOCK * quads).max(1);
        if self.right.len() < len {
            self.right.resize(len, Column::default());
        }
    }

    /// Solves for any number of right-hand sides; [`reserve`](Self::reserve) must have allocated room for them.
    pub(in crate::backends::sparse) fn solve(
        &mut self,
        analysis: &SymbolicBlockCholesky,
        b: &[Vector<T>],
        x: &mut [Vector<T>],
    ) {
        let most = MOST_QUADS * QUAD_LEN;
        for (b, x) in b.chunks(most).zip(x.chunks_mut(most)) {
            match (b, &mut *x) {
                ([b], [x]) => self.solve_one(analysis, b, x),
                _ if b.len() <= QUAD_LEN => self.solve_several::<1>(analysis, b, x),
                _ => self.solve_several::<MOST_QUADS>(analysis, b, x),
            }
        }
    }

    fn solve_one(&mut self, analysis: &SymbolicBlockCholesky, b: &Vector<T>, x: &mut Vector<T>) {
        let right = &mut self.right[..analysis.nodes()];
        for (right, node) in right.iter_mut().zip(&analysis.nodes) {
            let zero = T::zero();
            *right = match b.values[node.unknowns()] {
                [u, v, w] => [u, v, w, zero],
                [u, v] => [u, v, zero, zero],
                [u] => [u, zero, zero, zero],
                _ => [zero; QUAD_LEN],
            };
        }
        T::dispatch(SimdLevel::of_machine(), SolveOne { analysis, panels: &self.panels, x: right });
        for (&[u, v, w, _], node) in right.iter().zip(&analysis.nodes) {
            match &mut x.values[node.unknowns()] {
                [x, y, z] => (*x, *y, *z) = (u, v, w),
                [x, y] => (*x, *y) = (u, v),
                [x] => *x = u,
                _ => {}
            }
        }
    }

    fn solve_several<const Q: usize>(
        &mut self,
        analysis: &SymbolicBlockCholesky,
        b: &[Vector<T>],
        x: &mut [Vector<T>],
    ) {
        let (right, _) = self.right[..BLOCK * Q * analysis.nodes()].as_chunks_mut::<Q>();
        let (right, _) = right.as_chunks_mut::<BLOCK>();
        right.fill([[Column::default(); Q]; BLOCK]);
        for (k, b) in b.iter().enumerate() {
            for (right, node) in right.iter_mut().zip(&analysis.nodes) {
                for (right, &value) in right.iter_mut().zip(&b.values[node.unknowns()]) {
                    right[k / QUAD_LEN][k % QUAD_LEN] = value;
                }
            }
        }
        T::dispatch(SimdLevel::of_machine(), SolveSeveral { analysis, panels: &self.panels, x: right });
        for (k, x) in x.iter_mut().enumerate() {
            for (right, node) in right.iter().zip(&analysis.nodes) {
                for (x, right) in x.values[node.unknowns()].iter_mut().zip(right) {
                    *x = right[k / QUAD_LEN][k % QUAD_LEN];
                }
            }
        }
    }
}

/// One supernode of the factor: its panel as rows of blocks, its first position, its width, and the positions below.
struct Panel<'a, T> {
    blocks: &'a [Block<T>],
    first: usize,
    width: usize,
    below: &'a [u32],
}

impl SymbolicBlockCholesky {
    #[inline(always)]
    fn panel<'a, T>(&'a self, panels: &'a [Column<T>], s: usize) -> Panel<'a, T> {
        Panel {
            blocks: panels[self.panel_start[s]..self.panel_start[s + 1]].as_chunks().0,
            first: self.supernodes.first(s),
            width: self.supernodes.width(s),
            below: self.supernodes.rows(s),
        }
    }
}

/// The kernel for one right-hand side, with the three unknowns of a node in the lanes.
struct SolveOne<'a, T> {
    analysis: &'a SymbolicBlockCholesky,
    panels: &'a [Column<T>],
    x: &'a mut [Column<T>],
}

impl<T: Scalar> WithSimd<T> for SolveOne<'_, T> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd<T>>(self, simd: S) {
        let Self { analysis, panels, x } = self;
        for s in 0..analysis.supernodes.count() {
            forward_one(simd, &analysis.panel(panels, s), x);
        }
        for s in (0..analysis.supernodes.count()).rev() {
            backward_one(simd, &analysis.panel(panels, s), x);
        }
    }
}

/// Computes `x_row -= sum_k l_row,k x_k` over the columns `k` of a row.
#[inline(always)]
fn subtract_row<T: Scalar, S: Simd<T>>(simd: S, row: &[Block<T>], known: &[Column<T>], x: &mut Column<T>) {
    // Two independent sums shorten the dependency chain of the additions.
    let (mut even, mut odd) = (simd.load(x), simd.splat(T::zero()));
    for (block, known) in row.iter().zip(known) {
        even = simd.sub_mul(even, simd.load(&block[0]), simd.splat(known[0]));
        odd = simd.sub_mul(odd, simd.load(&block[1]), simd.splat(known[1]));
        even = simd.sub_mul(even, simd.load(&block[2]), simd.splat(known[2]));
    }
    simd.store(simd.add(even, odd), x);
}

#[inline(always)]
fn forward_one<T: Scalar, S: Simd<T>>(simd: S, panel: &Panel<'_, T>, x: &mut [Column<T>]) {
    let width = panel.width;
    let mut rows = panel.blocks.chunks_exact(width);
    for (node, row) in rows.by_ref().take(width).enumerate() {
        let (known, rest) = x[panel.first..].split_at_mut(node);
        subtract_row(simd, &row[..node], known, &mut rest[0]);
        let ([u, v, w, _], inverse) = (rest[0], &row[node]);
        let product = simd.mul(simd.load(&inverse[0]), simd.splat(u));
        let product = simd.add_mul(product, simd.load(&inverse[1]), simd.splat(v));
        let product = simd.add_mul(product, simd.load(&inverse[2]), simd.splat(w));
        simd.store(product, &mut rest[0]);
    }
    let (known, rest) = x[panel.first..].split_at_mut(width);
    for (row, &position) in rows.zip(panel.below) {
        subtract_row(simd, row, known, &mut rest[position as usize - panel.first - width]);
    }
}

/// Returns `sums_k + l_k x`, lane by lane; the sum over the lanes of the increment is `sum_i l_ik x_i`.
#[inline(always)]
fn add_transposed<T: Scalar, S: Simd<T>>(
    simd: S,
    mut sums: [S::Quad; BLOCK],
    block: &Block<T>,
    known: &Column<T>,
) -> [S::Quad; BLOCK] {
    let known = simd.load(known);
    for k in 0..BLOCK {
        sums[k] = simd.add_mul(sums[k], simd.load(&block[k]), known);
    }
    sums
}

#[inline(always)]
fn backward_one<T: Scalar, S: Simd<T>>(simd: S, panel: &Panel<'_, T>, x: &mut [Column<T>]) {
    let width = panel.width;
    let (own, below) = panel.blocks.split_at(width * width);
    for node in (0..width).rev() {
        let mut sums = [simd.splat(T::zero()); BLOCK];
        for (row, &position) in below.chunks_exact(width).zip(panel.below) {
            sums = add_transposed(simd, sums, &row[node], &x[position as usize]);
        }
        for (row, known) in own.chunks_exact(width).zip(&x[panel.first..]).skip(node + 1) {
            sums = add_transposed(simd, sums, &row[node], known);
        }
        let at = &mut x[panel.first + node];
        let mut right = [T::zero(); BLOCK];
        for (k, sum) in sums.into_iter().enumerate() {
            let mut lanes_of = Column::default();
            simd.store(sum, &mut lanes_of);
            let [u, v, w, _] = lanes_of;
            right[k] = at[k] - (u + v + w);
        }
        let inverse = &own[width * node + node];
        let [u, v, w] = right;
        let [[i00, i10, i20, _], [_, i11, i21, _], [_, _, i22, _]] = *inverse;
        *at = [i00 * u + i10 * v + i20 * w, i11 * v + i21 * w, i22 * w, T::zero()];
    }
}

/// `Q` quads of right-hand sides of a node: one row for each of its unknowns, right-hand sides in the lanes.
type Rows<T, const Q: usize> = [[Column<T>; Q]; BLOCK];

/// [`Rows`] in registers.
type Sums<S, T, const Q: usize> = [[<S as Simd<T>>::Quad; Q]; BLOCK];

/// The kernel for several right-hand sides.
struct SolveSeveral<'a, T, const Q: usize> {
    analysis: &'a SymbolicBlockCholesky,
    panels: &'a [Column<T>],
    x: &'a mut [Rows<T, Q>],
}

impl<T: Scalar, const Q: usize> WithSimd<T> for SolveSeveral<'_, T, Q> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd<T>>(self, simd: S) {
        let Self { analysis, panels, x } = self;
        for s in 0..analysis.supernodes.count() {
            forward_several(simd, &analysis.panel(panels, s), x);
        }
        for s in (0..analysis.supernodes.count()).rev() {
            backward_several(simd, &analysis.panel(panels, s), x);
        }
    }
}

/// Loads the right-hand sides of one unknown.
#[inline(always)]
fn load_row<T: Scalar, S: Simd<T>, const Q: usize>(simd: S, row: &[Column<T>; Q]) -> [S::Quad; Q] {
    let mut quads = [simd.splat(T::zero()); Q];
    for q in 0..Q {
        quads[q] = simd.load(&row[q]);
    }
    quads
}

#[inline(always)]
fn load<T: Scalar, S: Simd<T>, const Q: usize>(simd: S, rows: &Rows<T, Q>) -> Sums<S, T, Q> {
    let mut sums = [[simd.splat(T::zero()); Q]; BLOCK];
    for i in 0..BLOCK {
        sums[i] = load_row(simd, &rows[i]);
    }
    sums
}

#[inline(always)]
fn store<T: Scalar, S: Simd<T>, const Q: usize>(simd: S, sums: Sums<S, T, Q>, rows: &mut Rows<T, Q>) {
    for (row, sums) in rows.iter_mut().zip(sums) {
        for (quad, sum) in row.iter_mut().zip(sums) {
            simd.store(sum, quad);
        }
    }
}

/// Computes `sums_n -= sum_k l_nk x_k`, or with `l_kn` if `TRANSPOSED`.
#[inline(always)]
fn subtract_block<T: Scalar, S: Simd<T>, const Q: usize, const TRANSPOSED: bool>(
    simd: S,
    mut sums: Sums<S, T, Q>,
    block: &Block<T>,
    x: &Rows<T, Q>,
) -> Sums<S, T, Q> {
    for k in 0..BLOCK {
        let known = load_row(simd, &x[k]);
        for n in 0..BLOCK {
            let l = simd.splat(if TRANSPOSED { block[n][k] } else { block[k][n] });
            for q in 0..Q {
                sums[n][q] = simd.sub_mul(sums[n][q], l, known[q]);
            }
        }
    }
    sums
}

#[inline(always)]
fn forward_several<T: Scalar, S: Simd<T>, const Q: usize>(simd: S, panel: &Panel<'_, T>, x: &mut [Rows<T, Q>]) {
    let width = panel.width;
    let mut rows = panel.blocks.chunks_exact(width);
    for (node, row) in rows.by_ref().take(width).enumerate() {
        let (known, rest) = x[panel.first..].split_at_mut(node);
        let mut sums = load(simd, &rest[0]);
        for (block, known) in row.iter().zip(&*known) {
            sums = subtract_block::<_, _, Q, false>(simd, sums, block, known);
        }
        // x = inverse * sums, where the inverse is lower triangular.
        let mut scaled = sums;
        for i in 0..BLOCK {
            for q in 0..Q {
                scaled[i][q] = simd.mul(sums[0][q], simd.splat(row[node][0][i]));
                for k in 1..=i {
                    scaled[i][q] = simd.add_mul(scaled[i][q], sums[k][q], simd.splat(row[node][k][i]));
                }
            }
        }
        store(simd, scaled, &mut rest[0]);
    }
    let (known, rest) = x[panel.first..].split_at_mut(width);
    for (row, &position) in rows.zip(panel.below) {
        let at = &mut rest[position as usize - panel.first - width];
        let mut sums = load(simd, at);
        for (block, known) in row.iter().zip(&*known) {
            sums = subtract_block::<_, _, Q, false>(simd, sums, block, known);
        }
        store(simd, sums, at);
    }
}

#[inline(always)]
fn backward_several<T: Scalar, S: Simd<T>, const Q: usize>(simd: S, panel: &Panel<'_, T>, x: &mut [Rows<T, Q>]) {
    let width = panel.width;
    let (own, below) = panel.blocks.split_at(width * width);
    for node in (0..width).rev() {
        let mut sums = load(simd, &x[panel.first + node]);
        for (row, &position) in below.chunks_exact(width).zip(panel.below) {
            sums = subtract_block::<_, _, Q, true>(simd, sums, &row[node], &x[position as usize]);
        }
        for (row, known) in own.chunks_exact(width).zip(&x[panel.first..]).skip(node + 1) {
            sums = subtract_block::<_, _, Q, true>(simd, sums, &row[node], known);
        }
        let inverse = &own[width * node + node];
        let mut scaled = sums;
        for k in 0..BLOCK {
            for q in 0..Q {
                scaled[k][q] = simd.mul(sums[2][q], simd.splat(inverse[k][2]));
                for i in k..2 {
                    scaled[k][q] = simd.add_mul(scaled[k][q], sums[i][q], simd.splat(inverse[k][i]));
                }
            }
        }
        store(simd, scaled, &mut x[panel.first + node]);
    }
}
