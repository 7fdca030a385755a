//! Values by integration point, of all points of a mesh or of some.

use std::sync::Arc;

use serde::{Deserialize, Serialize};

/// The values of points, which are found by their numbers in the whole mesh.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(super) struct PointValues<T> {
    values: Arc<[T]>,
    /// The points of the values, ascending; `None` if these are all points from 0.
    points: Option<Arc<[u32]>>,
}

impl<T: Copy> PointValues<T> {
    /// Gives each point of a mesh its value.
    pub fn new(values: Vec<T>) -> Self {
        Self { values: values.into(), points: None }
    }

    /// Returns the values, in the order of the points.
    pub fn values(&self) -> &[T] {
        &self.values
    }

    /// Returns the value of a point; `None` if it has none here.
    pub fn get(&self, point: usize) -> Option<T> {
        let place = match &self.points {
            None => point,
            Some(points) => points.binary_search(&u32::try_from(point).ok()?).ok()?,
        };
        self.values.get(place).copied()
    }

    /// Returns the values of these points, ascending, for which `is_value` returns true.
    ///
    /// # Panics
    /// Panics if the points are not ascending.
    pub fn on_points(&self, points: &[usize], is_value: impl Fn(T) -> bool) -> Self {
        assert!(points.is_sorted(), "ascending points");
        let value =
            |&point: &usize| Some((u32::try_from(point).ok()?, self.get(point).filter(|&value| is_value(value))?));
        let (points, values): (Vec<u32>, Vec<T>) = points.iter().filter_map(value).unzip();
        Self { values: values.into(), points: Some(points.into()) }
    }

    /// Returns the values that `map` makes of these, at the same points.
    pub fn map(&self, map: impl FnMut(T) -> T) -> Self {
        Self { values: self.values.iter().copied().map(map).collect(), points: self.points.clone() }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_of_some_points_are_found_by_their_numbers() {
        let all = PointValues::new(vec![5, 6, 0, 8]);
        let some = all.on_points(&[0, 2, 3, 7], |value| value > 0);
        let of = |values: &PointValues<i32>| [0, 1, 2, 3, 4].map(|point| values.get(point));
        assert_eq!(of(&all), [Some(5), Some(6), Some(0), Some(8), None]);
        assert_eq!(of(&some), [Some(5), None, None, Some(8), None]);
        assert_eq!(some.values(), [5, 8]);
        assert_eq!(of(&some.on_points(&[1, 3], |_| true).map(|value| 2 * value)), [None, None, None, Some(16), None]);
        assert_eq!(of(&some.on_points(&[], |_| true)), [None; 5]);
    }
}
