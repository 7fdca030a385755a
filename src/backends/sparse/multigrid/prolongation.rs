//! The prolongation: the near null space restricted to the aggregates, smoothed by one step of the Jacobi method
//! (Vanek, Mandel and Brezina 1996).

use super::aggregation::{Aggregates, NONE};
use super::blocks::{BlockMatrix, compressed_rows, vectorized, with_sizes};
use crate::parallel;

/// The number of aggregates whose near null space a task orthonormalizes.
const AGGREGATES_PER_TASK: usize = 64;

/// Columns whose norm after orthogonalization is below this fraction of the norm before depend on the others.
const DEPENDENT: f64 = 1e-9;

/// Vectors on which a matrix is almost zero: for each node, `vectors` columns of one number per unknown.
pub(super) struct NodeModes {
    /// Number of vectors, padded to a block size.
    pub vectors: usize,
    /// Number of unknowns per node.
    pub size: usize,
    /// The values, at `(node * vectors + vector) * size + unknown`.
    pub values: Vec<f64>,
}

impl NodeModes {
    fn of_node(&self, node: usize) -> &[f64] {
        let len = self.vectors * self.size;
        &self.values[node * len..(node + 1) * len]
    }
}

/// The tentative prolongation, of one block per node.
pub(super) struct Tentative {
    /// Number of columns of a block.
    pub vectors: usize,
    /// The blocks, by columns: one row per unknown of the node and `vectors` columns.
    blocks: Vec<f64>,
}

/// The nodes of an aggregate, each with the number of the aggregate before it.
type Group<'a> = &'a [(u32, u32)];

/// Orthonormalizes the near null space on each aggregate: `B = Q R` gives the tentative prolongation `Q` and the near
/// null space `R` of the coarse matrix. Columns that depend on previous ones, as rotations of a single node do, are zero
/// in both.
pub(super) fn tentative(aggregates: &Aggregates, modes: &NodeModes) -> (Tentative, NodeModes) {
    let (size, k) = (modes.size, modes.vectors);
    let mut members: Vec<(u32, u32)> =
        aggregates.of_node.iter().zip(0..).filter(|(of, _)| **of != NONE).map(|(&of, node)| (of, node)).collect();
    members.sort_unstable();
    let groups: Vec<Group<'_>> = members.chunk_by(|one, other| one.0 == other.0).collect();
    let of_task = |(groups, factors): (&[Group<'_>], &mut [f64])| {
        let mut columns: Vec<Vec<f64>> = vec![Vec::new(); k];
        let mut blocks = Vec::new();
        for (group, factor) in groups.iter().zip(factors.chunks_exact_mut(k * k)) {
            for (j, column) in columns.iter_mut().enumerate() {
                column.clear();
                for &(_, node) in *group {
                    column.extend_from_slice(&modes.of_node(node as usize)[j * size..(j + 1) * size]);
                }
            }
            orthonormalize(&mut columns, factor);
            for position in 0..group.len() {
                columns.iter().for_each(|column| blocks.extend_from_slice(&column[position * size..][..size]));
            }
        }
        blocks
    };
    // Every aggregate has members.
    let mut coarse = vec![0.0; aggregates.count * k * k];
    let factors = coarse.chunks_mut(AGGREGATES_PER_TASK * k * k);
    let of_members = parallel::map(groups.chunks(AGGREGATES_PER_TASK).zip(factors), of_task);
    let mut blocks = parallel::filled(0.0, modes.values.len());
    for (&(_, node), block) in members.iter().zip(of_members.iter().flat_map(|of| of.chunks_exact(k * size))) {
        blocks[node as usize * k * size..][..k * size].copy_from_slice(block);
    }
    (Tentative { vectors: k, blocks }, NodeModes { vectors: k, size: k, values: coarse })
}

/// Orthonormalizes columns by the modified Gram-Schmidt method, twice, and writes the triangular factor by columns.
fn orthonormalize(columns: &mut [Vec<f64>], factor: &mut [f64]) {
    let k = columns.len();
    for j in 0..k {
        let (done, rest) = columns.split_at_mut(j);
        let column = &mut rest[0];
        let before = norm(column);
        for _ in 0..2 {
            for (i, q) in done.iter().enumerate() {
                let product: f64 = q.iter().zip(&*column).map(|(q, v)| q * v).sum();
                column.iter_mut().zip(q).for_each(|(v, q)| *v -= product * q);
                factor[j * k + i] += product;
            }
        }
        let after = norm(column);
        let scale = if after > DEPENDENT * before { 1.0 / after } else { 0.0 };
        column.iter_mut().for_each(|v| *v *= scale);
        factor[j * k + j] = if scale > 0.0 { after } else { 0.0 };
    }
}

fn norm(values: &[f64]) -> f64 {
    values.iter().map(|v| v * v).sum::<f64>().sqrt()
}

/// The smoothed prolongation `P = (I - omega D^-1 A) Q` of a tentative one, `Q`.
///
/// Couplings of a row that are small compared with its diagonal block are added to that block instead, so that they
/// cause no fill.
pub(super) struct Prolongation {
    pub p: BlockMatrix<f64>,
    /// Whether each block of the matrix is used as it is.
    keeps: Vec<bool>,
}

impl Prolongation {
    /// Finds the pattern of the prolongation; its numbers come from [`Prolongation::smooth`], in the memory of `values`.
    pub fn new(
        a: &BlockMatrix<f64>,
        aggregates: &Aggregates,
        vectors: usize,
        drop_below: f64,
        values: Vec<f64>,
    ) -> Self {
        let keeps = kept_blocks(a, drop_below);
        let (offsets, columns) = pattern(a, aggregates, &keeps);
        let size = (a.size.0, vectors);
        Self { p: BlockMatrix::in_memory_of(values, size, aggregates.count, offsets, columns), keeps }
    }

    /// Computes the numbers from the inverse diagonal blocks `D^-1` of the matrix.
    pub fn smooth(
        &mut self,
        a: &BlockMatrix<f64>,
        inverse: &[f64],
        aggregates: &Aggregates,
        tentative: &Tentative,
        omega: f64,
    ) {
        let Self { p, keeps } = self;
        with_sizes!(p.size.0, p.size.1, S, K => {
            let fill = Fill::<'_, S, K> {
                a,
                inverse: bytemuck::cast_slice(inverse),
                aggregates,
                tentative: bytemuck::cast_slice(&tentative.blocks),
                keeps,
                omega,
            };
            let BlockMatrix { offsets, columns, values, .. } = p;
            super::for_each_row(offsets, S * K, values, |row, values| {
                let range = offsets[row] as usize..offsets[row + 1] as usize;
                values.fill(0.0);
                let blocks: &mut [[[f64; S]; K]] = bytemuck::cast_slice_mut(values);
                vectorized(#[inline(always)] || fill.row(row, &columns[range], blocks));
            });
        });
    }
}

/// Returns for each block whether the smoother of the prolongation uses it as it is.
fn kept_blocks(a: &BlockMatrix<f64>, drop_below: f64) -> Vec<bool> {
    let len = a.size.0 * a.size.1;
    let norm = |at: usize| a.values[at * len..(at + 1) * len].iter().map(|v| v * v).sum::<f64>();
    let mut keeps = parallel::filled(true, a.columns.len());
    super::for_each_row(&a.offsets, 1, &mut keeps, |row, keeps| {
        let diagonal = a.range(row).find(|&at| a.columns[at] as usize == row).map_or(0.0, norm);
        for (at, keeps) in a.range(row).zip(keeps) {
            *keeps = a.columns[at] as usize == row || norm(at) > drop_below * drop_below * diagonal;
        }
    });
    keeps
}

/// Returns the pattern of the smoothed prolongation: each node couples to the aggregates of its neighbors.
fn pattern(a: &BlockMatrix<f64>, aggregates: &Aggregates, keeps: &[bool]) -> (Vec<u32>, Vec<u32>) {
    compressed_rows(a.rows(), |found: &mut Vec<u32>, row, columns| {
        found.clear();
        if aggregates.of_node[row] != NONE {
            let kept = a.range(row).filter(|&at| keeps[at]);
            found.extend(kept.map(|at| aggregates.of_node[a.columns[at] as usize]).filter(|&of| of != NONE));
        }
        found.sort_unstable();
        found.dedup();
        columns.extend_from_slice(found);
    })
}

/// The inputs of a row of the smoothed prolongation.
struct Fill<'a, const S: usize, const K: usize> {
    a: &'a BlockMatrix<f64>,
    inverse: &'a [[[f64; S]; S]],
    aggregates: &'a Aggregates,
    tentative: &'a [[[f64; S]; K]],
    keeps: &'a [bool],
    omega: f64,
}

impl<const S: usize, const K: usize> Fill<'_, S, K> {
    #[inline(always)]
    fn row(&self, row: usize, columns: &[u32], p: &mut [[[f64; S]; K]]) {
        let blocks = self.a.blocks::<S, S>();
        let own = self.aggregates.of_node[row];
        if own == NONE {
            return;
        }
        for at in self.a.range(row) {
            let neighbor = self.a.columns[at] as usize;
            let (aggregate, q) = if self.keeps[at] {
                (self.aggregates.of_node[neighbor], &self.tentative[neighbor])
            } else {
                (own, &self.tentative[row])
            };
            if let Ok(position) = columns.binary_search(&aggregate) {
                add_product(&blocks[at], q, &mut p[position]);
            }
        }
        for k in 0..p.len() {
            let mut scaled = [[0.0; S]; K];
            add_product(&self.inverse[row], &p[k], &mut scaled);
            let is_own = columns[k] == own;
            for j in 0..K {
                for i in 0..S {
                    let q = if is_own { self.tentative[row][j][i] } else { 0.0 };
                    p[k][j][i] = q - self.omega * scaled[j][i];
                }
            }
        }
    }
}

/// Adds `A B` to `sum`, all stored by columns.
#[inline(always)]
pub(super) fn add_product<const R: usize, const M: usize, const C: usize>(
    a: &[[f64; R]; M],
    b: &[[f64; M]; C],
    sum: &mut [[f64; R]; C],
) {
    for j in 0..C {
        for k in 0..M {
            for i in 0..R {
                sum[j][i] += a[k][i] * b[j][k];
            }
        }
    }
}
