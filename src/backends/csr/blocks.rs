//! Adding many blocks at once, on all threads.
//!
//! Every entry of the matrix sums its contributions in the order of the blocks, as a loop on one thread does, so that
//! the result has the same bits for any number of threads.

use std::ops::Range;

use rayon::prelude::*;

use super::Matrix;
use crate::las::{BlockPositions, NodeBlock, NodePositions, Sparsity, Value};
use crate::parallel;

/// The number of entries of all blocks from which several threads are worth while.
const PARALLEL_FROM: usize = 1 << 18;

/// The number of entries of the blocks that are held at a time where each block is computed once.
const ENTRIES_PER_BATCH: usize = 1 << 19;

/// The mean number of threads that may compute the same block; if more would, each block is computed once and stored.
const MOST_COMPUTATIONS: f64 = 1.3;

/// The values of whole rows of a matrix, from the position `start`.
struct Rows<'a, T> {
    start: usize,
    values: &'a mut [T],
}

impl<T: Value> Matrix<T> {
    /// Adds blocks whose entries `compute` writes; it returns false for a block that adds nothing.
    pub(in crate::backends) fn add_all_blocks(
        &mut self,
        size: usize,
        positions: &BlockPositions<u32>,
        compute: impl Fn(usize, &mut [T]) -> bool + Sync,
    ) {
        match positions {
            BlockPositions::Entries(slots) => {
                let mut block = vec![T::zero(); size * size];
                for (number, slots) in slots.chunks_exact(block.len().max(1)).enumerate() {
                    if compute(number, &mut block) {
                        self.add_at_positions(slots, &block);
                    }
                }
            }
            BlockPositions::Nodes(nodes) => {
                let is_large = nodes.len() * size * size >= PARALLEL_FROM;
                let threads = if is_large { parallel::threads() } else { 1 };
                self.add_node_blocks(nodes, threads, compute);
            }
        }
    }

    /// Adds blocks of nodes on this number of threads.
    fn add_node_blocks(
        &mut self,
        positions: &NodePositions,
        threads: usize,
        compute: impl Fn(usize, &mut [T]) -> bool + Sync,
    ) {
        let entries = positions.size() * positions.size();
        if threads <= 1 {
            let (mut rows, mut block) = (Rows { start: 0, values: self.values_mut() }, vec![T::zero(); entries]);
            for number in 0..positions.len() {
                if compute(number, &mut block) {
                    rows.add(positions.block(number), &block);
                }
            }
            return;
        }
        let cuts = cuts(&self.pattern, threads);
        if computations(positions, &cuts) <= MOST_COMPUTATIONS {
            self.row_ranges(&cuts).into_par_iter().for_each(|rows| rows.add_touching(positions, &compute));
            return;
        }
        let per_batch = (ENTRIES_PER_BATCH / entries).max(1);
        let mut blocks = vec![T::zero(); per_batch * entries];
        let mut is_added = vec![false; per_batch];
        for first in (0..positions.len()).step_by(per_batch) {
            let count = per_batch.min(positions.len() - first);
            blocks
                .par_chunks_exact_mut(entries)
                .zip(&mut is_added)
                .take(count)
                .enumerate()
                .with_min_len(64)
                .for_each(|(k, (block, is_added))| *is_added = compute(first + k, block));
            self.row_ranges(&cuts).into_par_iter().for_each(|mut rows| {
                for (k, block) in blocks.chunks_exact(entries).take(count).enumerate().filter(|&(k, _)| is_added[k]) {
                    rows.add(positions.block(first + k), block);
                }
            });
        }
    }

    /// Divides the values at these positions.
    fn row_ranges(&mut self, cuts: &[usize]) -> Vec<Rows<'_, T>> {
        let (mut ranges, mut rest) = (Vec::with_capacity(cuts.len()), &mut *self.values);
        for ends in cuts.windows(2) {
            let (values, after) = rest.split_at_mut(ends[1] - ends[0]);
            ranges.push(Rows { start: ends[0], values });
            rest = after;
        }
        ranges
    }
}

/// Divides the rows of a pattern into `count` ranges of about equally many entries; returns the positions of their first
/// entries and of the end.
fn cuts(pattern: &Sparsity, count: usize) -> Vec<usize> {
    let offsets = pattern.row_offsets();
    let cut = |k: usize| {
        let target = (pattern.nnz() as u64 * k as u64 / count as u64) as u32;
        offsets[offsets.partition_point(|&offset| offset < target)] as usize
    };
    (0..=count).map(cut).collect()
}

/// Returns the mean number of ranges that a block touches, by the spans of groups of blocks.
fn computations(positions: &NodePositions, cuts: &[usize]) -> f64 {
    let spans = positions.spans();
    let touched = |span: &Range<u32>| cuts.windows(2).filter(|ends| touches(span, ends[0]..ends[1])).count();
    spans.iter().map(touched).sum::<usize>() as f64 / spans.len().max(1) as f64
}

fn touches(span: &Range<u32>, range: Range<usize>) -> bool {
    (span.start as usize) < range.end && range.start < span.end as usize
}

impl<T: Value> Rows<'_, T> {
    /// Computes the blocks that have entries in these rows, and adds these entries.
    fn add_touching(mut self, positions: &NodePositions, compute: &(impl Fn(usize, &mut [T]) -> bool + Sync)) {
        let mut block = vec![T::zero(); positions.size() * positions.size()];
        let range = self.start..self.start + self.values.len();
        for (group, span) in positions.spans().iter().enumerate() {
            if !touches(span, range.clone()) {
                continue;
            }
            let first = group * NodePositions::GROUP;
            for number in first..positions.len().min(first + NodePositions::GROUP) {
                let of_nodes = positions.block(number);
                let has_rows = of_nodes.diagonal().any(|(first, rows)| self.has_rows(first, rows.len()));
                if has_rows && compute(number, &mut block) {
                    self.add(of_nodes, &block);
                }
            }
        }
    }

    /// Returns true if one of three rows of this length is here, given a position in the first one.
    #[inline(always)]
    fn has_rows(&self, position: u32, len: usize) -> bool {
        let position = (position as usize).wrapping_sub(self.start);
        (0..3).any(|i| position.wrapping_add(i * len) < self.values.len())
    }

    /// Adds the entries of a block that are in these rows; drops the others.
    #[inline(always)]
    fn add(&mut self, of_nodes: NodeBlock<'_>, block: &[T]) {
        if of_nodes.rows.iter().any(|rows| rows.is_partly_free()) {
            return self.add_partly_free(of_nodes, block);
        }
        // Loops of constant length for the most frequent elements.
        match of_nodes.rows.len() {
            4 => self.add_free::<4>(of_nodes, block),
            8 => self.add_free::<8>(of_nodes, block),
            10 => self.add_free::<10>(of_nodes, block),
            _ => self.add_free::<0>(of_nodes, block),
        }
    }

    /// Adds the entries of a block of which each node has three free unknowns or none. `N` is the number of nodes, or 0
    /// for any number.
    #[inline(always)]
    fn add_free<const N: usize>(&mut self, of_nodes: NodeBlock<'_>, block: &[T]) {
        let nodes = if N == 0 { of_nodes.rows.len() } else { N };
        let of_row_nodes = of_nodes.rows.iter().zip(of_nodes.first.chunks_exact(nodes));
        for (a, ((rows, first), block)) in of_row_nodes.zip(block.chunks_exact(9 * nodes)).enumerate() {
            if !self.has_rows(first[a], rows.len()) {
                continue;
            }
            for (i, block) in block.chunks_exact(3 * nodes).enumerate() {
                let moved = (i * rows.len()).wrapping_sub(self.start);
                for (&first, block) in first.iter().zip(block.as_chunks::<3>().0) {
                    // A position of other rows, also one before these, is beyond the end.
                    let values = self.values.get_mut((first as usize).wrapping_add(moved)..);
                    if let Some([x, y, z]) = values.and_then(|values| values.first_chunk_mut::<3>()) {
                        *x += block[0];
                        *y += block[1];
                        *z += block[2];
                    }
                }
            }
        }
    }

    /// Adds the entries of a block of which some nodes have one or two free unknowns.
    #[inline(never)]
    fn add_partly_free(&mut self, of_nodes: NodeBlock<'_>, block: &[T]) {
        let nodes = of_nodes.rows.len();
        let of_row_nodes = of_nodes.rows.iter().zip(of_nodes.first.chunks_exact(nodes));
        for ((rows, first), block) in of_row_nodes.zip(block.chunks_exact(9 * nodes)) {
            let free_rows = block.chunks_exact(3 * nodes).enumerate().filter(|&(i, _)| rows.is_free(i));
            for (rank, (_, block)) in free_rows.enumerate() {
                let moved = (rank * rows.len()).wrapping_sub(self.start);
                for ((&first, columns), block) in first.iter().zip(of_nodes.rows).zip(block.as_chunks::<3>().0) {
                    let free = block.iter().enumerate().filter(|&(k, _)| columns.is_free(k));
                    let position = (first as usize).wrapping_add(moved);
                    for (rank, (_, &value)) in free.enumerate() {
                        if let Some(entry) = self.values.get_mut(position.wrapping_add(rank)) {
                            *entry += value;
                        }
                    }
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use super::*;
    use crate::las::conformance::Random;

    const NODES: usize = 400;
    const ELEMENTS: usize = 5000;

    /// Elements of four nodes near each other by number, or anywhere. Node `k` has the unknowns of the components in
    /// `is_free(k)`. Returns their pattern and the unknowns of all elements.
    fn elements(is_near: bool, is_free: impl Fn(usize, usize) -> bool) -> (Arc<Sparsity>, Vec<i32>) {
        let (mut random, mut unknowns) = (Random::new(7), 0);
        let numbers: Vec<[i32; 3]> = (0..NODES)
            .map(|node| {
                std::array::from_fn(|i| {
                    let number = if is_free(node, i) { unknowns } else { -1 };
                    unknowns += i32::from(number >= 0);
                    number
                })
            })
            .collect();
        let mut element = |k: usize| -> [[i32; 3]; 4] {
            let first = k * (NODES - 8) / ELEMENTS;
            std::array::from_fn(|_| numbers[if is_near { first + random.below(8) } else { random.below(NODES) }])
        };
        let rows: Vec<i32> = (0..ELEMENTS).flat_map(|k| element(k).as_flattened().to_vec()).collect();
        let pattern = Sparsity::from_elements(unknowns as usize, rows.chunks(12)).unwrap();
        (Arc::new(pattern), rows)
    }

    /// Writes a block whose sums depend on their order; every tenth block adds nothing.
    fn compute(number: usize, block: &mut [f64]) -> bool {
        let mut random = Random::new(number as u64);
        block.iter_mut().for_each(|value| *value = random.signed());
        !number.is_multiple_of(10)
    }

    fn the_sums_are_those_of_one_thread(is_near: bool, is_free: impl Fn(usize, usize) -> bool) {
        let (pattern, rows) = elements(is_near, is_free);
        let mut expected = Matrix::<f64>::zeros(&pattern);
        let mut block = [0.0; 144];
        for (number, rows) in rows.chunks_exact(12).enumerate() {
            if compute(number, &mut block) {
                let mut slots = Vec::new();
                expected.positions(rows, rows, &mut slots);
                expected.add_at_positions(&slots, &block);
            }
        }
        let positions = NodePositions::new(&pattern, 12, &rows).unwrap();
        for threads in [1, 2, 3, 5, 64] {
            let computations = computations(&positions, &cuts(&pattern, threads));
            assert_eq!(computations <= MOST_COMPUTATIONS, is_near && threads <= 5 || threads == 1, "{computations}");
            let mut found = Matrix::<f64>::zeros(&pattern);
            found.add_node_blocks(&positions, threads, compute);
            assert!(found.values() == expected.values(), "{threads} threads");
        }
    }

    #[test]
    fn entries_sum_in_the_order_of_the_blocks_whatever_the_threads() {
        for is_near in [true, false] {
            the_sums_are_those_of_one_thread(is_near, |_, _| true);
            // Fixed nodes, and nodes on rollers in several directions.
            the_sums_are_those_of_one_thread(is_near, |node, i| node % 7 > 0 && (node % 5 > 0 || i != node % 3));
            the_sums_are_those_of_one_thread(is_near, |node, i| node % 3 > 0 || i == 1);
        }
    }

    #[test]
    fn blocks_that_are_not_of_nodes_are_located_entry_by_entry() {
        let pattern = Sparsity::from_elements(6, [[0, 1, 2, 3, 4, 5]]).unwrap();
        let is_of_nodes = |indices: &[i32]| NodePositions::new(&pattern, 6, indices).is_some();
        assert!(is_of_nodes(&[0, 1, 2, 3, 4, 5]) && is_of_nodes(&[-1, 1, 2, 0, -1, -1]));
        assert!(!is_of_nodes(&[0, 2, 1, 3, 4, 5]) && !is_of_nodes(&[0, -1, 2, 3, 4, 5]));
        // Rows of one node with different columns, and an entry outside the pattern.
        let pattern = Sparsity::from_elements(6, [[0, 1, 2], [3, 4, 5]]).unwrap();
        assert!(NodePositions::new(&pattern, 3, &[0, 1, 2, 3, 4, 5]).is_some());
        assert!(NodePositions::new(&pattern, 3, &[1, 2, 3]).is_none());
        assert!(NodePositions::new(&pattern, 6, &[0, 1, 2, 3, 4, 5]).is_none());
    }
}
