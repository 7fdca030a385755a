
// What PETSc has beside the template: communicators and options.

/// Makes the backend on the ranks of a communicator, given by its Fortran handle: MPI_Comm_c2f(comm) in C, comm%MPI_VAL in
/// Fortran. MPI must be initialised; all ranks of the communicator call this together.
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
