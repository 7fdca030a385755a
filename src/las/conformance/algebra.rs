//! Tests of products, sums, diagonals, transposes, and iteration over all entries.

use super::verbs::{all_are, drawn};
use super::{Oracle, Random, done, first_indices, is, scalars, splat};
use crate::las::{Backend, Entries, MatMat, MatVec, MatrixOps, SolveError, VectorOps};

/// Tests matrix-vector products and diagonals.
///
/// # Panics
/// Panics if the backend violates the specification of [`MatVec`].
pub fn products<B: Backend>(context: &B::Context) {
    for seed in 0..60 {
        let mut random = Random::new(2000 + seed);
        let (rows, cols) = (random.below(20), random.below(20));
        let (a, expected) = drawn::<B>(context, &mut random, rows, cols);
        let (right, left) = (random.integers(cols), random.integers(rows));
        let (mut x, mut y) = (vector::<B>(context, &right), vector::<B>(context, &vec![5.0; rows]));
        done(a.mul(&x, &mut y));
        assert_values::<B>(&y, &expected.times(&right), 2, seed);
        done(a.mul_transpose(&vector::<B>(context, &left), &mut x));
        assert_values::<B>(&x, &expected.transposed().times(&left), 2, seed);
        sizes::<B>(context, &a, rows, cols);
        diagonals::<B>(context, &a, &expected, seed);
    }
}

fn sizes<B: Backend>(context: &B::Context, a: &B::Matrix, rows: usize, cols: usize) {
    let vector = |len: usize| done(B::vector(context, len));
    let wrong = |outcome: Result<(), SolveError<B::Fault>>, size: usize| {
        assert!(matches!(outcome, Err(SolveError::Size { expected, .. }) if expected == size), "{outcome:?}");
    };
    wrong(a.mul(&vector(cols), &mut vector(rows + 1)), rows);
    wrong(a.mul(&vector(cols + 1), &mut vector(rows)), cols);
    wrong(a.mul_transpose(&vector(rows), &mut vector(cols + 1)), cols);
    wrong(a.mul_transpose(&vector(rows + 1), &mut vector(cols)), rows);
    wrong(a.diagonal(&mut vector(rows.min(cols) + 1)), rows.min(cols));
}

fn diagonals<B: Backend>(context: &B::Context, a: &B::Matrix, expected: &Oracle, seed: u64) {
    let diagonal: Vec<f64> =
        (0..expected.rows.min(expected.cols)).map(|k| expected.values[k * (expected.cols + 1)]).collect();
    let mut d = vector::<B>(context, &vec![5.0; diagonal.len()]);
    done(a.diagonal(&mut d));
    assert_values::<B>(&d, &diagonal, 1, seed);
    match (a.inverse_diagonal(&mut d), diagonal.iter().position(|&d| d == 0.0)) {
        (Ok(()), None) => {
            let mut values = scalars::<B>(&vec![0.0; diagonal.len()]);
            done(d.get(&first_indices::<B>(diagonal.len()), &mut values));
            for (found, d) in values.into_iter().zip(&diagonal) {
                // The product with the entry is one up to rounding.
                let rounded = (found * scalars::<B>(&[*d])[0] - splat::<B>(1.0)) * splat::<B>(1e4);
                let small =
                    |lane: usize| crate::las::Scalar::as_f64(crate::las::Value::lane(&rounded, lane)).abs() < 0.1;
                assert!((0..<B::Scalar as crate::las::Value>::LANES).all(small), "1 / {d}, seed {seed}");
            }
        }
        (Err(SolveError::ZeroDiagonal { row }), Some(first)) => assert_eq!(row, first, "seed {seed}"),
        (outcome, first) => panic!("the inverse of a diagonal with its first zero at {first:?}: {outcome:?}"),
    }
}

/// Tests matrix-matrix operations.
///
/// # Panics
/// Panics if the backend violates the specification of [`MatMat`] or [`Entries`].
pub fn algebra<B: Backend>(context: &B::Context) {
    for seed in 0..60 {
        let mut random = Random::new(2500 + seed);
        let (rows, inner, cols) = (random.below(12), random.below(12), random.below(12));
        let (mut a, mut expected) = drawn::<B>(context, &mut random, rows, inner);
        let (b, other) = drawn::<B>(context, &mut random, rows, inner);
        let (c, right) = drawn::<B>(context, &mut random, inner, cols);
        assert_entries::<B>(&a, &expected, 1, seed);
        assert_entries::<B>(&done(a.product(&c)), &expected.product(&right), 2, seed);
        assert_entries::<B>(&done(a.transpose()), &expected.transposed(), 1, seed);
        let sum = Oracle {
            values: expected.values.iter().zip(&other.values).map(|(x, y)| 3.0 * x - 2.0 * y).collect(),
            ..expected
        };
        assert_entries::<B>(&done(a.sum(splat::<B>(3.0), &b, splat::<B>(-2.0))), &sum, 1, seed);
        done(a.scale(splat::<B>(-4.0)));
        expected.values.iter_mut().for_each(|value| *value *= -4.0);
        assert_entries::<B>(&a, &expected, 1, seed);
        refusals::<B>(context, &a, seed);
    }
}

fn refusals<B: Backend>(context: &B::Context, a: &B::Matrix, seed: u64) {
    let (rows, cols) = a.shape();
    let (other, _) = drawn::<B>(context, &mut Random::new(seed), rows + 1, cols);
    let sum = a.sum(splat::<B>(1.0), &other, splat::<B>(1.0)).err();
    assert!(matches!(sum, Some(SolveError::Size { expected, .. }) if expected == rows), "{sum:?}");
    let (other, _) = drawn::<B>(context, &mut Random::new(seed), cols + 1, 2);
    let product = a.product(&other).err();
    assert!(matches!(product, Some(SolveError::Size { expected, .. }) if expected == cols), "{product:?}");
}

fn vector<B: Backend>(context: &B::Context, values: &[f64]) -> B::Vector {
    let mut vector = done(B::vector(context, values.len()));
    done(vector.set(&first_indices::<B>(values.len()), &scalars::<B>(values)));
    done(vector.finish());
    vector
}

fn assert_values<B: Backend>(y: &B::Vector, expected: &[f64], power: i32, seed: u64) {
    let mut values = scalars::<B>(&vec![77.0; expected.len()]);
    done(y.get(&first_indices::<B>(expected.len()), &mut values));
    assert!(y.len() == expected.len() && all_are(&values, expected, power), "{values:?}: {expected:?}, seed {seed}");
}

/// Checks all entries: each is visited once and in order, and entries outside the pattern are zero.
fn assert_entries<B: Backend>(a: &B::Matrix, expected: &Oracle, power: i32, seed: u64) {
    assert_eq!(a.shape(), (expected.rows, expected.cols), "shape, seed {seed}");
    let pattern = done(a.pattern());
    let mut values = scalars::<B>(&vec![0.0; expected.values.len()]);
    let mut visited = Vec::new();
    done(a.for_each(|row, column, value| {
        values[row * expected.cols + column] = value;
        visited.push((row, column));
    }));
    let of_pattern = (0..pattern.rows()).flat_map(|row| pattern.row(row).iter().map(move |&c| (row, c as usize)));
    assert!(visited.into_iter().eq(of_pattern), "entries row after row, seed {seed}");
    let wrong = values.iter().zip(&expected.values).find(|(value, expected)| !is(*value, **expected, power));
    assert!(wrong.is_none(), "{wrong:?} of a matrix of {} rows, seed {seed}", expected.rows);
}
