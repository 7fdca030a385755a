//! Lengths, areas, volumes and angles of a mesh.

use super::{Mesh, MeshError, Surface, check};
use crate::fem::element::{CellType, ElementType, FaceType};
use crate::parallel;

pub(super) fn difference(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

pub(super) fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

pub(super) fn cross(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

/// Returns the signed volume of an element.
pub(super) fn signed_volume(element_type: ElementType, nodes: &[[f64; 3]]) -> f64 {
    let mut volume = 0.0;
    element_type.integrate(nodes, |_, part| volume += part);
    volume
}

/// Returns the length of the longest edge; `edges` are pairs of nodes.
pub(in crate::fem) fn longest_edge(nodes: &[[f64; 3]], edges: &[[usize; 2]]) -> f64 {
    let length = |&[a, b]: &[usize; 2]| {
        let edge = difference(nodes[b], nodes[a]);
        dot(edge, edge)
    };
    edges.iter().map(length).fold(0.0, f64::max).sqrt()
}

/// Returns the angle, in degrees, between the two faces at each edge of an element. A face that is not plane counts as
/// one with its mean normal.
fn dihedral_angles(element_type: ElementType, x: &[[f64; 3]]) -> impl Iterator<Item = f64> {
    let normal = |corners: &[usize]| {
        let mut sum = [0.0; 3];
        for pair in corners[1..].windows(2) {
            let part = cross(difference(x[pair[0]], x[corners[0]]), difference(x[pair[1]], x[corners[0]]));
            sum.iter_mut().zip(part).for_each(|(sum, part)| *sum += part);
        }
        sum
    };
    let faces = element_type.face_corners();
    let normals: Vec<[f64; 3]> = faces.iter().map(|corners| normal(corners)).collect();
    element_type.edges().iter().filter_map(move |edge| {
        let mut at_edge = (0..faces.len()).filter(|&face| edge.iter().all(|corner| faces[face].contains(corner)));
        let (n, m) = (normals[at_edge.next()?], normals[at_edge.next()?]);
        let sine = dot(cross(n, m), cross(n, m)).sqrt();
        Some(sine.atan2(-dot(n, m)).to_degrees())
    })
}

impl Mesh {
    /// Returns the positions of the nodes of an element, m.
    ///
    /// # Panics
    /// Panics if the element does not exist.
    pub fn positions(&self, element: usize) -> Vec<[f64; 3]> {
        self.positions_of(&self.elements[element])
    }

    /// Returns the positions of nodes, m.
    ///
    /// # Panics
    /// Panics if a node does not exist.
    pub fn positions_of(&self, nodes: &[u32]) -> Vec<[f64; 3]> {
        nodes.iter().map(|&node| self.nodes[node as usize]).collect()
    }

    /// Returns the mean position of the corners of an element, m.
    ///
    /// # Panics
    /// Panics if the element does not exist.
    pub fn center(&self, element: usize) -> [f64; 3] {
        let corners = self.elements.cell_type(element).corners();
        let mut center = [0.0; 3];
        for &node in &self.elements[element][..corners] {
            center.iter_mut().zip(self.nodes[node as usize]).for_each(|(c, x)| *c += x / corners as f64);
        }
        center
    }

    /// Returns the volume of an element, m^3, which is positive.
    ///
    /// # Panics
    /// Panics if the element does not exist.
    pub fn element_volume(&self, element: usize) -> f64 {
        signed_volume(self.elements.cell_type(element), &self.positions(element))
    }

    /// Returns a vector field at each integration point, given its values at the nodes: `sum_a N_a v_a`. The positions
    /// of the nodes give those of the points.
    ///
    /// # Panics
    /// Panics if there are fewer values than nodes.
    pub fn at_points(&self, values: &[[f64; 3]]) -> Vec<[f64; 3]> {
        let mut at_points = Vec::with_capacity(self.points.len());
        for (element_type, nodes) in self.elements.typed() {
            element_type.integrate(&self.positions_of(nodes), |shape, _| {
                let mut sum = [0.0; 3];
                for (&node, weight) in nodes.iter().zip(shape) {
                    sum.iter_mut().zip(values[node as usize]).for_each(|(sum, value)| *sum += weight * value);
                }
                at_points.push(sum);
            });
        }
        at_points
    }

    /// Returns the volume of each integration point, m^3; those of an element sum to its volume.
    pub fn point_volumes(&self) -> Vec<f64> {
        /// The number of elements of a task.
        const ELEMENTS: usize = 4096;
        let all = self.elements.len();
        let of_task = |first: usize| {
            let mut volumes = Vec::new();
            for (element_type, nodes) in (first..all.min(first + ELEMENTS)).filter_map(|of| self.elements.get(of)) {
                element_type.integrate(&self.positions_of(nodes), |_, part| volumes.push(part));
            }
            volumes
        };
        parallel::map((0..all).step_by(ELEMENTS), of_task).concat()
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

    /// Returns the volume of each region, m^3, after these displacements of the nodes, m, in the order of
    /// [`Mesh::regions`]; in a part of a mesh, that of its own elements.
    ///
    /// # Panics
    /// Panics if there are fewer displacements than nodes.
    pub fn deformed_region_volumes(&self, displacements: &[[f64; 3]]) -> Vec<f64> {
        let deformed = |&node: &u32| {
            let (x, u) = (self.nodes[node as usize], displacements[node as usize]);
            [x[0] + u[0], x[1] + u[1], x[2] + u[2]]
        };
        let of_elements = parallel::collect(self.elements.len(), |element| {
            let positions: Vec<[f64; 3]> = self.elements[element].iter().map(deformed).collect();
            signed_volume(self.elements.cell_type(element), &positions)
        });
        let mut volumes = vec![0.0; self.regions.len()];
        for (element, (volume, &region)) in of_elements.into_iter().zip(&self.region_of).enumerate() {
            if self.is_own_element(element) {
                volumes[region as usize] += volume;
            }
        }
        volumes
    }

    /// Returns the integral of the unit normal over a face, m^2; for a plane face, its length is the area.
    ///
    /// # Panics
    /// Panics if a node of the face does not exist.
    pub fn area_vector(&self, face_type: FaceType, nodes: &[u32]) -> [f64; 3] {
        let mut sum = [0.0; 3];
        face_type.integrate(&self.positions_of(nodes), |_, area| {
            sum.iter_mut().zip(area).for_each(|(sum, area)| *sum += area);
        });
        sum
    }

    /// Returns the area of a surface of this mesh, m^2.
    ///
    /// # Panics
    /// Panics if a node of the surface does not exist.
    pub fn surface_area(&self, surface: &Surface) -> f64 {
        let mut sum = 0.0;
        for (face_type, nodes) in surface.faces.typed() {
            face_type.integrate(&self.positions_of(nodes), |_, area| sum += dot(area, area).sqrt());
        }
        sum
    }

    /// Returns the center of a surface of this mesh, m: its mean position. `None` if it has no area.
    ///
    /// # Panics
    /// Panics if a node of the surface does not exist.
    pub fn surface_center(&self, surface: &Surface) -> Option<[f64; 3]> {
        let (mut area, mut moment) = (0.0, [0.0; 3]);
        for (face_type, nodes) in surface.faces.typed() {
            let positions = self.positions_of(nodes);
            face_type.integrate(&positions, |values, normal| {
                let weight = dot(normal, normal).sqrt();
                area += weight;
                for (value, position) in values.iter().zip(&positions) {
                    moment.iter_mut().zip(position).for_each(|(sum, x)| *sum += weight * value * x);
                }
            });
        }
        (area > 0.0).then(|| moment.map(|moment| moment / area))
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
        let angles = self.elements.typed().flat_map(|(element_type, nodes)| {
            dihedral_angles(element_type, &self.positions_of(nodes)).collect::<Vec<_>>()
        });
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
