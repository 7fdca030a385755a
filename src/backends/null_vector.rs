//! The test whether a matrix is singular.
//!
//! The size of a pivot does not reveal whether it is a zero perturbed by rounding. For a floating body, elimination
//! without exchanges gives the last pivot as `lambda / v_n^2`, where `lambda` is the perturbed zero eigenvalue and
//! `v_n` the component of the last unknown in the rigid motion: at least `n` times the rounding error, and much more
//! near an axis of rotation. A well-supported slender body has pivots of that size too, and so has any matrix whose
//! unknowns have units of very different size. Small pivots therefore only raise doubt ([`null_vector_limit`]), and
//! [`check_null_vector`] decides: inverse iteration finds the vector `w` with the smallest `|H w| / |w|`, and a product
//! with the matrix `H` itself, scaled to entries of about one ([`Scales`]), gives that ratio.
#![cfg_attr(not(feature = "sparse"), allow(dead_code, unused_imports, reason = "some backends need only a part"))]

use num_traits::Float;

use crate::las::{
    Backend, Entries, FactorReport, Factorization, Failure, MatVec, MatrixOps, Scalar, SolveError, SolverParams,
    VectorOps,
};

/// A backend of single numbers whose matrices are in the memory of this process.
pub(super) trait InMemory: Backend<Scalar: Scalar, Context = (), Matrix: Entries<Self>> {}

impl<B: Backend<Scalar: Scalar, Context = (), Matrix: Entries<B>>> InMemory for B {}

/// Decides whether a matrix of `n` unknowns may be singular although no pivot is zero, given the ratio of the smallest
/// to the largest pivot. If so, returns the limit of `|H w| / |w|` above which the scaled matrix `H` counts as regular.
/// Returns `None` if there is no doubt or if the caller set a limit for pivots.
///
/// Assembly, factorization, solve and product each cause errors of the rounding unit in sums of independent terms;
/// their effect on an eigenvalue grows like the square root of the number of terms in a row, which is at most `n`.
pub(super) fn null_vector_limit<T: Scalar>(params: &SolverParams, n: usize, ratio: f64) -> Option<f64> {
    let epsilon = T::epsilon().as_f64();
    let is_doubtful = params.singular_below.is_none() && ratio < epsilon.sqrt();
    is_doubtful.then(|| (32.0 + 2.0 * (n as f64).sqrt()) * epsilon)
}

/// Row and column scales `R` and `C` such that the largest entries of the rows and columns of `H = R^-1 A C^-1` are of
/// order one. The scales are powers of two and so cause no rounding errors.
pub(super) struct Scales {
    rows: Vec<f64>,
    columns: Vec<f64>,
    /// The number of unknowns before those of this rank, and that of all ranks.
    first: usize,
    total: usize,
}

impl Scales {
    /// Returns the square roots of a positive diagonal, for rows and columns: nearly optimal scales for a positive
    /// definite matrix (van der Sluis 1969).
    pub(super) fn of_diagonal(diagonal: impl Iterator<Item = f64>) -> Self {
        let rows: Vec<f64> = diagonal.map(|entry| power_of_two(if entry > 0.0 { entry.sqrt() } else { 1.0 })).collect();
        Self { columns: rows.clone(), first: 0, total: rows.len(), rows }
    }

    /// Returns the same scales for the rows from `first` of a system of `total` unknowns, of which each rank holds a
    /// part.
    #[cfg(feature = "petsc")]
    pub(super) fn of_part(self, first: usize, total: usize) -> Self {
        Self { first, total, ..self }
    }

    /// Returns the scales of a matrix with `n` rows, all on this rank, for factors of this kind: by its diagonal for
    /// Cholesky, by equilibration for others.
    fn of_matrix<B: InMemory>(a: &B::Matrix, kind: Factorization, n: usize) -> Result<Self, Failure<B>> {
        if kind != Factorization::Cholesky {
            return Ok(Self::equilibrating::<B>(a, n)?);
        }
        let mut diagonal = B::vector(&(), n)?;
        a.diagonal(&mut diagonal)?;
        let scales = |entries: &[B::Scalar]| Self::of_diagonal(entries.iter().map(|entry| entry.as_f64()));
        Ok(diagonal.with_local(scales)?)
    }

    /// Equilibrates any matrix whose entries are all on this rank, by repeated division by the square roots of the
    /// largest entries (Ruiz, A scaling algorithm to equilibrate both rows and columns norms in matrices,
    /// RAL-TR-2001-034). The row and column scales of a symmetric matrix are equal.
    fn equilibrating<B: InMemory>(a: &B::Matrix, n: usize) -> Result<Self, B::Error> {
        /// Each pass halves the number of digits by which the scales are off, which is at most 308.
        const PASSES: usize = 12;
        let mut scales = Self { rows: vec![1.0; n], columns: vec![1.0; n], first: 0, total: n };
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

/// Returns the largest power of two not above a positive number.
fn power_of_two(x: f64) -> f64 {
    x.log2().floor().exp2()
}

/// Searches by inverse iteration for a vector `w` with `|H w| < limit |w|`, where `H` is the matrix `A` scaled by
/// `scales` to entries of about one. Returns [`SolveError::Singular`] if it finds one, or if a solve gives values that
/// are not finite. A regular matrix is not mistaken for a singular one, even if its factors grew, because the test
/// multiplies by the matrix itself. Otherwise returns an unknown whose equation the factors do not solve accurately, if
/// there is one: its digits were lost when rows of much larger magnitude were added to it.
///
/// `solve` applies the inverse of `A` by its factors, which are of the given `kind`. For a Cholesky factor, the
/// function uses the Rayleigh quotient `w . H w / |w|^2`, in which errors of `w` enter only quadratically.
pub(super) fn check_null_vector<B: Backend<Scalar: Scalar>>(
    context: &B::Context,
    a: &B::Matrix,
    kind: Factorization,
    scales: &Scales,
    limit: f64,
    mut solve: impl FnMut(&B::Vector, &mut B::Vector) -> Result<(), Failure<B>>,
) -> Result<Option<usize>, Failure<B>> {
    /// Each iteration reduces the other components of the vector by the ratio of the two smallest eigenvalues.
    const ITERATIONS: usize = 3;
    /// The component of a random vector along another vector is at least this fraction of its length, divided by the
    /// square root of the number of unknowns, in all but one of ten thousand cases.
    const ALONG: f64 = 1e-4;
    let ranks = Ranks::<B> { context, first: scales.first };
    let read = |x: &B::Vector| x.with_local(|x| x.iter().map(|x| x.as_f64()).collect::<Vec<f64>>());
    let (mut right, mut x) = (B::vector(context, scales.rows.len())?, B::vector(context, scales.rows.len())?);
    let mut w = random(scales.first, scales.rows.len());
    for iteration in 0..ITERATIONS {
        let length = ranks.norm(&w)?;
        let given: Vec<f64> = w.iter().map(|w| w / length).collect();
        write::<B>(&mut right, given.iter().zip(&scales.rows).map(|(w, r)| w * r))?;
        solve(&right, &mut x)?;
        w = read(&x)?.iter().zip(&scales.columns).map(|(x, c)| x * c).collect();
        let length = ranks.norm(&w)?;
        if !length.is_finite() {
            let unknown = ranks.first_not_finite(&w)?;
            return Err(SolveError::Singular { unknown, ratio: 0.0, limit });
        }
        write::<B>(&mut x, w.iter().zip(&scales.columns).map(|(w, c)| w / (c * length)))?;
        a.mul(&x, &mut right)?;
        let product: Vec<f64> = read(&right)?.iter().zip(&scales.rows).map(|(y, r)| y / r).collect();
        let resistance = if kind == Factorization::Cholesky {
            ranks.sum(product.iter().zip(&w).map(|(y, w)| y * w / length).sum())?.abs()
        } else {
            ranks.norm(&product)?
        };
        if resistance < limit {
            return Err(SolveError::Singular { unknown: ranks.position_of_largest(&w)?, ratio: resistance, limit });
        }
        let errors: Vec<f64> = product.iter().zip(&given).map(|(y, b)| y - b / length).collect();
        if ranks.norm(&errors)? > B::Scalar::epsilon().as_f64().sqrt() {
            return Ok(Some(ranks.position_of_largest(&errors)?));
        }
        if iteration == 0 && length * limit < ALONG / (scales.total as f64).sqrt() {
            return Ok(None);
        }
    }
    Ok(None)
}

/// Searches for a null vector of a matrix in memory if a pivot is small, unless the caller set a limit for pivots;
/// `solve` solves with the factors. Returns an unknown whose equation the factors do not solve accurately, if there is
/// one.
pub(super) fn check_near_singular<B: InMemory>(
    a: &B::Matrix,
    report: &FactorReport,
    params: &SolverParams,
    solve: impl FnMut(&B::Vector, &mut B::Vector) -> Result<(), Failure<B>>,
) -> Result<Option<usize>, Failure<B>> {
    let (n, _) = a.shape();
    let Some(limit) = null_vector_limit::<B::Scalar>(params, n, report.pivot_ratio) else { return Ok(None) };
    let scales = Scales::of_matrix::<B>(a, report.kind, n)?;
    check_null_vector::<B>(&(), a, report.kind, &scales, limit, solve)
}

/// Returns the report of a factorization without zero pivots, or [`SolveError::Singular`] if the matrix has a null
/// vector or the factors do not solve an equation accurately; `solve` solves with the factors.
pub(super) fn checked_report<B: InMemory>(
    a: &B::Matrix,
    report: FactorReport,
    params: &SolverParams,
    solve: impl FnMut(&B::Vector, &mut B::Vector) -> Result<(), Failure<B>>,
) -> Result<FactorReport, Failure<B>> {
    match check_near_singular::<B>(a, &report, params, solve)? {
        Some(unknown) => {
            let (ratio, limit) = (report.pivot_ratio, B::Scalar::epsilon().as_f64());
            Err(SolveError::Singular { unknown, ratio, limit })
        }
        None => Ok(report),
    }
}

fn write<B: Backend<Scalar: Scalar>>(x: &mut B::Vector, values: impl Iterator<Item = f64>) -> Result<(), Failure<B>> {
    let fill =
        |place: &mut [B::Scalar]| place.iter_mut().zip(values).for_each(|(place, value)| *place = B::Scalar::of(value));
    Ok(x.with_local_mut(fill)?)
}

/// The ranks that hold parts of a vector; a single one for a backend that does not distribute vectors.
struct Ranks<'a, B: Backend> {
    context: &'a B::Context,
    /// The number of unknowns before those of this rank.
    first: usize,
}

impl<B: Backend> Ranks<'_, B> {
    fn sum(&self, value: f64) -> Result<f64, B::Error> {
        let mut values = [value];
        B::sum(self.context, &mut values)?;
        Ok(values[0])
    }

    fn max(&self, value: f64) -> Result<f64, B::Error> {
        let mut values = [value];
        B::max(self.context, &mut values)?;
        Ok(values[0])
    }

    fn norm(&self, w: &[f64]) -> Result<f64, B::Error> {
        Ok(self.sum(w.iter().map(|w| w * w).sum())?.sqrt())
    }

    /// Returns the first unknown whose value is not finite; 0 if there is none. Numbers of unknowns are exact in double
    /// precision.
    fn first_not_finite(&self, w: &[f64]) -> Result<usize, B::Error> {
        let position = w.iter().position(|w| !w.is_finite());
        let first = -self.max(position.map_or(f64::NEG_INFINITY, |position| -((self.first + position) as f64)))?;
        Ok(if first.is_finite() { first as usize } else { 0 })
    }

    /// Returns the last of the unknowns with the largest magnitude.
    fn position_of_largest(&self, w: &[f64]) -> Result<usize, B::Error> {
        let found = w.iter().map(|w| w.abs()).enumerate().max_by(|a, b| a.1.total_cmp(&b.1));
        let largest = self.max(found.map_or(0.0, |(_, value)| value))?;
        let candidate =
            found.filter(|&(_, value)| value >= largest).map_or(-1.0, |(position, _)| (self.first + position) as f64);
        Ok(self.max(candidate)?.max(0.0) as usize)
    }
}

/// Returns numbers between -1 and 1, from position `first` of a fixed sequence.
fn random(first: usize, count: usize) -> Vec<f64> {
    // Each number adds this constant to the state.
    let mut state = 0x5eed_u64.wrapping_add(0x9e37_79b9_7f4a_7c15_u64.wrapping_mul(first as u64));
    (0..count).map(|_| crate::las::splitmix64(&mut state) as i64 as f64 / i64::MAX as f64).collect()
}
