//! The extension of a pulled body, or the shear of a sheared one: one number per load step, from the displacements of its
//! surfaces.
//!
//! The direction of the load is the axis and the two surfaces with boundary conditions whose mean displacements differ most
//! in the last row of `loads.csv`. If the centers of these surfaces are farthest apart along the same axis, the body is pulled
//! or pushed: the extension is the difference of the displacements over the distance of the centers along the axis, positive if
//! the surfaces move apart. For a bar held and pulled at its ends this is the engineering strain. Otherwise the body is sheared:
//! the shear is the difference over the distance along the axis on which the centers are farthest apart, `du_y / dx` for
//! example.
//!
//! Results without the centers of surfaces give the edge of the bounding box along the axis as length, and the sign from
//! its change. Without surfaces that move, and if a rigid surface turns, the change of the bounding box along its longest
//! edge is used instead.

use crate::app::results::loads::LoadRow;
use crate::app::results::log::SurfacePlace;
use crate::app::results::{Fields, Loads, RigidRow};

/// Mean displacements that differ by less than this, relative to the reference length, are equal.
const ROUNDING: f64 = 1e-9;

/// What a load does to the body as a whole.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// It moves two surfaces apart, or towards each other.
    Pull,
    /// It moves two surfaces past each other.
    Shear,
}

/// The direction of the load, and the reference length.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Extension {
    /// Whether the body is pulled or sheared.
    pub kind: Kind,
    /// The axis along which the surfaces move: 0, 1, 2 for x, y, z.
    pub axis: usize,
    /// The axis of the reference length: that along which the surfaces are farthest apart.
    pub over: usize,
    /// The two surfaces, as indices into the surfaces of the table of loads.
    pub surfaces: [usize; 2],
    /// Reference length, m: the distance of the centers of the surfaces, or the length of the body. `None` if neither is
    /// known.
    pub length: Option<f64>,
    /// 1 or -1, so that the elongation is positive if the surfaces move apart, and a shear if the surface that is farther
    /// along the other axis moves farther along this one.
    sign: f64,
}

impl Extension {
    /// Determines the direction of the load; `None` if the table has no rows, no surface moves relative to another, or a
    /// rigid surface turns, which moves the sides of the body apart without pulling.
    /// `places` are those of the surfaces with conditions; without any, all surfaces count, and the fields, with their
    /// pseudo-time, give the length of the body and distinguish pulling from pushing.
    pub fn find(loads: &Loads, places: &[SurfacePlace], fields: Option<(&Fields, f64)>) -> Option<Self> {
        /// A smaller angle, rad, changes lengths by less than half a percent.
        const TURNED: f64 = 0.1;
        let last = loads.rows.last()?;
        let angle = |rigid: &RigidRow| rigid.rotation.iter().map(|r| r * r).sum::<f64>().sqrt();
        if last.rigid.iter().any(|rigid| angle(rigid) > TURNED) {
            return None;
        }
        let counts = |surface: usize| {
            let name = loads.names.surfaces.get(surface);
            places.is_empty() || places.iter().any(|place| Some(&place.name) == name)
        };
        let surfaces = || last.surfaces.iter().enumerate().filter(|(surface, _)| counts(*surface));
        let mut largest = (0.0, 0, [0, 0]);
        for (b, to) in surfaces() {
            for (a, from) in surfaces().take_while(|(a, _)| *a < b) {
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
        let moved = Self { kind: Kind::Pull, axis, over: axis, surfaces, length: None, sign: apart.signum() };
        let found = match moved.between_centers(loads, places) {
            Some(between) => moved.of_surfaces(between),
            None => match fields {
                Some((fields, time)) => moved.of_body(fields, row_at(loads, time).unwrap_or(last)),
                None => moved,
            },
        };
        Some(found).filter(|found| found.length.is_none_or(|length| apart.abs() >= ROUNDING * length))
    }

    /// Returns the vector from the center of the first surface to that of the second one, m, if it is known and not zero.
    fn between_centers(&self, loads: &Loads, places: &[SurfacePlace]) -> Option<[f64; 3]> {
        let center = |surface: usize| {
            let name = loads.names.surfaces.get(surface)?;
            places.iter().find(|place| place.name == *name).map(|place| place.center)
        };
        let [from, to] = [center(self.surfaces[0])?, center(self.surfaces[1])?];
        let between: [f64; 3] = std::array::from_fn(|axis| to[axis] - from[axis]);
        between.iter().any(|&distance| distance != 0.0).then_some(between)
    }

    /// Determines the kind and the length, given the vector between the centers of the surfaces, m.
    fn of_surfaces(self, between: [f64; 3]) -> Self {
        // Of axes with equal distances, that of the displacements, and otherwise the first.
        let order = [self.axis, 0, 1, 2];
        let farther = |over: usize, axis: usize| if between[axis].abs() > between[over].abs() { axis } else { over };
        let over = order.into_iter().fold(self.axis, farther);
        let kind = if over == self.axis { Kind::Pull } else { Kind::Shear };
        Self { kind, over, length: Some(between[over].abs()), sign: between[over].signum(), ..self }
    }

    /// Determines the length and the sign from the bounding box of the body in the state of a row.
    fn of_body(self, fields: &Fields, row: &LoadRow) -> Self {
        let reference = edges(fields.points.iter().copied())[self.axis];
        let change = edges(deformed(fields))[self.axis] - reference;
        let sign = if change * self.elongation(row) < 0.0 { -self.sign } else { self.sign };
        Self { length: Some(reference).filter(|&length| length > 0.0), sign, ..self }
    }

    /// Returns the elongation, or the displacement of one surface past the other, in a row, m.
    pub fn elongation(&self, row: &LoadRow) -> f64 {
        let [from, to] =
            self.surfaces.map(|surface| row.surfaces.get(surface).map_or(0.0, |s| s.displacement[self.axis]));
        self.sign * (to - from)
    }

    /// Returns the extension or shear in a row (1 for 100 %), or `None` if the reference length of the body is not known.
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
            let extension = Extension::find(&loads, &[], Some((&fields, 1.0))).unwrap();
            assert_eq!((extension.axis, extension.surfaces, extension.length), (2, [0, 2], Some(2.0)));
            assert!((extension.fraction(&loads.rows[0]).unwrap() - 0.25 * by).abs() < 1e-15, "{by}");
        }
    }

    /// The same displacements along z are a pull between surfaces one above the other, and a shear between surfaces beside each
    /// other, with the sign of the surface that is farther along the other axis.
    #[test]
    fn surfaces_beside_each_other_shear_the_body() {
        let place = |name: &str, center| SurfacePlace { name: name.into(), center };
        for by in [0.3, -0.3] {
            let (mut loads, fields) = pulled_in_z(by);
            loads.names.surfaces = ["a", "b", "c"].map(str::to_owned).to_vec();
            for (center, kind, expected) in [
                ([0.5, 0.0, 1.5], Kind::Pull, by / 1.5),
                ([0.5, 0.0, -1.5], Kind::Pull, -by / 1.5),
                ([3.0, 4.0, 1.5], Kind::Shear, by / 4.0),
                ([-5.0, 4.0, 1.5], Kind::Shear, -by / 5.0),
            ] {
                let places = [place("c", [0.0; 3]), place("b", [9.0; 3]), place("a", center)];
                let extension = Extension::find(&loads, &places, Some((&fields, 1.0))).unwrap();
                assert_eq!((extension.kind, extension.axis, extension.surfaces), (kind, 2, [0, 2]));
                assert!((extension.fraction(&loads.rows[1]).unwrap() - expected).abs() < 1e-15, "{by} {center:?}");
            }
            let places = [place("b", [0.0, 0.0, 1.0]), place("c", [0.0; 3])];
            let extension = Extension::find(&loads, &places, Some((&fields, 1.0))).unwrap();
            assert_eq!((extension.surfaces, extension.length), ([1, 2], Some(1.0)), "a has no condition");
            let places = [place("a", [0.0; 3]), place("c", [0.0; 3])];
            let extension = Extension::find(&loads, &places, Some((&fields, 1.0))).unwrap();
            assert_eq!(extension.length, Some(2.0), "surfaces of the same center: that of the body");
        }
    }

    #[test]
    fn without_displacements_or_data_there_is_no_extension() {
        let (loads, mut fields) = pulled_in_z(0.0);
        assert_eq!(Extension::find(&loads, &[], Some((&fields, 1.0))), None);
        assert_eq!(Extension::find(&Loads::default(), &[], None), None);
        let (mut turned, _) = pulled_in_z(0.3);
        assert!(Extension::find(&turned, &[], None).is_some());
        turned.rows[1].rigid = vec![RigidRow { rotation: [0.0, 0.2, 0.0], ..RigidRow::default() }];
        assert_eq!(Extension::find(&turned, &[], None), None);
        assert_eq!(box_extension(&fields), Some(0.0));
        fields.points = vec![[0.0; 3], [1.0, 0.95, 0.5]];
        fields.point_vectors[0].1 = vec![[0.0; 3], [-0.1, 0.19, 5.0]];
        assert!((box_extension(&fields).unwrap() - 0.2).abs() < 1e-15);
        fields.points = vec![[1.0; 3]; 2];
        assert_eq!(box_extension(&fields), None);
    }
}
