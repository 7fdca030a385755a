//! Solutions with the factor of the stiffness.

use super::arrays::Arrays;
use super::blocks::{
    Block, Node, Triangle, add_image, add_transposed_image, multiply_inverse, multiply_transposed_inverse, negated,
};
use super::factor::{inner, pairs_of, take};
use super::network::Network;
use super::simd::{Double, Kernel, Lanes, Simd, load, store};
use crate::backends::networks::Schedule;

/// Solves `L^T x = y` for `direction`.
pub(super) struct SolveDirection<'a, 'b, S: Double, const C: usize> {
    pub network: &'a Network,
    pub arrays: &'a mut Arrays<'b, S>,
}

impl<S: Double, const C: usize> Kernel<S> for SolveDirection<'_, '_, S, C> {
    type Output = ();

    #[inline(always)]
    fn run(self, simd: S) {
        let Arrays { diagonal, lower, direction, .. } = self.arrays;
        backward::<S, C, 1, 1>(simd, &self.network.schedule, (diagonal, lower), direction);
    }
}

/// Solves `L L^T x = b` in place.
pub(super) struct SolveBoth<'a, S: Simd, const C: usize> {
    pub schedule: &'a Schedule,
    pub diagonal: &'a [S::Stored],
    pub lower: &'a [S::Stored],
    pub right: &'a mut [S::Stored],
}

impl<S: Simd, const C: usize> Kernel<S> for SolveBoth<'_, S, C> {
    type Output = ();

    #[inline(always)]
    fn run(self, simd: S) {
        let Self { schedule, diagonal, lower, right } = self;
        forward::<S, C, 1, 1>(simd, schedule, (diagonal, lower), right);
        backward::<S, C, 1, 1>(simd, schedule, (diagonal, lower), right);
    }
}

/// The operations of a tile of a substitution.
struct TileOps<'a> {
    first: usize,
    count: usize,
    /// The blocks of the pairs of columns.
    within: &'a [u32],
    /// For each update, the node and the blocks of the columns.
    updates: &'a [u32],
}

/// Takes the operations of a tile of up to `C` columns from the front of a list.
#[inline(always)]
fn take_tile<'a, const C: usize>(list: &mut &'a [u32]) -> TileOps<'a> {
    let header = take(list, 2);
    let within = take(list, pairs_of(C));
    let updates = take(list, 1)[0] as usize;
    TileOps { first: header[0] as usize, count: header[1] as usize, within, updates: take(list, updates * (1 + C)) }
}

/// Solves `L y = b` for `N` right-hand sides of three numbers a node, in place, `G` of them at a time.
#[inline(always)]
pub(super) fn forward<S: Simd, const C: usize, const N: usize, const G: usize>(
    simd: S,
    schedule: &Schedule,
    factor: (&[S::Stored], &[S::Stored]),
    values: &mut [S::Stored],
) {
    let mut list = &schedule.forward[..];
    for _ in 0..schedule.tiles {
        let tile = take_tile::<C>(&mut list);
        for c in (0..N).step_by(G) {
            if C > 1 && tile.count == 1 {
                forward_tile::<S, C, 1, N, G>(simd, &tile, factor, values, c);
            } else {
                forward_tile::<S, C, C, N, G>(simd, &tile, factor, values, c);
            }
        }
    }
}

/// Solves for the right-hand sides from `c` on in the first `M` columns of a tile.
#[inline(always)]
fn forward_tile<S: Simd, const C: usize, const M: usize, const N: usize, const G: usize>(
    simd: S,
    tile: &TileOps<'_>,
    (diagonal, lower): (&[S::Stored], &[S::Stored]),
    values: &mut [S::Stored],
    c: usize,
) {
    let &TileOps { first, count, within, .. } = tile;
    let mut sums = updated::<S, C, M, N, G, false>(simd, tile, lower, values, c);
    for q in 0..M {
        if q >= count {
            continue;
        }
        for s in 0..q {
            let b: Block<S> = load(simd, lower, within[inner(q, s)] as usize);
            let before = sums[s];
            for g in 0..G {
                add_image(&mut sums[q][g], &b, &before[g]);
            }
        }
        // The signs of the sums are changed.
        let inverse: Triangle<S> = negated(load(simd, diagonal, first + q));
        for g in 0..G {
            multiply_inverse(&inverse, &mut sums[q][g]);
            store(&sums[q][g], values, N * (first + q) + c + g);
        }
    }
}

/// Solves `L^T x = y` for `N` right-hand sides of three numbers a node, in place, `G` of them at a time.
#[inline(always)]
pub(super) fn backward<S: Simd, const C: usize, const N: usize, const G: usize>(
    simd: S,
    schedule: &Schedule,
    factor: (&[S::Stored], &[S::Stored]),
    values: &mut [S::Stored],
) {
    let mut list = &schedule.backward[..];
    for _ in 0..schedule.tiles {
        let tile = take_tile::<C>(&mut list);
        for c in (0..N).step_by(G) {
            if C > 1 && tile.count == 1 {
                backward_tile::<S, C, 1, N, G>(simd, &tile, factor, values, c);
            } else {
                backward_tile::<S, C, C, N, G>(simd, &tile, factor, values, c);
            }
        }
    }
}

/// Solves with the transpose for the right-hand sides from `c` on in the first `M` columns of a tile.
#[inline(always)]
fn backward_tile<S: Simd, const C: usize, const M: usize, const N: usize, const G: usize>(
    simd: S,
    tile: &TileOps<'_>,
    (diagonal, lower): (&[S::Stored], &[S::Stored]),
    values: &mut [S::Stored],
    c: usize,
) {
    let &TileOps { first, count, within, .. } = tile;
    let mut sums = updated::<S, C, M, N, G, true>(simd, tile, lower, values, c);
    for q in (0..M).rev() {
        if q >= count {
            continue;
        }
        for p in (q + 1..M).rev() {
            if p < count {
                let b: Block<S> = load(simd, lower, within[inner(p, q)] as usize);
                let after = sums[p];
                for g in 0..G {
                    add_transposed_image(&mut sums[q][g], &b, &after[g]);
                }
            }
        }
        // The signs of the sums are changed.
        let inverse: Triangle<S> = negated(load(simd, diagonal, first + q));
        for g in 0..G {
            multiply_transposed_inverse(&inverse, &mut sums[q][g]);
            store(&sums[q][g], values, N * (first + q) + c + g);
        }
    }
}

/// Returns the negatives of the right-hand sides from `c` on in the first `M` columns of a tile, after the updates by the
/// blocks or, if `TRANSPOSED`, by their transposes.
#[inline(always)]
fn updated<S: Simd, const C: usize, const M: usize, const N: usize, const G: usize, const TRANSPOSED: bool>(
    simd: S,
    &TileOps { first, count, updates, .. }: &TileOps<'_>,
    lower: &[S::Stored],
    values: &[S::Stored],
    c: usize,
) -> [[Node<S>; G]; M] {
    let zero = Lanes::splat(simd, 0.0);
    let mut sums = [[[zero; 3]; G]; M];
    for q in 0..M {
        for g in 0..G {
            let node = if q < count { first + q } else { first };
            sums[q][g] = negated(load(simd, values, N * node + c + g));
        }
    }
    for now in updates.chunks_exact(1 + C) {
        let mut known: [Node<S>; G] = [[zero; 3]; G];
        for g in 0..G {
            known[g] = load(simd, values, N * now[0] as usize + c + g);
        }
        for q in 0..M {
            let b: Block<S> = load(simd, lower, now[1 + q] as usize);
            for g in 0..G {
                if TRANSPOSED {
                    add_transposed_image(&mut sums[q][g], &b, &known[g]);
                } else {
                    add_image(&mut sums[q][g], &b, &known[g]);
                }
            }
        }
    }
    sums
}
