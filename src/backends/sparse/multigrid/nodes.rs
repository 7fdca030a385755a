//! The unknowns of a matrix as nodes with blocks of one size.

use super::super::order::Graph;
use super::blocks::{BlockMatrix, Entry, for_each_block};
use crate::las::{Scalar, Sparsity};

/// The block size of a matrix, and the unknowns of each of its nodes.
///
/// Nodes with fewer unknowns than the block size, such as those on rollers, are padded with unknowns of their own that
/// are not coupled to others.
pub(super) struct Nodes {
    /// Number of unknowns per node, padding included: 1 or 3.
    pub size: usize,
    /// The first unknown of each node, followed by the number of unknowns.
    first: Vec<u32>,
}

impl Nodes {
    /// Finds the nodes of a symmetric pattern. If most unknowns share their pattern with no neighboring unknown, every
    /// unknown is a node.
    pub fn new(pattern: &Sparsity) -> Self {
        let first = Graph::new(pattern).first_unknowns();
        let unknowns = pattern.rows();
        if first.len() - 1 > unknowns / 2 {
            Self { size: 1, first: (0..=unknowns as u32).collect() }
        } else {
            Self { size: 3, first }
        }
    }

    /// Returns the number of nodes.
    pub fn len(&self) -> usize {
        self.first.len() - 1
    }

    /// Returns the number of unknowns, padding included.
    pub fn padded_len(&self) -> usize {
        self.len() * self.size
    }

    /// Returns the unknowns of a node.
    #[inline(always)]
    pub fn unknowns(&self, node: usize) -> std::ops::Range<usize> {
        self.first[node] as usize..self.first[node + 1] as usize
    }

    /// Returns true if no node is padded, so that padded vectors are the vectors themselves.
    pub fn are_full(&self) -> bool {
        self.first.last().is_none_or(|&unknowns| unknowns as usize == self.padded_len())
    }

    /// Copies a vector to its padded form, divided by `unit`; the padding is zero.
    pub fn pad<U: Entry>(&self, x: &[f64], unit: f64, padded: &mut [U]) {
        let scale = 1.0 / unit;
        for_each_block(padded, self.size, |(node, to)| {
            let from = &x[self.unknowns(node)];
            to[from.len()..].fill(U::zero());
            to.iter_mut().zip(from).for_each(|(to, from)| *to = U::of(from * scale));
        });
    }

    /// Copies the unknowns of a padded vector, times `unit`.
    pub fn unpad<U: Entry>(&self, padded: &[U], unit: f64, x: &mut [f64]) {
        super::for_each_row(&self.first, 1, x, |node, to| {
            to.iter_mut().zip(&padded[node * self.size..]).for_each(|(to, from)| *to = from.as_f64() * unit);
        });
    }

    /// Returns the pattern of the padded matrix: offsets and columns of its blocks.
    pub fn block_pattern(&self, pattern: &Sparsity) -> (Vec<u32>, Vec<u32>) {
        let mut node_of = vec![0; pattern.rows()];
        for node in 0..self.len() {
            node_of[self.unknowns(node)].fill(node as u32);
        }
        let (mut offsets, mut columns) = (vec![0], Vec::with_capacity(pattern.nnz() / (self.size * self.size)));
        for node in 0..self.len() {
            let before = columns.len();
            for &unknown in pattern.row(self.unknowns(node).start) {
                let other = node_of[unknown as usize];
                if columns[before..].last() != Some(&other) {
                    columns.push(other);
                }
            }
            offsets.push(columns.len() as u32);
        }
        (offsets, columns)
    }

    /// Copies the values of a matrix with the given pattern to `blocks`, made from [`Nodes::block_pattern`]. The
    /// diagonal of the padding is the mean of the other diagonal entries of the node.
    pub fn copy_values<T: Scalar>(&self, pattern: &Sparsity, values: &[T], blocks: &mut BlockMatrix<f64>) {
        let size = self.size;
        let BlockMatrix { offsets, columns, values: entries, .. } = blocks;
        let copy_row = |node: usize, entries: &mut [f64]| {
            let columns = &columns[offsets[node] as usize..offsets[node + 1] as usize];
            for (i, unknown) in self.unknowns(node).enumerate() {
                let mut row = values[pattern.range(unknown)].iter();
                for (block, &other) in entries.chunks_exact_mut(size * size).zip(columns) {
                    for j in 0..self.unknowns(other as usize).len() {
                        block[j * size + i] = row.next().map_or(0.0, |value| value.as_f64());
                    }
                }
            }
            let count = self.unknowns(node).len();
            if let (true, Ok(at)) = (count < size, columns.binary_search(&(node as u32))) {
                let diagonal = &mut entries[at * size * size..][..size * size];
                let mean = (0..count).map(|i| diagonal[i * size + i]).sum::<f64>() / count.max(1) as f64;
                (count..size).for_each(|i| diagonal[i * size + i] = mean);
            }
        };
        super::for_each_row(offsets, size * size, entries, copy_row);
    }

    /// Copies the values that [`Nodes::copy_values`] copied back to a matrix with the given pattern.
    pub fn values_into<T: Scalar>(&self, pattern: &Sparsity, blocks: &BlockMatrix<f64>, values: &mut [T]) {
        let size = self.size;
        for node in 0..self.len() {
            for (i, unknown) in self.unknowns(node).enumerate() {
                let mut row = values[pattern.range(unknown)].iter_mut();
                for at in blocks.range(node) {
                    let other = self.unknowns(blocks.columns[at] as usize).len();
                    for (j, value) in (0..other).zip(&mut row) {
                        *value = T::of(blocks.values[(at * size + j) * size + i]);
                    }
                }
            }
        }
    }
}
