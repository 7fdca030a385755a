//! When a matrix counts as singular.
//!
//! A pivot that rounding left in place of a zero is not small enough to be told by its size. Elimination without exchanges
//! gives the last pivot of a body that floats as `lambda / v_n^2`, where `lambda` is what rounding made of the zero eigenvalue
//! and `v_n` the share of the last unknown in the rigid motion: `n` times rounding at least, much more near an axis of
//! rotation. A well-held slender body has pivots of that size too. Small pivots therefore only raise doubt
//! ([`is_doubtful`]), and [`null_vector`] decides: inverse iteration finds the vector that the matrix resists least, and a
//! product with the matrix itself, scaled to a unit diagonal, tells how much.

use crate::las::{Scalar, SolveError};

/// Whether a matrix of scalar `T` may be singular though no pivot vanishes, given the smallest pivot over the largest.
pub(super) fn is_doubtful<T: Scalar>(ratio: f64) -> bool {
    ratio < T::epsilon().as_f64().sqrt()
}

/// A vector that a matrix hardly resists.
#[derive(Clone, Copy, Debug)]
pub(super) struct NullVector {
    /// `|H w| / |w|`, of a definite matrix `w . H w / |w|^2`: no less than the least singular value of the scaled matrix `H`.
    pub(super) resistance: f64,
    /// The unknown that moves most.
    pub(super) unknown: usize,
}

/// Looks for a vector of the null space of `A`: `Some` where `H = S^-1 A S^-1`, which `scale` `S` gives a unit diagonal, resists
/// a vector by less than `limit` times its length. No regular matrix is taken for a singular one, however its factors grew:
/// the resistance is that of the matrix. A singular one is missed only if solving with its factors loses all digits.
///
/// `solve` applies the factors of `A`, `multiply` applies `A`; `is_definite` says that `A` has a Cholesky factor. The quotient
/// of a definite matrix feels errors of the vector only by their squares.
pub(super) fn null_vector<T: Scalar, F>(
    scale: &[f64],
    limit: f64,
    is_definite: bool,
    mut solve: impl FnMut(Vec<T>) -> Result<Vec<T>, SolveError<F>>,
    mut multiply: impl FnMut(Vec<T>) -> Result<Vec<T>, SolveError<F>>,
) -> Result<Option<NullVector>, SolveError<F>> {
    /// Each takes the rest of the vector down by the ratio of the least eigenvalues.
    const ITERATIONS: usize = 3;
    /// A random vector has at least this part of its length, over the root of the number of unknowns, along another: all but
    /// one of ten thousand.
    const ALONG: f64 = 1e-4;
    let n = scale.len();
    let norm = |w: &[f64]| w.iter().map(|w| w * w).sum::<f64>().sqrt();
    let mut w = random(n);
    let mut length = norm(&w);
    for iteration in 0..ITERATIONS {
        let right = w.iter().zip(scale).map(|(w, s)| T::of(w * s / length)).collect();
        w = solve(right)?.iter().zip(scale).map(|(x, s)| x.as_f64() * s).collect();
        length = norm(&w);
        if !length.is_finite() {
            let unknown = w.iter().position(|w| !w.is_finite()).unwrap_or(0);
            return Ok(Some(NullVector { resistance: 0.0, unknown }));
        }
        if iteration == 0 && length * limit < ALONG / (n as f64).sqrt() {
            return Ok(None);
        }
        let moved: Vec<f64> = w.iter().zip(scale).map(|(w, s)| w / (s * length)).collect();
        let product = multiply(moved.iter().map(|&x| T::of(x)).collect())?;
        let resistance = if is_definite {
            product.iter().zip(&moved).map(|(y, x)| y.as_f64() * x).sum::<f64>().abs()
        } else {
            norm(&product.iter().zip(scale).map(|(y, s)| y.as_f64() / s).collect::<Vec<f64>>())
        };
        if resistance < limit {
            let most = moved.iter().enumerate().max_by(|a, b| a.1.abs().total_cmp(&b.1.abs()));
            return Ok(most.map(|(unknown, _)| NullVector { resistance, unknown }));
        }
    }
    Ok(None)
}

/// The scale that gives a matrix a unit diagonal: the roots of its diagonal entries, or of the largest entry of the row where
/// that is not positive. `row` gives the diagonal entry and the largest of each row.
pub(super) fn unit_scale(rows: usize, row: impl Fn(usize) -> (f64, f64)) -> Vec<f64> {
    let of_row = |(diagonal, largest): (f64, f64)| {
        let size = if diagonal > 0.0 { diagonal } else { largest };
        if size > 0.0 { size.sqrt() } else { 1.0 }
    };
    (0..rows).map(|k| of_row(row(k))).collect()
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
