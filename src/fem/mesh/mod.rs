//! Meshes of linear tetrahedra with named regions and surfaces.
//!
//! | module | holds |
//! |---|---|
//! | this one | [`Mesh`], which carries its invariants, and what can be asked of it |
//! | [`gmsh`] | reading and writing Gmsh `.msh` files, versions 2.2 and 4.1 |
//! | [`shapes`] | the built-in box and dogbone |

mod check;
mod faces;
pub mod gmsh;
mod measure;
pub mod shapes;

pub use check::MeshError;

/// A tetrahedral mesh: node positions in meters, elements with the region each belongs to, named surfaces.
///
/// # Invariants
/// Checked by [`Mesh::new`] and kept by everything that makes a mesh:
/// - there is at least one element; all indices are in range and all coordinates finite;
/// - an element has four different nodes and a positive volume, and no two elements lie on the same side of a face
///   they share;
/// - every node belongs to an element (a free node would make the stiffness singular);
/// - every element has a region, every region an element, every surface a triangle; names are unique among the
///   regions and among the surfaces, not empty, and free of quotes and control characters;
/// - the triangles of a surface are faces of elements, none twice, with outward normals. A triangle between two
///   elements keeps the orientation it was given.
#[derive(Clone, Debug, PartialEq)]
pub struct Mesh {
    nodes: Vec<[f64; 3]>,
    elements: Vec<[u32; 4]>,
    region_of: Vec<u32>,
    regions: Vec<String>,
    surfaces: Vec<Surface>,
}

/// A named part of the boundary.
#[derive(Clone, Debug, PartialEq)]
pub struct Surface {
    /// Its name (physical group).
    pub name: String,
    /// Its triangles, nodes ordered so that the normal points out of the body.
    pub triangles: Vec<[u32; 3]>,
}

impl Surface {
    /// The nodes of the surface, each once, ascending.
    #[must_use]
    pub fn nodes(&self) -> Vec<u32> {
        let mut nodes: Vec<u32> = self.triangles.iter().flatten().copied().collect();
        nodes.sort_unstable();
        nodes.dedup();
        nodes
    }
}

impl Mesh {
    /// A mesh from its parts, checked; triangles on the boundary of the body are turned so that their normals point
    /// outward.
    ///
    /// `nodes` are positions in meters, `elements` four nodes each with
    /// `det[x1 - x0, x2 - x0, x3 - x0] > 0`, `region_of` one index into `regions` an element.
    ///
    /// # Errors
    /// The first invariant that does not hold, as a [`MeshError`] with the numbers in it.
    pub fn new(
        nodes: Vec<[f64; 3]>,
        elements: Vec<[u32; 4]>,
        region_of: Vec<u32>,
        regions: Vec<String>,
        surfaces: Vec<Surface>,
    ) -> Result<Self, MeshError> {
        let mut mesh = Self { nodes, elements, region_of, regions, surfaces };
        check::sizes(&mesh)?;
        check::nodes(&mesh)?;
        check::elements(&mesh)?;
        check::regions(&mesh)?;
        check::names(&mesh)?;
        let faces = faces::Faces::of(&mesh.elements)?;
        faces.orient(&mut mesh.surfaces)?;
        Ok(mesh)
    }

    /// A mesh whose maker guarantees how it hangs together: the built-in shapes, whose tests hand their parts to
    /// [`Mesh::new`]. Checked is what depends on their measures.
    fn built(
        nodes: Vec<[f64; 3]>,
        (elements, region_of): (Vec<[u32; 4]>, Vec<u32>),
        regions: &[&str],
        surfaces: Vec<Surface>,
    ) -> Result<Self, MeshError> {
        let regions = regions.iter().map(|&name| name.to_owned()).collect();
        let mesh = Self { nodes, elements, region_of, regions, surfaces };
        check::nodes(&mesh)?;
        check::elements(&mesh)?;
        Ok(mesh)
    }

    /// Node positions in the reference state, in meters.
    #[must_use]
    pub fn nodes(&self) -> &[[f64; 3]] {
        &self.nodes
    }

    /// The four nodes of every element; volumes are positive.
    #[must_use]
    pub fn elements(&self) -> &[[u32; 4]] {
        &self.elements
    }

    /// The index into [`Mesh::regions`] of every element.
    #[must_use]
    pub fn region_of(&self) -> &[u32] {
        &self.region_of
    }

    /// The names of the regions.
    #[must_use]
    pub fn regions(&self) -> &[String] {
        &self.regions
    }

    /// The named surfaces.
    #[must_use]
    pub fn surfaces(&self) -> &[Surface] {
        &self.surfaces
    }

    /// The index of the region of this name: what [`Mesh::region_of`] holds for its elements.
    #[must_use]
    pub fn region(&self, name: &str) -> Option<u32> {
        self.regions.iter().position(|region| region == name).and_then(|k| u32::try_from(k).ok())
    }

    /// The elements of a region, ascending; none for an index that is no region.
    pub fn elements_in(&self, region: u32) -> impl Iterator<Item = usize> + '_ {
        self.region_of.iter().enumerate().filter(move |&(_, &of)| of == region).map(|(element, _)| element)
    }

    /// The surface of this name.
    #[must_use]
    pub fn surface(&self, name: &str) -> Option<&Surface> {
        self.surfaces.iter().find(|surface| surface.name == name)
    }

    /// The elements that share a face with each element, ascending.
    #[must_use]
    pub fn neighbors(&self) -> Vec<Vec<u32>> {
        faces::neighbors(&self.elements)
    }

    /// The names of the surfaces.
    pub fn surface_names(&self) -> impl Iterator<Item = &str> + '_ {
        self.surfaces.iter().map(|surface| surface.name.as_str())
    }
}

#[cfg(test)]
mod tests;
