//! Preconditioned conjugate gradients.

use num_traits::{Float, Zero};

use super::{Ended, Run, axpy, combine, dot, norm};
use crate::las::{Backend, Scalar, SolveError};

/// Residual, product, direction, preconditioned residual.
pub(super) const VECTORS: usize = 4;

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
    let [r, q, p, z] = vectors else { return Ok(Ended::Breakdown) };
    (run.m)(r, z)?;
    combine::<B>(p, B::Scalar::zero(), num_traits::One::one(), z)?;
    let mut rz = dot::<B>(r, z)?;
    while run.iterations < run.max_iterations {
        (run.a)(p, q)?;
        let curvature = dot::<B>(p, q)?;
        // The matrix is not positive definite along this direction, so that conjugate gradients do not apply.
        if !(curvature > B::Scalar::zero() && rz.is_finite()) {
            return Ok(Ended::Breakdown);
        }
        let step = rz / curvature;
        axpy::<B>(x, step, p)?;
        axpy::<B>(r, -step, q)?;
        run.iterations += 1;
        if norm::<B>(r)? <= run.target {
            return Ok(Ended::CheckResidual);
        }
        (run.m)(r, z)?;
        let before = std::mem::replace(&mut rz, dot::<B>(r, z)?);
        combine::<B>(p, rz / before, num_traits::One::one(), z)?;
    }
    Ok(Ended::CheckResidual)
}
