//! The communication pattern of a coupling on one rank: the units exchanged with each rank of the other scale.

use std::collections::HashSet;
use std::ops::Range;

use super::data::UnitId;

/// A rank of the other scale, and the units exchanged with it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Neighbor {
    /// Rank in the other scale.
    pub(super) rank: usize,
    /// Indices of the units in this rank's data, in the order of the exchange, which is the same on both sides.
    pub(super) indices: Vec<u32>,
}

impl Neighbor {
    /// Returns the range of indices if the units are contiguous in this rank's data, so that their values need not be
    /// gathered.
    pub(super) fn contiguous_range(&self) -> Option<Range<usize>> {
        // The indices are ascending.
        let (first, last) = (*self.indices.first()? as usize, *self.indices.last()? as usize);
        (last - first + 1 == self.indices.len()).then_some(first..last + 1)
    }
}

/// The units of this rank, in the order of its data, and its neighbors, ordered by rank.
#[derive(Clone, Debug, Default)]
pub(super) struct UnitMap {
    pub(super) units: Vec<UnitId>,
    pub(super) neighbors: Vec<Neighbor>,
    /// Number of changes by addition or removal of units.
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
                self.neighbors.insert(at, Neighbor { rank, indices: Vec::new() });
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
}
