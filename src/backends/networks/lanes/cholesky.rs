//! Cholesky factorizations of matrices of 3x3 blocks with one pattern, one in each lane.

use std::marker::PhantomData;
use std::sync::Arc;

#[cfg(target_arch = "x86_64")]
use pulp::x86::{V3, V4};

use super::factor::{Factor, Full};
#[cfg(any(test, not(target_arch = "x86_64")))]
use super::portable::Portable;
use super::simd::{Double, numbers_of, numbers_of_mut};
use super::triangular::SolveBoth;
use super::{Level, tile_of};
use crate::backends::networks::Schedule;
use crate::las::Sparsity;

/// The unknowns of a node.
const BLOCK: usize = 3;

/// The pivots of a lane.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(in crate::backends) struct LanePivots {
    /// Whether all are positive and finite.
    pub are_positive: bool,
    pub smallest: f64,
    pub largest: f64,
}

/// The operations of the factorizations of all matrices with one pattern.
pub(in crate::backends) struct LaneAnalysis {
    level: Level,
    schedule: Schedule,
    blocks: Blocks,
}

impl LaneAnalysis {
    /// Prepares factorizations in this number of lanes, which eliminate the unknowns in this order. `None` if this
    /// machine does not have registers of so many lanes, or if the pattern, which is symmetric, does not consist of 3x3
    /// blocks that `order` eliminates one after the other.
    pub fn new(lanes: usize, pattern: &Sparsity, order: &[u32]) -> Option<Self> {
        let level = Level::all().into_iter().rfind(|level| level.lanes() == lanes)?;
        let blocks = Blocks::new(pattern, order)?;
        Some(Self { schedule: Schedule::new(blocks.order.len(), &blocks.edges, tile_of(level)), blocks, level })
    }
}

/// Factors symmetric matrices with one pattern in the lanes of the vector registers, and solves with the factors.
pub(in crate::backends) struct LaneCholesky {
    analysis: Arc<LaneAnalysis>,
    machine: Box<dyn Machine>,
}

impl LaneCholesky {
    /// Allocates the factors.
    pub fn new(analysis: &Arc<LaneAnalysis>) -> Self {
        let machine: Box<dyn Machine> = match analysis.level {
            #[cfg(any(test, not(target_arch = "x86_64")))]
            Level::Portable => Box::new(Factors::<_, 1>::new(Portable, analysis)),
            #[cfg(target_arch = "x86_64")]
            Level::Avx2(simd) => Box::new(Factors::<V3, 1>::new(simd, analysis)),
            #[cfg(target_arch = "x86_64")]
            Level::Avx512(simd) => Box::new(Factors::<V4, 2>::new(simd, analysis)),
        };
        Self { analysis: Arc::clone(analysis), machine }
    }

    /// Factors the matrices with these values, those of all lanes for each entry of the pattern; of a pair of entries
    /// `(i, j)` and `(j, i)`, it reads only one. Returns the pivots of each lane.
    pub fn factor(&mut self, values: &[f64]) -> Vec<LanePivots> {
        self.machine.factor(&self.analysis, values)
    }

    /// Solves with the factors: `b` and `x` have the numbers of all lanes for each unknown.
    pub fn solve(&mut self, b: &[f64], x: &mut [f64]) {
        self.machine.solve(&self.analysis, b, x);
    }
}

/// A matrix of 3x3 blocks in elimination order.
struct Blocks {
    /// By place in the order: the node.
    order: Vec<u32>,
    /// Pairs of places in the order that have a block, the earlier first.
    edges: Vec<[u32; 2]>,
    /// For each node, six indices of its diagonal block among the values of the matrix.
    of_diagonal: Vec<u32>,
    /// For each edge, nine indices of the block in the row of its later node.
    of_edges: Vec<u32>,
}

impl Blocks {
    fn new(pattern: &Sparsity, order: &[u32]) -> Option<Self> {
        let (nodes, []) = order.as_chunks::<BLOCK>() else { return None };
        let is_node = |&[a, b, c]: &[u32; BLOCK]| a.is_multiple_of(3) && b == a + 1 && c == a + 2;
        if order.len() != pattern.rows() || !nodes.iter().all(is_node) {
            return None;
        }
        let order: Vec<u32> = nodes.iter().map(|&[first, ..]| first / 3).collect();
        let mut place = vec![0_u32; order.len()];
        (0..).zip(&order).for_each(|(at, &node)| place[node as usize] = at);
        let mut blocks = Self { order, edges: Vec::new(), of_diagonal: Vec::new(), of_edges: Vec::new() };
        for (at, node) in (0_u32..).zip(blocks.order.clone()) {
            let rows = [0, 1, 2].map(|k| pattern.row(BLOCK * node as usize + k));
            let (columns, []) = rows[0].as_chunks::<BLOCK>() else { return None };
            if rows[1] != rows[0] || rows[2] != rows[0] || !columns.iter().all(is_node) {
                return None;
            }
            let start = [0, 1, 2].map(|k| pattern.row_offsets()[BLOCK * node as usize + k]);
            let mut has_diagonal = false;
            for (number, &[column, ..]) in (0_u32..).zip(columns) {
                let index = |row: usize, k: u32| start[row] + 3 * number + k;
                let other = place[column as usize / 3];
                if other == at {
                    has_diagonal = true;
                    blocks.of_diagonal.extend((0..BLOCK).flat_map(|row| (0..=row as u32).map(move |k| index(row, k))));
                } else if other < at {
                    blocks.edges.push([other, at]);
                    blocks.of_edges.extend((0..BLOCK).flat_map(|row| (0..3).map(move |k| index(row, k))));
                }
            }
            if !has_diagonal {
                return None;
            }
        }
        Some(blocks)
    }
}

/// The factors in the registers of some machine.
trait Machine: Send {
    fn factor(&mut self, analysis: &LaneAnalysis, values: &[f64]) -> Vec<LanePivots>;
    fn solve(&mut self, analysis: &LaneAnalysis, b: &[f64], x: &mut [f64]);
}

/// The matrices and their factors, as in [`Factor`].
struct Factors<S: Double, const C: usize> {
    simd: S,
    matrix_diagonal: Vec<S::Stored>,
    off_diagonal: Vec<S::Stored>,
    diagonal: Vec<S::Stored>,
    lower: Vec<S::Stored>,
    right: Vec<S::Stored>,
}

impl<S: Double, const C: usize> Factors<S, C> {
    fn new(simd: S, LaneAnalysis { schedule, blocks, .. }: &LaneAnalysis) -> Self {
        let (nodes, edges) = (blocks.order.len(), blocks.edges.len());
        let zeros = |len: usize| vec![bytemuck::Zeroable::zeroed(); len];
        Self {
            simd,
            matrix_diagonal: zeros(6 * nodes),
            off_diagonal: zeros(9 * edges),
            diagonal: zeros(6 * nodes),
            lower: zeros(9 * (schedule.blocks() + 1)),
            right: zeros(3 * nodes),
        }
    }
}

/// Copies the lanes of the entries at these indices.
fn gather<S: Double>(to: &mut [S::Stored], indices: &[u32], values: &[f64]) {
    for (to, &index) in numbers_of_mut::<S>(to).chunks_exact_mut(S::LANES).zip(indices) {
        to.copy_from_slice(&values[S::LANES * index as usize..][..S::LANES]);
    }
}

impl<S: Double, const C: usize> Machine for Factors<S, C> {
    fn factor(&mut self, LaneAnalysis { schedule, blocks, .. }: &LaneAnalysis, values: &[f64]) -> Vec<LanePivots> {
        gather::<S>(&mut self.matrix_diagonal, &blocks.of_diagonal, values);
        gather::<S>(&mut self.off_diagonal, &blocks.of_edges, values);
        numbers_of_mut::<S>(&mut self.right).fill(0.0);
        let pivots = self.simd.vectorize(Factor::<S, Full, C> {
            schedule,
            matrix_diagonal: &self.matrix_diagonal,
            off_diagonal: &self.off_diagonal,
            diagonal: &mut self.diagonal,
            lower: &mut self.lower,
            right: &mut self.right,
            stored: PhantomData,
        });
        let (positive, smallest, largest) =
            (pivots.positive.numbers(), pivots.smallest.numbers(), pivots.largest.numbers());
        let of_lane = |lane: usize| LanePivots {
            are_positive: positive[lane] != 0.0,
            smallest: smallest[lane],
            largest: largest[lane],
        };
        (0..S::LANES).map(of_lane).collect()
    }

    fn solve(&mut self, LaneAnalysis { schedule, blocks, .. }: &LaneAnalysis, b: &[f64], x: &mut [f64]) {
        let node = BLOCK * S::LANES;
        let right = numbers_of_mut::<S>(&mut self.right).chunks_exact_mut(node);
        for (right, &number) in right.zip(&blocks.order) {
            right.copy_from_slice(&b[node * number as usize..][..node]);
        }
        let Self { diagonal, lower, right, .. } = self;
        self.simd.vectorize(SolveBoth::<S, C> { schedule, diagonal, lower, right });
        for (right, &number) in numbers_of::<S>(&self.right).chunks_exact(node).zip(&blocks.order) {
            x[node * number as usize..][..node].copy_from_slice(right);
        }
    }
}
