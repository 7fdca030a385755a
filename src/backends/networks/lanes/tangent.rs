//! Stress, energy, and the sensitivities for the tangent.

use super::arrays::Arrays;
use super::blocks::{Block, Node, Triangle, multiply_symmetric};
use super::forces::{EndStiffness, add_to, stretch_of, subtract_from, vector, vector_and_length};
use super::network::Network;
use super::simd::{Double, Kernel, Lanes, load, numbers_of_mut, store};
use super::triangular::{backward, forward};
use crate::backends::networks::MODES;

/// Right-hand sides that are solved at the same time.
const AT_ONCE: usize = 3;

/// Applies the `k`-th unit strain, in the order 11, 22, 33, 23, 13, 12.
#[inline(always)]
pub(super) fn strain<S: Double>(k: usize, x: &Node<S>) -> Node<S> {
    let zero = Lanes::splat(x[0].0, 0.0);
    match k {
        0 => [x[0], zero, zero],
        1 => [zero, x[1], zero],
        2 => [zero, zero, x[2]],
        3 => [zero, x[2], x[1]],
        4 => [x[2], zero, x[0]],
        _ => [x[1], x[0], zero],
    }
}

/// Applies the `w`-th unit rotation.
#[inline(always)]
fn spin<S: Double>(w: usize, x: &Node<S>) -> Node<S> {
    let zero = Lanes::splat(x[0].0, 0.0);
    match w {
        0 => [zero, -x[2], x[1]],
        1 => [x[2], zero, -x[0]],
        _ => [-x[1], x[0], zero],
    }
}

/// Computes the sensitivities of interior nodes to the six strains into `modes`; requires the factor of the stiffness,
/// the stiffness of the connections, and that of the end fibers.
pub(super) struct SolveModes<'a, 'b, S: Double, const C: usize> {
    pub network: &'a Network,
    pub arrays: &'a mut Arrays<'b, S>,
}

impl<S: Double, const C: usize> Kernel<S> for SolveModes<'_, '_, S, C> {
    type Output = ();

    #[inline(always)]
    fn run(self, simd: S) {
        let Self { network, arrays } = self;
        let Arrays { positions, connections, end_stiffness, diagonal, lower, modes, .. } = arrays;
        for node in 0..network.interior {
            let loads = loads_of_end_fibers(simd, network, positions, end_stiffness, node);
            for mode in 0..MODES {
                store(&loads[mode], modes, MODES * node + mode);
            }
        }
        for (number, &ends) in network.connections.iter().enumerate() {
            let [a, b] = ends.map(|node| node as usize);
            if a >= network.interior {
                continue;
            }
            let d = vector(simd, positions, ends);
            let block: Triangle<S> = load(simd, connections, number);
            for mode in 0..MODES {
                let load_of_end = multiply_symmetric(&block, &strain(mode, &d));
                subtract_from(simd, modes, MODES * a + mode, &load_of_end);
                if b < network.interior {
                    add_to(simd, modes, MODES * b + mode, &load_of_end);
                }
            }
        }
        forward::<S, C, MODES, AT_ONCE>(simd, &network.schedule, (diagonal, lower), modes);
        backward::<S, C, MODES, AT_ONCE>(simd, &network.schedule, (diagonal, lower), modes);
        for node in 0..network.interior {
            let x: Node<S> = load(simd, positions, node);
            for mode in 0..MODES {
                let (affine, v): (_, Node<S>) = (strain(mode, &x), load(simd, modes, MODES * node + mode));
                store(&[affine[0] - v[0], affine[1] - v[1], affine[2] - v[2]], modes, MODES * node + mode);
            }
        }
    }
}

/// Returns the forces at an interior node when its end fibers follow each of the six strains: minus the sums of
/// `geometric E d + material d (d^T E d)` over these fibers with the vectors `d`, for the strain `E`.
#[inline(always)]
fn loads_of_end_fibers<S: Double>(
    simd: S,
    network: &Network,
    positions: &[S::Stored],
    end_stiffness: &[S::Stored],
    node: usize,
) -> [Node<S>; MODES] {
    let zero = Lanes::splat(simd, 0.0);
    let (mut across, mut along) = ([zero; 3], [[zero; 3]; MODES]);
    for number in network.end_fibers_of(node) {
        let d = vector(simd, positions, network.end_fibers()[number].ends);
        let EndStiffness { geometric, material } = EndStiffness::load(simd, end_stiffness, number);
        let twice = [2.0 * d[0], 2.0 * d[1]];
        // Half the change of the squared length by each unit strain.
        let changes = [d[0] * d[0], d[1] * d[1], d[2] * d[2], twice[1] * d[2], twice[0] * d[2], twice[0] * d[1]];
        for p in 0..3 {
            across[p].subtract_product(geometric, d[p]);
            let force = material * d[p];
            for mode in 0..MODES {
                along[mode][p].subtract_product(force, changes[mode]);
            }
        }
    }
    let mut loads = [[zero; 3]; MODES];
    for mode in 0..MODES {
        let strained = strain(mode, &across);
        for p in 0..3 {
            loads[mode][p] = strained[p] + along[mode][p];
        }
    }
    loads
}

/// The products of sensitivities of a group of networks.
pub(super) struct Products<S: Double> {
    /// Those of the positions for six strains and three rotations (rows) with those of the forces for six strains.
    pub form: [[Lanes<S>; MODES]; MODES + 3],
    /// Norm of the force sensitivities at interior nodes over that at interior nodes and at the ends of connections
    /// and end fibers on the boundary.
    pub imbalance: Lanes<S>,
}

/// Computes the products of sensitivities from `modes`.
pub(super) struct ComputeProducts<'a, 'b, S: Double> {
    pub network: &'a Network,
    pub arrays: &'a mut Arrays<'b, S>,
}

impl<S: Double> Kernel<S> for ComputeProducts<'_, '_, S> {
    type Output = Products<S>;

    #[inline(always)]
    fn run(self, simd: S) -> Products<S> {
        let Self { network, arrays } = self;
        let zero = Lanes::splat(simd, 0.0);
        numbers_of_mut::<S>(&mut arrays.loads[..3 * MODES * network.interior]).fill(0.0);
        let mut of_boundary = OfBoundary::new(simd);
        of_boundary.add_connections(simd, network, arrays);
        of_boundary.add_end_fibers(simd, network, arrays);
        let Arrays { positions, modes, loads, .. } = arrays;
        let mut form = [[zero; MODES]; MODES + 3];
        let mut of_interior = zero;
        for node in 0..network.interior {
            let x: Node<S> = load(simd, positions, node);
            for l in 0..MODES {
                let q: Node<S> = load(simd, loads, MODES * node + l);
                of_interior += dot(&q, &q);
                for k in 0..=l {
                    let v: Node<S> = load(simd, modes, MODES * node + k);
                    form[k][l] += dot(&v, &q);
                }
                for w in 0..3 {
                    form[MODES + w][l] += dot(&spin(w, &x), &q);
                }
            }
        }
        for (l, moment) in of_boundary.moments.iter().enumerate() {
            for k in 0..=l {
                form[k][l] += strain_product(k, moment);
            }
            for w in 0..3 {
                form[MODES + w][l] += spin_product(w, moment);
            }
        }
        for l in 0..MODES {
            for k in 0..l {
                form[l][k] = form[k][l];
            }
        }
        let all = of_interior + of_boundary.squares;
        let is_zero = all.less_or_equal(zero);
        Products { form, imbalance: zero.where_or(is_zero, of_interior.div(all).sqrt()) }
    }
}

/// The sums over the ends of connections and end fibers on the boundary.
struct OfBoundary<S: Double> {
    /// Position times force sensitivity of each mode, row by row.
    moments: [Block<S>; MODES],
    /// The squares of the force sensitivities.
    squares: Lanes<S>,
}

impl<S: Double> OfBoundary<S> {
    #[inline(always)]
    fn new(simd: S) -> Self {
        let zero = Lanes::splat(simd, 0.0);
        Self { moments: [[zero; 9]; MODES], squares: zero }
    }

    /// Adds the force of a mode at the position `x`.
    #[inline(always)]
    fn add(&mut self, mode: usize, x: &Node<S>, force: &Node<S>) {
        self.squares += dot(force, force);
        for p in 0..3 {
            for q in 0..3 {
                self.moments[mode][3 * p + q].add_product(x[p], force[q]);
            }
        }
    }

    /// Adds the connections of the network, and adds their force sensitivities to `loads` of interior nodes.
    #[inline(always)]
    fn add_connections(&mut self, simd: S, network: &Network, arrays: &mut Arrays<'_, S>) {
        let Arrays { positions, connections, modes, loads, .. } = arrays;
        for (number, ends) in network.connections.iter().enumerate() {
            let [a, b] = ends.map(|node| node as usize);
            let block: Triangle<S> = load(simd, connections, number);
            if b < network.interior {
                for mode in 0..MODES {
                    let of_a: Node<S> = load(simd, modes, MODES * a + mode);
                    let of_b: Node<S> = load(simd, modes, MODES * b + mode);
                    let apart = [of_a[0] - of_b[0], of_a[1] - of_b[1], of_a[2] - of_b[2]];
                    let force = multiply_symmetric(&block, &apart);
                    add_to(simd, loads, MODES * a + mode, &force);
                    subtract_from(simd, loads, MODES * b + mode, &force);
                }
                continue;
            }
            let mut x: Node<S> = load(simd, positions, b);
            if a >= network.interior {
                let of_a: Node<S> = load(simd, positions, a);
                x = [x[0] - of_a[0], x[1] - of_a[1], x[2] - of_a[2]];
            }
            for mode in 0..MODES {
                let mut apart = strain(mode, &x);
                if a < network.interior {
                    let of_a: Node<S> = load(simd, modes, MODES * a + mode);
                    apart = [apart[0] - of_a[0], apart[1] - of_a[1], apart[2] - of_a[2]];
                }
                let force = multiply_symmetric(&block, &apart);
                if a < network.interior {
                    subtract_from(simd, loads, MODES * a + mode, &force);
                } else {
                    // A connection of two boundary nodes has two ends there.
                    self.squares += dot(&force, &force);
                }
                self.add(mode, &x, &force);
            }
        }
    }

    /// Adds the end fibers, and adds their force sensitivities to `loads` of interior nodes.
    #[inline(always)]
    fn add_end_fibers(&mut self, simd: S, network: &Network, arrays: &mut Arrays<'_, S>) {
        let Arrays { positions, end_stiffness, modes, loads, .. } = arrays;
        for (number, fiber) in network.end_fibers().iter().enumerate() {
            let d = vector(simd, positions, fiber.ends);
            let stiffness = EndStiffness::load(simd, end_stiffness, number);
            let [a, b] = fiber.ends.map(|node| node as usize);
            let x: Node<S> = load(simd, positions, b);
            for mode in 0..MODES {
                let (affine, v): (_, Node<S>) = (strain(mode, &x), load(simd, modes, MODES * a + mode));
                let force = stiffness.multiply(&d, &[affine[0] - v[0], affine[1] - v[1], affine[2] - v[2]]);
                subtract_from(simd, loads, MODES * a + mode, &force);
                self.add(mode, &x, &force);
            }
        }
    }
}

/// Returns the product of the `k`-th unit strain of positions with forces, from the sum of positions times forces.
#[inline(always)]
fn strain_product<S: Double>(k: usize, moment: &Block<S>) -> Lanes<S> {
    match k {
        0 => moment[0],
        1 => moment[4],
        2 => moment[8],
        3 => moment[7] + moment[5],
        4 => moment[6] + moment[2],
        _ => moment[3] + moment[1],
    }
}

/// Returns the product of the `w`-th unit rotation of positions with forces, from the sum of positions times forces.
#[inline(always)]
fn spin_product<S: Double>(w: usize, moment: &Block<S>) -> Lanes<S> {
    match w {
        0 => moment[5] - moment[7],
        1 => moment[6] - moment[2],
        _ => moment[1] - moment[3],
    }
}

#[inline(always)]
fn dot<S: Double>(a: &Node<S>, b: &Node<S>) -> Lanes<S> {
    a[0].mul_add(b[0], a[1].mul_add(b[1], a[2] * b[2]))
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
            let force: Node<S> = match node.checked_sub(network.first_end_node()) {
                None => load(simd, arrays.forces, node),
                Some(number) => {
                    let d = vector(simd, arrays.positions, network.end_fibers()[number].ends);
                    let EndStiffness { geometric, .. } = EndStiffness::load(simd, arrays.end_stiffness, number);
                    [geometric * d[0], geometric * d[1], geometric * d[2]]
                }
            };
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
