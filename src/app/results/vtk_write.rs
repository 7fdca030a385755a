//! Writing VTK's XML form, with arrays that are compressed by zlib in blocks. The module `vtu::decode` describes the layout.
//!
//! An array is compressed straight from the numbers of its owner, and only the compressed blocks of one array are in memory at
//! a time: a copy of all arrays would be the largest part of the memory of a body without RVEs.

use std::io::{self, BufWriter, Write};
use std::ops::Range;

use base64::engine::general_purpose::STANDARD;
use base64::write::EncoderWriter;
use flate2::Compression;
use flate2::write::ZlibEncoder;
use quick_xml::Writer;
use rayon::prelude::*;

/// Bytes of a block before compression.
pub(super) const BLOCK: usize = 1 << 16;

/// The numbers of an array.
#[derive(Clone, Copy)]
pub(super) enum Numbers<'a> {
    Reals(&'a [f64]),
    Integers(&'a [i64]),
    Bytes(&'a [u8]),
}

/// An array of the points or of the cells of a file.
pub(super) struct Array<'a> {
    pub name: &'a str,
    /// Numbers per point or cell: 1, 3 of a vector, 9 of a tensor.
    pub components: usize,
    pub numbers: Numbers<'a>,
}

/// The cells of a file: the points of all cells after one another, and where those of each cell end.
#[derive(Debug, Default, PartialEq)]
pub(super) struct Cells {
    pub connectivity: Vec<i64>,
    pub offsets: Vec<i64>,
    /// The type of each cell of an unstructured grid, by its number in VTK; `None` for lines, which are PolyData.
    pub types: Option<Vec<u8>>,
}

/// The content of a file.
pub(super) struct Piece<'a> {
    pub positions: &'a [[f64; 3]],
    pub cells: Cells,
    pub of_points: Vec<Array<'a>>,
    pub of_cells: Vec<Array<'a>>,
}

impl<'a> Array<'a> {
    pub fn scalars(name: &'a str, values: &'a [f64]) -> Self {
        Self { name, components: 1, numbers: Numbers::Reals(values) }
    }

    pub fn integers(name: &'a str, values: &'a [i64]) -> Self {
        Self { name, components: 1, numbers: Numbers::Integers(values) }
    }

    pub fn vectors(name: &'a str, values: &'a [[f64; 3]]) -> Self {
        Self { name, components: 3, numbers: Numbers::Reals(values.as_flattened()) }
    }

    pub fn tensors(name: &'a str, values: &'a [[f64; 9]]) -> Self {
        Self { name, components: 9, numbers: Numbers::Reals(values.as_flattened()) }
    }
}

impl Numbers<'_> {
    fn len(self) -> usize {
        match self {
            Self::Reals(values) => values.len(),
            Self::Integers(values) => values.len(),
            Self::Bytes(values) => values.len(),
        }
    }

    /// Returns the name of the type in VTK and its bytes.
    fn kind(self) -> (&'static str, usize) {
        match self {
            Self::Reals(_) => ("Float64", 8),
            Self::Integers(_) => ("Int64", 8),
            Self::Bytes(_) => ("UInt8", 1),
        }
    }

    fn bytes(self, range: Range<usize>) -> Vec<u8> {
        match self {
            Self::Reals(values) => values[range].iter().flat_map(|value| value.to_le_bytes()).collect(),
            Self::Integers(values) => values[range].iter().flat_map(|value| value.to_le_bytes()).collect(),
            Self::Bytes(values) => values[range].to_vec(),
        }
    }

    /// Compresses the numbers, block by block.
    fn compressed(self) -> io::Result<Vec<Vec<u8>>> {
        let (count, per_block) = (self.len(), BLOCK / self.kind().1);
        let blocks = 0..count.div_ceil(per_block);
        let range = |block: usize| block * per_block..((block + 1) * per_block).min(count);
        blocks.into_par_iter().map(|block| compress(&self.bytes(range(block)))).collect()
    }
}

/// Writes a file.
pub(super) fn write(file: &mut impl Write, piece: &Piece<'_>) -> io::Result<()> {
    let kind = if piece.cells.types.is_some() { "UnstructuredGrid" } else { "PolyData" };
    let mut file = BufWriter::new(file);
    let mut writer = Writer::new(&mut file);
    let root = [
        ("type", kind),
        ("version", "1.0"),
        ("byte_order", "LittleEndian"),
        ("header_type", "UInt64"),
        ("compressor", "vtkZLibDataCompressor"),
    ];
    writer.create_element("VTKFile").with_attributes(root).write_inner_content(|writer| {
        writer.create_element(kind).write_inner_content(|writer| write_piece(writer, piece))?;
        Ok(())
    })?;
    file.write_all(b"\n")?;
    file.flush()
}

fn write_piece(writer: &mut Writer<impl Write>, piece: &Piece<'_>) -> io::Result<()> {
    let Piece { positions, cells, of_points, of_cells } = piece;
    let (points, count) = (positions.len().to_string(), cells.offsets.len().to_string());
    let counts = match cells.types {
        Some(_) => vec![("NumberOfPoints", points.as_str()), ("NumberOfCells", &count)],
        None => vec![
            ("NumberOfPoints", points.as_str()),
            ("NumberOfLines", &count),
            ("NumberOfVerts", "0"),
            ("NumberOfStrips", "0"),
            ("NumberOfPolys", "0"),
        ],
    };
    let tag = writer.create_element("Piece").with_attributes(counts);
    tag.write_inner_content(|writer| {
        write_arrays(writer, "PointData", of_points)?;
        write_arrays(writer, "CellData", of_cells)?;
        write_arrays(writer, "Points", &[Array::vectors("Points", positions)])?;
        let mut arrays =
            vec![Array::integers("connectivity", &cells.connectivity), Array::integers("offsets", &cells.offsets)];
        let Some(types) = &cells.types else { return write_arrays(writer, "Lines", &arrays) };
        arrays.push(Array { name: "types", components: 1, numbers: Numbers::Bytes(types) });
        write_arrays(writer, "Cells", &arrays)
    })?;
    Ok(())
}

/// Writes the arrays of one element; the first vectors and the first tensors of the data are the active ones.
fn write_arrays(writer: &mut Writer<impl Write>, element: &str, arrays: &[Array<'_>]) -> io::Result<()> {
    let is_data = element.ends_with("Data");
    let first = |components: usize| arrays.iter().find(|array| is_data && array.components == components);
    let active = (first(3).map(|array| ("Vectors", array.name)))
        .into_iter()
        .chain(first(9).map(|array| ("Tensors", array.name)));
    writer
        .create_element(element)
        .with_attributes(active)
        .write_inner_content(|writer| arrays.iter().try_for_each(|array| write_array(writer, array)))?;
    Ok(())
}

fn write_array(writer: &mut Writer<impl Write>, array: &Array<'_>) -> io::Result<()> {
    let (kind, size) = array.numbers.kind();
    let components = array.components.to_string();
    // Some readers in Python make a table of one column of scalars whose number of components is given.
    let count = (array.components > 1).then_some(("NumberOfComponents", components.as_str()));
    let attributes = [("type", kind), ("Name", array.name)].into_iter().chain(count).chain([("format", "binary")]);
    let tag = writer.create_element("DataArray").with_attributes(attributes);
    tag.write_inner_content(|writer| {
        let (blocks, bytes) = (array.numbers.compressed()?, array.numbers.len() * size);
        let lengths = [blocks.len(), BLOCK, bytes % BLOCK].into_iter().chain(blocks.iter().map(Vec::len));
        let header: Vec<u8> = lengths.flat_map(|length| (length as u64).to_le_bytes()).collect();
        let file = writer.get_mut();
        in_base64(file, [header])?;
        in_base64(file, blocks)
    })?;
    Ok(())
}

/// Writes bytes in base64, padded at the end.
fn in_base64(file: &mut impl Write, blocks: impl IntoIterator<Item = Vec<u8>>) -> io::Result<()> {
    let mut encoder = EncoderWriter::new(file, &STANDARD);
    blocks.into_iter().try_for_each(|block| encoder.write_all(&block))?;
    encoder.finish()?;
    Ok(())
}

fn compress(block: &[u8]) -> io::Result<Vec<u8>> {
    let mut encoder = ZlibEncoder::new(Vec::new(), Compression::fast());
    encoder.write_all(block)?;
    encoder.finish()
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;
    use crate::app::vtu::decode;
    use crate::app::vtu::file::{Content, parse};

    #[test]
    fn arrays_of_any_length_are_recovered() {
        for length in [0, 1, BLOCK / 8 - 1, BLOCK / 8, BLOCK / 8 + 1, BLOCK / 2] {
            let positions = vec![[0.0, 1.0, f64::from_bits(1)]; length];
            let integers: Vec<i64> = (0..length as i64).map(|k| k / 100 - 7).collect();
            let piece = Piece {
                positions: &positions,
                cells: Cells { types: Some(Vec::new()), ..Cells::default() },
                of_points: vec![Array::integers("a < \"b\"", &integers), Array::vectors("c", &positions)],
                of_cells: Vec::new(),
            };
            let mut bytes = Vec::new();
            write(&mut bytes, &piece).unwrap();
            let parse = |bytes: &[u8]| parse(Path::new("a.vtu"), bytes, Content::Grid);
            let grid = parse(&bytes).unwrap_or_else(|error| panic!("{error}"));
            assert_eq!(grid.positions.numbers, decode::Numbers::Reals(positions.as_flattened().to_vec()));
            assert_eq!(grid.of_points[0].name, "a < \"b\"");
            assert_eq!(grid.of_points[0].numbers, decode::Numbers::Integers(integers));
            assert_eq!((grid.of_points[1].components, grid.of_points[1].numbers.len()), (3, 3 * length));
            assert!(bytes.len() < 1500 + length, "{} bytes of {length} points", bytes.len());
            for end in [100, bytes.len() / 2, bytes.len() - 200] {
                assert!(parse(&bytes[..end]).is_err(), "a file that ends after {end} bytes");
            }
        }
    }
}
