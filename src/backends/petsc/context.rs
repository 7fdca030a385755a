//! The context of PETSc objects: a session, a communicator, and the prefix of their options.

use std::fmt;
use std::ops::Range;
use std::sync::Arc;

use mpi::collective::SystemOperation;
use mpi::datatype::{Equivalence, PartitionMut};
use mpi::environment::is_finalized;
use mpi::ffi::MPI_Comm;
use mpi::raw::AsRaw;
use mpi::topology::{Communicator, SimpleCommunicator};
use mpi::traits::CommunicatorCollectives;

use super::error::{PetscError, c_string};
use super::ffi;
use super::rows::Parts;
use super::session::{Session, SessionError, call, lock};
use crate::las::RankRows;

/// The data that each rank of a communicator stores and contributes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum Distribution {
    /// Every rank runs the same program on the same data and writes every entry. Each rank stores whole vectors, and
    /// the rows of a matrix that it owns.
    #[default]
    Copies,
    /// Every rank writes all contributions to its own rows, and stores these rows of matrices and vectors, and copies of
    /// the entries of vectors in its ghost rows ([`RankRows`]).
    Parts,
}

/// The storage format of matrices in PETSc.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum MatrixType {
    /// Compressed rows (`aij`).
    #[default]
    Aij,
    /// Compressed rows of blocks (`baij`) if the pattern consists of full blocks of the context's size, else `aij`. It
    /// takes less memory for indices and multiplies faster; solvers, sums and products of matrices work on an `aij`
    /// copy.
    Baij,
}

/// A session and a communicator, with the distribution, block size, matrix type and options prefix of the objects made
/// in them.
///
/// A context is cheap to clone. Creating a context, reading or multiplying matrices, and solving are collective. With
/// [`Distribution::Parts`], so are creating and finishing vectors and matrices, norms and dot products, but not reading
/// matrices.
#[derive(Clone, Debug)]
pub struct Context {
    comm: Arc<OwnedComm>,
    prefix: Arc<str>,
    block: usize,
    kind: MatrixType,
    /// `None` for copies.
    parts: Option<Arc<Parts>>,
}

/// A duplicated communicator.
pub(super) struct OwnedComm {
    /// `None` only during `drop`.
    mpi: Option<SimpleCommunicator>,
    raw: MPI_Comm,
    rank: usize,
    ranks: usize,
    session: Session,
}

// SAFETY: a communicator is not bound to a thread, and a lock serializes all calls on it (`session::lock`).
unsafe impl Send for OwnedComm {}
// SAFETY: as above; its fields never change.
unsafe impl Sync for OwnedComm {}

impl Context {
    /// Creates a context on all ranks, in its own session, which ends when the context and all objects made in it are
    /// dropped.
    ///
    /// # Errors
    /// Returns [`SessionError`] if the session cannot start.
    pub fn world() -> Result<Self, SessionError> {
        let session = Session::new()?;
        Ok(Self::new(&session, &SimpleCommunicator::world()))
    }

    /// Creates a context on the ranks of a communicator, which is duplicated.
    pub fn new(session: &Session, comm: &impl Communicator) -> Self {
        let alone = lock();
        let comm = comm.duplicate();
        let (raw, rank, ranks) = (comm.as_raw(), comm.rank() as usize, comm.size() as usize);
        drop(alone);
        let comm = OwnedComm { mpi: Some(comm), raw, rank, ranks, session: session.clone() };
        Self { comm: Arc::new(comm), prefix: "".into(), block: 3, kind: MatrixType::Aij, parts: None }
    }

    /// Returns the same context for a system of which this rank holds these rows; collective.
    ///
    /// # Errors
    /// Returns [`PetscError`] on all ranks if the own rows of the ranks do not follow one another from 0 to the total,
    /// or if the ghost rows of a rank do not ascend, are out of range or are its own.
    pub(super) fn with_rows(&self, rows: RankRows) -> Result<Self, PetscError> {
        let parts = Arc::new(Parts::new(&self.comm, rows)?);
        Ok(Self { parts: Some(parts), ..self.clone() })
    }

    /// Sets the prefix of the names of all options: after `with_prefix("body_")`, solvers read `-body_ksp_type` instead
    /// of `-ksp_type`.
    #[must_use]
    pub fn with_prefix(mut self, prefix: &str) -> Self {
        self.prefix = prefix.into();
        self
    }

    /// Sets the block size, which is three by default: ranks own whole blocks, and PETSc is told the block size of a
    /// matrix that consists of full blocks. Sums and products require matrices of contexts with equal block sizes.
    #[must_use]
    pub fn with_block_size(mut self, size: usize) -> Self {
        self.block = size.max(1);
        self
    }

    /// Sets the storage format of matrices. With [`Distribution::Parts`], all matrices are `aij`.
    #[must_use]
    pub fn with_matrix_type(mut self, kind: MatrixType) -> Self {
        self.kind = kind;
        self
    }

    /// Writes an option, with the prefix before its name, into the options database: `set_option("ksp_type", "gmres")`.
    /// It affects solvers whose first factorization comes later.
    ///
    /// # Errors
    /// Returns [`PetscError`] if PETSc rejects the name, or if the name or value contains a NUL character.
    pub fn set_option(&self, name: &str, value: &str) -> Result<(), PetscError> {
        let (name, value) = (c_string(&format!("-{}{name}", self.prefix))?, c_string(value)?);
        // SAFETY: PETSc is initialized, and copies both.
        call(|| unsafe { ffi::PetscOptionsSetValue(std::ptr::null_mut(), name.as_ptr(), value.as_ptr()) })
    }

    /// Removes an option from the options database.
    ///
    /// # Errors
    /// Returns [`PetscError`] if PETSc rejects the name, or if it contains a NUL character.
    pub fn clear_option(&self, name: &str) -> Result<(), PetscError> {
        let name = c_string(&format!("-{}{name}", self.prefix))?;
        // SAFETY: PETSc is initialized, and only reads the name.
        call(|| unsafe { ffi::PetscOptionsClearValue(std::ptr::null_mut(), name.as_ptr()) })
    }

    /// Returns the number of this rank.
    pub fn rank(&self) -> usize {
        self.comm.rank
    }

    /// Returns the number of ranks.
    pub fn ranks(&self) -> usize {
        self.comm.ranks
    }

    /// Returns the prefix of options.
    pub fn prefix(&self) -> &str {
        &self.prefix
    }

    /// Returns the distribution of data over the ranks.
    pub fn distribution(&self) -> Distribution {
        if self.parts.is_some() { Distribution::Parts } else { Distribution::Copies }
    }

    /// Returns the rows of this rank; `None` for [`Distribution::Copies`].
    pub fn rows(&self) -> Option<&Arc<RankRows>> {
        self.parts.as_deref().map(Parts::rows)
    }

    /// Returns the session.
    pub fn session(&self) -> &Session {
        &self.comm.session
    }

    /// Returns the storage format of matrices.
    pub fn matrix_type(&self) -> MatrixType {
        self.kind
    }

    /// Returns the number of unknowns per block.
    pub(super) fn block(&self) -> usize {
        self.block
    }

    pub(super) fn comm(&self) -> MPI_Comm {
        self.comm.raw
    }

    pub(super) fn parts(&self) -> Option<&Arc<Parts>> {
        self.parts.as_ref()
    }

    /// Returns true if the communicator has a single rank.
    pub(super) fn is_single_rank(&self) -> bool {
        self.comm.ranks == 1
    }

    /// Returns true if products and solvers work on the vectors of this crate themselves. Otherwise every rank has
    /// copies, and they work on parts of these.
    pub(super) fn shares_vectors(&self) -> bool {
        self.is_single_rank() || self.parts.is_some()
    }

    /// Returns the range of rows, out of `len`, that this rank owns.
    pub(super) fn own_range(&self, len: usize) -> Range<usize> {
        self.range_of_rank(len, self.comm.rank)
    }

    /// Returns the range of rows, out of `len`, that a rank owns: contiguous, and whole blocks if `len` is a multiple
    /// of the block size.
    fn range_of_rank(&self, len: usize, rank: usize) -> Range<usize> {
        let unit = if len.is_multiple_of(self.block) { self.block } else { 1 };
        let bound = |rank: usize| unit * (len / unit * rank / self.comm.ranks);
        bound(rank)..bound(rank + 1)
    }

    /// Gathers the parts of all ranks on every rank: `own` is the part of this rank, and `bound(row)` entries precede
    /// each row at which a rank begins.
    pub(super) fn gather(&self, own: &[f64], rows: usize, bound: impl Fn(usize) -> usize, whole: &mut [f64]) {
        let Some(comm) = self.comm.mpi.as_ref().filter(|_| !self.is_single_rank()) else {
            return whole.copy_from_slice(own);
        };
        let parts: Vec<_> = (0..self.comm.ranks).map(|rank| self.range_of_rank(rows, rank)).collect();
        let starts: Vec<i32> = parts.iter().map(|part| bound(part.start) as i32).collect();
        let counts: Vec<i32> = parts.iter().map(|part| (bound(part.end) - bound(part.start)) as i32).collect();
        let _alone = lock();
        comm.all_gather_varcount_into(own, &mut PartitionMut::new(whole, &counts[..], &starts[..]));
    }

    /// Sums over all ranks, entry by entry.
    pub(super) fn sum(&self, values: &mut [f64]) {
        if let Some(comm) = self.comm.mpi.as_ref().filter(|_| !self.is_single_rank()) {
            let own = values.to_vec();
            let _alone = lock();
            comm.all_reduce_into(&own[..], values, SystemOperation::sum());
        }
    }

    /// Returns the minimum over all ranks.
    pub(super) fn min(&self, value: usize) -> usize {
        let Some(comm) = self.comm.mpi.as_ref().filter(|_| !self.is_single_rank()) else { return value };
        let mut least = value as u64;
        let _alone = lock();
        comm.all_reduce_into(&(value as u64), &mut least, SystemOperation::min());
        least as usize
    }
}

impl OwnedComm {
    pub(super) fn ranks(&self) -> usize {
        self.ranks
    }

    pub(super) fn raw(&self) -> MPI_Comm {
        self.raw
    }

    pub(super) fn session(&self) -> &Session {
        &self.session
    }

    /// Returns the values of all ranks, in the order of the ranks; collective. All ranks pass the same number of
    /// values.
    pub(super) fn all_gather<T: Equivalence + Copy + Default>(&self, own: &[T]) -> Vec<T> {
        let Some(comm) = self.mpi.as_ref().filter(|_| self.ranks > 1 && !own.is_empty()) else { return own.to_vec() };
        let mut all = vec![T::default(); own.len() * self.ranks];
        let _alone = lock();
        comm.all_gather_into(own, &mut all[..]);
        all
    }
}

impl fmt::Debug for OwnedComm {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "rank {} of {}", self.rank, self.ranks)
    }
}

impl Drop for OwnedComm {
    fn drop(&mut self) {
        let comm = self.mpi.take();
        if is_finalized() {
            // MPI is finalized, so the communicator can no longer be freed.
            std::mem::forget(comm);
        } else {
            let _alone = lock();
            drop(comm);
        }
    }
}
