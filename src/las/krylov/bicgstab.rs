//! Stabilized biconjugate gradients with right preconditioning.

use num_traits::{Float, One, Zero};

use super::{Ended, Run};
use crate::las::{Failure, SingleLane, VectorOps};

/// Number of vectors: residual, product, shadow residual, direction, preconditioned vector, second product.
pub(super) const VECTORS: usize = 6;

/// Iterates from the residual in `vectors[0]`.
pub(super) fn run<B: SingleLane>(
    run: &mut Run<'_, B>,
    x: &mut B::Vector,
    vectors: &mut [B::Vector],
) -> Result<Ended, Failure<B>> {
    let one = B::Scalar::one();
    let [r, v, shadow, p, z, t] = vectors else { return Ok(Ended::Breakdown) };
    shadow.axpby(one, r, B::Scalar::zero())?;
    p.axpby(one, r, B::Scalar::zero())?;
    let mut rho = shadow.dot(r)?;
    let start = run.iterations;
    while run.iterations < run.max_iterations {
        (run.m)(p, z)?;
        (run.a)(z, v)?;
        let alpha = rho / shadow.dot(v)?;
        if !alpha.is_finite() {
            return Ok(on_breakdown(run.iterations > start));
        }
        x.axpy(alpha, z)?;
        r.axpy(-alpha, v)?;
        run.iterations += 1;
        if r.norm()? <= run.target {
            return Ok(Ended::CheckResidual);
        }
        (run.m)(r, z)?;
        (run.a)(z, t)?;
        let omega = t.dot(r)? / t.dot(t)?;
        if !omega.is_finite() {
            return Ok(on_breakdown(run.iterations > start));
        }
        x.axpy(omega, z)?;
        r.axpy(-omega, t)?;
        if r.norm()? <= run.target {
            return Ok(Ended::CheckResidual);
        }
        let before = std::mem::replace(&mut rho, shadow.dot(r)?);
        let beta = (rho / before) * (alpha / omega);
        if !beta.is_finite() || rho.is_zero() {
            return Ok(on_breakdown(true));
        }
        // p = r + beta (p - omega v)
        p.axpy(-omega, v)?;
        p.axpby(one, r, beta)?;
    }
    Ok(Ended::CheckResidual)
}

/// A breakdown after at least one step allows a restart with a new shadow residual.
fn on_breakdown(moved: bool) -> Ended {
    if moved { Ended::CheckResidual } else { Ended::Breakdown }
}
