//! The preconditioners of this backend.

use super::ilut::Ilut;
use super::solve::SparseScalar;
use super::{Failure, Sparse, Symbolic, Vector, multigrid};
use crate::backends::iterative::{ApproximateInverse, SimplePreconditioner};
use crate::las::Preconditioner;

/// Creates a preconditioner.
pub(super) fn preconditioner<T: SparseScalar>(
    symbolic: &Symbolic,
    kind: Preconditioner,
) -> Result<Box<dyn ApproximateInverse<Sparse<T>>>, Failure> {
    let zeros = || Vector::from(vec![T::zero(); symbolic.unknowns()]);
    let inverse: Box<dyn ApproximateInverse<Sparse<T>>> = match kind {
        Preconditioner::None => Box::new(SimplePreconditioner::<Sparse<T>>::None),
        Preconditioner::Diagonal => Box::new(SimplePreconditioner::<Sparse<T>>::diagonal(zeros())),
        Preconditioner::Ilut { drop_tolerance, fill } => Box::new(Ilut::<T>::new(drop_tolerance, fill)),
        Preconditioner::Multigrid => multigrid::preconditioner::<T>(&symbolic.pattern, symbolic.params.symmetry)?,
    };
    Ok(inverse)
}
