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

/// Computes the forces of the nodes and the stiffness, without those of the nodes of end fibers on the boundary; copies the forces of interior nodes to `direction`.
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

/// The force and the stiffness of a fiber.
struct State<S: Double> {
    /// The unit vector from the first end to the second.
    n: [Lanes<S>; 3],
    /// The force, positive in tension.
    force: Lanes<S>,
    /// The stiffness across the fiber, force over length, and what there is more of it along the fiber.
    geometric: Lanes<S>,
    material: Lanes<S>,
    /// The absolute value of the nominal stress over the modulus.
    ratio: Lanes<S>,
}

impl<S: Double> State<S> {
    #[inline(always)]
    fn new(network: &Network, fiber: &Fiber, geometry: &Geometry<S>) -> Self {
        let &Geometry { d, inverse, stretch } = geometry;
        let law: &Law = &network.laws[fiber.law as usize];
        let (stress, slope) = law.stress(stretch);
        let force = stress * fiber.area;
        let geometric = force * inverse;
        Self {
            n: [d[0] * inverse, d[1] * inverse, d[2] * inverse],
            force,
            geometric,
            material: slope * fiber.area_over_length - geometric,
            ratio: stress.abs() * law.inverse_modulus,
        }
    }

    /// The derivative of the energy by the position of the second end.
    #[inline(always)]
    fn pull(&self) -> [Lanes<S>; 3] {
        [self.force * self.n[0], self.force * self.n[1], self.force * self.n[2]]
    }

    /// The stiffness, a symmetric block.
    #[inline(always)]
    fn block(&self) -> [Lanes<S>; 6] {
        let &Self { n, geometric, material, .. } = self;
        let m = [material * n[0], material * n[1], material * n[2]];
        [
            m[0].mul_add(n[0], geometric),
            m[0] * n[1],
            m[1].mul_add(n[1], geometric),
            m[0] * n[2],
            m[1] * n[2],
            m[2].mul_add(n[2], geometric),
        ]
    }
}

impl<S: Double> Kernel<S> for Evaluate<'_, '_, S> {
    type Output = Forces<S>;

    #[inline(always)]
    fn run(self, simd: S) -> Forces<S> {
        let Self { network, arrays } = self;
        let Arrays { positions, forces, connections, stiffness, direction, .. } = arrays;
        let zero = Lanes::splat(simd, 0.0);
        let (mut largest, mut all) = (zero, zero);
        // While the law of a fiber is evaluated, the processor computes the geometry of the next one: each takes long,
        // but waits most of the time for its own intermediate results.
        let fibers = network.end_fibers();
        let mut next = fibers.first().map(|fiber| Geometry::new(simd, positions, fiber));
        for node in 0..network.interior {
            let (mut sum, mut diagonal) = ([zero; 3], [zero; 6]);
            for number in network.end_fibers_of(node) {
                let Some(geometry) = next else { break };
                next = fibers.get(number + 1).map(|fiber| Geometry::new(simd, positions, fiber));
                let state = State::new(network, &fibers[number], &geometry);
                largest = largest.where_or(state.ratio.less_or_equal(largest), state.ratio);
                let (pull, block) = (state.pull(), state.block());
                all += pull[0] * pull[0] + pull[1] * pull[1] + pull[2] * pull[2];
                for k in 0..3 {
                    sum[k] -= pull[k];
                }
                for k in 0..6 {
                    diagonal[k] += block[k];
                }
            }
            store(&sum, forces, node);
            store(&diagonal, stiffness, node);
        }
        numbers_of_mut::<S>(&mut forces[3 * network.interior..3 * network.first_end_node()]).fill(0.0);
        let fibers = network.other_fibers();
        let mut next = fibers.first().map(|fiber| Geometry::new(simd, positions, fiber));
        for (number, fiber) in fibers.iter().enumerate() {
            let Some(geometry) = next else { break };
            next = fibers.get(number + 1).map(|fiber| Geometry::new(simd, positions, fiber));
            let state = State::new(network, fiber, &geometry);
            largest = largest.where_or(state.ratio.less_or_equal(largest), state.ratio);
            let (pull, block) = (state.pull(), state.block());
            let connection = fiber.connection as usize;
            if number > 0 && fibers[number - 1].connection == fiber.connection {
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
        let mut residual = zero;
        for node in 0..network.first_end_node() {
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

/// The stiffness of a fiber, whose block is `geometric I + material d d^T`, with the vector `d` from the first end to the
/// second. The derivative of the energy by the position of the second end is `geometric d`.
pub(super) struct EndStiffness<S: Double> {
    pub geometric: Lanes<S>,
    pub material: Lanes<S>,
}

impl<S: Double> EndStiffness<S> {
    /// Loads the stiffness of an end fiber, which [`EvaluateEnds`] computed.
    #[inline(always)]
    pub fn load(simd: S, end_stiffness: &[S::Stored], number: usize) -> Self {
        let [geometric, material] = load(simd, end_stiffness, number);
        Self { geometric, material }
    }

    /// Returns the product with a vector.
    #[inline(always)]
    pub fn multiply(&self, d: &[Lanes<S>; 3], y: &[Lanes<S>; 3]) -> [Lanes<S>; 3] {
        let along = self.material * d[0].mul_add(y[0], d[1].mul_add(y[1], d[2] * y[2]));
        let &Self { geometric, .. } = self;
        [
            along.mul_add(d[0], geometric * y[0]),
            along.mul_add(d[1], geometric * y[1]),
            along.mul_add(d[2], geometric * y[2]),
        ]
    }
}

/// Computes the stiffness of the end fibers.
pub(super) struct EvaluateEnds<'a, 'b, S: Double> {
    pub network: &'a Network,
    pub arrays: &'a mut Arrays<'b, S>,
}

impl<S: Double> Kernel<S> for EvaluateEnds<'_, '_, S> {
    type Output = ();

    #[inline(always)]
    fn run(self, simd: S) {
        let Self { network, arrays: Arrays { positions, end_stiffness, .. } } = self;
        let fibers = network.end_fibers();
        let mut next = fibers.first().map(|fiber| Geometry::new(simd, positions, fiber));
        for (number, fiber) in fibers.iter().enumerate() {
            let Some(geometry) = next else { break };
            next = fibers.get(number + 1).map(|fiber| Geometry::new(simd, positions, fiber));
            let State { geometric, material, .. } = State::new(network, fiber, &geometry);
            let material = material * geometry.inverse * geometry.inverse;
            store(&[geometric, material], end_stiffness, number);
        }
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
