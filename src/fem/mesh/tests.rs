//! Tests of the mesh itself.

use super::faces::key;
use super::shapes::{self, cuboid};
use super::{Faces, Mesh, MeshError, Surface};
use crate::fem::element::{ElementType, FaceType};

/// The arguments of [`Mesh::new`].
#[derive(Clone)]
struct Parts {
    nodes: Vec<[f64; 3]>,
    elements: Vec<[u32; 4]>,
    region_of: Vec<u32>,
    regions: Vec<String>,
    surfaces: Vec<Surface>,
}

/// Two tetrahedra, one above and one below a common face, in two regions.
fn valid() -> Parts {
    Parts {
        nodes: vec![[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [0.0, 0.0, -2.0]],
        elements: vec![[0, 1, 2, 3], [0, 2, 1, 4]],
        region_of: vec![1, 0],
        regions: vec!["low".into(), "high".into()],
        surfaces: vec![Surface { name: "side".into(), faces: vec![[0, 1, 3], [0, 1, 4]].into() }],
    }
}

/// Checks the parts of a mesh again.
fn rebuilt(mesh: Parts) -> Result<Mesh, MeshError> {
    Mesh::new(mesh.nodes, mesh.elements, mesh.region_of, mesh.regions, mesh.surfaces)
}

/// Returns the error of the valid mesh after a change.
fn error_after(change: impl FnOnce(&mut Parts)) -> MeshError {
    let mut mesh = valid();
    change(&mut mesh);
    rebuilt(mesh).unwrap_err()
}

fn surface(name: &str, triangles: &[[u32; 3]]) -> Surface {
    Surface { name: name.into(), faces: triangles.to_vec().into() }
}

#[test]
fn linear_fields_are_exact_at_the_points() {
    for element_type in ElementType::ALL {
        let mesh = shapes::cuboid_of(element_type, [2, 1, 1], [1.0, 0.5, 0.5]).unwrap();
        let field = |[x, y, z]: [f64; 3]| [x - 2.0 * y, 3.0, x + y + z];
        let values: Vec<_> = mesh.nodes().iter().map(|&x| field(x)).collect();
        let (positions, found) = (mesh.at_points(mesh.nodes()), mesh.at_points(&values));
        assert_eq!((positions.len(), found.len()), (mesh.points().len(), mesh.points().len()));
        for (&position, found) in positions.iter().zip(found) {
            assert!(field(position).iter().zip(found).all(|(a, b)| (a - b).abs() < 1e-14), "{element_type:?}");
        }
        // The points of the first element integrate its positions.
        let volumes = mesh.point_volumes();
        let first: f64 = mesh.points().of_element(0).map(|point| volumes[point] * positions[point][0]).sum();
        assert!((first / mesh.element_volume(0) - mesh.center(0)[0]).abs() < 1e-14, "{element_type:?}");
    }
}

/// The mesh has more elements than a task, and the volumes differ.
#[test]
fn volumes_of_points_are_in_their_order() {
    let shape = shapes::TubeShape { inner_radius: 1.0, outer_radius: 2.0, length: 3.0 };
    let mesh = shapes::tube(ElementType::Wedge6, [4, 24, 30], &shape).unwrap();
    let volumes = mesh.point_volumes();
    assert!(mesh.elements().len() > 5000 && volumes.len() == mesh.points().len());
    for element in 0..mesh.elements().len() {
        let of_element: f64 = mesh.points().of_element(element).map(|point| volumes[point]).sum();
        assert!((of_element - mesh.element_volume(element)).abs() < 1e-15);
    }
}

#[test]
fn every_invariant_is_checked() {
    let name = String::from;
    assert_eq!(error_after(|p| p.elements.clear()), MeshError::NoElements);
    assert_eq!(error_after(|p| p.region_of.truncate(1)), MeshError::RegionCount { given: 1, elements: 2 });
    assert!(matches!(error_after(|p| p.nodes[4][1] = f64::NAN), MeshError::NotFinite { node: 4, .. }));
    assert!(matches!(error_after(|p| p.nodes[4][1] = f64::INFINITY), MeshError::NotFinite { node: 4, .. }));
    assert_eq!(error_after(|p| p.elements[1][3] = 5), MeshError::ElementNode { element: 1, node: 5, nodes: 5 });
    assert_eq!(error_after(|p| p.elements[1][3] = 2), MeshError::RepeatedNode { element: 1, node: 2 });
    let flat = MeshError::Flat { element: 1, volume: 0.0, longest_edge: 2_f64.sqrt() };
    assert_eq!(error_after(|p| p.nodes[4] = [0.5, 0.5, 0.0]), flat);
    assert!(matches!(error_after(|p| p.nodes[4][2] = -1e-12), MeshError::Flat { element: 1, .. }));
    assert!(matches!(error_after(|p| p.elements[0].swap(0, 1)), MeshError::Inverted { element: 0, .. }));
    assert_eq!(error_after(|p| p.nodes.extend([[9.0; 3]; 2])), MeshError::UnusedNodes { count: 2, first: 5 });
    assert_eq!(error_after(|p| p.region_of[1] = 2), MeshError::ElementRegion { element: 1, region: 2, regions: 2 });
    assert_eq!(error_after(|p| p.region_of[1] = 1), MeshError::EmptyRegion(name("low")));
    assert_eq!(error_after(|p| p.regions[1] = name("low")), MeshError::DuplicateName(name("low")));
    for bad in ["", " ", "a\"b", "a\nb"] {
        assert_eq!(error_after(|p| p.regions[1] = name(bad)), MeshError::Name(name(bad)));
        assert_eq!(error_after(|p| p.surfaces[0].name = name(bad)), MeshError::Name(name(bad)));
    }
    assert_eq!(error_after(|p| p.surfaces.push(surface("end", &[]))), MeshError::EmptySurface(name("end")));
    assert_eq!(error_after(|p| p.surfaces.push(surface("side", &[[0, 1, 3]]))), MeshError::DuplicateName(name("side")));
    for nodes in [[1, 3, 4], [0, 1, 7], [0, 0, 1]] {
        assert_eq!(
            error_after(|p| p.surfaces[0].faces.push(FaceType::Tri3, &nodes)),
            MeshError::NotAFace { surface: name("side"), face: 2, nodes: nodes.to_vec() }
        );
    }
    assert_eq!(
        error_after(|p| p.surfaces[0].faces.push(FaceType::Tri3, &[4, 1, 0])),
        MeshError::DuplicateFace { surface: name("side"), first: 1, second: 2 }
    );
}

#[test]
fn distorted_and_nonconforming_elements_are_errors() {
    // A hexahedron with one corner pushed in: its volume is positive, but not at every integration point.
    let mut parts = shapes::cuboid_of(ElementType::Hex8, [1, 1, 1], [1.0; 3]).unwrap();
    parts.nodes[7] = [0.1, 0.1, 0.1];
    let error = Mesh::new(parts.nodes, parts.elements, vec![0], parts.regions, vec![]).unwrap_err();
    assert!(matches!(error, MeshError::Distorted { element: 0, .. }), "{error}");
    // Two tetrahedra of order 2 that do not share the node on an edge of their common face.
    let two = |p: Parts| Mesh::new(p.nodes, p.elements, p.region_of, p.regions, vec![]).unwrap();
    let mut parts = two(valid()).quadratic(Default::default()).unwrap();
    let shared = parts.elements[0][4];
    assert!(parts.elements[1].contains(&shared));
    parts.nodes.push(parts.nodes[shared as usize]);
    let (copy, local) = (parts.nodes.len() as u32 - 1, parts.elements[1].iter().position(|&n| n == shared).unwrap());
    parts.elements[1][local] = copy;
    let error = Mesh::new(parts.nodes, parts.elements, parts.region_of, parts.regions, vec![]).unwrap_err();
    assert_eq!(error, MeshError::Nonconforming { first: 0, second: 1, face: vec![0, 1, 2] });
    // A linear face on a quadratic element.
    let mut parts = two(valid()).quadratic(Default::default()).unwrap();
    parts.surfaces = vec![surface("side", &[[0, 1, 3]])];
    let error = Mesh::new(parts.nodes, parts.elements, parts.region_of, parts.regions, parts.surfaces).unwrap_err();
    assert_eq!(error, MeshError::NotAFace { surface: "side".into(), face: 0, nodes: vec![0, 1, 3] });
    let wedges = shapes::cuboid_of(ElementType::Wedge6, [1, 1, 1], [1.0; 3]).unwrap();
    assert_eq!(wedges.quadratic(Default::default()), Err(MeshError::NoQuadraticType { element: 0 }));
}

#[test]
fn overlapping_elements_are_errors() {
    let overlap = |first, second| MeshError::Overlap { first, second, face: vec![0, 1, 2] };
    // An element folded over, a duplicate element, and a third element at a face.
    assert_eq!(error_after(|p| (p.nodes[4], p.elements[1]) = ([0.1, 0.1, 0.5], [0, 1, 2, 4])), overlap(0, 1));
    let twice =
        error_after(|p| (p.elements, p.region_of) = (vec![[0, 1, 2, 3], [0, 2, 1, 4], [1, 2, 0, 3]], vec![1, 0, 0]));
    assert_eq!(twice, overlap(0, 2));
    let third = error_after(|p| {
        p.nodes.push([0.3, 0.3, -1.0]);
        p.elements.push([0, 2, 1, 5]);
        p.region_of.push(0);
    });
    assert_eq!(third, overlap(1, 2));
}

#[test]
fn boundary_triangles_are_oriented_outward_and_inner_triangles_keep_their_orientation() {
    let mut parts = valid();
    let faces = [[0, 1, 3], [1, 3, 0], [3, 1, 0]];
    parts.surfaces = faces.iter().map(|&face| surface(&format!("{face:?}"), &[face])).collect();
    parts.surfaces.push(surface("up", &[[0, 1, 2]]));
    parts.surfaces.push(surface("down", &[[0, 2, 1]]));
    let mesh = rebuilt(parts).unwrap();
    let side: Vec<_> =
        mesh.surfaces()[..3].iter().map(|surface| mesh.area_vector(FaceType::Tri3, &surface.faces[0])).collect();
    assert_eq!(side, [[0.0, -0.5, 0.0]; 3]);
    assert_eq!(mesh.surface("up").unwrap().faces, Faces::from(vec![[0, 1, 2]]));
    assert_eq!(mesh.surface("down").unwrap().faces, Faces::from(vec![[0, 2, 1]]));
}

#[test]
fn the_key_of_a_face_does_not_depend_on_its_first_corner_and_its_side() {
    for (nodes, even) in [
        ([1, 2, 3], true),
        ([2, 3, 1], true),
        ([3, 1, 2], true),
        ([2, 1, 3], false),
        ([1, 3, 2], false),
        ([3, 2, 1], false),
    ] {
        assert_eq!(key(&nodes), ([1, 2, 3, u32::MAX], even));
    }
    for start in 0..4 {
        let corner = |k: usize| [7, 2, 9, 5][k % 4];
        let (forward, backward) = ([0, 1, 2, 3].map(|k| corner(start + k)), [4, 3, 2, 1].map(|k| corner(start + k)));
        assert_eq!((key(&forward), key(&backward)), (([2, 7, 5, 9], false), ([2, 7, 5, 9], true)));
    }
}

#[test]
fn queries_of_a_mesh() {
    let mesh = rebuilt(valid()).unwrap();
    assert_eq!((mesh.region("low"), mesh.region("high"), mesh.region("body")), (Some(0), Some(1), None));
    assert_eq!(mesh.elements_in(1).collect::<Vec<_>>(), [0]);
    assert_eq!(mesh.elements_in(9).count(), 0);
    assert_eq!(mesh.surface_names().collect::<Vec<_>>(), ["side"]);
    assert_eq!(mesh.surface("side").unwrap().nodes(), [0, 1, 3, 4]);
    assert_eq!(mesh.surface("none"), None);
    assert_eq!(mesh.region_volumes(), [1.0 / 3.0, 1.0 / 6.0]);
    assert_eq!(mesh.volume(), 0.5);
    assert!((mesh.surface_area(&mesh.surfaces()[0]) - 1.5).abs() < 1e-15);
    assert_eq!(mesh.bounding_box(), [[0.0, 0.0, -2.0], [1.0, 1.0, 1.0]]);
    assert_eq!(mesh.nearest_node([0.0, 0.75, 0.0]), (2, 0.25));
    // Of two nodes at the same distance, the first is returned.
    assert_eq!(mesh.nearest_node([0.5, 0.5, 0.0]).0, 0);
    assert_eq!(mesh.nearest_node([f64::NAN; 3]).0, 0);
}

#[test]
fn scaling() {
    let mesh = rebuilt(valid()).unwrap();
    let scaled = mesh.clone().scaled(1e-3).unwrap();
    assert!((scaled.volume() / 0.5e-9 - 1.0).abs() < 1e-14);
    assert_eq!((scaled.elements(), scaled.surfaces()), (mesh.elements(), mesh.surfaces()));
    for bad in [0.0, -1.0, f64::NAN, f64::INFINITY] {
        assert!(matches!(mesh.clone().scaled(bad), Err(MeshError::Scale(_))));
    }
    assert!(matches!(mesh.clone().scaled(1e308), Err(MeshError::NotFinite { node: 4, .. })));
    assert!(matches!(mesh.scaled(1e-200), Err(MeshError::Flat { element: 0, .. })));
}

#[test]
fn angles_between_faces() {
    let regular = vec![[1.0, 1.0, 1.0], [1.0, -1.0, -1.0], [-1.0, 1.0, -1.0], [-1.0, -1.0, 1.0]];
    let mesh = Mesh::new(regular, vec![[0, 1, 3, 2]], vec![0], vec!["body".into()], vec![]).unwrap();
    let angle = (1.0_f64 / 3.0).acos().to_degrees();
    assert!(mesh.dihedral_range().iter().all(|found| (found - angle).abs() < 1e-12));
    let [sharp, blunt] = cuboid([1, 1, 1], [1.0; 3]).unwrap().dihedral_range();
    assert!((sharp - 45.0).abs() < 1e-12 && (blunt - 90.0).abs() < 1e-12, "{sharp} to {blunt}");
}
