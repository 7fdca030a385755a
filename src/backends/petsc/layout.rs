//! Where the entries of a pattern lie in the arrays of an AIJ matrix.
//!
//! On one rank they lie in one array, in the order of the pattern. On several, each rank holds its own rows in two: the
//! entries whose columns it owns (the diagonal part), and the others (the off-diagonal part), row after row, columns
//! ascending in both. Here the two count as one, the off-diagonal part behind the diagonal one.

use std::ops::Range;
use std::sync::Arc;

use super::Context;
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
}

impl Row<'_> {
    /// Where the entry at a position of the row lies.
    #[inline(always)]
    pub(super) fn at(&self, position: usize) -> usize {
        if position < self.left {
            self.rest + position
        } else if position < self.left + self.inside {
            self.start + position - self.left
        } else {
            self.rest + position - self.inside
        }
    }

    /// Where the entry of a column lies. A negative one is larger than any column as a `u32`, and so not found.
    #[inline(always)]
    pub(super) fn find(&self, column: i32) -> Option<usize> {
        self.columns.binary_search(&(column as u32)).ok().map(|position| self.at(position))
    }
}

impl Layout {
    pub(super) fn new(context: &Context, pattern: &Arc<Sparsity>) -> Self {
        let (rows, cols) = (context.own(pattern.rows()), context.own(pattern.cols()));
        let mut layout =
            Self { pattern: Arc::clone(pattern), rows, cols, diagonal: pattern.entries(), splits: Vec::new() };
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
        let starts = self.pattern.row_start();
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
        let starts = self.pattern.row_start();
        let (begin, end) = (starts[row] as usize, starts[row + 1] as usize);
        let columns = &self.pattern.columns()[begin..end];
        Some(match self.splits.get(own) {
            None => Row { columns, start: begin, rest: 0, left: 0, inside: columns.len() },
            Some(&Split { start, left, len }) => {
                let (start, left, inside) = (start as usize, left as usize, len as usize);
                let before = begin - starts[self.rows.start] as usize - start;
                Row { columns, start, rest: self.diagonal + before, left, inside }
            }
        })
    }

    /// The compressed rows of this rank, as PETSc takes them.
    pub(super) fn compressed(&self) -> (Vec<i32>, Vec<i32>) {
        let starts = &self.pattern.row_start()[self.rows.start..=self.rows.end];
        let (first, last) = (starts[0], starts[starts.len() - 1]);
        let columns = &self.pattern.columns()[first as usize..last as usize];
        (starts.iter().map(|&start| (start - first) as i32).collect(), columns.iter().map(|&c| c as i32).collect())
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
