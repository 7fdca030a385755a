//! The state of a divided body in a checkpoint: that of the whole body, so that a run may resume on any number of ranks.

use serde::{Deserialize, Serialize};

use super::{WriterGroup, other_rank};
use crate::app::results::ResultsError;
use crate::fem::mesh::{Mesh, Part};
use crate::fem::stepping::SavedState;
use crate::tissue::micro_scale::{RveStatus, SavedSites, SleepingRve};
use crate::tissue::two_scale::{pack, unpack};

/// The own nodes and points of a rank, with their numbers in the whole mesh.
#[derive(Serialize, Deserialize)]
struct OwnState {
    nodes: Vec<u32>,
    displacements: Vec<[f64; 3]>,
    /// The points whose status is not [`RveStatus::Awake`].
    points: Vec<u32>,
    statuses: Vec<RveStatus>,
    asleep: Vec<SleepingRve>,
}

/// Returns the state of the whole body on the process that writes, given that of the part of each process; others may
/// return `None`.
pub(super) fn gather(
    writers: &dyn WriterGroup,
    mesh: &Mesh,
    state: SavedState,
    sites: SavedSites,
) -> Result<Option<(SavedState, SavedSites)>, ResultsError> {
    let Some(part) = mesh.part() else { return Ok(Some((state, sites))) };
    // The others wait for this rank even if it cannot encode its state; the one that writes reports an empty message.
    let own = pack(&OwnState::new(mesh, part, &state, sites)).unwrap_or_default();
    let Some(parts) = writers.gather(own)? else { return Ok(None) };
    let mut whole = SavedState { displacements: vec![[0.0; 3]; part.whole.nodes], ..state };
    let mut sites = SavedSites { statuses: vec![RveStatus::Awake; part.whole.points], asleep: Vec::new() };
    for part in &parts {
        let OwnState { nodes, displacements, points, statuses, asleep } = unpack(part).map_err(other_rank)?;
        for (&node, u) in nodes.iter().zip(displacements) {
            *whole.displacements.get_mut(node as usize).ok_or_else(|| other_rank("a node does not exist"))? = u;
        }
        for (&point, status) in points.iter().zip(statuses) {
            *sites.statuses.get_mut(point as usize).ok_or_else(|| other_rank("a point does not exist"))? = status;
        }
        sites.asleep.extend(asleep);
    }
    sites.asleep.sort_by_key(|rve| rve.point);
    Ok(Some((whole, sites)))
}

impl OwnState {
    fn new(mesh: &Mesh, part: &Part, state: &SavedState, sites: SavedSites) -> Self {
        let own_nodes = (0..part.nodes.len()).filter(|&node| part.is_own_node[node]);
        let (nodes, displacements) = own_nodes.map(|node| (part.nodes[node], state.displacements[node])).unzip();
        let (is_own, points) = (mesh.own_points(), mesh.points());
        let in_whole = |point: usize| points.in_whole(point);
        let changed = sites.statuses.iter().enumerate().filter(|(_, status)| **status != RveStatus::Awake);
        let changed =
            changed.filter(|(point, _)| is_own[*point]).map(|(point, &status)| (in_whole(point) as u32, status));
        let asleep = sites.asleep.into_iter().filter(|rve| is_own[rve.point]);
        let asleep = asleep.map(|rve| SleepingRve { point: in_whole(rve.point), ..rve }).collect();
        let (points, statuses) = changed.unzip();
        Self { nodes, displacements, points, statuses, asleep }
    }
}

/// Returns the state of the part of this process, given that of the whole body, which has as many nodes and points as the
/// whole mesh; unchanged if the body is not divided.
pub(super) fn of_part(mesh: &Mesh, whole: SavedState, sites: SavedSites) -> (SavedState, SavedSites) {
    let Some(part) = mesh.part() else { return (whole, sites) };
    let displacements = part.nodes.iter().map(|&node| whole.displacements[node as usize]).collect();
    let in_whole: Vec<usize> = (0..mesh.points().len()).map(|point| mesh.points().in_whole(point)).collect();
    let local = |rve: SleepingRve| Some(SleepingRve { point: in_whole.binary_search(&rve.point).ok()?, ..rve });
    let of_part = SavedSites {
        statuses: in_whole.iter().map(|&point| sites.statuses[point]).collect(),
        asleep: sites.asleep.into_iter().filter_map(local).collect(),
    };
    (SavedState { displacements, ..whole }, of_part)
}
