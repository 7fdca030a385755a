//! Stress and energy.

use super::arrays::Arrays;
use super::blocks::Node;
use super::forces::{EndStiffness, stretch_of, vector, vector_and_length};
use super::network::Network;
use super::simd::{Double, Kernel, Lanes, load};

/// Returns the force at a boundary node.
#[inline(always)]
pub(super) fn boundary_force<S: Double>(simd: S, network: &Network, arrays: &Arrays<'_, S>, node: usize) -> Node<S> {
    match node.checked_sub(network.first_end_node()) {
        None => load(simd, arrays.forces, node),
        Some(number) => {
            let d = vector(simd, arrays.positions, network.end_fibers()[number].ends);
            let EndStiffness { geometric, .. } = EndStiffness::load(simd, arrays.end_stiffness, number);
            [geometric * d[0], geometric * d[1], geometric * d[2]]
        }
    }
}

/// Computes the stress without its scale: the sum over boundary nodes of force times reference position, row by row.
pub(super) struct Stress<'a, 'b, S: Double> {
    pub network: &'a Network,
    pub arrays: &'a Arrays<'b, S>,
}

impl<S: Double> Kernel<S> for Stress<'_, '_, S> {
    type Output = [Lanes<S>; 9];

    #[inline(always)]
    fn run(self, simd: S) -> [Lanes<S>; 9] {
        let Self { network, arrays } = self;
        let mut stress = [Lanes::splat(simd, 0.0); 9];
        let nodes = network.interior..network.nodes;
        for (rest, node) in network.boundary.iter().zip(nodes) {
            let force = boundary_force(simd, network, arrays, node);
            for p in 0..3 {
                for q in 0..3 {
                    stress[3 * p + q] += force[p] * rest[q];
                }
            }
        }
        stress
    }
}

/// Computes the energy of all fibers of the lanes in which `counts` is 1; the others have that of a network at rest.
pub(super) struct Energy<'a, 'b, S: Double> {
    pub network: &'a Network,
    pub arrays: &'a Arrays<'b, S>,
    pub counts: Lanes<S>,
}

impl<S: Double> Kernel<S> for Energy<'_, '_, S> {
    type Output = Lanes<S>;

    #[inline(always)]
    fn run(self, simd: S) -> Lanes<S> {
        let Self { network, arrays, counts } = self;
        let one = Lanes::splat(simd, 1.0);
        let counts = one.less_or_equal(counts);
        let mut sum = Lanes::splat(simd, 0.0);
        for fiber in &network.fibers {
            let (_, length) = vector_and_length(simd, arrays.positions, fiber.ends);
            // The energy of a network without equilibrium could take very long to compute.
            let stretch = stretch_of(length, fiber).where_or(counts, one);
            sum += network.laws[fiber.law as usize].energy(stretch) * fiber.volume;
        }
        sum
    }
}
