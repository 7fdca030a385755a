//! The trait of a linear-algebra backend. All physics of this crate is generic over `B: RealBackend`.

use std::fmt::Debug;
use std::sync::Arc;

use super::{Index, MatVec, MatrixOps, RankRows, Scalar, SolveError, Solver, SolverParams, Sparsity, Value, VectorOps};

/// A linear-algebra backend: a zero-sized marker type that names the backend's types and constructs them.
///
/// The backend is chosen at compile time. Assembly and solution code is written once, `fn assemble<B: Backend>(..)`.
/// The methods of [`VectorOps`] and [`MatrixOps`] inline to the same instructions as a direct call of the backend. With
/// PETSc they work on the memory of the PETSc objects and execute no more instructions than the PETSc call, except
/// [`VectorOps::finish`] and [`MatrixOps::finish`].
/// `docs/overhead.md` reports the instruction counts of both cases.
///
/// ```
/// use std::sync::Arc;
/// use biotissue::las::{Backend, MatrixOps, RealBackend, Solver, SolverParams, Sparsity, VectorOps};
///
/// /// Solves the 2x2 system [[2, 1], [1, 3]] x = [3, 4]; the solution is [1, 1].
/// fn two_by_two<B: RealBackend<Index = i32>>(context: &B::Context) -> Result<[f64; 2], Box<dyn std::error::Error>> {
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
    /// The name of the backend, spelled as in its cargo feature and in the program's `--backend` option.
    const NAME: &'static str;

    /// Whether iterative methods have the preconditioner [`Preconditioner::Multigrid`](super::Preconditioner::Multigrid).
    const HAS_MULTIGRID: bool = false;

    /// The type of the entries of matrices and vectors.
    type Scalar: Value;
    /// The type of row and column indices.
    type Index: Index;
    /// The return type of `norm` and `dot`: the scalar, or one scalar per lane.
    type Reduced: Value;
    /// Run-time data of the backend (communicator, device, lanes); `()` if there are none.
    type Context: Clone + Send + Sync;
    /// The error type of vector and matrix operations; [`std::convert::Infallible`] for a backend that cannot fail.
    type Error: std::error::Error + Send + Sync + 'static;
    /// A position in a matrix, located once and reused for repeated writes (see [`MatrixOps::locate`]).
    type Slot: Copy + Debug + Send + Sync + 'static;
    /// The vector type.
    type Vector: VectorOps<Self> + Send;
    /// The matrix type; the sparsity pattern of a matrix is fixed. It may also implement [`Entries`](super::Entries)
    /// and [`MatMat`](super::MatMat).
    type Matrix: MatrixOps<Self> + MatVec<Self> + Send;
    /// The symbolic factorization: depends only on the pattern and is shared by all solvers of that pattern.
    type Symbolic: Send + Sync;
    /// The numeric solver: one for each matrix that is factored.
    type Solver: Solver<Self>;

    /// Returns a context for a linear system of which this rank holds these rows; all vectors, matrices and solvers made
    /// with it use local numbers ([`RankRows`]). Collective over the ranks of `context`. `None` if the backend does not
    /// distribute systems in this way, which is the default.
    ///
    /// # Errors
    /// Returns the backend's error if it cannot create the context, for example because the ranges of the ranks do not
    /// follow one another.
    fn with_rows(context: &Self::Context, rows: RankRows) -> Result<Option<Self::Context>, Self::Error> {
        let _ = (context, rows);
        Ok(None)
    }

    /// Replaces each value by its sum over the ranks that hold parts of a system; collective, and every rank gets the
    /// same bits. Without such parts ([`Backend::with_rows`]), every rank has the sums already, and nothing is done.
    ///
    /// # Errors
    /// Returns the backend's error if the ranks cannot communicate.
    fn sum(context: &Self::Context, values: &mut [f64]) -> Result<(), Self::Error> {
        let _ = (context, values);
        Ok(())
    }

    /// Replaces each value by its maximum over the ranks, like [`Backend::sum`].
    ///
    /// # Errors
    /// As for [`Backend::sum`].
    fn max(context: &Self::Context, values: &mut [f64]) -> Result<(), Self::Error> {
        let _ = (context, values);
        Ok(())
    }

    /// Creates a vector of `len` zeros.
    ///
    /// # Errors
    /// Returns the backend's error if it cannot create the vector.
    fn vector(context: &Self::Context, len: usize) -> Result<Self::Vector, Self::Error>;

    /// Creates a matrix of zeros with the given pattern.
    ///
    /// # Errors
    /// Returns the backend's error if it cannot create the matrix.
    fn matrix(context: &Self::Context, pattern: &Arc<Sparsity>) -> Result<Self::Matrix, Self::Error>;

    /// Computes the symbolic factorization of a square pattern, once for all matrices and solvers that share it.
    ///
    /// # Errors
    /// Returns [`SolveError::NotSquare`] for a rectangular pattern, or the error of the backend's own analysis.
    fn analyze(
        context: &Self::Context,
        pattern: &Arc<Sparsity>,
        params: &SolverParams,
    ) -> Result<Arc<Self::Symbolic>, SolveError<Self::Error>>;

    /// Creates a solver. The storage of its factorization is allocated here or in the first factorization.
    ///
    /// # Errors
    /// Returns the backend's error if it cannot create the solver.
    fn solver(symbolic: &Arc<Self::Symbolic>) -> Result<Self::Solver, SolveError<Self::Error>>;

    /// Returns the bytes that the factor of a direct solver takes, for forecasts of memory; 0 if the backend does not know
    /// or the method is iterative.
    fn factor_bytes(_symbolic: &Self::Symbolic) -> usize {
        0
    }
}

/// A backend whose entries, norms and dot products are single numbers: the bound of the Krylov methods. Every such
/// backend implements this trait.
pub trait SingleLane: Backend<Scalar: Scalar, Reduced = <Self as Backend>::Scalar> {}

impl<B: Backend<Scalar: Scalar, Reduced = <B as Backend>::Scalar>> SingleLane for B {}

/// A backend of real numbers in double precision whose `norm` and `dot` return one number: the bound of all physics
/// code. Every such backend implements this trait.
pub trait RealBackend: Backend<Scalar = f64, Reduced = f64> {}

impl<B: Backend<Scalar = f64, Reduced = f64>> RealBackend for B {}
