//! A sweep over RVEs, some of which have no equilibrium.

use biotissue::app::case::Case;
use biotissue::app::macro_scale;
use biotissue::backends::sparse::Sparse;
use biotissue::fem::point_field::{PointField, PointResponses};
use biotissue::tissue::micro_scale::{TissueField, TissueMaterial};
use nalgebra::Matrix3;
use rayon::ThreadPoolBuilder;

const CASE: &str = r#"
    [mesh]
    generate = { shape = "box", cells = [2, 2, 2], size = [1.0, 1.0, 1.0] }
    [[region]]
    name = "*"
    [region.material]
    model = "fiber-rve"
    networks = ["NETWORK"]
    fiber_volume_fraction = 0.003
    law = { name = "exponential", youngs_modulus = 1.0e8, radius = 5.0e-8, nonlinearity = 1.2 }
    [[boundary]]
    surface = "x0"
    displacement = { x = 0.0, y = 0.0, z = 0.0 }
    [steps]
    count = 1
"#;

/// Returns the responses of an update that follows a failed one, in which elements 3, 5 and 40 were stretched
/// excessively, and the error of the failed update.
fn after_a_failure(threads: usize) -> (PointResponses, String) {
    let dir = tempfile::tempdir().unwrap();
    let file = dir.path().join("case.toml");
    let network = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/networks/frozen.txt");
    std::fs::write(&file, CASE.replace("NETWORK", &network.display().to_string())).unwrap();
    let case = Case::read(&file).unwrap_or_else(|errors| panic!("{errors}")).case;
    let (mesh, _) = macro_scale::mesh(&case).unwrap();
    let pool = ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
    pool.install(|| {
        let (mut field, _) =
            TissueField::<Sparse>::new((), case.materials().unwrap(), &mesh).unwrap_or_else(|error| panic!("{error}"));
        let mut out = PointResponses::default();
        let stretched = |by: f64| Matrix3::new(by, 0.01, 0.0, 0.0, 0.98, 0.0, 0.02, 0.0, 1.01);
        let mut gradients: Vec<Matrix3<f64>> =
            (0..mesh.elements().len()).map(|k| stretched(1.05 + 1e-3 * k as f64)).collect();
        for element in [3, 5, 40] {
            gradients[element] = stretched(60.0);
        }
        let error = field.update(&gradients, &mut out).unwrap_err().to_string();
        assert_eq!(field.take_stats().solves, 4, "only elements up to the first failing one count");
        field.update(&vec![stretched(1.1); gradients.len()], &mut out).unwrap();
        assert!(field.take_failed_rve().is_none(), "the failure is over");
        (out, error)
    })
}

#[test]
fn a_sweep_ends_at_the_first_failing_rve_on_any_number_of_threads() {
    let (alone, error) = after_a_failure(1);
    assert!(error.starts_with("element 3 (network frozen"), "{error}");
    assert!(error.contains("the fiber forces are excessive: at stretch ") && error.contains("units"), "{error}");
    for threads in [2, 4] {
        assert_eq!(after_a_failure(threads), (alone.clone(), error.clone()), "{threads} threads");
    }
}
