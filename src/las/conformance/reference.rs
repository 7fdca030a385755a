//! The reference: a naive dense matrix in double precision, and random numbers and patterns.

use std::sync::Arc;

use super::unwrap;
use crate::las::{Sparsity, splitmix64};

/// SplitMix64: a short random number generator with a fixed sequence for each seed.
#[derive(Clone, Debug)]
pub struct Random(u64);

impl Random {
    /// Starts the sequence of a seed.
    pub fn new(seed: u64) -> Self {
        Self(seed)
    }

    /// Returns 64 random bits.
    pub fn bits(&mut self) -> u64 {
        splitmix64(&mut self.0)
    }

    /// Returns an integer from 0 to `end - 1`.
    ///
    /// # Panics
    /// Panics if `end` is zero.
    pub fn below(&mut self, end: usize) -> usize {
        (self.bits() % end as u64) as usize
    }

    /// Returns a multiple of 1/1024 from -1 to 1, which every scalar type represents exactly.
    pub fn signed(&mut self) -> f64 {
        (self.below(2049) as f64 - 1024.0) / 1024.0
    }

    /// Returns an integer from -8 to 8, so that sums of many of them are exact in every scalar type.
    pub fn integer(&mut self) -> f64 {
        self.below(17) as f64 - 8.0
    }

    /// Returns `count` integers from -8 to 8.
    pub fn integers(&mut self, count: usize) -> Vec<f64> {
        (0..count).map(|_| self.integer()).collect()
    }

    /// Returns up to five indices below `end`, some of them repeated and a fifth of them negative (constrained).
    pub fn indices(&mut self, end: usize) -> Vec<i32> {
        let index = |random: &mut Self| match random.below(15) {
            0 => i32::MIN,
            1 => -2 - random.below(50) as i32,
            2 => -1,
            _ if end == 0 => -1,
            _ => random.below(end) as i32,
        };
        (0..self.below(6)).map(|_| index(self)).collect()
    }

    /// Returns the square pattern of random elements of two to five unknowns, numerous enough to connect most unknowns.
    pub fn elements(&mut self, unknowns: usize) -> Arc<Sparsity> {
        let elements: Vec<Vec<i32>> =
            (0..2 * unknowns).map(|_| (0..2 + self.below(4)).map(|_| self.below(unknowns) as i32).collect()).collect();
        Arc::new(unwrap(Sparsity::from_elements(unknowns, elements)))
    }

    /// Returns the pattern of a truss: a full block of three unknowns for each node, and about `bars` bars per node,
    /// mostly between nodes with close numbers. Some nodes may have no bar.
    pub fn truss(&mut self, nodes: usize, bars: usize) -> Arc<Sparsity> {
        let three = |node: usize| [0, 1, 2].map(|k| (3 * node + k) as i32);
        let mut elements: Vec<Vec<i32>> = (0..nodes).map(|node| three(node).to_vec()).collect();
        for _ in 0..nodes * bars {
            let first = self.below(nodes);
            let second = if self.below(4) == 0 { self.below(nodes) } else { (first + self.below(5)) % nodes };
            elements.push([three(first), three(second)].concat());
        }
        Arc::new(unwrap(Sparsity::from_elements(3 * nodes, elements)))
    }
}

/// A dense matrix, stored row by row.
#[derive(Clone, Debug, PartialEq)]
pub struct DenseReference {
    /// Number of rows.
    pub rows: usize,
    /// Number of columns.
    pub cols: usize,
    /// Entries, row by row.
    pub values: Vec<f64>,
}

impl DenseReference {
    /// Creates a matrix of zeros.
    pub fn zeros(rows: usize, cols: usize) -> Self {
        Self { rows, cols, values: vec![0.0; rows * cols] }
    }

    /// Returns an entry.
    ///
    /// # Panics
    /// Panics if the entry does not exist.
    pub fn get(&self, row: usize, column: usize) -> f64 {
        assert!(column < self.cols, "column {column} of {}", self.cols);
        self.values[row * self.cols + column]
    }

    /// Returns an entry for modification.
    ///
    /// # Panics
    /// Panics if the entry does not exist.
    pub fn at(&mut self, row: usize, column: usize) -> &mut f64 {
        assert!(column < self.cols, "column {column} of {}", self.cols);
        &mut self.values[row * self.cols + column]
    }

    /// Returns `A x`.
    ///
    /// # Panics
    /// Panics if `x` has fewer than `cols` entries.
    pub fn times(&self, x: &[f64]) -> Vec<f64> {
        (0..self.rows).map(|i| (0..self.cols).map(|j| self.get(i, j) * x[j]).sum()).collect()
    }

    /// Returns `A B`.
    ///
    /// # Panics
    /// Panics if `B` has fewer rows than `A` has columns.
    pub fn product(&self, b: &Self) -> Self {
        Self::from_fn(self.rows, b.cols, |i, j| (0..self.cols).map(|k| self.get(i, k) * b.get(k, j)).sum())
    }

    /// Returns `A^T`.
    pub fn transposed(&self) -> Self {
        Self::from_fn(self.cols, self.rows, |i, j| self.get(j, i))
    }

    fn from_fn(rows: usize, cols: usize, entry: impl Fn(usize, usize) -> f64) -> Self {
        let mut matrix = Self::zeros(rows, cols);
        for i in 0..rows {
            for j in 0..cols {
                *matrix.at(i, j) = entry(i, j);
            }
        }
        matrix
    }

    /// Returns the infinity norm: the largest sum of the absolute entries of a row.
    pub fn norm(&self) -> f64 {
        let sums = (0..self.rows).map(|i| self.values[i * self.cols..][..self.cols].iter().map(|v| v.abs()).sum());
        sums.fold(0.0, f64::max)
    }

    /// Returns a symmetric matrix with random off-diagonal entries at the positions of a square pattern. The absolute
    /// value of each diagonal entry exceeds the sum of the absolute values of the rest of its row by one half; its sign
    /// is `sign(row)`. Such a matrix is well-conditioned, and in every elimination order, each pivot has the sign of
    /// its diagonal entry.
    pub fn dominant(random: &mut Random, pattern: &Sparsity, sign: impl Fn(usize) -> f64) -> Self {
        let n = pattern.rows();
        let mut a = Self::zeros(n, n);
        for i in 0..n {
            for &j in pattern.row(i).iter().filter(|&&j| j as usize > i) {
                let value = random.signed();
                *a.at(i, j as usize) = value;
                *a.at(j as usize, i) = value;
            }
        }
        for i in 0..n {
            let rest: f64 = a.values[i * n..(i + 1) * n].iter().map(|v| v.abs()).sum();
            *a.at(i, i) = sign(i) * (rest + 0.5);
        }
        a
    }
}
