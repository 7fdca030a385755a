//! Interpolation between two deformation gradients.
//!
//! ```
//! use biotissue::fiber::deformation_path::between;
//! use nalgebra::Matrix3;
//!
//! let stretched = Matrix3::from_diagonal(&[1.2, 1.0, 1.0].into());
//! let half = between(&Matrix3::identity(), &stretched, 0.5);
//! assert!((half[(0, 0)] - 1.1).abs() < 1e-14);
//! ```

use nalgebra::{Matrix3, Rotation3, UnitQuaternion};

/// A path between two deformation gradients of positive determinant.
///
/// The increment `target start^-1` is split into a stretch, which is interpolated linearly, and a rotation, which is
/// interpolated in its angle. The determinant therefore stays positive along the path, even for a rotation by 180
/// degrees, where linear interpolation of the matrices would become singular.
#[derive(Clone, Debug)]
pub struct DeformationPath {
    start: Matrix3<f64>,
    target: Matrix3<f64>,
    /// Stretch and rotation of the increment; `None` if it cannot be split.
    increment: Option<(Matrix3<f64>, UnitQuaternion<f64>)>,
}

impl DeformationPath {
    /// Makes the path from `start` to `target`.
    pub fn new(start: &Matrix3<f64>, target: &Matrix3<f64>) -> Self {
        Self {
            start: *start,
            target: *target,
            increment: start.try_inverse().and_then(|inverse| polar_decomposition(target * inverse)),
        }
    }

    /// Returns the deformation gradient at the fraction `part` (0 to 1) of the path.
    pub fn at(&self, part: f64) -> Matrix3<f64> {
        let Some((stretch, rotation)) = &self.increment else {
            return self.start + (self.target - self.start) * part;
        };
        let identity = Matrix3::identity();
        rotation.powf(part).to_rotation_matrix().matrix() * (identity + (stretch - identity) * part) * self.start
    }
}

/// Returns the symmetric stretch `U` and the rotation `R` of `F = R U`.
pub(super) fn polar_decomposition(f: Matrix3<f64>) -> Option<(Matrix3<f64>, UnitQuaternion<f64>)> {
    let svd = f.svd(true, true);
    let (u, v_t) = (svd.u?, svd.v_t?);
    let stretch = v_t.transpose() * Matrix3::from_diagonal(&svd.singular_values) * v_t;
    // The quaternion has a well-defined axis even for a rotation by 180 degrees.
    Some((stretch, UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(u * v_t))))
}

/// Returns the deformation gradient at the fraction `part` (0 to 1) of the path from `start` to `target`; see
/// [`DeformationPath`].
pub fn between(start: &Matrix3<f64>, target: &Matrix3<f64>, part: f64) -> Matrix3<f64> {
    DeformationPath::new(start, target).at(part)
}

#[cfg(test)]
mod tests {
    use nalgebra::Vector3;

    use super::*;

    #[test]
    fn a_path_starts_and_ends_at_the_given_gradients() {
        let start = Matrix3::new(1.1, 0.2, 0.0, 0.0, 0.9, 0.1, 0.0, 0.0, 1.0);
        let target =
            Rotation3::from_euler_angles(0.3, 1.0, -0.5) * Matrix3::new(1.5, 0.0, 0.0, 0.3, 0.8, 0.0, 0.0, 0.1, 0.9);
        assert!((between(&start, &target, 0.0) - start).amax() < 1e-14);
        assert!((between(&start, &target, 1.0) - target).amax() < 1e-14);
    }

    #[test]
    fn half_a_turn_keeps_the_volume() {
        let nearly = Rotation3::from_axis_angle(&Vector3::z_axis(), std::f64::consts::PI * (1.0 - 1e-9));
        for target in [nearly.into_inner(), Matrix3::from_diagonal(&[-1.0, -1.0, 1.0].into())] {
            for part in [0.25, 0.5, 0.75] {
                let f = between(&Matrix3::identity(), &target, part);
                assert!((f.determinant() - 1.0).abs() < 1e-12, "{part}: {f}");
                assert!(f[(2, 2)] > 0.999 && f[(0, 0)].abs() < 0.99, "{part}: {f}");
            }
        }
    }
}
