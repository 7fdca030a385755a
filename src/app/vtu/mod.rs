//! Meshes in VTK's XML form for unstructured grids (`.vtu`), as ParaView, VTK, meshio and this program write them.
//!
//! | cells | VTK's numbers | become |
//! |---|---|---|
//! | tetrahedra, hexahedra, linear wedges | 10, 24; 12, 25, 29; 13 | elements |
//! | triangles and quadrilaterals, linear or quadratic | 5, 22; 9, 23, 28 | faces of surfaces |
//! | points and lines | 1, 2; 3, 4, 21 | nothing |
//!
//! Regions and surfaces are the values of an integer array of the cells: the first that the file has of `region`,
//! `gmsh:physical`, `medit:ref`, `cell_tags` and `CellEntityIds`. The elements with the value 1 form `region_1`, the
//! faces with the value 2 `surface_2`. Without such an array, the elements form the region `body` and the faces, if
//! there are any, the surface `surface`.
//!
//! The arrays may be text, base64 or appended, of any number type and byte order, and compressed by zlib. (`vtkio` 0.7
//! panics on damaged input, omits the last block of a compressed array of full blocks, and does not compress. It would
//! also hold several copies of all arrays of a file in memory.)

mod cell_data;
mod cells;
pub(in crate::app) mod decode;
pub(in crate::app) mod file;
#[cfg(test)]
mod tests;

use std::path::Path;

use crate::fem::mesh::gmsh::MeshFile;
use crate::fem::mesh::parts::{Parts, make_upright, reversed_warning};
use crate::fem::mesh::{Elements, MeshError};
use crate::input::InputError;

pub(crate) use cell_data::center;
pub use cell_data::{CellData, ElementArray, read_cells};
use cells::{Cell, CellKind, GroupArray};
use decode::Numbers;
use file::Grid;

/// Returns true if the name of a file ends in `.vtu`.
pub fn is_vtu(path: &Path) -> bool {
    path.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("vtu"))
}

/// Reads a mesh, in the units of the file.
///
/// # Errors
/// Returns [`InputError`] if the file cannot be read, is not an unstructured grid, has cells of other types, or if its
/// cells do not form a valid mesh.
pub fn read(path: &Path) -> Result<MeshFile, InputError> {
    let grid = file::read(path)?;
    let nodes = positions(path, &grid)?;
    let mut cells = cells::read(path, &grid, nodes.len())?;
    let array = GroupArray::find(path, &grid.of_cells, cells.len())?;
    // As for Gmsh files: one block per type; the order within a type does not change.
    cells.sort_by_key(|cell| cell.kind);

    let (mut elements, mut reversed, mut cell_of) = (Elements::default(), 0, Vec::new());
    for Cell { number, kind, nodes: of_cell } in &mut cells {
        if let CellKind::Volume(element_type) = *kind {
            reversed += usize::from(make_upright(element_type, of_cell, &nodes));
            elements.push(element_type, of_cell);
            cell_of.push(*number);
        }
    }
    if elements.is_empty() {
        let problem = match cells.iter().filter(|cell| matches!(cell.kind, CellKind::Face(_))).count() {
            0 => "the grid has no cells with a volume".to_owned(),
            faces => format!("the grid has no cells with a volume, only {faces} faces"),
        };
        let cure = "mesh the volume and export it; a surface alone is no body";
        return Err(InputError::at_line(path, grid.line, problem, "a body of tetrahedra, hexahedra or wedges", cure));
    }
    let (regions, region_of) = array.regions(&cell_of);
    let groups = array.surfaces(&cells);
    let warnings = reversed_warning(reversed).into_iter().collect();
    let parts = Parts { nodes, elements, region_of, regions, groups };
    parts.into_mesh(warnings, |error, groups| {
        let cell = match error {
            MeshError::NotAFace { surface, face, .. } | MeshError::DuplicateFace { surface, second: face, .. } => {
                let group = groups.iter().find(|(name, _)| name == surface);
                group.and_then(|(_, faces)| faces.get(*face)).map(|&(_, _, cell)| cell)
            }
            MeshError::RepeatedNode { element, .. }
            | MeshError::Flat { element, .. }
            | MeshError::Inverted { element, .. }
            | MeshError::Distorted { element, .. }
            | MeshError::Overlap { first: element, .. }
            | MeshError::Nonconforming { first: element, .. } => cell_of.get(*element).copied(),
            _ => None,
        };
        let of_file = cell.map(|cell| format!(" (cell {cell} of the file, from 0)")).unwrap_or_default();
        let problem = format!("{error}{of_file}");
        InputError::in_file(
            path,
            problem,
            "cells that form a body",
            "correct the mesh where it was made, and export it again",
        )
    })
}

/// Returns the positions of the nodes.
fn positions(path: &Path, grid: &Grid) -> Result<Vec<[f64; 3]>, InputError> {
    let array = &grid.positions;
    let invalid =
        |problem: String| InputError::at_line(path, array.line, problem, "three numbers per point", file::DAMAGED);
    if array.components != 3 {
        return Err(invalid(format!("the positions have {} components", array.components)));
    }
    let numbers = match &array.numbers {
        Numbers::Reals(numbers) => numbers.clone(),
        Numbers::Integers(numbers) => numbers.iter().map(|&number| number as f64).collect(),
    };
    let nodes = numbers.as_chunks::<3>().0.to_vec();
    if u32::try_from(nodes.len()).is_err() {
        return Err(invalid(MeshError::TooLarge(nodes.len()).to_string()));
    }
    Ok(nodes)
}
