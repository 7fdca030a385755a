//! Fields of a divided body: a parallel VTK file (`.pvtu`) and one `.vtu` piece per part, which ParaView opens as one
//! grid.
//!
//! Each element is in exactly one piece, that of its part. A point is in the pieces of all its elements, so a point
//! shared by several parts is written once per part. A part without elements has no piece.

use std::ffi::OsStr;
use std::io;
use std::path::Path;

use quick_xml::Writer;

use super::fields::check;
use super::replace::replace;
use super::vtk::write_text;
use super::{FieldSet, ResultsError, write_vtu};
use crate::fem::mesh::Elements;

/// Returns the name of the piece of a part, beside the index file that names all pieces: `fields-00003.pvtu` has
/// `fields-00003-part-0002.vtu`.
pub fn part_file(index_name: &str, part: usize) -> String {
    let stem = index_name.strip_suffix(".pvtu").unwrap_or(index_name);
    format!("{stem}-part-{part:04}.vtu")
}

/// Writes the fields of a divided body: one `.vtu` per part that has elements, under the names given by [`part_file`],
/// then the index file `path`, which should end in `.pvtu` and comes last, because readers open it first. `part_of` is
/// the part of each element, below `parts`.
///
/// # Errors
/// Returns [`ResultsError::Length`] or [`ResultsError::ElementNode`] if the fields do not fit the mesh (nothing is
/// written), or [`ResultsError::Write`] if a file cannot be written or its name is not UTF-8.
///
/// # Panics
/// Panics if a part is not below `parts`.
pub fn write_pieces(path: &Path, fields: &FieldSet, part_of: &[u32], parts: usize) -> Result<(), ResultsError> {
    check(path, fields)?;
    ResultsError::check_length(path, "part_of", part_of.len(), fields.elements.len())?;
    let name = file_name(path)?;
    let mut of_part: Vec<Vec<u32>> = vec![Vec::new(); parts];
    (0..).zip(part_of).for_each(|(element, &part)| of_part[part as usize].push(element));
    let mut sources = Vec::new();
    for (part, own) in of_part.iter().enumerate().filter(|(_, own)| !own.is_empty()) {
        let source = part_file(name, part);
        write_piece(&path.with_file_name(&source), own, fields)?;
        sources.push(source);
    }
    replace(path, &piece_index(&sources, fields).map_err(ResultsError::write(path))?)
}

/// Returns the text of the index file of pieces with the arrays of these fields; `sources` are the names of the pieces.
///
/// # Errors
/// Returns the error of the XML writer.
pub fn piece_index(sources: &[String], fields: &FieldSet) -> io::Result<Vec<u8>> {
    let of_points = Arrays::new(&fields.point_scalars, &[], &fields.point_vectors, &fields.point_tensors);
    let of_cells = Arrays::new(&fields.cell_scalars, &fields.cell_integers, &fields.cell_vectors, &fields.cell_tensors);
    index(sources, &of_points, &of_cells)
}

/// The declarations of arrays: each with its name, its type and its number of components.
#[derive(Default)]
pub(super) struct Arrays<'a> {
    /// The active arrays: kind and name.
    active: Vec<(&'a str, &'a str)>,
    arrays: Vec<Array<'a>>,
}

impl<'a> Arrays<'a> {
    /// Declares arrays in the order in which [`write_vtu`] writes them.
    pub fn new(
        scalars: &[(&'a str, &[f64])],
        integers: &[(&'a str, &[i64])],
        vectors: &[(&'a str, &[[f64; 3]])],
        tensors: &[(&'a str, &[[f64; 9]])],
    ) -> Self {
        let arrays = (scalars.iter().map(|&(name, _)| (name, "Float64", "1")))
            .chain(integers.iter().map(|&(name, _)| (name, "Int64", "1")))
            .chain(vectors.iter().map(|&(name, _)| (name, "Float64", "3")))
            .chain(tensors.iter().map(|&(name, _)| (name, "Float64", "9")));
        // As in the pieces, the first array of its kind is the active one.
        let active = (vectors.first().map(|&(name, _)| ("Vectors", name)))
            .into_iter()
            .chain(tensors.first().map(|&(name, _)| ("Tensors", name)));
        Self { active: active.collect(), arrays: arrays.collect() }
    }
}

/// Returns the text of an index file.
pub(super) fn index(sources: &[String], of_points: &Arrays, of_cells: &Arrays) -> io::Result<Vec<u8>> {
    write_text(&FILE, |writer| {
        let grid = writer.create_element("PUnstructuredGrid").with_attribute(("GhostLevel", "0"));
        grid.write_inner_content(|writer| arrays_and_sources(writer, sources, of_points, of_cells))?;
        Ok(())
    })
}

fn arrays_and_sources(
    writer: &mut Writer<Vec<u8>>,
    sources: &[String],
    of_points: &Arrays,
    of_cells: &Arrays,
) -> io::Result<()> {
    declare(writer, "PPointData", of_points)?;
    declare(writer, "PCellData", of_cells)?;
    declare(writer, "PPoints", &Arrays { active: Vec::new(), arrays: vec![("Points", "Float64", "3")] })?;
    for source in sources {
        writer.create_element("Piece").with_attribute(("Source", source.as_str())).write_empty()?;
    }
    Ok(())
}

/// Writes the piece with these elements, ascending, and their points, to `path`.
///
/// # Errors
/// As for [`write_vtu`].
pub fn write_piece(path: &Path, own: &[u32], fields: &FieldSet) -> Result<(), ResultsError> {
    let elements: Elements = own.iter().filter_map(|&element| fields.elements.get(element as usize)).collect();
    let mut points: Vec<u32> = elements.iter().flatten().copied().collect();
    points.sort_unstable();
    points.dedup();
    let place = |point: u32| points.partition_point(|&other| other < point) as u32;
    let elements = elements.map(place);
    let positions = gather(fields.points, &points);
    let point_scalars = cut(&fields.point_scalars, &points);
    let point_vectors = cut(&fields.point_vectors, &points);
    let point_tensors = cut(&fields.point_tensors, &points);
    let cell_scalars = cut(&fields.cell_scalars, own);
    let cell_integers = cut(&fields.cell_integers, own);
    let cell_vectors = cut(&fields.cell_vectors, own);
    let cell_tensors = cut(&fields.cell_tensors, own);
    let own = FieldSet {
        points: &positions,
        elements: &elements,
        point_scalars: borrow(&point_scalars),
        point_vectors: borrow(&point_vectors),
        point_tensors: borrow(&point_tensors),
        cell_scalars: borrow(&cell_scalars),
        cell_integers: borrow(&cell_integers),
        cell_vectors: borrow(&cell_vectors),
        cell_tensors: borrow(&cell_tensors),
    };
    write_vtu(path, &own)
}

/// Selects the values at `places` from every field.
fn cut<'a, T: Copy>(fields: &[(&'a str, &[T])], places: &[u32]) -> Vec<(&'a str, Vec<T>)> {
    fields.iter().map(|&(name, values)| (name, gather(values, places))).collect()
}

pub(super) fn gather<T: Copy>(values: &[T], places: &[u32]) -> Vec<T> {
    places.iter().map(|&place| values[place as usize]).collect()
}

pub(super) fn borrow<'a, T>(fields: &'a [(&'a str, Vec<T>)]) -> Vec<(&'a str, &'a [T])> {
    fields.iter().map(|(name, values)| (*name, values.as_slice())).collect()
}

pub(super) fn file_name(path: &Path) -> Result<&str, ResultsError> {
    path.file_name().and_then(OsStr::to_str).ok_or_else(|| {
        ResultsError::write(path)(io::Error::new(io::ErrorKind::InvalidInput, "its name is not UTF-8 text"))
    })
}

/// Attributes of the root element. Version 1.0 of the format has array lengths of 64 bits.
const FILE: [(&str, &str); 4] =
    [("type", "PUnstructuredGrid"), ("version", "1.0"), ("byte_order", "LittleEndian"), ("header_type", "UInt64")];

/// The declaration of an array: its name, its type and its number of components.
type Array<'a> = (&'a str, &'a str, &'a str);

/// Declares the arrays of the points, of the elements, or the positions.
fn declare(writer: &mut Writer<Vec<u8>>, element: &str, arrays: &Arrays) -> io::Result<()> {
    let element = writer.create_element(element).with_attributes(arrays.active.iter().copied());
    element.write_inner_content(|writer| {
        for &(name, kind, components) in &arrays.arrays {
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

    fn write(path: &Path, fields: &FieldSet) -> Result<(), ResultsError> {
        write_pieces(path, fields, &PART_OF, PARTS)
    }

    /// Values that differ for every point and element.
    struct Values {
        points: Vec<[f64; 3]>,
        displacement: Vec<[f64; 3]>,
        energy: Vec<f64>,
        region: Vec<i64>,
        direction: Vec<[f64; 3]>,
        stress: Vec<[f64; 9]>,
        elements: Elements,
    }

    impl Values {
        fn new() -> Self {
            Self {
                elements: ELEMENTS.to_vec().into(),
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
                elements: &self.elements,
                point_vectors: vec![("displacement", &self.displacement)],
                cell_scalars: vec![("energy", &self.energy)],
                cell_integers: vec![("region", &self.region)],
                cell_vectors: vec![("direction", &self.direction)],
                cell_tensors: vec![("stress", &self.stress)],
                ..FieldSet::default()
            }
        }
    }

    #[test]
    fn values_follow_their_points_and_elements() {
        let dir = tempfile::tempdir().unwrap();
        let values = Values::new();
        write(&dir.path().join(INDEX), &values.fields()).unwrap();
        let own: [&[usize]; PARTS] = [&[1, 3], &[], &[0, 2], &[]];
        for (part, own) in own.iter().enumerate() {
            let path = dir.path().join(part_file(INDEX, part));
            assert_eq!(path.exists(), !own.is_empty());
            if !path.exists() {
                continue;
            }
            let read = read_vtu(&path).unwrap();
            let points: BTreeSet<u32> = own.iter().flat_map(|&element| ELEMENTS[element]).collect();
            let points: Vec<u32> = points.into_iter().collect();
            assert_eq!(read.elements.len(), own.len());
            assert_eq!(read.points.len(), points.len());
            for (place, &point) in points.iter().enumerate() {
                let moved = read.point_vector("displacement").unwrap()[place];
                assert_eq!(read.points[place], values.points[point as usize]);
                assert_eq!(moved, values.displacement[point as usize]);
            }
            for (place, &element) in own.iter().enumerate() {
                let nodes: Vec<u32> = read.elements[place].iter().map(|&node| points[node as usize]).collect();
                assert_eq!(nodes, ELEMENTS[element]);
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
        let (index, values) = (dir.path().join(INDEX), Values::new());
        write(&index, &values.fields()).unwrap();
        let read = read_fields(&index).unwrap();
        let met: BTreeSet<u32> = ELEMENTS.into_iter().flatten().collect();
        assert_eq!(read.points.len(), met.len(), "points shared by pieces occur once");
        assert_eq!(read.point_vector("displacement").unwrap().len(), met.len());
        // The elements are in the order of the pieces: those of part 0, then those of part 2.
        for (nodes, element) in read.elements.iter().zip([1, 3, 0, 2]) {
            let expected = ELEMENTS[element].map(|node| values.points[node as usize]);
            let found: Vec<_> = nodes.iter().map(|&node| read.points[node as usize]).collect();
            assert_eq!(found, expected);
        }
    }

    #[test]
    fn the_index_declares_the_arrays_and_names_the_existing_pieces() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join(INDEX);
        write(&path, &Values::new().fields()).unwrap();
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
        let refused = |fields: &FieldSet| write(&path, fields).unwrap_err();

        let error = refused(&FieldSet { cell_scalars: vec![("energy", &values.energy[..3])], ..values.fields() });
        assert!(matches!(&error, ResultsError::Length { name, found: 3, expected: 4, .. } if name == "energy"));
        let error =
            refused(&FieldSet { point_vectors: vec![("displacement", &values.points[1..])], ..values.fields() });
        assert!(matches!(&error, ResultsError::Length { name, found: 10, expected: 11, .. } if name == "displacement"));
        let error = refused(&FieldSet { points: &values.points[..9], point_vectors: Vec::new(), ..values.fields() });
        assert!(matches!(error, ResultsError::ElementNode { element: 0, node: 9, nodes: 9, .. }), "{error}");
        let error = write_pieces(&path, &values.fields(), &PART_OF[..3], PARTS).unwrap_err();
        assert!(matches!(&error, ResultsError::Length { name, found: 3, expected: 4, .. } if name == "part_of"));
        assert_eq!(std::fs::read_dir(dir.path()).unwrap().count(), 0);
    }
}
