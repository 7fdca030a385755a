//! faer's supernodal Cholesky, called directly, with minimum degree on the unknowns or with the elimination order of
//! biotissue.

use biotissue::backends::sparse::Sparse;
use biotissue::las::{Backend, SolverParams, Symmetry};
use faer::dyn_stack::{MemBuffer, MemStack};
use faer::perm::PermRef;
use faer::sparse::linalg::SupernodalThreshold;
use faer::sparse::linalg::cholesky::{
    CholeskySymbolicParams, LltRef, SymbolicCholesky, SymmetricOrdering, factorize_symbolic_cholesky,
};
use faer::sparse::{SparseColMatRef, SymbolicSparseColMat};
use faer::{Conj, MatMut, Par, Side, Spec};

use crate::system::{Contender, System};

pub struct PlainFaer {
    lower: SymbolicSparseColMat<u32>,
    values: Vec<f64>,
    symbolic: SymbolicCholesky<u32>,
    factor: Vec<f64>,
    memory: MemBuffer,
    name: &'static str,
}

impl PlainFaer {
    /// Uses faer's own order.
    pub fn new(system: &System, columns: usize) -> Self {
        Self::ordered("faer supernodal LLT, AMD", system, SymmetricOrdering::Amd, columns)
    }

    /// Uses the elimination order of biotissue, which is postordered.
    pub fn in_our_order(system: &System, columns: usize) -> Self {
        let params = SolverParams::new(Symmetry::Definite);
        let symbolic = Sparse::<f64>::analyze(&(), &system.pattern, &params).expect("an analysis");
        let forward = symbolic.order();
        let mut inverse = vec![0; forward.len()];
        for (position, &unknown) in (0..).zip(forward) {
            inverse[unknown as usize] = position;
        }
        let order = PermRef::new_checked(forward, &inverse, forward.len());
        Self::ordered("faer supernodal LLT, biotissue's order", system, SymmetricOrdering::Custom(order), columns)
    }

    fn ordered(name: &'static str, system: &System, order: SymmetricOrdering<'_, u32>, columns: usize) -> Self {
        let n = system.lower_start.len() - 1;
        let (start, rows) = (system.lower_start.clone(), system.lower_rows.clone());
        let lower = SymbolicSparseColMat::new_checked(n, n, start, None, rows);
        let params = CholeskySymbolicParams {
            supernodal_flop_ratio_threshold: SupernodalThreshold::FORCE_SUPERNODAL,
            ..CholeskySymbolicParams::default()
        };
        let symbolic =
            factorize_symbolic_cholesky(lower.as_ref(), Side::Lower, order, params).expect("memory for the analysis");
        let request = symbolic
            .factorize_numeric_llt_scratch::<f64>(Par::Seq, Spec::default())
            .or(symbolic.solve_in_place_scratch::<f64>(columns, Par::Seq));
        let factor = vec![0.0; symbolic.len_val()];
        Self { lower, values: system.lower_values.clone(), symbolic, factor, memory: MemBuffer::new(request), name }
    }
}

impl Contender for PlainFaer {
    fn name(&self) -> String {
        self.name.to_owned()
    }

    fn operations(&self) -> Option<f64> {
        None
    }

    fn factor(&mut self) {
        let matrix = SparseColMatRef::new(self.lower.as_ref(), &self.values);
        let stack = MemStack::new(&mut self.memory);
        let (regularization, params) = (Default::default(), Spec::default());
        self.symbolic
            .factorize_numeric_llt(&mut self.factor, matrix, Side::Lower, regularization, Par::Seq, stack, params)
            .expect("the matrix is definite");
    }

    fn solve(&mut self, columns: usize, right: &[f64], solution: &mut [f64]) {
        let n = self.lower.nrows();
        solution[..n * columns].copy_from_slice(&right[..n * columns]);
        let solution = MatMut::from_column_major_slice_mut(&mut solution[..n * columns], n, columns);
        let stack = MemStack::new(&mut self.memory);
        LltRef::new(&self.symbolic, &self.factor).solve_in_place_with_conj(Conj::No, solution, Par::Seq, stack);
    }
}
