//! What all VTK files of a result directory have in common: how they are read, the checks of their arrays, and the text of
//! files without arrays.

use std::io;
use std::path::Path;

use quick_xml::Writer;
use quick_xml::events::{BytesDecl, BytesStart, Event as XmlEvent};

use super::ResultsError;
use crate::app::vtu::decode::Numbers;
use crate::app::vtu::file::{Array, Content, Grid, parse};

/// Reads a file that this program wrote; `expected` describes it in errors.
pub(super) fn read(path: &Path, content: Content, expected: &'static str) -> Result<Grid, ResultsError> {
    let bytes = std::fs::read(path).map_err(ResultsError::read(path))?;
    parse(path, &bytes, content).map_err(|error| ResultsError::damaged(path, error.line, error.problem, expected))
}

/// Returns the positions of the points of a file.
pub(super) fn positions(path: &Path, array: Array, expected: &'static str) -> Result<Vec<[f64; 3]>, ResultsError> {
    match array.numbers {
        Numbers::Reals(values) if array.components == 3 => Ok(groups(&values)),
        _ => Err(ResultsError::damaged(
            path,
            Some(array.line),
            "the positions are not vectors of 64-bit numbers",
            expected,
        )),
    }
}

/// Returns the integers of an array of the cells.
pub(super) fn integers<'a>(path: &Path, array: &'a Array, expected: &'static str) -> Result<&'a [i64], ResultsError> {
    match &array.numbers {
        Numbers::Integers(values) => Ok(values),
        Numbers::Reals(_) => {
            let what = format!("the array `{}` does not hold integers", array.name);
            Err(ResultsError::damaged(path, Some(array.line), what, expected))
        }
    }
}

/// Checks that an array has values for `count` points or cells.
pub(super) fn check_count(path: &Path, array: &Array, count: usize) -> Result<(), ResultsError> {
    ResultsError::check_length(path, &array.name, array.numbers.len(), array.components.saturating_mul(count))
}

pub(super) fn groups<const N: usize>(values: &[f64]) -> Vec<[f64; N]> {
    values.as_chunks::<N>().0.to_vec()
}

/// Checks that the points of all cells are below `points`.
pub(super) fn check_points<'a>(
    path: &Path,
    cells: impl Iterator<Item = &'a [u32]>,
    points: usize,
) -> Result<(), ResultsError> {
    for (element, cell) in cells.enumerate() {
        if let Some(node) = cell.iter().map(|&node| node.into()).find(|&node| node >= points as i64) {
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
