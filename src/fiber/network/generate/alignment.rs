//! Alignment: the preferred direction of the fibers, and its strength.
//!
//! An isotropic network is stretched at constant volume by `U = mu a (x) a + mu^(-1/2) (I - a (x) a)` along the axis
//! `a`. Its fibers, isotropic unit vectors `N` before the stretch, then have the directions `U N / |U N|`. With
//! `e = mu^3 - 1` and the angle `theta` to the axis, the mean over all `N` is
//!
//! ```text
//! <cos^2 theta> = (1 + e)/e (1 - atan(sqrt e)/sqrt e)        P2 = (3 <cos^2 theta> - 1)/2
//! ```
//!
//! `P2`, the second-rank (nematic) order parameter, is 0 for isotropic and 1 for parallel fibers. The stretch is
//! applied to the space in which points are triangulated, not to the points, which stay uniform in the cube.

use super::GenerateError;
use super::portable::{atan, cbrt};

/// The maximum strength: at 0.95 the network is stretched 46 times more along the axis than across it.
pub const MAX_STRENGTH: f64 = 0.95;

/// A preferred direction of fibers.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Alignment {
    direction: [f64; 3],
    strength: f64,
}

impl Alignment {
    /// Creates an alignment along a `direction` of any positive length. The `strength` is the order parameter
    /// `P2` of the fibers, each counted with the same weight, from 0 (isotropic) to [`MAX_STRENGTH`].
    ///
    /// # Errors
    /// Returns [`GenerateError::Direction`] if the direction is zero or not finite, and [`GenerateError::Strength`] if
    /// the strength is out of range.
    pub fn new(direction: [f64; 3], strength: f64) -> Result<Self, GenerateError> {
        let longest = direction.iter().fold(0.0, |m: f64, x| m.max(x.abs()));
        if !(longest > 0.0 && direction.iter().all(|x| x.is_finite())) {
            return Err(GenerateError::Direction(direction));
        }
        if !(0.0..=MAX_STRENGTH).contains(&strength) {
            return Err(GenerateError::Strength { strength, most: MAX_STRENGTH });
        }
        Ok(Self { direction, strength })
    }

    /// Returns the direction as given.
    pub fn direction(&self) -> [f64; 3] {
        self.direction
    }

    /// Returns the direction as a unit vector.
    pub fn axis(&self) -> [f64; 3] {
        // The division by the largest component avoids overflow of the squares.
        let longest = self.direction.iter().fold(0.0, |m: f64, x| m.max(x.abs()));
        let [x, y, z] = self.direction.map(|x| x / longest);
        let norm = (x * x + y * y + z * z).sqrt();
        [x / norm, y / norm, z / norm]
    }

    /// Returns the requested order parameter.
    pub fn strength(&self) -> f64 {
        self.strength
    }

    /// Returns the stretch `mu` of the isotropic network along the axis.
    pub fn stretch(&self) -> f64 {
        cbrt(1.0 + excess(self.strength))
    }
}

/// Returns `P2` of an isotropic distribution stretched by `mu`, as a function of `excess = mu^3 - 1`.
fn order_parameter(excess: f64) -> f64 {
    let parts = if excess < 0.02 {
        // The closed form suffers from cancellation here; this is its series.
        (0..10).rev().fold(0.0, |sum, k| 1.0 / f64::from(2 * k + 3) - excess * sum)
    } else {
        let root = excess.sqrt();
        (1.0 - atan(root) / root) / excess
    };
    0.5 * (3.0 * (1.0 + excess) * parts - 1.0)
}

/// Returns the inverse of [`order_parameter`], by bisection down to adjacent floating-point numbers; it uses only
/// operations that are bitwise reproducible on every machine.
fn excess(order: f64) -> f64 {
    if order <= 0.0 {
        return 0.0;
    }
    let (mut low, mut high) = (0.0, 1.0e4);
    loop {
        let middle = 0.5 * (low + high);
        if middle <= low || middle >= high || high < 1e-15 {
            return low;
        }
        if order_parameter(middle) <= order { low = middle } else { high = middle }
    }
}

/// The stretch `U` of space for an alignment; the identity without alignment.
#[derive(Clone, Copy, Debug)]
pub(super) struct Stretch {
    axis: [f64; 3],
    along: f64,
    across: f64,
}

impl Stretch {
    pub(super) fn of(alignment: Option<&Alignment>) -> Self {
        match alignment {
            Some(alignment) if alignment.strength > 0.0 => {
                let along = alignment.stretch();
                Self { axis: alignment.axis(), along, across: 1.0 / along.sqrt() }
            }
            // With a zero axis all operations are exact.
            _ => Self { axis: [0.0; 3], along: 1.0, across: 1.0 },
        }
    }

    /// Returns `U^-1 x`: maps to the space in which the network is isotropic.
    pub(super) fn to_isotropic(self, x: [f64; 3]) -> [f64; 3] {
        self.apply(1.0 / self.along, 1.0 / self.across, x)
    }

    /// Returns `U x`: maps back to the space of the cube.
    pub(super) fn to_cube(self, x: [f64; 3]) -> [f64; 3] {
        self.apply(self.along, self.across, x)
    }

    fn apply(self, along: f64, across: f64, x: [f64; 3]) -> [f64; 3] {
        let part = self.axis[0] * x[0] + self.axis[1] * x[1] + self.axis[2] * x[2];
        [0, 1, 2].map(|k| across * x[k] + (along - across) * part * self.axis[k])
    }

    /// Returns `|U e_k|`, the half-width of the image of the unit ball along each axis of the cube.
    pub(super) fn reach(self) -> [f64; 3] {
        self.axis.map(|a| (self.across * self.across * (1.0 - a * a) + self.along * self.along * a * a).sqrt())
    }

    /// Returns the distance of two points of the cube, measured in the isotropic space.
    pub(super) fn distance(self, a: [f64; 3], b: [f64; 3]) -> f64 {
        let [x, y, z] = self.to_isotropic([b[0] - a[0], b[1] - a[1], b[2] - a[2]]);
        (x * x + y * y + z * z).sqrt()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Computes `P2` as a mean over isotropic directions by the midpoint rule, without the closed form.
    fn by_quadrature(mu: f64) -> f64 {
        let panels = 200_000;
        let cosine = |k: u32| (f64::from(k) + 0.5) / f64::from(panels);
        let square = |c: f64| {
            let (along, across) = (mu * c, (1.0 - c * c).sqrt() / mu.sqrt());
            along * along / (along * along + across * across)
        };
        let mean: f64 = (0..panels).map(|k| square(cosine(k))).sum::<f64>() / f64::from(panels);
        1.5 * mean - 0.5
    }

    #[test]
    fn the_stretch_gives_the_requested_order() {
        for strength in [1e-6, 0.003, 0.1, 0.3, 0.6, 0.8, 0.95] {
            let alignment = Alignment::new([0.0, 0.0, 2.0], strength).unwrap();
            let order = by_quadrature(alignment.stretch());
            assert!((order - strength).abs() < 1e-9, "{strength}: {order}");
        }
        assert_eq!(Alignment::new([1.0; 3], 0.0).unwrap().stretch(), 1.0);
    }

    #[test]
    fn series_and_closed_form_agree() {
        let (below, above) = (order_parameter(0.02 - 1e-12), order_parameter(0.02 + 1e-12));
        assert!((below - above).abs() < 1e-11, "{below} {above}");
    }

    #[test]
    fn the_stretch_preserves_volume_and_has_an_inverse() {
        let alignment = Alignment::new([1.0, -2.0, 0.5], 0.7).unwrap();
        let stretch = Stretch::of(Some(&alignment));
        let columns = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]].map(|e| stretch.to_cube(e));
        let u = nalgebra::Matrix3::from_fn(|i, j| columns[j][i]);
        assert!((u.determinant() - 1.0).abs() < 1e-13);
        for (k, column) in columns.iter().enumerate() {
            let norm = column.iter().map(|x| x * x).sum::<f64>().sqrt();
            assert!((stretch.reach()[k] - norm).abs() < 1e-13);
        }
        let x = [0.3, -0.2, 0.45];
        let again = stretch.to_cube(stretch.to_isotropic(x));
        assert!((0..3).all(|k| (again[k] - x[k]).abs() < 1e-14), "{again:?}");
        // Without alignment there is no rounding error.
        let none = Stretch::of(Some(&Alignment::new([1.0, 2.0, 3.0], 0.0).unwrap()));
        assert_eq!((none.to_isotropic(x), none.to_cube(x), none.reach()), (x, x, [1.0; 3]));
    }

    #[test]
    fn invalid_directions_and_strengths_are_errors() {
        assert_eq!(Alignment::new([0.0; 3], 0.5).unwrap_err(), GenerateError::Direction([0.0; 3]));
        assert!(Alignment::new([f64::INFINITY, 0.0, 0.0], 0.5).is_err());
        for strength in [-0.1, 0.96, f64::NAN] {
            let error = Alignment::new([1.0, 0.0, 0.0], strength).unwrap_err();
            assert!(matches!(error, GenerateError::Strength { .. }), "{error}");
        }
        let axis = Alignment::new([1e300, 0.0, -1e300], 0.5).unwrap().axis();
        assert!((axis[0] - 0.5f64.sqrt()).abs() < 1e-15 && axis[2] == -axis[0]);
    }
}
