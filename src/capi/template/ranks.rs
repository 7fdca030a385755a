
// The functions that only PETSc has: communicators, options, and the storage format of matrices.

use crate::backends::petsc::MatrixType;

/// Creates the backend on the ranks of a communicator, given by its Fortran handle: MPI_Comm_c2f(comm) in C,
/// comm%MPI_VAL in Fortran. MPI must be initialized; the call is collective.
///
/// On several ranks (las_create_petsc creates the backend on all MPI ranks), every rank runs the same program on the
/// same data: each rank assembles the whole matrix but stores only the rows that it owns, and stores whole vectors.
/// Reading a matrix, multiplying and solving are collective. A program whose ranks assemble only their own elements
/// gets a wrong matrix.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn las_create_on_petsc(comm: i32, las: *mut *mut las_petsc) -> i32 {
    create(las, "las", || Ok(las_petsc(super::session::context_on(comm)?)))
}

/// Writes an option into PETSc's options database: las_set_option_petsc(las, "ksp_type", "gmres"). It affects solvers
/// whose first factorization comes later.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn las_set_option_petsc(
    las: *const las_petsc,
    name: *const c_char,
    value: *const c_char,
) -> i32 {
    guarded(|| {
        let (name, value) = (text(name, "name")?, text(value, "value")?);
        shared(las, "las")?.0.set_option(name, value).map_err(backend_error)
    })
}

/// Sets a prefix of all option names: with "body_", solvers of objects created later read -body_ksp_type instead of
/// -ksp_type, and las_set_option_petsc writes such names.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn las_set_prefix_petsc(las: *mut las_petsc, prefix: *const c_char) -> i32 {
    guarded(|| {
        let (las, prefix) = (exclusive(las, "las")?, text(prefix, "prefix")?);
        las.0 = las.0.clone().with_prefix(prefix);
        Ok(())
    })
}

/// Sets the block size (3 by default): ranks own whole blocks, and a matrix of full blocks gets this block size in
/// PETSc.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn las_set_block_size_petsc(las: *mut las_petsc, size: i32) -> i32 {
    guarded(|| {
        let (las, size) = (exclusive(las, "las")?, count(size, "size")?);
        las.0 = las.0.clone().with_block_size(size);
        Ok(())
    })
}

/// Sets whether matrices created later are stored by blocks (BAIJ) if they consist of full blocks; 0 disables this.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn las_set_blocked_petsc(las: *mut las_petsc, blocked: i32) -> i32 {
    guarded(|| {
        let las = exclusive(las, "las")?;
        let kind = if blocked == 0 { MatrixType::Aij } else { MatrixType::Baij };
        las.0 = las.0.clone().with_matrix_type(kind);
        Ok(())
    })
}
