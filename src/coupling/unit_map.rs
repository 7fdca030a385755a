//! The communication pattern of a coupling on one rank: the units exchanged with each rank of the other scale.

use std::collections::HashSet;
use std::ops::Range;

use super::data::UnitId;

/// A rank of the other scale, and the units exchanged with it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Neighbor {
    /// Rank in the other scale.
    pub(super) rank: usize,
    /// Indices of the units in this rank's data, in the order of the exchange, which is the same on both sides. They
    /// ascend until units migrate.
    pub(super) indices: Vec<u32>,
    pub(super) is_ascending: bool,
}

/// A unit that migrated to this rank from another rank of the scale.
#[derive(Clone, Copy, Debug)]
pub(super) struct MigratedUnit {
    pub(super) unit: UnitId,
    /// The former rank in the scale.
    pub(super) origin: usize,
    /// The rank of the other scale that the unit is exchanged with.
    pub(super) remote: usize,
    /// The former position among the units that `origin` and `remote` exchange.
    pub(super) position: u32,
}

impl Neighbor {
    /// Returns the range of indices if the units are contiguous in this rank's data, so that their values need not be
    /// gathered.
    pub(super) fn contiguous_range(&self) -> Option<Range<usize>> {
        if !self.is_ascending {
            return None;
        }
        let (first, last) = (*self.indices.first()? as usize, *self.indices.last()? as usize);
        (last - first + 1 == self.indices.len()).then_some(first..last + 1)
    }
}

/// The units of this rank, in the order of its data, and its neighbors, ordered by rank.
#[derive(Clone, Debug, Default)]
pub(super) struct UnitMap {
    pub(super) units: Vec<UnitId>,
    pub(super) neighbors: Vec<Neighbor>,
    /// Number of changes by addition, removal or migration of units.
    pub(super) changes: u64,
}

impl UnitMap {
    /// Creates the map of units and the ranks that they are exchanged with.
    pub(super) fn new(units: &[UnitId], ranks: &[usize]) -> Self {
        let mut map = Self::default();
        map.append(units, ranks);
        map
    }

    /// Appends units.
    pub(super) fn append(&mut self, units: &[UnitId], ranks: &[usize]) {
        let first = self.units.len();
        self.units.extend_from_slice(units);
        self.changes += u64::from(!units.is_empty());
        for (index, &rank) in (first as u32..).zip(ranks) {
            self.neighbor(rank).indices.push(index);
        }
    }

    fn neighbor(&mut self, rank: usize) -> &mut Neighbor {
        let at = match self.neighbors.binary_search_by_key(&rank, |neighbor| neighbor.rank) {
            Ok(at) => at,
            Err(at) => {
                self.neighbors.insert(at, Neighbor { rank, indices: Vec::new(), is_ascending: true });
                at
            }
        };
        &mut self.neighbors[at]
    }

    /// Removes units. The others keep their order; returns their previous indices.
    pub(super) fn remove(&mut self, gone: &HashSet<UnitId>) -> Vec<u32> {
        let kept: Vec<u32> =
            (0..self.units.len() as u32).filter(|&index| !gone.contains(&self.units[index as usize])).collect();
        let mut moved = vec![None; self.units.len()];
        for (new, &old) in (0_u32..).zip(&kept) {
            moved[old as usize] = Some(new);
        }
        for neighbor in &mut self.neighbors {
            neighbor.indices = neighbor.indices.iter().filter_map(|&index| moved[index as usize]).collect();
        }
        self.neighbors.retain(|neighbor| !neighbor.indices.is_empty());
        self.changes += u64::from(kept.len() < self.units.len());
        self.units = kept.iter().map(|&index| self.units[index as usize]).collect();
        kept
    }

    /// Replaces the units of this rank after a migration: those at the former indices `stayed`, in this order, followed
    /// by the arrived ones. In the exchange, arrived units follow those that stayed, ordered by origin and by their
    /// former position; [`relocate`](Self::relocate) orders them equally on the other side.
    pub(super) fn migrate(&mut self, stayed: &[u32], arrived: &[MigratedUnit]) {
        let mut new_index = vec![None; self.units.len()];
        for (new, &old) in (0_u32..).zip(stayed) {
            new_index[old as usize] = Some(new);
        }
        let is_same = arrived.is_empty() && stayed.len() == self.units.len() && stayed.is_sorted();
        self.changes += u64::from(!is_same);
        self.units = stayed.iter().map(|&old| self.units[old as usize]).collect();
        self.units.extend(arrived.iter().map(|arrived| arrived.unit));
        for neighbor in &mut self.neighbors {
            neighbor.indices = neighbor.indices.iter().filter_map(|&old| new_index[old as usize]).collect();
        }
        let mut order: Vec<(&MigratedUnit, u32)> = arrived.iter().zip(stayed.len() as u32..).collect();
        order.sort_by_key(|(unit, _)| (unit.remote, unit.origin, unit.position));
        for (unit, index) in order {
            self.neighbor(unit.remote).indices.push(index);
        }
        self.finish_migration();
    }

    /// Assigns units to other ranks of the scale in which they migrated: `moved` contains, for each unit, its former
    /// rank, its position in the exchange with this rank, and its new rank. The data of this rank keeps its order.
    /// Returns `None` if there is no such unit, or if a unit is moved twice.
    pub(super) fn relocate(&mut self, moved: &[(usize, u32, usize)]) -> Option<()> {
        let mut arrivals = Vec::with_capacity(moved.len());
        for &(from, position, to) in moved {
            let at = self.neighbors.binary_search_by_key(&from, |neighbor| neighbor.rank).ok()?;
            let index = self.neighbors[at].indices.get_mut(position as usize)?;
            let index = std::mem::replace(index, Self::GONE);
            if index == Self::GONE {
                return None;
            }
            arrivals.push((to, from, position, index));
        }
        for neighbor in &mut self.neighbors {
            neighbor.indices.retain(|&index| index != Self::GONE);
        }
        self.changes += u64::from(!arrivals.is_empty());
        arrivals.sort_unstable();
        for (to, _, _, index) in arrivals {
            self.neighbor(to).indices.push(index);
        }
        self.finish_migration();
        Some(())
    }

    /// The index of a unit that is exchanged with another rank now.
    const GONE: u32 = u32::MAX;

    fn finish_migration(&mut self) {
        self.neighbors.retain(|neighbor| !neighbor.indices.is_empty());
        for neighbor in &mut self.neighbors {
            neighbor.is_ascending = neighbor.indices.is_sorted();
        }
    }

    /// Returns the order of data in which the units of each neighbor are contiguous: the present index of each unit.
    pub(super) fn exchange_order(&self) -> Vec<u32> {
        self.neighbors.iter().flat_map(|neighbor| &neighbor.indices).copied().collect()
    }

    /// Reorders the data: `order` contains the present index of each unit. The order of the exchange stays as it is.
    pub(super) fn reorder(&mut self, order: &[u32]) {
        self.migrate(order, &[]);
    }

    /// Returns the units exchanged with a neighbor, in order.
    pub(super) fn units_of<'a>(&'a self, neighbor: &'a Neighbor) -> impl Iterator<Item = UnitId> + 'a {
        neighbor.indices.iter().map(|&index| self.units[index as usize])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn units_keep_their_order_when_others_are_added_and_removed() {
        let mut map = UnitMap::new(&[10, 11, 12, 13], &[2, 0, 2, 0]);
        map.append(&[14], &[1]);
        assert_eq!(
            map.neighbors.iter().map(|n| (n.rank, n.indices.clone())).collect::<Vec<_>>(),
            [(0, vec![1, 3]), (1, vec![4]), (2, vec![0, 2])]
        );
        let ranges: Vec<Option<Range<usize>>> = map.neighbors.iter().map(Neighbor::contiguous_range).collect();
        assert_eq!(ranges, [None, Some(4..5), None]);
        let kept = map.remove(&HashSet::from([11, 13, 12]));
        assert_eq!(kept, [0, 4]);
        let (changes, new) = (map.changes, UnitMap::new(&[10, 14], &[2, 1]));
        assert_eq!((&map.units, &map.neighbors), (&new.units, &new.neighbors));
        map.append(&[], &[]);
        assert_eq!(map.remove(&HashSet::from([11])), [0, 1]);
        assert_eq!((changes, map.changes), (3, 3), "nothing came or went");
    }

    #[test]
    fn both_sides_order_migrated_units_equally() {
        let unit = |unit, origin, remote, position| MigratedUnit { unit, origin, remote, position };
        // Rank 1 sends 11 away, and gets 20 and 21 from rank 2, 5 from rank 0; all are exchanged with rank 7.
        let mut map = UnitMap::new(&[10, 11, 12], &[7, 7, 7]);
        map.migrate(&[0, 2], &[unit(20, 2, 7, 1), unit(21, 2, 7, 0), unit(5, 0, 7, 4)]);
        let list = |map: &UnitMap, at: usize| map.units_of(&map.neighbors[at]).collect::<Vec<_>>();
        assert_eq!(map.units, [10, 12, 20, 21, 5]);
        assert_eq!(list(&map, 0), [10, 12, 5, 21, 20]);
        assert_eq!(map.neighbors[0].contiguous_range(), None, "the indices do not ascend");
        // Rank 7 of the other scale.
        let (units, ranks) = ([1, 2, 3, 4, 5, 10, 11, 12, 21, 20], [0, 0, 0, 0, 0, 1, 1, 1, 2, 2]);
        let mut other = UnitMap::new(&units, &ranks);
        assert!(other.relocate(&[(2, 1, 1), (1, 1, 2), (0, 4, 1), (2, 0, 1)]).is_some());
        assert_eq!((other.units.clone(), other.changes), (units.to_vec(), 2), "the data keeps its order");
        let lists: Vec<Vec<UnitId>> = (0..3).map(|at| list(&other, at)).collect();
        assert_eq!(lists, [vec![1, 2, 3, 4], vec![10, 12, 5, 21, 20], vec![11]]);
        let order = map.exchange_order();
        map.reorder(&order);
        assert_eq!((list(&map, 0), map.neighbors[0].contiguous_range()), (map.units.clone(), Some(0..5)));
        assert!(other.relocate(&[(1, 0, 2), (1, 0, 0)]).is_none(), "a unit is moved twice");
        assert!(other.relocate(&[(5, 0, 2)]).is_none(), "rank 5 is not a neighbor");
    }
}
