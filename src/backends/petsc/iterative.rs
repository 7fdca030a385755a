//! The Krylov methods of PETSc.

use std::ffi::CStr;

use super::error::PetscError;
use super::ksp::Ksp;
use super::session::call;
use super::{Matrix, Petsc, SolverError, Vector, ffi};
use crate::backends::kept::KeptPreconditioner;
use crate::las::{
    Backend, Factorization, Iterative, Krylov, MatVec, Preconditioner, SolveError, SolveReport, StopReason, VectorOps,
};

/// A Krylov method with its preconditioner, on one matrix.
#[derive(Debug)]
pub(super) struct ByIterations {
    ksp: Ksp,
    /// The types of the method and of its preconditioner, before the options database.
    types: [&'static CStr; 2],
    method: Iterative,
    /// Whether the tolerance has changed since the last solve; otherwise that of the options database holds.
    is_changed: bool,
    /// Whether the tolerance has changed since the options database was read.
    is_own_tolerance: bool,
    /// The product `A x`, for the true residual.
    product: Vector,
    kept: KeptPreconditioner,
    /// Whether there was a preconditioner of this or of another matrix.
    is_used: bool,
    /// Whether there is a preconditioner.
    is_ready: bool,
    /// Whether the preconditioner is worth keeping for other values of the matrix.
    is_costly: bool,
}

/// The types of preconditioners that are kept, because their setup takes as long as many iterations.
const COSTLY: [&str; 4] = ["gamg", "hypre", "ml", "hmg"];

/// The largest number of runs of a method that reports convergence although the true residual is too large.
const ROUNDS: usize = 4;

/// The code of a method that reached its iteration limit.
const KSP_DIVERGED_ITS: i32 = -3;

impl ByIterations {
    pub(super) fn new(a: &Matrix, method: Iterative) -> Result<Self, SolverError> {
        let preconditioner = match method.preconditioner {
            Preconditioner::None => c"none",
            Preconditioner::Diagonal => c"jacobi",
            Preconditioner::Multigrid => c"gamg",
            Preconditioner::Ilut { .. } => {
                return Err(SolveError::Unsupported {
                    backend: Petsc::NAME,
                    what: "incomplete factorization with a threshold",
                    cure: "use the diagonal, multigrid, or one of PETSc's by the options database: `pc_type` `ilu` with \
                           `pc_factor_levels` (one rank), or `hypre` with `pc_hypre_type` `euclid` or `pilut`",
                });
            }
        };
        let krylov = match method.krylov {
            Krylov::Cg => c"cg",
            Krylov::BiCgStab => c"bcgs",
            Krylov::Gmres { .. } => c"gmres",
        };
        let types = [krylov, preconditioner];
        let ksp = create(a, types, &method)?;
        // The options database may have replaced the preconditioner.
        let [_, used] = ksp.types()?;
        Ok(Self {
            ksp,
            types,
            method,
            is_changed: false,
            is_own_tolerance: false,
            product: Vector::zeros(&a.context, a.pattern().rows())?,
            kept: KeptPreconditioner::default(),
            is_used: false,
            is_ready: false,
            is_costly: COSTLY.contains(&used.as_str()),
        })
    }

    /// Sets the relative residual at which the next solves stop.
    pub(super) fn set_tolerance(&mut self, tolerance: f64) {
        self.is_changed |= tolerance != self.method.tolerance;
        self.is_own_tolerance |= self.is_changed;
        self.method.tolerance = tolerance;
    }

    /// Computes the preconditioner, of this matrix alone: an object that has seen another one keeps some of it, as GAMG its
    /// aggregates and the interpolation, even after `KSPReset`.
    pub(super) fn set_up(&mut self, a: &Matrix) -> Result<(), SolverError> {
        (self.kept, self.is_ready) = (KeptPreconditioner::default(), false);
        if std::mem::replace(&mut self.is_used, true) && self.is_costly {
            self.ksp = create(a, self.types, &self.method)?;
            self.is_changed = self.is_own_tolerance;
        }
        self.ksp.set_up(a)?;
        let (pc, mut reason) = (self.ksp.pc(), 0);
        // SAFETY: a live object.
        call(|| unsafe { ffi::PCGetFailedReason(pc, &raw mut reason) })?;
        // A local block may fail on one rank alone.
        let reason = a.context.largest_code(reason);
        if reason == 0 {
            self.is_ready = true;
            return Ok(());
        }
        Err(SolveError::Library { library: "PETSc", reason: format!("no preconditioner (PCFailedReason {reason})") })
    }

    /// Keeps the preconditioner for new values of the matrix; `None` if it has to be computed again, because the last solve
    /// took too many iterations, or because this costs little.
    pub(super) fn keep(&mut self) -> Option<Factorization> {
        (self.is_costly && self.is_ready && self.kept.keep()).then(|| self.kept.kind())
    }

    /// Solves; if a kept preconditioner does not serve, computes that of this matrix.
    pub(super) fn solve(&mut self, a: &Matrix, b: &Vector, x: &mut Vector) -> Result<SolveReport, SolverError> {
        if !self.is_ready {
            return Err(SolveError::NotFactored);
        }
        self.method.check().map_err(SolveError::Parameter)?;
        let outcome = self.solve_once(a, b, x);
        let Err(SolveError::NotConverged { iterations: wasted, .. }) = outcome else { return outcome };
        // Without another preconditioner, the method has not converged.
        if !self.kept.is_kept() || a.context.agree(self.set_up(a)).is_err() {
            return outcome;
        }
        self.solve_once(a, b, x).map(|of| of.after(wasted)).map_err(|error| error.after(wasted))
    }

    /// Solves until the true residual is small enough, because the residual that a method computes recursively drifts
    /// away from it.
    fn solve_once(&mut self, a: &Matrix, b: &Vector, x: &mut Vector) -> Result<SolveReport, SolverError> {
        let size = b.norm()?;
        if size == 0.0 {
            x.zero()?;
            return Ok(SolveReport::DIRECT);
        }
        if !size.is_finite() {
            return Err(SolveError::RhsNotFinite);
        }
        if std::mem::take(&mut self.is_changed) {
            set_limits(&self.ksp, &self.method)?;
        }
        let mut report = SolveReport { iterations: 0, residual: 1.0, fallbacks: 0 };
        let mut reason = 0;
        for round in 0..ROUNDS {
            let ended = self.ksp.solve(a, b, x, round > 0)?;
            report.iterations += ended.iterations;
            reason = ended.reason;
            a.mul(x, &mut self.product)?;
            let squares = b.as_slice().iter().zip(self.product.as_slice()).map(|(b, ax)| ((b - ax) / size).powi(2));
            report.residual = a.context.sum_of_parts(squares.sum()).sqrt();
            if report.residual <= self.method.tolerance {
                self.kept.judge(&report);
                return Ok(report);
            }
            if reason <= 0 || report.residual.is_nan() {
                break;
            }
        }
        let stop_reason = match reason {
            KSP_DIVERGED_ITS => StopReason::MaxIterations,
            // PETSc reported convergence in every round.
            1.. => StopReason::Stagnated,
            _ => StopReason::Breakdown,
        };
        Err(self.method.not_converged(report, stop_reason))
    }
}

/// Creates the object of a method with the options of the database.
fn create(a: &Matrix, [krylov, preconditioner]: [&'static CStr; 2], method: &Iterative) -> Result<Ksp, PetscError> {
    let ksp = Ksp::new(a, krylov, preconditioner)?;
    set(&ksp, method)?;
    ksp.set_from_options()?;
    Ok(ksp)
}

/// Sets the tolerances and the number of iterations.
fn set_limits(ksp: &Ksp, method: &Iterative) -> Result<(), PetscError> {
    let (raw, most) = (ksp.raw(), i32::try_from(method.max_iterations).unwrap_or(i32::MAX));
    // SAFETY: a live object.
    call(|| unsafe { ffi::KSPSetTolerances(raw, method.tolerance, f64::MIN_POSITIVE, 1e30, most) })
}

/// Sets the tolerances, the preconditioning side and the restart length. All methods test the unpreconditioned residual
/// norm.
fn set(ksp: &Ksp, method: &Iterative) -> Result<(), PetscError> {
    set_limits(ksp, method)?;
    let raw = ksp.raw();
    // SAFETY: a live object, as in all that follows.
    call(|| unsafe { ffi::KSPSetNormType(raw, ffi::KSP_NORM_UNPRECONDITIONED) })?;
    if method.krylov != Krylov::Cg {
        call(|| unsafe { ffi::KSPSetPCSide(raw, ffi::PC_RIGHT) })?;
    }
    if let Krylov::Gmres { restart } = method.krylov {
        let restart = i32::try_from(restart.max(1)).unwrap_or(i32::MAX);
        call(|| unsafe { ffi::KSPGMRESSetRestart(raw, restart) })?;
    }
    Ok(())
}
