//! What to generate, and from it the network.

use super::alignment::Alignment;
use super::cloud::Cloud;
use super::{GenerateError, delaunay, voronoi};
use crate::fiber::network::check::{Removed, clean};
use crate::fiber::network::{Cube, Network};

/// The most points inside the cube: some gigabytes for the triangulation.
pub(super) const MOST_POINTS: usize = 1_000_000;

/// How points become a network.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// The points are the nodes; the fibers are the edges of their Delaunay triangulation, some 15 at a node. Such a
    /// network is rigid.
    Delaunay,
    /// The nodes are the vertices of the points' Voronoi cells, some 6.7 a point; the fibers are the edges of the cells,
    /// 4 at a node (more where nodes were merged), as in collagen gels. Such a network is floppy: at rest it does not
    /// resist every motion of its nodes, and stiffens when it is stretched.
    Voronoi,
}

impl Kind {
    /// All kinds.
    pub const ALL: [Self; 2] = [Self::Delaunay, Self::Voronoi];

    /// The name in files and on the command line.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Delaunay => "delaunay",
            Self::Voronoi => "voronoi",
        }
    }

    /// What [`Recipe::merge`] is where nothing else is asked for: 0 for Delaunay networks, whose points are kept apart so
    /// that nothing needs merging, and 0.05 for Voronoi networks.
    ///
    /// Of the 42 623 fibers of a Voronoi network of 3000 points, the shortest is 53 000 times shorter than the mean, and
    /// as a truss that much stiffer. Merging at 0.05 takes out 11 % of them; then it is 9 times (6 in Delaunay networks),
    /// and 4.2 fibers meet at a node instead of 4. Three networks of 60 points stretched to 1.8 then carry 0.4 to 1.4 %
    /// less stress, and Newton to a stretch of 1.05 takes 28 iterations on average instead of 42. At 0.1, stresses would
    /// be up to 6 % less and 4.4 fibers meet at a node.
    #[must_use]
    pub fn default_merge(self) -> f64 {
        match self {
            Self::Delaunay => 0.0,
            Self::Voronoi => 0.05,
        }
    }
}

/// What to generate.
///
/// Points are placed at random, uniformly: as many as are asked for in the unit cube and as densely in a layer around
/// it. They are joined to a network that goes on beyond the cube and is cut at its faces: an edge that leaves the cube
/// ends at the face, where a boundary node is put. So a boundary node has one fiber, and all nodes that are not cuts are
/// interior. An edge that passes through a corner of the cube with both ends outside is dropped: tied to nothing, it
/// would only follow its ends. As in the networks published for this family of models.
///
/// The same recipe gives the same network on every machine, bit for bit, and however many threads there are.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Recipe {
    /// How points become a network.
    pub kind: Kind,
    /// The seed of the random numbers.
    pub seed: u64,
    /// The least distance between two points and between a point and a face of the cube, over the mean spacing
    /// `points^(-1/3)`. No fiber of a Delaunay network is shorter, so none is out of proportion stiff. From 0 to about
    /// 0.5. Of twelve Delaunay networks of 60 points stretched to 1.8 at constant volume, some snapped through on the way
    /// at 0.05, none at 0.1 or more. In an aligned network, distances are those before the stretch.
    pub apart: f64,
    /// Nodes joined by a fiber shorter than this part of the mean spacing of the points are merged; 0 merges nothing. In
    /// an aligned network, lengths are those before the stretch. Above 0.5 little is left of a network.
    pub merge: f64,
    /// The direction that fibers prefer. The strength is that of the network that goes on beyond the cube; fibers along
    /// the axis are cut at the faces more often, so that by number a network of few points has some hundredths more.
    pub alignment: Option<Alignment>,
    /// Fibers shorter than this part of the cube's edge are taken out, and with them what then dangles or hangs loose.
    pub shorter_than: Option<f64>,
}

/// A network as it was generated.
#[derive(Clone, Debug, PartialEq)]
pub struct Made {
    /// The network, called `KIND-POINTS-SEED`.
    pub network: Network,
    /// The points in the cube.
    pub points: usize,
    /// What was taken out because it was short, dangled or hung loose.
    pub removed: Removed,
}

impl Recipe {
    /// The recipe of a kind of network: isotropic, with points kept a fifth of their mean spacing apart.
    #[must_use]
    pub fn new(kind: Kind, seed: u64) -> Self {
        Self { kind, seed, apart: 0.2, merge: kind.default_merge(), alignment: None, shorter_than: None }
    }

    /// The network of so many points in the cube.
    ///
    /// # Errors
    /// See [`GenerateError`]; with a handful of points a face may stay without fibers.
    pub fn of_points(&self, points: usize) -> Result<Made, GenerateError> {
        if !(1..=MOST_POINTS).contains(&points) {
            return Err(GenerateError::Points { points, most: MOST_POINTS });
        }
        if !(0.0..1.0).contains(&self.merge) {
            return Err(GenerateError::Merge { merge: self.merge });
        }
        let cloud = Cloud::place(self, points)?;
        let graph = match self.kind {
            Kind::Delaunay => delaunay::graph(&cloud),
            Kind::Voronoi => voronoi::graph(&cloud),
        };
        let clipped = graph.clip().merge(self.merge * cloud.spacing, cloud.stretch);
        // Before there is a network: one with an open face may be no network at all.
        check_faces(&clipped.nodes, &clipped.fibers)?;
        let name = format!("{}-{points}-{}", self.kind.name(), self.seed);
        let network = Network::in_cube(name, Cube::UNIT, clipped.nodes, clipped.fibers)?;
        let cleaned = clean(&network, self.shorter_than)?;
        let network = if cleaned.removed.is_nothing() { network } else { cleaned.network };
        check_faces(network.nodes(), network.fibers())?;
        Ok(Made { network, points, removed: cleaned.removed })
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
