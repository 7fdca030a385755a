//! Sums over elements at their nodes, on all threads, in an order that does not depend on their number.
//!
//! Elements are summed in chunks of a fixed size, each into an array of its own with one entry per node of the chunk.
//! Then the arrays are added to the nodes of the mesh in the order of the chunks.

use std::ops::Range;

use crate::parallel;

/// The number of elements of a chunk. Their nodes are numbered in 16 bits: 27 nodes of 2048 elements are fewer.
pub const ELEMENTS_PER_CHUNK: usize = 2048;

/// The number of nodes of the mesh to which one thread adds arrays at a time.
const NODES_PER_CHUNK: usize = 8192;

/// Consecutive elements of a block with `N` nodes each.
#[derive(Clone, Debug)]
pub struct ElementChunk<const N: usize> {
    /// The numbers of the elements in the block.
    elements: Range<usize>,
    /// The nodes of the elements, ascending.
    nodes: Vec<u32>,
    /// The nodes of each element, as positions in `nodes`.
    local: Vec<[u16; N]>,
}

impl<const N: usize> ElementChunk<N> {
    /// Divides the elements of a block, given by their nodes, into chunks.
    pub fn all(elements: &[[u32; N]]) -> Vec<Self> {
        let starts = (0..elements.len()).step_by(ELEMENTS_PER_CHUNK);
        parallel::map(starts.zip(elements.chunks(ELEMENTS_PER_CHUNK)), |(start, of_elements)| {
            let mut nodes = of_elements.as_flattened().to_vec();
            nodes.sort_unstable();
            nodes.dedup();
            let position = |node: u32| nodes.partition_point(|&other| other < node) as u16;
            let local = of_elements.iter().map(|nodes| nodes.map(position)).collect();
            Self { elements: start..start + of_elements.len(), nodes, local }
        })
    }

    /// Adds the array of this chunk to the sums of consecutive nodes of the mesh, the first of which is `start`.
    fn add_to(&self, sums: &mut [[f64; 3]], start: usize, part: &[[f64; 3]]) {
        let position = |node: usize| self.nodes.partition_point(|&other| (other as usize) < node);
        let range = position(start)..position(start + sums.len());
        for (&node, part) in self.nodes[range.clone()].iter().zip(&part[range]) {
            for (sum, part) in sums[node as usize - start].iter_mut().zip(part) {
                *sum += part;
            }
        }
    }
}

/// Adds to `sums`, which has one entry per node of the mesh, what `add` adds for each element. It gets the number of
/// the element in its block, the array of the chunk, and the positions of the nodes of the element in this array.
/// Returns the sum of its results over each chunk.
pub fn add<const N: usize>(
    chunks: &[ElementChunk<N>],
    sums: &mut [[f64; 3]],
    add: impl Fn(usize, &mut [[f64; 3]], &[u16; N]) -> f64 + Sync + Send,
) -> Vec<f64> {
    let sum = |chunk: &ElementChunk<N>| -> (Vec<[f64; 3]>, f64) {
        let mut part = vec![[0.0; 3]; chunk.nodes.len()];
        let elements = chunk.elements.clone().zip(&chunk.local);
        let total = elements.map(|(element, nodes)| add(element, &mut part, nodes)).sum();
        (part, total)
    };
    if chunks.len() <= 1 || parallel::threads() == 1 {
        let of_chunk = |chunk: &ElementChunk<N>| {
            let (part, total) = sum(chunk);
            chunk.add_to(sums, 0, &part);
            total
        };
        return chunks.iter().map(of_chunk).collect();
    }
    let parts = parallel::map(chunks, sum);
    let starts = (0..sums.len()).step_by(NODES_PER_CHUNK);
    parallel::map(starts.zip(sums.chunks_mut(NODES_PER_CHUNK)), |(start, sums)| {
        for (chunk, (part, _)) in chunks.iter().zip(&parts) {
            chunk.add_to(sums, start, part);
        }
    });
    parts.into_iter().map(|(_, total)| total).collect()
}

/// Adds the values of an element at the positions of its nodes.
#[inline(always)]
pub fn scatter<const N: usize>(sums: &mut [[f64; 3]], nodes: &[u16; N], values: [[f64; 3]; N]) {
    for (&node, value) in nodes.iter().zip(values) {
        for (sum, value) in sums[node as usize].iter_mut().zip(value) {
            *sum += value;
        }
    }
}
