//! Tests of the operations of vectors and matrices.

use std::sync::Arc;

use super::{Oracle, Random, done, epsilon, first_indices, indices, is, scalars, splat, weight};
use crate::las::{Backend, Index, MatrixOps, Scalar, Sparsity, Value, VectorOps};

/// The initial value of a buffer, to detect entries that a read leaves unchanged.
const UNTOUCHED: f64 = 77.0;

/// Tests the operations of vectors.
///
/// # Panics
/// Panics if the backend violates the specification of [`VectorOps`].
pub fn vectors<B: Backend>(context: &B::Context) {
    for seed in 0..60 {
        let mut random = Random::new(seed);
        let len = [0, 1, 7, 8, 9, 33][random.below(6)];
        let mut y = done(B::vector(context, len));
        assert_eq!((y.len(), y.is_empty()), (len, len == 0));
        assert_vector::<B>(&y, &vec![0.0; len], seed);
        let mut expected = vec![0.0; len];
        for step in 0..12 {
            let rows = random.positions(6, len);
            let values = random.integers(rows.len());
            if step % 2 == 0 {
                done(y.add(&indices::<B>(&rows), &scalars::<B>(&values)));
            } else {
                done(y.set(&indices::<B>(&rows), &scalars::<B>(&values)));
            }
            done(y.finish());
            for (row, value) in rows.iter().zip(&values) {
                if let Some(row) = *row {
                    expected[row] = if step % 2 == 0 { expected[row] + value } else { *value };
                }
            }
            assert_vector::<B>(&y, &expected, seed);
            assert_vector_read::<B>(&y, &expected, &random.positions(6, len), seed);
        }
        vector_arithmetic::<B>(context, &mut random, y, expected, seed);
    }
    writes_out_of_range_are_dropped::<B>(context);
}

fn vector_arithmetic<B: Backend>(
    context: &B::Context,
    random: &mut Random,
    mut y: B::Vector,
    mut expected: Vec<f64>,
    seed: u64,
) {
    let other = random.integers(expected.len());
    let mut x = done(B::vector(context, expected.len()));
    done(x.with_local_mut(|values| values.copy_from_slice(&scalars::<B>(&other))));
    done(x.finish());
    done(y.axpy(splat::<B>(-3.0), &x));
    for (y, x) in expected.iter_mut().zip(&other) {
        *y -= 3.0 * x;
    }
    assert_vector::<B>(&y, &expected, seed);
    // Sums of squares of small integers are exact; only their square root is rounded.
    let dot: f64 = expected.iter().zip(&other).map(|(y, x)| y * x).sum();
    let found = done(y.dot(&x));
    assert!(is(&found, dot, 2), "dot {found:?} instead of {dot}, seed {seed}");
    let norm = expected.iter().map(|y| y * y).sum::<f64>().sqrt();
    let found = done(y.norm());
    for lane in 0..B::Reduced::LANES {
        let (found, norm) = (found.lane(lane).as_f64(), norm * weight(lane));
        assert!((found - norm).abs() <= 2.0 * epsilon::<B>() * norm, "norm {found} instead of {norm}, seed {seed}");
    }
    done(y.zero());
    assert_vector::<B>(&y, &vec![0.0; expected.len()], seed);
}

/// Returns true if all values equal the expected ones times this power of the weight of each lane.
pub(super) fn all_are<V: Value>(values: &[V], expected: &[f64], power: i32) -> bool {
    values.iter().zip(expected).all(|(value, &expected)| is(value, expected, power))
}

fn assert_vector<B: Backend>(y: &B::Vector, expected: &[f64], seed: u64) {
    let same = done(y.with_local(|values| values.len() == expected.len() && all_are(values, expected, 1)));
    assert!(same, "the local values are not {expected:?}, seed {seed}");
}

fn assert_vector_read<B: Backend>(y: &B::Vector, expected: &[f64], rows: &[Option<usize>], seed: u64) {
    let mut values = scalars::<B>(&vec![UNTOUCHED; rows.len()]);
    done(y.get(&indices::<B>(rows), &mut values));
    for (row, value) in rows.iter().zip(values) {
        let expected = row.map_or(UNTOUCHED, |row| expected[row]);
        assert!(is(&value, expected, 1), "get of row {row:?}: {value:?} instead of {expected}, seed {seed}");
    }
}

/// Runs only without debug assertions, which such writes violate.
fn writes_out_of_range_are_dropped<B: Backend>(context: &B::Context) {
    if cfg!(debug_assertions) {
        return;
    }
    let (beyond, one) = ([B::Index::of(3)], [splat::<B>(1.0)]);
    let mut y = done(B::vector(context, 3));
    done(y.add(&beyond, &one));
    done(y.finish());
    assert_vector::<B>(&y, &[0.0; 3], 0);
    let Ok(pattern) = Sparsity::from_elements(3, [[0, 1]]) else { return };
    let mut a = done(B::matrix(context, &Arc::new(pattern)));
    done(a.add(&beyond, &[B::Index::of(0)], &one));
    done(a.add(&[B::Index::of(0)], &beyond, &one));
    done(a.zero_rows(&beyond));
    let mut slots = Vec::new();
    done(a.locate(&beyond, &beyond, &mut slots));
    done(a.add_at(&slots, &one));
    done(a.finish());
    assert_matrix::<B>(&a, &Oracle::zeros(3, 3), 0);
}

/// The rows and columns of a block, some of them constrained or repeated.
struct Block {
    rows: Vec<Option<usize>>,
    cols: Vec<Option<usize>>,
}

impl Block {
    fn pairs(&self) -> impl Iterator<Item = (Option<usize>, Option<usize>)> {
        self.rows.iter().flat_map(|&row| self.cols.iter().map(move |&column| (row, column)))
    }

    fn len(&self) -> usize {
        self.rows.len() * self.cols.len()
    }
}

/// Returns random blocks of a matrix and the pattern that contains them.
fn blocks(random: &mut Random, rows: usize, cols: usize) -> (Vec<Block>, Arc<Sparsity>) {
    let blocks: Vec<Block> =
        (0..6).map(|_| Block { rows: random.positions(5, rows), cols: random.positions(5, cols) }).collect();
    let mut lists = vec![Vec::new(); rows];
    for (row, column) in blocks.iter().flat_map(Block::pairs) {
        if let (Some(row), Some(column)) = (row, column) {
            lists[row].push(column as u32);
        }
    }
    let (mut row_offsets, mut columns) = (vec![0], Vec::new());
    for mut list in lists {
        list.sort_unstable();
        list.dedup();
        columns.extend(list);
        row_offsets.push(columns.len() as u32);
    }
    let pattern = Sparsity::from_rows(cols, row_offsets, columns).unwrap_or_else(|error| panic!("{error}"));
    (blocks, Arc::new(pattern))
}

/// Tests the operations of matrices, also for rectangular ones.
///
/// # Panics
/// Panics if the backend violates the specification of [`MatrixOps`].
pub fn matrices<B: Backend>(context: &B::Context) {
    for seed in 0..120 {
        let mut random = Random::new(1000 + seed);
        let (rows, cols) = (random.below(12), random.below(12));
        let (blocks, pattern) = blocks(&mut random, rows, cols);
        let mut a = done(B::matrix(context, &pattern));
        let mut expected = Oracle::zeros(rows, cols);
        assert_eq!(a.shape(), (rows, cols));
        assert_matrix::<B>(&a, &expected, seed);
        for _ in 0..25 {
            let block = &blocks[random.below(blocks.len())];
            matrix_step::<B>(&mut random, &mut a, &mut expected, block);
            done(a.finish());
            assert_matrix::<B>(&a, &expected, seed);
            let block = Block { rows: random.positions(5, rows), cols: random.positions(5, cols) };
            assert_block_read::<B>(&a, &mut expected, &block, seed);
        }
        slots::<B>(context, &mut random, &blocks, &pattern, seed);
        done(a.zero());
        assert_matrix::<B>(&a, &Oracle::zeros(rows, cols), seed);
    }
}

/// Applies one random operation to the matrix and to the oracle.
fn matrix_step<B: Backend>(random: &mut Random, a: &mut B::Matrix, expected: &mut Oracle, block: &Block) {
    let values = random.integers(block.len());
    let (rows, cols) = (indices::<B>(&block.rows), indices::<B>(&block.cols));
    let verb = random.below(7);
    match verb {
        0..=2 => done(a.add(&rows, &cols, &scalars::<B>(&values))),
        3..=4 => done(a.set(&rows, &cols, &scalars::<B>(&values))),
        5 => {
            done(a.zero_rows(&rows));
            for &row in block.rows.iter().flatten() {
                expected.values[row * expected.cols..][..expected.cols].fill(0.0);
            }
        }
        _ => {
            let mut slots = Vec::new();
            done(a.locate(&rows, &cols, &mut slots));
            done(a.add_at(&slots, &scalars::<B>(&values)));
        }
    }
    for ((row, column), value) in block.pairs().zip(values) {
        if let (Some(row), Some(column)) = (row, column) {
            match verb {
                0..=2 | 6 => *expected.at(row, column) += value,
                3..=4 => *expected.at(row, column) = value,
                _ => {}
            }
        }
    }
}

/// Tests that slots are valid for every matrix of the same pattern, and that calls append them in order.
fn slots<B: Backend>(context: &B::Context, random: &mut Random, blocks: &[Block], pattern: &Arc<Sparsity>, seed: u64) {
    let mut slots = Vec::new();
    let first = done(B::matrix(context, pattern));
    for block in blocks {
        done(first.locate(&indices::<B>(&block.rows), &indices::<B>(&block.cols), &mut slots));
    }
    assert_eq!(slots.len(), blocks.iter().map(Block::len).sum::<usize>(), "one slot a pair, seed {seed}");
    let values = random.integers(slots.len());
    let mut second = done(B::matrix(context, pattern));
    let mut expected = Oracle::zeros(pattern.rows(), pattern.cols());
    for _ in 0..2 {
        done(second.add_at(&slots, &scalars::<B>(&values)));
    }
    done(second.finish());
    for ((row, column), value) in blocks.iter().flat_map(Block::pairs).zip(values) {
        if let (Some(row), Some(column)) = (row, column) {
            *expected.at(row, column) += 2.0 * value;
        }
    }
    assert_matrix::<B>(&second, &expected, seed);
}

/// Checks every position; positions outside the pattern read as zero.
fn assert_matrix<B: Backend>(a: &B::Matrix, expected: &Oracle, seed: u64) {
    let mut values = scalars::<B>(&vec![UNTOUCHED; expected.values.len()]);
    done(a.get(&first_indices::<B>(expected.rows), &first_indices::<B>(expected.cols), &mut values));
    let same = all_are(&values, &expected.values, 1);
    assert!(same, "{values:?} instead of {:?} in {} rows, seed {seed}", expected.values, expected.rows);
}

fn assert_block_read<B: Backend>(a: &B::Matrix, expected: &mut Oracle, block: &Block, seed: u64) {
    let mut values = scalars::<B>(&vec![UNTOUCHED; block.len()]);
    done(a.get(&indices::<B>(&block.rows), &indices::<B>(&block.cols), &mut values));
    for ((row, column), value) in block.pairs().zip(values) {
        let expected = match (row, column) {
            (Some(row), Some(column)) => *expected.at(row, column),
            _ => UNTOUCHED,
        };
        assert!(is(&value, expected, 1), "get of ({row:?}, {column:?}): {value:?}, not {expected}, seed {seed}");
    }
}

/// Returns a random matrix of small integers and its expected values.
pub(super) fn drawn<B: Backend>(
    context: &B::Context,
    random: &mut Random,
    rows: usize,
    cols: usize,
) -> (B::Matrix, Oracle) {
    let (blocks, pattern) = blocks(random, rows, cols);
    let mut a = done(B::matrix(context, &pattern));
    let mut expected = Oracle::zeros(rows, cols);
    for block in &blocks {
        matrix_step::<B>(random, &mut a, &mut expected, block);
        done(a.finish());
    }
    (a, expected)
}
