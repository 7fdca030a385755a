//! Errors in the geometry and the materials of a network.

/// The error of a network that cannot be used as an RVE. Nodes and fibers are numbered from 0, in the order in which
/// they were given.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum NetworkError {
    /// The network has no fibers.
    #[error("the network has no fibers")]
    NoFibers,
    /// No node lies on a face of the cube, so that the deformation gradient cannot be imposed. The value is the number
    /// of nodes.
    #[error("none of the {0} nodes lies on a face of the cube")]
    NoBoundary(usize),
    /// There are more nodes or fibers than 32-bit unknowns can number, or more materials than 16 bits can.
    #[error("{count} {what}, but at most {most} can be numbered")]
    TooMany {
        /// `"nodes"`, `"fibers"` or `"materials"`.
        what: &'static str,
        /// The number given.
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
    /// A node lies outside the given cube.
    #[error("node {node} at {position:?} lies outside the cube")]
    Outside {
        /// The node.
        node: usize,
        /// Position of the node, in unit-cube units.
        position: [f64; 3],
    },
    /// A fiber refers to a node that does not exist.
    #[error("fiber {fiber} ends at node {index}, but there are only {nodes} nodes (0 to {})", nodes.saturating_sub(1))]
    NoSuchNode {
        /// The fiber.
        fiber: usize,
        /// The number of the missing node.
        index: u32,
        /// Number of nodes.
        nodes: usize,
    },
    /// Both ends of a fiber are the same node.
    #[error("fiber {fiber} runs from node {node} to itself")]
    Loop {
        /// The fiber.
        fiber: usize,
        /// The node at both of its ends.
        node: u32,
    },
    /// A fiber joins two nodes at the same position.
    #[error("fiber {fiber} between nodes {} and {} has the length {length:e}, in cube edges", ends[0], ends[1])]
    ZeroLength {
        /// The fiber.
        fiber: usize,
        /// The two nodes of the fiber.
        ends: [u32; 2],
        /// Length of the fiber, in unit-cube units.
        length: f64,
    },
    /// Two nodes that no fiber joins have the same position.
    #[error("nodes {first} and {second} have the same position, {position:?}")]
    CoincidentNodes {
        /// The node with the lower number.
        first: usize,
        /// The node with the higher number.
        second: usize,
        /// Their position, in the units of the given nodes.
        position: [f64; 3],
    },
    /// The bounding box is flat, or its edges differ by more than 1e-6 of the longest. The values are the edges along
    /// x, y, z, in the units of the given nodes.
    #[error("the bounding box of the nodes has the edges {} x {} x {}, not a cube", .0[0], .0[1], .0[2])]
    NotACube([f64; 3]),
    /// The list of materials does not have one entry per fiber.
    #[error("{given} material numbers for {fibers} fibers")]
    MaterialCount {
        /// Number of entries given.
        given: usize,
        /// Number of fibers.
        fibers: usize,
    },
    /// A fiber refers to a material that does not exist.
    #[error("fiber {fiber} has material {material}, but there are only {materials} materials")]
    NoSuchMaterial {
        /// The fiber.
        fiber: usize,
        /// The number of the missing material, from 0.
        material: u16,
        /// Number of materials.
        materials: usize,
    },
}
