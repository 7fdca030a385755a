//! Pieces of checkpoints that are missing or damaged, and checkpoints of earlier versions.

use std::fs;
use std::path::{Path, PathBuf};

use biotissue::app::Progress;
use biotissue::app::checkpoint::CheckpointError;
use biotissue::app::results::ResultsError;
use biotissue::app::results::log::{Cut, Step};
use biotissue::app::run::{ResumeError, RunError};
use biotissue::tissue::micro_scale::PieceError;

use super::{CASE, assert_same, checkpoint_files, command, contents, copy, resume, simulation, whole_and_killed};

/// A part of the warning, and the change that causes it.
type Change<'a> = (&'a str, &'a dyn Fn(&Path));

/// The piece with the states of the nodes and points, and that with those of the RVEs.
const KINDS: [&str; 2] = ["body", "part"];

fn piece(dir: &Path, kind: &str, step: usize) -> PathBuf {
    dir.join(format!("checkpoint/step-{step:05}-{kind}-0000.bin"))
}

/// The checkpoint before is used, as if the main file were damaged.
#[test]
fn a_run_is_resumed_from_the_checkpoint_before_one_with_a_damaged_piece() {
    let root = tempfile::tempdir().unwrap();
    let (whole, killed) = whole_and_killed(root.path());
    for kind in KINDS {
        let changes: [Change<'_>; 4] = [
            ("is missing", &|path| fs::remove_file(path).unwrap()),
            ("damaged: its ", &|path| {
                let mut bytes = fs::read(path).unwrap();
                bytes[200] ^= 1;
                fs::write(path, bytes).unwrap();
            }),
            ("damaged: does not begin like a file of this program", &|path| fs::write(path, "").unwrap()),
            ("damaged: belongs to another checkpoint", &|path| {
                fs::copy(piece(&whole, kind, 3), path).map(|_| ()).unwrap()
            }),
        ];
        for (k, (message, change)) in changes.into_iter().enumerate() {
            let dir = root.path().join(format!("changed-{kind}-{k}"));
            copy(&killed, &dir);
            change(&piece(&dir, kind, 2));
            let before = contents(&dir);
            let mut other = simulation(CASE);
            let resumed = other.resume(&dir).unwrap();
            assert_eq!(resumed.step, 1);
            let [warning] = &resumed.warnings[..] else { panic!("{resumed:?}") };
            let named = format!("{}: ", piece(&dir, kind, 2).display());
            assert!(warning.starts_with(&named) && warning.ends_with("; trying the one before"), "{warning}");
            assert!(warning.contains(message), "{warning}");
            assert!(contents(&dir) == before, "files were changed");
            drop(other);
            assert_eq!(resume(CASE, &dir).step, 1);
            assert_same(&whole, &dir);
        }
    }
}

#[test]
fn the_error_names_a_lost_piece_and_the_cure() {
    let root = tempfile::tempdir().unwrap();
    let (code, message) = command(root.path(), CASE, &["--ranks", "4"]);
    assert_eq!(code, Some(0), "{message}");
    let dir = root.path().join("results");
    // Of the last checkpoint, the piece of a rank; of the one before, the main file.
    fs::remove_file(dir.join("checkpoint/step-00003.bin")).unwrap();
    for lost in ["checkpoint/step-00004-part-0001.bin", "checkpoint/step-00004-body-0000.bin"] {
        fs::rename(dir.join(lost), root.path().join("lost")).unwrap();
        for ranks in ["1", "3"] {
            let (code, message) = command(root.path(), CASE, &["--ranks", ranks, "--resume"]);
            assert_eq!(code, Some(2), "{message}");
            let error = format!("error: {}: is missing", dir.join(lost).display());
            for part in [&error, "expected: ", "cure: put that file back"] {
                assert!(message.contains(part), "{message}");
            }
        }
        fs::rename(root.path().join("lost"), dir.join(lost)).unwrap();
    }
    let (code, message) = command(root.path(), CASE, &["--ranks", "2", "--resume"]);
    assert!(code == Some(0) && message.contains("continuing after step 4 of 4"), "{message}");
    // The pieces without main file are gone.
    assert!(checkpoint_files(&dir).iter().all(|name| name.starts_with("step-00004")), "{:?}", checkpoint_files(&dir));
}

/// Puts a folder where the piece of a step belongs.
struct Blocking<'a> {
    dir: &'a Path,
    kind: &'a str,
    step: usize,
}

impl Progress for Blocking<'_> {
    fn converged(&mut self, step: &Step) {
        if step.step == self.step {
            fs::create_dir(piece(self.dir, self.kind, step.step)).unwrap();
        }
    }

    fn failed(&mut self, _: &Cut) {}
}

#[test]
fn a_piece_that_cannot_be_written_leaves_the_checkpoint_before() {
    let root = tempfile::tempdir().unwrap();
    let (whole, _) = whole_and_killed(root.path());
    for kind in KINDS {
        let dir = root.path().join(kind);
        let error = simulation(CASE).run(&dir, &mut Blocking { dir: &dir, kind, step: 3 }).unwrap_err();
        let blocked = piece(&dir, kind, 3);
        assert!(matches!(&error, RunError::Results(ResultsError::Write(path, _)) if *path == blocked), "{error}");
        fs::remove_dir(blocked).unwrap();
        let files = checkpoint_files(&dir);
        assert!(!files.contains(&"step-00003.bin".to_owned()), "{files:?}");
        assert_eq!(resume(CASE, &dir).step, 2);
        assert_same(&whole, &dir);
    }
}

#[test]
fn a_checkpoint_of_an_earlier_version_is_rejected_with_its_version() {
    let root = tempfile::tempdir().unwrap();
    let (_, killed) = whole_and_killed(root.path());
    for name in checkpoint_files(&killed) {
        let path = killed.join("checkpoint").join(name);
        if KINDS.iter().any(|kind| path.to_str().unwrap().contains(&format!("-{kind}-"))) {
            fs::remove_file(path).unwrap();
            continue;
        }
        // Earlier versions have the same frame: the letters, the version, the content, and the hash of all these.
        let mut bytes = fs::read(&path).unwrap();
        bytes.truncate(bytes.len() - 8);
        bytes[8] = 7;
        let hash = bytes.iter().fold(0xcbf2_9ce4_8422_2325_u64, |hash, &byte| {
            (hash ^ u64::from(byte)).wrapping_mul(0x0000_0100_0000_01b3)
        });
        bytes.extend(hash.to_le_bytes());
        fs::write(&path, bytes).unwrap();
    }
    let error = simulation(CASE).resume(&killed).unwrap_err();
    assert!(error.to_string().ends_with("step-00002.bin: has version 7 of the format; this program reads version 8"));
    let ResumeError::Checkpoint(error @ CheckpointError::Version { .. }) = error else { panic!("{error}") };
    assert!(error.cure().starts_with("continue with the version of biotissue that wrote it"), "{}", error.cure());
    let lost = CheckpointError::from(PieceError::Missing("a".into()));
    assert!(lost.cure().starts_with("put that file back"), "{}", lost.cure());
}
