//! The cases that valid files give.

use super::super::*;
use super::{FULL, Folder, SMALL};
use crate::fem::element::ElementType;
use crate::fem::material::NeoHookean;
use crate::fem::mesh::QuadraticHexahedron;
use crate::fem::mesh::shapes::TubeShape;
use crate::fiber::equilibrium::{Stage, Stages};
use crate::fiber::law::{FiberMaterial, Law};
use crate::las::{Iterative, Krylov, Method, Preconditioner};
use crate::tissue::materials::LaneUse;

#[test]
fn every_entry_is_read() {
    let folder = Folder::new();
    let CaseFile { case, warnings } = folder.parse(FULL).unwrap();
    assert_eq!(case.title, "Dogbone in tension");
    assert_eq!(case.mesh, MeshSource::File(folder.path().join("sample.msh")));
    assert_eq!(case.mesh_scale, 0.001);
    let lines: Vec<_> = case.regions.iter().map(|region| (region.name.as_str(), region.line)).collect();
    assert_eq!(lines, [("gauge", 7), ("*", 18)]);
    let RegionMaterial::FiberRve(rve) = &case.regions[0].material else { panic!("not a fiber RVE") };
    let networks = ["networks/a.txt", "networks/b.txt"].map(|name| folder.path().join(name));
    assert_eq!(rve.networks, networks);
    assert_eq!(
        (&rve.assignment, rve.seed, &rve.scale),
        (&NetworkAssignment::Cycle, 7, &StressScale::FiberVolumeFraction(0.003).into())
    );
    let law = Law::ExponentialStretch { youngs_modulus: 1.0e8, nonlinearity: 1.2, transition: 1.4 };
    assert_eq!(rve.law, Some(FiberMaterial { law, radius: 5.0e-8, density: None }));
    assert_eq!(rve.matrix, Some(FormulaCase::Constant(Formula::NeoHookean(NeoHookean { mu: 100.0, lambda: 150.0 }))));

    let table = LoadCurve::table(&[[0.0, 0.0], [0.5, 1.0], [1.0, 0.25]]).unwrap();
    let boundary = |surface: &str, line, load, curve| BoundaryCase { surface: surface.into(), line, load, curve };
    assert_eq!(
        case.boundaries,
        [
            boundary(
                "left",
                22,
                SurfaceLoad::Displacement([const { Some(LoadValue::Number(0.0)) }; 3]),
                LoadCurve::Ramp
            ),
            boundary("right", 25, SurfaceLoad::Traction([4.0e4, 0.0, 0.0].map(LoadValue::Number)), table),
            boundary(
                "right",
                29,
                SurfaceLoad::Displacement([None, Some(LoadValue::Number(0.0)), None]),
                LoadCurve::Ramp
            ),
        ]
    );
    assert_eq!(case.points[0].place, PointPlace::At([0.0, 0.0, 0.5]));
    assert_eq!(case.points[0].displacement, [None, None, Some(LoadValue::Number(-1e-3))]);
    assert_eq!((case.points[1].place, case.points[1].line), (PointPlace::Node(12), 36));
    let weight = [0.0, 0.0, -9810.0].map(LoadValue::Number);
    assert_eq!((case.body_forces[0].region.as_str(), &case.body_forces[0].value), ("gauge", &weight));
    assert_eq!(
        case.steps,
        StepsCase {
            count: 20,
            max_cuts: 4,
            adaptive: Some(AdaptiveIncrements { target_iterations: 6, largest: 0.5, smallest: 0.015625 }),
        }
    );
    let cg = Iterative {
        krylov: Krylov::Cg,
        preconditioner: Preconditioner::Diagonal,
        tolerance: 1e-13,
        max_iterations: 1000,
    };
    let preconditioner = Preconditioner::Ilut { drop_tolerance: 0.0, fill: 7 };
    let gmres = Iterative { krylov: Krylov::Gmres { restart: 30 }, preconditioner, tolerance: 1e-12, ..cg };
    let newton = NewtonCase {
        tolerance: 1e-9,
        max_iterations: 30,
        line_search: false,
        displacement_tolerance: Some(1e-5),
        energy_tolerance: None,
        start: StepStart::Prescribed,
        solver: Some(SolverCase { method: Method::Iterative(cg), fixed_tolerance: true }),
    };
    assert_eq!(case.newton, newton);
    assert_eq!(
        case.micro,
        RveParams {
            tolerance: 1e-11,
            max_iterations: 60,
            max_cuts: 5,
            stages: Stages::of(&[Stage::Newton, Stage::Cuts]),
            predictor: false,
            solver: Method::Iterative(gmres),
            device: None,
            lanes: LaneUse::Mixed,
        }
    );
    assert_eq!(case.scales, ScalesCase { micro_ranks: 3, near: true, ..ScalesCase::default() });
    assert_eq!(case.output.directory, folder.path().join("out/pull"));
    assert!(case.output.points);
    assert_eq!((case.output.every, case.output.checkpoint), (5, 2));
    assert_eq!(case.output.rve, ElementSelection::Elements(vec![0, 17]));

    assert!(warnings.is_empty(), "{warnings:?}");
}

#[test]
fn defaults_fill_in() {
    let folder = Folder::new();
    let CaseFile { case, warnings } = folder.parse(SMALL).unwrap();
    assert!(warnings.is_empty());
    assert_eq!((case.title.as_str(), case.mesh_scale), ("pull", 1.0));
    assert_eq!(case.mesh, MeshSource::Dogbone { element_size: 0.002 });
    assert_eq!(case.steps, StepsCase { count: 10, max_cuts: 6, adaptive: None });
    let newton = NewtonCase {
        tolerance: 1e-8,
        max_iterations: 25,
        line_search: true,
        displacement_tolerance: None,
        energy_tolerance: None,
        start: StepStart::Tangent,
        solver: None,
    };
    assert_eq!(case.newton, newton);
    assert_eq!(
        case.micro,
        RveParams {
            tolerance: 1e-10,
            max_iterations: 50,
            max_cuts: 6,
            stages: Stages::default(),
            predictor: true,
            solver: Method::Direct,
            device: None,
            lanes: LaneUse::Auto,
        }
    );
    assert_eq!(case.scales, ScalesCase::default());
    let directory = folder.path().join("results");
    assert_eq!(case.output, OutputCase { directory, ..OutputCase::default() });
}

#[test]
fn elements_and_their_order_are_read() {
    let read = |keys: &str| {
        let text = SMALL.replace("generate = { shape = \"dogbone\", element_size = 0.002 }", keys);
        Folder::new().parse(&text).unwrap_or_else(|errors| panic!("{errors}")).case
    };
    let boxed = "generate = { shape = \"box\", cells = [1, 2, 3], size = [1, 1, 1], element = \"hex8\" }";
    let case = read(&format!("{boxed}\norder = 2"));
    let (cells, size, element) = ([1, 2, 3], [1.0; 3], ElementType::Hex8);
    assert_eq!(case.mesh, MeshSource::Box { cells, size, element });
    assert_eq!(case.quadratic, Some(QuadraticCase { hexahedra: QuadraticHexahedron::Serendipity, line: 3 }));
    let case = read(&format!("hexahedra = 27\n{boxed}\norder = 2"));
    assert_eq!(case.quadratic, Some(QuadraticCase { hexahedra: QuadraticHexahedron::Triquadratic, line: 4 }));
    assert_eq!(read(&format!("{boxed}\norder = 1")).quadratic, None);
    let lengths = "inner_radius = 3, outer_radius = 4.5, length = 50";
    let case = read(&format!("generate = {{ shape = \"tube\", cells = [2, 16, 20], {lengths} }}\norder = 2"));
    let (shape, element) = (TubeShape { inner_radius: 3.0, outer_radius: 4.5, length: 50.0 }, ElementType::Tet4);
    assert_eq!(case.mesh, MeshSource::Tube { cells: [2, 16, 20], shape, element });
    assert_eq!(case.quadratic.map(|each| each.line), Some(3));
    let case = read("generate = { shape = \"dogbone\", element_size = 0.002 }\norder = 2");
    assert_eq!(case.quadratic.map(|each| each.hexahedra), Some(QuadraticHexahedron::Serendipity));
}

#[test]
fn output_of_networks_warns_if_there_are_none() {
    let folder = Folder::new();
    let warnings = folder.parse(&format!("{SMALL}[output]\nrve = \"all\"\n")).unwrap().warnings;
    let said = "`output.rve` has no effect: no region has the model \"fiber-rve\"";
    assert_eq!(warnings, [format!("{}:6: {said}", folder.case().display())]);
}

#[test]
fn keys_of_a_balance_without_a_planner_warn() {
    let folder = Folder::new();
    let case =
        |balance: &str| folder.parse(&format!("{SMALL}[scales]\nmicro = 3\nbalance = {{ {balance} }}\n")).unwrap();
    let read = case("planner = \"none\", when = \"step\"");
    let said = "`scales.balance.when` has no effect: with `planner = \"none\"`, RVEs stay where they are";
    assert_eq!(read.warnings, [format!("{}:8: {said}", folder.case().display())]);
    assert_eq!(read.case.scales.balance, None);
    assert!(case("planner = \"none\"").warnings.is_empty() && case("when = \"step\"").warnings.is_empty());
}

#[test]
fn networks_are_found_sorted_and_each_once() {
    let folder = Folder::new();
    let odd = folder.path().join("networks/odd [1]*.txt");
    std::fs::write(&odd, "").unwrap();
    let [a, b] = ["networks/a.txt", "networks/b.txt"].map(|name| folder.path().join(name));
    let absolute = format!("\"{}/networks/?.txt\"", folder.path().display());
    for (networks, expected) in [
        ("\"networks/b.txt\"", vec![&b]),
        ("[\"networks/b.txt\", \"networks/*.txt\"]", vec![&a, &b, &odd]),
        ("[\"networks/[ab].*\", \"networks/a.txt\"]", vec![&a, &b]),
        ("\"networks/odd [1]*.txt\"", vec![&odd]),
        ("\"**/a.txt\"", vec![&a]),
        (&absolute, vec![&a, &b]),
    ] {
        let text = SMALL.replace(
            "model = \"neo-hookean\", shear_modulus = 1.0e5, lame_lambda = 2.0e5",
            &format!("model = \"fiber-rve\", scale = \"raw\", networks = {networks}"),
        );
        let case = folder.parse(&text).unwrap_or_else(|errors| panic!("{errors}")).case;
        let RegionMaterial::FiberRve(rve) = &case.regions[0].material else { panic!("not a fiber RVE") };
        assert_eq!(rve.networks.iter().collect::<Vec<_>>(), expected, "{networks}");
        assert_eq!((&rve.assignment, rve.seed, &rve.scale), (&NetworkAssignment::Random, 1, &StressScale::Raw.into()));
        assert_eq!(rve.law, None);
    }
}

#[test]
fn pattern_characters_in_a_folder_name_are_literal() {
    let folder = Folder::new();
    let odd = folder.path().join("odd [x] folder");
    std::fs::create_dir(&odd).unwrap();
    std::fs::write(odd.join("n.txt"), "").unwrap();
    let text = SMALL.replace(
        "model = \"neo-hookean\", shear_modulus = 1.0e5, lame_lambda = 2.0e5",
        "model = \"fiber-rve\", scale = \"raw\", networks = \"*.txt\"",
    );
    let case = Case::parse(&text, &odd.join("case.toml")).unwrap().case;
    let RegionMaterial::FiberRve(rve) = &case.regions[0].material else { panic!("not a fiber RVE") };
    assert_eq!(rve.networks, [odd.join("n.txt")]);
}

/// Returns `mu` and `lambda` of a material with the given entries.
fn constants(entries: &str) -> (f64, f64) {
    let text = SMALL.replace("shear_modulus = 1.0e5, lame_lambda = 2.0e5", entries);
    match Folder::new().parse(&text).unwrap().case.regions[0].material {
        RegionMaterial::Formula(FormulaCase::Constant(Formula::NeoHookean(NeoHookean { mu, lambda }))) => (mu, lambda),
        ref other => panic!("{other:?}"),
    }
}

#[test]
fn any_two_elastic_constants_give_the_same_material() {
    // E = 2.5 and nu = 0.25 give mu = lambda = 1; E = 0.9 and nu = -0.25 give mu = 0.6, lambda = -0.2.
    for (e, nu, mu, lambda) in [(2.5, 0.25, 1.0, 1.0), (0.9, -0.25, 0.6, -0.2), (2.999, 0.4995, 1.0, 999.0)] {
        let e = format!("youngs_modulus = {e}");
        let nu = format!("poisson_ratio = {nu}");
        let g = format!("shear_modulus = {mu}");
        let l = format!("lame_lambda = {lambda}");
        for pair in [[&e, &nu], [&e, &g], [&e, &l], [&nu, &g], [&nu, &l], [&g, &l]] {
            let (mu_found, lambda_found) = constants(&format!("{}, {}", pair[0], pair[1]));
            assert!((mu_found - mu).abs() < 1e-10 * mu, "{pair:?}: mu = {mu_found}");
            assert!((lambda_found - lambda).abs() < 1e-9 * lambda.abs(), "{pair:?}: lambda = {lambda_found}");
        }
    }
}

#[test]
fn file_is_read_from_disk() {
    let folder = Folder::new();
    std::fs::write(folder.case(), FULL).unwrap();
    assert_eq!(Case::read(&folder.case()), folder.parse(FULL));
    let text = Case::read(&folder.path().join("absent.toml")).unwrap_err().to_string();
    assert!(text.contains("absent.toml: cannot be read"), "{text}");
    std::fs::write(folder.case(), b"title = \"a\"\n# \xff\n").unwrap();
    let text = Case::read(&folder.case()).unwrap_err().to_string();
    assert!(text.contains("pull.toml:2: byte 0xff is not UTF-8 text"), "{text}");
}
