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

mod attempt;
mod body_division;
mod body_part;
mod error;
mod increments;
mod observer;
mod params;
mod saved;
mod setup;
mod system;

use std::sync::Arc;

pub use body_division::{BodyDivision, BodyPiece};
pub use body_part::BodyPart;
pub use error::{SetupError, StepFailure, SteppingError};
pub use increments::{AdaptiveIncrements, IncrementControl};
pub use observer::{ConvergedStep, FailedAttempt, Iterating, StepObserver};
pub use params::{StepParams, StepReport, StepStart};
pub use saved::{RestoreError, SavedState, StepperRestoreError};

use super::constraint::Constraints;
use super::equilibrium::{BodyState, Equilibrium};
use super::mesh::Mesh;
use super::point_field::PointField;
use super::reactions::BoundaryForces;
use crate::las::{Backend, NewtonReport, NewtonSystem, RealBackend, SolverChoice};
use attempt::Failed;
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

/// Receives the report of Newton's method before every iteration.
type Watch<'a> = &'a mut dyn FnMut(&NewtonReport);

/// The start and the end of an attempt in pseudo-time.
#[derive(Clone, Copy)]
struct Span {
    step: usize,
    from: f64,
    t: f64,
    /// Whether the step ends there.
    ends_step: bool,
}

impl<B: RealBackend, P: PointField> Stepper<B, P> {
    /// Returns the last converged state; that of the part if the body is divided.
    pub fn state(&self) -> &BodyState {
        self.body.committed()
    }

    /// Returns the surface and point forces in the last converged state. Collective if the body is divided; see
    /// [`Equilibrium::forces`].
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

    /// Returns the mesh; the part of this rank if the body is divided.
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
                let ends_step = end >= 1.0 && segment.end >= step as f64;
                let span = Span { step, from: segment.time(position, count), t: segment.time(end, count), ends_step };
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
            Ok(()) => {
                self.body.commit(span.ends_step).map_err(|error| Self::unrecoverable(error, NewtonReport::default()))
            }
            Err(mut failed) => match self.locate_residual(&mut failed).and_then(|()| self.body.revert()) {
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
        Span { step, from, t, .. }: Span,
        taken: f64,
        Failed { reason, newton, unrecoverable, largest_residual, .. }: Failed<P::Error, B::Error>,
        observer: &mut O,
    ) -> Result<(), RunError<B, P, O::Error>> {
        let (increment, halvings) = (t - from, self.increments.halvings);
        let (reason_of, newton, residual) = (&reason, &newton, largest_residual.as_deref());
        let attempt = FailedAttempt {
            step,
            t,
            increment,
            halvings,
            reason: reason_of,
            field: self.body.field(),
            state: self.body.committed(),
            mesh: self.body.mesh(),
            saved: self.saved(),
            newton,
            largest_residual: residual,
        };
        observer.failed(&attempt).map_err(|reason| SteppingError::Stopped { step, t: from, reason })?;
        if unrecoverable || !self.increments.halve(taken) {
            let reached = from;
            return Err(SteppingError::NotConverged {
                step,
                t,
                reached,
                increment,
                halvings,
                reason,
                largest_residual,
            });
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
