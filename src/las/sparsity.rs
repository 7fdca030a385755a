//! A validated sparsity pattern.

use std::ops::Range;

use thiserror::Error;

use crate::parallel;

/// The sparsity pattern of a matrix in compressed row storage; the columns of each row are strictly ascending.
///
/// The constructors check this invariant; all other code relies on it.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub struct Sparsity {
    cols: usize,
    row_offsets: Box<[u32]>,
    columns: Box<[u32]>,
}

/// The reason why arrays do not form a sparsity pattern.
#[derive(Clone, Debug, Error, PartialEq, Eq)]
pub enum SparsityError {
    /// Row offsets do not start at 0, decrease, or do not end at the number of entries.
    #[error("row starts must rise from 0 to {entries}; entry {row} is {found}")]
    RowStart {
        /// Position of the wrong offset.
        row: usize,
        /// The value of that offset.
        found: usize,
        /// Number of column indices.
        entries: usize,
    },
    /// There are no row offsets, of which a pattern without rows has one.
    #[error("there are no row starts: a pattern without rows has one, 0")]
    NoRowStarts,
    /// A column is out of range.
    #[error("row {row} names column {column}, but there are {cols}")]
    Column {
        /// Row.
        row: usize,
        /// Column.
        column: usize,
        /// Number of columns.
        cols: usize,
    },
    /// Columns of a row do not ascend strictly.
    #[error("the columns of row {row} do not ascend strictly")]
    Unsorted {
        /// Row.
        row: usize,
    },
    /// The entries, the unknowns, or the unknowns summed over the elements exceed what 32-bit signed indices can
    /// address.
    #[error("{0} is more than the 2147483647 that 32-bit indices can address")]
    TooLarge(usize),
}

impl Sparsity {
    /// Builds the pattern of a square matrix assembled from elements, each of which couples all of its unknowns.
    ///
    /// `elements` yields the unknowns of each element; negative unknowns (constrained) are skipped. The diagonal is
    /// always part of the pattern.
    ///
    /// # Errors
    /// Returns [`SparsityError::Column`] if an unknown is not below `unknowns` (its `row` is then the element number),
    /// or [`SparsityError::TooLarge`].
    pub fn from_elements<E, I>(unknowns: usize, elements: E) -> Result<Self, SparsityError>
    where
        E: IntoIterator<Item = I>,
        I: AsRef<[i32]>,
    {
        check_size(unknowns)?;
        let (mut starts, mut members) = (vec![0_u32], Vec::new());
        for (number, element) in elements.into_iter().enumerate() {
            for &unknown in element.as_ref().iter().filter(|&&unknown| unknown >= 0) {
                if unknown as usize >= unknowns {
                    return Err(SparsityError::Column { row: number, column: unknown as usize, cols: unknowns });
                }
                members.push(unknown as u32);
            }
            check_size(members.len())?;
            starts.push(members.len() as u32);
        }
        let (first, meeting) = transposed(unknowns, &starts, &members);
        Self::by_rows(unknowns, unknowns, |row, columns| {
            columns.push(row as u32);
            for &number in &meeting[first[row] as usize..first[row + 1] as usize] {
                let ends = [starts[number as usize], starts[number as usize + 1]];
                columns.extend_from_slice(&members[ends[0] as usize..ends[1] as usize]);
            }
        })
    }

    /// Builds a pattern from compressed rows and checks the invariant.
    ///
    /// # Errors
    /// Returns the first violation of the invariant.
    pub fn from_rows(cols: usize, row_offsets: Vec<u32>, columns: Vec<u32>) -> Result<Self, SparsityError> {
        check_size(cols)?;
        check_size(columns.len())?;
        check_row_start(&row_offsets, columns.len())?;
        for (row, ends) in row_offsets.windows(2).enumerate() {
            let these = &columns[ends[0] as usize..ends[1] as usize];
            if let Some(&column) = these.iter().find(|&&c| c as usize >= cols) {
                return Err(SparsityError::Column { row, column: column as usize, cols });
            }
            if these.windows(2).any(|pair| pair[0] >= pair[1]) {
                return Err(SparsityError::Unsorted { row });
            }
        }
        Ok(Self { cols, row_offsets: row_offsets.into(), columns: columns.into() })
    }

    /// Returns the pattern of the first rows.
    ///
    /// # Panics
    /// Panics if there are fewer rows.
    #[must_use]
    pub fn first_rows(&self, rows: usize) -> Self {
        let row_offsets = &self.row_offsets[..=rows];
        let columns = &self.columns[..self.row_offsets[rows] as usize];
        Self { cols: self.cols, row_offsets: row_offsets.into(), columns: columns.into() }
    }

    /// Builds the full pattern of a dense matrix.
    ///
    /// # Panics
    /// Panics if the pattern exceeds the range of 32-bit indices.
    pub fn full(rows: usize, cols: usize) -> Self {
        let fits = rows.checked_mul(cols).is_some_and(|entries| check_size(entries).is_ok());
        assert!(fits && check_size(rows).is_ok(), "{rows} by {cols} entries are more than 32-bit indices can address");
        let row_offsets = (0..=rows).map(|row| (row * cols) as u32).collect();
        Self { cols, row_offsets, columns: (0..rows).flat_map(|_| 0..cols as u32).collect() }
    }

    /// The pattern of the sum of two matrices of the same shape.
    ///
    /// # Errors
    /// Returns [`SparsityError::TooLarge`] if the union has too many entries.
    ///
    /// # Panics
    /// Panics in debug builds if the shapes differ.
    pub fn union(&self, other: &Self) -> Result<Self, SparsityError> {
        debug_assert_eq!((self.rows(), self.cols), (other.rows(), other.cols), "two patterns of one shape");
        Self::by_rows(self.cols, self.rows(), |row, columns| {
            columns.extend_from_slice(self.row(row));
            columns.extend_from_slice(other.row(row));
        })
    }

    /// The pattern of the product of a matrix with this pattern and a matrix with the pattern `other`.
    ///
    /// # Errors
    /// Returns [`SparsityError::TooLarge`] if the product has too many entries.
    ///
    /// # Panics
    /// Panics if an entry of this pattern has a column that is not a row of `other`.
    pub fn product(&self, other: &Self) -> Result<Self, SparsityError> {
        Self::by_rows(other.cols, self.rows(), |row, columns| {
            for &k in self.row(row) {
                columns.extend_from_slice(other.row(k as usize));
            }
        })
    }

    /// The pattern of the transpose.
    #[must_use]
    pub fn transpose(&self) -> Self {
        let (row_offsets, columns) = transposed(self.cols, &self.row_offsets, &self.columns);
        Self { cols: self.rows(), row_offsets: row_offsets.into(), columns: columns.into() }
    }

    /// Builds a pattern row by row; `fill` may append the columns of a row unsorted and repeatedly.
    pub(super) fn by_rows(
        cols: usize,
        rows: usize,
        fill: impl Fn(usize, &mut Vec<u32>) + Sync + Send,
    ) -> Result<Self, SparsityError> {
        // One thread needs no copy of the columns.
        let rows_per_task = if parallel::threads() == 1 { rows.max(1) } else { ROWS_PER_TASK };
        let starts = (0..rows).step_by(rows_per_task);
        let mut parts = parallel::map(starts, |start| {
            let (mut lengths, mut columns, mut one) = (Vec::with_capacity(rows_per_task), Vec::new(), Vec::new());
            for row in start..rows.min(start + rows_per_task) {
                one.clear();
                fill(row, &mut one);
                one.sort_unstable();
                one.dedup();
                columns.extend_from_slice(&one);
                lengths.push(one.len());
            }
            (lengths, columns)
        });
        let row_offsets = row_offsets(parts.iter().flat_map(|(lengths, _)| lengths.iter().copied()))?;
        if let [(_, columns)] = &mut parts[..] {
            return Ok(Self { cols, row_offsets: row_offsets.into(), columns: std::mem::take(columns).into() });
        }
        let mut columns = parallel::filled(0, row_offsets[rows] as usize);
        let to = parallel::split(&mut columns, parts.iter().map(|(_, columns)| columns.len()));
        parallel::map(to.into_iter().zip(&parts), |(to, (_, columns))| to.copy_from_slice(columns));
        Ok(Self { cols, row_offsets: row_offsets.into(), columns: columns.into() })
    }

    /// Number of rows.
    #[inline(always)]
    pub fn rows(&self) -> usize {
        self.row_offsets.len() - 1
    }

    /// Number of columns.
    #[inline(always)]
    pub fn cols(&self) -> usize {
        self.cols
    }

    /// Number of entries (structural nonzeros).
    #[inline(always)]
    pub fn nnz(&self) -> usize {
        self.columns.len()
    }

    /// The offset of the first entry of each row, followed by the number of entries.
    #[inline(always)]
    pub fn row_offsets(&self) -> &[u32] {
        &self.row_offsets
    }

    /// The column of every entry, row by row.
    #[inline(always)]
    pub fn col_indices(&self) -> &[u32] {
        &self.columns
    }

    /// The columns of one row.
    ///
    /// # Panics
    /// Panics if the pattern has no such row.
    #[inline(always)]
    pub fn row(&self, row: usize) -> &[u32] {
        &self.columns[self.range(row)]
    }

    /// The index range of the entries of one row.
    #[inline(always)]
    pub(crate) fn range(&self, row: usize) -> std::ops::Range<usize> {
        self.row_offsets[row] as usize..self.row_offsets[row + 1] as usize
    }

    /// The position of `(row, column)` among the entries, or `None` if it is not in the pattern.
    #[inline(always)]
    pub fn find(&self, row: usize, column: usize) -> Option<usize> {
        let start = *self.row_offsets.get(row)? as usize;
        let end = *self.row_offsets.get(row + 1)? as usize;
        self.columns[start..end].binary_search_by(|&at| (at as usize).cmp(&column)).ok().map(|k| start + k)
    }

    /// Returns true if the pattern is square and contains `(j, i)` for every entry `(i, j)`.
    pub fn is_symmetric(&self) -> bool {
        self.rows() == self.cols && self.first_unsymmetric_entry().is_none()
    }

    /// The first entry `(row, column)` whose transpose `(column, row)` is not in the pattern.
    pub fn first_unsymmetric_entry(&self) -> Option<(usize, usize)> {
        if self.has_all_transposes() {
            return None;
        }
        let columns = |row: usize| self.row(row).iter().map(|&column| column as usize);
        let alone = |row: usize| columns(row).find(|&column| self.find(column, row).is_none());
        (0..self.rows()).find_map(|row| alone(row).map(|column| (row, column)))
    }
    /// Returns true if the pattern is square and contains the transpose of every entry. Rows ascend, and so do the
    /// columns of row `j`: the next of them that was not met yet must be the row of the next entry in column `j`.
    fn has_all_transposes(&self) -> bool {
        let mut next = self.row_offsets.to_vec();
        let mut is_met = |row: usize, column: u32| {
            let Some(at) = next.get_mut(column as usize) else { return false };
            *at += 1;
            self.columns.get(*at as usize - 1) == Some(&(row as u32))
        };
        self.rows() == self.cols && (0..self.rows()).all(|row| self.row(row).iter().all(|&column| is_met(row, column)))
    }

    /// Replaces every row and column `k` by the consecutive ones from `first[k]` to before `first[k + 1]`.
    ///
    /// # Errors
    /// Returns [`SparsityError::TooLarge`] if the pattern has too many entries.
    ///
    /// # Panics
    /// Panics if `first` has fewer than one entry per row and one more, or fewer than one per column and one more.
    pub fn expanded(&self, first: &[u32]) -> Result<Self, SparsityError> {
        let expanded = |k: u32| first[k as usize]..first[k as usize + 1];
        let length = |row: usize| self.row(row).iter().map(|&column| expanded(column).len()).sum::<usize>();
        let lengths = parallel::collect(self.rows(), length);
        let of_rows = (0..).zip(&lengths).flat_map(|(row, &length)| expanded(row).map(move |_| length));
        let row_offsets = row_offsets(of_rows)?;
        let mut columns = parallel::filled(0, row_offsets.last().map_or(0, |&entries| entries as usize));
        let tasks = (0..self.rows()).step_by(ROWS_PER_TASK).map(|start| start..self.rows().min(start + ROWS_PER_TASK));
        let entries = |rows: Range<usize>| rows.map(|row| expanded(row as u32).len() * lengths[row]).sum();
        let to = parallel::split(&mut columns, tasks.clone().map(entries));
        parallel::map(tasks.zip(to), |(rows, mut to)| {
            for row in rows {
                for _ in expanded(row as u32) {
                    let (one, rest) = std::mem::take(&mut to).split_at_mut(lengths[row]);
                    let columns = self.row(row).iter().flat_map(|&column| expanded(column));
                    one.iter_mut().zip(columns).for_each(|(to, column)| *to = column);
                    to = rest;
                }
            }
        });
        let cols = first[self.cols] as usize;
        Ok(Self { cols, row_offsets: row_offsets.into(), columns: columns.into() })
    }
}

/// The number of rows that a task fills.
const ROWS_PER_TASK: usize = 4096;

/// Returns the offsets of rows of these lengths.
fn row_offsets(lengths: impl Iterator<Item = usize>) -> Result<Vec<u32>, SparsityError> {
    let (mut offsets, mut end) = (Vec::with_capacity(lengths.size_hint().0 + 1), 0);
    offsets.push(0);
    for length in lengths {
        end += length;
        check_size(end)?;
        offsets.push(end as u32);
    }
    Ok(offsets)
}

/// Returns the index of the first item of each of `count` groups, followed by the number of items, given the group of
/// every item.
pub(crate) fn offsets(count: usize, groups: impl Iterator<Item = usize>) -> Vec<u32> {
    let mut offsets = vec![0; count + 1];
    for group in groups {
        offsets[group + 1] += 1;
    }
    for group in 0..count {
        offsets[group + 1] += offsets[group];
    }
    offsets
}

/// For each column of compressed rows, lists the rows that contain it, in ascending order; returns the offset of each
/// column's list and the concatenated lists.
fn transposed(cols: usize, starts: &[u32], columns: &[u32]) -> (Vec<u32>, Vec<u32>) {
    let first = offsets(cols, columns.iter().map(|&column| column as usize));
    let mut next = first.clone();
    let mut rows = vec![0; columns.len()];
    for (row, ends) in starts.windows(2).enumerate() {
        for &column in &columns[ends[0] as usize..ends[1] as usize] {
            let at = &mut next[column as usize];
            rows[*at as usize] = row as u32;
            *at += 1;
        }
    }
    (first, rows)
}

fn check_size(count: usize) -> Result<(), SparsityError> {
    if count > i32::MAX as usize { Err(SparsityError::TooLarge(count)) } else { Ok(()) }
}

fn check_row_start(row_offsets: &[u32], entries: usize) -> Result<(), SparsityError> {
    let wrong = |row: usize| SparsityError::RowStart { row, found: row_offsets[row] as usize, entries };
    match row_offsets.first() {
        Some(0) => {}
        Some(_) => return Err(wrong(0)),
        None => return Err(SparsityError::NoRowStarts),
    }
    if let Some(row) = row_offsets.windows(2).position(|pair| pair[0] > pair[1]) {
        return Err(wrong(row + 1));
    }
    if row_offsets[row_offsets.len() - 1] as usize != entries {
        return Err(wrong(row_offsets.len() - 1));
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn elements_couple_all_their_free_unknowns() {
        let pattern = Sparsity::from_elements(4, [vec![0, 1, -1], vec![1, 3]]).unwrap();
        assert_eq!(pattern.row(0), [0, 1]);
        assert_eq!(pattern.row(1), [0, 1, 3]);
        assert_eq!(pattern.row(2), [2], "the diagonal is there even where no element is");
        assert_eq!(pattern.row(3), [1, 3]);
        assert_eq!(pattern.find(1, 3), Some(4));
        assert_eq!(pattern.find(3, 0), None);
        assert!(pattern.is_symmetric());
    }

    #[test]
    fn broken_patterns_are_refused() {
        let e = Sparsity::from_elements(2, [[0, 2]]).unwrap_err();
        assert_eq!(e, SparsityError::Column { row: 0, column: 2, cols: 2 });
        let cases = [
            (vec![], vec![], SparsityError::NoRowStarts),
            (vec![1, 2], vec![0, 0], SparsityError::RowStart { row: 0, found: 1, entries: 2 }),
            (vec![0, 2, 1], vec![0], SparsityError::RowStart { row: 2, found: 1, entries: 1 }),
            (vec![0, 1], vec![0, 1], SparsityError::RowStart { row: 1, found: 1, entries: 2 }),
            (vec![0, 1], vec![5], SparsityError::Column { row: 0, column: 5, cols: 3 }),
            (vec![0, 2], vec![1, 1], SparsityError::Unsorted { row: 0 }),
        ];
        for (row_offsets, columns, expected) in cases {
            assert_eq!(Sparsity::from_rows(3, row_offsets, columns).unwrap_err(), expected);
        }
    }
}
