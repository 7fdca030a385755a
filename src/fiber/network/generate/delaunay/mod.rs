//! Delaunay networks: the edges of the Delaunay triangulation of random points, cut at the faces of the cube.

use glam::DVec3;
use meshless_voronoi::{Dimensionality, Voronoi};
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{RngCore, SeedableRng};

use super::GenerateError;
use crate::fiber::network::proximity::Proximity;
use crate::fiber::network::{Cube, Network};

/// The most points inside the cube: some gigabytes for the triangulation.
const MOST_POINTS: usize = 1_000_000;
/// Thickness of the layer of points around the cube, in mean spacings. Points further off would change an edge only
/// if a ball through its ends reached across the whole layer and were empty: one such ball in some thousand networks.
const MARGIN: f64 = 2.5;
/// Attempts a point on average before the distance to be kept is found to leave no room.
const ATTEMPTS: usize = 1000;

/// What to generate.
///
/// Points are placed at random, uniformly: `points` in the unit cube and as densely in a layer around it. The fibers
/// are the Delaunay edges with at least one end in the cube. An edge that leaves the cube is cut at the face, where a
/// boundary node is put: so a boundary node has one fiber, and all nodes that are not cuts are interior. An edge that
/// passes through a corner of the cube with both ends outside is dropped: tied to nothing, it would only follow its
/// ends. As in the networks published for this family of models.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Delaunay {
    /// Points in the unit cube, which is how many interior nodes there will be.
    pub points: usize,
    /// The seed of the random numbers (ChaCha with 8 rounds).
    pub seed: u64,
    /// The least distance between two points and between a point and a face of the cube, over the mean spacing
    /// `points^(-1/3)`. No fiber is shorter, so none is out of proportion stiff. From 0 to about 0.5. Of twelve
    /// networks of 60 points stretched to 1.8 at constant volume, some snapped through on the way at 0.05, none at 0.1
    /// or more.
    pub shortest: f64,
}

impl Delaunay {
    /// So many points in the cube, kept a fifth of the mean spacing apart.
    #[must_use]
    pub fn new(points: usize, seed: u64) -> Self {
        Self { points, seed, shortest: 0.2 }
    }

    /// Generates the network, called `delaunay-POINTS-SEED`. The same parameters give the same network on every
    /// machine, bit for bit, and however many threads there are.
    ///
    /// # Errors
    /// See [`GenerateError`]; with a handful of points a face may stay without fibers.
    pub fn generate(&self) -> Result<Network, GenerateError> {
        if !(1..=MOST_POINTS).contains(&self.points) {
            return Err(GenerateError::Points { points: self.points, most: MOST_POINTS });
        }
        let cloud = self.place_points()?;
        let (nodes, fibers) = clip(&cloud, self.points);
        for (k, axis) in ['x', 'y', 'z'].into_iter().enumerate() {
            for side in [-0.5, 0.5] {
                if !nodes.iter().any(|node| node[k] == side) {
                    return Err(GenerateError::OpenFace { axis, side });
                }
            }
        }
        Ok(Network::in_cube(format!("delaunay-{}-{}", self.points, self.seed), Cube::UNIT, nodes, fibers)?)
    }

    /// The points in the cube first, then those of the layer around it.
    fn place_points(&self) -> Result<Vec<[f64; 3]>, GenerateError> {
        let spacing = (self.points as f64).cbrt().recip();
        let apart = self.shortest * spacing;
        let half = 0.5 + MARGIN * spacing; // of the edge of cube and layer
        let around = self.points as f64 * ((2.0 * half).powi(3) - 1.0);
        let total = self.points + around.round() as usize;
        let mut random = ChaCha8Rng::seed_from_u64(self.seed);
        let mut placed = Vec::with_capacity(total);
        // A positive radius is needed even where no distance is asked for: two points at one place are no triangulation.
        let mut taken = Proximity::new(apart.max(1e-9));
        let mut attempts = 0;
        while placed.len() < total {
            let inside = placed.len() < self.points;
            let reach = if inside { 0.5 } else { half };
            let point = [(); 3].map(|()| reach * (2.0 * uniform(&mut random) - 1.0));
            attempts += 1;
            if attempts > ATTEMPTS * total {
                let (placed, points) = (placed.len(), total);
                return Err(GenerateError::NoRoom { placed, points, shortest: self.shortest });
            }
            let outermost = point.iter().fold(0.0, |m: f64, x| m.max(x.abs()));
            let in_its_part = if inside { outermost < 0.5 - apart } else { outermost > 0.5 };
            let off_the_faces = inside || distance_to_cube(point) >= apart;
            if in_its_part && off_the_faces && taken.near(point).is_none() {
                taken.insert(placed.len(), point);
                placed.push(point);
            }
        }
        Ok(placed)
    }
}

/// A Delaunay network with `points` interior nodes; see [`Delaunay`].
///
/// # Errors
/// As for [`Delaunay::generate`].
///
/// ```
/// let network = biotissue::fiber::network::generate::delaunay(20, 1)?;
/// assert_eq!(network.interior().len(), 20);
/// # Ok::<(), biotissue::fiber::network::generate::GenerateError>(())
/// ```
pub fn delaunay(points: usize, seed: u64) -> Result<Network, GenerateError> {
    Delaunay::new(points, seed).generate()
}

/// The Delaunay network of this seed whose number of nodes, boundary included, comes closest to `nodes` (fewer points
/// where two are as close). The number of points is sought by bisection.
///
/// # Errors
/// [`GenerateError::Nodes`] for less than 40 or more than 100 000 nodes; otherwise as for [`Delaunay::generate`].
pub fn delaunay_of_nodes(nodes: usize, seed: u64) -> Result<Network, GenerateError> {
    const FEWEST: usize = 40;
    const MOST: usize = 100_000;
    if !(FEWEST..=MOST).contains(&nodes) {
        return Err(GenerateError::Nodes { nodes, fewest: FEWEST, most: MOST });
    }
    // Nodes grow with points, but not at every step: bisection finds a crossing, and its neighbours are tried too.
    let (mut fewer, mut more) = (1, nodes);
    while more - fewer > 1 {
        let middle = fewer + (more - fewer) / 2;
        if delaunay(middle, seed)?.nodes().len() < nodes { fewer = middle } else { more = middle }
    }
    let mut best: Option<Network> = None;
    for points in fewer.saturating_sub(2).max(1)..=fewer + 3 {
        let network = delaunay(points, seed)?;
        let off = network.nodes().len().abs_diff(nodes);
        if best.as_ref().is_none_or(|best| off < best.nodes().len().abs_diff(nodes)) {
            best = Some(network);
        }
    }
    best.ok_or(GenerateError::Nodes { nodes, fewest: FEWEST, most: MOST })
}

/// Uniform in `[0, 1)` from the upper 53 bits, spelled out so that no release of a library can change the networks.
fn uniform(random: &mut ChaCha8Rng) -> f64 {
    (random.next_u64() >> 11) as f64 / (1u64 << 53) as f64
}

/// Distance of an outer point to the unit cube.
fn distance_to_cube(point: [f64; 3]) -> f64 {
    let [x, y, z] = point.map(|x| (x.abs() - 0.5).max(0.0));
    (x * x + y * y + z * z).sqrt()
}

/// The Delaunay edges of the cloud that have an end among its first `inner` points, ascending: two points are joined
/// where their Voronoi cells share a face.
fn edges(cloud: &[[f64; 3]], inner: usize) -> Vec<[usize; 2]> {
    let generators: Vec<DVec3> = cloud.iter().map(|&point| DVec3::from_array(point)).collect();
    let reach = cloud.iter().flatten().fold(0.5, |m: f64, x| m.max(x.abs()));
    // Walls so far off that they cut no cell of an inner point.
    let wall = 10.0 * reach;
    let mask: Vec<bool> = (0..cloud.len()).map(|point| point < inner).collect();
    let cells = Voronoi::build_partial(
        &generators,
        &mask,
        DVec3::splat(-wall),
        DVec3::splat(2.0 * wall),
        Dimensionality::ThreeD,
        false,
    );
    let mut edges: Vec<[usize; 2]> = cells
        .faces()
        .iter()
        .filter_map(|face| face.right().map(|right| [face.left().min(right), face.left().max(right)]))
        .collect();
    edges.sort_unstable();
    edges.dedup();
    edges
}

/// Nodes and fibers of the edges, cut at the faces of the unit cube; the first `inner` points lie inside.
fn clip(cloud: &[[f64; 3]], inner: usize) -> (Vec<[f64; 3]>, Vec<[u32; 2]>) {
    let mut nodes: Vec<[f64; 3]> = cloud[..inner].to_vec();
    let mut fibers = Vec::new();
    for [a, b] in edges(cloud, inner) {
        let end = if b < inner {
            b
        } else {
            nodes.push(crossing(cloud[a], cloud[b]));
            nodes.len() - 1
        };
        fibers.push([a as u32, end as u32]);
    }
    (nodes, fibers)
}

/// Where the segment from a point inside to one outside leaves the unit cube; exactly on the face.
fn crossing(inside: [f64; 3], outside: [f64; 3]) -> [f64; 3] {
    let mut first = (f64::INFINITY, 0, 0.5);
    for k in 0..3 {
        if outside[k].abs() > 0.5 {
            let face = 0.5f64.copysign(outside[k]);
            let t = (face - inside[k]) / (outside[k] - inside[k]);
            if t < first.0 {
                first = (t, k, face);
            }
        }
    }
    let (t, axis, face) = first;
    let mut point = [0, 1, 2].map(|k| (inside[k] + t * (outside[k] - inside[k])).clamp(-0.5, 0.5));
    point[axis] = face;
    point
}

#[cfg(test)]
mod tests;
