//! What is drawn. Shapes, indices and values are drawn apart and fitted to each other afterward, so that a case that fails
//! can be made smaller in any of them.

use std::sync::Arc;

use biotissue::las::Sparsity;
use proptest::collection::vec;
use proptest::prelude::{Just, any};
use proptest::prop_oneof;
use proptest::strategy::Strategy;

/// The largest side of a matrix, and the most rows or columns of a block.
const SIDE: usize = 9;
const BLOCK: usize = 5;

/// Rows and columns that are addressed at once, constrained and repeated ones among them.
#[derive(Clone, Debug)]
pub struct Block {
    pub rows: Vec<i32>,
    pub cols: Vec<i32>,
}

impl Block {
    pub fn pairs(&self) -> impl Iterator<Item = (i32, i32)> {
        self.rows.iter().flat_map(|&row| self.cols.iter().map(move |&column| (row, column)))
    }
}

/// Small integers for the pairs of a block, and for the rows of a vector; there are more than it has.
pub type Values = Vec<i8>;

#[derive(Clone, Debug)]
pub enum VectorVerb {
    Zero,
    Add(Vec<i32>, Values),
    Set(Vec<i32>, Values),
    /// Adds the other vector times a factor.
    Axpy(i8),
    /// Writes into the entries that are lent.
    Lend(Values),
    Get(Vec<i32>),
    Finish,
}

/// Verbs on two vectors.
#[derive(Clone, Debug)]
pub struct VectorCase {
    pub len: usize,
    /// Which of the two, and what.
    pub steps: Vec<(usize, VectorVerb)>,
}

#[derive(Clone, Debug)]
pub enum MatrixVerb {
    Zero,
    ZeroRows(Vec<i32>),
    /// Of one of the blocks, by its number.
    Add(usize, Values),
    Set(usize, Values),
    AddAt(usize, Values),
    /// Of any positions, in the pattern or not.
    Get(Block),
    Finish,
}

/// Verbs on a matrix.
#[derive(Clone, Debug)]
pub struct MatrixCase {
    pub pattern: Arc<Sparsity>,
    /// What is written to; all of it is in the pattern.
    pub blocks: Vec<Block>,
    pub steps: Vec<MatrixVerb>,
}

/// A matrix as the sum of blocks.
#[derive(Clone, Debug)]
pub struct Filled {
    pub pattern: Arc<Sparsity>,
    pub blocks: Vec<(Block, Values)>,
}

/// Two matrices of one shape, one that the first can be multiplied with, and vectors for both sides of the first.
#[derive(Clone, Debug)]
pub struct AlgebraCase {
    pub a: Filled,
    pub b: Filled,
    pub c: Filled,
    pub right: Values,
    pub left: Values,
    pub factors: [i8; 2],
}

pub fn vectors() -> impl Strategy<Value = VectorCase> {
    let verb = prop_oneof![
        1 => Just(VectorVerb::Zero),
        4 => (indices(), values()).prop_map(|(rows, values)| VectorVerb::Add(rows, values)),
        3 => (indices(), values()).prop_map(|(rows, values)| VectorVerb::Set(rows, values)),
        2 => (-1_i8..=1).prop_map(VectorVerb::Axpy),
        1 => values().prop_map(VectorVerb::Lend),
        2 => indices().prop_map(VectorVerb::Get),
        1 => Just(VectorVerb::Finish),
    ];
    (0_usize..=20, vec((0_usize..2, verb), 0..12)).prop_map(|(len, mut steps)| {
        for (_, verb) in &mut steps {
            match verb {
                VectorVerb::Add(rows, _) | VectorVerb::Set(rows, _) | VectorVerb::Get(rows) => fit(rows, len),
                _ => {}
            }
        }
        VectorCase { len, steps }
    })
}

/// Patterns consist of full blocks of `unit` rows and columns.
pub fn matrices(unit: usize) -> impl Strategy<Value = MatrixCase> {
    let number = 0_usize..4;
    let verb = prop_oneof![
        1 => Just(MatrixVerb::Zero),
        1 => indices().prop_map(MatrixVerb::ZeroRows),
        3 => (number.clone(), values()).prop_map(|(block, values)| MatrixVerb::Add(block, values)),
        2 => (number.clone(), values()).prop_map(|(block, values)| MatrixVerb::Set(block, values)),
        3 => (number, values()).prop_map(|(block, values)| MatrixVerb::AddAt(block, values)),
        2 => block().prop_map(MatrixVerb::Get),
        1 => Just(MatrixVerb::Finish),
    ];
    let parts = (side(unit), side(unit), pattern_rows(), vec(block(), 1..=4), vec(verb, 0..12));
    parts.prop_map(move |(rows, cols, pattern_rows, mut blocks, mut steps)| {
        blocks.iter_mut().for_each(|block| fit_block(block, rows, cols));
        for verb in &mut steps {
            match verb {
                MatrixVerb::ZeroRows(indices) => fit(indices, rows),
                MatrixVerb::Add(number, _) | MatrixVerb::Set(number, _) | MatrixVerb::AddAt(number, _) => {
                    *number %= blocks.len();
                }
                MatrixVerb::Get(block) => fit_block(block, rows, cols),
                MatrixVerb::Zero | MatrixVerb::Finish => {}
            }
        }
        MatrixCase { pattern: pattern([rows, cols, unit], &pattern_rows, blocks.iter()), blocks, steps }
    })
}

/// The same of these patterns.
pub fn algebra(unit: usize) -> impl Strategy<Value = AlgebraCase> {
    let shape = (side(unit), side(unit), side(unit));
    let numbers = (values(), values(), any::<[bool; 2]>());
    (shape, filled(), filled(), filled(), numbers).prop_map(move |((rows, inner, cols), a, b, c, numbers)| {
        let (right, left, minus) = numbers;
        let factors = minus.map(|minus| if minus { -2 } else { 3 });
        let [a, b] = [a, b].map(|drawn| fit_filled([rows, inner, unit], drawn));
        let c = fit_filled([inner, cols, unit], c);
        AlgebraCase { a, b, c, right, left, factors }
    })
}

fn side(unit: usize) -> impl Strategy<Value = usize> {
    (0..=SIDE / unit).prop_map(move |count| count * unit)
}

fn values() -> impl Strategy<Value = Values> {
    vec(-8_i8..=8, BLOCK * BLOCK)
}

/// One in five is constrained, by any negative number.
fn indices() -> impl Strategy<Value = Vec<i32>> {
    let index = prop_oneof![4 => 0..60_i32, 1 => prop_oneof![Just(-1), -50..0_i32, Just(i32::MIN)]];
    vec(index, 0..=BLOCK)
}

fn block() -> impl Strategy<Value = Block> {
    (indices(), indices()).prop_map(|(rows, cols)| Block { rows, cols })
}

/// The rows of a pattern, beside what blocks need: empty ones, full ones (`None`), and some columns.
type PatternRows = Vec<Option<Vec<u8>>>;

fn pattern_rows() -> impl Strategy<Value = PatternRows> {
    vec(prop_oneof![3 => Just(Some(vec![])), 1 => Just(None), 2 => vec(0..60_u8, 1..4).prop_map(Some)], SIDE)
}

fn filled() -> impl Strategy<Value = (PatternRows, Vec<(Block, Values)>)> {
    (pattern_rows(), vec((block(), values()), 0..=4))
}

fn fit(indices: &mut [i32], end: usize) {
    for index in indices.iter_mut().filter(|index| **index >= 0) {
        *index = if end == 0 { -1 } else { *index % end as i32 };
    }
}

fn fit_block(block: &mut Block, rows: usize, cols: usize) {
    fit(&mut block.rows, rows);
    fit(&mut block.cols, cols);
}

fn fit_filled(shape: [usize; 3], (pattern_rows, mut blocks): (PatternRows, Vec<(Block, Values)>)) -> Filled {
    blocks.iter_mut().for_each(|(block, _)| fit_block(block, shape[0], shape[1]));
    Filled { pattern: pattern(shape, &pattern_rows, blocks.iter().map(|(block, _)| block)), blocks }
}

/// The rows drawn, whatever the blocks write to, and what makes whole units of both.
fn pattern<'a>(
    [rows, cols, unit]: [usize; 3],
    drawn: &PatternRows,
    blocks: impl Iterator<Item = &'a Block>,
) -> Arc<Sparsity> {
    let mut units = vec![Vec::new(); rows / unit];
    for (row, drawn) in drawn[..rows].iter().enumerate() {
        let columns: Vec<usize> = match drawn {
            None => (0..cols).collect(),
            Some(some) => some.iter().filter(|_| cols > 0).map(|&column| usize::from(column) % cols).collect(),
        };
        units[row / unit].extend(columns.into_iter().map(|column| column / unit));
    }
    for (row, column) in blocks.flat_map(Block::pairs).filter(|&(row, column)| row >= 0 && column >= 0) {
        units[row as usize / unit].push(column as usize / unit);
    }
    let (mut row_offsets, mut columns) = (vec![0], Vec::new());
    for mut list in units {
        list.sort_unstable();
        list.dedup();
        for _ in 0..unit {
            columns.extend(list.iter().flat_map(|&of| unit * of..unit * (of + 1)).map(|column| column as u32));
            row_offsets.push(columns.len() as u32);
        }
    }
    Arc::new(Sparsity::from_rows(cols, row_offsets, columns).unwrap())
}
