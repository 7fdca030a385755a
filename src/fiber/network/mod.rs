//! Fiber networks: immutable geometry in the unit cube, shared by every RVE that uses it.
//!
//! A [`Network`] comes from a file ([`file::read`]), from a generator (`generate::GeneratorParams`, with the feature
//! `generate`) or from given nodes and fibers ([`Network::new`]); each of these checks its geometry. [`check`] reports
//! the properties of a network and its rigidity, removes the parts that carry no load, and merges doubled fibers.
//!
//! ```
//! use biotissue::fiber::network::{Network, check::examine};
//!
//! // Eight fibers from the center of a cube to its corners.
//! let mut nodes: Vec<_> = (0..8).map(|c: u32| [0, 1, 2].map(|k| f64::from(c >> k & 1))).collect();
//! nodes.push([0.5; 3]);
//! let network = Network::new("star", nodes, (0..8).map(|corner| [8, corner]).collect())?;
//! assert_eq!((network.boundary().len(), network.interior()), (8, &[8][..]));
//! assert_eq!(examine(&network).maxwell_count, 8 - 3);
//! # Ok::<(), biotissue::fiber::network::NetworkError>(())
//! ```

pub mod check;
mod error;
pub mod file;
#[cfg(feature = "generate")]
pub mod generate;
mod geometry;
mod proximity;
#[cfg(feature = "generate")]
mod types;

pub use error::NetworkError;
pub use geometry::{BOUNDARY_TOLERANCE, CUBE_TOLERANCE, Cube, SAME_PLACE};
#[cfg(feature = "generate")]
pub use types::FiberTypesError;

use super::law::FiberMaterial;

/// A fiber network in the unit cube `[-1/2, 1/2]^3`, centered and scaled, with its boundary nodes identified and its
/// interior unknowns numbered.
#[derive(Clone, Debug, PartialEq)]
pub struct Network {
    name: String,
    nodes: Vec<[f64; 3]>,
    fibers: Vec<[u32; 2]>,
    lengths: Vec<f64>,
    material_of: Vec<u16>,
    materials: Vec<FiberMaterial>,
    boundary: Vec<u32>,
    interior: Vec<u32>,
    interior_number: Vec<i32>,
}

impl Network {
    /// Returns the network with another name.
    #[must_use]
    pub fn with_name(self, name: impl Into<String>) -> Self {
        Self { name: name.into(), ..self }
    }

    /// Returns the name: the file name without the folder, or the name given by the generator or the caller.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Returns the node positions in the unit cube.
    pub fn nodes(&self) -> &[[f64; 3]] {
        &self.nodes
    }

    /// Returns the two nodes of every fiber.
    pub fn fibers(&self) -> &[[u32; 2]] {
        &self.fibers
    }

    /// Returns the reference length of every fiber, in unit-cube units, computed as `sqrt(dx*dx + dy*dy + dz*dz)` of
    /// `node[b] - node[a]`: bitwise equal to the length that the truss computes for an undeformed fiber.
    pub fn lengths(&self) -> &[f64] {
        &self.lengths
    }

    /// Returns the unit vector from the first to the second node of a fiber.
    ///
    /// # Panics
    /// Panics if there is no such fiber.
    pub fn direction(&self, fiber: usize) -> [f64; 3] {
        let [a, b] = self.fibers[fiber].map(|node| self.nodes[node as usize]);
        [0, 1, 2].map(|k| (b[k] - a[k]) / self.lengths[fiber])
    }

    /// Returns the index of every fiber into [`Network::materials`]; 0 for all if the network has no materials.
    pub fn material_of(&self) -> &[u16] {
        &self.material_of
    }

    /// Returns the materials that were read or assigned with the network; empty if there are none.
    pub fn materials(&self) -> &[FiberMaterial] {
        &self.materials
    }

    /// Returns the nodes with a coordinate within 1e-8 of +-1/2, ascending: their positions are prescribed affinely.
    pub fn boundary(&self) -> &[u32] {
        &self.boundary
    }

    /// Returns the interior nodes, ascending.
    pub fn interior(&self) -> &[u32] {
        &self.interior
    }

    /// Returns the index of every node in [`Network::interior`], or -1 for a boundary node. The unknowns of node `a`
    /// are `3 * interior_number[a] + k` for `k` = 0, 1, 2.
    pub fn interior_number(&self) -> &[i32] {
        &self.interior_number
    }

    /// Returns the sum of the reference lengths, in unit-cube units.
    pub fn total_length(&self) -> f64 {
        self.lengths.iter().sum()
    }
}
