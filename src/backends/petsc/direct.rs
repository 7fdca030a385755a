//! Factorizations by the packages that PETSc was built with.

use std::ffi::CStr;

use super::error::{PetscError, copy_c_string};
use super::ksp::{Ksp, SolveOutcome};
use super::session::call;
use super::{Matrix, Petsc, SolverError, Vector, ffi};
use crate::las::{Backend, Factorization, SolveError};

/// A factorization that is recomputed for each new matrix of a pattern.
#[derive(Debug)]
pub(super) struct Factor {
    ksp: Ksp,
    /// The kind of factorization; `Approximate` if the options database selects something other than a factorization.
    pub(super) kind: Factorization,
    /// True if solves iterate because the options database selects a Krylov method.
    pub(super) iterates: bool,
    /// The factor matrix, owned by `ksp`; null if there is none.
    matrix: ffi::Mat,
    package: String,
    /// Pivots below this fraction of the largest count as zero.
    limit: f64,
}

// SAFETY: `matrix` belongs to the object that `ksp` owns; see there.
unsafe impl Send for Factor {}

/// The outcome of a factorization.
#[derive(Clone, Copy, Debug)]
pub(super) struct Outcome {
    /// The reason why the factor cannot be used, if any.
    pub(super) failure: Option<Failure>,
    /// True if the package aborted, so that it cannot continue with this factor.
    pub(super) aborted: bool,
    /// The number of negative pivots, if the package counts them.
    pub(super) negative: Option<usize>,
    /// The ratio of the smallest to the largest pivot; 1 if the package does not report it.
    pub(super) ratio: f64,
}

/// The reason why a factorization failed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Failure {
    /// Some pivots count as zero.
    Singular,
    /// The package needs more memory than it was given.
    OutOfMemory,
    /// Another failure: the error code of the package and its second code.
    Other([i32; 2]),
}

impl Failure {
    /// Converts a failure of the package into an error for the user.
    pub(super) fn error(self, package: &str) -> SolverError {
        let library = match package {
            "mumps" => "MUMPS",
            "superlu_dist" => "SuperLU_DIST",
            _ => "PETSc",
        };
        let reason = match self {
            Self::Other([code, more]) if package == "mumps" => format!("INFOG(1) = {code}, INFOG(2) = {more}"),
            Self::Other([code, _]) => format!("factorization error {code}"),
            _ => "there is not enough memory for the factors".to_owned(),
        };
        SolveError::Library { library, reason }
    }
}

/// Selects the package for a kind of factorization and returns the kind that it computes: MUMPS if it is installed,
/// else PETSc's own package on one rank, else LU by SuperLU_DIST.
fn package(kind: Factorization, ranks: usize) -> Result<(&'static CStr, Factorization), SolverError> {
    if cfg!(petsc_has = "mumps") {
        Ok((c"mumps", kind))
    } else if ranks == 1 {
        Ok((c"petsc", kind))
    } else if cfg!(petsc_has = "superlu_dist") {
        Ok((c"superlu_dist", Factorization::Lu))
    } else {
        Err(SolveError::Unsupported {
            backend: Petsc::NAME,
            what: "factorization on several ranks",
            cure: "use a PETSc with MUMPS or SuperLU_DIST, an iterative method, or one rank",
        })
    }
}

impl Factor {
    /// Creates a factorization. Pivots below `limit`, relative to the (scaled) matrix, count as zero; `extra_memory` is
    /// the percentage that MUMPS adds to its memory estimate.
    pub(super) fn new(a: &Matrix, kind: Factorization, limit: f64, extra_memory: i32) -> Result<Self, SolverError> {
        let (package, kind) = package(kind, a.context.ranks())?;
        Ok(Self::by_package(a, kind, package, limit, extra_memory)?)
    }

    fn by_package(
        a: &Matrix,
        kind: Factorization,
        package: &CStr,
        limit: f64,
        extra_memory: i32,
    ) -> Result<Self, PetscError> {
        let raw = a.raw();
        let [definite, symmetric] = [kind == Factorization::Cholesky, kind != Factorization::Lu].map(ffi::Bool::from);
        // MUMPS factors matrices declared definite without pivoting.
        // SAFETY: a live matrix.
        call(|| unsafe { ffi::MatSetOption(raw, ffi::MAT_SYMMETRIC, symmetric) })?;
        call(|| unsafe { ffi::MatSetOption(raw, ffi::MAT_SPD, definite) })?;
        let ksp = Ksp::new(a, c"preonly", if kind == Factorization::Lu { c"lu" } else { c"cholesky" })?;
        let pc = ksp.pc();
        // SAFETY: a live object and a C string.
        call(|| unsafe { ffi::PCFactorSetMatSolverType(pc, package.as_ptr()) })?;
        ksp.set_from_options()?;
        let [method, preconditioner] = ksp.types()?;
        let kind = match preconditioner.as_str() {
            "cholesky" => kind,
            "lu" => Factorization::Lu,
            _ => Factorization::Approximate,
        };
        let (matrix, iterates) = (std::ptr::null_mut(), method != "preonly");
        let mut factor = Self { ksp, kind, iterates, matrix, package: String::new(), limit };
        if kind != Factorization::Approximate {
            factor.find_matrix()?;
            factor.set_parameters(extra_memory)?;
        }
        Ok(factor)
    }

    fn find_matrix(&mut self) -> Result<(), PetscError> {
        let (pc, mut matrix, mut package) = (self.ksp.pc(), std::ptr::null_mut(), std::ptr::null());
        // SAFETY: live objects; the string is the matrix's.
        call(|| unsafe { ffi::PCFactorSetUpMatSolverType(pc) })?;
        call(|| unsafe { ffi::PCFactorGetMatrix(pc, &raw mut matrix) })?;
        call(|| unsafe { ffi::MatFactorGetSolverType(matrix, &raw mut package) })?;
        self.matrix = matrix;
        // SAFETY: as above.
        self.package = unsafe { copy_c_string(package) };
        Ok(())
    }

    /// Returns the name of the package in PETSc.
    pub(super) fn package(&self) -> &str {
        &self.package
    }

    #[cfg(petsc_has = "mumps")]
    fn set_parameters(&self, extra_memory: i32) -> Result<(), PetscError> {
        if self.package != "mumps" {
            return Ok(());
        }
        let (factor, limit) = (self.matrix, self.limit);
        // ICNTL(24): detect and count null pivots. ICNTL(13): do not hand the last front to ScaLAPACK, which does not
        // count negative pivots. ICNTL(14): memory. ICNTL(6) and (12): make the order of symmetric matrices depend on
        // the pattern alone, so that the result of a solver does not depend on earlier factorizations.
        let by_pattern = if self.kind == Factorization::Lu { &[][..] } else { &[(6, 0), (12, 1)] };
        for &(number, value) in [(24, 1), (13, 1), (14, extra_memory)].iter().chain(by_pattern) {
            // SAFETY: a live factor of MUMPS.
            call(|| unsafe { ffi::MatMumpsSetIcntl(factor, number, value) })?;
        }
        // CNTL(3): which pivots count as zero; CNTL(5): the value that replaces them, so that a solve reveals the null
        // space. Both are relative to the norm of the scaled matrix.
        for (number, value) in [(3, limit), (5, 1e-8)] {
            // SAFETY: as above.
            call(|| unsafe { ffi::MatMumpsSetCntl(factor, number, value) })?;
        }
        Ok(())
    }

    #[cfg(not(petsc_has = "mumps"))]
    fn set_parameters(&self, _: i32) -> Result<(), PetscError> {
        Ok(())
    }

    /// Factors the matrix with its current values.
    pub(super) fn factor(&self, a: &Matrix) -> Result<Outcome, PetscError> {
        self.ksp.set_up(a)?;
        let mut found = Outcome { failure: None, aborted: false, negative: None, ratio: 1.0 };
        if self.matrix.is_null() {
            let (pc, mut reason) = (self.ksp.pc(), 0);
            // SAFETY: a live object.
            call(|| unsafe { ffi::PCGetFailedReason(pc, &raw mut reason) })?;
            let reason = a.context.largest_code(reason);
            found.failure = (reason != 0).then_some(Failure::Other([reason, 0]));
            found.aborted = reason != 0;
            return Ok(found);
        }
        let (factor, mut error) = (self.matrix, 0);
        // SAFETY: a live factor.
        call(|| unsafe { ffi::MatFactorGetError(factor, &raw mut error) })?;
        found.failure = match error {
            ffi::MAT_FACTOR_NOERROR => None,
            ffi::MAT_FACTOR_OUTMEMORY => Some(Failure::OutOfMemory),
            1 | 2 => Some(Failure::Singular),
            error => Some(Failure::Other(self.codes()?.unwrap_or([error, 0]))),
        };
        found.aborted = found.failure.is_some();
        match (found.failure, self.kind, self.package.as_str()) {
            (None, kind, "mumps") => self.read_pivot_info(kind, self.limit, &mut found)?,
            (None, Factorization::Cholesky | Factorization::Ldlt, "petsc") => {
                let (mut negative, mut zero, mut positive) = (0, 0, 0);
                // SAFETY: a live factor of PETSc's own Cholesky, which counts them.
                call(|| unsafe { ffi::MatGetInertia(factor, &raw mut negative, &raw mut zero, &raw mut positive) })?;
                found.negative = Some(negative as usize);
                found.failure = (zero > 0).then_some(Failure::Singular);
            }
            _ => {}
        }
        Ok(found)
    }

    /// Returns `INFOG(1)` and `INFOG(2)` of MUMPS; `None` for other packages.
    #[cfg(petsc_has = "mumps")]
    fn codes(&self) -> Result<Option<[i32; 2]>, PetscError> {
        if self.package == "mumps" { Ok(Some([self.infog(1)?, self.infog(2)?])) } else { Ok(None) }
    }

    #[cfg(not(petsc_has = "mumps"))]
    fn codes(&self) -> Result<Option<[i32; 2]>, PetscError> {
        Ok(None)
    }

    /// Reads the information of MUMPS on its pivots.
    #[cfg(petsc_has = "mumps")]
    fn read_pivot_info(&self, kind: Factorization, limit: f64, found: &mut Outcome) -> Result<(), PetscError> {
        if kind != Factorization::Lu {
            found.negative = Some(self.infog(12)? as usize);
        }
        // RINFOG(19) and (21): the smallest and the largest pivot; zeros before MUMPS 5.5.
        let (least, most) = (self.rinfog(19)?, self.rinfog(21)?);
        if most > 0.0 {
            found.ratio = (least / most).min(1.0);
        }
        if self.infog(28)? > 0 || found.ratio < limit {
            found.failure = Some(Failure::Singular);
        }
        Ok(())
    }

    #[cfg(not(petsc_has = "mumps"))]
    fn read_pivot_info(&self, _: Factorization, _: f64, _: &mut Outcome) -> Result<(), PetscError> {
        Ok(())
    }

    #[cfg(petsc_has = "mumps")]
    fn infog(&self, number: i32) -> Result<i32, PetscError> {
        let (factor, mut value) = (self.matrix, 0);
        // SAFETY: a live factor of MUMPS.
        call(|| unsafe { ffi::MatMumpsGetInfog(factor, number, &raw mut value) })?;
        Ok(value)
    }

    #[cfg(petsc_has = "mumps")]
    fn rinfog(&self, number: i32) -> Result<f64, PetscError> {
        let (factor, mut value) = (self.matrix, 0.0);
        // SAFETY: a live factor of MUMPS.
        call(|| unsafe { ffi::MatMumpsGetRinfog(factor, number, &raw mut value) })?;
        Ok(value)
    }

    /// Returns the unknown with the largest component of a null vector or, if the package aborted, the unknown of the
    /// pivot at which it stopped. The factor cannot be used afterward.
    pub(super) fn null_space_unknown(
        &self,
        a: &Matrix,
        found: &Outcome,
        x: &mut Vector,
    ) -> Result<Option<usize>, PetscError> {
        if found.aborted {
            return Ok(self.zero_pivot(a));
        }
        // For almost any right-hand side, the solution of a nearly singular system is close to the null space.
        let mut load = Vector::zeros(&a.context, a.pattern().rows())?;
        for (row, load) in (a.context.first_row()..).zip(load.as_mut_slice()) {
            *load = (row as f64).sin() + 1.5;
        }
        self.solve(a, &load, x)?;
        Ok(a.context.largest_magnitude(x.as_slice()).map(|(unknown, _)| unknown))
    }

    /// Returns the row at whose pivot PETSc's own factorization stopped.
    fn zero_pivot(&self, a: &Matrix) -> Option<usize> {
        let (factor, mut pivot, mut row) = (self.matrix, 0.0, 0);
        // SAFETY: a live factor.
        let code = call(|| unsafe { ffi::MatFactorGetErrorZeroPivot(factor, &raw mut pivot, &raw mut row) });
        let row = usize::try_from(row).ok().filter(|&row| row < a.layout.shape_of_all().0);
        code.ok().and(row)
    }

    pub(super) fn solve(&self, a: &Matrix, b: &Vector, x: &mut Vector) -> Result<SolveOutcome, PetscError> {
        self.ksp.solve(a, b, x, false)
    }

    /// Solves `A x_k = b_k` for all `k` at once; requires that solves do not iterate.
    pub(super) fn solve_many(&self, a: &Matrix, b: &[Vector], x: &mut [Vector]) -> Result<(), PetscError> {
        self.ksp.solve_many(a, b, x)
    }
}
