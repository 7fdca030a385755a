//! The load-step driver: steps through pseudo-time, cuts steps that fail, tells the observer.
//!
//! A run has `count` steps; step `k` ends at `t = k / count`. An attempt that fails takes displacements and micro states
//! back to the last converged ones, and the increment is halved, up to `max_cuts` times; after a success it doubles
//! again, as soon as the doubled increment ends where a step can end. A converged sub-step is committed, but only full
//! steps are reported, so that the rows of a result do not depend on the cuts.

mod error;
mod observer;
mod params;
mod saved;

use std::sync::Arc;

pub use error::{SetupError, StepFailure, SteppingError};
pub use observer::{ConvergedStep, FailedAttempt, StepObserver};
pub use params::{StepParams, StepReport, StepStart};
pub use saved::{RestoreError, SavedState, StepperRestoreError};

use super::assembly::{self, Assembler, Unknowns};
use super::boundary::{Boundary, Conditions};
use super::equilibrium::{BodyState, Equilibrium, EquilibriumError};
use super::mesh::Mesh;
use super::point_field::PointField;
use super::reactions::BoundaryForces;
use crate::las::{Backend, NewtonError, NewtonFailure, NewtonReport, NewtonSystem, Scalar, SolveError, VectorOps};

/// A body, its linear system, and where in pseudo-time it is.
pub struct Stepper<B: Backend, P> {
    body: Equilibrium<B, P>,
    system: NewtonSystem<B>,
    params: StepParams,
    /// Full steps that have converged.
    done: usize,
    /// Halvings of the increment that the next attempt starts with.
    halvings: u32,
    /// Whether the accepted state is still the undeformed one.
    undeformed: bool,
}

/// The [`SteppingError`] of a run on backend `B` with point field `P`, watched by an observer that fails by `O`.
pub type RunError<B, P, O> = SteppingError<<P as PointField>::Error, <B as Backend>::Fault, O>;

/// What an attempt ends with.
type Attempt<B, P> = Result<NewtonReport, Box<Failed<<P as PointField>::Error, <B as Backend>::Fault>>>;

/// Why an attempt failed, and what Newton had done.
struct Failed<E, F> {
    reason: StepFailure<E, F>,
    newton: NewtonReport,
    /// Shorter steps will not help.
    hopeless: bool,
}

impl<B, P> Stepper<B, P>
where
    B: Backend<Scalar = f64>,
    B::Reduced: Scalar,
    P: PointField,
{
    /// The undeformed body at `t = 0`, ready to run.
    ///
    /// # Errors
    /// [`SetupError`].
    pub fn new(
        context: &B::Context,
        mesh: Arc<Mesh>,
        conditions: &Conditions,
        field: P,
        params: StepParams,
    ) -> Result<Self, SetupError<P::Error, B::Fault>> {
        let boundary = Boundary::new(&mesh, conditions)?;
        let geometry = assembly::geometry(&mesh)?;
        let prescribed = boundary.prescribed(mesh.nodes().len());
        let unknowns = Unknowns::new(mesh.nodes().len(), |node, component| prescribed[node][component])?;
        let pattern = Arc::new(unknowns.pattern(&mesh)?);
        let symbolic = B::analyze(context, &pattern, &params.solver).map_err(SetupError::System)?;
        let system = NewtonSystem::new(context, &pattern, &symbolic).map_err(SetupError::System)?;
        let assembler = Assembler::new(geometry, &mesh, &unknowns, &system.matrix)
            .map_err(|fault| SetupError::System(SolveError::Fault(fault)))?;
        let body = Equilibrium::new(mesh, boundary, assembler, field).map_err(SetupError::Undeformed)?;
        Ok(Self { body, system, params, done: 0, halvings: 0, undeformed: true })
    }

    /// The last converged state.
    #[must_use]
    pub fn state(&self) -> &BodyState {
        self.body.accepted()
    }

    /// What acts on the body in the last converged state.
    #[must_use]
    pub fn forces(&self) -> BoundaryForces {
        self.body.forces()
    }

    /// What the body is made of.
    #[must_use]
    pub fn field(&self) -> &P {
        self.body.field()
    }

    /// The mesh.
    #[must_use]
    pub fn mesh(&self) -> &Arc<Mesh> {
        self.body.mesh()
    }

    /// Full steps that have converged.
    #[must_use]
    pub fn done(&self) -> usize {
        self.done
    }

    /// Full steps of the whole run.
    #[must_use]
    pub fn count(&self) -> usize {
        self.params.count
    }

    /// Unknowns of the linear system.
    #[must_use]
    pub fn unknowns(&self) -> usize {
        self.system.residual.len()
    }

    /// Takes all steps that are left.
    ///
    /// # Errors
    /// [`SteppingError`]; the state is the last converged one.
    pub fn run<O: StepObserver<P, B::Fault>>(
        &mut self,
        observer: &mut O,
    ) -> Result<Vec<StepReport>, RunError<B, P, O::Error>> {
        let mut reports = Vec::new();
        while self.done < self.params.count {
            reports.push(self.step(observer)?);
        }
        Ok(reports)
    }

    /// Takes the next full step, in as many parts as it needs.
    ///
    /// # Errors
    /// [`SteppingError`]; the state is the last converged one, which may lie within the step.
    pub fn step<O: StepObserver<P, B::Fault>>(
        &mut self,
        observer: &mut O,
    ) -> Result<StepReport, RunError<B, P, O::Error>> {
        let max_cuts = self.params.max_cuts.min(StepParams::MAX_CUTS);
        // Positions within the step are counted in the smallest increments.
        let end = 1_u64 << max_cuts;
        let (step, mut position) = (self.done + 1, 0);
        let count = self.params.count as f64;
        let time = move |position: u64| {
            let whole = if position == end { step as f64 } else { (step - 1) as f64 + position as f64 / end as f64 };
            whole / count
        };
        let mut report = StepReport { step, t: time(end), ..StepReport::default() };
        while position < end {
            let increment = end >> self.halvings;
            let (from, t) = (time(position), time(position + increment));
            match self.attempt(t, &mut report) {
                Ok(newton) => {
                    report.substeps.push(newton);
                    self.body.accept();
                    self.undeformed = false;
                    position += increment;
                    if self.halvings > 0 && position.is_multiple_of(2 * increment) {
                        self.halvings -= 1;
                    }
                }
                Err(failed) => {
                    let Failed { reason, newton, hopeless } = *failed;
                    self.body.reject();
                    let halvings = self.halvings;
                    let (increment, field) = (t - from, self.body.field());
                    let attempt =
                        FailedAttempt { step, t, increment, halvings, reason: &reason, newton: &newton, field };
                    observer.failed(&attempt).map_err(|reason| SteppingError::Stopped { step, t: from, reason })?;
                    report.failures.push(newton);
                    if hopeless || halvings == max_cuts {
                        let increment = t - from;
                        return Err(SteppingError::NotConverged {
                            step,
                            t,
                            reached: from,
                            increment,
                            halvings,
                            reason,
                        });
                    }
                    self.halvings += 1;
                    report.cuts += 1;
                }
            }
        }
        self.done = step;
        observer.converged(&self.converged(&report)).map_err(|reason| SteppingError::Stopped {
            step,
            t: report.t,
            reason,
        })?;
        Ok(report)
    }

    fn converged<'a>(&'a self, report: &'a StepReport) -> ConvergedStep<'a, P> {
        ConvergedStep {
            step: report.step,
            count: self.params.count,
            t: report.t,
            report,
            mesh: self.body.mesh(),
            state: self.body.accepted(),
            forces: self.body.forces(),
            field: self.body.field(),
        }
    }

    /// From the accepted state to pseudo-time `t`, from a held or a linearised start.
    fn attempt(&mut self, t: f64, report: &mut StepReport) -> Attempt<B, P> {
        if self.undeformed || self.params.start == StepStart::Tangent {
            return self.attempt_linearised(t, report);
        }
        self.body.hold(t);
        match self.system.solve(&mut self.body, &self.params.newton) {
            Ok(newton) => Ok(newton),
            // The moved boundary has crushed the elements next to it: spread it over the body.
            Err(failure) if has_no_start(&failure) => {
                self.body.reject();
                self.attempt_linearised(t, report)
            }
            Err(failure) => Err(Failed::boxed(failure)),
        }
    }

    fn attempt_linearised(&mut self, t: f64, report: &mut StepReport) -> Attempt<B, P> {
        let seconds = self.body.linearise(t, &mut self.system).map_err(|error| {
            Box::new(Failed {
                // The tangent of the undeformed body does not depend on the increment.
                hopeless: self.undeformed || matches!(error, SolveError::Fault(_)),
                reason: NewtonError::Solve(error),
                newton: NewtonReport::default(),
            })
        })?;
        report.add_linearised(seconds);
        self.system.solve(&mut self.body, &self.params.newton).map_err(Failed::boxed)
    }
}

/// Whether Newton failed at its very first residual.
fn has_no_start<E, F>(failure: &NewtonFailure<EquilibriumError<E, F>, F>) -> bool
where
    E: std::fmt::Display,
    F: std::fmt::Display,
{
    let not_there =
        matches!(failure.reason, NewtonError::Problem(EquilibriumError::Points(_)) | NewtonError::NotFinite);
    not_there && failure.report.residuals.is_empty()
}

impl<E, F> Failed<E, F>
where
    E: std::fmt::Display,
    F: std::fmt::Display,
{
    fn boxed(failure: NewtonFailure<EquilibriumError<E, F>, F>) -> Box<Self> {
        let hopeless = matches!(
            failure.reason,
            NewtonError::Solve(SolveError::Fault(_)) | NewtonError::Problem(EquilibriumError::Backend(_))
        );
        Box::new(Self { reason: failure.reason, newton: *failure.report, hopeless })
    }
}

#[cfg(all(test, feature = "sparse"))]
mod tests;
