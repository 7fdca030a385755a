//! Meshes of other programs and of this one, in every encoding, and damaged ones.

use std::io::Write;
use std::path::{Path, PathBuf};

use super::read;
use crate::app::results::{FieldSet, vtk_place, write_vtu};
use crate::fem::element::{CellType, ElementType, FaceType};
use crate::fem::mesh::gmsh::{self, MeshFile};
use crate::fem::mesh::shapes::cuboid_of;
use crate::fem::mesh::{Elements, Mesh, Surface};

const DATA: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/data");

/// Returns the mesh with its regions and surfaces renamed.
fn renamed(mesh: &Mesh, regions: &[&str], surfaces: &[&str]) -> Mesh {
    let named = mesh.surfaces().iter().zip(surfaces);
    let surfaces = named.map(|(old, name)| Surface { name: (*name).into(), faces: old.faces.clone() }).collect();
    let regions = regions.iter().map(|&name| name.into()).collect();
    Mesh::new(mesh.nodes().to_vec(), mesh.elements().clone(), mesh.region_of().to_vec(), regions, surfaces).unwrap()
}

#[test]
fn files_of_meshio_give_the_mesh_of_the_gmsh_file() {
    for (name, forms) in [
        ("tet10", &["zlib"][..]),
        ("hex8", &["zlib", "text", "base64"]),
        ("hex20", &["zlib", "text"]),
        ("hex27", &["zlib", "text"]),
        ("wedge6", &["zlib", "text"]),
    ] {
        let of_gmsh = gmsh::read(Path::new(&format!("{DATA}/gmsh/ring_{name}_4.1_text.msh"))).unwrap().mesh;
        let expected = renamed(&of_gmsh, &["region_2"], &["surface_1"]);
        for form in forms {
            let path = format!("{DATA}/vtu/ring_{name}_{form}.vtu");
            let MeshFile { mesh, warnings } = read(Path::new(&path)).unwrap_or_else(|error| panic!("{error}"));
            // Text has 12 digits.
            let tolerance = if *form == "text" { 1e-11 } else { 0.0 };
            for (a, b) in mesh.nodes().as_flattened().iter().zip(expected.nodes().as_flattened()) {
                assert!((a - b).abs() <= tolerance, "{path}");
            }
            assert_eq!((mesh.regions(), mesh.region_of()), (expected.regions(), expected.region_of()), "{path}");
            assert_eq!(mesh.surfaces().len(), 1);
            assert!(warnings.is_empty(), "{warnings:?}");
            assert_eq!(mesh.elements(), expected.elements(), "{path}");
            assert_eq!(mesh.surfaces(), expected.surfaces(), "{path}");
        }
    }
}

/// A mesh of several types: the elements of two boxes that do not touch.
fn mixed() -> Mesh {
    let (hexahedra, wedges) =
        (cuboid_of(ElementType::Hex27, [1, 2, 1], [1.0; 3]), cuboid_of(ElementType::Wedge6, [1; 3], [1.0; 3]));
    let (hexahedra, wedges) = (hexahedra.unwrap(), wedges.unwrap());
    let first = hexahedra.nodes().len() as u32;
    let mut nodes = hexahedra.nodes().to_vec();
    nodes.extend(wedges.nodes().iter().map(|[x, y, z]| [x + 3.0, *y, *z]));
    let mut elements: Elements = hexahedra.elements().clone();
    elements.extend(&wedges.elements().map(|node| node + first));
    Mesh::new(nodes, elements, vec![0, 1, 1, 1], vec!["region_0".into(), "region_1".into()], Vec::new()).unwrap()
}

#[test]
fn fields_of_this_program_are_read_as_meshes() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("fields.vtu");
    let boxes = ElementType::ALL.map(|of| {
        let mesh = cuboid_of(of, [2, 1, 1], [0.3, 0.1, 0.2]).unwrap();
        Mesh::new(
            mesh.nodes().to_vec(),
            mesh.elements().clone(),
            mesh.region_of().to_vec(),
            vec!["region_0".into()],
            vec![],
        )
        .unwrap()
    });
    for mesh in boxes.into_iter().chain([mixed()]) {
        let region: Vec<i64> = mesh.region_of().iter().map(|&region| region.into()).collect();
        let mut fields = FieldSet { points: mesh.nodes(), elements: mesh.elements(), ..FieldSet::default() };
        write_vtu(&path, &FieldSet { cell_integers: vec![("region", &region)], ..fields.clone() }).unwrap();
        let found = read(&path).unwrap_or_else(|error| panic!("{error}"));
        assert_eq!((found.mesh, found.warnings), (mesh.clone(), Vec::new()));
        // Without groups there is one region.
        fields.cell_integers.clear();
        write_vtu(&path, &fields).unwrap();
        let found = read(&path).unwrap().mesh;
        assert_eq!((found.regions(), found.elements()), (&["body".to_owned()][..], mesh.elements()));
    }
}

/// The form of a file.
#[derive(Clone, Copy, Debug, Default)]
struct Form {
    is_appended: bool,
    is_raw: bool,
    is_compressed: bool,
    is_big_endian: bool,
    is_long: bool,
}

fn base64(bytes: &[u8]) -> String {
    const DIGITS: &[u8; 64] = b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    let mut text = String::new();
    for chunk in bytes.chunks(3) {
        let bits = (0..3).fold(0, |bits, k| bits << 8 | u32::from(chunk.get(k).copied().unwrap_or(0)));
        for k in 0..4 {
            let digit = char::from(DIGITS[(bits >> (18 - 6 * k) & 63) as usize]);
            text.push(if k <= chunk.len() { digit } else { '=' });
        }
    }
    text
}

impl Form {
    fn number(self, number: usize) -> Vec<u8> {
        let bytes = (number as u64).to_le_bytes();
        let mut bytes = if self.is_long { bytes.to_vec() } else { bytes[..4].to_vec() };
        if self.is_big_endian {
            bytes.reverse();
        }
        bytes
    }

    /// Encodes an array; compressed ones in full blocks of 64 bytes and a rest, as VTK does.
    fn encode(self, bytes: &[u8]) -> Vec<u8> {
        let (mut header, mut data) = (Vec::new(), Vec::new());
        if self.is_compressed {
            let blocks = bytes.chunks(64);
            header.extend([blocks.len(), 64, bytes.len() % 64].iter().flat_map(|&number| self.number(number)));
            for block in blocks {
                let mut encoder = flate2::write::ZlibEncoder::new(Vec::new(), flate2::Compression::fast());
                encoder.write_all(block).unwrap();
                let block = encoder.finish().unwrap();
                header.extend(self.number(block.len()));
                data.extend(block);
            }
        } else {
            header = self.number(bytes.len());
            data = bytes.to_vec();
        }
        match self.is_raw {
            true => [header, data].concat(),
            // The header of a compressed array is padded by itself.
            false if self.is_compressed => (base64(&header) + &base64(&data)).into_bytes(),
            false => base64(&[header, data].concat()).into_bytes(),
        }
    }

    /// Writes a mesh whose regions and surfaces are numbered from 0 and 10.
    fn file(self, mesh: &Mesh) -> Vec<u8> {
        let mut cells: Vec<(u8, Vec<i32>, i32)> = Vec::new();
        let nodes = |nodes: &[u32]| nodes.iter().map(|&node| node as i32).collect::<Vec<_>>();
        for (number, surface) in (10..).zip(mesh.surfaces()) {
            for (face, of) in surface.faces.typed() {
                let vtk = match face {
                    FaceType::Tri3 => 5,
                    FaceType::Tri6 => 22,
                    FaceType::Quad4 => 9,
                    FaceType::Quad8 => 23,
                    FaceType::Quad9 => 28,
                };
                cells.push((vtk, nodes(of), number));
            }
        }
        cells.push((3, vec![0, 1], 99));
        for ((of, nodes), region) in mesh.elements().typed().zip(mesh.region_of()) {
            let vtk = [10, 24, 12, 25, 29, 13][of as usize];
            let nodes = (0..of.nodes()).map(|node| nodes[vtk_place(of, node)] as i32).collect();
            cells.push((vtk, nodes, *region as i32));
        }
        let mut end = 0;
        let offsets = cells.iter().map(|(_, nodes, _)| {
            end += nodes.len() as i32;
            end
        });
        let whole = |numbers: Vec<i32>| -> Vec<u8> {
            let of = |number: i32| if self.is_big_endian { number.to_be_bytes() } else { number.to_le_bytes() };
            numbers.into_iter().flat_map(of).collect()
        };
        let real = |number: &f64| if self.is_big_endian { number.to_be_bytes() } else { number.to_le_bytes() };
        let arrays = [
            ("Points", "Float64\" NumberOfComponents=\"3", mesh.nodes().as_flattened().iter().flat_map(real).collect()),
            ("connectivity", "Int32", whole(cells.iter().flat_map(|(_, nodes, _)| nodes.clone()).collect())),
            ("offsets", "Int32", whole(offsets.collect())),
            ("types", "UInt8", cells.iter().map(|(vtk, _, _)| *vtk).collect()),
            ("medit:ref", "Int32", whole(cells.iter().map(|(_, _, group)| *group).collect())),
        ];
        let (mut tags, mut appended) = (Vec::new(), Vec::new());
        for (name, kind, bytes) in arrays {
            let data = self.encode(&bytes);
            tags.push(match self.is_appended {
                true => format!(
                    "<DataArray Name=\"{name}\" type=\"{kind}\" format=\"appended\" offset=\"{}\"/>",
                    appended.len()
                ),
                false => format!(
                    "<DataArray Name=\"{name}\" type=\"{kind}\" format=\"binary\">\n  {}\n</DataArray>",
                    String::from_utf8(data.clone()).unwrap()
                ),
            });
            appended.extend(data);
        }
        let mut file = format!(
            "<?xml version=\"1.0\"?>\n<VTKFile type=\"UnstructuredGrid\" byte_order=\"{}\" header_type=\"{}\"{}>\n\
             <UnstructuredGrid>\n<Piece NumberOfPoints=\"{}\" NumberOfCells=\"{}\">\n<Points>{}</Points>\n\
             <Cells>{}{}{}</Cells>\n<CellData>{}</CellData>\n</Piece></UnstructuredGrid>\n",
            if self.is_big_endian { "BigEndian" } else { "LittleEndian" },
            if self.is_long { "UInt64" } else { "UInt32" },
            if self.is_compressed { " compressor=\"vtkZLibDataCompressor\"" } else { "" },
            mesh.nodes().len(),
            cells.len(),
            tags[0],
            tags[1],
            tags[2],
            tags[3],
            tags[4]
        )
        .into_bytes();
        if self.is_appended {
            let encoding = if self.is_raw { "raw" } else { "base64" };
            file.extend(format!("<AppendedData encoding=\"{encoding}\">\n   _").bytes());
            file.extend(appended);
            file.extend(b"\n</AppendedData>\n");
        }
        file.extend(b"</VTKFile>\n");
        file
    }
}

/// Reads the bytes of a file.
fn parsed(bytes: &[u8]) -> Result<MeshFile, String> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.vtu");
    std::fs::write(&path, bytes).unwrap();
    read(&path).map_err(|error| error.to_string().replace(&format!("{}/", folder.path().display()), ""))
}

#[test]
fn every_encoding_of_every_element_type_gives_the_same_mesh() {
    let surfaces: Vec<String> = (10..16).map(|number| format!("surface_{number}")).collect();
    let surfaces: Vec<&str> = surfaces.iter().map(String::as_str).collect();
    for element_type in ElementType::ALL {
        let mesh = cuboid_of(element_type, [2, 1, 1], [0.3, 0.1, 0.2]).unwrap();
        let expected = renamed(&mesh, &["region_0"], &surfaces);
        for bits in 0..32 {
            let is = |bit: u32| bits >> bit & 1 == 1;
            let form = Form {
                is_appended: is(0),
                is_raw: is(0) && is(1),
                is_compressed: is(2),
                is_big_endian: is(3),
                is_long: is(4),
            };
            let found = parsed(&form.file(&mesh)).unwrap_or_else(|error| panic!("{form:?}: {error}"));
            assert_eq!((found.mesh, found.warnings), (expected.clone(), Vec::new()), "{form:?}");
        }
    }
}

/// One tetrahedron with one face, in text.
const TEXT: &str = r#"<VTKFile type="UnstructuredGrid" byte_order="LittleEndian">
<UnstructuredGrid><Piece NumberOfPoints="5" NumberOfCells="2"><Points>
<DataArray type="Float32" NumberOfComponents="3" format="ascii">0 0 0 1 0 0 0 1 0 0 0 1 9 9 9</DataArray>
</Points><Cells>
<DataArray type="Int64" Name="connectivity" format="ascii">0 2 1 3 0 1 2</DataArray>
<DataArray type="Int64" Name="offsets" format="ascii">4 7</DataArray>
<DataArray type="UInt8" Name="types" format="ascii">10 5</DataArray>
</Cells><CellData>
<DataArray type="Int32" Name="region" format="ascii">-3 4</DataArray>
</CellData></Piece></UnstructuredGrid></VTKFile>
"#;

#[test]
fn inverted_elements_and_unused_nodes_are_corrected() {
    let MeshFile { mesh, warnings } = parsed(TEXT.as_bytes()).unwrap();
    assert_eq!(
        warnings,
        ["1 element had a negative volume and has been reversed", "1 node belongs to no element and is left out"]
    );
    assert_eq!((mesh.regions(), mesh.nodes().len()), (&["region_-3".to_owned()][..], 4));
    assert_eq!(mesh.surface_names().collect::<Vec<_>>(), ["surface_4"]);
    let plain = TEXT.replace("\"region\"", "\"temperature\"");
    let mesh = parsed(plain.as_bytes()).unwrap().mesh;
    assert_eq!((mesh.regions()[0].as_str(), mesh.surface_names().collect::<Vec<_>>()), ("body", vec!["surface"]));
}

/// VTK writes the ranges of an array inside of it.
#[test]
fn elements_within_arrays_are_skipped() {
    let keys =
        "<InformationKey name=\"L2_NORM_RANGE\" length=\"2\"><Value index=\"0\">0</Value></InformationKey></DataArray>";
    let mesh = parsed(TEXT.as_bytes()).unwrap().mesh;
    assert_eq!(parsed(TEXT.replace("</DataArray>", keys).as_bytes()).unwrap().mesh, mesh);
    let form = Form { is_appended: true, ..Form::default() };
    let mesh = cuboid_of(ElementType::Hex8, [1; 3], [1.0; 3]).unwrap();
    let file = String::from_utf8(form.file(&mesh)).unwrap();
    let with_keys = file.replace("\"/></", &format!("\">{keys}</"));
    assert_ne!(with_keys, file);
    assert_eq!(parsed(with_keys.as_bytes()).unwrap().mesh, parsed(file.as_bytes()).unwrap().mesh);
}

#[test]
fn invalid_files_name_the_line_and_a_cure() {
    for (from, to, expected) in [
        ("10 5", "14 5", "a.vtu:7: cell 0 is of type 14 (pyramid)"),
        ("10 5", "10 99", "a.vtu:7: cell 1 is of type 99 (cell of unknown kind)"),
        ("10 5", "24 5", "a.vtu:6: cell 0 of type 24 has 4 nodes, not 10"),
        (">10 5", ">3 5", "a.vtu:2: the grid has no cells with a volume, only 1 faces"),
        ("4 7", "4 9", "a.vtu:6: the nodes of cell 1 end at 9, after 4 of 7"),
        ("0 1 2<", "0 1 5<", "a.vtu:5: cell 1 names node 5, but there are 5 points (from 0)"),
        (
            "0 1 2<",
            "0 1 4<",
            "face 0 of surface `surface_4`, nodes [0, 1, 4], is not a face of any element (cell 1 of the file",
        ),
        ("0 2 1 3 ", "0 2 1 0 ", "element 0 has node 0 twice (cell 0 of the file, from 0)"),
        ("1 0 0 0 1 9", "0 0 0 0 1 9", "a.vtu: "),
        ("-3 4", "-3 4 5", "a.vtu:9: the array `region` has 3 values for 2 cells"),
        ("Int32", "Float64", "a.vtu:9: the array `region` holds floating-point numbers"),
        ("-3 4", "-3 x", "a.vtu:9: the array `region` `x` is not a number of its type"),
        ("9 9 9", "9 9", "a.vtu:3: the array `Points` has 14 numbers; 15 are announced"),
        ("\"types\"", "\"type\"", "a.vtu:2: the array `types` is missing"),
        ("NumberOfCells=\"2\"", "NumberOfCells=\"\"", "a.vtu:2: `NumberOfCells` is ``, not a number"),
        ("UnstructuredGrid\"", "PolyData\"", "a.vtu:1: the file holds the data set `PolyData`"),
        (
            "byte_order",
            "compressor=\"vtkLZ4DataCompressor\" byte_order",
            "a.vtu:1: the arrays are compressed by `vtkLZ4",
        ),
        (
            "</Piece>",
            "</Piece><Piece NumberOfPoints=\"0\" NumberOfCells=\"0\"></Piece>",
            "the grid consists of 2 pieces",
        ),
        ("ascii", "binary", "a.vtu:3: the array `` "),
        ("format=\"ascii\"", "", "a.vtu:3: the array `` has no format"),
        ("ascii", "appended\" offset=\"0", "a.vtu:3: the array `` has no appended data"),
        ("UInt8", "String", "a.vtu:7: the array `types` has the type `String`"),
        ("<VTKFile", "<File", "a.vtu:3: the file does not begin with <VTKFile>"),
        ("</Points>", "</Nodes>", "a.vtu:4: not XML: "),
    ] {
        let text = TEXT.replacen(from, to, 1);
        assert_ne!(text, TEXT, "{from}");
        let error = parsed(text.as_bytes()).map(|read| read.mesh).expect_err(to);
        assert!(error.contains(expected), "{expected}\n{error}");
        assert!(error.contains("expected: ") && error.contains("cure: "), "{error}");
    }
    let empty = TEXT.replace("\"2\"", "\"0\"").replace("10 5", "").replace("4 7", "");
    let error = parsed(empty.as_bytes()).map(|read| read.mesh).unwrap_err();
    assert!(error.contains("a.vtu:2: the grid has no cells"), "{error}");
    assert!(parsed(b"$MeshFormat\n4.1 0 8\n").is_err_and(|error| error.contains("the file has no <VTKFile>")));
    assert!(read(&PathBuf::from("/nowhere/a.vtu")).is_err_and(|error| error.to_string().contains("cannot be read")));
}

/// Files with a changed byte or an early end give an error or a mesh, but never a panic.
#[test]
fn damaged_files_never_panic() {
    let mesh = cuboid_of(ElementType::Hex8, [1; 3], [1.0; 3]).unwrap();
    let compressed = Form { is_compressed: true, ..Form::default() };
    let appended = Form { is_appended: true, is_raw: true, ..Form::default() };
    for bytes in
        [TEXT.as_bytes().to_vec(), compressed.file(&mesh), Form { is_compressed: true, ..appended }.file(&mesh)]
    {
        for at in 0..bytes.len() {
            let mut damaged = bytes.clone();
            damaged[at] = damaged[at].wrapping_add(1 + (at % 7) as u8);
            let _ = parsed(&damaged);
            let _ = parsed(&bytes[..at]);
        }
    }
}
