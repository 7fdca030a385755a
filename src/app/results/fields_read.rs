//! Reading `.vtu` files.

use std::collections::HashMap;
use std::fs;
use std::path::Path;

use quick_xml::events::Event as XmlEvent;
use vtkio::IOBuffer;
use vtkio::model::{Attribute, CellType, DataSet, Piece, UnstructuredGridPiece, VertexNumbers, Vtk};

use super::{Fields, ResultsError};

/// Reads a file written by [`write_vtu`](super::write_vtu). Arrays of other types are ignored.
///
/// # Errors
/// Returns [`ResultsError::Read`] if the file cannot be read; [`ResultsError::Damaged`] or
/// [`ResultsError::ElementNode`] if it does not hold a valid mesh of tetrahedra.
pub fn read_vtu(path: &Path) -> Result<Fields, ResultsError> {
    let text = fs::read(path).map_err(ResultsError::read(path))?;
    check_arrays(path, &text)?;
    let damaged = |what: String| ResultsError::damaged(path, None, what, "an unstructured grid in VTK's XML form");
    let vtk = Vtk::parse_xml(text.as_slice()).map_err(|error| damaged(error.to_string()))?;
    let DataSet::UnstructuredGrid { pieces, .. } = vtk.data else {
        return Err(damaged("holds another kind of data set".into()));
    };
    let Some(Piece::Inline(piece)) = pieces.into_iter().next() else {
        return Err(damaged("holds no piece of a grid".into()));
    };
    mesh_and_fields(path, *piece)
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
    let damaged = |what: String| ResultsError::damaged(path, None, what, "a .pvtu file that names its pieces");
    let mut reader = quick_xml::Reader::from_str(text);
    let mut sources = Vec::new();
    loop {
        match reader.read_event().map_err(|error| damaged(error.to_string()))? {
            XmlEvent::Empty(tag) | XmlEvent::Start(tag) if tag.name().as_ref() == "Piece" => {
                let source = tag.try_get_attribute("Source").ok().flatten();
                let source = source.ok_or_else(|| damaged("a piece without a file".into()))?;
                let source = source.normalized_value(quick_xml::XmlVersion::Implicit1_0);
                sources.push(source.map_err(|error| damaged(error.to_string()))?.into_owned());
            }
            XmlEvent::Eof if sources.is_empty() => return Err(damaged("names no piece".into())),
            XmlEvent::Eof => return Ok(sources),
            _ => {}
        }
    }
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
    let Fields { mut points, mut elements, mut point_vectors, .. } = piece;
    keep(&mut points, &is_new);
    point_vectors.iter_mut().for_each(|(_, values)| keep(values, &is_new));
    elements.iter_mut().for_each(|nodes| *nodes = nodes.map(|node| places[node as usize]));
    let piece = Fields { points, elements, point_vectors, ..piece };
    if whole.elements.is_empty() {
        *whole = piece;
        return Ok(());
    }
    whole.points.extend(piece.points);
    whole.elements.extend(piece.elements);
    let same = extend(&mut whole.point_vectors, piece.point_vectors)
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

/// Checks that the file has points and that every array has at least the header with its length (eight bytes), because
/// the VTK reader assumes both; a damaged file then gives an error instead of a panic.
pub(super) fn check_arrays(path: &Path, text: &[u8]) -> Result<(), ResultsError> {
    let damaged = |what: String| {
        ResultsError::damaged(path, None, what, "VTK's XML form with the arrays in base64, as this program writes it")
    };
    let mut reader = quick_xml::Reader::from_reader(text);
    let mut buffer = Vec::new();
    let (mut points, mut array) = (false, None::<usize>);
    loop {
        match reader.read_event_into(&mut buffer).map_err(|error| damaged(error.to_string()))? {
            XmlEvent::Start(tag) if tag.name().as_ref() == "DataArray" => {
                let format = tag.try_get_attribute("format").ok().flatten().map(|format| format.value.into_owned());
                if format.as_deref() != Some("binary") {
                    return Err(damaged("an array is not in base64".into()));
                }
                array = Some(0);
            }
            XmlEvent::Start(tag) => points |= tag.name().as_ref() == "Points",
            XmlEvent::Text(text) => {
                if let Some(digits) = &mut array {
                    *digits += text.chars().filter(|letter| !letter.is_whitespace() && *letter != '=').count();
                }
            }
            // Eight bytes take eleven base64 digits of six bits.
            XmlEvent::End(tag)
                if tag.name().as_ref() == "DataArray" && array.take().is_some_and(|digits| digits < 11) =>
            {
                return Err(damaged("an array is empty".into()));
            }
            XmlEvent::Empty(tag) if tag.name().as_ref() == "DataArray" => {
                return Err(damaged("an array is empty".into()));
            }
            XmlEvent::Eof => break,
            _ => {}
        }
        buffer.clear();
    }
    if points { Ok(()) } else { Err(damaged("holds no points".into())) }
}

fn mesh_and_fields(path: &Path, piece: UnstructuredGridPiece) -> Result<Fields, ResultsError> {
    let damaged = |what: &str| ResultsError::damaged(path, None, what, "a mesh of tetrahedra");
    if piece.cells.types.iter().any(|&kind| kind != CellType::Tetra) {
        return Err(damaged("holds other cells than tetrahedra"));
    }
    let points: Vec<[f64; 3]> = match piece.points {
        IOBuffer::F64(values) => groups(&values),
        _ => return Err(damaged("positions are no 64-bit numbers")),
    };
    let VertexNumbers::XML { connectivity, .. } = piece.cells.cell_verts else {
        return Err(damaged("cells are in another form"));
    };
    let mut elements = Vec::with_capacity(connectivity.len() / 4);
    for (element, nodes) in connectivity.chunks_exact(4).enumerate() {
        let mut own = [0; 4];
        for (own, &node) in own.iter_mut().zip(nodes) {
            *own = u32::try_from(node)
                .ok()
                .filter(|&node| (node as usize) < points.len())
                .ok_or_else(|| ResultsError::ElementNode { path: path.into(), element, node, nodes: points.len() })?;
        }
        elements.push(own);
    }
    let mut fields = Fields { points, elements, ..Fields::default() };
    for attribute in piece.data.point {
        if let Attribute::DataArray(array) = attribute
            && let (3, IOBuffer::F64(values)) = (array.elem.num_comp(), array.data)
        {
            fields.point_vectors.push((array.name, groups(&values)));
        }
    }
    for attribute in piece.data.cell {
        let Attribute::DataArray(array) = attribute else { continue };
        let name = array.name;
        match (array.elem.num_comp(), array.data) {
            (1, IOBuffer::F64(values)) => fields.cell_scalars.push((name, values)),
            (1, IOBuffer::I64(values)) => fields.cell_integers.push((name, values)),
            (3, IOBuffer::F64(values)) => fields.cell_vectors.push((name, groups(&values))),
            (9, IOBuffer::F64(values)) => fields.cell_tensors.push((name, groups(&values))),
            _ => {}
        }
    }
    Ok(fields)
}

pub(super) fn groups<const N: usize>(values: &[f64]) -> Vec<[f64; N]> {
    values.as_chunks::<N>().0.to_vec()
}
