//! Loads and prescribed displacements given by functions of pseudo-time and position.

use super::*;

/// `t (1 + x y)`, with a jump of its rate.
#[derive(Debug)]
struct Saddle;

impl LoadFunction for Saddle {
    fn factor(&self, t: f64, [x, y, _]: [f64; 3]) -> f64 {
        t * (1.0 + x * y)
    }

    fn break_points(&self) -> Vec<f64> {
        vec![0.25]
    }
}

#[test]
fn functions_of_the_position_are_integrated_over_surfaces_and_regions() {
    let mesh = box_2x1x1();
    let curve = LoadCurve::Function(Arc::new(Saddle));
    let loads: Vec<Arc<dyn LoadCondition>> = vec![
        Arc::new(Traction { surface: "z1".into(), value: [3.0, 0.0, 0.0], curve: curve.clone() }),
        Arc::new(Pressure { surface: "z1".into(), value: 4.0, curve: curve.clone() }),
        Arc::new(BodyForce { region: "*".into(), value: [0.0, 5.0, 0.0], curve: curve.clone() }),
        Arc::new(PointLoad {
            point: 0,
            place: PointLocation::Nearest([2.0, 1.0, 0.0]),
            value: [0.0, 0.0, 7.0],
            curve: curve.clone(),
        }),
    ];
    let clamp = SurfaceCondition { surface: "x1".into(), displacement: [Some(0.1), None, None], curve: curve.clone() };
    let conditions = Conditions { surfaces: vec![clamp], loads, ..Conditions::default() };
    let boundary = Boundary::new(&mesh, &conditions).unwrap();
    assert_eq!(boundary.break_points(), [0.25]);
    // The integral of 1 + x y over 2 by 1 by 1 is 3.
    let zeros = vec![[0.0; 3]; mesh.nodes().len()];
    let expected = [[4.5, 0.0, 0.0], [0.0, 0.0, -6.0], [0.0, 7.5, 0.0], [0.0, 0.0, 10.5]];
    for (load, expected) in boundary.loads().iter().zip(expected) {
        let mut forces = zeros.clone();
        load.add_forces(0.5, &zeros, &mut forces);
        let sum = forces.iter().fold([0.0; 3], |sum, f| std::array::from_fn(|i| sum[i] + f[i]));
        for found in [sum, load.resultant(0.5, &zeros)] {
            // One point per triangle or tetrahedron does not integrate x y exactly.
            assert!((0..3).all(|i| (found[i] - expected[i]).abs() <= 0.06 * expected[i].abs()), "{found:?}");
        }
    }
    let mut displacements = zeros;
    boundary.apply_prescribed(0.5, &mut displacements, &mut []);
    for (x, u) in mesh.nodes().iter().zip(&displacements).filter(|(x, _)| x[0] == 2.0) {
        assert!((u[0] - 0.05 * (1.0 + 2.0 * x[1])).abs() < 1e-15);
    }
}

/// `1 / (x - from)`, which has no value at `from`.
#[derive(Debug)]
struct Pole {
    from: f64,
    formula: String,
}

impl LoadFunction for Pole {
    fn factor(&self, t: f64, [x, ..]: [f64; 3]) -> f64 {
        t / (x - self.from)
    }

    fn formula(&self) -> Option<&str> {
        Some(&self.formula)
    }
}

fn pole(from: f64) -> LoadCurve {
    LoadCurve::Function(Arc::new(Pole { from, formula: format!("t / (x - {from})") }))
}

#[test]
fn functions_without_a_value_at_a_node_or_point_are_reported() {
    let mesh = box_2x1x1();
    let refused = |conditions: Conditions| match Boundary::new(&mesh, &conditions).unwrap_err() {
        BoundaryError::NotFiniteAt { place, t, position: [x, ..], .. } => (place, t, x),
        other => panic!("{other}"),
    };
    let (surface, value) = (|name: &str| name.to_owned(), [1.0, 0.0, 0.0]);
    let at_end = |name: &str| (surface(name), 0.0, 2.0);
    // t / (x - 2) is 0 / 0 at t = 0.
    let pulled = Traction { surface: surface("x1"), value, curve: pole(2.0) };
    assert_eq!(refused(with_load(pulled)), at_end("surface `x1`"));
    let pressed = Pressure { surface: surface("x1"), value: 1.0, curve: pole(2.0) };
    assert_eq!(refused(with_load(pressed)), at_end("surface `x1`"));
    let moved = SurfaceCondition { curve: pole(2.0), ..prescribed_at("x1", [Some(1.0), None, None]) };
    assert_eq!(refused(on_surfaces(vec![moved])), at_end("surface `x1`"));
    let force = BodyForce { region: "*".into(), value, curve: LoadCurve::Function(Arc::new(Unreal)) };
    assert_eq!(refused(with_load(force)).0, "the body force on region `*`");
    let place = PointLocation::Node(0);
    let points = vec![PointCondition { place, displacement: [None; 3], curve: LoadCurve::Ramp }];
    let load = PointLoad { point: 0, place, value, curve: pole(0.0) };
    let loads: Vec<Arc<dyn LoadCondition>> = vec![Arc::new(load)];
    assert_eq!(
        refused(Conditions { points, loads, ..Conditions::default() }),
        (surface("point condition 1"), 0.0, 0.0)
    );
}

#[derive(Debug)]
struct Unreal;

impl LoadFunction for Unreal {
    fn factor(&self, _: f64, _: [f64; 3]) -> f64 {
        f64::NAN
    }
}

#[test]
fn functions_with_the_same_formula_agree_at_shared_nodes() {
    let mesh = box_2x1x1();
    let moved =
        |name: &str, from| SurfaceCondition { curve: pole(from), ..prescribed_at(name, [Some(1.0), None, None]) };
    assert!(Boundary::new(&mesh, &on_surfaces(vec![moved("x1", 5.0), moved("y1", 5.0)])).is_ok());
    let other = Boundary::new(&mesh, &on_surfaces(vec![moved("x1", 5.0), moved("y1", 6.0)])).unwrap_err();
    assert!(matches!(other, BoundaryError::Conflict { .. }), "{other}");
}

#[test]
fn displacements_that_agree_at_all_times_are_no_conflict() {
    let mesh = box_2x1x1();
    let on = |value, curve: &LoadCurve| [curve.clone(), LoadCurve::Ramp].map(|curve| (value, curve));
    let of = |[(first, one), (second, other)]: [(f64, LoadCurve); 2]| {
        let moved =
            |name: &str, value, curve| SurfaceCondition { curve, ..prescribed_at(name, [None, Some(value), None]) };
        Boundary::new(&mesh, &on_surfaces(vec![moved("x1", first, one), moved("z1", second, other)]))
    };
    let ramp = LoadCurve::table(&[[0.0, 0.0], [0.25, 0.25], [1.0, 1.0]]).unwrap();
    let bent = LoadCurve::table(&[[0.0, 0.0], [0.125, 0.1251], [1.0, 1.0]]).unwrap();
    let short = LoadCurve::table(&[[0.0, 0.0], [0.404, 0.404], [0.405, 0.4], [0.406, 0.406], [1.0, 1.0]]).unwrap();
    let linear = LoadCurve::Function(Arc::new(Timed(|t| t)));
    let kinked = LoadCurve::Function(Arc::new(Timed(|t| if t > 0.5 { t * t } else { t })));
    for curve in [&ramp, &linear] {
        let [first, second] = on(0.5, curve);
        assert!(of([first.clone(), second.clone()]).is_ok() && of([second, first]).is_ok(), "{curve:?}");
    }
    for curve in [&bent, &short, &kinked] {
        let [first, second] = on(0.5, curve);
        assert!(of([first.clone(), second.clone()]).is_err() && of([second, first]).is_err(), "{curve:?}");
    }
    // A function that is 0 at the nodes of another condition does not move them.
    let never = LoadCurve::Function(Arc::new(Timed(|_| 0.0)));
    assert!(of([(1.0, never), (0.0, LoadCurve::Ramp)]).is_ok());
}

/// A function of pseudo-time alone.
struct Timed(fn(f64) -> f64);

impl std::fmt::Debug for Timed {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str("Timed")
    }
}

impl LoadFunction for Timed {
    fn factor(&self, t: f64, _: [f64; 3]) -> f64 {
        (self.0)(t)
    }

    fn depends_on_position(&self) -> bool {
        false
    }
}

#[test]
fn messages_show_formulas_instead_of_values_at_a_factor_of_one() {
    let mesh = box_2x1x1();
    let moved = SurfaceCondition { curve: pole(5.0), ..prescribed_at("x1", [Some(1.0), None, None]) };
    let twice = SurfaceCondition { curve: pole(5.0), ..prescribed_at("y1", [Some(2.0), None, None]) };
    let held = prescribed_at("y0", [Some(0.0), None, None]);
    let message = |surfaces| Boundary::new(&mesh, &on_surfaces(surfaces)).unwrap_err().to_string();
    assert_eq!(
        message(vec![held, moved.clone()]),
        "node 2 is given two x-displacements: 0e0 m by surface `y0` and \"t / (x - 5)\" m by surface `x1` (the number times its curve)"
    );
    let both = message(vec![moved.clone(), twice]);
    assert!(both.ends_with("\"t / (x - 5)\" m by surface `x1` and 2e0 * \"t / (x - 5)\" m by surface `y1`"), "{both}");
    let plane = Conditions { symmetry_planes: vec!["x1".into()], surfaces: vec![moved], ..Conditions::default() };
    assert!(Boundary::new(&mesh, &plane).unwrap_err().to_string().contains("\"t / (x - 5)\" m by surface `x1`"));
}

#[test]
fn values_are_checked_at_given_times_where_they_act() {
    let mesh = box_2x1x1();
    // Infinite at t = 0.5 everywhere, and at x = 0, which is not on x1.
    let curve = LoadCurve::Function(Arc::new(Timed(|t| 1.0 / (t - 0.5))));
    let unlike = |x: f64| LoadCurve::Function(Arc::new(Quotient(x)));
    let pressed = |curve| with_load(Pressure { surface: "x1".into(), value: 1.0, curve });
    let pulled = |curve| with_load(Traction { surface: "x1".into(), value: [0.0, 1.0, 0.0], curve });
    let body = |curve| with_load(BodyForce { region: "*".into(), value: [0.0, 1.0, 0.0], curve });
    let point = |curve| PointLoad { point: 0, place: PointLocation::Node(0), value: [1.0; 3], curve };
    let moved = |curve| on_surfaces(vec![SurfaceCondition { curve, ..prescribed_at("x1", [Some(1.0), None, None]) }]);
    let rigid = |curve: LoadCurve| {
        let of = RigidCondition {
            surface: "x1".into(),
            reference: None,
            displacement: [const { None }; 3],
            rotation: [const { None }; 3],
        };
        let displacement = [Some(TimedValue { value: 1.0, curve }), None, None];
        Conditions { rigid: vec![RigidCondition { displacement, ..of }], ..Conditions::default() }
    };
    let check = |conditions: Conditions| {
        let boundary = Boundary::new(&mesh, &conditions).unwrap();
        boundary.check_finite(&mesh, &[0.25, 0.75]).unwrap();
        boundary.check_finite(&mesh, &[0.25, 0.5, 0.75])
    };
    for (place, conditions) in [
        ("surface `x1`", pressed(curve.clone())),
        ("surface `x1`", pulled(curve.clone())),
        ("the body force on region `*`", body(curve.clone())),
        ("point condition 1", with_load(point(curve.clone()))),
        ("surface `x1`", moved(curve.clone())),
        ("surface `x1`", rigid(curve.clone())),
    ] {
        match check(conditions) {
            Err(BoundaryError::NotFiniteAt { place: found, t: 0.5, .. }) => assert_eq!(found, place),
            other => panic!("{place}: {other:?}"),
        }
    }
    for conditions in [pressed(unlike(0.0)), pulled(unlike(0.0)), moved(unlike(0.0)), rigid(unlike(0.0))] {
        check(conditions).unwrap();
    }
}

/// `t / (x - x0)`.
#[derive(Debug)]
struct Quotient(f64);

impl LoadFunction for Quotient {
    fn factor(&self, t: f64, [x, ..]: [f64; 3]) -> f64 {
        t / (x - self.0)
    }
}

#[test]
fn components_of_a_point_have_curves_of_their_own() {
    let mesh = box_2x1x1();
    let point =
        PointCondition { place: PointLocation::Node(1), displacement: [Some(2.0), None, None], curve: LoadCurve::Ramp };
    let own = |point| PointDisplacement { point, component: 2, value: 3.0, curve: pole(-1.0) };
    let conditions = Conditions { points: vec![point], point_displacements: vec![own(0)], ..Conditions::default() };
    let boundary = Boundary::new(&mesh, &conditions).unwrap();
    let mut displacements = vec![[9.0; 3]; mesh.nodes().len()];
    boundary.apply_prescribed(0.5, &mut displacements, &mut []);
    let x = mesh.nodes()[1][0];
    assert_eq!(displacements[1], [1.0, 9.0, 3.0 * (0.5 / (x + 1.0))]);
    let unknown = Conditions { point_displacements: vec![own(1)], ..conditions };
    let error = Boundary::new(&mesh, &unknown).unwrap_err();
    assert_eq!(error, BoundaryError::UnknownPoint { point: 1, known: 1 });
}
