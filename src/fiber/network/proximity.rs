//! A hash grid that finds points within a fixed distance.

use std::collections::HashMap;

/// Points in a hash grid, for searches within one fixed radius.
#[derive(Debug)]
pub(super) struct Proximity {
    radius: f64,
    cells: HashMap<[i64; 3], Vec<(usize, [f64; 3])>>,
}

impl Proximity {
    /// Creates an empty grid for searches within `radius` (positive).
    pub(super) fn new(radius: f64) -> Self {
        Self { radius, cells: HashMap::new() }
    }

    /// Adds a point with a number given by the caller.
    pub(super) fn insert(&mut self, number: usize, point: [f64; 3]) {
        let cell = point.map(|x| self.cell(x));
        self.cells.entry(cell).or_default().push((number, point));
    }

    /// Returns the lowest number of the points within the radius of `point`; `None` if there is no such point.
    pub(super) fn near(&self, point: [f64; 3]) -> Option<usize> {
        let lower = point.map(|x| self.cell(x - self.radius));
        let upper = point.map(|x| self.cell(x + self.radius));
        let mut found = None;
        for i in lower[0]..=upper[0] {
            for j in lower[1]..=upper[1] {
                for k in lower[2]..=upper[2] {
                    for &(number, other) in self.cells.get(&[i, j, k]).into_iter().flatten() {
                        if distance(point, other) <= self.radius && found.is_none_or(|lowest| number < lowest) {
                            found = Some(number);
                        }
                    }
                }
            }
        }
        found
    }

    /// Returns the index of the cell along an axis; cells are four radii wide, so that most searches visit only one
    /// cell.
    fn cell(&self, x: f64) -> i64 {
        (x / (4.0 * self.radius)).floor() as i64
    }
}

/// Returns the distance of two points: `sqrt(dx*dx + dy*dy + dz*dz)`, in this order of operations.
pub(super) fn distance(a: [f64; 3], b: [f64; 3]) -> f64 {
    let d = [b[0] - a[0], b[1] - a[1], b[2] - a[2]];
    (d[0] * d[0] + d[1] * d[1] + d[2] * d[2]).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_lowest_number_is_found_across_cell_borders() {
        let mut points = Proximity::new(0.1);
        points.insert(7, [0.401, 0.0, -0.001]);
        points.insert(3, [0.35, 0.0, 0.0]);
        assert_eq!(points.near([0.399, 0.0, 0.001]), Some(3));
        assert_eq!(points.near([0.47, 0.0, 0.0]), Some(7));
        assert_eq!(points.near([0.6, 0.0, 0.0]), None);
    }
}
