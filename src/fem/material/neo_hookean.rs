//! Compressible neo-Hookean material.

use nalgebra::{Matrix3, SMatrix};

use super::small_strain::{Dilatation, green_lagrange};
use super::{Material, MaterialError, Response, checked_determinant};
use crate::tensor::row_major;

/// The energy is `W = mu/2 (I1 - 3) - mu ln J + lambda/2 (ln J)^2` with `I1 = F : F`.
///
/// # Derivation
/// With `dJ/dF = J F^-T` and `d(F^-1)_Ji / dF_kL = -F^-1_Jk F^-1_Li`, the first Piola-Kirchhoff stress `P = dW/dF` and
/// its tangent `A = dP/dF` are
///
/// ```text
/// P_iJ   = mu (F_iJ - F^-1_Ji) + lambda ln J F^-1_Ji
/// A_iJkL = mu d_ik d_JL + (mu - lambda ln J) F^-1_Jk F^-1_Li + lambda F^-1_Ji F^-1_Lk
/// ```
///
/// `A` is symmetric under the exchange of `iJ` and `kL`. At `F = I` it is Hooke's law with Lame's constants `mu` and
/// `lambda`. `mu - lambda ln J` is `J` times the effective shear modulus of the spatial elasticity tensor.
///
/// # Small strains
/// In the formulas above, terms of first order (in `W`) and of order zero (in `P`) cancel; at a strain of `1e-8` the
/// energy would have no correct digit. The code therefore evaluates energy and stress in an equivalent form with
/// `H = F - I`, `e = sym(H)`, the Green-Lagrange strain `E = e + H^T H / 2` and `J - 1 = tr H + II(H) + det H`:
///
/// ```text
/// W = mu (e : e - (tr H)^2 / 2 - det H + [(J - 1) - ln J]) + lambda/2 (ln J)^2
/// P = F^-T (2 mu E + lambda ln J I)        (2 mu E + lambda ln J I = F^T P is the Mandel stress)
/// ```
///
/// in which every term is of the order of the result.
///
/// # References
/// J. Bonet and R. D. Wood, *Nonlinear Continuum Mechanics for Finite Element Analysis*, 2nd ed., 2008,
/// section 6.4.3; W. R. Tobin, *The Adaptive Multiscale Simulation Infrastructure* (PhD thesis, Rensselaer Polytechnic
/// Institute, 2018), equations A.17 to A.19.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "app", derive(serde::Serialize, serde::Deserialize))]
pub struct NeoHookean {
    /// Shear modulus, Pa.
    pub mu: f64,
    /// Lame's first constant, Pa; `2 mu nu / (1 - 2 nu)` with Poisson's ratio `nu`.
    pub lambda: f64,
}

impl NeoHookean {
    /// Evaluates `W` at `H = F - I`.
    fn energy_at(&self, h: &Matrix3<f64>, dilatation: &Dilatation) -> f64 {
        self.mu * dilatation.trace_beyond_ln(h) + 0.5 * self.lambda * dilatation.ln * dilatation.ln
    }
}

impl Material for NeoHookean {
    fn evaluate(&self, f: &Matrix3<f64>) -> Result<Response, MaterialError> {
        let determinant = checked_determinant(f)?;
        let inverse = f.try_inverse().ok_or(MaterialError::Inverted(determinant))?;
        let displacement_gradient = f - Matrix3::identity();
        let dilatation = Dilatation::of(&displacement_gradient, determinant);
        let effective_mu = self.mu - self.lambda * dilatation.ln;
        let strain = green_lagrange(&displacement_gradient);
        let mandel = strain * (2.0 * self.mu) + Matrix3::from_diagonal_element(self.lambda * dilatation.ln);
        let pk1 = inverse.transpose() * mandel;
        // F^-T, row-major: F^-1_Ji is at 3 i + J.
        let f_inv_t = row_major(&inverse.transpose());
        let mut tangent = SMatrix::<f64, 9, 9>::zeros();
        for k in 0..3 {
            for l in 0..3 {
                let column = 3 * k + l;
                let lambda_term = self.lambda * f_inv_t[column];
                for i in 0..3 {
                    let mu_term = effective_mu * f_inv_t[3 * i + l];
                    for j in 0..3 {
                        tangent[(3 * i + j, column)] = lambda_term * f_inv_t[3 * i + j] + mu_term * f_inv_t[3 * k + j];
                    }
                }
                tangent[(column, column)] += self.mu;
            }
        }
        Ok(Response { energy: self.energy_at(&displacement_gradient, &dilatation), pk1, tangent })
    }
}
