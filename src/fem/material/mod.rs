//! Constitutive formulas: energy, stress and tangent as functions of the deformation gradient.
//!
//! ```
//! use biotissue::fem::material::{Material, NeoHookean};
//! use nalgebra::Matrix3;
//!
//! let material = NeoHookean { mu: 1.0e3, lambda: 2.0e3 }; // Pa
//! let response = material.evaluate(&Matrix3::from_diagonal(&[1.1, 0.96, 0.96].into())).unwrap();
//! assert!(response.energy > 0.0 && response.pk1[(0, 0)] > 0.0);
//! assert!(material.evaluate(&Matrix3::from_diagonal(&[-1.0, 1.0, 1.0].into())).is_err(), "inverted");
//! ```

mod guccione;
mod holmes_mow;
mod holzapfel_gasser_ogden;
mod lagrangian;
mod linear_elastic;
mod neo_hookean;
mod saint_venant;
mod small_strain;
mod transversely_isotropic;

use nalgebra::{Matrix3, SMatrix};
use thiserror::Error;

pub use guccione::Guccione;
pub use holmes_mow::HolmesMow;
pub use holzapfel_gasser_ogden::HolzapfelGasserOgden;
pub use linear_elastic::LinearElastic;
pub use neo_hookean::NeoHookean;
pub use saint_venant::SaintVenantKirchhoff;
pub use transversely_isotropic::{TransverseModuli, TransverselyIsotropic};

/// The response of a material at one point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Response {
    /// Energy `W` per reference volume, J/m^3.
    pub energy: f64,
    /// First Piola-Kirchhoff stress `P = dW/dF`, Pa.
    pub pk1: Matrix3<f64>,
    /// `A = dP/dF`, Pa: row `3 * i + J`, column `3 * k + L` holds `dP_iJ / dF_kL`; symmetric.
    pub tangent: SMatrix<f64, 9, 9>,
}

impl Response {
    /// Returns the response of this material in another amount: all values times a factor.
    #[must_use]
    pub fn scaled(self, factor: f64) -> Self {
        Self { energy: self.energy * factor, pk1: self.pk1 * factor, tangent: self.tangent * factor }
    }
}

/// The reason why a material cannot be evaluated.
#[derive(Clone, Copy, Debug, Error, PartialEq)]
pub enum MaterialError {
    /// The deformation inverts or flattens the point, or `det F` is not finite. Holds `J = det F`.
    #[error("the deformation is inverted: det F = {0:.6e}, and a body needs det F > 0")]
    Inverted(f64),
}

/// A hyperelastic material without memory.
pub trait Material: Send + Sync {
    /// Evaluates energy, stress and tangent at the deformation gradient `f`.
    ///
    /// # Errors
    /// Returns [`MaterialError::Inverted`] if the material is undefined at `f`.
    fn evaluate(&self, f: &Matrix3<f64>) -> Result<Response, MaterialError>;

    /// Returns the name for messages and checkpoints.
    fn name(&self) -> &str {
        "custom"
    }

    /// Returns the numbers that define the material, in SI units. Checkpoints detect a change of them; without them,
    /// the default, a change of the material remains unnoticed.
    fn parameters(&self) -> Vec<(&'static str, f64)> {
        Vec::new()
    }
}

/// Returns `J = det F` if it is positive and finite.
fn checked_determinant(f: &Matrix3<f64>) -> Result<f64, MaterialError> {
    let determinant = f.determinant();
    if determinant > 0.0 && determinant.is_finite() {
        Ok(determinant)
    } else {
        Err(MaterialError::Inverted(determinant))
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::Rotation3;

    use super::*;

    const MU: f64 = 3.0e3;
    const LAMBDA: f64 = 5.0e3;

    /// Stretch, shear and rotation mixed; `det F` between 0.5 and 2.
    fn states() -> [Matrix3<f64>; 4] {
        let turned =
            Rotation3::from_euler_angles(0.7, -0.4, 1.9) * Matrix3::new(1.3, 0.2, 0.0, 0.2, 0.8, 0.1, 0.0, 0.1, 1.1);
        [
            Matrix3::identity(),
            Matrix3::new(1.2, 0.3, -0.1, 0.05, 0.9, 0.2, -0.2, 0.1, 1.1),
            Matrix3::new(0.7, 0.1, 0.0, -0.2, 0.8, 0.15, 0.1, 0.0, 0.95),
            turned,
        ]
    }

    fn moved(f: &Matrix3<f64>, k: usize, by: f64) -> Matrix3<f64> {
        let mut f = *f;
        f[(k / 3, k % 3)] += by;
        f
    }

    fn energy(material: &dyn Material, f: &Matrix3<f64>) -> f64 {
        material.evaluate(f).unwrap().energy
    }

    fn stress_is_the_slope_of_the_energy(material: &dyn Material) {
        stress_is_the_slope_at(material, &states());
    }

    /// At rest, the curvature of the energy of fibers that carry no compression jumps.
    fn stress_is_the_slope_when_deformed(material: &dyn Material) {
        stress_is_the_slope_at(material, &states()[1..]);
    }

    fn stress_is_the_slope_at(material: &dyn Material, states: &[Matrix3<f64>]) {
        let h = 1e-5;
        for &f in states {
            let pk1 = material.evaluate(&f).unwrap().pk1;
            for k in 0..9 {
                let slope = (energy(material, &moved(&f, k, h)) - energy(material, &moved(&f, k, -h))) / (2.0 * h);
                let error = (slope - pk1[(k / 3, k % 3)]).abs();
                assert!(error < 1e-8 * (MU + LAMBDA), "component {k}: {error:e}");
            }
        }
    }

    fn tangent_is_the_slope_of_the_stress(material: &dyn Material) {
        tangent_is_the_slope_at(material, &states());
    }

    /// At rest, the tangent of fibers that carry no compression jumps.
    fn tangent_is_the_slope_when_deformed(material: &dyn Material) {
        tangent_is_the_slope_at(material, &states()[1..]);
    }

    fn tangent_is_the_slope_at(material: &dyn Material, states: &[Matrix3<f64>]) {
        let h = 1e-5;
        for &f in states {
            let tangent = material.evaluate(&f).unwrap().tangent;
            for c in 0..9 {
                let up = material.evaluate(&moved(&f, c, h)).unwrap().pk1;
                let down = material.evaluate(&moved(&f, c, -h)).unwrap().pk1;
                let slope = (up - down) / (2.0 * h);
                for r in 0..9 {
                    let error = (slope[(r / 3, r % 3)] - tangent[(r, c)]).abs();
                    assert!(error < 1e-7 * tangent.norm(), "({r}, {c}): {error:e} of {:e}", tangent.norm());
                }
            }
        }
    }

    fn tangent_is_symmetric(material: &dyn Material) {
        for f in states() {
            let tangent = material.evaluate(&f).unwrap().tangent;
            let skew = (tangent - tangent.transpose()).norm();
            assert!(skew <= 1e-14 * tangent.norm(), "{skew:e}");
        }
    }

    /// At `F = I`: no stress, and `A : H = lambda tr(H) I + mu (H + H^T)`.
    fn small_strain_moduli_are_lames(material: &dyn Material) {
        let at_rest = material.evaluate(&Matrix3::identity()).unwrap();
        assert_eq!(at_rest.pk1, Matrix3::zeros(), "not rounded: exactly zero");
        assert_eq!(at_rest.energy, 0.0);
        for k in 0..9 {
            let h = moved(&Matrix3::zeros(), k, 1.0);
            let expected = LAMBDA * h.trace() * Matrix3::identity() + MU * (h + h.transpose());
            for r in 0..9 {
                assert!((at_rest.tangent[(r, k)] - expected[(r / 3, r % 3)]).abs() < 1e-12 * MU);
            }
        }
    }

    fn energy_is_objective(material: &dyn Material) {
        let q = Rotation3::from_euler_angles(-0.3, 1.1, 0.6);
        for f in states() {
            let (here, there) = (energy(material, &f), energy(material, &(q * f)));
            assert!((here - there).abs() <= 1e-13 * (MU + here.abs()), "{here} {there}");
        }
    }

    fn oblique() -> nalgebra::Vector3<f64> {
        nalgebra::Vector3::new(0.6, 0.0, 0.8)
    }

    /// Two families of fibers; some states stretch both, some one of them.
    fn fibers(dispersion: f64) -> HolzapfelGasserOgden {
        let axes = [Some(oblique()), Some(nalgebra::Vector3::new(0.0, -0.8, 0.6))];
        HolzapfelGasserOgden { mu: 1.0e3, k1: 5.0e2, k2: 0.5, dispersion, bulk_modulus: 4.0e3, axes }
    }

    macro_rules! checks_of {
        ($($name:ident: $material:expr, [$($check:ident),* $(,)?];)*) => {$(
            mod $name {
                use super::*;
                $(#[test] fn $check() { super::$check(&$material); })*
            }
        )*};
    }

    checks_of! {
        neo_hookean: NeoHookean { mu: MU, lambda: LAMBDA }, [
            stress_is_the_slope_of_the_energy,
            tangent_is_the_slope_of_the_stress,
            tangent_is_symmetric,
            small_strain_moduli_are_lames,
            energy_is_objective,
        ];
        linear_elastic: LinearElastic { mu: MU, lambda: LAMBDA }, [
            stress_is_the_slope_of_the_energy,
            tangent_is_the_slope_of_the_stress,
            tangent_is_symmetric,
            small_strain_moduli_are_lames,
        ];
        holmes_mow: HolmesMow { mu: MU, lambda: LAMBDA, beta: 0.5 }, [
            stress_is_the_slope_of_the_energy,
            tangent_is_the_slope_of_the_stress,
            tangent_is_symmetric,
            small_strain_moduli_are_lames,
            energy_is_objective,
        ];
        transversely_isotropic: TransverselyIsotropic::new(
            &TransverseModuli {
                youngs_modulus: 3.0e3,
                poisson_ratio: 0.3,
                axial_youngs_modulus: 5.0e3,
                axial_shear_modulus: 2.0e3,
            },
            [0.3, -0.5, 0.8],
        ).unwrap(), [
            stress_is_the_slope_of_the_energy,
            tangent_is_the_slope_of_the_stress,
            tangent_is_symmetric,
            energy_is_objective,
        ];
        guccione: Guccione { c: 2.0e2, bf: 2.0, bt: 0.5, bfs: 1.0, bulk_modulus: 3.0e3, axis: oblique() }, [
            stress_is_the_slope_of_the_energy,
            tangent_is_the_slope_of_the_stress,
            tangent_is_symmetric,
            energy_is_objective,
        ];
        holzapfel_gasser_ogden: fibers(0.0), [
            stress_is_the_slope_when_deformed,
            tangent_is_the_slope_when_deformed,
            tangent_is_symmetric,
            energy_is_objective,
        ];
        holzapfel_gasser_ogden_with_dispersion: fibers(0.2), [
            stress_is_the_slope_when_deformed,
            tangent_is_the_slope_when_deformed,
            tangent_is_symmetric,
            energy_is_objective,
        ];
        saint_venant: SaintVenantKirchhoff::at_rest(
            &NeoHookean { mu: MU, lambda: LAMBDA }.evaluate(&Matrix3::identity()).unwrap().tangent
        ), [
            stress_is_the_slope_of_the_energy,
            tangent_is_the_slope_of_the_stress,
            tangent_is_symmetric,
            small_strain_moduli_are_lames,
            energy_is_objective,
        ];
    }

    #[test]
    fn inverted_and_nonfinite_states_are_errors() {
        let material = NeoHookean { mu: MU, lambda: LAMBDA };
        let mirrored = Matrix3::from_diagonal(&[1.0, -0.5, 1.0].into());
        assert_eq!(material.evaluate(&mirrored).unwrap_err(), MaterialError::Inverted(-0.5));
        assert!(material.evaluate(&Matrix3::zeros()).is_err());
        assert!(material.evaluate(&Matrix3::from_element(f64::NAN)).is_err());
    }
}
