//! Runs the example of the README in full: 20 load steps to more than 40 % extension, with balanced forces in each.
//!
//! The extensions do not validate the model: the traction of the example was chosen to give those of figure 3.3 of the
//! thesis, which does not state its load. The test only detects a change of the extensions.
use std::path::Path;

use biotissue::app::case::Case;
use biotissue::app::results::log::Event;
use biotissue::app::results::{Collection, LOADS_FILE, LOG_FILE, Loads, log, read_vtu};
use biotissue::app::run::Simulation;
use biotissue::backends::sparse::Sparse;

#[test]
fn regression_the_dogbone_has_the_recorded_extensions_and_balanced_forces() {
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("examples/dogbone/dogbone.toml");
    let case = Case::read(&file).unwrap_or_else(|errors| panic!("{errors}")).case;
    let dir = tempfile::tempdir().unwrap();
    let mut simulation = Simulation::<Sparse>::new((), case).unwrap_or_else(|error| panic!("{error}"));

    let size = simulation.problem_size();
    assert!(size.elements >= 2000 && size.rves == size.elements);
    assert_eq!(size.networks.len(), 8);
    assert_eq!(size.networks.iter().map(|network| network.rves).sum::<usize>(), size.rves);
    let [lower, upper] = simulation.mesh().bounding_box();
    let length = upper[0] - lower[0];
    simulation.run(dir.path(), &mut ()).unwrap_or_else(|error| panic!("{error}"));

    let loads = Loads::read(&dir.path().join(LOADS_FILE)).unwrap();
    assert_eq!(loads.rows.len(), 20);
    let right = loads.names.surfaces.iter().position(|name| name == "right").unwrap();
    for row in &loads.rows {
        let pull = row.surfaces[right].force[0];
        assert!(pull > 0.0);
        for component in 0..3 {
            let sum: f64 = row.surfaces.iter().map(|surface| surface.force[component]).sum();
            assert!(sum.abs() < 1e-9 * pull, "step {}: forces sum to {sum:e} N of {pull:e} N", row.step);
        }
    }
    // The traction was chosen to give these extensions: approximately 27 % after ten load steps and 45 % after twenty.
    let extension = |step: usize| loads.rows[step - 1].surfaces[right].displacement[0] / length;
    assert!((extension(10) - 0.27).abs() < 0.02, "{}", extension(10));
    assert!((extension(20) - 0.45).abs() < 0.02, "{}", extension(20));

    let events = log::read(&dir.path().join(LOG_FILE)).unwrap();
    let iterations: Vec<usize> = events
        .iter()
        .filter_map(|e| if let Event::Step(step) = e { Some(step.newton.iterations) } else { None })
        .collect();
    assert_eq!(iterations.len(), 20);
    assert!(iterations.iter().all(|&n| (1..=8).contains(&n)), "{iterations:?}");
    assert!(matches!(events.last(), Some(Event::End(end)) if end.converged));

    assert_fibers_rotate_toward_the_load(dir.path());
}

/// Checks that the mean of `n_x^2` over the fiber directions `n` increases.
fn assert_fibers_rotate_toward_the_load(dir: &Path) {
    let collection = Collection::read(dir.join("fields.pvd")).unwrap();
    let along_x = |entry: usize| {
        let fields = read_vtu(&dir.join(&collection.entries()[entry].file)).unwrap();
        let orientation = fields.cell_tensor("fiber_orientation").unwrap();
        orientation.iter().map(|omega| omega[0]).sum::<f64>() / orientation.len() as f64
    };
    let (first, last) = (along_x(0), along_x(collection.entries().len() - 1));
    assert!(last > first + 0.1 && last > 0.45, "mean n_x^2 from {first} to {last}");
}
