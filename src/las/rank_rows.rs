//! The rows of a linear system that one rank holds, where each rank holds a part.

use std::ops::Range;

/// The rows of a distributed linear system that one rank reads or writes.
///
/// Rows are numbered globally over all ranks; each rank owns a contiguous range. On a rank, all code uses **local
/// numbers**: first its own rows in their order, then the ghost rows, ascending by their global numbers. A pattern has one
/// row per own row and one column per local number.
///
/// * A vector has the entries of the own rows, and copies of those of the ghost rows. Writes to ghost rows are dropped;
///   [`VectorOps::finish`](super::VectorOps::finish), which is collective, and solvers update the copies.
/// * A matrix has the own rows; writes to ghost rows are dropped. Each rank must therefore write all contributions to
///   its own rows.
/// * Norms and dot products are collective, and every rank gets the same bits.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "app", derive(serde::Serialize, serde::Deserialize))]
pub struct RankRows {
    /// The global numbers of the rows that the rank owns.
    pub own: Range<usize>,
    /// The global numbers of the rows of other ranks whose entries the rank reads, ascending.
    pub ghosts: Vec<u32>,
    /// The number of rows of all ranks.
    pub total: usize,
}

impl RankRows {
    /// Returns the number of local numbers: own rows and ghost rows.
    pub fn local(&self) -> usize {
        self.own.len() + self.ghosts.len()
    }

    /// Returns the local number of a global row; `None` if the rank does not hold it.
    pub fn local_number(&self, row: usize) -> Option<usize> {
        if self.own.contains(&row) {
            return Some(row - self.own.start);
        }
        let ghost = self.ghosts.binary_search(&u32::try_from(row).ok()?).ok()?;
        Some(self.own.len() + ghost)
    }

    /// Returns the global row of a local number.
    ///
    /// # Panics
    /// Panics if there is no such local number.
    pub fn global_row(&self, local: usize) -> usize {
        if local < self.own.len() { self.own.start + local } else { self.ghosts[local - self.own.len()] as usize }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn local_numbers_are_those_of_own_rows_then_of_ghosts() {
        let rows = RankRows { own: 4..7, ghosts: vec![1, 3, 9], total: 10 };
        assert_eq!(rows.local(), 6);
        let expected = [None, Some(3), None, Some(4), Some(0), Some(1), Some(2), None, None, Some(5)];
        for (row, expected) in expected.into_iter().enumerate() {
            assert_eq!(rows.local_number(row), expected);
            assert!(expected.is_none_or(|local| rows.global_row(local) == row));
        }
        assert_eq!(rows.local_number(usize::MAX), None);
    }
}
