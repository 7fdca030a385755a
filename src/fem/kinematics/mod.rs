//! The map from the unknowns of a body to the displacements of its nodes.
//!
//! The unknowns of most nodes are the components of their displacement. There are two exceptions:
//!
//! * A node with a **frame** has components along three orthonormal directions other than x, y and z, so that a
//!   component normal to an inclined plane can be prescribed.
//! * The nodes of a **rigid surface** follow six unknowns, a displacement and a rotation ([`RigidSurface`]).
//!
//! With the derivative `C = du/dq` of the displacements by the unknowns, nodal forces `f` and a stiffness `K` become
//!
//! ```text
//! r = C^T f,        dr/dq = C^T K C + f . d2u/dq2,
//! ```
//!
//! whose last term, the geometric stiffness of rigid surfaces, is symmetric: the equations derive from an energy if
//! those of the nodes do. Nodes of a rigid surface have no unknowns of their own; their rows are those of the surface.

mod rigid_surface;
mod rotation;

use nalgebra::{DMatrix, Matrix3, Vector3};

pub(in crate::fem) use rigid_surface::RigidDerivatives;
pub use rigid_surface::{RigidMotion, RigidSurface};

/// The map from unknowns to displacements of the nodes of one body.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Kinematics {
    /// The entry of `exceptions` of each node, or [`PLAIN`]; empty if there are no exceptions.
    exception_of: Vec<u32>,
    exceptions: Vec<Exception>,
    rigid_surfaces: Vec<RigidSurface>,
}

const PLAIN: u32 = u32::MAX;

/// A node whose unknowns are not the components of its displacement along x, y and z.
#[derive(Clone, Debug, PartialEq)]
enum Exception {
    /// The unknowns are the components along the columns of an orthogonal matrix.
    Frame { node: u32, directions: Matrix3<f64> },
    /// The node at this position of a rigid surface.
    Follower { surface: usize, position: usize },
}

/// Rows of a group of nodes in the linear system.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Rows {
    /// The three rows of a node.
    Node(u32),
    /// The six rows of a rigid surface.
    RigidSurface(usize),
}

impl Kinematics {
    /// Creates the map for a mesh of `nodes` nodes from frames, whose columns are orthonormal, and rigid surfaces. No
    /// node appears twice.
    pub(super) fn new(nodes: usize, frames: Vec<(u32, Matrix3<f64>)>, rigid_surfaces: Vec<RigidSurface>) -> Self {
        if frames.is_empty() && rigid_surfaces.is_empty() {
            return Self::default();
        }
        let (mut exception_of, mut exceptions) = (vec![PLAIN; nodes], Vec::new());
        let mut add = |node: u32, exception| {
            debug_assert_eq!(exception_of[node as usize], PLAIN, "a node has one exception");
            exception_of[node as usize] = exceptions.len() as u32;
            exceptions.push(exception);
        };
        for (node, directions) in frames {
            add(node, Exception::Frame { node, directions });
        }
        for (surface, rigid) in rigid_surfaces.iter().enumerate() {
            for (position, &node) in rigid.nodes.iter().enumerate() {
                add(node, Exception::Follower { surface, position });
            }
        }
        Self { exception_of, exceptions, rigid_surfaces }
    }

    /// Returns the rigid surfaces.
    pub fn rigid_surfaces(&self) -> &[RigidSurface] {
        &self.rigid_surfaces
    }

    fn exception(&self, node: u32) -> Option<&Exception> {
        self.exceptions.get(*self.exception_of.get(node as usize)? as usize)
    }

    /// Returns the rigid surface to which a node belongs.
    pub fn rigid_surface_of(&self, node: u32) -> Option<usize> {
        match self.exception(node)? {
            Exception::Follower { surface, .. } => Some(*surface),
            Exception::Frame { .. } => None,
        }
    }

    /// Returns true if the unknowns of all these nodes are components along x, y and z.
    pub(super) fn are_plain(&self, nodes: &[u32]) -> bool {
        self.exceptions.is_empty() || nodes.iter().all(|&node| self.exception(node).is_none())
    }

    /// Returns the rows of a group of nodes: those of every node that is not on a rigid surface, in order, then those
    /// of the rigid surfaces.
    pub(super) fn rows(&self, nodes: &[u32]) -> Vec<Rows> {
        let mut rows = Vec::with_capacity(nodes.len());
        let mut surfaces = Vec::new();
        for &node in nodes {
            match self.rigid_surface_of(node) {
                Some(surface) => surfaces.push(surface),
                None => rows.push(Rows::Node(node)),
            }
        }
        surfaces.sort_unstable();
        surfaces.dedup();
        rows.extend(surfaces.into_iter().map(Rows::RigidSurface));
        rows
    }

    /// Returns the derivatives of all rigid surfaces at their motions.
    pub(super) fn derivatives(&self, motions: &[RigidMotion]) -> Vec<RigidDerivatives> {
        self.rigid_surfaces.iter().zip(motions).map(|(surface, motion)| surface.derivatives(motion)).collect()
    }

    /// Returns `C^T K C` of a group of nodes, row-major in the order of [`Kinematics::rows`], from the stiffness of the
    /// group, row-major.
    pub(super) fn condense(&self, nodes: &[u32], stiffness: &[f64], derivatives: &[RigidDerivatives]) -> Vec<f64> {
        let map = self.map(nodes, derivatives);
        let size = 3 * nodes.len();
        let condensed = map.transpose() * (DMatrix::from_row_slice(size, size, stiffness) * map);
        condensed.transpose().as_slice().to_vec()
    }

    /// Returns `C` of a group of nodes.
    fn map(&self, nodes: &[u32], derivatives: &[RigidDerivatives]) -> DMatrix<f64> {
        let rows = self.rows(nodes);
        let widths = rows.iter().map(|rows| if matches!(rows, Rows::Node(_)) { 3 } else { 6 });
        let starts: Vec<usize> = std::iter::once(0)
            .chain(widths.scan(0, |end, width| {
                *end += width;
                Some(*end)
            }))
            .collect();
        let mut map = DMatrix::zeros(3 * nodes.len(), starts[rows.len()]);
        let mut own = starts.iter().copied();
        let column_of = |wanted: usize| rows.iter().position(|&rows| rows == Rows::RigidSurface(wanted));
        for (a, &node) in nodes.iter().enumerate() {
            match self.exception(node) {
                Some(&Exception::Follower { surface, position }) => {
                    let column = column_of(surface).map_or(0, |group| starts[group]);
                    let block = derivatives[surface].of_node(self.rigid_surfaces[surface].arm(position));
                    map.fixed_view_mut::<3, 6>(3 * a, column).copy_from(&block);
                }
                exception => {
                    let block = match exception {
                        Some(Exception::Frame { directions, .. }) => *directions,
                        _ => Matrix3::identity(),
                    };
                    map.fixed_view_mut::<3, 3>(3 * a, own.next().unwrap_or(0)).copy_from(&block);
                }
            }
        }
        map
    }

    /// Replaces the forces on nodes with frames by their components along the frames.
    pub(super) fn rotate_to_frames(&self, forces: &mut [[f64; 3]]) {
        for (node, directions) in self.frames() {
            let force = &mut forces[node as usize];
            *force = directions.tr_mul(&Vector3::from(*force)).into();
        }
    }

    /// Replaces the components of vectors along frames by those along x, y and z.
    pub(super) fn rotate_from_frames(&self, vectors: &mut [[f64; 3]]) {
        for (node, directions) in self.frames() {
            let vector = &mut vectors[node as usize];
            *vector = (directions * Vector3::from(*vector)).into();
        }
    }

    fn frames(&self) -> impl Iterator<Item = (u32, &Matrix3<f64>)> {
        self.exceptions.iter().filter_map(|exception| match exception {
            Exception::Frame { node, directions } => Some((*node, directions)),
            Exception::Follower { .. } => None,
        })
    }

    /// Returns the forces conjugate to the unknowns of each rigid surface, N.
    pub(super) fn rigid_forces(&self, motions: &[RigidMotion], forces: &[[f64; 3]]) -> Vec<[f64; 6]> {
        let with_motion = self.rigid_surfaces.iter().zip(motions);
        with_motion.map(|(surface, motion)| surface.generalized_forces(&surface.derivatives(motion), forces)).collect()
    }

    /// Adds `a` times increments of the unknowns of the rigid surfaces to their motions, and moves their nodes.
    pub(super) fn advance(
        &self,
        a: f64,
        increments: &[[f64; 6]],
        motions: &mut [RigidMotion],
        displacements: &mut [[f64; 3]],
    ) {
        for ((surface, increments), motion) in self.rigid_surfaces.iter().zip(increments).zip(motions) {
            surface.advance(a, increments, motion);
            surface.place(motion, displacements);
        }
    }

    /// Returns the geometric stiffness of each rigid surface, row-major over its six unknowns, N/m, for the forces on
    /// all nodes.
    pub(super) fn geometric_stiffness(&self, motions: &[RigidMotion], forces: &[[f64; 3]]) -> Vec<[f64; 36]> {
        let of_surface = |(surface, motion): (&RigidSurface, &RigidMotion)| {
            let rotations = surface.geometric_stiffness(motion, forces);
            let mut block = [0.0; 36];
            for (i, j) in (0..9).map(|k| (k / 3, k % 3)) {
                block[6 * (3 + i) + 3 + j] = rotations[(i, j)];
            }
            block
        };
        self.rigid_surfaces.iter().zip(motions).map(of_surface).collect()
    }
}

#[cfg(test)]
mod tests;
