//! What can be wrong with the geometry of a network.

/// A network that no RVE can be made of. Nodes and fibers are numbered from 0, in the order in which they were given.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum NetworkError {
    /// There is nothing to carry a load.
    #[error("the network has no fibers")]
    NoFibers,
    /// No node lies on a face of the cube, so nothing ties the network to the deformation around it.
    #[error("none of the {nodes} nodes lies on a face of the cube")]
    NoBoundary {
        /// How many nodes there are.
        nodes: usize,
    },
    /// More nodes or fibers than 32-bit numbers of unknowns can count.
    #[error("{count} {what}, but at most {most} can be numbered")]
    TooMany {
        /// `"nodes"` or `"fibers"`.
        what: &'static str,
        /// How many were given.
        count: usize,
        /// The limit.
        most: usize,
    },
    /// A coordinate is NaN or infinite.
    #[error("node {node} has the coordinate {value}")]
    NotFinite {
        /// The node.
        node: usize,
        /// The coordinate.
        value: f64,
    },
    /// A node lies outside the cube that was given.
    #[error("node {node} at {position:?} lies outside the cube")]
    Outside {
        /// The node.
        node: usize,
        /// Where it lies, in unit-cube units.
        position: [f64; 3],
    },
    /// A fiber names a node that does not exist.
    #[error("fiber {fiber} ends at node {index}, but there are only {nodes} nodes (0 to {})", nodes.saturating_sub(1))]
    NoSuchNode {
        /// The fiber.
        fiber: usize,
        /// The node it names.
        index: u32,
        /// How many nodes there are.
        nodes: usize,
    },
    /// A fiber ends where it starts.
    #[error("fiber {fiber} runs from node {node} to itself")]
    Loop {
        /// The fiber.
        fiber: usize,
        /// The node at both of its ends.
        node: u32,
    },
    /// A fiber between two nodes that lie at one place.
    #[error("fiber {fiber} between nodes {} and {} has the length {length:e} of the cube's edge", ends[0], ends[1])]
    ZeroLength {
        /// The fiber.
        fiber: usize,
        /// Its ends.
        ends: [u32; 2],
        /// Its length, in unit-cube units.
        length: f64,
    },
    /// Two nodes at one place that no fiber joins.
    #[error("nodes {first} and {second} lie at one place, {position:?}")]
    SamePlace {
        /// The lower node.
        first: usize,
        /// The higher node.
        second: usize,
        /// Where they lie, in the units given.
        position: [f64; 3],
    },
    /// The bounding box is flat or its edges differ by more than 1e-6 of the longest.
    #[error("the box of the nodes has the edges {} x {} x {}, which is no cube", edges[0], edges[1], edges[2])]
    NotACube {
        /// The edges along x, y, z, in the units given.
        edges: [f64; 3],
    },
    /// The list of materials does not have one entry a fiber.
    #[error("{given} material numbers for {fibers} fibers")]
    MaterialCount {
        /// How many numbers were given.
        given: usize,
        /// How many fibers there are.
        fibers: usize,
    },
    /// A fiber names a material that does not exist.
    #[error("fiber {fiber} is of material {material}, but there are {materials}")]
    NoSuchMaterial {
        /// The fiber.
        fiber: usize,
        /// The material it names, from 0.
        material: u16,
        /// How many materials there are.
        materials: usize,
    },
}
