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

use std::path::{Path, PathBuf};
use std::time::Instant;

pub use outcome::{ResumeError, Resumed, RunError, RunSummary};
pub use plan::{NetworkPlan, Plan};
pub use setup::{Setup, SimulationError};
pub use writers::Writers;

use self::writers::Witness;
use super::case::Case;
use super::checkpoint::{self, Checkpoint, Identity};
use super::micro_scale::{TissueField, TissueMaterial};
use super::recorder::{GoingOn, Progress, Recorder};
use super::results::log::{End, Event, Start};
use super::results::{self, DirectoryLock, Done, ResultsError, Written};
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
    /// The result directory that this run has for itself, from when it is taken until the run ends.
    own: Option<(PathBuf, DirectoryLock)>,
    /// The results of the steps that were done before this run, where it was taken up again.
    written: Written,
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

    /// The mesh, in meters.
    #[must_use]
    pub fn mesh(&self) -> &Mesh {
        self.stepper.mesh()
    }

    /// What is about to be solved.
    #[must_use]
    pub fn plan(&self) -> Plan {
        Plan::new(&self.case, self.mesh(), self.stepper.field(), self.stepper.unknowns())
    }

    /// Takes the result directory `dir` for this run alone, until [`Simulation::run`] ends, and checks that a run has written
    /// what this one would replace there. [`Simulation::resume`] and [`Simulation::run`] do so where it was not done before.
    /// Returns what the user should know.
    ///
    /// # Errors
    /// [`ResultsError::Locked`], [`ResultsError::Foreign`]: nothing on the disk is touched. [`ResultsError::Write`].
    pub fn take_directory(&mut self, writers: &dyn Writers, dir: &Path) -> Result<Vec<String>, ResultsError> {
        let is_own = self.own.as_ref().is_some_and(|(own, _)| own == dir);
        let taken = match writers.is_writer() && !is_own {
            true => results::check_origin(dir).and_then(|()| DirectoryLock::take(dir)).map(Some),
            false => Ok(None),
        };
        let (taken, outcome) = match taken {
            Ok(taken) => (taken, Ok(())),
            Err(error) => (None, Err(error)),
        };
        writers.agree(outcome)?;
        let Some((lock, warning)) = taken else { return Ok(Vec::new()) };
        self.own = Some((dir.to_owned(), lock));
        Ok(warning.into_iter().collect())
    }

    /// Goes back to the last converged step that is kept in the result directory `dir`; [`Simulation::run`] then takes the
    /// steps that are left and gives bit for bit what it would have given without the interruption. Without a
    /// checkpoint the run starts from the beginning, unless there are results.
    ///
    /// # Errors
    /// [`ResumeError`]: checkpoints of another run, or only damaged ones; results without a checkpoint, or that are not those
    /// that were written before it; another run in the same directory. Nothing on the disk is touched.
    pub fn resume(&mut self, dir: &Path) -> Result<Resumed, ResumeError<B::Fault>> {
        self.resume_among(&(), dir)
    }

    /// The same, in step with other processes that go back together.
    ///
    /// # Errors
    /// [`ResumeError`], on all.
    pub fn resume_among(&mut self, writers: &dyn Writers, dir: &Path) -> Result<Resumed, ResumeError<B::Fault>> {
        let outcome = self.go_back(writers, dir);
        if outcome.is_err() {
            self.own = None;
        }
        outcome
    }

    fn go_back(&mut self, writers: &dyn Writers, dir: &Path) -> Result<Resumed, ResumeError<B::Fault>> {
        // There is nothing to take where nothing is.
        let mut warnings = match dir.exists() {
            true => self.take_directory(writers, dir)?,
            false => writers.agree(Ok(())).map(|()| Vec::new())?,
        };
        let found = checkpoint::latest(dir, &self.identity());
        // Whoever goes on would wait for those that do not.
        let told = found
            .as_ref()
            .map(|_| ())
            .map_err(|error| ResultsError::Elsewhere { path: dir.to_owned(), reason: error.to_string() });
        let agreed = writers.agree(told);
        let (checkpoint, remarks) = found?;
        warnings.extend(remarks);
        let step = checkpoint.as_ref().map_or(0, |checkpoint| checkpoint.state.completed_steps);
        agreed.and_then(|()| writers.agree_on(step)).map_err(ResumeError::Elsewhere)?;
        let Some(Checkpoint { path, state, lives, units, written }) = checkpoint else {
            self.check_empty(writers, dir)?;
            warnings.push(format!("{}: no checkpoint: starting from the beginning", dir.display()));
            return Ok(Resumed { step: 0, warnings });
        };
        let done = Done { steps: state.completed_steps, of: self.stepper.count() };
        let checked = if writers.is_writer() { written.check(dir, done) } else { Ok(Vec::new()) };
        let (restored, outcome) = match checked {
            Ok(restored) => (restored, Ok(())),
            Err(error) => (Vec::new(), Err(error)),
        };
        writers.agree(outcome)?;
        warnings.extend(restored);
        let restored = self.stepper.restore(&state, |field| field.restore_units(&lives, units));
        restored.map_err(|reason| ResumeError::State { path, reason: Box::new(reason) })?;
        self.written = written;
        // What it took to get there is not part of the next step.
        let _ = (self.stepper.field().take_stats(), self.stepper.field().take_seconds());
        Ok(Resumed { step: state.completed_steps, warnings })
    }

    /// That a directory without a checkpoint holds no results that starting from the beginning would remove.
    fn check_empty(&self, writers: &dyn Writers, dir: &Path) -> Result<(), ResumeError<B::Fault>> {
        let found = match writers.is_writer() {
            true => results::results_without_checkpoint(dir, &self.case),
            false => Ok(None),
        };
        let told = match &found {
            Ok(None) => Ok(()),
            Ok(Some((path, what))) => {
                let reason = format!("{}: {what}, but no checkpoint", path.display());
                Err(ResultsError::Elsewhere { path: path.clone(), reason })
            }
            Err(error) => Err(ResultsError::Elsewhere { path: dir.to_owned(), reason: error.to_string() }),
        };
        let agreed = writers.agree(told);
        match found? {
            Some((path, what)) => Err(ResumeError::NoCheckpoint { path, what }),
            None => Ok(agreed?),
        }
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
        let outcome = self.take_directory(writers, dir).map_err(RunError::from);
        let outcome = outcome.and_then(|_| self.run_in_own(writers, dir, progress, start));
        self.own = None;
        outcome
    }

    /// The same in a directory that this run has for itself.
    fn run_in_own(
        &mut self,
        writers: &dyn Writers,
        dir: &Path,
        progress: &mut dyn Progress,
        start: Instant,
    ) -> Result<RunSummary, RunError<B::Fault>> {
        let done = self.stepper.completed_steps();
        let on = (done > 0).then(|| GoingOn {
            done: Done { steps: done, of: self.stepper.count() },
            written: std::mem::take(&mut self.written),
        });
        let (opened, outcome) = match writers.is_writer() {
            false => (None, Ok(())),
            true => match Recorder::open(dir, &self.case, self.stepper.mesh(), &self.networks, on.as_ref(), progress) {
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
        let steps = self.stepper.completed_steps();
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
        while self.stepper.completed_steps() < count {
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
                witness.write(|recorder| {
                    let written = recorder.settle()?;
                    checkpoint::write(dir, &identity, &state, &written, self.stepper.field())
                })?;
            }
        }
        Ok(iterations)
    }
}
