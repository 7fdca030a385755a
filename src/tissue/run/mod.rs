//! A two-scale simulation from a case to its result directory.
//!
//! | module | holds |
//! |---|---|
//! | `setup` | a case with everything that it names, read and checked |
//! | `plan` | what is about to be solved |
//! | this one | the run itself ([`Simulation`]) |
//! | `outcome` | how it ends, and how it is taken up again |
//! | `writers` | who writes its results |

mod outcome;
mod plan;
mod setup;
mod writers;

use std::path::Path;
use std::time::Instant;

pub use outcome::{ResumeError, Resumed, RunError, RunSummary};
pub use plan::{NetworkPlan, Plan};
pub use setup::{Setup, SimulationError};
pub use writers::Writers;

use self::writers::Witness;
use super::case::Case;
use super::checkpoint::{self, Checkpoint, Identity};
use super::micro_scale::{TissueField, TissueMaterial};
use super::record::{Progress, Recorder};
use super::results::ResultsError;
use super::results::log::{End, Event, Start};
use crate::fem::mesh::Mesh;
use crate::fem::stepping::{Stepper, SteppingError};
use crate::las::{Backend, Scalar};

/// A body and its networks, ready to be stepped through its loads.
///
/// `B` is the backend of the body, `M` its material: in one process by default, or on ranks of its own.
pub struct Simulation<B: Backend<Scalar = f64>, M = TissueField<B>>
where
    B::Reduced: Scalar,
{
    case: Case,
    stepper: Stepper<B, M>,
    /// The elements whose networks are written.
    networks: Vec<usize>,
    warnings: Vec<String>,
}

impl<B: Backend<Scalar = f64>> Simulation<B>
where
    B::Reduced: Scalar,
{
    /// Reads the mesh and the networks of a case and sets up the linear systems of both scales.
    ///
    /// # Errors
    /// [`SimulationError`].
    pub fn new(context: B::Context, case: Case) -> Result<Self, SimulationError<B::Fault>>
    where
        B::Context: Clone,
    {
        Setup::new(context, case)?.simulation()
    }
}

impl<B: Backend<Scalar = f64>, M: TissueMaterial> Simulation<B, M>
where
    B::Reduced: Scalar,
{
    /// What the readers thought worth saying.
    #[must_use]
    pub fn warnings(&self) -> &[String] {
        &self.warnings
    }

    /// The case.
    #[must_use]
    pub fn case(&self) -> &Case {
        &self.case
    }

    /// The mesh, in metres.
    #[must_use]
    pub fn mesh(&self) -> &Mesh {
        self.stepper.mesh()
    }

    /// What is about to be solved.
    #[must_use]
    pub fn plan(&self) -> Plan {
        Plan::new(&self.case, self.mesh(), self.stepper.field(), self.stepper.unknowns())
    }

    /// Goes back to the last converged step that is kept in the result directory `dir`; [`Simulation::run`] then takes the
    /// steps that are left and gives bit for bit what it would have given without the interruption. Without a
    /// checkpoint the run starts from the beginning.
    ///
    /// # Errors
    /// [`ResumeError`]: checkpoints of another run, or only damaged ones. Nothing on the disk is touched.
    pub fn resume(&mut self, dir: &Path) -> Result<Resumed, ResumeError<B::Fault>> {
        self.resume_among(&(), dir)
    }

    /// The same, in step with other processes that go back together.
    ///
    /// # Errors
    /// [`ResumeError`], on all.
    pub fn resume_among(&mut self, writers: &dyn Writers, dir: &Path) -> Result<Resumed, ResumeError<B::Fault>> {
        let found = checkpoint::latest(dir, &self.identity());
        // Whoever goes on would wait for those that do not.
        let told = found
            .as_ref()
            .map(|_| ())
            .map_err(|error| ResultsError::Elsewhere { path: dir.to_owned(), reason: error.to_string() });
        let agreed = writers.agree(told);
        let (checkpoint, mut warnings) = found?;
        let step = checkpoint.as_ref().map_or(0, |checkpoint| checkpoint.state.done);
        agreed.and_then(|()| writers.agree_on(step)).map_err(ResumeError::Elsewhere)?;
        let Some(Checkpoint { path, state, lives, units }) = checkpoint else {
            warnings.push(format!("{}: no checkpoint: starting from the beginning", dir.display()));
            return Ok(Resumed { step: 0, warnings });
        };
        let restored = self.stepper.restore(&state, |field| field.restore_units(&lives, units));
        restored.map_err(|reason| ResumeError::State { path, reason: Box::new(reason) })?;
        // What it took to get there is not part of the next step.
        let _ = (self.stepper.field().take_stats(), self.stepper.field().take_seconds());
        Ok(Resumed { step: state.done, warnings })
    }

    fn identity(&self) -> Identity {
        Identity::new(B::NAME, &self.case, self.stepper.mesh(), self.stepper.field())
    }

    /// Takes all load steps that are left and writes the result directory `dir` on the way. A run from the beginning
    /// replaces the results that are there; one that was taken up by [`Simulation::resume`] goes on with them.
    ///
    /// # Errors
    /// [`RunError`]; what converged before is on disk.
    pub fn run(&mut self, dir: &Path, progress: &mut dyn Progress) -> Result<RunSummary, RunError<B::Fault>> {
        self.run_among(&(), dir, progress)
    }

    /// The same, in step with other processes of which one writes.
    ///
    /// # Errors
    /// [`RunError`], the same on all.
    pub fn run_among(
        &mut self,
        writers: &dyn Writers,
        dir: &Path,
        progress: &mut dyn Progress,
    ) -> Result<RunSummary, RunError<B::Fault>> {
        let start = Instant::now();
        let done = self.stepper.done();
        let resumed = (done > 0).then(|| done as f64 / self.stepper.count() as f64);
        let (opened, outcome) = match writers.is_writer() {
            false => (None, Ok(())),
            true => match Recorder::open(dir, &self.case, self.stepper.mesh(), &self.networks, resumed, progress) {
                Ok(recorder) => (Some(recorder), Ok(())),
                Err(error) => (None, Err(error)),
            },
        };
        writers.agree(outcome)?;
        let mut witness = Witness { recorder: opened, writers };
        let start_of_run = Event::Start(self.start_event(done));
        witness.write(|recorder| recorder.log(&start_of_run))?;
        let outcome = self.take_steps(dir, &mut witness);
        let seconds = start.elapsed().as_secs_f64();
        let steps = self.stepper.done();
        let reason = match &outcome {
            Ok(_) => None,
            Err(error @ RunError::NotConverged { .. }) => {
                let (state, field) = (self.stepper.state(), self.stepper.field());
                let t = steps as f64 / self.stepper.count() as f64;
                let mesh = self.stepper.mesh();
                witness.write(|recorder| recorder.write_last(steps, t, mesh, state, field))?;
                Some(error.to_string())
            }
            // A disk that refuses results refuses the end of the log too.
            Err(RunError::Results(_)) => return outcome.map(|iterations| RunSummary { steps, iterations, seconds }),
        };
        let end = Event::End(End { converged: reason.is_none(), reason, steps, seconds });
        witness.write(|recorder| recorder.log(&end))?;
        outcome.map(|iterations| RunSummary { steps, iterations, seconds })
    }

    fn start_event(&self, done: usize) -> Start {
        let plan = self.plan();
        Start {
            title: self.case.title.clone(),
            backend: B::NAME.to_owned(),
            elements: plan.elements,
            nodes: plan.nodes,
            unknowns: plan.unknowns,
            rves: plan.rves,
            networks: plan.networks.len(),
            threads: plan.threads,
            ranks: plan.ranks,
            version: env!("CARGO_PKG_VERSION").to_owned(),
            resumed_from: done,
        }
    }

    /// Takes the steps that are left, with a checkpoint after each; returns the Newton iterations.
    fn take_steps(&mut self, dir: &Path, witness: &mut Witness<'_, '_>) -> Result<usize, RunError<B::Fault>> {
        let identity = self.identity();
        let count = self.stepper.count();
        let mut iterations = 0;
        while self.stepper.done() < count {
            match self.stepper.step(witness) {
                Ok(report) => iterations += report.iterations(),
                Err(SteppingError::Stopped { reason, .. }) => return Err(reason.into()),
                Err(SteppingError::NotConverged { step, reached, halvings, reason, .. }) => {
                    let (reason, lost) = (Box::new(reason), witness.lost());
                    return Err(RunError::NotConverged { step, count, reached, halvings, reason, lost });
                }
            }
            // Last, so that a checkpoint never stands for results that are not there.
            if let Some(state) = self.stepper.saved() {
                witness.write(|_| checkpoint::write(dir, &identity, &state, self.stepper.field()))?;
            }
        }
        Ok(iterations)
    }
}
