//! Implements a minimal backend outside `biotissue` and tests it with the conformance suite.
//!
//! The backend stores every entry, has Cholesky and LU but no LDL^T, and does not determine the unknown at which a
//! factorization failed. It runs every simulation of `biotissue`; because it lacks the optional extensions `Entries`
//! and `MatMat`, it does not support Matrix Market files, sums of matrices and products of matrices.

use std::convert::Infallible;
use std::sync::Arc;

use biotissue::las::conformance::{self, Capabilities, Trials};
use biotissue::las::{
    Backend, FactorReport, Factorization, MatVec, MatrixOps, Method, SolveError, SolveReport, Solver, SolverParams,
    Sparsity, Symmetry, VectorOps,
};

/// The marker type.
#[derive(Clone, Copy, Debug, Default)]
struct Own;

struct Vector(Vec<f64>);

#[derive(Clone)]
struct Matrix {
    rows: usize,
    cols: usize,
    values: Vec<f64>,
}

struct Symbolic {
    unknowns: usize,
    symmetry: Symmetry,
    limit: f64,
}

/// The factors of the last matrix: `L` in the lower triangle, and for LU also `U` and the row of each pivot.
struct OwnSolver {
    symbolic: Arc<Symbolic>,
    factors: Option<(Matrix, Vec<usize>)>,
}

type Error = SolveError<Infallible>;

impl Backend for Own {
    const NAME: &'static str = "own";

    type Scalar = f64;
    type Index = i64;
    type Reduced = f64;
    type Context = ();
    type Error = Infallible;
    /// The position of an entry, or `None` for a value that is discarded.
    type Slot = Option<usize>;
    type Vector = Vector;
    type Matrix = Matrix;
    type Symbolic = Symbolic;
    type Solver = OwnSolver;

    fn vector(_: &(), len: usize) -> Result<Vector, Infallible> {
        Ok(Vector(vec![0.0; len]))
    }

    fn matrix(_: &(), pattern: &Arc<Sparsity>) -> Result<Matrix, Infallible> {
        let (rows, cols) = (pattern.rows(), pattern.cols());
        Ok(Matrix { rows, cols, values: vec![0.0; rows * cols] })
    }

    fn analyze(_: &(), pattern: &Arc<Sparsity>, params: &SolverParams) -> Result<Arc<Symbolic>, Error> {
        let (unknowns, cols) = (pattern.rows(), pattern.cols());
        if unknowns != cols {
            return Err(SolveError::NotSquare { rows: unknowns, cols });
        }
        if params.symmetry == Symmetry::Symmetric || params.method != Method::Direct {
            let (what, cure) = ("LDL^T and no iterative method", "declare the matrix as `Symmetry::None`");
            return Err(SolveError::Unsupported { backend: Self::NAME, what, cure });
        }
        let limit = params.singular_below.unwrap_or(1e-14);
        Ok(Arc::new(Symbolic { unknowns, symmetry: params.symmetry, limit }))
    }

    fn solver(symbolic: &Arc<Symbolic>) -> Result<OwnSolver, Error> {
        Ok(OwnSolver { symbolic: Arc::clone(symbolic), factors: None })
    }
}

impl VectorOps<Own> for Vector {
    #[inline(always)]
    fn len(&self) -> usize {
        self.0.len()
    }

    #[inline(always)]
    fn zero(&mut self) -> Result<(), Infallible> {
        self.0.fill(0.0);
        Ok(())
    }

    #[inline(always)]
    fn add(&mut self, rows: &[i64], values: &[f64]) -> Result<(), Infallible> {
        for (&row, value) in rows.iter().zip(values).filter(|(row, _)| **row >= 0) {
            self.0[row as usize] += value;
        }
        Ok(())
    }

    #[inline(always)]
    fn set(&mut self, rows: &[i64], values: &[f64]) -> Result<(), Infallible> {
        for (&row, &value) in rows.iter().zip(values).filter(|(row, _)| **row >= 0) {
            self.0[row as usize] = value;
        }
        Ok(())
    }

    #[inline(always)]
    fn get(&self, rows: &[i64], values: &mut [f64]) -> Result<(), Infallible> {
        for (&row, value) in rows.iter().zip(values).filter(|(row, _)| **row >= 0) {
            *value = self.0[row as usize];
        }
        Ok(())
    }

    #[inline(always)]
    fn norm(&self) -> Result<f64, Infallible> {
        Ok(self.dot(self)?.sqrt())
    }

    #[inline(always)]
    fn dot(&self, y: &Self) -> Result<f64, Infallible> {
        Ok(self.0.iter().zip(&y.0).map(|(x, y)| x * y).sum())
    }

    #[inline(always)]
    fn axpy(&mut self, a: f64, x: &Self) -> Result<(), Infallible> {
        self.0.iter_mut().zip(&x.0).for_each(|(y, x)| *y += a * x);
        Ok(())
    }

    #[inline(always)]
    fn with_local<R>(&self, read: impl FnOnce(&[f64]) -> R) -> Result<R, Infallible> {
        Ok(read(&self.0))
    }

    #[inline(always)]
    fn with_local_mut<R>(&mut self, write: impl FnOnce(&mut [f64]) -> R) -> Result<R, Infallible> {
        Ok(write(&mut self.0))
    }

    #[inline(always)]
    fn finish(&mut self) -> Result<(), Infallible> {
        Ok(())
    }
}

impl Matrix {
    fn row(&self, row: usize) -> &[f64] {
        &self.values[row * self.cols..(row + 1) * self.cols]
    }

    /// Returns the position of an entry, or `None` for a constrained one.
    #[inline(always)]
    fn position(&self, row: i64, column: i64) -> Option<usize> {
        (row >= 0 && column >= 0).then(|| row as usize * self.cols + column as usize)
    }

    #[inline(always)]
    fn positions(&self, rows: &[i64], cols: &[i64]) -> impl Iterator<Item = Option<usize>> {
        rows.iter().flat_map(move |&row| cols.iter().map(move |&column| self.position(row, column)))
    }
}

impl MatrixOps<Own> for Matrix {
    #[inline(always)]
    fn shape(&self) -> (usize, usize) {
        (self.rows, self.cols)
    }

    #[inline(always)]
    fn zero(&mut self) -> Result<(), Infallible> {
        self.values.fill(0.0);
        Ok(())
    }

    #[inline(always)]
    fn zero_rows(&mut self, rows: &[i64]) -> Result<(), Infallible> {
        for row in rows.iter().filter_map(|&row| usize::try_from(row).ok()) {
            self.values[row * self.cols..(row + 1) * self.cols].fill(0.0);
        }
        Ok(())
    }

    #[inline(always)]
    fn add(&mut self, rows: &[i64], cols: &[i64], block: &[f64]) -> Result<(), Infallible> {
        let mut slots = Vec::new();
        self.locate(rows, cols, &mut slots)?;
        self.add_at(&slots, block)
    }

    #[inline(always)]
    fn set(&mut self, rows: &[i64], cols: &[i64], block: &[f64]) -> Result<(), Infallible> {
        let positions: Vec<_> = self.positions(rows, cols).collect();
        for (position, &value) in positions.into_iter().zip(block) {
            position.into_iter().for_each(|position| self.values[position] = value);
        }
        Ok(())
    }

    #[inline(always)]
    fn get(&self, rows: &[i64], cols: &[i64], block: &mut [f64]) -> Result<(), Infallible> {
        for (position, value) in self.positions(rows, cols).zip(block) {
            *value = position.map_or(*value, |position| self.values[position]);
        }
        Ok(())
    }

    #[inline(always)]
    fn locate(&self, rows: &[i64], cols: &[i64], slots: &mut Vec<Option<usize>>) -> Result<(), Infallible> {
        slots.extend(self.positions(rows, cols));
        Ok(())
    }

    #[inline(always)]
    fn add_at(&mut self, slots: &[Option<usize>], block: &[f64]) -> Result<(), Infallible> {
        for (slot, value) in slots.iter().zip(block) {
            slot.iter().for_each(|&position| self.values[position] += value);
        }
        Ok(())
    }

    #[inline(always)]
    fn finish(&mut self) -> Result<(), Infallible> {
        Ok(())
    }
}

/// Returns an error if two lengths differ.
fn check_size(what: &'static str, found: usize, expected: usize) -> Result<(), Error> {
    if found == expected { Ok(()) } else { Err(SolveError::Size { what, found, expected }) }
}

impl MatVec<Own> for Matrix {
    fn mul(&self, x: &Vector, y: &mut Vector) -> Result<(), Error> {
        check_size("the vector", x.len(), self.cols)?;
        check_size("the product", y.len(), self.rows)?;
        for (row, y) in y.0.iter_mut().enumerate() {
            *y = self.row(row).iter().zip(&x.0).map(|(a, x)| a * x).sum();
        }
        Ok(())
    }

    fn mul_transpose(&self, x: &Vector, y: &mut Vector) -> Result<(), Error> {
        check_size("the vector", x.len(), self.rows)?;
        check_size("the product", y.len(), self.cols)?;
        y.0.fill(0.0);
        for (row, x) in x.0.iter().enumerate() {
            y.0.iter_mut().zip(self.row(row)).for_each(|(y, a)| *y += a * x);
        }
        Ok(())
    }

    fn diagonal(&self, d: &mut Vector) -> Result<(), Error> {
        check_size("the diagonal", d.len(), self.rows.min(self.cols))?;
        d.0.iter_mut().enumerate().for_each(|(k, d)| *d = self.row(k)[k]);
        Ok(())
    }
}

impl OwnSolver {
    /// Discards the factors and checks the size of the matrix and that its values are finite.
    fn check(&mut self, a: &Matrix) -> Result<(), Error> {
        self.factors = None;
        check_size("the matrix", a.rows, self.symbolic.unknowns)?;
        match a.values.iter().position(|value| !value.is_finite()) {
            Some(position) => Err(SolveError::NotFinite { row: position / a.cols }),
            None => Ok(()),
        }
    }

    /// Factors by Gaussian elimination: without pivoting for Cholesky (in the form without square roots), with partial
    /// pivoting for LU.
    fn eliminate(&mut self, a: &Matrix, kind: Factorization) -> Result<FactorReport, Error> {
        let n = a.rows;
        let (mut factors, mut order) = (a.clone(), (0..n).collect::<Vec<_>>());
        let (mut smallest, mut largest) = (f64::INFINITY, 0.0_f64);
        for k in 0..n {
            let size = |&row: &usize| factors.row(row)[k].abs();
            let pivot_row = (k..n).max_by(|a, b| size(a).total_cmp(&size(b))).filter(|_| kind == Factorization::Lu);
            let pivot_row = pivot_row.unwrap_or(k);
            for column in 0..n {
                factors.values.swap(k * n + column, pivot_row * n + column);
            }
            order.swap(k, pivot_row);
            let pivot = factors.row(k)[k];
            if kind == Factorization::Cholesky && pivot < 0.0 {
                return Err(SolveError::Indefinite { unknown: None });
            }
            (smallest, largest) = (smallest.min(pivot.abs()), largest.max(pivot.abs()));
            let ratio = if largest > 0.0 { smallest / largest } else { 0.0 };
            if ratio < self.symbolic.limit {
                // The error requires an unknown, which this backend does not determine.
                return Err(SolveError::Singular { unknown: usize::MAX, ratio, limit: self.symbolic.limit });
            }
            for row in k + 1..n {
                let factor = factors.row(row)[k] / pivot;
                factors.values[row * n + k] = factor;
                for column in k + 1..n {
                    factors.values[row * n + column] -= factor * factors.values[k * n + column];
                }
            }
        }
        self.factors = Some((factors, order));
        let negative_pivots = (kind == Factorization::Cholesky).then_some(0);
        let pivot_ratio = if n == 0 { 1.0 } else { smallest / largest };
        Ok(FactorReport { kind, indefinite_at: None, pivot_ratio, negative_pivots })
    }

    fn solve_one(&self, b: &Vector, x: &mut Vector) -> Result<(), Error> {
        let n = self.symbolic.unknowns;
        check_size("the right-hand side", b.len(), n)?;
        check_size("the solution", x.len(), n)?;
        let (factors, order) = self.factors.as_ref().ok_or(SolveError::NotFactored)?;
        let product = |row: usize, range: std::ops::Range<usize>, x: &[f64]| -> f64 {
            factors.row(row)[range.clone()].iter().zip(&x[range]).map(|(a, x)| a * x).sum()
        };
        for (row, &source) in order.iter().enumerate() {
            x.0[row] = b.0[source] - product(row, 0..row, &x.0);
        }
        for row in (0..n).rev() {
            x.0[row] = (x.0[row] - product(row, row + 1..n, &x.0)) / factors.row(row)[row];
        }
        Ok(())
    }
}

impl Solver<Own> for OwnSolver {
    fn factor(&mut self, a: &Matrix) -> Result<FactorReport, Error> {
        self.check(a)?;
        let is_definite = self.symbolic.symmetry == Symmetry::Definite;
        self.eliminate(a, if is_definite { Factorization::Cholesky } else { Factorization::Lu })
    }

    fn factor_definite(&mut self, a: &Matrix) -> Result<FactorReport, Error> {
        self.check(a)?;
        if self.symbolic.symmetry != Symmetry::Definite {
            let (what, cure) = ("test of definiteness by LU", "declare the matrix as `Symmetry::Definite`");
            return Err(SolveError::Unsupported { backend: Own::NAME, what, cure });
        }
        self.eliminate(a, Factorization::Cholesky)
    }

    fn solve_many(&mut self, b: &[Vector], x: &mut [Vector]) -> Result<SolveReport, Error> {
        check_size("the list of solutions", x.len(), b.len())?;
        if self.factors.is_none() {
            return Err(SolveError::NotFactored);
        }
        b.iter().zip(x).try_for_each(|(b, x)| self.solve_one(b, x))?;
        Ok(SolveReport::DIRECT)
    }
}

/// The suite does not require LDL^T or the unknown of a failure from this backend.
#[test]
fn own_backend_conforms() {
    conformance::all::<Own>(&(), Trials::default(), Capabilities { ldlt: false, names_unknown: false });
}
