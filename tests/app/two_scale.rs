//! The coupled scales: the interface between them, the result files, quadratic convergence, and agreement of all
//! backends.
use crate::bar_of_24;
use std::collections::{HashMap, HashSet};
use std::path::{Path, PathBuf};
use std::process::Command;

use biotissue::app::case::Case;
use biotissue::app::results::collection::field_file;
use biotissue::app::results::log::{Event, Step};
use biotissue::app::results::{LOADS_FILE, LOG_FILE, Loads, log, read_vtu};
use biotissue::app::run::Simulation;
use biotissue::backends::{dense::Dense, sparse::Sparse};
use biotissue::fem::mesh::gmsh;
use biotissue::las::RealBackend;

/// The results of a run.
struct Results {
    steps: Vec<Step>,
    loads: Loads,
    dir: tempfile::TempDir,
}

fn frozen() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/networks/frozen.txt")
}

/// Runs the case in `text` from a file in its own folder, after `prepare` has written the files that the case names.
fn run<B>(text: &str, prepare: impl FnOnce(&Path)) -> Results
where
    B: RealBackend<Context = ()>,
{
    let dir = tempfile::tempdir().unwrap();
    prepare(dir.path());
    let file = dir.path().join("case.toml");
    std::fs::write(&file, text).unwrap();
    let case = Case::read(&file).unwrap_or_else(|errors| panic!("{errors}")).case;
    let out = dir.path().join("results");
    let mut simulation = Simulation::<B>::new((), case).unwrap_or_else(|error| panic!("{error}"));
    simulation.run(&out, &mut ()).unwrap_or_else(|error| panic!("{error}"));
    let events = log::read(&out.join(LOG_FILE)).unwrap();
    let steps = events.into_iter().filter_map(|event| if let Event::Step(step) = event { Some(step) } else { None });
    Results { steps: steps.collect(), loads: Loads::read(&out.join(LOADS_FILE)).unwrap(), dir }
}

/// Returns the case of a box of 48 tetrahedra, with a network in each, which is extended by 20 % in two steps.
fn box_of_networks() -> String {
    box_of_networks_in("generate = { shape = \"box\", cells = [2, 2, 2], size = [1.0, 1.0, 1.0] }")
}

/// Returns the case of a box of elements of another type, with a network at each integration point.
fn box_of(element: &str, cells: [usize; 3], order: &str) -> String {
    let generated = "generate = { shape = \"box\", size = [1.0, 1.0, 1.0], cells = ";
    box_of_networks_in(&format!("{generated}{cells:?}, element = \"{element}\" }}\n        {order}"))
}

fn box_of_networks_in(mesh: &str) -> String {
    format!(
        r#"
        [mesh]
        {mesh}
        [[region]]
        name = "*"
        [region.material]
        model = "fiber-rve"
        networks = ["{}"]
        fiber_volume_fraction = 0.003
        law = {{ name = "exponential", youngs_modulus = 1.0e8, radius = 5.0e-8, nonlinearity = 1.2 }}
        matrix = {{ model = "neo-hookean", shear_modulus = 1000.0, poisson_ratio = 0.3 }}
        [[boundary]]
        surface = "x0"
        displacement = {{ x = 0.0, y = 0.0, z = 0.0 }}
        [[boundary]]
        surface = "x1"
        displacement = {{ x = 0.2, y = 0.05, z = 0.0 }}
        [steps]
        count = 2
        [newton]
        tolerance = 1e-12
        [micro]
        tolerance = 1e-14
        "#,
        frozen().display()
    )
}

#[test]
fn newton_converges_quadratically_with_a_network_at_every_element() {
    assert_quadratic(&run::<Sparse>(&box_of_networks(), |_| ()));
}

/// Checks the order of convergence of the last three residuals above the tolerance of each step.
fn assert_quadratic(results: &Results) {
    assert_eq!(results.steps.len(), 2);
    for step in &results.steps {
        let above: Vec<f64> = step.newton.relative.iter().copied().filter(|&r| r > 1e-12).collect();
        let [.., r1, r2, r3] = above.as_slice() else { panic!("too few residuals: {:?}", step.newton.relative) };
        let order = (r3 / r2).ln() / (r2 / r1).ln();
        assert!(order >= 1.8, "step {}: order {order:.2} from {above:?}", step.step);
    }
}

/// The history does not depend on the number of threads, bit for bit.
#[test]
fn newton_converges_quadratically_with_a_network_at_every_point_of_other_elements() {
    for (element, cells, order) in [
        ("tet4", [1, 1, 1], "order = 2"),
        ("hex8", [2, 1, 1], ""),
        ("hex8", [1, 1, 1], "order = 2"),
        ("wedge6", [2, 1, 1], ""),
    ] {
        let text = box_of(element, cells, order);
        let on = |threads| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| run::<Sparse>(&text, |_| ()))
        };
        let (results, others) = (on(1), on(3));
        assert_quadratic(&results);
        assert_eq!(results.loads, others.loads, "{element} {order}: bit for bit");
    }
}

#[test]
fn backends_agree_on_a_box_of_networks() {
    let sparse = run::<Sparse>(&box_of_networks(), |_| ());
    let dense = run::<Dense>(&box_of_networks(), |_| ());
    assert_loads_agree(&sparse.loads, &dense.loads, 1e-10);
}

/// Both scales use Krylov methods: the macro scale with diagonal preconditioning, the RVEs with an incomplete
/// factorization.
#[test]
fn iterative_solvers_agree_with_direct_ones() {
    let direct = run::<Sparse>(&box_of_networks(), |_| ());
    let newton = "[newton]\n        solver = { method = \"cg\", preconditioner = \"diagonal\", tolerance = 1e-13 }";
    let micro = "[micro]\n        solver = { method = \"gmres\", drop_tolerance = 1e-3, fill = 20, tolerance = 1e-14 }";
    let text = box_of_networks().replace("[newton]", newton).replace("[micro]", micro);
    let iterative = run::<Sparse>(&text, |_| ());
    assert_loads_agree(&direct.loads, &iterative.loads, 1e-9);
    for step in &iterative.steps {
        assert!(step.newton.linear_iterations > step.newton.iterations, "{:?}", step.newton);
        assert_eq!(step.newton.factorizations.cholesky, 0);
    }
}

fn assert_loads_agree(some: &Loads, others: &Loads, tolerance: f64) {
    for (a, b) in some.rows.iter().zip(&others.rows) {
        let pull = norm(&a.surfaces[1].force);
        assert!(pull > 0.0);
        for (surface, (a, b)) in some.names.surfaces.iter().zip(a.surfaces.iter().zip(&b.surfaces)) {
            assert!(norm(&minus(a.force, b.force)) < tolerance * pull, "{surface}: {:?} {:?}", a.force, b.force);
            assert!(norm(&minus(a.displacement, b.displacement)) < tolerance, "{surface}");
        }
    }
    assert_eq!((some.rows.len(), others.rows.len()), (2, 2));
}

#[test]
fn results_do_not_depend_on_the_number_of_threads() {
    let on = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| run::<Sparse>(&box_of_networks(), |_| ()).loads)
    };
    assert_eq!(on(1), on(3), "bit for bit");
}

fn minus(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [0, 1, 2].map(|i| a[i] - b[i])
}

fn norm(a: &[f64; 3]) -> f64 {
    a.iter().map(|x| x * x).sum::<f64>().sqrt()
}

fn write_bar(dir: &Path) {
    gmsh::write(&dir.join("bar.msh"), &bar_of_24::mesh()).unwrap();
}

fn bar(material: &str) -> String {
    format!(
        r#"
        [mesh]
        file = "bar.msh"
        [[region]]
        name = "body"
        material = {material}
        [[boundary]]
        surface = "left"
        displacement = {{ x = 0.0 }}
        [[boundary]]
        surface = "right"
        displacement = {{ x = 0.5 }}
        [[point]]
        node = 6
        displacement = {{ x = 0.0, y = 0.0, z = 0.0 }}
        [[point]]
        node = 5
        displacement = {{ z = 0.0 }}
        [steps]
        count = 10
        [newton]
        tolerance = 1e-10
        start = "held"
        "#
    )
}

#[test]
fn neo_hookean_rves_give_the_recorded_residuals_of_the_material_model() {
    let constants = r#"{ model = "neo-hookean", youngs_modulus = 10000.0, poisson_ratio = 0.3 }"#;
    let formula = run::<Sparse>(&bar(constants), write_bar);
    let rves =
        run::<Sparse>(&bar(&format!("{{ model = \"fiber-rve\", networks = [], matrix = {constants} }}")), write_bar);
    assert_eq!(rves.loads, formula.loads, "bit for bit");
    for results in [&formula, &rves] {
        assert_eq!(results.steps.len(), 10);
        for (step, (recorded, _)) in results.steps.iter().zip(bar_of_24::RECORDED) {
            let found = &step.newton.residuals;
            assert_eq!(found.len(), recorded.len() + 1, "one further residual is below the tolerance");
            for (found, recorded) in found.iter().zip(recorded) {
                // The terms that cancel in a residual are of the order of 1e3, so that a residual of 1e-3 has six
                // significant digits fewer.
                let digits = if *recorded > 1e-2 { 1e-10 } else { 1e-8 };
                assert!((found - recorded).abs() < digits * recorded, "step {}: {found} {recorded}", step.step);
            }
        }
        let forces: f64 = results.loads.rows[9].surfaces.iter().map(|s| s.force[0]).sum();
        assert!(forces.abs() < 1e-9 * results.loads.rows[9].surfaces[0].force[0].abs());
    }
    assert!(rves.steps[0].rve.is_some() && formula.steps[0].rve.is_none());
}

/// The bits of every number of an array, by reader and name.
type Arrays = HashMap<(String, String), Vec<[u8; 8]>>;

/// Returns the output of `tests/read_vtu.py` for a file: the numbers of every array by reader and name; `None` if
/// Python or its readers are missing and not required.
fn read_by_python(file: &Path) -> Option<Arrays> {
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/read_vtu.py");
    let required = std::env::var("BIOTISSUE_REQUIRE_PYTHON").is_ok_and(|value| value == "1");
    let output = match Command::new("python3").arg(script).arg(file).output() {
        Ok(output) if output.status.code() != Some(3) => output,
        missing if required => panic!("python3 with meshio or vtk is required: {missing:?}"),
        _ => {
            crate::skip::skip("needs python3 with meshio or vtk");
            return None;
        }
    };
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let bytes = |hex: &str| std::array::from_fn(|k| u8::from_str_radix(&hex[2 * k..2 * k + 2], 16).unwrap());
    let text = String::from_utf8(output.stdout).unwrap();
    let arrays = text.lines().map(|line| {
        let words: Vec<&str> = line.split(' ').collect();
        ((words[0].to_owned(), words[2].to_owned()), words[4..].iter().map(|hex| bytes(hex)).collect())
    });
    Some(arrays.collect())
}

#[test]
fn an_independent_reader_finds_the_fields_of_a_run() {
    let results = run::<Sparse>(&box_of_networks(), |_| ());
    let file = results.dir.path().join("results").join(field_file(2));
    let Some(arrays) = read_by_python(&file) else { return };
    let own = read_vtu(&file).unwrap();
    let readers: HashSet<&str> = arrays.keys().map(|(reader, _)| reader.as_str()).collect();
    for reader in readers {
        let array = |name: &str| {
            arrays.get(&(reader.to_owned(), name.to_owned())).unwrap_or_else(|| panic!("{reader} finds no {name}"))
        };
        let reals = |name: &str| array(name).iter().map(|&bits| f64::from_le_bytes(bits)).collect::<Vec<_>>();
        let whole = |name: &str| array(name).iter().map(|&bits| i64::from_le_bytes(bits)).collect::<Vec<_>>();
        assert_eq!(reals("displacement"), own.point_vector("displacement").unwrap().as_flattened());
        assert_eq!(reals("cauchy_stress"), own.cell_tensor("cauchy_stress").unwrap().as_flattened());
        assert!(reals("displacement").contains(&0.2), "the pulled surface has moved");
        assert!(reals("fiber_direction").chunks(3).all(|n| (n.iter().map(|x| x * x).sum::<f64>() - 1.0).abs() < 1e-12));
        for f in reals("deformation_gradient").chunks(9) {
            assert!(nalgebra::Matrix3::from_row_slice(f).determinant() > 0.0);
        }
        for omega in reals("fiber_orientation").chunks(9) {
            assert!((omega[0] + omega[4] + omega[8] - 1.0).abs() < 1e-12);
        }
        assert!(whole("rve_iterations").iter().all(|&n| n >= 1), "{:?}", whole("rve_iterations"));
        assert!(whole("rve_status").iter().chain(&whole("network")).chain(&whole("rank")).all(|&n| n == 0));
        assert!(reals("energy_density").iter().chain(&reals("von_mises_stress")).all(|&w| w > 0.0));
        assert!(
            reals("stretch_max").iter().zip(reals("stretch_min")).all(|(&most, least)| most > least && least > 0.0)
        );
    }
}
