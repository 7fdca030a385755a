//! The solver: Krylov methods on the device, and the direct solvers of `sparse` on the host.

use std::convert::Infallible;
use std::sync::Arc;

use super::multigrid::DeviceMultigrid;
use super::{Cuda, CudaError, Device, Failure, Matrix, Vector};
use crate::backends::checks::{check_analyzable, check_columns, check_finite, check_pattern};
use crate::backends::iterative::{ApproximateInverse, IterativeSolver, SimplePreconditioner};
use crate::backends::local;
use crate::backends::sparse::{self, Sparse};
use crate::las::{
    Backend, FactorReport, Method, Preconditioner, SolveError, SolveReport, Solver as _, SolverParams, Sparsity,
    VectorOps,
};

/// The analysis of a pattern, shared by all its solvers.
pub struct Symbolic {
    device: Device,
    pattern: Arc<Sparsity>,
    params: SolverParams,
    /// The analysis of the direct solver; `None` for an iterative one.
    direct: Option<Arc<sparse::Symbolic>>,
}

/// The solver for matrices with one sparsity pattern.
///
/// With [`Method::Iterative`], the solver runs a Krylov method on the device, with no preconditioner, the diagonal or
/// multigrid. Otherwise the direct solver of [`sparse`](crate::backends::sparse) factors and solves on the host.
pub struct Solver {
    symbolic: Arc<Symbolic>,
    /// The direct solver, made at once or where an iterative one fails.
    direct: Option<sparse::Solver>,
    /// Whether the direct solver has the current factorization.
    is_direct: bool,
    iterative: Option<Box<IterativeSolver<Cuda>>>,
}

/// Converts an error of the solver on the host.
pub(super) fn of_host(error: SolveError<Infallible>) -> Failure {
    match error {
        SolveError::Unsupported { what, cure, .. } => SolveError::Unsupported { backend: Cuda::NAME, what, cure },
        error => error.map_backend(|never| match never {}),
    }
}

impl Symbolic {
    pub(super) fn new(device: &Device, pattern: &Arc<Sparsity>, params: &SolverParams) -> Result<Self, Failure> {
        check_analyzable(pattern, params)?;
        let direct = match params.method {
            Method::Direct => Some(Sparse::<f64>::analyze(&(), pattern, params).map_err(of_host)?),
            Method::Iterative(_) => None,
        };
        Ok(Self { device: device.clone(), pattern: Arc::clone(pattern), params: *params, direct })
    }
}

impl Solver {
    pub(super) fn new(symbolic: &Arc<Symbolic>) -> Result<Self, Failure> {
        let Symbolic { device, pattern, params, direct } = &**symbolic;
        let (mut solver_on_host, mut iterative) = (None, None);
        if let Some(direct) = direct {
            solver_on_host = Some(Sparse::<f64>::solver(direct).map_err(of_host)?);
        }
        if let Method::Iterative(method) = params.method {
            let inverse: Box<dyn ApproximateInverse<Cuda>> = match method.preconditioner {
                Preconditioner::None => Box::new(SimplePreconditioner::<Cuda>::None),
                Preconditioner::Diagonal => {
                    Box::new(SimplePreconditioner::<Cuda>::diagonal(Vector::zeros(device, pattern.rows())))
                }
                Preconditioner::Multigrid => Box::new(DeviceMultigrid::new(device, pattern, params.symmetry)?),
                Preconditioner::Ilut { .. } => {
                    return Err(SolveError::Unsupported {
                        backend: Cuda::NAME,
                        what: "incomplete factorization",
                        cure: "use the diagonal, multigrid, a direct method, or the backend `sparse`",
                    });
                }
            };
            iterative = Some(Box::new(IterativeSolver::new(device, pattern.rows(), method, inverse)?));
        }
        Ok(Self { symbolic: Arc::clone(symbolic), direct: solver_on_host, is_direct: false, iterative })
    }

    /// Returns an error if the matrix has another pattern or a value that is not finite.
    fn check(&self, a: &Matrix) -> Result<(), Failure> {
        let expected = &self.symbolic.pattern;
        check_pattern(a.pattern(), expected)?;
        check_finite(expected, a.values(), local::all_finite)
    }

    /// Checks the next matrix.
    fn check_next(&mut self, a: &Matrix) -> Result<(), Failure> {
        let checked = self.check(a);
        IterativeSolver::unless_invalid(&mut self.iterative, checked)
    }

    /// Factors a matrix on the host; after an iterative method failed, with a solver made on first use.
    fn factor_directly(&mut self, a: &Matrix) -> Result<FactorReport, Failure> {
        self.is_direct = false;
        let direct = match &mut self.direct {
            Some(direct) => direct,
            empty => {
                let Symbolic { pattern, params, .. } = &*self.symbolic;
                let params = SolverParams { method: Method::Direct, ..*params };
                let symbolic = Sparse::<f64>::analyze(&(), pattern, &params).map_err(of_host)?;
                empty.insert(Sparse::<f64>::solver(&symbolic).map_err(of_host)?)
            }
        };
        let report = direct.factor(a.on_host()).map_err(of_host)?;
        self.is_direct = true;
        Ok(report)
    }

    /// Solves on the host.
    fn solve_directly(&mut self, b: &[Vector], x: &mut [Vector]) -> Result<SolveReport, Failure> {
        check_columns(self.symbolic.pattern.rows(), b.iter().map(VectorOps::len), x.iter().map(VectorOps::len))?;
        let (Some(direct), true) = (&mut self.direct, self.is_direct) else { return Err(SolveError::NotFactored) };
        if let ([b], [x]) = (b, &mut *x) {
            return direct.solve(b.on_host()?, x.overwrite_on_host()).map_err(of_host);
        }
        let right = b.iter().map(|b| Ok(b.on_host()?.clone())).collect::<Result<Vec<_>, CudaError>>()?;
        let mut solution: Vec<_> = x.iter_mut().map(|x| std::mem::take(x.overwrite_on_host())).collect();
        let outcome = direct.solve_many(&right, &mut solution);
        x.iter_mut().zip(solution).for_each(|(x, solution)| *x.overwrite_on_host() = solution);
        outcome.map_err(of_host)
    }
}

impl crate::las::Solver<Cuda> for Solver {
    fn factor(&mut self, a: &Matrix) -> Result<FactorReport, Failure> {
        self.is_direct = false;
        self.check_next(a)?;
        let Some(iterative) = &mut self.iterative else { return self.factor_directly(a) };
        match iterative.factor(a) {
            Err(_) if self.symbolic.params.fallback => self.factor_directly(a),
            outcome => outcome.map(|(report, _)| report),
        }
    }

    fn update(&mut self, a: &Matrix) -> Result<FactorReport, Failure> {
        if self.iterative.is_none() {
            return self.factor_directly(a);
        }
        // A direct method replaces the iterative one until the next `factor`.
        let was_direct = std::mem::take(&mut self.is_direct);
        self.check_next(a)?;
        if was_direct {
            return self.factor_directly(a);
        }
        let Some(iterative) = &mut self.iterative else { return Err(SolveError::NotFactored) };
        match iterative.update(a) {
            Err(_) if self.symbolic.params.fallback => self.factor_directly(a),
            outcome => outcome,
        }
    }

    fn set_tolerance(&mut self, tolerance: f64) {
        if let Some(iterative) = &mut self.iterative {
            iterative.set_tolerance(tolerance);
        }
    }

    fn uses_near_null_space(&self) -> bool {
        self.iterative.as_ref().is_some_and(|iterative| iterative.uses_near_null_space())
    }

    fn set_near_null_space(&mut self, vectors: &[Vec<f64>]) -> Result<(), Failure> {
        self.iterative.as_mut().map_or(Ok(()), |iterative| iterative.set_near_null_space(vectors))
    }

    fn factor_definite(&mut self, a: &Matrix) -> Result<FactorReport, Failure> {
        self.is_direct = false;
        self.check_next(a)?;
        if let Some(iterative) = &mut self.iterative {
            return iterative.factor_definite(a);
        }
        let Some(direct) = &mut self.direct else { return Err(SolveError::NotFactored) };
        let report = direct.factor_definite(a.on_host()).map_err(of_host)?;
        self.is_direct = true;
        Ok(report)
    }

    fn solve_many(&mut self, b: &[Vector], x: &mut [Vector]) -> Result<SolveReport, Failure> {
        let mut report = SolveReport::DIRECT;
        if let (Some(iterative), false) = (&mut self.iterative, self.is_direct) {
            let outcome = iterative.solve_columns(b, x);
            let (Err(SolveError::NotConverged { iterations, .. }), true) = (&outcome, self.symbolic.params.fallback)
            else {
                return outcome;
            };
            report = SolveReport { iterations: *iterations, residual: 0.0, fallbacks: 1 };
            let a = iterative.matrix().ok_or(SolveError::NotFactored)?;
            self.factor_directly(&a)?;
        }
        self.solve_directly(b, x).map(|of| report.merge(of))
    }
}
