//! The rotation of a rotation vector, and its derivatives.
//!
//! With `s = theta . theta`, the cross-product matrix `[theta]` and
//!
//! ```text
//! c(s) = cos(sqrt(s)),    a(s) = sin(sqrt(s)) / sqrt(s),    b(s) = (1 - cos(sqrt(s))) / s,
//! ```
//!
//! the formula of Rodrigues is `R = c I + a [theta] + b theta (x) theta`. The three functions are smooth in `s`, and
//! their derivatives follow from `c' = -a / 2`, `2 s a' = c - a` and `s b' = a / 2 - b`.

use nalgebra::{Matrix3, Vector3};

/// Below this value of `s`, the functions are summed as power series, because the closed forms of their derivatives
/// cancel.
const SERIES_BELOW: f64 = 1.0;

/// `c`, `a` and `b`, each with its first and second derivative with respect to `s`.
struct Coefficients {
    c: [f64; 3],
    a: [f64; 3],
    b: [f64; 3],
}

impl Coefficients {
    fn new(s: f64) -> Self {
        if s < SERIES_BELOW {
            return Self { c: series(s, 0), a: series(s, 1), b: series(s, 2) };
        }
        let (sin, cos) = s.sqrt().sin_cos();
        let (a, b) = (sin / s.sqrt(), (1.0 - cos) / s);
        let (da, db) = ((cos - a) / (2.0 * s), (0.5 * a - b) / s);
        let dc = -0.5 * a;
        Self { c: [cos, dc, -0.5 * da], a: [a, da, (dc - 3.0 * da) / (2.0 * s)], b: [b, db, (0.5 * da - 2.0 * db) / s] }
    }

    /// `c I + a [theta] + b theta (x) theta` with the derivative of this order of each function.
    fn combine(&self, theta: &Vector3<f64>, order: usize) -> Matrix3<f64> {
        let diagonal = Matrix3::from_diagonal_element(self.c[order]);
        diagonal + theta.cross_matrix() * self.a[order] + theta * theta.transpose() * self.b[order]
    }
}

/// Returns `sum_k (-s)^k / (2 k + offset)!` and its first two derivatives.
fn series(s: f64, offset: u32) -> [f64; 3] {
    const TERMS: u32 = 12;
    let mut sums = [0.0; 3];
    // By Horner's rule for a polynomial and its derivatives.
    for k in (0..TERMS).rev() {
        let factorial: f64 = (1..=2 * k + offset).map(f64::from).product();
        let coefficient = if k % 2 == 0 { 1.0 } else { -1.0 } / factorial;
        sums[2] = sums[2] * s + sums[1];
        sums[1] = sums[1] * s + sums[0];
        sums[0] = sums[0] * s + coefficient;
    }
    [sums[0], sums[1], 2.0 * sums[2]]
}

/// Returns the rotation by the angle `|theta|`, rad, about the axis `theta`.
pub fn rotation(theta: &Vector3<f64>) -> Matrix3<f64> {
    Coefficients::new(theta.norm_squared()).combine(theta, 0)
}

/// Returns `dR / d theta_i` for `i = 0, 1, 2`.
pub fn derivatives(theta: &Vector3<f64>) -> [Matrix3<f64>; 3] {
    let coefficients = Coefficients::new(theta.norm_squared());
    let along = coefficients.combine(theta, 1) * 2.0;
    std::array::from_fn(|i| along * theta[i] + partial(theta, i, coefficients.a[0], coefficients.b[0]))
}

/// Returns the symmetric matrix `V : d2R / d theta_i d theta_j`.
pub fn second_derivatives(theta: &Vector3<f64>, v: &Matrix3<f64>) -> Matrix3<f64> {
    let coefficients = Coefficients::new(theta.norm_squared());
    let Coefficients { a, b, .. } = coefficients;
    let (first, second) = (v.dot(&coefficients.combine(theta, 1)), v.dot(&coefficients.combine(theta, 2)));
    let mixed: [f64; 3] = std::array::from_fn(|i| 2.0 * v.dot(&partial(theta, i, a[1], b[1])));
    Matrix3::from_fn(|i, j| {
        let diagonal = if i == j { 2.0 * first } else { 0.0 };
        diagonal
            + 4.0 * theta[i] * theta[j] * second
            + theta[i] * mixed[j]
            + theta[j] * mixed[i]
            + b[0] * (v[(i, j)] + v[(j, i)])
    })
}

/// Returns the derivative of `a [theta] + b theta (x) theta` with respect to `theta_i` at constant `a` and `b`.
fn partial(theta: &Vector3<f64>, i: usize, a: f64, b: f64) -> Matrix3<f64> {
    let unit = Vector3::ith(i, 1.0);
    unit.cross_matrix() * a + (unit * theta.transpose() + theta * unit.transpose()) * b
}

#[cfg(test)]
mod tests {
    use nalgebra::Rotation3;

    use super::*;

    fn samples() -> Vec<Vector3<f64>> {
        let directions = [Vector3::new(1.0, -2.0, 0.5), Vector3::new(0.3, 0.2, 0.9), Vector3::x()];
        let angles = [0.0, 1e-9, 1e-3, 0.5, 0.9999, 1.0001, 2.0, 3.1, 5.0];
        angles.iter().flat_map(|&angle| directions.map(|direction| direction.normalize() * angle)).collect()
    }

    #[test]
    fn rotations_are_those_of_nalgebra() {
        for theta in samples() {
            let expected = Rotation3::from_scaled_axis(theta).into_inner();
            assert!((rotation(&theta) - expected).norm() < 1e-14, "{theta}");
        }
    }

    #[test]
    fn derivatives_are_central_differences() {
        let h = 1e-5;
        let v = Matrix3::new(1.0, -0.4, 0.3, 0.7, 2.0, -1.1, 0.2, 0.5, -0.6);
        for theta in samples() {
            let first = derivatives(&theta);
            let second = second_derivatives(&theta, &v);
            for i in 0..3 {
                let step = Vector3::ith(i, h);
                let (up, down) = (theta + step, theta - step);
                let difference = (rotation(&up) - rotation(&down)) / (2.0 * h);
                assert!((first[i] - difference).norm() < 1e-9, "{theta} {i}");
                for j in 0..3 {
                    let difference = (v.dot(&derivatives(&up)[j]) - v.dot(&derivatives(&down)[j])) / (2.0 * h);
                    assert!((second[(i, j)] - difference).abs() < 1e-9, "{theta} ({i}, {j})");
                }
            }
        }
    }
}
