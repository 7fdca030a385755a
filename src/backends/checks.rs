//! Checks shared by all solvers: sizes, definiteness, and the limit below which a pivot counts as zero.
#![cfg_attr(not(feature = "sparse"), allow(dead_code, unused_imports, reason = "some backends need only a part"))]

use std::sync::Arc;

use crate::las::{FactorReport, Scalar, SolveError, SolverParams, Sparsity};

/// Returns the ratio of the smallest to the largest pivot below which the matrix counts as singular if only pivots are
/// examined.
pub(super) fn singular_limit<T: Scalar>(params: &SolverParams) -> f64 {
    params.singular_below.unwrap_or(4.0 * T::epsilon().as_f64())
}

/// Returns the ratio of the smallest to the largest pivot below which the matrix counts as singular without a search
/// for a null vector.
pub(super) fn immediate_singular_limit(params: &SolverParams) -> f64 {
    params.singular_below.unwrap_or(f64::MIN_POSITIVE)
}

/// Returns an error if the factorization shows that its matrix is not positive definite, or cannot decide it.
pub(super) fn definite<F>(backend: &'static str, report: FactorReport) -> Result<FactorReport, SolveError<F>> {
    match report.negative_pivots {
        Some(0) => Ok(report),
        Some(_) => Err(SolveError::Indefinite { unknown: report.indefinite_at }),
        None => Err(SolveError::Unsupported {
            backend,
            what: "test of definiteness by LU",
            cure: "declare the matrix as `Symmetry::Definite` or `Symmetry::Symmetric`",
        }),
    }
}

/// Returns [`SolveError::Size`] if the size of an argument differs from the expected one.
pub(super) fn check_size<F>(what: &'static str, found: usize, expected: usize) -> Result<(), SolveError<F>> {
    if found == expected { Ok(()) } else { Err(SolveError::Size { what, found, expected }) }
}

/// Returns an error if no solver can be created for matrices with this pattern and these parameters.
pub(super) fn check_analyzable<F>(pattern: &Sparsity, params: &SolverParams) -> Result<(), SolveError<F>> {
    let (rows, cols) = (pattern.rows(), pattern.cols());
    if rows != cols {
        return Err(SolveError::NotSquare { rows, cols });
    }
    parameters(params)
}

/// Returns an error if a parameter is out of range.
pub(super) fn parameters<F>(params: &SolverParams) -> Result<(), SolveError<F>> {
    params.check().map_err(SolveError::Parameter)
}

/// Returns an error if the pattern of a matrix to factor differs from the analyzed one.
pub(super) fn check_pattern<F>(found: &Arc<Sparsity>, expected: &Arc<Sparsity>) -> Result<(), SolveError<F>> {
    if Arc::ptr_eq(found, expected) {
        return Ok(());
    }
    check_size("the matrix to factor (rows)", found.rows(), expected.rows())?;
    check_size("the matrix to factor (entries)", found.nnz(), expected.nnz())?;
    if found == expected { Ok(()) } else { Err(SolveError::Pattern) }
}

/// Returns [`SolveError::NotFinite`] if a value of a matrix is not finite; `all_finite` tests all values.
pub(super) fn check_finite<T: Scalar, F>(
    pattern: &Sparsity,
    values: &[T],
    all_finite: impl Fn(&[T]) -> bool,
) -> Result<(), SolveError<F>> {
    if all_finite(values) {
        return Ok(());
    }
    let bad = values.iter().position(|value| !value.is_finite()).unwrap_or(0);
    Err(SolveError::NotFinite { row: pattern.row_offsets()[1..].partition_point(|&end| end as usize <= bad) })
}

/// Returns [`SolveError::Size`] if the right-hand sides or solutions do not fit the system.
pub(super) fn check_columns<F>(
    unknowns: usize,
    b: impl ExactSizeIterator<Item = usize>,
    x: impl ExactSizeIterator<Item = usize>,
) -> Result<(), SolveError<F>> {
    check_size("the list of solutions (against that of right-hand sides)", x.len(), b.len())?;
    for len in b {
        check_size("a right-hand side", len, unknowns)?;
    }
    for len in x {
        check_size("a solution", len, unknowns)?;
    }
    Ok(())
}
