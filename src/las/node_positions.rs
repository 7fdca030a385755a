//! The positions of blocks of nodes in compressed rows, in a ninth of the memory of one position per entry.

use std::ops::Range;

use super::Sparsity;
use crate::parallel;

/// The positions of square blocks that couple nodes with three unknowns each.
///
/// The free unknowns of a node are consecutive in the columns of a row, and its rows have the same columns. Therefore
/// one position per pair of nodes, the length of the rows, and the components that are free determine all positions.
#[derive(Clone, Debug)]
pub(crate) struct NodePositions {
    /// Number of nodes of a block.
    nodes: usize,
    /// For each block and each pair of nodes, row-major, the position of the entry of their first free unknowns, or
    /// [`NodePositions::NONE`] if a node has none.
    first: Vec<u32>,
    /// The rows of each node of each block.
    rows: Vec<NodeRows>,
    /// The range of the positions of each group of [`NodePositions::GROUP`] blocks.
    spans: Vec<Range<u32>>,
}

/// The rows of a node: the number of their entries, and the components that are free.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct NodeRows(u32);

impl NodeRows {
    const LONGEST: usize = (u32::MAX >> 3) as usize;

    /// Number of entries of a row.
    #[inline(always)]
    pub fn len(self) -> usize {
        (self.0 >> 3) as usize
    }

    /// Returns true if component `i` is free.
    #[inline(always)]
    pub fn is_free(self, i: usize) -> bool {
        self.0 >> i & 1 == 1
    }

    /// Returns true if one or two components are free.
    #[inline(always)]
    pub fn is_partly_free(self) -> bool {
        !matches!(self.0 & 7, 0 | 7)
    }

    fn free(self) -> usize {
        (self.0 & 7).count_ones() as usize
    }
}

/// The positions of one block.
#[derive(Clone, Copy, Debug)]
pub(crate) struct NodeBlock<'a> {
    /// Those of the first free unknowns of each pair of nodes, row-major.
    pub first: &'a [u32],
    /// The rows of each node.
    pub rows: &'a [NodeRows],
}

impl NodePositions {
    /// The position of a pair of nodes one of which has no free unknown: beyond the end of every pattern, whatever is
    /// added to it for the other rows of the node.
    pub const NONE: u32 = 1 << 31;

    /// Number of blocks whose positions have one range.
    pub const GROUP: usize = 64;

    /// Number of blocks that a task locates.
    const PER_TASK: usize = 2048;

    /// Locates blocks of `size` unknowns, whose indices follow each other block by block, three per node. Returns
    /// `None` if the unknowns of a node are not consecutive, if its rows have different columns, or if an entry is not
    /// in the pattern.
    pub fn new(pattern: &Sparsity, size: usize, indices: &[i32]) -> Option<Self> {
        let (triples, &[]) = indices.as_chunks::<3>() else { return None };
        if size == 0 || !size.is_multiple_of(3) || !indices.len().is_multiple_of(size) {
            return None;
        }
        let nodes = size / 3;
        let is_as_before = parallel::collect(pattern.rows(), |row| row > 0 && pattern.row(row) == pattern.row(row - 1));
        let len = triples.len() / nodes;
        let mut positions = Self {
            nodes,
            first: parallel::filled(Self::NONE, triples.len() * nodes),
            rows: parallel::filled(NodeRows(0), triples.len()),
            spans: Vec::new(),
        };
        let blocks = triples.chunks(nodes * Self::PER_TASK);
        let tasks = positions.first.chunks_mut(nodes * nodes * Self::PER_TASK);
        let tasks = tasks.zip(positions.rows.chunks_mut(nodes * Self::PER_TASK)).zip(blocks);
        let located = parallel::try_each(tasks, |((first, rows), triples)| {
            let nodes_of_blocks =
                triples.chunks_exact(nodes).flat_map(|block| block.iter().map(move |node| (block, node)));
            for (((block, row_node), rows), first) in nodes_of_blocks.zip(rows).zip(first.chunks_exact_mut(nodes)) {
                *rows = node_rows(pattern, &is_as_before, row_node).ok_or(())?;
                for (first, column_node) in first.iter_mut().zip(block) {
                    *first = position(pattern, row_node, column_node).ok_or(())?;
                }
            }
            Ok::<_, ()>(())
        });
        located.ok()?;
        positions.spans = parallel::collect(len.div_ceil(Self::GROUP), |group| {
            let blocks = group * Self::GROUP..len.min((group + 1) * Self::GROUP);
            let spans = blocks.flat_map(|number| positions.block(number).spans());
            let limits = (Self::NONE, 0);
            let (start, end) = spans.fold(limits, |(start, end), span| (span.start.min(start), span.end.max(end)));
            start..end
        });
        Some(positions)
    }

    /// Number of rows of a block.
    pub fn size(&self) -> usize {
        3 * self.nodes
    }

    /// Number of blocks.
    pub fn len(&self) -> usize {
        self.rows.len() / self.nodes
    }

    /// Returns the positions of a block.
    #[inline(always)]
    pub fn block(&self, number: usize) -> NodeBlock<'_> {
        let nodes = self.nodes;
        NodeBlock {
            first: &self.first[number * nodes * nodes..][..nodes * nodes],
            rows: &self.rows[number * nodes..][..nodes],
        }
    }

    /// Returns a range that contains all positions of each group of [`NodePositions::GROUP`] blocks.
    pub fn spans(&self) -> &[Range<u32>] {
        &self.spans
    }
}

impl<'a> NodeBlock<'a> {
    /// Returns the position of the diagonal entry of the first free unknown of each node that has one, with the rows of
    /// the node.
    pub fn diagonal(self) -> impl Iterator<Item = (u32, NodeRows)> + 'a {
        let diagonal = self.first.iter().step_by(self.rows.len() + 1).copied().zip(self.rows.iter().copied());
        diagonal.filter(|&(first, _)| first != NodePositions::NONE)
    }

    /// Returns ranges that contain the positions of the diagonal blocks of the nodes.
    fn spans(self) -> impl Iterator<Item = Range<u32>> + 'a {
        self.diagonal().map(|(first, rows)| {
            let last = first + ((rows.free() - 1) * rows.len() + rows.free() - 1) as u32;
            first..last + 1
        })
    }
}

/// Returns the rows of a node; `None` if its free unknowns are not consecutive, or if their rows differ.
fn node_rows(pattern: &Sparsity, is_as_before: &[bool], unknowns: &[i32; 3]) -> Option<NodeRows> {
    let mut free = unknowns.iter().filter(|&&unknown| unknown >= 0);
    let Some(&first) = free.next() else { return Some(NodeRows(0)) };
    let follows = |(k, &unknown): (usize, &i32)| {
        unknown as usize == first as usize + 1 + k && is_as_before.get(unknown as usize) == Some(&true)
    };
    let len = pattern.row_offsets().get(first as usize + 1)? - pattern.row_offsets().get(first as usize)?;
    if !free.enumerate().all(follows) || len as usize > NodeRows::LONGEST {
        return None;
    }
    let mask = (0..3).filter(|&i| unknowns[i] >= 0).fold(0, |mask, i| mask | 1 << i);
    Some(NodeRows(len << 3 | mask))
}

/// Returns the position of the first free unknowns of two nodes; `None` if the entries of all their free unknowns are
/// not consecutive in the row of the first one.
fn position(pattern: &Sparsity, row_node: &[i32; 3], column_node: &[i32; 3]) -> Option<u32> {
    let Some(row) = row_node.iter().find(|&&row| row >= 0) else { return Some(NodePositions::NONE) };
    let mut columns = column_node.iter().filter(|&&column| column >= 0);
    let Some(&first) = columns.next() else { return Some(NodePositions::NONE) };
    let position = pattern.find(*row as usize, first as usize)?;
    let end = pattern.range(*row as usize).end;
    let follow = &pattern.col_indices()[position + 1..end];
    let is_next = |(column, next): (&i32, Option<&u32>)| next.is_some_and(|&next| next == *column as u32);
    let nexts = follow.iter().map(Some).chain(std::iter::repeat(None));
    columns.zip(nexts).all(is_next).then_some(position as u32)
}
