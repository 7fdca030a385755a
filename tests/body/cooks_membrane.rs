//! Cook's membrane: compressible, and nearly incompressible with plain elements and with the patches of the F-bar
//! method.

use std::sync::Arc;

use biotissue::backends::sparse::Sparse;
use biotissue::fem::boundary::{Conditions, LoadCurve, PointCondition, PointLocation, SurfaceCondition, Traction};
use biotissue::fem::element::ElementType;
use biotissue::fem::material::{Material, MaterialError, NeoHookean, Response};
use biotissue::fem::mesh::{Mesh, QuadraticHexahedron, shapes};
use biotissue::fem::point_field::FormulaField;
use biotissue::fem::stepping::{StepParams, StepStart, Stepper};
use nalgebra::{Matrix3, SMatrix};

/// The membrane with corners (0, 0), (48, 44), (48, 60), (0, 44) mm, 1 mm thick, and `cells` elements along each edge.
fn membrane(element_type: ElementType, cells: usize) -> Mesh {
    let flat = shapes::cuboid_of(element_type, [cells, cells, 1], [1.0; 3]).unwrap();
    let position = |&[s, t, z]: &[f64; 3]| [48.0 * s, 44.0 * s + t * (44.0 - 28.0 * s), z];
    let nodes = flat.nodes().iter().map(position).collect();
    let (regions, surfaces) = (flat.regions().to_vec(), flat.surfaces().to_vec());
    Mesh::new(nodes, flat.elements().clone(), flat.region_of().to_vec(), regions, surfaces).unwrap()
}

/// Returns the displacement along y, mm, of the corner (48, 60) under a vertical traction on x = 48, MPa, and the
/// largest number of Newton iterations of a step. The side x = 0 is clamped; the faces normal to z are held along z, or
/// else only enough to prevent rigid motions.
fn deflect(mesh: Mesh, material: impl Material + 'static, traction: f64, plane_strain: bool) -> (f64, usize) {
    let field = FormulaField::uniform(material, &mesh);
    let held = |surface: &str, displacement| SurfaceCondition {
        surface: surface.into(),
        displacement,
        curve: LoadCurve::Ramp,
    };
    let plane = (0..mesh.nodes().len()).filter(|_| plane_strain).map(|node| PointCondition {
        place: PointLocation::Node(node),
        displacement: [None, None, Some(0.0)],
        curve: LoadCurve::Ramp,
    });
    let traction = Traction { surface: "x1".into(), value: [0.0, traction, 0.0], curve: LoadCurve::Ramp };
    let conditions = Conditions {
        surfaces: vec![held("x0", [Some(0.0); 3])],
        points: plane.collect(),
        loads: vec![Arc::new(traction)],
        ..Conditions::default()
    };
    let (corner, distance) = mesh.nearest_node([48.0, 60.0, 0.0]);
    assert!(distance < 1e-12);
    let params = StepParams { count: 10, start: StepStart::Tangent, ..StepParams::default() };
    let mut stepper = Stepper::<Sparse, _>::new(&(), Arc::new(mesh), &conditions, field, params).unwrap();
    let mut most = 0;
    while stepper.completed_steps() < params.count {
        let report = stepper.step(&mut ()).unwrap();
        assert_eq!(report.cuts, 0, "step {}", report.step);
        most = most.max(report.iterations());
    }
    (stepper.state().displacements[corner][1], most)
}

/// Returns the deflection in plane strain under 6.25 MPa (OpenGeoSys, benchmark `CooksMembraneFbar`: bulk modulus
/// 40 094.2 MPa, shear modulus 80.1938 MPa), and the number of iterations.
fn deflection(mesh: Mesh) -> (f64, usize) {
    let (mu, bulk) = (80.1938, 40_094.2);
    deflect(mesh, NeoHookean { mu, lambda: bulk - 2.0 / 3.0 * mu }, 6.25, true)
}

/// Elements per edge, and the published deflections with F-bar and without, mm; both series of OpenGeoSys are
/// two-dimensional. `(J0 / J)^(1/3)` of a hexahedron differs from `(J0 / J)^(1/2)` of a quadrilateral, which matters
/// for coarse meshes.
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
        println!(
            "{cells} elements per edge: with F-bar {with:.3} mm ({published}), without {without:.3} mm ({locked})"
        );
        let tolerance = if cells == 4 { 0.02 } else { 0.01 };
        assert!((with / published - 1.0).abs() < tolerance, "{cells} elements: {with} mm, published {published} mm");
        // The published locked values do not grow smoothly: by 0.506, 0.362 and 0.460 mm from 15 to 30 elements. The
        // values of this crate do, by 0.507, 0.445 and 0.377 mm, so the one at 25 elements differs by 2 %.
        let tolerance = if cells == 25 { 0.025 } else { tolerance };
        assert!((without / locked - 1.0).abs() < tolerance, "{cells} elements: {without} mm, published {locked} mm");
        assert!(iterations < 12, "{cells} elements: {iterations} iterations");
    }
}

#[test]
fn patches_of_tetrahedra_do_not_lock() {
    let mesh = membrane(ElementType::Tet4, 10);
    let (without, _) = deflection(mesh.clone());
    let (with, _) = deflection(mesh.with_patches(|_| true));
    println!("tetrahedra, 10 elements per edge: with F-bar {with:.3} mm, without {without:.3} mm");
    assert!(with > 6.2 && with < 6.9, "{with} mm");
    assert!(without < 0.4 * with, "{without} mm");
}

/// The shear modulus, MPa, at a Poisson ratio of 0.3, and 1 N on the side of 16 mm^2.
const COMPRESSIBLE: (f64, f64, f64) = (0.4225, 0.3, 1.0 / 16.0);

#[test]
fn the_compressible_membrane_in_plane_strain_bends_as_published() {
    let (mu, nu, traction) = COMPRESSIBLE;
    let material = NeoHookean { mu, lambda: 2.0 * mu * nu / (1.0 - 2.0 * nu) };
    let mesh = membrane(ElementType::Hex8, 8).quadratic(QuadraticHexahedron::Serendipity).unwrap();
    let (found, _) = deflect(mesh, material, traction, true);
    println!("compressible, plane strain: {found:.3} mm");
    assert!((found / 13.58 - 1.0).abs() < 0.01, "{found} mm");
}

/// `W = K/4 (J^2 - 1 - 2 ln J) + G/2 (J^(-2/3) I1 - 3)`.
#[derive(Debug)]
struct Decoupled {
    bulk: f64,
    shear: f64,
}

impl Material for Decoupled {
    fn evaluate(&self, f: &Matrix3<f64>) -> Result<Response, MaterialError> {
        let j = f.determinant();
        let inverse = f.try_inverse().filter(|_| j > 0.0).ok_or(MaterialError::Inverted(j))?;
        let (normal, i1) = (inverse.transpose(), f.norm_squared());
        let isochoric = self.shear * j.powf(-2.0 / 3.0);
        let volumetric = 0.5 * self.bulk * (j * j - 1.0);
        let (p, q) = (volumetric - isochoric * i1 / 3.0, 2.0 * isochoric / 3.0);
        let tangent = SMatrix::from_fn(|row, column| {
            let ([i, a], [k, b]) = ([row / 3, row % 3], [column / 3, column % 3]);
            let identity = if row == column { isochoric } else { 0.0 };
            identity - q * (f[(i, a)] * normal[(k, b)] + normal[(i, a)] * f[(k, b)])
                + (self.bulk * j * j + q * i1 / 3.0) * normal[(i, a)] * normal[(k, b)]
                - p * normal[(i, b)] * normal[(k, a)]
        });
        Ok(Response {
            energy: 0.25 * self.bulk * (j * j - 1.0 - 2.0 * j.ln())
                + 0.5 * self.shear * (j.powf(-2.0 / 3.0) * i1 - 3.0),
            pk1: f * isochoric + normal * p,
            tangent,
        })
    }
}

/// deal.II code gallery, `Quasi_static_Finite_strain_Compressible_Elasticity`.
#[test]
fn the_compressible_membrane_with_free_faces_bends_as_published() {
    let (shear, nu, traction) = COMPRESSIBLE;
    let material = Decoupled { bulk: 2.0 * shear * (1.0 + nu) / (3.0 * (1.0 - 2.0 * nu)), shear };
    let mesh = membrane(ElementType::Hex8, 8).quadratic(QuadraticHexahedron::Serendipity).unwrap();
    let (found, _) = deflect(mesh, material, traction, false);
    println!("compressible, free faces: {found:.3} mm");
    assert!((found / 14.33 - 1.0).abs() < 0.01, "{found} mm");
}
