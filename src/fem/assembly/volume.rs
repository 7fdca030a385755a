//! The volume of regions with its derivatives, and the stiffness of constrained volumes.
//!
//! The volume of the deformed region is `V = integral J dV`, the energy of a material with the energy density `W = J`.
//! Its stress and tangent are polynomials in `F` (Holzapfel 2000, section 1.3),
//!
//! ```text
//! P_iJ    = dJ/dF_iJ     = cof F                             (= J F^-T)
//! A_iJkL  = dP_iJ/dF_kL  = eps_ikm eps_JLN F_mN,
//! ```
//!
//! so that `dV/du` and `d^2V/du^2` are its nodal forces and its stiffness. `F` is that of the displacements also where
//! the F-bar method modifies the deformation gradient of the material.

use nalgebra::{Matrix3, SMatrix};

use super::geometry::{Block, ElementBlock, Geometry, with_block};
use super::unknown_map::StateMap;
use super::{Assembler, LocalBlock, local};
use crate::fem::constraint::Constraints;
use crate::fem::kinematics::RigidMotion;
use crate::fem::point_field::POINTS_PER_CHUNK;
use crate::las::{MatrixOps, RealBackend};
use crate::parallel;

/// The position in the matrix of one face of a cavity.
#[derive(Debug)]
pub(super) struct CavityFace<S> {
    constraint: usize,
    face: usize,
    /// The nodes of the face.
    nodes: Vec<u32>,
    /// The square of the number of rows, row-major.
    entry_positions: Vec<S>,
}

/// Returns `dP/dF` of the material with the energy density `W = J`: row `3 * i + J`, column `3 * k + L`.
pub fn volume_tangent(f: &Matrix3<f64>) -> SMatrix<f64, 9, 9> {
    /// The permutation symbol of two indices that differ, and the third index.
    fn complete(i: usize, k: usize) -> (f64, usize) {
        (if (i + 1) % 3 == k { 1.0 } else { -1.0 }, 3 - i - k)
    }
    SMatrix::from_fn(|row, column| {
        let ([i, j], [k, l]) = ([row / 3, row % 3], [column / 3, column % 3]);
        if i == k || j == l {
            return 0.0;
        }
        let ((sign, m), (other_sign, n)) = (complete(i, k), complete(j, l));
        sign * other_sign * f[(m, n)]
    })
}

impl Geometry {
    /// Returns the volume of the deformed elements at the points marked in `points`, m^3, of which `own` may select some,
    /// and adds `dV/du` of all of them, m^2, to `gradient`.
    pub(in crate::fem) fn add_volume_gradient(
        &self,
        points: (&[bool], Option<&[bool]>),
        displacements: &[[f64; 3]],
        gradient: &mut [[f64; 3]],
    ) -> f64 {
        let of_block = |block: &ElementBlock| with_block!(block, b => b.add_volume_gradient(points, displacements, &mut *gradient));
        self.blocks.iter().map(of_block).sum()
    }

    /// Adds the first-order change of the forces `-p dV/du` of regions, N, with the pressure at each point, Pa, for the
    /// displacement `increments`.
    pub(in crate::fem) fn add_linearized_pressure_forces(
        &self,
        pressures: &[f64],
        displacements: &[[f64; 3]],
        increments: &[[f64; 3]],
        forces: &mut [[f64; 3]],
    ) {
        let tangent = self.pressure_tangents(pressures, displacements);
        for block in &self.blocks {
            with_block!(block, b => b.add_linearized_forces(&tangent, increments, forces));
        }
    }

    /// Returns `-p dP/dF` of each point, Pa.
    fn pressure_tangents(&self, pressures: &[f64], displacements: &[[f64; 3]]) -> Vec<SMatrix<f64, 9, 9>> {
        let (mut f, mut tangents) = (Vec::new(), vec![SMatrix::zeros(); pressures.len()]);
        self.deformation_gradients(displacements, &mut f);
        let inputs = f.chunks(POINTS_PER_CHUNK).zip(pressures.chunks(POINTS_PER_CHUNK));
        parallel::map(inputs.zip(tangents.chunks_mut(POINTS_PER_CHUNK)), |((f, pressures), tangents)| {
            for ((f, &p), tangent) in f.iter().zip(pressures).zip(tangents).filter(|((_, p), _)| **p != 0.0) {
                *tangent = volume_tangent(f) * -p;
            }
        });
        tangents
    }
}

impl<B: RealBackend> Assembler<B> {
    /// Locates the faces of constrained cavities in `matrix`, for [`Assembler::cavity_stiffness`].
    ///
    /// # Errors
    /// Returns the error of the backend.
    pub fn locate_constraints(&mut self, constraints: &Constraints, matrix: &B::Matrix) -> Result<(), B::Error> {
        self.cavity_faces.clear();
        for (number, constraint) in constraints.iter().enumerate() {
            let Some(cavity) = constraint.cavity() else { continue };
            for (face, nodes) in cavity.faces().iter().enumerate() {
                if let Some(entry_positions) = self.locate_nodes(nodes, matrix)? {
                    let nodes = nodes.to_vec();
                    self.cavity_faces.push(CavityFace { constraint: number, face, nodes, entry_positions });
                }
            }
        }
        Ok(())
    }

    /// Adds `-p d^2V/du^2` of regions, N/m, to `k`, with the pressure at each point, Pa, the displacements of all
    /// nodes, m, and the motions of the rigid surfaces. Skips elements without pressure.
    ///
    /// # Errors
    /// Returns the error of the backend.
    ///
    /// # Panics
    /// Panics if an array is too short.
    pub fn pressure_stiffness(
        &self,
        pressures: &[f64],
        displacements: &[[f64; 3]],
        motions: &[RigidMotion],
        k: &mut B::Matrix,
    ) -> Result<(), B::Error> {
        let (map, tangent) = (self.state_map(motions), self.geometry.pressure_tangents(pressures, displacements));
        for (block, local) in self.geometry.blocks.iter().zip(&self.local_blocks) {
            with_block!(block, b => add_pressure_stiffness::<B, _, _>(b, local, (pressures, &tangent), &map, k))?;
        }
        Ok(())
    }

    /// Adds `-p d^2V/du^2` of the cavities given to [`Assembler::locate_constraints`], N/m, to `k`, with the pressure
    /// of each constraint, Pa, the displacements of all nodes, m, and the motions of the rigid surfaces.
    ///
    /// # Errors
    /// Returns the error of the backend.
    ///
    /// # Panics
    /// Panics if there are fewer constraints or pressures than located.
    pub fn cavity_stiffness(
        &self,
        constraints: &Constraints,
        pressures: &[f64],
        displacements: &[[f64; 3]],
        motions: &[RigidMotion],
        k: &mut B::Matrix,
    ) -> Result<(), B::Error> {
        let map = self.state_map(motions);
        let cavities: Vec<_> = constraints.iter().map(|constraint| constraint.cavity()).collect();
        let mut block = Vec::new();
        for CavityFace { constraint, face, nodes, entry_positions } in &self.cavity_faces {
            let Some(cavity) = cavities[*constraint] else { continue };
            block.clear();
            block.resize(9 * nodes.len() * nodes.len(), 0.0);
            cavity.add_stiffness(pressures[*constraint], displacements, *face, &mut block);
            k.add_at(entry_positions, &map.condense(nodes, &block))?;
        }
        Ok(())
    }
}

fn add_pressure_stiffness<B: RealBackend, const N: usize, const Q: usize>(
    block: &Block<N, Q>,
    of_rank: &LocalBlock<B>,
    (pressures, tangent): (&[f64], &[SMatrix<f64, 9, 9>]),
    map: &StateMap<'_>,
    k: &mut B::Matrix,
) -> Result<(), B::Error> {
    let (pressures, tangent) = (block.of_points(pressures), block.of_points(tangent));
    let elements = &of_rank.elements;
    k.add_blocks(&of_rank.slots, |number, entries| {
        let element = elements[number] as usize;
        let Some(stiffness) = local::from_entries(entries) else { return false };
        let has_pressure = pressures[element] != [0.0; Q];
        if has_pressure {
            local::write_stiffness(&block.points[element], &tangent[element], stiffness);
        }
        has_pressure
    })?;
    for (element, positions) in &of_rank.condensed {
        let element = *element as usize;
        if pressures[element] != [0.0; Q] {
            let stiffness = local::stiffness(&block.points[element], &tangent[element]);
            k.add_at(positions, &map.condense(&block.nodes[element], local::entries(&stiffness)))?;
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tensor::cofactor;

    #[test]
    fn the_tangent_is_the_slope_of_the_cofactor_and_the_cofactor_that_of_the_determinant() {
        let f = Matrix3::new(1.2, 0.3, -0.1, 0.05, 0.9, 0.2, -0.2, 0.1, 1.1);
        let tangent = volume_tangent(&f);
        for k in 0..9 {
            let h = 1e-6;
            let moved = |by: f64| {
                let mut f = f;
                f[(k / 3, k % 3)] += by;
                f
            };
            let slope = (cofactor(&moved(h)) - cofactor(&moved(-h))) / (2.0 * h);
            let determinant = (moved(h).determinant() - moved(-h).determinant()) / (2.0 * h);
            assert!((determinant - cofactor(&f)[(k / 3, k % 3)]).abs() < 1e-9);
            for row in 0..9 {
                assert!((tangent[(row, k)] - slope[(row / 3, row % 3)]).abs() < 1e-9, "({row}, {k})");
            }
        }
    }
}
