//! The exponential material of Holmes and Mow for cartilage and other soft tissue.

use nalgebra::Matrix3;

use super::lagrangian::{Lagrangian, Strain, outer, symmetric_square};
use super::{Material, MaterialError, Response};

/// The energy is `W = c/2 (exp Q - 1)` with `c = (lambda + 2 mu) / (2 beta)` and
/// `Q = beta / (lambda + 2 mu) [(2 mu - lambda) (I1 - 3) + lambda (I2 - 3) - (lambda + 2 mu) ln J^2]`.
///
/// # Derivation
/// In the Green-Lagrange strain `E`, with `I1 - 3 = 2 tr E`, `I2 - 3 = 4 tr E + 2 (tr E)^2 - 2 E : E` and
/// `d ln J / dE = C^-1`:
///
/// ```text
/// Q     = 2 beta / (lambda + 2 mu) [(lambda + 2 mu) (tr E - ln J) + lambda ((tr E)^2 - E : E)]
/// S     = exp(Q) G,    G = (lambda + 2 mu) C^-1 E + lambda (tr(E) I - E)        (I - C^-1 = 2 C^-1 E)
/// dS/dE = exp(Q) [4 beta / (lambda + 2 mu) G (x) G + lambda (I (x) I - 1) + (lambda + 2 mu) C^-1 (.) C^-1]
/// ```
///
/// with `(b (.) b)_IJKL = (b_IK b_JL + b_IL b_JK) / 2` and `1 = I (.) I`. All terms are of the order of the result at
/// small strains, where the law is Hooke's with `mu` and `lambda`.
///
/// # References
/// M. H. Holmes and V. C. Mow, J. Biomech. 23 (1990) 1145-1156.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "app", derive(serde::Serialize, serde::Deserialize))]
pub struct HolmesMow {
    /// Shear modulus at rest, Pa.
    pub mu: f64,
    /// Lame's first constant at rest, Pa.
    pub lambda: f64,
    /// Stiffening exponent, above 0.
    pub beta: f64,
}

impl Material for HolmesMow {
    fn evaluate(&self, f: &Matrix3<f64>) -> Result<Response, MaterialError> {
        let strain = Strain::of(f)?;
        let Self { mu, lambda, beta } = *self;
        let aggregate = lambda + 2.0 * mu;
        let (e, identity) = (&strain.e, Matrix3::identity());
        let trace = e.trace();
        let bracket = aggregate * strain.trace_beyond_ln + lambda * (trace * trace - e.norm_squared());
        let exponent = 2.0 * beta / aggregate * bracket;
        let exp = exponent.exp();
        // `C^-1` and `E` commute, so the product is symmetric but for rounding.
        let product = strain.c_inverse * e;
        let g = (product + product.transpose()) * (0.5 * aggregate) + (identity * trace - e) * lambda;
        let moduli = outer(&g, &g) * (4.0 * beta / aggregate)
            + (outer(&identity, &identity) - symmetric_square(&identity)) * lambda
            + symmetric_square(&strain.c_inverse) * aggregate;
        let energy = 0.25 * aggregate / beta * exponent.exp_m1();
        Ok(Lagrangian { energy, pk2: g * exp, moduli: moduli * exp }.response(f))
    }
}
