//! Reading of files that Gmsh 4.15 wrote: two unit cubes side by side along x, joined at x = 1.
//!
//! The physical volumes are 7 `left half` and 3 `right half`; the physical surfaces are 1 `end` (x = 0), 2 `interface`
//! (x = 1), 5 `far` (x = 2) and 4 without a name (x = 0, y = 0 and y = 1 of the left cube). A geometric point away from
//! the body is in a physical group of its own.

use std::path::PathBuf;

use biotissue::fem::mesh::Mesh;
use biotissue::fem::mesh::gmsh;

fn file(name: &str) -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("tests/data/gmsh").join(name)
}

/// Returns the normals of a named surface, and the coordinates of its triangles' corners.
fn triangles(mesh: &Mesh, name: &str) -> Vec<([f64; 3], Vec<[f64; 3]>)> {
    let surface = mesh.surface(name).unwrap();
    let faces = surface.faces.typed();
    faces.map(|(face_type, nodes)| (mesh.area_vector(face_type, nodes), mesh.positions_of(nodes))).collect()
}

fn check(mesh: &Mesh) {
    assert_eq!((mesh.nodes().len(), mesh.elements().len()), (23, 48));
    assert_eq!(mesh.regions(), ["right half", "left half"]);
    for (volume, region) in mesh.region_volumes().into_iter().zip(0..) {
        assert!((volume - 1.0).abs() < 1e-14, "{volume}");
        let middle = if region == 0 { 1.5 } else { 0.5 };
        let here = |element| mesh.center(element)[0] - middle;
        assert!(mesh.elements_in(region).all(|element| f64::abs(here(element)) < 0.5));
    }
    assert_eq!(mesh.surface_names().collect::<Vec<_>>(), ["end", "interface", "4", "far"]);
    for (name, x, outward) in [("end", 0.0, -1.0), ("far", 2.0, 1.0), ("interface", 1.0, 0.0)] {
        let triangles = triangles(mesh, name);
        assert_eq!(triangles.len(), 4);
        for (normal, corners) in triangles {
            assert!(corners.iter().all(|corner| corner[0] == x));
            assert!(outward == 0.0 || normal[0] * outward > 0.0, "{name}: {normal:?}");
        }
        assert!((mesh.surface_area(mesh.surface(name).unwrap()) - 1.0).abs() < 1e-14);
    }
    for (normal, corners) in triangles(mesh, "4") {
        let out =
            |axis: usize, plane: f64, sign: f64| corners.iter().all(|x| x[axis] == plane) && normal[axis] * sign > 0.0;
        assert!(out(0, 0.0, -1.0) || out(1, 0.0, -1.0) || out(1, 1.0, 1.0), "{corners:?}");
    }
}

#[test]
fn files_written_by_gmsh_are_read_in_every_format() {
    let mut meshes = Vec::new();
    for name in ["2.2_text", "2.2_binary", "4.1_text", "4.1_binary", "4.1_parametric_text", "4.1_parametric_binary"] {
        let read = gmsh::read(&file(&format!("two_cubes_{name}.msh"))).unwrap_or_else(|error| panic!("{error}"));
        check(&read.mesh);
        let dropped: Vec<_> = read.warnings.iter().filter(|warning| warning.contains("to no element")).collect();
        assert_eq!(dropped, ["1 node belongs to no element and is left out"], "{name}");
        assert_eq!(read.warnings.len(), 1, "{name}: {:?}", read.warnings);
        meshes.push(read.mesh);
    }
    for mesh in &meshes {
        // Version 2 groups elements by physical number, version 4 by entity.
        assert_eq!(mesh.nodes(), meshes[0].nodes());
        assert!((mesh.volume() - 2.0).abs() < 1e-14);
    }
}

/// A quarter of a ring in every element type, written by Gmsh; `tests/data/gmsh/elements.py` printed the numbers of
/// elements and nodes and the volumes. A wrong order of the nodes on curved edges changes the volume.
#[test]
fn curved_elements_have_the_volume_that_gmsh_integrates() {
    // The rule of four points is not exact for curved tetrahedra.
    for (name, elements, nodes, volume, tolerance) in [
        ("tet10", 92, 215, 1.1781063953811706, 1e-4),
        ("hex8", 4, 18, 1.06066017177982, 1e-14),
        ("hex20", 4, 51, 1.1771803388670814, 1e-14),
        ("hex27", 4, 75, 1.177180338867081, 1e-14),
        ("wedge6", 16, 30, 1.1700849718747286, 1e-14),
    ] {
        let [text, binary] = ["4.1_text", "2.2_binary"].map(|format| {
            gmsh::read(&file(&format!("ring_{name}_{format}.msh"))).unwrap_or_else(|error| panic!("{error}"))
        });
        assert_eq!(text.mesh.elements(), binary.mesh.elements(), "{name}");
        assert_eq!(text.warnings, [""; 0], "{name}");
        let mesh = text.mesh;
        assert_eq!((mesh.elements().len(), mesh.nodes().len()), (elements, nodes), "{name}");
        assert!((mesh.volume() / volume - 1.0).abs() < tolerance, "{name}: {}", mesh.volume());
        let base = mesh.surface("base").unwrap();
        let (area, height) = (mesh.surface_area(base), 0.5);
        assert!((area * height / volume - 1.0).abs() < 10.0 * tolerance, "{name}: {area}");
        let z = base.faces.typed().map(|(face_type, nodes)| mesh.area_vector(face_type, nodes)[2]).sum::<f64>();
        assert!((z + area).abs() < 1e-12, "{name}: the normals point out of the body, downward");
        assert_eq!(base.nodes().iter().filter(|&&node| mesh.nodes()[node as usize][2] != 0.0).count(), 0);
    }
}
