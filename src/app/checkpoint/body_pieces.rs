//! The body pieces of a checkpoint: files with the displacements of the nodes and the life cycles of the RVEs, one for
//! each rank that holds a part of the body.
//!
//! A piece has the own nodes and points of its rank, by their numbers in the whole mesh. A rank that resumes reads one piece
//! after the other and takes what its part of the mesh contains, from however many ranks wrote them. It thus never holds more
//! than a piece and its own part.

use std::io;
use std::path::Path;

use serde::{Deserialize, Serialize};

use super::{Checkpoint, CheckpointError};
use crate::fem::mesh::Mesh;
use crate::sealed_file::Seal;
use crate::tissue::micro_scale::{PieceError, RveStatus, SavedSites, SleepingRve, verify_sealed, write_sealed};

/// A body piece, as the checkpoint lists it.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct BodyStatePiece {
    /// Name of the file in the folder of checkpoints.
    pub file: String,
    /// Length of the file in bytes.
    pub bytes: u64,
    /// The hash at the end of the file.
    pub hash: u64,
    /// Number of nodes.
    pub nodes: usize,
    /// Number of integration points.
    pub points: usize,
}

/// The state of the nodes and points of a mesh, which may be a part of a whole one.
#[derive(Clone, Debug, PartialEq)]
pub(in crate::app) struct BodyState {
    /// Displacements of the nodes, m.
    pub displacements: Vec<[f64; 3]>,
    /// The life cycles of the RVEs.
    pub sites: SavedSites,
}

/// The content of a piece, with nodes and points by their numbers in the whole mesh.
#[derive(Serialize, Deserialize)]
struct Content {
    nodes: Runs,
    displacements: Vec<[f64; 3]>,
    points: Runs,
    statuses: Vec<RveStatus>,
    asleep: Vec<SleepingRve>,
}

/// Numbers in the form of runs of consecutive ones: the first of each run and their count.
#[derive(Debug, Default, PartialEq, Serialize, Deserialize)]
struct Runs(Vec<(u32, u32)>);

fn file_name(stem: &str, rank: usize) -> String {
    format!("{stem}-body-{rank:04}.bin")
}

/// Returns the beginning of the names of all files of the checkpoint that a body piece of this name belongs to; `None` if
/// this is no name of one.
pub(super) fn stem_of(name: &str) -> Option<&str> {
    let (stem, rank) = name.strip_suffix(".bin")?.rsplit_once("-body-")?;
    (file_name(stem, rank.parse().ok()?) == name).then_some(stem)
}

/// Writes the own nodes and points of a mesh to a piece, which is complete and on the disk then. `stem` is the beginning of
/// the names of all files of the checkpoint; displacements and life cycles are those of all nodes and points.
///
/// # Errors
/// Returns [`PieceError::Write`].
pub(in crate::app) fn write(
    folder: &Path,
    stem: &str,
    mesh: &Mesh,
    displacements: &[[f64; 3]],
    sites: SavedSites,
) -> Result<BodyStatePiece, PieceError> {
    let content = Content::new(mesh, displacements, sites);
    let file = file_name(stem, mesh.part().map_or(0, |part| part.rank));
    let Seal { bytes, hash } =
        write_sealed(folder, &file, |out| postcard::to_io(&content, out).map(drop).map_err(io::Error::other))?;
    let (nodes, points) = (content.displacements.len(), content.statuses.len());
    Ok(BodyStatePiece { file, bytes, hash, nodes, points })
}

/// Reads the state of the nodes and points of a mesh from the pieces of a checkpoint, which it verifies.
///
/// If it succeeds on all ranks of a body, the pieces hold every node and every point of the whole mesh once: there are as
/// many as in the whole mesh, and none lacks.
///
/// # Errors
/// Returns [`CheckpointError`] if a piece cannot be used, if the pieces lack a node or a point of the mesh, or if a
/// displacement is not finite. Other ranks of the body may then have succeeded.
pub(in crate::app) fn read(checkpoint: &Checkpoint, mesh: &Mesh) -> Result<BodyState, CheckpointError> {
    let damaged = |what| CheckpointError::Damaged(checkpoint.path.clone(), what);
    let sum = |count: fn(&BodyStatePiece) -> usize| checkpoint.body.iter().map(count).fold(0, usize::saturating_add);
    let (nodes, points, whole) = (sum(|piece| piece.nodes), sum(|piece| piece.points), mesh.whole());
    if (nodes, points) != (whole.nodes, whole.points) {
        return Err(damaged(format!(
            "its body pieces hold {nodes} nodes and {points} integration points; the mesh has {} and {}",
            whole.nodes, whole.points
        )));
    }
    let mut found = Found::new(mesh);
    checkpoint.body.iter().try_for_each(|piece| found.take_from(checkpoint.folder(), piece))?;
    found.complete().map_err(damaged)
}

impl Content {
    fn new(mesh: &Mesh, displacements: &[[f64; 3]], sites: SavedSites) -> Self {
        let nodes: Vec<u32> = (0..displacements.len() as u32).filter(|&node| mesh.is_own_node(node)).collect();
        let of_whole = |node: u32| mesh.part().map_or(node, |part| part.nodes[node as usize]);
        let (is_own, in_whole) = (mesh.own_points(), |point| mesh.points().in_whole(point));
        let own_points = || (0..is_own.len()).filter(|&point| is_own[point]);
        let asleep = sites.asleep.into_iter().filter(|rve| is_own[rve.point]);
        Self {
            displacements: nodes.iter().map(|&node| displacements[node as usize]).collect(),
            nodes: nodes.into_iter().map(of_whole).collect(),
            points: own_points().map(|point| in_whole(point) as u32).collect(),
            statuses: own_points().map(|point| sites.statuses[point]).collect(),
            asleep: asleep.map(|rve| SleepingRve { point: in_whole(rve.point), ..rve }).collect(),
        }
    }

    /// Reads a piece and compares it with the checkpoint that lists it.
    fn read(path: &Path, listed: &BodyStatePiece) -> Result<Self, PieceError> {
        let mut bytes = Vec::new();
        let seal = Seal { bytes: listed.bytes, hash: listed.hash };
        verify_sealed(path, seal, |block| bytes.extend_from_slice(block))?;
        let content: Self = match postcard::take_from_bytes(&bytes) {
            Ok((content, [])) => content,
            Ok(_) => return Err(PieceError::damaged(path, "the state is followed by other bytes")),
            Err(error) => return Err(PieceError::damaged(path, error.to_string())),
        };
        let Self { nodes, displacements, points, statuses, .. } = &content;
        let is_listed = |numbers: &Runs, values, listed| numbers.len() == Some(values) && values == listed;
        if !is_listed(nodes, displacements.len(), listed.nodes) || !is_listed(points, statuses.len(), listed.points) {
            return Err(PieceError::damaged(path, "its numbers of nodes and integration points differ"));
        }
        Ok(content)
    }
}

/// What was found so far of the nodes and points of a mesh.
struct Found<'a> {
    mesh: &'a Mesh,
    /// The number in the whole mesh of each point, ascending.
    in_whole: Vec<usize>,
    displacements: Vec<Option<[f64; 3]>>,
    statuses: Vec<Option<RveStatus>>,
    asleep: Vec<SleepingRve>,
}

impl<'a> Found<'a> {
    fn new(mesh: &'a Mesh) -> Self {
        let (nodes, points) = (mesh.nodes().len(), mesh.points());
        Self {
            mesh,
            in_whole: (0..points.len()).map(|point| points.in_whole(point)).collect(),
            displacements: vec![None; nodes],
            statuses: vec![None; points.len()],
            asleep: Vec::new(),
        }
    }

    fn take_from(&mut self, folder: &Path, piece: &BodyStatePiece) -> Result<(), PieceError> {
        let path = folder.join(&piece.file);
        let Content { nodes, displacements, points, statuses, asleep } = Content::read(&path, piece)?;
        for (node, u) in nodes.numbers().zip(displacements) {
            let Some(local) = self.mesh.local_node(node) else { continue };
            if u.iter().any(|u| !u.is_finite()) {
                let what = format!("the displacement of node {node} is not a finite number");
                return Err(PieceError::damaged(&path, what));
            }
            self.displacements[local as usize] = Some(u);
        }
        for (point, status) in points.numbers().zip(statuses) {
            if let Some(local) = self.local_point(point as usize) {
                self.statuses[local] = Some(status);
            }
        }
        for rve in asleep {
            if let Some(point) = self.local_point(rve.point) {
                self.asleep.push(SleepingRve { point, ..rve });
            }
        }
        Ok(())
    }

    fn local_point(&self, in_whole: usize) -> Option<usize> {
        self.in_whole.binary_search(&in_whole).ok()
    }

    /// Returns the state, or what it lacks.
    fn complete(self) -> Result<BodyState, String> {
        let Self { mesh, in_whole, displacements, statuses, asleep } = self;
        if let Some(node) = displacements.iter().position(Option::is_none) {
            let node = mesh.part().map_or(node, |part| part.nodes[node] as usize);
            return Err(format!("its body pieces lack node {node}"));
        }
        if let Some(point) = statuses.iter().position(Option::is_none) {
            return Err(format!("its body pieces lack integration point {}", in_whole[point]));
        }
        let sites = SavedSites { statuses: statuses.into_iter().flatten().collect(), asleep };
        Ok(BodyState { displacements: displacements.into_iter().flatten().collect(), sites })
    }
}

impl Runs {
    /// Returns the count of all numbers; `None` if a number is too large.
    fn len(&self) -> Option<usize> {
        let counts = self.0.iter().map(|&(first, count)| first.checked_add(count).map(|_| count as usize));
        counts.sum()
    }

    fn numbers(&self) -> impl Iterator<Item = u32> {
        self.0.iter().flat_map(|&(first, count)| first..first.saturating_add(count))
    }
}

impl FromIterator<u32> for Runs {
    fn from_iter<I: IntoIterator<Item = u32>>(numbers: I) -> Self {
        let mut runs: Vec<(u32, u32)> = Vec::new();
        for number in numbers {
            match runs.last_mut() {
                Some((first, count)) if first.checked_add(*count) == Some(number) => *count += 1,
                _ => runs.push((number, 1)),
            }
        }
        Self(runs)
    }
}

#[cfg(all(test, feature = "sparse"))]
mod tests;
