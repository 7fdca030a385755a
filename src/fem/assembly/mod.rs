//! From elements to the global system: local kernels on stack arrays ([`local`]), the numbering of the unknowns
//! ([`Unknowns`]), and the scatter into whatever backend ([`Assembler`]). The physics is not seen here: stresses and
//! tangents come from a [`PointField`](super::point_field::PointField).
//!
//! # Order
//! Elements are added in the order of the mesh, nodes and components in theirs: the same sums in the same order on
//! every run.

pub mod local;
mod unknowns;

use nalgebra::{Matrix3, SMatrix};
use thiserror::Error;

pub use unknowns::Unknowns;

use super::element::{ElementError, NODES, Tetrahedron, UNKNOWNS};
use super::mesh::Mesh;
use crate::las::{Backend, Index, MatrixOps, VectorOps};

/// An element of the mesh that cannot be integrated over.
#[derive(Clone, Copy, Debug, Error, PartialEq)]
#[error("element {element}: {reason}")]
pub struct GeometryError {
    /// The element, from 0.
    pub element: usize,
    /// Why.
    pub reason: ElementError,
}

/// Geometry and global positions of all elements, found once; integrates and scatters at every state.
///
/// # Symmetry
/// The stiffness is [`Symmetry::Definite`](crate::las::Symmetry): `A` is symmetric because stresses derive from an
/// energy, and the loads are dead. [`Assembler::stiffness`] relies on it: only half of the node blocks are integrated.
pub struct Assembler<B: Backend> {
    geometry: Vec<Tetrahedron>,
    nodes: Vec<[u32; NODES]>,
    /// The unknown of every node and component, `3 * node + component`.
    rows: Vec<B::Index>,
    /// Elements with a row that this rank keeps, ascending: all of them on a backend that knows no ranks.
    kept: Vec<u32>,
    /// 144 positions a kept element, block rows first.
    slots: Vec<B::Slot>,
}

impl<B: Backend<Scalar = f64>> Assembler<B> {
    /// Locates all elements of `mesh` in `matrix`, whose pattern is [`Unknowns::pattern`].
    ///
    /// # Errors
    /// What the backend reports.
    pub fn new(
        geometry: Vec<Tetrahedron>,
        mesh: &Mesh,
        unknowns: &Unknowns,
        matrix: &B::Matrix,
    ) -> Result<Self, B::Fault> {
        let index = |&number: &i32| if number < 0 { B::Index::CONSTRAINED } else { B::Index::of(number as usize) };
        let rows: Vec<B::Index> = unknowns.numbers().iter().map(index).collect();
        let rows_of = |nodes: &[u32; NODES]| -> [B::Index; UNKNOWNS] {
            std::array::from_fn(|k| rows[3 * nodes[k / 3] as usize + k % 3])
        };
        let elements = (0_u32..).zip(mesh.elements());
        let kept: Vec<u32> =
            elements.filter(|(_, nodes)| matrix.owns_any_row(&rows_of(nodes))).map(|(element, _)| element).collect();
        let mut slots = Vec::with_capacity(kept.len() * UNKNOWNS * UNKNOWNS);
        for &element in &kept {
            let of_element = rows_of(&mesh.elements()[element as usize]);
            matrix.locate(&of_element, &of_element, &mut slots)?;
        }
        debug_assert_eq!(slots.len(), kept.len() * UNKNOWNS * UNKNOWNS, "a slot a pair of unknowns");
        Ok(Self { geometry, nodes: mesh.elements().to_vec(), rows, kept, slots })
    }

    /// Volume and shape-function gradients of every element.
    #[must_use]
    pub fn geometry(&self) -> &[Tetrahedron] {
        &self.geometry
    }

    /// The row of every node and component, `3 * node + component`; negative where it is prescribed.
    #[must_use]
    pub fn rows(&self) -> &[B::Index] {
        &self.rows
    }

    /// `F` of every element from the displacements of all nodes, in meters.
    ///
    /// # Panics
    /// Where `displacements` has fewer nodes than the mesh.
    pub fn deformation_gradients(&self, displacements: &[[f64; 3]], gradients: &mut Vec<Matrix3<f64>>) {
        let elements = self.geometry.iter().zip(&self.nodes);
        gradients.clear();
        gradients.extend(elements.map(|(g, nodes)| g.deformation_gradient(&gather(displacements, nodes))));
    }

    /// `f_a = integral P grad N_a dV`, N, of all nodes, prescribed ones included; `forces` is overwritten.
    ///
    /// # Panics
    /// Where `forces` has fewer nodes than the mesh.
    pub fn internal_forces(&self, pk1: &[Matrix3<f64>], forces: &mut [[f64; 3]]) {
        forces.fill([0.0; 3]);
        for ((g, nodes), p) in self.geometry.iter().zip(&self.nodes).zip(pk1) {
            let of_element = local::internal_force(g, p);
            for (&node, force) in nodes.iter().zip(of_element) {
                add(&mut forces[node as usize], force);
            }
        }
    }

    /// `r += forces` at the free unknowns; those of prescribed ones are dropped.
    ///
    /// # Errors
    /// What the backend reports.
    pub fn scatter(&self, forces: &[[f64; 3]], r: &mut B::Vector) -> Result<(), B::Fault> {
        r.add(&self.rows, forces.as_flattened())
    }

    /// The forces that the displacements `increments` add to the internal ones to first order, `K du`, N, of all
    /// nodes; only elements that touch a moved node count. `forces` is overwritten.
    ///
    /// # Panics
    /// Where an array has fewer nodes than the mesh.
    pub fn linearized_forces(&self, tangent: &[SMatrix<f64, 9, 9>], increments: &[[f64; 3]], forces: &mut [[f64; 3]]) {
        forces.fill([0.0; 3]);
        for ((g, nodes), a) in self.geometry.iter().zip(&self.nodes).zip(tangent) {
            let moved = gather(increments, nodes);
            if moved == [[0.0; 3]; NODES] {
                continue;
            }
            let dp = local::contract(a, &g.displacement_gradient(&moved));
            for (&node, force) in nodes.iter().zip(local::internal_force(g, &dp)) {
                add(&mut forces[node as usize], force);
            }
        }
    }

    /// Adds `integral grad N_a . A . grad N_b dV`, N/m, to `k`; on each rank of a backend that spreads its rows, over the
    /// elements that have some of them.
    ///
    /// # Errors
    /// What the backend reports.
    pub fn stiffness(&self, tangent: &[SMatrix<f64, 9, 9>], k: &mut B::Matrix) -> Result<(), B::Fault> {
        for (&element, slots) in self.kept.iter().zip(self.slots.chunks_exact(UNKNOWNS * UNKNOWNS)) {
            let element = element as usize;
            k.add_at(slots, &local::stiffness(&self.geometry[element], &tangent[element]))?;
        }
        Ok(())
    }

    /// The size of the rounding errors in the internal forces, N: a residual below it is none.
    ///
    /// `F = I + du/dX` is rounded to `eps`, whatever the displacement gradient, and the stress by `|A| eps`, so that
    /// node `a` of element `e` gets a force wrong by about `V |A| |grad N_a| eps` (`V |grad N_a|^2 |A|` is the size of
    /// its stiffness). These errors are independent, so their squares add up; a factor of 8 as at the micro scale:
    /// `8 eps sqrt(sum_e sum_a (V |A| |grad N_a|)^2)`, with Frobenius norms.
    #[must_use]
    pub fn rounding(&self, tangent: &[SMatrix<f64, 9, 9>]) -> f64 {
        let squares = self.geometry.iter().zip(tangent).map(|(g, a)| {
            let gradients: f64 = g.gradients.as_flattened().iter().map(|g| g * g).sum();
            g.volume * g.volume * a.norm_squared() * gradients
        });
        8.0 * f64::EPSILON * squares.sum::<f64>().sqrt()
    }
}

/// Volume and shape-function gradients of every element.
///
/// # Errors
/// [`GeometryError`] for the first degenerate one.
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
