//! Saint Venant-Kirchhoff material: stress linear in the Green-Lagrange strain.

use nalgebra::{Matrix3, SMatrix};

use super::lagrangian::Lagrangian;
use super::small_strain::green_lagrange;
use super::{Material, MaterialError, Response, checked_determinant};

/// The energy is `W = E : C : E / 2` with `E = (F^T F - I) / 2`. The law extends any linear elasticity `C` at rest to
/// finite rotations, which cause no strain.
///
/// # Derivation
/// With the second Piola-Kirchhoff stress `S = C : E` and the minor symmetries of `C`:
///
/// ```text
/// P_iJ   = F_iM S_MJ
/// A_iJkL = d_ik S_JL + F_iM C_MJLP F_kP
/// ```
///
/// At `F = I`, `A = C`. The law softens in strong compression without limit; use it only for small strains.
///
/// # References
/// J. Bonet and R. D. Wood, *Nonlinear Continuum Mechanics for Finite Element Analysis*, 2nd ed., 2008,
/// chapter 6.
#[derive(Clone, Debug, PartialEq)]
pub struct SaintVenantKirchhoff {
    /// `C_IJKL`, Pa: row `3 * I + J`, column `3 * K + L`; with both minor symmetries and the major one.
    stiffness: SMatrix<f64, 9, 9>,
}

impl SaintVenantKirchhoff {
    /// Creates the law from the tangent `A = dP/dF` of a body at rest; enforces the symmetries of `C` exactly.
    pub fn at_rest(tangent: &SMatrix<f64, 9, 9>) -> Self {
        let transposed = |k: usize| 3 * (k % 3) + k / 3;
        let mut stiffness = SMatrix::zeros();
        for row in 0..9 {
            for column in 0..9 {
                let minor = |a: usize, b: usize| {
                    tangent[(a, b)]
                        + tangent[(transposed(a), b)]
                        + tangent[(a, transposed(b))]
                        + tangent[(transposed(a), transposed(b))]
                };
                stiffness[(row, column)] = (minor(row, column) + minor(column, row)) / 8.0;
            }
        }
        Self { stiffness }
    }
}

impl Material for SaintVenantKirchhoff {
    fn evaluate(&self, f: &Matrix3<f64>) -> Result<Response, MaterialError> {
        checked_determinant(f)?;
        let strain = green_lagrange(&(f - Matrix3::identity()));
        // The second Piola-Kirchhoff stress.
        let pk2: Matrix3<f64> = Matrix3::from_fn(|i, j| {
            (0..9).map(|column| self.stiffness[(3 * i + j, column)] * strain[(column / 3, column % 3)]).sum()
        });
        Ok(Lagrangian { energy: 0.5 * strain.dot(&pk2), pk2, moduli: self.stiffness }.response(f))
    }
}
