//! Assembly, factorization and solution allocate no memory after the first pass.

use std::sync::Arc;

use biotissue::las::conformance::{DenseReference, Random};
use biotissue::las::{Backend, Factorization, MatrixOps, RealBackend, Solver, SolverParams, Sparsity, VectorOps};

use crate::counting;

const RIGHT_HAND_SIDES: usize = 9;

/// The objects that are assembled and solved repeatedly.
struct Work<B: Backend> {
    elements: Vec<(Vec<i32>, Vec<f64>)>,
    slots: Vec<B::Slot>,
    values: Vec<f64>,
    matrix: B::Matrix,
    solver: B::Solver,
    right: Vec<B::Vector>,
    solutions: Vec<B::Vector>,
}

impl<B: RealBackend<Index = i32, Context = ()>> Work<B> {
    fn new(mut random: Random, pattern: &Arc<Sparsity>) -> Self {
        let unknowns = pattern.rows();
        let a = DenseReference::dominant(&mut random, pattern, |_| 1.0);
        let elements: Vec<(Vec<i32>, Vec<f64>)> = (0..unknowns)
            .map(|row| {
                let columns = pattern.row(row).iter().map(|&c| c as i32);
                let values = pattern.row(row).iter().map(|&c| a.values[row * unknowns + c as usize]);
                (columns.collect(), values.collect())
            })
            .collect();
        let matrix = B::matrix(&(), pattern).unwrap();
        let mut slots = Vec::new();
        for (row, (columns, _)) in elements.iter().enumerate() {
            matrix.locate(&[row as i32], columns, &mut slots).unwrap();
        }
        let values = elements.iter().flat_map(|(_, values)| values.iter().copied()).collect();
        let vectors = || (0..RIGHT_HAND_SIDES).map(|_| B::vector(&(), unknowns).unwrap()).collect::<Vec<_>>();
        let symbolic = B::analyze(&(), pattern, &SolverParams::default()).unwrap();
        let solver = B::solver(&symbolic).unwrap();
        Self { elements, slots, values, matrix, solver, right: vectors(), solutions: vectors() }
    }

    /// Assembles one definite and one indefinite system, with `add` and with `add_at`, and solves each for one and for
    /// several right-hand sides.
    fn round(&mut self) {
        for kind in [Factorization::Cholesky, Factorization::Ldlt] {
            self.matrix.zero().unwrap();
            if kind == Factorization::Cholesky {
                for (row, (columns, values)) in self.elements.iter().enumerate() {
                    self.matrix.add(&[row as i32], columns, values).unwrap();
                }
            } else {
                self.matrix.add_at(&self.slots, &self.values).unwrap();
                self.matrix.set(&[3], &[3], &[-1e3]).unwrap();
            }
            self.matrix.finish().unwrap();
            for (k, b) in self.right.iter_mut().enumerate() {
                b.zero().unwrap();
                b.add(&[-1, 3, k as i32], &[1.0, 2.0, 3.0]).unwrap();
            }
            let report = self.solver.factor(&self.matrix).unwrap();
            assert_eq!(report.kind, kind);
            self.solver.solve(&self.right[0], &mut self.solutions[0]).unwrap();
            self.solver.solve_many(&self.right, &mut self.solutions).unwrap();
            self.solver.solve_many(&self.right[..2], &mut self.solutions[..2]).unwrap();
        }
    }
}

fn assert_allocates_only_in_the_first_pass<B: RealBackend<Index = i32, Context = ()>>() {
    for size in [10, 40, 120, 300] {
        for blocks in [false, true] {
            let mut random = Random::new(size);
            let size = size as usize;
            let pattern = if blocks { random.truss(size.div_ceil(3), 4) } else { random.elements(size) };
            let mut work = Work::<B>::new(random, &pattern);
            let before = counting::calls();
            work.round();
            assert!(counting::calls() > before, "the first pass allocates, and the counter counts it");
            let before = counting::calls();
            for _ in 0..100 {
                work.round();
            }
            assert_eq!(counting::calls() - before, 0, "{} unknowns, in blocks: {blocks}", pattern.rows());
        }
    }
}

#[test]
#[cfg(feature = "sparse")]
fn sparse() {
    assert_allocates_only_in_the_first_pass::<biotissue::backends::sparse::Sparse>();
}

#[test]
#[cfg(feature = "dense")]
fn dense() {
    assert_allocates_only_in_the_first_pass::<biotissue::backends::dense::Dense>();
}
