//! A block of hexahedral cells, each cut into six tetrahedra.

use super::{MAX_ELEMENTS, ShapeError};
use crate::fem::element::{ElementType, FaceNodes};
use crate::fem::mesh::{Elements, Faces};

/// The Kuhn subdivision of a cell with corners numbered `a + 2 b + 4 c` (`a`, `b`, `c` are 0 or 1 along x, y, z): six
/// tetrahedra of positive volume around the diagonal from corner 0 to corner 7, one for each path along the edges.
pub const KUHN: [[usize; 4]; 6] = [[0, 1, 3, 7], [0, 3, 2, 7], [0, 2, 6, 7], [0, 6, 4, 7], [0, 4, 5, 7], [0, 5, 1, 7]];

/// A block of cells. Nodes and cells are numbered with x running fastest, then y, then z.
#[derive(Clone, Copy)]
pub(super) struct Grid {
    cells: [usize; 3],
    /// The half along each axis (true: the upper one) in which the subdivision of the cells is mirrored, so that the
    /// subdivision of the block is symmetric about its three middle planes. `None`: all cells have the same
    /// subdivision.
    mirrored: Option<[bool; 3]>,
}

impl Grid {
    /// Creates a block. With `mirrored`, the number of cells along each axis must be even for symmetry.
    pub fn new(cells: [usize; 3], mirrored: Option<[bool; 3]>) -> Result<Self, ShapeError> {
        if cells.contains(&0) {
            return Err(ShapeError::NoCells(cells));
        }
        let elements = cells.iter().fold(6_u64, |product, &n| product.saturating_mul(n as u64));
        if elements > MAX_ELEMENTS {
            return Err(ShapeError::TooManyElements(elements));
        }
        Ok(Self { cells, mirrored })
    }

    /// Returns the positions of all nodes, computed from their grid indices `(i, j, k)`.
    pub fn nodes(&self, position: impl Fn(usize, usize, usize) -> [f64; 3]) -> Vec<[f64; 3]> {
        let [nx, ny, nz] = self.cells;
        let mut nodes = Vec::with_capacity((nx + 1) * (ny + 1) * (nz + 1));
        for k in 0..=nz {
            for j in 0..=ny {
                nodes.extend((0..=nx).map(|i| position(i, j, k)));
            }
        }
        nodes
    }

    /// Returns the tetrahedra, six per cell, and their regions, given the region of each cell.
    pub fn elements(&self, region: impl Fn([usize; 3]) -> u32) -> (Elements, Vec<u32>) {
        let [nx, ny, nz] = self.cells;
        let count = 6 * nx * ny * nz;
        let (mut elements, mut region_of) = (Vec::with_capacity(count), Vec::with_capacity(count));
        for k in 0..nz {
            for j in 0..ny {
                for i in 0..nx {
                    elements.extend(self.tetrahedra([i, j, k]));
                    region_of.extend([region([i, j, k]); 6]);
                }
            }
        }
        (elements.into(), region_of)
    }

    /// Returns two wedges per cell, which extend along z, or one hexahedron.
    pub fn uncut(&self, has_wedges: bool) -> Elements {
        // Corners of a cell in the order of the elements, numbered as in `KUHN`.
        let (element_type, corners): (_, &[&[usize]]) = match has_wedges {
            false => (ElementType::Hex8, &[&[0, 1, 3, 2, 4, 5, 7, 6]]),
            true => (ElementType::Wedge6, &[&[0, 1, 3, 4, 5, 7], &[0, 3, 2, 4, 7, 6]]),
        };
        let [nx, ny, nz] = self.cells;
        let mut elements = Elements::default();
        for cell in 0..nx * ny * nz {
            let (i, j, k) = (cell % nx, cell / nx % ny, cell / (nx * ny));
            for corners in corners {
                let node = |&corner: &usize| self.node(i + (corner & 1), j + (corner >> 1 & 1), k + (corner >> 2));
                let nodes: Vec<u32> = corners.iter().map(node).collect();
                elements.push(element_type, &nodes);
            }
        }
        elements
    }

    /// Returns the faces of elements on the lowest (`upper` false) or highest side along `axis`, with outward normals.
    pub fn side_of(&self, elements: &Elements, axis: usize, upper: bool) -> Faces {
        let plane = if upper { self.cells[axis] } else { 0 };
        let mut side = Faces::default();
        for (element_type, nodes) in elements.typed() {
            for FaceNodes { face_type, nodes: local } in element_type.faces() {
                let face: Vec<u32> = local.iter().map(|&node| nodes[node]).collect();
                if face.iter().all(|&node| self.grid_indices(node)[axis] == plane) {
                    side.push(*face_type, &face);
                }
            }
        }
        side
    }

    /// Returns the triangles of the lowest (`upper` false) or highest side along `axis`, with outward normals.
    pub fn side(&self, axis: usize, upper: bool) -> Vec<[u32; 3]> {
        let [u, v] = [(axis + 1) % 3, (axis + 2) % 3];
        let mut triangles = Vec::with_capacity(2 * self.cells[u] * self.cells[v]);
        let mut cell = [0; 3];
        cell[axis] = if upper { self.cells[axis] - 1 } else { 0 };
        let plane = if upper { self.cells[axis] } else { 0 };
        for second in 0..self.cells[v] {
            for first in 0..self.cells[u] {
                (cell[u], cell[v]) = (first, second);
                let faces = self.tetrahedra(cell).into_iter().flat_map(outward);
                triangles.extend(faces.filter(|face| face.iter().all(|&node| self.grid_indices(node)[axis] == plane)));
            }
        }
        triangles
    }

    /// Returns the six tetrahedra of a cell.
    fn tetrahedra(&self, cell: [usize; 3]) -> [[u32; 4]; 6] {
        let in_upper_half = |axis: usize| 2 * cell[axis] >= self.cells[axis];
        let flip: [bool; 3] = match self.mirrored {
            Some(mirror_upper) => std::array::from_fn(|axis| in_upper_half(axis) == mirror_upper[axis]),
            None => [false; 3],
        };
        let inverted = flip.iter().filter(|&&flip| flip).count() % 2 == 1;
        KUHN.map(|corners| {
            let [a, b, c, d] = corners.map(|corner| {
                let [i, j, k] =
                    std::array::from_fn(|axis| cell[axis] + usize::from((corner >> axis & 1 == 1) != flip[axis]));
                self.node(i, j, k)
            });
            // An odd number of reflections reverses the orientation.
            if inverted { [a, c, b, d] } else { [a, b, c, d] }
        })
    }

    /// Returns the index of a node, which fits in 32 bits: there are fewer than eight nodes per cell.
    fn node(&self, i: usize, j: usize, k: usize) -> u32 {
        (i + (self.cells[0] + 1) * (j + (self.cells[1] + 1) * k)) as u32
    }

    /// Returns the grid indices of a node.
    pub fn grid_indices(&self, node: u32) -> [usize; 3] {
        let (row, layer) = (self.cells[0] + 1, self.cells[1] + 1);
        let node = node as usize;
        [node % row, node / row % layer, node / (row * layer)]
    }
}

/// Returns the faces of a tetrahedron of positive volume, with outward normals.
fn outward([a, b, c, d]: [u32; 4]) -> [[u32; 3]; 4] {
    [[b, c, d], [a, d, c], [a, b, d], [a, c, b]]
}
