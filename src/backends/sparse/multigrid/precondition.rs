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
        self.multigrid.set_near_null_space(vectors)
    }
}

#[cfg(test)]
mod tests {
    use std::cell::Cell;
    use std::sync::atomic::{AtomicBool, Ordering};
    use std::sync::{Arc, Barrier};

    use super::*;
    use crate::las::MatrixOps;
    use crate::parallel;

    thread_local! {
        static IS_ALONE: Cell<bool> = const { Cell::new(false) };
    }

    /// An RVE is solved by a thread that holds a lock: while it waited for others, it might start another RVE.
    #[test]
    fn a_thread_that_is_alone_starts_no_other_task() {
        let side = 90;
        let at = |i: i32, j: i32| side * i + j;
        let edges: Vec<[i32; 2]> = (0..side)
            .flat_map(|i| (1..side).flat_map(move |j| [[at(i, j - 1), at(i, j)], [at(j - 1, i), at(j, i)]]))
            .collect();
        let pattern = Arc::new(Sparsity::from_elements((side * side) as usize, edges.iter().copied()).unwrap());
        let mut laplacian = Matrix::<f64>::zeros(&pattern);
        for edge in &edges {
            MatrixOps::<Sparse>::add(&mut laplacian, edge, edge, &[1.0, -1.0, -1.0, 1.0]).unwrap();
        }
        MatrixOps::<Sparse>::add(&mut laplacian, &[0], &[0], &[1.0]).unwrap();
        let starts_others = Arc::new(AtomicBool::new(false));
        let pool = rayon::ThreadPoolBuilder::new().num_threads(2).build().unwrap();
        let barrier = Barrier::new(2);
        std::thread::scope(|scope| {
            // Tasks from outside of the pool: its other thread takes parts of loops first, so that a loop would wait.
            scope.spawn(|| {
                barrier.wait();
                for _ in 0..400 {
                    let starts_others = Arc::clone(&starts_others);
                    pool.spawn(move || {
                        starts_others.fetch_or(IS_ALONE.get(), Ordering::Relaxed);
                        std::thread::sleep(std::time::Duration::from_millis(1));
                    });
                }
                barrier.wait();
            });
            pool.install(|| {
                barrier.wait();
                barrier.wait();
                IS_ALONE.set(true);
                parallel::alone(|| {
                    let (x, mut y) = (Vector::from(vec![1.0; pattern.rows()]), Vector::from(vec![0.0; pattern.rows()]));
                    let mut multigrid =
                        Multigrid::new(&pattern, Symmetry::Definite, MultigridParams::default()).unwrap();
                    for _ in 0..10 {
                        multigrid.set_up(&laplacian).unwrap();
                        multigrid.apply(&x, &mut y).unwrap();
                        multigrid.product(&x, &mut y).unwrap();
                    }
                });
                IS_ALONE.set(false);
            });
        });
        assert!(!starts_others.load(Ordering::Relaxed));
    }
}
