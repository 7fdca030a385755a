//! Generators of networks, reproducible from the seed on every machine.
//!
//! A [`GeneratorParams`] gives the kind of network ([`Kind`]), the alignment ([`Alignment`]) and the seed; the size is
//! a number of points ([`GeneratorParams::of_points`]), of nodes ([`GeneratorParams::of_nodes`]) or a density
//! ([`GeneratorParams::of_density`]).
//!
//! ```
//! use biotissue::fiber::network::generate::{Alignment, Kind, GeneratorParams};
//!
//! let alignment = Some(Alignment::new([1.0, 0.0, 0.0], 0.4)?);
//! let made = GeneratorParams { alignment, ..GeneratorParams::new(Kind::Voronoi, 1) }.of_points(50)?;
//! assert!(made.network.nodes().len() > 300);
//! # Ok::<(), biotissue::fiber::network::generate::GenerateError>(())
//! ```

mod alignment;
mod clip;
mod cloud;
mod delaunay;
mod merge;
mod params;
mod portable;
mod size;
mod voronoi;

pub use alignment::{Alignment, MAX_STRENGTH};
pub use params::{GeneratedNetwork, GeneratorParams, Kind};
pub use size::{delaunay, delaunay_of_nodes, voronoi};

use super::NetworkError;

/// The error of a network that cannot be generated.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum GenerateError {
    /// The requested number of points is out of range.
    #[error("{points} points requested; the number must be from 1 to {most}")]
    Points {
        /// The requested number.
        points: usize,
        /// The maximum.
        most: usize,
    },
    /// The requested number of nodes is out of range.
    #[error("{nodes} nodes requested; a network can have {fewest} to {most} nodes")]
    Nodes {
        /// The requested number.
        nodes: usize,
        /// The minimum.
        fewest: usize,
        /// The maximum.
        most: usize,
    },
    /// No number of points gives a density close to the requested one.
    #[error(
        "a density of {density} requested; the nearest possible density is about {nearest:.3}, with {points} points"
    )]
    Density {
        /// The requested density: total length of the fibers in the unit cube.
        density: f64,
        /// The closest density that is possible.
        nearest: f64,
        /// The number of points that gives the closest density.
        points: usize,
    },
    /// The direction of alignment is zero or not finite.
    #[error("the direction {0:?} is zero or not finite")]
    Direction([f64; 3]),
    /// The strength of the alignment is out of range.
    #[error("the strength of the alignment is {strength}; it must be from 0 (isotropic) to {most}")]
    Strength {
        /// The requested order parameter.
        strength: f64,
        /// The maximum.
        most: f64,
    },
    /// The merge length is out of range. The value is the length, relative to the mean spacing.
    #[error("the merge length is {0} mean spacings; it must be at least 0 and below 1")]
    Merge(f64),
    /// The minimum distance leaves no room for the points.
    #[error("only {placed} of {points} points could be placed with a minimum distance of {min_distance} mean spacings")]
    NoRoom {
        /// Number of points placed.
        placed: usize,
        /// Number of points requested.
        points: usize,
        /// The requested distance, relative to the mean spacing.
        min_distance: f64,
    },
    /// No fiber crosses one of the faces, so that the network does not fill its cube.
    #[error("no fiber crosses the face {axis} = {side} of the cube")]
    OpenFace {
        /// `x`, `y` or `z`.
        axis: char,
        /// `-0.5` or `0.5`.
        side: f64,
    },
    /// The generated network is invalid.
    #[error(transparent)]
    Network(#[from] NetworkError),
}

#[cfg(test)]
mod tests;
