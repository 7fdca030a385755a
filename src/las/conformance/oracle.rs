//! The naive reference: a dense matrix in double precision, and the numbers and patterns that tests draw.

use std::sync::Arc;

use crate::las::Sparsity;

/// SplitMix64: a generator of a few lines whose sequence never changes.
///
/// Reference: G. L. Steele, D. Lea, C. H. Flood, *Fast splittable pseudorandom number generators*, OOPSLA 2014.
#[derive(Clone, Debug)]
pub struct Random(u64);

impl Random {
    /// The sequence of a seed.
    #[must_use]
    pub fn new(seed: u64) -> Self {
        Self(seed)
    }

    /// 64 bits.
    pub fn bits(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        z ^ (z >> 31)
    }

    /// An integer from 0 to `end - 1`.
    pub fn below(&mut self, end: usize) -> usize {
        (self.bits() % end as u64) as usize
    }

    /// A real number from -1 to 1 whose digits fit every scalar.
    pub fn signed(&mut self) -> f64 {
        (self.below(2049) as f64 - 1024.0) / 1024.0
    }

    /// A small integer, so that sums of many are exact in every scalar.
    pub fn integer(&mut self) -> f64 {
        self.below(17) as f64 - 8.0
    }

    /// `count` small integers.
    pub fn integers(&mut self, count: usize) -> Vec<f64> {
        (0..count).map(|_| self.integer()).collect()
    }

    /// Up to `most` positions below `end`, repeated ones and constrained ones (`None`) among them.
    pub fn positions(&mut self, most: usize, end: usize) -> Vec<Option<usize>> {
        let count = self.below(most + 1);
        (0..count).map(|_| if end == 0 || self.below(5) == 0 { None } else { Some(self.below(end)) }).collect()
    }

    /// The pattern of elements of two to five unknowns each, enough of them to tie most of the unknowns together.
    pub fn elements(&mut self, unknowns: usize) -> Arc<Sparsity> {
        let elements: Vec<Vec<i32>> =
            (0..2 * unknowns).map(|_| (0..2 + self.below(4)).map(|_| self.below(unknowns) as i32).collect()).collect();
        Arc::new(Sparsity::from_elements(unknowns, elements).unwrap_or_else(|error| panic!("{error}")))
    }

    /// The pattern of a truss: full blocks of three unknowns a node, and about `bars` bars a node between nodes that mostly
    /// lie near each other in their numbering; some nodes may have none.
    pub fn truss(&mut self, nodes: usize, bars: usize) -> Arc<Sparsity> {
        let three = |node: usize| [0, 1, 2].map(|k| (3 * node + k) as i32);
        let mut elements: Vec<Vec<i32>> = (0..nodes).map(|node| three(node).to_vec()).collect();
        for _ in 0..nodes * bars {
            let first = self.below(nodes);
            let second = if self.below(4) == 0 { self.below(nodes) } else { (first + self.below(5)) % nodes };
            elements.push([three(first), three(second)].concat());
        }
        Arc::new(Sparsity::from_elements(3 * nodes, elements).unwrap_or_else(|error| panic!("{error}")))
    }
}

/// A dense matrix, row after row.
#[derive(Clone, Debug, PartialEq)]
pub struct Oracle {
    /// Rows.
    pub rows: usize,
    /// Columns.
    pub cols: usize,
    /// Values.
    pub values: Vec<f64>,
}

impl Oracle {
    /// Zeros.
    #[must_use]
    pub fn zeros(rows: usize, cols: usize) -> Self {
        Self { rows, cols, values: vec![0.0; rows * cols] }
    }

    /// One entry.
    ///
    /// # Panics
    /// Where there is none.
    pub fn at(&mut self, row: usize, column: usize) -> &mut f64 {
        assert!(column < self.cols, "column {column} of {}", self.cols);
        &mut self.values[row * self.cols + column]
    }

    /// `A x`.
    #[must_use]
    pub fn times(&self, x: &[f64]) -> Vec<f64> {
        (0..self.rows).map(|i| (0..self.cols).map(|j| self.values[i * self.cols + j] * x[j]).sum()).collect()
    }

    /// `A B`.
    #[must_use]
    pub fn product(&self, b: &Self) -> Self {
        let mut product = Self::zeros(self.rows, b.cols);
        for i in 0..self.rows {
            for j in 0..b.cols {
                *product.at(i, j) =
                    (0..self.cols).map(|k| self.values[i * self.cols + k] * b.values[k * b.cols + j]).sum();
            }
        }
        product
    }

    /// `A^T`.
    #[must_use]
    pub fn transposed(&self) -> Self {
        let mut transposed = Self::zeros(self.cols, self.rows);
        for i in 0..self.rows {
            for j in 0..self.cols {
                *transposed.at(j, i) = self.values[i * self.cols + j];
            }
        }
        transposed
    }

    /// Largest sum of absolute values of a row.
    #[must_use]
    pub fn norm(&self) -> f64 {
        let sums = (0..self.rows).map(|i| self.values[i * self.cols..][..self.cols].iter().map(|v| v.abs()).sum());
        sums.fold(0.0, f64::max)
    }

    /// Values drawn for the upper triangle of a symmetric pattern and mirrored; the diagonal exceeds the rest of its row
    /// by a half, with the sign that `sign` gives. Such a matrix is well-conditioned, and whatever the order of
    /// elimination, every pivot has the sign of its diagonal entry.
    #[must_use]
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
