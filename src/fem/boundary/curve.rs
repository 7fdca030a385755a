//! Load curves: factors over pseudo-time, and over the position if a function gives them.

use std::fmt::Debug;
use std::sync::Arc;

use thiserror::Error;

/// A load factor as a function of pseudo-time `t` in `(0, 1]` and of the reference position.
///
/// ```
/// use biotissue::fem::boundary::LoadCurve;
///
/// let load_and_unload = LoadCurve::table(&[[0.0, 0.0], [0.5, 1.0], [1.0, 0.0]]).unwrap();
/// let anywhere = [0.0; 3];
/// assert_eq!((load_and_unload.factor(0.25, anywhere), load_and_unload.factor(1.0, anywhere)), (0.5, 0.0));
/// ```
#[derive(Clone, Debug, Default)]
pub enum LoadCurve {
    /// `factor = t`.
    #[default]
    Ramp,
    /// Linear interpolation between points.
    Table(LoadTable),
    /// Any function. Two curves are equal if they share it, or if both functions have the same
    /// [`LoadFunction::formula`].
    Function(Arc<dyn LoadFunction>),
}

/// A load factor as a function of pseudo-time and position. A traction or pressure evaluates it at the integration
/// points of faces, a prescribed displacement at nodes.
///
/// ```
/// use std::sync::Arc;
/// use biotissue::fem::boundary::{LoadCurve, LoadFunction, Traction};
///
/// /// The pressure of water at rest, whose level rises to `height`.
/// #[derive(Debug)]
/// struct Water {
///     height: f64,
/// }
///
/// impl LoadFunction for Water {
///     fn factor(&self, t: f64, [_, _, z]: [f64; 3]) -> f64 {
///         (t * self.height - z).max(0.0)
///     }
/// }
///
/// let curve = LoadCurve::Function(Arc::new(Water { height: 2.0 }));
/// let wall = Traction { surface: "x1".into(), value: [-9.81e3, 0.0, 0.0], curve };
/// assert_eq!(wall.curve.factor(0.5, [0.0, 0.0, 0.25]), 0.75);
/// ```
pub trait LoadFunction: Debug + Send + Sync {
    /// Returns the factor at pseudo-time `t` and at a position in the reference state, m.
    fn factor(&self, t: f64, x: [f64; 3]) -> f64;

    /// Returns the pseudo-times at which the rate of the factor jumps; an increment ends exactly at each of them. The
    /// default is none.
    fn break_points(&self) -> Vec<f64> {
        Vec::new()
    }

    /// Returns a text that defines the function: two functions with the same formula have the same factors. The default
    /// is `None`.
    fn formula(&self) -> Option<&str> {
        None
    }

    /// Returns true if the factor may depend on the position. A pressure on a closed surface has a symmetric stiffness only
    /// if it does not. The default is true.
    fn depends_on_position(&self) -> bool {
        true
    }

    /// Returns true if the factor is a product of a function of `t`, which is finite, and a function of the position: a
    /// factor that is finite at `t = 0` and `t = 1` is then finite at all times. The default is false.
    fn is_separable(&self) -> bool {
        false
    }
}

impl PartialEq for LoadCurve {
    fn eq(&self, other: &Self) -> bool {
        match (self, other) {
            (Self::Ramp, Self::Ramp) => true,
            (Self::Table(one), Self::Table(other)) => one == other,
            (Self::Function(one), Self::Function(other)) => {
                Arc::ptr_eq(one, other) || one.formula().is_some() && one.formula() == other.formula()
            }
            _ => false,
        }
    }
}

/// `(t, factor)` points with strictly ascending `t`: linear between them, constant outside.
#[derive(Clone, Debug, PartialEq)]
pub struct LoadTable {
    points: Vec<[f64; 2]>,
}

/// The reason why points do not form a load curve.
#[derive(Clone, Copy, Debug, Error, PartialEq)]
pub enum CurveError {
    /// There are no points.
    #[error("a load curve needs at least one point (t, factor)")]
    Empty,
    /// A coordinate is NaN or infinite.
    #[error("point {index} of the load curve, ({t}, {factor}), is not finite")]
    NotFinite {
        /// Index of the point, from 0.
        index: usize,
        /// The pseudo-time of the point.
        t: f64,
        /// The factor of the point.
        factor: f64,
    },
    /// Times do not ascend strictly.
    #[error("the times of a load curve ascend strictly, but point {index} has t = {t} after {previous}")]
    NotAscending {
        /// Index of the point, from 0.
        index: usize,
        /// The pseudo-time of the point.
        t: f64,
        /// The pseudo-time of the previous point.
        previous: f64,
    },
}

impl LoadCurve {
    /// Creates a curve through `(t, factor)` points.
    ///
    /// # Errors
    /// Returns [`CurveError`] if there are no points, a coordinate is not finite, or the times do not ascend strictly.
    pub fn table(points: &[[f64; 2]]) -> Result<Self, CurveError> {
        if points.is_empty() {
            return Err(CurveError::Empty);
        }
        for (index, &[t, factor]) in points.iter().enumerate() {
            if !(t.is_finite() && factor.is_finite()) {
                return Err(CurveError::NotFinite { index, t, factor });
            }
            let previous = index.checked_sub(1).map_or(f64::NEG_INFINITY, |before| points[before][0]);
            if t <= previous {
                return Err(CurveError::NotAscending { index, t, previous });
            }
        }
        Ok(Self::Table(LoadTable { points: points.to_vec() }))
    }

    /// Returns the pseudo-times at which the rate of the factor jumps.
    pub fn break_points(&self) -> Vec<f64> {
        match self {
            Self::Ramp => Vec::new(),
            Self::Table(table) => table.points.iter().map(|point| point[0]).collect(),
            Self::Function(function) => function.break_points(),
        }
    }

    /// Returns the text that defines a function, if it gives one.
    pub fn formula(&self) -> Option<&str> {
        if let Self::Function(function) = self { function.formula() } else { None }
    }

    /// Returns true if the factor may depend on the position.
    pub fn depends_on_position(&self) -> bool {
        matches!(self, Self::Function(function) if function.depends_on_position())
    }

    /// Returns true if a factor that is finite at `t = 0` and `t = 1` is finite at all times; see
    /// [`LoadFunction::is_separable`].
    pub fn is_separable(&self) -> bool {
        match self {
            Self::Ramp | Self::Table(_) => true,
            Self::Function(function) => function.is_separable(),
        }
    }

    /// Returns the factor at pseudo-time `t` and at a position in the reference state, m.
    pub fn factor(&self, t: f64, x: [f64; 3]) -> f64 {
        match self {
            Self::Ramp => t,
            Self::Table(table) => table.factor(t),
            Self::Function(function) => function.factor(t, x),
        }
    }
}

impl LoadTable {
    /// Returns the `(t, factor)` points.
    pub fn points(&self) -> &[[f64; 2]] {
        &self.points
    }

    fn factor(&self, t: f64) -> f64 {
        let after = self.points.partition_point(|point| point[0] < t);
        match (after.checked_sub(1).and_then(|before| self.points.get(before)), self.points.get(after)) {
            (Some([t0, f0]), Some([t1, f1])) => f0 + (f1 - f0) * ((t - t0) / (t1 - t0)),
            (Some([_, factor]), None) | (None, Some([_, factor])) => *factor,
            (None, None) => 0.0,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tables_are_linear_between_and_constant_outside() {
        let curve = LoadCurve::table(&[[0.2, 1.0], [0.4, 3.0], [1.0, 0.0]]).unwrap();
        for (t, expected) in [(0.0, 1.0), (0.2, 1.0), (0.3, 2.0), (0.4, 3.0), (0.7, 1.5), (1.0, 0.0), (2.0, 0.0)] {
            assert!((curve.factor(t, [0.0; 3]) - expected).abs() < 1e-15, "{t}");
        }
        assert_eq!(LoadCurve::Ramp.factor(0.3, [0.0; 3]), 0.3);
    }

    #[test]
    fn broken_tables_are_refused() {
        assert_eq!(LoadCurve::table(&[]).unwrap_err(), CurveError::Empty);
        let twice = LoadCurve::table(&[[0.5, 0.0], [0.5, 1.0]]).unwrap_err();
        assert_eq!(twice, CurveError::NotAscending { index: 1, t: 0.5, previous: 0.5 });
        let unreal = LoadCurve::table(&[[0.5, f64::INFINITY]]).unwrap_err();
        assert_eq!(unreal, CurveError::NotFinite { index: 0, t: 0.5, factor: f64::INFINITY });
    }
}
