//! A body of which each rank of the macro scale holds a part: its RVEs, and the responses of its ghosts.

use std::collections::HashMap;

use bytemuck::{AnyBitPattern, NoUninit};

use crate::coupling::UnitId;
use crate::fem::mesh::{Mesh, Part};
use crate::las::{Comm, Message, Payload, SendRequest, Tag};
use crate::tissue::micro_scale::{PointFailure, RveCounts, Sites};

use super::TwoScaleError;
use super::protocol::{pack, unpack};

/// Values for the ghosts of another rank.
const GHOSTS: Tag = Tag::of(3);

/// The part of a rank: which points are its own, and with which ranks it exchanges responses.
pub(super) struct DividedBody<C: Comm> {
    comm: C,
    is_own: Vec<bool>,
    /// The point of each unit of the part, ghosts included.
    point_of: HashMap<UnitId, usize>,
    /// The own points that are ghosts of another rank, for each such rank.
    wanted: Vec<(usize, Vec<usize>)>,
    /// The ranks that own ghosts of this one, ascending.
    owners: Vec<usize>,
    /// The RVEs of the whole body at the last commit.
    pub counts: RveCounts,
}

impl<C: Comm> DividedBody<C> {
    /// Collects the own points and the ghosts of a part. Does not communicate.
    pub fn new(comm: &C, mesh: &Mesh, part: &Part) -> Self {
        let points = mesh.points();
        let point_of = (0..points.len()).map(|point| (points.in_whole(point) as UnitId, point)).collect();
        let mut owners: Vec<usize> = part.rank_of_element.iter().map(|&rank| rank as usize).collect();
        owners.sort_unstable();
        owners.dedup();
        owners.retain(|&rank| rank != part.rank);
        Self {
            comm: comm.clone(),
            is_own: mesh.own_points(),
            point_of,
            wanted: Vec::new(),
            owners,
            counts: RveCounts::default(),
        }
    }

    /// Learns which ranks have own points as ghosts. Collective.
    pub fn couple(&mut self, sites: &Sites) -> Result<(), TwoScaleError> {
        let points = sites.points();
        let ghosts = (0..self.is_own.len()).filter(|&point| !self.is_own[point]);
        let ghosts: Vec<UnitId> = ghosts.map(|point| points.in_whole(point) as UnitId).collect();
        let all = self.comm.gather_all(Message::of(&ghosts))?;
        for (rank, ghosts) in all.iter().enumerate().filter(|(rank, _)| *rank != self.comm.rank()) {
            let units = ghosts.values::<UnitId>().ok_or(TwoScaleError::Protocol)?;
            let own = units.iter().filter_map(|unit| self.point_of.get(unit).copied());
            let own: Vec<usize> = own.filter(|&point| self.is_own[point]).collect();
            if !own.is_empty() {
                self.wanted.push((rank, own));
            }
        }
        Ok(())
    }

    /// Returns true if a point belongs to this rank.
    pub fn is_own(&self, point: usize) -> bool {
        self.is_own[point]
    }

    /// Returns the point of a unit; `None` if the part does not have it.
    pub fn point_of(&self, unit: UnitId) -> Option<usize> {
        self.point_of.get(&unit).copied()
    }

    /// Returns true on all ranks if one of them passes true. Collective.
    pub fn any(&self, conditions: &mut [bool]) -> Result<(), TwoScaleError> {
        let mut most: Vec<f64> = conditions.iter().map(|&condition| f64::from(u8::from(condition))).collect();
        self.comm.max(&mut most)?;
        conditions.iter_mut().zip(most).for_each(|(condition, most)| *condition = most > 0.0);
        Ok(())
    }

    /// Returns the failure of the lowest point of all ranks, if one failed. Collective.
    pub fn first_failure(&self, own: Option<PointFailure>) -> Result<Option<PointFailure>, TwoScaleError> {
        let mut failed = [own.is_some()];
        self.any(&mut failed)?;
        if !failed[0] {
            return Ok(None);
        }
        let all = self.comm.gather_all(pack(&own)?)?;
        let all = all.iter().map(unpack).collect::<Result<Vec<Option<PointFailure>>, _>>()?;
        Ok(all.into_iter().flatten().min_by_key(|failure| failure.point))
    }

    /// Appends to the values of the units at own points those at ghosts; `unit` returns the unit of a value. Collective.
    pub fn exchange_ghosts<T: Payload>(
        &self,
        values: &mut Vec<T>,
        unit: impl Fn(&T) -> UnitId,
    ) -> Result<(), TwoScaleError> {
        if self.counts.rves == 0 {
            return Ok(());
        }
        let numbered = values.iter().enumerate();
        let number_of: HashMap<usize, usize> =
            numbered.filter_map(|(number, value)| Some((self.point_of(unit(value))?, number))).collect();
        let mut pending = Vec::with_capacity(self.wanted.len());
        for (rank, points) in &self.wanted {
            let sent: Vec<T> = points.iter().filter_map(|point| Some(values[*number_of.get(point)?])).collect();
            pending.push(self.comm.start_send(*rank, GHOSTS, Message::of(&sent))?);
        }
        for &rank in &self.owners {
            let received = self.comm.receive(rank, GHOSTS)?;
            values.extend_from_slice(received.values::<T>().ok_or(TwoScaleError::Protocol)?);
        }
        pending.into_iter().try_for_each(|send| send.wait().map(drop))?;
        Ok(())
    }

    /// Replaces the values at nodes that belong to other ranks by theirs: `width` numbers for each node. Collective.
    pub fn share_at_nodes(
        &self,
        mesh: &Mesh,
        part: &Part,
        width: usize,
        values: &mut [f64],
    ) -> Result<(), TwoScaleError> {
        // All elements at an own node are in the part: those of other ranks show which nodes are in other parts.
        let mut is_shared = vec![false; part.nodes.len()];
        let elements = mesh.elements().iter().enumerate();
        for (_, nodes) in elements.filter(|(element, _)| !part.is_own_element(*element)) {
            nodes.iter().for_each(|&node| is_shared[node as usize] |= part.is_own_node[node as usize]);
        }
        let shared: Vec<usize> = (0..is_shared.len()).filter(|&node| is_shared[node]).collect();
        let numbers: Vec<u64> = shared.iter().map(|&node| part.nodes[node].into()).collect();
        let rows: Vec<f64> = shared.iter().flat_map(|&node| &values[width * node..][..width]).copied().collect();
        let (numbers, rows) = (self.gather(&numbers)?, self.gather(&rows)?);
        for (&number, row) in numbers.iter().zip(rows.chunks_exact(width)) {
            if let Some(node) = part.local_node(number as u32).filter(|&node| !part.is_own_node[node as usize]) {
                values[width * node as usize..][..width].copy_from_slice(row);
            }
        }
        Ok(())
    }

    /// Gathers the values of all ranks, in the order of ranks. Collective.
    pub fn gather<T: AnyBitPattern + NoUninit>(&self, own: &[T]) -> Result<Vec<T>, TwoScaleError> {
        let all = self.comm.gather_all(Message::of(own))?;
        let mut joined = Vec::new();
        for message in &all {
            joined.extend_from_slice(message.values::<T>().ok_or(TwoScaleError::Protocol)?);
        }
        Ok(joined)
    }

    /// Counts the RVEs of all ranks. Collective.
    pub fn count(&mut self, sites: &Sites, models: usize) -> Result<(), TwoScaleError> {
        let own = sites.counts(models, |point| self.is_own(point));
        let RveCounts { rves, per_model, asleep, waiting, deleted } = own;
        let mut sums: Vec<f64> = [rves, asleep, waiting, deleted].iter().chain(&per_model).map(|&n| n as f64).collect();
        self.comm.sum(&mut sums)?;
        let [rves, asleep, waiting, deleted] = std::array::from_fn(|k| sums[k] as usize);
        let per_model = sums[4..].iter().map(|&sum| sum as usize).collect();
        self.counts = RveCounts { rves, per_model, asleep, waiting, deleted };
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::backends::comm::thread;
    use crate::fem::mesh::Division;
    use crate::fem::mesh::shapes::cuboid;
    use crate::tissue::two_scale::partition;

    /// Sums at the nodes of own elements are those of the whole body, bit for bit, whatever the number of ranks.
    #[test]
    fn values_at_nodes_do_not_depend_on_ranks() {
        let whole = cuboid([3, 2, 2], [1.0; 3]).unwrap();
        let sums = |mesh: &Mesh, in_whole: &dyn Fn(usize) -> usize| {
            let mut sums = vec![0.0; 2 * mesh.nodes().len()];
            for (element, nodes) in mesh.elements().iter().enumerate() {
                for &node in nodes {
                    sums[2 * node as usize] += 1.0;
                    sums[2 * node as usize + 1] += 1.0 / (1.0 + in_whole(element) as f64);
                }
            }
            sums
        };
        let expected = sums(&whole, &|element| element);
        for ranks in [1, 2, 4] {
            let main = |comm: thread::ThreadComm| -> Result<usize, TwoScaleError> {
                let division = Division::new(&whole, partition(&whole, ranks), ranks, std::iter::empty());
                let mesh = whole.divided(&division, comm.rank());
                let part = mesh.part().unwrap();
                let mut values = sums(&mesh, &|element| part.elements[element] as usize);
                let complete = |values: &[f64], node: u32| {
                    let in_whole = part.nodes[node as usize] as usize;
                    values[2 * node as usize..][..2] == expected[2 * in_whole..][..2]
                };
                let mut of_own: Vec<u32> = Vec::new();
                part.own_elements().for_each(|element| of_own.extend(&mesh.elements()[element]));
                let incomplete = of_own.iter().filter(|&&node| !complete(&values, node)).count();
                DividedBody::new(&comm, &mesh, part).share_at_nodes(&mesh, part, 2, &mut values)?;
                assert!(of_own.iter().all(|&node| complete(&values, node)));
                Ok(incomplete)
            };
            let incomplete = thread::run(ranks, main).unwrap();
            assert_eq!(incomplete.iter().sum::<usize>() > 0, ranks > 1, "nothing was to be shared");
        }
    }
}
