//! Rigidity: the zero modes of a network at rest, and the nodes that they move.
//!
//! Every fiber is modeled as an unstressed spring between its ends, with the boundary nodes fixed. A motion `u` that
//! changes no fiber length to first order, `n . (u_b - u_a) = 0`, is a *zero mode*: it lies in the null space of the
//! stiffness `K = sum n (x) n` (per fiber, in the blocks of its ends). The null space does not depend on the fiber
//! stiffness, so all springs have the constant 1: otherwise the large stiffness of short fibers would mask small
//! eigenvalues. `K` is positive semidefinite, and by Sylvester's law of inertia the number of zero modes is the number
//! of negative pivots of `K - s I`, with `s` 1e-9 times the largest diagonal entry: a chain that is straight within a
//! few 1e-5 counts as straight.
//!
//! The numbers of zero modes and of states of self stress (tensions in equilibrium without load) are related to the
//! number of fibers with a free end and of free unknowns by `zero modes - self stresses = unknowns - fibers`.
//!
//! Reference: C. R. Calladine, *Buckminster Fuller's "tensegrity" structures and Clerk Maxwell's rules for the
//! construction of stiff frames*, International Journal of Solids and Structures 14 (1978), 161-172.

mod null_space;

use std::sync::Arc;

use nalgebra::{Matrix3, SymmetricEigen, Vector3};
use thiserror::Error;

use self::null_space::mobilities;
use crate::fiber::network::Network;
use crate::fiber::stiffness::pattern;
use crate::las::{
    Backend, FactorReport, Index, MatrixOps, RealBackend, SolveError, Solver, SolverParams, SparsityError, Symmetry,
};

/// The shift `s`, relative to the largest diagonal entry of the stiffness.
const SHIFT: f64 = 1e-9;
/// Number of shifts that are tried if a pivot vanishes.
const ATTEMPTS: i32 = 5;
/// Mobility above which a node takes part in zero modes.
const MOBILE: f64 = 1e-6;
/// Maximum number of most mobile nodes in the report.
const MAX_MOBILE_NODES: usize = 10;

/// The zero modes of a network at rest with its boundary nodes fixed.
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "app", derive(serde::Serialize))]
pub struct Rigidity {
    /// Number of free unknowns, three per interior node.
    pub unknowns: usize,
    /// Number of independent motions that no fiber resists.
    pub zero_modes: usize,
    /// Number of independent states of self stress.
    pub self_stresses: usize,
    /// Number of zero modes that move a single node, summed over the interior nodes: three minus the rank of the fiber
    /// directions at the node.
    pub single_node_modes: usize,
    /// Number of interior nodes with fewer than three fibers; each of them has single-node modes.
    pub few_fibers: usize,
    /// Number of interior nodes with three or more fibers, all in one plane; each of them has single-node modes.
    pub coplanar_fibers: usize,
    /// Number of nodes that take part in zero modes: those with a mobility above 1e-6.
    pub mobile_nodes: usize,
    /// True if the mobilities were estimated by random probing (relative standard deviation 10 to 18 %), because there
    /// are too many zero modes for a basis.
    pub estimated: bool,
    /// The nodes with the largest mobilities, at most ten.
    pub most_mobile: Vec<MobileNode>,
}

/// The mobility of a node in the zero modes.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "app", derive(serde::Serialize))]
pub struct MobileNode {
    /// The node.
    pub node: u32,
    /// Position of the node in the unit cube.
    pub position: [f64; 3],
    /// The trace of the node's block of the projector onto the zero modes: 3 for a node that moves freely, 0 for one
    /// that does not move. The mobilities of all nodes sum to the number of zero modes.
    pub mobility: f64,
}

/// Error in the count of zero modes.
#[derive(Clone, Debug, Error, PartialEq)]
pub enum RigidityError<F: std::error::Error> {
    /// The network is too large for the index type.
    #[error("the stiffness has no valid pattern: {0}")]
    Pattern(#[from] SparsityError),
    /// The backend cannot factor the stiffness.
    #[error("the stiffness cannot be factored: {0}")]
    Solve(#[from] SolveError<F>),
    /// No shift gave a factorization with nonzero pivots whose negative ones the backend counts.
    #[error("every tried shift of the stiffness has a zero pivot")]
    Undecided,
}

/// Counts the zero modes of a network with one factorization.
///
/// # Errors
/// Returns [`RigidityError`] if the stiffness has no valid pattern or cannot be factored.
pub fn zero_modes<B: RealBackend>(context: &B::Context, network: &Network) -> Result<usize, RigidityError<B::Error>> {
    if network.interior().is_empty() {
        return Ok(0);
    }
    Stiffness::<B>::new(context, network)?.zero_modes()
}

/// Counts the zero modes of a network and computes the mobilities of its nodes.
///
/// # Errors
/// As for [`zero_modes`].
pub fn rigidity<B: RealBackend>(context: &B::Context, network: &Network) -> Result<Rigidity, RigidityError<B::Error>> {
    let unknowns = 3 * network.interior().len();
    let (mut zero_modes, mut mobility, mut estimated) = (0, Vec::new(), false);
    if unknowns > 0 {
        let mut stiffness = Stiffness::<B>::new(context, network)?;
        zero_modes = stiffness.zero_modes()?;
        if zero_modes > 0 {
            let shift = SHIFT * stiffness.scale;
            stiffness.factor(shift)?;
            (mobility, estimated) = mobilities::<B>(context, &mut stiffness.solver, unknowns, zero_modes, shift)?;
        }
    }
    let [single_node_modes, few_fibers, coplanar_fibers] = single_node_modes(network);
    let free_end = |ends: &&[u32; 2]| ends.iter().any(|&node| network.interior_number()[node as usize] >= 0);
    let fibers = network.fibers().iter().filter(free_end).count();
    let mut nodes: Vec<MobileNode> = (network.interior().iter().zip(mobility))
        .map(|(&node, mobility)| MobileNode { node, position: network.nodes()[node as usize], mobility })
        .filter(|node| node.mobility > MOBILE)
        .collect();
    nodes.sort_by(|a, b| b.mobility.total_cmp(&a.mobility).then(a.node.cmp(&b.node)));
    let mobile_nodes = nodes.len();
    nodes.truncate(MAX_MOBILE_NODES);
    Ok(Rigidity {
        unknowns,
        zero_modes,
        self_stresses: (zero_modes + fibers).saturating_sub(unknowns),
        single_node_modes,
        few_fibers,
        coplanar_fibers,
        mobile_nodes,
        estimated,
        most_mobile: nodes,
    })
}

/// Returns the number of single-node modes, and of nodes that have them because of few or of coplanar fibers.
fn single_node_modes(network: &Network) -> [usize; 3] {
    let mut blocks = vec![(Matrix3::zeros(), 0); network.interior().len()];
    for (fiber, ends) in network.fibers().iter().enumerate() {
        let n = Vector3::from(network.direction(fiber));
        for &node in ends {
            // A boundary node has number -1, which is out of range.
            if let Some((block, fibers)) = blocks.get_mut(network.interior_number()[node as usize] as usize) {
                *block += n * n.transpose();
                *fibers += 1;
            }
        }
    }
    let [mut modes, mut few_fibers, mut coplanar_fibers] = [0; 3];
    for (block, fibers) in blocks {
        let limit = SHIFT * block.diagonal().max().max(1.0);
        let free = SymmetricEigen::new(block).eigenvalues.iter().filter(|&&value| value < limit).count();
        modes += free;
        if fibers < 3 {
            few_fibers += 1;
        } else if free > 0 {
            coplanar_fibers += 1;
        }
    }
    [modes, few_fibers, coplanar_fibers]
}

/// The stiffness of a network of unstressed springs, with its solver.
struct Stiffness<'a, B: Backend> {
    network: &'a Network,
    matrix: B::Matrix,
    solver: B::Solver,
    /// The largest diagonal entry.
    scale: f64,
}

impl<'a, B: RealBackend> Stiffness<'a, B> {
    fn new(context: &B::Context, network: &'a Network) -> Result<Self, RigidityError<B::Error>> {
        let number = network.interior_number();
        let pattern = Arc::new(pattern(network)?);
        // In a rigid network `K - s I` is positive definite, and Cholesky, the fastest factorization, succeeds.
        let symbolic = B::analyze(context, &pattern, &SolverParams::new(Symmetry::Definite))?;
        let solver = B::solver(&symbolic)?;
        let matrix = B::matrix(context, &pattern).map_err(SolveError::Backend)?;
        let mut diagonal = vec![0.0; 3 * network.interior().len()];
        for (fiber, ends) in network.fibers().iter().enumerate() {
            let n = network.direction(fiber);
            for &node in ends {
                let first = 3 * number[node as usize];
                if first >= 0 {
                    (0..3).for_each(|k| diagonal[first as usize + k] += n[k] * n[k]);
                }
            }
        }
        // If no interior node has fibers, any positive number serves as the scale.
        let scale = diagonal.into_iter().fold(0.0, f64::max);
        Ok(Self { network, matrix, solver, scale: if scale > 0.0 { scale } else { 1.0 } })
    }

    /// Factors `K + shift I`.
    fn factor(&mut self, shift: f64) -> Result<FactorReport, SolveError<B::Error>> {
        let Self { network, matrix, solver, .. } = self;
        matrix.assemble(|matrix| add_stiffness::<B>(network, shift, matrix))?;
        solver.factor(matrix)
    }

    /// Counts the zero modes: the negative pivots of `K - s I`.
    fn zero_modes(&mut self) -> Result<usize, RigidityError<B::Error>> {
        for attempt in 0..ATTEMPTS {
            // With an irrational ratio, no pivot vanishes at two of these shifts by coincidence.
            let shift = SHIFT * self.scale * std::f64::consts::SQRT_2.powi(attempt);
            match self.factor(-shift) {
                Ok(FactorReport { negative_pivots: Some(count), .. }) => return Ok(count),
                Ok(_) | Err(SolveError::Singular { .. }) => {}
                Err(error) => return Err(error.into()),
            }
        }
        Err(RigidityError::Undecided)
    }
}

/// Adds `K + shift I` to the matrix.
fn add_stiffness<B: RealBackend>(network: &Network, shift: f64, matrix: &mut B::Matrix) -> Result<(), B::Error> {
    let number = network.interior_number();
    for (fiber, ends) in network.fibers().iter().enumerate() {
        let rows = [0, 1, 2, 3, 4, 5].map(|i: usize| match number[ends[i / 3] as usize] {
            interior if interior < 0 => B::Index::CONSTRAINED,
            interior => B::Index::of(3 * interior as usize + i % 3),
        });
        let n = network.direction(fiber);
        let signed = [-n[0], -n[1], -n[2], n[0], n[1], n[2]];
        let block: [f64; 36] = std::array::from_fn(|k| signed[k / 6] * signed[k % 6]);
        matrix.add(&rows, &rows, &block)?;
    }
    for row in 0..3 * network.interior().len() {
        let row = [B::Index::of(row)];
        matrix.add(&row, &row, &[shift])?;
    }
    Ok(())
}
