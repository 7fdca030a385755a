//! Hand-written bindings of the part of PETSc's C interface that this backend calls. They assume real scalars in double
//! precision and 32-bit indices, which `build.rs` checks.
//!
//! Names, types and numbers are those of `petscsys.h`, `petscvec.h`, `petscmat.h`, `petscpc.h` and `petscksp.h`.
#![allow(non_camel_case_types, missing_docs)]

use std::ffi::{c_char, c_int, c_void};

use mpi::ffi::MPI_Comm;

macro_rules! opaque {
    ($($name:ident),*) => {$(
        #[repr(C)]
        #[derive(Debug)]
        pub struct $name {
            _private: [u8; 0],
        }
    )*};
}

opaque!(_p_Vec, _p_Mat, _p_KSP, _p_PC, _p_MatNullSpace);

pub type Vec = *mut _p_Vec;
pub type Mat = *mut _p_Mat;
pub type Ksp = *mut _p_KSP;
pub type NullSpace = *mut _p_MatNullSpace;
pub type Pc = *mut _p_PC;

/// `PetscInt`.
pub type Int = c_int;
pub type Ints = *const c_int;
pub type Reals = *const f64;

/// `PetscErrorCode`; also the C enums, all of which are `int`.
pub type Code = c_int;
pub type Bool = c_int;
pub const FALSE: Bool = 0;
pub const TRUE: Bool = 1;

/// The function that PETSc calls where it detects an error and in each caller up the stack.
pub type ErrorHandler =
    extern "C" fn(MPI_Comm, c_int, *const c_char, *const c_char, Code, c_int, *const c_char, *mut c_void) -> Code;
/// `PetscErrorType`: the function that detected the error, not a caller on the stack.
pub const ERROR_INITIAL: c_int = 0;
/// Borrows or returns the array of values of a sequential matrix.
pub type Array = unsafe extern "C" fn(Mat, *mut *mut f64) -> Code;
/// `PETSC_ERR_SUP`.
pub const ERR_SUP: Code = 56;
/// `PETSC_ERR_ARG_OUTOFRANGE`.
pub const ERR_ARG_OUTOFRANGE: Code = 63;
/// `PETSC_ERR_ARG_SIZ`.
pub const ERR_ARG_SIZ: Code = 60;
/// `PETSC_ERR_ARG_WRONG`.
pub const ERR_ARG_WRONG: Code = 62;

// MatOption
pub const MAT_SYMMETRIC: c_int = 1;
pub const MAT_IGNORE_OFF_PROC_ENTRIES: c_int = 4;
pub const MAT_SPD: c_int = 15;
pub const MAT_NEW_NONZERO_LOCATIONS: c_int = 18;
// MatAssemblyType
pub const MAT_FINAL_ASSEMBLY: c_int = 0;
// MatReuse
pub const MAT_INITIAL_MATRIX: c_int = 0;
// MatStructure
pub const SUBSET_NONZERO_PATTERN: c_int = 1;
// MatFactorError
pub const MAT_FACTOR_NOERROR: c_int = 0;
pub const MAT_FACTOR_OUTMEMORY: c_int = 3;
// InsertMode, ScatterMode
pub const INSERT_VALUES: c_int = 1;
pub const SCATTER_FORWARD: c_int = 0;
// KSPNormType, PCSide
pub const KSP_NORM_UNPRECONDITIONED: c_int = 2;
pub const PC_RIGHT: c_int = 1;
/// `PETSC_DECIDE`.
pub const DECIDE: c_int = -1;
/// `PETSC_DEFAULT`.
pub const DEFAULT_REAL: f64 = -2.0;

unsafe extern "C" {
    pub fn PetscInitializeNoArguments() -> Code;
    pub fn PetscFinalize() -> Code;
    pub fn PetscInitialized(initialized: *mut Bool) -> Code;
    pub fn PetscPushErrorHandler(handler: Option<ErrorHandler>, context: *mut c_void) -> Code;
    pub fn PetscPopErrorHandler() -> Code;
    pub fn PetscErrorMessage(code: c_int, text: *mut *const c_char, specific: *mut *mut c_char) -> Code;
    pub fn PetscOptionsSetValue(options: *mut c_void, name: *const c_char, value: *const c_char) -> Code;
    pub fn PetscOptionsClearValue(options: *mut c_void, name: *const c_char) -> Code;

    pub fn VecCreateSeq(comm: MPI_Comm, len: c_int, out: *mut Vec) -> Code;
    pub fn VecCreateGhost(comm: MPI_Comm, own: Int, total: Int, ghosts: Int, rows: Ints, out: *mut Vec) -> Code;
    pub fn VecGhostGetLocalForm(vec: Vec, local: *mut Vec) -> Code;
    pub fn VecGhostRestoreLocalForm(vec: Vec, local: *mut Vec) -> Code;
    pub fn VecGhostUpdateBegin(vec: Vec, insert: c_int, direction: c_int) -> Code;
    pub fn VecGhostUpdateEnd(vec: Vec, insert: c_int, direction: c_int) -> Code;
    pub fn VecDuplicate(vec: Vec, out: *mut Vec) -> Code;
    pub fn VecDestroy(vec: *mut Vec) -> Code;
    pub fn VecGetArray(vec: Vec, values: *mut *mut f64) -> Code;
    pub fn VecRestoreArray(vec: Vec, values: *mut *mut f64) -> Code;
    pub fn VecGetArrayRead(vec: Vec, values: *mut *const f64) -> Code;
    pub fn VecRestoreArrayRead(vec: Vec, values: *mut *const f64) -> Code;
    pub fn VecDot(x: Vec, y: Vec, dot: *mut f64) -> Code;
    pub fn VecAXPY(y: Vec, a: f64, x: Vec) -> Code;

    pub fn MatCreate(comm: MPI_Comm, out: *mut Mat) -> Code;
    pub fn MatDestroy(mat: *mut Mat) -> Code;
    pub fn MatSetSizes(mat: Mat, own_rows: c_int, own_cols: c_int, rows: c_int, cols: c_int) -> Code;
    pub fn MatSetType(mat: Mat, kind: *const c_char) -> Code;
    pub fn MatSetBlockSize(mat: Mat, size: c_int) -> Code;
    pub fn MatSetOption(mat: Mat, option: c_int, on: Bool) -> Code;
    pub fn MatSeqAIJSetPreallocationCSR(mat: Mat, starts: Ints, columns: Ints, values: Reals) -> Code;
    pub fn MatMPIAIJSetPreallocationCSR(mat: Mat, starts: Ints, columns: Ints, values: Reals) -> Code;
    pub fn MatSeqBAIJSetPreallocationCSR(mat: Mat, size: Int, starts: Ints, columns: Ints, values: Reals) -> Code;
    pub fn MatMPIBAIJSetPreallocationCSR(mat: Mat, size: Int, starts: Ints, columns: Ints, values: Reals) -> Code;
    pub fn MatMPIBAIJGetSeqBAIJ(mat: Mat, diagonal: *mut Mat, off: *mut Mat, columns: *mut *const c_int) -> Code;
    pub fn MatSeqBAIJGetArray(mat: Mat, values: *mut *mut f64) -> Code;
    pub fn MatSeqBAIJRestoreArray(mat: Mat, values: *mut *mut f64) -> Code;
    pub fn MatMPIAIJGetSeqAIJ(mat: Mat, diagonal: *mut Mat, off: *mut Mat, columns: *mut *const c_int) -> Code;
    pub fn MatSeqAIJGetArray(mat: Mat, values: *mut *mut f64) -> Code;
    pub fn MatSeqAIJRestoreArray(mat: Mat, values: *mut *mut f64) -> Code;
    pub fn MatAssemblyBegin(mat: Mat, kind: c_int) -> Code;
    pub fn MatAssemblyEnd(mat: Mat, kind: c_int) -> Code;
    pub fn MatNullSpaceCreate(comm: MPI_Comm, constant: Bool, n: c_int, vecs: *const Vec, out: *mut NullSpace) -> Code;
    pub fn MatNullSpaceDestroy(space: *mut NullSpace) -> Code;
    pub fn MatSetNearNullSpace(mat: Mat, space: NullSpace) -> Code;
    pub fn MatCreateVecs(mat: Mat, right: *mut Vec, left: *mut Vec) -> Code;
    pub fn MatMult(mat: Mat, x: Vec, y: Vec) -> Code;
    pub fn MatMultTranspose(mat: Mat, x: Vec, y: Vec) -> Code;
    pub fn MatScale(mat: Mat, factor: f64) -> Code;
    pub fn MatAXPY(y: Mat, a: f64, x: Mat, structure: c_int) -> Code;
    pub fn MatMatMult(a: Mat, b: Mat, reuse: c_int, fill: f64, out: *mut Mat) -> Code;
    pub fn MatTranspose(a: Mat, reuse: c_int, out: *mut Mat) -> Code;
    pub fn MatCreateDense(comm: MPI_Comm, m: Int, n: Int, rows: Int, cols: Int, a: *mut f64, out: *mut Mat) -> Code;
    pub fn MatFactorGetError(factor: Mat, error: *mut c_int) -> Code;
    pub fn MatFactorGetErrorZeroPivot(factor: Mat, pivot: *mut f64, row: *mut c_int) -> Code;
    pub fn MatFactorGetSolverType(factor: Mat, package: *mut *const c_char) -> Code;
    pub fn MatGetInertia(factor: Mat, negative: *mut c_int, zero: *mut c_int, positive: *mut c_int) -> Code;

    pub fn KSPCreate(comm: MPI_Comm, out: *mut Ksp) -> Code;
    pub fn KSPDestroy(ksp: *mut Ksp) -> Code;
    pub fn KSPSetOptionsPrefix(ksp: Ksp, prefix: *const c_char) -> Code;
    pub fn KSPSetOperators(ksp: Ksp, a: Mat, preconditioner: Mat) -> Code;
    pub fn KSPSetType(ksp: Ksp, kind: *const c_char) -> Code;
    pub fn KSPSetFromOptions(ksp: Ksp) -> Code;
    pub fn KSPSetTolerances(ksp: Ksp, relative: f64, absolute: f64, divergence: f64, iterations: c_int) -> Code;
    pub fn KSPSetNormType(ksp: Ksp, norm: c_int) -> Code;
    pub fn KSPSetPCSide(ksp: Ksp, side: c_int) -> Code;
    pub fn KSPSetInitialGuessNonzero(ksp: Ksp, on: Bool) -> Code;
    pub fn KSPSetReusePreconditioner(ksp: Ksp, on: Bool) -> Code;
    pub fn KSPGMRESSetRestart(ksp: Ksp, steps: c_int) -> Code;
    pub fn KSPSetUp(ksp: Ksp) -> Code;
    pub fn KSPSolve(ksp: Ksp, b: Vec, x: Vec) -> Code;
    pub fn KSPMatSolve(ksp: Ksp, b: Mat, x: Mat) -> Code;
    pub fn KSPGetIterationNumber(ksp: Ksp, count: *mut c_int) -> Code;
    pub fn KSPGetConvergedReason(ksp: Ksp, reason: *mut c_int) -> Code;
    pub fn KSPGetType(ksp: Ksp, kind: *mut *const c_char) -> Code;
    pub fn KSPGetPC(ksp: Ksp, pc: *mut Pc) -> Code;

    pub fn PCSetType(pc: Pc, kind: *const c_char) -> Code;
    pub fn PCGetType(pc: Pc, kind: *mut *const c_char) -> Code;
    pub fn PCFactorSetMatSolverType(pc: Pc, package: *const c_char) -> Code;
    pub fn PCFactorSetUpMatSolverType(pc: Pc) -> Code;
    pub fn PCFactorGetMatrix(pc: Pc, factor: *mut Mat) -> Code;
    pub fn PCGetFailedReason(pc: Pc, reason: *mut c_int) -> Code;
}

#[cfg(petsc_has = "mumps")]
unsafe extern "C" {
    pub fn MatMumpsSetIcntl(factor: Mat, number: c_int, value: c_int) -> Code;
    pub fn MatMumpsSetCntl(factor: Mat, number: c_int, value: f64) -> Code;
    pub fn MatMumpsGetInfog(factor: Mat, number: c_int, value: *mut c_int) -> Code;
    pub fn MatMumpsGetRinfog(factor: Mat, number: c_int, value: *mut f64) -> Code;
}
