//! Values on a regular grid.
//!
//! The file is text: numbers between blanks, commas or line breaks, and comments from `#` to the end of a line. The first
//! nine numbers are the lowest corner of the grid, the edges of a cell, and the numbers of cells, each along x, y and z,
//! with lengths in mesh units; then follow the values of the cells, those along x first, then along y, then along z.

use std::path::{Path, PathBuf};

use crate::fem::mesh::IntegrationPoint;
use crate::input::{InputError, excerpt, without_byte_order_mark};

const EXPECTED: &str = "a regular grid: x0 y0 z0 dx dy dz nx ny nz, then nx*ny*nz numbers, those along x first";
const CURE: &str = "correct the file; lengths are in mesh units, and # begins a comment";

/// Values in the cells of a regular grid.
#[derive(Debug)]
pub(in crate::app::material_fields) struct Grid {
    file: PathBuf,
    origin: [f64; 3],
    edges: [f64; 3],
    counts: [usize; 3],
    values: Vec<f64>,
    /// The line of each value.
    lines: Vec<u32>,
}

impl Grid {
    /// Reads a file.
    pub fn read(file: &Path) -> Result<Self, InputError> {
        let bytes = std::fs::read(file).map_err(|error| InputError::unreadable(file, &error))?;
        Self::parse(file, &String::from_utf8_lossy(without_byte_order_mark(&bytes)))
    }

    fn parse(file: &Path, text: &str) -> Result<Self, InputError> {
        let lines = (1..).zip(text.lines());
        let words = lines.flat_map(|(line, text): (u32, &str)| {
            let text = text.split('#').next().unwrap_or_default();
            let words = text.split(|c: char| c.is_ascii_whitespace() || c == ',').filter(|word| !word.is_empty());
            words.map(move |word| (line, word))
        });
        let mut numbers = Vec::new();
        for (line, word) in words {
            let number: f64 = word.parse().map_err(|_| {
                let problem = format!("`{}` is not a number", excerpt(word));
                InputError::at_line(file, line as usize, problem, EXPECTED, CURE)
            })?;
            numbers.push((line, number));
        }
        let Some((header, values)) = numbers.split_at_checked(9) else {
            let problem = format!("the file ends after {} of nine numbers that describe the grid", numbers.len());
            return Err(InputError::in_file(file, problem, EXPECTED, CURE));
        };
        let invalid = |k: usize, problem: &str| {
            let (line, number) = header[k];
            let name = ["x0", "y0", "z0", "dx", "dy", "dz", "nx", "ny", "nz"][k];
            let problem = format!("{name} is {number}; {problem}");
            InputError::at_line(file, line as usize, problem, EXPECTED, CURE)
        };
        for (k, (_, number)) in header.iter().enumerate().take(6) {
            if !number.is_finite() || (k >= 3 && *number <= 0.0) {
                return Err(invalid(k, "corners are finite, and edges above 0"));
            }
        }
        let mut counts = [0; 3];
        for (k, count) in counts.iter_mut().enumerate() {
            let (_, number) = header[6 + k];
            if !(number.fract() == 0.0 && (1.0..=1e9).contains(&number)) {
                return Err(invalid(6 + k, "the number of cells is a whole number from 1"));
            }
            *count = number as usize;
        }
        let total = counts.iter().fold(1_usize, |total, &count| total.saturating_mul(count));
        if values.len() != total {
            let [x, y, z] = counts;
            let problem =
                format!("the file has {} values; a grid of {x} x {y} x {z} cells needs {total}", values.len());
            return Err(InputError::in_file(file, problem, EXPECTED, CURE));
        }
        let of = |first: usize| std::array::from_fn(|k| header[first + k].1);
        let (lines, values) = values.iter().copied().unzip();
        Ok(Self { file: file.into(), origin: of(0), edges: of(3), counts, values, lines })
    }

    /// Returns all values.
    pub fn values(&self) -> &[f64] {
        &self.values
    }

    /// Returns the index of the cell that contains a position; `None` outside of the grid.
    fn cell(&self, position: [f64; 3]) -> Option<usize> {
        let mut index = 0;
        for k in (0..3).rev() {
            let place = ((position[k] - self.origin[k]) / self.edges[k]).floor();
            if !(place >= 0.0 && place < self.counts[k] as f64) {
                return None;
            }
            index = index * self.counts[k] + place as usize;
        }
        Some(index)
    }

    /// Returns the value of the cell that contains a position; `None` outside of the grid.
    pub fn at(&self, position: [f64; 3]) -> Option<f64> {
        self.cell(position).map(|index| self.values[index])
    }

    /// Reports an invalid value at a position.
    pub fn error(&self, position: [f64; 3], point: IntegrationPoint, value: &str, expected: &str) -> InputError {
        let [x, y, z] = position.map(|x| format!("{x:.6e}"));
        let place = format!("{point} at x = {x}, y = {y}, z = {z} in mesh units");
        match self.cell(position) {
            Some(index) => {
                let problem = format!("the value of the cell of {place} is {value}");
                InputError::at_line(&self.file, self.lines[index] as usize, problem, expected, "correct the value")
            }
            None => {
                let end = |k: usize| {
                    let ends = [0.0, self.counts[k] as f64];
                    ends.map(|at| format!("{:.6e}", self.origin[k] + at * self.edges[k])).join(" to ")
                };
                let problem = format!("{place} lies outside of the grid");
                let expected =
                    format!("a grid that contains the region; it reaches from {}, {} and {}", end(0), end(1), end(2));
                InputError::in_file(&self.file, problem, expected, "extend the grid; its lengths are in mesh units")
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const TEXT: &str = "# a comment\n1 2 3  0.5 1 2\n3 2 1 # cells\n1,2,3\n4 5 6\n";

    fn grid(text: &str) -> Result<Grid, String> {
        Grid::parse(Path::new("g.txt"), text).map_err(|error| error.to_string().lines().next().unwrap().to_owned())
    }

    #[test]
    fn a_position_has_the_value_of_its_cell() {
        let grid = grid(TEXT).unwrap();
        let at = |x, y, z| grid.at([x, y, z]);
        assert_eq!([at(1.0, 2.0, 3.0), at(2.4, 2.4, 4.9), at(1.5, 3.4, 3.1)], [Some(1.0), Some(3.0), Some(5.0)]);
        assert_eq!([at(0.9, 2.0, 3.0), at(1.0, 4.1, 3.0), at(1.0, 2.0, 5.1)], [None; 3]);
        let point = IntegrationPoint { element: 4, point: 0, points: 1 };
        let error = grid.error([1.5, 3.4, 3.1], point, "5", "a number below 4").to_string();
        assert!(error.starts_with("g.txt:5: the value of the cell of element 4 at x = 1.5"), "{error}");
        let error = grid.error([9.0, 3.4, 2.1], point, "NaN", "a number").to_string();
        assert!(error.contains("outside of the grid") && error.contains("1.000000e0 to 2.500000e0"), "{error}");
    }

    #[test]
    fn files_that_are_no_grid_are_reported() {
        for (text, expected) in [
            ("1 2 3", "g.txt: the file ends after 3 of nine numbers that describe the grid"),
            ("0 0 0 1 1 1 2 1 1 5", "g.txt: the file has 1 values; a grid of 2 x 1 x 1 cells needs 2"),
            ("0 0 0 1 1 1 1\n1 1\nx", "g.txt:3: `x` is not a number"),
            ("0 0 0 1 -1 1 1 1 1 5", "g.txt:1: dy is -1; corners are finite, and edges above 0"),
            ("0 0 0 1 1 1\n1.5 1 1 5", "g.txt:2: nx is 1.5; the number of cells is a whole number from 1"),
        ] {
            assert_eq!(grid(text).unwrap_err(), expected, "{text}");
        }
    }
}
