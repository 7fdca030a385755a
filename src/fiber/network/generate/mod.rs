//! Networks made on the spot, the same for the same seed on every machine.

mod delaunay;

pub use delaunay::{Delaunay, delaunay, delaunay_of_nodes};

use super::NetworkError;

/// Why no network could be generated.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum GenerateError {
    /// The number of points asked for is out of range.
    #[error("{points} points asked for; from 1 to {most} can be placed")]
    Points {
        /// How many were asked for.
        points: usize,
        /// The limit.
        most: usize,
    },
    /// The total number of nodes asked for is out of range.
    #[error("{nodes} nodes asked for; Delaunay networks have from {fewest} to {most} of them")]
    Nodes {
        /// How many were asked for.
        nodes: usize,
        /// The least that can be asked for.
        fewest: usize,
        /// The most that can be asked for.
        most: usize,
    },
    /// The distance to be kept leaves no room for the points.
    #[error("{placed} of {points} points could be placed with {shortest} of the mean spacing between any two")]
    NoRoom {
        /// How many found a place.
        placed: usize,
        /// How many were asked for.
        points: usize,
        /// The distance asked for, over the mean spacing.
        shortest: f64,
    },
    /// No fiber crosses one of the faces, so that the network would not fill its cube.
    #[error("no fiber crosses the face {axis} = {side} of the cube; take more points or another seed")]
    OpenFace {
        /// `x`, `y` or `z`.
        axis: char,
        /// `-0.5` or `0.5`.
        side: f64,
    },
    /// What was generated is no network.
    #[error(transparent)]
    Network(#[from] NetworkError),
}
