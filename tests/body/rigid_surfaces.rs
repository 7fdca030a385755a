//! Planes of symmetry of any orientation, rigid surfaces, and bodies that only their loads hold.
use std::f64::consts::PI;
use std::sync::Arc;

use biotissue::backends::sparse::Sparse;
use biotissue::fem::boundary::{
    Boundary, BoundaryError, Conditions, LoadCurve, PointCondition, PointLoad, PointLocation, Pressure, RigidCondition,
    SurfaceCondition, TimedValue, Traction,
};
use biotissue::fem::element::ElementType;
use biotissue::fem::material::{LinearElastic, NeoHookean};
use biotissue::fem::mesh::{Mesh, shapes};
use biotissue::fem::point_field::FormulaField;
use biotissue::fem::reactions::RigidForce;
use biotissue::fem::stepping::{SetupError, StepParams, Stepper};
use biotissue::las::NewtonParams;
use nalgebra::{Rotation3, Vector3};

const MATERIAL: NeoHookean = NeoHookean { mu: 3.0e3, lambda: 5.0e3 };

type Body = Stepper<Sparse, FormulaField>;

fn setup(mesh: Mesh, conditions: &Conditions, count: usize) -> Result<Body, Box<dyn std::error::Error>> {
    let mut newton = NewtonParams::default();
    newton.tolerance = 1e-11;
    let params = StepParams { count, newton, ..StepParams::default() };
    let field = FormulaField::uniform(MATERIAL, &mesh);
    Ok(Stepper::new(&(), Arc::new(mesh), conditions, field, params)?)
}

fn solved(mesh: Mesh, conditions: &Conditions, count: usize) -> Body {
    let mut body = setup(mesh, conditions, count).unwrap();
    body.run(&mut ()).unwrap();
    body
}

fn turned(mesh: &Mesh, by: &Rotation3<f64>) -> Mesh {
    with_nodes(mesh, mesh.nodes().iter().map(|&x| (by * Vector3::from(x)).into()).collect())
}

fn with_nodes(mesh: &Mesh, nodes: Vec<[f64; 3]>) -> Mesh {
    let (elements, regions) = (mesh.elements().clone(), mesh.regions().to_vec());
    Mesh::new(nodes, elements, mesh.region_of().to_vec(), regions, mesh.surfaces().to_vec()).unwrap()
}

fn traction(surface: &str, value: [f64; 3]) -> Arc<Traction> {
    Arc::new(Traction { surface: surface.into(), value, curve: LoadCurve::Ramp })
}

/// A block pulled between three planes of symmetry deforms in the same way in a rotated frame, where none of the planes
/// is normal to an axis.
#[test]
fn planes_of_symmetry_may_have_any_orientation() {
    let frame = Rotation3::from_euler_angles(0.4, -0.7, 1.1);
    for element_type in ElementType::ALL {
        let mesh = shapes::cuboid_of(element_type, [2, 1, 1], [1.0, 0.7, 0.5]).unwrap();
        let planes = ["x0", "y0", "z0"].map(str::to_owned).to_vec();
        let pulled = |mesh: Mesh, by: Vector3<f64>| {
            let conditions = Conditions {
                symmetry_planes: planes.clone(),
                loads: vec![traction("x1", by.into())],
                ..Conditions::default()
            };
            solved(mesh, &conditions, 2)
        };
        let pull = Vector3::new(2.0e3, 400.0, 300.0);
        let straight = pulled(mesh.clone(), pull);
        let inclined = pulled(turned(&mesh, &frame), frame * pull);
        assert_eq!(straight.unknowns(), inclined.unknowns());
        for (one, other) in straight.state().displacements.iter().zip(&inclined.state().displacements) {
            assert!((frame * Vector3::from(*one) - Vector3::from(*other)).norm() < 1e-11, "{element_type:?}");
        }
        for (one, other) in straight.forces().surfaces.iter().zip(&inclined.forces().surfaces) {
            let difference = frame * Vector3::from(one.force) - Vector3::from(other.force);
            assert!(difference.norm() < 1e-7, "{element_type:?} {}: {:?} {:?}", one.name, one.force, other.force);
        }
        assert!(Vector3::from(inclined.forces().sum()).norm() < 1e-7);
    }
}

/// Positions with the 6 digits that some mesh generators write, or in single precision, change the displacements by no
/// more than that.
#[test]
fn planes_of_symmetry_tolerate_rounded_coordinates() {
    let frame = Rotation3::from_axis_angle(&Vector3::z_axis(), PI / 6.0);
    let pull = frame * Vector3::new(2.0e3, 0.0, 0.0);
    let pulled = |rounded: &dyn Fn(f64) -> f64| {
        let exact = turned(&shapes::cuboid([4, 4, 4], [1.0; 3]).unwrap(), &frame);
        let nodes = exact.nodes().iter().map(|x| x.map(rounded)).collect();
        let conditions = Conditions {
            symmetry_planes: ["x0", "y0", "z0"].map(str::to_owned).to_vec(),
            loads: vec![traction("x1", pull.into())],
            ..Conditions::default()
        };
        solved(with_nodes(&exact, nodes), &conditions, 1)
    };
    let exact = pulled(&|x| x);
    let six_digits = |x: f64| format!("{:.5e}", x + 5.0).parse::<f64>().unwrap();
    for (rounded, accuracy) in [(&six_digits as &dyn Fn(f64) -> f64, 1e-4), (&|x| f64::from(x as f32), 1e-6)] {
        let body = pulled(rounded);
        assert_eq!(exact.unknowns(), body.unknowns());
        for (one, other) in exact.state().displacements.iter().zip(&body.state().displacements) {
            let difference = (Vector3::from(*one) - Vector3::from(*other)).norm();
            assert!(difference < accuracy, "{difference:e}");
        }
    }
}

/// A plane and a prescribed displacement that is not normal to it share their nodes.
#[test]
fn a_node_of_an_inclined_plane_may_be_moved_within_the_plane() {
    let frame = Rotation3::from_axis_angle(&Vector3::z_axis(), PI / 6.0);
    let mesh = turned(&shapes::cuboid([2, 2, 2], [1.0; 3]).unwrap(), &frame);
    let conditions = Conditions {
        symmetry_planes: vec!["x0".into(), "y0".into()],
        surfaces: vec![SurfaceCondition {
            surface: "z0".into(),
            displacement: [None, None, Some(0.0)],
            curve: LoadCurve::Ramp,
        }],
        points: vec![PointCondition {
            place: PointLocation::Nearest((frame * Vector3::new(0.0, 1.0, 1.0)).into()),
            displacement: [None, Some(0.1), None],
            curve: LoadCurve::Ramp,
        }],
        ..Conditions::default()
    };
    let body = solved(mesh, &conditions, 1);
    let point = body.forces().points[0];
    // Along the plane, y moves by 0.1 and x by -0.1 tan 30.
    assert!((point.displacement[1] - 0.1).abs() < 1e-12);
    assert!((point.displacement[0] + 0.1 * (PI / 6.0).tan()).abs() < 1e-12, "{:?}", point.displacement);
    assert!(Vector3::from(body.forces().sum()).norm() < 1e-8);
}

fn rigid(surface: &str, displacement: [Option<f64>; 3], rotation: [Option<f64>; 3]) -> RigidCondition {
    let [displacement, rotation] = [displacement, rotation].map(|of| of.map(|value| value.map(TimedValue::from)));
    RigidCondition { surface: surface.into(), reference: None, displacement, rotation }
}

fn clamp(surface: &str) -> SurfaceCondition {
    SurfaceCondition { surface: surface.into(), displacement: [Some(0.0); 3], curve: LoadCurve::Ramp }
}

/// Twisted by a small angle, a prism of square section has the torque `G J theta / l` of Saint-Venant with
/// `J = 0.14058 a^4` (S. Timoshenko, J. N. Goodier, *Theory of Elasticity*, 1970, section 109), up to the stiffening of
/// the ends that cannot warp.
#[test]
fn a_twisted_prism_has_the_moment_of_saint_venant() {
    let (length, angle) = (8.0, 1e-3);
    let mesh = shapes::cuboid_of(ElementType::Hex20, [16, 3, 3], [length, 1.0, 1.0]).unwrap();
    let conditions = Conditions {
        surfaces: vec![clamp("x0")],
        rigid: vec![rigid("x1", [Some(0.0); 3], [Some(angle), Some(0.0), Some(0.0)])],
        ..Conditions::default()
    };
    let body = solved(mesh, &conditions, 1);
    let moment = body.forces().rigid[0].moment;
    let expected = MATERIAL.mu * 0.140_58 * angle / length;
    assert!((moment[0] / expected - 1.0).abs() < 0.05 && moment[0] > expected, "{moment:?}, {expected}");
    assert!(moment[1].abs() + moment[2].abs() < 1e-6 * expected, "{moment:?}");
}

/// Returns the moments whose products with the rates of the rotation vector are the power: `m . w_i` with the angular
/// velocity `w_i` that belongs to a unit rate of component `i`.
fn conjugate_moment(force: &RigidForce) -> [f64; 3] {
    let (theta, h) = (Vector3::from(force.motion.rotation), 1e-6);
    std::array::from_fn(|i| {
        let at = |by: f64| Rotation3::from_scaled_axis(theta + Vector3::ith(i, by)).into_inner();
        let spin = (at(h) - at(-h)) * at(0.0).transpose() / (2.0 * h);
        Vector3::new(spin[(2, 1)], spin[(0, 2)], spin[(1, 0)]).dot(&Vector3::from(force.moment))
    })
}

/// The work of the moment in a rotation is the increase of the energy, also at a finite angle and with free components;
/// all forces and moments on the body balance.
#[test]
fn the_moment_is_the_derivative_of_the_energy() {
    for element_type in ElementType::ALL {
        let mesh = shapes::cuboid_of(element_type, [3, 1, 1], [2.0, 1.0, 0.8]).unwrap();
        let energy_and_moment = |angle: f64| {
            let twist = rigid("x1", [None; 3], [None, None, Some(angle)]);
            let conditions = Conditions { surfaces: vec![clamp("x0")], rigid: vec![twist], ..Conditions::default() };
            let body = solved(mesh.clone(), &conditions, 4);
            let energy: f64 =
                body.state().responses.energy.iter().zip(mesh.point_volumes()).map(|(w, volume)| w * volume).sum();
            let force = body.forces().rigid[0].clone();
            // The components that are free carry no force and no moment.
            let through = body.forces().surfaces[force.surface].force;
            assert!(Vector3::from(through).norm() < 1e-7, "{through:?}");
            let moment = conjugate_moment(&force);
            assert!(moment[0].abs() + moment[1].abs() < 1e-6, "{moment:?}");
            assert_eq!(force.motion.rotation[2], angle);
            (energy, moment[2])
        };
        let (h, angle) = (1e-3, 0.9);
        let (moment, slope) =
            (energy_and_moment(angle).1, (energy_and_moment(angle + h).0 - energy_and_moment(angle - h).0) / (2.0 * h));
        assert!((moment / slope - 1.0).abs() < 2e-6, "{element_type:?}: {moment} {slope}");
    }
}

/// The moment is that of all forces through the surface: a load on a surface that is held does not reach the body.
#[test]
fn the_moment_contains_that_of_loads_on_the_surface() {
    let mesh = shapes::cuboid_of(ElementType::Tet4, [2, 1, 1], [2.0, 1.0, 0.8]).unwrap();
    let held = RigidCondition { reference: Some([2.0, 0.0, 0.0]), ..rigid("x1", [Some(0.0); 3], [Some(0.0); 3]) };
    let conditions = Conditions {
        rigid: vec![held],
        loads: vec![
            traction("x1", [30.0, -20.0, 50.0]),
            Arc::new(Pressure { surface: "x1".into(), value: 70.0, curve: LoadCurve::Ramp }),
        ],
        ..Conditions::default()
    };
    let forces = solved(mesh, &conditions, 1).forces();
    let rigid = &forces.rigid[0];
    let through = forces.surfaces[rigid.surface].force;
    // Those of the loads alone are 40 N and 30 N m.
    for part in through.iter().chain(&rigid.moment) {
        assert!(part.abs() < 1e-12, "{through:?} {:?}", rigid.moment);
    }
}

/// A body that only turns has no stress, but its displacements over many elements round to more than one of order one
/// would.
#[test]
fn a_body_that_turns_far_around_converges_without_loads() {
    let mesh = shapes::cuboid_of(ElementType::Hex8, [4, 2, 2], [2.0, 1.0, 1.0]).unwrap();
    for distance in [5.0, 500.0] {
        let turning = RigidCondition {
            reference: Some([distance, 0.0, 0.0]),
            ..rigid("x1", [Some(0.0); 3], [Some(0.0), Some(0.0), Some(1.0)])
        };
        let conditions = Conditions { rigid: vec![turning], ..Conditions::default() };
        let mut body = setup(mesh.clone(), &conditions, 4).unwrap();
        let reports = body.run(&mut ()).unwrap_or_else(|error| panic!("{distance}: {error}"));
        assert!(reports.iter().all(|report| report.cuts == 0), "{distance}");
    }
}

/// Newton converges quadratically with free rotations.
#[test]
fn newton_converges_quadratically_with_a_free_rigid_surface() {
    let mesh = shapes::cuboid_of(ElementType::Hex8, [4, 2, 2], [2.0, 1.0, 1.0]).unwrap();
    let pull = Pressure { surface: "x1".into(), value: -300.0, curve: LoadCurve::Ramp };
    let conditions = Conditions {
        surfaces: vec![clamp("x0")],
        rigid: vec![rigid("x1", [None; 3], [Some(0.5), None, None])],
        loads: vec![Arc::new(pull), traction("x1", [0.0, 150.0, 0.0])],
        ..Conditions::default()
    };
    let mut body = setup(mesh, &conditions, 2).unwrap();
    let reports = body.run(&mut ()).unwrap();
    let residuals = &reports[1].solves[0].residuals;
    let [.., a, b, c] = &residuals[..] else { panic!("{residuals:?}") };
    assert!(*c < 1e-11 || (c.ln() - b.ln()) / (b.ln() - a.ln()) > 1.6, "{residuals:?}");
    assert!(residuals.len() <= 7, "{residuals:?}");
    let tilt = body.forces().rigid[0].motion.rotation;
    assert!(tilt[2] > 0.05, "the end follows the bending: {tilt:?}");
    assert!(Vector3::from(body.forces().sum()).norm() < 1e-7);
}

/// A quarter of a turn, in one step per nine degrees, turns the end exactly.
#[test]
fn a_prism_bends_by_a_right_angle() {
    let mesh = shapes::cuboid_of(ElementType::Hex20, [8, 1, 1], [8.0, 1.0, 1.0]).unwrap();
    let conditions = Conditions {
        surfaces: vec![clamp("x0")],
        rigid: vec![rigid("x1", [None; 3], [Some(0.0), Some(0.0), Some(PI / 2.0)])],
        ..Conditions::default()
    };
    let body = solved(mesh, &conditions, 10);
    let force = &body.forces().rigid[0];
    let moment = force.moment[2];
    // E I / R with the radius of a quarter circle; the section is not thin.
    let youngs_modulus = MATERIAL.mu * (3.0 * MATERIAL.lambda + 2.0 * MATERIAL.mu) / (MATERIAL.lambda + MATERIAL.mu);
    let expected = youngs_modulus / 12.0 * (PI / 2.0) / 8.0;
    assert!((moment / expected - 1.0).abs() < 0.05, "{moment}, {expected}");
    // The end of a quarter circle.
    let radius = 8.0 / (PI / 2.0);
    let end = Vector3::new(radius - 8.0, radius, 0.0);
    assert!((Vector3::from(force.motion.displacement) - end).norm() < 0.15, "{:?}", force.motion);
}

/// Nothing of a failed attempt remains in the motion of a rigid surface: a bend in one step, which must be cut, ends like
/// one in small steps.
#[test]
fn cut_steps_end_in_the_state_of_uncut_ones() {
    let mesh = shapes::cuboid_of(ElementType::Hex8, [6, 1, 1], [6.0, 1.0, 1.0]).unwrap();
    let conditions = Conditions {
        surfaces: vec![clamp("x0")],
        rigid: vec![rigid("x1", [None; 3], [None, Some(0.0), Some(2.5)])],
        ..Conditions::default()
    };
    let mut cut = setup(mesh.clone(), &conditions, 1).unwrap();
    let reports = cut.run(&mut ()).unwrap();
    assert!(reports[0].cuts > 0, "{}", reports[0].cuts);
    let whole = solved(mesh, &conditions, 20);
    for (one, other) in cut.state().displacements.iter().zip(&whole.state().displacements) {
        assert!((Vector3::from(*one) - Vector3::from(*other)).norm() < 1e-8);
    }
    let [one, other] = [&cut, &whole].map(|body| body.forces().rigid[0].motion);
    assert_eq!(one.rotation[1..], other.rotation[1..]);
}

/// A half of the bent prism, with a plane of symmetry that contains nodes of the rigid surface.
#[test]
fn a_rigid_surface_may_share_nodes_with_a_plane_that_it_keeps() {
    let whole = shapes::cuboid_of(ElementType::Hex8, [4, 2, 2], [2.0, 1.0, 1.0]).unwrap();
    let half = shapes::cuboid_of(ElementType::Hex8, [4, 2, 1], [2.0, 1.0, 0.5]).unwrap();
    let free_in_plane = rigid("x1", [None, None, Some(0.0)], [Some(0.0), Some(0.0), Some(0.4)]);
    let plane = vec!["z0".to_owned()];
    let bend = |mesh: Mesh, symmetry_planes: Vec<String>, rigid: RigidCondition| {
        let conditions =
            Conditions { surfaces: vec![clamp("x0")], rigid: vec![rigid], symmetry_planes, ..Conditions::default() };
        setup(mesh, &conditions, 2).map(|mut body| {
            body.run(&mut ()).unwrap();
            body.forces().rigid[0].moment[2]
        })
    };
    let (all, of_half) = (
        bend(whole, Vec::new(), free_in_plane.clone()).unwrap(),
        bend(half.clone(), plane.clone(), free_in_plane).unwrap(),
    );
    assert!((all / (2.0 * of_half) - 1.0).abs() < 1e-9, "{all} {of_half}");
    let tilting = rigid("x1", [None, None, Some(0.0)], [Some(0.0), None, Some(0.4)]);
    let error = bend(half, plane, tilting).unwrap_err().to_string();
    let expected =
        "node 4 belongs to the rigid surface `x1`, but also to surface `z0`, which prescribes its z-displacement";
    assert_eq!(error, expected);
}

#[test]
fn contradictory_planes_and_curved_surfaces_are_refused() {
    let mesh = turned(&shapes::cuboid([1, 1, 1], [1.0; 3]).unwrap(), &Rotation3::from_euler_angles(0.0, 0.0, 0.3));
    let boundary_error = |conditions: &Conditions| {
        let field = FormulaField::uniform(LinearElastic { mu: 1.0, lambda: 1.0 }, &mesh);
        let mesh = Arc::new(mesh.clone());
        match Stepper::<Sparse, _>::new(&(), mesh, conditions, field, StepParams::default()).err() {
            Some(SetupError::Boundary(error)) => error,
            other => panic!("{:?}", other.map(|error| error.to_string())),
        }
    };
    // All three components of a node of the plane are moved.
    let moved = SurfaceCondition { surface: "x0".into(), displacement: [Some(0.1); 3], curve: LoadCurve::Ramp };
    let conditions = Conditions { surfaces: vec![moved], symmetry_planes: vec!["x0".into()], ..Conditions::default() };
    let error = boundary_error(&conditions);
    assert!(matches!(error, BoundaryError::PlaneConflict { value: 0.1, .. }), "{error}");
    assert!(error.to_string().contains("symmetry plane of surface `x0`"), "{error}");
}

/// A sector of a tube between inclined planes in a grip that pulls along the axis, which keeps the planes.
#[test]
fn a_rigid_surface_may_share_nodes_with_an_inclined_plane_that_it_keeps() {
    let frame = Rotation3::from_axis_angle(&Vector3::x_axis(), 0.5);
    let mesh = turned(&shapes::cuboid_of(ElementType::Hex8, [3, 2, 2], [2.0, 1.0, 1.0]).unwrap(), &frame);
    let pulled = |rotation| Conditions {
        symmetry_planes: vec!["x0".into(), "y0".into(), "z0".into()],
        rigid: vec![rigid("x1", [Some(0.2), Some(0.0), Some(0.0)], rotation)],
        ..Conditions::default()
    };
    let body = solved(mesh.clone(), &pulled([Some(0.0); 3]), 1);
    assert!(Vector3::from(body.forces().sum()).norm() < 1e-7);
    assert!(body.forces().surfaces[1].force[0] > 1.0);
    let error = setup(mesh.clone(), &pulled([Some(0.0), None, Some(0.0)]), 1).err().unwrap().to_string();
    assert!(error.contains("belongs to the rigid surface `x1`, which may leave the plane"), "{error}");
    let spun =
        Conditions { symmetry_planes: Vec::new(), surfaces: vec![clamp("x0")], ..pulled([Some(6.3), None, None]) };
    let error = setup(mesh, &spun, 1).err().unwrap().to_string();
    assert!(error.starts_with("surface `x1` is turned by 6.3000 rad while a component"), "{error}");
}

/// A grip that moves within an inclined plane of symmetry and turns about its normal exerts the force and moment of the grip
/// of the body that is not rotated.
#[test]
fn a_rigid_surface_may_move_within_an_inclined_plane() {
    let frame = Rotation3::from_axis_angle(&Vector3::z_axis(), PI / 6.0);
    let mesh = shapes::cuboid_of(ElementType::Hex8, [3, 2, 2], [1.0, 0.7, 0.5]).unwrap();
    let plane = vec!["y0".to_owned()];
    let curve = LoadCurve::table(&[[0.0, 0.0], [0.3, 1.0], [1.0, 0.5]]).unwrap();
    let held = [Some(0.0); 3];
    let cases = [
        (Some(0.0), Vector3::zeros(), vec!["y0", "z0"]),
        (None, Vector3::zeros(), vec!["y0"]),
        (Some(0.02), Vector3::new(0.0, 0.3, 0.0), vec!["y0"]),
    ];
    for (z, rotation, planes) in cases {
        let pulled = |by: &Rotation3<f64>| {
            let [x, y, _] = <[f64; 3]>::from(by * Vector3::new(0.1, 0.0, 0.0));
            let mut grip = rigid("x1", [Some(x), Some(y), z], <[f64; 3]>::from(by * rotation).map(Some));
            grip.displacement.iter_mut().flatten().for_each(|value| value.curve = curve.clone());
            let conditions = Conditions {
                symmetry_planes: planes.iter().map(|&name| name.to_owned()).collect(),
                surfaces: vec![clamp("x0")],
                rigid: vec![grip],
                ..Conditions::default()
            };
            solved(turned(&mesh, by), &conditions, 2)
        };
        let (straight, inclined) = (pulled(&Rotation3::identity()), pulled(&frame));
        let [one, other] = [&straight, &inclined].map(|body| body.forces().surfaces[1].force).map(Vector3::from);
        assert!(one.norm() > 10.0 && (frame * one - other).norm() < 1e-9 * one.norm(), "{one} {other}");
        let [one, other] = [&straight, &inclined].map(|body| body.forces().rigid[0].moment).map(Vector3::from);
        assert!(one.norm() > 1.0 && (frame * one - other).norm() < 1e-9 * one.norm(), "{one} {other}");
    }
    let mesh = turned(&mesh, &frame);
    let resolved = |grip: RigidCondition| {
        let conditions = Conditions {
            symmetry_planes: plane.clone(),
            surfaces: vec![clamp("x0")],
            rigid: vec![grip],
            ..Conditions::default()
        };
        Boundary::new(&mesh, &conditions).map(|_| ()).map_err(|error| error.to_string())
    };
    // Four digits, and a rotation vector that is parallel to the normal up to rounding.
    assert_eq!(resolved(rigid("x1", [Some(0.0866), Some(0.05), None], held)), Ok(()));
    assert_eq!(resolved(rigid("x1", held, [Some(-0.1), Some(0.173_205), Some(0.0)])), Ok(()));
    let mut apart = rigid("x1", [Some(0.086_602_54), Some(0.05), Some(0.0)], held);
    apart.displacement[0].as_mut().unwrap().curve = curve;
    let leaving = [
        apart,
        rigid("x1", [Some(0.087), Some(0.05), Some(0.0)], held),
        rigid("x1", [None, Some(0.0), Some(0.0)], held),
        rigid("x1", held, [Some(0.0), Some(0.0), Some(0.1)]),
        rigid("x1", held, [None, Some(0.0), Some(0.0)]),
    ];
    let expected = "node 3 belongs to the rigid surface `x1`, which may leave the plane of symmetry of surface `y0`";
    for grip in leaving {
        assert_eq!(resolved(grip.clone()), Err(expected.to_owned()), "{grip:?}");
    }
}

/// A box under pressure from all sides and a box pulled at both ends need no supports; those that are added exert no
/// force and cause no stress.
#[test]
fn bodies_in_balance_need_no_supports() {
    for element_type in ElementType::ALL {
        let mesh = shapes::cuboid_of(element_type, [2, 1, 1], [1.0, 0.7, 0.5]).unwrap();
        let press = |surface: &str| Pressure { surface: surface.into(), value: 500.0, curve: LoadCurve::Ramp };
        let free = Conditions { hold_free_modes: true, ..Conditions::default() };
        let pressed = Conditions {
            loads: ["x0", "x1", "y0", "y1", "z0", "z1"].map(|surface| Arc::new(press(surface)) as _).to_vec(),
            ..free.clone()
        };
        let body = solved(mesh.clone(), &pressed, 1);
        let gradients = &body.state().gradients;
        for f in gradients {
            assert!((f - gradients[0]).norm() < 1e-9, "{element_type:?}");
            assert!((f - nalgebra::Matrix3::from_diagonal_element(f[(0, 0)])).norm() < 1e-9, "{element_type:?}: {f}");
        }
        let pulled = Conditions {
            loads: vec![traction("x0", [-2.0e3, 0.0, 0.0]), traction("x1", [2.0e3, 0.0, 0.0])],
            ..free.clone()
        };
        let body = solved(mesh, &pulled, 2);
        assert!(body.state().responses.pk1.iter().all(|p| (p[(0, 0)] - 2.0e3).abs() < 1e-5), "{element_type:?}");
    }
}

#[test]
fn loads_that_do_not_balance_are_refused() {
    let mesh = shapes::cuboid([2, 2, 2], [1.0; 3]).unwrap();
    let conditions = Conditions {
        hold_free_modes: true,
        loads: vec![traction("x0", [-2.0e3, 0.0, 0.0]), traction("x1", [2.001e3, 0.0, 0.0])],
        ..Conditions::default()
    };
    let mut body = setup(mesh.clone(), &conditions, 1).unwrap();
    let error = body.run(&mut ()).unwrap_err().to_string();
    assert!(error.contains("do not balance on the deformed body"), "{error}");
    // Supports are added only against modes that the other conditions leave.
    let point = PointLoad {
        point: 0,
        place: PointLocation::Nearest([1.0; 3]),
        value: [10.0, 0.0, 0.0],
        curve: LoadCurve::Ramp,
    };
    let roller =
        SurfaceCondition { surface: "x0".into(), displacement: [Some(0.0), None, None], curve: LoadCurve::Ramp };
    let conditions = Conditions {
        hold_free_modes: true,
        surfaces: vec![roller],
        points: vec![PointCondition {
            place: PointLocation::Nearest([1.0; 3]),
            displacement: [None; 3],
            curve: LoadCurve::Ramp,
        }],
        loads: vec![Arc::new(point)],
        ..Conditions::default()
    };
    let body = solved(mesh, &conditions, 1);
    assert_eq!(body.unknowns(), 3 * 27 - 9 - 3);
    assert!(Vector3::from(body.forces().sum()).norm() < 1e-7);
}
