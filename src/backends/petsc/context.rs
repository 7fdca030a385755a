//! Where objects live: a session, a communicator, and the names of their options.

use std::fmt;
use std::ops::Range;
use std::sync::Arc;

use mpi::collective::SystemOperation;
use mpi::datatype::PartitionMut;
use mpi::environment::is_finalized;
use mpi::ffi::MPI_Comm;
use mpi::raw::AsRaw;
use mpi::topology::{Communicator, SimpleCommunicator};
use mpi::traits::CommunicatorCollectives;

use super::error::{PetscError, c_string};
use super::ffi;
use super::session::{Session, SessionError, call, lock};

/// What each rank of a communicator holds and contributes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum Distribution {
    /// Every rank runs the same program on the same data, and writes every entry. Vectors lie whole on each of them; of a
    /// matrix each keeps the rows that it owns.
    #[default]
    Copies,
}

/// How PETSc stores matrices.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum MatrixType {
    /// Compressed rows (`aij`).
    #[default]
    Aij,
    /// Compressed rows of blocks (`baij`) where the pattern consists of full blocks of the context's size, else `aij`. Takes
    /// less memory for indices and multiplies faster; solvers, sums and products of matrices work on an `aij` copy.
    Baij,
}

/// A session, a communicator, and what is made in them: how it is distributed, blocked, and named in the options database.
///
/// Cheap to clone. Making a context, and whatever reads or multiplies matrices or solves, is done by all ranks of the
/// communicator together.
#[derive(Clone, Debug)]
pub struct Context {
    team: Arc<Team>,
    prefix: Arc<str>,
    block: usize,
    kind: MatrixType,
    distribution: Distribution,
}

/// A communicator of our own.
struct Team {
    /// `None` only while it is dropped.
    comm: Option<SimpleCommunicator>,
    raw: MPI_Comm,
    rank: usize,
    ranks: usize,
    session: Session,
}

// SAFETY: a communicator belongs to no thread, and every call on it waits for all others (`session::lock`).
unsafe impl Send for Team {}
// SAFETY: as above; nothing in it changes.
unsafe impl Sync for Team {}

impl Context {
    /// Of all ranks, in a session of its own that ends with the context and all that was made in it.
    ///
    /// # Errors
    /// [`SessionError`].
    pub fn world() -> Result<Self, SessionError> {
        let session = Session::new()?;
        Ok(Self::new(&session, &SimpleCommunicator::world()))
    }

    /// Of the ranks of a communicator, which is duplicated.
    #[must_use]
    pub fn new(session: &Session, comm: &impl Communicator) -> Self {
        let alone = lock();
        let comm = comm.duplicate();
        let (raw, rank, ranks) = (comm.as_raw(), comm.rank() as usize, comm.size() as usize);
        drop(alone);
        let team = Team { comm: Some(comm), raw, rank, ranks, session: session.clone() };
        Self {
            team: Arc::new(team),
            prefix: "".into(),
            block: 3,
            kind: MatrixType::Aij,
            distribution: Distribution::Copies,
        }
    }

    /// The same, with this prefix to the names of all options: `with_prefix("body_")` lets solvers listen to
    /// `-body_ksp_type` in place of `-ksp_type`.
    #[must_use]
    pub fn with_prefix(mut self, prefix: &str) -> Self {
        self.prefix = prefix.into();
        self
    }

    /// The same, with another block size than three: ranks own whole blocks, and a matrix that consists of full blocks is
    /// known to by PETSc. Matrices of contexts with different block sizes do not meet in sums and products.
    #[must_use]
    pub fn with_block_size(mut self, size: usize) -> Self {
        self.block = size.max(1);
        self
    }

    /// The same, with matrices that are stored in this way.
    #[must_use]
    pub fn with_matrix_type(mut self, kind: MatrixType) -> Self {
        self.kind = kind;
        self
    }

    /// Writes an option into the options database: `set_option("ksp_type", "gmres")`; the prefix is put before the name. It
    /// counts for solvers that factor for the first time from then on.
    ///
    /// # Errors
    /// What PETSc reports of such a name.
    pub fn set_option(&self, name: &str, value: &str) -> Result<(), PetscError> {
        let (name, value) = (c_string(&format!("-{}{name}", self.prefix))?, c_string(value)?);
        // SAFETY: PETSc is initialized, and copies both.
        call(|| unsafe { ffi::PetscOptionsSetValue(std::ptr::null_mut(), name.as_ptr(), value.as_ptr()) })
    }

    /// Takes an option out of the options database.
    ///
    /// # Errors
    /// What PETSc reports of such a name.
    pub fn clear_option(&self, name: &str) -> Result<(), PetscError> {
        let name = c_string(&format!("-{}{name}", self.prefix))?;
        // SAFETY: PETSc is initialized, and only reads the name.
        call(|| unsafe { ffi::PetscOptionsClearValue(std::ptr::null_mut(), name.as_ptr()) })
    }

    /// The number of this rank.
    #[must_use]
    pub fn rank(&self) -> usize {
        self.team.rank
    }

    /// How many ranks there are.
    #[must_use]
    pub fn ranks(&self) -> usize {
        self.team.ranks
    }

    /// The prefix of options.
    #[must_use]
    pub fn prefix(&self) -> &str {
        &self.prefix
    }

    /// What each rank holds.
    #[must_use]
    pub fn distribution(&self) -> Distribution {
        self.distribution
    }

    /// The session.
    #[must_use]
    pub fn session(&self) -> &Session {
        &self.team.session
    }

    /// How matrices are stored.
    #[must_use]
    pub fn matrix_type(&self) -> MatrixType {
        self.kind
    }

    /// How many unknowns a block has.
    pub(super) fn block(&self) -> usize {
        self.block
    }

    pub(super) fn comm(&self) -> MPI_Comm {
        self.team.raw
    }

    /// Whether objects of the two can meet.
    pub(super) fn is_alone(&self) -> bool {
        self.team.ranks == 1
    }

    /// What this rank owns of `len` rows.
    pub(super) fn own(&self, len: usize) -> Range<usize> {
        self.part(len, self.team.rank)
    }

    /// What a rank owns of `len` rows: contiguous, and whole blocks where `len` consists of them.
    fn part(&self, len: usize, rank: usize) -> Range<usize> {
        let unit = if len.is_multiple_of(self.block) { self.block } else { 1 };
        let bound = |rank: usize| unit * (len / unit * rank / self.team.ranks);
        bound(rank)..bound(rank + 1)
    }

    /// Puts the parts of all ranks together: `own` of this one, `bound(row)` entries before each row that a rank begins with.
    pub(super) fn gather(&self, own: &[f64], rows: usize, bound: impl Fn(usize) -> usize, whole: &mut [f64]) {
        let Some(comm) = self.team.comm.as_ref().filter(|_| !self.is_alone()) else {
            return whole.copy_from_slice(own);
        };
        let parts: Vec<_> = (0..self.team.ranks).map(|rank| self.part(rows, rank)).collect();
        let starts: Vec<i32> = parts.iter().map(|part| bound(part.start) as i32).collect();
        let counts: Vec<i32> = parts.iter().map(|part| (bound(part.end) - bound(part.start)) as i32).collect();
        let _alone = lock();
        comm.all_gather_varcount_into(own, &mut PartitionMut::new(whole, &counts[..], &starts[..]));
    }

    /// Sums over all ranks, entry by entry.
    pub(super) fn sum(&self, values: &mut [f64]) {
        if let Some(comm) = self.team.comm.as_ref().filter(|_| !self.is_alone()) {
            let own = values.to_vec();
            let _alone = lock();
            comm.all_reduce_into(&own[..], values, SystemOperation::sum());
        }
    }

    /// The smallest of all ranks.
    pub(super) fn least(&self, value: usize) -> usize {
        let Some(comm) = self.team.comm.as_ref().filter(|_| !self.is_alone()) else { return value };
        let mut least = value as u64;
        let _alone = lock();
        comm.all_reduce_into(&(value as u64), &mut least, SystemOperation::min());
        least as usize
    }
}

impl fmt::Debug for Team {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "rank {} of {}", self.rank, self.ranks)
    }
}

impl Drop for Team {
    fn drop(&mut self) {
        let comm = self.comm.take();
        if is_finalized() {
            // It can no longer be freed.
            std::mem::forget(comm);
        } else {
            let _alone = lock();
            drop(comm);
        }
    }
}
