//! The levels of the hierarchy and the cycle through them.

use std::sync::Arc;

use super::blocks::{BlockMatrix, Entry};
use super::level::{Level, Memory};
use super::prolongation::NodeModes;
use super::smoother::SingularBlock;
use super::{CHUNK, LevelSize, MultigridParams};
use crate::backends::sparse::{Failure, Matrix, Solver, Sparse, Vector};
use crate::las::{Backend, Solver as _, SolverParams, Sparsity, Symmetry};
use crate::parallel;

/// The levels of a multigrid preconditioner that computes with numbers `T`.
pub(super) struct Hierarchy<T> {
    levels: Vec<Level<T>>,
    coarsest: Coarsest<T>,
    /// The number by which the entries of all matrices but the coarsest are divided, so that single precision suffices.
    unit: f64,
}

/// The coarsest level: a factorization in double precision.
struct Coarsest<T> {
    solver: Solver<f64>,
    matrix: Matrix<f64>,
    /// Right-hand side and solution in double precision, and the one of the cycle, which holds both.
    right: Vector<f64>,
    solution: Vector<f64>,
    b: Vec<T>,
}

/// The most unknowns of a coarsest level whose inverse a device multiplies with: 0.5 GB on the host, half of it on the device.
#[cfg(feature = "cuda")]
pub(super) const MOST_INVERTED: usize = 8192;

/// The reason why there is no hierarchy.
pub(super) enum SetupError {
    /// A diagonal block is singular: its row on the finest level, if it is on this level.
    Singular(Option<usize>),
    Failed(Failure),
}

impl From<Failure> for SetupError {
    fn from(error: Failure) -> Self {
        Self::Failed(error)
    }
}

impl<T: Entry> Hierarchy<T> {
    /// Builds the levels for the matrix `a`, on which the vectors `modes` are almost zero, with the memory of the levels of an
    /// earlier hierarchy.
    pub fn new(
        a: &BlockMatrix<f64>,
        modes: NodeModes,
        params: &MultigridParams,
        symmetry: Symmetry,
        memory: Vec<Memory<T>>,
    ) -> Result<Self, SetupError> {
        let unit = unit_of(a);
        let (mut levels, mut modes, mut threshold) = (Vec::<Level<T>>::new(), modes, params.strength);
        let mut memory = memory.into_iter();
        loop {
            let finest = levels.is_empty();
            let a = levels.last().map_or(a, Level::coarse);
            let singular = |block: SingularBlock| SetupError::Singular(finest.then_some(block.row));
            let memory = memory.next().unwrap_or_default();
            let built = Level::new(a, &modes, threshold, params, unit, memory).map_err(singular)?;
            let Some((level, coarse_modes)) = built else { break };
            levels.push(level);
            // Couplings of a coarse matrix are weaker, because smoothing spreads them.
            (modes, threshold) = (coarse_modes, 0.5 * threshold);
        }
        let coarsest = Coarsest::new(levels.last().map_or(a, Level::coarse), symmetry)?;
        Ok(Self { levels, coarsest, unit })
    }

    /// Returns the memory for another hierarchy.
    pub fn into_memory(self) -> Vec<Memory<T>> {
        self.levels.into_iter().map(Level::into_memory).collect()
    }

    /// Computes all numbers from a matrix of the same pattern.
    pub fn update(&mut self, a: &BlockMatrix<f64>, params: &MultigridParams) -> Result<(), SetupError> {
        self.unit = unit_of(a);
        for number in 0..self.levels.len() {
            let (finer, rest) = self.levels.split_at_mut(number);
            let a = finer.last().map_or(a, Level::coarse);
            let updated = rest[0].update(a, params, self.unit);
            updated.map_err(|block| SetupError::Singular((number == 0).then_some(block.row)))?;
        }
        self.coarsest.update(self.levels.last().map_or(a, Level::coarse))
    }

    /// Returns the size of each level, from the finest.
    pub fn sizes(&self) -> Vec<LevelSize> {
        let of = |a: &BlockMatrix<T>| LevelSize { unknowns: a.rows() * a.size.0, entries: a.values.len() };
        let pattern = self.coarsest.matrix.pattern();
        let coarsest = LevelSize { unknowns: pattern.rows(), entries: pattern.nnz() };
        self.levels.iter().map(|level| of(&level.a)).chain([coarsest]).collect()
    }

    /// Returns the number by which a solution of the cycle is divided.
    pub fn unit(&self) -> f64 {
        self.unit
    }

    #[cfg(feature = "cuda")]
    pub fn levels(&self) -> &[Level<T>] {
        &self.levels
    }

    /// Returns the number of unknowns of the coarsest level, and the inverse of its matrix by rows.
    ///
    /// # Errors
    /// Returns [`SolveError::Unsupported`](crate::las::SolveError::Unsupported) if the inverse would take much memory.
    #[cfg(feature = "cuda")]
    pub fn coarsest_inverse(&mut self) -> Result<(usize, Vec<f64>), Failure> {
        self.coarsest.inverse()
    }

    /// Applies a V-cycle: `write` fills the right-hand side, `read` gets the solution.
    pub fn apply(&mut self, write: impl FnOnce(&mut [T]), read: impl FnOnce(&[T])) -> Result<(), Failure> {
        let Self { levels, coarsest, unit } = self;
        match levels.first_mut() {
            Some(first) => write(&mut first.b),
            None => write(&mut coarsest.b),
        }
        for number in 0..levels.len() {
            let (finer, coarser) = levels.split_at_mut(number + 1);
            let Some(level) = finer.last_mut() else { break };
            level.smoother.pre_smooth(&level.a, &level.b, &mut level.x, &mut level.work);
            let b = coarser.first_mut().map_or(&mut coarsest.b, |next| &mut next.b);
            level.r.multiply::<false>(&level.work, b);
        }
        coarsest.solve(*unit)?;
        for number in (0..levels.len()).rev() {
            let (finer, coarser) = levels.split_at_mut(number + 1);
            let Some(level) = finer.last_mut() else { break };
            let correction = coarser.first().map_or(&coarsest.b, |next| &next.x);
            level.p.multiply::<true>(correction, &mut level.x);
            level.smoother.post_smooth(&level.a, &level.b, &mut level.x, &mut level.work);
        }
        read(levels.first().map_or(&coarsest.b, |first| &first.x));
        Ok(())
    }
}

/// Returns the largest absolute value of a matrix.
fn unit_of(a: &BlockMatrix<f64>) -> f64 {
    let of_chunk = |values: &[f64]| values.iter().fold(0.0, |most: f64, value| most.max(value.abs()));
    let largest = parallel::map(a.values.chunks(CHUNK), of_chunk).into_iter().fold(0.0, f64::max);
    if largest > 0.0 { largest } else { 1.0 }
}

impl<T: Entry> Coarsest<T> {
    fn new(a: &BlockMatrix<f64>, symmetry: Symmetry) -> Result<Self, SetupError> {
        let pattern = Arc::new(scalar_pattern(a)?);
        let n = pattern.rows();
        let symbolic = Sparse::<f64>::analyze(&(), &pattern, &SolverParams::new(symmetry))?;
        let mut coarsest = Self {
            solver: Sparse::<f64>::solver(&symbolic)?,
            matrix: Matrix::zeros(&pattern),
            right: vec![0.0; n].into(),
            solution: vec![0.0; n].into(),
            b: vec![T::zero(); n],
        };
        coarsest.update(a)?;
        Ok(coarsest)
    }

    fn update(&mut self, a: &BlockMatrix<f64>) -> Result<(), SetupError> {
        let size = a.size.0;
        let entries = (0..a.rows()).flat_map(|row| (0..size).map(move |i| (row, i))).flat_map(|(row, i)| {
            a.range(row).flat_map(move |at| (0..size).map(move |j| a.values[(at * size + j) * size + i]))
        });
        self.matrix.values_mut().iter_mut().zip(entries).for_each(|(to, from)| *to = from);
        self.solver.factor(&self.matrix)?;
        Ok(())
    }

    #[cfg(feature = "cuda")]
    fn inverse(&mut self) -> Result<(usize, Vec<f64>), Failure> {
        /// Right-hand sides that are solved at a time.
        const COLUMNS: usize = 32;
        let n = self.matrix.pattern().rows();
        if n > MOST_INVERTED {
            return Err(crate::las::SolveError::Unsupported {
                backend: Sparse::<f64>::NAME,
                what: "multigrid for a matrix that coarsening leaves with more than 8192 unknowns",
                cure: "use the diagonal as the preconditioner, a direct method, or the backend `sparse`",
            });
        }
        let mut inverse = vec![0.0; n * n];
        for first in (0..n).step_by(COLUMNS) {
            let columns = first..n.min(first + COLUMNS);
            let unit = |column: usize| {
                let mut unit = vec![0.0; n];
                unit[column] = 1.0;
                Vector::from(unit)
            };
            let right: Vec<_> = columns.clone().map(unit).collect();
            let mut solution = vec![Vector::from(vec![0.0; n]); right.len()];
            self.solver.solve_many(&right, &mut solution)?;
            for (column, solution) in columns.zip(&solution) {
                for (row, &value) in solution.as_slice().iter().enumerate() {
                    inverse[row * n + column] = value;
                }
            }
        }
        Ok((n, inverse))
    }

    /// Replaces the right-hand side, which is not divided by `unit` while the matrix of the cycle is, by the solution.
    fn solve(&mut self, unit: f64) -> Result<(), Failure> {
        self.right.as_mut_slice().iter_mut().zip(&self.b).for_each(|(to, from)| *to = from.as_f64() * unit);
        self.solver.solve(&self.right, &mut self.solution)?;
        self.b.iter_mut().zip(self.solution.as_slice()).for_each(|(to, from)| *to = T::of(*from));
        Ok(())
    }
}

/// Returns the pattern of a matrix of blocks in compressed rows of numbers.
fn scalar_pattern(a: &BlockMatrix<f64>) -> Result<Sparsity, Failure> {
    let size = a.size.0;
    let (mut offsets, mut columns) = (vec![0], Vec::new());
    for row in (0..a.rows()).flat_map(|row| std::iter::repeat_n(row, size)) {
        columns.extend(
            a.columns[a.range(row)].iter().flat_map(|&column| (0..size).map(move |j| column * size as u32 + j as u32)),
        );
        offsets.push(columns.len() as u32);
    }
    Sparsity::from_rows(a.cols * size, offsets, columns).map_err(crate::las::SolveError::TooLarge)
}
