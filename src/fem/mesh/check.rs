//! The invariants of a mesh, one function each, and what can be wrong.

use std::collections::HashSet;

use thiserror::Error;

use super::Mesh;
use super::measure::{longest_edge, signed_volume};

/// A tetrahedron is flat when its volume is below this times the cube of its longest edge: rounding of the
/// coordinates alone can make such a volume.
pub(super) const FLAT: f64 = 1e-12;

/// Why nodes, elements and surfaces are no mesh. Indices count from 0.
#[derive(Clone, Debug, Error, PartialEq)]
pub enum MeshError {
    /// There is nothing to compute on.
    #[error("the mesh has no elements")]
    NoElements,
    /// More nodes, elements or triangles than 32-bit indices can address.
    #[error("{count} nodes or elements are more than the {} that 32-bit indices can address", u32::MAX)]
    TooLarge {
        /// How many.
        count: usize,
    },
    /// A coordinate is not a finite number.
    #[error("node {node} lies at {position:?}: not finite")]
    NotFinite {
        /// Which node.
        node: usize,
        /// Where it is said to be.
        position: [f64; 3],
    },
    /// An element names a node that is not there.
    #[error("element {element} names node {node}, but there are {nodes}")]
    ElementNode {
        /// Which element.
        element: usize,
        /// The node it names.
        node: u32,
        /// How many there are.
        nodes: usize,
    },
    /// An element has a node twice.
    #[error("element {element} has node {node} twice")]
    RepeatedNode {
        /// Which element.
        element: usize,
        /// The node.
        node: u32,
    },
    /// An element has no volume.
    #[error("element {element} is flat: its volume is {volume:e}, its longest edge {longest_edge:e}")]
    Flat {
        /// Which element.
        element: usize,
        /// Its volume, m^3.
        volume: f64,
        /// Its longest edge, m.
        longest_edge: f64,
    },
    /// An element's nodes are numbered inside out.
    #[error("element {element} is inverted: its volume is {volume:e}")]
    Inverted {
        /// Which element.
        element: usize,
        /// Its volume, m^3.
        volume: f64,
    },
    /// Two elements share a face and lie on the same side of it.
    #[error("elements {first} and {second} overlap: they lie on the same side of the face {face:?}")]
    Overlap {
        /// An element.
        first: usize,
        /// Another one.
        second: usize,
        /// The nodes of the face they share.
        face: [u32; 3],
    },
    /// Nodes that no element uses.
    #[error("{count} nodes belong to no element, the first of them node {first}")]
    UnusedNodes {
        /// How many.
        count: usize,
        /// The first of them.
        first: usize,
    },
    /// Not one region an element.
    #[error("{given} region indices for {elements} elements")]
    RegionCount {
        /// Region indices given.
        given: usize,
        /// Elements.
        elements: usize,
    },
    /// An element names a region that is not there.
    #[error("element {element} is in region {region}, but there are {regions}")]
    ElementRegion {
        /// Which element.
        element: usize,
        /// The region it names.
        region: u32,
        /// How many there are.
        regions: usize,
    },
    /// A region without elements.
    #[error("region `{name}` has no elements")]
    EmptyRegion {
        /// Its name.
        name: String,
    },
    /// A surface without triangles.
    #[error("surface `{name}` has no triangles")]
    EmptySurface {
        /// Its name.
        name: String,
    },
    /// A name that files cannot carry.
    #[error("the name `{}` is empty or holds a quote or a control character", .name.escape_debug())]
    Name {
        /// The name.
        name: String,
    },
    /// Two regions or two surfaces of one name.
    #[error("the name `{name}` is given to two regions or to two surfaces")]
    DuplicateName {
        /// The name.
        name: String,
    },
    /// A triangle of a surface is no face of any element.
    #[error("triangle {triangle} of surface `{surface}`, nodes {nodes:?}, is no face of any element")]
    NotAFace {
        /// The surface.
        surface: String,
        /// Which of its triangles.
        triangle: usize,
        /// Its nodes.
        nodes: [u32; 3],
    },
    /// A triangle is twice in one surface.
    #[error("triangles {first} and {second} of surface `{surface}` are the same")]
    DuplicateTriangle {
        /// The surface.
        surface: String,
        /// One of its triangles.
        first: usize,
        /// Another one.
        second: usize,
    },
    /// A mesh cannot be scaled by this.
    #[error("{factor} is no factor to scale a mesh by: it must be positive and finite")]
    Scale {
        /// The factor.
        factor: f64,
    },
}

/// There are elements, no more of anything than indices can tell apart, and one region index an element.
pub(super) fn sizes(mesh: &Mesh) -> Result<(), MeshError> {
    if mesh.elements.is_empty() {
        return Err(MeshError::NoElements);
    }
    for count in [mesh.nodes.len(), mesh.elements.len(), mesh.regions.len()] {
        if u32::try_from(count).is_err() {
            return Err(MeshError::TooLarge { count });
        }
    }
    if mesh.region_of.len() != mesh.elements.len() {
        return Err(MeshError::RegionCount { given: mesh.region_of.len(), elements: mesh.elements.len() });
    }
    Ok(())
}

/// Coordinates are finite.
pub(super) fn nodes(mesh: &Mesh) -> Result<(), MeshError> {
    match mesh.nodes.iter().position(|position| !position.iter().all(|x| x.is_finite())) {
        Some(node) => Err(MeshError::NotFinite { node, position: mesh.nodes[node] }),
        None => Ok(()),
    }
}

/// Elements have four different nodes that are there and a positive volume, and leave no node out.
pub(super) fn elements(mesh: &Mesh) -> Result<(), MeshError> {
    let count = mesh.nodes.len();
    let mut used = vec![false; count];
    for (element, nodes) in mesh.elements.iter().enumerate() {
        for (k, &node) in nodes.iter().enumerate() {
            let Some(used) = used.get_mut(node as usize) else {
                return Err(MeshError::ElementNode { element, node, nodes: count });
            };
            *used = true;
            if nodes[..k].contains(&node) {
                return Err(MeshError::RepeatedNode { element, node });
            }
        }
        let corners = mesh.corners(element);
        let (volume, longest_edge) = (signed_volume(corners), longest_edge(corners));
        let thickness = volume / longest_edge.powi(3);
        if !thickness.is_finite() || thickness.abs() <= FLAT {
            return Err(MeshError::Flat { element, volume, longest_edge });
        }
        if volume < 0.0 {
            return Err(MeshError::Inverted { element, volume });
        }
    }
    match used.iter().position(|used| !used) {
        Some(first) => Err(MeshError::UnusedNodes { count: used.iter().filter(|used| !**used).count(), first }),
        None => Ok(()),
    }
}

/// Every element's region is there, and every region has an element.
pub(super) fn regions(mesh: &Mesh) -> Result<(), MeshError> {
    let mut used = vec![false; mesh.regions.len()];
    for (element, &region) in mesh.region_of.iter().enumerate() {
        match used.get_mut(region as usize) {
            Some(used) => *used = true,
            None => return Err(MeshError::ElementRegion { element, region, regions: mesh.regions.len() }),
        }
    }
    match used.iter().position(|used| !used) {
        Some(region) => Err(MeshError::EmptyRegion { name: mesh.regions[region].clone() }),
        None => Ok(()),
    }
}

/// Names can be written into files and tell things apart; surfaces have triangles.
pub(super) fn names(mesh: &Mesh) -> Result<(), MeshError> {
    distinct(mesh.regions.iter().map(String::as_str))?;
    distinct(mesh.surface_names())?;
    match mesh.surfaces.iter().find(|surface| surface.triangles.is_empty()) {
        Some(surface) => Err(MeshError::EmptySurface { name: surface.name.clone() }),
        None => Ok(()),
    }
}

fn distinct<'a>(names: impl Iterator<Item = &'a str>) -> Result<(), MeshError> {
    let mut seen = HashSet::new();
    for name in names {
        if !is_name(name) {
            return Err(MeshError::Name { name: name.into() });
        }
        if !seen.insert(name) {
            return Err(MeshError::DuplicateName { name: name.into() });
        }
    }
    Ok(())
}

/// Whether a mesh file can carry a name between quotes.
pub(super) fn is_name(name: &str) -> bool {
    !name.trim().is_empty() && !name.contains(|c: char| c == '"' || c.is_control())
}
