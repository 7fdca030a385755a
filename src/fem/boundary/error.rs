//! Errors of boundary conditions that contradict the mesh or each other.

use thiserror::Error;

/// The reason why conditions cannot be applied to a mesh.
#[derive(Clone, Debug, Error, PartialEq)]
pub enum BoundaryError {
    /// The mesh has no surface of this name.
    #[error("the mesh has no surface `{name}`; it has {}", list(known))]
    UnknownSurface {
        /// The requested name.
        name: String,
        /// The names of the surfaces of the mesh.
        known: Vec<String>,
    },
    /// The mesh has no region of this name.
    #[error("the mesh has no region `{name}`; it has {}, and `*` is all of it", list(known))]
    UnknownRegion {
        /// The requested name.
        name: String,
        /// The names of the regions of the mesh.
        known: Vec<String>,
    },
    /// The mesh has no node of this index.
    #[error("there is no node {node}: the mesh has nodes 0 to {}", nodes.saturating_sub(1))]
    UnknownNode {
        /// The requested index.
        node: usize,
        /// The number of nodes.
        nodes: usize,
    },
    /// A prescribed value or position is NaN or infinite.
    #[error("{place}: a prescribed value is {value}, which is not finite")]
    NotFinite {
        /// The condition that contains the value.
        place: String,
        /// The value.
        value: f64,
    },
    /// A load or a prescribed displacement is NaN or infinite at a position of the body.
    #[error(
        "{place}: the value at t = {t} and x = {:.6e}, y = {:.6e}, z = {:.6e} m is {value}, which is not finite{}",
        position[0], position[1], position[2],
        formula.as_ref().map_or(String::new(), |formula| format!(" (\"{formula}\")"))
    )]
    NotFiniteAt {
        /// The condition that contains the value.
        place: String,
        /// The value.
        value: f64,
        /// The [formula](super::LoadFunction::formula) of the factor.
        formula: Option<String>,
        /// The pseudo-time.
        t: f64,
        /// The position in the reference state, m.
        position: [f64; 3],
    },
    /// A displacement refers to a point condition that does not exist.
    #[error("there is no point condition {point}: there are {known}")]
    UnknownPoint {
        /// The requested index.
        point: usize,
        /// The number of point conditions.
        known: usize,
    },
    /// A displacement of a point condition refers to a component that does not exist.
    #[error("point condition {point} has the components 0, 1 and 2, not {component}")]
    UnknownComponent {
        /// The index of the point condition.
        point: usize,
        /// The requested component.
        component: usize,
    },
    /// Two conditions prescribe different values for one displacement component.
    #[error(
        "node {node} is given two {}-displacements: {} by {first} and {} by {second}{}",
        component_name(*component),
        displacement(*first_value, formulas[0].as_deref()),
        displacement(*second_value, formulas[1].as_deref()),
        curves(formulas)
    )]
    Conflict {
        /// The node, from 0.
        node: usize,
        /// 0, 1, 2 for x, y, z.
        component: usize,
        /// The first condition.
        first: String,
        /// The displacement of the first condition at a factor of 1, m.
        first_value: f64,
        /// The second condition.
        second: String,
        /// The displacement of the second condition at a factor of 1, m.
        second_value: f64,
        /// The [formulas](super::LoadFunction::formula) of both factors.
        formulas: Box<[Option<String>; 2]>,
    },
    /// The faces of a plane of symmetry point to opposite sides, or it has none.
    #[error("surface `{surface}` is not one plane: its faces point to opposite sides")]
    OppositeSides {
        /// The name of the surface.
        surface: String,
    },
    /// The nodes of a plane of symmetry do not lie in a plane.
    #[error(
        "surface `{surface}` is not one plane: a node is {distance:.3e} m away from the mean plane, and the surface extends over {extent:.3e} m"
    )]
    NotPlanar {
        /// The name of the surface.
        surface: String,
        /// The greatest distance of a node from the mean plane, m.
        distance: f64,
        /// The diagonal of the box around the nodes, m.
        extent: f64,
    },
    /// A node of a plane of symmetry is moved out of the plane.
    #[error(
        "node {node} lies in the symmetry plane of {plane}, but {other} moves it out of the plane (by {}{})",
        displacement(*value, formula.as_deref()),
        if formula.is_some() { "" } else { " times a curve" }
    )]
    PlaneConflict {
        /// The node, from 0.
        node: usize,
        /// The plane.
        plane: String,
        /// The condition that moves the node.
        other: String,
        /// The displacement of that condition at a factor of 1, m.
        value: f64,
        /// The formula of its factor.
        formula: Option<String>,
    },
    /// A node of a rigid surface has another condition that the rigid surface does not satisfy by itself.
    #[error("node {node} belongs to the rigid {rigid}, but also to {other}")]
    RigidConflict {
        /// The node, from 0.
        node: usize,
        /// The rigid surface.
        rigid: String,
        /// The other condition, and what it prescribes.
        other: String,
    },
    /// A node of a rigid surface lies in an inclined plane of symmetry, out of which the rigid surface may move.
    #[error("node {node} belongs to the rigid {rigid}, which may leave the plane of symmetry of {plane}")]
    LeavesPlane {
        /// The node, from 0.
        node: usize,
        /// The rigid surface.
        rigid: String,
        /// The surface with the plane.
        plane: String,
    },
    /// The prescribed part of a rotation vector is too long for free components beside it.
    #[error(
        "surface `{surface}` is turned by {angle:.4} rad while a component of its rotation vector is free; at 2 pi, rotations about all axes coincide"
    )]
    RotationTooLarge {
        /// The name of the surface.
        surface: String,
        /// The angle, rad.
        angle: f64,
    },
    /// A load couples nodes that do not belong to one element, so that the sparsity pattern has no entries for them.
    /// Holds the nodes of one group of the load.
    #[error("a load couples the nodes {0:?}, which no element contains together")]
    NotInOneElement(Vec<u32>),
}

fn list(known: &[String]) -> String {
    if known.is_empty() { "none".to_owned() } else { known.join(", ") }
}

/// Describes a displacement, m, by its formula or, without one, by its value at a factor of 1.
fn displacement(value: f64, formula: Option<&str>) -> String {
    match formula {
        None => format!("{value:e} m"),
        Some(formula) if value == 1.0 => format!("\"{formula}\" m"),
        Some(formula) => format!("{value:e} * \"{formula}\" m"),
    }
}

/// Completes a message with two displacements: those without a formula have curves that the message does not show.
fn curves(formulas: &[Option<String>; 2]) -> &'static str {
    match formulas {
        [None, None] => " (times their curves)",
        [Some(_), Some(_)] => "",
        _ => " (the number times its curve)",
    }
}

fn component_name(component: usize) -> &'static str {
    ["x", "y", "z"].get(component).copied().unwrap_or("?")
}
