use std::path::Path;

use super::*;
use crate::app::case::Case;
use crate::app::macro_scale;
use crate::app::run::{ResumeError, Simulation};
use crate::backends::sparse::Sparse;
use crate::checksum::Fnv;
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

/// Returns a result directory with only the checkpoint of step 2, and the bytes of its main file.
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

/// Returns the newest checkpoint of the case in a directory.
fn newest(dir: &Path) -> Result<Option<Checkpoint>, CheckpointError> {
    let case = case();
    let (mesh, _) = macro_scale::mesh(&case).unwrap();
    let (field, _) = TissueField::<Sparse>::new((), case.materials().unwrap(), &mesh).unwrap();
    latest(dir, usize::MAX, &Identity::new("sparse", &case, (hash_of_mesh(&mesh), None), &field))
        .map(|(found, _)| found)
}

#[test]
fn a_checkpoint_lists_its_pieces() {
    let (dir, path, _) = directory();
    let found = newest(dir.path()).unwrap().unwrap();
    assert_eq!(
        (found.path.as_path(), found.folder(), found.state.completed_steps),
        (&*path, path.parent().unwrap(), 2)
    );
    let [Piece { file, bytes, rves: 6, .. }] = &found.pieces[..] else { panic!("{:?}", found.pieces) };
    assert_eq!(fs::metadata(found.folder().join(file)).unwrap().len(), *bytes);
    let [BodyStatePiece { file, bytes, nodes: 8, points: 6, .. }] = &found.body[..] else { panic!("{:?}", found.body) };
    assert_eq!(fs::metadata(found.folder().join(file)).unwrap().len(), *bytes);
}

#[test]
fn a_main_file_cut_short_or_changed_anywhere_is_damaged() {
    let (dir, path, bytes) = directory();
    let damaged = |bytes: &[u8]| {
        fs::write(&path, bytes).unwrap();
        let error = newest(dir.path()).unwrap_err();
        assert!(matches!(error, CheckpointError::Damaged { .. }), "{error}");
    };
    for at in (0..bytes.len()).filter(|at| at % 41 == 0 || bytes.len() - at < 10) {
        damaged(&bytes[..at]);
        let mut changed = bytes.clone();
        changed[at] ^= 0x80;
        damaged(&changed);
    }
    damaged(&[&bytes[..], &[0]].concat());
}

/// A machine that does not find the piece of a rank cannot resume either.
#[test]
fn a_piece_must_be_visible_to_the_rank_that_lists_it() {
    let (dir, path, _) = directory();
    let Checkpoint { state, body, pieces, written, .. } = newest(dir.path()).unwrap().unwrap();
    let case = case();
    let (mesh, _) = macro_scale::mesh(&case).unwrap();
    let (field, _) = TissueField::<Sparse>::new((), case.materials().unwrap(), &mesh).unwrap();
    let identity = Identity::new("sparse", &case, (hash_of_mesh(&mesh), None), &field);
    for file in [&pieces[0].file, &body[0].file] {
        let piece = path.with_file_name(file);
        let elsewhere = dir.path().join("elsewhere");
        fs::rename(&piece, &elsewhere).unwrap();
        let written = write(dir.path(), &identity, state.clone(), written.clone(), body.clone(), pieces.clone());
        let error = written.unwrap_err().to_string();
        assert!(error.starts_with(piece.to_str().unwrap()) && error.contains("that all ranks share"), "{error}");
        fs::rename(&elsewhere, &piece).unwrap();
    }
}

#[test]
fn names_of_all_files_are_recognized() {
    for (name, is_file) in [
        ("step-00003.bin", true),
        ("step-00003-part-0000.bin", true),
        ("step-00003-body-0012.bin", true),
        ("step-3-part-0000.bin", false),
        ("step-3-body-0000.bin", false),
        ("step-00003-other-0000.bin", false),
        ("step-3.bin", false),
        ("other-part-0000.bin", false),
    ] {
        assert_eq!(is_file_name(name), is_file, "{name}");
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
        matches!(error, ResumeError::Checkpoint(CheckpointError::Version { found: 9, expected: 8, .. })),
        "{error}"
    );
}
