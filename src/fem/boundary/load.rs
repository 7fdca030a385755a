//! The interface of loads, which may depend on the displacements of the body.

use std::fmt::Debug;

use super::{BoundaryError, Source};
use crate::fem::mesh::{Elements, Faces, Mesh, Part};
use crate::las::Symmetry;

/// A load by name, an entry of [`Conditions::loads`](super::Conditions::loads).
pub trait LoadCondition: Debug + Send + Sync {
    /// Resolves the names on a mesh and computes everything that depends neither on pseudo-time nor on displacements.
    ///
    /// # Errors
    /// Returns [`BoundaryError`] if a name is unknown or a value is not finite.
    fn resolve(&self, mesh: &Mesh) -> Result<Box<dyn Load>, BoundaryError>;
}

/// A load on a mesh: forces on nodes as a function of pseudo-time `t` and of the displacements of all nodes, m. The
/// factor over pseudo-time is part of the load.
///
/// Every rank evaluates the forces of all loads. The tangent of the body contains `-df/du` of every load with
/// [`Load::coupled_nodes`]. The prescribed displacements and [`Load::supports`] must prevent rigid-body motions.
pub trait Load: Debug + Send + Sync {
    /// Adds the forces on the nodes, N; `forces` has one entry per node of the mesh.
    fn add_forces(&self, t: f64, displacements: &[[f64; 3]], forces: &mut [[f64; 3]]);

    /// Returns the sum of the forces, N.
    fn resultant(&self, t: f64, displacements: &[[f64; 3]]) -> [f64; 3];

    /// Returns the surface or the point condition through which the load acts; `None` for a body force.
    fn source(&self) -> Option<Source> {
        None
    }

    /// Returns the directions in which the load resists motions of the undeformed body, as springs do. They count as
    /// supports against rigid-body motions. The default is none.
    fn supports(&self) -> &[Support] {
        &[]
    }

    /// Returns the pseudo-times at which the rate of the load jumps; an increment ends exactly at each of them. The
    /// default is none.
    fn break_points(&self) -> Vec<f64> {
        Vec::new()
    }

    /// Checks that the load is finite at pseudo-time `t` where it acts.
    /// [`Boundary::check_finite`](super::Boundary::check_finite) calls it for the ends of load steps. The default is for
    /// loads that are finite at all times if they are finite at `t = 0` and `t = 1`, where `resolve` checks them.
    ///
    /// # Errors
    /// Returns [`BoundaryError::NotFiniteAt`] for the first value that is not finite.
    fn check_finite(&self, t: f64) -> Result<(), BoundaryError> {
        let _ = t;
        Ok(())
    }

    /// Returns the sparsity of `df/du`: the groups of nodes whose forces depend on the displacements of the same group.
    /// The default, [`CoupledNodes::None`], is for loads that do not depend on the displacements. Their forces are
    /// evaluated once per load step; those of other loads with every residual.
    fn coupled_nodes(&self) -> CoupledNodes<'_> {
        CoupledNodes::None
    }

    /// Returns the symmetry of `df/du`. The solver of the body uses the weakest symmetry of the body and of all loads;
    /// a symmetric load that can make the tangent indefinite returns [`Symmetry::Symmetric`].
    fn symmetry(&self) -> Symmetry {
        Symmetry::Definite
    }

    /// Adds `-df/du` of one group of [`Load::coupled_nodes`] to `block`, N/m: row `3 * a + i` of the row-major square
    /// block belongs to component `i` of the force on node `a` of the group, column `3 * b + k` to component `k` of the
    /// displacement of node `b`. `block` is zero before the call.
    ///
    /// Called only for loads with coupled nodes.
    fn add_stiffness(&self, t: f64, displacements: &[[f64; 3]], group: usize, block: &mut [f64]) {
        let _ = (t, displacements, group, block);
    }

    /// Returns the load on a part of the mesh, with the node numbers of the part: it must add the whole forces on all own
    /// nodes, and what it adds on ghosts is ignored. `None` if it acts on no own node.
    ///
    /// # Errors
    /// Returns [`Indivisible`] if there is no such load, which is the default; every rank then holds the whole body. This
    /// must not depend on the part.
    fn on_part(&self, part: &Part) -> Result<Option<Box<dyn Load>>, Indivisible> {
        let _ = part;
        Err(Indivisible)
    }
}

/// A load that cannot be divided among the ranks that hold parts of a mesh.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Indivisible;

/// A direction in which a spring resists the displacement of a node.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Support {
    /// The node.
    pub node: u32,
    /// The direction, a unit vector.
    pub direction: [f64; 3],
}

/// The nodes that the stiffness of a load couples.
///
/// The sparsity pattern of the body couples the nodes of each element. A load may only add entries to this pattern, so
/// a group consists of nodes of one element: those of a face, or all. [`Boundary::new`](super::Boundary)
/// rejects other groups. A pressure that depends on the volume of a cavity couples more nodes: it is a
/// [`constraint`](crate::fem::constraint).
#[derive(Clone, Copy, Debug)]
pub enum CoupledNodes<'a> {
    /// The load does not depend on the displacements.
    None,
    /// Faces of elements.
    Faces(&'a Faces),
    /// Elements.
    Elements(&'a Elements),
}

impl<'a> CoupledNodes<'a> {
    /// Returns the nodes of each group.
    pub fn groups(self) -> impl Iterator<Item = &'a [u32]> {
        let (faces, elements) = match self {
            Self::None => (None, None),
            Self::Faces(faces) => (Some(faces), None),
            Self::Elements(elements) => (None, Some(elements)),
        };
        faces.into_iter().flatten().chain(elements.into_iter().flatten())
    }

    /// Returns true for a load that does not depend on the displacements.
    pub fn is_none(self) -> bool {
        matches!(self, Self::None)
    }
}
