//! The verbs of matrices.

use biotissue::las::conformance::Oracle;
use biotissue::las::{Backend, MatrixOps};

use super::draw::{Block, MatrixCase, MatrixVerb};
use super::{Outcome, check, done, equal, exactly, in_lane, lanes, scalars, untouched};

/// A matrix, and what it must be in every lane.
struct Subject<B: Backend> {
    found: B::Matrix,
    expected: Vec<Oracle>,
    /// Where the blocks lie: located in another matrix of the pattern.
    slots: Vec<Vec<B::Slot>>,
    /// Whether `set` was the last verb that wrote to it; `None` behind a `finish`.
    pending: Option<bool>,
}

pub fn agree<B: Backend<Index = i32>>(context: &B::Context, case: &MatrixCase) -> Outcome {
    let (rows, cols) = (case.pattern.rows(), case.pattern.cols());
    let twin = done(B::matrix(context, &case.pattern))?;
    let mut slots = Vec::new();
    for block in &case.blocks {
        let mut of_block = Vec::new();
        done(twin.locate(&block.rows, &block.cols, &mut of_block))?;
        equal("slots of a block", of_block.len(), block.pairs().count())?;
        slots.push(of_block);
    }
    let mut subject = Subject::<B> {
        found: done(B::matrix(context, &case.pattern))?,
        expected: vec![Oracle::zeros(rows, cols); lanes::<B>()],
        slots,
        pending: None,
    };
    equal("the shape", subject.found.shape(), (rows, cols))?;
    for verb in &case.steps {
        subject.step(&case.blocks, verb)?;
    }
    subject.read(&Block { rows: (0..rows as i32).collect(), cols: (0..cols as i32).collect() })
}

impl<B: Backend<Index = i32>> Subject<B> {
    fn step(&mut self, blocks: &[Block], verb: &MatrixVerb) -> Outcome {
        match verb {
            MatrixVerb::Zero => {
                done(self.found.zero())?;
                self.expected.iter_mut().for_each(|a| a.values.fill(0.0));
            }
            MatrixVerb::ZeroRows(rows) => {
                done(self.found.zero_rows(rows))?;
                for a in &mut self.expected {
                    for row in rows.iter().filter_map(|&row| usize::try_from(row).ok()) {
                        a.values[row * a.cols..][..a.cols].fill(0.0);
                    }
                }
            }
            MatrixVerb::Add(number, values) => {
                let Block { rows, cols } = &blocks[*number];
                self.turn_to(false)?;
                done(self.found.add(rows, cols, &scalars::<B>(&values[..rows.len() * cols.len()])))?;
                self.write(&blocks[*number], values, |entry, value| *entry += value);
            }
            MatrixVerb::Set(number, values) => {
                let Block { rows, cols } = &blocks[*number];
                self.turn_to(true)?;
                done(self.found.set(rows, cols, &scalars::<B>(&values[..rows.len() * cols.len()])))?;
                self.write(&blocks[*number], values, |entry, value| *entry = value);
            }
            MatrixVerb::AddAt(number, values) => {
                self.turn_to(false)?;
                let slots = &self.slots[*number];
                done(self.found.add_at(slots, &scalars::<B>(&values[..slots.len()])))?;
                self.write(&blocks[*number], values, |entry, value| *entry += value);
            }
            MatrixVerb::Get(block) => self.read(block)?,
            MatrixVerb::Finish => self.finish()?,
        }
        Ok(())
    }

    fn write(&mut self, block: &Block, values: &[i8], write: impl Fn(&mut f64, f64)) {
        for (lane, a) in self.expected.iter_mut().enumerate() {
            for ((row, column), &value) in block.pairs().zip(values) {
                if row >= 0 && column >= 0 {
                    write(a.at(row as usize, column as usize), in_lane(value, lane));
                }
            }
        }
    }

    /// `finish` stands between adding and setting.
    fn turn_to(&mut self, set: bool) -> Outcome {
        if self.pending.is_some_and(|pending| pending != set) {
            self.finish()?;
        }
        self.pending = Some(set);
        Ok(())
    }

    fn finish(&mut self) -> Outcome {
        self.pending = None;
        done(self.found.finish())
    }

    fn read(&mut self, block: &Block) -> Outcome {
        self.finish()?;
        let mut values = untouched::<B>(block.pairs().count());
        done(self.found.get(&block.rows, &block.cols, &mut values))?;
        for ((row, column), value) in block.pairs().zip(&values) {
            let expected = |lane: usize| match (usize::try_from(row), usize::try_from(column)) {
                (Ok(row), Ok(column)) => super::at(&self.expected[lane], row, column),
                _ => in_lane(super::UNTOUCHED, lane),
            };
            check(format_args!("entry ({row}, {column})"), value, expected, exactly)?;
        }
        Ok(())
    }
}
