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
//! With `u = sum_b N_b u_b` and `w = N_a e_i`, at integration points `q` of volume `V` (weight times Jacobian) with the
//! gradients `g_a = dN_a/dX`, and with summation over repeated indices:
//!
//! ```text
//! f_int[a i]  = integral P_iJ dN_a/dX_J dV                  = sum_q V P_iJ g_a[J]
//! r           = f_int - f_ext                               = 0 for the free components
//! K[a i, b k] = dr[a i] / du[b k]  (dF_kL / du[b k] = dN_b/dX_L)
//!             = integral dN_a/dX_J A_iJkL dN_b/dX_L dV      = sum_q V g_a[J] A_iJkL g_b[L]
//!               - df_ext[a i] / du[b k]
//! ```
//!
//! `A = dP/dF` is the consistent tangent; the derivative of `f_ext` is zero for dead loads. The rows and columns of
//! prescribed components are left out of `r` and `K`; their entries of `f_int - f_ext` are the reaction forces.
//!
//! # F-bar
//! The elements of a patch ([`Mesh::patches`](super::mesh::Mesh::patches)) share one dilatation `J0`, that of the
//! center of a hexahedron, or the volume of all tetrahedra of the patch over their reference volume. The constitutive
//! model gets
//!
//! ```text
//! F_bar = a F,    a = (J0 / J)^(1/3),    J = det F,
//! ```
//!
//! and its Cauchy stress `sigma(F_bar)` acts on the current volume, so that `P(F_bar) / a^2` takes the place of `P` in
//! `f_int` (E. A. de Souza Neto et al., Int. J. Solids Struct. 33 (1996) 3277-3296; for tetrahedra, Int. J. Numer.
//! Methods Eng. 62 (2005) 353-383). With `d ln a = (d ln J0 - F^-T : dF) / 3` its derivative is
//!
//! ```text
//! d(P / a^2) = A : dF / a + S (d ln J0 - F^-T : dF),    S = (A : F / a - 2 P / a^2) / 3,
//! ```
//!
//! with `P` and `A` at `F_bar`. `d ln J0` couples all nodes of the patch by a block of rank one. The stiffness is
//! unsymmetric, because the method does not derive from an energy.
//!
//! # Threads
//! All loops over elements and points use the threads of the current rayon pool, and results have the same bits for any
//! number of them. The entries of the stiffness are sums in mesh order ([`MatrixOps::add_blocks`]), with points, nodes
//! and components in local order. Forces are first summed over chunks of a fixed number of consecutive elements, then
//! the sums of the chunks are added in their order.

mod f_bar;
mod geometry;
pub mod local;
mod nodal_sums;
mod unknown_map;
mod unknowns;
mod volume;

use std::borrow::Cow;
use std::sync::Arc;

use nalgebra::{Matrix3, SMatrix};

pub use geometry::{Geometry, GeometryError, geometry};
pub use unknowns::{NodePattern, Unknowns};
pub(in crate::fem) use unknowns::{PartUnknowns, RankNumbers};
pub use volume::volume_tangent;

use super::boundary::Load;
use super::kinematics::{Kinematics, RigidMotion, Rows};
use super::mesh::Mesh;
use super::point_field::PointResponses;
use crate::las::{Backend, BlockSlots, Index, MatrixOps, RealBackend};
use f_bar::{PatchTangents, tangents};
use geometry::{Block, with_block};
use unknown_map::StateMap;
use volume::CavityFace;

/// Geometry and matrix positions of all elements, computed once; integrates and scatters at every state.
///
/// # Symmetry
/// The stiffness of the elements is [`Symmetry::Definite`](crate::las::Symmetry): `A` is symmetric because stresses
/// derive from an energy. [`Assembler::stiffness`] relies on it: only half of the node blocks are integrated. The
/// stiffness of patches is [`Symmetry::None`](crate::las::Symmetry), and that of loads may be; see [`Load::symmetry`].
pub struct Assembler<B: Backend> {
    geometry: Geometry,
    /// The positions of the stiffness in the matrix, for each block of elements.
    local_blocks: Vec<LocalBlock<B>>,
    /// The unknown of each node and component, at `3 * node + component`.
    equation_numbers: Vec<B::Index>,
    rigid_equations: Vec<[B::Index; 6]>,
    kinematics: Arc<Kinematics>,
    /// The number of rows on this rank; on a backend whose every rank holds all entries of a vector, that of all rows.
    rows: usize,
    /// Whether each point belongs to an own element; `None` if all do.
    own_points: Option<Vec<bool>>,
    /// The positions of the geometric stiffness of each rigid surface with rows on this rank.
    local_rigid: Vec<(usize, Vec<B::Slot>)>,
    /// The groups of coupled nodes of the loads that have rows on this rank.
    load_groups: Vec<LoadGroup<B>>,
    /// The patches with rows on this rank, and their positions in the matrix.
    local_patches: Vec<(usize, Vec<B::Slot>)>,
    /// The faces of constrained cavities with rows on this rank.
    cavity_faces: Vec<CavityFace<B::Slot>>,
}

/// The elements of a block with rows on this rank.
struct LocalBlock<B: Backend> {
    /// The numbers within the block of those whose unknowns are the components at their nodes, ascending; all elements
    /// on a serial backend if the body has neither frames nor rigid surfaces.
    elements: Vec<u32>,
    /// The positions of their stiffness.
    slots: BlockSlots<B>,
    /// The other elements, with the positions of their condensed stiffness ([`Kinematics::condense`]).
    condensed: Vec<(u32, Vec<B::Slot>)>,
    /// Whether elements of the block belong to patches, so that their tangents are unsymmetric.
    has_patches: bool,
}

/// The position in the matrix of one group of [`Load::coupled_nodes`].
struct LoadGroup<B: Backend> {
    load: usize,
    group: usize,
    /// The nodes of the group.
    nodes: Vec<u32>,
    /// The square of the number of rows, row-major.
    entry_positions: Vec<B::Slot>,
}

impl<B: RealBackend> Assembler<B> {
    /// Looks up the positions of the entries of all elements in `matrix`, whose sparsity pattern is
    /// [`Unknowns::pattern`].
    ///
    /// # Errors
    /// Returns the error of the backend.
    pub fn new(geometry: Geometry, unknowns: &Unknowns, matrix: &B::Matrix) -> Result<Self, B::Error> {
        let index = |&number: &i32| if number < 0 { B::Index::CONSTRAINED } else { B::Index::of(number as usize) };
        let equation_numbers: Vec<B::Index> = unknowns.equation_numbers().iter().map(index).collect();
        let rigid_equations = unknowns.rigid_equations().iter().map(|numbers| numbers.each_ref().map(index)).collect();
        let mut assembler = Self {
            geometry,
            local_blocks: Vec::new(),
            equation_numbers,
            rigid_equations,
            kinematics: Arc::clone(unknowns.kinematics()),
            rows: matrix.shape().0,
            own_points: None,
            local_rigid: Vec::new(),
            load_groups: Vec::new(),
            local_patches: Vec::new(),
            cavity_faces: Vec::new(),
        };
        let (geometry, locate) =
            (&assembler.geometry, |block: &_| with_block!(block, b => assembler.locate(b, matrix)));
        let mut local_blocks = geometry.blocks.iter().map(locate).collect::<Result<Vec<_>, _>>()?;
        let mut first = 0;
        for (block, local) in geometry.blocks.iter().zip(&mut local_blocks) {
            let elements = first..first + with_block!(block, b => b.nodes.len() as u32);
            let in_patches = geometry.patches.iter().flat_map(|patch| &patch.elements);
            local.has_patches = in_patches.into_iter().any(|element| elements.contains(element));
            first = elements.end;
        }
        assembler.local_blocks = local_blocks;
        for (number, patch) in assembler.geometry.patches.iter().enumerate() {
            if let Some(positions) = assembler.locate_nodes(&patch.nodes, matrix)? {
                assembler.local_patches.push((number, positions));
            }
        }
        for (number, rows) in assembler.rigid_equations.iter().enumerate() {
            if let Some(positions) = locate_rows::<B>(rows, matrix)? {
                assembler.local_rigid.push((number, positions));
            }
        }
        Ok(assembler)
    }

    /// Looks up the positions of the entries of a block in a matrix.
    fn locate<const N: usize, const Q: usize>(
        &self,
        block: &Block<N, Q>,
        matrix: &B::Matrix,
    ) -> Result<LocalBlock<B>, B::Error> {
        let rows_of = |nodes: &[u32; N]| -> [[B::Index; 3]; N] {
            nodes.map(|node| std::array::from_fn(|i| self.equation_numbers[3 * node as usize + i]))
        };
        let (mut elements, mut condensed) = (Vec::with_capacity(block.nodes.len()), Vec::new());
        let mut rows_of_all = Vec::with_capacity(3 * N * block.nodes.len());
        for (element, nodes) in (0..).zip(&block.nodes) {
            let rows = rows_of(nodes);
            if !self.kinematics.are_plain(nodes) {
                condensed.extend(self.locate_nodes(nodes, matrix)?.map(|positions| (element, positions)));
            } else if matrix.owns_any_row(rows.as_flattened()) {
                elements.push(element);
                rows_of_all.extend_from_slice(rows.as_flattened());
            }
        }
        let slots = matrix.locate_blocks(3 * N, &rows_of_all)?;
        debug_assert_eq!(slots.len(), elements.len(), "one block per element");
        Ok(LocalBlock { elements, slots, condensed, has_patches: false })
    }

    /// Restricts [`Assembler::squared_errors`] to the points of own elements of a part of a mesh.
    pub(in crate::fem) fn count_own_points(&mut self, mesh: &Mesh) {
        self.own_points = mesh.part().map(|_| mesh.own_points());
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
                if let Some(entry_positions) = self.locate_nodes(nodes, matrix)? {
                    self.load_groups.push(LoadGroup { load, group, nodes: nodes.to_vec(), entry_positions });
                }
            }
        }
        Ok(())
    }

    /// Returns the positions of the entries that couple nodes, in the order of [`Kinematics::rows`]; `None` if none of
    /// the rows is on this rank.
    fn locate_nodes(&self, nodes: &[u32], matrix: &B::Matrix) -> Result<Option<Vec<B::Slot>>, B::Error> {
        let rows = self.kinematics.rows(nodes).into_iter().flat_map(|rows| match rows {
            Rows::Node(node) => &self.equation_numbers[3 * node as usize..][..3],
            Rows::RigidSurface(surface) => &self.rigid_equations[surface],
        });
        locate_rows::<B>(&rows.copied().collect::<Vec<_>>(), matrix)
    }

    /// Returns the volumes and shape-function gradients of all points.
    pub fn geometry(&self) -> &Geometry {
        &self.geometry
    }

    /// Returns the equation number (row) of each node and component, at `3 * node + component`; negative for prescribed
    /// components.
    pub fn equation_numbers(&self) -> &[B::Index] {
        &self.equation_numbers
    }

    /// Returns the rows of the six unknowns of each rigid surface; negative for prescribed ones.
    pub(in crate::fem) fn rigid_equations(&self) -> &[[B::Index; 6]] {
        &self.rigid_equations
    }

    /// Returns true if elements belong to patches; the stiffness is then unsymmetric.
    pub fn has_patches(&self) -> bool {
        !self.geometry.patches.is_empty()
    }

    /// Computes `F` of each point from the displacements of all nodes, in meters; at points of patches, `F_bar`.
    ///
    /// # Panics
    /// Panics if `displacements` has fewer nodes than the mesh.
    pub fn deformation_gradients(&self, displacements: &[[f64; 3]], gradients: &mut Vec<Matrix3<f64>>) {
        self.geometry.deformation_gradients(displacements, gradients);
        f_bar::scale_gradients(&self.geometry.patches, displacements, gradients);
    }

    /// Computes `f_a = integral P grad N_a dV`, N, for all nodes, including prescribed components, from `P` of all
    /// points at these displacements; overwrites `forces`.
    ///
    /// # Panics
    /// Panics if `displacements` or `forces` has fewer nodes than the mesh, or `pk1` fewer points.
    pub fn internal_forces(&self, displacements: &[[f64; 3]], pk1: &[Matrix3<f64>], forces: &mut [[f64; 3]]) {
        let mut pk1 = Cow::Borrowed(pk1);
        if self.has_patches() {
            f_bar::scale_stresses(&self.geometry.patches, displacements, pk1.to_mut());
        }
        forces.fill([0.0; 3]);
        for block in &self.geometry.blocks {
            with_block!(block, b => b.add_internal_forces(&pk1, forces));
        }
    }

    /// Computes the first-order change `K du` of the internal forces, N, for the displacement `increments` of all
    /// nodes, prescribed components included; overwrites `forces`. Skips elements whose nodes do not move.
    ///
    /// # Panics
    /// Panics if an array has fewer nodes than the mesh, or `responses` fewer points.
    pub fn linearized_forces(
        &self,
        displacements: &[[f64; 3]],
        responses: &PointResponses,
        increments: &[[f64; 3]],
        forces: &mut [[f64; 3]],
    ) {
        let patches = self.patch_tangents(displacements, responses);
        let tangent = patches.as_ref().map_or(&responses.tangent, |patches| &patches.tangent);
        forces.fill([0.0; 3]);
        for block in &self.geometry.blocks {
            with_block!(block, b => b.add_linearized_forces(tangent, increments, forces));
        }
        let couplings = patches.iter().flat_map(|patches| &patches.couplings);
        for (patch, coupling) in self.geometry.patches.iter().zip(couplings) {
            coupling.add_linearized_forces(&patch.nodes, increments, forces);
        }
    }

    /// Adds `integral grad N_a . A . grad N_b dV`, N/m, to `k`, from the responses of all points at these displacements
    /// of the nodes, m, and motions of the rigid surfaces.
    /// With a distributed matrix, each rank integrates the elements that have rows on it.
    ///
    /// # Errors
    /// Returns the error of the backend.
    ///
    /// # Panics
    /// Panics if `displacements` has fewer nodes than the mesh, or `responses` fewer points.
    pub fn stiffness(
        &self,
        displacements: &[[f64; 3]],
        motions: &[RigidMotion],
        responses: &PointResponses,
        k: &mut B::Matrix,
    ) -> Result<(), B::Error> {
        let (map, patches) = (self.state_map(motions), self.patch_tangents(displacements, responses));
        let tangent = patches.as_ref().map_or(&responses.tangent, |patches| &patches.tangent);
        for (block, local) in self.geometry.blocks.iter().zip(&self.local_blocks) {
            with_block!(block, b => add_stiffness::<B, _, _>(b, local, tangent, &map, k))?;
        }
        if let Some(patches) = &patches {
            for (patch, positions) in &self.local_patches {
                let nodes = &self.geometry.patches[*patch].nodes;
                k.add_at(positions, &map.condense(nodes, &patches.couplings[*patch].stiffness()))?;
            }
        }
        Ok(())
    }

    fn patch_tangents(&self, displacements: &[[f64; 3]], responses: &PointResponses) -> Option<PatchTangents> {
        self.has_patches().then(|| tangents(&self.geometry.patches, displacements, responses))
    }

    /// Adds `-df_ext/du` of the loads given to [`Assembler::locate_loads`], N/m, to `k`, at pseudo-time `t` and the
    /// displacements of all nodes, m, and motions of the rigid surfaces.
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
        motions: &[RigidMotion],
        k: &mut B::Matrix,
    ) -> Result<(), B::Error> {
        let map = self.state_map(motions);
        let largest = self.load_groups.iter().map(|group| group.nodes.len()).max().unwrap_or(0);
        let mut block = vec![0.0; 9 * largest * largest];
        for LoadGroup { load, group, nodes, entry_positions } in &self.load_groups {
            let block = &mut block[..9 * nodes.len() * nodes.len()];
            block.fill(0.0);
            loads[*load].add_stiffness(t, displacements, *group, block);
            k.add_at(entry_positions, &map.condense(nodes, block))?;
        }
        Ok(())
    }

    /// Estimates the rounding error of the internal forces, N; a smaller residual is zero up to rounding.
    ///
    /// `F = I + du/dX` is rounded to `eps`, whatever the displacement gradient, and hence the stress to `|A| eps`. The
    /// contribution of a point to the force on node `a` is then wrong by about `V |A| |grad N_a| eps`; that to the
    /// stiffness of the node is of size `V |grad N_a|^2 |A|`. These errors are independent, so their squares add up.
    /// With a factor of 8, as at the micro scale, the estimate is `8 eps sqrt(sum_q sum_a (V |A| |grad N_a|)^2)` in
    /// Frobenius norms.
    pub fn rounding_error(&self, tangent: &[SMatrix<f64, 9, 9>]) -> f64 {
        Self::rounding_error_of(self.squared_errors(tangent))
    }

    /// Returns the sum `sum_q sum_a (V |A| |grad N_a|)^2` of [`Assembler::rounding_error`] over the points of own elements.
    pub(in crate::fem) fn squared_errors(&self, tangent: &[SMatrix<f64, 9, 9>]) -> f64 {
        let own = self.own_points.as_deref();
        let blocks = self.geometry.blocks.iter();
        blocks.map(|block| with_block!(block, b => b.squared_errors(tangent, own))).sum()
    }

    /// Returns the estimate of [`Assembler::rounding_error`] from this sum over all points.
    pub(in crate::fem) fn rounding_error_of(squares: f64) -> f64 {
        8.0 * f64::EPSILON * squares.sqrt()
    }
}

/// Returns the positions of the entries that couple rows; `None` if none of the rows is on this rank.
fn locate_rows<B: RealBackend>(rows: &[B::Index], matrix: &B::Matrix) -> Result<Option<Vec<B::Slot>>, B::Error> {
    if !matrix.owns_any_row(rows) {
        return Ok(None);
    }
    let mut entry_positions = Vec::new();
    matrix.locate(rows, rows, &mut entry_positions)?;
    Ok(Some(entry_positions))
}

fn add_stiffness<B: RealBackend, const N: usize, const Q: usize>(
    block: &Block<N, Q>,
    local: &LocalBlock<B>,
    tangent: &[SMatrix<f64, 9, 9>],
    map: &StateMap<'_>,
    k: &mut B::Matrix,
) -> Result<(), B::Error> {
    let tangent = block.of_points(tangent);
    let (elements, has_patches) = (&local.elements, local.has_patches);
    k.add_blocks(&local.slots, |number, entries| {
        let element = elements[number] as usize;
        let (points, tangent) = (&block.points[element], &tangent[element]);
        let Some(stiffness) = local::from_entries(entries) else { return false };
        if has_patches {
            *stiffness = local::unsymmetric_stiffness(points, tangent);
        } else {
            local::write_stiffness(points, tangent, stiffness);
        }
        true
    })?;
    for (element, positions) in &local.condensed {
        let element = *element as usize;
        let (points, tangent) = (&block.points[element], &tangent[element]);
        let stiffness = if local.has_patches {
            local::unsymmetric_stiffness(points, tangent)
        } else {
            local::stiffness(points, tangent)
        };
        k.add_at(positions, &map.condense(&block.nodes[element], local::entries(&stiffness)))?;
    }
    Ok(())
}

#[cfg(all(test, feature = "sparse"))]
mod tests;
