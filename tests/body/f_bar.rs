//! Nearly incompressible bodies: Cook's membrane with plain elements and with patches of the F-bar method.

use std::sync::Arc;

use biotissue::backends::sparse::Sparse;
use biotissue::fem::boundary::{Conditions, LoadCurve, PointCondition, PointLocation, SurfaceCondition, Traction};
use biotissue::fem::element::ElementType;
use biotissue::fem::material::NeoHookean;
use biotissue::fem::mesh::{Mesh, shapes};
use biotissue::fem::point_field::FormulaField;
use biotissue::fem::stepping::{StepParams, Stepper};

/// The membrane with corners (0, 0), (48, 44), (48, 60), (0, 44) mm, 1 mm thick, and `cells` elements along each edge.
fn membrane(element_type: ElementType, cells: usize) -> Mesh {
    let flat = shapes::cuboid_of(element_type, [cells, cells, 1], [1.0; 3]).unwrap();
    let position = |&[s, t, z]: &[f64; 3]| [48.0 * s, 44.0 * s + t * (44.0 - 28.0 * s), z];
    let nodes = flat.nodes().iter().map(position).collect();
    let (regions, surfaces) = (flat.regions().to_vec(), flat.surfaces().to_vec());
    Mesh::new(nodes, flat.elements().clone(), flat.region_of().to_vec(), regions, surfaces).unwrap()
}

/// Returns the displacement along y, mm, of the corner (48, 60) in plane strain under 6.25 MPa on x = 48, and the
/// largest number of Newton iterations of a step.
///
/// OpenGeoSys, benchmark `CooksMembraneFbar`: bulk modulus 40 094.2 MPa, shear modulus 80.1938 MPa; x = 0 is clamped.
fn deflection(mesh: Mesh) -> (f64, usize) {
    let (mu, bulk) = (80.1938, 40_094.2);
    let field = FormulaField::uniform(NeoHookean { mu, lambda: bulk - 2.0 / 3.0 * mu }, &mesh);
    let held = |surface: &str, displacement| SurfaceCondition {
        surface: surface.into(),
        displacement,
        curve: LoadCurve::Ramp,
    };
    let plane = (0..mesh.nodes().len()).map(|node| PointCondition {
        place: PointLocation::Node(node),
        displacement: [None, None, Some(0.0)],
        curve: LoadCurve::Ramp,
    });
    let traction = Traction { surface: "x1".into(), value: [0.0, 6.25, 0.0], curve: LoadCurve::Ramp };
    let conditions = Conditions {
        surfaces: vec![held("x0", [Some(0.0); 3])],
        points: plane.collect(),
        loads: vec![Arc::new(traction)],
    };
    let (corner, distance) = mesh.nearest_node([48.0, 60.0, 0.0]);
    assert!(distance < 1e-12);
    let params = StepParams { count: 5, ..StepParams::default() };
    let mut stepper = Stepper::<Sparse, _>::new(&(), Arc::new(mesh), &conditions, field, params).unwrap();
    let mut most = 0;
    while stepper.completed_steps() < params.count {
        let report = stepper.step().unwrap();
        assert_eq!(report.cuts, 0);
        most = most.max(report.iterations());
    }
    (stepper.state().displacements[corner][1], most)
}

/// Elements per edge, and the published deflections with F-bar and without, mm; both series of OpenGeoSys are
/// two-dimensional. `(J0 / J)^(1/3)` of a hexahedron differs from `(J0 / J)^(1/2)` of a quadrilateral, which matters for
/// coarse meshes.
const PUBLISHED: [(usize, f64, f64); 6] = [
    (4, 6.141, 2.287),
    (10, 6.746, 2.841),
    (15, 6.824, 3.375),
    (20, 6.859, 3.881),
    (25, 6.873, 4.243),
    (30, 6.891, 4.703),
];

#[test]
fn cooks_membrane_does_not_lock() {
    for (cells, published, locked) in PUBLISHED {
        let mesh = membrane(ElementType::Hex8, cells);
        let (with, iterations) = deflection(mesh.clone().with_patches(|_| true));
        let (without, _) = deflection(mesh);
        println!("{cells:2} elements: {with:.3} mm with F-bar ({published}), {without:.3} mm without ({locked})");
        let tolerance = if cells == 4 { 0.02 } else { 0.01 };
        assert!((with / published - 1.0).abs() < tolerance, "{cells} elements: {with} mm, published {published} mm");
        assert!((without / locked - 1.0).abs() < tolerance, "{cells} elements: {without} mm, published {locked} mm");
        assert!(iterations < 12, "{cells} elements: {iterations} iterations");
    }
}

#[test]
fn patches_of_tetrahedra_do_not_lock() {
    let mesh = membrane(ElementType::Tet4, 10);
    let (without, _) = deflection(mesh.clone());
    let (with, _) = deflection(mesh.with_patches(|_| true));
    assert!(with > 6.2 && with < 6.9, "{with} mm");
    assert!(without < 0.4 * with, "{without} mm");
}
