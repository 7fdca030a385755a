//! PETSc's `KSP` object, for Krylov and direct methods, on one matrix.

use std::ffi::CStr;

use super::error::{PetscError, c_string, copy_c_string};
use super::handle::Handle;
use super::products::scatter;
use super::session::call;
use super::{Matrix, Vector, ffi};

/// A `KSP` with its preconditioner.
#[derive(Debug)]
pub(super) struct Ksp {
    handle: Handle<ffi::_p_KSP>,
    /// Owned by `handle`.
    pc: ffi::Pc,
}

// SAFETY: `pc` belongs to the object that `handle` owns; see there.
unsafe impl Send for Ksp {}

/// The outcome of a solve.
#[derive(Clone, Copy, Debug)]
pub(super) struct SolveOutcome {
    pub(super) iterations: usize,
    /// `KSPConvergedReason`: negative if the method did not converge.
    pub(super) reason: i32,
}

impl Ksp {
    /// Creates a solver with these types; the options database can override them.
    pub(super) fn new(a: &Matrix, method: &CStr, preconditioner: &CStr) -> Result<Self, PetscError> {
        let (comm, context, matrix) = (a.context.comm(), &a.context, a.raw());
        let prefix = c_string(context.prefix())?;
        // SAFETY: PETSc is initialized and the communicator live.
        let handle = Handle::new(context.session(), |out| unsafe { ffi::KSPCreate(comm, out) })?;
        let (ksp, mut pc) = (handle.raw(), std::ptr::null_mut());
        // SAFETY: live objects and C strings, which PETSc copies.
        call(|| unsafe { ffi::KSPSetOptionsPrefix(ksp, prefix.as_ptr()) })?;
        call(|| unsafe { ffi::KSPSetOperators(ksp, matrix, matrix) })?;
        call(|| unsafe { ffi::KSPSetType(ksp, method.as_ptr()) })?;
        call(|| unsafe { ffi::KSPGetPC(ksp, &raw mut pc) })?;
        call(|| unsafe { ffi::PCSetType(pc, preconditioner.as_ptr()) })?;
        Ok(Self { handle, pc })
    }

    pub(super) fn raw(&self) -> ffi::Ksp {
        self.handle.raw()
    }

    pub(super) fn pc(&self) -> ffi::Pc {
        self.pc
    }

    /// Applies the options database.
    pub(super) fn set_from_options(&self) -> Result<(), PetscError> {
        let ksp = self.raw();
        // SAFETY: a live object.
        call(|| unsafe { ffi::KSPSetFromOptions(ksp) })
    }

    /// Returns the types of the `KSP` and of its preconditioner in use.
    pub(super) fn types(&self) -> Result<[String; 2], PetscError> {
        let (ksp, pc, mut method, mut preconditioner) = (self.raw(), self.pc, std::ptr::null(), std::ptr::null());
        // SAFETY: live objects, which own the strings.
        call(|| unsafe { ffi::KSPGetType(ksp, &raw mut method) })?;
        call(|| unsafe { ffi::PCGetType(pc, &raw mut preconditioner) })?;
        // SAFETY: null or C strings, as above.
        Ok(unsafe { [copy_c_string(method), copy_c_string(preconditioner)] })
    }

    /// Computes the preconditioner for the current values of the matrix, and keeps it when they change.
    pub(super) fn set_up(&self, a: &Matrix) -> Result<(), PetscError> {
        let (ksp, matrix) = (self.raw(), a.raw());
        // SAFETY: live objects.
        call(|| unsafe { ffi::KSPSetReusePreconditioner(ksp, ffi::FALSE) })?;
        call(|| unsafe { ffi::KSPSetOperators(ksp, matrix, matrix) })?;
        call(|| unsafe { ffi::KSPSetUp(ksp) })?;
        call(|| unsafe { ffi::KSPSetReusePreconditioner(ksp, ffi::TRUE) })
    }

    /// Solves `A x = b`, starting from `x` if `go_on` is true, else from zero.
    pub(super) fn solve(
        &self,
        a: &Matrix,
        b: &Vector,
        x: &mut Vector,
        go_on: bool,
    ) -> Result<SolveOutcome, PetscError> {
        let ksp = self.raw();
        // SAFETY: a live object.
        call(|| unsafe { ffi::KSPSetInitialGuessNonzero(ksp, ffi::Bool::from(go_on)) })?;
        if a.context.shares_vectors() {
            let (b, solution) = (b.raw()?, x.raw()?);
            // SAFETY: live objects of the sizes that were analyzed; two vectors.
            call(|| unsafe { ffi::KSPSolve(ksp, b, solution) })?;
            x.update_ghosts()?;
        } else {
            let [right, left] = a.distributed_vectors()?;
            scatter(b.as_slice(), a.layout.rows.clone(), left)?;
            if go_on {
                scatter(x.as_slice(), a.layout.rows.clone(), right)?;
            }
            let (b, part) = (left.raw(), right.raw());
            // SAFETY: as above.
            call(|| unsafe { ffi::KSPSolve(ksp, b, part) })?;
            a.gather(right, x)?;
        }
        let (mut iterations, mut reason) = (0, 0);
        // SAFETY: a live object.
        call(|| unsafe { ffi::KSPGetIterationNumber(ksp, &raw mut iterations) })?;
        call(|| unsafe { ffi::KSPGetConvergedReason(ksp, &raw mut reason) })?;
        Ok(SolveOutcome { iterations: iterations as usize, reason })
    }

    /// Solves `A x_k = b_k` for all `k` at once by a factorization. It does not check convergence, because a
    /// factorization either solves or reports an error.
    pub(super) fn solve_many(&self, a: &Matrix, b: &[Vector], x: &mut [Vector]) -> Result<(), PetscError> {
        let (own, (rows, _), ksp) = (a.layout.rows.clone(), a.layout.shape_of_all(), self.raw());
        let mut columns = vec![0.0; own.len() * b.len()];
        let mut solutions = columns.clone();
        for (column, b) in columns.chunks_exact_mut(own.len().max(1)).zip(b) {
            column.copy_from_slice(&b.as_slice()[own.clone()]);
        }
        let dense = |values: &mut Vec<f64>| {
            let (comm, count, own) = (a.context.comm(), b.len() as i32, own.len() as i32);
            let values = values.as_mut_ptr();
            // SAFETY: a live communicator; as many values as this rank owns of the matrix, which outlive it.
            let make = |out| unsafe { ffi::MatCreateDense(comm, own, ffi::DECIDE, rows as i32, count, values, out) };
            let handle = Handle::new(a.context.session(), make)?;
            let raw = handle.raw();
            // SAFETY: a live matrix.
            call(|| unsafe { ffi::MatAssemblyBegin(raw, ffi::MAT_FINAL_ASSEMBLY) })?;
            // SAFETY: begun just now.
            call(|| unsafe { ffi::MatAssemblyEnd(raw, ffi::MAT_FINAL_ASSEMBLY) })?;
            Ok(handle)
        };
        let (right, left) = (dense(&mut columns)?, dense(&mut solutions)?);
        let (b, to) = (right.raw(), left.raw());
        // SAFETY: live objects of the sizes that were analyzed; two matrices.
        call(|| unsafe { ffi::KSPMatSolve(ksp, b, to) })?;
        drop((right, left));
        for (k, x) in x.iter_mut().enumerate() {
            let column = &solutions[k * own.len()..(k + 1) * own.len()];
            if a.context.shares_vectors() {
                x.as_mut_slice().copy_from_slice(column);
                x.update_ghosts()?;
            } else {
                a.context.gather(column, rows, |row| row, x.as_mut_slice());
            }
        }
        Ok(())
    }
}
