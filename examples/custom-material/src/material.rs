//! A compressible foam: one formula for energy, stress and tangent.

use biotissue::fem::material::{Material, MaterialError, Response};
use nalgebra::{Matrix3, SMatrix};

/// The material of Blatz and Ko for foamed rubber: `W = mu/2 (tr C^-1 + 2 J - 5)`, with Poisson ratio 1/4 at rest.
///
/// # Derivation
/// With `G = F^-1`, `H = F^-T` and `dG = -G dF G`, `dH = -H dF^T H`, `dJ = J H : dF`:
///
/// ```text
/// P  = mu (J H - H G H)
/// dP = mu (J (H : dF) H + J dH - dH G H - H dG H - H G dH)
/// ```
///
/// # References
/// P. J. Blatz and W. L. Ko, Trans. Soc. Rheology 6 (1962) 223-251.
#[derive(Clone, Copy, Debug)]
pub struct BlatzKo {
    /// Shear modulus at rest, Pa.
    pub mu: f64,
}

impl Material for BlatzKo {
    fn evaluate(&self, f: &Matrix3<f64>) -> Result<Response, MaterialError> {
        let jacobian = f.determinant();
        let inverse = f.try_inverse().filter(|_| jacobian > 0.0 && jacobian.is_finite());
        let g = inverse.ok_or(MaterialError::Inverted(jacobian))?;
        let h = g.transpose();
        let mut tangent = SMatrix::<f64, 9, 9>::zeros();
        for column in 0..9 {
            let mut df = Matrix3::zeros();
            df[(column / 3, column % 3)] = 1.0;
            let (dg, dh) = (-g * df * g, -h * df.transpose() * h);
            let dp = h * (jacobian * h.dot(&df)) + dh * jacobian - dh * g * h - h * dg * h - h * g * dh;
            for row in 0..9 {
                tangent[(row, column)] = self.mu * dp[(row / 3, row % 3)];
            }
        }
        Ok(Response {
            energy: 0.5 * self.mu * (g.norm_squared() + 2.0 * jacobian - 5.0),
            pk1: (h * jacobian - h * g * h) * self.mu,
            tangent,
        })
    }

    /// Returns the name for messages and checkpoints. This method and the next one are optional.
    fn name(&self) -> &str {
        "blatz-ko"
    }

    /// Returns what defines the material: a checkpoint then belongs to these numbers.
    fn parameters(&self) -> Vec<(&'static str, f64)> {
        vec![("shear_modulus", self.mu)]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const FOAM: BlatzKo = BlatzKo { mu: 3.0 };

    fn moved(f: &Matrix3<f64>, k: usize, by: f64) -> Matrix3<f64> {
        let mut f = *f;
        f[(k / 3, k % 3)] += by;
        f
    }

    /// The two tests that every formula needs: by central differences, the stress is the derivative of the energy and the
    /// tangent that of the stress.
    #[test]
    fn stress_and_tangent_are_derivatives() {
        let h = 1e-6;
        for f in [Matrix3::identity(), Matrix3::new(1.2, 0.3, -0.1, 0.05, 0.9, 0.2, -0.2, 0.1, 1.1)] {
            let Response { pk1, tangent, .. } = FOAM.evaluate(&f).unwrap();
            for k in 0..9 {
                let [up, down] = [h, -h].map(|by| FOAM.evaluate(&moved(&f, k, by)).unwrap());
                let slope = (up.energy - down.energy) / (2.0 * h);
                assert!((slope - pk1[(k / 3, k % 3)]).abs() < 1e-8, "{k}: {slope}");
                let slope = (up.pk1 - down.pk1) / (2.0 * h);
                for row in 0..9 {
                    assert!((slope[(row / 3, row % 3)] - tangent[(row, k)]).abs() < 1e-7, "({row}, {k})");
                }
            }
        }
    }

    #[test]
    fn the_body_at_rest_is_free_of_stress_and_has_the_moduli() {
        let rest = FOAM.evaluate(&Matrix3::identity()).unwrap();
        assert!(rest.energy.abs() < 1e-15 && rest.pk1.norm() < 1e-15);
        // Lame constants are equal at a Poisson ratio of 1/4.
        assert!((rest.tangent[(0, 0)] - 9.0).abs() < 1e-12 && (rest.tangent[(0, 4)] - 3.0).abs() < 1e-12);
        assert!((rest.tangent[(1, 1)] - 3.0).abs() < 1e-12);
        assert!(FOAM.evaluate(&Matrix3::from_diagonal(&[-1.0, 1.0, 1.0].into())).is_err());
    }
}
