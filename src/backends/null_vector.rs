//! When a matrix counts as singular.
//!
//! A pivot that rounding left in place of a zero is not small enough to be told by its size. Elimination without exchanges
//! gives the last pivot of a body that floats as `lambda / v_n^2`, where `lambda` is what rounding made of the zero eigenvalue
//! and `v_n` the share of the last unknown in the rigid motion: `n` times rounding at least, much more near an axis of
//! rotation. A well-held slender body has pivots of that size too, and so has any matrix whose unknowns have units of very
//! different size. Small pivots therefore only raise doubt ([`in_doubt`]), and [`refuse_null_vector`] decides: inverse
//! iteration finds the vector that the matrix resists least, and a product with the matrix itself, scaled to entries of
//! about one ([`Scales`]), tells how much.

use num_traits::Float;

#[cfg(any(feature = "sparse", feature = "dense"))]
use crate::las::Entries;
use crate::las::{Backend, Factorization, MatVec, Scalar, SolveError, SolverParams, VectorOps};

/// Whether a matrix of `n` unknowns may be singular though no pivot vanishes, given the smallest pivot over the largest: what
/// the scaled matrix must resist every vector with, over its length, to count as regular. `None` where there is no doubt, or
/// where the caller judges by pivots.
///
/// Assembling, factoring, solving and multiplying each leave errors of the rounding unit in sums of independent terms: their
/// effect on an eigenvalue grows like the root of how many there are in a row, at most `n`.
pub(super) fn in_doubt<T: Scalar>(params: &SolverParams, n: usize, ratio: f64) -> Option<f64> {
    let epsilon = T::epsilon().as_f64();
    let is_doubtful = params.singular_below.is_none() && ratio < epsilon.sqrt();
    is_doubtful.then(|| (32.0 + 2.0 * (n as f64).sqrt()) * epsilon)
}

/// Scales `R` and `C` of rows and columns, such that the largest entries of the rows and columns of `H = R^-1 A C^-1` are of
/// size one. Powers of two, so that they leave no errors.
pub(super) struct Scales {
    rows: Vec<f64>,
    columns: Vec<f64>,
}

impl Scales {
    /// The roots of a positive diagonal, one for rows and columns: best for a matrix that is positive definite.
    pub(super) fn of_diagonal(diagonal: impl Iterator<Item = f64>) -> Self {
        let rows: Vec<f64> = diagonal.map(|entry| power_of_two(if entry > 0.0 { entry.sqrt() } else { 1.0 })).collect();
        Self { columns: rows.clone(), rows }
    }

    /// Of any matrix whose entries are all on this rank, by repeated division by the roots of the largest entries (Ruiz, A
    /// scaling algorithm to equilibrate both rows and columns norms in matrices, RAL-TR-2001-034). A symmetric matrix gets
    /// equal scales.
    #[cfg(any(feature = "sparse", feature = "dense"))]
    pub(super) fn equilibrating<B: Backend<Scalar: Scalar>>(a: &B::Matrix, n: usize) -> Result<Self, B::Fault> {
        /// Each halves the digits that scales are off by, of 308 at most.
        const PASSES: usize = 12;
        let mut scales = Self { rows: vec![1.0; n], columns: vec![1.0; n] };
        for _ in 0..PASSES {
            let (mut of_rows, mut of_columns) = (vec![0.0_f64; n], vec![0.0_f64; n]);
            a.for_each(|row, column, value| {
                let size = (value.as_f64() / scales.rows[row] / scales.columns[column]).abs();
                of_rows[row] = of_rows[row].max(size);
                of_columns[column] = of_columns[column].max(size);
            })?;
            let largest = of_rows.iter().chain(&of_columns).filter(|&&size| size > 0.0);
            if largest.clone().all(|size| (0.5..=2.0).contains(size)) {
                break;
            }
            for (scale, size) in scales.rows.iter_mut().zip(of_rows).chain(scales.columns.iter_mut().zip(of_columns)) {
                *scale *= power_of_two(if size > 0.0 { size.sqrt() } else { 1.0 });
            }
        }
        Ok(scales)
    }
}

/// The power of two next below a positive number.
fn power_of_two(x: f64) -> f64 {
    x.log2().floor().exp2()
}

/// Refuses a matrix `A` that resists a vector by less than `limit` times its length, once `scales` give it entries of about
/// one. No regular matrix is taken for a singular one, however its factors grew: the resistance is that of the matrix.
/// Returns an unknown whose equation the factors do not solve, if there is one: the sizes of other rows cost its digits.
///
/// `solve` applies the factors of `A`, which are of the given `kind`. Of a Cholesky factor the quotient `w . H w / |w|^2`
/// serves, which feels errors of the vector only by their squares.
pub(super) fn refuse_null_vector<B: Backend<Scalar: Scalar>>(
    context: &B::Context,
    a: &B::Matrix,
    kind: Factorization,
    scales: &Scales,
    limit: f64,
    mut solve: impl FnMut(&B::Vector, &mut B::Vector) -> Result<(), SolveError<B::Fault>>,
) -> Result<Option<usize>, SolveError<B::Fault>> {
    /// Each takes the rest of the vector down by the ratio of the least eigenvalues.
    const ITERATIONS: usize = 3;
    /// A random vector has at least this part of its length, over the root of the number of unknowns, along another: all but
    /// one of ten thousand.
    const ALONG: f64 = 1e-4;
    let n = scales.rows.len();
    let norm = |w: &[f64]| w.iter().map(|w| w * w).sum::<f64>().sqrt();
    let read =
        |x: &B::Vector| x.with_local(|x| x.iter().map(|x| x.as_f64()).collect::<Vec<f64>>()).map_err(SolveError::Fault);
    let vector = || B::vector(context, n).map_err(SolveError::Fault);
    let (mut right, mut x) = (vector()?, vector()?);
    let mut w = random(n);
    for iteration in 0..ITERATIONS {
        let length = norm(&w);
        let given: Vec<f64> = w.iter().map(|w| w / length).collect();
        write::<B>(&mut right, given.iter().zip(&scales.rows).map(|(w, r)| w * r))?;
        solve(&right, &mut x)?;
        w = read(&x)?.iter().zip(&scales.columns).map(|(x, c)| x * c).collect();
        let length = norm(&w);
        if !length.is_finite() {
            let unknown = w.iter().position(|w| !w.is_finite()).unwrap_or(0);
            return Err(SolveError::Singular { unknown, ratio: 0.0, limit });
        }
        write::<B>(&mut x, w.iter().zip(&scales.columns).map(|(w, c)| w / (c * length)))?;
        a.mul(&x, &mut right)?;
        let product: Vec<f64> = read(&right)?.iter().zip(&scales.rows).map(|(y, r)| y / r).collect();
        let resistance = if kind == Factorization::Cholesky {
            product.iter().zip(&w).map(|(y, w)| y * w / length).sum::<f64>().abs()
        } else {
            norm(&product)
        };
        if resistance < limit {
            return Err(SolveError::Singular { unknown: position_of_largest(&w), ratio: resistance, limit });
        }
        let errors: Vec<f64> = product.iter().zip(&given).map(|(y, b)| y - b / length).collect();
        if norm(&errors) > B::Scalar::epsilon().as_f64().sqrt() {
            return Ok(Some(position_of_largest(&errors)));
        }
        if iteration == 0 && length * limit < ALONG / (n as f64).sqrt() {
            return Ok(None);
        }
    }
    Ok(None)
}

fn write<B: Backend<Scalar: Scalar>>(
    x: &mut B::Vector,
    values: impl Iterator<Item = f64>,
) -> Result<(), SolveError<B::Fault>> {
    let fill =
        |place: &mut [B::Scalar]| place.iter_mut().zip(values).for_each(|(place, value)| *place = B::Scalar::of(value));
    x.with_local_mut(fill).map_err(SolveError::Fault)
}

fn position_of_largest(w: &[f64]) -> usize {
    w.iter().enumerate().max_by(|a, b| a.1.abs().total_cmp(&b.1.abs())).map_or(0, |(position, _)| position)
}

/// Numbers between -1 and 1 by SplitMix64, whose sequence never changes (Steele, Lea and Flood, OOPSLA 2014).
fn random(count: usize) -> Vec<f64> {
    let mut state = 0x5eed_u64;
    let mut next = || {
        state = state.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = state;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        (z ^ (z >> 31)) as i64 as f64 / i64::MAX as f64
    };
    (0..count).map(|_| next()).collect()
}
