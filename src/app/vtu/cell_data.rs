//! The values of the cells of a file.

use std::path::{Path, PathBuf};

use super::cells::{self, Cell, CellKind};
use super::decode::Numbers;
use super::file::{self, Grid};
use super::positions;
use crate::fem::element::CellType;
use crate::input::{InputError, excerpt};

/// The arrays of the cells of a file, with its grid.
pub struct CellData {
    path: PathBuf,
    grid: Grid,
    nodes: Vec<[f64; 3]>,
    /// In the order in which [`read`](super::read) numbers the elements.
    cells: Vec<Cell>,
}

/// The values of an array of the cells, those of the cells that are elements.
#[derive(Clone, Debug, PartialEq)]
pub struct ElementArray {
    /// Line of the array in the file, from 1.
    pub line: usize,
    /// Number of values per element.
    pub components: usize,
    /// The values, element by element, in the order in which [`read`](super::read) numbers the elements.
    pub values: Vec<f64>,
}

/// Reads the cells of a file and their arrays.
///
/// # Errors
/// Returns [`InputError`] as [`read`](super::read) does.
pub fn read_cells(path: &Path) -> Result<CellData, InputError> {
    let grid = file::read(path)?;
    let nodes = positions(path, &grid)?;
    let mut cells = cells::read(path, &grid, nodes.len())?;
    cells.sort_by_key(|cell| cell.kind);
    Ok(CellData { path: path.into(), grid, nodes, cells })
}

impl CellData {
    /// Returns the values of the array of this name.
    ///
    /// # Errors
    /// Returns [`InputError`] if there is no such array or if it has a wrong number of values.
    pub fn array(&self, name: &str) -> Result<ElementArray, InputError> {
        let Self { path, grid, cells, .. } = self;
        let Some(array) = grid.of_cells.iter().find(|array| array.name == name) else {
            let names: Vec<String> =
                grid.of_cells.iter().map(|array| format!("\"{}\"", excerpt(&array.name))).collect();
            let problem = format!("the cells have no array \"{}\"", excerpt(name));
            let expected = match names.is_empty() {
                true => "arrays of cells, of which there are none".to_owned(),
                false => format!("one of the arrays of cells: {}", names.join(", ")),
            };
            return Err(InputError::at_line(path, grid.line, problem, expected, "correct the name, or add the array"));
        };
        let numbers: Vec<f64> = match &array.numbers {
            Numbers::Reals(numbers) => numbers.clone(),
            Numbers::Integers(numbers) => numbers.iter().map(|&number| number as f64).collect(),
        };
        let (components, count) = (array.components, cells.len());
        if numbers.len() != components.saturating_mul(count) {
            let problem = format!(
                "the array \"{}\" has {} values, {components} per cell, for {count} cells",
                excerpt(name),
                numbers.len()
            );
            return Err(InputError::at_line(path, array.line, problem, "values of every cell", file::DAMAGED));
        }
        let values = self.elements().flat_map(|(cell, _)| numbers[cell.number * components..][..components].to_vec());
        Ok(ElementArray { line: array.line, components, values: values.collect() })
    }

    /// Returns the mean position of the corners of each element, in the units of the file.
    pub fn centers(&self) -> Vec<[f64; 3]> {
        self.elements().map(|(cell, corners)| center(&self.nodes, &cell.nodes[..corners])).collect()
    }

    /// Returns the number, from 0, of the cell that is an element.
    pub fn cell_of(&self, element: usize) -> Option<usize> {
        self.elements().nth(element).map(|(cell, _)| cell.number)
    }

    /// Returns the line of the positions in the file, from 1.
    pub fn line_of_positions(&self) -> usize {
        self.grid.positions.line
    }

    /// Returns the cells that are elements, with their number of corners.
    fn elements(&self) -> impl Iterator<Item = (&Cell, usize)> {
        self.cells.iter().filter_map(|cell| match cell.kind {
            CellKind::Volume(of) => Some((cell, of.corners())),
            _ => None,
        })
    }
}

/// Returns the mean position of nodes.
pub(crate) fn center(nodes: &[[f64; 3]], of: &[u32]) -> [f64; 3] {
    let sum =
        of.iter().fold([0.0; 3], |sum: [f64; 3], &node| std::array::from_fn(|i| sum[i] + nodes[node as usize][i]));
    sum.map(|sum| sum / of.len() as f64)
}
