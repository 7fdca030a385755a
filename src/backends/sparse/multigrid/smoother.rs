//! Block Gauss-Seidel sweeps, in parallel over chunks of rows.
//!
//! Within a chunk a sweep uses the newest values, across chunks those before the sweep. Half the sum of the absolute
//! values of the couplings across chunks is added to the diagonal of a row; a forward and a backward sweep then form a
//! positive definite smoother for every positive definite matrix (A. H. Baker, R. D. Falgout, T. V. Kolev, U. M. Yang,
//! *Multigrid smoothers for ultraparallel computing*, SIAM J. Sci. Comput. 33, 2011). The chunks depend only on the
//! size of the matrix, so that results do not depend on the number of threads.

use super::blocks::{BlockMatrix, Entry, MOST, vectorized, with_size};
use crate::parallel;

/// The number of block rows that a task prepares.
const ROWS_PER_TASK: usize = 1024;

/// The number of block rows of a chunk, about; of blocks with more than nine entries, correspondingly fewer.
const ROWS_PER_CHUNK: usize = 4096;

/// A pivot of a diagonal block that is smaller than this fraction of its largest entry is zero up to rounding.
const SINGULAR: f64 = 1e-14;

/// The greatest number of chunks.
const MOST_CHUNKS: usize = 64;

/// What the sweeps need in addition to the matrix.
pub(super) struct Smoother<T> {
    /// Number of rows of a chunk.
    chunk: usize,
    /// The index of the diagonal block of each row.
    diagonal: Vec<u32>,
    /// The inverse of each diagonal block with the addition, by columns.
    inverse: Vec<T>,
    /// The additions to the diagonal; empty if there is one chunk.
    additions: Vec<T>,
}

/// A diagonal block that cannot be inverted: its row.
#[derive(Debug)]
pub(super) struct SingularBlock {
    pub row: usize,
}

/// Returns the number of rows per chunk of a matrix with so many block rows. All chunks but the last have as many, that one at
/// most as many; there is one chunk, or an even number, so that two threads have the same work.
fn chunk_of(rows: usize, size: usize) -> usize {
    let wanted = 9 * ROWS_PER_CHUNK / (size * size).max(9);
    let chunks = match (rows + wanted / 2) / wanted {
        0 | 1 => 1,
        chunks => chunks.next_multiple_of(2).min(MOST_CHUNKS),
    };
    rows.div_ceil(chunks).max(1)
}

/// Returns the index of the diagonal block of each row.
pub(super) fn diagonals<T: Sync>(a: &BlockMatrix<T>) -> Result<Vec<u32>, SingularBlock> {
    let of_row = |row: usize| {
        let range = a.offsets[row] as usize..a.offsets[row + 1] as usize;
        let found = a.columns[range].binary_search(&(row as u32));
        found.map(|at| a.offsets[row] + at as u32).map_err(|_| SingularBlock { row })
    };
    parallel::try_collect(a.rows(), 0, of_row)
}

/// Returns the inverse of each diagonal block, with `addition(row, unknown)` added to its diagonal.
pub(super) fn inverses(
    a: &BlockMatrix<f64>,
    diagonal: &[u32],
    addition: impl Fn(usize, usize) -> f64 + Sync + Send,
) -> Result<Vec<f64>, SingularBlock> {
    let size = a.size.0;
    let mut inverses = vec![0.0; diagonal.len() * size * size];
    let rows = inverses.chunks_mut(ROWS_PER_TASK * size * size).zip(diagonal.chunks(ROWS_PER_TASK)).enumerate();
    parallel::try_each(rows, |(task, (inverses, diagonal))| {
        for (k, (inverse, &at)) in inverses.chunks_exact_mut(size * size).zip(diagonal).enumerate() {
            let row = task * ROWS_PER_TASK + k;
            let mut block = [0.0; MOST * MOST];
            let block = &mut block[..size * size];
            block.copy_from_slice(&a.values[at as usize * size * size..][..size * size]);
            (0..size).for_each(|i| block[i * size + i] += addition(row, i));
            if !invert(block, inverse, size) {
                return Err(SingularBlock { row });
            }
        }
        Ok(())
    })?;
    Ok(inverses)
}

/// Writes the inverse of the small matrix `a`, which is overwritten, into `b`, by Gauss-Jordan elimination with row
/// exchanges. Returns false if it is singular to rounding.
fn invert(a: &mut [f64], b: &mut [f64], n: usize) -> bool {
    let largest = a.iter().fold(0.0, |most: f64, v| most.max(v.abs()));
    b.fill(0.0);
    (0..n).for_each(|i| b[i * n + i] = 1.0);
    for k in 0..n {
        let size = |&i: &usize| a[k * n + i].abs();
        let pivot = (k..n).max_by(|one, other| size(one).total_cmp(&size(other))).unwrap_or(k);
        // A NaN is not above the limit either.
        let is_regular = a[k * n + pivot].abs() > SINGULAR * largest;
        if !is_regular {
            return false;
        }
        for j in 0..n {
            a.swap(j * n + k, j * n + pivot);
            b.swap(j * n + k, j * n + pivot);
        }
        let scale = 1.0 / a[k * n + k];
        for j in 0..n {
            a[j * n + k] *= scale;
            b[j * n + k] *= scale;
        }
        for i in (0..n).filter(|&i| i != k) {
            let factor = a[k * n + i];
            for j in 0..n {
                a[j * n + i] -= factor * a[j * n + k];
                b[j * n + i] -= factor * b[j * n + k];
            }
        }
    }
    true
}

impl<T: Entry> Smoother<T> {
    /// Creates a smoother for matrices with the pattern of `a`.
    pub fn new(a: &BlockMatrix<f64>) -> Self {
        Self { chunk: chunk_of(a.rows(), a.size.0), diagonal: Vec::new(), inverse: Vec::new(), additions: Vec::new() }
    }

    /// Prepares the sweeps with a matrix whose entries are divided by `unit` in the sweeps.
    pub fn compute(&mut self, a: &BlockMatrix<f64>, diagonal: &[u32], unit: f64) -> Result<(), SingularBlock> {
        let additions = if a.rows() > self.chunk { additions(a, self.chunk) } else { Vec::new() };
        let size = a.size.0;
        let addition = |row: usize, i: usize| additions.get(row * size + i).copied().unwrap_or(0.0);
        let inverse = inverses(a, diagonal, addition)?;
        self.diagonal.clear();
        self.diagonal.extend_from_slice(diagonal);
        self.inverse.clear();
        self.inverse.extend(inverse.iter().map(|&value| T::of(value * unit)));
        self.additions.clear();
        self.additions.extend(additions.iter().map(|&value| T::of(value / unit)));
        Ok(())
    }

    /// Sweeps forward from `x = 0`, then computes the residual `r = b - A x`.
    pub fn pre_smooth(&self, a: &BlockMatrix<T>, b: &[T], x: &mut [T], r: &mut [T]) {
        with_size!(a.size.0, S => {
            let b: &[[T; S]] = bytemuck::cast_slice(b);
            let x: &mut [[T; S]] = bytemuck::cast_slice_mut(x);
            self.chunks(x, |first, x| {
                vectorized(#[inline(always)] || self.forward(a, first, b, x));
            });
            let x = &*x;
            self.chunks(bytemuck::cast_slice_mut::<T, [T; S]>(r), |first, r| {
                vectorized(#[inline(always)] || self.residual(a, first, x, r));
            });
        });
    }

    /// Sweeps backward; `old` is overwritten.
    pub fn post_smooth(&self, a: &BlockMatrix<T>, b: &[T], x: &mut [T], old: &mut [T]) {
        if !self.additions.is_empty() {
            old.copy_from_slice(x);
        }
        with_size!(a.size.0, S => {
            let (b, old): (&[[T; S]], &[[T; S]]) = (bytemuck::cast_slice(b), bytemuck::cast_slice(old));
            self.chunks(bytemuck::cast_slice_mut::<T, [T; S]>(x), |first, x| {
                vectorized(#[inline(always)] || self.backward(a, first, b, old, x));
            });
        });
    }

    fn chunks<V: Send>(&self, values: &mut [V], of_chunk: impl Fn(usize, &mut [V]) + Sync + Send) {
        let chunks = values.chunks_mut(self.chunk).enumerate();
        parallel::map(chunks, |(number, values)| of_chunk(number * self.chunk, values));
    }

    #[inline(always)]
    fn forward<const S: usize>(&self, a: &BlockMatrix<T>, first: usize, b: &[[T; S]], x: &mut [[T; S]]) {
        let (blocks, inverses) = (a.blocks::<S, S>(), self.inverses::<S>());
        for row in 0..x.len() {
            let mut sums = [[T::zero(); S]; S];
            sums[0] = b[first + row];
            for at in a.offsets[first + row] as usize..self.diagonal[first + row] as usize {
                let column = a.columns[at] as usize;
                if column >= first {
                    subtract(&blocks[at], &x[column - first], &mut sums);
                }
            }
            x[row] = product(&inverses[first + row], &total(&sums));
        }
    }

    /// The residual after a forward sweep from zero: the couplings that the sweep used cancel.
    #[inline(always)]
    fn residual<const S: usize>(&self, a: &BlockMatrix<T>, first: usize, x: &[[T; S]], r: &mut [[T; S]]) {
        let blocks = a.blocks::<S, S>();
        let additions: &[[T; S]] = bytemuck::cast_slice(&self.additions);
        for (row, r) in r.iter_mut().enumerate() {
            let row = first + row;
            let mut sums = [[T::zero(); S]; S];
            if let Some(addition) = additions.get(row) {
                for i in 0..S {
                    sums[0][i] = addition[i] * x[row][i];
                }
                for at in a.offsets[row] as usize..self.diagonal[row] as usize {
                    let column = a.columns[at] as usize;
                    if column >= first {
                        break;
                    }
                    subtract(&blocks[at], &x[column], &mut sums);
                }
            }
            for at in self.diagonal[row] as usize + 1..a.offsets[row + 1] as usize {
                subtract(&blocks[at], &x[a.columns[at] as usize], &mut sums);
            }
            *r = total(&sums);
        }
    }

    #[inline(always)]
    fn backward<const S: usize>(
        &self,
        a: &BlockMatrix<T>,
        first: usize,
        b: &[[T; S]],
        old: &[[T; S]],
        x: &mut [[T; S]],
    ) {
        let (blocks, inverses) = (a.blocks::<S, S>(), self.inverses::<S>());
        for row in (0..x.len()).rev() {
            let mut sums = [[T::zero(); S]; S];
            sums[0] = b[first + row];
            for at in a.range(first + row) {
                let column = a.columns[at] as usize;
                let value = match x.get(column.wrapping_sub(first)) {
                    Some(value) => value,
                    None => &old[column],
                };
                subtract(&blocks[at], value, &mut sums);
            }
            let change = product(&inverses[first + row], &total(&sums));
            for i in 0..S {
                x[row][i] += change[i];
            }
        }
    }

    fn inverses<const S: usize>(&self) -> &[[[T; S]; S]] {
        bytemuck::cast_slice(&self.inverse)
    }
}

/// Returns half the sum of the absolute couplings to other chunks, for each unknown.
fn additions(a: &BlockMatrix<f64>, chunk: usize) -> Vec<f64> {
    let size = a.size.0;
    let mut additions = vec![0.0; a.rows() * size];
    parallel::map(additions.chunks_mut(ROWS_PER_TASK * size).enumerate(), |(task, additions)| {
        for (k, additions) in additions.chunks_exact_mut(size).enumerate() {
            let row = task * ROWS_PER_TASK + k;
            for at in a.range(row).filter(|&at| a.columns[at] as usize / chunk != row / chunk) {
                for (k, value) in a.values[at * size * size..(at + 1) * size * size].iter().enumerate() {
                    additions[k % size] += 0.5 * value.abs();
                }
            }
        }
    });
    additions
}

/// Subtracts `A x` from the sum of `sums`, column by column.
#[inline(always)]
fn subtract<T: Entry, const S: usize>(block: &[[T; S]; S], x: &[T; S], sums: &mut [[T; S]; S]) {
    for j in 0..S {
        for i in 0..S {
            sums[j][i] -= block[j][i] * x[j];
        }
    }
}

#[inline(always)]
fn total<T: Entry, const S: usize>(sums: &[[T; S]; S]) -> [T; S] {
    let mut total = sums[0];
    for other in &sums[1..] {
        for i in 0..S {
            total[i] += other[i];
        }
    }
    total
}

#[inline(always)]
fn product<T: Entry, const S: usize>(block: &[[T; S]; S], x: &[T; S]) -> [T; S] {
    let mut y = [T::zero(); S];
    for j in 0..S {
        for i in 0..S {
            y[i] += block[j][i] * x[j];
        }
    }
    y
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn chunks_are_even_and_neither_short_nor_many() {
        for (size, wanted) in [(1, 4096), (3, 4096), (6, 1024)] {
            for rows in
                [0, 1, wanted, 3 * wanted / 2, 2 * wanted, 5 * wanted / 2, 3 * wanted, 17 * wanted + 5, 1000 * wanted]
            {
                let chunk = chunk_of(rows, size);
                let chunks = rows.div_ceil(chunk);
                assert!(chunks <= 1 || chunks.is_multiple_of(2), "{chunks} chunks of {rows} rows");
                assert!(
                    chunks <= MOST_CHUNKS && (chunks <= 1 || 8 * chunk >= 5 * wanted),
                    "{chunks} chunks of {rows} rows"
                );
                assert!(chunk < 3 * wanted / 2 + 1 || chunks == MOST_CHUNKS, "{chunks} chunks of {rows} rows");
            }
        }
    }
}
