//! Quadratic elements from linear ones.

use std::collections::HashMap;

use super::cells::{Cells, Elements};
use super::{Mesh, MeshError, Surface};
use crate::fem::element::{CellType, ElementType, FaceType};

/// The quadratic type of hexahedra.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum QuadraticHexahedron {
    /// [`ElementType::Hex20`], without nodes inside faces and the volume.
    #[default]
    Serendipity,
    /// [`ElementType::Hex27`].
    Triquadratic,
}

/// The nodes between corners: the corners of an edge, a face or an element, ascending, and the node between them.
struct NewNodes<F> {
    positions: Vec<[f64; 3]>,
    of_corners: HashMap<Vec<u32>, u32>,
    /// Returns the position of a node from those of the corners.
    position: F,
}

impl<F: Fn(&[[f64; 3]]) -> [f64; 3]> NewNodes<F> {
    /// Returns the node between these corners; creates it if it is new.
    fn between(&mut self, mut corners: Vec<u32>) -> u32 {
        corners.sort_unstable();
        if let Some(&node) = self.of_corners.get(&corners) {
            return node;
        }
        let of_corners: Vec<[f64; 3]> = corners.iter().map(|&corner| self.positions[corner as usize]).collect();
        let position = (self.position)(&of_corners);
        let node = self.positions.len() as u32;
        self.positions.push(position);
        self.of_corners.insert(corners, node);
        node
    }

    /// Returns the cells with the nodes of their quadratic types. `between` returns, for each node of a type after the
    /// corners, the corners at whose center it lies.
    fn elevate<T: CellType>(
        &mut self,
        cells: &Cells<T>,
        quadratic: impl Fn(T) -> T,
        between: impl Fn(T) -> Vec<Vec<usize>>,
    ) -> Cells<T> {
        let mut elevated = Cells::default();
        for block in cells.blocks() {
            let to = quadratic(block.cell_type());
            let between = if to == block.cell_type() { Vec::new() } else { between(to) };
            for nodes in block.iter() {
                let mut all = nodes.to_vec();
                for corners in &between {
                    all.push(self.between(corners.iter().map(|&corner| nodes[corner]).collect()));
                }
                elevated.push(to, &all);
            }
        }
        elevated
    }
}

/// Returns the center of corners.
fn center(corners: &[[f64; 3]]) -> [f64; 3] {
    corners.iter().fold([0.0; 3], |sum, x| std::array::from_fn(|i| sum[i] + x[i] / corners.len() as f64))
}

impl Mesh {
    /// Returns the mesh with quadratic tetrahedra and hexahedra in place of the linear ones. The new nodes lie at the
    /// centers of edges, faces and elements, so faces stay as they are; nodes and elements keep their numbers.
    ///
    /// # Errors
    /// Returns [`MeshError::NoQuadraticType`] if the mesh has wedges.
    pub fn quadratic(&self, hexahedra: QuadraticHexahedron) -> Result<Self, MeshError> {
        self.quadratic_between(hexahedra, center)
    }

    /// Returns the mesh with quadratic elements as [`Mesh::quadratic`] does, with new nodes at other positions:
    /// `position` returns that of a node from the positions of the corners of its edge, face or element, m. This lets
    /// the elements follow curved surfaces.
    ///
    /// # Errors
    /// Returns [`MeshError::NoQuadraticType`] if the mesh has wedges, or another [`MeshError`] if the positions are not
    /// finite or invert an element.
    pub fn quadratic_between(
        &self,
        hexahedra: QuadraticHexahedron,
        position: impl Fn(&[[f64; 3]]) -> [f64; 3],
    ) -> Result<Self, MeshError> {
        if let Some((element, _)) = self.elements.typed().enumerate().find(|(_, (t, _))| *t == ElementType::Wedge6) {
            return Err(MeshError::NoQuadraticType { element });
        }
        let is_serendipity = hexahedra == QuadraticHexahedron::Serendipity;
        let mut new = NewNodes { positions: self.nodes.clone(), of_corners: HashMap::new(), position };
        let elements: Elements = new.elevate(
            &self.elements,
            |element_type| match element_type {
                ElementType::Tet4 => ElementType::Tet10,
                ElementType::Hex8 if is_serendipity => ElementType::Hex20,
                ElementType::Hex8 => ElementType::Hex27,
                quadratic => quadratic,
            },
            ElementType::corners_around_nodes,
        );
        let elevate = |surface: &Surface| Surface {
            name: surface.name.clone(),
            faces: new.elevate(
                &surface.faces,
                |face_type| match face_type {
                    FaceType::Tri3 => FaceType::Tri6,
                    FaceType::Quad4 if is_serendipity => FaceType::Quad8,
                    FaceType::Quad4 => FaceType::Quad9,
                    quadratic => quadratic,
                },
                FaceType::corners_around_nodes,
            ),
        };
        let surfaces = self.surfaces.iter().map(elevate).collect();
        Self::new(new.positions, elements, self.region_of.clone(), self.regions.clone(), surfaces)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fem::mesh::shapes;

    #[test]
    fn new_nodes_are_shared_and_the_body_keeps_its_shape() {
        let linear = shapes::cuboid([2, 1, 1], [2.0, 1.0, 1.0]).unwrap();
        let mesh = linear.quadratic(QuadraticHexahedron::default()).unwrap();
        // The nodes of a grid of twice as many cells.
        assert_eq!(mesh.nodes().len(), 5 * 3 * 3);
        assert_eq!(mesh.elements().blocks()[0].cell_type(), ElementType::Tet10);
        assert!((mesh.volume() - 2.0).abs() < 1e-14);
        for (surface, before) in mesh.surfaces().iter().zip(linear.surfaces()) {
            assert!((mesh.surface_area(surface) - linear.surface_area(before)).abs() < 1e-14, "{}", surface.name);
        }
        assert_eq!(mesh.quadratic(QuadraticHexahedron::default()).as_ref(), Ok(&mesh), "already quadratic");
    }
}
