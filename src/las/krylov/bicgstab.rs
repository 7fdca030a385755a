//! Stabilized biconjugate gradients with right preconditioning.

use num_traits::{Float, One, Zero};

use super::{Ended, Run, axpy, combine, dot, norm};
use crate::las::{Backend, Scalar, SolveError};

/// Residual, product, shadow residual, direction, preconditioned vector, second product.
pub(super) const VECTORS: usize = 6;

/// Iterates from the residual in `vectors[0]`.
pub(super) fn run<B>(
    run: &mut Run<'_, B>,
    x: &mut B::Vector,
    vectors: &mut [B::Vector],
) -> Result<Ended, SolveError<B::Fault>>
where
    B: Backend<Reduced = <B as Backend>::Scalar>,
    B::Scalar: Scalar,
{
    let one = B::Scalar::one();
    let [r, v, shadow, p, z, t] = vectors else { return Ok(Ended::Breakdown) };
    combine::<B>(shadow, B::Scalar::zero(), one, r)?;
    combine::<B>(p, B::Scalar::zero(), one, r)?;
    let mut rho = dot::<B>(shadow, r)?;
    let begun = run.iterations;
    while run.iterations < run.max_iterations {
        (run.m)(p, z)?;
        (run.a)(z, v)?;
        let alpha = rho / dot::<B>(shadow, v)?;
        if !alpha.is_finite() {
            return Ok(broken(run.iterations > begun));
        }
        axpy::<B>(x, alpha, z)?;
        axpy::<B>(r, -alpha, v)?;
        run.iterations += 1;
        if norm::<B>(r)? <= run.target {
            return Ok(Ended::CheckResidual);
        }
        (run.m)(r, z)?;
        (run.a)(z, t)?;
        let omega = dot::<B>(t, r)? / dot::<B>(t, t)?;
        if !omega.is_finite() {
            return Ok(broken(run.iterations > begun));
        }
        axpy::<B>(x, omega, z)?;
        axpy::<B>(r, -omega, t)?;
        if norm::<B>(r)? <= run.target {
            return Ok(Ended::CheckResidual);
        }
        let before = std::mem::replace(&mut rho, dot::<B>(shadow, r)?);
        let beta = (rho / before) * (alpha / omega);
        if !beta.is_finite() || rho.is_zero() {
            return Ok(broken(true));
        }
        // p = r + beta (p - omega v)
        axpy::<B>(p, -omega, v)?;
        combine::<B>(p, beta, one, r)?;
    }
    Ok(Ended::CheckResidual)
}

/// A breakdown after at least one step allows a restart with a new shadow residual.
fn broken(moved: bool) -> Ended {
    if moved { Ended::CheckResidual } else { Ended::Breakdown }
}
