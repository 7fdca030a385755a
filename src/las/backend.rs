//! What a linear-algebra backend is: one bound, `B: Backend`, that all physics of this crate is generic over.

use std::fmt::Debug;
use std::sync::Arc;

use super::{Entries, Index, MatMat, MatVec, MatrixOps, SolveError, Solver, SolverParams, Sparsity, Value, VectorOps};

/// A linear-algebra backend: a zero-sized marker that names its types and makes them.
///
/// A backend is chosen at compile time. Code that assembles and solves is written once, `fn assemble<B: Backend>(..)`,
/// and the verbs of [`VectorOps`] and [`MatrixOps`] inline into what a direct call of the backend compiles to, instruction by
/// instruction; where that is a call of PETSc, they work on the memory of its objects and execute no more than the call does.
/// `docs/overhead.md` counts both.
///
/// ```
/// use std::sync::Arc;
/// use biotissue::las::{Backend, MatrixOps, Solver, SolverParams, Sparsity, VectorOps};
///
/// /// Solves the 2x2 system [[2, 1], [1, 3]] x = [3, 4]; the solution is [1, 1].
/// fn two_by_two<B: Backend<Scalar = f64, Index = i32>>(context: &B::Context) -> Result<[f64; 2], Box<dyn std::error::Error>> {
///     let pattern = Arc::new(Sparsity::from_elements(2, [[0, 1]])?);
///     let mut a = B::matrix(context, &pattern)?;
///     a.add(&[0, 1], &[0, 1], &[2.0, 1.0, 1.0, 3.0])?;
///     a.finish()?;
///     let (mut b, mut x) = (B::vector(context, 2)?, B::vector(context, 2)?);
///     b.set(&[0, 1], &[3.0, 4.0])?;
///     b.finish()?;
///     let mut solver = B::solver(&B::analyze(context, &pattern, &SolverParams::default())?)?;
///     solver.factor(&a)?;
///     solver.solve(&b, &mut x)?;
///     let mut values = [0.0; 2];
///     x.get(&[0, 1], &mut values)?;
///     Ok(values)
/// }
/// # #[cfg(feature = "sparse")]
/// # assert!((two_by_two::<biotissue::backends::sparse::Sparse>(&()).unwrap()[0] - 1.0).abs() < 1e-15);
/// ```
pub trait Backend: Copy + Default + Debug + Send + Sync + 'static {
    /// The name of the backend, as its cargo feature and the program's `--backend` spell it.
    const NAME: &'static str;

    /// What matrices and vectors hold.
    type Scalar: Value;
    /// How rows and columns are addressed.
    type Index: Index;
    /// What `norm` and `dot` return: the scalar, or one scalar a lane.
    type Reduced: Value;
    /// What the backend needs at run time (communicator, device, lanes); `()` if nothing.
    type Context: Send + Sync;
    /// How a verb can fail; [`std::convert::Infallible`] for a backend that cannot.
    type Fault: std::error::Error + Send + Sync + 'static;
    /// A position in a matrix, located once and written to many times (see [`MatrixOps::locate`]).
    type Slot: Copy + Debug + Send + Sync + 'static;
    /// A vector.
    type Vector: VectorOps<Self> + Send;
    /// A matrix with a fixed pattern.
    type Matrix: MatrixOps<Self> + MatVec<Self> + MatMat<Self> + Entries<Self> + Send;
    /// The symbolic part of a factorization: depends on the pattern alone and is shared by every solver of it.
    type Symbolic: Send + Sync;
    /// The numeric part: one a matrix that is factored.
    type Solver: Solver<Self>;

    /// A vector of `len` zeros.
    ///
    /// # Errors
    /// What the backend reports when it cannot make one.
    fn vector(context: &Self::Context, len: usize) -> Result<Self::Vector, Self::Fault>;

    /// A matrix of zeros with the given pattern.
    ///
    /// # Errors
    /// What the backend reports when it cannot make one.
    fn matrix(context: &Self::Context, pattern: &Arc<Sparsity>) -> Result<Self::Matrix, Self::Fault>;

    /// Orders and analyses a square pattern, once for all matrices and solvers that share it.
    ///
    /// # Errors
    /// [`SolveError::NotSquare`], or what the backend's own analysis reports.
    fn analyze(
        context: &Self::Context,
        pattern: &Arc<Sparsity>,
        params: &SolverParams,
    ) -> Result<Arc<Self::Symbolic>, SolveError<Self::Fault>>;

    /// A solver with all storage that its first factorization needs.
    ///
    /// # Errors
    /// What the backend reports when it cannot make one.
    fn solver(symbolic: &Arc<Self::Symbolic>) -> Result<Self::Solver, SolveError<Self::Fault>>;
}
