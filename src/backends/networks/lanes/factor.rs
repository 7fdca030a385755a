//! The Cholesky factorization of the matrices of all lanes.

#[cfg(test)]
mod tests;

use std::marker::PhantomData;

use super::blocks::{Block, Node, Triangle, add_image, add_product, add_square, multiply_inverse, negated, scale_rows};
use super::simd::{Kernel, Lanes, Simd, load, store};
use crate::backends::networks::{NONE, Schedule};

/// The smallest and the largest pivot of each lane, and whether all are positive.
pub(super) struct Pivots<S: Simd> {
    pub smallest: Lanes<S>,
    pub largest: Lanes<S>,
    /// 1 if all pivots are positive and finite, else 0.
    pub positive: Lanes<S>,
}

impl<S: Simd> Pivots<S> {
    /// Takes account of a pivot; returns the inverse of its root.
    #[inline(always)]
    fn inverse_root(&mut self, pivot: Lanes<S>) -> Lanes<S> {
        let simd = pivot.0;
        let zero = Lanes::splat(simd, 0.0);
        self.positive = self.positive.where_or(zero.less(pivot), zero);
        self.positive = self.positive.where_or(pivot.less(Lanes::splat(simd, f64::INFINITY)), zero);
        self.smallest = pivot.where_or(pivot.less(self.smallest), self.smallest);
        self.largest = pivot.where_or(self.largest.less(pivot), self.largest);
        Lanes::splat(simd, 1.0).div(pivot.sqrt())
    }

    /// Replaces a diagonal block by the inverse of its Cholesky factor.
    #[inline(always)]
    fn invert(&mut self, d: &mut Triangle<S>) {
        let i00 = self.inverse_root(d[0]);
        let (l10, l20) = (d[1] * i00, d[3] * i00);
        d[2].subtract_product(l10, l10);
        let i11 = self.inverse_root(d[2]);
        d[4].subtract_product(l20, l10);
        let l21 = d[4] * i11;
        d[5].subtract_product(l20, l20);
        d[5].subtract_product(l21, l21);
        let i22 = self.inverse_root(d[5]);
        let (i10, i21) = (-(l10 * i00) * i11, -(l21 * i11) * i22);
        d[3] = -(l20 * i00 + l21 * i10) * i22;
        (d[0], d[1], d[2], d[4], d[5]) = (i00, i10, i11, i21, i22);
    }
}

/// The place of the block of row `p` and column `q` of a tile, `p > q`.
#[inline(always)]
pub(super) const fn inner(p: usize, q: usize) -> usize {
    p * (p - 1) / 2 + q
}

/// The pairs of columns of a tile.
#[inline(always)]
pub(super) const fn pairs_of(columns: usize) -> usize {
    columns * (columns - 1) / 2
}

/// The most pairs of columns of a tile: those of two columns.
const MOST_PAIRS: usize = 1;

/// How the blocks of a matrix below its diagonal are stored.
pub(super) trait OffDiagonal {
    /// Loads the negative of the block of an edge.
    fn load_negative<S: Simd>(simd: S, from: &[S::Stored], edge: usize) -> Block<S>;
}

/// Nine numbers for each edge, row by row: the block in the row of the node that is eliminated later.
#[cfg(feature = "batched")]
pub(super) struct Full;

/// Six numbers for each edge: the lower triangle of the negative of a symmetric block.
pub(super) struct NegatedSymmetric;

#[cfg(feature = "batched")]
impl OffDiagonal for Full {
    #[inline(always)]
    fn load_negative<S: Simd>(simd: S, from: &[S::Stored], edge: usize) -> Block<S> {
        negated(load(simd, from, edge))
    }
}

impl OffDiagonal for NegatedSymmetric {
    #[inline(always)]
    fn load_negative<S: Simd>(simd: S, from: &[S::Stored], edge: usize) -> Block<S> {
        let k: Triangle<S> = load(simd, from, edge);
        [k[0], k[1], k[3], k[1], k[2], k[4], k[3], k[4], k[5]]
    }
}

/// Factors the matrices `A = L L^T`, and solves `L y = b` on the way. The schedule has panels, and tiles of `C` columns
/// and one row; `O` tells how the blocks below the diagonal are stored.
pub(super) struct Factor<'a, S: Simd, O, const C: usize> {
    pub schedule: &'a Schedule,
    /// Six numbers of each node: the lower triangle of its diagonal block.
    pub matrix_diagonal: &'a [S::Stored],
    /// The blocks below the diagonal, one for each edge.
    pub off_diagonal: &'a [S::Stored],
    /// Six of each node: the inverse of the diagonal block of the factor.
    pub diagonal: &'a mut [S::Stored],
    /// Nine of each block of the factor below the diagonal, and of a last block of zeros.
    pub lower: &'a mut [S::Stored],
    /// Three of each node: `b`, which `y` replaces.
    pub right: &'a mut [S::Stored],
    pub stored: PhantomData<O>,
}

/// Where the numbers of a tile are before its updates.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Start {
    /// In the matrix.
    Matrix,
    /// In the factor, because its panel was updated before.
    Factor,
}

/// The numbers of a factorization, while it runs.
struct Numbers<'a, S: Simd, O> {
    simd: S,
    matrix_diagonal: &'a [S::Stored],
    off_diagonal: &'a [S::Stored],
    diagonal: &'a mut [S::Stored],
    lower: &'a mut [S::Stored],
    right: &'a mut [S::Stored],
    /// The block of zeros.
    none: usize,
    stored: PhantomData<O>,
}

/// The head of a tile in the list of operations.
#[derive(Clone, Copy)]
struct Head<'a> {
    first: usize,
    count: usize,
    /// The blocks of the pairs of columns, and their edges.
    within: &'a [u32],
}

/// The blocks of a tile on and below the diagonal, and its right-hand side, with the signs changed.
struct TileSums<S: Simd, const C: usize> {
    d: [Triangle<S>; C],
    y: [Node<S>; C],
    low: [Block<S>; MOST_PAIRS],
}

/// Takes numbers from the front of a list.
#[inline(always)]
pub(super) fn take<'a>(list: &mut &'a [u32], count: usize) -> &'a [u32] {
    let (taken, rest) = list.split_at(count);
    *list = rest;
    taken
}

impl<S: Simd, O: OffDiagonal> Numbers<'_, S, O> {
    /// The negative value of a block before updates.
    #[inline(always)]
    fn start(&self, start: Start, block: u32, edge: u32) -> Block<S> {
        if start == Start::Factor {
            return load(self.simd, self.lower, if block == NONE { self.none } else { block as usize });
        }
        if edge == NONE {
            [Lanes::splat(self.simd, 0.0); 9]
        } else {
            O::load_negative(self.simd, self.off_diagonal, edge as usize)
        }
    }

    /// Loads the sums of a tile and adds the updates of the list.
    #[inline(always)]
    fn tile<'o, const C: usize>(&self, list: &mut &'o [u32], start: Start) -> (Head<'o>, TileSums<S, C>) {
        let zero = Lanes::splat(self.simd, 0.0);
        let header = take(list, 2);
        let head = Head { first: header[0] as usize, count: header[1] as usize, within: take(list, 2 * pairs_of(C)) };
        let mut sums = TileSums { d: [[zero; 6]; C], y: [[zero; 3]; C], low: [[zero; 9]; MOST_PAIRS] };
        let updates = take(list, 1)[0] as usize;
        let updates = take(list, updates * (1 + C));
        if C > 1 && head.count == 1 {
            self.tile_column::<C, 1, 0>(&mut sums, head, updates, start);
        } else {
            self.tile_column::<C, C, 0>(&mut sums, head, updates, start);
            self.tile_column::<C, C, 1>(&mut sums, head, updates, start);
        }
        (head, sums)
    }

    /// Loads the sums of the column `Q` of a tile in the rows of its first `M` columns, and adds the updates. Those of all
    /// columns would not fit into the registers.
    #[inline(always)]
    fn tile_column<const C: usize, const M: usize, const Q: usize>(
        &self,
        sums: &mut TileSums<S, C>,
        head: Head<'_>,
        updates: &[u32],
        start: Start,
    ) {
        if Q >= M || Q >= head.count {
            return;
        }
        let (simd, node) = (self.simd, head.first + Q);
        let (mut d, mut y): (Triangle<S>, Node<S>) = match start {
            Start::Factor => (load(simd, self.diagonal, node), load(simd, self.right, node)),
            Start::Matrix => (negated(load(simd, self.matrix_diagonal, node)), negated(load(simd, self.right, node))),
        };
        let mut low = [[Lanes::splat(simd, 0.0); 9]; MOST_PAIRS];
        for p in Q + 1..M {
            let pair = inner(p, Q);
            low[pair] = self.start(start, head.within[2 * pair], head.within[2 * pair + 1]);
        }
        for now in updates.chunks_exact(1 + C) {
            let before: Node<S> = load(simd, self.right, now[0] as usize);
            let b: Block<S> = load(simd, self.lower, now[1 + Q] as usize);
            add_square(&mut d, &b);
            add_image(&mut y, &b, &before);
            for p in Q + 1..M {
                let below: Block<S> = load(simd, self.lower, now[1 + p] as usize);
                add_product(&mut low[inner(p, Q)], &below, &b);
            }
        }
        (sums.d[Q], sums.y[Q]) = (d, y);
        for p in Q + 1..M {
            sums.low[inner(p, Q)] = low[inner(p, Q)];
        }
    }

    /// Stores the sums of a tile whose updates are not complete.
    #[inline(always)]
    fn keep<const C: usize>(&mut self, head: Head<'_>, sums: &TileSums<S, C>) {
        for q in 0..C {
            if q < head.count {
                store(&sums.d[q], self.diagonal, head.first + q);
                store(&sums.y[q], self.right, head.first + q);
            }
            for p in q + 1..C {
                self.store_block(head.within[2 * inner(p, q)], &sums.low[inner(p, q)]);
            }
        }
    }

    #[inline(always)]
    fn store_block(&mut self, number: u32, block: &Block<S>) {
        if number != NONE {
            store(block, self.lower, number as usize);
        }
    }

    /// Loads the sums of a row below the first `M` columns of a tile and adds the updates of the list; returns also its
    /// blocks.
    #[inline(always)]
    fn row<'o, const C: usize, const M: usize>(
        &self,
        list: &mut &'o [u32],
        start: Start,
    ) -> (&'o [u32], [Block<S>; M]) {
        let destination = take(list, 2 * C);
        let mut sums: [Block<S>; M] = [[Lanes::splat(self.simd, 0.0); 9]; M];
        for q in 0..M {
            sums[q] = self.start(start, destination[2 * q], destination[2 * q + 1]);
        }
        let updates = take(list, 1)[0] as usize;
        for now in take(list, updates * (C + 1)).chunks_exact(C + 1) {
            let a: Block<S> = load(self.simd, self.lower, now[C] as usize);
            for q in 0..M {
                let b: Block<S> = load(self.simd, self.lower, now[q] as usize);
                add_product(&mut sums[q], &a, &b);
            }
        }
        (destination, sums)
    }

    /// Updates a panel by the columns before it. Returns the number of its tiles, and where their numbers are.
    #[inline(always)]
    fn update_panel<const C: usize>(&mut self, list: &mut &[u32]) -> (u32, Start) {
        let header = take(list, 2);
        let (tiles, steps) = (header[0], header[1]);
        let mut start = Start::Matrix;
        for _ in 0..steps {
            for _ in 0..tiles {
                let (head, sums) = self.tile::<C>(list, start);
                self.keep(head, &sums);
            }
            for _ in 0..take(list, 1)[0] {
                let (destination, sums) = self.row::<C, C>(list, start);
                for q in 0..C {
                    self.store_block(destination[2 * q], &sums[q]);
                }
            }
            start = Start::Factor;
        }
        (tiles, start)
    }

    /// Factors a tile, after the updates by columns before its panel.
    #[inline(always)]
    fn factor_tile<const C: usize>(&mut self, list: &mut &[u32], start: Start, pivots: &mut Pivots<S>) {
        let (head, mut sums) = self.tile::<C>(list, start);
        self.factor_column::<C, 0>(head, &mut sums, pivots);
        self.factor_column::<C, 1>(head, &mut sums, pivots);
        let rows = take(list, 1)[0];
        if C > 1 && head.count == 1 {
            self.factor_rows::<C, 1>(list, rows, head, start);
        } else {
            self.factor_rows::<C, C>(list, rows, head, start);
        }
    }

    /// Factors the rows below the first `M` columns of a tile.
    #[inline(always)]
    fn factor_rows<const C: usize, const M: usize>(
        &mut self,
        list: &mut &[u32],
        rows: u32,
        head: Head<'_>,
        start: Start,
    ) {
        for _ in 0..rows {
            let (destination, mut sums) = self.row::<C, M>(list, start);
            self.finish_row::<M, 0>(head, destination, &mut sums);
            self.finish_row::<M, 1>(head, destination, &mut sums);
        }
    }

    /// Factors the blocks of the column `Q` of a tile.
    #[inline(always)]
    fn factor_column<const C: usize, const Q: usize>(
        &mut self,
        head: Head<'_>,
        TileSums { d, y, low }: &mut TileSums<S, C>,
        pivots: &mut Pivots<S>,
    ) {
        if Q >= C || Q >= head.count {
            return;
        }
        for s in 0..Q {
            add_square(&mut d[Q], &low[inner(Q, s)]);
            let before = y[s];
            add_image(&mut y[Q], &low[inner(Q, s)], &before);
        }
        (d[Q], y[Q]) = (negated(d[Q]), negated(y[Q]));
        pivots.invert(&mut d[Q]);
        multiply_inverse(&d[Q], &mut y[Q]);
        store(&d[Q], self.diagonal, head.first + Q);
        store(&y[Q], self.right, head.first + Q);
        for p in Q + 1..C {
            let mut block = low[inner(p, Q)];
            for s in 0..Q {
                add_product(&mut block, &low[inner(p, s)], &low[inner(Q, s)]);
            }
            scale_rows(&mut block, &negated(d[Q]));
            low[inner(p, Q)] = block;
            self.store_block(head.within[2 * inner(p, Q)], &block);
        }
    }

    /// Divides a row by the column `Q` of its tile, which is read again because it would take the registers of the
    /// sums.
    #[inline(always)]
    fn finish_row<const M: usize, const Q: usize>(
        &mut self,
        head: Head<'_>,
        destination: &[u32],
        sums: &mut [Block<S>; M],
    ) {
        if Q >= M || Q >= head.count {
            return;
        }
        for s in 0..Q {
            let number = head.within[2 * inner(Q, s)];
            let b: Block<S> = load(self.simd, self.lower, if number == NONE { self.none } else { number as usize });
            let a = sums[s];
            add_product(&mut sums[Q], &a, &b);
        }
        // The signs of the sums are changed.
        let inverse: Triangle<S> = negated(load(self.simd, self.diagonal, head.first + Q));
        scale_rows(&mut sums[Q], &inverse);
        self.store_block(destination[2 * Q], &sums[Q]);
    }
}

impl<S: Simd, O: OffDiagonal, const C: usize> Kernel<S> for Factor<'_, S, O, C> {
    type Output = Pivots<S>;

    #[inline(always)]
    fn run(self, simd: S) -> Pivots<S> {
        const { assert!(pairs_of(C) <= MOST_PAIRS) };
        let Self { schedule, matrix_diagonal, off_diagonal, diagonal, lower, right, stored } = self;
        assert!(schedule.panels > 0 || schedule.tiles == 0, "the schedule has panels");
        let zero = Lanes::splat(simd, 0.0);
        let none = schedule.blocks();
        store(&[zero; 9], lower, none);
        let mut numbers = Numbers { simd, matrix_diagonal, off_diagonal, diagonal, lower, right, none, stored };
        let mut pivots =
            Pivots { smallest: Lanes::splat(simd, f64::MAX), largest: zero, positive: Lanes::splat(simd, 1.0) };
        let (mut of_panels, mut of_tiles) = (&schedule.updates[..], &schedule.factor[..]);
        for _ in 0..schedule.panels {
            let (tiles, start) = numbers.update_panel::<C>(&mut of_panels);
            for _ in 0..tiles {
                numbers.factor_tile::<C>(&mut of_tiles, start, &mut pivots);
            }
        }
        pivots
    }
}
