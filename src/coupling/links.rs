//! Which units go between this rank and each rank of the other scale: the pattern of a coupling as one rank knows it.

use std::collections::HashSet;
use std::ops::Range;

use super::data::UnitId;

/// A rank of the other scale, and the units that this rank exchanges with it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Neighbor {
    /// Its rank in the other scale.
    pub rank: usize,
    /// Where the units lie in this rank's data, in the order in which they are exchanged: the same on both sides.
    pub places: Vec<u32>,
}

impl Neighbor {
    /// Where its units lie one behind the other in this rank's data, if they do: such values need not be gathered.
    pub(super) fn run(&self) -> Option<Range<usize>> {
        // Places ascend.
        let (first, last) = (*self.places.first()? as usize, *self.places.last()? as usize);
        (last - first + 1 == self.places.len()).then_some(first..last + 1)
    }
}

/// The units of this rank, in the order of its data, and its neighbors by rank.
#[derive(Clone, Debug, Default)]
pub struct Links {
    pub(super) units: Vec<UnitId>,
    pub(super) neighbors: Vec<Neighbor>,
    /// How often units have come or gone.
    pub(super) changes: u64,
}

impl Links {
    /// Each unit with the rank that it is exchanged with.
    pub(super) fn new(units: &[UnitId], ranks: &[usize]) -> Self {
        let mut links = Self::default();
        links.append(units, ranks);
        links
    }

    /// More units behind those that are there.
    pub(super) fn append(&mut self, units: &[UnitId], ranks: &[usize]) {
        let first = self.units.len();
        self.units.extend_from_slice(units);
        self.changes += u64::from(!units.is_empty());
        for (place, &rank) in (first as u32..).zip(ranks) {
            self.neighbor(rank).places.push(place);
        }
    }

    fn neighbor(&mut self, rank: usize) -> &mut Neighbor {
        let at = match self.neighbors.binary_search_by_key(&rank, |neighbor| neighbor.rank) {
            Ok(at) => at,
            Err(at) => {
                self.neighbors.insert(at, Neighbor { rank, places: Vec::new() });
                at
            }
        };
        &mut self.neighbors[at]
    }

    /// Without some units. The others keep their order; where they were before is what comes back.
    pub(super) fn remove(&mut self, gone: &HashSet<UnitId>) -> Vec<u32> {
        let kept: Vec<u32> =
            (0..self.units.len() as u32).filter(|&place| !gone.contains(&self.units[place as usize])).collect();
        let mut moved = vec![None; self.units.len()];
        for (new, &old) in (0_u32..).zip(&kept) {
            moved[old as usize] = Some(new);
        }
        for neighbor in &mut self.neighbors {
            neighbor.places = neighbor.places.iter().filter_map(|&place| moved[place as usize]).collect();
        }
        self.neighbors.retain(|neighbor| !neighbor.places.is_empty());
        self.changes += u64::from(kept.len() < self.units.len());
        self.units = kept.iter().map(|&place| self.units[place as usize]).collect();
        kept
    }

    /// The units that are exchanged with a neighbor, in order.
    pub(super) fn units_of<'a>(&'a self, neighbor: &'a Neighbor) -> impl Iterator<Item = UnitId> + 'a {
        neighbor.places.iter().map(|&place| self.units[place as usize])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn units_keep_their_order_when_some_come_and_go() {
        let mut links = Links::new(&[10, 11, 12, 13], &[2, 0, 2, 0]);
        links.append(&[14], &[1]);
        assert_eq!(
            links.neighbors.iter().map(|n| (n.rank, n.places.clone())).collect::<Vec<_>>(),
            [(0, vec![1, 3]), (1, vec![4]), (2, vec![0, 2])]
        );
        let runs: Vec<Option<Range<usize>>> = links.neighbors.iter().map(Neighbor::run).collect();
        assert_eq!(runs, [None, Some(4..5), None]);
        let kept = links.remove(&HashSet::from([11, 13, 12]));
        assert_eq!(kept, [0, 4]);
        let (changes, new) = (links.changes, Links::new(&[10, 14], &[2, 1]));
        assert_eq!((&links.units, &links.neighbors), (&new.units, &new.neighbors));
        links.append(&[], &[]);
        assert_eq!(links.remove(&HashSet::from([11])), [0, 1]);
        assert_eq!((changes, links.changes), (3, 3), "nothing came or went");
    }
}
