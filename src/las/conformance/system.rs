//! A linear system under test: it is factored, solved and compared with the reference.

use std::sync::Arc;

use super::{Capabilities, DenseReference, Random, epsilon, indices, lanes, scalar, scalars, unwrap};
use crate::las::{
    Backend, FactorReport, Factorization, Index, MatrixOps, Scalar, SolveError, Solver, SolverParams, Sparsity,
    Symmetry, Value, VectorOps,
};

/// A solver with its pattern and symbolic factorization.
///
/// With several lanes, the matrix of each is that of the test times a power of two, so that all lanes get the same reports but
/// different factors and solutions.
pub(super) struct LinearSystem<'a, B: Backend> {
    context: &'a B::Context,
    pub(super) pattern: Arc<Sparsity>,
    symbolic: Arc<B::Symbolic>,
    pub(super) solver: B::Solver,
    capabilities: Capabilities,
}

impl<'a, B: Backend> LinearSystem<'a, B> {
    pub(super) fn new(
        context: &'a B::Context,
        capabilities: Capabilities,
        pattern: &Arc<Sparsity>,
        symmetry: Symmetry,
    ) -> Self {
        // The limit is above the rounding errors in the pivots of a singular matrix.
        let mut params = SolverParams::new(symmetry);
        params.singular_below = Some(1e3 * epsilon::<B>());
        let symbolic = unwrap(B::analyze(context, pattern, &params));
        let solver = unwrap(B::solver(&symbolic));
        Self { context, capabilities, pattern: Arc::clone(pattern), symbolic, solver }
    }

    /// Creates another solver with the same symbolic factorization.
    pub(super) fn twin(&self) -> Self {
        Self {
            pattern: Arc::clone(&self.pattern),
            symbolic: Arc::clone(&self.symbolic),
            solver: unwrap(B::solver(&self.symbolic)),
            ..*self
        }
    }

    /// Returns the matrix of the backend with the entries of `a` at the positions of the pattern.
    fn matrix(&self, a: &DenseReference) -> B::Matrix {
        let mut matrix = unwrap(B::matrix(self.context, &self.pattern));
        for row in 0..a.rows {
            for &column in self.pattern.row(row) {
                let value = scalar::<B>(|lane| factor_of(lane) * a.get(row, column as usize));
                unwrap(matrix.set(&[B::Index::of(row)], &[B::Index::of(column as usize)], &[value]));
            }
        }
        unwrap(matrix.finish());
        matrix
    }

    pub(super) fn vector(&self, values: &[f64]) -> B::Vector {
        let mut vector = unwrap(B::vector(self.context, values.len()));
        let rows: Vec<i32> = (0..values.len() as i32).collect();
        unwrap(vector.set(&indices::<B>(&rows), &scalars::<B>(values)));
        unwrap(vector.finish());
        vector
    }

    pub(super) fn factor(&mut self, a: &DenseReference) -> Result<FactorReport, SolveError<B::Error>> {
        let matrix = self.matrix(a);
        self.solver.factor(&matrix)
    }

    pub(super) fn factor_definite(&mut self, a: &DenseReference) -> Result<FactorReport, SolveError<B::Error>> {
        let matrix = self.matrix(a);
        self.solver.factor_definite(&matrix)
    }

    /// Solves `a x = b`, checks that the residual is at the level of rounding errors, and returns `x`.
    pub(super) fn solve(&mut self, a: &DenseReference, b: &[f64]) -> Vec<f64> {
        let (b, mut x) = (self.vector(b), self.vector(&vec![UNSOLVED; b.len()]));
        let report = unwrap(self.solver.solve(&b, &mut x));
        assert_eq!(report.iterations, 0, "a direct solver does not iterate");
        assert_solved::<B>(a, &b, &x)
    }

    /// Factors, checks the report, and solves for one and for several right-hand sides.
    pub(super) fn check(&mut self, random: &mut Random, a: &DenseReference, kinds: &[Factorization]) -> FactorReport {
        let report = unwrap(self.factor(a));
        let n = a.rows;
        assert!(kinds.contains(&report.kind), "{:?} instead of {kinds:?}, {n} unknowns", report.kind);
        assert!(report.pivot_ratio > 0.0 && report.pivot_ratio <= 1.0, "pivot ratio {}", report.pivot_ratio);
        for count in [1, 4, 2, 0] {
            let right: Vec<Vec<f64>> = (0..count).map(|_| random.integers(n)).collect();
            let b: Vec<_> = right.iter().map(|b| self.vector(b)).collect();
            let mut x: Vec<_> = right.iter().map(|_| self.vector(&vec![UNSOLVED; n])).collect();
            unwrap(self.solver.solve_many(&b, &mut x));
            for ((values, b), x) in right.iter().zip(&b).zip(&x) {
                let solved_at_once = assert_solved::<B>(a, b, x);
                let solved_alone = self.solve(a, values);
                let size = solved_alone.iter().fold(0.0, |m: f64, v| m.max(v.abs()));
                let pairs = solved_alone.iter().zip(&solved_at_once);
                let difference = pairs.fold(0.0, |m: f64, (s, t)| m.max((s - t).abs()));
                let bound = 1e3 * n as f64 * epsilon::<B>() * size / report.pivot_ratio;
                assert!(difference <= bound, "solve and solve_many differ by {difference:e}, {n} unknowns");
            }
        }
        report
    }

    /// Checks that the matrix is reported as singular with one of `unknowns`, that the solver then has no
    /// factorization, and that it can factor the next matrix.
    pub(super) fn check_singular(&mut self, a: &DenseReference, unknowns: &[usize], regular: &DenseReference) {
        match self.factor(a) {
            Err(SolveError::Singular { unknown, ratio, limit }) => {
                let is_named = !self.capabilities.names_unknown || unknowns.contains(&unknown);
                assert!(is_named, "unknown {unknown} named instead of one of {unknowns:?}");
                assert!(ratio < limit, "pivot ratio {ratio} is not below the limit {limit}");
            }
            // Without LDL^T, a pivot that rounding made negative cannot be distinguished from a negative eigenvalue.
            Err(SolveError::Indefinite { .. }) if !self.capabilities.ldlt => {}
            other => panic!("factor returned {other:?} for a singular matrix"),
        }
        self.check_not_factored();
        unwrap(self.factor(regular));
        self.solve(regular, &vec![1.0; a.rows]);
    }

    /// Checks that the solver refuses to solve because it has no factorization.
    pub(super) fn check_not_factored(&mut self) {
        let n = self.pattern.rows();
        let (b, mut x) = (self.vector(&vec![1.0; n]), self.vector(&vec![1.0; n]));
        assert!(matches!(self.solver.solve(&b, &mut x), Err(SolveError::NotFactored)));
        assert!(matches!(self.solver.solve_many(&[b], &mut [x]), Err(SolveError::NotFactored)));
    }
}

/// The value of all entries of a solution vector before the solve.
const UNSOLVED: f64 = -55.0;

/// The factor of the matrix of a lane.
fn factor_of(lane: usize) -> f64 {
    f64::from(1 << (lane % 8))
}

fn read<B: Backend>(x: &B::Vector, lane: usize) -> Vec<f64> {
    unwrap(x.with_local(|values| values.iter().map(|v| v.lane(lane).as_f64()).collect()))
}

/// Checks that the residual of a solution is at the level of rounding errors, and returns the solutions of all lanes.
fn assert_solved<B: Backend>(a: &DenseReference, b: &B::Vector, x: &B::Vector) -> Vec<f64> {
    let largest = |v: &[f64]| v.iter().fold(0.0, |m: f64, v| m.max(v.abs()));
    let of_lane = |lane: usize| {
        let (b, x, factor) = (read::<B>(b, lane), read::<B>(x, lane), factor_of(lane));
        let residual: Vec<f64> = a.times(&x).iter().zip(&b).map(|(ax, b)| factor * ax - b).collect();
        let bound = 50.0 * (1.0 + a.rows as f64) * epsilon::<B>() * (factor * a.norm() * largest(&x) + largest(&b));
        let found = largest(&residual);
        let is_solved = found <= bound && !x.iter().any(|v| v.is_nan());
        assert!(is_solved, "residual {found:e} > {bound:e} in lane {lane}, {} unknowns", a.rows);
        x
    };
    (0..lanes::<B>()).flat_map(of_lane).collect()
}
