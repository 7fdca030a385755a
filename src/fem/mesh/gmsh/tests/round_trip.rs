//! Round trips: a written mesh is read back unchanged.

use super::super::{Version, WriteOptions, parse, read, to_writer, write, write_with};
use crate::fem::element::{ElementType, FaceType};
use crate::fem::mesh::shapes::{DogboneShape, cuboid, cuboid_of, dogbone};
use crate::fem::mesh::{Elements, Faces, Mesh, Surface};
use std::path::Path;

const ALL: [WriteOptions; 4] = [
    WriteOptions { version: Version::V2_2, binary: false },
    WriteOptions { version: Version::V2_2, binary: true },
    WriteOptions { version: Version::V4_1, binary: false },
    WriteOptions { version: Version::V4_1, binary: true },
];

fn assert_round_trip(mesh: &Mesh) {
    for options in ALL {
        let mut bytes = Vec::new();
        to_writer(&mut bytes, mesh, options).unwrap();
        let back = parse(&bytes, Path::new("a.msh")).unwrap();
        assert_eq!(back.mesh, *mesh, "{options:?}");
        assert_eq!(back.warnings, [""; 0], "{options:?}");
    }
}

#[test]
fn shapes_are_read_back_unchanged_in_every_format() {
    assert_round_trip(&cuboid([2, 1, 3], [0.1, 1.0 / 3.0, 1e-9]).unwrap());
    // The regions of this mesh alternate in the order of the elements.
    assert_round_trip(&dogbone(&DogboneShape::default(), 0.004).unwrap());
}

#[test]
fn unusual_names_shared_triangles_and_inner_surfaces_are_read_back_unchanged() {
    let plain = cuboid([2, 1, 1], [1e-7, 1.0 / 3.0, 0.1]).unwrap();
    let region_of = (0..12).map(|element| u32::from(element % 3 == 0)).collect();
    let mut surfaces = plain.surfaces().to_vec();
    surfaces.push(Surface { name: "all $End of it: \u{e4}\u{2115} '`".into(), faces: surfaces[0].faces.clone() });
    // Corner 0 of the second cell is node 1; the triangle is a face between two cells.
    surfaces.push(Surface { name: "inner".into(), faces: vec![[1, 4, 10]].into() });
    let regions = vec!["12".into(), "a b".into()];
    let mesh = Mesh::new(plain.nodes().to_vec(), plain.elements().clone(), region_of, regions, surfaces);
    assert_round_trip(&mesh.unwrap());
}

#[test]
fn a_written_file_replaces_the_old_one_without_temporary_files() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("box.msh");
    std::fs::write(&path, "the old content").unwrap();
    let mesh = cuboid([1, 1, 1], [1.0; 3]).unwrap();
    write(&path, &mesh).unwrap();
    assert_eq!(read(&path).unwrap().mesh, mesh);
    for options in ALL {
        write_with(&path, &mesh, options).unwrap();
        assert_eq!(read(&path).unwrap().mesh, mesh);
    }
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1);
    let error = write(&folder.path().join("missing/box.msh"), &mesh).unwrap_err();
    assert_eq!(error.kind(), std::io::ErrorKind::NotFound);
    let error = read(&folder.path().join("none.msh")).unwrap_err();
    assert!(error.problem.starts_with("cannot be read: "), "{error}");
}

#[cfg(unix)]
#[test]
fn writing_to_a_link_or_a_device_does_not_replace_it() {
    let folder = tempfile::tempdir().unwrap();
    let (path, link) = (folder.path().join("box.msh"), folder.path().join("link.msh"));
    std::fs::write(&path, "").unwrap();
    std::os::unix::fs::symlink(&path, &link).unwrap();
    write(&link, &cuboid([1, 1, 1], [1.0; 3]).unwrap()).unwrap();
    assert!(link.is_symlink());
    assert!(read(&path).is_ok());
    write(Path::new("/dev/null"), &cuboid([1, 1, 1], [1.0; 3]).unwrap()).unwrap();
    assert!(!Path::new("/dev/null").is_file());
}

#[test]
fn all_element_types_are_read_back_unchanged() {
    for element_type in ElementType::ALL {
        assert_round_trip(&cuboid_of(element_type, [2, 1, 2], [0.1, 1.0 / 3.0, 0.7]).unwrap());
    }
}

/// A hexahedron and two wedges that share a quadrilateral.
#[test]
fn a_mesh_of_several_types_is_read_back_unchanged() {
    let mut elements = Elements::default();
    elements.push(ElementType::Hex8, &[0, 1, 2, 3, 4, 5, 6, 7]);
    elements.push(ElementType::Wedge6, &[1, 8, 9, 5, 10, 11]);
    elements.push(ElementType::Wedge6, &[1, 9, 2, 5, 11, 6]);
    let at = |x: f64, y: f64, z: f64| [x, y, z];
    let nodes = vec![
        at(0.0, 0.0, 0.0),
        at(1.0, 0.0, 0.0),
        at(1.0, 1.0, 0.0),
        at(0.0, 1.0, 0.0),
        at(0.0, 0.0, 1.0),
        at(1.0, 0.0, 1.0),
        at(1.0, 1.0, 1.0),
        at(0.0, 1.0, 1.0),
        at(2.0, 0.0, 0.0),
        at(2.0, 1.0, 0.0),
        at(2.0, 0.0, 1.0),
        at(2.0, 1.0, 1.0),
    ];
    let mut base = Faces::default();
    // The reader groups cells by type.
    base.push(FaceType::Tri3, &[1, 9, 8]);
    base.push(FaceType::Quad4, &[0, 3, 2, 1]);
    let surfaces = vec![Surface { name: "base".into(), faces: base }];
    let regions = vec!["left".into(), "right".into()];
    let mesh = Mesh::new(nodes, elements, vec![0, 1, 1], regions, surfaces).unwrap();
    assert!(
        (mesh.volume() - 2.0).abs() < 1e-15
            && [[2].as_slice(), &[2], &[0, 1]] == [0, 1, 2].map(|element| mesh.neighbors().of(element).to_vec())
    );
    assert_eq!(mesh.dihedral_range().map(f64::round), [45.0, 90.0]);
    assert_round_trip(&mesh);
}
