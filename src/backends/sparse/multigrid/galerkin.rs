//! The coarse matrix `P^T A P`.

use super::blocks::{BlockMatrix, vectorized, with_sizes};
use super::prolongation::add_product;
use crate::parallel;

/// The least number of coarse rows of a task. Tasks repeat the products of fine rows that belong to several of them.
const LEAST_ROWS: usize = 16;

/// The number of coarse rows whose pattern a task computes.
const ROWS_PER_TASK: usize = 1024;

/// Returns zeros in the pattern of `P^T A P`. `r` has the pattern of `P^T`.
pub(super) fn zeros<T: Sync>(a: &BlockMatrix<f64>, p: &BlockMatrix<f64>, r: &BlockMatrix<T>) -> BlockMatrix<f64> {
    let (offsets, columns) = pattern(a, p, r);
    BlockMatrix::zeros((p.size.1, p.size.1), p.cols, offsets, columns)
}

/// Computes `P^T A P` in a matrix of its pattern.
///
/// Tasks own ranges of coarse rows. Each goes through the fine rows that contribute to its range, in ascending order, so
/// that the sums do not depend on the number of tasks.
pub(super) fn compute(a: &BlockMatrix<f64>, p: &BlockMatrix<f64>, coarse: &mut BlockMatrix<f64>) {
    let k = p.size.1;
    let tasks = parallel::threads().min(coarse.rows() / LEAST_ROWS).max(1);
    let ends = balanced(&coarse.offsets, tasks);
    let BlockMatrix { offsets, columns, values, .. } = coarse;
    let (offsets, columns) = (&*offsets, &*columns);
    let mut parts = Vec::with_capacity(tasks);
    let mut rest = values.as_mut_slice();
    for pair in ends.windows(2) {
        let len = (offsets[pair[1]] - offsets[pair[0]]) as usize * k * k;
        let (part, others) = rest.split_at_mut(len);
        parts.push((pair[0]..pair[1], part));
        rest = others;
    }
    parallel::map(parts, |(rows, values)| {
        let pattern = CoarseRows { rows, offsets, columns };
        values.fill(0.0);
        with_sizes!(a.size.0, k, S, K => {
            let blocks: &mut [[[f64; K]; K]] = bytemuck::cast_slice_mut(values);
            vectorized(#[inline(always)] || add_rows::<S, K>(a, p, &pattern, blocks));
        });
    });
}

/// Divides rows into `parts` ranges with about the same number of blocks; returns their limits.
fn balanced(offsets: &[u32], parts: usize) -> Vec<usize> {
    let blocks = offsets.last().map_or(0, |&blocks| blocks as usize);
    let limit = |part: usize| offsets.partition_point(|&offset| (offset as usize) < part * blocks / parts);
    let mut limits: Vec<usize> = (0..=parts).map(limit).collect();
    limits[parts] = offsets.len() - 1;
    limits
}

/// The pattern of a range of coarse rows.
struct CoarseRows<'a> {
    rows: std::ops::Range<usize>,
    offsets: &'a [u32],
    columns: &'a [u32],
}

#[inline(always)]
fn add_rows<const S: usize, const K: usize>(
    a: &BlockMatrix<f64>,
    p: &BlockMatrix<f64>,
    coarse: &CoarseRows<'_>,
    blocks: &mut [[[f64; K]; K]],
) {
    let (a_blocks, p_blocks) = (a.blocks::<S, S>(), p.blocks::<S, K>());
    let first_block = coarse.offsets[coarse.rows.start] as usize;
    // The row of `A P`: its columns, its blocks, and the position of each column.
    let (mut columns, mut products): (Vec<u32>, Vec<[[f64; S]; K]>) = (Vec::new(), Vec::new());
    let mut position = vec![u32::MAX; p.cols];
    for row in 0..a.rows() {
        let of_range = |&at: &usize| coarse.rows.contains(&(p.columns[at] as usize));
        if !p.range(row).any(|at| of_range(&at)) {
            continue;
        }
        for at in a.range(row) {
            for k in p.range(a.columns[at] as usize) {
                let slot = &mut position[p.columns[k] as usize];
                if *slot == u32::MAX {
                    *slot = columns.len() as u32;
                    columns.push(p.columns[k]);
                    products.push([[0.0; S]; K]);
                }
                add_product(&a_blocks[at], &p_blocks[k], &mut products[*slot as usize]);
            }
        }
        for at in p.range(row).filter(of_range) {
            let coarse_row = p.columns[at] as usize;
            let range = coarse.offsets[coarse_row] as usize..coarse.offsets[coarse_row + 1] as usize;
            let transpose = transposed(&p_blocks[at]);
            for k in range {
                if let Some(product) = products.get(position[coarse.columns[k] as usize] as usize) {
                    add_product(&transpose, product, &mut blocks[k - first_block]);
                }
            }
        }
        columns.iter().for_each(|&column| position[column as usize] = u32::MAX);
        columns.clear();
        products.clear();
    }
}

/// Returns the transpose of a block stored by columns.
#[inline(always)]
fn transposed<const M: usize, const R: usize>(a: &[[f64; M]; R]) -> [[f64; R]; M] {
    let mut transpose = [[0.0; R]; M];
    for i in 0..M {
        for j in 0..R {
            transpose[i][j] = a[j][i];
        }
    }
    transpose
}

/// Returns the pattern of `P^T A P`.
fn pattern<T: Sync>(a: &BlockMatrix<f64>, p: &BlockMatrix<f64>, r: &BlockMatrix<T>) -> (Vec<u32>, Vec<u32>) {
    let of_row = |marks: &mut Vec<u32>, row: usize| -> Vec<u32> {
        marks.resize(p.cols, u32::MAX);
        let mut columns = Vec::new();
        for &fine in &r.columns[r.range(row)] {
            for &neighbor in &a.columns[a.range(fine as usize)] {
                for &column in &p.columns[p.range(neighbor as usize)] {
                    if marks[column as usize] != row as u32 {
                        marks[column as usize] = row as u32;
                        columns.push(column);
                    }
                }
            }
        }
        columns.sort_unstable();
        columns
    };
    let of_chunk = |first: usize| -> Vec<Vec<u32>> {
        let mut marks = Vec::new();
        (first..p.cols.min(first + ROWS_PER_TASK)).map(|row| of_row(&mut marks, row)).collect()
    };
    let rows = parallel::map((0..p.cols).step_by(ROWS_PER_TASK), of_chunk).concat();
    let mut offsets = vec![0];
    offsets.extend(rows.iter().scan(0, |sum, row| {
        *sum += row.len() as u32;
        Some(*sum)
    }));
    (offsets, rows.concat())
}
