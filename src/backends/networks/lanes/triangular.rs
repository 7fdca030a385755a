//! Solutions with the factor of the stiffness.

use super::arrays::Arrays;
use super::blocks::{
    Block, Node, Triangle, add_image, add_transposed_image, multiply_inverse, multiply_transposed_inverse, negated,
};
use super::factor::{inner, pairs_of};
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

/// Solves `L y = b` for `N` right-hand sides of three numbers a node, in place, `G` of them at a time.
#[inline(always)]
pub(super) fn forward<S: Simd, const C: usize, const N: usize, const G: usize>(
    simd: S,
    schedule: &Schedule,
    (diagonal, lower): (&[S::Stored], &[S::Stored]),
    values: &mut [S::Stored],
) {
    let zero = Lanes::splat(simd, 0.0);
    let mut op = &schedule.forward[..];
    for _ in 0..schedule.tiles {
        let (first, count) = (op[0] as usize, op[1] as usize);
        let within = &op[2..2 + pairs_of(C)];
        let (updates, rest) = (op[2 + pairs_of(C)] as usize, &op[3 + pairs_of(C)..]);
        let (updates, rest) = rest.split_at(updates * (1 + C));
        op = rest;
        for c in (0..N).step_by(G) {
            let mut sums: [[Node<S>; G]; C] = [[[zero; 3]; G]; C];
            for q in 0..C {
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
                for q in 0..C {
                    let b: Block<S> = load(simd, lower, now[1 + q] as usize);
                    for g in 0..G {
                        add_image(&mut sums[q][g], &b, &known[g]);
                    }
                }
            }
            for q in 0..C {
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
    }
}

/// Solves `L^T x = y` for `N` right-hand sides of three numbers a node, in place, `G` of them at a time.
#[inline(always)]
pub(super) fn backward<S: Simd, const C: usize, const N: usize, const G: usize>(
    simd: S,
    schedule: &Schedule,
    (diagonal, lower): (&[S::Stored], &[S::Stored]),
    values: &mut [S::Stored],
) {
    let zero = Lanes::splat(simd, 0.0);
    let mut op = &schedule.backward[..];
    for _ in 0..schedule.tiles {
        let (first, count) = (op[0] as usize, op[1] as usize);
        let within = &op[2..2 + pairs_of(C)];
        let (updates, rest) = (op[2 + pairs_of(C)] as usize, &op[3 + pairs_of(C)..]);
        let (updates, rest) = rest.split_at(updates * (1 + C));
        op = rest;
        for c in (0..N).step_by(G) {
            let mut sums: [[Node<S>; G]; C] = [[[zero; 3]; G]; C];
            for q in 0..C {
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
                for q in 0..C {
                    let b: Block<S> = load(simd, lower, now[1 + q] as usize);
                    for g in 0..G {
                        add_transposed_image(&mut sums[q][g], &b, &known[g]);
                    }
                }
            }
            for q in (0..C).rev() {
                if q >= count {
                    continue;
                }
                for p in (q + 1..C).rev() {
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
    }
}
