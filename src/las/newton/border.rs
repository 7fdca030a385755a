//! Systems bordered by scalar constraints, solved with the factorization of the matrix alone.
//!
//! A problem with `m` constraints `c(x, p) = 0` and multipliers `p` has the linear system
//!
//! ```text
//! [ K    -V ] [dx]   [r]
//! [ V^T   D ] [dp] = [c]
//! ```
//!
//! with the gradients `V = dc/dx`, an `n` by `m` matrix that may be dense, and the diagonal matrix `D = dc/dp` of the
//! compliances. Eliminating `dx = y + Z dp` with `K [y Z] = [r V]` leaves the Schur complement (G. H. Golub and C. F.
//! Van Loan, *Matrix Computations*, 4th ed., 2013, section 3.2.11)
//!
//! ```text
//! (V^T Z + D) dp = c - V^T y.
//! ```
//!
//! The sparse matrix `K` is factored as without constraints, with `m` more right-hand sides. Elimination of `dp`
//! instead, with `K + V D^-1 V^T`, would need `D > 0` and fill the matrix.

use crate::las::{Backend, Scalar, SolveError, SolveReport, Solver, Value, VectorOps};

/// A scaled pivot of the Schur complement below this value is zero up to rounding.
const SINGULAR: f64 = 1e-11;

/// The constraints of a [`NewtonSystem`](super::NewtonSystem), the border of its matrix.
#[derive(Debug)]
pub struct Border<B: Backend> {
    /// The diagonal `dc_j/dp_j`, which is not negative; 0 for a constraint that holds exactly.
    pub compliances: Vec<f64>,
    /// The right-hand sides `c_j`.
    pub residuals: Vec<f64>,
    /// The solution `dp`.
    pub increments: Vec<f64>,
    /// The gradients `V`, then a copy of `r`.
    right_hand_sides: Vec<B::Vector>,
    /// The solutions `Z`, then `y`.
    solutions: Vec<B::Vector>,
}

impl<B: Backend> Border<B> {
    pub(super) fn empty() -> Self {
        let (right_hand_sides, solutions) = (Vec::new(), Vec::new());
        Self { compliances: Vec::new(), residuals: Vec::new(), increments: Vec::new(), right_hand_sides, solutions }
    }

    /// Creates the border of a matrix with `rows` rows.
    pub(super) fn new(context: &B::Context, rows: usize, constraints: usize) -> Result<Self, B::Error> {
        if constraints == 0 {
            return Ok(Self::empty());
        }
        let vectors = || (0..=constraints).map(|_| B::vector(context, rows)).collect::<Result<_, _>>();
        let zeros = vec![0.0; constraints];
        Ok(Self {
            compliances: zeros.clone(),
            residuals: zeros.clone(),
            increments: zeros,
            right_hand_sides: vectors()?,
            solutions: vectors()?,
        })
    }

    /// Returns the number of constraints.
    pub fn len(&self) -> usize {
        self.residuals.len()
    }

    /// Returns true if there are no constraints.
    pub fn is_empty(&self) -> bool {
        self.residuals.is_empty()
    }

    /// Returns the absolute value of `dp . c`, the work of the constraints in the last solution.
    pub(super) fn work(&self) -> f64 {
        self.increments.iter().zip(&self.residuals).map(|(dp, c)| dp * c).sum::<f64>().abs()
    }

    /// Returns the gradient `dc_j/dx` of each constraint, to be written.
    pub fn gradients_mut(&mut self) -> &mut [B::Vector] {
        let constraints = self.len();
        &mut self.right_hand_sides[..constraints]
    }
}

impl<B: Backend<Reduced: Scalar>> Border<B> {
    /// Solves the bordered system with the factorization of `K` that `solver` holds: writes `dx` into `direction` and
    /// `dp` into [`Border::increments`]. On a distributed backend every rank gets the same `dp`.
    pub(super) fn solve(
        &mut self,
        solver: &mut B::Solver,
        residual: &B::Vector,
        direction: &mut B::Vector,
    ) -> Result<SolveReport, SolveError<B::Error>> {
        let Self { compliances, residuals, increments, right_hand_sides, solutions } = self;
        if let Some(copy) = right_hand_sides.last_mut() {
            copy.zero()?;
            copy.axpy(B::Scalar::every(1.0), residual)?;
        }
        let report = solver.solve_many(right_hand_sides, solutions)?;
        let (Some((_, gradients)), Some((y, z))) = (right_hand_sides.split_last(), solutions.split_last()) else {
            return Ok(report);
        };
        // The size of each constraint: the terms of `V_i . Z_j` are at most `size_i size_j` for a symmetric `K`.
        let mut sizes = Vec::with_capacity(gradients.len());
        for ((gradient, z), compliance) in gradients.iter().zip(z).zip(&*compliances) {
            sizes.push((gradient.norm()?.as_f64() * z.norm()?.as_f64() + compliance).sqrt());
        }
        let mut schur = Vec::with_capacity(gradients.len());
        for (i, gradient) in gradients.iter().enumerate() {
            let mut row = Vec::with_capacity(gradients.len() + 1);
            for (j, z) in z.iter().enumerate() {
                let compliance = if i == j { compliances[i] } else { 0.0 };
                row.push((gradient.dot(z)?.as_f64() + compliance) / (sizes[i] * sizes[j]));
            }
            row.push((residuals[i] - gradient.dot(y)?.as_f64()) / sizes[i]);
            schur.push(row);
        }
        let scaled = eliminate(schur).map_err(|Zero { constraint, ratio }| SolveError::SingularBorder {
            constraint,
            ratio,
            limit: SINGULAR,
        })?;
        direction.zero()?;
        direction.axpy(B::Scalar::every(1.0), y)?;
        for (j, z) in z.iter().enumerate() {
            increments[j] = scaled[j] / sizes[j];
            direction.axpy(B::Scalar::every(increments[j]), z)?;
        }
        Ok(report)
    }
}

/// A pivot that is zero up to rounding.
struct Zero {
    constraint: usize,
    ratio: f64,
}

/// Solves the system whose rows hold the coefficients, then the right-hand side, by Gaussian elimination with complete
/// pivoting; the coefficients are scaled to 1 or less.
fn eliminate(mut rows: Vec<Vec<f64>>) -> Result<Vec<f64>, Zero> {
    let m = rows.len();
    let mut order: Vec<usize> = (0..m).collect();
    for k in 0..m {
        let positions = (k..m).flat_map(|row| (k..m).map(move |column| (row, column)));
        let size = |&(row, column): &(usize, usize)| {
            let size = rows[row][column].abs();
            // A scale of zero makes a NaN.
            if size.is_nan() { 0.0 } else { size }
        };
        let Some((row, column)) = positions.max_by(|one, other| size(one).total_cmp(&size(other))) else { break };
        let ratio = size(&(row, column));
        if ratio < SINGULAR {
            return Err(Zero { constraint: order[column], ratio });
        }
        rows.swap(k, row);
        rows.iter_mut().for_each(|row| row.swap(k, column));
        order.swap(k, column);
        let pivot = rows[k].clone();
        for row in &mut rows[k + 1..] {
            let factor = row[k] / pivot[k];
            row.iter_mut().zip(&pivot).skip(k).for_each(|(entry, pivot)| *entry -= factor * pivot);
        }
    }
    let mut solution = vec![0.0; m];
    for k in (0..m).rev() {
        let known: f64 = (k + 1..m).map(|j| rows[k][j] * solution[order[j]]).sum();
        solution[order[k]] = (rows[k][m] - known) / rows[k][k];
    }
    Ok(solution)
}

#[cfg(all(test, feature = "dense"))]
mod tests;
