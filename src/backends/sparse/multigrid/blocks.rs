//! Sparse matrices of small dense blocks of one size.

use crate::las::Scalar;
use crate::parallel;
use bytemuck::Pod;

/// The largest number of rows or columns of a block.
pub(super) const MOST: usize = 6;

/// A number of a block matrix: `f64` or `f32`.
pub(in crate::backends) trait Entry: Scalar + Pod {}

impl<T: Scalar + Pod> Entry for T {}

/// Returns the smallest supported block size that is not below `size`, which is at most [`MOST`].
pub(super) fn padded(size: usize) -> usize {
    match size {
        0 | 1 => 1,
        2 | 3 => 3,
        _ => MOST,
    }
}

/// Evaluates an expression with the sizes of a block, 1, 3 or 6 each, as constants.
macro_rules! with_sizes {
    ($rows:expr, $cols:expr, $R:ident, $C:ident => $body:expr) => {
        match ($rows, $cols) {
            (1, 1) => with_sizes!(@one 1, 1, $R, $C => $body),
            (1, 3) => with_sizes!(@one 1, 3, $R, $C => $body),
            (1, _) => with_sizes!(@one 1, 6, $R, $C => $body),
            (3, 1) => with_sizes!(@one 3, 1, $R, $C => $body),
            (3, 3) => with_sizes!(@one 3, 3, $R, $C => $body),
            (3, _) => with_sizes!(@one 3, 6, $R, $C => $body),
            (_, 1) => with_sizes!(@one 6, 1, $R, $C => $body),
            (_, 3) => with_sizes!(@one 6, 3, $R, $C => $body),
            _ => with_sizes!(@one 6, 6, $R, $C => $body),
        }
    };
    (@one $r:literal, $c:literal, $R:ident, $C:ident => $body:expr) => {{
        const $R: usize = $r;
        const $C: usize = $c;
        $body
    }};
}
/// Evaluates an expression with the size of a square block as a constant.
macro_rules! with_size {
    ($size:expr, $S:ident => $body:expr) => {
        match $size {
            1 => with_size!(@one 1, $S => $body),
            3 => with_size!(@one 3, $S => $body),
            _ => with_size!(@one 6, $S => $body),
        }
    };
    (@one $s:literal, $S:ident => $body:expr) => {{
        const $S: usize = $s;
        $body
    }};
}
pub(super) use {with_size, with_sizes};

/// Compressed rows of blocks; the columns of each row ascend, and the entries of a block are stored by columns.
#[derive(Clone, Debug)]
pub(in crate::backends) struct BlockMatrix<T> {
    /// Rows and columns of a block.
    pub size: (usize, usize),
    /// Number of block columns.
    pub cols: usize,
    /// The first block of each block row, followed by the number of blocks.
    pub offsets: Vec<u32>,
    /// The block column of each block.
    pub columns: Vec<u32>,
    /// The entries of all blocks.
    pub values: Vec<T>,
}

/// The most block rows that a task processes.
const ROWS_PER_TASK: usize = 1024;

/// The number of entries that a task copies or multiplies.
const ENTRIES_PER_TASK: usize = 1 << 15;

impl<T> BlockMatrix<T> {
    /// Returns the number of block rows.
    pub fn rows(&self) -> usize {
        self.offsets.len() - 1
    }

    /// Returns the indices of the blocks of a row.
    #[inline(always)]
    pub fn range(&self, row: usize) -> std::ops::Range<usize> {
        self.offsets[row] as usize..self.offsets[row + 1] as usize
    }
}

impl<T: Entry> BlockMatrix<T> {
    /// Creates a matrix of zeros.
    pub fn zeros(size: (usize, usize), cols: usize, offsets: Vec<u32>, columns: Vec<u32>) -> Self {
        let values = parallel::filled(T::zero(), columns.len() * size.0 * size.1);
        Self { size, cols, offsets, columns, values }
    }

    /// Returns the blocks as arrays of columns.
    #[inline(always)]
    pub fn blocks<const R: usize, const C: usize>(&self) -> &[[[T; R]; C]] {
        bytemuck::cast_slice(&self.values)
    }

    /// Creates a matrix whose values are to be overwritten, in the memory of `values` if there is enough.
    pub fn in_memory_of(
        mut values: Vec<T>,
        size: (usize, usize),
        cols: usize,
        offsets: Vec<u32>,
        columns: Vec<u32>,
    ) -> Self {
        let len = columns.len() * size.0 * size.1;
        if values.capacity() < len {
            drop(values);
            return Self::zeros(size, cols, offsets, columns);
        }
        values.resize(len, T::zero());
        Self { size, cols, offsets, columns, values }
    }

    /// Returns a matrix with the pattern of this one, whose values are to be overwritten, as [`BlockMatrix::in_memory_of`].
    pub fn like<U: Entry>(&self, values: Vec<U>) -> BlockMatrix<U> {
        BlockMatrix::in_memory_of(values, self.size, self.cols, self.offsets.clone(), self.columns.clone())
    }

    /// Copies a matrix of the same pattern and other precision, divided by `unit`.
    pub fn convert_from(&mut self, from: &BlockMatrix<f64>, unit: f64) {
        let scale = 1.0 / unit;
        let chunks = self.values.chunks_mut(ENTRIES_PER_TASK).zip(from.values.chunks(ENTRIES_PER_TASK));
        parallel::map(chunks, |(to, from)| {
            to.iter_mut().zip(from).for_each(|(to, from)| *to = T::of(from * scale));
        });
    }

    /// Copies the transpose of a matrix; block `k` is that of block `sources[k]` of `from`.
    pub fn transpose_from(&mut self, from: &BlockMatrix<f64>, sources: &[u32]) {
        let (r, c) = from.size;
        for_each_block(&mut self.values, r * c, |(at, to)| {
            let block = &from.values[sources[at] as usize * r * c..][..r * c];
            for (k, &value) in block.iter().enumerate() {
                to[(k % r) * c + k / r] = T::of(value);
            }
        });
    }

    /// Returns zeros in the pattern of the transpose, and the index of the transpose of each of its blocks.
    pub fn transposed_pattern(&self) -> (Self, Vec<u32>) {
        let offsets = crate::las::offsets(self.cols, self.columns.iter().map(|&column| column as usize));
        let (mut next, blocks) = (offsets.clone(), self.columns.len());
        let mut transpose = Self::zeros((self.size.1, self.size.0), self.rows(), offsets, vec![0; blocks]);
        let mut sources = vec![0; blocks];
        for row in 0..self.rows() {
            for at in self.range(row) {
                let to = &mut next[self.columns[at] as usize];
                transpose.columns[*to as usize] = row as u32;
                sources[*to as usize] = at as u32;
                *to += 1;
            }
        }
        (transpose, sources)
    }

    /// Computes `y = A x`, or `y += A x` if `ADD`.
    pub fn multiply<const ADD: bool>(&self, x: &[T], y: &mut [T]) {
        with_sizes!(self.size.0, self.size.1, R, C => self.multiply_sized::<R, C, ADD>(x, y));
    }

    fn multiply_sized<const R: usize, const C: usize, const ADD: bool>(&self, x: &[T], y: &mut [T]) {
        let (x, y): (&[[T; C]], &mut [[T; R]]) = (bytemuck::cast_slice(x), bytemuck::cast_slice_mut(y));
        // Coarse levels and restrictions have few rows, each of many and large blocks.
        let rows = (ENTRIES_PER_TASK * self.rows()).div_ceil(self.values.len().max(1)).clamp(1, ROWS_PER_TASK);
        parallel::map(y.chunks_mut(rows).enumerate(), |(task, y)| {
            vectorized(
                #[inline(always)]
                || self.multiply_rows::<R, C, ADD>(task * rows, x, y),
            );
        });
    }

    #[inline(always)]
    fn multiply_rows<const R: usize, const C: usize, const ADD: bool>(
        &self,
        first: usize,
        x: &[[T; C]],
        y: &mut [[T; R]],
    ) {
        let blocks = self.blocks::<R, C>();
        for (row, y) in y.iter_mut().enumerate() {
            let range = self.range(first + row);
            let product = row_product(&blocks[range.clone()], &self.columns[range], x);
            for (y, value) in y.iter_mut().zip(product) {
                *y = if ADD { *y + value } else { value };
            }
        }
    }
}

/// Calls a function for each of consecutive blocks of `len` entries with its number, in parallel.
pub(super) fn for_each_block<V: Send>(
    values: &mut [V],
    len: usize,
    of_block: impl Fn((usize, &mut [V])) + Sync + Send,
) {
    let tasks = values.chunks_mut(ROWS_PER_TASK * len).enumerate();
    parallel::map(tasks, |(task, values)| {
        (task * ROWS_PER_TASK..).zip(values.chunks_exact_mut(len)).for_each(&of_block);
    });
}

/// Returns compressed rows, their offsets and columns, computed in parallel: `of_row(memory, row, columns)` appends the
/// columns of a row; the memory is for the rows of a task.
pub(super) fn compressed_rows<M: Default>(
    rows: usize,
    of_row: impl Fn(&mut M, usize, &mut Vec<u32>) + Sync + Send,
) -> (Vec<u32>, Vec<u32>) {
    // Each task has memory of its own, which may be as long as a row.
    let rows_of_task = rows.div_ceil(64).clamp(256, 1 << 14);
    let of_task = |first: usize| {
        let (mut memory, mut ends, mut columns) = (M::default(), Vec::with_capacity(rows_of_task), Vec::new());
        for row in first..rows.min(first + rows_of_task) {
            of_row(&mut memory, row, &mut columns);
            ends.push(columns.len() as u32);
        }
        (ends, columns)
    };
    let tasks = parallel::map((0..rows).step_by(rows_of_task), of_task);
    let (mut offsets, mut columns) = (Vec::with_capacity(rows + 1), Vec::new());
    offsets.push(0);
    columns.reserve_exact(tasks.iter().map(|(_, columns)| columns.len()).sum());
    for (ends, of_task) in &tasks {
        let begin = columns.len() as u32;
        offsets.extend(ends.iter().map(|end| begin + end));
        columns.extend_from_slice(of_task);
    }
    (offsets, columns)
}

/// Runs a loop compiled for the vector instructions of this machine; everything that it calls must be inlined.
#[inline]
pub(super) fn vectorized(run: impl FnOnce()) {
    pulp::Arch::new().dispatch(run);
}

/// Returns the sum of the products of blocks with the entries of `x` at their columns.
#[inline(always)]
pub(super) fn row_product<T: Entry, const R: usize, const C: usize>(
    blocks: &[[[T; R]; C]],
    columns: &[u32],
    x: &[[T; C]],
) -> [T; R] {
    // One sum per column of the block: independent chains of additions.
    let mut sums = [[T::zero(); R]; C];
    for (block, &column) in blocks.iter().zip(columns) {
        let x = &x[column as usize];
        for j in 0..C {
            for i in 0..R {
                sums[j][i] += block[j][i] * x[j];
            }
        }
    }
    let mut sum = sums[0];
    for other in &sums[1..] {
        for i in 0..R {
            sum[i] += other[i];
        }
    }
    sum
}
