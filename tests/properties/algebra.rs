//! Products, sums, transposes, diagonals, and all entries.

use biotissue::las::conformance::Oracle;
use biotissue::las::{Backend, Entries, MatMat, MatVec, MatrixOps, SolveError, Sparsity, VectorOps};
use proptest::test_runner::TestCaseError;

use super::draw::{AlgebraCase, Filled};
use super::{
    Outcome, absolute, at, check, done, epsilon, equal, exactly, factor, factor_in_lane, in_lane, lanes, scalars,
    untouched,
};

pub fn agree<B: Backend<Index = i32>>(context: &B::Context, case: &AlgebraCase) -> Outcome {
    let (mut a, of_a) = filled::<B>(context, &case.a)?;
    let (b, of_b) = filled::<B>(context, &case.b)?;
    let (c, of_c) = filled::<B>(context, &case.c)?;
    let pattern = &*case.a.pattern;
    same::<B>("A", &a, pattern, &of_a)?;
    times_vectors::<B>(context, &a, &of_a, case)?;
    diagonals::<B>(context, &a, &of_a)?;

    let transposed: Vec<Oracle> = of_a.iter().map(Oracle::transposed).collect();
    same::<B>("A^T", &done(a.transpose())?, &pattern.transpose(), &transposed)?;

    let product: Vec<Oracle> = of_a.iter().zip(&of_c).map(|(a, c)| a.product(c)).collect();
    let sizes = of_a.iter().zip(&of_c).map(|(a, c)| absolute(a).product(&absolute(c)));
    let pattern_of_product = done(pattern.product(&case.c.pattern))?;
    let found = done(a.product(&c))?;
    near::<B>("A C", &found, &pattern_of_product, &product, &sizes.collect::<Vec<_>>(), pattern.cols())?;

    let [x, y] = case.factors;
    let sum = of_a.iter().zip(&of_b).enumerate().map(|(lane, (a, b))| {
        let (x, y) = (factor_in_lane(x, lane), factor_in_lane(y, lane));
        Oracle { values: a.values.iter().zip(&b.values).map(|(a, b)| x * a + y * b).collect(), ..*a }
    });
    let union = done(pattern.union(&case.b.pattern))?;
    let found = done(a.sum(factor::<B>(x), &b, factor::<B>(y)))?;
    same::<B>("x A + y B", &found, &union, &sum.collect::<Vec<_>>())?;

    done(a.scale(factor::<B>(x)))?;
    let scaled = of_a.iter().enumerate().map(|(lane, a)| {
        let x = factor_in_lane(x, lane);
        Oracle { values: a.values.iter().map(|value| x * value).collect(), ..*a }
    });
    same::<B>("x A", &a, pattern, &scaled.collect::<Vec<_>>())
}

/// The sum of its blocks, and what that is in every lane.
fn filled<B: Backend<Index = i32>>(
    context: &B::Context,
    filled: &Filled,
) -> Result<(B::Matrix, Vec<Oracle>), TestCaseError> {
    let mut a = done(B::matrix(context, &filled.pattern))?;
    let mut expected = vec![Oracle::zeros(filled.pattern.rows(), filled.pattern.cols()); lanes::<B>()];
    for (block, values) in &filled.blocks {
        let values = &values[..block.pairs().count()];
        done(a.add(&block.rows, &block.cols, &scalars::<B>(values)))?;
        for ((row, column), &value) in block.pairs().zip(values).filter(|((r, c), _)| *r >= 0 && *c >= 0) {
            for (lane, expected) in expected.iter_mut().enumerate() {
                *expected.at(row as usize, column as usize) += in_lane(value, lane);
            }
        }
    }
    done(a.finish())?;
    Ok((a, expected))
}

fn same<B: Backend>(what: &str, found: &B::Matrix, pattern: &Sparsity, expected: &[Oracle]) -> Outcome {
    let exact: Vec<Oracle> = expected.iter().map(|a| Oracle::zeros(a.rows, a.cols)).collect();
    near::<B>(what, found, pattern, expected, &exact, 0)
}

/// All entries, row after row and each once, as near as sums of so many terms of those sizes come. Those of `pattern` are
/// among them; a backend may have others, which are zero.
fn near<B: Backend>(
    what: &str,
    found: &B::Matrix,
    pattern: &Sparsity,
    expected: &[Oracle],
    sizes: &[Oracle],
    terms: usize,
) -> Outcome {
    let (rows, cols) = (expected[0].rows, expected[0].cols);
    equal("the shape", found.shape(), (rows, cols))?;
    let mut visited = Vec::new();
    done(found.for_each(|row, column, value| visited.push((row, column, value))))?;
    let own = done(found.pattern())?;
    let of_own = (0..rows).flat_map(|row| own.row(row).iter().map(move |&column| (row, column as usize)));
    equal(
        "the places of entries",
        visited.iter().map(|&(row, column, _)| (row, column)).collect::<Vec<_>>(),
        of_own.collect(),
    )?;
    let slack = (terms + 2) as f64 * epsilon::<B>();
    for (row, column, value) in &visited {
        let expected = |lane: usize| at(&expected[lane], *row, *column);
        let slack = |lane: usize| slack * at(&sizes[lane], *row, *column);
        check(format_args!("entry ({row}, {column}) of {what}"), value, expected, slack)?;
    }
    for row in 0..rows {
        let missing = pattern.row(row).iter().find(|&&column| own.find(row, column as usize).is_none());
        equal("a column that the pattern has and the matrix has not", missing, None)?;
    }
    Ok(())
}

fn vector<B: Backend<Index = i32>>(context: &B::Context, values: &[i8]) -> Result<B::Vector, TestCaseError> {
    let mut vector = done(B::vector(context, values.len()))?;
    let rows: Vec<i32> = (0..values.len() as i32).collect();
    done(vector.set(&rows, &scalars::<B>(values)))?;
    done(vector.finish())?;
    Ok(vector)
}

fn read<B: Backend<Index = i32>>(vector: &B::Vector) -> Result<Vec<B::Scalar>, TestCaseError> {
    let rows: Vec<i32> = (0..vector.len() as i32).collect();
    let mut values = untouched::<B>(rows.len());
    done(vector.get(&rows, &mut values))?;
    Ok(values)
}

fn times_vectors<B: Backend<Index = i32>>(
    context: &B::Context,
    a: &B::Matrix,
    of_a: &[Oracle],
    case: &AlgebraCase,
) -> Outcome {
    let (rows, cols) = a.shape();
    let (right, left) = (&case.right[..cols], &case.left[..rows]);
    let (x, mut y) = (vector::<B>(context, right)?, vector::<B>(context, &vec![5; rows])?);
    done(a.mul(&x, &mut y))?;
    product_is::<B>("A x", &y, of_a, right)?;
    let (x, mut y) = (vector::<B>(context, left)?, vector::<B>(context, &vec![5; cols])?);
    done(a.mul_transpose(&x, &mut y))?;
    product_is::<B>("A^T x", &y, &of_a.iter().map(Oracle::transposed).collect::<Vec<_>>(), left)
}

fn product_is<B: Backend<Index = i32>>(what: &str, found: &B::Vector, of_a: &[Oracle], x: &[i8]) -> Outcome {
    let of_lane = |lane: usize| -> Vec<f64> { x.iter().map(|&x| in_lane(x, lane)).collect() };
    let product: Vec<Vec<f64>> = of_a.iter().enumerate().map(|(lane, a)| a.times(&of_lane(lane))).collect();
    let size = |lane: usize| of_lane(lane).iter().map(|x| x.abs()).collect::<Vec<_>>();
    let sizes: Vec<Vec<f64>> = of_a.iter().enumerate().map(|(lane, a)| absolute(a).times(&size(lane))).collect();
    let slack = (x.len() + 2) as f64 * epsilon::<B>();
    for (row, value) in read::<B>(found)?.iter().enumerate() {
        let slack = |lane: usize| slack * sizes[lane][row];
        check(format_args!("entry {row} of {what}"), value, |lane| product[lane][row], slack)?;
    }
    Ok(())
}

fn diagonals<B: Backend<Index = i32>>(context: &B::Context, a: &B::Matrix, of_a: &[Oracle]) -> Outcome {
    let len = of_a[0].rows.min(of_a[0].cols);
    let entry = |lane: usize, k: usize| at(&of_a[lane], k, k);
    let mut d = vector::<B>(context, &vec![5; len])?;
    done(a.diagonal(&mut d))?;
    for (k, value) in read::<B>(&d)?.iter().enumerate() {
        check(format_args!("diagonal entry {k}"), value, |lane| entry(lane, k), exactly)?;
    }
    let first_zero = (0..len).find(|&k| (0..lanes::<B>()).any(|lane| entry(lane, k) == 0.0));
    match (a.inverse_diagonal(&mut d), first_zero) {
        (Ok(()), None) => {
            for (k, value) in read::<B>(&d)?.iter().enumerate() {
                let inverse = |lane: usize| 1.0 / entry(lane, k);
                let slack = |lane: usize| epsilon::<B>() * inverse(lane).abs();
                check(format_args!("the inverse of diagonal entry {k}"), value, inverse, slack)?;
            }
            Ok(())
        }
        (Err(SolveError::ZeroDiagonal { row }), Some(first)) => equal("the row of the first zero", row, first),
        (outcome, first) => {
            let text = format!("the inverse of a diagonal with its first zero at {first:?}: {outcome:?}");
            Err(TestCaseError::fail(text))
        }
    }
}
