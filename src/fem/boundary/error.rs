//! How conditions can disagree with the mesh or with each other.

use thiserror::Error;

/// Conditions that cannot be laid on a mesh.
#[derive(Clone, Debug, Error, PartialEq)]
pub enum BoundaryError {
    /// No surface of this name.
    #[error("the mesh has no surface `{name}`; it has {}", list(known))]
    UnknownSurface {
        /// The name asked for.
        name: String,
        /// Those that the mesh has.
        known: Vec<String>,
    },
    /// No region of this name.
    #[error("the mesh has no region `{name}`; it has {}, and `*` is all of it", list(known))]
    UnknownRegion {
        /// The name asked for.
        name: String,
        /// Those that the mesh has.
        known: Vec<String>,
    },
    /// No node of this index.
    #[error("there is no node {node}: the mesh has nodes 0 to {}", nodes.saturating_sub(1))]
    UnknownNode {
        /// The index asked for.
        node: usize,
        /// How many nodes there are.
        nodes: usize,
    },
    /// A prescribed number or position is a NaN or an infinity.
    #[error("{place}: a prescribed value is {value}, which is not finite")]
    NotFinite {
        /// The condition.
        place: String,
        /// What stands there.
        value: f64,
    },
    /// One displacement component is prescribed twice, differently.
    #[error(
        "node {node} is given two {}-displacements: {first_value:e} m by {first} and {second_value:e} m by {second} (times their curves)",
        component_name(*component)
    )]
    Conflict {
        /// The node, from 0.
        node: usize,
        /// 0, 1, 2 for x, y, z.
        component: usize,
        /// Who prescribes it first.
        first: String,
        /// What, m.
        first_value: f64,
        /// Who prescribes it again.
        second: String,
        /// What, m.
        second_value: f64,
    },
}

fn list(known: &[String]) -> String {
    if known.is_empty() { "none".to_owned() } else { known.join(", ") }
}

fn component_name(component: usize) -> &'static str {
    ["x", "y", "z"].get(component).copied().unwrap_or("?")
}
