//! The condensed stiffness for the tangent.
//!
//! With the stiffness `K_f` and the vector `d` of each fiber `f`, the strains `E_k`, the forces `B_k` at the interior
//! nodes when all nodes follow a strain, and the factor `L` of the interior stiffness `K`, the condensed stiffness is
//!
//! ```text
//! C_kl = A_kl - (L^-1 B_k) . (L^-1 B_l),    A_kl = sum_f (E_k d) . K_f (E_l d)
//! ```
//!
//! Rounding in the factor, which is exact for a stiffness `K + e`, changes it by `V_k . e V_l` with the solutions
//! `V = K^-1 B`. The products `v_k . K v_l` of all sensitivities, which `fiber::homogenize` takes, have an error of second
//! order in `e`, but pass over all fibers for all strains. [`CheckModes`](super::check::CheckModes) compares both for one
//! strain.

use super::arrays::Arrays;
use super::blocks::{Block, Node, Triangle};
use super::forces::{EndStiffness, add_to, subtract_from, vector};
use super::network::Network;
use super::response::boundary_force;
use super::simd::{Double, Kernel, Lanes, load, store};
use super::triangular::{backward, forward};
use crate::backends::networks::MODES;

/// Right-hand sides that are solved at the same time.
const AT_ONCE: usize = 3;

/// Where the lower triangle of a symmetric block has the entries of each of its columns.
const COLUMNS: [[usize; 3]; 3] = [[0, 1, 3], [1, 2, 4], [3, 4, 5]];

/// The two axes of each shear strain.
const SHEARS: [(usize, usize); 3] = [(1, 2), (0, 2), (0, 1)];

/// The entries `(i, j)` where each unit rotation is 1; it is -1 at `(j, i)`.
const ROTATIONS: [(usize, usize); 3] = [(2, 1), (0, 2), (1, 0)];

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

/// Multiplies a symmetric block, given by its lower triangle, by a vector after the `k`-th unit strain, without the
/// zeros of this.
#[inline(always)]
fn multiply_strained<S: Double>(block: &Triangle<S>, k: usize, d: &Node<S>) -> Node<S> {
    if k < 3 {
        let [x, y, z] = COLUMNS[k];
        return [block[x] * d[k], block[y] * d[k], block[z] * d[k]];
    }
    let (p, q) = SHEARS[k - 3];
    let ([xp, yp, zp], [xq, yq, zq]) = (COLUMNS[p], COLUMNS[q]);
    [
        block[xp].mul_add(d[q], block[xq] * d[p]),
        block[yp].mul_add(d[q], block[yq] * d[p]),
        block[zp].mul_add(d[q], block[zq] * d[p]),
    ]
}

/// Adds the product of a vector after the `k`-th unit strain with another.
#[inline(always)]
fn add_strained_product<S: Double>(sum: &mut Lanes<S>, k: usize, d: &Node<S>, q: &Node<S>) {
    match k {
        0..3 => sum.add_product(d[k], q[k]),
        3 => sum.add_product(d[2], q[1]),
        4 => sum.add_product(d[2], q[0]),
        _ => sum.add_product(d[1], q[0]),
    }
    match k {
        3 => sum.add_product(d[1], q[2]),
        4 => sum.add_product(d[0], q[2]),
        5 => sum.add_product(d[0], q[1]),
        _ => {}
    }
}

/// Adds the product of a vector after the `w`-th unit rotation with another.
#[inline(always)]
fn add_rotated_product<S: Double>(sum: &mut Lanes<S>, w: usize, t: &Node<S>, u: &Node<S>) {
    let (i, j) = ROTATIONS[w];
    sum.add_product(t[j], u[i]);
    sum.subtract_product(t[i], u[j]);
}

/// The condensed stiffness of a group of networks.
pub(super) struct Condensed<S: Double> {
    /// The products of the sensitivities of all positions to six strains and three rotations (rows) with those of the
    /// forces to six strains.
    pub form: [[Lanes<S>; MODES]; MODES + 3],
}

/// Computes the sensitivities of interior nodes to the six strains into `modes`, and the condensed stiffness; requires the
/// forces, the factor of the stiffness, the stiffness of the connections, and that of the end fibers.
pub(super) struct SolveModes<'a, 'b, S: Double, const C: usize> {
    pub network: &'a Network,
    pub arrays: &'a mut Arrays<'b, S>,
}

impl<S: Double, const C: usize> Kernel<S> for SolveModes<'_, '_, S, C> {
    type Output = Condensed<S>;

    #[inline(always)]
    fn run(self, simd: S) -> Condensed<S> {
        let Self { network, arrays } = self;
        let mut affine = AffineProducts::new(simd);
        add_end_fibers(simd, network, arrays, &mut affine);
        add_connections(simd, network, arrays, &mut affine);
        let mut products = affine.all();
        let Arrays { positions, diagonal, lower, modes, .. } = arrays;
        forward::<S, C, MODES, AT_ONCE>(simd, &network.schedule, (diagonal, lower), modes);
        for node in 0..network.interior {
            let mut y = [[Lanes::splat(simd, 0.0); 3]; MODES];
            for l in 0..MODES {
                y[l] = load(simd, modes, MODES * node + l);
                for k in 0..=l {
                    for p in 0..3 {
                        products[k][l].subtract_product(y[k][p], y[l][p]);
                    }
                }
            }
        }
        backward::<S, C, MODES, AT_ONCE>(simd, &network.schedule, (diagonal, lower), modes);
        for node in 0..network.interior {
            let x: Node<S> = load(simd, positions, node);
            for mode in 0..MODES {
                let (affine, v): (_, Node<S>) = (strain(mode, &x), load(simd, modes, MODES * node + mode));
                store(&[affine[0] - v[0], affine[1] - v[1], affine[2] - v[2]], modes, MODES * node + mode);
            }
        }
        let rotations = rotation_products(simd, network, arrays);
        let mut form = [[Lanes::splat(simd, 0.0); MODES]; MODES + 3];
        for l in 0..MODES {
            for k in 0..MODES {
                form[k][l] = products[k.min(l)][k.max(l)];
            }
            for w in 0..3 {
                form[MODES + w][l] = rotations[w][l];
            }
        }
        Condensed { form }
    }
}

/// The products of the strains of fibers, if all nodes follow the strain.
struct AffineProducts<S: Double> {
    /// `(E_k d) . K (E_l d)` for `k <= l`, without what `across` holds.
    products: [[Lanes<S>; MODES]; MODES],
    /// The sum of `geometric d d^T` over the end fibers, as lower triangle.
    across: Triangle<S>,
}

impl<S: Double> AffineProducts<S> {
    #[inline(always)]
    fn new(simd: S) -> Self {
        let zero = Lanes::splat(simd, 0.0);
        Self { products: [[zero; MODES]; MODES], across: [zero; 6] }
    }

    /// Returns the products for `k <= l`.
    #[inline(always)]
    fn all(self) -> [[Lanes<S>; MODES]; MODES] {
        let Self { mut products, across } = self;
        // (E_k d) . (E_l d) is the product of E_k with d d^T E_l.
        for l in 0..MODES {
            let columns = [0, 1, 2].map(|q| COLUMNS[q].map(|at| across[at]));
            let strained = columns.map(|column| strain(l, &column));
            for k in 0..=l {
                let sum = &mut products[k][l];
                match k {
                    0..3 => *sum += strained[k][k],
                    _ => {
                        let (p, q) = SHEARS[k - 3];
                        *sum += strained[p][q] + strained[q][p];
                    }
                }
            }
        }
        products
    }
}

/// Stores the forces at the interior nodes when their end fibers follow each of the six strains: minus the sums of
/// `geometric E d + material d (d^T E d)` over these fibers with the vectors `d`, for the strain `E`. Adds the products of
/// these fibers to `affine`.
#[inline(always)]
fn add_end_fibers<S: Double>(simd: S, network: &Network, arrays: &mut Arrays<'_, S>, affine: &mut AffineProducts<S>) {
    let Arrays { positions, end_stiffness, modes, .. } = arrays;
    let zero = Lanes::splat(simd, 0.0);
    for node in 0..network.interior {
        let (mut across, mut along) = ([zero; 3], [[zero; 3]; MODES]);
        for number in network.end_fibers_of(node) {
            let d = vector(simd, positions, network.end_fibers()[number].ends);
            let EndStiffness { geometric, material } = EndStiffness::load(simd, end_stiffness, number);
            let twice = [2.0 * d[0], 2.0 * d[1]];
            // Half the change of the squared length by each unit strain.
            let changes = [d[0] * d[0], d[1] * d[1], d[2] * d[2], twice[1] * d[2], twice[0] * d[2], twice[0] * d[1]];
            let mut pull = [zero; 3];
            for p in 0..3 {
                pull[p] = geometric * d[p];
                across[p] -= pull[p];
                let force = material * d[p];
                for mode in 0..MODES {
                    along[mode][p].subtract_product(force, changes[mode]);
                }
            }
            for l in 0..MODES {
                let weighted = material * changes[l];
                for k in 0..=l {
                    affine.products[k][l].add_product(changes[k], weighted);
                }
            }
            for p in 0..3 {
                for q in 0..=p {
                    affine.across[COLUMNS[q][p]].add_product(pull[p], d[q]);
                }
            }
        }
        for mode in 0..MODES {
            let strained = strain(mode, &across);
            let [x, y, z] = along[mode];
            store(&[strained[0] + x, strained[1] + y, strained[2] + z], modes, MODES * node + mode);
        }
    }
}

/// Adds the forces at the interior nodes when their connections follow each of the six strains, and the products of the
/// connections to `affine`.
#[inline(always)]
fn add_connections<S: Double>(simd: S, network: &Network, arrays: &mut Arrays<'_, S>, affine: &mut AffineProducts<S>) {
    let Arrays { positions, connections, modes, .. } = arrays;
    for (number, &ends) in network.connections.iter().enumerate() {
        let connection = Connection { d: vector(simd, positions, ends), stiffness: load(simd, connections, number) };
        let ends = ends.map(|node| Some(node as usize).filter(|&node| node < network.interior));
        // Compilers do not unroll a loop over the strains, whose operations differ.
        connection.add::<0>(simd, ends, modes, affine);
        connection.add::<1>(simd, ends, modes, affine);
        connection.add::<2>(simd, ends, modes, affine);
        connection.add::<3>(simd, ends, modes, affine);
        connection.add::<4>(simd, ends, modes, affine);
        connection.add::<5>(simd, ends, modes, affine);
    }
}

/// A connection of two nodes.
struct Connection<S: Double> {
    /// The vector from the first node to the second.
    d: Node<S>,
    stiffness: Triangle<S>,
}

impl<S: Double> Connection<S> {
    /// Adds the forces of a strain at the interior nodes of the connection, and its products with the strains up to this
    /// one.
    #[inline(always)]
    fn add<const MODE: usize>(
        &self,
        simd: S,
        [a, b]: [Option<usize>; 2],
        modes: &mut [S::Stored],
        affine: &mut AffineProducts<S>,
    ) {
        let force = multiply_strained(&self.stiffness, MODE, &self.d);
        for k in 0..=MODE {
            add_strained_product(&mut affine.products[k][MODE], k, &self.d, &force);
        }
        if let Some(a) = a {
            subtract_from(simd, modes, MODES * a + MODE, &force);
        }
        if let Some(b) = b {
            add_to(simd, modes, MODES * b + MODE, &force);
        }
    }
}

/// Returns the products of three rotations with the sensitivities of the forces. The stiffness is symmetric, and forces
/// turn with the network, so these are the products of turned forces with the sensitivities of the positions.
#[inline(always)]
fn rotation_products<S: Double>(simd: S, network: &Network, arrays: &Arrays<'_, S>) -> [[Lanes<S>; MODES]; 3] {
    let zero = Lanes::splat(simd, 0.0);
    let mut products = [[zero; MODES]; 3];
    for node in 0..network.interior {
        let force: Node<S> = load(simd, arrays.forces, node);
        for l in 0..MODES {
            let v: Node<S> = load(simd, arrays.modes, MODES * node + l);
            for w in 0..3 {
                add_rotated_product(&mut products[w][l], w, &force, &v);
            }
        }
    }
    let mut moment: Block<S> = [zero; 9];
    for node in network.interior..network.nodes {
        let (force, x): (_, Node<S>) =
            (boundary_force(simd, network, arrays, node), load(simd, arrays.positions, node));
        for p in 0..3 {
            for q in 0..3 {
                moment[3 * p + q].add_product(force[p], x[q]);
            }
        }
    }
    let rows =
        [[moment[0], moment[1], moment[2]], [moment[3], moment[4], moment[5]], [moment[6], moment[7], moment[8]]];
    for l in 0..MODES {
        let strained = [strain(l, &rows[0]), strain(l, &rows[1]), strain(l, &rows[2])];
        for w in 0..3 {
            let (i, j) = ROTATIONS[w];
            products[w][l] += strained[j][i] - strained[i][j];
        }
    }
    products
}
