//! The load-step driver: steps through pseudo-time, cuts steps that fail, tells the observer.
//!
//! A run has `count` steps; step `k` ends at `t = k / count`. An attempt that fails takes displacements and micro states
//! back to the last converged ones, and the increment is halved, up to `max_cuts` times; after a success it doubles
//! again, as soon as the doubled increment ends where a step can end. A converged sub-step is committed, but only full
//! steps are reported, so that the rows of a result do not depend on the cuts.
//!
//! A state is accepted once it balances, once every response in it continues the last accepted state
//! ([`PointField::verify`]), and once the material of no point is due to change in it ([`PointField::evolve`]). Until
//! then the body is brought to balance again at the same pseudo-time.

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
use super::rigid_modes;
use crate::las::{
    Backend, NewtonError, NewtonFailure, NewtonReport, NewtonSystem, NonlinearProblem, Scalar, SolveError, VectorOps,
};

/// A body, its linear system, and where in pseudo-time it is.
pub struct Stepper<B: Backend, P> {
    body: Equilibrium<B, P>,
    system: NewtonSystem<B>,
    params: StepParams,
    /// Full steps that have converged.
    completed_steps: usize,
    /// Halvings of the increment that the next attempt starts with.
    halvings: u32,
    /// Whether the accepted state is still the undeformed one.
    undeformed: bool,
}

/// The [`SteppingError`] of a run on backend `B` with point field `P`, watched by an observer that fails by `O`.
pub type RunError<B, P, O> = SteppingError<<P as PointField>::Error, <B as Backend>::Fault, O>;

/// What an attempt, or a part of one, ends with.
type Attempt<B, P, T> = Result<T, Box<Failed<<P as PointField>::Error, <B as Backend>::Fault>>>;

/// Where an attempt begins and where it is to end, in pseudo-time.
#[derive(Clone, Copy)]
struct Span {
    step: usize,
    from: f64,
    t: f64,
}

/// Why an attempt failed, and what Newton had done.
struct Failed<E, F> {
    reason: StepFailure<E, F>,
    newton: NewtonReport,
    /// Shorter steps will not help.
    unrecoverable: bool,
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
        let order: Vec<u32> = (0..mesh.nodes().len() as u32).collect();
        Self::in_order(&order, context, mesh, conditions, field, params)
    }

    /// The same, with the unknowns numbered node by node as `order` has them, every node once: ranks that share the rows of
    /// the linear system have neighboring ones.
    ///
    /// # Errors
    /// [`SetupError`].
    ///
    /// # Panics
    /// Where `order` is not one of all nodes.
    pub fn in_order(
        order: &[u32],
        context: &B::Context,
        mesh: Arc<Mesh>,
        conditions: &Conditions,
        field: P,
        params: StepParams,
    ) -> Result<Self, SetupError<P::Error, B::Fault>> {
        assert_eq!(order.len(), mesh.nodes().len(), "every node has its place");
        let boundary = Boundary::new(&mesh, conditions)?;
        let geometry = assembly::geometry(&mesh)?;
        let prescribed = boundary.prescribed(mesh.nodes().len());
        rigid_modes::check(&mesh, &prescribed)?;
        let unknowns = Unknowns::in_order(order, |node, component| prescribed[node][component])?;
        let pattern = Arc::new(unknowns.pattern(&mesh)?);
        let symbolic = B::analyze(context, &pattern, &params.solver).map_err(SetupError::System)?;
        let system = NewtonSystem::new(context, &pattern, &symbolic).map_err(SetupError::System)?;
        let assembler = Assembler::new(geometry, &mesh, &unknowns, &system.matrix)
            .map_err(|fault| SetupError::System(SolveError::Fault(fault)))?;
        let body = Equilibrium::new(mesh, boundary, assembler, field).map_err(SetupError::Undeformed)?;
        Ok(Self { body, system, params, completed_steps: 0, halvings: 0, undeformed: true })
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
    pub fn completed_steps(&self) -> usize {
        self.completed_steps
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
        while self.completed_steps < self.params.count {
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
        let (step, mut position) = (self.completed_steps + 1, 0);
        let count = self.params.count as f64;
        let time = move |position: u64| {
            let whole = if position == end { step as f64 } else { (step - 1) as f64 + position as f64 / end as f64 };
            whole / count
        };
        let mut report = StepReport { step, t: time(end), ..StepReport::default() };
        while position < end {
            let increment = end >> self.halvings;
            let span = Span { step, from: time(position), t: time(position + increment) };
            let mut solves = Vec::new();
            let outcome = match self.attempt(span.t, &mut report, &mut solves) {
                Ok(()) => self.body.accept().map_err(|error| lost(error, NewtonReport::default())),
                Err(failed) => match self.body.reject() {
                    Ok(()) => Err(failed),
                    Err(error) => Err(lost(error, failed.newton)),
                },
            };
            match outcome {
                Ok(()) => {
                    report.substeps.append(&mut solves);
                    self.undeformed = false;
                    position += increment;
                    if self.halvings > 0 && position.is_multiple_of(2 * increment) {
                        self.halvings -= 1;
                    }
                }
                Err(mut failed) => {
                    // Newton converged, but the state could not be accepted.
                    if failed.newton.residuals.is_empty() {
                        failed.newton = solves.pop().unwrap_or_default();
                    }
                    report.failures.append(&mut solves);
                    report.failures.push(failed.newton.clone());
                    self.cut(span, *failed, max_cuts, observer)?;
                    report.cuts += 1;
                }
            }
        }
        self.completed_steps = step;
        observer.converged(&self.converged(&report)).map_err(|reason| SteppingError::Stopped {
            step,
            t: report.t,
            reason,
        })?;
        Ok(report)
    }

    /// Tells the observer of a failed attempt; the next one goes half as far, if that may help.
    fn cut<O: StepObserver<P, B::Fault>>(
        &mut self,
        Span { step, from, t }: Span,
        Failed { reason, newton, unrecoverable }: Failed<P::Error, B::Fault>,
        max_cuts: u32,
        observer: &mut O,
    ) -> Result<(), RunError<B, P, O::Error>> {
        let (increment, halvings, field) = (t - from, self.halvings, self.body.field());
        let attempt = FailedAttempt { step, t, increment, halvings, reason: &reason, newton: &newton, field };
        observer.failed(&attempt).map_err(|reason| SteppingError::Stopped { step, t: from, reason })?;
        if unrecoverable || halvings == max_cuts {
            return Err(SteppingError::NotConverged { step, t, reached: from, increment, halvings, reason });
        }
        self.halvings += 1;
        Ok(())
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

    /// From the accepted state to a balanced one at pseudo-time `t` in which every response continues the accepted state
    /// and the material of no point is due to change. `solves` collects what each Newton that converged did.
    fn attempt(&mut self, t: f64, report: &mut StepReport, solves: &mut Vec<NewtonReport>) -> Attempt<B, P, ()> {
        /// Where responses still do not continue the accepted state after so many rounds, they jump back and forth between
        /// branches, and only a shorter step helps.
        const MAX_REPLACEMENTS: usize = 5;
        solves.push(self.start(t, report)?);
        let (mut rounds, mut replacements) = (0, 0);
        loop {
            if self.body.verify().map_err(unacceptable::<B, P>)? {
                if replacements == MAX_REPLACEMENTS {
                    return Err(unacceptable::<B, P>(EquilibriumError::OffBranch { rounds: replacements }));
                }
                replacements += 1;
                report.replaced += 1;
            } else if self.body.evolve().map_err(unacceptable::<B, P>)? {
                if rounds == self.params.max_rounds {
                    return Err(unacceptable::<B, P>(EquilibriumError::StillChanging { rounds }));
                }
                (rounds, replacements) = (rounds + 1, 0);
                report.rounds += 1;
            } else {
                break;
            }
            solves.push(self.system.solve(&mut self.body, &self.params.newton).map_err(failed::<B, P>)?);
        }
        self.body.check_balance(self.params.newton.tolerance).map_err(unacceptable::<B, P>)
    }

    /// From the accepted state to pseudo-time `t` by Newton, from a held or a linearized start.
    fn start(&mut self, t: f64, report: &mut StepReport) -> Attempt<B, P, NewtonReport> {
        if self.undeformed || self.params.start == StepStart::Tangent {
            return self.attempt_linearized(t, report);
        }
        self.body.apply_prescribed(t);
        match self.system.solve(&mut self.body, &self.params.newton) {
            Ok(newton) => Ok(newton),
            // The moved boundary has crushed the elements next to it: spread it over the body.
            Err(failure) if has_no_start::<B, P>(&failure) => {
                self.body.reject().map_err(|error| lost(error, NewtonReport::default()))?;
                self.attempt_linearized(t, report)
            }
            Err(failure) => Err(failed::<B, P>(failure)),
        }
    }

    fn attempt_linearized(&mut self, t: f64, report: &mut StepReport) -> Attempt<B, P, NewtonReport> {
        let seconds = self.body.linearize(t, &mut self.system).map_err(|error| {
            Box::new(Failed {
                // The tangent of the undeformed body does not depend on the increment.
                unrecoverable: self.undeformed || matches!(error, SolveError::Fault(_)),
                reason: NewtonError::Solve(error),
                newton: NewtonReport::default(),
            })
        })?;
        report.add_linearized(seconds);
        self.system.solve(&mut self.body, &self.params.newton).map_err(failed::<B, P>)
    }
}

/// Whether Newton failed at its very first residual, for a reason that another start may not have.
fn has_no_start<B: Backend, P: PointField>(
    failure: &NewtonFailure<EquilibriumError<P::Error, B::Fault>, B::Fault>,
) -> bool {
    let not_there = match &failure.reason {
        NewtonError::Problem(EquilibriumError::Points(error)) => !P::is_final(error),
        reason => matches!(reason, NewtonError::NotFinite),
    };
    not_there && failure.report.residuals.is_empty()
}

fn failed<B, P>(
    failure: NewtonFailure<EquilibriumError<P::Error, B::Fault>, B::Fault>,
) -> Box<Failed<P::Error, B::Fault>>
where
    B: Backend<Scalar = f64>,
    B::Reduced: Scalar,
    P: PointField,
{
    let unrecoverable = match &failure.reason {
        NewtonError::Solve(SolveError::Fault(_)) => true,
        NewtonError::Problem(error) => <Equilibrium<B, P> as NonlinearProblem<B>>::is_final(error),
        _ => false,
    };
    Box::new(Failed { reason: failure.reason, newton: *failure.report, unrecoverable })
}

/// The converged state cannot be accepted, for a reason that a shorter step may not have.
fn unacceptable<B, P>(error: EquilibriumError<P::Error, B::Fault>) -> Box<Failed<P::Error, B::Fault>>
where
    B: Backend<Scalar = f64>,
    B::Reduced: Scalar,
    P: PointField,
{
    let unrecoverable = <Equilibrium<B, P> as NonlinearProblem<B>>::is_final(&error);
    Box::new(Failed { reason: NewtonError::Problem(error), newton: NewtonReport::default(), unrecoverable })
}

/// The points could not be told what became of an attempt.
fn lost<E, F>(error: EquilibriumError<E, F>, newton: NewtonReport) -> Box<Failed<E, F>>
where
    E: std::fmt::Display,
    F: std::fmt::Display,
{
    Box::new(Failed { reason: NewtonError::Problem(error), newton, unrecoverable: true })
}

#[cfg(all(test, feature = "sparse"))]
mod tests;
