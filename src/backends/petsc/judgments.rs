//! Whether the copied matrix of a solver is finite, regular and definite, and which unknown is to blame.
//!
//! Unknowns are numbered over all ranks, and all ranks come to the same judgment.

use super::direct::Outcome;
use super::solve::{Solver, index, solve_one};
use super::{Matrix, Petsc, SolverError, Vector};
use crate::backends::null_vector::{Scales, check_null_vector, null_vector_limit};
use crate::las::{Factorization, MatVec, SolveError};

impl Solver {
    /// Returns the first row of this rank with a value that is not finite, numbered over all ranks.
    pub(super) fn first_not_finite(&self, a: &Matrix) -> usize {
        let is_bad = |&row: &usize| {
            let own = a.layout.row(row as i32);
            own.is_some_and(|own| (0..own.columns.len()).any(|k| !a.values.get(own.at(k)).is_finite()))
        };
        a.layout.rows.clone().find(is_bad).map_or(usize::MAX, |row| a.context.first_row() + row)
    }

    /// Returns the unknown with the smallest diagonal entry, and that entry; 0 and infinity if there are no unknowns.
    pub(super) fn smallest_diagonal(&mut self) -> Result<(usize, f64), SolverError> {
        self.a.diagonal(&mut self.diagonal)?;
        Ok(self.symbolic.context.smallest(self.diagonal.as_slice()).unwrap_or((0, f64::INFINITY)))
    }

    /// Searches for a null vector if a pivot is small or the package does not report pivots, unless the caller set a
    /// limit for pivots. If a diagonal entry is not positive, the judgment of the package stands.
    pub(super) fn check_near_singular(&mut self, kind: Factorization, ratio: f64) -> Result<(), SolverError> {
        let n = self.symbolic.unknowns;
        let reported = if ratio < 1.0 { ratio } else { 0.0 };
        let Some(limit) = null_vector_limit::<f64>(&self.symbolic.params, n, reported) else { return Ok(()) };
        if kind == Factorization::Approximate {
            return Ok(());
        }
        self.a.diagonal(&mut self.diagonal)?;
        let Self { symbolic, a, factors, diagonal, .. } = self;
        let factor = factors.iter().flatten().find(|factor| factor.kind == kind);
        let is_positive = symbolic.context.holds_for_all(diagonal.as_slice().iter().all(|&entry| entry > 0.0));
        let Some(factor) = factor.filter(|_| is_positive) else { return Ok(()) };
        let scales = Scales::of_diagonal(diagonal.as_slice().iter().copied());
        let scales = scales.of_part(symbolic.context.first_row(), n);
        let solve = |b: &Vector, x: &mut Vector| solve_one(factor, a, b, x).map(drop);
        match check_null_vector::<Petsc>(&symbolic.context, a, kind, &scales, limit, solve)? {
            Some(unknown) => Err(SolveError::Singular { unknown, ratio, limit: f64::EPSILON }),
            None => Ok(()),
        }
    }

    pub(super) fn singular(&mut self, kind: Factorization, found: &Outcome) -> SolverError {
        let Self { a, factors, diagonal, limit, .. } = self;
        let limit = *limit;
        let unknown = match factors[index(kind)].take().map(|factor| factor.null_space_unknown(a, found, diagonal)) {
            Some(Err(error)) => return SolveError::Backend(error),
            Some(Ok(Some(unknown))) => unknown,
            _ => 0,
        };
        SolveError::Singular { unknown, ratio: if found.ratio < limit { found.ratio } else { 0.0 }, limit }
    }
}
