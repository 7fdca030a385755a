//! The positions of the entries of a pattern in the arrays of an AIJ or BAIJ matrix.
//!
//! On one rank, all entries are in one array, in the order of the pattern. On several ranks, each rank stores its rows
//! in two arrays: the entries whose columns it owns (the diagonal part) and the others (the off-diagonal part), row
//! after row, with columns ascending in both. This module treats the two as one array, the off-diagonal part after the
//! diagonal one. BAIJ does the same with blocks, and stores each block by columns.
//!
//! A rank that holds a part of a system uses local numbers: its own rows, which are all rows of the pattern, and the
//! columns of these rows before those of the ghosts. Because ghosts ascend by their global numbers, the columns of both
//! parts ascend in PETSc's order.

use std::ops::Range;
use std::sync::Arc;

use super::Context;
use super::rows::Parts;
use crate::backends::local::{NOT_FOUND, find};
use crate::las::Sparsity;

/// A pattern and the part of it that this rank owns.
#[derive(Debug)]
pub(super) struct Layout {
    pub(super) pattern: Arc<Sparsity>,
    /// The rows of this rank.
    pub(super) rows: Range<usize>,
    /// The columns of the diagonal part.
    pub(super) cols: Range<usize>,
    /// The number of entries of the diagonal part.
    pub(super) diagonal: usize,
    /// The size of stored blocks; 1 for AIJ.
    pub(super) block: usize,
    /// For each row of this rank, the start and length of its diagonal part and the number of entries left of it; empty
    /// on one rank.
    splits: Vec<Split>,
    /// The global numbers of the rows and columns; `None` if the pattern uses them itself.
    parts: Option<Arc<Parts>>,
}

#[derive(Clone, Copy, Debug, Default)]
struct Split {
    start: u32,
    left: u32,
    len: u32,
}

/// One row of this rank.
#[derive(Clone, Copy)]
pub(super) struct Row<'a> {
    pub(super) columns: &'a [u32],
    /// The start of the diagonal part in its array, and the start of the off-diagonal part after it.
    start: usize,
    rest: usize,
    left: usize,
    inside: usize,
    /// The block size, and the index of this row within its blocks.
    block: u32,
    within: u32,
}

impl Row<'_> {
    /// Returns the array index of the entry at a position of the row.
    #[inline(always)]
    pub(super) fn at(&self, position: usize) -> usize {
        if position < self.left {
            self.rest + self.step(position)
        } else if position < self.left + self.inside {
            self.start + self.step(position - self.left)
        } else {
            self.rest + self.step(position - self.inside)
        }
    }

    /// Returns the offset of the entry at a position of a part from the start of the row (for BAIJ, of the block row).
    #[inline(always)]
    fn step(&self, position: usize) -> usize {
        if self.block == 1 {
            return position;
        }
        let (block, position) = (self.block, position as u32);
        (position / block * block * block + position % block * block + self.within) as usize
    }

    /// Returns the array index of the entry in a column. A negative column is larger than any column as a `u32` and so
    /// not found.
    #[inline(always)]
    pub(super) fn find(&self, column: i32) -> Option<usize> {
        self.columns.binary_search(&(column as u32)).ok().map(|position| self.at(position))
    }

    /// Does the same as [`Self::find`], but first tries the position `next`, which follows the last one found.
    #[inline(always)]
    pub(super) fn find_after(&self, next: &mut usize, column: i32) -> Option<usize> {
        match find(self.columns, next, column) {
            NOT_FOUND => None,
            position => Some(self.at(position)),
        }
    }
}

impl Layout {
    pub(super) fn new(context: &Context, pattern: &Arc<Sparsity>) -> Self {
        let (rows, cols) = match context.rows() {
            Some(rows) => (0..rows.own.len(), 0..rows.own.len()),
            None => (context.own_range(pattern.rows()), context.own_range(pattern.cols())),
        };
        let (pattern, diagonal, parts) = (Arc::clone(pattern), pattern.nnz(), context.parts().cloned());
        let mut layout = Self { pattern, rows, cols, diagonal, block: 1, splits: Vec::new(), parts };
        if !context.is_single_rank() {
            layout.split();
        }
        layout
    }

    fn split(&mut self) {
        let mut start = 0;
        for row in self.rows.clone() {
            let columns = self.pattern.row(row);
            let left = columns.partition_point(|&column| (column as usize) < self.cols.start);
            let len = columns.partition_point(|&column| (column as usize) < self.cols.end) - left;
            self.splits.push(Split { start: start as u32, left: left as u32, len: len as u32 });
            start += len;
        }
        self.diagonal = start;
    }

    /// Returns the numbers of rows and columns of all ranks.
    pub(super) fn shape_of_all(&self) -> (usize, usize) {
        match &self.parts {
            Some(parts) => (parts.rows().total, parts.rows().total),
            None => (self.pattern.rows(), self.pattern.cols()),
        }
    }

    /// Returns the number of row numbers in use on this rank, some of which may be rows of other ranks.
    pub(super) fn row_numbers(&self) -> usize {
        if self.parts.is_some() { self.pattern.cols() } else { self.pattern.rows() }
    }

    /// Returns true if a pair of indices is neither in the pattern nor of a row or column to drop. Rows outside the
    /// pattern are rows of ghosts.
    pub(super) fn is_outside(&self, row: i32, column: i32) -> bool {
        let is_dropped = row < 0 || column < 0 || (row as usize) >= self.pattern.rows() && self.parts.is_some();
        !is_dropped && self.pattern.find(row as usize, column as usize).is_none()
    }

    /// Returns the number of entries of this rank.
    pub(super) fn entries(&self) -> usize {
        let starts = self.pattern.row_offsets();
        (starts[self.rows.end] - starts[self.rows.start]) as usize
    }

    /// Returns a row of this rank; `None` for a row of another rank, a constrained row, and a row out of range.
    #[inline(always)]
    pub(super) fn row(&self, row: i32) -> Option<Row<'_>> {
        // As a `usize`, a negative row is larger than any valid one.
        let row = row as usize;
        let own = row.wrapping_sub(self.rows.start);
        if own >= self.rows.len() {
            return None;
        }
        let starts = self.pattern.row_offsets();
        let (begin, end) = (starts[row] as usize, starts[row + 1] as usize);
        let columns = &self.pattern.col_indices()[begin..end];
        let first = starts[self.rows.start] as usize;
        let split = match self.splits.get(own) {
            None => Split { start: begin as u32, left: 0, len: columns.len() as u32 },
            Some(split) => *split,
        };
        let (start, left, inside) = (split.start as usize, split.left as usize, split.len as usize);
        let mut found = Row { columns, start, rest: 0, left, inside, block: 1, within: 0 };
        found.rest = self.diagonal + (begin - first - start);
        if self.block > 1 {
            // All rows of a block have the same columns; move the start from this row back to the first of them.
            let within = own % self.block;
            (found.block, found.within) = (self.block as u32, within as u32);
            found.start -= within * inside;
            found.rest -= within * (columns.len() - inside);
        }
        Some(found)
    }

    /// Returns the compressed rows (or block rows) of this rank in the form that PETSc expects.
    pub(super) fn compressed(&self) -> (Vec<i32>, Vec<i32>) {
        if self.block > 1 {
            return self.compressed_blocks();
        }
        if let Some(parts) = &self.parts {
            return parts.compressed(&self.pattern);
        }
        let starts = &self.pattern.row_offsets()[self.rows.start..=self.rows.end];
        let (first, last) = (starts[0], starts[starts.len() - 1]);
        let columns = &self.pattern.col_indices()[first as usize..last as usize];
        (starts.iter().map(|&start| (start - first) as i32).collect(), columns.iter().map(|&c| c as i32).collect())
    }

    fn compressed_blocks(&self) -> (Vec<i32>, Vec<i32>) {
        let (mut starts, mut blocks) = (vec![0], Vec::new());
        for row in self.rows.clone().step_by(self.block) {
            let first = self.pattern.row(row).iter().step_by(self.block);
            blocks.extend(first.map(|&column| (column as usize / self.block) as i32));
            starts.push(blocks.len() as i32);
        }
        (starts, blocks)
    }

    /// Returns true if the pattern consists of full blocks of `size` by `size`; the part of every rank then does so
    /// too. If each rank holds a part of the system, only the part of this rank is examined.
    pub(super) fn has_blocks(&self, size: usize) -> bool {
        if let Some(parts) = &self.parts {
            return parts.has_blocks(&self.pattern, size);
        }
        let (rows, cols) = (self.pattern.rows(), self.pattern.cols());
        if size < 2 || !rows.is_multiple_of(size) || !cols.is_multiple_of(size) {
            return false;
        }
        (0..rows).step_by(size).all(|first| {
            let columns = self.pattern.row(first);
            let full = columns.chunks(size).all(|block| {
                block.len() == size
                    && (block[0] as usize).is_multiple_of(size)
                    && block.windows(2).all(|pair| pair[1] == pair[0] + 1)
            });
            full && (first + 1..first + size).all(|row| self.pattern.row(row) == columns)
        })
    }
}
