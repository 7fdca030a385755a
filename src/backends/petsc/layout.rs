//! Where the entries of a pattern lie in the arrays of an AIJ or BAIJ matrix.
//!
//! On one rank they lie in one array, in the order of the pattern. On several, each rank holds its own rows in two: the
//! entries whose columns it owns (the diagonal part), and the others (the off-diagonal part), row after row, columns
//! ascending in both. Here the two count as one, the off-diagonal part behind the diagonal one. BAIJ does the same with blocks,
//! and stores each of them column after column.

use std::ops::Range;
use std::sync::Arc;

use super::Context;
use crate::backends::local::{NOWHERE, find};
use crate::las::Sparsity;

/// A pattern, and what this rank owns of it.
#[derive(Debug)]
pub(super) struct Layout {
    pub(super) pattern: Arc<Sparsity>,
    /// Own rows.
    pub(super) rows: Range<usize>,
    /// Columns of the diagonal part.
    pub(super) cols: Range<usize>,
    /// Entries of the diagonal part.
    pub(super) diagonal: usize,
    /// The size of stored blocks; 1 for AIJ.
    pub(super) block: usize,
    /// Of each own row where its diagonal part starts, and how many entries stand left of that; none on one rank.
    splits: Vec<Split>,
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
    /// Where the diagonal part starts in its array, and where the rest does behind it.
    start: usize,
    rest: usize,
    left: usize,
    inside: usize,
    /// The size of blocks, and which row of its blocks this one is.
    block: u32,
    within: u32,
}

impl Row<'_> {
    /// Where the entry at a position of the row lies.
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

    /// How far the entry at a position of a part lies behind the start of the row (of the row of blocks, for BAIJ).
    #[inline(always)]
    fn step(&self, position: usize) -> usize {
        if self.block == 1 {
            return position;
        }
        let (block, position) = (self.block, position as u32);
        (position / block * block * block + position % block * block + self.within) as usize
    }

    /// Where the entry of a column lies. A negative one is larger than any column as a `u32`, and so not found.
    #[inline(always)]
    pub(super) fn find(&self, column: i32) -> Option<usize> {
        self.columns.binary_search(&(column as u32)).ok().map(|position| self.at(position))
    }

    /// The same; the place `next` to the last one found is tried first.
    #[inline(always)]
    pub(super) fn find_after(&self, next: &mut usize, column: i32) -> Option<usize> {
        match find(self.columns, next, column) {
            NOWHERE => None,
            position => Some(self.at(position)),
        }
    }
}

impl Layout {
    pub(super) fn new(context: &Context, pattern: &Arc<Sparsity>) -> Self {
        let (rows, cols) = (context.own(pattern.rows()), context.own(pattern.cols()));
        let mut layout = Self {
            pattern: Arc::clone(pattern),
            rows,
            cols,
            diagonal: pattern.entries(),
            block: 1,
            splits: Vec::new(),
        };
        if !context.is_alone() {
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

    /// Entries of this rank.
    pub(super) fn entries(&self) -> usize {
        let starts = self.pattern.row_offsets();
        (starts[self.rows.end] - starts[self.rows.start]) as usize
    }

    /// A row of this rank; `None` for one of another rank, a constrained one, and one out of range.
    #[inline(always)]
    pub(super) fn row(&self, row: i32) -> Option<Row<'_>> {
        // As a `usize` a negative row is larger than any.
        let row = row as usize;
        let own = row.wrapping_sub(self.rows.start);
        if own >= self.rows.len() {
            return None;
        }
        let starts = self.pattern.row_offsets();
        let (begin, end) = (starts[row] as usize, starts[row + 1] as usize);
        let columns = &self.pattern.columns()[begin..end];
        let first = starts[self.rows.start] as usize;
        let split = match self.splits.get(own) {
            None => Split { start: begin as u32, left: 0, len: columns.len() as u32 },
            Some(split) => *split,
        };
        let (start, left, inside) = (split.start as usize, split.left as usize, split.len as usize);
        let mut found = Row { columns, start, rest: 0, left, inside, block: 1, within: 0 };
        found.rest = self.diagonal + (begin - first - start);
        if self.block > 1 {
            // All rows of a block have the same columns: from this one back to the first of them.
            let within = own % self.block;
            (found.block, found.within) = (self.block as u32, within as u32);
            found.start -= within * inside;
            found.rest -= within * (columns.len() - inside);
        }
        Some(found)
    }

    /// The compressed rows of this rank, or rows of blocks, as PETSc takes them.
    pub(super) fn compressed(&self) -> (Vec<i32>, Vec<i32>) {
        if self.block > 1 {
            return self.compressed_blocks();
        }
        let starts = &self.pattern.row_offsets()[self.rows.start..=self.rows.end];
        let (first, last) = (starts[0], starts[starts.len() - 1]);
        let columns = &self.pattern.columns()[first as usize..last as usize];
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

    /// Whether the pattern consists of full blocks of `size` by `size`, and so does the part of every rank.
    pub(super) fn has_blocks(&self, size: usize) -> bool {
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
