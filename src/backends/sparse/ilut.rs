//! Incomplete LU with a threshold (Y. Saad, *ILUT: a dual threshold incomplete LU factorization*, Numer. Linear Algebra
//! Appl. 1, 1994; the preconditioner of that name in SPARSKIT).
//!
//! The factorization is Gaussian elimination row by row, without row exchanges. It drops multipliers up to the drop
//! tolerance. In the resulting row, it drops entries up to the tolerance times the mean absolute value of the matrix
//! row, and each factor keeps the `fill` largest of the remaining ones besides the diagonal. With tolerance 0 and
//! unlimited fill, the factorization is the complete LU.

use std::cmp::Reverse;
use std::collections::BinaryHeap;

use super::solve::SparseScalar;
use super::{Failure, Matrix, Sparse, Vector};
use crate::backends::direct::Pivots;
use crate::backends::iterative::ApproximateInverse;
use crate::las::{Scalar, SolveError};

/// Compressed rows that are built row by row.
struct Rows<T> {
    start: Vec<usize>,
    columns: Vec<u32>,
    values: Vec<T>,
}

impl<T: Copy> Rows<T> {
    fn new() -> Self {
        Self { start: vec![0], columns: Vec::new(), values: Vec::new() }
    }

    fn clear(&mut self) {
        self.start.truncate(1);
        self.columns.clear();
        self.values.clear();
    }

    fn push_row(&mut self, row: &[(u32, T)]) {
        self.columns.extend(row.iter().map(|&(column, _)| column));
        self.values.extend(row.iter().map(|&(_, value)| value));
        self.start.push(self.columns.len());
    }

    fn row(&self, row: usize) -> impl DoubleEndedIterator<Item = (usize, T)> {
        let range = self.start[row]..self.start[row + 1];
        self.columns[range.clone()].iter().zip(&self.values[range]).map(|(&column, &value)| (column as usize, value))
    }
}

/// The factors: `L` with a unit diagonal that is not stored, `U` with the inverse of its diagonal stored separately.
pub(super) struct Ilut<T> {
    drop_tolerance: T,
    fill: usize,
    lower: Rows<T>,
    upper: Rows<T>,
    inverse_diagonal: Vec<T>,
    /// The current row: its values by column, and flags of the columns that it contains.
    row: Vec<T>,
    present: Vec<bool>,
    /// Columns left of the diagonal that are not yet eliminated, smallest first.
    left: BinaryHeap<Reverse<u32>>,
    multipliers: Vec<(u32, T)>,
    right: Vec<u32>,
    kept: Vec<(u32, T)>,
}

impl<T: Scalar> Ilut<T> {
    pub(super) fn new(drop_tolerance: f64, fill: usize) -> Self {
        Self {
            drop_tolerance: T::of(drop_tolerance),
            fill,
            lower: Rows::new(),
            upper: Rows::new(),
            inverse_diagonal: Vec::new(),
            row: Vec::new(),
            present: Vec::new(),
            left: BinaryHeap::new(),
            multipliers: Vec::new(),
            right: Vec::new(),
            kept: Vec::new(),
        }
    }

    /// Scatters row `i` into the work arrays; returns its mean absolute value.
    fn scatter_row(&mut self, a: &Matrix<T>, i: usize) -> T {
        let range = a.pattern().range(i);
        let (columns, values) = (&a.pattern().col_indices()[range.clone()], &a.values()[range]);
        self.present[i] = true;
        for (&column, &value) in columns.iter().zip(values) {
            self.row[column as usize] = value;
            self.mark_column(i, column);
        }
        let sum: T = values.iter().map(|value| value.abs()).sum();
        sum / T::of(values.len().max(1) as f64)
    }

    /// Marks a column as present in the row.
    fn mark_column(&mut self, i: usize, column: u32) {
        let at = column as usize;
        if !std::mem::replace(&mut self.present[at], true) {
            if at < i { self.left.push(Reverse(column)) } else { self.right.push(column) }
        }
    }

    /// Eliminates the columns left of the diagonal in ascending order; fill-in appears to their right.
    fn eliminate(&mut self, i: usize) {
        self.multipliers.clear();
        while let Some(Reverse(column)) = self.left.pop() {
            let k = column as usize;
            let multiplier = std::mem::take(&mut self.row[k]) * self.inverse_diagonal[k];
            self.present[k] = false;
            if multiplier.abs() <= self.drop_tolerance {
                continue;
            }
            self.multipliers.push((column, multiplier));
            for at in self.upper.start[k]..self.upper.start[k + 1] {
                let (column, value) = (self.upper.columns[at], self.upper.values[at]);
                self.row[column as usize] -= multiplier * value;
                self.mark_column(i, column);
            }
        }
    }

    /// Stores the largest entries of row `i` in both factors and clears the row; returns the pivot.
    fn store_row(&mut self, i: usize, mean: T) -> T {
        let threshold = self.drop_tolerance * mean;
        largest(&mut self.multipliers, self.fill);
        self.lower.push_row(&self.multipliers);
        self.present[i] = false;
        let mut pivot = std::mem::take(&mut self.row[i]);
        if pivot.is_zero() {
            pivot = (T::of(1e-4) + self.drop_tolerance) * mean;
        }
        self.kept.clear();
        for &column in &self.right {
            let value = std::mem::take(&mut self.row[column as usize]);
            self.present[column as usize] = false;
            if value.abs() > threshold {
                self.kept.push((column, value));
            }
        }
        self.right.clear();
        largest(&mut self.kept, self.fill);
        self.upper.push_row(&self.kept);
        self.inverse_diagonal.push(pivot.recip());
        pivot
    }
}

impl<T: SparseScalar> ApproximateInverse<Sparse<T>> for Ilut<T> {
    /// Factors a square matrix. A zero pivot is replaced by a small one, as SPARSKIT does; a zero row is an error.
    fn compute(&mut self, a: &Matrix<T>) -> Result<Option<Pivots>, Failure> {
        let n = a.pattern().rows();
        self.lower.clear();
        self.upper.clear();
        self.inverse_diagonal.clear();
        // A factorization that failed may have left these buffers filled.
        self.row.clear();
        self.row.resize(n, T::zero());
        self.present.clear();
        self.present.resize(n, false);
        self.left.clear();
        self.right.clear();
        let mut pivots = Pivots::empty();
        for i in 0..n {
            let threshold = self.scatter_row(a, i);
            if threshold.is_zero() {
                return Err(SolveError::Singular { unknown: i, ratio: 0.0, limit: 0.0 });
            }
            self.eliminate(i);
            let pivot = self.store_row(i, threshold);
            pivots.record(pivot.as_f64(), i);
        }
        Ok(Some(pivots))
    }

    /// Computes `y = (L U)^-1 x`.
    fn apply(&mut self, x: &Vector<T>, y: &mut Vector<T>) -> Result<(), Failure> {
        let y = y.as_mut_slice();
        y.copy_from_slice(x.as_slice());
        for i in 0..y.len() {
            let sum: T = self.lower.row(i).map(|(column, value)| value * y[column]).sum();
            y[i] -= sum;
        }
        for i in (0..y.len()).rev() {
            let sum: T = self.upper.row(i).map(|(column, value)| value * y[column]).sum();
            y[i] = (y[i] - sum) * self.inverse_diagonal[i];
        }
        Ok(())
    }

    /// Returns the number of entries of both factors, including the diagonal of `U`.
    fn entries(&self) -> Option<usize> {
        Some(self.lower.columns.len() + self.upper.columns.len() + self.inverse_diagonal.len())
    }
}

/// Keeps the `count` entries with the largest absolute values, columns ascending; of equal values the leftmost.
fn largest<T: Scalar>(entries: &mut Vec<(u32, T)>, count: usize) {
    if entries.len() > count {
        let order = |a: &(u32, T), b: &(u32, T)| {
            b.1.abs().partial_cmp(&a.1.abs()).unwrap_or(std::cmp::Ordering::Equal).then(a.0.cmp(&b.0))
        };
        if count > 0 {
            entries.select_nth_unstable_by(count - 1, order);
        }
        entries.truncate(count);
    }
    entries.sort_unstable_by_key(|&(column, _)| column);
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use super::*;
    use crate::las::conformance::Random;
    use crate::las::{MatrixOps, Sparsity};

    type Sparse = crate::backends::sparse::Sparse;

    /// A matrix with a random pattern and a diagonal so large that elimination needs no row exchanges.
    fn matrix(unknowns: usize, seed: u64) -> Matrix<f64> {
        let mut random = Random::new(seed);
        let pattern = random.elements(unknowns);
        let mut a = Matrix::zeros(&pattern);
        for row in 0..unknowns {
            for &column in pattern.row(row) {
                let value = random.signed() + if row == column as usize { 20.0 } else { 0.0 };
                MatrixOps::<Sparse>::set(&mut a, &[row as i32], &[column as i32], &[value]).unwrap();
            }
        }
        a
    }

    /// Returns `L U` as a dense matrix.
    fn product(ilut: &Ilut<f64>, n: usize) -> Vec<f64> {
        let upper = |row: usize| ilut.upper.row(row).chain([(row, 1.0 / ilut.inverse_diagonal[row])]);
        let mut product = vec![0.0; n * n];
        for row in 0..n {
            for (k, left) in ilut.lower.row(row).chain([(row, 1.0)]) {
                for (column, right) in upper(k) {
                    product[row * n + column] += left * right;
                }
            }
        }
        product
    }

    #[test]
    fn without_dropping_it_is_lu() {
        for (seed, n) in [(1, 1), (2, 7), (3, 40), (4, 120)] {
            let a = matrix(n, seed);
            let mut ilut = Ilut::<f64>::new(0.0, n);
            let pivots = ilut.compute(&a).unwrap().unwrap();
            assert!(pivots.negative() == 0 && pivots.ratio() > 0.0);
            let product = product(&ilut, n);
            for row in 0..n {
                for column in 0..n {
                    let exact = a.pattern().find(row, column).map_or(0.0, |at| a.values()[at]);
                    let apart = (product[row * n + column] - exact).abs();
                    assert!(apart < 1e-12, "({row}, {column}) of {n}: {apart:e}");
                }
            }
        }
    }

    #[test]
    fn no_row_keeps_more_than_the_fill_limit() {
        let (n, fill) = (120, 4);
        let a = matrix(n, 5);
        let mut ilut = Ilut::<f64>::new(1e-3, fill);
        ilut.compute(&a).unwrap();
        assert!((0..n).all(|row| ilut.lower.row(row).count() <= fill && ilut.upper.row(row).count() <= fill));
        assert!((0..n).any(|row| ilut.upper.row(row).count() == fill), "some rows are filled up to the limit");
        let first = ilut.entries();
        ilut.compute(&a).unwrap();
        assert_eq!(ilut.entries(), first, "no entry of the previous factorization remains");
        assert!(ilut.present.iter().all(|present| !present) && ilut.row.iter().all(|&value| value == 0.0));
    }

    #[test]
    fn a_zero_row_is_reported() {
        let pattern = Arc::new(Sparsity::from_elements(3, [[0, 1], [1, 2]]).unwrap());
        let mut a = Matrix::<f64>::zeros(&pattern);
        MatrixOps::<Sparse>::set(&mut a, &[0], &[0], &[1.0]).unwrap();
        MatrixOps::<Sparse>::set(&mut a, &[2], &[2], &[1.0]).unwrap();
        let mut ilut = Ilut::<f64>::new(0.0, 3);
        let outcome = ilut.compute(&a).err();
        assert!(matches!(outcome, Some(SolveError::Singular { unknown: 1, .. })), "{outcome:?}");
        // The failed factorization does not affect the next one.
        MatrixOps::<Sparse>::set(&mut a, &[1], &[1], &[2.0]).unwrap();
        ilut.compute(&a).unwrap();
        assert_eq!(product(&ilut, 3), [1.0, 0.0, 0.0, 0.0, 2.0, 0.0, 0.0, 0.0, 1.0]);
    }
}
