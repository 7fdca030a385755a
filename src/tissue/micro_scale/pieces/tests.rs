use std::fs;

use nalgebra::Matrix3;

use super::*;
use crate::backends::sparse::Sparse;
use crate::checksum::Fnv;
use crate::fem::mesh::shapes::cuboid;
use crate::fem::point_field::{PointField, PointResponses};
use crate::fiber::rve::{Rve, StressScale};
use crate::tissue::materials::{FiberRve, Materials, NetworkAssignment, Region, RegionMaterial, RveLifecycle};
use crate::tissue::micro_scale::{FieldRestoreError, TissueField, TissueMaterial};

/// Returns the material of the cube after a step in which each element was stretched by another amount.
fn stretched() -> TissueField<Sparse> {
    let mut field = at_rest();
    let gradients: Vec<_> =
        (0..6).map(|k| Matrix3::from_diagonal(&[1.01 + 0.002 * f64::from(k), 1.0, 1.0].into())).collect();
    field.update(&gradients, &mut PointResponses::default()).unwrap();
    field.commit(true).unwrap();
    field
}

/// Returns the material of a cube with a network in each of its six elements.
fn at_rest() -> TissueField<Sparse> {
    let network = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/networks/frozen.txt");
    let rve = FiberRve {
        networks: vec![network],
        assignment: NetworkAssignment::Cycle,
        seed: 0,
        scale: StressScale::Raw.into(),
        law: None,
        matrix: None,
        lifecycle: RveLifecycle::default(),
    };
    let region = Region { name: "*".into(), material: RegionMaterial::FiberRve(rve) };
    let materials = Materials { regions: vec![region], ..Materials::default() };
    let mut field = TissueField::new((), materials, &cuboid([1, 1, 1], [1.0; 3]).unwrap()).unwrap().0;
    field.create_existing();
    field
}

fn states(field: &TissueField<Sparse>) -> Vec<(u64, UnitState)> {
    (0..6).map(|number| (number as u64, field.units.state(number))).collect()
}

/// Writes a piece of some states.
fn piece_of(folder: &Path, rank: usize, states: &[(u64, UnitState)]) -> Piece {
    write(folder, piece_file("step-00001", rank), states.iter().cloned()).unwrap().unwrap()
}

#[test]
fn names_are_recognized_exactly() {
    assert_eq!(piece_file("step-00003", 12), "step-00003-part-0012.bin");
    for (name, stem) in [
        ("step-00003-part-0012.bin", Some("step-00003")),
        ("step-00003-part-12345.bin", Some("step-00003")),
        ("step-00003-part-12.bin", None),
        ("step-00003-part-00012.bin", None),
        ("step-00003-part-+012.bin", None),
        ("step-00003.bin", None),
        (".step-00003-part-0012.bin.part", None),
    ] {
        assert_eq!(piece_stem(name), stem, "{name}");
    }
}

/// Any split of the RVEs into pieces restores all of them.
#[test]
fn states_are_restored_from_any_pieces() {
    let folder = tempfile::tempdir().unwrap();
    let field = stretched();
    let all = states(&field);
    let backward: Vec<_> = all.iter().rev().cloned().collect();
    let splits: [&[&[(u64, UnitState)]]; 3] =
        [&[&all], &[&backward[..1], &backward[1..5], &backward[5..]], &[&all[3..], &all[..3]]];
    for split in splits {
        let pieces: Vec<Piece> =
            split.iter().enumerate().map(|(rank, states)| piece_of(folder.path(), rank, states)).collect();
        let mut other = at_rest();
        other.verify_pieces(folder.path(), &pieces).unwrap();
        other.restore_units(&field.sites().saved(), folder.path(), &pieces).unwrap();
        assert!(states(&other) == all);
    }
    // A rank reads only what it asks for.
    let piece = piece_of(folder.path(), 0, &all);
    let mut found = Vec::new();
    let take = |point, state| {
        found.push((point, state));
        Ok::<_, PieceError>(())
    };
    read(folder.path(), &piece, |point| point % 3 == 1, take).unwrap();
    assert!(found == [all[1].clone(), all[4].clone()]);
    // Without RVEs, there is no piece.
    assert_eq!(write(folder.path(), piece_file("step-00001", 7), [].into_iter()).unwrap(), None);
    assert!(!folder.path().join(piece_file("step-00001", 7)).exists());
}

#[test]
fn states_that_do_not_fit_are_rejected() {
    let folder = tempfile::tempdir().unwrap();
    let field = stretched();
    let all = states(&field);
    let changed = |unit: usize, change: fn(&mut Matrix3<f64>, &mut Vec<[f64; 3]>)| {
        let mut states = all.clone();
        let rve = states[unit].1.rve.as_mut().unwrap();
        let (mut gradient, mut interior) = (*rve.gradient(), rve.interior().to_vec());
        change(&mut gradient, &mut interior);
        *rve = Rve::restored(gradient, interior, None);
        states
    };
    let mut bare = all.clone();
    bare[4].1.rve = None;
    let mut twice = all.clone();
    twice[3].0 = 2;
    for (states, expected) in [
        (all[..5].to_vec(), "the state has 5 RVEs; this body has 6"),
        (twice, "element 3: no piece of the state has its RVE"),
        (bare, "element 4 has no fibers in the saved state, but has some here"),
        (changed(5, |_, interior| interior.truncate(2)), "element 5: the state has positions of"),
        (
            changed(1, |_, interior| interior[3][2] = f64::NAN),
            "element 1: the position of interior node 3 is not a finite number",
        ),
        (changed(2, |gradient, _| *gradient *= -1.0), "element 2: the deformation gradient has determinant -"),
    ] {
        let piece = piece_of(folder.path(), 0, &states);
        let error = at_rest().restore_units(&field.sites().saved(), folder.path(), &[piece]).unwrap_err().to_string();
        assert!(error.starts_with(expected), "{error}");
    }
    let mut sites = field.sites().saved();
    sites.statuses.pop();
    let piece = piece_of(folder.path(), 0, &all);
    let error = at_rest().restore_units(&sites, folder.path(), &[piece]).unwrap_err();
    assert_eq!(error, FieldRestoreError::Points { found: 5, expected: 6 });
}

#[test]
fn a_missing_damaged_or_foreign_piece_is_named() {
    let folder = tempfile::tempdir().unwrap();
    let field = stretched();
    let (piece, other) = (piece_of(folder.path(), 0, &states(&field)), piece_of(folder.path(), 1, &states(&at_rest())));
    let path = folder.path().join(&piece.file);
    let error = |piece: &Piece| field.verify_pieces(folder.path(), &[other.clone(), piece.clone()]).unwrap_err();
    let bytes = fs::read(&path).unwrap();
    for at in (0..bytes.len()).step_by(997) {
        let mut changed = bytes.clone();
        changed[at] ^= 0x10;
        fs::write(&path, &changed).unwrap();
        assert!(matches!(error(&piece), PieceError::Damaged(at, _) if at == path));
        fs::write(&path, &bytes[..at]).unwrap();
        assert!(matches!(error(&piece), PieceError::Damaged(at, _) if at == path));
    }
    fs::copy(folder.path().join(&other.file), &path).unwrap();
    assert_eq!(error(&piece), PieceError::Damaged(path.clone(), "belongs to another checkpoint".into()));
    fs::remove_file(&path).unwrap();
    assert_eq!(error(&piece), PieceError::Missing(path));
}

#[test]
fn damage_with_a_matching_hash_never_panics() {
    let folder = tempfile::tempdir().unwrap();
    let field = stretched();
    let piece = piece_of(folder.path(), 0, &states(&field));
    let path = folder.path().join(&piece.file);
    let bytes = fs::read(&path).unwrap();
    let body = &bytes[..bytes.len() - TAIL];
    let mut refused = 0;
    let mut restore = |body: &[u8]| {
        let mut hash = Fnv::new();
        hash.add_bytes(body);
        fs::write(&path, [body, &hash.finish().to_le_bytes()].concat()).unwrap();
        let piece = Piece { bytes: (body.len() + TAIL) as u64, hash: hash.finish(), ..piece.clone() };
        field.verify_pieces(folder.path(), std::slice::from_ref(&piece)).unwrap();
        if let Err(error) = at_rest().restore_units(&field.sites().saved(), folder.path(), &[piece]) {
            refused += 1;
            assert!(!error.to_string().is_empty());
        }
    };
    let from_end = |at: &usize| body.len() - at < 6 * ENTRY + 8;
    for at in (HEAD..body.len()).filter(|at| at % 1499 == 0 || *at < HEAD + 24 || from_end(at) && at % 5 == 0) {
        let mut changed = body.to_vec();
        changed[at] ^= 0x81;
        restore(&changed);
        // A number that is too large for any file.
        changed[at..].iter_mut().take(9).for_each(|byte| *byte = 0xff);
        restore(&changed);
        restore(&body[..at]);
    }
    assert!(refused > 60, "{refused}");
}
