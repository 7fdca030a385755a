//! `biotissue mesh`: the files that it writes, its output and its exit codes.
use std::path::Path;
use std::process::{Command, Output};

use biotissue::fem::element::ElementType;
use biotissue::fem::mesh::shapes::{DogboneShape, TubeShape, between_on_tube, cuboid, cuboid_of, dogbone, tube};
use biotissue::fem::mesh::{QuadraticHexahedron, gmsh};

fn mesh(folder: &Path, arguments: &str) -> Output {
    let program = env!("CARGO_BIN_EXE_biotissue");
    let arguments = ["mesh"].into_iter().chain(arguments.split(' '));
    Command::new(program).current_dir(folder).args(arguments).output().unwrap()
}

fn summary(output: &Output) -> serde_json::Value {
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    serde_json::from_slice(&output.stdout).unwrap()
}

#[test]
fn box_in_every_format() {
    let folder = tempfile::tempdir().unwrap();
    let expected = cuboid([4, 2, 1], [2.0, 1.0, 0.5]).unwrap();
    for format in ["", " --format 2.2", " --format 4.1 --binary", " --format 2.2 --binary"] {
        let output = mesh(folder.path(), &format!("box --cells 4,2,1 --size 2,1,0.5 -o box.msh --json{format}"));
        let summary = summary(&output);
        assert_eq!((&summary["nodes"], &summary["elements"]), (&30.into(), &48.into()));
        let region = serde_json::json!({ "name": "body", "elements": 48, "volume": expected.volume() });
        assert_eq!(summary["regions"], serde_json::json!([region]));
        assert_eq!(
            summary["surfaces"][1],
            serde_json::json!({ "name": "x1", "triangles": 4, "quadrilaterals": 0, "area": 0.5 })
        );
        assert_eq!(gmsh::read(&folder.path().join("box.msh")).unwrap().mesh, expected);
    }
}

#[test]
fn boxes_of_other_elements() {
    let folder = tempfile::tempdir().unwrap();
    for (arguments, element_type, points) in [
        ("--element tet4 --order 2", ElementType::Tet10, 48),
        ("--element hex8", ElementType::Hex8, 16),
        ("--element hex8 --order 2", ElementType::Hex20, 54),
        ("--element hex8 --order 2 --hexahedra 27", ElementType::Hex27, 54),
        ("--element wedge6", ElementType::Wedge6, 24),
    ] {
        let output = mesh(folder.path(), &format!("box --cells 2,1,1 {arguments} -o box.msh --json"));
        let summary = summary(&output);
        let expected = cuboid_of(element_type, [2, 1, 1], [1.0; 3]).unwrap();
        assert_eq!(gmsh::read(&folder.path().join("box.msh")).unwrap().mesh, expected, "{arguments}");
        let types = serde_json::json!({ element_type.name(): expected.elements().len() });
        assert_eq!(summary["element_types"], types);
        assert_eq!(summary["integration_points"], serde_json::json!(points));
    }
}

#[test]
fn tubes_of_all_elements() {
    let folder = tempfile::tempdir().unwrap();
    let shape = TubeShape { inner_radius: 0.003, outer_radius: 0.004, length: 0.05 };
    for (arguments, linear, hexahedra) in [
        ("", ElementType::Tet4, None),
        ("--element hex8", ElementType::Hex8, None),
        ("--element wedge6", ElementType::Wedge6, None),
        ("--order 2", ElementType::Tet4, Some(QuadraticHexahedron::Serendipity)),
        ("--element hex8 --order 2", ElementType::Hex8, Some(QuadraticHexahedron::Serendipity)),
        ("--element hex8 --order 2 --hexahedra 27", ElementType::Hex8, Some(QuadraticHexahedron::Triquadratic)),
    ] {
        let size = "--inner-radius 0.003 --outer-radius 0.004 --length 0.05";
        let arguments = format!("tube --cells 1,12,5 {size} {arguments} -o tube.msh --json").replace("  ", " ");
        let summary = summary(&mesh(folder.path(), &arguments));
        let expected = tube(linear, [1, 12, 5], &shape).unwrap();
        let expected = match hexahedra {
            Some(hexahedra) => expected.quadratic_between(hexahedra, between_on_tube).unwrap(),
            None => expected,
        };
        assert_eq!(gmsh::read(&folder.path().join("tube.msh")).unwrap().mesh, expected, "{arguments}");
        assert_eq!(summary["regions"][0]["name"], "wall");
        let curved = summary["volume"].as_f64().unwrap() / (7e-6 * std::f64::consts::PI * 0.05);
        assert!((curved - 1.0).abs() < if hexahedra.is_some() { 1e-3 } else { 0.05 }, "{arguments}: {curved}");
    }
}

#[test]
fn a_dogbone_of_order_2() {
    let folder = tempfile::tempdir().unwrap();
    let summary = summary(&mesh(folder.path(), "dogbone --element-size 0.004 --order 2 -o bone.msh --json"));
    let linear = dogbone(&DogboneShape::default(), 0.004).unwrap();
    assert_eq!(summary["element_types"], serde_json::json!({ "tet10": linear.elements().len() }));
    let read = gmsh::read(&folder.path().join("bone.msh")).unwrap().mesh;
    assert_eq!(read, linear.quadratic(Default::default()).unwrap());
}

#[test]
fn a_dogbone_has_the_given_dimensions() {
    let folder = tempfile::tempdir().unwrap();
    let output = mesh(folder.path(), "dogbone --element-size 0.002 --length 0.05 --thickness 0.003 -o bone.msh");
    let text = String::from_utf8(output.stdout).unwrap();
    for piece in ["region    grip", "region    gauge", "surface   left", "surface   right", "surface   sides"] {
        assert!(text.contains(piece), "{piece} is not in\n{text}");
    }
    let shape = DogboneShape { length: 0.05, thickness: 0.003, ..DogboneShape::default() };
    let expected = dogbone(&shape, 0.002).unwrap();
    assert!(text.contains(&format!("elements  {:>10}", expected.elements().len())), "{text}");
    assert_eq!(gmsh::read(&folder.path().join("bone.msh")).unwrap().mesh, expected);
}

#[test]
fn invalid_arguments_are_reported() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("file"), "not a folder").unwrap();
    for (arguments, code, message) in [
        ("box --cells 4,4 -o a.msh", 2, "expected three numbers separated by commas"),
        (
            "box --cells 4,4,0 -o a.msh",
            2,
            "error: [4, 4, 0] cells along x, y and z: there must be at least one along each",
        ),
        (
            "box --cells 1,1,1 --size 1,-2,1 -o a.msh",
            2,
            "error: the size along y is -2: it must be positive and finite",
        ),
        (
            "tube --cells 1,2,1 --inner-radius 1 --outer-radius 2 --length 1 -o a.msh",
            2,
            "error: [1, 2, 1] cells through the wall, around the axis and along it: there must be at least 1, 3 and 1",
        ),
        (
            "tube --cells 1,9,1 --inner-radius 2 --outer-radius 2 --length 1 -o a.msh",
            2,
            "error: an inner radius of 2 is not below the outer radius, 2",
        ),
        (
            "tube --cells 1,9,1 --inner-radius 1 --outer-radius 2 --length 1 --element wedge6 --order 2 -o a.msh",
            2,
            "error: --order 2: there are no wedges of order 2",
        ),
        ("box --cells 9999,9999,9999 -o a.msh", 2, "error: 5998200179994 elements are more than the 50000000"),
        ("dogbone --element-size nan -o a.msh", 2, "error: the element size is NaN: it must be positive and finite"),
        ("dogbone --element-size 1 -o a.msh", 2, "error: the element size 1 exceeds the grip width, 0.01"),
        (
            "box --cells 1,1,1 --element wedge6 --order 2 -o a.msh",
            2,
            "error: --order 2: there are no wedges of order 2",
        ),
        ("box --cells 1,1,1 --hexahedra 27 -o a.msh", 2, "error: --hexahedra 27 is given without --order 2"),
        ("box --cells 1,1,1 --order 3 -o a.msh", 2, "3 is not in 1..=2"),
        ("box --cells 1,1,1 -o file/a.msh", 4, "error: file/a.msh: cannot be written: "),
    ] {
        let output = mesh(folder.path(), arguments);
        let stderr = String::from_utf8(output.stderr).unwrap();
        assert_eq!(output.status.code(), Some(code), "{arguments}: {stderr}");
        assert!(stderr.contains(message), "{arguments}: {stderr}");
        assert!(output.stdout.is_empty());
    }
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1, "a file was created");
}

/// `mesh info` of a file prints what `mesh box` printed when it wrote the file, and in other units what the scale says.
#[test]
fn a_file_is_summarized_as_when_it_was_written() {
    let folder = tempfile::tempdir().unwrap();
    let written = summary(&mesh(folder.path(), "box --cells 4,2,1 --size 2,1,0.5 -o box.msh --json"));
    assert_eq!(summary(&mesh(folder.path(), "info box.msh --json")), written);
    let scaled = summary(&mesh(folder.path(), "info box.msh --scale 0.5 --json"));
    for value in [&scaled["volume"], &scaled["surfaces"][1]["area"]] {
        assert!((value.as_f64().unwrap() - 0.125).abs() < 1e-15, "{value}");
    }
    let table = mesh(folder.path(), "info box.msh");
    assert!(String::from_utf8_lossy(&table.stdout).contains("  region    body"));
    for (arguments, code, expected) in [
        ("info box.msh --scale 0", 2, "--scale 0: "),
        ("info absent.msh", 2, "absent.msh: cannot be read"),
        ("info --scale", 2, "--scale"),
    ] {
        let output = mesh(folder.path(), arguments);
        let text = String::from_utf8_lossy(&output.stderr).into_owned();
        assert!(output.status.code() == Some(code) && text.contains(expected), "{arguments}: {text}");
    }
}
