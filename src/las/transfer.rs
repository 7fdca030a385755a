//! Copies of vectors and matrices from one backend to another.
//!
//! ```
//! # #[cfg(all(feature = "sparse", feature = "dense"))] {
//! use std::sync::Arc;
//! use biotissue::backends::{dense::Dense, sparse::Sparse};
//! use biotissue::las::{Backend, MatrixOps, Sparsity, transfer};
//!
//! let pattern = Arc::new(Sparsity::from_elements(3, [[0, 1], [1, 2]]).unwrap());
//! let mut a = Sparse::<f64>::matrix(&(), &pattern).unwrap();
//! a.add(&[0, 1], &[0, 1], &[2.0, -1.0, -1.0, 2.0]).unwrap();
//! let copy = transfer::matrix::<Sparse, Dense>(&a, &()).unwrap();
//! assert_eq!(copy.values(), [2.0, -1.0, 0.0, -1.0, 2.0, 0.0, 0.0, 0.0, 0.0]);
//! # }
//! ```

use thiserror::Error;

use super::{Backend, Entries, Index, MatrixOps, Scalar, Value, VectorOps};

/// The reason why a transfer failed.
#[derive(Clone, Debug, Error, PartialEq)]
pub enum TransferError<F, G> {
    /// The source backend failed.
    #[error("reading failed: {0}")]
    From(F),
    /// The target backend failed.
    #[error("writing failed: {0}")]
    To(G),
    /// The target vector has another length.
    #[error("a vector of {from} entries does not fit into one of {to}")]
    Size {
        /// Entries of the source.
        from: usize,
        /// Entries of the target.
        to: usize,
    },
}

/// Copies a vector to backend `B`: rounds it to the scalar of `B` and repeats it in every lane.
///
/// # Errors
/// Returns the error of the backend that failed.
pub fn vector<A: Backend<Scalar: Scalar>, B: Backend>(
    from: &A::Vector,
    context: &B::Context,
) -> Result<B::Vector, TransferError<A::Error, B::Error>> {
    let mut to = B::vector(context, from.len()).map_err(TransferError::To)?;
    vector_into::<A, B>(from, &mut to)?;
    Ok(to)
}

/// Copies a vector into an existing vector of backend `B`, without allocation of a vector.
///
/// # Errors
/// Returns [`TransferError::Size`] if the lengths differ, or the error of the backend that failed.
pub fn vector_into<A: Backend<Scalar: Scalar>, B: Backend>(
    from: &A::Vector,
    to: &mut B::Vector,
) -> Result<(), TransferError<A::Error, B::Error>> {
    if from.len() != to.len() {
        return Err(TransferError::Size { from: from.len(), to: to.len() });
    }
    let copy = |from: &[A::Scalar]| {
        to.with_local_mut(|to| {
            for (to, from) in to.iter_mut().zip(from) {
                *to = converted::<A, B>(*from);
            }
        })
    };
    from.with_local(copy).map_err(TransferError::From)?.map_err(TransferError::To)?;
    to.finish().map_err(TransferError::To)
}

/// Copies a matrix to backend `B`: rounds it to the scalar of `B` and repeats it in every lane.
///
/// # Errors
/// Returns the error of the backend that failed.
pub fn matrix<A: Backend<Scalar: Scalar, Matrix: Entries<A>>, B: Backend>(
    from: &A::Matrix,
    context: &B::Context,
) -> Result<B::Matrix, TransferError<A::Error, B::Error>> {
    let pattern = from.pattern().map_err(TransferError::From)?;
    let mut to = B::matrix(context, &pattern).map_err(TransferError::To)?;
    let mut outcome = Ok(());
    let copy = |row, column, value| {
        if outcome.is_ok() {
            outcome = to.set(&[B::Index::of(row)], &[B::Index::of(column)], &[converted::<A, B>(value)]);
        }
    };
    from.for_each(copy).map_err(TransferError::From)?;
    outcome.map_err(TransferError::To)?;
    to.finish().map_err(TransferError::To)?;
    Ok(to)
}

fn converted<A: Backend<Scalar: Scalar>, B: Backend>(value: A::Scalar) -> B::Scalar {
    B::Scalar::every(value.as_f64())
}
