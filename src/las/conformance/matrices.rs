//! Tests of the operations of matrices.

use std::ops::Range;
use std::sync::Arc;

use super::cases::{Block, ManyBlocksCase, MatrixCase, MatrixStep};
use super::{DenseReference, Outcome, equal, indices, lanes, number_in_lane, same, scalars, tried, untouched};
use crate::las::{Backend, Index, MatrixOps, Sparsity};

/// A matrix, and its expected entries in every lane.
struct Subject<'a, B: Backend> {
    found: B::Matrix,
    expected: Vec<DenseReference>,
    blocks: &'a [Block],
    /// The positions of all blocks, located in another matrix with this pattern, and the range of each block.
    slots: Vec<B::Slot>,
    ranges: Vec<Range<usize>>,
    /// Whether the last write was a `set`; `None` if there was no write since `finish`.
    pending: Option<bool>,
}

/// Performs the operations of the case on a matrix and compares every entry that it reads with the reference.
pub(super) fn check<B: Backend>(context: &B::Context, case: &MatrixCase) -> Outcome {
    let (rows, cols) = (case.pattern.rows(), case.pattern.cols());
    let twin = tried(B::matrix(context, &case.pattern))?;
    let (mut slots, mut ranges) = (Vec::new(), Vec::new());
    for block in &case.blocks {
        let start = slots.len();
        tried(twin.locate(&indices::<B>(&block.rows), &indices::<B>(&block.cols), &mut slots))?;
        equal("the number of slots of a block", slots.len() - start, block.len())?;
        ranges.push(start..slots.len());
    }
    let mut subject = Subject::<B> {
        found: tried(B::matrix(context, &case.pattern))?,
        expected: vec![DenseReference::zeros(rows, cols); lanes::<B>()],
        blocks: &case.blocks,
        slots,
        ranges,
        pending: None,
    };
    let all = Block { rows: (0..rows as i32).collect(), cols: (0..cols as i32).collect() };
    equal("the shape", subject.found.shape(), (rows, cols))?;
    subject.read(&all)?;
    for step in &case.steps {
        subject.step(step)?;
    }
    subject.read(&all)?;
    out_of_range_is_dropped::<B>(context)
}

impl<B: Backend> Subject<'_, B> {
    fn step(&mut self, step: &MatrixStep) -> Outcome {
        match step {
            MatrixStep::Zero => {
                tried(self.found.zero())?;
                self.expected.iter_mut().for_each(|a| a.values.fill(0.0));
            }
            MatrixStep::ZeroRows(rows) => {
                tried(self.found.zero_rows(&indices::<B>(rows)))?;
                for a in &mut self.expected {
                    for row in rows.iter().filter_map(|&row| usize::try_from(row).ok()) {
                        a.values[row * a.cols..][..a.cols].fill(0.0);
                    }
                }
            }
            MatrixStep::Add(number, values) => {
                self.separate(false)?;
                let Block { rows, cols } = &self.blocks[*number];
                tried(self.found.add(&indices::<B>(rows), &indices::<B>(cols), &scalars::<B>(values)))?;
                self.write(*number, values, |entry, value| *entry += value);
            }
            MatrixStep::Set(number, values) => {
                self.separate(true)?;
                let Block { rows, cols } = &self.blocks[*number];
                tried(self.found.set(&indices::<B>(rows), &indices::<B>(cols), &scalars::<B>(values)))?;
                self.write(*number, values, |entry, value| *entry = value);
            }
            MatrixStep::AddAt(number, values) => {
                self.separate(false)?;
                let slots = &self.slots[self.ranges[*number].clone()];
                tried(self.found.add_at(slots, &scalars::<B>(values)))?;
                self.write(*number, values, |entry, value| *entry += value);
            }
            MatrixStep::Get(block) => self.read(block)?,
            MatrixStep::Finish => self.finish()?,
        }
        Ok(())
    }

    /// Applies `write(entry, value)` to the expected entries of a block.
    fn write(&mut self, number: usize, values: &[f64], write: impl Fn(&mut f64, f64)) {
        for (lane, a) in self.expected.iter_mut().enumerate() {
            for (row, column, value) in self.blocks[number].entries(values) {
                write(a.at(row, column), number_in_lane(value, lane));
            }
        }
    }

    /// Calls `finish` if the next write is a `set` and the last one was not, or the reverse.
    fn separate(&mut self, set: bool) -> Outcome {
        if self.pending.is_some_and(|pending| pending != set) {
            self.finish()?;
        }
        self.pending = Some(set);
        Ok(())
    }

    fn finish(&mut self) -> Outcome {
        self.pending = None;
        tried(self.found.finish())
    }

    /// Reads a block and compares it with the expected entries.
    fn read(&mut self, block: &Block) -> Outcome {
        self.finish()?;
        let mut values = untouched::<B>(block.len());
        tried(self.found.get(&indices::<B>(&block.rows), &indices::<B>(&block.cols), &mut values))?;
        for ((row, column), value) in block.pairs().zip(&values) {
            let expected = |lane: usize| match (usize::try_from(row), usize::try_from(column)) {
                (Ok(row), Ok(column)) => self.expected[lane].get(row, column),
                _ => number_in_lane(super::UNTOUCHED, lane),
            };
            same(format_args!("entry ({row}, {column})"), value, expected)?;
        }
        Ok(())
    }
}

/// Adds many blocks at once, twice, and compares every entry with the reference.
pub(super) fn check_many_blocks<B: Backend>(context: &B::Context, case: &ManyBlocksCase) -> Outcome {
    let unknowns = case.pattern.rows();
    let twin = tried(B::matrix(context, &case.pattern))?;
    let rows: Vec<i32> = case.blocks.iter().flat_map(|(rows, _)| rows).copied().collect();
    let slots = tried(twin.locate_blocks(case.size, &indices::<B>(&rows)))?;
    equal("the number and size of located blocks", (slots.len(), slots.size()), (case.blocks.len(), case.size))?;
    let mut expected = vec![DenseReference::zeros(unknowns, unknowns); lanes::<B>()];
    for (rows, values) in case.blocks.iter().filter_map(|(rows, values)| Some((rows, values.as_ref()?))) {
        for (lane, a) in expected.iter_mut().enumerate() {
            let block = Block { rows: rows.clone(), cols: rows.clone() };
            for (row, column, value) in block.entries(values) {
                *a.at(row, column) += 2.0 * number_in_lane(value, lane);
            }
        }
    }
    let values: Vec<Option<Vec<B::Scalar>>> =
        case.blocks.iter().map(|(_, values)| values.as_ref().map(|values| scalars::<B>(values))).collect();
    let mut found = tried(B::matrix(context, &case.pattern))?;
    for _ in 0..2 {
        tried(found.add_blocks(&slots, |number, block| match &values[number] {
            Some(values) => {
                block.copy_from_slice(values);
                true
            }
            None => {
                block.copy_from_slice(&untouched::<B>(block.len()));
                false
            }
        }))?;
    }
    let all = Block { rows: (0..unknowns as i32).collect(), cols: (0..unknowns as i32).collect() };
    Subject::<B> { found, expected, blocks: &[], slots: Vec::new(), ranges: Vec::new(), pending: Some(false) }
        .read(&all)
}

/// Checks that writes out of range are dropped. Debug assertions forbid such writes, so that builds with them skip the
/// check.
fn out_of_range_is_dropped<B: Backend>(context: &B::Context) -> Outcome {
    if cfg!(debug_assertions) {
        return Ok(());
    }
    let pattern = Arc::new(tried(Sparsity::from_elements(3, [[0, 1]]))?);
    let mut a = tried(B::matrix(context, &pattern))?;
    let (beyond, inside, one) = ([B::Index::of(3)], [B::Index::of(0)], scalars::<B>(&[1.0]));
    let mut slots = Vec::new();
    tried(a.add(&beyond, &inside, &one))?;
    tried(a.add(&inside, &beyond, &one))?;
    tried(a.zero_rows(&beyond))?;
    tried(a.locate(&beyond, &beyond, &mut slots))?;
    tried(a.add_at(&slots, &one))?;
    tried(a.finish())?;
    let (all, mut values) = (indices::<B>(&[0, 1, 2]), untouched::<B>(9));
    tried(a.get(&all, &all, &mut values))?;
    values.iter().try_for_each(|value| same("an entry after a write out of range", value, |_| 0.0))
}
