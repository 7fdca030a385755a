//! Cholesky factorization of matrices of 3x3 blocks, for fiber networks and bodies.
//!
//! Nodes with (almost) the same couplings form a supernode and are eliminated together. The columns of a supernode in
//! the factor form a panel: one row of 3x3 blocks for each node of the supernode and for each node below that they
//! couple to. A row of the panel is contiguous, column after column; each column of a block has four lanes, the last of
//! which is zero:
//!
//! ```text
//! panel[(row * width + node) * 3 + column][lane]      rows: the nodes of the supernode, then those below
//! ```
//!
//! A node with one or two unknowns is padded to three, with ones on the diagonal and no couplings. All operations leave
//! the padding unchanged; it counts neither as a pivot nor as a value of the factor.
//!
//! The diagonal blocks store the inverse of their Cholesky factor, so that the inner loops contain no divisions. The
//! blocks above the diagonal blocks are scratch.
//!
//! The factorization is left-looking: a supernode loads the values of the matrix, subtracts the contributions of the
//! earlier supernodes that update it, and is then factored. The last two steps are products of panel rows,
//! `sum_k a_k b_k^T` over the columns of both, with the sums of three or six rows at a time kept in registers.

#![allow(
    clippy::needless_range_loop,
    reason = "indices of registers, known when compiled; the closures of iterators may be left calls without vectors"
)]

mod factor;
mod products;
mod simd;
mod solve;
mod sources;
mod supernodes;
#[cfg(test)]
mod tests;
mod update;
#[cfg(target_arch = "x86_64")]
mod x86;

pub(super) use factor::BlockCholesky;
pub use simd::{BlockScalar, SimdLevel};

use super::order::{BLOCK, Graph, Tree};
use crate::las::{Sparsity, offsets};
use supernodes::Supernodes;

/// A column of a block: three rows and a zero lane.
type Column<T> = [T; simd::QUAD_LEN];

/// The source and destination of one block of the matrix.
#[derive(Clone, Copy, Debug)]
struct BlockSource {
    /// Index of the first value of the block in the matrix.
    at: u32,
    /// Number of values in each of its rows of the matrix, which is the distance between two rows of the block.
    stride: u32,
    /// Index of the first column of the block in the panel of the supernode.
    to: u32,
}

/// A block with fewer than three rows or columns; padding fills the rest of its place in the panel.
#[derive(Clone, Copy, Debug)]
struct PartialBlock {
    source: BlockSource,
    rows: u8,
    columns: u8,
}

/// A node: consecutive unknowns of the matrix.
#[derive(Clone, Copy, Debug)]
struct Node {
    first: u32,
    /// The number of unknowns, one to three.
    size: u32,
}

impl Node {
    #[inline(always)]
    fn unknowns(self) -> std::ops::Range<usize> {
        self.first as usize..(self.first + self.size) as usize
    }
}

/// An update of a supernode by an earlier one: rows `begin..end` of the panel of supernode `from` (counted from the
/// first row below its own nodes) belong to the updated supernode.
#[derive(Clone, Copy, Debug)]
struct Update {
    from: u32,
    begin: u32,
    end: u32,
}

/// The symbolic factorization of a matrix of blocks.
pub(super) struct SymbolicBlockCholesky {
    supernodes: Supernodes,
    /// The index of the first column of each panel; one entry more than there are supernodes.
    panel_start: Vec<usize>,
    /// The blocks of the matrix that belong to each supernode.
    sources: Vec<BlockSource>,
    source_start: Vec<u32>,
    /// The earlier supernodes that update each supernode.
    updates: Vec<Update>,
    update_start: Vec<u32>,
    /// The blocks with fewer than three rows or columns that belong to each supernode.
    partial: Vec<PartialBlock>,
    partial_start: Vec<u32>,
    /// The node eliminated at each position.
    nodes: Vec<Node>,
}

impl SymbolicBlockCholesky {
    /// Computes the symbolic factorization of matrices with this pattern, graph and elimination tree.
    pub(super) fn new(pattern: &Sparsity, graph: &Graph, tree: &Tree) -> Self {
        let supernodes = Supernodes::new(graph, tree);
        let mut panel_start = vec![0];
        for s in 0..supernodes.count() {
            panel_start.push(panel_start[s] + BLOCK * supernodes.width(s) * supernodes.height(s));
        }
        let (updates, update_start) = updates(&supernodes);
        let mut blocks = sources::blocks(pattern, graph, tree, &supernodes);
        let is_full = |block: &PartialBlock| usize::from(block.rows.min(block.columns)) == BLOCK;
        let partial = blocks.extract_if(.., |(_, block)| !is_full(block)).collect::<Vec<_>>();
        let first = graph.first_unknowns();
        let node = |&node: &u32| Node { first: first[node as usize], size: graph.size(node as usize) as u32 };
        Self {
            panel_start,
            source_start: offsets(supernodes.count(), blocks.iter().map(|&(s, _)| s as usize)),
            sources: blocks.into_iter().map(|(_, block)| block.source).collect(),
            partial_start: offsets(supernodes.count(), partial.iter().map(|&(s, _)| s as usize)),
            partial: partial.into_iter().map(|(_, block)| block).collect(),
            updates,
            update_start,
            nodes: tree.order.iter().map(node).collect(),
            supernodes,
        }
    }

    /// Returns the number of nodes.
    fn nodes(&self) -> usize {
        self.nodes.len()
    }

    /// Returns the number of block columns in all panels.
    fn columns(&self) -> usize {
        self.panel_start.last().copied().unwrap_or(0)
    }

    /// Returns the number of values in all panels, with their padding.
    pub(super) fn stored_values(&self) -> usize {
        simd::QUAD_LEN * self.columns()
    }

    /// Returns the number of values in the factor, including the explicit zeros of the supernodes but not the padding.
    pub(super) fn entries(&self) -> usize {
        let entries = |s: usize| {
            let own: usize = self.nodes_of(s).iter().map(|node| node.size as usize).sum();
            let below: usize = self.supernodes.rows(s).iter().map(|&row| self.nodes[row as usize].size as usize).sum();
            own * below + own * (own + 1) / 2
        };
        (0..self.supernodes.count()).map(entries).sum()
    }

    /// Returns the unknown of a pivot, which is unknown `position % 3` of the node at `position / 3`.
    pub(super) fn unknown(&self, position: usize) -> usize {
        self.nodes[position / BLOCK].first as usize + position % BLOCK
    }

    /// Returns the nodes of a supernode.
    #[inline(always)]
    fn nodes_of(&self, s: usize) -> &[Node] {
        &self.nodes[self.supernodes.first(s)..][..self.supernodes.width(s)]
    }

    #[inline]
    fn partial_of(&self, s: usize) -> &[PartialBlock] {
        &self.partial[self.partial_start[s] as usize..self.partial_start[s + 1] as usize]
    }

    #[inline]
    fn sources_of(&self, s: usize) -> &[BlockSource] {
        &self.sources[self.source_start[s] as usize..self.source_start[s + 1] as usize]
    }

    #[inline]
    fn updates_of(&self, s: usize) -> &[Update] {
        &self.updates[self.update_start[s] as usize..self.update_start[s + 1] as usize]
    }
}

/// Returns for every supernode the updates by earlier supernodes, in ascending order.
fn updates(supernodes: &Supernodes) -> (Vec<Update>, Vec<u32>) {
    let mut updates: Vec<(u32, Update)> = Vec::new();
    for from in 0..supernodes.count() {
        let rows = supernodes.rows(from);
        let mut begin = 0;
        while begin < rows.len() {
            let target = supernodes.of_position(rows[begin] as usize);
            let inside = |&row: &u32| supernodes.of_position(row as usize) == target;
            let end = begin + rows[begin..].iter().take_while(|row| inside(row)).count();
            updates.push((target, Update { from: from as u32, begin: begin as u32, end: end as u32 }));
            begin = end;
        }
    }
    updates.sort_by_key(|&(target, _)| target);
    let start = offsets(supernodes.count(), updates.iter().map(|&(target, _)| target as usize));
    (updates.into_iter().map(|(_, update)| update).collect(), start)
}
