//! One level of the hierarchy: its matrix and smoother, and the transfer to the next level.
//!
//! What depends on the pattern, the strong couplings and the near null space is computed once: aggregates, the
//! tentative prolongation and the patterns of the prolongation and of the coarse matrix. [`Level::update`] computes the
//! numbers from a matrix of the same pattern.

use super::aggregation::{Aggregates, aggregate, strong_couplings};
use super::blocks::{BlockMatrix, Entry, for_each_block};
use super::galerkin;
use super::prolongation::{NodeModes, Prolongation, Tentative, tentative};
use super::smoother::{SingularBlock, Smoother, diagonals, inverses};
use super::{CHUNK, MultigridParams};
use crate::parallel;

/// Number of power iterations for the largest eigenvalue of `D^-1 A` of the first matrix.
const FIRST_POWER_ITERATIONS: usize = 10;

/// Number of power iterations for later matrices, from the vector of the previous one.
const POWER_ITERATIONS: usize = 3;

/// The power iteration approaches the largest eigenvalue from below.
const EIGENVALUE_SAFETY: f64 = 1.1;

/// A coarse level that keeps more than this fraction of the rows of the finer one does not pay.
const LEAST_COARSENING: f64 = 0.7;

/// A level but the coarsest.
pub(super) struct Level<T> {
    /// The matrix in the precision of the cycle, divided by the unit of the hierarchy.
    pub a: BlockMatrix<T>,
    pub smoother: Smoother<T>,
    /// The prolongation from the next level, and the restriction to it, its transpose.
    pub p: BlockMatrix<T>,
    pub r: BlockMatrix<T>,
    /// Right-hand side, solution and scratch of the cycle.
    pub b: Vec<T>,
    pub x: Vec<T>,
    pub work: Vec<T>,
    setup: Setup,
}

/// The large arrays of a level, which the next hierarchy takes over: memory that is returned to the system and requested
/// again costs the time in which the system clears it.
#[derive(Default)]
pub(super) struct Memory<T> {
    a: Vec<T>,
    p: Vec<T>,
    r: Vec<T>,
    prolongation: Vec<f64>,
    coarse: Vec<f64>,
}

/// What the setup of a level computes in double precision.
struct Setup {
    aggregates: Aggregates,
    tentative: Tentative,
    prolongation: Prolongation,
    /// The index of the diagonal block of each row.
    diagonal: Vec<u32>,
    /// The vector of the power iteration.
    dominant: Vec<f64>,
    /// The estimate of the largest eigenvalue of `D^-1 A`.
    largest_eigenvalue: f64,
    /// For each block of the restriction, the index of its transpose in the prolongation.
    transposes: Vec<u32>,
    coarse: BlockMatrix<f64>,
}

impl<T: Entry> Level<T> {
    /// Builds the level of the matrix `a`, on which `modes` are almost zero; also returns the near null space of the
    /// coarse matrix. `None` if the matrix is small or cannot be coarsened.
    pub fn new(
        a: &BlockMatrix<f64>,
        modes: &NodeModes,
        threshold: f64,
        params: &MultigridParams,
        unit: f64,
        memory: Memory<T>,
    ) -> Result<Option<(Self, NodeModes)>, SingularBlock> {
        let unknowns = a.rows() * a.size.0;
        if unknowns <= params.coarsest {
            return Ok(None);
        }
        let diagonal = diagonals(a)?;
        let aggregates = aggregate(a, &strong_couplings(a, threshold));
        if aggregates.count == 0 || aggregates.count as f64 > LEAST_COARSENING * a.rows() as f64 {
            return Ok(None);
        }
        let (tentative, coarse_modes) = tentative(&aggregates, modes);
        let prolongation = Prolongation::new(a, &aggregates, tentative.vectors, params.drop_below, memory.prolongation);
        let (r, transposes) = prolongation.p.transposed_pattern();
        let coarse = galerkin::with_pattern(a, &prolongation.p, &r, memory.coarse);
        let setup = Setup {
            aggregates,
            tentative,
            prolongation,
            diagonal,
            dominant: start_vector(unknowns),
            largest_eigenvalue: 1.0,
            transposes,
            coarse,
        };
        let zeros = || vec![T::zero(); unknowns];
        let mut level = Self {
            a: a.like(memory.a),
            smoother: Smoother::new(a),
            p: setup.prolongation.p.like(memory.p),
            r: r.like(memory.r),
            b: zeros(),
            x: zeros(),
            work: zeros(),
            setup,
        };
        level.compute(a, params, unit, FIRST_POWER_ITERATIONS)?;
        Ok(Some((level, coarse_modes)))
    }

    /// Computes all numbers of the level from a matrix of the same pattern.
    pub fn update(&mut self, a: &BlockMatrix<f64>, params: &MultigridParams, unit: f64) -> Result<(), SingularBlock> {
        self.compute(a, params, unit, POWER_ITERATIONS)
    }

    /// Returns the memory for the level of another hierarchy.
    pub fn into_memory(self) -> Memory<T> {
        let Setup { prolongation, coarse, .. } = self.setup;
        let (prolongation, coarse) = (prolongation.p.values, coarse.values);
        Memory { a: self.a.values, p: self.p.values, r: self.r.values, prolongation, coarse }
    }

    /// Returns the matrix of the next level.
    pub fn coarse(&self) -> &BlockMatrix<f64> {
        &self.setup.coarse
    }

    /// Returns the index of the diagonal block of each row.
    #[cfg(feature = "cuda")]
    pub fn diagonal(&self) -> &[u32] {
        &self.setup.diagonal
    }

    /// Returns an estimate of the largest eigenvalue of `D^-1 A`, with a margin.
    #[cfg(feature = "cuda")]
    pub fn largest_eigenvalue(&self) -> f64 {
        self.setup.largest_eigenvalue
    }

    fn compute(
        &mut self,
        a: &BlockMatrix<f64>,
        params: &MultigridParams,
        unit: f64,
        power_iterations: usize,
    ) -> Result<(), SingularBlock> {
        let Setup { aggregates, tentative, prolongation, diagonal, dominant, largest_eigenvalue, transposes, coarse } =
            &mut self.setup;
        let inverse = inverses(a, diagonal, |_, _| 0.0)?;
        *largest_eigenvalue = EIGENVALUE_SAFETY * estimated_eigenvalue(a, &inverse, dominant, power_iterations);
        let omega = params.damping / *largest_eigenvalue;
        prolongation.smooth(a, &inverse, aggregates, tentative, omega);
        let p = &prolongation.p;
        self.p.convert_from(p, 1.0);
        self.r.transpose_from(p, transposes);
        galerkin::compute(a, p, coarse);
        fill_inactive(coarse);
        self.smoother.compute(a, diagonal, unit)?;
        self.a.convert_from(a, unit);
        Ok(())
    }
}

/// Sets the diagonal of coarse unknowns without a vector, whose rows and columns are zero, to the mean of the others of
/// the node.
fn fill_inactive(a: &mut BlockMatrix<f64>) {
    let size = a.size.0;
    for row in 0..a.rows() {
        let Some(at) = a.range(row).find(|&at| a.columns[at] as usize == row) else { continue };
        let block = &mut a.values[at * size * size..][..size * size];
        let active: Vec<f64> = (0..size).map(|i| block[i * size + i]).filter(|&value| value != 0.0).collect();
        let mean = if active.is_empty() { 1.0 } else { active.iter().sum::<f64>() / active.len() as f64 };
        for i in 0..size {
            if block[i * size + i] == 0.0 {
                block[i * size + i] = mean;
            }
        }
    }
}

/// Returns a vector without symmetries, from a fixed sequence of random numbers.
fn start_vector(len: usize) -> Vec<f64> {
    let mut state = 1;
    (0..len).map(|_| crate::las::splitmix64(&mut state) as f64 / u64::MAX as f64 - 0.5).collect()
}

/// Estimates the largest eigenvalue of `D^-1 A` by power iterations from `x`, which is replaced.
fn estimated_eigenvalue(a: &BlockMatrix<f64>, inverse: &[f64], x: &mut [f64], iterations: usize) -> f64 {
    let size = a.size.0;
    let (mut y, mut estimate) = (vec![0.0; x.len()], 1.0);
    let mut length = norm(x);
    for _ in 0..iterations {
        if length == 0.0 || !length.is_finite() {
            break;
        }
        for_each_block(x, size, |(_, x)| x.iter_mut().for_each(|x| *x /= length));
        a.multiply::<false>(x, &mut y);
        for_each_block(x, size, |(row, x)| {
            let (y, inverse) = (&y[row * size..][..size], &inverse[row * size * size..][..size * size]);
            for (i, x) in x.iter_mut().enumerate() {
                *x = (0..size).map(|j| inverse[j * size + i] * y[j]).sum();
            }
        });
        length = norm(x);
        estimate = length;
    }
    estimate
}

/// Returns the norm of a vector, summed in chunks of a fixed size.
fn norm(x: &[f64]) -> f64 {
    let of_chunk = |x: &[f64]| x.iter().map(|x| x * x).sum::<f64>();
    parallel::map(x.chunks(CHUNK), of_chunk).iter().sum::<f64>().sqrt()
}
