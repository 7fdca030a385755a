use std::fs;
use std::path::PathBuf;

use nalgebra::{Matrix3, SMatrix};

use super::*;
use crate::app::results::ResultsRecord;
use crate::checksum::Fnv;
use crate::fem::material::Response;
use crate::fem::mesh::{Division, shapes};
use crate::fem::stepping::SavedState;
use crate::sealed_file::{HEAD, TAIL};

/// A part of the error, and the change of the pieces that causes it.
type Change<'a> = (&'a str, &'a dyn Fn(&mut Vec<Content>));

fn whole_mesh() -> Mesh {
    shapes::cuboid([3, 2, 1], [3.0, 2.0, 1.0]).unwrap()
}

/// Returns the parts of the mesh on this number of ranks; the last of more than four has no elements.
fn parts(ranks: usize) -> Vec<Mesh> {
    let mesh = whole_mesh();
    let with_elements = if ranks > 4 { ranks - 1 } else { ranks };
    let elements = mesh.elements().len();
    let rank_of = (0..elements).map(|element| (element * with_elements / elements) as u32).collect();
    let division = Division::new(&mesh, rank_of, ranks, std::iter::empty());
    match ranks {
        1 => vec![mesh],
        _ => (0..ranks).map(|rank| mesh.divided(&division, rank)).collect(),
    }
}

/// Returns a state that differs at each node and point, of a mesh that may be a part.
fn state_of(mesh: &Mesh) -> BodyState {
    let node_in_whole = |node: usize| mesh.part().map_or(node, |part| part.nodes[node] as usize);
    let displacement = |node| [node_in_whole(node) as f64, -0.0, 1.0 / (1.0 + node_in_whole(node) as f64)];
    let status = |point: usize| match mesh.points().in_whole(point) % 5 {
        0 => RveStatus::Waiting,
        1 => RveStatus::Deleted,
        2 => RveStatus::Asleep,
        _ => RveStatus::Awake,
    };
    let points = mesh.points().len();
    let sleeping = |point: usize| {
        let size = mesh.points().in_whole(point) as f64;
        let response = Response { energy: size, pk1: Matrix3::repeat(-size), tangent: SMatrix::repeat(0.1 * size) };
        SleepingRve { point, extrapolation_point: (Matrix3::identity() * size, response) }
    };
    let asleep = (0..points).filter(|&point| status(point) == RveStatus::Asleep).map(sleeping).collect();
    let sites = SavedSites { statuses: (0..points).map(status).collect(), asleep };
    BodyState { displacements: (0..mesh.nodes().len()).map(displacement).collect(), sites }
}

fn listing(folder: &Path, body: Vec<BodyStatePiece>) -> Checkpoint {
    let path = folder.join("step-00001.bin");
    Checkpoint { path, state: SavedState::default(), body, pieces: vec![], written: ResultsRecord::default() }
}

/// Writes the pieces of some ranks.
fn written_by(folder: &Path, ranks: usize) -> Checkpoint {
    let write = |mesh: &Mesh| {
        let BodyState { displacements, sites } = state_of(mesh);
        write(folder, "step-00001", mesh, &displacements, sites).unwrap()
    };
    listing(folder, parts(ranks).iter().map(write).collect())
}

/// Writes a piece with this content; returns what the checkpoint lists.
fn forged(folder: &Path, rank: usize, content: &Content) -> BodyStatePiece {
    let file = file_name("step-00001", rank);
    let Seal { bytes, hash } =
        write_sealed(folder, &file, |out| postcard::to_io(content, out).map(drop).map_err(io::Error::other)).unwrap();
    BodyStatePiece { file, bytes, hash, nodes: content.displacements.len(), points: content.statuses.len() }
}

#[test]
fn names_are_recognized_exactly() {
    for (name, stem) in [
        ("step-00003-body-0012.bin", Some("step-00003")),
        ("step-00003-body-12345.bin", Some("step-00003")),
        ("step-00003-body-12.bin", None),
        ("step-00003-body-+012.bin", None),
        ("step-00003-part-0012.bin", None),
        ("step-00003.bin", None),
        (".step-00003-body-0012.bin.part", None),
    ] {
        assert_eq!(stem_of(name), stem, "{name}");
    }
}

#[test]
fn runs_hold_any_numbers() {
    let numbers = [0, 1, 2, 7, 9, 10, u32::MAX - 1];
    let runs: Runs = numbers.into_iter().collect();
    assert_eq!(runs, Runs(vec![(0, 3), (7, 1), (9, 2), (u32::MAX - 1, 1)]));
    assert!(runs.numbers().eq(numbers) && runs.len() == Some(7));
    assert_eq!(Runs(vec![(2, u32::MAX)]).len(), None);
}

/// Whatever division wrote the pieces, the parts of any other one find their state.
#[test]
fn the_state_is_read_on_any_number_of_ranks() {
    for writers in [1, 2, 3, 5] {
        let folder = tempfile::tempdir().unwrap();
        let checkpoint = written_by(folder.path(), writers);
        assert_eq!(checkpoint.body.len(), writers);
        for mesh in [1, 2, 3, 5].into_iter().flat_map(parts) {
            let BodyState { displacements, mut sites } = read(&checkpoint, &mesh).unwrap();
            sites.asleep.sort_by_key(|rve| rve.point);
            let expected = state_of(&mesh);
            let bits = |of: &[[f64; 3]]| of.iter().map(|u| u.map(f64::to_bits)).collect::<Vec<_>>();
            assert_eq!(bits(&displacements), bits(&expected.displacements));
            assert_eq!(sites, expected.sites);
        }
    }
}

#[test]
fn a_missing_damaged_or_foreign_piece_is_named_on_all_ranks() {
    let folder = tempfile::tempdir().unwrap();
    let checkpoint = written_by(folder.path(), 3);
    let path = folder.path().join(&checkpoint.body[1].file);
    let bytes = fs::read(&path).unwrap();
    let errors = || parts(2).into_iter().map(|mesh| read(&checkpoint, &mesh).unwrap_err());
    for at in (0..bytes.len()).step_by(61) {
        let mut changed = bytes.clone();
        changed[at] ^= 0x10;
        for content in [&changed, &bytes[..at]] {
            fs::write(&path, content).unwrap();
            for error in errors() {
                let CheckpointError::Piece(PieceError::Damaged(named, _)) = error else { panic!("{error}") };
                assert_eq!(named, path);
            }
        }
    }
    fs::copy(folder.path().join(&checkpoint.body[2].file), &path).unwrap();
    errors()
        .for_each(|error| assert!(error.to_string().ends_with("damaged: belongs to another checkpoint"), "{error}"));
    fs::remove_file(&path).unwrap();
    errors().for_each(|error| assert!(matches!(error, CheckpointError::Piece(PieceError::Missing(_))), "{error}"));
}

/// The sum of the counts of all pieces is right in the second half of the cases: only some ranks find the error.
#[test]
fn pieces_without_every_node_and_point_once_are_rejected() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let contents = || -> Vec<Content> {
        let of_part = |mesh: &Mesh| {
            let BodyState { displacements, sites } = state_of(mesh);
            Content::new(mesh, &displacements, sites)
        };
        parts(2).iter().map(of_part).collect()
    };
    let replaced = |runs: &Runs, from: u32, to: u32| runs.numbers().map(|k| if k == from { to } else { k }).collect();
    let (node, point) = (contents()[1].nodes.numbers().next().unwrap(), contents()[1].points.numbers().next().unwrap());
    let changes: [Change<'_>; 6] = [
        ("step-00001.bin: damaged: its body pieces hold ", &|contents| {
            contents.pop();
        }),
        ("step-00001-body-0001.bin: damaged: its numbers of nodes and integration points differ", &|contents| {
            contents[1].nodes.0.push((0, 1));
        }),
        ("step-00001-body-0000.bin: damaged: its numbers of nodes and integration points differ", &|contents| {
            contents[0].points.0[0] = (5, u32::MAX);
        }),
        (&format!("step-00001.bin: damaged: its body pieces lack node {node}"), &|contents| {
            contents[1].nodes = replaced(&contents[1].nodes, node, contents[0].nodes.0[0].0);
        }),
        (&format!("step-00001.bin: damaged: its body pieces lack integration point {point}"), &|contents| {
            contents[1].points = replaced(&contents[1].points, point, contents[0].points.0[0].0);
        }),
        (
            &format!("step-00001-body-0001.bin: damaged: the displacement of node {node} is not a finite number"),
            &|contents| contents[1].displacements[0][2] = f64::NAN,
        ),
    ];
    for (expected, change) in changes {
        let mut changed = contents();
        change(&mut changed);
        let pieces = changed.iter().enumerate().map(|(rank, content)| forged(folder, rank, content)).collect();
        let checkpoint = listing(folder, pieces);
        let errors: Vec<String> =
            parts(3).iter().filter_map(|mesh| Some(read(&checkpoint, mesh).err()?.to_string())).collect();
        let named = format!("{}/{expected}", folder.display());
        assert!(errors.iter().any(|error| error.starts_with(&named)), "{errors:?} {named}");
    }
}

#[test]
fn damage_with_a_matching_hash_never_panics() {
    let folder = tempfile::tempdir().unwrap();
    let checkpoint = written_by(folder.path(), 2);
    let path: PathBuf = folder.path().join(&checkpoint.body[0].file);
    let bytes = fs::read(&path).unwrap();
    let body = &bytes[..bytes.len() - TAIL];
    let meshes = parts(3);
    let mut refused = 0;
    let mut outcomes = |changed: &[u8]| {
        let mut hash = Fnv::new();
        hash.add_bytes(changed);
        fs::write(&path, [changed, &hash.finish().to_le_bytes()].concat()).unwrap();
        let mut listed = checkpoint.clone();
        (listed.body[0].bytes, listed.body[0].hash) = ((changed.len() + TAIL) as u64, hash.finish());
        for mesh in &meshes {
            if let Err(error) = read(&listed, mesh) {
                refused += 1;
                assert!(!error.to_string().is_empty());
            }
        }
    };
    for at in (HEAD..body.len()).filter(|at| at % 11 == 0 || *at < HEAD + 24) {
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
