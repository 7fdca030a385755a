//! Orientation of fibers: tensors and principal directions.
//!
//! ```
//! use biotissue::fiber::orientation::{Weighting, tensor};
//!
//! let (directions, lengths) = ([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]], [3.0, 1.0]);
//! assert_eq!(tensor(&directions, &lengths, Weighting::Number)[(0, 0)], 0.5);
//! assert_eq!(tensor(&directions, &lengths, Weighting::Length)[(0, 0)], 0.75);
//! ```

use nalgebra::{Matrix3, SymmetricEigen, Vector3};

/// The weight of each fiber in an orientation tensor.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Weighting {
    /// Equal weights: `(1/N) sum n (x) n`, as in Tobin 2018.
    Number,
    /// Weights proportional to the given lengths.
    Length,
}

/// Orientation tensor `Omega = sum w n (x) n / sum w` of unit vectors; its trace is 1.
///
/// `lengths` has one entry per fiber; the values are used with [`Weighting::Length`] only. The tensor of no fibers is
/// zero.
pub fn tensor(directions: &[[f64; 3]], lengths: &[f64], weighting: Weighting) -> Matrix3<f64> {
    let mut sum = Matrix3::zeros();
    let mut total = 0.0;
    for (n, &length) in directions.iter().zip(lengths) {
        let weight = if weighting == Weighting::Length { length } else { 1.0 };
        let n = Vector3::from(*n);
        sum += n * n.transpose() * weight;
        total += weight;
    }
    if total > 0.0 { sum / total } else { sum }
}

/// Orientation tensor of the projections of the fibers onto the plane normal to `axis`, each projection normalized to a
/// unit vector; its trace is 1, and it is zero along `axis`. Fibers along the axis are ignored.
///
/// # Panics
/// Panics if `axis` is not 0, 1 or 2.
pub fn planar_tensor(directions: &[[f64; 3]], lengths: &[f64], weighting: Weighting, axis: usize) -> Matrix3<f64> {
    assert!(axis < 3, "an axis is 0, 1 or 2");
    let mut projected = Vec::with_capacity(directions.len());
    let mut weights = Vec::with_capacity(directions.len());
    for (n, &length) in directions.iter().zip(lengths) {
        let mut n = Vector3::from(*n);
        n[axis] = 0.0;
        let norm = n.norm();
        if norm > 1e-12 {
            projected.push((n / norm).into());
            weights.push(length * norm);
        }
    }
    tensor(&projected, &weights, weighting)
}

/// Returns the principal direction of an orientation tensor, with the largest component positive, and its eigenvalue:
/// the axis along which most fibers lie.
pub fn principal(tensor: &Matrix3<f64>) -> (Vector3<f64>, f64) {
    let eigen = SymmetricEigen::new((tensor + tensor.transpose()) * 0.5);
    let largest = eigen.eigenvalues.imax();
    let direction: Vector3<f64> = eigen.eigenvectors.column(largest).into();
    let sign = if direction[direction.iamax()] < 0.0 { -1.0 } else { 1.0 };
    (direction * sign, eigen.eigenvalues[largest])
}

/// The order parameter `P2 = (3 a . Omega a - 1)/2` of an orientation tensor about a unit vector `a`: 1 if all
/// fibers are parallel to it, 0 if they are isotropic, -1/2 if all are normal to it.
pub fn second_order_parameter(tensor: &Matrix3<f64>, axis: &Vector3<f64>) -> f64 {
    1.5 * axis.dot(&(tensor * axis)) - 0.5
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn aligned_fibers_have_their_axis_as_principal_direction() {
        let n = [0.6, 0.0, 0.8];
        let omega = tensor(&[n, [-0.6, 0.0, -0.8]], &[1.0, 2.0], Weighting::Number);
        assert!((omega.trace() - 1.0).abs() < 1e-15);
        let (direction, value) = principal(&omega);
        assert!((value - 1.0).abs() < 1e-14);
        assert!((direction - Vector3::from(n)).norm() < 1e-14);
    }

    #[test]
    fn the_order_parameter_is_right_for_parallel_isotropic_and_normal_fibers() {
        let axis = Vector3::new(0.0, 0.6, 0.8);
        let along = axis * axis.transpose();
        let normal = (Matrix3::identity() - along) * 0.5;
        for (tensor, order) in [(along, 1.0), (Matrix3::identity() / 3.0, 0.0), (normal, -0.5)] {
            assert!((second_order_parameter(&tensor, &axis) - order).abs() < 1e-15);
        }
    }

    #[test]
    fn lengths_are_weights_only_on_request() {
        let fibers = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
        assert_eq!(tensor(&fibers, &[1.0, 3.0], Weighting::Number)[(0, 0)], 0.5);
        assert_eq!(tensor(&fibers, &[1.0, 3.0], Weighting::Length)[(0, 0)], 0.25);
    }

    #[test]
    fn the_planar_tensor_is_that_of_the_projections() {
        let s = 0.5_f64.sqrt();
        let omega = planar_tensor(&[[s, 0.0, s], [0.0, 0.0, 1.0]], &[1.0, 1.0], Weighting::Number, 2);
        assert!((omega[(0, 0)] - 1.0).abs() < 1e-15, "the fiber along the axis does not count");
        assert_eq!(omega[(2, 2)], 0.0);
    }
}
