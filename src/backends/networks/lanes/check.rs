//! A check of the sensitivities and of the condensed stiffness, by their products for one strain.

use super::arrays::Arrays;
use super::blocks::{Node, Triangle, multiply_symmetric};
use super::forces::{EndStiffness, add_to, subtract_from, vector};
use super::network::Network;
use super::simd::{Double, Kernel, Lanes, load, store};
use super::tangent::Condensed;
use crate::backends::networks::MODES;

/// How far the sensitivities to a strain are from their equations.
pub(super) struct Errors<S: Double> {
    /// Norm of the force sensitivities at interior nodes over that at interior nodes and at the ends of connections
    /// and end fibers on the boundary.
    pub imbalance: Lanes<S>,
    /// The difference of the condensed stiffness of the strain from the product of the sensitivities of positions and
    /// forces, over the sum of the condensed stiffnesses of the six unit strains.
    pub of_stiffness: Lanes<S>,
}

/// The strain for which [`CheckModes`] examines the sensitivities: all unit strains take part.
const CHECKED: [f64; MODES] = [1.0, -0.7, 0.4, 0.9, -0.6, 0.5];

/// Examines the sensitivities in `modes` for one strain; overwrites `direction` and `loads`.
pub(super) struct CheckModes<'a, 'b, S: Double> {
    pub network: &'a Network,
    pub arrays: &'a mut Arrays<'b, S>,
    pub condensed: &'a Condensed<S>,
}

impl<S: Double> Kernel<S> for CheckModes<'_, '_, S> {
    type Output = Errors<S>;

    #[inline(always)]
    fn run(self, simd: S) -> Errors<S> {
        let Self { network, arrays, condensed } = self;
        let zero = Lanes::splat(simd, 0.0);
        combine_modes(simd, network, arrays);
        let mut found = Found { stiffness: zero, of_boundary: zero };
        found.add_end_fibers(simd, network, arrays);
        found.add_connections(simd, network, arrays);
        let mut of_interior = zero;
        for node in 0..network.interior {
            let q: Node<S> = load(simd, arrays.loads, node);
            of_interior += dot(&q, &q);
        }
        let (mut expected, mut all_strains) = (zero, zero);
        for l in 0..MODES {
            all_strains += condensed.form[l][l].abs();
            let mut row = zero;
            for k in 0..MODES {
                row += CHECKED[k] * condensed.form[k][l];
            }
            expected += CHECKED[l] * row;
        }
        let all = of_interior + found.of_boundary;
        let (imbalance, difference) = (of_interior.div(all).sqrt(), (found.stiffness - expected).abs());
        Errors {
            imbalance: zero.where_or(all.less_or_equal(zero), imbalance),
            of_stiffness: zero.where_or(difference.less_or_equal(zero), difference.div(all_strains)),
        }
    }
}

/// Stores the sensitivities to the strain that is examined in `direction`.
#[inline(always)]
fn combine_modes<S: Double>(simd: S, network: &Network, arrays: &mut Arrays<'_, S>) {
    for node in 0..network.interior {
        let mut sum = [Lanes::splat(simd, 0.0); 3];
        for mode in 0..MODES {
            let v: Node<S> = load(simd, arrays.modes, MODES * node + mode);
            for p in 0..3 {
                sum[p] += CHECKED[mode] * v[p];
            }
        }
        store(&sum, arrays.direction, node);
    }
}

/// Returns the strain that is examined, as lower triangle.
#[inline(always)]
fn checked_strain<S: Double>(simd: S) -> Triangle<S> {
    let [xx, yy, zz, zy, zx, yx] = CHECKED;
    [
        Lanes::splat(simd, xx),
        Lanes::splat(simd, yx),
        Lanes::splat(simd, yy),
        Lanes::splat(simd, zx),
        Lanes::splat(simd, zy),
        Lanes::splat(simd, zz),
    ]
}

/// Sums over fibers.
struct Found<S: Double> {
    /// The product of the sensitivities of positions and forces.
    stiffness: Lanes<S>,
    /// The squares of the force sensitivities at the ends on the boundary.
    of_boundary: Lanes<S>,
}

impl<S: Double> Found<S> {
    /// Stores the force sensitivities of end fibers in `loads` of interior nodes.
    #[inline(always)]
    fn add_end_fibers(&mut self, simd: S, network: &Network, arrays: &mut Arrays<'_, S>) {
        let Arrays { positions, end_stiffness, direction, loads, .. } = arrays;
        let checked = checked_strain(simd);
        for node in 0..network.interior {
            let (mut sum, u): (_, Node<S>) = ([Lanes::splat(simd, 0.0); 3], load(simd, direction, node));
            for number in network.end_fibers_of(node) {
                let ends = network.end_fibers()[number].ends;
                let d = vector(simd, positions, ends);
                let affine = multiply_symmetric(&checked, &load(simd, positions, ends[1] as usize));
                let apart = [affine[0] - u[0], affine[1] - u[1], affine[2] - u[2]];
                let force = EndStiffness::load(simd, end_stiffness, number).multiply(&d, &apart);
                self.stiffness += dot(&apart, &force);
                self.of_boundary += dot(&force, &force);
                for p in 0..3 {
                    sum[p] -= force[p];
                }
            }
            store(&sum, loads, node);
        }
    }

    /// Adds the force sensitivities of connections to `loads` of interior nodes.
    #[inline(always)]
    fn add_connections(&mut self, simd: S, network: &Network, arrays: &mut Arrays<'_, S>) {
        let Arrays { positions, connections, direction, loads, .. } = arrays;
        let checked = checked_strain(simd);
        for (number, ends) in network.connections.iter().enumerate() {
            let ends = ends.map(|node| node as usize);
            let mut moved = [[Lanes::splat(simd, 0.0); 3]; 2];
            for end in 0..2 {
                moved[end] = if ends[end] < network.interior {
                    load(simd, direction, ends[end])
                } else {
                    multiply_symmetric(&checked, &load(simd, positions, ends[end]))
                };
            }
            let [a, b] = moved;
            let apart = [b[0] - a[0], b[1] - a[1], b[2] - a[2]];
            let force = multiply_symmetric(&load(simd, connections, number), &apart);
            self.stiffness += dot(&apart, &force);
            let square = dot(&force, &force);
            for end in 0..2 {
                if ends[end] >= network.interior {
                    self.of_boundary += square;
                } else if end == 0 {
                    subtract_from(simd, loads, ends[end], &force);
                } else {
                    add_to(simd, loads, ends[end], &force);
                }
            }
        }
    }
}

#[inline(always)]
fn dot<S: Double>(a: &Node<S>, b: &Node<S>) -> Lanes<S> {
    a[0].mul_add(b[0], a[1].mul_add(b[1], a[2] * b[2]))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::backends::networks::lanes::arrays::with_arrays;
    use crate::backends::networks::lanes::forces::{Evaluate, EvaluateEnds};
    use crate::backends::networks::lanes::portable::Portable;
    use crate::backends::networks::lanes::simd::{MOST_LANES, Simd, numbers_of_mut};
    use crate::backends::networks::lanes::tangent::SolveModes;
    use crate::backends::networks::lanes::test_network::{grid, write};

    /// An error in a sensitivity to any strain, or in the condensed stiffness of any two, shows, in its lane alone.
    #[test]
    fn errors_show() {
        const LANE: usize = 2;
        let (data, interior) = grid(1e7);
        let network = Network::new(&data, Portable::TILE);
        assert!(!network.end_fibers().is_empty() && network.connections.len() > network.pairs);
        with_arrays::<Portable, ()>(&network, false, |arrays| {
            write(&network, &interior, None, arrays.positions);
            Portable.vectorize(Evaluate { network: &network, arrays });
            Portable.vectorize(arrays.factor::<1>(&network));
            Portable.vectorize(EvaluateEnds { network: &network, arrays });
            let mut condensed = Portable.vectorize(SolveModes::<Portable, 1> { network: &network, arrays });
            let exact = numbers_of_mut::<Portable>(arrays.modes).to_vec();
            for mode in 0..MODES {
                let entry = 3 * (MODES * (network.interior / 2) + mode) + 1;
                numbers_of_mut::<Portable>(arrays.modes)[Portable::LANES * entry + LANE] *= 1.0 + 1e-4;
                let [imbalance, _] = errors(&network, arrays, &condensed);
                for lane in 0..Portable::LANES {
                    let is_right = if lane == LANE { imbalance[lane] > 1e-8 } else { imbalance[lane] < 1e-14 };
                    assert!(is_right, "{mode}: {imbalance:?}");
                }
                numbers_of_mut::<Portable>(arrays.modes).copy_from_slice(&exact);
            }
            for (k, l) in (0..MODES).flat_map(|k| (0..MODES).map(move |l| (k, l))) {
                let mut error = [0.0; MOST_LANES];
                error[LANE] = 1e-7;
                let before = condensed.form[k][l];
                condensed.form[k][l] += condensed.form[0][0] * Lanes::of_numbers(Portable, &error);
                let [_, of_stiffness] = errors(&network, arrays, &condensed);
                for lane in 0..Portable::LANES {
                    let is_right = if lane == LANE { of_stiffness[lane] > 1e-10 } else { of_stiffness[lane] < 1e-14 };
                    assert!(is_right, "{k} {l}: {of_stiffness:?}");
                }
                condensed.form[k][l] = before;
            }
        });
    }

    /// Returns the imbalance and the error of the stiffness of each lane.
    fn errors(network: &Network, arrays: &mut Arrays<'_, Portable>, condensed: &Condensed<Portable>) -> [Vec<f64>; 2] {
        let errors = Portable.vectorize(CheckModes { network, arrays, condensed });
        [errors.imbalance, errors.of_stiffness].map(|of_lanes| of_lanes.numbers()[..Portable::LANES].to_vec())
    }
}
