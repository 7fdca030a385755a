//! The load-step driver: steps through pseudo-time, halves failed steps, and calls the observer.
//!
//! A run has `count` load steps; step `k` ends at `t = k / count`. Break points of load curves divide a step into
//! segments, so that an increment ends exactly at each of them. If an attempt fails, displacements and micro states are
//! reset to the last converged ones, and the increment is halved, up to `max_cuts` times. After a success the increment
//! doubles again if the position within the segment is a multiple of the doubled increment. Alternatively, the
//! increments adapt to the number of Newton iterations ([`AdaptiveIncrements`]). A converged increment is committed,
//! but only full steps are reported, so the rows of a result do not depend on the cuts.
//!
//! A state is committed if it is in equilibrium, if every response continues the committed state
//! ([`PointField::verify`]), if no point changes its material ([`PointField::evolve`]), and if the volumes that
//! penalties constrain are at their targets ([`ConstraintMethod`](super::constraint::ConstraintMethod)). Otherwise,
//! equilibrium is restored at the same pseudo-time.
//!
//! # Example
//! A box is stretched by 10 % in two load steps:
//!
//! ```
//! # #[cfg(feature = "sparse")] {
//! use std::sync::Arc;
//! use biotissue::backends::sparse::Sparse;
//! use biotissue::fem::boundary::{Conditions, LoadCurve, SurfaceCondition};
//! use biotissue::fem::material::NeoHookean;
//! use biotissue::fem::mesh::shapes;
//! use biotissue::fem::point_field::FormulaField;
//! use biotissue::fem::stepping::{StepParams, Stepper};
//!
//! let mesh = Arc::new(shapes::cuboid([2, 2, 2], [1.0; 3]).unwrap());
//! let clamp = |surface: &str, x| SurfaceCondition {
//!     surface: surface.into(),
//!     displacement: [Some(x), Some(0.0), Some(0.0)],
//!     curve: LoadCurve::Ramp,
//! };
//! let conditions = Conditions { surfaces: vec![clamp("x0", 0.0), clamp("x1", 0.1)], ..Conditions::default() };
//! let field = FormulaField::uniform(NeoHookean { mu: 1.0e3, lambda: 2.0e3 }, &mesh);
//! let params = StepParams { count: 2, ..StepParams::default() };
//! let mut stepper = Stepper::<Sparse, _>::new(&(), mesh, &conditions, field, params).unwrap();
//! let reports = stepper.run(&mut ()).unwrap();
//!
//! assert_eq!((reports.len(), stepper.state().t), (2, 1.0));
//! let forces = stepper.forces();
//! assert!(forces.surfaces.iter().any(|surface| surface.name == "x1" && surface.force[0] > 300.0));
//! assert!(forces.sum().iter().all(|force| force.abs() < 1e-5));
//! # }
//! ```

mod body_part;
mod error;
mod increments;
mod observer;
mod params;
mod saved;
mod system;

use std::sync::Arc;

pub use body_part::BodyPart;
pub use error::{SetupError, StepFailure, SteppingError};
pub use increments::{AdaptiveIncrements, IncrementControl};
pub use observer::{ConvergedStep, FailedAttempt, Iterating, StepObserver};
pub use params::{StepParams, StepReport, StepStart};
pub use saved::{RestoreError, SavedState, StepperRestoreError};

use super::assembly::{self, Assembler};
use super::boundary::{Boundary, Conditions};
use super::constraint::Constraints;
use super::equilibrium::{BodyState, Equilibrium, EquilibriumError};
use super::mesh::Mesh;
use super::point_field::PointField;
use super::reactions::BoundaryForces;
use super::rigid_modes;
use crate::las::{
    Backend, Forcing, NewtonError, NewtonFailure, NewtonParams, NewtonReport, NewtonSystem, NonlinearProblem,
    RealBackend, SolveError, SolverChoice, VectorOps,
};
use increments::Increments;
pub use system::LinearSystem;

/// A body, its linear system, and its position in pseudo-time.
pub struct Stepper<B: Backend, P> {
    body: Equilibrium<B, P>,
    system: NewtonSystem<B>,
    params: StepParams,
    choice: Option<SolverChoice>,
    /// Whether the first iteration of a step uses the factorization of its linearized start.
    reuses_factorization: bool,
    /// Number of unknowns of the whole body.
    unknowns: usize,
    /// Number of converged full steps.
    completed_steps: usize,
    increments: Increments,
    /// The pseudo-times at which load curves have kinks, ascending.
    break_points: Vec<f64>,
    /// True as long as the committed state is the undeformed one.
    undeformed: bool,
}

/// The [`SteppingError`] of a run on backend `B` with point field `P` and an observer with error `O`.
pub type RunError<B, P, O> = SteppingError<<P as PointField>::Error, <B as Backend>::Error, O>;

/// The result of an attempt or of a part of one.
type Attempt<B, P, T> = Result<T, FailedAttemptOf<B, P>>;
type FailedAttemptOf<B, P> = Box<Failed<<P as PointField>::Error, <B as Backend>::Error>>;
type SolveFailure<B, P> =
    NewtonFailure<EquilibriumError<<P as PointField>::Error, <B as Backend>::Error>, <B as Backend>::Error>;

/// Receives the report of Newton's method before every iteration.
type Watch<'a> = &'a mut dyn FnMut(&NewtonReport);

/// The start and the end of an attempt in pseudo-time.
#[derive(Clone, Copy)]
struct Span {
    step: usize,
    from: f64,
    t: f64,
}

/// The reason why an attempt failed, and the report of its Newton solve.
struct Failed<E, F> {
    reason: StepFailure<E, F>,
    newton: NewtonReport,
    /// True if smaller increments cannot help.
    unrecoverable: bool,
    /// True if the attempt failed at its start, so that the other start may help.
    at_start: bool,
}

impl<B: RealBackend, P: PointField> Stepper<B, P> {
    /// Creates a stepper with the undeformed body at `t = 0`.
    ///
    /// # Errors
    /// Returns [`SetupError`] if the conditions, the mesh, the linear system or the point field prevent the setup.
    pub fn new(
        context: &B::Context,
        mesh: Arc<Mesh>,
        conditions: &Conditions,
        field: P,
        params: StepParams,
    ) -> Result<Self, SetupError<P::Error, B::Error>> {
        let order: Vec<u32> = (0..mesh.nodes().len() as u32).collect();
        Self::in_order(&order, context, mesh, conditions, field, params)
    }

    /// Creates a stepper whose unknowns are numbered node by node in the given order, a permutation of all nodes. The
    /// order determines which unknowns are neighboring rows of a linear system that is distributed over ranks.
    ///
    /// # Errors
    /// As for [`Stepper::new`].
    ///
    /// # Panics
    /// Panics if `order` does not have one entry per node or contains an index that is not a node.
    pub fn in_order(
        order: &[u32],
        context: &B::Context,
        mesh: Arc<Mesh>,
        conditions: &Conditions,
        field: P,
        params: StepParams,
    ) -> Result<Self, SetupError<P::Error, B::Error>> {
        assert_eq!(order.len(), mesh.nodes().len(), "the order has one entry per node");
        let boundary = Boundary::new(&mesh, conditions)?;
        let geometry = assembly::geometry(&mesh)?;
        rigid_modes::check(&mesh, &boundary.restraints(&mesh), boundary.kinematics().rigid_surfaces())?;
        let fixed = boundary.fixed_components(mesh.nodes().len());
        let constraints = Constraints::new(&mesh, &geometry, &conditions.constraints, &fixed)?;
        let LinearSystem { unknowns, pattern, solver, choice, has_costly_factorization } =
            LinearSystem::new::<B>(order, &mesh, &boundary, constraints.len(), &params)?;
        let symbolic = B::analyze(context, &pattern, &solver)?;
        let system = NewtonSystem::bordered(context, &pattern, &symbolic, constraints.len())?;
        let mut assembler = Assembler::new(geometry, &unknowns, &system.matrix).map_err(SolveError::Backend)?;
        assembler.locate_loads(boundary.loads(), &system.matrix).map_err(SolveError::Backend)?;
        assembler.locate_constraints(&constraints, &system.matrix).map_err(SolveError::Backend)?;
        let break_points = merged(boundary.break_points(), constraints.break_points());
        let body = Equilibrium::constrained(mesh, boundary, constraints, assembler, field)?;
        let unknowns = pattern.rows();
        Ok(Self::assembled(body, system, (choice, has_costly_factorization), (unknowns, break_points), params))
    }

    /// Creates a stepper for a part of a body; all ranks call it, and all other methods, alike. The point field has the points
    /// of the part; if it communicates, it must fail on all ranks if it fails on one. `context` is that of all ranks.
    ///
    /// # Errors
    /// As for [`Stepper::new`]. Returns [`SolveError::Unsupported`] if the backend does not distribute systems
    /// ([`Backend::with_rows`]).
    pub fn on_part(
        context: &B::Context,
        part: BodyPart,
        field: P,
        params: StepParams,
    ) -> Result<Self, SetupError<P::Error, B::Error>> {
        let BodyPart { mesh, boundary, constraints, unknowns, rows, .. } = part;
        let (solver, choice, has_costly_factorization) = (part.solver, part.choice, part.has_costly_factorization);
        let (own, total) = (rows.own.len(), rows.total);
        let context = B::with_rows(context, rows).map_err(SolveError::Backend)?.ok_or(SolveError::Unsupported {
            backend: B::NAME,
            what: "a linear system of which every rank holds a part",
            cure: "use a backend that distributes systems, or let every rank hold the whole body",
        })?;
        let geometry = assembly::geometry(&mesh)?;
        let pattern = Arc::new(unknowns.pattern(&mesh)?.first_rows(own));
        let symbolic = B::analyze(&context, &pattern, &solver)?;
        let system = NewtonSystem::bordered(&context, &pattern, &symbolic, constraints.len())?;
        let mut assembler = Assembler::new(geometry, &unknowns, &system.matrix).map_err(SolveError::Backend)?;
        assembler.locate_loads(boundary.loads(), &system.matrix).map_err(SolveError::Backend)?;
        assembler.locate_constraints(&constraints, &system.matrix).map_err(SolveError::Backend)?;
        assembler.count_own_points(&mesh);
        let body = Equilibrium::on_part((context, total), mesh, boundary, constraints, assembler, field)?;
        Ok(Self::assembled(body, system, (choice, has_costly_factorization), (total, part.break_points), params))
    }

    fn assembled(
        body: Equilibrium<B, P>,
        system: NewtonSystem<B>,
        (choice, has_costly_factorization): (Option<SolverChoice>, bool),
        (unknowns, break_points): (usize, Vec<f64>),
        mut params: StepParams,
    ) -> Self {
        if choice.is_some() {
            params.newton.forcing = params.newton.forcing.or_else(|| Some(Forcing::default()));
        }
        let increments = Increments::new(&params);
        let reuses_factorization = has_costly_factorization && body.field().is_cheap();
        Self {
            body,
            system,
            params,
            choice,
            reuses_factorization,
            unknowns,
            completed_steps: 0,
            increments,
            break_points,
            undeformed: true,
        }
    }

    /// Returns the last converged state.
    pub fn state(&self) -> &BodyState {
        self.body.committed()
    }

    /// Returns the surface and point forces in the last converged state.
    pub fn forces(&self) -> BoundaryForces {
        self.body.forces()
    }

    /// Returns the volume constraints.
    pub fn constraints(&self) -> &Constraints {
        self.body.constraints()
    }

    /// Returns the point field.
    pub fn field(&self) -> &P {
        self.body.field()
    }

    /// Returns the mesh.
    pub fn mesh(&self) -> &Arc<Mesh> {
        self.body.mesh()
    }

    /// Returns the number of converged full steps.
    pub fn completed_steps(&self) -> usize {
        self.completed_steps
    }

    /// Returns the number of full steps of the whole run.
    pub fn count(&self) -> usize {
        self.params.count
    }

    /// Returns the number of unknowns of the linear system, on all ranks.
    pub fn unknowns(&self) -> usize {
        self.unknowns
    }

    /// Returns the solver of the linear systems if it was chosen by their size.
    pub fn solver_choice(&self) -> Option<&SolverChoice> {
        self.choice.as_ref()
    }

    /// Takes all remaining steps.
    ///
    /// # Errors
    /// Returns [`SteppingError`]; the state is then the last converged one.
    pub fn run<O: StepObserver<P, B::Error>>(
        &mut self,
        observer: &mut O,
    ) -> Result<Vec<StepReport>, RunError<B, P, O::Error>> {
        let mut reports = Vec::new();
        while self.completed_steps < self.params.count {
            reports.push(self.step(observer)?);
        }
        Ok(reports)
    }

    /// Takes the next full step, in as many substeps as necessary.
    ///
    /// # Errors
    /// Returns [`SteppingError`]; the state is then the last converged one, which may lie within the step.
    pub fn step<O: StepObserver<P, B::Error>>(
        &mut self,
        observer: &mut O,
    ) -> Result<StepReport, RunError<B, P, O::Error>> {
        let (step, count) = (self.completed_steps + 1, self.params.count);
        let mut report = StepReport { step, t: self.time_after(step), ..StepReport::default() };
        for segment in increments::segments(step, count, &self.break_points) {
            let mut position = 0.0;
            while position < 1.0 {
                let end = self.increments.end(&segment, position);
                let span = Span { step, from: segment.time(position, count), t: segment.time(end, count) };
                let taken = (end - position) * (segment.end - segment.start);
                let solves = report.solves.len();
                if self.increment(span, taken, &mut report, observer)? {
                    // Only the first solve depends on the length of the increment: the others restore equilibrium at
                    // its end after augmentations and changes of the material.
                    let iterations = report.solves.get(solves).map_or(0, |first| first.iterations);
                    position = end;
                    self.increments.succeeded(position, taken, iterations);
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

    /// Attempts one increment of `taken` steps, and commits its state. Returns false if the attempt failed and may be
    /// repeated with a shorter increment.
    fn increment<O: StepObserver<P, B::Error>>(
        &mut self,
        span: Span,
        taken: f64,
        report: &mut StepReport,
        observer: &mut O,
    ) -> Result<bool, RunError<B, P, O::Error>> {
        let mut solves = Vec::new();
        let (step, count, t) = (span.step, self.params.count, span.t);
        let mut watch = |newton: &NewtonReport| observer.iterating(&Iterating { step, count, t, newton });
        let outcome = match self.attempt(t, report, &mut solves, &mut watch) {
            Ok(()) => self.body.commit().map_err(|error| Self::unrecoverable(error, NewtonReport::default())),
            Err(failed) => match self.body.revert() {
                Ok(()) => Err(failed),
                Err(error) => Err(Self::unrecoverable(error, failed.newton)),
            },
        };
        match outcome {
            Ok(()) => {
                report.solves.append(&mut solves);
                report.increments += 1;
                self.undeformed = false;
                Ok(true)
            }
            Err(mut failed) => {
                // Without residuals, the last solve had converged, but the state could not be committed.
                if failed.newton.residuals.is_empty() {
                    failed.newton = solves.pop().unwrap_or_default();
                }
                report.failures.append(&mut solves);
                report.failures.push(failed.newton.clone());
                self.cut(span, taken, *failed, observer)?;
                report.cuts += 1;
                Ok(false)
            }
        }
    }

    /// Reports a failed attempt to the observer and halves the increment, unless that cannot help.
    fn cut<O: StepObserver<P, B::Error>>(
        &mut self,
        Span { step, from, t }: Span,
        taken: f64,
        Failed { reason, newton, unrecoverable, .. }: Failed<P::Error, B::Error>,
        observer: &mut O,
    ) -> Result<(), RunError<B, P, O::Error>> {
        let (increment, halvings, field) = (t - from, self.increments.halvings, self.body.field());
        let attempt = FailedAttempt { step, t, increment, halvings, reason: &reason, newton: &newton, field };
        observer.failed(&attempt).map_err(|reason| SteppingError::Stopped { step, t: from, reason })?;
        if unrecoverable || !self.increments.halve(taken) {
            return Err(SteppingError::NotConverged { step, t, reached: from, increment, halvings, reason });
        }
        Ok(())
    }

    fn converged<'a>(&'a self, report: &'a StepReport) -> ConvergedStep<'a, P> {
        ConvergedStep {
            step: report.step,
            count: self.params.count,
            t: report.t,
            report,
            mesh: self.body.mesh(),
            state: self.body.committed(),
            forces: self.body.forces(),
            region_volumes: self.body.region_volumes(),
            constraints: self.body.constraints(),
            field: self.body.field(),
        }
    }

    /// Advances from the committed state to an equilibrium state at pseudo-time `t` in which every response continues
    /// the committed state, all constraints hold, and no point changes its material. Material changes last, because
    /// they are decided by the state that the step would end in. `solves` collects the reports of the converged Newton
    /// solves.
    fn attempt(
        &mut self,
        t: f64,
        report: &mut StepReport,
        solves: &mut Vec<NewtonReport>,
        watch: Watch<'_>,
    ) -> Attempt<B, P, ()> {
        /// If responses still do not continue the committed state after this many rounds, they alternate between
        /// branches, and only a smaller increment helps.
        const MAX_REPLACEMENTS: usize = 5;
        // An attempt depends on the committed state alone: not on earlier ones, which a resumed run does not repeat.
        self.system.start_anew();
        let own_unknowns = self.system.residual.len();
        self.body.set_near_null_space(own_unknowns, &mut self.system.solver).map_err(|error| {
            Self::failed(NewtonFailure { reason: NewtonError::Solve(error), report: Box::default() })
        })?;
        solves.push(self.start(t, report, watch)?);
        let (mut evolutions, mut replacements, mut augmentations) = (0, 0, 0);
        loop {
            if self.body.verify().map_err(Self::rejected)? {
                if replacements == MAX_REPLACEMENTS {
                    return Err(Self::rejected(EquilibriumError::OffBranch(replacements)));
                }
                replacements += 1;
                report.verification_rounds += 1;
            } else if self.body.augment(self.params.newton.tolerance) {
                if augmentations == self.params.max_augmentations {
                    return Err(Self::rejected(self.body.volume_not_reached(augmentations)));
                }
                (augmentations, replacements) = (augmentations + 1, 0);
                report.augmentations += 1;
            } else if self.body.evolve().map_err(Self::rejected)? {
                if evolutions == self.params.max_evolutions {
                    return Err(Self::rejected(EquilibriumError::StillChanging(evolutions)));
                }
                (evolutions, replacements, augmentations) = (evolutions + 1, 0, 0);
                report.evolutions += 1;
            } else {
                break;
            }
            let solved = self.system.solve_watched(&mut self.body, &self.params.newton, watch);
            solves.push(solved.map_err(Self::failed)?);
        }
        self.body.check_balance(self.params.newton.tolerance).map_err(Self::rejected)
    }

    /// Solves from the committed state to pseudo-time `t` by Newton, starting from the linearization or from the
    /// prescribed displacements, and from the other one if the chosen start fails: the tangent may be singular, and
    /// moving only the boundary may invert the adjacent elements. The undeformed body always starts from the
    /// linearization.
    fn start(&mut self, t: f64, report: &mut StepReport, watch: Watch<'_>) -> Attempt<B, P, NewtonReport> {
        let first = if self.undeformed { StepStart::Tangent } else { self.params.start };
        match self.solve_from(first, t, report, watch) {
            Err(failed) if failed.at_start && !self.undeformed && !failed.unrecoverable => {
                self.body.revert().map_err(|error| Self::unrecoverable(error, NewtonReport::default()))?;
                let second = match first {
                    StepStart::Tangent => StepStart::Prescribed,
                    StepStart::Prescribed => StepStart::Tangent,
                };
                self.solve_from(second, t, report, watch)
            }
            outcome => outcome,
        }
    }

    fn solve_from(
        &mut self,
        start: StepStart,
        t: f64,
        report: &mut StepReport,
        watch: Watch<'_>,
    ) -> Attempt<B, P, NewtonReport> {
        match start {
            StepStart::Prescribed => self.body.begin_step(t),
            StepStart::Tangent => {
                if let Some(forcing) = self.params.newton.forcing {
                    self.system.set_tolerance(forcing.largest);
                }
                let start = self.body.linearize(t, &mut self.system).map_err(|error| {
                    Box::new(Failed {
                        // The tangent of the undeformed body does not depend on the increment, so cutting cannot help.
                        unrecoverable: self.undeformed || matches!(error, SolveError::Backend(_)),
                        at_start: true,
                        reason: NewtonError::Solve(error),
                        newton: NewtonReport::default(),
                    })
                })?;
                report.add_linearized(&start);
            }
        }
        let reuse_factorization = self.reuses_factorization && start == StepStart::Tangent;
        let newton = NewtonParams { reuse_factorization, ..self.params.newton };
        self.system.solve_watched(&mut self.body, &newton, watch).map_err(|failure| {
            let at_start = start == StepStart::Prescribed && Self::failed_at_first_residual(&failure);
            Box::new(Failed { at_start, ..*Self::failed(failure) })
        })
    }

    /// Returns true if Newton failed at its first residual for a reason that another start may avoid.
    fn failed_at_first_residual(failure: &SolveFailure<B, P>) -> bool {
        let undefined = match &failure.reason {
            NewtonError::Problem(EquilibriumError::PointField(error)) => !P::is_final(error),
            reason => matches!(reason, NewtonError::NotFinite),
        };
        undefined && failure.report.residuals.is_empty()
    }

    fn failed(NewtonFailure { reason, report }: SolveFailure<B, P>) -> FailedAttemptOf<B, P> {
        let unrecoverable = match &reason {
            NewtonError::Solve(SolveError::Backend(_)) => true,
            NewtonError::Problem(error) => <Equilibrium<B, P> as NonlinearProblem<B>>::is_final(error),
            _ => false,
        };
        Box::new(Failed { reason, newton: *report, unrecoverable, at_start: false })
    }

    /// Converts the error of a converged state that cannot be committed; a smaller increment may help.
    fn rejected(error: EquilibriumError<P::Error, B::Error>) -> FailedAttemptOf<B, P> {
        Self::failed(NewtonFailure { reason: NewtonError::Problem(error), report: Box::default() })
    }

    /// Converts an error of commit or revert; no further attempt is possible.
    fn unrecoverable(error: EquilibriumError<P::Error, B::Error>, newton: NewtonReport) -> FailedAttemptOf<B, P> {
        Box::new(Failed { reason: NewtonError::Problem(error), newton, unrecoverable: true, at_start: false })
    }
}

/// Returns the times of both lists, ascending and each once.
fn merged(mut times: Vec<f64>, others: Vec<f64>) -> Vec<f64> {
    times.extend(others);
    times.sort_by(f64::total_cmp);
    times.dedup();
    times
}

#[cfg(all(test, feature = "sparse"))]
mod tests;
