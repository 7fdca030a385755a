//! Cholesky of a matrix of 3x3 blocks: the factorization for fiber networks and bodies.
//!
//! Nodes with (almost) the same couplings are eliminated together, as a supernode. Its columns of the factor form a
//! panel: a row of 3x3 blocks for each of its own nodes and for each node below that they couple to. A row of the panel
//! lies in one piece, column after column, each column of a block as four lanes of which the last is zero:
//!
//! ```text
//! panel[(row * width + node) * 3 + column][lane]      rows: the supernode's nodes, then those below
//! ```
//!
//! A node with one or two unknowns is padded to three, with ones on the diagonal and no couplings. Padding stays as it is
//! through all operations, and neither counts as a pivot nor as a value of the factor.
//!
//! The diagonal blocks hold the inverse of their Cholesky factor, so that nothing is divided by in the inner loops. What
//! lies above the diagonal blocks is scratch.
//!
//! The factorization is left-looking: a supernode takes the values of the matrix, subtracts the products of those before
//! it that reach it, and is then factored by itself. All three are products of rows with rows, `sum_k a_k b_k^T` over
//! columns of both, of which three rows at once are kept in registers, or six.

#![allow(
    clippy::needless_range_loop,
    reason = "indices of registers, known when compiled; the closures of iterators may be left calls without vectors"
)]

mod factor;
mod lanes;
mod products;
mod solve;
mod sources;
mod supernodes;
#[cfg(test)]
mod tests;
mod update;
#[cfg(target_arch = "x86_64")]
mod x86;

pub(super) use factor::BlockCholesky;
pub use lanes::{BlockScalar, Width};

use super::order::{BLOCK, Graph, Tree};
use crate::las::Sparsity;
use supernodes::Supernodes;

/// A column of a block: three rows and a zero.
type Column<T> = [T; lanes::LANES];

/// Where a block of the matrix goes.
#[derive(Clone, Copy, Debug)]
struct Source {
    /// The first value of the block among those of the matrix.
    at: u32,
    /// Number of values of its rows in the matrix: the distance from one row of the block to the next.
    stride: u32,
    /// Its first column in the panel of the supernode.
    to: u32,
}

/// A block with fewer than three rows or columns; what it lacks in the panel is padding.
#[derive(Clone, Copy, Debug)]
struct Partial {
    source: Source,
    rows: u8,
    columns: u8,
}

/// Consecutive unknowns of the matrix.
#[derive(Clone, Copy, Debug)]
struct Node {
    first: u32,
    /// One to three.
    size: u32,
}

impl Node {
    #[inline(always)]
    fn unknowns(self) -> std::ops::Range<usize> {
        self.first as usize..(self.first + self.size) as usize
    }
}

/// Rows `begin..end` of the panel of the supernode `from` (counted from the first below its own nodes) belong to the
/// supernode whose update this is.
#[derive(Clone, Copy, Debug)]
struct Update {
    from: u32,
    begin: u32,
    end: u32,
}

/// The symbolic factorization of a matrix of blocks.
pub(super) struct SymbolicBlockCholesky {
    supernodes: Supernodes,
    /// Where the panel of each supernode starts, in columns; one more than there are supernodes.
    panel_start: Vec<usize>,
    /// The blocks of the matrix that each supernode takes.
    sources: Vec<Source>,
    source_start: Vec<u32>,
    /// The earlier supernodes that reach each supernode.
    updates: Vec<Update>,
    update_start: Vec<u32>,
    /// The same for blocks with fewer than three rows or columns.
    partial: Vec<Partial>,
    partial_start: Vec<u32>,
    /// The node eliminated at each position.
    nodes: Vec<Node>,
}

impl SymbolicBlockCholesky {
    /// For a matrix of this graph.
    pub(super) fn new(pattern: &Sparsity, graph: &Graph, tree: &Tree) -> Self {
        let supernodes = Supernodes::new(graph, tree);
        let mut panel_start = vec![0];
        for s in 0..supernodes.count() {
            panel_start.push(panel_start[s] + BLOCK * supernodes.width(s) * supernodes.height(s));
        }
        let (updates, update_start) = updates(&supernodes);
        let mut blocks = sources::blocks(pattern, graph, tree, &supernodes);
        let is_full = |block: &Partial| usize::from(block.rows.min(block.columns)) == BLOCK;
        let partial = blocks.extract_if(.., |(_, block)| !is_full(block)).collect::<Vec<_>>();
        let first = graph.first_unknowns();
        let node = |&node: &u32| Node { first: first[node as usize], size: graph.size(node as usize) as u32 };
        Self {
            panel_start,
            source_start: starts(supernodes.count(), blocks.iter().map(|&(s, _)| s as usize)),
            sources: blocks.into_iter().map(|(_, block)| block.source).collect(),
            partial_start: starts(supernodes.count(), partial.iter().map(|&(s, _)| s as usize)),
            partial: partial.into_iter().map(|(_, block)| block).collect(),
            updates,
            update_start,
            nodes: tree.order.iter().map(node).collect(),
            supernodes,
        }
    }

    /// Number of nodes.
    fn nodes(&self) -> usize {
        self.nodes.len()
    }

    /// Number of columns of blocks in all panels.
    fn columns(&self) -> usize {
        self.panel_start.last().copied().unwrap_or(0)
    }

    /// Number of values of the factor, explicit zeros of the supernodes included, padding not.
    pub(super) fn entries(&self) -> usize {
        let entries = |s: usize| {
            let own: usize = self.nodes_of(s).iter().map(|node| node.size as usize).sum();
            let below: usize = self.supernodes.rows(s).iter().map(|&row| self.nodes[row as usize].size as usize).sum();
            own * below + own * (own + 1) / 2
        };
        (0..self.supernodes.count()).map(entries).sum()
    }

    /// The unknown of a pivot: the `position % 3`-th of the node at `position / 3`.
    pub(super) fn unknown(&self, position: usize) -> usize {
        self.nodes[position / BLOCK].first as usize + position % BLOCK
    }

    /// The nodes of a supernode.
    #[inline(always)]
    fn nodes_of(&self, s: usize) -> &[Node] {
        &self.nodes[self.supernodes.first(s)..][..self.supernodes.width(s)]
    }

    #[inline]
    fn partial_of(&self, s: usize) -> &[Partial] {
        &self.partial[self.partial_start[s] as usize..self.partial_start[s + 1] as usize]
    }

    #[inline]
    fn sources_of(&self, s: usize) -> &[Source] {
        &self.sources[self.source_start[s] as usize..self.source_start[s + 1] as usize]
    }

    #[inline]
    fn updates_of(&self, s: usize) -> &[Update] {
        &self.updates[self.update_start[s] as usize..self.update_start[s + 1] as usize]
    }
}

/// For every supernode the earlier ones whose rows lie in it, in ascending order.
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
    let start = starts(supernodes.count(), updates.iter().map(|&(target, _)| target as usize));
    (updates.into_iter().map(|(_, update)| update).collect(), start)
}

/// Where the items of each of `count` owners start, given the owner of every item, ascending.
fn starts(count: usize, owners: impl Iterator<Item = usize>) -> Vec<u32> {
    let mut start = vec![0; count + 1];
    for owner in owners {
        start[owner + 1] += 1;
    }
    for owner in 0..count {
        start[owner + 1] += start[owner];
    }
    start
}
