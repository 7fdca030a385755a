//! Migration plans: which units of which ranks go to which other ranks.

use std::collections::BTreeMap;
use std::fmt::{self, Display};

use super::error::{BalanceError, MoveError};
use super::loads::Loads;

/// The units of one rank that move to other ranks of the scale, by target; a unit is given by its index in the data of
/// its rank.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Moves {
    /// Ascending indices by target.
    targets: BTreeMap<usize, Vec<u32>>,
}

impl Moves {
    /// Adds units that move to a rank.
    #[must_use]
    pub fn with(mut self, units: &[u32], to: usize) -> Self {
        if !units.is_empty() {
            let list = self.targets.entry(to).or_default();
            list.extend_from_slice(units);
            list.sort_unstable();
        }
        self
    }

    /// Returns the targets in ascending order, each with its units in ascending order.
    pub fn iter(&self) -> impl Iterator<Item = (usize, &[u32])> {
        self.targets.iter().map(|(&to, units)| (to, units.as_slice()))
    }

    /// Returns the number of units that move.
    pub fn len(&self) -> usize {
        self.targets.values().map(Vec::len).sum()
    }

    /// Returns true if no unit moves.
    pub fn is_empty(&self) -> bool {
        self.targets.is_empty()
    }

    /// Checks that every unit exists and is moved once, to another rank that exists: for rank `rank` of `ranks`, with
    /// `units` units.
    ///
    /// # Errors
    /// Returns the first error.
    pub fn check(&self, rank: usize, units: usize, ranks: usize) -> Result<(), MoveError> {
        let mut is_moved = vec![false; if self.is_empty() { 0 } else { units }];
        for (to, list) in self.iter() {
            if to >= ranks {
                return Err(MoveError::Rank { to, ranks });
            }
            for &unit in list {
                let is_moved = is_moved.get_mut(unit as usize).ok_or(MoveError::Unit { unit, units })?;
                if std::mem::replace(is_moved, true) {
                    return Err(MoveError::Twice { unit });
                }
                if to == rank {
                    return Err(MoveError::Itself { unit });
                }
            }
        }
        Ok(())
    }

    /// Returns the indices of the units that stay, of `units` units.
    pub(super) fn stayed(&self, units: usize) -> Vec<u32> {
        let mut stays = vec![true; units];
        self.iter().flat_map(|(_, list)| list).for_each(|&unit| stays[unit as usize] = false);
        (0..units as u32).filter(|&unit| stays[unit as usize]).collect()
    }
}

/// As in table 4.1 of the reference text, with numbers of ranks: `{(2,4):5,(3,6,7):7}`.
impl Display for Moves {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let list = |units: &[u32]| units.iter().map(u32::to_string).collect::<Vec<_>>().join(",");
        let targets: Vec<String> = self.iter().map(|(to, units)| format!("({}):{to}", list(units))).collect();
        write!(f, "{{{}}}", targets.join(","))
    }
}

/// The moves of all ranks of a scale.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct MigrationPlan {
    ranks: Vec<Moves>,
}

impl MigrationPlan {
    /// Creates a plan that moves no unit.
    pub fn new(ranks: usize) -> Self {
        Self { ranks: vec![Moves::default(); ranks] }
    }

    /// Creates the plan that takes every unit to its target. `targets` contains the rank of every unit, in the order of
    /// [`Loads::weights`].
    ///
    /// # Errors
    /// Returns [`BalanceError`] if the number of targets is wrong or a rank does not exist.
    pub fn to_targets(loads: &Loads, targets: &[u32]) -> Result<Self, BalanceError> {
        let (units, found) = (loads.units(), targets.len());
        if found != units {
            return Err(BalanceError::Count { rank: 0, units, found, what: "targets" });
        }
        let mut plan = Self::new(loads.ranks());
        let mut rest = targets;
        for (rank, (moves, units)) in plan.ranks.iter_mut().zip(loads.counts()).enumerate() {
            let (own, behind) = rest.split_at(units);
            rest = behind;
            for (unit, &to) in (0_u32..).zip(own).filter(|&(_, &to)| to as usize != rank) {
                moves.targets.entry(to as usize).or_default().push(unit);
            }
        }
        plan.check(&loads.counts())?;
        Ok(plan)
    }

    /// Returns the number of ranks.
    pub fn ranks(&self) -> usize {
        self.ranks.len()
    }

    /// Returns the moves of a rank.
    ///
    /// # Panics
    /// Panics if there is no such rank.
    pub fn of(&self, rank: usize) -> &Moves {
        &self.ranks[rank]
    }

    /// Sets the moves of a rank.
    ///
    /// # Panics
    /// Panics if there is no such rank.
    pub fn set(&mut self, rank: usize, moves: Moves) {
        self.ranks[rank] = moves;
    }

    /// Returns the number of units that move.
    pub fn len(&self) -> usize {
        self.ranks.iter().map(Moves::len).sum()
    }

    /// Returns true if no unit moves.
    pub fn is_empty(&self) -> bool {
        self.ranks.iter().all(Moves::is_empty)
    }

    /// Checks the moves of all ranks, whose numbers of units are `counts`. A valid plan conserves units: each of them
    /// leaves one rank and arrives on one other.
    ///
    /// # Errors
    /// Returns [`BalanceError`] with the first rank whose moves are invalid.
    pub fn check(&self, counts: &[usize]) -> Result<(), BalanceError> {
        let (found, ranks) = (self.ranks(), counts.len());
        if found != ranks {
            return Err(BalanceError::Ranks { found, ranks });
        }
        let check = |(rank, (moves, &units)): (usize, (&Moves, &usize))| {
            moves.check(rank, units, ranks).map_err(|error| BalanceError::Plan { rank, error })
        };
        self.ranks.iter().zip(counts).enumerate().try_for_each(check)
    }

    /// Returns the sequence of the units of all ranks after the migration, and how many of them each rank has: `counts`
    /// contains these numbers before it. A unit is given by its position in the sequence before. On each rank, the units
    /// that stayed come first in their order, then those that arrived, ordered by origin rank and index.
    ///
    /// # Errors
    /// Returns [`BalanceError`] if the plan does not fit.
    pub fn sequence_after(&self, counts: &[usize]) -> Result<(Vec<usize>, Vec<usize>), BalanceError> {
        self.check(counts)?;
        let mut moved = vec![false; counts.iter().sum()];
        let mut arrived: Vec<Vec<usize>> = vec![Vec::new(); counts.len()];
        let mut first = 0;
        for (moves, count) in self.ranks.iter().zip(counts) {
            for (to, units) in moves.iter() {
                for at in units.iter().map(|&unit| first + unit as usize) {
                    moved[at] = true;
                    arrived[to].push(at);
                }
            }
            first += count;
        }
        let (mut sequence, mut counts_after) = (Vec::with_capacity(moved.len()), Vec::with_capacity(counts.len()));
        first = 0;
        for (arrived, count) in arrived.into_iter().zip(counts) {
            let before = sequence.len();
            sequence.extend((first..first + count).filter(|&at| !moved[at]));
            sequence.extend(arrived);
            counts_after.push(sequence.len() - before);
            first += count;
        }
        Ok((sequence, counts_after))
    }

    /// Returns the bytes that the busiest rank sends and receives, with the sizes of the units in `loads`.
    pub fn bytes(&self, loads: &Loads) -> u64 {
        let mut bytes = vec![0; self.ranks()];
        for (rank, moves) in self.ranks.iter().enumerate() {
            for (to, units) in moves.iter() {
                let sent: u64 = units.iter().map(|&unit| loads.bytes(rank, unit)).sum();
                bytes[rank] += sent;
                bytes[to] += sent;
            }
        }
        bytes.into_iter().max().unwrap_or(0)
    }
}

/// One line per rank whose units move.
impl Display for MigrationPlan {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let moved = self.ranks.iter().enumerate().filter(|(_, moves)| !moves.is_empty());
        f.write_str(&moved.map(|(rank, moves)| format!("{rank}:{moves}")).collect::<Vec<_>>().join("\n"))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Tobin 2018, table 4.1, with the ranks A to H numbered from 0.
    #[test]
    fn plans_are_printed_as_published() {
        let mut plan = MigrationPlan::new(8);
        plan.set(0, Moves::default().with(&[4], 1));
        plan.set(2, Moves::default().with(&[3], 1));
        plan.set(6, Moves::default().with(&[3, 7, 6], 7).with(&[4], 5).with(&[2], 5));
        assert_eq!(plan.to_string(), "0:{(4):1}\n2:{(3):1}\n6:{(2,4):5,(3,6,7):7}");
        assert_eq!((plan.len(), plan.is_empty(), MigrationPlan::new(8).is_empty()), (7, false, true));
        assert_eq!(plan.check(&[5, 4, 5, 4, 4, 2, 9, 1]), Ok(()));
    }

    #[test]
    fn invalid_moves_are_errors() {
        let check = |moves: Moves| {
            let mut plan = MigrationPlan::new(3);
            plan.set(1, moves);
            plan.check(&[4, 4, 4]).map_err(|error| error.to_string())
        };
        let error = |text: &str| Err(format!("migration plan of rank 1: {text}"));
        assert_eq!(check(Moves::default().with(&[3, 4], 0)), error("there is no unit 4 among 4"));
        assert_eq!(check(Moves::default().with(&[2, 2], 0)), error("unit 2 is moved twice"));
        assert_eq!(check(Moves::default().with(&[1], 0).with(&[1], 2)), error("unit 1 is moved twice"));
        assert_eq!(check(Moves::default().with(&[1], 3)), error("there is no rank 3 among 3"));
        assert_eq!(check(Moves::default().with(&[1], 1)), error("unit 1 is moved to the rank that it is on"));
        let other = MigrationPlan::new(2).check(&[1, 1, 1]).map_err(|error| error.to_string());
        assert_eq!(other, Err("the migration plan is for 2 ranks; the scale has 3".into()));
    }

    #[test]
    fn targets_and_bytes() {
        let loads = Loads::new(&[vec![1.0, 2.0], vec![3.0]]).unwrap();
        let plan = MigrationPlan::to_targets(&loads, &[0, 1, 0]).unwrap();
        assert_eq!(plan.to_string(), "0:{(1):1}\n1:{(0):0}");
        assert!(MigrationPlan::to_targets(&loads, &[0, 1]).is_err());
        assert!(MigrationPlan::to_targets(&loads, &[0, 1, 2]).is_err());
        assert_eq!(plan.bytes(&loads), 0, "the sizes are unknown");
    }
}
