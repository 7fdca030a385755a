//! Preconditioned conjugate gradients.

use num_traits::{Float, Zero};

use super::{Ended, Run};
use crate::las::{Failure, SingleLane, VectorOps};

/// Number of vectors: residual, product, direction, preconditioned residual.
pub(super) const VECTORS: usize = 4;

/// Iterates from the residual in `vectors[0]`.
pub(super) fn run<B: SingleLane>(
    run: &mut Run<'_, B>,
    x: &mut B::Vector,
    vectors: &mut [B::Vector],
) -> Result<Ended, Failure<B>> {
    let [r, q, p, z] = vectors else { return Ok(Ended::Breakdown) };
    (run.m)(r, z)?;
    p.axpby(num_traits::One::one(), z, B::Scalar::zero())?;
    let mut rz = r.dot(z)?;
    while run.iterations < run.max_iterations {
        (run.a)(p, q)?;
        let curvature = p.dot(q)?;
        // The matrix is not positive definite along this direction, so that conjugate gradients do not apply.
        if !(curvature > B::Scalar::zero() && rz.is_finite()) {
            return Ok(Ended::Breakdown);
        }
        let step = rz / curvature;
        x.axpy(step, p)?;
        r.axpy(-step, q)?;
        run.iterations += 1;
        if r.norm()? <= run.target {
            return Ok(Ended::CheckResidual);
        }
        (run.m)(r, z)?;
        let before = std::mem::replace(&mut rz, r.dot(z)?);
        p.axpby(num_traits::One::one(), z, rz / before)?;
    }
    Ok(Ended::CheckResidual)
}
