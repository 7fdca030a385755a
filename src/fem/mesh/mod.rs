//! Meshes of linear tetrahedra with named regions and surfaces.

/// A tetrahedral mesh: node positions in metres, elements with the region each belongs to, named surfaces.
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

impl Mesh {
    /// Node positions in the reference state, in metres.
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
}
