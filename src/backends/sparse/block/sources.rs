//! The destinations of the blocks of the matrix in the panels.

use std::iter::repeat_n;

use super::supernodes::Supernodes;
use super::{BLOCK, BlockSource, PartialBlock};
use crate::backends::sparse::order::{Graph, Tree};
use crate::las::Sparsity;

/// Returns the blocks of the matrix at and below the diagonal of the factor, each with its supernode, in panel order.
pub(super) fn blocks(
    pattern: &Sparsity,
    graph: &Graph,
    tree: &Tree,
    supernodes: &Supernodes,
) -> Vec<(u32, PartialBlock)> {
    let first = graph.first_unknowns();
    let node_of: Vec<u32> = (0..graph.nodes()).flat_map(|node| repeat_n(node as u32, graph.size(node))).collect();
    let mut blocks: Vec<(u32, PartialBlock)> = Vec::new();
    for node in 0..graph.nodes() {
        let start = pattern.row_offsets()[first[node] as usize];
        let (row, columns) = (pattern.row(first[node] as usize), graph.size(node));
        let column = tree.position[node] as usize;
        let s = supernodes.of_position(column);
        let mut k = 0;
        while let Some(&unknown) = row.get(k) {
            let other = node_of[unknown as usize] as usize;
            let at = start + k as u32;
            k += graph.size(other);
            // The matrix is symmetric: a row of its block `(node, other)` is a column of block `(other, node)` of the
            // factor. Reading `(node, other)` avoids a transposition.
            let row_of_factor = tree.position[other] as usize;
            if row_of_factor < column {
                continue;
            }
            let to = BLOCK
                * (supernodes.width(s as usize) * supernodes.row_of(s as usize, row_of_factor)
                    + supernodes.column_of(s as usize, column));
            let source = BlockSource { at, stride: row.len() as u32, to: to as u32 };
            blocks.push((s, PartialBlock { source, rows: graph.size(other) as u8, columns: columns as u8 }));
        }
    }
    blocks.sort_unstable_by_key(|&(s, block)| (s, block.source.to));
    blocks
}
