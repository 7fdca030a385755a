//! The symbolic part of the factorizations: everything that depends on the pattern alone.

use std::convert::Infallible;
use std::fmt::Display;
use std::sync::{Arc, OnceLock};

use faer::dyn_stack::{MemBuffer, MemStack, StackReq};
use faer::sparse::linalg::cholesky::{simplicial, supernodal};
use faer::sparse::{FaerError, SymbolicSparseColMat, SymbolicSparseColMatRef};

use super::block::{SymbolicBlockCholesky, Width};
use super::lu::LuAnalysis;
use super::order::{self, Graph};
use crate::las::{Method, SolveError, SolverParams, Sparsity, Symmetry};

/// Operations of a factorization, those of padding included, from which on the library's supernodes serve instead of
/// blocks of three: there, blocking for the caches counts for more than small overheads. The library gains more from
/// AVX-512 than the blocks do. Measured in `docs/kernel.md`.
fn supernodes_from(width: Width) -> f64 {
    match width {
        #[cfg(target_arch = "x86_64")]
        Width::Avx512 => 2.5e9,
        _ => 4e9,
    }
}

/// How many times the operations may be that blocks of three carry out where nodes have fewer unknowns. The nodes of a body
/// that rollers hold at its surface have three but for these, and stay well below it; a matrix of nodes with one or two
/// unknowns is above.
const MOST_PADDING: f64 = 2.0;

/// The analysis of one pattern, shared by every solver of it.
pub struct Symbolic {
    pub(super) pattern: Arc<Sparsity>,
    pub(super) params: SolverParams,
    order: Vec<u32>,
    operations: Option<f64>,
    /// For definite matrices of blocks that are not too large.
    pub(super) blocks: Option<SymbolicBlockCholesky>,
    /// Made in advance for symmetric matrices without the former, and on the first need for the others.
    cholesky: OnceLock<CholeskyAnalysis>,
    /// Made in advance for unsymmetric matrices, and on the first need for others.
    lu: OnceLock<LuAnalysis>,
}

impl Symbolic {
    pub(super) fn new(pattern: &Arc<Sparsity>, params: &SolverParams) -> Result<Self, SolveError<Infallible>> {
        let (rows, cols) = (pattern.rows(), pattern.cols());
        if rows != cols {
            return Err(SolveError::NotSquare { rows, cols });
        }
        params.check()?;
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
            // Nothing is ordered or factored exactly.
        } else if params.symmetry == Symmetry::None {
            symbolic.lu()?;
        } else {
            symbolic.analyze_symmetric()?;
        }
        Ok(symbolic)
    }

    fn analyze_symmetric(&mut self) -> Result<(), SolveError<Infallible>> {
        let pattern = &*self.pattern;
        if let Some((row, column)) = pattern.without_mirror() {
            return Err(SolveError::OneTriangle { row, column });
        }
        let graph = Graph::new(pattern);
        let tree = order::eliminate(&graph, self.params.ordering)?;
        let first = graph.first_unknowns();
        self.order = tree.order.iter().flat_map(|&node| first[node as usize]..first[node as usize + 1]).collect();
        let operations = tree.operations();
        self.operations = Some(operations);
        let padded = tree.padded_operations();
        let by_blocks = self.params.symmetry == Symmetry::Definite
            && padded < supernodes_from(Width::of_machine())
            && padded <= MOST_PADDING * operations;
        if by_blocks {
            self.blocks = Some(SymbolicBlockCholesky::new(pattern, &graph, &tree));
        } else {
            self.cholesky()?;
        }
        Ok(())
    }

    /// Number of unknowns.
    #[must_use]
    pub fn unknowns(&self) -> usize {
        self.pattern.rows()
    }

    /// Number of values that a Cholesky or LDL^T factor holds, explicit zeros of the supernodes included; `None` where
    /// the matrices are stated to be unsymmetric.
    #[must_use]
    pub fn factor_entries(&self) -> Option<usize> {
        let of_cholesky = || self.cholesky.get().map(|analysis| analysis.supernodes.len_val());
        self.blocks.as_ref().map(SymbolicBlockCholesky::entries).or_else(of_cholesky)
    }

    /// The unknown that Cholesky eliminates at each position; empty where the matrices are stated to be unsymmetric.
    #[must_use]
    pub fn order(&self) -> &[u32] {
        &self.order
    }

    /// Floating-point operations of a Cholesky factorization in the order found, explicit zeros not counted; `None` where
    /// the matrices are stated to be unsymmetric.
    #[must_use]
    pub fn operations(&self) -> Option<f64> {
        self.operations
    }

    /// The analysis for Cholesky and LDL^T of the library; there is one where the matrices are stated to be symmetric.
    pub(super) fn cholesky(&self) -> Result<&CholeskyAnalysis, SolveError<Infallible>> {
        if let Some(analysis) = self.cholesky.get() {
            return Ok(analysis);
        }
        let analysis = CholeskyAnalysis::new(&self.pattern, self.order.clone()).map_err(failed)?;
        Ok(self.cholesky.get_or_init(|| analysis))
    }

    /// The same if it was made already.
    pub(super) fn cholesky_made(&self) -> Option<&CholeskyAnalysis> {
        self.cholesky.get()
    }

    /// The analysis for LU.
    pub(super) fn lu(&self) -> Result<&LuAnalysis, SolveError<Infallible>> {
        if let Some(analysis) = self.lu.get() {
            return Ok(analysis);
        }
        let analysis = LuAnalysis::new(&self.pattern).map_err(failed)?;
        Ok(self.lu.get_or_init(|| analysis))
    }
}

/// What the library said, as an error of ours.
pub(super) fn failed(reason: impl Display) -> SolveError<Infallible> {
    SolveError::Library { library: "faer", reason: reason.to_string() }
}

/// The ordered lower triangle and the supernodes of its factor.
pub(super) struct CholeskyAnalysis {
    /// The unknown that is eliminated at each position.
    pub(super) order: Vec<u32>,
    /// The lower triangle of the ordered matrix, by columns.
    pub(super) lower: SymbolicSparseColMat<u32>,
    /// Where the value of each of its entries stands among those of the matrix.
    pub(super) source: Vec<u32>,
    /// The pattern of the factor.
    pub(super) supernodes: supernodal::SymbolicSupernodalCholesky<u32>,
    /// Where the diagonal entry of each position stands among the values of the factor.
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

/// The lower triangle of the ordered matrix by columns, and where its values come from: the upper triangle of the matrix.
fn permuted_lower_triangle(pattern: &Sparsity, position: &[u32]) -> (SymbolicSparseColMat<u32>, Vec<u32>) {
    let n = pattern.rows();
    let mut entries = Vec::with_capacity(pattern.entries().div_ceil(2) + n);
    for row in 0..n {
        let start = pattern.row_offsets()[row];
        for (k, &column) in (start..).zip(pattern.row(row)).filter(|&(_, &column)| column as usize >= row) {
            let (i, j) = (position[row], position[column as usize]);
            entries.push((i.min(j), i.max(j), k));
        }
    }
    entries.sort_unstable();
    let mut col_offsets = vec![0_u32; n + 1];
    for &(column, ..) in &entries {
        col_offsets[column as usize + 1] += 1;
    }
    for column in 0..n {
        col_offsets[column + 1] += col_offsets[column];
    }
    let rows = entries.iter().map(|&(_, row, _)| row).collect();
    let source = entries.iter().map(|&(.., k)| k).collect();
    (SymbolicSparseColMat::new_checked(n, n, col_offsets, None, rows), source)
}

/// The supernodes of the factor. Always supernodes: on the networks that this crate is made for, which are small, the
/// library's own choice between them and single columns is the slower one.
fn supernodes(
    lower: SymbolicSparseColMatRef<'_, u32>,
) -> Result<supernodal::SymbolicSupernodalCholesky<u32>, FaerError> {
    let (n, entries) = (lower.nrows(), lower.row_idx().len());
    // The analysis reads the upper triangle by columns: the lower one by rows.
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
