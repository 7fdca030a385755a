//! The rows of a rank in a system of which each rank holds a part.

use std::fmt;
use std::sync::Arc;

use super::context::OwnedComm;
use super::error::PetscError;
use super::ffi;
use super::handle::Handle;
use super::vector::count;
use crate::las::{RankRows, Sparsity};

/// The rows of this rank, and what all vectors of the system share.
pub(super) struct Parts {
    rows: Arc<RankRows>,
    /// A vector whose duplicates share the plan of its exchange of ghost entries; `None` on one rank, which has no
    /// ghosts.
    template: Option<Handle<ffi::_p_Vec>>,
    comm: Arc<OwnedComm>,
}

// SAFETY: the template is the only field that other threads could not use otherwise. It is only duplicated and
// destroyed, both under the lock that serializes the calls of PETSc.
unsafe impl Sync for Parts {}

impl Parts {
    /// Checks the rows of all ranks; collective.
    pub(super) fn new(comm: &Arc<OwnedComm>, rows: RankRows) -> Result<Self, PetscError> {
        check(comm, &rows)?;
        let sizes = [count(rows.own.len())?, count(rows.total)?, count(rows.ghosts.len())?];
        let ghosts: Vec<i32> = rows.ghosts.iter().map(|&row| row as i32).collect();
        let template = if comm.ranks() == 1 { None } else { Some(ghosted(comm, sizes, &ghosts)?) };
        Ok(Self { rows: Arc::new(rows), template, comm: Arc::clone(comm) })
    }

    pub(super) fn rows(&self) -> &Arc<RankRows> {
        &self.rows
    }

    pub(super) fn comm(&self) -> &OwnedComm {
        &self.comm
    }

    /// Returns the vector to duplicate; `None` on one rank.
    pub(super) fn template(&self) -> Option<ffi::Vec> {
        self.template.as_ref().map(Handle::raw)
    }

    /// Returns true if the part of this rank of a pattern consists of full blocks of `size` by `size` global numbers.
    /// If that is so on all ranks, all ranks own whole blocks.
    pub(super) fn has_blocks(&self, pattern: &Sparsity, size: usize) -> bool {
        if size < 2 || !pattern.rows().is_multiple_of(size) {
            return false;
        }
        let global = |local: u32| self.rows.global_row(local as usize);
        (0..pattern.rows()).step_by(size).all(|first| {
            let columns = pattern.row(first);
            let full = columns.chunks(size).all(|block| {
                let start = global(block[0]);
                let follows = |(k, &column): (usize, &u32)| global(column) == start + k;
                block.len() == size && start.is_multiple_of(size) && block.iter().enumerate().all(follows)
            });
            full && (first + 1..first + size).all(|row| pattern.row(row) == columns)
        })
    }

    /// Returns the own rows of a pattern as compressed rows of global columns, which ascend in every row.
    pub(super) fn compressed(&self, pattern: &Sparsity) -> (Vec<i32>, Vec<i32>) {
        let (own, mut columns) = (&self.rows.own, Vec::with_capacity(pattern.nnz()));
        for row in 0..pattern.rows() {
            let (inside, ghosts) = pattern.row(row).split_at(self.inside(pattern.row(row)));
            let ghosts = ghosts.iter().map(|&column| self.rows.ghosts[column as usize - own.len()] as usize);
            let below = ghosts.clone().take_while(|&ghost| ghost < own.start);
            let above = ghosts.clone().skip_while(|&ghost| ghost < own.start);
            let inside = inside.iter().map(|&column| own.start + column as usize);
            columns.extend(below.chain(inside).chain(above).map(|column| column as i32));
        }
        (pattern.row_offsets().iter().map(|&start| start as i32).collect(), columns)
    }

    /// Returns the number of columns of a row that this rank owns; they precede the ghosts.
    fn inside(&self, columns: &[u32]) -> usize {
        columns.partition_point(|&column| (column as usize) < self.rows.own.len())
    }

    /// Returns an error unless the pattern has the own rows and a column per local number.
    pub(super) fn check_pattern(&self, pattern: &Sparsity) -> Result<(), PetscError> {
        let (found, expected) = ((pattern.rows(), pattern.cols()), (self.rows.own.len(), self.rows.local()));
        if found == expected {
            return Ok(());
        }
        let text = format!(
            "a pattern of {} by {} entries on a rank with {} own rows and {} local numbers",
            found.0, found.1, expected.0, expected.1
        );
        Err(PetscError::found(ffi::ERR_ARG_SIZ, "", text))
    }
}

impl fmt::Debug for Parts {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_tuple("Parts").field(&self.rows).finish()
    }
}

/// Creates a vector with ghost entries. `sizes` are the numbers of own entries, of all entries and of ghosts.
fn ghosted(comm: &OwnedComm, sizes: [i32; 3], ghosts: &[i32]) -> Result<Handle<ffi::_p_Vec>, PetscError> {
    let (raw, [own, total, held]) = (comm.raw(), sizes);
    Handle::new(comm.session(), |out| {
        // SAFETY: PETSc is initialized and the communicator live; PETSc copies the ghost rows, which are in range.
        unsafe { ffi::VecCreateGhost(raw, own, total, held, ghosts.as_ptr(), out) }
    })
}

/// Compares the rows of all ranks, with the same outcome on all of them.
fn check(comm: &OwnedComm, rows: &RankRows) -> Result<(), PetscError> {
    let RankRows { own, ghosts, total } = rows;
    let is_bad = |&k: &usize| {
        let row = ghosts[k] as usize;
        row >= *total || own.contains(&row) || k > 0 && ghosts[k - 1] >= ghosts[k]
    };
    // The first bad ghost: one more than its position, and its row.
    let [at, ghost] = (0..ghosts.len()).find(is_bad).map_or([0, 0], |k| [k as u64 + 1, u64::from(ghosts[k])]);
    let all = comm.all_gather(&[own.start as u64, own.end as u64, *total as u64, at, ghost]);
    let all = all.as_chunks::<5>().0;
    let wrong = |text: String| Err(PetscError::found(ffi::ERR_ARG_OUTOFRANGE, "", text));
    let rows_of_first = all.first().map_or(0, |first| first[2]);
    let mut next = 0;
    for (rank, &[start, end, total, at, ghost]) in all.iter().enumerate() {
        if total != rows_of_first {
            return wrong(format!("rank {rank} counts {total} rows of all ranks, but rank 0 counts {rows_of_first}"));
        }
        if start != next || end < start {
            return wrong(format!("rank {rank} owns the rows {start}..{end}, which must begin at {next}"));
        }
        if at > 0 {
            let number = at - 1;
            return wrong(format!(
                "ghost {number} of rank {rank} is row {ghost}: ghosts ascend, are below {total} and not own rows"
            ));
        }
        next = end;
    }
    if next != rows_of_first {
        return wrong(format!("the ranks own {next} of {rows_of_first} rows"));
    }
    Ok(())
}
