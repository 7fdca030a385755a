//! Neo-Hookean material with one stiff direction.

use nalgebra::{Matrix3, Vector3};

use super::lagrangian::{Axial, Lagrangian, Strain, outer, symmetric_outer, symmetric_square};
use super::{Material, MaterialError, NeoHookean, Response};

/// The energy is that of [`NeoHookean`] plus `(alpha + beta ln J + gamma (I4 - 1)) (I4 - 1) - alpha/2 (I5 - 1)` with
/// `I4 = a . C a` and `I5 = a . C^2 a` for the unit vector `a`.
///
/// # Derivation
/// In the Green-Lagrange strain `E`, with `e = a . E a`, `I4 - 1 = 2 e` and `I5 - 1 = 4 e + 4 |E a|^2`, the part of the
/// stiff direction is
///
/// ```text
/// W     = 2 beta e ln J + 4 gamma e^2 - 2 alpha |E a|^2
/// S     = (2 beta ln J + 8 gamma e) a (x) a + 2 beta e C^-1 - 2 alpha (a (x) E a + E a (x) a)
/// dS/dE = 2 beta (a (x) a (x) C^-1 + C^-1 (x) a (x) a) - 4 beta e C^-1 (.) C^-1 + 8 gamma a (x) a (x) a (x) a
///         - 2 alpha d^2|E a|^2/dE^2
/// ```
///
/// At rest, with the axis along 1, `A_1122 = lambda + 2 beta`, `A_1212 = mu - alpha` and
/// `A_1111 = lambda + 2 mu + 4 beta + 8 gamma - 4 alpha`. The coefficients follow from these entries, which are the
/// inverse of the compliance in [`TransverseModuli`].
///
/// # References
/// J. Bonet and A. J. Burton, Comput. Methods Appl. Mech. Eng. 162 (1998) 151-164.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "app", derive(serde::Serialize, serde::Deserialize))]
pub struct TransverselyIsotropic {
    isotropic: NeoHookean,
    alpha: f64,
    beta: f64,
    gamma: f64,
    axis: Vector3<f64>,
}

/// The elastic constants of a [`TransverselyIsotropic`] material at small strain.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "app", derive(serde::Serialize, serde::Deserialize))]
pub struct TransverseModuli {
    /// Young's modulus in the plane normal to the axis, Pa.
    pub youngs_modulus: f64,
    /// Poisson's ratio in that plane, which is also the contraction along the axis under a stress in the plane.
    pub poisson_ratio: f64,
    /// Young's modulus along the axis, Pa.
    pub axial_youngs_modulus: f64,
    /// Shear modulus in planes that contain the axis, Pa.
    pub axial_shear_modulus: f64,
}

impl TransverseModuli {
    /// Returns `m = 1 - nu - 2 n nu^2` with `n = E_A / E`; the material is stable only if it is positive.
    pub fn stability(&self) -> f64 {
        let nu = self.poisson_ratio;
        1.0 - nu - 2.0 * self.axial_youngs_modulus / self.youngs_modulus * nu * nu
    }
}

impl TransverselyIsotropic {
    /// Creates the material from its elastic constants and its axis, of any length but zero; `None` if the axis is
    /// zero or not finite, or if [`TransverseModuli::stability`] is not positive.
    pub fn new(moduli: &TransverseModuli, axis: [f64; 3]) -> Option<Self> {
        let TransverseModuli { youngs_modulus: e, poisson_ratio: nu, axial_youngs_modulus: axial, axial_shear_modulus } =
            *moduli;
        let axis = Vector3::from(axis).try_normalize(0.0).filter(|axis| axis.iter().all(|x| x.is_finite()))?;
        let (n, m) = (axial / e, moduli.stability());
        if m.is_nan() || m <= 0.0 {
            return None;
        }
        let mu = 0.5 * e / (1.0 + nu);
        let lambda = e * (nu + n * nu * nu) / (m * (1.0 + nu));
        let alpha = mu - axial_shear_modulus;
        let beta = 0.5 * e * nu * (n - 1.0) / (m * (1.0 + nu));
        let gamma = axial * (1.0 - nu) / (8.0 * m) - (lambda + 2.0 * mu) / 8.0 + 0.5 * (alpha - beta);
        Some(Self { isotropic: NeoHookean { mu, lambda }, alpha, beta, gamma, axis })
    }

    /// Returns the axis, a unit vector.
    pub fn axis(&self) -> Vector3<f64> {
        self.axis
    }
}

impl Material for TransverselyIsotropic {
    fn evaluate(&self, f: &Matrix3<f64>) -> Result<Response, MaterialError> {
        let isotropic = self.isotropic.evaluate(f)?;
        let strain = Strain::of(f)?;
        let Self { alpha, beta, gamma, axis, .. } = self;
        let axial = Axial::of(axis, &strain.e);
        let (e, ln, inverse) = (axial.strain, strain.dilatation.ln, &strain.c_inverse);
        let stiff = Lagrangian {
            energy: 2.0 * beta * e * ln + 4.0 * gamma * e * e - 2.0 * alpha * axial.square,
            pk2: axial.structure * (2.0 * beta * ln + 8.0 * gamma * e) + inverse * (2.0 * beta * e)
                - axial.square_slope * (2.0 * alpha),
            moduli: symmetric_outer(&axial.structure, inverse) * (2.0 * beta)
                - symmetric_square(inverse) * (4.0 * beta * e)
                + outer(&axial.structure, &axial.structure) * (8.0 * gamma)
                - axial.square_moduli() * (2.0 * alpha),
        };
        let stiff = stiff.response(f);
        Ok(Response {
            energy: isotropic.energy + stiff.energy,
            pk1: isotropic.pk1 + stiff.pk1,
            tangent: isotropic.tangent + stiff.tangent,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The compliance at rest has the four constants: `1/E_A` along the axis, `1/E` and `-nu/E` across, `1/G_A` in shear.
    #[test]
    fn the_elastic_constants_are_those_given() {
        let moduli = TransverseModuli {
            youngs_modulus: 3.0e3,
            poisson_ratio: 0.3,
            axial_youngs_modulus: 5.0e3,
            axial_shear_modulus: 2.0e3,
        };
        let material = TransverselyIsotropic::new(&moduli, [2.0, 0.0, 0.0]).unwrap();
        let a = material.evaluate(&Matrix3::identity()).unwrap().tangent;
        let normal = Matrix3::from_fn(|i, k| a[(4 * i, 4 * k)]).try_inverse().unwrap();
        let nu = 0.3;
        let expected = Matrix3::new(
            1.0 / 5.0e3,
            -nu / 3.0e3,
            -nu / 3.0e3,
            -nu / 3.0e3,
            1.0 / 3.0e3,
            -nu / 3.0e3,
            -nu / 3.0e3,
            -nu / 3.0e3,
            1.0 / 3.0e3,
        );
        assert!((normal - expected).norm() < 1e-13 * expected.norm(), "{normal}{expected}");
        assert!((a[(1, 1)] - 2.0e3).abs() < 1e-9 && (a[(5, 5)] - 0.5 * 3.0e3 / 1.3).abs() < 1e-9);
    }

    #[test]
    fn an_isotropic_choice_is_neo_hookean() {
        let mu = 0.5 * 3.0e3 / 1.3;
        let moduli = TransverseModuli {
            youngs_modulus: 3.0e3,
            poisson_ratio: 0.3,
            axial_youngs_modulus: 3.0e3,
            axial_shear_modulus: mu,
        };
        let material = TransverselyIsotropic::new(&moduli, [1.0, 2.0, -0.5]).unwrap();
        let f = Matrix3::new(1.2, 0.3, -0.1, 0.05, 0.9, 0.2, -0.2, 0.1, 1.1);
        let isotropic = NeoHookean { mu, lambda: 2.0 * mu * 0.3 / 0.4 }.evaluate(&f).unwrap();
        let found = material.evaluate(&f).unwrap();
        assert!((found.pk1 - isotropic.pk1).norm() < 1e-12 * isotropic.pk1.norm());
    }

    #[test]
    fn unstable_constants_and_axes_without_direction_are_refused() {
        let stable = TransverseModuli {
            youngs_modulus: 1.0,
            poisson_ratio: 0.3,
            axial_youngs_modulus: 2.0,
            axial_shear_modulus: 1.0,
        };
        assert!(TransverselyIsotropic::new(&stable, [0.0; 3]).is_none());
        assert!(TransverselyIsotropic::new(&stable, [f64::NAN, 0.0, 1.0]).is_none());
        let unstable = TransverseModuli { axial_youngs_modulus: 10.0, ..stable };
        assert!(TransverselyIsotropic::new(&unstable, [1.0, 0.0, 0.0]).is_none());
    }
}
