//! Newton directions by factors of single precision, corrected until the residual of double precision is small.
//!
//! A factor of single precision leaves about a thousandth of the residual `r - K d`. It therefore only preconditions
//! the iteration `d += (L L^T)^-1 (r - K d)`, whose residual has double precision. A lane whose residual is small
//! enough keeps its direction while others are corrected. Where the factor says nothing about the definiteness of `K`,
//! or the corrections do not suffice, the caller factors in double precision. While steps reduce the residual well,
//! directions need not be exact, and a factor serves several of them ([`chord`]).

use std::marker::PhantomData;

use super::arrays::{Arrays, single_lengths};
use super::blocks::{Node, Triangle, multiply_symmetric};
use super::factor::{Factor, NegatedSymmetric};
use super::forces::add_to;
use super::network::Network;
use super::simd::{Double, Kernel, Lanes, MOST_LANES, Simd, load, numbers_of_mut, store};
use super::triangular::{SolveBoth, backward};

/// The residual of a direction, relative to `r`, at which it is accurate. The residuals of Newton's method then fall as
/// with exact directions, but in each iteration at most by this factor.
const ACCURATE: f64 = 1e-6;

/// The same for rough directions.
const ROUGH: f64 = 1e-2;

/// Corrections after which the lanes that are not accurate give up.
const MOST_CORRECTIONS: usize = 4;

/// The ratio of the smallest pivot to the largest one below which rounding in single precision may change its sign.
const LEAST_RATIO: f64 = 1e-5;

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

/// The units in which the equations of each lane have single precision, whose range is narrow.
struct Units {
    unit: [f64; MOST_LANES],
    of_right: [f64; MOST_LANES],
    back: [f64; MOST_LANES],
}

impl Units {
    fn of(network: &Network, residuals: &[Option<f64>; MOST_LANES]) -> Self {
        let unit = [1.0 / network.stiffness; MOST_LANES];
        let of_right = residuals.map(|norm| norm.map_or(1.0, |norm| 1.0 / norm));
        Self { unit, of_right, back: std::array::from_fn(|lane| unit[lane] / of_right[lane]) }
    }
}

/// The outcome of the lanes.
pub(super) struct SingleDirection {
    /// The ratio of the smallest pivot of a lane to the largest one.
    pub ratios: [f64; MOST_LANES],
    /// Whether the matrix of a lane is evidently positive definite, and its direction accurate.
    pub is_accurate: [bool; MOST_LANES],
    /// The corrections of the lane that needed most.
    #[cfg(test)]
    pub corrections: usize,
}

/// Computes the directions `K d = r` of the lanes for which there is a norm of `r`, into the first numbers of `modes`.
/// Those of `rough` lanes need not be accurate.
pub(super) fn direction<S: Double, const C: usize>(
    simd: S,
    network: &Network,
    arrays: &mut Arrays<'_, S>,
    residuals: &[Option<f64>; MOST_LANES],
    rough: &[bool; MOST_LANES],
) -> SingleDirection {
    let Arrays { stiffness, connections, direction, modes, loads, .. } = arrays;
    let pairs = &connections[..6 * network.pairs];
    let single = single_arrays::<S>(network, loads);
    let (found, remainder) = modes.split_at_mut(3 * network.interior);
    let remainder = &mut remainder[..3 * network.interior];
    let Units { unit, of_right, back } = Units::of(network, residuals);
    let narrow = |from: &[S::Stored], to: &mut [<S::Single as Simd>::Stored], factors: &[f64; MOST_LANES]| {
        simd.vectorize(Narrow::<S> { from, to, factors });
    };
    narrow(stiffness, single.stiffness, &unit);
    narrow(pairs, single.pairs, &unit);
    narrow(direction, single.right, &of_right);
    let pivots = simd.single().vectorize(Factor::<S::Single, NegatedSymmetric, C> {
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
    widen(simd, single.right, found, &back);
    let (smallest, largest, positive) =
        (pivots.smallest.numbers(), pivots.largest.numbers(), pivots.positive.numbers());
    let ratios: [f64; MOST_LANES] = std::array::from_fn(|lane| smallest[lane] / largest[lane]);
    let is_definite = |lane: usize| positive[lane] != 0.0 && ratios[lane] >= LEAST_RATIO;
    let mut is_accurate = [false; MOST_LANES];
    let mut corrections = 0;
    loop {
        let squares = simd.vectorize(Remainder { network, stiffness, pairs, right: direction, found, remainder });
        let squares = squares.numbers();
        let mut factors = [0.0; MOST_LANES];
        for lane in (0..S::LANES).filter(|&lane| is_definite(lane)) {
            let Some(residual) = residuals[lane] else { continue };
            let tolerance = if rough[lane] { ROUGH } else { ACCURATE };
            is_accurate[lane] |= squares[lane].sqrt() <= tolerance * residual;
            if !is_accurate[lane] {
                factors[lane] = back[lane];
            }
        }
        if corrections == MOST_CORRECTIONS || factors == [0.0; MOST_LANES] {
            break;
        }
        corrections += 1;
        narrow(remainder, single.right, &of_right);
        let right = &mut *single.right;
        simd.single().vectorize(SolveBoth::<S::Single, C> { schedule: &network.schedule, diagonal, lower, right });
        simd.vectorize(Correct::<S> { from: right, to: found, factors: &factors });
    }
    SingleDirection {
        ratios,
        is_accurate,
        #[cfg(test)]
        corrections,
    }
}

/// Computes the directions of the lanes for which there is a norm of `r`, with the factors of the last call of
/// [`direction`], into the first numbers of `modes`.
pub(super) fn chord<S: Double, const C: usize>(
    simd: S,
    network: &Network,
    arrays: &mut Arrays<'_, S>,
    residuals: &[Option<f64>; MOST_LANES],
) {
    let Arrays { direction, modes, loads, .. } = arrays;
    let SingleArrays { diagonal, lower, right, .. } = single_arrays::<S>(network, loads);
    let Units { of_right, back, .. } = Units::of(network, residuals);
    simd.vectorize(Narrow::<S> { from: direction, to: right, factors: &of_right });
    simd.single().vectorize(SolveBoth::<S::Single, C> { schedule: &network.schedule, diagonal, lower, right });
    widen(simd, right, &mut modes[..3 * network.interior], &back);
}

/// Returns numbers of single precision times the factors of the lanes.
fn widen<S: Double>(simd: S, from: &[<S::Single as Simd>::Stored], to: &mut [S::Stored], factors: &[f64; MOST_LANES]) {
    numbers_of_mut::<S>(to).fill(0.0);
    simd.vectorize(Correct::<S> { from, to, factors });
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
        for (number, ends) in network.connections[..network.pairs].iter().enumerate() {
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::backends::networks::lanes::arrays::with_arrays;
    use crate::backends::networks::lanes::forces::Evaluate;
    use crate::backends::networks::lanes::portable::Portable;
    use crate::backends::networks::lanes::simd::numbers_of;
    use crate::backends::networks::lanes::test_network::{grid, write};
    use crate::backends::networks::lanes::triangular::SolveDirection;

    /// The directions are those of factors of double precision, whatever the units are; a lane that is not positive
    /// definite has none, and lanes without a residual cause no corrections.
    #[test]
    fn directions_are_those_of_double_precision() {
        const CRUSHED: usize = 2;
        for youngs_modulus in [1e-12, 1e7, 1e25] {
            let (data, interior) = grid(youngs_modulus);
            let network = Network::new(&data, Portable::TILE);
            with_arrays::<Portable, ()>(&network, true, |arrays| {
                write(&network, &interior, Some(CRUSHED), arrays.positions);
                let forces = Portable.vectorize(Evaluate { network: &network, arrays });
                let residuals = forces.residual.numbers();
                let mut wanted = [None; MOST_LANES];
                (0..Portable::LANES).for_each(|lane| wanted[lane] = Some(residuals[lane]));
                let all = direction::<_, 1>(Portable, &network, arrays, &wanted, &[false; MOST_LANES]);
                assert_eq!(all.is_accurate[..4], [true, true, false, true]);
                assert!((1..=3).contains(&all.corrections), "{}", all.corrections);
                wanted = [None; MOST_LANES];
                wanted[1] = Some(residuals[1]);
                let one = direction::<_, 1>(Portable, &network, arrays, &wanted, &[false; MOST_LANES]);
                assert_eq!(one.is_accurate[..4], [false, true, false, false]);
                assert!(one.corrections <= all.corrections);
                let entries = 3 * network.interior;
                let found = numbers_of::<Portable>(&arrays.modes[..entries]).to_vec();
                let rough = direction::<_, 1>(Portable, &network, arrays, &wanted, &[true; MOST_LANES]);
                assert_eq!((rough.is_accurate, rough.corrections), (one.is_accurate, 0));
                let roughly = numbers_of::<Portable>(&arrays.modes[..entries]).to_vec();
                chord::<_, 1>(Portable, &network, arrays, &wanted);
                let by_chord = numbers_of::<Portable>(&arrays.modes[..entries]).to_vec();
                Portable.vectorize(arrays.factor::<1>(&network));
                Portable.vectorize(SolveDirection::<Portable, 1> { network: &network, arrays });
                let expected = numbers_of::<Portable>(arrays.direction);
                let of_lane = |numbers: &[f64]| numbers.iter().skip(1).step_by(4).copied().collect::<Vec<_>>();
                assert_eq!(of_lane(&by_chord), of_lane(&roughly), "the same factor, the same residual");
                let (found, roughly, expected) = (of_lane(&found), of_lane(&roughly), of_lane(expected));
                let size = expected.iter().fold(0.0, |size: f64, x| size.max(x.abs()));
                for (found, expected) in found.iter().zip(&expected) {
                    assert!((found - expected).abs() < 1e-5 * size, "{found} {expected}");
                }
                for (found, expected) in roughly.iter().zip(&expected) {
                    assert!((found - expected).abs() < 1e-2 * size, "{found} {expected}");
                }
            });
        }
    }
}
