//! Reading `.vtu` files.

use std::collections::HashMap;
use std::path::Path;

use super::vtk::{attribute, check_count, groups, positions, read, visit_elements};
use super::{Fields, ResultsError, vtk_cells};
use crate::app::vtu::decode::Numbers;
use crate::app::vtu::file::{Content, Grid};

const EXPECTED: &str = "an unstructured grid in VTK's XML form, as a run writes it";

/// Reads a file written by [`write_vtu`](super::write_vtu). Arrays of other types are ignored.
///
/// # Errors
/// Returns [`ResultsError::Read`] if the file cannot be read; [`ResultsError::Damaged`], [`ResultsError::Length`] or
/// [`ResultsError::ElementNode`] if it does not hold a valid mesh with its fields.
pub fn read_vtu(path: &Path) -> Result<Fields, ResultsError> {
    mesh_and_fields(path, read(path, Content::Grid, EXPECTED)?)
}

/// Reads the fields of a whole body (`.vtu`), or of the pieces of a divided body that an index file names (`.pvtu`),
/// concatenated in order; points shared by several pieces are merged.
///
/// # Errors
/// Returns the errors of [`read_vtu`] for every piece, or [`ResultsError::Damaged`] if the index is invalid or the
/// pieces have different fields.
pub fn read_fields(path: &Path) -> Result<Fields, ResultsError> {
    if path.extension().is_none_or(|extension| extension != "pvtu") {
        return read_vtu(path);
    }
    let text = std::fs::read_to_string(path).map_err(ResultsError::read(path))?;
    let (mut whole, mut met) = (Fields::default(), HashMap::new());
    for source in sources(path, &text)? {
        let piece = path.with_file_name(source);
        append(&mut whole, read_vtu(&piece)?, &mut met, &piece)?;
    }
    Ok(whole)
}

/// Returns the files that an index file names.
pub(super) fn sources(path: &Path, text: &str) -> Result<Vec<String>, ResultsError> {
    let mut sources = Vec::new();
    let visited = visit_elements(text, "Piece", |tag| {
        sources.push(attribute(tag, "Source")?.ok_or("a piece without a file")?);
        Ok(())
    });
    let names = visited.and_then(|_| if sources.is_empty() { Err("names no piece".into()) } else { Ok(sources) });
    names.map_err(|what| ResultsError::damaged(path, None, what, "a .pvtu file that names its pieces"))
}

/// The identity of a point: the bits of its position and of its vectors.
type Mark = Vec<u64>;

/// Appends a piece. A point with the same position and values as a point of an earlier piece is merged with it;
/// otherwise the body would have a gap where its pieces meet.
fn append(whole: &mut Fields, piece: Fields, met: &mut HashMap<Mark, u32>, path: &Path) -> Result<(), ResultsError> {
    let marks: Vec<Mark> = (0..piece.points.len()).map(|point| mark(&piece, point)).collect();
    let is_new: Vec<bool> = marks.iter().map(|mark| !met.contains_key(mark)).collect();
    let mut next = whole.points.len() as u32;
    let mut place = |mark: &Mark| {
        met.get(mark).copied().unwrap_or_else(|| {
            next += 1;
            next - 1
        })
    };
    let places: Vec<u32> = marks.iter().map(&mut place).collect();
    met.extend(marks.into_iter().zip(places.iter().copied()));
    let Fields { mut points, mut elements, mut point_scalars, mut point_vectors, mut point_tensors, .. } = piece;
    keep(&mut points, &is_new);
    point_scalars.iter_mut().for_each(|(_, values)| keep(values, &is_new));
    point_vectors.iter_mut().for_each(|(_, values)| keep(values, &is_new));
    point_tensors.iter_mut().for_each(|(_, values)| keep(values, &is_new));
    elements = elements.map(|node| places[node as usize]);
    let piece = Fields { points, elements, point_scalars, point_vectors, point_tensors, ..piece };
    if whole.elements.is_empty() {
        *whole = piece;
        return Ok(());
    }
    whole.points.extend(piece.points);
    whole.elements.extend(&piece.elements);
    let same = extend(&mut whole.point_scalars, piece.point_scalars)
        && extend(&mut whole.point_vectors, piece.point_vectors)
        && extend(&mut whole.point_tensors, piece.point_tensors)
        && extend(&mut whole.cell_scalars, piece.cell_scalars)
        && extend(&mut whole.cell_integers, piece.cell_integers)
        && extend(&mut whole.cell_vectors, piece.cell_vectors)
        && extend(&mut whole.cell_tensors, piece.cell_tensors);
    if same {
        return Ok(());
    }
    Err(ResultsError::damaged(path, None, "has other fields than the pieces before it", "pieces of one body"))
}

fn mark(piece: &Fields, point: usize) -> Mark {
    let vectors = piece.point_vectors.iter().filter_map(|(_, values)| values.get(point));
    piece.points.get(point).into_iter().chain(vectors).flatten().map(|value| value.to_bits()).collect()
}

fn keep<T>(values: &mut Vec<T>, which: &[bool]) {
    let mut which = which.iter();
    values.retain(|_| which.next().copied().unwrap_or(true));
}

/// Appends the fields of `piece` to those of `whole` and returns true if both have the same field names.
fn extend<T>(whole: &mut [(String, Vec<T>)], piece: Vec<(String, Vec<T>)>) -> bool {
    let same = whole.len() == piece.len() && whole.iter().zip(&piece).all(|((a, _), (b, _))| a == b);
    for ((_, whole), (_, piece)) in whole.iter_mut().zip(piece) {
        whole.extend(piece);
    }
    same
}

fn mesh_and_fields(path: &Path, grid: Grid) -> Result<Fields, ResultsError> {
    let (elements, count) = (vtk_cells::from_vtk(path, &grid)?, grid.types.numbers.len());
    let points = positions(path, grid.positions, EXPECTED)?;
    let mut fields = Fields { points, elements, ..Fields::default() };
    for array in grid.of_points {
        check_count(path, &array, fields.points.len())?;
        match (array.components, array.numbers) {
            (1, Numbers::Reals(values)) => fields.point_scalars.push((array.name, values)),
            (3, Numbers::Reals(values)) => fields.point_vectors.push((array.name, groups(&values))),
            (9, Numbers::Reals(values)) => fields.point_tensors.push((array.name, groups(&values))),
            _ => {}
        }
    }
    for array in grid.of_cells {
        check_count(path, &array, count)?;
        match (array.components, array.numbers) {
            (1, Numbers::Reals(values)) => fields.cell_scalars.push((array.name, values)),
            (1, Numbers::Integers(values)) => fields.cell_integers.push((array.name, values)),
            (3, Numbers::Reals(values)) => fields.cell_vectors.push((array.name, groups(&values))),
            (9, Numbers::Reals(values)) => fields.cell_tensors.push((array.name, groups(&values))),
            _ => {}
        }
    }
    Ok(fields)
}
