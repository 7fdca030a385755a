//! Tensors of continuum mechanics as matrices: row-major components, stress measures, and fourth-order tangents.

use nalgebra::{Matrix3, SMatrix, SVector};

/// Returns the components row by row: `T_ij` at `3 * i + j`.
///
/// ```
/// use biotissue::tensor::{from_row_major, row_major};
///
/// let t = nalgebra::Matrix3::new(1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0, 9.0);
/// assert_eq!(row_major(&t), [1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0, 9.0]);
/// assert_eq!(from_row_major(&row_major(&t)), t);
/// ```
#[inline(always)]
pub fn row_major(tensor: &Matrix3<f64>) -> [f64; 9] {
    std::array::from_fn(|k| tensor[(k / 3, k % 3)])
}

/// Returns the rows of the tensor.
pub fn rows(tensor: &Matrix3<f64>) -> [[f64; 3]; 3] {
    std::array::from_fn(|i| std::array::from_fn(|j| tensor[(i, j)]))
}

/// Returns the tensor with these components, row by row.
#[inline(always)]
pub fn from_row_major(components: &[f64; 9]) -> Matrix3<f64> {
    Matrix3::from_fn(|i, j| components[3 * i + j])
}

/// Computes the cofactor `det(F) F^-T`, the derivative of `det F`, also where `det F = 0`.
///
/// ```
/// let f = nalgebra::Matrix3::from_diagonal(&[2.0, 3.0, 0.0].into());
/// assert_eq!(biotissue::tensor::cofactor(&f), nalgebra::Matrix3::from_diagonal(&[0.0, 0.0, 6.0].into()));
/// ```
pub fn cofactor(f: &Matrix3<f64>) -> Matrix3<f64> {
    let [x, y, z] = [0, 1, 2].map(|column| f.column(column).into_owned());
    Matrix3::from_columns(&[y.cross(&z), z.cross(&x), x.cross(&y)])
}

/// Computes `dP = A : dF`, Pa, for a tangent with row `3 * i + J` and column `3 * k + L`.
#[inline(always)]
pub fn contract(tangent: &SMatrix<f64, 9, 9>, df: &Matrix3<f64>) -> Matrix3<f64> {
    let dp = tangent * SVector::from(row_major(df));
    from_row_major(&dp.into())
}

/// Computes the Cauchy stress `sigma = P F^T / J`, Pa, from the first Piola-Kirchhoff stress `P` and the deformation
/// gradient `F`.
///
/// ```
/// use biotissue::tensor::cauchy;
/// use nalgebra::Matrix3;
///
/// // Uniaxial force of 6 N on a unit cube that is stretched to 2 m by 0.5 m by 0.5 m.
/// let (pk1, f) = (Matrix3::from_diagonal(&[6.0, 0.0, 0.0].into()), Matrix3::from_diagonal(&[2.0, 0.5, 0.5].into()));
/// assert_eq!(cauchy(&pk1, &f)[(0, 0)], 6.0 / 0.25);
/// ```
pub fn cauchy(pk1: &Matrix3<f64>, gradient: &Matrix3<f64>) -> Matrix3<f64> {
    pk1 * gradient.transpose() / gradient.determinant()
}

/// Computes the von Mises stress `sqrt(3/2 s : s)`, Pa, of the deviator `s` of a Cauchy stress.
///
/// ```
/// use biotissue::tensor::von_mises;
/// use nalgebra::Matrix3;
///
/// assert_eq!(von_mises(&Matrix3::from_diagonal(&[7.5, 0.0, 0.0].into())), 7.5);
/// assert_eq!(von_mises(&Matrix3::from_diagonal_element(-3.0)), 0.0);
/// ```
pub fn von_mises(cauchy: &Matrix3<f64>) -> f64 {
    let deviator = cauchy - Matrix3::identity() * (cauchy.trace() / 3.0);
    (1.5 * deviator.norm_squared()).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn contraction_is_the_double_dot() {
        let a = SMatrix::<f64, 9, 9>::from_fn(|r, c| (10 * r + c) as f64);
        let df = Matrix3::new(0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0);
        assert_eq!(contract(&a, &df), Matrix3::from_fn(|i, j| (10 * (3 * i + j) + 3) as f64));
    }

    /// In principal axes, `sqrt(((a - b)^2 + (b - c)^2 + (c - a)^2) / 2)`; independent of rotations.
    #[test]
    fn von_mises_stress_is_that_of_the_principal_stresses() {
        let [a, b, c] = [3.0_f64, -1.0, 0.5];
        let expected = (((a - b).powi(2) + (b - c).powi(2) + (c - a).powi(2)) / 2.0).sqrt();
        let q = nalgebra::Rotation3::from_euler_angles(0.7, -0.4, 1.9).into_inner();
        let turned = q * Matrix3::from_diagonal(&[a, b, c].into()) * q.transpose();
        assert!((von_mises(&turned) - expected).abs() < 1e-14 * expected);
    }
}
