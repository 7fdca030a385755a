//! Reading a `.vtu` file back.

use std::fs;
use std::path::Path;

use quick_xml::events::Event as XmlEvent;
use vtkio::IOBuffer;
use vtkio::model::{Attribute, CellType, DataSet, Piece, UnstructuredGridPiece, VertexNumbers, Vtk};

use super::{Fields, ResultsError};

/// Reads a file that [`write_vtu`](super::write_vtu) wrote. Arrays of other kinds than it writes are left out.
///
/// # Errors
/// [`ResultsError::Read`] where the file cannot be read; [`ResultsError::Damaged`] or [`ResultsError::ElementNode`]
/// where it holds something else than a mesh of tetrahedra.
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

/// The reader behind takes for granted that there are points and that every array holds at least its own length
/// (a header of eight bytes): check it, so that a damaged file is an error.
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
            // Eight bytes are eleven digits of six bits.
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
