//! Gradients and second derivatives of volumes against finite differences, through residual and Jacobian of the body.

use std::sync::Arc;

use biotissue::backends::sparse::Sparse;
use biotissue::fem::assembly::{Assembler, Unknowns, geometry};
use biotissue::fem::boundary::{Boundary, Conditions, LoadCurve, Pressure, RigidCondition};
use biotissue::fem::constraint::{Constraints, VolumeConstraint};
use biotissue::fem::element::ElementType;
use biotissue::fem::equilibrium::Equilibrium;
use biotissue::fem::material::NeoHookean;
use biotissue::fem::mesh::Mesh;
use biotissue::fem::point_field::FormulaField;
use biotissue::las::{Backend, MatVec, MatrixOps, NewtonSystem, NonlinearProblem, SolverParams, Symmetry, VectorOps};
use nalgebra::{Rotation3, Vector3};

use super::hollow_box::hollow_box;
use super::{cavity, penalized, prescribed, region};

type Vector = <Sparse as Backend>::Vector;

/// A body under constraints, and its linear system.
struct Setup {
    body: Equilibrium<Sparse, FormulaField>,
    system: NewtonSystem<Sparse>,
}

fn set_up(mesh: Mesh, conditions: &Conditions) -> Setup {
    let mesh = Arc::new(mesh);
    let boundary = Boundary::new(&mesh, conditions).unwrap();
    let prescribed = boundary.prescribed_mask(mesh.nodes().len());
    let unknowns = Unknowns::new(mesh.nodes().len(), |node, component| prescribed[node][component])
        .unwrap()
        .with_kinematics(boundary.kinematics(), &boundary.prescribed_of_rigid_surfaces())
        .unwrap();
    let geometry = geometry(&mesh).unwrap();
    let fixed = boundary.fixed_components(mesh.nodes().len());
    let constraints = Constraints::new(&mesh, &geometry, &conditions.constraints, &fixed).unwrap();
    let pattern = Arc::new(unknowns.pattern(&mesh).unwrap());
    let symbolic = Sparse::<f64>::analyze(&(), &pattern, &SolverParams::new(Symmetry::None)).unwrap();
    let system = NewtonSystem::bordered(&(), &pattern, &symbolic, constraints.len()).unwrap();
    let mut assembler = Assembler::new(geometry, &unknowns, &system.matrix).unwrap();
    assembler.locate_loads(boundary.loads(), &system.matrix).unwrap();
    assembler.locate_constraints(&constraints, &system.matrix).unwrap();
    let field = FormulaField::uniform(NeoHookean { mu: 3.0, lambda: 5.0 }, &mesh);
    let body = Equilibrium::constrained(mesh, boundary, constraints, assembler, field).unwrap();
    Setup { body, system }
}

/// A vector of numbers without a pattern.
fn scattered(len: usize, size: f64, seed: f64) -> Vector {
    let mut vector = Sparse::<f64>::vector(&(), len).unwrap();
    let value = |k: usize| size * (((k as f64 + seed) * 0.618_033_988).fract() - 0.5);
    let write = |x: &mut [f64]| x.iter_mut().enumerate().for_each(|(k, x)| *x = value(k));
    vector.with_local_mut(write).unwrap();
    vector
}

fn entries(vector: &Vector) -> Vec<f64> {
    vector.with_local(<[f64]>::to_vec).unwrap()
}

impl Setup {
    /// Returns residual and constraints at the current state.
    fn residual(&mut self) -> (Vec<f64>, Vec<f64>) {
        self.body.residual(&mut self.system.residual).unwrap();
        let mut c = vec![0.0; self.body.constraints().len()];
        self.body.constraint_residuals(&mut c);
        (entries(&self.system.residual), c)
    }
}

fn check(mesh: Mesh, constraints: Vec<VolumeConstraint>, pressure: bool) {
    let surfaces = vec![prescribed("x0", [Some(0.0); 3])];
    check_with(mesh, Conditions { surfaces, constraints, ..Conditions::default() }, pressure);
}

fn check_with(mesh: Mesh, conditions: Conditions, pressure: bool) {
    let press = Pressure { surface: "walls".into(), value: 0.7, curve: LoadCurve::Ramp };
    let loads: Vec<Arc<dyn biotissue::fem::boundary::LoadCondition>> =
        if pressure { vec![Arc::new(press)] } else { Vec::new() };
    let conditions = Conditions { loads, ..conditions };
    let mut setup = set_up(mesh, &conditions);
    let (n, m) = (setup.system.residual.len(), conditions.constraints.len());
    setup.body.begin_step(0.6);
    setup.body.advance(1.0, &scattered(n, 0.15, 0.3)).unwrap();
    let multipliers: Vec<f64> = (0..m).map(|j| 0.3 - 0.5 * j as f64).collect();
    setup.body.advance_multipliers(1.0, &multipliers);
    let (at, _) = setup.residual();
    setup.system.matrix.zero().unwrap();
    setup.body.jacobian(&mut setup.system.matrix).unwrap();
    setup.system.matrix.finish().unwrap();
    setup.body.border(&mut setup.system.border).unwrap();

    let direction = scattered(n, 1.0, 0.7);
    let dp: Vec<f64> = (0..m).map(|j| 0.4 + 0.3 * j as f64).collect();
    let mut expected = Sparse::<f64>::vector(&(), n).unwrap();
    setup.system.matrix.mul(&direction, &mut expected).unwrap();
    let mut of_constraints = Vec::new();
    let compliances = setup.system.border.compliances.clone();
    for ((gradient, dp), compliance) in setup.system.border.gradients_mut().iter().zip(&dp).zip(compliances) {
        expected.axpy(-dp, gradient).unwrap();
        of_constraints.push(gradient.dot(&direction).unwrap() + compliance * dp);
    }
    let h = 1e-6;
    let mut moved = |by: f64| {
        setup.body.advance(by, &direction).unwrap();
        setup.body.advance_multipliers(by, &dp);
        let found = setup.residual();
        setup.body.advance(-by, &direction).unwrap();
        setup.body.advance_multipliers(-by, &dp);
        found
    };
    let ((r1, c1), (r0, c0)) = (moved(h), moved(-h));
    let size = |values: &[f64]| values.iter().fold(1e-3, |most: f64, value| most.max(value.abs()));
    let expected = entries(&expected);
    for (k, expected_k) in expected.iter().enumerate() {
        let slope = (r1[k] - r0[k]) / (2.0 * h);
        assert!((slope - expected_k).abs() < 2e-7 * size(&expected), "row {k}: {slope} {expected_k}");
    }
    for (j, expected) in of_constraints.iter().enumerate() {
        let slope = (c1[j] - c0[j]) / (2.0 * h);
        assert!((slope - expected).abs() < 1e-7 * size(&of_constraints), "constraint {j}: {slope} {expected}");
    }
    assert!(size(&at) > 0.1);
}

#[test]
fn derivatives_of_the_volume_of_a_region_are_exact_for_every_element_type() {
    for element_type in ElementType::ALL {
        check(hollow_box(element_type), vec![region("body")], false);
    }
}

#[test]
fn derivatives_of_the_volume_of_a_cavity_are_exact_for_every_element_type() {
    for element_type in ElementType::ALL {
        check(hollow_box(element_type), vec![cavity(&["floor", "walls"])], false);
    }
}

#[test]
fn derivatives_are_exact_with_f_bar_two_constraints_a_penalty_and_a_follower_pressure() {
    for element_type in [ElementType::Hex8, ElementType::Tet4] {
        let mesh = hollow_box(element_type).with_patches(|_| true);
        check(mesh, vec![region("*"), penalized(cavity(&["walls", "floor"]))], true);
    }
}

/// The wall of the cavity is partly rigid, and the nodes of one side of the body move along an inclined plane.
#[test]
fn derivatives_are_exact_with_a_rigid_wall_and_an_inclined_plane() {
    for element_type in [ElementType::Hex8, ElementType::Tet4, ElementType::Tet10] {
        let straight = hollow_box(element_type);
        let frame = Rotation3::from_euler_angles(0.4, -0.7, 1.1);
        let nodes = straight.nodes().iter().map(|&x| (frame * Vector3::from(x)).into()).collect();
        let (elements, regions) = (straight.elements().clone(), straight.regions().to_vec());
        let (region_of, surfaces) = (straight.region_of().to_vec(), straight.surfaces().to_vec());
        let mesh = Mesh::new(nodes, elements, region_of, regions, surfaces).unwrap().with_patches(|_| true);
        let rigid = RigidCondition {
            surface: "floor".into(),
            reference: None,
            displacement: [None, Some(0.02.into()), None],
            rotation: [None, None, Some(0.3.into())],
        };
        let conditions = Conditions {
            symmetry_planes: vec!["x0".into()],
            rigid: vec![rigid],
            constraints: vec![region("*"), penalized(cavity(&["walls", "floor"]))],
            ..Conditions::default()
        };
        check_with(mesh, conditions, true);
    }
}
