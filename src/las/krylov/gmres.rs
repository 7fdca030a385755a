//! Generalized minimal residuals with restarts (modified Gram-Schmidt, Givens rotations). Right preconditioning, so
//! that the method minimizes the true residual.

use num_traits::{Float, One, Zero};

use super::{Ended, Run};
use crate::las::{Failure, Scalar, SingleLane, VectorOps};

/// Number of vectors: the basis of `restart + 1` vectors, one for products and one for preconditioned vectors.
pub(super) fn vectors(restart: usize) -> usize {
    restart.max(1) + 3
}

/// Number of coefficients: the Hessenberg matrix by columns, the rotations, and the right-hand side.
pub(super) fn coefficients(restart: usize) -> usize {
    let m = restart.max(1);
    (m + 1) * m + 2 * m + m + 1
}

/// Performs up to `restart` steps from the residual in `vectors[0]`.
pub(super) fn run<B: SingleLane>(
    run: &mut Run<'_, B>,
    x: &mut B::Vector,
    vectors: &mut [B::Vector],
    coefficients: &mut [B::Scalar],
    restart: usize,
) -> Result<Ended, Failure<B>> {
    let m = restart.max(1);
    let (basis, [product, z]) = vectors.split_at_mut(m + 1) else { return Ok(Ended::Breakdown) };
    let (h, rest) = coefficients.split_at_mut((m + 1) * m);
    let (rotations, g) = rest.split_at_mut(2 * m);
    g.fill(B::Scalar::zero());
    g[0] = basis[0].norm()?;
    let length = g[0];
    basis[0].with_local_mut(|v| v.iter_mut().for_each(|v| *v /= length))?;
    let mut steps = 0;
    let mut broke_down = false;
    while steps < m && run.iterations < run.max_iterations {
        let k = steps;
        let column = &mut h[k * (m + 1)..(k + 1) * (m + 1)];
        (run.m)(&basis[k], z)?;
        (run.a)(z, product)?;
        let before = product.norm()?;
        for (i, v) in basis[..=k].iter().enumerate() {
            column[i] = v.dot(product)?;
            product.axpy(-column[i], v)?;
        }
        column[k + 1] = product.norm()?;
        run.iterations += 1;
        steps += 1;
        let length = column[k + 1];
        rotate(column, &mut rotations[..2 * (k + 1)], g, k);
        if !column[k].is_finite() || column[k].is_zero() {
            steps -= 1;
            broke_down = true;
            break;
        }
        // The Krylov subspace is invariant and contains the solution.
        let exhausted = length <= before * B::Scalar::epsilon();
        if g[k + 1].abs() <= run.target || exhausted {
            break;
        }
        basis[k + 1].axpby(B::Scalar::one() / length, product, B::Scalar::zero())?;
    }
    back_substitute(h, g, m, steps);
    VectorOps::zero(product)?;
    for (v, &y) in basis.iter().zip(&g[..steps]) {
        product.axpy(y, v)?;
    }
    (run.m)(product, z)?;
    x.axpy(B::Scalar::one(), z)?;
    Ok(if broke_down || steps == 0 { Ended::Breakdown } else { Ended::CheckResidual })
}

/// Makes column `k` upper triangular: applies the previous rotations and appends one that eliminates the subdiagonal
/// entry.
fn rotate<T: Scalar>(column: &mut [T], rotations: &mut [T], g: &mut [T], k: usize) {
    for i in 0..k {
        let (c, s) = (rotations[2 * i], rotations[2 * i + 1]);
        (column[i], column[i + 1]) = (c * column[i] + s * column[i + 1], c * column[i + 1] - s * column[i]);
    }
    let length = column[k].hypot(column[k + 1]);
    let (c, s) = if length.is_zero() { (T::one(), T::zero()) } else { (column[k] / length, column[k + 1] / length) };
    (rotations[2 * k], rotations[2 * k + 1]) = (c, s);
    (column[k], column[k + 1]) = (length, T::zero());
    (g[k], g[k + 1]) = (c * g[k], -s * g[k]);
}

/// Solves the triangular system for the coefficients of the basis; overwrites the right-hand side.
fn back_substitute<T: Scalar>(h: &[T], g: &mut [T], m: usize, steps: usize) {
    for k in (0..steps).rev() {
        let column = &h[k * (m + 1)..(k + 1) * (m + 1)];
        g[k] /= column[k];
        for i in 0..k {
            let y = g[k];
            g[i] -= column[i] * y;
        }
    }
}
