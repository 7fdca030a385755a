//! Fields of a divided body: a parallel VTK file (`.pvtu`) and one `.vtu` piece per part, which ParaView opens as one
//! grid.
//!
//! Each element is in exactly one piece, that of its part. A point is in the pieces of all its elements, so a point
//! shared by several parts is written once per part. A part without elements has no piece.

use std::ffi::OsStr;
use std::io;
use std::path::Path;

use quick_xml::Writer;

use super::replace::replace;
use super::vtk::write_text;
use super::{FieldSet, ResultsError, write_vtu};

/// Returns the name of the piece of a part, beside the index file that names all pieces: `fields-00003.pvtu` has
/// `fields-00003-part-0002.vtu`.
#[must_use]
pub fn part_file(index_name: &str, part: usize) -> String {
    let stem = index_name.strip_suffix(".pvtu").unwrap_or(index_name);
    format!("{stem}-part-{part:04}.vtu")
}

/// A body divided into pieces, one per part.
#[derive(Clone, Debug, PartialEq)]
pub struct Pieces {
    pieces: Vec<Piece>,
    /// Number of elements of the body.
    elements: usize,
}

/// The mesh of one part.
#[derive(Clone, Debug, PartialEq)]
struct Piece {
    /// Its elements, ascending.
    elements: Vec<u32>,
    /// The points of its elements, ascending.
    points: Vec<u32>,
    /// The four points of each of its elements, as indices into `points`.
    corners: Vec<[u32; 4]>,
}

impl Pieces {
    /// Divides a body. `part_of` is the part of each element, below `parts`.
    #[must_use]
    pub fn new(elements: &[[u32; 4]], part_of: &[u32], parts: usize) -> Self {
        let mut of_part = vec![Vec::new(); parts];
        for (element, &part) in (0..).zip(part_of) {
            of_part[part as usize].push(element);
        }
        let pieces = of_part.into_iter().map(|own| Piece::new(own, elements)).collect();
        Self { pieces, elements: elements.len() }
    }

    /// Returns the number of parts, including those without elements.
    #[must_use]
    pub fn len(&self) -> usize {
        self.pieces.len()
    }

    /// Returns true if there is no part.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.pieces.is_empty()
    }

    /// Writes the piece of one part beside the index file `path` (see [`write_index`](Self::write_index)), under the
    /// name given by [`part_file`]. `fields` are the fields of the whole body. A part without elements is not written.
    ///
    /// # Errors
    /// Returns [`ResultsError::Length`] or [`ResultsError::ElementNode`] if the fields do not belong to the divided
    /// body (nothing is written), [`ResultsError::Encode`] if the data cannot be encoded, or [`ResultsError::Write`] if
    /// the file cannot be written.
    pub fn write_part(&self, part: usize, path: &Path, fields: &FieldSet) -> Result<(), ResultsError> {
        let Some(piece) = self.pieces.get(part).filter(|piece| !piece.elements.is_empty()) else {
            return Ok(());
        };
        let path = path.with_file_name(part_file(file_name(path)?, part));
        ResultsError::check_length(&path, "elements", fields.elements.len(), self.elements)?;
        piece.write(&path, fields)
    }

    /// Writes the index file that names all pieces to `path`, which should end in `.pvtu`. Write it after the pieces,
    /// because readers open it first. Only the names and types of `fields` are used, not the values.
    ///
    /// # Errors
    /// Returns [`ResultsError::Write`] if the file cannot be written or its name is not UTF-8.
    pub fn write_index(&self, path: &Path, fields: &FieldSet) -> Result<(), ResultsError> {
        let bytes = self.index(file_name(path)?, fields).map_err(ResultsError::write(path))?;
        replace(path, &bytes)
    }

    fn index(&self, name: &str, fields: &FieldSet) -> io::Result<Vec<u8>> {
        write_text(&FILE, |writer| {
            let grid = writer.create_element("PUnstructuredGrid").with_attribute(("GhostLevel", "0"));
            grid.write_inner_content(|writer| self.arrays_and_sources(writer, name, fields))?;
            Ok(())
        })
    }

    fn arrays_and_sources(&self, writer: &mut Writer<Vec<u8>>, name: &str, fields: &FieldSet) -> io::Result<()> {
        let of_points: Vec<Array> = fields.point_vectors.iter().map(|&(name, _)| (name, "Float64", "3")).collect();
        let active = [first("Vectors", &fields.point_vectors), None];
        declare(writer, "PPointData", active, &of_points)?;
        let active = [first("Vectors", &fields.cell_vectors), first("Tensors", &fields.cell_tensors)];
        declare(writer, "PCellData", active, &arrays_of_cells(fields))?;
        declare(writer, "PPoints", [None, None], &[("Points", "Float64", "3")])?;
        for (part, piece) in self.pieces.iter().enumerate() {
            if !piece.elements.is_empty() {
                let source = part_file(name, part);
                writer.create_element("Piece").with_attribute(("Source", source.as_str())).write_empty()?;
            }
        }
        Ok(())
    }
}

impl Piece {
    /// Creates the piece with these elements, ascending; `body` has the points of all elements.
    fn new(elements: Vec<u32>, body: &[[u32; 4]]) -> Self {
        let mut points: Vec<u32> = elements.iter().flat_map(|&element| body[element as usize]).collect();
        points.sort_unstable();
        points.dedup();
        let place = |point: u32| points.partition_point(|&other| other < point) as u32;
        let corners = elements.iter().map(|&element| body[element as usize].map(place)).collect();
        Self { elements, points, corners }
    }

    /// Writes the part of `fields` that belongs to this piece; `fields` has one value per element or point of the body.
    fn write(&self, path: &Path, fields: &FieldSet) -> Result<(), ResultsError> {
        let (points, elements) = (fields.points.len(), fields.elements.len());
        self.check_points(path, points)?;
        let positions = gather(fields.points, &self.points);
        let point_vectors = cut(path, &fields.point_vectors, &self.points, points)?;
        let cell_scalars = cut(path, &fields.cell_scalars, &self.elements, elements)?;
        let cell_integers = cut(path, &fields.cell_integers, &self.elements, elements)?;
        let cell_vectors = cut(path, &fields.cell_vectors, &self.elements, elements)?;
        let cell_tensors = cut(path, &fields.cell_tensors, &self.elements, elements)?;
        let own = FieldSet {
            points: &positions,
            elements: &self.corners,
            point_vectors: borrow(&point_vectors),
            cell_scalars: borrow(&cell_scalars),
            cell_integers: borrow(&cell_integers),
            cell_vectors: borrow(&cell_vectors),
            cell_tensors: borrow(&cell_tensors),
        };
        write_vtu(path, &own)
    }

    /// Checks that every point of the piece is one of the `nodes` of the body.
    fn check_points(&self, path: &Path, nodes: usize) -> Result<(), ResultsError> {
        for (&element, corners) in self.elements.iter().zip(&self.corners) {
            let points = corners.map(|place| self.points[place as usize]);
            if let Some(&node) = points.iter().find(|&&node| node as usize >= nodes) {
                let (element, node) = (element as usize, node.into());
                return Err(ResultsError::ElementNode { path: path.into(), element, node, nodes });
            }
        }
        Ok(())
    }
}

/// Selects the values at `places` from every field, which must have `expected` values.
fn cut<'a, T: Copy>(
    path: &Path,
    fields: &[(&'a str, &[T])],
    places: &[u32],
    expected: usize,
) -> Result<Vec<(&'a str, Vec<T>)>, ResultsError> {
    let mut own = Vec::with_capacity(fields.len());
    for &(name, values) in fields {
        ResultsError::check_length(path, name, values.len(), expected)?;
        own.push((name, gather(values, places)));
    }
    Ok(own)
}

fn gather<T: Copy>(values: &[T], places: &[u32]) -> Vec<T> {
    places.iter().map(|&place| values[place as usize]).collect()
}

fn borrow<'a, T>(fields: &'a [(&'a str, Vec<T>)]) -> Vec<(&'a str, &'a [T])> {
    fields.iter().map(|(name, values)| (*name, values.as_slice())).collect()
}

fn file_name(path: &Path) -> Result<&str, ResultsError> {
    path.file_name().and_then(OsStr::to_str).ok_or_else(|| {
        ResultsError::write(path)(io::Error::new(io::ErrorKind::InvalidInput, "its name is no text in UTF-8"))
    })
}

/// Attributes of the root element. Version 1.0 of the format has array lengths of 64 bits.
const FILE: [(&str, &str); 4] =
    [("type", "PUnstructuredGrid"), ("version", "1.0"), ("byte_order", "LittleEndian"), ("header_type", "UInt64")];

/// The declaration of an array: its name, its type and its number of components.
type Array<'a> = (&'a str, &'a str, &'a str);

/// The arrays of the elements, in the order in which [`write_vtu`] writes them.
fn arrays_of_cells<'a>(fields: &FieldSet<'a>) -> Vec<Array<'a>> {
    let scalars = fields.cell_scalars.iter().map(|&(name, _)| (name, "Float64", "1"));
    let integers = fields.cell_integers.iter().map(|&(name, _)| (name, "Int64", "1"));
    let vectors = fields.cell_vectors.iter().map(|&(name, _)| (name, "Float64", "3"));
    let tensors = fields.cell_tensors.iter().map(|&(name, _)| (name, "Float64", "9"));
    scalars.chain(integers).chain(vectors).chain(tensors).collect()
}

/// Makes the first field the active one of its kind, as in the pieces.
fn first<'a, T>(kind: &'a str, fields: &[(&'a str, T)]) -> Option<(&'a str, &'a str)> {
    fields.first().map(|(name, _)| (kind, *name))
}

/// Declares the arrays of the points, of the elements, or the positions.
fn declare<'a>(
    writer: &mut Writer<Vec<u8>>,
    element: &str,
    active: [Option<(&'a str, &'a str)>; 2],
    arrays: &[Array<'a>],
) -> io::Result<()> {
    let element = writer.create_element(element).with_attributes(active.into_iter().flatten());
    element.write_inner_content(|writer| {
        for &(name, kind, components) in arrays {
            let array = [("type", kind), ("Name", name), ("NumberOfComponents", components)];
            writer.create_element("PDataArray").with_attributes(array).write_empty()?;
        }
        Ok(())
    })?;
    Ok(())
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use super::*;
    use crate::app::results::{read_fields, read_vtu};

    const POINTS: i32 = 11;
    const ELEMENTS: [[u32; 4]; 4] = [[9, 2, 4, 0], [2, 5, 4, 9], [7, 5, 2, 4], [7, 8, 5, 1]];
    /// The second part and the last have no element.
    const PART_OF: [u32; 4] = [2, 0, 2, 0];
    const PARTS: usize = 4;
    const INDEX: &str = "fields-00003.pvtu";

    fn pieces() -> Pieces {
        Pieces::new(&ELEMENTS, &PART_OF, PARTS)
    }

    /// Values that differ for every point and element.
    struct Values {
        points: Vec<[f64; 3]>,
        displacement: Vec<[f64; 3]>,
        energy: Vec<f64>,
        region: Vec<i64>,
        direction: Vec<[f64; 3]>,
        stress: Vec<[f64; 9]>,
    }

    impl Values {
        fn new() -> Self {
            Self {
                points: (0..POINTS).map(|point| [f64::from(point), 0.5, -1.0]).collect(),
                displacement: (0..POINTS).map(|point| [0.0, f64::from(point) / 3.0, 1.0]).collect(),
                energy: (0..4).map(|element| f64::from(element) / 7.0).collect(),
                region: (0..4).map(|element| 10 * element).collect(),
                direction: (0..4).map(|element| [1.0, f64::from(element), 0.0]).collect(),
                stress: (0..4).map(|element| std::array::from_fn(|k| f64::from(element) + k as f64 / 9.0)).collect(),
            }
        }

        fn fields(&self) -> FieldSet<'_> {
            FieldSet {
                points: &self.points,
                elements: &ELEMENTS,
                point_vectors: vec![("displacement", &self.displacement)],
                cell_scalars: vec![("energy", &self.energy)],
                cell_integers: vec![("region", &self.region)],
                cell_vectors: vec![("direction", &self.direction)],
                cell_tensors: vec![("stress", &self.stress)],
            }
        }
    }

    #[test]
    fn every_element_is_in_one_piece_with_its_points() {
        let pieces = pieces();
        assert_eq!((pieces.len(), pieces.is_empty()), (PARTS, false));
        let mut met = [0; 4];
        for (part, piece) in (0_u32..).zip(&pieces.pieces) {
            assert_eq!(piece.elements.len(), piece.corners.len());
            for (&element, corners) in piece.elements.iter().zip(&piece.corners) {
                met[element as usize] += 1;
                assert_eq!(PART_OF[element as usize], part);
                assert_eq!(corners.map(|place| piece.points[place as usize]), ELEMENTS[element as usize]);
            }
            let points: BTreeSet<u32> = piece.elements.iter().flat_map(|&element| ELEMENTS[element as usize]).collect();
            assert_eq!(piece.points, points.into_iter().collect::<Vec<_>>());
        }
        assert_eq!(met, [1; 4]);
    }

    #[test]
    fn values_follow_their_points_and_elements() {
        let dir = tempfile::tempdir().unwrap();
        let values = Values::new();
        for (part, piece) in pieces().pieces.iter().enumerate() {
            pieces().write_part(part, &dir.path().join(INDEX), &values.fields()).unwrap();
            let path = dir.path().join(part_file(INDEX, part));
            assert_eq!(path.exists(), !piece.elements.is_empty());
            if !path.exists() {
                continue;
            }
            let read = read_vtu(&path).unwrap();
            assert_eq!(read.elements, piece.corners);
            assert_eq!(read.points.len(), piece.points.len());
            for (place, &point) in piece.points.iter().enumerate() {
                let moved = read.point_vector("displacement").unwrap()[place];
                assert_eq!(read.points[place], values.points[point as usize]);
                assert_eq!(moved, values.displacement[point as usize]);
            }
            for (place, &element) in piece.elements.iter().enumerate() {
                let element = element as usize;
                assert_eq!(read.cell_scalar("energy").unwrap()[place], values.energy[element]);
                assert_eq!(read.cell_integer("region").unwrap()[place], values.region[element]);
                assert_eq!(read.cell_vector("direction").unwrap()[place], values.direction[element]);
                assert_eq!(read.cell_tensor("stress").unwrap()[place], values.stress[element]);
            }
        }
    }

    #[test]
    fn pieces_are_read_as_one_body() {
        let dir = tempfile::tempdir().unwrap();
        let (index, values, pieces) = (dir.path().join(INDEX), Values::new(), pieces());
        (0..PARTS).for_each(|part| pieces.write_part(part, &index, &values.fields()).unwrap());
        pieces.write_index(&index, &values.fields()).unwrap();
        let read = read_fields(&index).unwrap();
        let met: BTreeSet<u32> = ELEMENTS.into_iter().flatten().collect();
        assert_eq!(read.points.len(), met.len(), "points between the pieces are there once");
        assert_eq!(read.point_vector("displacement").unwrap().len(), met.len());
        // The elements are in the order of the pieces: those of part 0, then those of part 2.
        for (nodes, element) in read.elements.iter().zip([1, 3, 0, 2]) {
            let expected = ELEMENTS[element].map(|node| values.points[node as usize]);
            assert_eq!(nodes.map(|node| read.points[node as usize]), expected);
        }
    }

    #[test]
    fn the_index_declares_what_is_in_the_pieces_and_names_those_that_are() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join(INDEX);
        pieces().write_index(&path, &Values::new().fields()).unwrap();
        let expected = r#"<?xml version="1.0" encoding="UTF-8"?>
<VTKFile type="PUnstructuredGrid" version="1.0" byte_order="LittleEndian" header_type="UInt64">
  <PUnstructuredGrid GhostLevel="0">
    <PPointData Vectors="displacement">
      <PDataArray type="Float64" Name="displacement" NumberOfComponents="3"/>
    </PPointData>
    <PCellData Vectors="direction" Tensors="stress">
      <PDataArray type="Float64" Name="energy" NumberOfComponents="1"/>
      <PDataArray type="Int64" Name="region" NumberOfComponents="1"/>
      <PDataArray type="Float64" Name="direction" NumberOfComponents="3"/>
      <PDataArray type="Float64" Name="stress" NumberOfComponents="9"/>
    </PCellData>
    <PPoints>
      <PDataArray type="Float64" Name="Points" NumberOfComponents="3"/>
    </PPoints>
    <Piece Source="fields-00003-part-0000.vtu"/>
    <Piece Source="fields-00003-part-0002.vtu"/>
  </PUnstructuredGrid>
</VTKFile>
"#;
        assert_eq!(std::fs::read_to_string(&path).unwrap(), expected);
    }

    #[test]
    fn fields_of_another_body_are_refused_before_anything_is_written() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join(INDEX);
        let values = Values::new();
        let refused = |fields: &FieldSet| pieces().write_part(0, &path, fields).unwrap_err();

        let error = refused(&FieldSet { cell_scalars: vec![("energy", &values.energy[..3])], ..values.fields() });
        assert!(matches!(&error, ResultsError::Length { name, found: 3, expected: 4, .. } if name == "energy"));
        let error =
            refused(&FieldSet { point_vectors: vec![("displacement", &values.points[1..])], ..values.fields() });
        assert!(matches!(&error, ResultsError::Length { name, found: 10, expected: 11, .. } if name == "displacement"));
        let error = refused(&FieldSet { elements: &ELEMENTS[..2], ..values.fields() });
        assert!(matches!(&error, ResultsError::Length { name, found: 2, expected: 4, .. } if name == "elements"));
        let error = refused(&FieldSet { points: &values.points[..9], ..values.fields() });
        assert!(matches!(error, ResultsError::ElementNode { element: 1, node: 9, nodes: 9, .. }), "{error}");
        assert_eq!(std::fs::read_dir(dir.path()).unwrap().count(), 0);
    }
}
