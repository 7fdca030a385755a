//! Networks made on the spot, the same for the same seed on every machine.
//!
//! A [`Recipe`] says what kind of network ([`Kind`]), how aligned ([`Alignment`]) and which seed; its size is a number of
//! points ([`Recipe::of_points`]), of nodes ([`Recipe::of_nodes`]) or a density ([`Recipe::of_density`]).
//!
//! ```
//! use biotissue::fiber::network::generate::{Alignment, Kind, Recipe};
//!
//! let alignment = Some(Alignment::new([1.0, 0.0, 0.0], 0.4)?);
//! let made = Recipe { alignment, ..Recipe::new(Kind::Voronoi, 1) }.of_points(50)?;
//! assert!(made.network.nodes().len() > 300);
//! # Ok::<(), biotissue::fiber::network::generate::GenerateError>(())
//! ```

mod alignment;
mod clip;
mod cloud;
mod delaunay;
mod merge;
mod portable;
mod recipe;
mod size;
mod voronoi;

pub use alignment::{Alignment, GREATEST_STRENGTH};
pub use recipe::{Kind, Made, Recipe};
pub use size::{delaunay, delaunay_of_nodes, voronoi};

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
    #[error("{nodes} nodes asked for; networks can be sought that have from {fewest} to {most} of them")]
    Nodes {
        /// How many were asked for.
        nodes: usize,
        /// The least that can be asked for.
        fewest: usize,
        /// The most that can be asked for.
        most: usize,
    },
    /// No number of points gives a density near the one asked for.
    #[error("a density of {density} asked for; the nearest within reach is about {nearest:.3}, of {points} points")]
    Density {
        /// Total length of the fibers in the unit cube.
        density: f64,
        /// The nearest one.
        nearest: f64,
        /// The points that give it.
        points: usize,
    },
    /// The direction of alignment is none.
    #[error("the direction {direction:?} asked for; it is zero or not finite")]
    Direction {
        /// The direction.
        direction: [f64; 3],
    },
    /// The strength of the alignment is out of range.
    #[error("a strength of {strength} asked for; alignment has one from 0 (isotropic) to {most}")]
    Strength {
        /// The second order parameter.
        strength: f64,
        /// The limit.
        most: f64,
    },
    /// The length below which nodes are merged is out of range.
    #[error("nodes nearer than {merge} of the mean spacing are to be merged; it must be from 0 up to and without 1")]
    Merge {
        /// The length, over the mean spacing.
        merge: f64,
    },
    /// The distance to be kept leaves no room for the points.
    #[error("{placed} of {points} points could be placed with {apart} of the mean spacing between any two")]
    NoRoom {
        /// How many found a place.
        placed: usize,
        /// How many were asked for.
        points: usize,
        /// The distance asked for, over the mean spacing.
        apart: f64,
    },
    /// No fiber crosses one of the faces, so that the network would not fill its cube.
    #[error("no fiber crosses the face {axis} = {side} of the cube")]
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

#[cfg(test)]
mod tests;
