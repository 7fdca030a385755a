//! Bending of a beam of heart muscle under follower pressure: problem 1 of S. Land et al., Proc. R. Soc. A 471 (2015)
//! 20150641.

use std::sync::Arc;

use biotissue::backends::sparse::Sparse;
use biotissue::fem::boundary::{Conditions, LoadCurve, Pressure, SurfaceCondition};
use biotissue::fem::element::ElementType;
use biotissue::fem::material::Guccione;
use biotissue::fem::mesh::shapes;
use biotissue::fem::point_field::FormulaField;
use biotissue::fem::stepping::{StepParams, Stepper};
use nalgebra::Vector3;

/// The fibers lie along the beam. The height is 4.141 mm on this mesh of linear hexahedra with F-bar, 4.019 mm with
/// half as many elements along the beam and 4.151 mm with twice as many across it. A bulk modulus of 1 MPa, 500 times
/// the stress scale of the material, keeps the volume constant up to 0.1 %; one tenth of it raises the tip by 0.014 mm.
#[test]
fn the_tip_of_the_beam_rises_as_published() {
    let mesh = shapes::cuboid_of(ElementType::Hex8, [40, 2, 4], [10e-3, 1e-3, 1e-3]).unwrap().with_patches(|_| true);
    let volume = mesh.volume();
    let material = Guccione { c: 2.0e3, bf: 8.0, bt: 2.0, bfs: 4.0, bulk_modulus: 1.0e6, axis: Vector3::x() };
    let field = FormulaField::uniform(material, &mesh);
    let clamp = SurfaceCondition { surface: "x0".into(), displacement: [Some(0.0); 3], curve: LoadCurve::Ramp };
    let pressure = Pressure { surface: "z0".into(), value: 4.0, curve: LoadCurve::Ramp };
    let conditions = Conditions { surfaces: vec![clamp], loads: vec![Arc::new(pressure)], ..Conditions::default() };
    let (node, distance) = mesh.nearest_node([10e-3, 0.5e-3, 1e-3]);
    assert!(distance < 1e-12);
    let params = StepParams { count: 8, ..StepParams::default() };
    let mut stepper = Stepper::<Sparse, _>::new(&(), Arc::new(mesh), &conditions, field, params).unwrap();
    let reports = stepper.run(&mut ()).unwrap();
    assert!(reports.iter().all(|report| report.cuts == 0));
    let displacements = &stepper.state().displacements;
    let height = 1.0 + 1e3 * displacements[node][2];
    println!("height {height:.3} mm");
    assert!((4.0..4.2).contains(&height) && (height / 4.17 - 1.0).abs() < 0.01, "{height} mm");
    let deformed: f64 = stepper.mesh().deformed_region_volumes(displacements).iter().sum();
    assert!((deformed / volume - 1.0).abs() < 1e-3, "the volume changes by the factor {}", deformed / volume);
}
