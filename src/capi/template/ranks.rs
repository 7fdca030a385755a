
// What PETSc has beside the template: communicators, options, and how matrices are stored.

use crate::backends::petsc::MatrixType;

/// Makes the backend on the ranks of a communicator, given by its Fortran handle: MPI_Comm_c2f(comm) in C, comm%MPI_VAL in
/// Fortran. MPI must be initialized; all ranks of the communicator call this together.
///
/// On several ranks (las_create_petsc makes the backend on all of them) every rank runs the same program on the same data:
/// each assembles the whole matrix, and keeps the rows that it owns of it; vectors lie whole on each. Reading a matrix,
/// multiplying and solving are done by all ranks together. Who assembles only his own elements gets another matrix.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn las_create_on_petsc(comm: i32, las: *mut *mut las_petsc) -> i32 {
    // SAFETY: as above; the communicator is the caller's, and is duplicated.
    guarded(|| unsafe { give(las, "las", || Ok(las_petsc(super::session::on(comm)?))) })
}

/// Writes an option into PETSc's database: las_set_option_petsc(las, "ksp_type", "gmres"). It counts for solvers that factor
/// for the first time from then on.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn las_set_option_petsc(
    las: *const las_petsc,
    name: *const c_char,
    value: *const c_char,
) -> i32 {
    // SAFETY: as above.
    guarded(|| unsafe { shared(las, "las")?.0.set_option(text(name, "name")?, text(value, "value")?).map_err(fault) })
}

/// Puts a prefix before the names of all options: with "body_", solvers of what is made from then on listen to
/// -body_ksp_type in place of -ksp_type, and las_set_option_petsc writes such names.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn las_set_prefix_petsc(las: *mut las_petsc, prefix: *const c_char) -> i32 {
    // SAFETY: as above.
    guarded(|| unsafe {
        let (las, prefix) = (exclusive(las, "las")?, text(prefix, "prefix")?);
        las.0 = las.0.clone().with_prefix(prefix);
        Ok(())
    })
}

/// Sets the unknowns of a block (3 at first): ranks own whole blocks, and a matrix of full blocks is known to be one.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn las_set_block_size_petsc(las: *mut las_petsc, size: i32) -> i32 {
    // SAFETY: as above.
    guarded(|| unsafe {
        let (las, size) = (exclusive(las, "las")?, count(size, "size")?);
        las.0 = las.0.clone().with_block_size(size);
        Ok(())
    })
}

/// Lets matrices that are made from then on be stored in blocks (BAIJ) where they consist of full ones; 0 ends that.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn las_set_blocked_petsc(las: *mut las_petsc, blocked: i32) -> i32 {
    // SAFETY: as above.
    guarded(|| unsafe {
        let las = exclusive(las, "las")?;
        let kind = if blocked == 0 { MatrixType::Aij } else { MatrixType::Baij };
        las.0 = las.0.clone().with_matrix_type(kind);
        Ok(())
    })
}
