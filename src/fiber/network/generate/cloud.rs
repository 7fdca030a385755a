//! Random points for the construction of networks: uniform in the cube and in a layer around it.

use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{RngCore, SeedableRng};

use super::alignment::Stretch;
use super::portable::cbrt;
use super::{GenerateError, GeneratorParams};
use crate::fiber::network::proximity::Proximity;

/// Thickness of the layer of points around the cube, in mean spacings. Points beyond the layer would change an edge of
/// a Delaunay network only if an empty ball through the ends of the edge reached across the whole layer, which happens
/// in about one of a thousand networks. To change a Voronoi vertex in the cube, the ball would need twice that radius,
/// which practically never happens.
pub(super) const MARGIN: f64 = 2.5;
/// Average number of attempts per point after which the minimum distance is reported as too large.
const ATTEMPTS: usize = 1000;

/// The points, those in the cube first, and the stretch to the space in which they are isotropic.
#[derive(Debug)]
pub(super) struct Cloud {
    /// Positions in the isotropic space.
    pub(super) points: Vec<[f64; 3]>,
    /// Positions in the space of the cube.
    pub(super) places: Vec<[f64; 3]>,
    /// Number of points in the cube.
    pub(super) inner: usize,
    /// The mean spacing `inner^(-1/3)`, the same in both spaces.
    pub(super) spacing: f64,
    pub(super) stretch: Stretch,
}

impl Cloud {
    /// Places `points` points in the cube and points of the same density in the layer, whose thickness is that of the
    /// stretched image of a ball of [`MARGIN`] spacings.
    pub(super) fn place(params: &GeneratorParams, points: usize) -> Result<Self, GenerateError> {
        let spacing = cbrt(points as f64).recip();
        let min_distance = params.min_distance * spacing;
        let stretch = Stretch::of(params.alignment.as_ref());
        let reach = stretch.reach();
        let half = reach.map(|reach| 0.5 + MARGIN * spacing * reach); // half edges of cube and layer
        let around = points as f64 * ((2.0 * half[0]) * (2.0 * half[1]) * (2.0 * half[2]) - 1.0);
        let total = points + around.round() as usize;
        // Distances across the axis of alignment shrink, so that nodes may be closer to a face.
        let gap = reach.map(|reach| min_distance * reach.min(1.0));
        let mut random = ChaCha8Rng::seed_from_u64(params.seed);
        let mut cloud = Self { points: Vec::new(), places: Vec::new(), inner: points, spacing, stretch };
        // A positive radius is needed even for `min_distance = 0`: two points at the same position cannot be
        // triangulated.
        let mut taken = Proximity::new(min_distance.max(1e-9));
        let mut attempts = 0;
        while cloud.places.len() < total {
            let inside = cloud.places.len() < points;
            let place = [0, 1, 2].map(|k| {
                let half = if inside { 0.5 } else { half[k] };
                half * (2.0 * uniform(&mut random) - 1.0)
            });
            attempts += 1;
            if attempts > ATTEMPTS * total {
                let (placed, points) = (cloud.places.len(), total);
                return Err(GenerateError::NoRoom { placed, points, min_distance: params.min_distance });
            }
            let in_its_part = if inside {
                (0..3).all(|k| place[k].abs() < 0.5 - gap[k])
            } else {
                place.iter().any(|x| x.abs() > 0.5) && distance_to_cube(place, reach) >= min_distance
            };
            let point = stretch.to_isotropic(place);
            if in_its_part && taken.near(point).is_none() {
                taken.insert(cloud.places.len(), point);
                cloud.places.push(place);
                cloud.points.push(point);
            }
        }
        Ok(cloud)
    }

    /// Returns a lower bound of the distance of a point to the cube, measured in the isotropic space, in mean spacings:
    /// the largest distance from the planes of the faces that the point lies outside of; 0 in the cube.
    pub(super) fn outside(&self, point: usize) -> f64 {
        let (place, reach) = (self.places[point], self.stretch.reach());
        (0..3).map(|k| (place[k].abs() - 0.5) / (reach[k] * self.spacing)).fold(0.0, f64::max)
    }
}

/// Returns a uniform random number in `[0, 1)` from the upper 53 bits; implemented here so that no library release can
/// change the networks.
pub(super) fn uniform(random: &mut ChaCha8Rng) -> f64 {
    (random.next_u64() >> 11) as f64 / (1u64 << 53) as f64
}

/// Returns the distance of an outer point to the unit cube, with each axis in units of its reach.
fn distance_to_cube(point: [f64; 3], reach: [f64; 3]) -> f64 {
    let [x, y, z] = [0, 1, 2].map(|k| (point[k].abs() - 0.5).max(0.0) / reach[k]);
    (x * x + y * y + z * z).sqrt()
}
