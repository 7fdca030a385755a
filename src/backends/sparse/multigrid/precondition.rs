//! Multigrid as a preconditioner of the iterative solver.

use std::any::Any;

use super::{Multigrid, MultigridParams};
use crate::backends::direct::Pivots;
use crate::backends::iterative::ApproximateInverse;
use crate::backends::sparse::solve::SparseScalar;
use crate::backends::sparse::{Failure, Matrix, Sparse, Vector};
use crate::las::{Scalar, Sparsity, Symmetry};

/// A multigrid preconditioner for matrices with entries `T`; also stores the matrix.
struct Precondition {
    multigrid: Multigrid,
    /// Copies in double precision of vectors in another one.
    x: Vector,
    y: Vector,
}

/// Creates a multigrid preconditioner with default parameters.
pub(in crate::backends::sparse) fn preconditioner<T: SparseScalar>(
    pattern: &std::sync::Arc<Sparsity>,
    symmetry: Symmetry,
) -> Result<Box<dyn ApproximateInverse<Sparse<T>>>, Failure> {
    let multigrid = Multigrid::new(pattern, symmetry, MultigridParams::default())?;
    Ok(Box::new(Precondition { multigrid, x: Vec::new().into(), y: Vec::new().into() }))
}

impl Precondition {
    /// Calls `f` with vectors in double precision, and copies its result to `y`.
    fn in_double<T: Scalar>(
        &mut self,
        x: &Vector<T>,
        y: &mut Vector<T>,
        f: impl FnOnce(&mut Multigrid, &Vector, &mut Vector) -> Result<(), Failure>,
    ) -> Result<(), Failure> {
        if let (Some(x), Some(y)) =
            ((x as &dyn Any).downcast_ref::<Vector>(), (&mut *y as &mut dyn Any).downcast_mut::<Vector>())
        {
            return f(&mut self.multigrid, x, y);
        }
        let double = |x: &Vector<T>| Vector::from(x.as_slice().iter().map(|x| x.as_f64()).collect::<Vec<_>>());
        (self.x, self.y) = (double(x), double(y));
        f(&mut self.multigrid, &self.x, &mut self.y)?;
        y.as_mut_slice().iter_mut().zip(self.y.as_slice()).for_each(|(y, &value)| *y = T::of(value));
        Ok(())
    }
}

impl<T: SparseScalar> ApproximateInverse<Sparse<T>> for Precondition {
    fn compute(&mut self, a: &Matrix<T>) -> Result<Option<Pivots>, Failure> {
        self.multigrid.copy_matrix(a)?;
        self.multigrid.build()?;
        Ok(None)
    }

    fn keep(&mut self, a: &Matrix<T>) -> Result<bool, Failure> {
        self.multigrid.copy_matrix(a)?;
        Ok(true)
    }

    fn refresh(&mut self) -> Result<(), Failure> {
        self.multigrid.refresh()
    }

    fn apply(&mut self, x: &Vector<T>, y: &mut Vector<T>) -> Result<(), Failure> {
        self.in_double(x, y, Multigrid::apply)
    }

    fn stores_matrix(&self) -> bool {
        true
    }

    fn product(&mut self, x: &Vector<T>, y: &mut Vector<T>) -> Result<(), Failure> {
        self.in_double(x, y, Multigrid::product)
    }

    fn matrix(&self) -> Option<Matrix<T>> {
        let Multigrid { pattern, nodes, a, .. } = &self.multigrid;
        let mut matrix = Matrix::zeros(pattern);
        nodes.values_into(pattern, a, matrix.values_mut());
        Some(matrix)
    }

    fn uses_near_null_space(&self) -> bool {
        true
    }

    fn set_near_null_space(&mut self, vectors: &[Vec<T>]) -> Result<(), Failure> {
        let double = |x: &Vec<T>| x.iter().map(|x| x.as_f64()).collect();
        self.multigrid.set_near_null_space(&vectors.iter().map(double).collect::<Vec<_>>())
    }
}
