//! Linear elasticity at small strains (Hooke's law).

use nalgebra::{Matrix3, SMatrix};

use super::{Material, MaterialError, Response};

/// The energy is `W = mu e : e + lambda/2 (tr e)^2` with the small strain `e = sym(F) - I`.
///
/// # Derivation
/// `P = 2 mu e + lambda tr(e) I` and `A_iJkL = mu (d_ik d_JL + d_iL d_Jk) + lambda d_iJ d_kL`, independent of `F`. `P`
/// is the stress of the small-strain theory, in which all stress measures coincide.
///
/// # Limits
/// The law is not objective: a rotation causes strain. It is defined for every `F`, also for `det F <= 0`, as the
/// linear theory is.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "app", derive(serde::Serialize, serde::Deserialize))]
pub struct LinearElastic {
    /// Shear modulus, Pa.
    pub mu: f64,
    /// Lame's first constant, Pa.
    pub lambda: f64,
}

impl Material for LinearElastic {
    fn evaluate(&self, f: &Matrix3<f64>) -> Result<Response, MaterialError> {
        let strain = (f + f.transpose()) * 0.5 - Matrix3::identity();
        let energy = self.mu * strain.norm_squared() + 0.5 * self.lambda * strain.trace().powi(2);
        let pk1 = strain * (2.0 * self.mu) + Matrix3::from_diagonal_element(self.lambda * strain.trace());
        let mut tangent = SMatrix::<f64, 9, 9>::zeros();
        for a in 0..3 {
            for b in 0..3 {
                tangent[(3 * a + b, 3 * a + b)] += self.mu;
                tangent[(3 * a + b, 3 * b + a)] += self.mu;
                tangent[(4 * a, 4 * b)] += self.lambda;
            }
        }
        Ok(Response { energy, pk1, tangent })
    }
}
