//! Checks of the mesh invariants, and their errors.

use std::collections::HashSet;

use thiserror::Error;

use super::Mesh;
use super::measure::longest_edge;
use crate::parallel;

/// An element is flat if its volume is at most this factor times the cube of its longest edge: such a volume can be due
/// to rounding of the coordinates alone. The same holds for the volume of each integration point in proportion.
pub(super) const FLAT: f64 = 1e-12;

/// The number of elements that a task checks.
const ELEMENTS_PER_TASK: usize = 4096;

/// A violation of the invariants of [`Mesh`]. Indices count from 0.
#[derive(Clone, Debug, Error, PartialEq)]
pub enum MeshError {
    /// The mesh has no elements.
    #[error("the mesh has no elements")]
    NoElements,
    /// There are more nodes, elements or regions than 32-bit indices can address. The value is their number.
    #[error("{} nodes or elements are more than the {} that 32-bit indices can address", .0, u32::MAX)]
    TooLarge(usize),
    /// A coordinate is NaN or infinite.
    #[error("the position {position:?} of node {node} is not finite")]
    NotFinite {
        /// Index of the node.
        node: usize,
        /// The given position.
        position: [f64; 3],
    },
    /// An element refers to a node that does not exist.
    #[error("element {element} refers to node {node}, but there are only {nodes} nodes")]
    ElementNode {
        /// Index of the element.
        element: usize,
        /// The node index in the element.
        node: u32,
        /// The number of nodes.
        nodes: usize,
    },
    /// An element contains a node twice.
    #[error("element {element} has node {node} twice")]
    RepeatedNode {
        /// Index of the element.
        element: usize,
        /// Index of the node.
        node: u32,
    },
    /// An element has no volume.
    #[error("element {element} is flat: its volume is {volume:e}, its longest edge {longest_edge:e}")]
    Flat {
        /// Index of the element.
        element: usize,
        /// Volume of the element, m^3.
        volume: f64,
        /// Longest edge of the element, m.
        longest_edge: f64,
    },
    /// The node order of an element gives a negative volume.
    #[error("element {element} is inverted: its volume is {volume:e}")]
    Inverted {
        /// Index of the element.
        element: usize,
        /// Signed volume of the element, m^3.
        volume: f64,
    },
    /// An element of positive volume is so distorted that it is inverted at an integration point.
    #[error("element {element} is distorted: the volume of its integration point {point} is {volume:e}")]
    Distorted {
        /// Index of the element.
        element: usize,
        /// The integration point within the element.
        point: usize,
        /// Signed volume of the point, m^3.
        volume: f64,
    },
    /// Two elements share a face and lie on the same side of it.
    #[error("elements {first} and {second} overlap: they lie on the same side of the face {face:?}")]
    Overlap {
        /// The first element.
        first: usize,
        /// The second element.
        second: usize,
        /// The corners of the shared face.
        face: Vec<u32>,
    },
    /// Two elements share the corners of a face, but not the nodes between the corners.
    #[error("elements {first} and {second} have different nodes on the face {face:?} they share")]
    Nonconforming {
        /// The first element.
        first: usize,
        /// The second element.
        second: usize,
        /// The corners of the shared face.
        face: Vec<u32>,
    },
    /// Some nodes belong to no element.
    #[error("nodes that belong to no element: {count}, the first of them node {first}")]
    UnusedNodes {
        /// The number of unused nodes.
        count: usize,
        /// The first unused node.
        first: usize,
    },
    /// The number of region indices differs from the number of elements.
    #[error("{given} region indices for {elements} elements")]
    RegionCount {
        /// The number of region indices.
        given: usize,
        /// The number of elements.
        elements: usize,
    },
    /// An element refers to a region that does not exist.
    #[error("element {element} is in region {region}, but there are only {regions} regions")]
    ElementRegion {
        /// Index of the element.
        element: usize,
        /// The region index of the element.
        region: u32,
        /// The number of regions.
        regions: usize,
    },
    /// The region of this name has no elements.
    #[error("region `{0}` has no elements")]
    EmptyRegion(String),
    /// The surface of this name has no faces.
    #[error("surface `{0}` has no faces")]
    EmptySurface(String),
    /// This name cannot be written to mesh files.
    #[error("the name `{}` is empty or contains a quote or a control character", .0.escape_debug())]
    Name(String),
    /// Two regions or two surfaces have this name.
    #[error("the name `{0}` is given to two regions or to two surfaces")]
    DuplicateName(String),
    /// A face of a surface is not a face of any element.
    #[error("face {face} of surface `{surface}`, nodes {nodes:?}, is not a face of any element")]
    NotAFace {
        /// Name of the surface.
        surface: String,
        /// Index of the face in the surface.
        face: usize,
        /// Nodes of the face.
        nodes: Vec<u32>,
    },
    /// A surface contains a face twice.
    #[error("faces {first} and {second} of surface `{surface}` are the same")]
    DuplicateFace {
        /// Name of the surface.
        surface: String,
        /// Index of the first face.
        first: usize,
        /// Index of the second face.
        second: usize,
    },
    /// There is no quadratic type for a wedge.
    #[error("element {element} is a wedge, which has no quadratic type here")]
    NoQuadraticType {
        /// Index of the first wedge.
        element: usize,
    },
    /// The mesh cannot be scaled by this factor, which is not positive or not finite.
    #[error("the scale factor is {0}: it must be positive and finite")]
    Scale(f64),
}

/// Checks that there are elements, that 32-bit indices suffice, and that each element has one region index.
pub(super) fn sizes(mesh: &Mesh) -> Result<(), MeshError> {
    if mesh.elements.is_empty() {
        return Err(MeshError::NoElements);
    }
    for count in [mesh.nodes.len(), mesh.elements.len(), mesh.regions.len()] {
        if u32::try_from(count).is_err() {
            return Err(MeshError::TooLarge(count));
        }
    }
    if mesh.region_of.len() != mesh.elements.len() {
        return Err(MeshError::RegionCount { given: mesh.region_of.len(), elements: mesh.elements.len() });
    }
    Ok(())
}

/// Checks that all coordinates are finite.
pub(super) fn nodes(mesh: &Mesh) -> Result<(), MeshError> {
    match mesh.nodes.iter().position(|position| !position.iter().all(|x| x.is_finite())) {
        Some(node) => Err(MeshError::NotFinite { node, position: mesh.nodes[node] }),
        None => Ok(()),
    }
}

/// Checks that the nodes of each element exist and differ, that its volume is positive at every integration point, and
/// that all nodes are used.
pub(super) fn elements(mesh: &Mesh) -> Result<(), MeshError> {
    let mut used = vec![false; mesh.nodes.len()];
    let failed = mesh.elements.iter().enumerate().find_map(|(element, nodes)| {
        let error = indices(element, nodes, &mut used).err()?;
        Some((element, error))
    });
    // The error is that of the first element that has one.
    let with_nodes = failed.as_ref().map_or(mesh.elements.len(), |&(element, _)| element);
    parallel::try_each((0..with_nodes).step_by(ELEMENTS_PER_TASK), |first| {
        (first..with_nodes.min(first + ELEMENTS_PER_TASK)).try_for_each(|element| volume(mesh, element))
    })?;
    if let Some((_, error)) = failed {
        return Err(error);
    }
    match used.iter().position(|used| !used) {
        Some(first) => Err(MeshError::UnusedNodes { count: used.iter().filter(|used| !**used).count(), first }),
        None => Ok(()),
    }
}

/// Checks that the nodes of an element exist and differ, and marks them.
fn indices(element: usize, nodes: &[u32], used: &mut [bool]) -> Result<(), MeshError> {
    let count = used.len();
    for (k, &node) in nodes.iter().enumerate() {
        let Some(used) = used.get_mut(node as usize) else {
            return Err(MeshError::ElementNode { element, node, nodes: count });
        };
        *used = true;
        if nodes[..k].contains(&node) {
            return Err(MeshError::RepeatedNode { element, node });
        }
    }
    Ok(())
}

/// Checks that the volume of an element is positive, as a whole and at every integration point.
fn volume(mesh: &Mesh, element: usize) -> Result<(), MeshError> {
    let (element_type, nodes) = (mesh.elements.cell_type(element), mesh.positions(element));
    let longest_edge = longest_edge(&nodes, element_type.edges());
    let (mut volume, mut smallest, mut points) = (0.0, (f64::INFINITY, 0), 0);
    element_type.integrate(&nodes, |_, part| {
        volume += part;
        if part < smallest.0 {
            smallest = (part, points);
        }
        points += 1;
    });
    let relative = |volume: f64| volume / longest_edge.powi(3);
    if !relative(volume).is_finite() || relative(volume).abs() <= FLAT {
        return Err(MeshError::Flat { element, volume, longest_edge });
    }
    if volume < 0.0 {
        return Err(MeshError::Inverted { element, volume });
    }
    if points > 1 && relative(smallest.0) * points as f64 <= FLAT {
        return Err(MeshError::Distorted { element, point: smallest.1, volume: smallest.0 });
    }
    Ok(())
}

/// Checks that the region of each element exists and that each region has an element.
pub(super) fn regions(mesh: &Mesh) -> Result<(), MeshError> {
    let mut used = vec![false; mesh.regions.len()];
    for (element, &region) in mesh.region_of.iter().enumerate() {
        match used.get_mut(region as usize) {
            Some(used) => *used = true,
            None => return Err(MeshError::ElementRegion { element, region, regions: mesh.regions.len() }),
        }
    }
    match used.iter().position(|used| !used) {
        Some(region) => Err(MeshError::EmptyRegion(mesh.regions[region].clone())),
        None => Ok(()),
    }
}

/// Checks that names are valid and unique and that each surface has faces.
pub(super) fn names(mesh: &Mesh) -> Result<(), MeshError> {
    distinct(mesh.regions.iter().map(String::as_str))?;
    distinct(mesh.surface_names())?;
    match mesh.surfaces.iter().find(|surface| surface.faces.is_empty()) {
        Some(surface) => Err(MeshError::EmptySurface(surface.name.clone())),
        None => Ok(()),
    }
}

/// Checks that names are valid and unique.
fn distinct<'a>(names: impl Iterator<Item = &'a str>) -> Result<(), MeshError> {
    let mut seen = HashSet::new();
    for name in names {
        if !is_name(name) {
            return Err(MeshError::Name(name.into()));
        }
        if !seen.insert(name) {
            return Err(MeshError::DuplicateName(name.into()));
        }
    }
    Ok(())
}

/// Returns true if a mesh file can store the name between quotes.
pub(super) fn is_name(name: &str) -> bool {
    !name.trim().is_empty() && !name.contains(|c: char| c == '"' || c.is_control())
}
