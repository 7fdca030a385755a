//! Meshes with named regions and surfaces.
//!
//! | module | contains |
//! |---|---|
//! | this one | [`Mesh`] with its invariants and queries |
//! | `cells`, `points` | [`Elements`] and [`Faces`] in blocks of one type; the numbering of the integration points |
//! | `quality` | the shape quality of elements |
//! | `quadratic` | quadratic elements from linear ones |
//! | `patches` | patches of linear elements that share one dilatation |
//! | `part`, `excerpt` | the part of a mesh that one rank holds; the part with all surfaces |
//! | [`gmsh`] | reading and writing of Gmsh `.msh` files, versions 2.2 and 4.1 |
//! | [`shapes`] | the built-in box, dogbone and tube |
//!
//! ```
//! use biotissue::fem::mesh::shapes;
//!
//! let mesh = shapes::cuboid([4, 2, 2], [2.0, 1.0, 1.0]).unwrap(); // 16 cells of six tetrahedra
//! assert_eq!((mesh.elements().len(), mesh.regions()), (96, &["body".to_owned()][..]));
//! let end = mesh.surface("x1").unwrap();
//! assert!((mesh.surface_area(end) - 1.0).abs() < 1e-14 && (mesh.volume() - 2.0).abs() < 1e-14);
//! ```

mod cells;
mod check;
mod excerpt;
mod faces;
pub mod gmsh;
mod measure;
mod part;
pub(crate) mod parts;
mod patches;
mod points;
mod quadratic;
mod quality;
pub mod shapes;

pub use cells::{Block, Cells, Elements, Faces};
pub use check::MeshError;
pub use excerpt::{Excerpt, ExcerptElements};
pub use faces::Neighbors;
pub(super) use measure::longest_edge;
pub use part::{Division, Part, Sizes};
pub use points::{IntegrationPoint, PointNumbering};
pub use quadratic::QuadraticHexahedron;
pub use quality::ElementQuality;

use std::sync::Arc;

/// A mesh: node positions in meters, elements with their regions, named surfaces.
///
/// # Invariants
/// [`Mesh::new`] checks and every other constructor preserves these invariants:
/// - There is at least one element; all indices are in range and all coordinates are finite.
/// - The nodes of an element differ, and its volume is positive at every integration point. No two elements lie on the
///   same side of a shared face, and both have the same nodes on it.
/// - Every node belongs to an element (a free node would make the stiffness singular).
/// - Every element has a region, every region an element, every surface a face. Names are unique among the regions and
///   among the surfaces, not empty, and free of quotes and control characters.
/// - The faces of a surface are faces of elements, without duplicates. Their normals point outward; a face between two
///   elements keeps its given orientation.
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "app", derive(serde::Serialize, serde::Deserialize))]
pub struct Mesh {
    nodes: Vec<[f64; 3]>,
    elements: Elements,
    points: PointNumbering,
    region_of: Vec<u32>,
    regions: Vec<String>,
    surfaces: Vec<Surface>,
    patches: Vec<Vec<u32>>,
    part: Option<Arc<Part>>,
}

/// A named set of faces on the boundary or between elements.
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "app", derive(serde::Serialize, serde::Deserialize))]
pub struct Surface {
    /// Name of the surface (physical group).
    pub name: String,
    /// The nodes of each face, on the boundary ordered so that the normal points out of the body.
    pub faces: Faces,
}

impl Surface {
    /// Returns the nodes of the surface, without duplicates, ascending.
    pub fn nodes(&self) -> Vec<u32> {
        let mut nodes: Vec<u32> = self.faces.iter().flatten().copied().collect();
        nodes.sort_unstable();
        nodes.dedup();
        nodes
    }
}

impl Mesh {
    /// Creates a mesh from its parts and checks it; faces on the boundary of the body whose normals point inward are
    /// reversed.
    ///
    /// `nodes` are positions in meters, `elements` have their nodes in the order of the reference elements (for linear
    /// tetrahedra, `det[x1 - x0, x2 - x0, x3 - x0] > 0`), and `region_of` has one index into `regions` per element.
    ///
    /// # Errors
    /// Returns a [`MeshError`] for the first violated invariant.
    pub fn new(
        nodes: Vec<[f64; 3]>,
        elements: impl Into<Elements>,
        region_of: Vec<u32>,
        regions: Vec<String>,
        surfaces: Vec<Surface>,
    ) -> Result<Self, MeshError> {
        let elements = elements.into();
        let points = PointNumbering::new(&elements);
        let mut mesh = Self { nodes, elements, points, region_of, regions, surfaces, patches: Vec::new(), part: None };
        check::sizes(&mesh)?;
        check::nodes(&mesh)?;
        check::elements(&mesh)?;
        check::regions(&mesh)?;
        check::names(&mesh)?;
        let faces = faces::ElementFaces::of(&mesh.elements)?;
        faces.orient(&mut mesh.surfaces)?;
        Ok(mesh)
    }

    /// Creates a mesh of a built-in shape, whose topology is correct by construction (the tests of the shapes verify it
    /// with [`Mesh::new`]). Only the invariants that depend on the dimensions are checked.
    fn from_shape(
        nodes: Vec<[f64; 3]>,
        (elements, region_of): (Elements, Vec<u32>),
        regions: &[&str],
        surfaces: Vec<Surface>,
    ) -> Result<Self, MeshError> {
        let regions = regions.iter().map(|&name| name.to_owned()).collect();
        let points = PointNumbering::new(&elements);
        let mesh = Self { nodes, elements, points, region_of, regions, surfaces, patches: Vec::new(), part: None };
        check::nodes(&mesh)?;
        check::elements(&mesh)?;
        Ok(mesh)
    }

    /// Returns the positions of the nodes in the reference state, in meters.
    pub fn nodes(&self) -> &[[f64; 3]] {
        &self.nodes
    }

    /// Returns type and nodes of each element; volumes are positive.
    pub fn elements(&self) -> &Elements {
        &self.elements
    }

    /// Returns the numbering of the integration points.
    pub fn points(&self) -> &PointNumbering {
        &self.points
    }

    /// Returns the index into [`Mesh::regions`] of each element.
    pub fn region_of(&self) -> &[u32] {
        &self.region_of
    }

    /// Returns the names of the regions.
    pub fn regions(&self) -> &[String] {
        &self.regions
    }

    /// Returns the named surfaces.
    pub fn surfaces(&self) -> &[Surface] {
        &self.surfaces
    }

    /// Returns the index of the region of this name, as used in [`Mesh::region_of`]; `None` if there is no such region.
    pub fn region(&self, name: &str) -> Option<u32> {
        self.regions.iter().position(|region| region == name).and_then(|k| u32::try_from(k).ok())
    }

    /// Returns the elements of a region, ascending; the iterator is empty if the region does not exist.
    pub fn elements_in(&self, region: u32) -> impl Iterator<Item = usize> + '_ {
        self.region_of.iter().enumerate().filter(move |&(_, &of)| of == region).map(|(element, _)| element)
    }

    /// Returns the surface of this name; `None` if there is no such surface.
    pub fn surface(&self, name: &str) -> Option<&Surface> {
        self.surfaces.iter().find(|surface| surface.name == name)
    }

    /// Returns the elements that share a face with each element.
    pub fn neighbors(&self) -> Neighbors {
        Neighbors::new(&self.elements)
    }

    /// Returns true if all these faces lie between two elements.
    pub(in crate::fem) fn lie_between_elements(&self, faces: &Faces) -> bool {
        faces::lie_between(&self.elements, faces)
    }

    /// Returns the names of the surfaces.
    pub fn surface_names(&self) -> impl Iterator<Item = &str> + '_ {
        self.surfaces.iter().map(|surface| surface.name.as_str())
    }
}

#[cfg(test)]
mod tests;
