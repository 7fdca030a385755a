//! Lengths, areas, volumes and angles of a mesh.

use super::{Mesh, MeshError, Surface, check};

pub(super) fn difference(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

pub(super) fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

pub(super) fn cross(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

/// Returns the signed volume of a tetrahedron, `det[x1 - x0, x2 - x0, x3 - x0] / 6`.
pub(super) fn signed_volume(x: [[f64; 3]; 4]) -> f64 {
    dot(difference(x[1], x[0]), cross(difference(x[2], x[0]), difference(x[3], x[0]))) / 6.0
}

/// Returns the length of the longest of the six edges.
pub(in crate::fem) fn longest_edge(x: [[f64; 3]; 4]) -> f64 {
    let mut longest: f64 = 0.0;
    for (a, &start) in x.iter().enumerate() {
        for &end in &x[a + 1..] {
            let edge = difference(end, start);
            longest = longest.max(dot(edge, edge));
        }
    }
    longest.sqrt()
}

/// Returns the six angles, in degrees, between the faces of a tetrahedron of positive volume.
fn dihedral_angles(x: [[f64; 3]; 4]) -> [f64; 6] {
    let normal = |a: usize, b: usize, c: usize| cross(difference(x[b], x[a]), difference(x[c], x[a]));
    // Outward normals; face k is opposite to node k.
    let normals = [normal(1, 2, 3), normal(0, 3, 2), normal(0, 1, 3), normal(0, 2, 1)];
    [(0, 1), (0, 2), (0, 3), (1, 2), (1, 3), (2, 3)].map(|(a, b)| {
        let (n, m) = (normals[a], normals[b]);
        let sine = dot(cross(n, m), cross(n, m)).sqrt();
        sine.atan2(-dot(n, m)).to_degrees()
    })
}

impl Mesh {
    /// Returns the positions of the four nodes of an element.
    ///
    /// # Panics
    /// Panics if the element does not exist.
    pub fn corners(&self, element: usize) -> [[f64; 3]; 4] {
        self.elements[element].map(|node| self.nodes[node as usize])
    }

    /// Returns the volume of an element, m^3, which is positive.
    ///
    /// # Panics
    /// Panics if the element does not exist.
    pub fn element_volume(&self, element: usize) -> f64 {
        signed_volume(self.corners(element))
    }

    /// Returns the volume of the body, m^3.
    pub fn volume(&self) -> f64 {
        (0..self.elements.len()).map(|element| self.element_volume(element)).sum()
    }

    /// Returns the volume of each region, m^3, in the order of [`Mesh::regions`].
    pub fn region_volumes(&self) -> Vec<f64> {
        let mut volumes = vec![0.0; self.regions.len()];
        for (element, &region) in self.region_of.iter().enumerate() {
            volumes[region as usize] += self.element_volume(element);
        }
        volumes
    }

    /// Returns the normal of a triangle; its length is the area of the triangle, m^2.
    ///
    /// # Panics
    /// Panics if a node of the triangle does not exist.
    pub fn area_vector(&self, triangle: [u32; 3]) -> [f64; 3] {
        let [a, b, c] = triangle.map(|node| self.nodes[node as usize]);
        cross(difference(b, a), difference(c, a)).map(|component| 0.5 * component)
    }

    /// Returns the area of a surface of this mesh, m^2.
    ///
    /// # Panics
    /// Panics if a node of the surface does not exist.
    pub fn surface_area(&self, surface: &Surface) -> f64 {
        let area = |&triangle: &[u32; 3]| {
            let normal = self.area_vector(triangle);
            dot(normal, normal).sqrt()
        };
        surface.triangles.iter().map(area).sum()
    }

    /// Returns the lowest and the highest coordinates, m.
    pub fn bounding_box(&self) -> [[f64; 3]; 2] {
        bounding_box(self.nodes.iter().copied())
    }

    /// Returns the node nearest to a point (m) and its distance, m; the lowest index if several are equally near.
    pub fn nearest_node(&self, point: [f64; 3]) -> (usize, f64) {
        let distance = |&node: &[f64; 3]| {
            let [x, y, z] = difference(node, point);
            x.hypot(y).hypot(z)
        };
        let mut nearest = (0, f64::INFINITY);
        for (node, distance) in self.nodes.iter().map(distance).enumerate() {
            if distance < nearest.1 {
                nearest = (node, distance);
            }
        }
        nearest
    }

    /// Returns the smallest and the largest angle between two faces of an element, in degrees: 70.5 and 70.5 for
    /// regular tetrahedra, 0 and 180 for flat ones.
    pub fn dihedral_range(&self) -> [f64; 2] {
        let angles = (0..self.elements.len()).flat_map(|element| dihedral_angles(self.corners(element)));
        angles.fold([180.0, 0.0], |[low, high], angle| [angle.min(low), angle.max(high)])
    }

    /// Returns the mesh with every coordinate multiplied by `factor`, for example to convert units.
    ///
    /// # Errors
    /// Returns [`MeshError::Scale`] if the factor is not positive and finite, [`MeshError::NotFinite`] if coordinates
    /// overflow, and [`MeshError::Flat`] if element volumes vanish or overflow.
    pub fn scaled(mut self, factor: f64) -> Result<Self, MeshError> {
        if !(factor > 0.0 && factor.is_finite()) {
            return Err(MeshError::Scale(factor));
        }
        for coordinate in self.nodes.iter_mut().flatten() {
            *coordinate *= factor;
        }
        check::nodes(&self)?;
        check::elements(&self)?;
        Ok(self)
    }
}

/// Returns the lowest and the highest coordinates of points.
pub(super) fn bounding_box(points: impl Iterator<Item = [f64; 3]>) -> [[f64; 3]; 2] {
    let mut bounds = [[f64::INFINITY; 3], [f64::NEG_INFINITY; 3]];
    for point in points {
        for (axis, coordinate) in point.into_iter().enumerate() {
            bounds[0][axis] = bounds[0][axis].min(coordinate);
            bounds[1][axis] = bounds[1][axis].max(coordinate);
        }
    }
    bounds
}
