//! Values at the integration points, as a VTK file (`.vtu`) of vertices; for a divided body, as pieces and an index file
//! (`.pvtu`).
//!
//! A vertex lies at the reference position of its point. ParaView draws points as glyphs or Gaussian points, and moves
//! them by the vectors `displacement`.

use std::io;
use std::path::Path;

use super::ResultsError;
use super::fields_read::sources;
use super::pieces::{Arrays, borrow, file_name, gather, index, part_file};
use super::replace::{replace, replace_by};
use super::vtk::{check_count, positions, read};
use super::vtk_write::{Array, Cells, Piece, write};
use crate::app::vtu::decode::Numbers;
use crate::app::vtu::file::Content;

/// The name of an array with its values.
pub type Named<T> = (&'static str, Vec<T>);

/// Integration points and the values there.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct PointCloud {
    /// Reference positions, m.
    pub positions: Vec<[f64; 3]>,
    /// Scalars at the points.
    pub scalars: Vec<Named<f64>>,
    /// Integers at the points.
    pub integers: Vec<Named<i64>>,
    /// Vectors at the points.
    pub vectors: Vec<Named<[f64; 3]>>,
    /// Tensors at the points, row-major.
    pub tensors: Vec<Named<[f64; 9]>>,
}

/// The values of a file of points.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct PointValues {
    /// Reference positions, m.
    pub positions: Vec<[f64; 3]>,
    /// Name, number of components and numbers of each array of floating-point numbers.
    pub numbers: Vec<(String, usize, Vec<f64>)>,
    /// Name and numbers of each array of integers.
    pub integers: Vec<(String, Vec<i64>)>,
}

impl PointValues {
    /// Returns the numbers of the array with this name, all components of a point after one another.
    pub fn numbers(&self, name: &str) -> Option<&[f64]> {
        self.numbers.iter().find(|(other, ..)| other == name).map(|(.., values)| values.as_slice())
    }

    /// Returns the array of integers with this name.
    pub fn integers(&self, name: &str) -> Option<&[i64]> {
        self.integers.iter().find(|(other, _)| other == name).map(|(_, values)| values.as_slice())
    }
}

/// Writes points to `path`, which should end in `.vtu`. An existing file is replaced atomically.
///
/// # Errors
/// Returns [`ResultsError::Length`] if an array does not have one value per point (nothing is written), or
/// [`ResultsError::Write`] if the file cannot be written.
pub fn write_points(path: &Path, cloud: &PointCloud) -> Result<(), ResultsError> {
    check(path, cloud)?;
    replace_by(path, |file| write(file, &piece(cloud)))
}

/// Writes the points of a divided body: one `.vtu` per part that has points, then the index file `path`, which should
/// end in `.pvtu`. `part_of` is the part of each point, below `parts`.
///
/// # Errors
/// As for [`write_points`].
///
/// # Panics
/// Panics if a part is not below `parts`.
pub fn write_point_pieces(path: &Path, cloud: &PointCloud, part_of: &[u32], parts: usize) -> Result<(), ResultsError> {
    check(path, cloud)?;
    ResultsError::check_length(path, "part_of", part_of.len(), cloud.positions.len())?;
    let name = file_name(path)?;
    let mut of_part: Vec<Vec<u32>> = vec![Vec::new(); parts];
    (0..).zip(part_of).for_each(|(point, &part)| of_part[part as usize].push(point));
    let mut files = Vec::new();
    for (part, own) in of_part.iter().enumerate().filter(|(_, own)| !own.is_empty()) {
        let file = part_file(name, part);
        write_points(&path.with_file_name(&file), &cloud.select(own))?;
        files.push(file);
    }
    replace(path, &point_piece_index(&files, cloud).map_err(ResultsError::write(path))?)
}

/// Returns the text of the index file of pieces with the arrays of this cloud; `sources` are the names of the pieces.
///
/// # Errors
/// Returns the error of the XML writer.
pub fn point_piece_index(sources: &[String], cloud: &PointCloud) -> io::Result<Vec<u8>> {
    let (vectors, tensors) = (borrow(&cloud.vectors), borrow(&cloud.tensors));
    let arrays = Arrays::new(&borrow(&cloud.scalars), &borrow(&cloud.integers), &vectors, &tensors);
    index(sources, &arrays, &Arrays::default())
}

/// Reads points written by [`write_points`] or, if the name ends in `.pvtu`, by [`write_point_pieces`]; the points of
/// pieces follow one another.
///
/// # Errors
/// Returns [`ResultsError::Read`] if a file cannot be read, or [`ResultsError::Damaged`] or [`ResultsError::Length`] if it does
/// not hold points with their values, or if the pieces have different arrays.
pub fn read_points(path: &Path) -> Result<PointValues, ResultsError> {
    if path.extension().is_none_or(|extension| extension != "pvtu") {
        return read_piece(path);
    }
    let text = std::fs::read_to_string(path).map_err(ResultsError::read(path))?;
    let mut whole: Option<PointValues> = None;
    for source in sources(path, &text)? {
        let path = path.with_file_name(source);
        let piece = read_piece(&path)?;
        let Some(whole) = &mut whole else {
            whole = Some(piece);
            continue;
        };
        let is_same = whole.numbers.iter().map(|(name, ..)| name).eq(piece.numbers.iter().map(|(name, ..)| name))
            && whole.integers.iter().map(|(name, _)| name).eq(piece.integers.iter().map(|(name, _)| name));
        if !is_same {
            let what = "has other arrays than the pieces before it";
            return Err(ResultsError::damaged(&path, None, what, "pieces of one body"));
        }
        whole.positions.extend(piece.positions);
        whole.numbers.iter_mut().zip(piece.numbers).for_each(|((.., own), (.., more))| own.extend(more));
        whole.integers.iter_mut().zip(piece.integers).for_each(|((_, own), (_, more))| own.extend(more));
    }
    Ok(whole.unwrap_or_default())
}

fn read_piece(path: &Path) -> Result<PointValues, ResultsError> {
    const EXPECTED: &str = "a grid of vertices in VTK's XML form";
    let grid = read(path, Content::Grid, EXPECTED)?;
    let positions = positions(path, grid.positions, EXPECTED)?;
    let mut values = PointValues { positions, ..PointValues::default() };
    for array in grid.of_points {
        check_count(path, &array, values.positions.len())?;
        match array.numbers {
            Numbers::Reals(numbers) => values.numbers.push((array.name, array.components, numbers)),
            Numbers::Integers(numbers) => values.integers.push((array.name, numbers)),
        }
    }
    Ok(values)
}

impl PointCloud {
    /// Keeps the arrays whose names satisfy a condition.
    pub fn retain(&mut self, is_kept: impl Fn(&str) -> bool) {
        self.scalars.retain(|(name, _)| is_kept(name));
        self.integers.retain(|(name, _)| is_kept(name));
        self.vectors.retain(|(name, _)| is_kept(name));
        self.tensors.retain(|(name, _)| is_kept(name));
    }

    /// Returns these points, ascending, with their values.
    pub fn select(&self, points: &[u32]) -> Self {
        Self {
            positions: gather(&self.positions, points),
            scalars: select(&self.scalars, points),
            integers: select(&self.integers, points),
            vectors: select(&self.vectors, points),
            tensors: select(&self.tensors, points),
        }
    }
}

fn select<T: Copy>(arrays: &[Named<T>], points: &[u32]) -> Vec<Named<T>> {
    arrays.iter().map(|(name, values)| (*name, gather(values, points))).collect()
}

/// Checks that every array has one value per point.
fn check(path: &Path, cloud: &PointCloud) -> Result<(), ResultsError> {
    let lengths = (cloud.scalars.iter().map(|(name, values)| (*name, values.len())))
        .chain(cloud.integers.iter().map(|(name, values)| (*name, values.len())))
        .chain(cloud.vectors.iter().map(|(name, values)| (*name, values.len())))
        .chain(cloud.tensors.iter().map(|(name, values)| (*name, values.len())));
    for (name, found) in lengths {
        ResultsError::check_length(path, name, found, cloud.positions.len())?;
    }
    Ok(())
}

/// Returns what a file of the points holds: a vertex at each.
fn piece(cloud: &PointCloud) -> Piece<'_> {
    /// The number of the cell type in VTK.
    const VERTEX: u8 = 1;
    let arrays = (cloud.scalars.iter().map(|(name, values)| Array::scalars(name, values)))
        .chain(cloud.integers.iter().map(|(name, values)| Array::integers(name, values)))
        .chain(cloud.vectors.iter().map(|(name, values)| Array::vectors(name, values)))
        .chain(cloud.tensors.iter().map(|(name, values)| Array::tensors(name, values)));
    let count = cloud.positions.len() as i64;
    let cells = Cells {
        connectivity: (0..count).collect(),
        offsets: (1..=count).collect(),
        types: Some(vec![VERTEX; cloud.positions.len()]),
    };
    Piece { positions: &cloud.positions, cells, of_points: arrays.collect(), of_cells: Vec::new() }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn cloud() -> PointCloud {
        let of = |k: usize| k as f64 / 3.0;
        PointCloud {
            positions: (0..5).map(|k| [of(k), 1.0, -of(k)]).collect(),
            scalars: vec![("volume", (0..5).map(of).collect())],
            integers: vec![("element", (0..5).collect())],
            vectors: vec![("displacement", (0..5).map(|k| [0.0, of(k), 1.0]).collect())],
            tensors: vec![("cauchy_stress", (0..5).map(|k| std::array::from_fn(|c| of(k + c))).collect())],
        }
    }

    #[test]
    fn points_are_read_back_whole_and_in_pieces() {
        let folder = tempfile::tempdir().unwrap();
        let (path, index) = (folder.path().join("points-00001.vtu"), folder.path().join("points-00001.pvtu"));
        let cloud = cloud();
        write_points(&path, &cloud).unwrap();
        let whole = read_points(&path).unwrap();
        assert_eq!(whole.positions, cloud.positions);
        assert_eq!(whole.integers("element").unwrap(), [0, 1, 2, 3, 4]);
        assert_eq!(whole.numbers("cauchy_stress").unwrap(), cloud.tensors[0].1.as_flattened());
        assert_eq!(whole.numbers("volume").unwrap(), cloud.scalars[0].1);
        assert_eq!(whole.numbers("displacement").unwrap(), cloud.vectors[0].1.as_flattened());
        write_point_pieces(&index, &cloud, &[2, 0, 2, 0, 0], 4).unwrap();
        let pieces = read_points(&index).unwrap();
        assert_eq!(pieces.integers("element").unwrap(), [1, 3, 4, 0, 2]);
        assert_eq!(pieces.positions[3], cloud.positions[0]);
        assert_eq!(&pieces.numbers("volume").unwrap()[..2], [cloud.scalars[0].1[1], cloud.scalars[0].1[3]]);
        let text = std::fs::read_to_string(&index).unwrap();
        assert!(text.contains("<PPointData Vectors=\"displacement\" Tensors=\"cauchy_stress\">"), "{text}");
        assert!(text.contains("<Piece Source=\"points-00001-part-0002.vtu\"/>"), "{text}");
    }

    #[test]
    fn arrays_of_another_length_are_refused() {
        let folder = tempfile::tempdir().unwrap();
        let cloud = PointCloud { integers: vec![("element", vec![0; 4])], ..cloud() };
        let error = write_points(&folder.path().join("points-00001.vtu"), &cloud).unwrap_err();
        assert!(matches!(&error, ResultsError::Length { name, found: 4, expected: 5, .. } if name == "element"));
    }
}
