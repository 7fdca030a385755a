//! The way from one deformation gradient to another.

use nalgebra::{Matrix3, Rotation3, UnitQuaternion};

/// The deformation gradient at `part` (0 to 1) of the way from `start` to `target`, both of positive determinant.
///
/// The increment `target start^-1` is split into a stretch, which grows linearly, and a rotation, which grows in angle:
/// the determinant stays positive all the way, also through half a turn, where the straight line between the two
/// matrices would pass through zero.
#[must_use]
pub fn between(start: &Matrix3<f64>, target: &Matrix3<f64>, part: f64) -> Matrix3<f64> {
    let straight = start + (target - start) * part;
    let Some(inverse) = start.try_inverse() else { return straight };
    let svd = (target * inverse).svd(true, true);
    let (Some(u), Some(v_t)) = (svd.u, svd.v_t) else { return straight };
    let identity = Matrix3::identity();
    let stretch = v_t.transpose() * Matrix3::from_diagonal(&svd.singular_values) * v_t;
    // A quaternion has an axis for half a turn too.
    let rotation = UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(u * v_t));
    rotation.powf(part).to_rotation_matrix().matrix() * (identity + (stretch - identity) * part) * start
}

#[cfg(test)]
mod tests {
    use nalgebra::Vector3;

    use super::*;

    #[test]
    fn the_ends_are_the_ends() {
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
