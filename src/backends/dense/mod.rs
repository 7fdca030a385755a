//! `dense`: matrices that store every entry; the backend for small systems and a reference for comparisons.
//!
//! A [`Sparsity`] determines only the shape of a matrix: every position within it is stored and can be written. The
//! factorizations are those of the crate `faer`: Cholesky, LDL^T with a variant of Bunch-Kaufman pivoting, and LU with
//! partial pivoting.

mod matrix;
mod ops;
mod products;
mod solve;

use std::convert::Infallible;
use std::marker::PhantomData;
use std::sync::Arc;

pub use matrix::Matrix;
use solve::DenseScalar;
pub use solve::{Solver, Symbolic};

use crate::backends::checks::check_analyzable;
use crate::backends::local::contiguous_vector;
use crate::las::{Backend, SolveError, SolverParams, Sparsity};

type Failure = SolveError<Infallible>;

/// The backend of dense matrices; `T` is `f64` or `f32`.
#[derive(Clone, Copy, Debug, Default)]
pub struct Dense<T = f64>(PhantomData<fn() -> T>);

contiguous_vector!();

impl<T: DenseScalar> Backend for Dense<T> {
    const NAME: &'static str = "dense";

    type Scalar = T;
    type Index = i32;
    type Reduced = T;
    type Context = ();
    type Error = Infallible;
    type Slot = usize;
    type Vector = Vector<T>;
    type Matrix = Matrix<T>;
    type Symbolic = Symbolic;
    type Solver = Solver<T>;

    fn vector(_: &(), len: usize) -> Result<Vector<T>, Infallible> {
        Ok(Vector::from(vec![T::zero(); len]))
    }

    fn matrix(_: &(), pattern: &Arc<Sparsity>) -> Result<Matrix<T>, Infallible> {
        Ok(Matrix::zeros(pattern))
    }

    fn analyze(_: &(), pattern: &Arc<Sparsity>, params: &SolverParams) -> Result<Arc<Symbolic>, Failure> {
        check_analyzable(pattern, params)?;
        Ok(Arc::new(Symbolic { unknowns: pattern.rows(), params: *params }))
    }

    fn solver(symbolic: &Arc<Symbolic>) -> Result<Solver<T>, Failure> {
        T::solver(symbolic)
    }
}
