//! Errors of constraints that contradict the mesh or the boundary conditions.

use std::fmt;

use thiserror::Error;

use crate::fem::boundary::BoundaryError;

/// The reason why a constraint cannot be imposed.
#[derive(Clone, Debug, Error, PartialEq)]
pub enum ConstraintError {
    /// The mesh has no such surface or region.
    #[error("constraint `{constraint}`: {reason}")]
    Unknown {
        /// The name of the constraint.
        constraint: String,
        /// The error with the names that exist.
        reason: BoundaryError,
    },
    /// The surfaces of a cavity do not form a closed surface of one orientation.
    #[error("constraint `{constraint}`: the surfaces of the cavity are not closed: {}", list(edges, *count))]
    Open {
        /// The name of the constraint.
        constraint: String,
        /// The first open edges.
        edges: Vec<OpenEdge>,
        /// The number of open edges.
        count: usize,
    },
    /// A face belongs to the surfaces of a cavity twice.
    #[error("constraint `{constraint}`: the face with the nodes {nodes:?} belongs to the surfaces of the cavity twice")]
    RepeatedFace {
        /// The name of the constraint.
        constraint: String,
        /// The nodes of the face.
        nodes: Vec<u32>,
    },
    /// The enclosed volume is not positive: the body, not a cavity, lies inside the surfaces.
    #[error(
        "constraint `{constraint}`: its surfaces enclose no cavity: with the normals that point out of the body, the volume is {volume:.4e} m^3"
    )]
    NotACavity {
        /// The name of the constraint.
        constraint: String,
        /// The volume with its sign, m^3.
        volume: f64,
    },
    /// The surfaces lie between elements, and all their normals point out of the volume that they enclose.
    #[error(
        "constraint `{constraint}`: the normals of {} all point out of the enclosed {volume:.4e} m^3, not into them",
        quoted(surfaces)
    )]
    Reversed {
        /// The name of the constraint.
        constraint: String,
        /// The names of the surfaces.
        surfaces: Vec<String>,
        /// The enclosed volume, positive, m^3.
        volume: f64,
    },
    /// A factor of the target is not positive and finite.
    #[error("constraint `{constraint}`: the target is {factor} times the reference volume at t = {t}")]
    Target {
        /// The name of the constraint.
        constraint: String,
        /// The pseudo-time.
        t: f64,
        /// The factor.
        factor: f64,
    },
    /// The penalty factor is not positive and finite.
    #[error("constraint `{constraint}`: the penalty factor is {factor}")]
    Penalty {
        /// The name of the constraint.
        constraint: String,
        /// The factor.
        factor: f64,
    },
    /// The free displacement components do not change the volume.
    #[error("constraint `{constraint}`: no free displacement changes the volume; all nodes that do are prescribed")]
    Fixed {
        /// The name of the constraint.
        constraint: String,
    },
}

impl ConstraintError {
    /// Returns the name of the constraint.
    pub fn constraint(&self) -> &str {
        match self {
            Self::Unknown { constraint, .. }
            | Self::Open { constraint, .. }
            | Self::RepeatedFace { constraint, .. }
            | Self::NotACavity { constraint, .. }
            | Self::Reversed { constraint, .. }
            | Self::Target { constraint, .. }
            | Self::Penalty { constraint, .. }
            | Self::Fixed { constraint } => constraint,
        }
    }
}

/// An edge of a surface whose faces do not continue each other.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct OpenEdge {
    /// The nodes at its ends.
    pub nodes: [u32; 2],
    /// Their positions, m.
    pub positions: [[f64; 3]; 2],
    /// Number of faces at the edge. More than one do not continue each other: their normals point to different sides,
    /// or the surface branches.
    pub faces: usize,
}

impl fmt::Display for OpenEdge {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let [first, second] = self.nodes;
        let [a, b] = self.positions.map(|[x, y, z]| format!("({x:.4e}, {y:.4e}, {z:.4e})"));
        match self.faces {
            1 => write!(f, "the edge from node {first} {a} to node {second} {b} has only one face"),
            n => write!(
                f,
                "the edge from node {first} {a} to node {second} {b} has {n} faces that do not continue each other"
            ),
        }
    }
}

fn list(edges: &[OpenEdge], count: usize) -> String {
    let shown: Vec<String> = edges.iter().map(OpenEdge::to_string).collect();
    let more = match count.saturating_sub(edges.len()) {
        0 => String::new(),
        more => format!(", and {more} more"),
    };
    shown.join(", ") + &more
}

fn quoted(surfaces: &[String]) -> String {
    let quoted: Vec<String> = surfaces.iter().map(|name| format!("`{name}`")).collect();
    quoted.join(", ")
}
