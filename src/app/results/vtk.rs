//! What all VTK files of a result directory have in common: the XML text, the checks of their arrays, and the errors.

use std::io;
use std::path::Path;

use quick_xml::Writer;
use quick_xml::events::{BytesDecl, BytesStart, Event as XmlEvent};
use vtkio::model::{Attribute, ByteOrder, DataArray, DataSet, Version, Vtk};

use super::ResultsError;
use super::compressed::{compress, decompress};

/// Encodes a data set in VTK's XML form, with compressed arrays.
pub(super) fn encode(path: &Path, data: DataSet) -> Result<Vec<u8>, ResultsError> {
    let vtk = Vtk {
        version: Version::XML { major: 1, minor: 0 },
        title: String::new(),
        byte_order: ByteOrder::LittleEndian,
        file_path: None,
        data,
    };
    let mut bytes = Vec::new();
    vtk.write_xml(&mut bytes).map_err(|source| ResultsError::Encode(path.into(), source))?;
    for array in ["connectivity", "offsets"] {
        declare_signed(&mut bytes, array);
    }
    compress(&bytes).map_err(|source| ResultsError::Encode(path.into(), source.into()))
}

/// Declares an array of the cells as signed, as VTK's own files do. The bits are the same, but numpy, and therefore
/// meshio, converts a difference of unsigned and signed integers to floating point.
fn declare_signed(bytes: &mut Vec<u8>, array: &str) {
    let (unsigned, signed) = (format!("type=\"UInt64\" Name=\"{array}\""), format!("type=\"Int64\" Name=\"{array}\""));
    if let Some(at) = bytes.windows(unsigned.len()).position(|window| window == unsigned.as_bytes()) {
        bytes.splice(at..at + unsigned.len(), signed.into_bytes());
    }
}

/// Reads the data set in a file; `expected` describes it in errors.
pub(super) fn read(path: &Path, expected: &'static str) -> Result<DataSet, ResultsError> {
    let text = std::fs::read(path).map_err(ResultsError::read(path))?;
    let text =
        decompress(text).map_err(|what| ResultsError::damaged(path, None, format!("an array {what}"), expected))?;
    check_arrays(path, &text)?;
    let vtk = Vtk::parse_xml(text.as_slice());
    vtk.map(|vtk| vtk.data).map_err(|error| ResultsError::damaged(path, None, error.to_string(), expected))
}

/// Checks that the file has points and that every array has at least the header with its length (eight bytes), because
/// the VTK reader assumes both; a damaged file then gives an error instead of a panic.
fn check_arrays(path: &Path, text: &[u8]) -> Result<(), ResultsError> {
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

pub(super) fn array<T: num_traits::ToPrimitive + Clone + 'static>(head: DataArray, values: &[T]) -> Attribute {
    Attribute::DataArray(head.with_vec(values.to_vec()))
}

pub(super) fn groups<const N: usize>(values: &[f64]) -> Vec<[f64; N]> {
    values.as_chunks::<N>().0.to_vec()
}

/// Returns the cells of `N` points each; all points must be below `points`.
pub(super) fn cells<const N: usize>(
    path: &Path,
    connectivity: &[u64],
    points: usize,
) -> Result<Vec<[u32; N]>, ResultsError> {
    let cells = connectivity.as_chunks::<N>().0;
    check_points(path, cells.iter().map(<[u64; N]>::as_slice), points)?;
    Ok(cells.iter().map(|cell| cell.map(|point| point as u32)).collect())
}

/// Checks that the points of all cells are below `points`.
pub(super) fn check_points<'a, T: Copy + Into<u64> + 'a>(
    path: &Path,
    cells: impl Iterator<Item = &'a [T]>,
    points: usize,
) -> Result<(), ResultsError> {
    for (element, cell) in cells.enumerate() {
        if let Some(node) = cell.iter().map(|&node| node.into()).find(|&node| node >= points as u64) {
            return Err(ResultsError::ElementNode { path: path.into(), element, node, nodes: points });
        }
    }
    Ok(())
}

/// Writes the text of a VTK file without arrays: a collection or an index of pieces.
pub(super) fn write_text(
    attributes: &[(&str, &str)],
    content: impl FnOnce(&mut Writer<Vec<u8>>) -> io::Result<()>,
) -> io::Result<Vec<u8>> {
    let mut writer = Writer::new_with_indent(Vec::new(), b' ', 2);
    writer.write_event(XmlEvent::Decl(BytesDecl::new("1.0", Some("UTF-8"), None)))?;
    let root = writer.create_element("VTKFile").with_attributes(attributes.iter().copied());
    root.write_inner_content(content)?;
    let mut bytes = writer.into_inner();
    bytes.push(b'\n');
    Ok(bytes)
}

/// Calls `visit` with every element `name` of such a text, and returns true if the text is complete.
pub(super) fn visit_elements(
    text: &str,
    name: &str,
    mut visit: impl FnMut(&BytesStart) -> Result<(), String>,
) -> Result<bool, String> {
    let mut reader = quick_xml::Reader::from_str(text);
    let mut is_complete = false;
    loop {
        match reader.read_event().map_err(|error| error.to_string())? {
            XmlEvent::Empty(tag) | XmlEvent::Start(tag) if tag.name().as_ref() == name => visit(&tag)?,
            XmlEvent::End(tag) => is_complete |= tag.name().as_ref() == "VTKFile",
            XmlEvent::Eof => return Ok(is_complete),
            _ => {}
        }
    }
}

/// Returns the value of an attribute, if the element has it.
pub(in crate::app) fn attribute(tag: &BytesStart, name: &str) -> Result<Option<String>, String> {
    let attribute = tag.try_get_attribute(name).map_err(|error| error.to_string())?;
    let value = attribute.map(|attribute| attribute.normalized_value(quick_xml::XmlVersion::Implicit1_0));
    value.transpose().map(|value| value.map(std::borrow::Cow::into_owned)).map_err(|error| error.to_string())
}
