//! The volume of a cavity enclosed by surfaces of the body.
//!
//! With the normal `n` that points out of the body, into the cavity, and the divergence theorem,
//!
//! ```text
//! V       = -1/3 integral x . n da
//! dV/du_a = -integral N_a n da
//! ```
//!
//! The surface is closed, so that `V` does not depend on the origin and the change of `n da` contributes as much to
//! `dV` as twice the motion of `x` (G. A. Holzapfel, *Nonlinear Solid Mechanics*, 2000, section 8.3; the identity is
//! exact here, because the quadrature rules of all faces integrate the polynomials exactly). Hence `p dV/du` is the
//! force of a follower pressure `p` on the wall, and its derivative is symmetric although that of a single face is not.

use std::collections::HashSet;

use crate::fem::boundary::{add_pressure_stiffness, find_surface, unmatched_edges};
use crate::fem::mesh::{Faces, Mesh, Part};

use super::error::{ConstraintError, OpenEdge};

/// The surfaces that enclose a cavity.
#[derive(Clone, Debug)]
pub struct Cavity {
    /// The faces of all surfaces.
    faces: Faces,
    /// The number of each surface in [`Mesh::surfaces`] and its faces.
    surfaces: Vec<(usize, Faces)>,
    /// A node of the surface; `None` in a part of a mesh.
    origin: Option<u32>,
    /// In a part of a mesh, whether the volume of each face counts on this rank.
    own: Option<Vec<bool>>,
    /// Positions of the nodes of the mesh relative to that node in the reference state, m.
    positions: Vec<[f64; 3]>,
}

impl Cavity {
    /// Resolves the surfaces of a constraint and checks that they enclose a cavity.
    pub(super) fn new(mesh: &Mesh, constraint: &str, names: &[String]) -> Result<Self, ConstraintError> {
        let mut surfaces = Vec::with_capacity(names.len());
        let mut faces = Faces::default();
        for name in names {
            let (number, surface) = find_surface(mesh, name)
                .map_err(|reason| ConstraintError::Unknown { constraint: constraint.to_owned(), reason })?;
            faces.extend(&surface.faces);
            surfaces.push((number, surface.faces.clone()));
        }
        let origin = faces.iter().next().and_then(|nodes| nodes.first()).copied();
        let center = origin.and_then(|origin| mesh.nodes().get(origin as usize)).copied().unwrap_or_default();
        let relative = |x: &[f64; 3]| std::array::from_fn(|i| x[i] - center[i]);
        let positions = mesh.nodes().iter().map(relative).collect();
        let cavity = Self { faces, surfaces, origin, own: None, positions };
        cavity.check_distinct(constraint)?;
        cavity.check_closed(mesh, constraint)?;
        let volume = cavity.volume(&vec![[0.0; 3]; mesh.nodes().len()]);
        // A NaN is no volume either.
        if volume > 0.0 { Ok(cavity) } else { Err(cavity.not_enclosed(mesh, constraint, volume)) }
    }

    /// Returns the error of a volume that is not positive. Faces on the boundary of the body have outward normals, so
    /// that the body is inside; faces between elements keep the orientation of the file, so that they may be reversed.
    fn not_enclosed(&self, mesh: &Mesh, constraint: &str, volume: f64) -> ConstraintError {
        let constraint = constraint.to_owned();
        if volume < 0.0 && mesh.lie_between_elements(&self.faces) {
            let of_mesh = mesh.surfaces();
            let surfaces = self.surfaces.iter().map(|&(number, _)| of_mesh[number].name.clone()).collect();
            return ConstraintError::Reversed { constraint, surfaces, volume: -volume };
        }
        ConstraintError::NotACavity { constraint, volume }
    }

    fn check_distinct(&self, constraint: &str) -> Result<(), ConstraintError> {
        let mut known = HashSet::with_capacity(self.faces.len());
        for nodes in &self.faces {
            let mut key = nodes.to_vec();
            key.sort_unstable();
            if !known.insert(key) {
                return Err(ConstraintError::RepeatedFace { constraint: constraint.to_owned(), nodes: nodes.to_vec() });
            }
        }
        Ok(())
    }

    fn check_closed(&self, mesh: &Mesh, constraint: &str) -> Result<(), ConstraintError> {
        /// More edges do not help to find the gap.
        const SHOWN: usize = 3;
        let open = unmatched_edges(&self.faces);
        if open.is_empty() {
            return Ok(());
        }
        let of_edge = |&(nodes, faces): &([u32; 2], usize)| {
            let positions = nodes.map(|node| mesh.nodes()[node as usize]);
            OpenEdge { nodes, positions, faces }
        };
        let edges = open.iter().take(SHOWN).map(of_edge).collect();
        Err(ConstraintError::Open { constraint: constraint.to_owned(), edges, count: open.len() })
    }

    /// Returns the faces.
    pub fn faces(&self) -> &Faces {
        &self.faces
    }

    /// Returns the cavity on a part of the mesh, with the faces at its own nodes.
    pub(super) fn on_part(&self, part: &Part) -> Self {
        let (faces, _) = part.faces(&self.faces);
        let is_own = |nodes: &[u32]| part.is_own_node[nodes[0] as usize];
        Self {
            own: Some(faces.iter().map(is_own).collect()),
            faces,
            surfaces: self.surfaces.iter().map(|(number, faces)| (*number, part.faces(faces).0)).collect(),
            origin: None,
            positions: part.nodes.iter().map(|&node| self.positions[node as usize]).collect(),
        }
    }

    /// Returns the current positions of nodes relative to the origin, which moves with the body: their rounding errors
    /// are those of the size of the cavity, wherever it is. In a part of a mesh, the origin stays where it is, because it
    /// must be the same on all ranks.
    fn current(&self, nodes: &[u32], displacements: &[[f64; 3]]) -> Vec<[f64; 3]> {
        let of_origin = self.origin.map_or([0.0; 3], |origin| displacements[origin as usize]);
        let at = |node: usize| -> [f64; 3] {
            std::array::from_fn(|i| self.positions[node][i] + (displacements[node][i] - of_origin[i]))
        };
        nodes.iter().map(|&node| at(node as usize)).collect()
    }

    /// Returns the volume at these displacements of the nodes, m^3; in a part of a mesh, the share of this rank.
    pub fn volume(&self, displacements: &[[f64; 3]]) -> f64 {
        let mut sum = 0.0;
        let is_own = |face: usize| self.own.as_ref().is_none_or(|own| own[face]);
        for (_, (face_type, nodes)) in self.faces.typed().enumerate().filter(|(face, _)| is_own(*face)) {
            let current = self.current(nodes, displacements);
            face_type.integrate(&current, |values, area| {
                for (value, x) in values.iter().zip(&current) {
                    sum += value * (x[0] * area[0] + x[1] * area[1] + x[2] * area[2]);
                }
            });
        }
        -sum / 3.0
    }

    /// Adds `dV/du` at these displacements, m^2, to `gradient`, which has one entry per node of the mesh.
    pub fn add_gradient(&self, displacements: &[[f64; 3]], gradient: &mut [[f64; 3]]) {
        self.add_forces(&self.faces, 1.0, displacements, gradient);
    }

    /// Adds `-p d^2V/du^2` of one face, N/m, to the row-major square `block` of its nodes. Only the sum over all faces
    /// is symmetric.
    pub fn add_stiffness(&self, pressure: f64, displacements: &[[f64; 3]], face: usize, block: &mut [f64]) {
        let Some((face_type, nodes)) = self.faces.get(face) else { return };
        add_pressure_stiffness(face_type, &self.current(nodes, displacements), |_| pressure, block);
    }

    /// Returns the number of each surface in [`Mesh::surfaces`] and its faces.
    pub fn surfaces(&self) -> impl Iterator<Item = (usize, &Faces)> {
        self.surfaces.iter().map(|(number, faces)| (*number, faces))
    }

    /// Adds the forces of a pressure on faces of the cavity, N, to `forces`, which has one entry per node of the mesh.
    pub fn add_forces(&self, faces: &Faces, pressure: f64, displacements: &[[f64; 3]], forces: &mut [[f64; 3]]) {
        for (face_type, nodes) in faces.typed() {
            face_type.integrate(&self.current(nodes, displacements), |values, area| {
                for (&node, value) in nodes.iter().zip(values) {
                    forces[node as usize].iter_mut().zip(area).for_each(|(sum, a)| *sum -= pressure * value * a);
                }
            });
        }
    }

    /// Returns the force of a pressure on faces of the cavity, N.
    pub fn resultant(&self, faces: &Faces, pressure: f64, displacements: &[[f64; 3]]) -> [f64; 3] {
        let mut sum = [0.0; 3];
        for (face_type, nodes) in faces.typed() {
            face_type.integrate(&self.current(nodes, displacements), |_, area| {
                sum.iter_mut().zip(area).for_each(|(sum, area)| *sum -= pressure * area);
            });
        }
        sum
    }
}
