//! Fields on a mesh, as a VTK file (`.vtu`) that ParaView, python-vtk and meshio open.
//!
//! Numbers are stored in binary (64 bits, little endian, base64 in XML), so that reading a file returns bitwise the
//! values written. Tensors have all nine components, row-major.

use std::path::Path;

use super::ResultsError;
pub use super::fields_read::{read_fields, read_vtu};
use super::replace::replace_by;
use super::vtk::check_points;
use super::vtk_cells;
use super::vtk_write::{Array, Piece, write};
use crate::fem::mesh::Elements;

/// A mesh and its fields, borrowed for writing. Names of point fields are unique, and so are names of cell fields.
#[derive(Clone, Debug, Default)]
pub struct FieldSet<'a> {
    /// Reference positions, m.
    pub points: &'a [[f64; 3]],
    /// The points of each element.
    pub elements: &'a Elements,
    /// Scalars at the points.
    pub point_scalars: Vec<(&'a str, &'a [f64])>,
    /// Vectors at the points.
    pub point_vectors: Vec<(&'a str, &'a [[f64; 3]])>,
    /// Tensors at the points, row-major.
    pub point_tensors: Vec<(&'a str, &'a [[f64; 9]])>,
    /// Scalars in the elements.
    pub cell_scalars: Vec<(&'a str, &'a [f64])>,
    /// Integers in the elements.
    pub cell_integers: Vec<(&'a str, &'a [i64])>,
    /// Vectors in the elements.
    pub cell_vectors: Vec<(&'a str, &'a [[f64; 3]])>,
    /// Tensors in the elements, row-major.
    pub cell_tensors: Vec<(&'a str, &'a [[f64; 9]])>,
}

impl FieldSet<'_> {
    /// Keeps the fields whose names satisfy a condition.
    pub fn retain(&mut self, is_kept: impl Fn(&str) -> bool) {
        self.point_scalars.retain(|(name, _)| is_kept(name));
        self.point_vectors.retain(|(name, _)| is_kept(name));
        self.point_tensors.retain(|(name, _)| is_kept(name));
        self.cell_scalars.retain(|(name, _)| is_kept(name));
        self.cell_integers.retain(|(name, _)| is_kept(name));
        self.cell_vectors.retain(|(name, _)| is_kept(name));
        self.cell_tensors.retain(|(name, _)| is_kept(name));
    }
}

/// A mesh and its fields, read from a file: the owned counterpart of [`FieldSet`].
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Fields {
    /// Reference positions, m.
    pub points: Vec<[f64; 3]>,
    /// The points of each element, each below the number of points.
    pub elements: Elements,
    /// Scalars at the points.
    pub point_scalars: Vec<(String, Vec<f64>)>,
    /// Vectors at the points.
    pub point_vectors: Vec<(String, Vec<[f64; 3]>)>,
    /// Tensors at the points, row-major.
    pub point_tensors: Vec<(String, Vec<[f64; 9]>)>,
    /// Scalars in the elements.
    pub cell_scalars: Vec<(String, Vec<f64>)>,
    /// Integers in the elements.
    pub cell_integers: Vec<(String, Vec<i64>)>,
    /// Vectors in the elements.
    pub cell_vectors: Vec<(String, Vec<[f64; 3]>)>,
    /// Tensors in the elements, row-major.
    pub cell_tensors: Vec<(String, Vec<[f64; 9]>)>,
}

impl Fields {
    /// Returns the point scalars with this name.
    pub fn point_scalar(&self, name: &str) -> Option<&[f64]> {
        named(&self.point_scalars, name)
    }

    /// Returns the point tensors with this name, row-major.
    pub fn point_tensor(&self, name: &str) -> Option<&[[f64; 9]]> {
        named(&self.point_tensors, name)
    }

    /// Returns the point vectors with this name.
    pub fn point_vector(&self, name: &str) -> Option<&[[f64; 3]]> {
        named(&self.point_vectors, name)
    }

    /// Returns the element scalars with this name.
    pub fn cell_scalar(&self, name: &str) -> Option<&[f64]> {
        named(&self.cell_scalars, name)
    }

    /// Returns the element integers with this name.
    pub fn cell_integer(&self, name: &str) -> Option<&[i64]> {
        named(&self.cell_integers, name)
    }

    /// Returns the element vectors with this name.
    pub fn cell_vector(&self, name: &str) -> Option<&[[f64; 3]]> {
        named(&self.cell_vectors, name)
    }

    /// Returns the element tensors with this name, row-major.
    pub fn cell_tensor(&self, name: &str) -> Option<&[[f64; 9]]> {
        named(&self.cell_tensors, name)
    }
}

fn named<'a, T>(fields: &'a [(String, Vec<T>)], name: &str) -> Option<&'a [T]> {
    fields.iter().find(|(other, _)| other == name).map(|(_, values)| values.as_slice())
}

/// Writes a mesh and its fields to `path`, which should end in `.vtu`. An existing file is replaced atomically.
///
/// # Errors
/// Returns [`ResultsError::Length`] or [`ResultsError::ElementNode`] if the fields do not fit the mesh (nothing is
/// written), or [`ResultsError::Write`] if the file cannot be written.
pub fn write_vtu(path: &Path, fields: &FieldSet) -> Result<(), ResultsError> {
    check(path, fields)?;
    replace_by(path, |file| write(file, &piece(fields)))
}

/// Checks that every field has one value per point or element, and that every element refers to existing points.
pub(super) fn check(path: &Path, fields: &FieldSet) -> Result<(), ResultsError> {
    let (points, elements) = (fields.points.len(), fields.elements.len());
    let lengths = (fields.point_scalars.iter().map(|(name, values)| (*name, values.len(), points)))
        .chain(fields.point_vectors.iter().map(|(name, values)| (*name, values.len(), points)))
        .chain(fields.point_tensors.iter().map(|(name, values)| (*name, values.len(), points)))
        .chain(fields.cell_scalars.iter().map(|(name, values)| (*name, values.len(), elements)))
        .chain(fields.cell_integers.iter().map(|(name, values)| (*name, values.len(), elements)))
        .chain(fields.cell_vectors.iter().map(|(name, values)| (*name, values.len(), elements)))
        .chain(fields.cell_tensors.iter().map(|(name, values)| (*name, values.len(), elements)));
    for (name, found, expected) in lengths {
        ResultsError::check_length(path, name, found, expected)?;
    }
    check_points(path, fields.elements.iter(), points)
}

/// Returns what a file of the fields holds.
fn piece<'a>(fields: &FieldSet<'a>) -> Piece<'a> {
    let of_points = (fields.point_scalars.iter().map(|(name, values)| Array::scalars(name, values)))
        .chain(fields.point_vectors.iter().map(|(name, values)| Array::vectors(name, values)))
        .chain(fields.point_tensors.iter().map(|(name, values)| Array::tensors(name, values)));
    let of_cells = (fields.cell_scalars.iter().map(|(name, values)| Array::scalars(name, values)))
        .chain(fields.cell_integers.iter().map(|(name, values)| Array::integers(name, values)))
        .chain(fields.cell_vectors.iter().map(|(name, values)| Array::vectors(name, values)))
        .chain(fields.cell_tensors.iter().map(|(name, values)| Array::tensors(name, values)));
    Piece {
        positions: fields.points,
        cells: vtk_cells::to_vtk(fields.elements),
        of_points: of_points.collect(),
        of_cells: of_cells.collect(),
    }
}
