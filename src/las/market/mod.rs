//! Matrix Market files, for all backends.
//!
//! The reader supports `coordinate` and `array`; `real`, `integer` and `pattern` (all entries are 1); `general`,
//! `symmetric` and `skew-symmetric`, as defined by R. F. Boisvert, R. Pozo and K. A. Remington (*The Matrix Market
//! exchange formats: initial design*, NISTIR 5935, 1996). Repeated entries are added. The writer produces
//! `coordinate real general` with enough digits to recover the values exactly.

mod read;
#[cfg(test)]
mod tests;

use std::io::{BufWriter, Write};
use std::path::Path;
use std::sync::Arc;

use thiserror::Error;

use super::{Backend, Entries, Index, MatrixOps, Scalar, Sparsity, SparsityError};
use crate::input::InputError;
use read::Triplets;

/// The reason why a file was not read or written.
#[derive(Debug, Error)]
pub enum MarketError<F: std::error::Error> {
    /// The file cannot be read, or its content is invalid.
    #[error(transparent)]
    Input(#[from] InputError),
    /// The matrix is larger than 32-bit indices can address.
    #[error(transparent)]
    TooLarge(#[from] SparsityError),
    /// The file cannot be written.
    #[error("{file} cannot be written: {reason}", file = file.display())]
    Write {
        /// Path of the file.
        file: std::path::PathBuf,
        /// The error of the operating system.
        reason: std::io::Error,
    },
    /// The backend failed.
    #[error(transparent)]
    Backend(F),
}

/// Reads a file into a matrix of backend `B`.
///
/// # Errors
/// Returns [`MarketError`]; errors in the file state line, problem and remedy.
pub fn read<B: Backend<Scalar: Scalar>>(file: &Path, context: &B::Context) -> Result<B::Matrix, MarketError<B::Error>> {
    let bytes = std::fs::read(file).map_err(|error| InputError::unreadable(file, &error))?;
    let Triplets { rows, cols, entries } = read::triplets(file, &bytes)?;
    let pattern = Arc::new(pattern(rows, cols, &entries)?);
    let mut a = B::matrix(context, &pattern).map_err(MarketError::Backend)?;
    let add = |a: &mut B::Matrix| {
        entries.iter().try_for_each(|&(row, column, value)| {
            a.add(&[B::Index::of(row as usize)], &[B::Index::of(column as usize)], &[B::Scalar::of(value)])
        })
    };
    a.assemble(add).map_err(MarketError::Backend)?;
    Ok(a)
}

fn pattern(rows: usize, cols: usize, entries: &[(u32, u32, f64)]) -> Result<Sparsity, SparsityError> {
    let mut lists = vec![Vec::new(); rows];
    for &(row, column, _) in entries {
        lists[row as usize].push(column);
    }
    Sparsity::by_rows(cols, rows, |row, columns| columns.extend_from_slice(&lists[row]))
}

/// Writes the entries that [`Entries::for_each`] visits to a file.
///
/// # Errors
/// Returns [`MarketError::Write`] if the file cannot be written, [`MarketError::Backend`] if the backend fails.
pub fn write<B: Backend<Matrix: Entries<B>>>(file: &Path, a: &B::Matrix) -> Result<(), MarketError<B::Error>>
where
    B::Scalar: Scalar,
{
    let (rows, cols) = a.shape();
    let entries = a.pattern().map_err(MarketError::Backend)?.nnz();
    let failed = |reason| MarketError::Write { file: file.to_path_buf(), reason };
    let mut out = BufWriter::new(std::fs::File::create(file).map_err(failed)?);
    let mut written = writeln!(out, "%%MatrixMarket matrix coordinate real general\n{rows} {cols} {entries}");
    let line = |row: usize, column: usize, value: B::Scalar| {
        if written.is_ok() {
            written = writeln!(out, "{} {} {:e}", row + 1, column + 1, value);
        }
    };
    a.for_each(line).map_err(MarketError::Backend)?;
    written.and_then(|()| out.flush()).map_err(failed)
}
