//! Assembly of residual and stiffness: element kernels on stack arrays ([`local`]), the numbering of the unknowns
//! ([`Unknowns`]), and the scatter into vectors and matrices of any backend ([`Assembler`]). Stresses and tangents come
//! from a [`PointField`](super::point_field::PointField).
//!
//! # Derivation
//! The weak form requires, for all test functions `w` that vanish on prescribed components,
//!
//! ```text
//! integral P(F) : grad w dV = sum_a w_a . f_ext_a,    F = I + grad u.
//! ```
//!
//! With `u = sum_b N_b u_b` and `w = N_a e_i`, on tetrahedra of volume `V` with constant gradients `g_a = dN_a/dX`, and
//! with summation over repeated indices:
//!
//! ```text
//! f_int[a i]  = integral P_iJ dN_a/dX_J dV                  = sum_e V P_iJ g_a[J]
//! r           = f_int - f_ext                               = 0 for the free components
//! K[a i, b k] = dr[a i] / du[b k]  (dF_kL / du[b k] = dN_b/dX_L)
//!             = integral dN_a/dX_J A_iJkL dN_b/dX_L dV      = sum_e V g_a[J] A_iJkL g_b[L]
//!               - df_ext[a i] / du[b k]
//! ```
//!
//! `A = dP/dF` is the consistent tangent; the derivative of `f_ext` is zero for dead loads. The rows and columns of
//! prescribed components are left out of `r` and `K`; their entries of `f_int - f_ext` are the reaction forces.
//!
//! # Order
//! Elements are added in mesh order, their nodes and components in local order, so every run adds the same terms in the
//! same order.

pub mod local;
mod unknowns;

use nalgebra::{Matrix3, SMatrix};
use thiserror::Error;

pub use unknowns::Unknowns;

use super::boundary::Load;
use super::element::{ElementError, NODES, Tetrahedron, UNKNOWNS};
use super::mesh::Mesh;
use crate::las::{Backend, Index, MatrixOps, RealBackend, VectorOps};
use crate::tensor::contract;

/// An element of the mesh that is degenerate.
#[derive(Clone, Copy, Debug, Error, PartialEq)]
#[error("element {element}: {reason}")]
pub struct GeometryError {
    /// Element index, from 0.
    pub element: usize,
    /// The defect of the element.
    pub reason: ElementError,
}

/// Geometry and matrix positions of all elements, computed once; integrates and scatters at every state.
///
/// # Symmetry
/// The stiffness of the elements is [`Symmetry::Definite`](crate::las::Symmetry): `A` is symmetric because stresses
/// derive from an energy. [`Assembler::stiffness`] relies on it: only half of the node blocks are integrated. The
/// stiffness of loads may be unsymmetric; see [`Load::symmetry`].
pub struct Assembler<B: Backend> {
    geometry: Vec<Tetrahedron>,
    nodes: Vec<[u32; NODES]>,
    /// The unknown of each node and component, at `3 * node + component`.
    equation_numbers: Vec<B::Index>,
    /// Elements with a row on this rank, ascending; all elements on a serial backend.
    local_elements: Vec<u32>,
    /// 144 matrix positions per local element, row-major.
    entry_positions: Vec<B::Slot>,
    /// The groups of coupled nodes of the loads that have rows on this rank.
    load_groups: Vec<LoadGroup<B>>,
}

/// The position in the matrix of one group of [`Load::coupled_nodes`].
struct LoadGroup<B: Backend> {
    load: usize,
    group: usize,
    /// The square of three times the number of nodes, row-major.
    entry_positions: Vec<B::Slot>,
}

impl<B: RealBackend> Assembler<B> {
    /// Looks up the positions of the entries of all elements of `mesh` in `matrix`, whose sparsity pattern is [`Unknowns::pattern`].
    ///
    /// # Errors
    /// Returns the error of the backend.
    pub fn new(
        geometry: Vec<Tetrahedron>,
        mesh: &Mesh,
        unknowns: &Unknowns,
        matrix: &B::Matrix,
    ) -> Result<Self, B::Error> {
        let index = |&number: &i32| if number < 0 { B::Index::CONSTRAINED } else { B::Index::of(number as usize) };
        let equation_numbers: Vec<B::Index> = unknowns.equation_numbers().iter().map(index).collect();
        let rows_of = |nodes: &[u32; NODES]| -> [B::Index; UNKNOWNS] {
            std::array::from_fn(|k| equation_numbers[3 * nodes[k / 3] as usize + k % 3])
        };
        let elements = (0_u32..).zip(mesh.elements());
        let local_elements: Vec<u32> =
            elements.filter(|(_, nodes)| matrix.owns_any_row(&rows_of(nodes))).map(|(element, _)| element).collect();
        let count = local_elements.len() * UNKNOWNS * UNKNOWNS;
        let mut entry_positions = Vec::with_capacity(count);
        for &element in &local_elements {
            let rows = rows_of(&mesh.elements()[element as usize]);
            matrix.locate(&rows, &rows, &mut entry_positions)?;
        }
        debug_assert_eq!(entry_positions.len(), count, "one position per pair of unknowns");
        let nodes = mesh.elements().to_vec();
        Ok(Self { geometry, nodes, equation_numbers, local_elements, entry_positions, load_groups: Vec::new() })
    }

    /// Locates the stiffness of loads in `matrix`, for [`Assembler::load_stiffness`].
    ///
    /// # Errors
    /// Returns the error of the backend.
    ///
    /// # Panics
    /// Panics if a load couples a node that does not exist.
    pub fn locate_loads(&mut self, loads: &[Box<dyn Load>], matrix: &B::Matrix) -> Result<(), B::Error> {
        self.load_groups.clear();
        for (load, coupled) in loads.iter().map(|load| load.coupled_nodes()).enumerate() {
            for (group, nodes) in coupled.groups().enumerate() {
                let components = nodes.iter().flat_map(|&node| (0..3).map(move |i| 3 * node as usize + i));
                let rows: Vec<B::Index> = components.map(|k| self.equation_numbers[k]).collect();
                if matrix.owns_any_row(&rows) {
                    let mut entry_positions = Vec::new();
                    matrix.locate(&rows, &rows, &mut entry_positions)?;
                    self.load_groups.push(LoadGroup { load, group, entry_positions });
                }
            }
        }
        Ok(())
    }

    /// Returns volume and shape-function gradients of each element.
    pub fn geometry(&self) -> &[Tetrahedron] {
        &self.geometry
    }

    /// Returns the equation number (row) of each node and component, at `3 * node + component`; negative for prescribed
    /// components.
    pub fn equation_numbers(&self) -> &[B::Index] {
        &self.equation_numbers
    }

    /// Computes `F` of each element from the displacements of all nodes, in meters.
    ///
    /// # Panics
    /// Panics if `displacements` has fewer nodes than the mesh.
    pub fn deformation_gradients(&self, displacements: &[[f64; 3]], gradients: &mut Vec<Matrix3<f64>>) {
        let elements = self.geometry.iter().zip(&self.nodes);
        gradients.clear();
        gradients.extend(elements.map(|(g, nodes)| g.deformation_gradient(&gather(displacements, nodes))));
    }

    /// Computes `f_a = integral P grad N_a dV`, N, for all nodes, including prescribed components; overwrites `forces`.
    ///
    /// # Panics
    /// Panics if `forces` has fewer nodes than the mesh.
    pub fn internal_forces(&self, pk1: &[Matrix3<f64>], forces: &mut [[f64; 3]]) {
        forces.fill([0.0; 3]);
        for ((g, nodes), p) in self.geometry.iter().zip(&self.nodes).zip(pk1) {
            let of_element = local::internal_force(g, p);
            for (&node, force) in nodes.iter().zip(of_element) {
                add(&mut forces[node as usize], force);
            }
        }
    }

    /// Adds `forces` to `r` at the free unknowns; drops the forces of prescribed components.
    ///
    /// # Errors
    /// Returns the error of the backend.
    pub fn scatter(&self, forces: &[[f64; 3]], r: &mut B::Vector) -> Result<(), B::Error> {
        r.add(&self.equation_numbers, forces.as_flattened())
    }

    /// Computes the first-order change `K du` of the internal forces, N, for the displacement `increments` of all
    /// nodes, prescribed components included; overwrites `forces`. Skips elements whose nodes do not move.
    ///
    /// # Panics
    /// Panics if an array has fewer nodes than the mesh.
    pub fn linearized_forces(&self, tangent: &[SMatrix<f64, 9, 9>], increments: &[[f64; 3]], forces: &mut [[f64; 3]]) {
        forces.fill([0.0; 3]);
        for ((g, nodes), a) in self.geometry.iter().zip(&self.nodes).zip(tangent) {
            let moved = gather(increments, nodes);
            if moved == [[0.0; 3]; NODES] {
                continue;
            }
            let dp = contract(a, &g.displacement_gradient(&moved));
            for (&node, force) in nodes.iter().zip(local::internal_force(g, &dp)) {
                add(&mut forces[node as usize], force);
            }
        }
    }

    /// Adds `integral grad N_a . A . grad N_b dV`, N/m, to `k`. With a distributed matrix, each rank integrates the
    /// elements that have rows on it.
    ///
    /// # Errors
    /// Returns the error of the backend.
    pub fn stiffness(&self, tangent: &[SMatrix<f64, 9, 9>], k: &mut B::Matrix) -> Result<(), B::Error> {
        let positions = self.entry_positions.chunks_exact(UNKNOWNS * UNKNOWNS);
        for (&element, positions) in self.local_elements.iter().zip(positions) {
            let element = element as usize;
            k.add_at(positions, &local::stiffness(&self.geometry[element], &tangent[element]))?;
        }
        Ok(())
    }

    /// Adds `-df_ext/du` of the loads given to [`Assembler::locate_loads`], N/m, to `k`, at pseudo-time `t` and the
    /// displacements of all nodes, m.
    ///
    /// # Errors
    /// Returns the error of the backend.
    ///
    /// # Panics
    /// Panics if `loads` are fewer than those located.
    pub fn load_stiffness(
        &self,
        loads: &[Box<dyn Load>],
        t: f64,
        displacements: &[[f64; 3]],
        k: &mut B::Matrix,
    ) -> Result<(), B::Error> {
        let mut block = [0.0; UNKNOWNS * UNKNOWNS];
        for LoadGroup { load, group, entry_positions } in &self.load_groups {
            let block = &mut block[..entry_positions.len()];
            block.fill(0.0);
            loads[*load].add_stiffness(t, displacements, *group, block);
            k.add_at(entry_positions, block)?;
        }
        Ok(())
    }

    /// Estimates the rounding error of the internal forces, N; a smaller residual is zero up to rounding.
    ///
    /// `F = I + du/dX` is rounded to `eps`, whatever the displacement gradient, and hence the stress to `|A| eps`. The
    /// force on node `a` of element `e` is then wrong by about `V |A| |grad N_a| eps`; the stiffness of the node is of
    /// size `V |grad N_a|^2 |A|`. These errors are independent, so their squares add up. With a factor of 8, as at the
    /// micro scale, the estimate is `8 eps sqrt(sum_e sum_a (V |A| |grad N_a|)^2)` in Frobenius norms.
    pub fn rounding_error(&self, tangent: &[SMatrix<f64, 9, 9>]) -> f64 {
        let squares = self.geometry.iter().zip(tangent).map(|(g, a)| {
            let gradients: f64 = g.gradients.as_flattened().iter().map(|g| g * g).sum();
            g.volume * g.volume * a.norm_squared() * gradients
        });
        8.0 * f64::EPSILON * squares.sum::<f64>().sqrt()
    }
}

/// Computes volume and shape-function gradients of each element.
///
/// # Errors
/// Returns [`GeometryError`] for the first degenerate element.
pub fn geometry(mesh: &Mesh) -> Result<Vec<Tetrahedron>, GeometryError> {
    let of_element =
        |element| Tetrahedron::new(&mesh.corners(element)).map_err(|reason| GeometryError { element, reason });
    (0..mesh.elements().len()).map(of_element).collect()
}

#[inline(always)]
fn gather(values: &[[f64; 3]], nodes: &[u32; NODES]) -> [[f64; 3]; NODES] {
    nodes.map(|node| values[node as usize])
}

#[inline(always)]
fn add(sum: &mut [f64; 3], value: [f64; 3]) {
    for (sum, value) in sum.iter_mut().zip(value) {
        *sum += value;
    }
}

#[cfg(all(test, feature = "sparse"))]
mod tests;
