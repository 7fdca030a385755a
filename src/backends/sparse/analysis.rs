//! The symbolic phase of the factorizations, which depends on the sparsity pattern alone.

use std::fmt::Display;
use std::sync::{Arc, OnceLock};

use faer::Par;
use faer::dyn_stack::{MemBuffer, MemStack, StackReq};
use faer::sparse::linalg::cholesky::{simplicial, supernodal};
use faer::sparse::{FaerError, SymbolicSparseColMat, SymbolicSparseColMatRef};

use super::Failure;
use super::block::{SimdLevel, SymbolicBlockCholesky};
use super::lu::LuAnalysis;
use super::order::{self, Graph, Tree};
use crate::backends::checks::check_analyzable;
use crate::las::{Method, Ordering, SolveError, SolverParams, Sparsity, Symmetry, offsets};
use crate::parallel;

/// The number of floating-point operations, padding included, from which faer's supernodal factorization replaces the
/// one by 3x3 blocks: for such large matrices, cache blocking matters more than small overheads. faer gains more from
/// AVX-512 than the block factorization does. `docs/kernel.md` has the measurements.
fn supernodes_from(level: SimdLevel) -> f64 {
    match level {
        #[cfg(target_arch = "x86_64")]
        SimdLevel::Avx512 => 2.5e9,
        _ => 4e9,
    }
}

/// The largest accepted ratio of operations with and without the padding of nodes with fewer than three unknowns. In a
/// body, only the nodes on rollers at its surface have fewer, which keeps the ratio well below this limit; a matrix
/// whose nodes all have one or two unknowns exceeds it.
const MOST_PADDING: f64 = 2.0;

/// The symbolic analysis of one pattern, shared by all its solvers.
pub struct Symbolic {
    pub(super) pattern: Arc<Sparsity>,
    pub(super) params: SolverParams,
    order: Vec<u32>,
    operations: Option<f64>,
    /// The analysis by blocks, for positive definite matrices of 3x3 blocks that are not too large.
    pub(super) blocks: Option<SymbolicBlockCholesky>,
    /// Made in advance for symmetric matrices without `blocks`, and on first use for the others.
    pub(super) cholesky: OnceLock<CholeskyAnalysis>,
    /// Made in advance for unsymmetric matrices, and on first use for the others.
    lu: OnceLock<LuAnalysis>,
}

impl Symbolic {
    pub(super) fn new(pattern: &Arc<Sparsity>, params: &SolverParams) -> Result<Self, Failure> {
        check_analyzable(pattern, params)?;
        let mut symbolic = Self {
            pattern: Arc::clone(pattern),
            params: *params,
            order: Vec::new(),
            operations: None,
            blocks: None,
            cholesky: OnceLock::new(),
            lu: OnceLock::new(),
        };
        if let Method::Iterative(_) = params.method {
            // An iterative method needs no elimination order and no exact factorization.
        } else if params.symmetry == Symmetry::None {
            symbolic.lu()?;
        } else {
            symbolic.analyze_symmetric()?;
        }
        Ok(symbolic)
    }

    fn analyze_symmetric(&mut self) -> Result<(), Failure> {
        let pattern = &*self.pattern;
        let ((graph, tree), order) = self.eliminate()?;
        self.order = order;
        let operations = tree.operations();
        self.operations = Some(operations);
        let padded = tree.padded_operations();
        let by_blocks = self.params.symmetry == Symmetry::Definite
            && padded < supernodes_from(SimdLevel::of_machine())
            && padded <= MOST_PADDING * operations;
        if by_blocks {
            self.blocks = Some(SymbolicBlockCholesky::new(pattern, &graph, &tree));
        } else {
            self.cholesky()?;
        }
        Ok(())
    }

    /// Computes the elimination order of a symmetric pattern: graph and tree of its nodes, and the order of the unknowns.
    fn eliminate(&self) -> Result<((Graph, Tree), Vec<u32>), Failure> {
        if let Some((row, column)) = self.pattern.first_unsymmetric_entry() {
            return Err(SolveError::UnsymmetricPattern { row, column });
        }
        let graph = Graph::new(&self.pattern);
        let tree = order::eliminate(&graph, self.params.ordering)?;
        let first = graph.first_unknowns();
        let order = tree.order.iter().flat_map(|&node| first[node as usize]..first[node as usize + 1]).collect();
        Ok(((graph, tree), order))
    }

    /// Returns the number of unknowns.
    pub fn unknowns(&self) -> usize {
        self.pattern.rows()
    }

    /// Returns the number of values in a Cholesky or LDL^T factor, including the explicit zeros of the supernodes;
    /// `None` if the matrices are declared unsymmetric or the method is iterative.
    pub fn factor_entries(&self) -> Option<usize> {
        let of_cholesky = || self.cholesky.get().map(|analysis| analysis.supernodes.len_val());
        self.blocks.as_ref().map(SymbolicBlockCholesky::entries).or_else(of_cholesky)
    }

    /// Returns the number of values that a Cholesky or LDL^T factorization stores, with the padding of blocks; `None` as in
    /// [`Symbolic::factor_entries`].
    pub(super) fn stored_values(&self) -> Option<usize> {
        self.blocks.as_ref().map(SymbolicBlockCholesky::stored_values).or_else(|| self.factor_entries())
    }

    /// Returns the unknown that Cholesky eliminates at each position; empty if the matrices are declared unsymmetric or
    /// the method is iterative.
    pub fn order(&self) -> &[u32] {
        &self.order
    }

    /// Returns the number of floating-point operations of a Cholesky factorization in this order, without those on
    /// explicit zeros; `None` if the matrices are declared unsymmetric or the method is iterative.
    pub fn operations(&self) -> Option<f64> {
        self.operations
    }

    /// Returns the analysis for faer's Cholesky and LDL^T, made on first use. It requires matrices declared symmetric.
    pub(super) fn cholesky(&self) -> Result<&CholeskyAnalysis, Failure> {
        if let Some(analysis) = self.cholesky.get() {
            return Ok(analysis);
        }
        let order = if self.order.is_empty() { self.eliminate()?.1 } else { self.order.clone() };
        let analysis = CholeskyAnalysis::new(&self.pattern, order).map_err(failed)?;
        Ok(self.cholesky.get_or_init(|| analysis))
    }

    /// Returns the analysis for LU, made on first use.
    pub(super) fn lu(&self) -> Result<&LuAnalysis, Failure> {
        if let Some(analysis) = self.lu.get() {
            return Ok(analysis);
        }
        let analysis = LuAnalysis::new(&self.pattern).map_err(failed)?;
        Ok(self.lu.get_or_init(|| analysis))
    }
}

/// Returns the number of entries of the Cholesky factor of matrices with this pattern in the order of elimination of this
/// backend, without the explicit zeros of supernodes. Takes less time than an analysis, which this does not make.
///
/// # Errors
/// Returns [`SolveError::UnsymmetricPattern`], or an error of the library that computes the order.
pub fn cholesky_entries(pattern: &Sparsity) -> Result<f64, Failure> {
    if let Some((row, column)) = pattern.first_unsymmetric_entry() {
        return Err(SolveError::UnsymmetricPattern { row, column });
    }
    Ok(order::eliminate(&Graph::new(pattern), Ordering::Auto)?.entries())
}

/// The number of values of a Cholesky factor from which faer factors on all threads.
pub(super) const PARALLEL_CHOLESKY_FROM: usize = 1 << 22;

/// The number of unknowns from which faer factors by LU on all threads.
pub(super) const PARALLEL_LU_FROM: usize = 10_000;

/// Returns how faer computes a factorization. The factors have the same bits for any number of threads; solves do not,
/// and use one.
pub(super) fn parallelism(is_large: bool) -> Par {
    let threads = if is_large { parallel::threads() } else { 1 };
    if threads > 1 { Par::rayon(threads) } else { Par::Seq }
}

/// Converts an error of faer into a [`SolveError`].
pub(super) fn failed(reason: impl Display) -> Failure {
    SolveError::Library { library: "faer", reason: reason.to_string() }
}

/// The permuted lower triangle and the supernodes of its factor.
pub(super) struct CholeskyAnalysis {
    /// The unknown that is eliminated at each position.
    pub(super) order: Vec<u32>,
    /// The lower triangle of the permuted matrix, by columns.
    pub(super) lower: SymbolicSparseColMat<u32>,
    /// For each entry of `lower`, the index of its value in the matrix.
    pub(super) source: Vec<u32>,
    /// The supernodes of the factor, with their sparsity pattern.
    pub(super) supernodes: supernodal::SymbolicSupernodalCholesky<u32>,
    /// For each position, the index of its diagonal entry among the values of the factor.
    pub(super) diagonal: Vec<u32>,
}

impl CholeskyAnalysis {
    fn new(pattern: &Sparsity, order: Vec<u32>) -> Result<Self, FaerError> {
        let n = pattern.rows();
        let (lower, source) = permuted_lower_triangle(pattern, &order::inverse(&order));
        let supernodes = supernodes(lower.as_ref())?;
        let mut diagonal = Vec::with_capacity(n);
        for s in 0..supernodes.n_supernodes() {
            let first = supernodes.col_ptr_for_val()[s];
            let columns = supernodes.supernode_end()[s] - supernodes.supernode_begin()[s];
            let height = columns + supernodes.supernode(s).pattern().len() as u32;
            diagonal.extend((0..columns).map(|k| first + k * (height + 1)));
        }
        Ok(Self { order, lower, source, supernodes, diagonal })
    }
}

/// Returns the lower triangle of the permuted matrix by columns, and for each of its entries the index of the value in
/// the matrix; the values come from the upper triangle of the matrix.
fn permuted_lower_triangle(pattern: &Sparsity, position: &[u32]) -> (SymbolicSparseColMat<u32>, Vec<u32>) {
    let n = pattern.rows();
    let mut entries = Vec::with_capacity(pattern.nnz().div_ceil(2) + n);
    for row in 0..n {
        let start = pattern.row_offsets()[row];
        for (k, &column) in (start..).zip(pattern.row(row)).filter(|&(_, &column)| column as usize >= row) {
            let (i, j) = (position[row], position[column as usize]);
            entries.push((i.min(j), i.max(j), k));
        }
    }
    by_columns(n, entries)
}

/// Sorts entries `(column, row, index of its value)` by columns; returns their pattern and the indices.
pub(super) fn by_columns(n: usize, mut entries: Vec<(u32, u32, u32)>) -> (SymbolicSparseColMat<u32>, Vec<u32>) {
    entries.sort_unstable();
    let col_offsets = offsets(n, entries.iter().map(|&(column, ..)| column as usize));
    let rows = entries.iter().map(|&(_, row, _)| row).collect();
    let source = entries.iter().map(|&(.., k)| k).collect();
    (SymbolicSparseColMat::new_checked(n, n, col_offsets, None, rows), source)
}

/// Computes the supernodes of the factor. It never uses the simplicial variant: for the networks that this crate
/// targets, which are small, faer's automatic choice between the two is slower.
fn supernodes(
    lower: SymbolicSparseColMatRef<'_, u32>,
) -> Result<supernodal::SymbolicSupernodalCholesky<u32>, FaerError> {
    let (n, entries) = (lower.nrows(), lower.row_idx().len());
    // The analysis expects the upper triangle by columns, that is, the lower triangle by rows.
    let upper = lower.transpose().to_col_major()?;
    let mut memory = MemBuffer::new(StackReq::any_of(&[
        simplicial::prefactorize_symbolic_cholesky_scratch::<u32>(n, entries),
        supernodal::factorize_supernodal_symbolic_cholesky_scratch::<u32>(n),
    ]));
    let (mut tree, mut column_counts) = (vec![0_i32; n], vec![0_u32; n]);
    let tree = simplicial::prefactorize_symbolic_cholesky(
        &mut tree,
        &mut column_counts,
        upper.as_ref(),
        MemStack::new(&mut memory),
    );
    supernodal::factorize_supernodal_symbolic_cholesky(
        upper.as_ref(),
        tree,
        &column_counts,
        MemStack::new(&mut memory),
        faer::sparse::linalg::SymbolicSupernodalParams::default(),
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::backends::sparse::{Matrix, Solver, Sparse, Vector};
    use crate::las::{Backend, MatrixOps, Solver as _};
    use crate::parallel::tests::on_pools;

    /// A box of cubes with eight nodes of three unknowns, whose matrix is diagonally dominant.
    fn box_of_cubes(cells: usize, asymmetry: f64) -> Matrix {
        let line = cells + 1;
        let node = |i: usize, j: usize, k: usize| (i * line + j) * line + k;
        let cube = |cell: usize| -> Vec<i32> {
            let (i, j, k) = (cell / (cells * cells), cell / cells % cells, cell % cells);
            let nodes = (0..8).map(|corner| node(i + corner / 4, j + corner / 2 % 2, k + corner % 2));
            nodes.flat_map(|node| (0..3).map(move |axis| (3 * node + axis) as i32)).collect()
        };
        let cubes: Vec<Vec<i32>> = (0..cells * cells * cells).map(cube).collect();
        let mut matrix = Matrix::zeros(&Arc::new(Sparsity::from_elements(3 * line.pow(3), &cubes).unwrap()));
        let entry = |row: usize, column: usize| match row.cmp(&column) {
            std::cmp::Ordering::Equal => 24.0 + row as f64 * 0.3,
            std::cmp::Ordering::Less => -0.9 - asymmetry,
            std::cmp::Ordering::Greater => -0.9,
        };
        let block: Vec<f64> = (0..24 * 24).map(|k| entry(k / 24, k % 24)).collect();
        for rows in &cubes {
            MatrixOps::<Sparse>::add(&mut matrix, rows, rows, &block).unwrap();
        }
        matrix
    }

    /// Factors and solves on pools of several threads; returns the factor entries, if they are known.
    fn the_solution_has_the_same_bits(matrix: &Matrix, symmetry: Symmetry) -> Option<usize> {
        let params = SolverParams::new(symmetry);
        let symbolic = Sparse::<f64>::analyze(&(), matrix.pattern(), &params).unwrap();
        let right: Vector = (0..symbolic.unknowns()).map(|k| (k % 7) as f64 - 3.0).collect::<Vec<f64>>().into();
        let mut solutions = on_pools(|| {
            let mut solver: Solver = Sparse::<f64>::solver(&symbolic).unwrap();
            solver.factor(matrix).unwrap();
            let mut x = Vector::from(vec![0.0; symbolic.unknowns()]);
            solver.solve(&right, &mut x).unwrap();
            x
        });
        let serial = std::mem::take(&mut solutions[0]);
        assert!(solutions[1..].iter().all(|x| *x == serial), "{symmetry:?}");
        symbolic.factor_entries()
    }

    #[test]
    fn large_factors_have_the_same_bits_on_any_number_of_threads() {
        let entries = the_solution_has_the_same_bits(&box_of_cubes(18, 0.0), Symmetry::Definite);
        assert!(entries.is_some_and(|entries| entries > PARALLEL_CHOLESKY_FROM), "{entries:?}");
        let unsymmetric = box_of_cubes(15, 0.05);
        assert!(unsymmetric.pattern().rows() > PARALLEL_LU_FROM);
        the_solution_has_the_same_bits(&unsymmetric, Symmetry::None);
    }
}
