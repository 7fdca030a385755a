//! The C interface of LAS, which Fortran uses too: functions `las_<verb>_<backend>` for every compiled-in backend.
//!
//! `include/las.h` and `include/las.f90` declare the functions; `tools/headers` generates both files. Every function
//! returns [`LAS_OK`] or an error code; [`las_message`] returns the error message. No panic unwinds into the caller.
//! Functions `las_create_...` create objects and `las_destroy_...` free them; two threads must not use an object at the
//! same time.
#![cfg_attr(
    not(any(feature = "sparse", feature = "dense", feature = "petsc")),
    allow(dead_code, unused_imports, unused_macros, reason = "used by some backends only")
)]
#![allow(
    rustdoc::broken_intra_doc_links,
    reason = "these texts are also those of the C header, where a[k] is an entry"
)]
#![allow(
    unsafe_code,
    unsafe_op_in_unsafe_fn,
    clippy::missing_safety_doc,
    reason = "the foreign interface: the header states the conditions on which the functions rely as a whole"
)]

mod backend;
mod handles;
#[cfg(feature = "petsc")]
mod session;

use std::ffi::{CStr, c_char};
use std::path::Path;
use std::sync::Arc;

use backend::exported;
use handles::{Failure, array, backend_error, count, create, exclusive, free, guarded};

use crate::las::{Backend, Iterative, Krylov, Preconditioner, SolverParams, Sparsity, SparsityError, Symmetry, market};

/// Success.
pub const LAS_OK: i32 = 0;
/// A pointer is null.
pub const LAS_NULL: i32 = 1;
/// A size is negative, or sizes are inconsistent.
pub const LAS_SIZE: i32 = 2;
/// An index is out of range.
pub const LAS_INDEX: i32 = 3;
/// The matrix is singular, or not positive definite where that is required.
pub const LAS_SINGULAR: i32 = 4;
/// An iterative method did not converge, the matrix is too ill-conditioned, or the matrix or right-hand side contains
/// values that are not finite.
pub const LAS_NOT_CONVERGED: i32 = 5;
/// The solver has not factored a matrix yet.
pub const LAS_NOT_FACTORED: i32 = 6;
/// The backend does not support the operation.
pub const LAS_UNSUPPORTED: i32 = 7;
/// A file is invalid, or cannot be read or written.
pub const LAS_FILE: i32 = 8;
/// The backend or its library failed.
pub const LAS_BACKEND_ERROR: i32 = 9;
/// An internal error of this library.
pub const LAS_PANIC: i32 = 10;
/// A parameter has a value that is not allowed.
pub const LAS_ARGUMENT: i32 = 11;

/// The matrix is symmetric, both of its triangles are stored, and it is normally positive definite.
pub const LAS_DEFINITE: i32 = 0;
/// The matrix is symmetric, and both of its triangles are stored.
pub const LAS_SYMMETRIC: i32 = 1;
/// The matrix is not symmetric.
pub const LAS_UNSYMMETRIC: i32 = 2;

/// Solve directly, by a factorization.
pub const LAS_DIRECT: i32 = 0;
/// Solve by the conjugate gradient method (CG).
pub const LAS_CG: i32 = 1;
/// Solve by the stabilized biconjugate gradient method (BiCGSTAB).
pub const LAS_BICGSTAB: i32 = 2;
/// Solve by the generalized minimal residual method (GMRES).
pub const LAS_GMRES: i32 = 3;

/// Precondition by the default of the method: the diagonal for LAS_CG and for all methods of PETSc, LAS_ILUT for the
/// others.
pub const LAS_AUTO: i32 = -1;
/// Use no preconditioner.
pub const LAS_NONE: i32 = 0;
/// Precondition by the inverse of the diagonal.
pub const LAS_DIAGONAL: i32 = 1;
/// Precondition by an incomplete factorization.
pub const LAS_ILUT: i32 = 2;
/// Precondition by algebraic multigrid.
pub const LAS_MULTIGRID: i32 = 3;

/// The solver parameters; las_default_params sets the defaults.
#[allow(non_camel_case_types, reason = "a name of C")]
#[derive(Clone, Copy, Debug)]
#[repr(C)]
pub struct las_params {
    /// LAS_DEFINITE, LAS_SYMMETRIC or LAS_UNSYMMETRIC.
    pub symmetry: i32,
    /// LAS_DIRECT, LAS_CG, LAS_BICGSTAB or LAS_GMRES.
    pub method: i32,
    /// LAS_AUTO, LAS_NONE, LAS_DIAGONAL, LAS_ILUT or LAS_MULTIGRID.
    pub preconditioner: i32,
    /// Number of GMRES steps between restarts.
    pub restart: i32,
    /// Number of entries that a row of an incomplete factor keeps.
    pub fill: i32,
    /// Largest number of iterations.
    pub max_iterations: i32,
    /// Entries below this fraction of their row are dropped from an incomplete factor.
    pub drop_tolerance: f64,
    /// Norm of the residual over that of the right-hand side at which the iteration stops.
    pub tolerance: f64,
}

impl las_params {
    fn checked(&self, backend: &str) -> Result<SolverParams, Failure> {
        let symmetry = match self.symmetry {
            LAS_DEFINITE => Symmetry::Definite,
            LAS_SYMMETRIC => Symmetry::Symmetric,
            LAS_UNSYMMETRIC => Symmetry::None,
            other => return Err(invalid_argument("symmetry", other, "LAS_DEFINITE, LAS_SYMMETRIC or LAS_UNSYMMETRIC")),
        };
        let params = SolverParams::new(symmetry);
        let krylov = match self.method {
            LAS_DIRECT => return Ok(params),
            LAS_CG => Krylov::Cg,
            LAS_BICGSTAB => Krylov::BiCgStab,
            LAS_GMRES => Krylov::Gmres { restart: to_count(self.restart, "restart")? },
            other => return Err(invalid_argument("method", other, "LAS_DIRECT, LAS_CG, LAS_BICGSTAB or LAS_GMRES")),
        };
        let suited = if backend == "petsc" || self.method == LAS_CG { LAS_DIAGONAL } else { LAS_ILUT };
        let preconditioner = match if self.preconditioner == LAS_AUTO { suited } else { self.preconditioner } {
            LAS_NONE => Preconditioner::None,
            LAS_DIAGONAL => Preconditioner::Diagonal,
            LAS_ILUT => {
                Preconditioner::Ilut { drop_tolerance: self.drop_tolerance, fill: to_count(self.fill, "fill")? }
            }
            LAS_MULTIGRID => Preconditioner::Multigrid,
            other => {
                let allowed = "LAS_AUTO, LAS_NONE, LAS_DIAGONAL, LAS_ILUT or LAS_MULTIGRID";
                return Err(invalid_argument("preconditioner", other, allowed));
            }
        };
        let max_iterations = to_count(self.max_iterations, "max_iterations")?;
        Ok(params.iterative(Iterative { krylov, preconditioner, tolerance: self.tolerance, max_iterations }))
    }
}

fn invalid_argument(what: &str, value: i32, allowed: &str) -> Failure {
    Failure::new(LAS_ARGUMENT, format!("`{what}` is {value}; it must be {allowed}"))
}

/// Converts a parameter that is a count; the check that it is not zero comes with the other checks.
fn to_count(value: i32, what: &str) -> Result<usize, Failure> {
    usize::try_from(value).map_err(|_| invalid_argument(what, value, "0 or above"))
}

/// A sparsity pattern, shared by all backends.
#[allow(non_camel_case_types, reason = "a name of C")]
pub struct las_pattern(Arc<Sparsity>);

/// Returns the message of the last call of this thread that did not return LAS_OK. The text is valid until the next
/// such call.
#[unsafe(no_mangle)]
pub extern "C" fn las_message() -> *const c_char {
    handles::message()
}

/// Returns the version of this library, such as "0.1.0".
#[unsafe(no_mangle)]
pub extern "C" fn las_version() -> *const c_char {
    const VERSION: &CStr = match CStr::from_bytes_with_nul(concat!(env!("CARGO_PKG_VERSION"), "\0").as_bytes()) {
        Ok(version) => version,
        Err(_) => c"unknown",
    };
    VERSION.as_ptr()
}

/// Sets the defaults: a definite matrix, solved directly. For iterative methods: tolerance 1e-10, the default
/// preconditioner of the method, and ILUT(1e-3, 20) if that is ILUT.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn las_default_params(params: *mut las_params) -> i32 {
    guarded(|| {
        *exclusive(params, "params")? = las_params {
            symmetry: LAS_DEFINITE,
            method: LAS_DIRECT,
            preconditioner: LAS_AUTO,
            restart: 50,
            fill: 20,
            max_iterations: 1000,
            drop_tolerance: 1e-3,
            tolerance: 1e-10,
        };
        Ok(())
    })
}

/// Creates a pattern from compressed rows: row_offsets has rows + 1 entries, the last of which is the number of
/// entries; the columns of a row ascend. All indices count from 0.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn las_create_pattern(
    rows: i32,
    cols: i32,
    row_offsets: *const i32,
    columns: *const i32,
    pattern: *mut *mut las_pattern,
) -> i32 {
    create(pattern, "pattern", || {
        let (rows, cols) = (count(rows, "rows")?, count(cols, "cols")?);
        let row_offsets: &[i32] = array(row_offsets, rows + 1, "row_offsets")?;
        let columns: &[i32] = array(columns, count(row_offsets[rows], "row_offsets[rows]")?, "columns")?;
        let numbers = |numbers: &[i32], name: &str| -> Result<Vec<u32>, Failure> {
            numbers.iter().map(|&number| Ok(count(number, name)? as u32)).collect()
        };
        let sparsity = Sparsity::from_rows(cols, numbers(row_offsets, "row_offsets")?, numbers(columns, "columns")?);
        Ok(las_pattern(Arc::new(sparsity.map_err(pattern_error)?)))
    })
}

/// Creates the square pattern of elements, each of which couples all of its unknowns: element k has the unknowns
/// unknowns[element_start[k]] to unknowns[element_start[k + 1] - 1]; negative ones are constrained.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn las_create_pattern_of_elements(
    size_of_system: i32,
    elements: i32,
    element_start: *const i32,
    unknowns: *const i32,
    pattern: *mut *mut las_pattern,
) -> i32 {
    create(pattern, "pattern", || {
        let (len, elements) = (count(size_of_system, "size_of_system")?, count(elements, "elements")?);
        let starts: &[i32] = array(element_start, elements + 1, "element_start")?;
        let all: &[i32] = array(unknowns, count(starts[elements], "element_start[elements]")?, "unknowns")?;
        let list = |pair: &[i32]| {
            let range = count(pair[0], "element_start")?..count(pair[1], "element_start")?;
            all.get(range).ok_or_else(|| Failure::new(LAS_SIZE, "`element_start` does not ascend"))
        };
        let lists = starts.windows(2).map(list).collect::<Result<Vec<&[i32]>, _>>()?;
        let sparsity = Sparsity::from_elements(len, lists);
        Ok(las_pattern(Arc::new(sparsity.map_err(pattern_error)?)))
    })
}

/// Frees a pattern. Null is allowed.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn las_destroy_pattern(pattern: *mut las_pattern) -> i32 {
    guarded(|| free(pattern))
}

fn pattern_error(error: SparsityError) -> Failure {
    let code = if matches!(error, SparsityError::Column { .. }) { LAS_INDEX } else { LAS_SIZE };
    Failure::new(code, error.to_string())
}

/// The functions that a backend needs for the C interface, in addition to its traits.
trait Exported: Backend {
    /// Creates the context of the backend.
    fn context() -> Result<Self::Context, Failure>;

    /// Reads a Matrix Market file.
    fn read(file: &Path, context: &Self::Context) -> Result<Self::Matrix, Failure>;

    /// Writes a Matrix Market file.
    fn write(file: &Path, mat: &Self::Matrix) -> Result<(), Failure>;
}

fn file_error<F: std::error::Error>(error: market::MarketError<F>) -> Failure {
    match error {
        market::MarketError::Backend(error) => backend_error(error),
        error => Failure::new(LAS_FILE, error.to_string()),
    }
}

macro_rules! with_files {
    ($backend:ty, $context:expr) => {
        impl Exported for $backend {
            fn context() -> Result<Self::Context, Failure> {
                $context
            }

            fn read(file: &Path, context: &Self::Context) -> Result<Self::Matrix, Failure> {
                market::read::<Self>(file, context).map_err(file_error)
            }

            fn write(file: &Path, mat: &Self::Matrix) -> Result<(), Failure> {
                market::write::<Self>(file, mat).map_err(file_error)
            }
        }
    };
}

#[cfg(feature = "sparse")]
with_files!(crate::backends::sparse::Sparse, Ok(()));
#[cfg(feature = "sparse")]
exported!(sparse, crate::backends::sparse::Sparse, "/las_sparse.rs");

#[cfg(feature = "dense")]
with_files!(crate::backends::dense::Dense, Ok(()));
#[cfg(feature = "dense")]
exported!(dense, crate::backends::dense::Dense, "/las_dense.rs");

#[cfg(feature = "batched")]
impl Exported for crate::backends::batched::Batched {
    fn context() -> Result<(), Failure> {
        Ok(())
    }

    fn read(_: &Path, (): &()) -> Result<Self::Matrix, Failure> {
        Err(Failure::new(LAS_UNSUPPORTED, "Matrix Market files cannot store the lanes of `batched`"))
    }

    fn write(_: &Path, _: &Self::Matrix) -> Result<(), Failure> {
        Err(Failure::new(LAS_UNSUPPORTED, "Matrix Market files cannot store the lanes of `batched`"))
    }
}
#[cfg(feature = "batched")]
exported!(batched, crate::backends::batched::Batched, "/las_batched.rs");

#[cfg(feature = "petsc")]
with_files!(crate::backends::petsc::Petsc, session::world_context());
#[cfg(feature = "petsc")]
exported!(petsc, crate::backends::petsc::Petsc, "/las_petsc.rs");
