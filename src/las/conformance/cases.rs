//! Random test cases, which can be printed and reduced if they fail.

use std::fmt::Debug;
use std::sync::Arc;

use super::{Random, unwrap};
use crate::las::Sparsity;

/// The largest length of a vector: two registers of 16 single-precision numbers (AVX-512) and a remainder of one.
const MAX_LENGTH: usize = 33;
/// The largest number of rows or columns of a matrix.
const MAX_SIDE: usize = 12;
/// The exclusive upper bound of the number of operations in a case.
const STEPS_END: usize = 14;

/// A random test case.
pub(super) trait Case: Clone + Debug {
    /// Draws a case; patterns consist of full blocks of `block_size` rows and columns.
    fn draw(random: &mut Random, block_size: usize) -> Self;

    /// Returns the cases that lack one of the steps or blocks of this case.
    fn smaller(&self) -> Vec<Self>;
}

/// Returns `make(shorter)` for every list `shorter` that lacks one element of `list`.
fn without_one<T: Clone, C>(list: &[T], make: impl Fn(Vec<T>) -> C) -> Vec<C> {
    (0..list.len()).map(|skipped| make([&list[..skipped], &list[skipped + 1..]].concat())).collect()
}

/// Rows and columns of a block that is written or read at once, some of them repeated or constrained (negative).
#[derive(Clone, Debug)]
pub(super) struct Block {
    pub rows: Vec<i32>,
    pub cols: Vec<i32>,
}

impl Block {
    fn draw(random: &mut Random, rows: usize, cols: usize) -> Self {
        Self { rows: random.indices(rows), cols: random.indices(cols) }
    }

    pub fn len(&self) -> usize {
        self.rows.len() * self.cols.len()
    }

    /// Returns all pairs of a row and a column, row by row.
    pub fn pairs(&self) -> impl Iterator<Item = (i32, i32)> {
        self.rows.iter().flat_map(|&row| self.cols.iter().map(move |&column| (row, column)))
    }

    /// Returns `(row, column, value)` for the pairs without a constrained index; `values` has one number for each pair.
    pub fn entries(&self, values: &[f64]) -> impl Iterator<Item = (usize, usize, f64)> {
        let pairs = self.pairs().zip(values).filter(|((row, column), _)| *row >= 0 && *column >= 0);
        pairs.map(|((row, column), &value)| (row as usize, column as usize, value))
    }
}

/// One operation on one of two vectors; values are small integers.
#[derive(Clone, Debug)]
pub(super) enum VectorStep {
    Zero,
    Add(Vec<i32>, Vec<f64>),
    Set(Vec<i32>, Vec<f64>),
    /// Adds the other vector times a factor.
    Axpy(f64),
    /// Replaces the vector by a sum of the other one and itself, times these factors.
    Axpby(f64, f64),
    /// Writes all entries in `with_local_mut`.
    WriteLocal(Vec<f64>),
    Get(Vec<i32>),
    Finish,
}

/// Operations on two vectors of one length.
#[derive(Clone, Debug)]
pub(super) struct VectorCase {
    pub len: usize,
    /// The number of the vector, 0 or 1, and the operation.
    pub steps: Vec<(usize, VectorStep)>,
}

impl Case for VectorCase {
    fn draw(random: &mut Random, _: usize) -> Self {
        let len = random.below(MAX_LENGTH + 1);
        let count = random.below(STEPS_END);
        let mut step = || {
            let rows = random.indices(len);
            let values = random.integers(rows.len());
            let step = match random.below(15) {
                0 => VectorStep::Zero,
                1..=4 => VectorStep::Add(rows, values),
                5..=7 => VectorStep::Set(rows, values),
                8..=9 => VectorStep::Axpy(random.below(3) as f64 - 1.0),
                10 => VectorStep::WriteLocal(random.integers(len)),
                11..=12 => VectorStep::Get(rows),
                13 => VectorStep::Axpby(random.below(3) as f64 - 1.0, random.below(2) as f64),
                _ => VectorStep::Finish,
            };
            (random.below(2), step)
        };
        Self { len, steps: (0..count).map(|_| step()).collect() }
    }

    fn smaller(&self) -> Vec<Self> {
        without_one(&self.steps, |steps| Self { steps, ..*self })
    }
}

/// One operation on a matrix; a `usize` is the number of a block of the case.
#[derive(Clone, Debug)]
pub(super) enum MatrixStep {
    Zero,
    ZeroRows(Vec<i32>),
    Add(usize, Vec<f64>),
    Set(usize, Vec<f64>),
    AddAt(usize, Vec<f64>),
    /// Reads entries inside and outside the pattern.
    Get(Block),
    Finish,
}

/// Operations on a matrix.
#[derive(Clone, Debug)]
pub(super) struct MatrixCase {
    pub pattern: Arc<Sparsity>,
    /// The blocks that are written, all of them in the pattern.
    pub blocks: Vec<Block>,
    pub steps: Vec<MatrixStep>,
}

impl Case for MatrixCase {
    fn draw(random: &mut Random, block_size: usize) -> Self {
        let [rows, cols] = [(); 2].map(|()| random.side(block_size));
        let blocks: Vec<_> = (0..4).map(|_| Block::draw(random, rows, cols)).collect();
        let count = random.below(STEPS_END);
        let mut step = || {
            let number = random.below(blocks.len());
            let values = random.integers(blocks[number].len());
            match random.below(13) {
                0 => MatrixStep::Zero,
                1 => MatrixStep::ZeroRows(random.indices(rows)),
                2..=4 => MatrixStep::Add(number, values),
                5..=6 => MatrixStep::Set(number, values),
                7..=9 => MatrixStep::AddAt(number, values),
                10..=11 => MatrixStep::Get(Block::draw(random, rows, cols)),
                _ => MatrixStep::Finish,
            }
        };
        let steps = (0..count).map(|_| step()).collect();
        Self { pattern: random.pattern([rows, cols, block_size], &blocks), blocks, steps }
    }

    fn smaller(&self) -> Vec<Self> {
        without_one(&self.steps, |steps| Self { steps, ..self.clone() })
    }
}

/// Many square blocks of one size, whose rows are those of nodes, some of them constrained.
#[derive(Clone, Debug)]
pub(super) struct ManyBlocksCase {
    pub pattern: Arc<Sparsity>,
    /// Number of rows of a block.
    pub size: usize,
    /// The rows of each block and its values; no values if the block adds nothing.
    pub blocks: Vec<(Vec<i32>, Option<Vec<f64>>)>,
}

impl Case for ManyBlocksCase {
    fn draw(random: &mut Random, block_size: usize) -> Self {
        let unknowns = random.side(block_size);
        let rows_per_node = [1, 3][random.below(2)];
        let mut nodes = vec![vec![-1; rows_per_node]];
        let mut next = 0;
        while next < unknowns {
            let mut row = || {
                let is_free = next < unknowns && random.below(4) > 0;
                next += usize::from(is_free);
                if is_free { next as i32 - 1 } else { -1 }
            };
            nodes.push((0..rows_per_node).map(|_| row()).collect());
        }
        let size = (1 + random.below(4)) * rows_per_node;
        let mut block = || {
            let rows: Vec<i32> =
                (0..size / rows_per_node).flat_map(|_| nodes[random.below(nodes.len())].clone()).collect();
            let values = (random.below(5) > 0).then(|| random.integers(size * size));
            (rows, values)
        };
        let blocks: Vec<_> = (0..6).map(|_| block()).collect();
        // Rows of a node have the same columns only if no others are added.
        let pattern = if block_size == 1 && random.below(4) > 0 {
            Arc::new(unwrap(Sparsity::from_elements(unknowns, blocks.iter().map(|(rows, _)| rows))))
        } else {
            let blocks: Vec<_> =
                blocks.iter().map(|(rows, _)| Block { rows: rows.clone(), cols: rows.clone() }).collect();
            random.pattern([unknowns, unknowns, block_size], &blocks)
        };
        Self { pattern, size, blocks }
    }

    fn smaller(&self) -> Vec<Self> {
        without_one(&self.blocks, |blocks| Self { blocks, ..self.clone() })
    }
}

/// A matrix as the sum of blocks.
#[derive(Clone, Debug)]
pub(super) struct Sum {
    pub pattern: Arc<Sparsity>,
    pub blocks: Vec<(Block, Vec<f64>)>,
}

impl Sum {
    fn draw(random: &mut Random, [rows, cols, block_size]: [usize; 3]) -> Self {
        let blocks: Vec<_> = (0..random.below(5)).map(|_| Block::draw(random, rows, cols)).collect();
        let pattern = random.pattern([rows, cols, block_size], &blocks);
        let with_values = |block: Block| {
            let values = random.integers(block.len());
            (block, values)
        };
        Self { pattern, blocks: blocks.into_iter().map(with_values).collect() }
    }

    fn smaller(&self) -> Vec<Self> {
        without_one(&self.blocks, |blocks| Self { blocks, pattern: Arc::clone(&self.pattern) })
    }
}

/// Matrices `a` and `b` of one shape, a matrix `c` for the product `a c`, vectors `right` for `a x` and `left` for
/// `a^T x`, and the factors of sums of `a` and `b`.
#[derive(Clone, Debug)]
pub(super) struct AlgebraCase {
    pub a: Sum,
    pub b: Sum,
    pub c: Sum,
    pub right: Vec<f64>,
    pub left: Vec<f64>,
    pub factors: [f64; 2],
}

impl Case for AlgebraCase {
    fn draw(random: &mut Random, block_size: usize) -> Self {
        let [rows, inner, cols] = [(); 3].map(|()| random.side(block_size));
        Self {
            a: Sum::draw(random, [rows, inner, block_size]),
            b: Sum::draw(random, [rows, inner, block_size]),
            c: Sum::draw(random, [inner, cols, block_size]),
            right: random.integers(inner),
            left: random.integers(rows),
            factors: [(); 2].map(|()| if random.below(2) == 0 { -2.0 } else { 3.0 }),
        }
    }

    fn smaller(&self) -> Vec<Self> {
        let mut cases: Vec<Self> = self.a.smaller().into_iter().map(|a| Self { a, ..self.clone() }).collect();
        cases.extend(self.b.smaller().into_iter().map(|b| Self { b, ..self.clone() }));
        cases.extend(self.c.smaller().into_iter().map(|c| Self { c, ..self.clone() }));
        cases
    }
}

impl Random {
    /// Returns a number of rows or columns.
    fn side(&mut self, block_size: usize) -> usize {
        self.below(MAX_SIDE / block_size + 1) * block_size
    }

    /// Returns a pattern that contains the given blocks and random entries: some rows are full, some may be empty.
    fn pattern(&mut self, [rows, cols, block_size]: [usize; 3], blocks: &[Block]) -> Arc<Sparsity> {
        let columns = cols / block_size;
        let mut lists = vec![Vec::new(); rows / block_size];
        for list in &mut lists {
            match self.below(6) {
                0 => list.extend(0..columns),
                1 | 2 if cols > 0 => list.extend((0..3).map(|_| self.below(columns))),
                _ => {}
            }
        }
        for (row, column) in blocks.iter().flat_map(Block::pairs).filter(|&(row, column)| row >= 0 && column >= 0) {
            lists[row as usize / block_size].push(column as usize / block_size);
        }
        let fill = |row: usize, found: &mut Vec<u32>| {
            let positions = lists[row / block_size].iter().flat_map(|&k| block_size * k..block_size * (k + 1));
            found.extend(positions.map(|column| column as u32));
        };
        Arc::new(unwrap(Sparsity::by_rows(cols, rows, fill)))
    }
}
