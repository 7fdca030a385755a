//! The memory that an RVE of a run occupies, counted by the allocator.

use std::path::Path;

use biotissue::app::case::Case;
use biotissue::app::macro_scale;
use biotissue::backends::sparse::Sparse;
use biotissue::fem::point_field::{PointField, PointResponses};
use biotissue::tissue::micro_scale::{TissueField, TissueMaterial};
use nalgebra::Matrix3;

use crate::counting;
use crate::networks::published_file;

fn case(network: &Path, cells: usize) -> String {
    format!(
        r#"
        [mesh]
        generate = {{ shape = "box", cells = [{cells}, 2, 2], size = [1.0, 1.0, 1.0] }}
        [[region]]
        name = "*"
        [region.material]
        model = "fiber-rve"
        networks = ["{}"]
        fiber_volume_fraction = 0.003
        law = {{ name = "exponential", youngs_modulus = 1.0e8, radius = 5.0e-8, nonlinearity = 1.2 }}
        [[boundary]]
        surface = "x0"
        displacement = {{ x = 0.0, y = 0.0, z = 0.0 }}
        [steps]
        count = 1
        "#,
        network.display()
    )
}

/// Returns the number of RVEs of a box with this number of cells along x, and the bytes of their field in the middle of
/// a load step: those counted by the allocator, and those that the field reports.
fn field(network: &Path, cells: usize) -> (f64, f64, f64) {
    let dir = tempfile::tempdir().unwrap();
    let file = dir.path().join("case.toml");
    std::fs::write(&file, case(network, cells)).unwrap();
    let case = Case::read(&file).unwrap_or_else(|errors| panic!("{errors}")).case;
    let (mesh, _) = macro_scale::mesh(&case).unwrap();
    let before = counting::in_use();
    let (mut field, _) =
        TissueField::<Sparse>::new((), case.materials().unwrap(), &mesh).unwrap_or_else(|error| panic!("{error}"));
    let planned = field.rve_bytes();
    let mut out = PointResponses::default();
    for k in 0..2 {
        let gradient = Matrix3::new(1.05, 0.01, 0.0, 0.0, 0.98, 0.0, 0.02, 0.0, 1.01) * (1.0 + 0.01 * f64::from(k));
        field.update(&vec![gradient; mesh.elements().len()], &mut out).unwrap_or_else(|error| panic!("{error}"));
        assert_eq!(field.rve_bytes(), planned, "the memory does not change during a run");
        if k == 0 {
            field.commit(true).unwrap();
        }
    }
    drop(out);
    (field.sites().rves() as f64, (counting::in_use() - before) as f64, planned as f64)
}

#[test]
fn an_rve_of_336_nodes_takes_less_than_12_kb() {
    let Some(network) = published_file("Network_2_7.txt") else { return };
    // One thread, so that both fields have the same number of workspaces and every allocation is counted.
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap();
    // The first field allocates the memory of lanes, which belongs to the thread.
    let [_, few, many] = [4, 4, 40].map(|cells| pool.install(|| field(&network, cells)));
    let rves = many.0 - few.0;
    let (counted, reported) = ((many.1 - few.1) / rves, (many.2 - few.2) / rves);
    println!("{counted:.0} bytes per RVE counted by the allocator, {reported:.0} reported by the field");
    assert!(counted <= 12_000.0, "{counted:.0} bytes");
    assert!((counted - reported).abs() < 0.02 * counted, "{counted:.0} counted, {reported:.0} reported");
}

/// Writing and reading a checkpoint holds one state at a time, besides an index.
#[test]
fn pieces_of_a_checkpoint_are_written_and_read_one_state_at_a_time() {
    let dir = tempfile::tempdir().unwrap();
    let network = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/networks/frozen.txt");
    let case = Case::parse(&case(&network, 20), &dir.path().join("case.toml")).unwrap().case;
    let (mesh, _) = macro_scale::mesh(&case).unwrap();
    let new = || TissueField::<Sparse>::new((), case.materials().unwrap(), &mesh).unwrap().0;
    let mut field = new();
    let gradient = Matrix3::new(1.05, 0.01, 0.0, 0.0, 0.98, 0.0, 0.02, 0.0, 1.01);
    field.update(&vec![gradient; mesh.elements().len()], &mut PointResponses::default()).unwrap();
    field.commit(true).unwrap();
    let peak_of = |work: &mut dyn FnMut()| {
        let before = counting::in_use();
        counting::start_peak();
        work();
        counting::peak() - before
    };
    let mut pieces = Vec::new();
    let written = peak_of(&mut || pieces = field.save_units(dir.path(), "step-00001").unwrap());
    let bytes = pieces[0].bytes as isize;
    assert!(pieces[0].rves == 480 && bytes > 800_000, "{pieces:?}");
    let verified = peak_of(&mut || field.verify_pieces(dir.path(), &pieces).unwrap());
    let mut other = new();
    let before = counting::in_use();
    let restored = peak_of(&mut || other.restore_units(&field.sites().saved(), dir.path(), &pieces).unwrap());
    let kept = counting::in_use() - before;
    // The restored RVEs own predictions, which those at rest do not.
    assert!(written < bytes / 8 && verified < bytes / 8, "{written} {verified} of {bytes}");
    assert!(restored - kept < bytes / 4, "{restored} bytes at most, {kept} kept, of {bytes}");
}
