//! Newton directions by factors of single precision, corrected until the residual of double precision is small.
//!
//! A factor of single precision takes half of the time, but leaves about a thousandth of the residual `r - K d`. It
//! therefore only preconditions the iteration `d += (L L^T)^-1 (r - K d)`, whose residual has double precision. A lane
//! whose residual is small enough keeps its direction while others are corrected.

use std::marker::PhantomData;

use super::arrays::{Arrays, single_lengths};
use super::blocks::{Node, Triangle, multiply_symmetric};
use super::factor::{Factor, NegatedSymmetric};
use super::forces::add_to;
use super::network::Network;
use super::simd::{Double, Kernel, Lanes, MOST_LANES, Simd, load, store};
use super::triangular::{SolveBoth, backward};

/// The residual of a direction, relative to that of the equilibrium, at which it is accurate. Newton's method then converges
/// as with the exact direction, until the residual is a millionth of the first one or less.
const ACCURATE: f64 = 1e-6;

/// Corrections after which a lane gives up.
const MOST_CORRECTIONS: usize = 8;

/// The numbers of single precision of a group.
struct SingleArrays<'a, S: Double> {
    stiffness: &'a mut [<S::Single as Simd>::Stored],
    pairs: &'a mut [<S::Single as Simd>::Stored],
    diagonal: &'a mut [<S::Single as Simd>::Stored],
    lower: &'a mut [<S::Single as Simd>::Stored],
    right: &'a mut [<S::Single as Simd>::Stored],
}

/// Divides an array that is free until the end.
fn single_arrays<'a, S: Double>(network: &Network, free: &'a mut [S::Stored]) -> SingleArrays<'a, S> {
    let mut rest: &mut [<S::Single as Simd>::Stored] = bytemuck::cast_slice_mut(free);
    let mut take = |length: usize| {
        let (taken, others) = std::mem::take(&mut rest).split_at_mut(length);
        rest = others;
        taken
    };
    let [stiffness, pairs, diagonal, lower, right] = single_lengths(network).map(&mut take);
    SingleArrays { stiffness, pairs, diagonal, lower, right }
}

/// The pivots of the lanes, and which of them have an accurate direction.
pub(super) struct SingleDirection {
    pub smallest: [f64; MOST_LANES],
    pub largest: [f64; MOST_LANES],
    /// Whether all pivots of a lane are positive, and its direction is accurate.
    pub is_accurate: [bool; MOST_LANES],
}

/// Computes the directions `K d = r` of the lanes with these norms of `r`, into the first numbers of `modes`.
pub(super) fn direction<S: Double, const C: usize, const R: usize>(
    simd: S,
    network: &Network,
    arrays: &mut Arrays<'_, S>,
    residuals: &[f64; MOST_LANES],
) -> SingleDirection {
    let Arrays { stiffness, pairs, direction, modes, loads, .. } = arrays;
    let single = single_arrays::<S>(network, loads);
    let (found, remainder) = modes.split_at_mut(3 * network.interior);
    let remainder = &mut remainder[..3 * network.interior];
    // The range of single precision is narrow: both sides of the equations are scaled.
    let unit = [1.0 / network.stiffness; MOST_LANES];
    let of_right = residuals.map(|norm| if norm > 0.0 && norm.is_finite() { 1.0 / norm } else { 1.0 });
    let back: [f64; MOST_LANES] = std::array::from_fn(|lane| unit[lane] / of_right[lane]);
    let narrow = |from: &[S::Stored], to: &mut [<S::Single as Simd>::Stored], factors: &[f64; MOST_LANES]| {
        simd.vectorize(Narrow::<S> { from, to, factors });
    };
    narrow(stiffness, single.stiffness, &unit);
    narrow(pairs, single.pairs, &unit);
    narrow(direction, single.right, &of_right);
    let pivots = simd.single().vectorize(Factor::<S::Single, NegatedSymmetric, C, R> {
        schedule: &network.schedule,
        matrix_diagonal: single.stiffness,
        off_diagonal: single.pairs,
        diagonal: single.diagonal,
        lower: single.lower,
        right: single.right,
        stored: PhantomData,
    });
    let (diagonal, lower) = (&*single.diagonal, &*single.lower);
    simd.single().vectorize(Backward::<S::Single, C> { network, factor: (diagonal, lower), right: single.right });
    simd.vectorize(Widen::<S> { from: single.right, to: found, factors: &back });
    let positive = pivots.positive.numbers();
    let mut is_accurate = [false; MOST_LANES];
    for correction in 0..=MOST_CORRECTIONS {
        let squares = simd.vectorize(Remainder { network, stiffness, pairs, right: direction, found, remainder });
        let squares = squares.numbers();
        let mut factors = [0.0; MOST_LANES];
        for lane in 0..S::LANES {
            is_accurate[lane] |= squares[lane].sqrt() <= ACCURATE * residuals[lane];
            if !is_accurate[lane] && positive[lane] != 0.0 {
                factors[lane] = back[lane];
            }
        }
        if correction == MOST_CORRECTIONS || factors == [0.0; MOST_LANES] {
            break;
        }
        narrow(remainder, single.right, &of_right);
        let right = &mut *single.right;
        simd.single().vectorize(SolveBoth::<S::Single, C> { schedule: &network.schedule, diagonal, lower, right });
        simd.vectorize(Correct::<S> { from: right, to: found, factors: &factors });
    }
    for lane in 0..S::LANES {
        is_accurate[lane] &= positive[lane] != 0.0;
    }
    SingleDirection { smallest: pivots.smallest.numbers(), largest: pivots.largest.numbers(), is_accurate }
}

/// Multiplies by the factors of the lanes, and rounds to single precision.
struct Narrow<'a, S: Double> {
    from: &'a [S::Stored],
    to: &'a mut [<S::Single as Simd>::Stored],
    factors: &'a [f64; MOST_LANES],
}

impl<S: Double> Kernel<S> for Narrow<'_, S> {
    type Output = ();

    #[inline(always)]
    fn run(self, simd: S) {
        let factors = Lanes::of_numbers(simd, self.factors);
        for (from, to) in self.from.iter().zip(self.to) {
            let scaled = Lanes::load(simd, from) * factors;
            simd.single().store(simd.narrow(scaled.1), to);
        }
    }
}

/// Multiplies numbers of single precision by the factors of the lanes.
struct Widen<'a, S: Double> {
    from: &'a [<S::Single as Simd>::Stored],
    to: &'a mut [S::Stored],
    factors: &'a [f64; MOST_LANES],
}

impl<S: Double> Kernel<S> for Widen<'_, S> {
    type Output = ();

    #[inline(always)]
    fn run(self, simd: S) {
        let factors = Lanes::of_numbers(simd, self.factors);
        for (from, to) in self.from.iter().zip(self.to) {
            let wide = Lanes(simd, simd.widen(simd.single().load(from)));
            (wide * factors).store(to);
        }
    }
}

/// Adds numbers of single precision times the factors of the lanes; where these are zero, nothing changes.
struct Correct<'a, S: Double> {
    from: &'a [<S::Single as Simd>::Stored],
    to: &'a mut [S::Stored],
    factors: &'a [f64; MOST_LANES],
}

impl<S: Double> Kernel<S> for Correct<'_, S> {
    type Output = ();

    #[inline(always)]
    fn run(self, simd: S) {
        let factors = Lanes::of_numbers(simd, self.factors);
        let changes = Lanes::splat(simd, 0.0).less(factors.abs());
        for (from, to) in self.from.iter().zip(self.to) {
            let wide = Lanes(simd, simd.widen(simd.single().load(from)));
            let before = Lanes::load(simd, to);
            // A lane that does not change may hold a correction that is not finite.
            wide.mul_add(factors, before).where_or(changes, before).store(to);
        }
    }
}

/// Solves `L^T x = y` in place.
struct Backward<'a, S: Simd, const C: usize> {
    network: &'a Network,
    factor: (&'a [S::Stored], &'a [S::Stored]),
    right: &'a mut [S::Stored],
}

impl<S: Simd, const C: usize> Kernel<S> for Backward<'_, S, C> {
    type Output = ();

    #[inline(always)]
    fn run(self, simd: S) {
        backward::<S, C, 1, 1>(simd, &self.network.schedule, self.factor, self.right);
    }
}

/// Computes `r - K d`; returns the squares of its norms.
struct Remainder<'a, S: Double> {
    network: &'a Network,
    stiffness: &'a [S::Stored],
    pairs: &'a [S::Stored],
    right: &'a [S::Stored],
    found: &'a [S::Stored],
    remainder: &'a mut [S::Stored],
}

impl<S: Double> Kernel<S> for Remainder<'_, S> {
    type Output = Lanes<S>;

    #[inline(always)]
    fn run(self, simd: S) -> Lanes<S> {
        let Self { network, stiffness, pairs, right, found, remainder } = self;
        for node in 0..network.interior {
            let r: Node<S> = load(simd, right, node);
            let d: Node<S> = load(simd, found, node);
            let block: Triangle<S> = load(simd, stiffness, node);
            let force = multiply_symmetric(&block, &d);
            store(&[r[0] - force[0], r[1] - force[1], r[2] - force[2]], remainder, node);
        }
        // A pair has the negative of its block.
        for (number, ends) in network.pair_ends.iter().enumerate() {
            let [a, b] = ends.map(|node| node as usize);
            let block: Triangle<S> = load(simd, pairs, number);
            let (of_a, of_b): (Node<S>, Node<S>) = (load(simd, found, a), load(simd, found, b));
            add_to(simd, remainder, a, &multiply_symmetric(&block, &of_b));
            add_to(simd, remainder, b, &multiply_symmetric(&block, &of_a));
        }
        let mut squares = Lanes::splat(simd, 0.0);
        for node in 0..network.interior {
            let s: Node<S> = load(simd, remainder, node);
            squares += s[0] * s[0] + s[1] * s[1] + s[2] * s[2];
        }
        squares
    }
}
