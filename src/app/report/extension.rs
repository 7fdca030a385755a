//! The extension of a pulled body: one number per load step, from the displacements of its surfaces.
//!
//! The direction of the pull is the axis and the two surfaces whose mean displacements differ most in the last row of
//! `loads.csv`; the elongation is that difference, positive if the body becomes longer, and the extension is the
//! elongation divided by the reference length of the body (the edge of its bounding box along that axis). For a bar
//! held and pulled at its ends this is the engineering strain. Without such surfaces, and if a rigid surface turns, the
//! change of the bounding box along its longest edge is used instead.

use crate::app::results::loads::LoadRow;
use crate::app::results::{Fields, Loads, RigidRow};

/// The direction of the pull, and the reference length.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Extension {
    /// The axis along which the body is pulled: 0, 1, 2 for x, y, z.
    pub axis: usize,
    /// The two surfaces, as indices into the surfaces of the table of loads.
    pub surfaces: [usize; 2],
    /// Reference length of the body along the axis, m, if fields are available.
    pub length: Option<f64>,
    /// 1 or -1, so that the elongation is positive if the body becomes longer.
    sign: f64,
}

impl Extension {
    /// Determines the direction of the pull; `None` if the table has no rows, no surface moves relative to another, or a
    /// rigid surface turns, which moves the sides of the body apart without pulling.
    /// The fields, with their pseudo-time, give the length of the body and distinguish pulling from pushing.
    pub fn find(loads: &Loads, fields: Option<(&Fields, f64)>) -> Option<Self> {
        /// A smaller angle, rad, changes lengths by less than half a percent.
        const TURNED: f64 = 0.1;
        /// Mean displacements that differ by less than this, relative to the body, are equal.
        const ROUNDING: f64 = 1e-9;
        let last = loads.rows.last()?;
        let angle = |rigid: &RigidRow| rigid.rotation.iter().map(|r| r * r).sum::<f64>().sqrt();
        if last.rigid.iter().any(|rigid| angle(rigid) > TURNED) {
            return None;
        }
        let mut largest = (0.0, 0, [0, 0]);
        for (b, to) in last.surfaces.iter().enumerate() {
            for (a, from) in last.surfaces.iter().enumerate().take(b) {
                for axis in 0..3 {
                    let apart = to.displacement[axis] - from.displacement[axis];
                    if apart.abs() > f64::abs(largest.0) {
                        largest = (apart, axis, [a, b]);
                    }
                }
            }
        }
        let (apart, axis, surfaces) = largest;
        if apart == 0.0 {
            return None;
        }
        let mut extension = Self { axis, surfaces, length: None, sign: apart.signum() };
        if let Some((fields, time)) = fields {
            let reference = edges(fields.points.iter().copied())[axis];
            if apart.abs() < ROUNDING * reference {
                return None;
            }
            extension.length = Some(reference).filter(|&length| length > 0.0);
            let change = edges(deformed(fields))[axis] - reference;
            let counted = extension.elongation(row_at(loads, time).unwrap_or(last));
            if change * counted < 0.0 {
                extension.sign = -extension.sign;
            }
        }
        Some(extension)
    }

    /// Returns the elongation in a row, m.
    pub fn elongation(&self, row: &LoadRow) -> f64 {
        let [from, to] =
            self.surfaces.map(|surface| row.surfaces.get(surface).map_or(0.0, |s| s.displacement[self.axis]));
        self.sign * (to - from)
    }

    /// Returns the extension in a row (1 for 100 %), or `None` if the reference length of the body is not known.
    pub fn fraction(&self, row: &LoadRow) -> Option<f64> {
        self.length.map(|length| self.elongation(row) / length)
    }
}

/// Returns the row at a pseudo-time; the last one if there are several.
pub(super) fn row_at(loads: &Loads, time: f64) -> Option<&LoadRow> {
    loads.rows.iter().rev().find(|row| (row.t - time).abs() < 1e-12)
}

/// Returns the relative change of the bounding box along its longest reference edge. If other edges are less than a
/// tenth shorter (as in a cube), the one of these edges with the largest change is used. Returns `None` if the bounding
/// box is a point.
pub fn box_extension(fields: &Fields) -> Option<f64> {
    let (reference, current) = (edges(fields.points.iter().copied()), edges(deformed(fields)));
    let longest = reference.into_iter().fold(0.0, f64::max);
    let changes =
        (0..3).filter(|&axis| reference[axis] > 0.9 * longest).map(|axis| current[axis] / reference[axis] - 1.0);
    changes.max_by(|a, b| a.abs().total_cmp(&b.abs()))
}

/// Returns the current positions, or the reference positions if there is no displacement field.
pub(super) fn deformed(fields: &Fields) -> impl Iterator<Item = [f64; 3]> + '_ {
    let displacement = fields.point_vector("displacement").unwrap_or_default();
    fields.points.iter().enumerate().map(move |(k, point)| {
        let moved = displacement.get(k).copied().unwrap_or_default();
        std::array::from_fn(|axis| point[axis] + moved[axis])
    })
}

/// Returns the edge lengths of the bounding box.
fn edges(points: impl Iterator<Item = [f64; 3]>) -> [f64; 3] {
    let (mut low, mut high) = ([f64::INFINITY; 3], [f64::NEG_INFINITY; 3]);
    for point in points {
        for axis in 0..3 {
            low[axis] = low[axis].min(point[axis]);
            high[axis] = high[axis].max(point[axis]);
        }
    }
    std::array::from_fn(|axis| (high[axis] - low[axis]).max(0.0))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::app::results::SurfaceRow;

    fn pulled_in_z(by: f64) -> (Loads, Fields) {
        let surface = |uz| SurfaceRow { displacement: [0.01, 0.0, uz], ..SurfaceRow::default() };
        let row = |t: f64| LoadRow {
            t,
            surfaces: vec![surface(t * by), surface(t * by / 2.0), surface(0.0)],
            ..LoadRow::default()
        };
        let points = vec![[0.0, 0.0, -1.0], [5.0, 0.0, 1.0]];
        let displacement = vec![[0.01, 0.0, 0.0], [0.01, 0.0, by]];
        let fields = Fields { points, point_vectors: vec![("displacement".into(), displacement)], ..Fields::default() };
        (Loads { rows: vec![row(0.5), row(1.0)], ..Loads::default() }, fields)
    }

    #[test]
    fn the_pull_is_along_the_largest_relative_displacement_of_two_surfaces() {
        for by in [0.3, -0.3] {
            let (loads, fields) = pulled_in_z(by);
            let extension = Extension::find(&loads, Some((&fields, 1.0))).unwrap();
            assert_eq!((extension.axis, extension.surfaces, extension.length), (2, [0, 2], Some(2.0)));
            assert!((extension.fraction(&loads.rows[0]).unwrap() - 0.25 * by).abs() < 1e-15, "{by}");
        }
    }

    #[test]
    fn without_displacements_or_data_there_is_no_extension() {
        let (loads, mut fields) = pulled_in_z(0.0);
        assert_eq!(Extension::find(&loads, Some((&fields, 1.0))), None);
        assert_eq!(Extension::find(&Loads::default(), None), None);
        let (mut turned, _) = pulled_in_z(0.3);
        assert!(Extension::find(&turned, None).is_some());
        turned.rows[1].rigid = vec![RigidRow { rotation: [0.0, 0.2, 0.0], ..RigidRow::default() }];
        assert_eq!(Extension::find(&turned, None), None);
        assert_eq!(box_extension(&fields), Some(0.0));
        fields.points = vec![[0.0; 3], [1.0, 0.95, 0.5]];
        fields.point_vectors[0].1 = vec![[0.0; 3], [-0.1, 0.19, 5.0]];
        assert!((box_extension(&fields).unwrap() - 0.2).abs() < 1e-15);
        fields.points = vec![[1.0; 3]; 2];
        assert_eq!(box_extension(&fields), None);
    }
}
