//! The near null space of a matrix, for PETSc's multigrid.

use super::error::PetscError;
use super::handle::Handle;
use super::products::scatter;
use super::session::call;
use super::{Context, Matrix, ffi};

impl Matrix {
    /// Attaches vectors on which the matrix is almost zero, with the entries of a vector of this rank. PETSc needs
    /// orthonormal ones; a vector that depends on previous ones is left out.
    pub(super) fn set_near_null_space(&self, vectors: &[Vec<f64>]) -> Result<(), PetscError> {
        let (raw, session, comm) = (self.raw(), self.context.session(), self.context.comm());
        let mut parts = Vec::with_capacity(vectors.len());
        for vector in orthonormalized(&self.context, vectors) {
            // SAFETY: a live matrix; null asks for no vector.
            let part = Handle::new(session, |out| unsafe { ffi::MatCreateVecs(raw, out, std::ptr::null_mut()) })?;
            scatter(&vector, self.layout.rows.clone(), &part)?;
            parts.push(part);
        }
        let raw_parts: Vec<ffi::Vec> = parts.iter().map(Handle::raw).collect();
        let count = raw_parts.len() as std::ffi::c_int;
        let space = Handle::new(session, |out: *mut ffi::NullSpace| {
            // SAFETY: a live communicator and live vectors, which PETSc keeps references to.
            unsafe { ffi::MatNullSpaceCreate(comm, ffi::FALSE, count, raw_parts.as_ptr(), out) }
        })?;
        let space = space.raw();
        // SAFETY: live objects; the matrix keeps a reference.
        call(|| unsafe { ffi::MatSetNearNullSpace(raw, space) })
    }
}

/// Orthonormalizes vectors by the modified Gram-Schmidt method, twice.
fn orthonormalized(context: &Context, vectors: &[Vec<f64>]) -> Vec<Vec<f64>> {
    /// A vector whose norm falls below this fraction depends on the others.
    const DEPENDENT: f64 = 1e-9;
    let norm = |v: &[f64]| context.sum_of_parts(v.iter().map(|x| x * x).sum()).sqrt();
    let mut basis: Vec<Vec<f64>> = Vec::with_capacity(vectors.len());
    for vector in vectors {
        let mut v = vector.clone();
        let before = norm(&v);
        for q in basis.iter().chain(&basis) {
            let product = context.sum_of_parts(q.iter().zip(&v).map(|(q, v)| q * v).sum());
            v.iter_mut().zip(q).for_each(|(v, q)| *v -= product * q);
        }
        let after = norm(&v);
        if after > DEPENDENT * before {
            v.iter_mut().for_each(|v| *v /= after);
            basis.push(v);
        }
    }
    basis
}
