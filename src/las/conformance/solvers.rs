//! Tests of the solvers.

use std::sync::Arc;

use super::system::LinearSystem;
use super::{Capabilities, DenseReference, Random, unwrap};
use crate::las::{Backend, Factorization, SolveError, Solver, SolverParams, Sparsity, Symmetry};

/// Tests the factorizations and solves of a backend; all lanes have matrices of the same kind.
///
/// # Panics
/// Panics if the backend violates the specification of [`Solver`]; violations that `capabilities` permits are ignored.
pub fn solvers<B: Backend>(context: &B::Context, capabilities: Capabilities) {
    let suite = Suite::<B> { context, capabilities };
    for (seed, unknowns) in (3000..).zip([1, 2, 3, 5, 8, 13, 21, 40, 70, 150, 450]) {
        let mut random = Random::new(seed);
        let pattern = random.elements(unknowns);
        suite.matrices_of_one_pattern(&mut random, &pattern);
        suite.unsymmetric(&mut random, &pattern);
    }
    for (seed, nodes) in (3500..).zip([1, 2, 4, 9, 20, 45, 90]) {
        let mut random = Random::new(seed);
        let pattern = random.truss(nodes, 2);
        suite.matrices_of_one_pattern(&mut random, &pattern);
    }
    for seed in 4000..4020 {
        suite.floating_part(&mut Random::new(seed));
        if capabilities.ldlt {
            suite.saddle_point(&mut Random::new(seed));
        }
    }
    if capabilities.ldlt {
        suite.exact_cancellation();
        suite.two_by_two_then_single_pivots();
    }
    suite.row_exchanges();
    suite.error_conditions();
    suite.empty_and_single();
}

/// The backend under test.
struct Suite<'a, B: Backend> {
    context: &'a B::Context,
    capabilities: Capabilities,
}

impl<B: Backend> Suite<'_, B> {
    fn system(&self, pattern: &Arc<Sparsity>, symmetry: Symmetry) -> LinearSystem<'_, B> {
        LinearSystem::new(self.context, self.capabilities, pattern, symmetry)
    }

    /// Returns true if an unknown is the expected one, or if the backend need not know it.
    fn is_named(&self, unknown: Option<usize>, is_expected: impl Fn(usize) -> bool) -> bool {
        !self.capabilities.names_unknown || unknown.is_some_and(is_expected)
    }

    fn matrices_of_one_pattern(&self, random: &mut Random, pattern: &Arc<Sparsity>) {
        self.definite(random, pattern);
        self.indefinite(random, pattern);
        self.isolated_unknown(random, pattern);
        self.not_finite(random, pattern);
        self.reuse(random, pattern);
    }

    fn definite(&self, random: &mut Random, pattern: &Arc<Sparsity>) {
        let a = DenseReference::dominant(random, pattern, |_| 1.0);
        for &symmetry in self.capabilities.symmetries() {
            let kind = match symmetry {
                Symmetry::Definite => Factorization::Cholesky,
                Symmetry::Symmetric => Factorization::Ldlt,
                Symmetry::None => Factorization::Lu,
            };
            let report = self.system(pattern, symmetry).check(random, &a, &[kind]);
            assert_eq!(report.indefinite_at, None);
            assert_eq!(report.negative_pivots, (kind != Factorization::Lu).then_some(0));
        }
    }

    /// If one diagonal entry is negative, Cholesky fails at its unknown; if several are, it fails at one of them.
    fn indefinite(&self, random: &mut Random, pattern: &Arc<Sparsity>) {
        let n = pattern.rows();
        let at = random.below(n);
        let one = DenseReference::dominant(random, pattern, |i| if i == at { -1.0 } else { 1.0 });
        let mut case = self.system(pattern, Symmetry::Definite);
        let refused = case.factor_definite(&one);
        let Err(SolveError::Indefinite { unknown }) = refused else {
            panic!("factor_definite returned {refused:?} for an indefinite matrix")
        };
        assert!(self.is_named(unknown, |unknown| unknown == at), "{unknown:?} instead of {at} of {n}");
        case.check_not_factored();
        if !self.capabilities.ldlt {
            return;
        }
        let report = case.check(random, &one, &[Factorization::Ldlt]);
        assert!(self.is_named(report.indefinite_at, |unknown| unknown == at), "{report:?} instead of {at} of {n}");
        assert_eq!(report.negative_pivots, Some(1));
        let many = DenseReference::dominant(random, pattern, |i| if i % 3 == at % 3 { -1.0 } else { 1.0 });
        let report = case.check(random, &many, &[Factorization::Ldlt]);
        assert!(self.is_named(report.indefinite_at, |unknown| unknown % 3 == at % 3), "{report:?}");
        let report = self.system(pattern, Symmetry::Symmetric).check(random, &many, &[Factorization::Ldlt]);
        assert_eq!(report.indefinite_at, None, "the backend did not try Cholesky");
        assert_eq!(report.negative_pivots, Some((0..n).filter(|i| i % 3 == at % 3).count()));
    }

    fn unsymmetric(&self, random: &mut Random, pattern: &Arc<Sparsity>) {
        let mut a = DenseReference::dominant(random, pattern, |i| if i % 2 == 0 { 1.0 } else { -1.0 });
        for i in 0..a.rows {
            for &j in pattern.row(i).iter().filter(|&&j| (j as usize) < i) {
                *a.at(i, j as usize) *= 0.25;
            }
        }
        let mut case = self.system(pattern, Symmetry::None);
        case.check(random, &a, &[Factorization::Lu]);
        assert!(
            matches!(case.factor_definite(&a), Err(SolveError::Unsupported { .. })),
            "LU pivots do not determine definiteness"
        );
    }

    /// A matrix with a zero row and column.
    fn isolated_unknown(&self, random: &mut Random, pattern: &Arc<Sparsity>) {
        let n = pattern.rows();
        let unknown = random.below(n);
        let regular = DenseReference::dominant(random, pattern, |_| 1.0);
        let mut a = regular.clone();
        for i in 0..n {
            *a.at(i, unknown) = 0.0;
            *a.at(unknown, i) = 0.0;
        }
        for &symmetry in self.capabilities.symmetries() {
            self.system(pattern, symmetry).check_singular(&a, &[unknown], &regular);
        }
    }

    /// A singular positive semidefinite matrix is not positive definite. It becomes so by a positive shift of its
    /// diagonal, and indefinite by a negative one.
    fn semidefinite(&self, pattern: &Arc<Sparsity>, a: &DenseReference) {
        const SHIFT: f64 = 1e-2;
        let shifted = |by: f64| {
            let mut shifted = a.clone();
            (0..a.rows).for_each(|i| *shifted.at(i, i) += by);
            shifted
        };
        for &symmetry in self.capabilities.symmetries().iter().filter(|&&symmetry| symmetry != Symmetry::None) {
            let mut case = self.system(pattern, symmetry);
            let refused = case.factor_definite(a);
            assert!(matches!(refused, Err(SolveError::Singular { .. } | SolveError::Indefinite { .. })), "{refused:?}");
            case.check_not_factored();
            let report = unwrap(case.factor_definite(&shifted(SHIFT)));
            assert_eq!(report.negative_pivots, Some(0), "{symmetry:?}");
            case.solve(&shifted(SHIFT), &vec![1.0; a.rows]);
            let refused = case.factor_definite(&shifted(-SHIFT));
            assert!(matches!(refused, Err(SolveError::Indefinite { .. })), "{refused:?}");
            case.check_not_factored();
            if self.capabilities.ldlt {
                let report = unwrap(case.factor(&shifted(-SHIFT)));
                assert!(report.negative_pivots.is_some_and(|negative| negative > 0), "{report:?}");
            }
        }
    }

    /// A connected part without supports: its translation is a null vector of the exact matrix, which rounding
    /// perturbs.
    fn floating_part(&self, random: &mut Random) {
        let n = 30;
        let pattern = random.elements(n);
        let regular = DenseReference::dominant(random, &pattern, |_| 1.0);
        let mut a = DenseReference::zeros(n, n);
        let inside = |i: usize| i.is_multiple_of(2);
        for i in 0..n {
            for j in pattern.row(i).iter().map(|&j| j as usize).filter(|&j| j > i && inside(i) == inside(j)) {
                let stiffness = 0.5 + random.signed().abs();
                *a.at(i, j) -= stiffness;
                *a.at(j, i) -= stiffness;
                *a.at(i, i) += stiffness;
                *a.at(j, j) += stiffness;
            }
            if !inside(i) {
                *a.at(i, i) += 1.0;
            }
        }
        // The even unknowns may form several such parts, each of which is singular; the submatrix of the odd unknowns
        // is regular.
        let part: Vec<usize> = (0..n).filter(|&i| inside(i)).collect();
        for &symmetry in self.capabilities.symmetries() {
            self.system(&pattern, symmetry).check_singular(&a, &part, &regular);
        }
        self.semidefinite(&pattern, &a);
    }

    /// Constraints with Lagrange multipliers, `[[K, G^T], [G, 0]]`: in some elimination orders a pivot is zero.
    fn saddle_point(&self, random: &mut Random) {
        let (free, constraints) = (24, 6);
        let n = free + constraints;
        let stiff = random.elements(free);
        let k = DenseReference::dominant(random, &stiff, |_| 1.0);
        let mut a = DenseReference::zeros(n, n);
        let mut elements: Vec<Vec<i32>> = Vec::new();
        for i in 0..free {
            for &j in stiff.row(i) {
                *a.at(i, j as usize) = k.values[i * free + j as usize];
                elements.push(vec![i as i32, j as i32]);
            }
        }
        for c in 0..constraints {
            // The constraints act on different unknowns, so that they are independent.
            for i in [4 * c, 4 * c + 1, 4 * c + 2] {
                let value = 1.0 + random.signed().abs();
                *a.at(free + c, i) = value;
                *a.at(i, free + c) = value;
                elements.push(vec![i as i32, (free + c) as i32]);
            }
        }
        let pattern = Arc::new(unwrap(Sparsity::from_elements(n, elements)));
        for symmetry in [Symmetry::Definite, Symmetry::Symmetric] {
            let mut case = self.system(&pattern, symmetry);
            let report = case.check(random, &a, &[Factorization::Ldlt, Factorization::Lu]);
            let is_expected = report.indefinite_at.is_some() == (symmetry == Symmetry::Definite);
            assert!(is_expected || !self.capabilities.names_unknown, "{report:?}");
            let negative = (report.kind == Factorization::Ldlt).then_some(constraints);
            assert_eq!(report.negative_pivots, negative, "every constraint makes one eigenvalue negative");
        }
    }

    /// `1 1^T` with smaller diagonal entries: after the first pivot all off-diagonal entries vanish exactly.
    fn exact_cancellation(&self) {
        let n = 100;
        let pattern = Arc::new(unwrap(Sparsity::from_elements(n, [(0..n as i32).collect::<Vec<_>>()])));
        let mut a = DenseReference { rows: n, cols: n, values: vec![1.0; n * n] };
        for i in 1..n {
            *a.at(i, i) = if i % 2 == 0 { -0.5 } else { 0.25 };
        }
        for symmetry in [Symmetry::Definite, Symmetry::Symmetric] {
            self.system(&pattern, symmetry).check(&mut Random::new(5000), &a, &[Factorization::Ldlt]);
        }
    }

    /// A factorization with 2x2 pivots must not affect the next one with 1x1 pivots.
    fn two_by_two_then_single_pivots(&self) {
        let pattern = Arc::new(unwrap(Sparsity::from_elements(2, [[0, 1]])));
        let square = |values: [f64; 4]| DenseReference { rows: 2, cols: 2, values: values.into() };
        for symmetry in [Symmetry::Definite, Symmetry::Symmetric] {
            let mut case = self.system(&pattern, symmetry);
            for a in [square([0.0, 1.0, 1.0, 0.0]), square([2.0, 0.0, 0.0, -3.0])] {
                case.check(&mut Random::new(5500), &a, &[Factorization::Ldlt]);
            }
        }
    }

    /// A cyclic permutation: regular, with a zero diagonal, so that LU needs row exchanges.
    fn row_exchanges(&self) {
        let n = 9;
        let elements = (0..n as i32).map(|i| [i, (i + 1) % n as i32]);
        let pattern = Arc::new(unwrap(Sparsity::from_elements(n, elements)));
        let mut a = DenseReference::zeros(n, n);
        for i in 0..n {
            *a.at(i, (i + 1) % n) = 1.0 + i as f64;
        }
        self.system(&pattern, Symmetry::None).check(&mut Random::new(6000), &a, &[Factorization::Lu]);
    }

    fn not_finite(&self, random: &mut Random, pattern: &Arc<Sparsity>) {
        let regular = DenseReference::dominant(random, pattern, |_| 1.0);
        for (&symmetry, bad) in self.capabilities.symmetries().iter().zip([f64::NAN, f64::INFINITY, f64::NEG_INFINITY])
        {
            let mut a = regular.clone();
            let row = random.below(a.rows);
            let column = pattern.row(row)[random.below(pattern.row(row).len())];
            *a.at(row, column as usize) = bad;
            let mut case = self.system(pattern, symmetry);
            unwrap(case.factor(&regular));
            assert!(matches!(case.factor(&a), Err(SolveError::NotFinite { row: found }) if found == row));
            case.check_not_factored();
        }
    }

    /// Reuse: one solver for a sequence of matrices, and two solvers with a common symbolic factorization.
    fn reuse(&self, random: &mut Random, pattern: &Arc<Sparsity>) {
        for &symmetry in self.capabilities.symmetries() {
            let mut first = self.system(pattern, symmetry);
            let mut second = first.twin();
            // The second matrix is negative definite if the backend can factor it.
            let other = if self.capabilities.ldlt { -1.0 } else { 2.0 };
            let matrices = [1.0, other, 1.0].map(|sign| DenseReference::dominant(random, pattern, |_| sign));
            let b = random.integers(pattern.rows());
            unwrap(first.factor(&matrices[0]));
            unwrap(second.factor(&matrices[1]));
            first.solve(&matrices[0], &b);
            second.solve(&matrices[1], &b);
            unwrap(first.factor(&matrices[1]));
            first.solve(&matrices[1], &b);
            unwrap(first.factor(&matrices[2]));
            first.solve(&matrices[2], &b);
            second.solve(&matrices[1], &b);
        }
    }

    /// Rectangular systems, vectors and matrices of the wrong size, and `solve` before `factor` are errors.
    fn error_conditions(&self) {
        let flat = Arc::new(unwrap(Sparsity::from_rows(3, vec![0, 1, 2], vec![0, 1])));
        let params = SolverParams::default();
        let refused = B::analyze(self.context, &flat, &params);
        assert!(matches!(refused, Err(SolveError::NotSquare { rows: 2, cols: 3 })));
        let mut random = Random::new(7000);
        let (pattern, larger) = (random.elements(6), random.elements(7));
        let a = DenseReference::dominant(&mut random, &pattern, |_| 1.0);
        for &symmetry in self.capabilities.symmetries() {
            let mut case = self.system(&pattern, symmetry);
            case.check_not_factored();
            let other = unwrap(B::matrix(self.context, &larger));
            assert!(matches!(case.solver.factor(&other), Err(SolveError::Size { found: 7, expected: 6, .. })));
            unwrap(case.factor(&a));
            let (mut six, mut seven) = (case.vector(&[1.0; 6]), case.vector(&[1.0; 7]));
            let size = |result: Result<_, SolveError<B::Error>>| {
                matches!(result, Err(SolveError::Size { found: 7, expected: 6, .. }))
            };
            assert!(size(case.solver.solve(&seven, &mut six)));
            assert!(size(case.solver.solve(&six, &mut seven)));
            assert!(size(case.solver.solve_many(&[case.vector(&[1.0; 6])], &mut [seven])));
            let too_few = case.solver.solve_many(&[case.vector(&[1.0; 6]), case.vector(&[1.0; 6])], &mut [six]);
            assert!(matches!(too_few, Err(SolveError::Size { found: 1, expected: 2, .. })));
            case.solve(&a, &[1.0; 6]);
        }
    }

    fn empty_and_single(&self) {
        let empty = Arc::new(unwrap(Sparsity::from_rows(0, vec![0], vec![])));
        let single = Arc::new(unwrap(Sparsity::from_elements(1, [[0]])));
        let without_entries = Arc::new(unwrap(Sparsity::from_rows(2, vec![0, 0, 0], vec![])));
        for &symmetry in self.capabilities.symmetries() {
            let mut case = self.system(&empty, symmetry);
            case.check_not_factored();
            let report = unwrap(case.factor(&DenseReference::zeros(0, 0)));
            assert_eq!(report.pivot_ratio, 1.0, "an empty matrix");
            case.solve(&DenseReference::zeros(0, 0), &[]);
            let mut case = self.system(&single, symmetry);
            let one = |value: f64| DenseReference { rows: 1, cols: 1, values: vec![value] };
            for value in [4.0, -3.0, 1e-30, 1e30] {
                if value < 0.0 && symmetry != Symmetry::None && !self.capabilities.ldlt {
                    continue;
                }
                let report = unwrap(case.factor(&one(value)));
                assert_eq!(report.pivot_ratio, 1.0, "a single pivot");
                let expected = (symmetry == Symmetry::Definite && value < 0.0).then_some(0);
                assert!(report.indefinite_at == expected || !self.capabilities.names_unknown, "{report:?}");
                case.solve(&one(value), &[2.0]);
            }
            case.check_singular(&one(0.0), &[0], &one(1.0));
            let mut case = self.system(&without_entries, symmetry);
            let zero = case.factor(&DenseReference::zeros(2, 2));
            let Err(SolveError::Singular { unknown, .. }) = zero else { panic!("factor returned {zero:?}") };
            assert!(self.is_named(Some(unknown), |unknown| unknown < 2), "{unknown}");
        }
    }
}
