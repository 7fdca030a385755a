//! Algebraic multigrid by smoothed aggregation, a preconditioner of Krylov methods whose number of iterations hardly
//! depends on the mesh width.
//!
//! # Method
//! Unknowns with the same couplings, such as the displacement components of a node of a finite-element mesh, form nodes
//! of up to three unknowns. A matrix is stored as blocks of nodes. Nodes that are strongly coupled form aggregates, the
//! nodes of the next level (P. Vanek, J. Mandel, M. Brezina, *Algebraic multigrid by smoothed aggregation for second and
//! fourth order elliptic problems*, Computing 56, 1996). The near null space, vectors on which the matrix is almost
//! zero, restricted to the aggregates and smoothed by one Jacobi step, gives the prolongation `P` from a coarse level,
//! and `P^T A P` is the coarse matrix. A level is smoothed by a forward and a backward sweep of block Gauss-Seidel, and
//! the coarsest matrix is factored. The default near null space is constant: the one of the Poisson equation. Pass the
//! six rigid motions for elasticity ([`Solver::set_near_null_space`](crate::las::Solver::set_near_null_space)), or the
//! iteration becomes slow.
//!
//! The levels compute in single precision by default, which halves the time of memory-bound loops; the Krylov method
//! around them computes in double precision, and its tolerance holds.
//!
//! Smoothing, products with matrices and the Galerkin products run on the threads of rayon's current pool; aggregation and the
//! coarsest solution on one. Results do not depend on the number of threads.
//!
//! # Use
//! As the preconditioner of a solver, [`Preconditioner::Multigrid`](crate::las::Preconditioner::Multigrid) selects it.
//! [`Multigrid`] itself serves an iteration of your own, or other parameters. For the Laplace operator on a square:
//!
//! ```
//! use std::sync::Arc;
//! use biotissue::backends::sparse::{Sparse, Vector};
//! use biotissue::las::{Backend, Iterative, Krylov, MatrixOps, Preconditioner, Solver, SolverParams, Sparsity, Symmetry};
//!
//! let side = 100;
//! let at = |i: i32, j: i32| side * i + j;
//! let edges: Vec<[i32; 2]> = (0..side)
//!     .flat_map(|i| (1..side).flat_map(move |j| [[at(i, j - 1), at(i, j)], [at(j - 1, i), at(j, i)]]))
//!     .collect();
//! let pattern = Arc::new(Sparsity::from_elements((side * side) as usize, edges.iter().copied())?);
//! let mut laplacian = Sparse::<f64>::matrix(&(), &pattern)?;
//! for &edge in &edges {
//!     laplacian.add(&edge, &edge, &[1.0, -1.0, -1.0, 1.0])?;
//! }
//! laplacian.add(&[0], &[0], &[1.0])?; // a Dirichlet condition
//!
//! let cg = Iterative { preconditioner: Preconditioner::Multigrid, tolerance: 1e-8, ..Iterative::new(Krylov::Cg) };
//! let params = SolverParams::new(Symmetry::Definite).iterative(cg);
//! let mut solver = Sparse::solver(&Sparse::<f64>::analyze(&(), &pattern, &params)?)?;
//! solver.factor(&laplacian)?;
//! let (b, mut x): (Vector, Vector) = (vec![1e-4; 10_000].into(), vec![0.0; 10_000].into());
//! assert!(solver.solve(&b, &mut x)?.iterations < 25);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! `examples/multigrid.rs` solves the Poisson equation and linear elasticity on finer and finer meshes;
//! `docs/multigrid.md` has numbers of iterations for meshes, materials and aspect ratios of all kinds, beside PETSc's.

#![allow(clippy::needless_range_loop, reason = "the compiler unrolls loops over the indices of small blocks")]

mod aggregation;
mod blocks;
mod galerkin;
mod hierarchy;
mod level;
mod nodes;
#[cfg(feature = "cuda")]
mod parts;
mod precondition;
mod prolongation;
mod smoother;

use std::sync::Arc;

use super::{Failure, Matrix, Vector};
use crate::backends::checks::{check_finite, check_pattern, check_size};
use crate::backends::sparse::long;
use crate::las::{Scalar, SolveError, Sparsity, Symmetry};
use crate::parallel;
#[cfg(feature = "cuda")]
pub(in crate::backends) use blocks::{BlockMatrix as Blocks, Entry};
use blocks::{BlockMatrix, MOST, padded};
use hierarchy::{Hierarchy, SetupError};
use nodes::Nodes;
#[cfg(feature = "cuda")]
pub(in crate::backends) use parts::{LevelParts, Parts};
pub(super) use precondition::preconditioner;
use prolongation::NodeModes;

/// Parameters of [`Multigrid`].
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct MultigridParams {
    /// Two nodes `i` and `j` are strongly coupled if `|A_ij|^2 > strength^2 |A_ii| |A_jj|`, in Frobenius norms of their
    /// blocks; halved on every coarser level. Default 0.04.
    pub strength: f64,
    /// Couplings below this fraction of the diagonal block are lumped to it in the smoothing of the prolongation, which
    /// would otherwise couple more coarse nodes. Default 0.01.
    pub drop_below: f64,
    /// The damping factor of the smoothing of the prolongation, divided by the largest eigenvalue of `D^-1 A`. Default
    /// 4/3 (Vanek, Mandel and Brezina 1996).
    pub damping: f64,
    /// A matrix with at most this many unknowns is factored. Default 800.
    pub coarsest: usize,
    /// Whether the levels compute in single precision. Default true.
    pub single_precision: bool,
}

impl Default for MultigridParams {
    fn default() -> Self {
        Self { strength: 0.04, drop_below: 0.01, damping: 4.0 / 3.0, coarsest: 800, single_precision: true }
    }
}

/// The size of a level of the hierarchy, with the padding of nodes to one block size.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct LevelSize {
    /// Number of unknowns.
    pub unknowns: usize,
    /// Number of stored entries.
    pub entries: usize,
}

/// The largest number of vectors in a near null space.
pub const MOST_VECTORS: usize = MOST;

/// An algebraic multigrid preconditioner for matrices with one sparsity pattern, which is symmetric. The matrix may be
/// unsymmetric.
pub struct Multigrid {
    params: MultigridParams,
    symmetry: Symmetry,
    pattern: Arc<Sparsity>,
    nodes: Nodes,
    /// The matrix by blocks.
    a: BlockMatrix<f64>,
    near_null_space: Vec<Vec<f64>>,
    hierarchy: Option<AnyHierarchy>,
    /// Padded vectors of a product.
    x: Vec<f64>,
    y: Vec<f64>,
}

enum AnyHierarchy {
    Single(Hierarchy<f32>),
    Double(Hierarchy<f64>),
}

/// Evaluates an expression with the hierarchy of either precision.
macro_rules! with_hierarchy {
    ($any:expr, $h:ident => $body:expr) => {
        match $any {
            AnyHierarchy::Single($h) => $body,
            AnyHierarchy::Double($h) => $body,
        }
    };
}

impl Multigrid {
    /// Creates a preconditioner for matrices of this pattern and symmetry.
    ///
    /// # Errors
    /// Returns [`SolveError::UnsymmetricPattern`] if an entry has no transpose.
    pub fn new(pattern: &Arc<Sparsity>, symmetry: Symmetry, params: MultigridParams) -> Result<Self, Failure> {
        if let Some((row, column)) = pattern.first_unsymmetric_entry() {
            return Err(SolveError::UnsymmetricPattern { row, column });
        }
        let nodes = Nodes::new(pattern);
        let (offsets, columns) = nodes.block_pattern(pattern);
        let a = BlockMatrix::zeros((nodes.size, nodes.size), nodes.len(), offsets, columns);
        let padding = if nodes.are_full() { 0 } else { nodes.padded_len() };
        Ok(Self {
            params,
            symmetry,
            pattern: Arc::clone(pattern),
            a,
            near_null_space: Vec::new(),
            hierarchy: None,
            x: vec![0.0; padding],
            y: vec![0.0; padding],
            nodes,
        })
    }

    /// Sets vectors on which the matrix is almost zero, one number per unknown, for the next [`Multigrid::set_up`]. Of
    /// more than [`MOST_VECTORS`] vectors, the first are used; without vectors, the constants of each unknown of a node.
    ///
    /// # Errors
    /// Returns [`SolveError::Size`] if the length of a vector is not the number of unknowns.
    pub fn set_near_null_space<T: Scalar>(&mut self, vectors: &[Vec<T>]) -> Result<(), Failure> {
        for vector in vectors {
            check_size("a vector of the near null space", vector.len(), self.pattern.rows())?;
        }
        self.near_null_space.resize(vectors.len().min(MOST_VECTORS), Vec::new());
        parallel::map(self.near_null_space.iter_mut().zip(vectors), |(to, from)| {
            to.clear();
            to.extend(from.iter().map(|value| value.as_f64()));
        });
        Ok(())
    }

    /// Builds the hierarchy for a matrix: aggregates, prolongations and coarse matrices.
    ///
    /// # Errors
    /// Returns [`SolveError::Pattern`] for a matrix of another pattern, [`SolveError::NotFinite`],
    /// [`SolveError::ZeroDiagonal`] if the diagonal block of a node is singular, and the error of the factorization of the
    /// coarsest matrix. There is no hierarchy then.
    pub fn set_up(&mut self, a: &Matrix) -> Result<(), Failure> {
        self.take_finite(a)?;
        self.build()
    }

    /// Copies the values of a matrix, if all are finite. There is no hierarchy otherwise.
    fn take_finite(&mut self, a: &Matrix) -> Result<(), Failure> {
        let is_finite = check_finite(a.pattern(), a.values(), long::all_finite);
        let taken = is_finite.and_then(|()| self.copy_matrix(a));
        taken.inspect_err(|_| self.hierarchy = None)
    }

    /// Builds the hierarchy for the matrix copied last.
    pub(in crate::backends) fn build(&mut self) -> Result<(), Failure> {
        let (mut single, mut double) = (Vec::new(), Vec::new());
        match self.hierarchy.take() {
            Some(AnyHierarchy::Single(hierarchy)) => single = hierarchy.into_memory(),
            Some(AnyHierarchy::Double(hierarchy)) => double = hierarchy.into_memory(),
            None => {}
        }
        let modes = self.node_modes();
        let Self { a, params, symmetry, .. } = self;
        let built = if params.single_precision {
            Hierarchy::new(a, modes, params, *symmetry, single).map(AnyHierarchy::Single)
        } else {
            Hierarchy::new(a, modes, params, *symmetry, double).map(AnyHierarchy::Double)
        };
        self.hierarchy = Some(built.map_err(|error| self.failed(error))?);
        Ok(())
    }

    /// Computes the numbers of the hierarchy for another matrix, with the aggregates and patterns of the last
    /// [`Multigrid::set_up`]; builds it if there is none.
    ///
    /// # Errors
    /// As for [`Multigrid::set_up`].
    pub fn update(&mut self, a: &Matrix) -> Result<(), Failure> {
        self.take_finite(a)?;
        self.refresh()
    }

    /// Computes the numbers of the hierarchy for the matrix copied last.
    pub(in crate::backends) fn refresh(&mut self) -> Result<(), Failure> {
        let Some(mut hierarchy) = self.hierarchy.take() else { return self.build() };
        let updated = with_hierarchy!(&mut hierarchy, h => h.update(&self.a, &self.params));
        updated.map_err(|error| self.failed(error))?;
        self.hierarchy = Some(hierarchy);
        Ok(())
    }

    /// Copies the values of a matrix.
    pub(in crate::backends) fn copy_matrix<T: Scalar>(&mut self, a: &Matrix<T>) -> Result<(), Failure> {
        check_pattern(a.pattern(), &self.pattern)?;
        self.nodes.copy_values(&self.pattern, a.values(), &mut self.a);
        Ok(())
    }

    fn failed(&self, error: SetupError) -> Failure {
        match error {
            SetupError::Failed(error) => error,
            SetupError::Singular(Some(node)) => SolveError::ZeroDiagonal { row: self.nodes.unknowns(node).start },
            SetupError::Singular(None) => SolveError::Library {
                library: "multigrid",
                reason: "a diagonal block of a coarse matrix is singular".into(),
            },
        }
    }

    /// Returns the near null space by nodes.
    fn node_modes(&self) -> NodeModes {
        let (size, given) = (self.nodes.size, &self.near_null_space);
        let vectors = padded(if given.is_empty() { size } else { given.len() });
        let mut values = parallel::filled(0.0, self.nodes.len() * vectors * size);
        let of_node = |(node, to): (usize, &mut [f64])| {
            for (i, unknown) in self.nodes.unknowns(node).enumerate() {
                for (j, vector) in given.iter().enumerate() {
                    to[j * size + i] = vector[unknown];
                }
                if given.is_empty() {
                    to[i * size + i] = 1.0;
                }
            }
        };
        blocks::for_each_block(&mut values, vectors * size, of_node);
        NodeModes { vectors, size, values }
    }

    /// Computes `y`, an approximation of `A^-1 x`, by a V-cycle; linear in `x`, and symmetric positive definite if the
    /// matrix is. If an entry of `x` is not finite, all of `y` are NaN.
    ///
    /// # Errors
    /// Returns [`SolveError::NotFactored`] without a hierarchy, and [`SolveError::Size`].
    pub fn apply(&mut self, x: &Vector, y: &mut Vector) -> Result<(), Failure> {
        check_size("the vector to precondition", x.as_slice().len(), self.pattern.rows())?;
        check_size("the preconditioned vector", y.as_slice().len(), self.pattern.rows())?;
        let Self { nodes, hierarchy: Some(hierarchy), .. } = self else { return Err(SolveError::NotFactored) };
        let (x, y) = (x.as_slice(), y.as_mut_slice());
        // Single precision has a smaller range.
        // The bits of a NaN are greater than those of any other number without its sign.
        let largest_of = |x: &[f64]| x.iter().fold(0, |most: u64, v| most.max(v.abs().to_bits()));
        let largest = parallel::map(x.chunks(CHUNK), largest_of).into_iter().fold(0, u64::max);
        let largest = f64::from_bits(largest);
        if largest == 0.0 || !largest.is_finite() {
            y.fill(if largest == 0.0 { 0.0 } else { f64::NAN });
            return Ok(());
        }
        with_hierarchy!(hierarchy, h => {
            let unit = largest / h.unit();
            h.apply(|b| nodes.pad(x, largest, b), |solution| nodes.unpad(solution, unit, y))
        })
    }

    /// Computes `y = A x` with the matrix of the last setup or update.
    ///
    /// # Errors
    /// Returns [`SolveError::Size`].
    pub fn product(&mut self, x: &Vector, y: &mut Vector) -> Result<(), Failure> {
        check_size("the vector to multiply", x.as_slice().len(), self.pattern.rows())?;
        check_size("the product", y.as_slice().len(), self.pattern.rows())?;
        let (x, y) = (x.as_slice(), y.as_mut_slice());
        if self.nodes.are_full() {
            self.a.multiply::<false>(x, y);
            return Ok(());
        }
        self.nodes.pad(x, 1.0, &mut self.x);
        self.a.multiply::<false>(&self.x, &mut self.y);
        self.nodes.unpad(&self.y, 1.0, y);
        Ok(())
    }

    /// Returns the size of each level, from the finest; empty before the first setup.
    pub fn levels(&self) -> Vec<LevelSize> {
        self.hierarchy.as_ref().map_or_else(Vec::new, |hierarchy| with_hierarchy!(hierarchy, h => h.sizes()))
    }

    /// Returns the number of entries of all levels divided by that of the finest; 0 before the first setup.
    pub fn operator_complexity(&self) -> f64 {
        let levels = self.levels();
        let Some(finest) = levels.first() else { return 0.0 };
        levels.iter().map(|level| level.entries).sum::<usize>() as f64 / finest.entries as f64
    }
}

/// The number of entries of a vector that a task reduces.
const CHUNK: usize = 1 << 13;

/// Calls `of_row(row, values)` for the values of every block row, in parallel; a block has `len` values.
fn for_each_row<V: Send>(
    offsets: &[u32],
    len: usize,
    values: &mut [V],
    of_row: impl Fn(usize, &mut [V]) + Sync + Send,
) {
    const ROWS: usize = 2048;
    let rows = offsets.len() - 1;
    let tasks = (0..rows).step_by(ROWS).map(|first| first..rows.min(first + ROWS));
    let values_of = |rows: std::ops::Range<usize>| (offsets[rows.end] - offsets[rows.start]) as usize * len;
    let parts = tasks.clone().zip(parallel::split(values, tasks.map(values_of)));
    parallel::map(parts, |(rows, values)| {
        let mut rest = values;
        for row in rows {
            let (values, others) = rest.split_at_mut((offsets[row + 1] - offsets[row]) as usize * len);
            of_row(row, values);
            rest = others;
        }
    });
}
