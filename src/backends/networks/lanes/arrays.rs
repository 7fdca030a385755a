//! The memory of a group of networks, one in each lane.

use std::cell::RefCell;
use std::marker::PhantomData;

use super::factor::{Factor, NegatedSymmetric};
use super::network::Network;
use super::simd::{Double, MOST_LANES, Simd};
use crate::backends::networks::MODES;

/// The numbers of a group. Interior nodes are numbered by their place in the elimination order; boundary nodes follow
/// them.
pub(super) struct Arrays<'a, S: Double> {
    /// Three coordinates of each node, at which forces are evaluated.
    pub positions: &'a mut [S::Stored],
    /// Three of each node, without those of end fibers on the boundary: the internal force, the derivative of the energy.
    pub forces: &'a mut [S::Stored],
    /// Six of each connection, without those of end fibers: the stiffness of its fibers. In the matrix, that of two
    /// interior nodes is the negative of their block.
    pub connections: &'a mut [S::Stored],
    /// Two of each end fiber, [`EndStiffness`](super::forces::EndStiffness), at the end of a solution.
    pub end_stiffness: &'a mut [S::Stored],
    /// Six of each interior node: the diagonal block of the stiffness.
    pub stiffness: &'a mut [S::Stored],
    /// Six of each interior node: the inverse of the diagonal block of the factor.
    pub diagonal: &'a mut [S::Stored],
    /// Nine of each block of the factor below the diagonal, and of a last block of zeros.
    pub lower: &'a mut [S::Stored],
    /// Three of each interior node: the residual, then the direction; at the end the sensitivities to the strain that is
    /// checked, and then the positions, lane after lane.
    pub direction: &'a mut [S::Stored],
    /// Eighteen of each interior node: the sensitivities to the six strains.
    pub modes: &'a mut [S::Stored],
    /// At least nine of each interior node, for one after the other of these: the factor of single precision, the
    /// sensitivities of the forces to the strain that is checked, and the sensitivities of the positions, in single
    /// precision, lane after lane.
    pub loads: &'a mut [S::Stored],
}

impl<S: Double> Arrays<'_, S> {
    /// Factors the stiffness of the last evaluation, and solves `L y = r` for the residual.
    pub fn factor<'a, const C: usize>(&'a mut self, network: &'a Network) -> Factor<'a, S, NegatedSymmetric, C> {
        let Self { stiffness, connections, diagonal, lower, direction, .. } = self;
        let schedule = &network.schedule;
        Factor {
            schedule,
            matrix_diagonal: stiffness,
            off_diagonal: connections,
            diagonal,
            lower,
            right: direction,
            stored: PhantomData,
        }
    }
}

/// A number of each of the most lanes of any machine.
#[derive(Clone, Copy, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(C, align(64))]
struct Entry([f64; MOST_LANES]);

thread_local! {
    /// The memory of all groups that this thread solves, one after the other: as large as the largest of them needs.
    static MEMORY: RefCell<Vec<Entry>> = const { RefCell::new(Vec::new()) };
}

/// The numbers of the size of `f64` that hold the sensitivities of a node in single precision.
const SENSITIVITIES: usize = 3 * MODES * size_of::<f32>() / size_of::<f64>();

/// The numbers of entries of the arrays of a network. A number of single precision takes `single_bytes` of a lane; 0 if
/// there are none.
fn lengths(network: &Network, single_bytes: usize) -> [usize; 10] {
    let Network { interior, nodes, .. } = *network;
    let blocks = network.schedule.blocks();
    let single = (single_bytes * single_lengths(network).iter().sum::<usize>()).div_ceil(size_of::<f64>());
    [
        3 * nodes,
        3 * network.first_end_node(),
        6 * network.connections.len(),
        2 * network.end_fibers().len(),
        6 * interior,
        6 * interior,
        9 * (blocks + 1),
        3 * interior,
        3 * MODES * interior,
        single.max(SENSITIVITIES * interior),
    ]
}

/// The numbers of entries in single precision: stiffness, pairs, diagonal, blocks and right-hand side.
pub(super) fn single_lengths(network: &Network) -> [usize; 5] {
    let Network { interior, .. } = *network;
    [6 * interior, 6 * network.pairs, 6 * interior, 9 * (network.schedule.blocks() + 1), 3 * interior]
}

/// Bytes of the arrays of a network in each lane.
pub(super) fn bytes_per_lane(network: &Network, has_single: bool) -> usize {
    let single_bytes = if has_single { size_of::<f32>() } else { 0 };
    size_of::<f64>() * lengths(network, single_bytes).iter().sum::<usize>()
}

/// Calls `action` with arrays for a network, which hold numbers of earlier groups.
pub(super) fn with_arrays<S: Double, R>(
    network: &Network,
    has_single: bool,
    action: impl FnOnce(&mut Arrays<'_, S>) -> R,
) -> R {
    MEMORY.with(|memory| {
        let mut memory = memory.borrow_mut();
        let of_single = size_of::<<S::Single as Simd>::Stored>() * size_of::<f64>() / size_of::<S::Stored>();
        let lengths = lengths(network, if has_single { of_single } else { 0 });
        let entries = lengths.iter().sum::<usize>();
        let needed = (entries * S::LANES).div_ceil(MOST_LANES);
        if memory.len() < needed {
            memory.resize(needed, bytemuck::Zeroable::zeroed());
        }
        let mut rest: &mut [S::Stored] = bytemuck::cast_slice_mut(&mut memory);
        let mut take = |length: usize| {
            let (taken, others) = std::mem::take(&mut rest).split_at_mut(length);
            rest = others;
            taken
        };
        let [positions, forces, connections, end_stiffness, stiffness, diagonal, lower, direction, modes, loads] =
            lengths.map(&mut take);
        action(&mut Arrays {
            positions,
            forces,
            connections,
            end_stiffness,
            stiffness,
            diagonal,
            lower,
            direction,
            modes,
            loads,
        })
    })
}
