//! Forces, displacements and stiffness by the unknowns of the body, where these are not the components at the nodes.

use std::borrow::Cow;

use super::Assembler;
use crate::fem::kinematics::{Kinematics, RigidDerivatives, RigidMotion};
use crate::las::{Index, MatrixOps, RealBackend, VectorOps};
use crate::parallel;

/// The derivatives of displacements by the unknowns of rigid surfaces, at one state of the body.
pub(super) struct StateMap<'a> {
    kinematics: &'a Kinematics,
    derivatives: Vec<RigidDerivatives>,
}

impl StateMap<'_> {
    /// Returns the stiffness of a group of nodes by their unknowns, row-major in the order of [`Kinematics::rows`].
    pub fn condense<'s>(&self, nodes: &[u32], stiffness: &'s [f64]) -> Cow<'s, [f64]> {
        if self.kinematics.are_plain(nodes) {
            return Cow::Borrowed(stiffness);
        }
        Cow::Owned(self.kinematics.condense(nodes, stiffness, &self.derivatives))
    }
}

impl<B: RealBackend> Assembler<B> {
    /// Returns the map from unknowns to displacements at these motions of the rigid surfaces.
    pub(super) fn state_map(&self, motions: &[RigidMotion]) -> StateMap<'_> {
        StateMap { kinematics: &self.kinematics, derivatives: self.kinematics.derivatives(motions) }
    }

    /// Adds the `forces` on nodes, N, at these motions of the rigid surfaces, to `r` at the free unknowns; drops the
    /// forces of prescribed components. The forces on nodes with frames are replaced by their components along the
    /// frames.
    ///
    /// # Errors
    /// Returns the error of the backend.
    ///
    /// # Panics
    /// Panics if `forces` has fewer nodes than the mesh.
    pub fn scatter(&self, forces: &mut [[f64; 3]], motions: &[RigidMotion], r: &mut B::Vector) -> Result<(), B::Error> {
        let of_rigid_surfaces = self.kinematics.rigid_forces(motions, forces);
        self.kinematics.rotate_to_frames(forces);
        r.add(&self.equation_numbers, forces.as_flattened())?;
        self.rigid_equations.iter().zip(&of_rigid_surfaces).try_for_each(|(rows, forces)| r.add(rows, forces))
    }

    /// Returns the sum of the squares of the forces on nodes, N^2, at the free unknowns with rows on this rank, as
    /// [`Assembler::scatter`] adds them.
    ///
    /// # Panics
    /// Panics if `forces` has fewer nodes than the mesh.
    pub fn free_squares(&self, forces: &mut [[f64; 3]], motions: &[RigidMotion]) -> f64 {
        let of_rigid_surfaces = self.kinematics.rigid_forces(motions, forces);
        self.kinematics.rotate_to_frames(forces);
        const CHUNK: usize = 3 * 4096;
        let squares = |(equations, forces): (&[B::Index], &[f64])| -> f64 {
            let is_own = |equation: &B::Index| equation.position().is_some_and(|row| row < self.rows);
            let free = equations.iter().zip(forces).filter(|(equation, _)| is_own(equation));
            free.map(|(_, force)| force * force).sum()
        };
        let of_nodes =
            parallel::map(self.equation_numbers.chunks(CHUNK).zip(forces.as_flattened().chunks(CHUNK)), squares);
        let of_surfaces = squares((self.rigid_equations.as_flattened(), of_rigid_surfaces.as_flattened()));
        of_nodes.into_iter().sum::<f64>() + of_surfaces
    }

    /// Returns the node with the largest of the `forces`, N, of whose components only those at free unknowns with rows on
    /// this rank count, and that force; `None` without such components. The forces on nodes with frames are replaced by their
    /// components along the frames.
    ///
    /// # Panics
    /// Panics if `forces` has fewer nodes than the mesh.
    pub fn largest_free(&self, forces: &mut [[f64; 3]]) -> Option<(usize, f64)> {
        self.kinematics.rotate_to_frames(forces);
        let is_own = |equation: &B::Index| equation.position().is_some_and(|row| row < self.rows);
        let force = |(node, (equations, force)): (usize, (&[B::Index], &[f64; 3]))| {
            let free = || equations.iter().zip(force).filter(|(equation, _)| is_own(equation));
            let square: f64 = free().map(|(_, force)| force * force).sum();
            (free().next().is_some() && !square.is_nan()).then(|| (node, square.sqrt()))
        };
        let forces = self.equation_numbers.chunks(3).zip(forces.iter()).enumerate();
        forces.filter_map(force).max_by(|(_, a), (_, b)| a.total_cmp(b))
    }

    /// Adds `a` times the `direction` of the unknowns to the displacements of all nodes, m, and to the motions of the
    /// rigid surfaces. `nodal` is overwritten; it has one entry per node.
    ///
    /// # Errors
    /// Returns the error of the backend.
    ///
    /// # Panics
    /// Panics if `displacements` or `nodal` has fewer nodes than the mesh.
    pub fn advance(
        &self,
        a: f64,
        direction: &B::Vector,
        displacements: &mut [[f64; 3]],
        motions: &mut [RigidMotion],
        nodal: &mut [[f64; 3]],
    ) -> Result<(), B::Error> {
        // `get` does not write prescribed components; they stay at zero.
        nodal.fill([0.0; 3]);
        direction.get(&self.equation_numbers, nodal.as_flattened_mut())?;
        self.kinematics.rotate_from_frames(nodal);
        for (u, d) in displacements.as_flattened_mut().iter_mut().zip(nodal.as_flattened()) {
            *u += a * d;
        }
        let mut increments = vec![[0.0; 6]; self.rigid_equations.len()];
        for (rows, increments) in self.rigid_equations.iter().zip(&mut increments) {
            direction.get(rows, increments)?;
        }
        self.kinematics.advance(a, &increments, motions, displacements);
        Ok(())
    }

    /// Adds the geometric stiffness of the rigid surfaces, N/m, to `k`, from the forces on all nodes, N: internal minus
    /// external.
    ///
    /// # Errors
    /// Returns the error of the backend.
    ///
    /// # Panics
    /// Panics if `forces` has fewer nodes than the mesh.
    pub fn rigid_stiffness(
        &self,
        motions: &[RigidMotion],
        forces: &[[f64; 3]],
        k: &mut B::Matrix,
    ) -> Result<(), B::Error> {
        let blocks = self.kinematics.geometric_stiffness(motions, forces);
        self.local_rigid.iter().try_for_each(|(surface, positions)| k.add_at(positions, &blocks[*surface]))
    }
}
