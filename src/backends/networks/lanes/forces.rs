//! Forces and stiffness.

use super::arrays::Arrays;
use super::laws::Law;
use super::network::{Fiber, Network};
use super::simd::{Double, Kernel, Lanes, load, numbers_of_mut, store};

/// What the evaluation of forces says about each lane.
pub(super) struct Forces<S: Double> {
    /// Norm of the forces at interior nodes.
    pub residual: Lanes<S>,
    /// Norm of the forces at all nodes.
    pub scale: Lanes<S>,
    /// The largest nominal stress over modulus of all fibers, by absolute value.
    pub largest: Lanes<S>,
}

/// Computes the forces of all nodes and the stiffness; copies the forces of interior nodes to `direction`.
pub(super) struct Evaluate<'a, 'b, S: Double> {
    pub network: &'a Network,
    pub arrays: &'a mut Arrays<'b, S>,
}

/// The vector from one node to another.
#[inline(always)]
pub(super) fn vector<S: Double>(simd: S, positions: &[S::Stored], ends: [u32; 2]) -> [Lanes<S>; 3] {
    let from: [Lanes<S>; 3] = load(simd, positions, ends[0] as usize);
    let to: [Lanes<S>; 3] = load(simd, positions, ends[1] as usize);
    [to[0] - from[0], to[1] - from[1], to[2] - from[2]]
}

/// The vector from the first end of a fiber to the second, and its length.
#[inline(always)]
pub(super) fn vector_and_length<S: Double>(
    simd: S,
    positions: &[S::Stored],
    ends: [u32; 2],
) -> ([Lanes<S>; 3], Lanes<S>) {
    let d = vector(simd, positions, ends);
    // Not fused, like the reference lengths, so that the stretch at rest is exactly 1.
    (d, (d[0] * d[0] + d[1] * d[1] + d[2] * d[2]).sqrt())
}

/// Returns the stretch of a fiber: the quotient to rounding.
#[inline(always)]
pub(super) fn stretch_of<S: Double>(length: Lanes<S>, fiber: &Fiber) -> Lanes<S> {
    let simd = length.0;
    let (rest, inverse) = (Lanes::splat(simd, fiber.length), Lanes::splat(simd, fiber.inverse_length));
    let quotient = length * inverse;
    let mut remainder = length;
    remainder.subtract_product(quotient, rest);
    remainder.mul_add(inverse, quotient)
}

/// The geometry of a fiber.
struct Geometry<S: Double> {
    /// The direction from the first end to the second, as long as the fiber.
    d: [Lanes<S>; 3],
    /// The inverse of the length.
    inverse: Lanes<S>,
    stretch: Lanes<S>,
}

impl<S: Double> Geometry<S> {
    #[inline(always)]
    fn new(simd: S, positions: &[S::Stored], fiber: &Fiber) -> Self {
        let (d, length) = vector_and_length(simd, positions, fiber.ends);
        Self { d, inverse: Lanes::splat(simd, 1.0).div(length), stretch: stretch_of(length, fiber) }
    }
}

impl<S: Double> Kernel<S> for Evaluate<'_, '_, S> {
    type Output = Forces<S>;

    #[inline(always)]
    fn run(self, simd: S) -> Forces<S> {
        let Self { network, arrays } = self;
        let Arrays { positions, forces, connections, stiffness, direction, .. } = arrays;
        for zeroed in [&mut **forces, &mut **stiffness] {
            numbers_of_mut::<S>(zeroed).fill(0.0);
        }
        let zero = Lanes::splat(simd, 0.0);
        let mut largest = zero;
        // While the law of a fiber is evaluated, the processor computes the geometry of the next one: each takes long,
        // but waits most of the time for its own intermediate results.
        let mut next = network.fibers.first().map(|fiber| Geometry::new(simd, positions, fiber));
        for (number, fiber) in network.fibers.iter().enumerate() {
            let Some(Geometry { d, inverse, stretch }) = next else { break };
            next = network.fibers.get(number + 1).map(|fiber| Geometry::new(simd, positions, fiber));
            let law: &Law = &network.laws[fiber.law as usize];
            let (stress, slope) = law.stress(stretch);
            let force = stress * fiber.area;
            let geometric = force * inverse;
            let material = slope * fiber.area_over_length - geometric;
            let ratio = stress.abs() * law.inverse_modulus;
            largest = largest.where_or(ratio.less_or_equal(largest), ratio);
            let n = [d[0] * inverse, d[1] * inverse, d[2] * inverse];
            let pull = [force * n[0], force * n[1], force * n[2]];
            let m = [material * n[0], material * n[1], material * n[2]];
            let block = [
                m[0].mul_add(n[0], geometric),
                m[0] * n[1],
                m[1].mul_add(n[1], geometric),
                m[0] * n[2],
                m[1] * n[2],
                m[2].mul_add(n[2], geometric),
            ];
            let connection = fiber.connection as usize;
            if number > 0 && network.fibers[number - 1].connection == fiber.connection {
                add_to(simd, connections, connection, &block);
            } else {
                store(&block, connections, connection);
            }
            let [a, b] = fiber.ends.map(|node| node as usize);
            subtract_from(simd, forces, a, &pull);
            add_to(simd, forces, b, &pull);
            for node in [a, b] {
                if node < network.interior {
                    add_to(simd, stiffness, node, &block);
                }
            }
        }
        let (mut residual, mut all) = (zero, zero);
        for node in 0..network.nodes {
            let force: [Lanes<S>; 3] = load(simd, forces, node);
            let square = force[0] * force[0] + force[1] * force[1] + force[2] * force[2];
            all += square;
            if node < network.interior {
                residual += square;
                store(&force, direction, node);
            }
        }
        Forces { residual: residual.sqrt(), scale: all.sqrt(), largest }
    }
}

#[inline(always)]
pub(super) fn add_to<S: Double, const N: usize>(simd: S, array: &mut [S::Stored], at: usize, block: &[Lanes<S>; N]) {
    let mut sum: [Lanes<S>; N] = load(simd, array, at);
    for k in 0..N {
        sum[k] += block[k];
    }
    store(&sum, array, at);
}

#[inline(always)]
pub(super) fn subtract_from<S: Double, const N: usize>(
    simd: S,
    array: &mut [S::Stored],
    at: usize,
    block: &[Lanes<S>; N],
) {
    let mut sum: [Lanes<S>; N] = load(simd, array, at);
    for k in 0..N {
        sum[k] -= block[k];
    }
    store(&sum, array, at);
}
