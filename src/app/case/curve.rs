//! Load curves.

use super::data::CurveCase;

impl CurveCase {
    /// Returns the factor at pseudo-time `t`: `t` itself for a ramp; for a table, linear interpolation between its
    /// points, constant before the first and after the last.
    #[must_use]
    pub fn factor(&self, t: f64) -> f64 {
        let points = match self {
            Self::Ramp => return t,
            Self::Table(points) => points,
        };
        let next = points.partition_point(|point| point[0] <= t);
        match (next.checked_sub(1).and_then(|last| points.get(last)), points.get(next)) {
            (Some(&[t0, f0]), Some(&[t1, f1])) => f0 + (f1 - f0) * ((t - t0) / (t1 - t0)),
            (Some(&[_, factor]), None) | (None, Some(&[_, factor])) => factor,
            // A table without points prescribes zero; the reader rejects such tables.
            (None, None) => 0.0,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ramp_is_the_time() {
        for t in [0.0, 0.05, 0.3, 1.0] {
            assert_eq!(CurveCase::Ramp.factor(t), t);
        }
    }

    #[test]
    fn table_is_linear_between_its_points_and_meets_them_exactly() {
        let curve = CurveCase::Table(vec![[0.0, 0.0], [0.25, 2.0], [0.5, -1.0], [1.0, 1.0]]);
        for (t, factor) in [(0.0, 0.0), (0.25, 2.0), (0.5, -1.0), (1.0, 1.0)] {
            assert_eq!(curve.factor(t), factor);
        }
        assert_eq!(curve.factor(0.125), 1.0);
        assert_eq!(curve.factor(0.375), 0.5);
        assert!((curve.factor(0.6) - -0.6).abs() < 1e-15);
    }

    #[test]
    fn table_is_constant_outside() {
        let curve = CurveCase::Table(vec![[0.2, 3.0], [0.4, 5.0]]);
        assert_eq!((curve.factor(0.0), curve.factor(0.1), curve.factor(0.9)), (3.0, 3.0, 5.0));
        let single = CurveCase::Table(vec![[0.5, 7.0]]);
        assert_eq!((single.factor(0.1), single.factor(0.5), single.factor(1.0)), (7.0, 7.0, 7.0));
    }
}
