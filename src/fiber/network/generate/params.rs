//! The parameters of the generator, and the generation.

use super::alignment::Alignment;
use super::cloud::Cloud;
use super::{GenerateError, delaunay, voronoi};
use crate::fiber::network::check::{Removed, clean};
use crate::fiber::network::{Cube, Network};

/// Maximum number of points inside the cube, for which the triangulation takes some gigabytes.
pub(super) const MAX_POINTS: usize = 1_000_000;

/// The construction of a network from points.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// The points are the nodes; the fibers are the edges of their Delaunay triangulation, about 15 per node. Such a
    /// network is rigid.
    Delaunay,
    /// The nodes are the vertices of the points' Voronoi cells, about 6.7 per point; the fibers are the edges of the
    /// cells, 4 per node (more where nodes were merged), as in collagen gels. Such a network is floppy: at rest it has
    /// zero modes, and it stiffens when stretched.
    Voronoi,
}

impl Kind {
    /// All kinds.
    pub const ALL: [Self; 2] = [Self::Delaunay, Self::Voronoi];

    /// Returns the name in files and on the command line.
    pub fn name(self) -> &'static str {
        match self {
            Self::Delaunay => "delaunay",
            Self::Voronoi => "voronoi",
        }
    }

    /// Returns the default of [`GeneratorParams::merge_length`]: 0 for Delaunay networks, whose minimum distance of the
    /// points makes merging unnecessary, and 0.05 for Voronoi networks.
    ///
    /// Of the 42 623 fibers of a Voronoi network of 3000 points, the shortest is 53 000 times shorter than the mean,
    /// and stiffer by that factor. Merging at 0.05 removes 11 % of the fibers; the factor is then 9 (6 in Delaunay
    /// networks), and 4.2 fibers instead of 4 meet at a node. In three networks of 60 points, it reduces the stress at
    /// a stretch of 1.8 by 0.4 to 1.4 %, and Newton's method to a stretch of 1.05 takes on average 28 instead of 42
    /// iterations. At 0.1, stresses would be up to 6 % lower, with 4.4 fibers per node.
    pub fn default_merge_length(self) -> f64 {
        match self {
            Self::Delaunay => 0.0,
            Self::Voronoi => 0.05,
        }
    }
}

/// The parameters of a generated network.
///
/// Points are placed at random, uniformly: the given number in the unit cube, and with the same density in a layer
/// around it. They define a network that extends beyond the cube and is cut at its faces: an edge that leaves the cube
/// ends at the face, in a boundary node. A boundary node therefore has one fiber (unless nodes are merged into it), and
/// all other nodes are interior. An edge that passes through a corner of the cube with both ends outside is dropped: it
/// would only deform affinely. The published networks of this family of models are generated in the same way.
///
/// The same parameters give bitwise the same network on every machine and with any number of threads.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GeneratorParams {
    /// The construction of the network from points.
    pub kind: Kind,
    /// The seed of the random numbers.
    pub seed: u64,
    /// The minimum distance between two points and between a point and a face of the cube, relative to the mean spacing
    /// `points^(-1/3)`; from 0 to about 0.5. It bounds the fiber lengths of a Delaunay network from below, and so the
    /// fiber stiffness from above. Of twelve Delaunay networks of 60 points stretched to 1.8 at constant volume, some
    /// snapped through before the full stretch with a minimum distance of 0.05, none with 0.1 or more. In an aligned
    /// network, distances are measured before the stretch.
    pub min_distance: f64,
    /// Nodes joined by a fiber shorter than this fraction of the mean spacing of the points are merged; from 0 (no
    /// merging) to below 1. In an aligned network, lengths are measured before the stretch. Values above 0.5 leave only
    /// few fibers.
    pub merge_length: f64,
    /// The preferred direction of the fibers. The strength is that of the network that extends beyond the cube; fibers
    /// along the axis are cut at the faces more often, so that the order parameter of a network of few points,
    /// with equal weights, exceeds the strength by some hundredths.
    pub alignment: Option<Alignment>,
    /// Fibers shorter than this fraction of the cube's edge are removed, together with fibers that dangle or lose their
    /// connection to the boundary as a result.
    pub min_length: Option<f64>,
}

/// A generated network.
#[derive(Clone, Debug, PartialEq)]
pub struct GeneratedNetwork {
    /// The network, with the name `KIND-POINTS-SEED`.
    pub network: Network,
    /// Number of points in the cube.
    pub points: usize,
    /// The counts of fibers and nodes that were removed because they were short, dangling or not connected to the
    /// boundary.
    pub removed: Removed,
}

impl GeneratorParams {
    /// Creates the default parameters of a kind of network: isotropic, with a minimum distance of a fifth of the mean
    /// spacing.
    pub fn new(kind: Kind, seed: u64) -> Self {
        Self {
            kind,
            seed,
            min_distance: 0.2,
            merge_length: kind.default_merge_length(),
            alignment: None,
            min_length: None,
        }
    }

    /// Generates the network with this number of points in the cube.
    ///
    /// # Errors
    /// Returns [`GenerateError`] if a parameter is out of range, the points do not fit, or the network is invalid; with
    /// very few points a face may have no fibers.
    pub fn of_points(&self, points: usize) -> Result<GeneratedNetwork, GenerateError> {
        if !(1..=MAX_POINTS).contains(&points) {
            return Err(GenerateError::Points { points, most: MAX_POINTS });
        }
        if !(0.0..1.0).contains(&self.merge_length) {
            return Err(GenerateError::Merge(self.merge_length));
        }
        let cloud = Cloud::place(self, points)?;
        let graph = match self.kind {
            Kind::Delaunay => delaunay::graph(&cloud),
            Kind::Voronoi => voronoi::graph(&cloud),
        };
        let clipped = graph.clip().merge_short_fibers(self.merge_length * cloud.spacing, cloud.stretch);
        // The faces are checked first, because the construction of a network with an open face may fail.
        check_faces(&clipped.nodes, &clipped.fibers)?;
        let name = format!("{}-{points}-{}", self.kind.name(), self.seed);
        let network = Network::in_cube(name, Cube::UNIT, clipped.nodes, clipped.fibers)?;
        let cleaned = clean(&network, self.min_length)?;
        let network = if cleaned.removed.is_nothing() { network } else { cleaned.network };
        check_faces(network.nodes(), network.fibers())?;
        Ok(GeneratedNetwork { network, points, removed: cleaned.removed })
    }
}

/// Checks that fibers reach every face, so that the network fills its cube.
fn check_faces(nodes: &[[f64; 3]], fibers: &[[u32; 2]]) -> Result<(), GenerateError> {
    for (k, axis) in ['x', 'y', 'z'].into_iter().enumerate() {
        for side in [-0.5, 0.5] {
            if !fibers.iter().flatten().any(|&node| nodes[node as usize][k] == side) {
                return Err(GenerateError::OpenFace { axis, side });
            }
        }
    }
    Ok(())
}
