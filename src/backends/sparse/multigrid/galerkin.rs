//! The coarse matrix `P^T A P`.

use std::ops::Range;

use super::blocks::{BlockMatrix, compressed_rows, vectorized, with_sizes};
use super::prolongation::add_product;
use crate::parallel;

/// The most fine rows whose products `A P` a task computes: their products stay in the cache of a core.
const ROWS_PER_TASK: usize = 128;

/// The least number of fine rows of a task, on coarse levels, whose rows have many and large blocks.
const LEAST_ROWS: usize = 16;

/// The least number of tasks of a batch with several threads, which share a cache. One thread adds the products of each task
/// at once.
const TASKS_PER_BATCH: usize = 32;

/// The number of tasks per thread among which the coarse rows of a batch are divided.
const PARTS_PER_THREAD: usize = 4;

/// The number of entries that a task sets to zero.
const ENTRIES_PER_TASK: usize = 1 << 16;

/// Returns a matrix in the pattern of `P^T A P` whose values are to be computed, in the memory of `values` if there is
/// enough. `r` has the pattern of `P^T`.
pub(super) fn with_pattern<T: Sync>(
    a: &BlockMatrix<f64>,
    p: &BlockMatrix<f64>,
    r: &BlockMatrix<T>,
    values: Vec<f64>,
) -> BlockMatrix<f64> {
    let (offsets, columns) = pattern(a, p, r);
    BlockMatrix::in_memory_of(values, (p.size.1, p.size.1), p.cols, offsets, columns)
}

/// Computes `P^T A P` in a matrix of its pattern.
///
/// The rows of `A P` are computed batch by batch, each row once, and then added to ranges of coarse rows, in ascending
/// order, so that the sums depend neither on the batches nor on the ranges.
pub(super) fn compute(a: &BlockMatrix<f64>, p: &BlockMatrix<f64>, coarse: &mut BlockMatrix<f64>) {
    parallel::map(coarse.values.chunks_mut(ENTRIES_PER_TASK), |values| values.fill(0.0));
    with_sizes!(a.size.0, p.size.1, S, K => compute_sized::<S, K>(a, p, coarse));
}

fn compute_sized<const S: usize, const K: usize>(
    a: &BlockMatrix<f64>,
    p: &BlockMatrix<f64>,
    coarse: &mut BlockMatrix<f64>,
) {
    let threads = parallel::threads();
    let (tasks, parts) =
        if threads == 1 { (1, 1) } else { (TASKS_PER_BATCH.max(2 * threads), PARTS_PER_THREAD * threads) };
    let of_task = (a.rows() / (PARTS_PER_THREAD * threads)).clamp(LEAST_ROWS, ROWS_PER_TASK);
    let mut products: Vec<Products<S, K>> = (0..tasks).map(|_| Products::default()).collect();
    let mut positions = vec![Vec::new(); parts];
    for first in (0..a.rows()).step_by(tasks * of_task) {
        let rows = (first..a.rows()).step_by(of_task).map(|first| first..a.rows().min(first + of_task));
        parallel::map(products.iter_mut().zip(rows.clone()), |(products, rows)| {
            vectorized(
                #[inline(always)]
                || products.compute(a, p, rows),
            );
        });
        let products = &products[..rows.take(tasks).count()];
        parallel::map(coarse_rows(p, products, coarse, &mut positions), |mut part| {
            vectorized(
                #[inline(always)]
                || products.iter().for_each(|products| part.add(p, products)),
            );
        });
    }
}

/// Consecutive rows of `A P`.
#[derive(Default)]
struct Products<const S: usize, const K: usize> {
    /// The fine rows.
    rows: Range<usize>,
    /// The end of each row in `columns` and `blocks`.
    ends: Vec<usize>,
    columns: Vec<u32>,
    blocks: Vec<[[f64; S]; K]>,
    /// The index in `blocks` of each column of the row at hand; of other columns, [`ABSENT`].
    position: Vec<u32>,
}

/// The position of a column that a row does not have.
const ABSENT: u32 = u32::MAX;

impl<const S: usize, const K: usize> Products<S, K> {
    #[inline(always)]
    fn compute(&mut self, a: &BlockMatrix<f64>, p: &BlockMatrix<f64>, rows: Range<usize>) {
        let (a_blocks, p_blocks) = (a.blocks::<S, S>(), p.blocks::<S, K>());
        self.ends.clear();
        self.columns.clear();
        self.blocks.clear();
        self.position.resize(p.cols, ABSENT);
        for row in rows.clone() {
            let begin = self.columns.len();
            // Rows without a coarse unknown contribute nothing.
            let neighbors = if p.range(row).is_empty() { 0..0 } else { a.range(row) };
            for at in neighbors {
                for k in p.range(a.columns[at] as usize) {
                    let slot = &mut self.position[p.columns[k] as usize];
                    if *slot == ABSENT {
                        *slot = self.columns.len() as u32;
                        self.columns.push(p.columns[k]);
                        self.blocks.push([[0.0; S]; K]);
                    }
                    add_product(&a_blocks[at], &p_blocks[k], &mut self.blocks[*slot as usize]);
                }
            }
            self.columns[begin..].iter().for_each(|&column| self.position[column as usize] = ABSENT);
            self.ends.push(self.columns.len());
        }
        self.rows = rows;
    }
}

/// A range of coarse rows.
struct CoarseRows<'a, const K: usize> {
    rows: Range<usize>,
    offsets: &'a [u32],
    columns: &'a [u32],
    /// The blocks of these rows.
    blocks: &'a mut [[[f64; K]; K]],
    /// The index of each column in the blocks of a row of products; [`ABSENT`] between two rows.
    position: &'a mut Vec<u32>,
}

impl<const K: usize> CoarseRows<'_, K> {
    /// Adds the contributions of fine rows.
    #[inline(always)]
    fn add<const S: usize>(&mut self, p: &BlockMatrix<f64>, products: &Products<S, K>) {
        let p_blocks = p.blocks::<S, K>();
        let first_block = self.offsets[self.rows.start] as usize;
        self.position.resize(p.cols, ABSENT);
        let mut begin = 0;
        for (row, &end) in products.rows.clone().zip(&products.ends) {
            let of_row = std::mem::replace(&mut begin, end)..end;
            let of_range = |&at: &usize| self.rows.contains(&(p.columns[at] as usize));
            if !p.range(row).any(|at| of_range(&at)) {
                continue;
            }
            for at in of_row.clone() {
                self.position[products.columns[at] as usize] = at as u32;
            }
            for at in p.range(row).filter(of_range) {
                let coarse_row = p.columns[at] as usize;
                let range = self.offsets[coarse_row] as usize..self.offsets[coarse_row + 1] as usize;
                let transpose = transposed(&p_blocks[at]);
                for k in range {
                    if let Some(product) = products.blocks.get(self.position[self.columns[k] as usize] as usize) {
                        add_product(&transpose, product, &mut self.blocks[k - first_block]);
                    }
                }
            }
            products.columns[of_row].iter().for_each(|&column| self.position[column as usize] = ABSENT);
        }
    }
}

/// Divides the coarse rows from the first to the last one to which fine rows contribute into ranges with about the same number
/// of blocks, one for each memory of positions at most.
fn coarse_rows<'a, const S: usize, const K: usize>(
    p: &BlockMatrix<f64>,
    products: &[Products<S, K>],
    coarse: &'a mut BlockMatrix<f64>,
    positions: &'a mut [Vec<u32>],
) -> Vec<CoarseRows<'a, K>> {
    let BlockMatrix { offsets, columns, values, .. } = coarse;
    let (offsets, columns): (&[u32], &[u32]) = (offsets, columns);
    let fine = products.first().map_or(0, |first| first.rows.start)..products.last().map_or(0, |last| last.rows.end);
    let targets = &p.columns[p.offsets[fine.start] as usize..p.offsets[fine.end] as usize];
    let (Some(&first), Some(&last)) = (targets.iter().min(), targets.iter().max()) else { return Vec::new() };
    let ends = balanced(offsets, first as usize..last as usize + 1, positions.len());
    let blocks: &mut [[[f64; K]; K]] = bytemuck::cast_slice_mut(values);
    let blocks = &mut blocks[offsets[first as usize] as usize..offsets[last as usize + 1] as usize];
    let lengths = ends.windows(2).map(|ends| (offsets[ends[1]] - offsets[ends[0]]) as usize);
    let ranges = ends.windows(2).map(|ends| ends[0]..ends[1]).zip(parallel::split(blocks, lengths));
    let ranges = ranges.zip(positions).filter(|((rows, _), _)| !rows.is_empty());
    ranges.map(|((rows, blocks), position)| CoarseRows { rows, offsets, columns, blocks, position }).collect()
}

/// Divides rows into `parts` ranges with about the same number of blocks; returns their limits.
fn balanced(offsets: &[u32], rows: Range<usize>, parts: usize) -> Vec<usize> {
    let (begin, end) = (offsets[rows.start] as usize, offsets[rows.end] as usize);
    let limit = |part: usize| {
        let blocks = begin + part * (end - begin) / parts;
        offsets.partition_point(|&offset| (offset as usize) < blocks).clamp(rows.start, rows.end)
    };
    let mut limits: Vec<usize> = (0..=parts).map(limit).collect();
    limits[parts] = rows.end;
    limits
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
    compressed_rows(p.cols, |marks: &mut Vec<u32>, row, columns| {
        marks.resize(p.cols, u32::MAX);
        let begin = columns.len();
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
        columns[begin..].sort_unstable();
    })
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeMap;

    use super::*;
    use crate::las::splitmix64;
    use crate::parallel::tests::on_pools;

    /// Returns a matrix of blocks with these columns in each row and random entries.
    fn random(
        size: (usize, usize),
        rows: usize,
        cols: usize,
        row: impl Fn(usize) -> Vec<usize> + Sync + Send,
    ) -> BlockMatrix<f64> {
        let (offsets, columns) = compressed_rows(rows, |(): &mut (), number, columns| {
            let mut of_row: Vec<u32> = row(number).into_iter().map(|column| column as u32).collect();
            of_row.sort_unstable();
            of_row.dedup();
            columns.extend(of_row);
        });
        let mut matrix = BlockMatrix::zeros(size, cols, offsets, columns);
        let mut state = 5;
        matrix.values.iter_mut().for_each(|value| *value = splitmix64(&mut state) as f64 / u64::MAX as f64 - 0.5);
        matrix
    }

    /// Adds the entries of `A B`, by row and column.
    fn product(a: &BTreeMap<(usize, usize), f64>, b: &BTreeMap<(usize, usize), f64>) -> BTreeMap<(usize, usize), f64> {
        let mut sum = BTreeMap::new();
        for (&(row, k), x) in a {
            for (&(_, column), y) in b.range((k, 0)..(k + 1, 0)) {
                *sum.entry((row, column)).or_insert(0.0) += x * y;
            }
        }
        sum
    }

    fn entries(a: &BlockMatrix<f64>, transposed: bool) -> BTreeMap<(usize, usize), f64> {
        let (r, c) = a.size;
        let blocks = (0..a.rows()).flat_map(|row| a.range(row).map(move |at| (row, at)));
        let of_block = |(row, at): (usize, usize)| {
            let column = a.columns[at] as usize;
            (0..r * c).map(move |k| {
                let place = (row * r + k % r, column * c + k / r);
                (if transposed { (place.1, place.0) } else { place }, a.values[at * r * c + k])
            })
        };
        blocks.flat_map(of_block).collect()
    }

    /// The matrices have more rows than a batch, and rows of them contribute to coarse rows far from each other.
    #[test]
    fn sums_depend_neither_on_batches_nor_on_threads() {
        for size in [(1, 3), (3, 6)] {
            check_product(size);
        }
    }

    fn check_product(size: (usize, usize)) {
        let (fine, coarse) = (TASKS_PER_BATCH * ROWS_PER_TASK + 700, 300);
        let neighbors = |row| vec![row, (row + 1) % fine, (row + 77) % fine, (row * 7) % fine];
        let a = random((size.0, size.0), fine, fine, neighbors);
        // Some rows have no coarse unknown.
        let p = random(size, fine, coarse, |row| match row % 11 {
            0 => vec![],
            _ => vec![row * coarse / fine, (row * 13) % coarse],
        });
        let (r, _) = p.transposed_pattern();
        let computed = || {
            let mut coarse = with_pattern(&a, &p, &r, vec![1.0; 10]);
            compute(&a, &p, &mut coarse);
            coarse
        };
        let [one, two, five] = on_pools(computed);
        let bits = |a: &BlockMatrix<f64>| a.values.iter().map(|value| value.to_bits()).collect::<Vec<_>>();
        assert!(bits(&one) == bits(&two) && bits(&one) == bits(&five));
        let expected = product(&entries(&p, true), &product(&entries(&a, false), &entries(&p, false)));
        let found = entries(&one, false);
        assert!(expected.keys().all(|place| found.contains_key(place)));
        for (place, value) in found {
            let expected = expected.get(&place).copied().unwrap_or(0.0);
            assert!((value - expected).abs() < 1e-12, "{place:?}: {value} instead of {expected}");
        }
    }
}
