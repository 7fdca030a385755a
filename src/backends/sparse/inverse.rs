//! The preconditioners of this backend.

use std::convert::Infallible;

use super::block::BlockScalar;
use super::ilut::Ilut;
use super::{Matrix, Sparse, Vector};
use crate::backends::direct::Pivots;
use crate::backends::iterative::{ApproximateInverse, SimplePreconditioner};
use crate::las::{Backend, Preconditioner, SolveError};

/// No preconditioner, the diagonal, or an incomplete factorization.
pub(super) enum Inverse<T: BlockScalar> {
    Simple(SimplePreconditioner<Sparse<T>>),
    Ilut(Box<Ilut<T>>),
}

impl<T: BlockScalar> Inverse<T> {
    pub(super) fn new(unknowns: usize, preconditioner: Preconditioner) -> Result<Self, SolveError<Infallible>> {
        match preconditioner {
            Preconditioner::None => Ok(Self::Simple(SimplePreconditioner::None)),
            Preconditioner::Diagonal => {
                Ok(Self::Simple(SimplePreconditioner::Diagonal(Vector::from(vec![T::zero(); unknowns]))))
            }
            Preconditioner::Ilut { drop_tolerance, fill } => Ok(Self::Ilut(Box::new(Ilut::new(drop_tolerance, fill)))),
            Preconditioner::Multigrid => Err(SolveError::Unsupported {
                backend: Sparse::<T>::NAME,
                what: "multigrid",
                cure: "take an incomplete factorization, or the backend `petsc`",
            }),
        }
    }

    /// Returns the number of values in the incomplete factorization, if there is one.
    pub(super) fn entries(&self) -> Option<usize> {
        match self {
            Self::Simple(_) => None,
            Self::Ilut(ilut) => Some(ilut.entries()),
        }
    }
}

impl<T: BlockScalar> ApproximateInverse<Sparse<T>> for Inverse<T> {
    fn compute(&mut self, a: &Matrix<T>) -> Result<Option<Pivots>, SolveError<Infallible>> {
        match self {
            Self::Simple(simple) => simple.compute(a),
            Self::Ilut(ilut) => ilut.factor(a).map(Some),
        }
    }

    fn apply(&self, x: &Vector<T>, y: &mut Vector<T>) -> Result<(), SolveError<Infallible>> {
        match self {
            Self::Simple(simple) => simple.apply(x, y),
            Self::Ilut(ilut) => {
                ilut.apply(x, y);
                Ok(())
            }
        }
    }
}
