//! Fields that follow from the Cauchy stress and the deformation gradient, on request.

use nalgebra::Matrix3;

use crate::tensor::row_major;

/// Returns the Green-Lagrange strain `(F^T F - I) / 2`; both tensors are row-major.
pub(super) fn green_lagrange_strain(f: &[f64; 9]) -> [f64; 9] {
    let f = Matrix3::from_row_slice(f);
    row_major(&((f.transpose() * f - Matrix3::identity()) * 0.5))
}

/// Returns the principal stretches, the square roots of the eigenvalues of `F^T F`, in descending order.
pub(super) fn principal_stretches(f: &[f64; 9]) -> [f64; 3] {
    let f = Matrix3::from_row_slice(f);
    descending(f.transpose() * f).map(|square| square.max(0.0).sqrt())
}

/// Returns the principal values of a symmetric tensor, row-major, in descending order.
pub(super) fn principal_stresses(stress: &[f64; 9]) -> [f64; 3] {
    descending(Matrix3::from_row_slice(stress))
}

fn descending(symmetric: Matrix3<f64>) -> [f64; 3] {
    let mut values: [f64; 3] = symmetric.symmetric_eigenvalues().into();
    values.sort_by(|a, b| b.total_cmp(a));
    values
}

#[cfg(test)]
mod tests {
    use nalgebra::Rotation3;

    use super::*;

    #[test]
    fn a_rotated_stretch_has_its_stretches_and_strain() {
        let rotation = Rotation3::from_euler_angles(0.3, -0.7, 1.1).into_inner();
        let axes = Rotation3::from_euler_angles(-0.2, 0.4, 0.9).into_inner();
        let stretch = axes * Matrix3::from_diagonal(&[0.5, 2.0, 1.25].into()) * axes.transpose();
        let f = row_major(&(rotation * stretch));
        let close = |a: &[f64], b: &[f64]| a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-14);
        assert!(close(&principal_stretches(&f), &[2.0, 1.25, 0.5]));
        let strain = green_lagrange_strain(&f);
        assert!(close(&principal_stresses(&strain), &[1.5, 0.28125, -0.375]), "(l^2 - 1) / 2");
        assert!(close(&green_lagrange_strain(&row_major(&rotation)), &[0.0; 9]));
    }
}
