//! `batched`: `N` systems with one sparsity pattern at once, one in each lane.
//!
//! Every entry of a vector or matrix is a [`Lanes`] of `N` numbers; each operation acts on all lanes with the same
//! instructions, and `norm` and `dot` return one number per lane. All lanes share the searches in the pattern, which
//! cost more than the additions, and the symbolic factorization; [`Solver`] says which matrices are factored side by side.
//!
//! ```
//! use std::sync::Arc;
//! use biotissue::backends::batched::{Batched, Lanes};
//! use biotissue::las::{Backend, MatVec, MatrixOps, Solver, SolverParams, Sparsity, Symmetry, VectorOps};
//!
//! // Four systems: springs of stiffness 1, 2, 3, 4, each between the same two unknowns.
//! type B = Batched<f64, 4>;
//! let pattern = Arc::new(Sparsity::from_elements(2, [[0, 1]]).unwrap());
//! let mut a = B::matrix(&(), &pattern).unwrap();
//! let k = Lanes([1.0, 2.0, 3.0, 4.0]);
//! a.add(&[0, 1], &[0, 1], &[k, -k, -k, k]).unwrap();
//! let (mut x, mut y) = (B::vector(&(), 2).unwrap(), B::vector(&(), 2).unwrap());
//! x.set(&[1], &[Lanes([1.0; 4])]).unwrap();
//! a.mul(&x, &mut y).unwrap();
//! assert_eq!(y.dot(&x).unwrap(), k);
//!
//! // Another spring of stiffness 1 holds the first unknown; a force of 6 acts on the second.
//! a.add(&[0], &[0], &[Lanes([1.0; 4])]).unwrap();
//! let symbolic = B::analyze(&(), &pattern, &SolverParams::new(Symmetry::Definite)).unwrap();
//! let mut solver = B::solver(&symbolic).unwrap();
//! solver.factor(&a).unwrap();
//! let force = vec![Lanes([0.0; 4]), Lanes([6.0; 4])].into();
//! solver.solve(&force, &mut x).unwrap();
//! for lane in 0..4 {
//!     let stiffness = lane as f64 + 1.0;
//!     assert!((x.as_slice()[1].0[lane] - (6.0 + 6.0 / stiffness)).abs() < 1e-12);
//! }
//! ```

mod lanes;
mod ops;
mod solve;

use std::convert::Infallible;
use std::marker::PhantomData;
use std::sync::Arc;

pub use lanes::Lanes;
pub use solve::{Solver, Symbolic};

use crate::backends::csr;
use crate::backends::sparse::{Sparse, SparseScalar};
use crate::las::{Backend, SolveError, SolverParams, Sparsity, Value};

type Failure = SolveError<Infallible>;

/// A vector of `N` lanes.
pub type Vector<T = f64, const N: usize = 4> = csr::Vector<Lanes<T, N>>;

/// A matrix of `N` lanes: compressed rows over one pattern.
pub type Matrix<T = f64, const N: usize = 4> = csr::Matrix<Lanes<T, N>>;

/// The backend of `N` systems at once; `T` is `f64` or `f32`.
#[derive(Clone, Copy, Debug, Default)]
pub struct Batched<T = f64, const N: usize = 4>(PhantomData<fn() -> T>);

impl<T: SparseScalar, const N: usize> Backend for Batched<T, N> {
    const NAME: &'static str = "batched";

    type Scalar = Lanes<T, N>;
    type Index = i32;
    type Reduced = Lanes<T, N>;
    type Context = ();
    type Error = Infallible;
    type Slot = u32;
    type Vector = Vector<T, N>;
    type Matrix = Matrix<T, N>;
    type Symbolic = Symbolic;
    type Solver = Solver<T, N>;

    fn vector(_: &(), len: usize) -> Result<Self::Vector, Infallible> {
        Ok(csr::Vector::from(vec![Lanes::splat(T::zero()); len]))
    }

    fn matrix(_: &(), pattern: &Arc<Sparsity>) -> Result<Self::Matrix, Infallible> {
        Ok(csr::Matrix::zeros(pattern))
    }

    fn analyze(_: &(), pattern: &Arc<Sparsity>, params: &SolverParams) -> Result<Arc<Symbolic>, Failure> {
        Symbolic::new::<T, N>(pattern, params).map(Arc::new)
    }

    fn solver(symbolic: &Arc<Symbolic>) -> Result<Solver<T, N>, Failure> {
        Solver::new(symbolic)
    }

    fn factor_bytes(symbolic: &Symbolic) -> usize {
        N * Sparse::<T>::factor_bytes(symbolic.single())
    }
}
