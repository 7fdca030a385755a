//! Incomplete LU with a threshold (Y. Saad, *ILUT: a dual threshold incomplete LU factorization*, Numer. Linear Algebra
//! Appl. 1, 1994; the preconditioner of that name in SPARSKIT).
//!
//! Row by row, Gaussian elimination without exchanges: multipliers below the drop tolerance are left out; of what then
//! stands in a row, entries below the tolerance times the row's mean absolute value are dropped, and of the rest each
//! factor keeps the `fill` largest beside the diagonal. With tolerance 0 and a fill without limit it is LU itself.

use std::cmp::Reverse;
use std::collections::BinaryHeap;

use super::{Matrix, Vector};
use crate::backends::direct::Pivots;
use crate::las::{Scalar, SolveError};

/// Compressed rows that grow while they are made.
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

    fn close_row(&mut self) {
        self.start.push(self.columns.len());
    }

    fn row(&self, row: usize) -> impl DoubleEndedIterator<Item = (usize, T)> {
        let range = self.start[row]..self.start[row + 1];
        self.columns[range.clone()].iter().zip(&self.values[range]).map(|(&column, &value)| (column as usize, value))
    }
}

/// The factors: `L` with a diagonal of ones that is not kept, `U` with the inverse of its diagonal apart.
pub(super) struct Ilut<T> {
    drop_tolerance: T,
    fill: usize,
    lower: Rows<T>,
    upper: Rows<T>,
    inverse_diagonal: Vec<T>,
    /// The row in work: its values by column, and which columns it has.
    row: Vec<T>,
    present: Vec<bool>,
    /// Columns left of the diagonal yet to be eliminated, the first on top.
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

    /// Entries of both factors, the diagonal of `U` included.
    pub(super) fn entries(&self) -> usize {
        self.lower.columns.len() + self.upper.columns.len() + self.inverse_diagonal.len()
    }

    /// Factors a square matrix. A pivot of zero is replaced by a small one, as SPARSKIT does; a row of zeros is an error.
    pub(super) fn factor<F>(&mut self, a: &Matrix<T>) -> Result<Pivots, SolveError<F>> {
        let n = a.pattern().rows();
        self.lower.clear();
        self.upper.clear();
        self.inverse_diagonal.clear();
        // One that ended early leaves them as they were.
        self.row.clear();
        self.row.resize(n, T::zero());
        self.present.clear();
        self.present.resize(n, false);
        self.left.clear();
        self.right.clear();
        let mut pivots = Pivots::none();
        for i in 0..n {
            let threshold = self.load(a, i);
            if threshold.is_zero() {
                return Err(SolveError::Singular { unknown: i, ratio: 0.0, limit: 0.0 });
            }
            self.eliminate(i);
            let pivot = self.store(i, threshold);
            pivots.see(pivot.as_f64(), i);
        }
        Ok(pivots)
    }

    /// Spreads row `i` out; gives its mean absolute value.
    fn load(&mut self, a: &Matrix<T>, i: usize) -> T {
        let range = a.pattern().row_offsets()[i] as usize..a.pattern().row_offsets()[i + 1] as usize;
        let (columns, values) = (&a.pattern().columns()[range.clone()], &a.values()[range]);
        self.present[i] = true;
        for (&column, &value) in columns.iter().zip(values) {
            self.row[column as usize] = value;
            self.meet(i, column);
        }
        let sum: T = values.iter().map(|value| value.abs()).sum();
        sum / T::of(values.len().max(1) as f64)
    }

    /// Notes that the row has a column.
    fn meet(&mut self, i: usize, column: u32) {
        let at = column as usize;
        if !std::mem::replace(&mut self.present[at], true) {
            if at < i { self.left.push(Reverse(column)) } else { self.right.push(column) }
        }
    }

    /// Takes the columns left of the diagonal away, from the first on; fill appears to their right.
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
                self.meet(i, column);
            }
        }
    }

    /// Keeps the largest of row `i` in both factors and clears it; gives the pivot.
    fn store(&mut self, i: usize, mean: T) -> T {
        let threshold = self.drop_tolerance * mean;
        largest(&mut self.multipliers, self.fill);
        for &(column, value) in &self.multipliers {
            self.lower.columns.push(column);
            self.lower.values.push(value);
        }
        self.lower.close_row();
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
        for &(column, value) in &self.kept {
            self.upper.columns.push(column);
            self.upper.values.push(value);
        }
        self.upper.close_row();
        self.inverse_diagonal.push(pivot.recip());
        pivot
    }

    /// `y = (L U)^-1 x`.
    pub(super) fn apply(&self, x: &Vector<T>, y: &mut Vector<T>) {
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
    }
}

/// The `count` largest by absolute value, columns ascending; of equal ones those to the left.
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

    /// Of a random pattern, with a diagonal that lets elimination do without exchanges.
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

    /// `L U` as a dense matrix.
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
            let mut ilut = Ilut::new(0.0, n);
            let pivots = ilut.factor::<()>(&a).unwrap();
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
    fn no_row_keeps_more_than_its_share() {
        let (n, fill) = (120, 4);
        let a = matrix(n, 5);
        let mut ilut = Ilut::new(1e-3, fill);
        ilut.factor::<()>(&a).unwrap();
        assert!((0..n).all(|row| ilut.lower.row(row).count() <= fill && ilut.upper.row(row).count() <= fill));
        assert!((0..n).any(|row| ilut.upper.row(row).count() == fill), "the limit does limit");
        let first = ilut.entries();
        ilut.factor::<()>(&a).unwrap();
        assert_eq!(ilut.entries(), first, "nothing of the factorization before is left");
        assert!(ilut.present.iter().all(|present| !present) && ilut.row.iter().all(|&value| value == 0.0));
    }

    #[test]
    fn a_row_of_zeros_is_named() {
        let pattern = Arc::new(Sparsity::from_elements(3, [[0, 1], [1, 2]]).unwrap());
        let mut a = Matrix::<f64>::zeros(&pattern);
        MatrixOps::<Sparse>::set(&mut a, &[0], &[0], &[1.0]).unwrap();
        MatrixOps::<Sparse>::set(&mut a, &[2], &[2], &[1.0]).unwrap();
        let mut ilut = Ilut::new(0.0, 3);
        let outcome = ilut.factor::<()>(&a).err();
        assert!(matches!(outcome, Some(SolveError::Singular { unknown: 1, .. })), "{outcome:?}");
        // Nothing of it is left in the next one.
        MatrixOps::<Sparse>::set(&mut a, &[1], &[1], &[2.0]).unwrap();
        ilut.factor::<()>(&a).unwrap();
        assert_eq!(product(&ilut, 3), [1.0, 0.0, 0.0, 0.0, 2.0, 0.0, 0.0, 0.0, 1.0]);
    }
}
