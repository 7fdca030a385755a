use std::path::Path;

use nalgebra::Matrix3;

use super::*;
use crate::app::case::Case;
use crate::app::macro_scale;
use crate::app::run::{ResumeError, Simulation};
use crate::backends::sparse::Sparse;
use crate::checksum::Fnv;
use crate::fiber::rve::Rve;
use crate::tissue::micro_scale::TissueField;

/// A cube with one network in every element, and two load steps.
const CASE: &str = r#"
[mesh]
generate = { shape = "box", cells = [1, 1, 1], size = [1.0, 1.0, 1.0] }
[[region]]
name = "*"
material = { model = "fiber-rve", networks = ["NETWORK"], scale = "raw" }
[[boundary]]
surface = "x0"
displacement = { x = 0.0, y = 0.0, z = 0.0 }
[[boundary]]
surface = "x1"
displacement = { x = 0.02, y = 0.0, z = 0.0 }
[steps]
count = 2
"#;

fn case() -> Case {
    let network = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/networks/frozen.txt");
    let text = CASE.replace("NETWORK", network.to_str().unwrap());
    Case::parse(&text, Path::new("/nowhere/cube.toml")).unwrap_or_else(|errors| panic!("{errors}")).case
}

fn simulation() -> Simulation<Sparse> {
    Simulation::new((), case()).unwrap_or_else(|error| panic!("{error}"))
}

/// Returns a result directory with only the checkpoint of step 2, and the bytes of that checkpoint.
fn directory() -> (tempfile::TempDir, PathBuf, Vec<u8>) {
    let dir = tempfile::tempdir().unwrap();
    simulation().run(dir.path(), &mut ()).unwrap_or_else(|error| panic!("{error}"));
    let folder = dir.path().join(CHECKPOINT_FOLDER);
    fs::remove_file(folder.join(file_name(1))).unwrap();
    let path = folder.join(file_name(2));
    let bytes = fs::read(&path).unwrap();
    (dir, path, bytes)
}

/// Returns the bytes of a file with this content and the correct hash.
fn sealed(body: &[u8]) -> Vec<u8> {
    let mut hash = Fnv::new();
    hash.add_bytes(body);
    [body, &hash.finish().to_le_bytes()].concat()
}

#[test]
fn a_file_cut_short_anywhere_is_damaged() {
    let (_dir, path, bytes) = directory();
    assert!(file::read::<Record>(&path).is_ok());
    for len in (0..bytes.len()).filter(|len| len % 41 == 0 || *len < 64 || bytes.len() - len < 64) {
        fs::write(&path, &bytes[..len]).unwrap();
        let error = file::read::<Record>(&path).err().unwrap();
        assert!(matches!(error, CheckpointError::Damaged { .. }), "{len} bytes: {error}");
    }
    fs::write(&path, [&bytes[..], &[0]].concat()).unwrap();
    assert!(file::read::<Record>(&path).is_err(), "a byte too many");
}

#[test]
fn a_changed_byte_anywhere_is_damage() {
    let (_dir, path, bytes) = directory();
    for at in (0..bytes.len()).filter(|at| at % 37 == 0 || *at < 64 || bytes.len() - at < 16) {
        for flip in [0x01, 0x80, 0xff] {
            let mut changed = bytes.clone();
            changed[at] ^= flip;
            fs::write(&path, &changed).unwrap();
            let error = file::read::<Record>(&path).err().unwrap();
            assert!(matches!(error, CheckpointError::Damaged { .. }), "byte {at}: {error}");
        }
    }
}

#[test]
fn damage_with_a_matching_hash_never_panics() {
    let (dir, path, bytes) = directory();
    let body = &bytes[..bytes.len() - 8];
    let (mut simulation, mut refused) = (simulation(), 0);
    let mut outcomes = |changed: &[u8]| {
        fs::write(&path, sealed(changed)).unwrap();
        if let Err(error) = simulation.resume(dir.path()) {
            refused += 1;
            assert!(!error.to_string().is_empty());
        }
    };
    for at in (8..body.len()).filter(|at| at % 97 == 0 || *at < 24 || (600..1400).contains(at) && at % 3 == 0) {
        for value in [0x00, 0x7f, 0xff] {
            let mut changed = body.to_vec();
            changed[at] = value;
            outcomes(&changed);
            // A count that is too large for any file.
            changed[at..].iter_mut().take(9).for_each(|byte| *byte = 0xff);
            outcomes(&changed);
        }
        outcomes(&body[..at]);
    }
    assert!(refused > 100, "{refused}");
}

#[test]
fn another_version_of_the_format_is_named() {
    let (dir, path, bytes) = directory();
    let mut body = bytes[..bytes.len() - 8].to_vec();
    body[8] += 1;
    fs::write(&path, sealed(&body)).unwrap();
    let error = simulation().resume(dir.path()).unwrap_err();
    assert!(
        matches!(error, ResumeError::Checkpoint(CheckpointError::Version { found: 7, expected: 6, .. })),
        "{error}"
    );
}

#[test]
fn a_state_that_does_not_fit_changes_nothing() {
    let (dir, _, _) = directory();
    let case = case();
    let (mesh, _) = macro_scale::mesh(&case).unwrap();
    let (mut field, _) = TissueField::<Sparse>::new((), case.materials(), &mesh).unwrap();
    let (found, _) = latest(dir.path(), &Identity::new("sparse", &case, &mesh, &field)).unwrap();
    let Checkpoint { state, statuses, units, .. } = found.unwrap();
    assert_eq!((state.completed_steps, units.len()), (2, 6));
    let before: Vec<UnitState> = field.unit_states().collect();

    let mut fewer = units.clone();
    fewer.pop();
    let mut bare = units.clone();
    bare[4].rve = None;
    let changed = |unit: usize, change: fn(&mut Matrix3<f64>, &mut Vec<[f64; 3]>)| {
        let mut units = units.clone();
        let rve = units[unit].rve.as_mut().unwrap();
        let (mut gradient, mut interior) = (*rve.gradient(), rve.interior().to_vec());
        change(&mut gradient, &mut interior);
        *rve = Rve::restored(gradient, interior, None);
        units
    };
    let short = changed(5, |_, interior| interior.truncate(2));
    let lost = changed(1, |_, interior| interior[3][2] = f64::NAN);
    let inverted = changed(2, |gradient, _| *gradient *= -1.0);
    let cases = [
        (fewer, "the state has 5 RVEs; this body has 6"),
        (bare, "element 4 has no fibers in the saved state, but has some here"),
        (short, "element 5: the state has positions of"),
        (lost, "element 1: the position of interior node 3 is not a finite number"),
        (inverted, "element 2: the deformation gradient has determinant -"),
    ];
    for (units, expected) in cases {
        let error = field.restore_units(&statuses, units).unwrap_err().to_string();
        assert!(error.starts_with(expected), "{error}");
        assert!(field.unit_states().eq(before.iter().cloned()));
    }
    field.restore_units(&statuses, units.clone()).unwrap();
    let after: Vec<UnitState> = field.unit_states().collect();
    assert!(after.iter().zip(&units).all(|(a, b)| a.rve == b.rve && a.response == b.response));
}
