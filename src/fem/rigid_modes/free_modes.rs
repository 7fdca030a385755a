//! Description of the free rigid-body modes of a part: translations, and rotations about axes.

use std::fmt;

use nalgebra::{DMatrix, DVector, Matrix3, Matrix3xX, Vector3, Vector6};

/// Numbers of order one are treated as zero below this threshold.
const ZERO: f64 = 1e-6;

/// The free rigid-body modes of a part.
#[derive(Clone, Debug, PartialEq)]
pub struct FreeModes {
    /// Directions of the free translations, orthonormal.
    pub translations: Vec<[f64; 3]>,
    /// The free rotations, up to free translations.
    pub rotations: Vec<Screw>,
    /// A point that all free rotations leave in place, m, if there is one; not unique if translations are also free.
    pub fixed_point: Option<[f64; 3]>,
}

/// A rotation about an axis, combined with a translation along it if the pitch is not zero.
#[derive(Clone, Debug, PartialEq)]
pub struct Screw {
    /// Direction of the axis, a unit vector.
    pub axis: [f64; 3],
    /// A point on the axis, m.
    pub point: [f64; 3],
    /// Translation along the axis, m per radian.
    pub pitch: f64,
}

impl FreeModes {
    /// Analyzes orthonormal modes `(v, w)`, each the motion `v + w x (x - center) / size`.
    pub(super) fn new(center: Vector3<f64>, size: f64, modes: &[Vector6<f64>]) -> Self {
        let half = |at: usize| -> Matrix3xX<f64> {
            let halves: Vec<Vector3<f64>> = modes.iter().map(|mode| mode.fixed_rows::<3>(at).into_owned()).collect();
            Matrix3xX::from_columns(&halves)
        };
        let (linear, angular) = (half(0), half(3));
        let (without_rotation, with_rotation) = split(&angular);
        let translations = aligned(&(&linear * without_rotation));
        // Rotations are determined up to free translations, which the projection removes.
        let projection = translations.iter().fold(Matrix3::identity(), |projection, t| projection - t * t.transpose());
        let (linear, angular) = (projection * linear * &with_rotation, angular * with_rotation);
        let common = common_point(&linear, &angular, &projection);
        let at = |arm: Vector3<f64>| rounded(center + size * arm, size);
        let screw = |axis: Vector3<f64>| {
            let velocity = velocity(&linear, &angular, axis);
            let pitch = velocity.dot(&axis);
            let point = at(common.unwrap_or_else(|| axis.cross(&velocity)));
            Screw { axis: axis.into(), point, pitch: if pitch.abs() < ZERO { 0.0 } else { size * pitch } }
        };
        Self {
            rotations: aligned(&angular).into_iter().map(screw).collect(),
            translations: translations.into_iter().map(Into::into).collect(),
            fixed_point: common.map(at),
        }
    }
}

/// Returns the combinations of the modes without rotation, and the others, as columns.
fn split(angular: &Matrix3xX<f64>) -> (DMatrix<f64>, DMatrix<f64>) {
    let eigen = angular.tr_mul(angular).symmetric_eigen();
    let chosen = |with_rotation: bool| {
        let columns = (0..angular.ncols()).filter(|&k| (eigen.eigenvalues[k] > ZERO * ZERO) == with_rotation);
        let columns: Vec<DVector<f64>> = columns.map(|k| eigen.eigenvectors.column(k).into_owned()).collect();
        if columns.is_empty() { DMatrix::zeros(angular.ncols(), 0) } else { DMatrix::from_columns(&columns) }
    };
    (chosen(false), chosen(true))
}

/// Returns an orthonormal basis of the column space, aligned with x, y and z as far as possible.
fn aligned(columns: &Matrix3xX<f64>) -> Vec<Vector3<f64>> {
    let eigen = (columns * columns.transpose()).symmetric_eigen();
    let spanning = (0..3).filter(|&k| eigen.eigenvalues[k] > ZERO * ZERO);
    let mut projector = Matrix3::zeros();
    let mut dimension = 0;
    for k in spanning {
        let direction = eigen.eigenvectors.column(k);
        projector += direction * direction.transpose();
        dimension += 1;
    }
    let mut basis = Vec::new();
    for _ in 0..dimension {
        let mut longest = 0;
        for k in 1..3 {
            if projector.column(k).norm() > projector.column(longest).norm() + ZERO {
                longest = k;
            }
        }
        let direction = projector.column(longest).normalize();
        projector -= direction * direction.transpose();
        basis.push(direction.map(|x| if x.abs() < ZERO { 0.0 } else { x }).normalize());
    }
    basis
}

/// Returns the velocity of the center in a rotation about an axis at unit rate.
fn velocity(linear: &Matrix3xX<f64>, angular: &Matrix3xX<f64>, axis: Vector3<f64>) -> Vector3<f64> {
    let axis = DVector::from_column_slice(axis.as_slice());
    let angular = DMatrix::from_iterator(3, angular.ncols(), angular.iter().copied());
    let mix = angular.svd(true, true).solve(&axis, 0.1 * ZERO).unwrap_or_else(|_| DVector::zeros(linear.ncols()));
    linear * mix
}

/// Returns the arm `q` with `v + w x q = 0` in all modes, up to free translations, if it exists.
fn common_point(linear: &Matrix3xX<f64>, angular: &Matrix3xX<f64>, projection: &Matrix3<f64>) -> Option<Vector3<f64>> {
    let rows = 3 * angular.ncols();
    if rows == 0 {
        return None;
    }
    let (mut matrix, mut right) = (DMatrix::zeros(rows, 3), DVector::zeros(rows));
    for (k, (v, w)) in linear.column_iter().zip(angular.column_iter()).enumerate() {
        let turn = projection * w.into_owned().cross_matrix();
        matrix.view_mut((3 * k, 0), (3, 3)).copy_from(&turn);
        right.rows_mut(3 * k, 3).copy_from(&-v);
    }
    let arm = matrix.clone().svd(true, true).solve(&right, 0.1 * ZERO).ok()?;
    let left = (matrix * &arm - right).amax();
    (left < ZERO).then(|| Vector3::new(arm[0], arm[1], arm[2]))
}

/// Sets coordinates to zero that are rounding errors for a body of this size.
fn rounded(position: Vector3<f64>, size: f64) -> [f64; 3] {
    position.map(|x| if x.abs() < 1e-9 * size { 0.0 } else { x }).into()
}

impl fmt::Display for FreeModes {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match (self.describe_translations(), self.describe_rotations()) {
            (Some(translations), Some(rotations)) => write!(f, "free to move {translations} and to {rotations}"),
            (Some(translations), None) => write!(f, "free to move {translations}"),
            (None, Some(rotations)) => write!(f, "free to {rotations}"),
            (None, None) => f.write_str("fully constrained"),
        }
    }
}

impl FreeModes {
    fn describe_translations(&self) -> Option<String> {
        match self.translations.len() {
            0 => None,
            3 => Some("in every direction".into()),
            _ => Some(format!("along {}", joined(self.translations.iter().map(direction)))),
        }
    }

    fn describe_rotations(&self) -> Option<String> {
        match (self.rotations.as_slice(), self.fixed_point) {
            ([], _) => None,
            ([_, _, _], Some(_)) if self.translations.len() == 3 => Some("rotate about every axis".into()),
            ([_, _, _], Some(point)) => Some(format!("rotate about every axis through {}", vector(&point))),
            // The position of an axis is arbitrary if the part can also translate.
            (screws, Some(_)) if !self.translations.is_empty() => {
                Some(format!("rotate about {}", joined(screws.iter().map(|screw| direction(&screw.axis)))))
            }
            (screws, Some(point)) => {
                let axes = joined(screws.iter().map(|screw| direction(&screw.axis)));
                let word = if screws.len() == 1 { "the axis" } else { "axes" };
                Some(format!("rotate about {axes} ({word} through {})", vector(&point)))
            }
            (screws, None) => Some(joined(screws.iter().map(Screw::describe))),
        }
    }
}

impl Screw {
    fn describe(&self) -> String {
        let turn = format!("rotate about the axis through {} along {}", vector(&self.point), direction(&self.axis));
        if self.pitch == 0.0 {
            return turn;
        }
        format!("{turn} while it moves {} m along it per radian", number(self.pitch))
    }
}

/// Formats a direction as `x`, `y`, `z` or a vector.
pub(super) fn direction(axis: &[f64; 3]) -> String {
    match axis.iter().position(|&x| x.abs() > 1.0 - ZERO) {
        Some(k) => ["x", "y", "z"][k].into(),
        None => vector(axis),
    }
}

pub(super) fn vector([x, y, z]: &[f64; 3]) -> String {
    format!("({}, {}, {})", number(*x), number(*y), number(*z))
}

/// Formats a number with four significant digits, without trailing zeros.
fn number(value: f64) -> String {
    let short = format!("{value:.3e}");
    short.parse().map_or(short, |value: f64| value.to_string())
}

fn joined(items: impl Iterator<Item = String>) -> String {
    let items: Vec<String> = items.collect();
    match items.as_slice() {
        [first @ .., last] if !first.is_empty() => format!("{} and {last}", first.join(", ")),
        _ => items.concat(),
    }
}
