//! Cholesky of a matrix of 3x3 blocks: the factorisation for fiber networks.
//!
//! Nodes with (almost) the same couplings are eliminated together, as a supernode. Its columns of the factor form a
//! panel: a row of 3x3 blocks for each of its own nodes and for each node below that they couple to. A row of the panel
//! lies in one piece, column after column, each column of a block as four lanes of which the last is zero:
//!
//! ```text
//! panel[(row * width + node) * 3 + column][lane]      rows: the supernode's nodes, then those below
//! ```
//!
//! The diagonal blocks hold the inverse of their Cholesky factor, so that nothing is divided by in the inner loops. What
//! lies above the diagonal blocks is scratch.
//!
//! The factorisation is left-looking: a supernode takes the values of the matrix, subtracts the products of those before
//! it that reach it, and is then factored by itself. All three are products of rows with rows, `sum_k a_k b_k^T` over
//! columns of both, of which three rows at once are kept in registers.

mod factor;
mod lanes;
mod solve;
mod supernodes;
#[cfg(test)]
mod tests;

pub(super) use factor::BlockCholesky;
pub use lanes::BlockScalar;

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

/// Rows `begin..end` of the panel of the supernode `from` (counted from the first below its own nodes) belong to the
/// supernode whose update this is.
#[derive(Clone, Copy, Debug)]
struct Update {
    from: u32,
    begin: u32,
    end: u32,
}

/// The symbolic factorisation of a matrix of blocks.
pub(super) struct BlockAnalysis {
    supernodes: Supernodes,
    /// Where the panel of each supernode starts, in columns; one more than there are supernodes.
    panel_start: Vec<usize>,
    /// The blocks of the matrix that each supernode takes.
    sources: Vec<Source>,
    source_start: Vec<u32>,
    /// The earlier supernodes that reach each supernode.
    updates: Vec<Update>,
    update_start: Vec<u32>,
    /// The node eliminated at each position.
    order: Vec<u32>,
}

impl BlockAnalysis {
    /// For a matrix whose graph is one of blocks.
    pub(super) fn new(pattern: &Sparsity, graph: &Graph, tree: &Tree) -> Self {
        let supernodes = Supernodes::new(graph, tree);
        let mut panel_start = vec![0];
        for s in 0..supernodes.count() {
            panel_start.push(panel_start[s] + BLOCK * supernodes.width(s) * supernodes.height(s));
        }
        let (updates, update_start) = updates(&supernodes);
        let (sources, source_start) = sources(pattern, tree, &supernodes);
        let order = tree.order.clone();
        Self { supernodes, panel_start, sources, source_start, updates, update_start, order }
    }

    /// Number of nodes.
    fn nodes(&self) -> usize {
        self.order.len()
    }

    /// Number of columns of blocks in all panels.
    fn columns(&self) -> usize {
        self.panel_start.last().copied().unwrap_or(0)
    }

    /// Number of values of the factor, explicit zeros of the supernodes included, padding not.
    pub(super) fn entries(&self) -> usize {
        let of_blocks = |blocks: usize| BLOCK * BLOCK * blocks;
        let entries = |s: usize| {
            let (width, height) = (self.supernodes.width(s), self.supernodes.height(s));
            of_blocks(width * (height - width)) + BLOCK * width * (BLOCK * width + 1) / 2
        };
        (0..self.supernodes.count()).map(entries).sum()
    }

    /// The unknown that is eliminated at a position, counted in unknowns.
    pub(super) fn unknown(&self, position: usize) -> usize {
        BLOCK * self.order[position / BLOCK] as usize + position % BLOCK
    }

    fn sources_of(&self, s: usize) -> &[Source] {
        &self.sources[self.source_start[s] as usize..self.source_start[s + 1] as usize]
    }

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

/// For every supernode the blocks of the matrix at and below its diagonal.
fn sources(pattern: &Sparsity, tree: &Tree, supernodes: &Supernodes) -> (Vec<Source>, Vec<u32>) {
    let mut sources: Vec<(u32, Source)> = Vec::new();
    for node in 0..tree.order.len() {
        let (at, row) = (pattern.row_start()[BLOCK * node], pattern.row(BLOCK * node));
        let column = tree.position[node] as usize;
        for (k, block) in (0..).zip(row.as_chunks::<BLOCK>().0) {
            // A row of the mirrored block is a column of this one: of the two, take the one that needs no transposition.
            let row_of_factor = tree.position[block[0] as usize / BLOCK] as usize;
            if row_of_factor >= column {
                let s = supernodes.of_position(column);
                let to = BLOCK
                    * (supernodes.width(s as usize) * supernodes.row_of(s as usize, row_of_factor)
                        + supernodes.column_of(s as usize, column));
                let source = Source { at: at + k * BLOCK as u32, stride: row.len() as u32, to: to as u32 };
                sources.push((s, source));
            }
        }
    }
    sources.sort_by_key(|&(s, source)| (s, source.to));
    let start = starts(supernodes.count(), sources.iter().map(|&(s, _)| s as usize));
    (sources.into_iter().map(|(_, source)| source).collect(), start)
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
