//! The meshes of Gmsh in other formats, and files that are wrong.

use std::path::{Path, PathBuf};

use super::read;
use crate::fem::element::{ElementType, FaceType};
use crate::fem::mesh::gmsh::{self, MeshFile};
use crate::fem::mesh::{Cells, Mesh};

const DATA: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/data");

fn of_gmsh(name: &str) -> Mesh {
    gmsh::read(Path::new(&format!("{DATA}/gmsh/{name}_4.1_text.msh"))).unwrap().mesh
}

fn volume(mesh: &Mesh) -> f64 {
    let mut volume = 0.0;
    for (element_type, of) in mesh.elements().typed() {
        let nodes: Vec<[f64; 3]> = of.iter().map(|&node| mesh.nodes()[node as usize]).collect();
        element_type.integrate(&nodes, |_, weight| volume += weight);
    }
    volume
}

/// The elements and faces of all formats have the same nodes, in the same order, also where edges are curved.
#[test]
fn other_formats_give_the_mesh_of_gmsh() {
    for name in ["ring_tet10", "ring_hex8", "ring_wedge6", "two_cubes"] {
        let expected = of_gmsh(name);
        for ending in ["inp", "mesh", "feb"] {
            if (name, ending) == ("ring_wedge6", "mesh") {
                // Gmsh writes no prisms there.
                continue;
            }
            let path = format!("{DATA}/mesh_files/{name}.{ending}");
            let MeshFile { mesh, warnings } = read(Path::new(&path)).unwrap_or_else(|error| panic!("{error}"));
            // The cubes have a node of no element.
            let is_known = |warning: &String| name == "two_cubes" && warning.contains("belongs to no element");
            assert!(warnings.iter().all(is_known), "{path}: {warnings:?}");
            for (a, b) in mesh.nodes().as_flattened().iter().zip(expected.nodes().as_flattened()) {
                assert!((a - b).abs() <= 1e-12, "{path}");
            }
            // Groups may be written one after the other; the order within an element is the same.
            let elements = |mesh: &Mesh| {
                let mut elements: Vec<Vec<u32>> = mesh.elements().iter().map(<[u32]>::to_vec).collect();
                elements.sort();
                elements
            };
            assert_eq!(elements(&mesh), elements(&expected), "{path}");
            if ending == "mesh" {
                // References are the numbers of surfaces and volumes of Gmsh's geometry.
                assert!(mesh.regions().iter().all(|region| region.starts_with("region_")), "{:?}", mesh.regions());
                assert!(mesh.surface_names().all(|surface| surface.starts_with("surface_")), "{path}");
                continue;
            }
            assert_eq!(mesh.surfaces().len(), expected.surfaces().len(), "{path}");
            // Gmsh names groups so in files of Abaqus.
            let shown = |name: &str| match (ending, name) {
                ("inp", "4") => "PhysicalSurface4".to_owned(),
                ("inp", name) => name.replace(' ', "_"),
                (_, name) => name.to_owned(),
            };
            let regions = |mesh: &Mesh| -> Vec<(Vec<u32>, String)> {
                let region = |region: &u32| mesh.regions()[*region as usize].clone();
                let elements = mesh.elements().iter().map(<[u32]>::to_vec);
                let mut regions: Vec<_> = elements.zip(mesh.region_of().iter().map(region)).collect();
                regions.sort();
                regions
            };
            let expected_regions = regions(&expected).into_iter().map(|(nodes, name)| (nodes, shown(&name)));
            assert_eq!(regions(&mesh), expected_regions.collect::<Vec<_>>(), "{path}");
            for surface in expected.surfaces() {
                let name = shown(&surface.name);
                let found = mesh.surface(&name).unwrap_or_else(|| panic!("{path}: {name}"));
                let sorted = |faces: &Cells<FaceType>| {
                    let mut faces: Vec<Vec<u32>> = faces.iter().map(<[u32]>::to_vec).collect();
                    faces.sort();
                    faces
                };
                assert_eq!(sorted(&found.faces), sorted(&surface.faces), "{path}: {name}");
            }
        }
    }
}

/// The last two nodes of a curved tetrahedron exchanged make another body, so that the test above sees the order.
#[test]
fn the_order_of_the_nodes_on_edges_matters() {
    let mesh = of_gmsh("ring_tet10");
    let swapped = mesh.elements().iter().map(|nodes| {
        let mut nodes = nodes.to_vec();
        nodes.swap(8, 9);
        nodes
    });
    let (mut smallest, whole) = (f64::INFINITY, volume(&mesh));
    for nodes in swapped {
        let positions: Vec<[f64; 3]> = nodes.iter().map(|&node| mesh.nodes()[node as usize]).collect();
        ElementType::Tet10.integrate(&positions, |_, weight| smallest = smallest.min(weight));
    }
    assert!(whole > 1.1 && smallest < 0.0, "{whole} {smallest}");
}

/// Reads a text as a file with this ending.
fn parse(ending: &str, text: &str) -> Result<MeshFile, String> {
    let folder = tempfile::tempdir().unwrap();
    let path: PathBuf = folder.path().join(format!("m.{ending}"));
    std::fs::write(&path, text).unwrap();
    let shown = format!("{}/", folder.path().display());
    read(&path).map_err(|error| error.to_string().replace(&shown, ""))
}

/// A tetrahedron of order 2 whose edges have distinguishable nodes: that of the edge `ab` has the abscissa `a + b` over 100
/// beside its center. `order` lists the edges in the order of the file, by corners from 1.
fn distinguishable(order: [&str; 6]) -> (Vec<[f64; 3]>, Vec<[f64; 3]>) {
    let corners = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
    let on = |edge: &str| {
        let ends: Vec<usize> = edge.chars().map(|c| c.to_digit(10).unwrap() as usize - 1).collect();
        let mut middle: [f64; 3] = std::array::from_fn(|k| 0.5 * (corners[ends[0]][k] + corners[ends[1]][k]));
        middle[0] += (ends[0] + ends[1]) as f64 / 100.0;
        middle
    };
    let of_file = order.map(on);
    let of_reference = ElementType::Tet10.edges().iter().map(|[a, b]| on(&format!("{}{}", a + 1, b + 1)));
    (corners.into_iter().chain(of_file).collect(), corners.into_iter().chain(of_reference).collect())
}

#[test]
fn every_format_has_its_own_order_of_the_nodes_on_edges() {
    let abaqus = ["12", "23", "31", "14", "24", "34"];
    let gmsh = ["12", "23", "31", "14", "34", "24"];
    let numbers: Vec<String> = (1..=10).map(|k: usize| k.to_string()).collect();
    let rows = |nodes: &[[f64; 3]], form: &dyn Fn(usize, [f64; 3]) -> String| -> String {
        nodes.iter().enumerate().map(|(k, node)| form(k + 1, *node)).collect()
    };
    for (ending, order) in [("inp", abaqus), ("feb", abaqus), ("mesh", abaqus), ("mesh", gmsh), ("msh", gmsh)] {
        let (nodes, expected) = distinguishable(order);
        let text = match ending {
            "inp" => format!(
                "*NODE\n{}*ELEMENT, TYPE=C3D10\n1, {}\n",
                rows(&nodes, &|k, [x, y, z]| format!("{k}, {x}, {y}, {z}\n")),
                numbers.join(", ")
            ),
            "feb" => format!(
                "<febio_spec><Geometry><Nodes>{}</Nodes><Elements type=\"tet10\" mat=\"1\"><elem id=\"1\">{}</elem></Elements>\
                 </Geometry></febio_spec>",
                rows(&nodes, &|k, [x, y, z]| format!("<node id=\"{k}\">{x},{y},{z}</node>")),
                numbers.join(",")
            ),
            "mesh" => format!(
                "MeshVersionFormatted 2\nDimension 3\nVertices\n10\n{}TetrahedraP2 1\n{} 7\nEnd\n",
                rows(&nodes, &|_, [x, y, z]| format!("{x} {y} {z} 0\n")),
                numbers.join(" ")
            ),
            _ => format!(
                "$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$Nodes\n10\n{}$EndNodes\n$Elements\n1\n1 11 2 1 1 {}\n$EndElements\n",
                rows(&nodes, &|k, [x, y, z]| format!("{k} {x} {y} {z}\n")),
                numbers.join(" ")
            ),
        };
        let mesh = parse(ending, &text).unwrap_or_else(|error| panic!("{ending}: {error}")).mesh;
        let nodes = mesh.elements().iter().next().unwrap();
        let positions: Vec<[f64; 3]> = nodes.iter().map(|&node| mesh.nodes()[node as usize]).collect();
        assert_eq!(positions, expected, "{ending} {order:?}");
    }
}

/// Two cubes of 1 and 2 along x, in an assembly of Abaqus/CAE.
const CAE: &str = "*Heading
*Part, name=Bar
*Node
1, 0, 0, 0
2, 1, 0, 0
3, 1, 1, 0
4, 0, 1, 0
5, 0, 0, 1
6, 1, 0, 1
7, 1, 1, 1
8, 0, 1, 1
12, 2, 0, 0
13, 2, 1, 0
16, 2., 0.0, 1d0
17, 2, 1, 1
*Element, type=C3D8R
10, 1, 2, 3, 4, 5,
 6, 7, 8
20, 2, 12, 13, 3, 6, 16, 17, 7
*Nset, nset=all, generate
1, 17, 1
*Elset, elset=soft
10,
*Elset, elset=stiff
20
*Elset, elset=\"both\"
soft, stiff
*Solid Section, elset=soft, material=m
,
*Solid Section, elset=stiff, material=n
,
*End Part
*Assembly, name=Assembly
*Instance, name=Bar-1, part=Bar
*End Instance
*Nset, nset=end, instance=Bar-1
12, 13, 16, 17
*Nset, nset=corner, instance=Bar-1
1
*Elset, elset=_left_S6, internal, instance=Bar-1
10
*Surface, type=ELEMENT, name=left
_left_S6, S6
*Surface, type=ELEMENT, name=skin
Bar-1.both
*End Assembly
";

#[test]
fn sections_sides_and_node_sets_of_abaqus_are_regions_and_surfaces() {
    let mesh = parse("inp", CAE).unwrap().mesh;
    assert_eq!((mesh.regions(), mesh.region_of()), (&["soft".to_owned(), "stiff".to_owned()][..], &[0, 1][..]));
    let names: Vec<&str> = mesh.surface_names().collect();
    assert_eq!(names, ["left", "skin", "all", "end"]);
    let faces = |name: &str| mesh.surface(name).unwrap().faces.len();
    assert_eq!([faces("left"), faces("skin"), faces("all"), faces("end")], [1, 10, 10, 1]);
    let place = |name: &str| {
        let nodes = mesh.surface(name).unwrap().nodes();
        nodes.iter().map(|&node| mesh.nodes()[node as usize][0]).collect::<Vec<_>>()
    };
    assert_eq!((place("left"), place("end")), (vec![0.0; 4], vec![2.0; 4]));
}

#[test]
fn sides_of_abaqus_lie_where_its_manual_says() {
    // Element, its sides, and the constant coordinate of each: the axis and the value.
    let cube = "1, 0,0,0\n2, 1,0,0\n3, 1,1,0\n4, 0,1,0\n5, 0,0,1\n6, 1,0,1\n7, 1,1,1\n8, 0,1,1\n";
    for (kind, nodes, sides) in [
        ("C3D8", "1,2,3,4,5,6,7,8", &[(2, 0.0), (2, 1.0), (1, 0.0), (0, 1.0), (1, 1.0), (0, 0.0)][..]),
        ("C3D4", "1,2,4,5", &[(2, 0.0), (1, 0.0), (9, 0.0), (0, 0.0)]),
        ("C3D6", "1,2,4,5,6,8", &[(2, 0.0), (2, 1.0), (1, 0.0), (9, 0.0), (0, 0.0)]),
    ] {
        for (number, &(axis, value)) in (1..).zip(sides) {
            let text =
                format!("*NODE\n{cube}*ELEMENT, TYPE={kind}, ELSET=e\n7,{nodes}\n*SURFACE, NAME=s\ne, S{number}\n");
            let mesh = parse("inp", &text).unwrap_or_else(|error| panic!("{error}")).mesh;
            let surface = mesh.surface("s").unwrap();
            for node in surface.nodes() {
                let x = mesh.nodes()[node as usize];
                // The slanted side: x + y = 1, or x + y + z = 1.
                let sum = x[0] + x[1] + if kind == "C3D4" { x[2] } else { 0.0 };
                let is_there = if axis == 9 { sum == 1.0 } else { x[axis] == value };
                assert!(is_there, "{kind} S{number}: {x:?}");
            }
            assert!(surface.faces.iter().next().unwrap().len() >= 3);
        }
    }
}

#[test]
fn older_models_of_febio_have_materials_and_sets() {
    let text = "<febio_spec version=\"2.5\"><Material><material id=\"1\" name=\"m\"/></Material>
<Geometry>
<Nodes name=\"n\"><node id=\"1\">0,0,0</node><node id=\"2\">1,0,0</node><node id=\"3\">0,1,0</node>
<node id=\"4\">0,0,1</node><node id=\"9\">5,5,5</node></Nodes>
<Elements type=\"tet4\" mat=\"2\"><elem id=\"1\"> 1, 2, 3, 4</elem></Elements>
<NodeSet name=\"base\"><node id=\"1\"/><node id=\"2\"/><node id=\"3\"/></NodeSet>
<NodeSet name=\"side\">1,2,4</NodeSet>
<NodeSet name=\"tip\"><n id=\"4\"></n></NodeSet>
<Surface name=\"slope\"><tri3 id=\"1\">2,3,4</tri3></Surface>
</Geometry><Boundary><fix node_set=\"base\"/></Boundary></febio_spec>";
    let MeshFile { mesh, warnings } = parse("feb", text).unwrap();
    assert_eq!(mesh.regions(), ["material_2"]);
    assert_eq!(mesh.surface_names().collect::<Vec<_>>(), ["slope", "base", "side"]);
    assert_eq!(warnings.len(), 1, "{warnings:?}");
}

#[test]
fn wrong_files_are_reported_with_their_lines() {
    let feb = |elements: &str| {
        format!(
            "<febio_spec>\n<Mesh>\n<Nodes>\n<node id=\"1\">0,0,0</node>\n</Nodes>\n{elements}\n</Mesh></febio_spec>"
        )
    };
    for (ending, text, expected) in [
        ("inp", CAE.replace("20, 2, 12", "20, 2, 99"), "m.inp:19: there is no node 99"),
        ("inp", CAE.replace("*Element, type=C3D8R", "*Element, type=C3D15"), "m.inp:16: elements of type C3D15"),
        ("inp", CAE.replace("17, 2, 1, 1", "16, 2, 1, 1"), "m.inp:15: node 16 occurs twice"),
        ("inp", CAE.replace("*End Instance", "1., 0., 0."), "m.inp:35: the instance is translated or rotated"),
        ("inp", CAE.replace("_left_S6, S6", "_left_S6, S7"), "m.inp:43: element 10 has no side `S7`"),
        ("inp", CAE.replace("soft, stiff", "soft, stif"), "m.inp:27: there is no set `stif`"),
        ("inp", CAE.replace("*Heading", "*Include, input=a.inp"), "m.inp:1: *INCLUDE is not read"),
        (
            "inp",
            CAE.replace("stiff\n20", "stiff\n20, 10"),
            "m.inp:30: element 10 is in two sections, of `soft` and `stiff`",
        ),
        ("inp", "*NODE\n1, 0, x, 0\n".into(), "m.inp:2: `x` is not a coordinate"),
        ("inp", "*NODE\n1, 0, 0, 0\n".into(), "m.inp: the file has no elements with a volume"),
        ("mesh", "MeshVersionFormatted 2\nDimension 2\n".into(), "m.mesh:2: the mesh has 2 dimensions"),
        ("mesh", "Vertices 1\n0 0 0 1\nTetrahedra 1\n1 2 3 4 1\n".into(), "m.mesh:4: there is no vertex 2"),
        ("mesh", "Vertices 2\n0 0 0 1\n".into(), "m.mesh: the file ends within a section"),
        ("mesh", "Vertices 1\n0 0 a 1\n".into(), "m.mesh:2: `a` is not a number"),
        ("mesh", "Pyramids 1\n".into(), "m.mesh:1: the file has `Pyramids`"),
        ("feb", feb("<Elements type=\"tet15\" name=\"a\">\n</Elements>"), "m.feb:6: elements of type `tet15`"),
        (
            "feb",
            feb("<Elements type=\"tet4\" name=\"a\">\n<elem id=\"3\">1,2</elem></Elements>"),
            "m.feb:7: element 3 has 2 nodes, not 4",
        ),
        (
            "feb",
            feb("<Surface name=\"a\">\n<tri7 id=\"3\">1,2</tri7></Surface>"),
            "m.feb:7: the surface `a` has faces of type `tri7`",
        ),
        ("feb", feb("<Surface>\n</Surface>"), "m.feb:6: the surface has no `name`"),
        ("feb", "<a><b></a>".into(), "m.feb:1: not XML"),
    ] {
        let error = parse(ending, &text).unwrap_err();
        assert!(error.starts_with(expected) && error.contains("\n  cure: "), "{expected}: {error}");
    }
}
