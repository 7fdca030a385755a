//! The direct solver of the backend `sparse`.

use std::sync::Arc;

use biotissue::backends::sparse::{Matrix, Solver, Sparse, Symbolic, Vector};
use biotissue::las::{Backend, Ordering, Solver as _, SolverParams, Symmetry, VectorOps};

use crate::MODES;
use crate::system::{Contender, System};

struct Ours {
    name: String,
    symbolic: Arc<Symbolic>,
    solver: Solver,
    matrix: Matrix,
    right: Vec<Vector>,
    solution: Vec<Vector>,
}

/// Returns one solver for every ordering.
pub fn all(system: &System) -> Vec<Box<dyn Contender>> {
    let make = |name: &str, params: &SolverParams| -> Box<dyn Contender> {
        let symbolic = Sparse::<f64>::analyze(&(), &system.pattern, params).expect("an analysis");
        let solver = Sparse::solver(&symbolic).expect("a solver");
        let vectors = || vec![Sparse::<f64>::vector(&(), system.pattern.rows()).expect("a vector"); MODES];
        let matrix = system.stiffness.clone();
        Box::new(Ours { name: name.to_owned(), symbolic, solver, matrix, right: vectors(), solution: vectors() })
    };
    let orderings = [
        ("biotissue, best order", Ordering::Auto),
        ("biotissue, minimum degree", Ordering::MinimumDegree),
        ("biotissue, nested dissection", Ordering::NestedDissection),
        ("biotissue, METIS", Ordering::Metis),
    ];
    let params = |ordering| {
        let mut params = SolverParams::new(Symmetry::Definite);
        params.ordering = ordering;
        params
    };
    orderings.into_iter().map(|(name, ordering)| make(name, &params(ordering))).collect()
}

impl Contender for Ours {
    fn name(&self) -> String {
        self.name.clone()
    }

    fn operations(&self) -> Option<f64> {
        self.symbolic.operations()
    }

    fn factor(&mut self) {
        let report = self.solver.factor(&self.matrix).expect("a regular matrix");
        assert_eq!(report.indefinite_at, None, "the matrix is definite");
    }

    fn solve(&mut self, columns: usize, right: &[f64], solution: &mut [f64]) {
        let n = self.right[0].len();
        for (own, b) in self.right.iter_mut().zip(right.chunks_exact(n)).take(columns) {
            own.as_mut_slice().copy_from_slice(b);
        }
        self.solver.solve_many(&self.right[..columns], &mut self.solution[..columns]).expect("a factor");
        for (own, x) in self.solution.iter().zip(solution.chunks_exact_mut(n)).take(columns) {
            x.copy_from_slice(own.as_slice());
        }
    }
}
