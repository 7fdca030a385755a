mod functions;

use std::sync::Arc;

use super::*;
use crate::fem::mesh::{Faces, shapes};

fn prescribed_at(surface: &str, displacement: [Option<f64>; 3]) -> SurfaceCondition {
    SurfaceCondition { surface: surface.into(), displacement, curve: LoadCurve::Ramp }
}

fn pulled_at(surface: &str, value: [f64; 3]) -> Arc<dyn LoadCondition> {
    Arc::new(Traction { surface: surface.into(), value, curve: LoadCurve::Ramp })
}

fn with_load(load: impl LoadCondition + 'static) -> Conditions {
    Conditions { loads: vec![Arc::new(load)], ..Conditions::default() }
}

fn on_surfaces(surfaces: Vec<SurfaceCondition>) -> Conditions {
    Conditions { surfaces, ..Conditions::default() }
}

fn box_2x1x1() -> Mesh {
    shapes::cuboid([2, 1, 1], [2.0, 1.0, 1.0]).unwrap()
}

#[test]
fn a_shared_edge_belongs_to_the_first_condition() {
    let conditions = on_surfaces(vec![
        prescribed_at("x0", [Some(0.0), None, None]),
        prescribed_at("y0", [Some(0.0), Some(0.0), None]),
        prescribed_at("x1", [Some(0.5), None, None]),
    ]);
    // x1 and y0 share an edge and prescribe different x-displacements.
    let error = Boundary::new(&box_2x1x1(), &conditions).unwrap_err();
    match error {
        BoundaryError::Conflict { node, component: 0, first, second, first_value, second_value, .. } => {
            assert_eq!((first.as_str(), second.as_str()), ("surface `y0`", "surface `x1`"));
            assert_eq!((first_value, second_value), (0.0, 0.5));
            assert_eq!(box_2x1x1().nodes()[node][..2], [2.0, 0.0]);
        }
        other => panic!("{other}"),
    }
    let agreeing = on_surfaces(conditions.surfaces[..2].to_vec());
    let mesh = box_2x1x1();
    let boundary = Boundary::new(&mesh, &agreeing).unwrap();
    // x0 prescribes 4 nodes in x; y0 prescribes 6 nodes in x and y, two of them already in x by x0.
    assert_eq!(boundary.prescribed_components().len(), 4 + 12 - 2);
    let number = |name| mesh.surface_names().position(|n| n == name).unwrap();
    let shared = |h: &&PrescribedComponent| h.component == 0 && mesh.nodes()[h.node as usize][..2] == [0.0, 0.0];
    let owners: Vec<Source> = boundary.prescribed_components().iter().filter(shared).map(|h| h.source).collect();
    assert_eq!(owners, [Source::Surface(number("x0")); 2]);
}

#[test]
fn one_value_on_two_curves_is_a_conflict_unless_it_is_zero() {
    let held = |value| {
        let mut second = prescribed_at("y0", [Some(value), None, None]);
        second.curve = LoadCurve::table(&[[0.0, 0.0], [0.5, 1.0]]).unwrap();
        Boundary::new(&box_2x1x1(), &on_surfaces(vec![prescribed_at("x0", [Some(value), None, None]), second]))
    };
    assert!(held(0.0).is_ok());
    assert!(matches!(held(0.1), Err(BoundaryError::Conflict { .. })));
}

#[test]
fn loads_add_up_to_area_and_volume() {
    let weight = BodyForce { region: "*".into(), value: [0.0, 0.0, -10.0], curve: LoadCurve::Ramp };
    let loads = vec![pulled_at("x1", [4.0, -2.0, 0.5]), pulled_at("z1", [0.0, 0.0, 1.0]), Arc::new(weight)];
    let conditions = Conditions { loads, ..Conditions::default() };
    let mesh = box_2x1x1();
    let boundary = Boundary::new(&mesh, &conditions).unwrap();
    let mut forces = vec![[1.0; 3]; mesh.nodes().len()];
    boundary.external_forces(0.5, &[], &mut forces);
    let sum = forces.iter().fold([0.0; 3], |sum, f| std::array::from_fn(|i| sum[i] + f[i]));
    let expected = [2.0, -1.0, 0.25 + 1.0 - 10.0];
    for i in 0..3 {
        assert!((sum[i] - expected[i]).abs() < 1e-14, "{sum:?}");
    }
    let resultants: Vec<[f64; 3]> = boundary.loads().iter().map(|load| load.resultant(1.0, &[])).collect();
    assert_eq!(boundary.loads()[0].source(), mesh.surface_names().position(|n| n == "x1").map(Source::Surface));
    assert_eq!((boundary.loads()[2].source(), boundary.depends_on_displacements()), (None, false));
    for (found, expected) in resultants.iter().zip([[4.0, -2.0, 0.5], [0.0, 0.0, 2.0], [0.0, 0.0, -20.0]]) {
        assert!((0..3).all(|i| (found[i] - expected[i]).abs() < 1e-14), "{found:?}");
    }
}

#[test]
fn points_are_found_and_follow_their_curve() {
    let point = |place| PointCondition { place, displacement: [None, Some(2.0), None], curve: LoadCurve::Ramp };
    let conditions = Conditions {
        points: vec![point(PointLocation::Nearest([2.2, 0.9, 1.3])), point(PointLocation::Node(1))],
        ..Conditions::default()
    };
    let mesh = box_2x1x1();
    let boundary = Boundary::new(&mesh, &conditions).unwrap();
    assert_eq!(mesh.nodes()[boundary.point_nodes()[0].unwrap() as usize], [2.0, 1.0, 1.0]);
    let mut displacements = vec![[9.0; 3]; mesh.nodes().len()];
    boundary.apply_prescribed(0.25, &mut displacements, &mut []);
    assert_eq!(displacements[1], [9.0, 0.5, 9.0]);
    assert_eq!(displacements.as_flattened().iter().filter(|&&u| u == 0.5).count(), 2);
}

#[test]
fn names_that_the_mesh_lacks_are_reported() {
    let mesh = box_2x1x1();
    let refused = |conditions| Boundary::new(&mesh, &conditions).unwrap_err();
    let surface = refused(Conditions { loads: vec![pulled_at("top", [0.0; 3])], ..Conditions::default() });
    assert_eq!(surface.to_string(), "the mesh has no surface `top`; it has x0, x1, y0, y1, z0, z1");
    let force = BodyForce { region: "grip".into(), value: [0.0; 3], curve: LoadCurve::Ramp };
    let region = refused(with_load(force));
    assert_eq!(region.to_string(), "the mesh has no region `grip`; it has body, and `*` is all of it");
    let point = PointCondition { place: PointLocation::Node(12), displacement: [None; 3], curve: LoadCurve::Ramp };
    let node = refused(Conditions { points: vec![point], ..Conditions::default() });
    assert_eq!(node, BoundaryError::UnknownNode { node: 12, nodes: 12 });
    let unreal = refused(on_surfaces(vec![prescribed_at("x0", [None, Some(f64::NAN), None])]));
    assert!(matches!(unreal, BoundaryError::NotFinite { place, .. } if place == "surface `x0`"));
}

/// A load whose stiffness couples three nodes.
#[derive(Clone, Debug)]
struct Coupling(Faces, Symmetry);

impl LoadCondition for Coupling {
    fn resolve(&self, _: &Mesh) -> Result<Box<dyn Load>, BoundaryError> {
        Ok(Box::new(self.clone()))
    }
}

impl Load for Coupling {
    fn add_forces(&self, _: f64, _: &[[f64; 3]], _: &mut [[f64; 3]]) {}

    fn resultant(&self, _: f64, _: &[[f64; 3]]) -> [f64; 3] {
        [0.0; 3]
    }

    fn coupled_nodes(&self) -> CoupledNodes<'_> {
        CoupledNodes::Faces(&self.0)
    }

    fn symmetry(&self) -> Symmetry {
        self.1
    }
}

#[test]
fn loads_couple_only_nodes_of_one_element_and_weaken_the_symmetry() {
    let mesh = box_2x1x1();
    // Node 0 is at x = 0, node 2 at x = 2, two cells away.
    let far = Boundary::new(&mesh, &with_load(Coupling(vec![[0, 1, 2]].into(), Symmetry::None))).unwrap_err();
    assert_eq!(far, BoundaryError::NotInOneElement(vec![0, 1, 2]));
    let none = Boundary::new(&mesh, &with_load(Coupling(vec![[0, 1, 99]].into(), Symmetry::None))).unwrap_err();
    assert_eq!(none, BoundaryError::NotInOneElement(vec![0, 1, 99]));
    let facet = Faces::from(vec![<[u32; 3]>::try_from(&mesh.surfaces()[0].faces[0]).unwrap()]);
    for symmetry in [Symmetry::None, Symmetry::Symmetric, Symmetry::Definite] {
        let boundary = Boundary::new(&mesh, &with_load(Coupling(facet.clone(), symmetry))).unwrap();
        assert!(boundary.depends_on_displacements());
        assert_eq!(boundary.symmetry(Symmetry::Definite), symmetry);
        assert_eq!(boundary.symmetry(Symmetry::None), Symmetry::None);
    }
    let dead = Boundary::new(&mesh, &Conditions { loads: vec![pulled_at("x1", [1.0; 3])], ..Conditions::default() });
    assert_eq!(dead.unwrap().symmetry(Symmetry::Definite), Symmetry::Definite);
}
