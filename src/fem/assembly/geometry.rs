//! Geometry of all elements, in blocks of one type, and the integrals over one block.

use nalgebra::{Matrix3, SMatrix};
use thiserror::Error;

use super::f_bar::{self, Patch};
use super::local;
use super::nodal_sums::{self, ELEMENTS_PER_CHUNK, ElementChunk, scatter};
use crate::fem::element::reference::Element;
use crate::fem::element::{self, ElementError, ElementType, PointGeometry};
use crate::fem::mesh::{self, Mesh};
use crate::parallel;
use crate::tensor::{cofactor, contract};

/// An element of the mesh that is degenerate.
#[derive(Clone, Copy, Debug, Error, PartialEq)]
#[error("element {element}: {reason}")]
pub struct GeometryError {
    /// Element index, from 0.
    pub element: usize,
    /// The defect of the element.
    pub reason: ElementError,
}

/// Volumes and shape-function gradients of all integration points of a mesh.
#[derive(Clone, Debug)]
pub struct Geometry {
    pub(super) blocks: Vec<ElementBlock>,
    /// The patches of elements that share one dilatation.
    pub(super) patches: Vec<Patch>,
}

/// Consecutive elements of one type with `N` nodes and `Q` integration points each.
#[derive(Clone, Debug)]
pub struct Block<const N: usize, const Q: usize> {
    /// The nodes of each element.
    pub nodes: Vec<[u32; N]>,
    /// The points of each element.
    pub points: Vec<[PointGeometry<N>; Q]>,
    /// The first point of the block among all points of the mesh.
    pub first_point: usize,
    /// The elements in chunks whose nodal values are summed apart.
    chunks: Vec<ElementChunk<N>>,
}

/// A block of any element type.
#[derive(Clone, Debug)]
pub(super) enum ElementBlock {
    Tet4(Block<4, 1>),
    Tet10(Block<10, 4>),
    Hex8(Block<8, 8>),
    Hex20(Block<20, 27>),
    Hex27(Block<27, 27>),
    Wedge6(Block<6, 6>),
}

/// Evaluates an expression with the block `$b` in an [`ElementBlock`].
macro_rules! with_block {
    ($block:expr, $b:ident => $body:expr) => {
        match $block {
            $crate::fem::assembly::geometry::ElementBlock::Tet4($b) => $body,
            $crate::fem::assembly::geometry::ElementBlock::Tet10($b) => $body,
            $crate::fem::assembly::geometry::ElementBlock::Hex8($b) => $body,
            $crate::fem::assembly::geometry::ElementBlock::Hex20($b) => $body,
            $crate::fem::assembly::geometry::ElementBlock::Hex27($b) => $body,
            $crate::fem::assembly::geometry::ElementBlock::Wedge6($b) => $body,
        }
    };
}

pub(super) use with_block;

/// Computes volumes and shape-function gradients of all integration points.
///
/// # Errors
/// Returns [`GeometryError`] for the first degenerate element; if the mesh is a part, with its number in the whole one.
pub fn geometry(mesh: &Mesh) -> Result<Geometry, GeometryError> {
    of_elements(mesh).map_err(|error| {
        let element = mesh.part().map_or(error.element, |part| part.elements[error.element] as usize);
        GeometryError { element, ..error }
    })
}

fn of_elements(mesh: &Mesh) -> Result<Geometry, GeometryError> {
    use element::reference::{Hex8, Hex20, Hex27, Tet4, Tet10, Wedge6};
    let of_block = |block: &mesh::Block<ElementType>| {
        Ok(match block.cell_type() {
            ElementType::Tet4 => ElementBlock::Tet4(Block::new::<Tet4>(mesh, block)?),
            ElementType::Tet10 => ElementBlock::Tet10(Block::new::<Tet10>(mesh, block)?),
            ElementType::Hex8 => ElementBlock::Hex8(Block::new::<Hex8>(mesh, block)?),
            ElementType::Hex20 => ElementBlock::Hex20(Block::new::<Hex20>(mesh, block)?),
            ElementType::Hex27 => ElementBlock::Hex27(Block::new::<Hex27>(mesh, block)?),
            ElementType::Wedge6 => ElementBlock::Wedge6(Block::new::<Wedge6>(mesh, block)?),
        })
    };
    let blocks = mesh.elements().blocks().iter().map(of_block).collect::<Result<_, _>>()?;
    let mut geometry = Geometry { blocks, patches: Vec::new() };
    geometry.patches = f_bar::patches(mesh, &geometry)?;
    Ok(geometry)
}

impl Geometry {
    /// Returns the number of integration points.
    pub(super) fn points(&self) -> usize {
        self.blocks.iter().map(|block| with_block!(block, b => b.points.as_flattened().len())).sum()
    }

    /// Computes `F` of each point from the displacements of all nodes, in meters.
    pub(super) fn deformation_gradients(&self, displacements: &[[f64; 3]], gradients: &mut Vec<Matrix3<f64>>) {
        gradients.resize(self.points(), Matrix3::identity());
        for block in &self.blocks {
            with_block!(block, b => b.deformation_gradients(displacements, gradients));
        }
    }

    /// Returns the volume of each integration point, m^3.
    pub fn volumes(&self) -> Vec<f64> {
        let of_block = |block: &ElementBlock| -> Vec<f64> {
            with_block!(block, b => b.points.as_flattened().iter().map(|point| point.volume).collect())
        };
        self.blocks.iter().flat_map(of_block).collect()
    }

    /// Returns the largest norm of the gradient of a shape function, 1/m.
    pub fn steepest_gradient(&self) -> f64 {
        let of_blocks = self.blocks.iter().map(|block| with_block!(block, b => b.steepest_gradient()));
        of_blocks.fold(0.0, f64::max)
    }

    /// Returns the volume, m^3, and the shape-function gradients of a point.
    pub(super) fn point(&self, number: usize) -> (f64, Vec<[f64; 3]>) {
        let first = |block: &ElementBlock| with_block!(block, b => b.first_point);
        let block = &self.blocks[self.blocks.partition_point(|block| first(block) <= number) - 1];
        with_block!(block, b => {
            let point = &b.points.as_flattened()[number - b.first_point];
            (point.volume, point.gradients.to_vec())
        })
    }
}

impl<const N: usize, const Q: usize> Block<N, Q> {
    fn new<E: Element<3, N, Q>>(mesh: &Mesh, block: &mesh::Block<ElementType>) -> Result<Self, GeometryError> {
        let (nodes, _) = block.nodes().as_chunks::<N>();
        let of_element = |number: usize| {
            let (element, positions) =
                (block.range().start + number, nodes[number].map(|node| mesh.nodes()[node as usize]));
            element::geometry::<E, N, Q>(&positions).map_err(|reason| GeometryError { element, reason })
        };
        let placeholder = [PointGeometry { volume: 0.0, gradients: [[0.0; 3]; N] }; Q];
        Ok(Self {
            chunks: ElementChunk::all(nodes),
            nodes: nodes.to_vec(),
            points: parallel::try_collect(nodes.len(), placeholder, of_element)?,
            first_point: mesh.points().of_element(block.range().start).start,
        })
    }

    /// Returns the entries of this block in an array with one entry per point of the mesh, by element.
    pub fn of_points<'a, T>(&self, values: &'a [T]) -> &'a [[T; Q]] {
        values[self.first_point..self.first_point + Q * self.nodes.len()].as_chunks().0
    }

    /// Returns the entries of this block in an array with one entry per point of the mesh, by element, mutably.
    fn of_points_mut<'a, T>(&self, values: &'a mut [T]) -> &'a mut [[T; Q]] {
        values[self.first_point..self.first_point + Q * self.nodes.len()].as_chunks_mut().0
    }

    /// Computes `F` of each point of the block, in an array with one entry per point of the mesh.
    pub fn deformation_gradients(&self, displacements: &[[f64; 3]], gradients: &mut [Matrix3<f64>]) {
        let elements = self.points.chunks(ELEMENTS_PER_CHUNK).zip(self.nodes.chunks(ELEMENTS_PER_CHUNK));
        let chunks = elements.zip(self.of_points_mut(gradients).chunks_mut(ELEMENTS_PER_CHUNK));
        parallel::map(chunks, |((points, nodes), gradients)| {
            for ((points, nodes), gradients) in points.iter().zip(nodes).zip(gradients) {
                let u = gather(displacements, nodes);
                for (point, f) in points.iter().zip(gradients) {
                    *f = point.deformation_gradient(&u);
                }
            }
        });
    }

    /// Adds `integral P grad N_a dV` to the forces on the nodes.
    pub fn add_internal_forces(&self, pk1: &[Matrix3<f64>], forces: &mut [[f64; 3]]) {
        let pk1 = self.of_points(pk1);
        nodal_sums::add(&self.chunks, forces, |element, forces, nodes| {
            for (point, p) in self.points[element].iter().zip(&pk1[element]) {
                scatter(forces, nodes, local::internal_force(point, p));
            }
            0.0
        });
    }

    /// Adds the first-order change of the internal forces; skips elements whose nodes do not move.
    pub fn add_linearized_forces(
        &self,
        tangent: &[SMatrix<f64, 9, 9>],
        increments: &[[f64; 3]],
        forces: &mut [[f64; 3]],
    ) {
        let tangent = self.of_points(tangent);
        nodal_sums::add(&self.chunks, forces, |element, forces, nodes| {
            let moved = gather(increments, &self.nodes[element]);
            if moved != [[0.0; 3]; N] {
                for (point, a) in self.points[element].iter().zip(&tangent[element]) {
                    let dp = contract(a, &point.displacement_gradient(&moved));
                    scatter(forces, nodes, local::internal_force(point, &dp));
                }
            }
            0.0
        });
    }

    /// Returns the deformed volume at the points marked in `points`, m^3, of which `own` may select some, and adds the
    /// derivatives of all by the displacements of the nodes, m^2, to `gradient`.
    pub fn add_volume_gradient(
        &self,
        (points, own): (&[bool], Option<&[bool]>),
        displacements: &[[f64; 3]],
        gradient: &mut [[f64; 3]],
    ) -> f64 {
        let is_inside = self.of_points(points);
        // All points of an element belong to one rank.
        let own = own.map(|own| self.of_points(own));
        let is_own = |element: usize| own.is_none_or(|own| own[element][0]);
        let volumes = nodal_sums::add(&self.chunks, gradient, |element, gradient, nodes| {
            let u = gather(displacements, &self.nodes[element]);
            let mut volume = 0.0;
            for (point, _) in self.points[element].iter().zip(&is_inside[element]).filter(|(_, is_inside)| **is_inside)
            {
                let f = point.deformation_gradient(&u);
                volume += point.volume * f.determinant();
                scatter(gradient, nodes, local::internal_force(point, &cofactor(&f)));
            }
            if is_own(element) { volume } else { 0.0 }
        });
        volumes.into_iter().sum()
    }

    /// Returns the largest norm of the gradient of a shape function, 1/m.
    pub fn steepest_gradient(&self) -> f64 {
        let gradients = self.points.as_flattened().iter().flat_map(|point| &point.gradients);
        gradients.map(|g| g.iter().map(|x| x * x).sum::<f64>()).fold(0.0, f64::max).sqrt()
    }

    /// Returns the sum over all own points and their nodes of the squared errors of the forces, divided by `eps`; see
    /// [`Assembler::rounding_error`](super::Assembler::rounding_error).
    pub fn squared_errors(&self, tangent: &[SMatrix<f64, 9, 9>], own: Option<&[bool]>) -> f64 {
        let own = own.map(|own| self.of_points(own).as_flattened());
        let points = self.points.chunks(ELEMENTS_PER_CHUNK);
        let starts = (0..).step_by(Q * ELEMENTS_PER_CHUNK);
        let chunks = starts.zip(points.zip(self.of_points(tangent).chunks(ELEMENTS_PER_CHUNK)));
        let sums: Vec<f64> = parallel::map(chunks, |(start, (points, tangent))| {
            let is_own = |(number, _): &(usize, _)| own.is_none_or(|own| own[*number]);
            let points = (start..).zip(points.as_flattened().iter().zip(tangent.as_flattened())).filter(is_own);
            let squares = points.map(|(_, (p, a))| {
                let gradients: f64 = p.gradients.as_flattened().iter().map(|g| g * g).sum();
                p.volume * p.volume * a.norm_squared() * gradients
            });
            squares.sum()
        });
        sums.into_iter().sum()
    }
}

#[inline(always)]
fn gather<const N: usize>(values: &[[f64; 3]], nodes: &[u32; N]) -> [[f64; 3]; N] {
    let mut gathered = [[0.0; 3]; N];
    for (to, &node) in gathered.iter_mut().zip(nodes) {
        *to = values[node as usize];
    }
    gathered
}
