//! Tests of products, sums, diagonals, transposes, and iteration over all entries.

use super::cases::{AlgebraCase, Sum};
use super::{
    DenseReference, Outcome, epsilon, equal, indices, lanes, number_in_lane, same, scalar, scalars, sign_in_lane,
    tried, untouched, within,
};
use crate::las::{Backend, Entries, MatMat, MatVec, MatrixOps, SolveError, Sparsity, VectorOps};

/// Tests [`MatVec`] on the matrix `a` of the case.
pub(super) fn check_products<B: Backend>(context: &B::Context, case: &AlgebraCase) -> Outcome {
    let (a, expected) = assembled::<B>(context, &case.a)?;
    let (rows, cols) = a.shape();
    let (x, mut y) = (vector::<B>(context, &case.right)?, vector::<B>(context, &vec![5.0; rows])?);
    tried(a.mul(&x, &mut y))?;
    check_vector::<B>("A x", &y, |lane| expected[lane].times(&in_lane(&case.right, lane)))?;
    let (x, mut y) = (vector::<B>(context, &case.left)?, vector::<B>(context, &vec![5.0; cols])?);
    tried(a.mul_transpose(&x, &mut y))?;
    check_vector::<B>("A^T x", &y, |lane| expected[lane].transposed().times(&in_lane(&case.left, lane)))?;
    wrong_sizes::<B>(context, &a)?;
    diagonals::<B>(context, &a, &expected)
}

/// Tests [`Entries`] on the matrix `a` of the case.
pub(super) fn check_entries<B: Backend<Matrix: Entries<B>>>(context: &B::Context, case: &AlgebraCase) -> Outcome {
    let (a, expected) = assembled::<B>(context, &case.a)?;
    check_matrix::<B>("A", &a, &case.a.pattern, &expected)
}

/// Tests [`MatMat`] on all matrices of the case.
pub(super) fn check_algebra<B: Backend<Matrix: MatMat<B>>>(context: &B::Context, case: &AlgebraCase) -> Outcome {
    let (mut a, of_a) = assembled::<B>(context, &case.a)?;
    let (b, of_b) = assembled::<B>(context, &case.b)?;
    let (c, of_c) = assembled::<B>(context, &case.c)?;
    let pattern = &*case.a.pattern;

    let transposed: Vec<_> = of_a.iter().map(DenseReference::transposed).collect();
    check_matrix::<B>("A^T", &tried(a.transpose())?, &pattern.transpose(), &transposed)?;

    let product: Vec<_> = of_a.iter().zip(&of_c).map(|(a, c)| a.product(c)).collect();
    let pattern_of_product = tried(pattern.product(&case.c.pattern))?;
    check_matrix::<B>("A C", &tried(a.product(&c))?, &pattern_of_product, &product)?;

    let [x, y] = case.factors;
    let factor = |x: f64| scalar::<B>(|lane| x * sign_in_lane(lane));
    let combined = |x: f64, y: f64| -> Vec<DenseReference> {
        let of_lane = |(lane, (a, b)): (usize, (&DenseReference, &DenseReference))| {
            let pairs = a.values.iter().zip(&b.values);
            let values = pairs.map(|(a, b)| sign_in_lane(lane) * (x * a + y * b)).collect();
            DenseReference { values, ..*a }
        };
        of_a.iter().zip(&of_b).enumerate().map(of_lane).collect()
    };
    let union = tried(pattern.union(&case.b.pattern))?;
    check_matrix::<B>("x A + y B", &tried(a.sum(factor(x), &b, factor(y)))?, &union, &combined(x, y))?;
    let narrow = tried(B::matrix(context, &std::sync::Arc::new(Sparsity::full(a.shape().0 + 1, a.shape().1))))?;
    expect_size("a sum", a.sum(factor(x), &narrow, factor(y)).map(drop), a.shape().0)?;
    let long = tried(B::matrix(context, &std::sync::Arc::new(Sparsity::full(a.shape().1 + 1, 2))))?;
    expect_size("a product", a.product(&long).map(drop), a.shape().1)?;

    tried(a.scale(factor(x)))?;
    check_matrix::<B>("x A", &a, pattern, &combined(x, 0.0))
}

/// Assembles the sum of the blocks; also returns its expected entries in every lane.
fn assembled<B: Backend>(context: &B::Context, sum: &Sum) -> Result<(B::Matrix, Vec<DenseReference>), String> {
    let mut a = tried(B::matrix(context, &sum.pattern))?;
    let mut expected = vec![DenseReference::zeros(sum.pattern.rows(), sum.pattern.cols()); lanes::<B>()];
    for (block, values) in &sum.blocks {
        tried(a.add(&indices::<B>(&block.rows), &indices::<B>(&block.cols), &scalars::<B>(values)))?;
        for (row, column, value) in block.entries(values) {
            for (lane, expected) in expected.iter_mut().enumerate() {
                *expected.at(row, column) += number_in_lane(value, lane);
            }
        }
    }
    tried(a.finish())?;
    Ok((a, expected))
}

/// Checks that the iteration visits every stored entry once, row by row, with the expected values, and that all entries
/// of `pattern` are stored. A backend may store other entries, which must be zero.
fn check_matrix<B: Backend<Matrix: Entries<B>>>(
    what: &str,
    found: &B::Matrix,
    pattern: &Sparsity,
    expected: &[DenseReference],
) -> Outcome {
    let (rows, cols) = (expected[0].rows, expected[0].cols);
    equal("the shape", found.shape(), (rows, cols))?;
    let mut visited = Vec::new();
    tried(found.for_each(|row, column, value| visited.push((row, column, value))))?;
    let stored = tried(found.pattern())?;
    let positions = (0..rows).flat_map(|row| stored.row(row).iter().map(move |&column| (row, column as usize)));
    let order: Vec<_> = visited.iter().map(|&(row, column, _)| (row, column)).collect();
    equal("the positions of the entries", order, positions.collect())?;
    for (row, column, value) in &visited {
        same(format_args!("entry ({row}, {column}) of {what}"), value, |lane| expected[lane].get(*row, *column))?;
    }
    for row in 0..rows {
        let missing = pattern.row(row).iter().find(|&&column| stored.find(row, column as usize).is_none());
        equal("a column of the pattern that the matrix lacks", missing, None)?;
    }
    Ok(())
}

/// Returns the numbers that a lane gets for numbers of the case.
fn in_lane(values: &[f64], lane: usize) -> Vec<f64> {
    values.iter().map(|&value| number_in_lane(value, lane)).collect()
}

fn all_rows<B: Backend>(len: usize) -> Vec<B::Index> {
    indices::<B>(&(0..len as i32).collect::<Vec<_>>())
}

fn vector<B: Backend>(context: &B::Context, values: &[f64]) -> Result<B::Vector, String> {
    let mut vector = tried(B::vector(context, values.len()))?;
    tried(vector.set(&all_rows::<B>(values.len()), &scalars::<B>(values)))?;
    tried(vector.finish())?;
    Ok(vector)
}

fn read<B: Backend>(vector: &B::Vector) -> Result<Vec<B::Scalar>, String> {
    let mut values = untouched::<B>(vector.len());
    tried(vector.get(&all_rows::<B>(vector.len()), &mut values))?;
    Ok(values)
}

fn check_vector<B: Backend>(what: &str, found: &B::Vector, expected: impl Fn(usize) -> Vec<f64>) -> Outcome {
    let expected: Vec<Vec<f64>> = (0..lanes::<B>()).map(expected).collect();
    equal("the length", found.len(), expected[0].len())?;
    let values = read::<B>(found)?;
    let check = |(row, value)| same(format_args!("entry {row} of {what}"), value, |lane| expected[lane][row]);
    values.iter().enumerate().try_for_each(check)
}

/// Checks that an operation with operands of different sizes returns an error with the expected size.
fn expect_size<F: std::error::Error>(what: &str, found: Result<(), SolveError<F>>, size: usize) -> Outcome {
    match found {
        Err(SolveError::Size { expected, .. }) if expected == size => Ok(()),
        other => Err(format!("{what} with an operand of wrong size: {other:?} instead of an error")),
    }
}

fn wrong_sizes<B: Backend>(context: &B::Context, a: &B::Matrix) -> Outcome {
    let (rows, cols) = a.shape();
    let vector = |len: usize| tried(B::vector(context, len));
    expect_size("A x", a.mul(&vector(cols)?, &mut vector(rows + 1)?), rows)?;
    expect_size("A x", a.mul(&vector(cols + 1)?, &mut vector(rows)?), cols)?;
    expect_size("A^T x", a.mul_transpose(&vector(rows)?, &mut vector(cols + 1)?), cols)?;
    expect_size("A^T x", a.mul_transpose(&vector(rows + 1)?, &mut vector(cols)?), rows)?;
    expect_size("a diagonal", a.diagonal(&mut vector(rows.min(cols) + 1)?), rows.min(cols))
}

fn diagonals<B: Backend>(context: &B::Context, a: &B::Matrix, expected: &[DenseReference]) -> Outcome {
    let len = expected[0].rows.min(expected[0].cols);
    let entry = |lane: usize, k: usize| expected[lane].get(k, k);
    let mut d = vector::<B>(context, &vec![5.0; len])?;
    tried(a.diagonal(&mut d))?;
    check_vector::<B>("the diagonal", &d, |lane| (0..len).map(|k| entry(lane, k)).collect())?;
    let first_zero = (0..len).find(|&k| (0..lanes::<B>()).any(|lane| entry(lane, k) == 0.0));
    match (a.inverse_diagonal(&mut d), first_zero) {
        (Ok(()), None) => read::<B>(&d)?.iter().enumerate().try_for_each(|(k, value)| {
            let inverse = |lane: usize| 1.0 / entry(lane, k);
            let tolerance = |lane: usize| epsilon::<B>() * inverse(lane).abs();
            within(format_args!("the inverse of diagonal entry {k}"), value, inverse, tolerance)
        }),
        (Err(SolveError::ZeroDiagonal { row }), Some(first)) => equal("the row of the first zero", row, first),
        (outcome, first) => Err(format!("the inverse of a diagonal with its first zero at {first:?}: {outcome:?}")),
    }
}
