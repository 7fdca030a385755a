//! The Cholesky factorization of the matrices of all lanes.

use std::marker::PhantomData;

use super::blocks::{
    Block, Node, Triangle, multiply_inverse, scale_rows, subtract_image, subtract_product, subtract_square,
};
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

/// The most columns of a tile, and the pairs of them.
const MOST_PAIRS: usize = 3;

/// How the blocks of a matrix below its diagonal are stored.
pub(super) trait OffDiagonal {
    /// Loads the block of an edge.
    fn load<S: Simd>(simd: S, from: &[S::Stored], edge: usize) -> Block<S>;
}

/// Nine numbers for each edge, row by row: the block in the row of the node that is eliminated later.
#[cfg(feature = "batched")]
pub(super) struct Full;

/// Six numbers for each edge: the lower triangle of the negative of a symmetric block.
pub(super) struct NegatedSymmetric;

#[cfg(feature = "batched")]
impl OffDiagonal for Full {
    #[inline(always)]
    fn load<S: Simd>(simd: S, from: &[S::Stored], edge: usize) -> Block<S> {
        load(simd, from, edge)
    }
}

impl OffDiagonal for NegatedSymmetric {
    #[inline(always)]
    fn load<S: Simd>(simd: S, from: &[S::Stored], edge: usize) -> Block<S> {
        let k: Triangle<S> = load(simd, from, edge);
        let k = [-k[0], -k[1], -k[2], -k[3], -k[4], -k[5]];
        [k[0], k[1], k[3], k[1], k[2], k[4], k[3], k[4], k[5]]
    }
}

/// Factors the matrices `A = L L^T`, and solves `L y = b` on the way. The schedule has tiles of `C` columns and `R` rows;
/// `O` tells how the blocks below the diagonal are stored.
pub(super) struct Factor<'a, S: Simd, O, const C: usize, const R: usize> {
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

/// The initial value of a block of the factor.
#[inline(always)]
fn start_block<S: Simd, O: OffDiagonal>(simd: S, from: &[S::Stored], edge: u32) -> Block<S> {
    if edge == NONE { [Lanes::splat(simd, 0.0); 9] } else { O::load(simd, from, edge as usize) }
}

impl<S: Simd, O: OffDiagonal, const C: usize, const R: usize> Kernel<S> for Factor<'_, S, O, C, R> {
    type Output = Pivots<S>;

    #[inline(always)]
    fn run(self, simd: S) -> Pivots<S> {
        let Self { schedule, matrix_diagonal, off_diagonal, diagonal, lower, right, stored: _ } = self;
        let zero = Lanes::splat(simd, 0.0);
        let none = schedule.blocks();
        store(&[zero; 9], lower, none);
        let mut pivots =
            Pivots { smallest: Lanes::splat(simd, f64::MAX), largest: zero, positive: Lanes::splat(simd, 1.0) };
        let mut op = &schedule.factor[..];
        for _ in 0..schedule.tiles {
            let (first, count) = (op[0] as usize, op[1] as usize);
            let within = &op[2..2 + 2 * pairs_of(C)];
            op = &op[2 + 2 * pairs_of(C)..];
            // The blocks of the tile on and below the diagonal.
            let mut d: [Triangle<S>; C] = [[zero; 6]; C];
            let mut y: [Node<S>; C] = [[zero; 3]; C];
            let mut low: [Block<S>; MOST_PAIRS] = [[zero; 9]; MOST_PAIRS];
            for q in 0..C {
                // Columns that the tile does not have are a copy of the first one, which nothing reads.
                let node = if q < count { first + q } else { first };
                d[q] = load(simd, matrix_diagonal, node);
                y[q] = load(simd, right, node);
                for p in q + 1..C {
                    low[inner(p, q)] = start_block::<S, O>(simd, off_diagonal, within[2 * inner(p, q) + 1]);
                }
            }
            let (updates, rest) = (op[0], &op[1..]);
            op = rest;
            for _ in 0..updates {
                let (now, rest) = op.split_at(1 + C);
                op = rest;
                let before: Node<S> = load(simd, right, now[0] as usize);
                let mut b: [Block<S>; C] = [[zero; 9]; C];
                for q in 0..C {
                    b[q] = load(simd, lower, now[1 + q] as usize);
                    subtract_square(&mut d[q], &b[q]);
                    subtract_image(&mut y[q], &b[q], &before);
                    for s in 0..q {
                        subtract_product(&mut low[inner(q, s)], &b[q], &b[s]);
                    }
                }
            }
            for q in 0..C {
                if q >= count {
                    continue;
                }
                for s in 0..q {
                    subtract_square(&mut d[q], &low[inner(q, s)]);
                    let before = y[s];
                    subtract_image(&mut y[q], &low[inner(q, s)], &before);
                }
                pivots.invert(&mut d[q]);
                multiply_inverse(&d[q], &mut y[q]);
                store(&d[q], diagonal, first + q);
                store(&y[q], right, first + q);
                for p in q + 1..C {
                    let mut block = low[inner(p, q)];
                    for s in 0..q {
                        subtract_product(&mut block, &low[inner(p, s)], &low[inner(q, s)]);
                    }
                    scale_rows(&mut block, &d[q]);
                    low[inner(p, q)] = block;
                    let number = within[2 * inner(p, q)];
                    if number != NONE {
                        store(&block, lower, number as usize);
                    }
                }
            }
            // The blocks below the tile.
            let (groups, rest) = (op[0], &op[1..]);
            op = rest;
            for _ in 0..groups {
                let (destination, rest) = op.split_at(2 * C * R);
                let (updates, rest) = (rest[0], &rest[1..]);
                op = rest;
                let mut sums: [[Block<S>; C]; R] = [[[zero; 9]; C]; R];
                for r in 0..R {
                    for q in 0..C {
                        sums[r][q] = start_block::<S, O>(simd, off_diagonal, destination[2 * (C * r + q) + 1]);
                    }
                }
                for _ in 0..updates {
                    let (now, rest) = op.split_at(C + R);
                    op = rest;
                    for r in 0..R {
                        let a: Block<S> = load(simd, lower, now[C + r] as usize);
                        for q in 0..C {
                            let b: Block<S> = load(simd, lower, now[q] as usize);
                            subtract_product(&mut sums[r][q], &a, &b);
                        }
                    }
                }
                // The tile is read again, because its blocks would take the registers of the sums.
                for q in 0..C {
                    if q >= count {
                        continue;
                    }
                    let inverse: Triangle<S> = load(simd, diagonal, first + q);
                    for s in 0..q {
                        let number = within[2 * inner(q, s)];
                        let b: Block<S> = load(simd, lower, if number == NONE { none } else { number as usize });
                        for r in 0..R {
                            let a = sums[r][s];
                            subtract_product(&mut sums[r][q], &a, &b);
                        }
                    }
                    for r in 0..R {
                        scale_rows(&mut sums[r][q], &inverse);
                        let number = destination[2 * (C * r + q)];
                        if number != NONE {
                            store(&sums[r][q], lower, number as usize);
                        }
                    }
                }
            }
        }
        pivots
    }
}
