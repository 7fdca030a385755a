//! The viewpoint: an orthographic view of the body, with its longest axis across the page, from slightly above.

use nalgebra::Vector3;

/// Elevation angle of the viewpoint, radians.
const ELEVATION: f64 = 0.46;

/// Returns the azimuth of the viewpoint (the rotation of the body about the vertical axis of the page), radians. The
/// azimuth decreases with the slenderness; otherwise a long body would appear steeply inclined on the page.
fn azimuth(longest: f64, second: f64) -> f64 {
    let slenderness = if second > 0.0 { (longest / second).max(1.0) } else { 1.0 };
    0.06 + 0.45 / slenderness
}

/// The axes of the page as directions in space.
#[derive(Clone, Copy, Debug)]
pub(in crate::app::report) struct View {
    /// To the right.
    pub(in crate::app::report) right: Vector3<f64>,
    /// Up.
    pub(in crate::app::report) up: Vector3<f64>,
    /// Out of the page, toward the viewer.
    pub(in crate::app::report) toward: Vector3<f64>,
}

impl View {
    /// Returns the view for a body with a bounding box of these edges: the longest edge lies across the page, and the
    /// viewer looks along `axis` (0, 1, 2) if given, otherwise along the shortest edge. A direction `toward` the viewer,
    /// if given, replaces both: z points up the page, or y if the viewer looks along z.
    pub(in crate::app::report) fn of(edges: Vector3<f64>, axis: Option<usize>, toward: Option<[f64; 3]>) -> Self {
        if let Some(toward) = toward.and_then(|toward| Vector3::from(toward).try_normalize(0.0)) {
            return Self::from_direction(toward);
        }
        // Edges that differ by less than a tenth count as equal, so that a pulled cube keeps its view.
        let mut order = [0, 1, 2];
        order.sort_by(|&a, &b| {
            let (a, b) = (edges[a], edges[b]);
            if (a - b).abs() <= 0.1 * a.max(b) { std::cmp::Ordering::Equal } else { b.total_cmp(&a) }
        });
        if let Some(axis) = axis {
            order.sort_by_key(|&other| other == axis);
        }
        let unit = |axis: usize| Vector3::from_fn(|k, _| if k == axis { 1.0 } else { 0.0 });
        let (across, upward) = (unit(order[0]), unit(order[1]));
        let outward = across.cross(&upward);
        let (sin, cos) = azimuth(edges[order[0]], edges[order[1]]).sin_cos();
        let right = across * cos - outward * sin;
        let level = across * sin + outward * cos;
        let (sin, cos) = ELEVATION.sin_cos();
        let toward = level * cos + upward * sin;
        Self { right, up: toward.cross(&right), toward }
    }

    fn from_direction(toward: Vector3<f64>) -> Self {
        let vertical = if toward.z.abs() > 0.99 { Vector3::y() } else { Vector3::z() };
        let right = vertical.cross(&toward).normalize();
        Self { right, up: toward.cross(&right), toward }
    }

    /// Returns the coordinates of a point on the page (right, up) and its depth (toward the viewer).
    pub(in crate::app::report) fn project(&self, point: &Vector3<f64>) -> [f64; 3] {
        [self.right.dot(point), self.up.dot(point), self.toward.dot(point)]
    }

    /// Returns the brightness of a face with this normal, at most 1. The light comes from the front, so that the broad
    /// side keeps the colors of the color bar.
    pub(in crate::app::report) fn light(&self, normal: &Vector3<f64>) -> f64 {
        let source = (self.toward * 0.9 - self.up * 0.3).normalize();
        let cosine = normal.try_normalize(0.0).map_or(1.0, |normal| normal.dot(&source).max(0.0));
        0.82 + 0.18 * cosine
    }
}

/// The map from projected coordinates to the page: meters to pixels, with y downward.
#[derive(Clone, Copy, Debug, Default)]
pub(in crate::app::report) struct Frame {
    /// Pixels per meter.
    pub(in crate::app::report) scale: f64,
    /// Part of the width of the rectangle that the points do not use, pixels.
    pub(in crate::app::report) unused_width: f64,
    /// Part of the height of the rectangle that the points do not use, pixels.
    pub(in crate::app::report) unused_height: f64,
    offset: [f64; 2],
}

impl Frame {
    /// Fits projected points into a rectangle (left, top, width, height), centered.
    pub(in crate::app::report) fn fit(
        points: impl Iterator<Item = [f64; 3]>,
        [left, top, width, height]: [f64; 4],
    ) -> Self {
        let (mut low, mut high) = ([f64::INFINITY; 2], [f64::NEG_INFINITY; 2]);
        for point in points {
            for k in 0..2 {
                low[k] = low[k].min(point[k]);
                high[k] = high[k].max(point[k]);
            }
        }
        let span = [high[0] - low[0], high[1] - low[1]];
        let scale = (width / span[0]).min(height / span[1]);
        let scale = if scale.is_finite() && scale > 0.0 { scale } else { 1.0 };
        let middle = [(low[0] + high[0]) / 2.0, (low[1] + high[1]) / 2.0];
        let offset = [left + width / 2.0 - scale * middle[0], top + height / 2.0 + scale * middle[1]];
        let unused = |room: f64, span: f64| (room - scale * span).max(0.0);
        Self { scale, unused_width: unused(width, span[0]), unused_height: unused(height, span[1]), offset }
    }

    /// Returns the pixel coordinates of a projected point.
    pub(in crate::app::report) fn page_position(&self, [across, up, _]: [f64; 3]) -> [f64; 2] {
        [self.offset[0] + self.scale * across, self.offset[1] - self.scale * up]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_page_is_right_handed_and_the_longest_edge_lies_across() {
        for (edges, axis) in [([5.0, 1.0, 0.2], None), ([0.2, 1.0, 5.0], None), ([1.0, 1.0, 1.0], Some(1))] {
            let view = View::of(edges.into(), axis, None);
            assert!((view.right.cross(&view.up) - view.toward).norm() < 1e-15);
            let longest = (0..3).max_by(|&a, &b| f64::total_cmp(&edges[a], &edges[b])).unwrap();
            if axis.is_none() {
                assert!(view.right[longest] > 0.9);
            }
            assert!(view.up.iter().any(|&part| part > 0.75) && view.toward.iter().any(|part| part.abs() > 0.75));
        }
    }

    #[test]
    fn a_direction_chooses_the_view() {
        let view = View::of([5.0, 1.0, 0.2].into(), Some(2), Some([2.0, 0.0, 0.0]));
        let expected = [Vector3::y(), Vector3::z(), Vector3::x()];
        assert!([view.right, view.up, view.toward].iter().zip(expected).all(|(a, b)| (a - b).norm() < 1e-15));
        let above = View::of([1.0; 3].into(), None, Some([0.0, 0.0, 3.0]));
        assert!((above.up - Vector3::y()).norm() < 1e-15 && (above.right - Vector3::x()).norm() < 1e-15);
    }

    #[test]
    fn a_frame_contains_all_points() {
        let points = [[-2.0, 0.0, 9.0], [3.0, 1.0, -9.0], [0.0, 7.0, 0.0]];
        let frame = Frame::fit(points.into_iter(), [10.0, 20.0, 100.0, 50.0]);
        assert!(frame.unused_height < 1e-9);
        for [x, y] in points.map(|point| frame.page_position(point)) {
            assert!((10.0..=110.0).contains(&x) && (20.0 - 1e-9..=70.0 + 1e-9).contains(&y));
        }
        let flat = Frame::fit([[1.0; 3]].into_iter(), [0.0, 0.0, 10.0, 10.0]);
        assert_eq!((flat.page_position([1.0; 3]), flat.unused_height), ([5.0, 5.0], 10.0));
    }
}
