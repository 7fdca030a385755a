//! The cells of a grid: their types, their nodes, and the array that groups them into regions and surfaces.

use std::path::Path;

use super::decode::Numbers;
use super::file::{Array, DAMAGED, Grid};
use crate::app::results::{volume_type, vtk_place};
use crate::fem::element::{CellType, ElementType, FaceType};
use crate::fem::mesh::parts::GroupFaces;
use crate::input::{InputError, excerpt};

/// The names of the array of groups: of this program, and of meshio for Gmsh, Medit and MED files, and of VTK's reader
/// of Gmsh files.
const GROUP_ARRAYS: [&str; 5] = ["region", "gmsh:physical", "medit:ref", "cell_tags", "CellEntityIds"];

/// What becomes of a cell.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum CellKind {
    Volume(ElementType),
    Face(FaceType),
    /// A point or a line.
    Ignored,
}

/// A cell of the file.
pub(super) struct Cell {
    /// Its number in the file, from 0.
    pub number: usize,
    pub kind: CellKind,
    /// Its nodes in the order of the reference elements; empty if it is ignored.
    pub nodes: Vec<u32>,
}

impl CellKind {
    fn of(vtk: i64) -> Option<Self> {
        let face = |of| Some(Self::Face(of));
        match vtk {
            1..=4 | 21 => Some(Self::Ignored),
            5 => face(FaceType::Tri3),
            22 => face(FaceType::Tri6),
            9 => face(FaceType::Quad4),
            23 => face(FaceType::Quad8),
            28 => face(FaceType::Quad9),
            other => volume_type(other).map(Self::Volume),
        }
    }
}

/// Reads the cells.
pub(super) fn read(path: &Path, grid: &Grid, points: usize) -> Result<Vec<Cell>, InputError> {
    let (connectivity, offsets) = (integers(path, &grid.connectivity)?, integers(path, &grid.offsets)?);
    let types = integers(path, &grid.types)?;
    if types.is_empty() {
        let cure = "export the body as tetrahedra, hexahedra or wedges";
        return Err(InputError::at_line(path, grid.line, "the grid has no cells", "a body of cells", cure));
    }
    let (mut cells, mut start) = (Vec::with_capacity(types.len()), 0);
    for (number, (&vtk, &end)) in types.iter().zip(offsets).enumerate() {
        let kind = CellKind::of(vtk).ok_or_else(|| unsupported(path, grid.types.line, number, vtk))?;
        let damaged =
            |problem: String| InputError::at_line(path, grid.offsets.line, problem, "the nodes of each cell", DAMAGED);
        let of_cell = usize::try_from(end).ok().and_then(|end| connectivity.get(start..end)).ok_or_else(|| {
            damaged(format!("the nodes of cell {number} end at {end}, after {start} of {}", connectivity.len()))
        })?;
        start += of_cell.len();
        if let Some(node) = of_cell.iter().find(|&&node| !usize::try_from(node).is_ok_and(|node| node < points)) {
            let problem = format!("cell {number} names node {node}, but there are {points} points (from 0)");
            return Err(InputError::at_line(path, grid.connectivity.line, problem, "nodes of this file", DAMAGED));
        }
        let count = match kind {
            CellKind::Volume(of) => of.nodes(),
            CellKind::Face(of) => of.nodes(),
            CellKind::Ignored => of_cell.len(),
        };
        if of_cell.len() != count {
            return Err(damaged(format!("cell {number} of type {vtk} has {} nodes, not {count}", of_cell.len())));
        }
        // All nodes are below the number of points, which fits into 32 bits.
        let nodes = match kind {
            CellKind::Volume(of) => (0..count).map(|node| of_cell[vtk_place(of, node)] as u32).collect(),
            CellKind::Face(_) => of_cell.iter().map(|&node| node as u32).collect(),
            CellKind::Ignored => Vec::new(),
        };
        cells.push(Cell { number, kind, nodes });
    }
    Ok(cells)
}

/// Returns the numbers of an array of integers.
fn integers<'a>(path: &Path, array: &'a Array) -> Result<&'a [i64], InputError> {
    match &array.numbers {
        Numbers::Integers(numbers) => Ok(numbers),
        Numbers::Reals(_) => {
            let problem = format!("the array `{}` holds floating-point numbers", excerpt(&array.name));
            let cure = "write the array as Int32 or Int64, or give it another name if it does not number groups";
            Err(InputError::at_line(path, array.line, problem, "an array of integers", cure))
        }
    }
}

fn unsupported(path: &Path, line: usize, cell: usize, vtk: i64) -> InputError {
    const ORDER: &str = "export the mesh with elements of order 1 or 2";
    const PYRAMIDS: &str = "mesh the body without pyramids: with tetrahedra only, or with hexahedra and wedges only";
    const GRID: &str = "convert the grid to tetrahedra (in ParaView: Tetrahedralize) or to hexahedra";
    let (name, cure) = match vtk {
        6 => ("triangle strip", "convert strips to triangles (in ParaView: Triangulate)"),
        7 => ("polygon", "convert polygons to triangles (in ParaView: Triangulate)"),
        8 => ("pixel", GRID),
        11 => ("voxel", GRID),
        14 => ("pyramid", PYRAMIDS),
        15 => ("pentagonal prism", GRID),
        16 => ("hexagonal prism", GRID),
        26 => ("quadratic wedge", "export wedges with order 1, the only order supported here"),
        27 => ("quadratic pyramid", PYRAMIDS),
        30 => ("biquadratic quadrilateral of 6 nodes", ORDER),
        31 => ("quadratic-linear wedge", "export wedges with order 1, the only order supported here"),
        32 => ("biquadratic-quadratic wedge", "export wedges with order 1, the only order supported here"),
        33 => ("hexahedron of 24 nodes", "export hexahedra of 20 or 27 nodes"),
        34 => ("biquadratic triangle", "export triangles of 6 nodes"),
        42 => ("polyhedron", GRID),
        68..=74 => ("cell of Lagrange", ORDER),
        75..=81 => ("Bezier cell", ORDER),
        _ => ("cell of unknown kind", DAMAGED),
    };
    let problem = format!("cell {cell} is of type {vtk} ({name})");
    let expected = "tetrahedra (10, 24), hexahedra (12, 25, 29), wedges (13), and faces of them (5, 22, 9, 23, 28)";
    InputError::at_line(path, line, problem, expected, cure)
}

/// The groups of the cells, if an array numbers them.
pub(super) struct GroupArray<'a>(Option<&'a [i64]>);

impl<'a> GroupArray<'a> {
    /// Finds the array of groups.
    pub fn find(path: &Path, arrays: &'a [Array], cells: usize) -> Result<Self, InputError> {
        let named = |name: &&str| arrays.iter().find(|array| array.name == *name);
        let Some(array) = GROUP_ARRAYS.iter().find_map(named) else { return Ok(Self(None)) };
        let numbers = integers(path, array)?;
        if numbers.len() != cells {
            let problem = format!("the array `{}` has {} values for {cells} cells", array.name, numbers.len());
            return Err(InputError::at_line(path, array.line, problem, "one integer per cell", DAMAGED));
        }
        Ok(Self(Some(numbers)))
    }

    /// Returns the names of the regions, and the region of each element, given the cell of each.
    pub fn regions(&self, cell_of: &[usize]) -> (Vec<String>, Vec<u32>) {
        let Some(groups) = self.0 else { return (vec!["body".into()], vec![0; cell_of.len()]) };
        let of: Vec<i64> = cell_of.iter().map(|&cell| groups[cell]).collect();
        let mut numbers = of.clone();
        numbers.sort_unstable();
        numbers.dedup();
        let region_of = of.iter().map(|group| numbers.partition_point(|number| number < group) as u32);
        (numbers.iter().map(|number| format!("region_{number}")).collect(), region_of.collect())
    }

    /// Returns the surfaces with their faces.
    pub fn surfaces(&self, cells: &[Cell]) -> Vec<(String, GroupFaces)> {
        let mut surfaces = std::collections::BTreeMap::<i64, GroupFaces>::new();
        for cell in cells {
            if let CellKind::Face(face_type) = cell.kind {
                let group = self.0.map_or(0, |groups| groups[cell.number]);
                surfaces.entry(group).or_default().push((face_type, cell.nodes.clone(), cell.number));
            }
        }
        let name = |number| if self.0.is_some() { format!("surface_{number}") } else { "surface".into() };
        surfaces.into_iter().map(|(number, faces)| (name(number), faces)).collect()
    }
}
