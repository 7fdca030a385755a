//! A two-scale simulation from a case to its result directory.
//!
//! | module | holds |
//! |---|---|
//! | `setup` | a case with all its input files, read and checked |
//! | `whole_body` | the mesh of a case with its boundary conditions and materials |
//! | `body_files` | a body that is divided once, in files |
//! | `setup_ranks` | ranks that set up a case together: what the first one sends the others |
//! | `problem_size` | the size of the problem before the solve |
//! | this one | the run itself ([`Simulation`]) |
//! | `checkpoints` | resuming from a checkpoint, and writing one |
//! | `measurement`, `forecast` | what an evaluation costs, and on how many ranks a run pays |
//! | `outcome` | the errors and the result of a run, and of resuming it |
//! | `writers` | which process writes the results |

mod body_files;
mod checkpoints;
mod forecast;
mod measurement;
mod memory;
mod outcome;
mod problem_size;
mod rank_writers;
mod setup;
mod setup_ranks;
mod whole_body;
mod writers;

use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Instant;

pub use body_files::{BodyFiles, DivisionReport};
pub use forecast::{Forecast, RankSplit};
pub use measurement::{Measurement, NetworkCost};
pub use memory::MemoryForecast;
pub use outcome::{ResumeError, Resumed, RunError, RunSummary};
pub use problem_size::{NetworkSize, ProblemSize};
pub use rank_writers::RootWriter;
pub use setup::{Setup, SimulationError};
pub use setup_ranks::{ExchangeError, ScaleRanks, SetupRanks};
pub use writers::WriterGroup;

use self::writers::AgreedRecorder;
use super::case::Case;
use super::checkpoint::Identity;
use super::field_files::{FieldFiles, FieldState};
use super::progress::Progress;
use super::recorder::{Recorder, ResumePoint};
use super::results::log::{End, Event, Start, SurfacePlace};
use super::results::{self, DirectoryLock, ResultsError, ResultsRecord, RunProgress};
use crate::fem::equilibrium::EquilibriumError;
use crate::fem::mesh::Mesh;
use crate::fem::stepping::{StepFailure, Stepper, SteppingError};
use crate::las::{NewtonError, RealBackend};
use crate::tissue::micro_scale::{ProgressSource, TissueField, TissueFieldError, TissueMaterial};

/// A body and its networks, set up to step through the loads.
///
/// `B` is the backend of the body, `M` its material: in one process by default, or on other ranks.
pub struct Simulation<B: RealBackend, M = TissueField<B>> {
    case: Case,
    stepper: Stepper<B, M>,
    /// The hashes of the whole mesh and of the materials that vary over it.
    hashes: (u64, Option<u64>),
    /// The surfaces with boundary conditions; empty on a process that does not write.
    surfaces: Vec<SurfacePlace>,
    /// The elements whose networks are written to the results.
    networks: Vec<usize>,
    warnings: Vec<String>,
    /// The result directory and its lock, held from [`Simulation::take_directory`] until the run ends.
    lock: Option<(PathBuf, DirectoryLock)>,
    /// The results of the steps completed before this run, if it was resumed.
    written: ResultsRecord,
}

impl<B: RealBackend> Simulation<B> {
    /// Reads the mesh and the networks of a case and sets up the linear systems of both scales.
    ///
    /// # Errors
    /// Returns [`SimulationError`] if an input file cannot be read or does not match the case, or the first evaluation
    /// of the body fails.
    pub fn new(context: B::Context, case: Case) -> Result<Self, SimulationError<B::Error>> {
        Setup::new(context, case)?.with_device()?.simulation()
    }
}

impl<B: RealBackend, M: TissueMaterial> Simulation<B, M> {
    /// Returns the warnings of the readers.
    pub fn warnings(&self) -> &[String] {
        &self.warnings
    }

    /// Returns the case.
    pub fn case(&self) -> &Case {
        &self.case
    }

    /// Returns the mesh, in meters; the part of this process if the body is divided.
    pub fn mesh(&self) -> &Mesh {
        self.stepper.mesh()
    }

    /// Returns a function that returns what the RVEs of all ranks do, for another thread; `None` if this rank does not get
    /// to know it.
    pub fn progress_source(&self) -> Option<ProgressSource> {
        self.stepper.field().progress_source()
    }

    /// Returns the size of the problem.
    pub fn problem_size(&self) -> ProblemSize {
        let Self { case, stepper, .. } = self;
        ProblemSize::new(case, self.mesh(), stepper.field(), stepper.unknowns(), stepper.solver_choice())
    }

    /// Locks the result directory `dir` for this run until [`Simulation::run`] ends, and checks that the files that
    /// this run would replace were written by a run. [`Simulation::resume`] and [`Simulation::run`] call it if it was
    /// not called before. Returns warnings for the user.
    ///
    /// # Errors
    /// Returns [`ResultsError::Locked`] or [`ResultsError::UnknownOrigin`] without touching a file, or
    /// [`ResultsError::Write`] if the directory or its lock cannot be written.
    pub fn take_directory(&mut self, writers: &dyn WriterGroup, dir: &Path) -> Result<Vec<String>, ResultsError> {
        let is_locked = self.lock.as_ref().is_some_and(|(locked, _)| locked == dir);
        let lock = || results::check_origin(dir).and_then(|()| DirectoryLock::acquire(dir)).map(Some);
        let taken = writers.on_writer(|| if is_locked { Ok(None) } else { lock() })?;
        let Some((lock, warning)) = taken else { return Ok(Vec::new()) };
        self.lock = Some((dir.to_owned(), lock));
        Ok(warning.into_iter().collect())
    }

    /// Checks, for a directory that the user has not named, that it does not hold the results of another case, whose file
    /// lies beside that of this one: all cases in a folder have the same default directory.
    ///
    /// # Errors
    /// Returns [`ResultsError::OtherCase`] on all processes.
    pub fn check_case_of(&self, writers: &dyn WriterGroup, dir: &Path) -> Result<(), ResultsError> {
        writers.on_writer(|| results::check_case(dir, &self.case))
    }

    /// Restores the last converged step stored in the result directory `dir`; [`Simulation::run`] then takes the
    /// remaining steps with results that are bit for bit those of an uninterrupted run. Without a checkpoint, the run
    /// starts from the beginning, unless there are results.
    ///
    /// # Errors
    /// Returns [`ResumeError`] if the checkpoints belong to another run or are all damaged, if there are results
    /// without a checkpoint or results that differ from those written before it, or if another run uses the directory.
    /// No result file is changed then.
    pub fn resume(&mut self, dir: &Path) -> Result<Resumed, ResumeError<B::Error>> {
        self.resume_among(&(), dir)
    }

    /// Like [`Simulation::resume`], in step with other processes that resume together.
    ///
    /// # Errors
    /// Returns [`ResumeError`] on all processes.
    pub fn resume_among(&mut self, writers: &dyn WriterGroup, dir: &Path) -> Result<Resumed, ResumeError<B::Error>> {
        let outcome = self.restore(writers, dir);
        if outcome.is_err() {
            self.lock = None;
        }
        outcome
    }

    fn identity(&self) -> Identity {
        Identity::new(B::NAME, &self.case, self.hashes, self.stepper.field())
    }

    /// Takes all remaining load steps and writes their results to the directory `dir`. A run from the beginning
    /// replaces the results in the directory; one resumed by [`Simulation::resume`] appends to them.
    ///
    /// # Errors
    /// Returns [`RunError`]; the results of all converged steps are on disk.
    pub fn run(&mut self, dir: &Path, progress: &mut dyn Progress) -> Result<RunSummary, RunError<B::Error>> {
        self.run_among(&(), dir, progress)
    }

    /// Like [`Simulation::run`], in step with other processes of which one writes.
    ///
    /// # Errors
    /// Returns [`RunError`], the same on all processes.
    pub fn run_among(
        &mut self,
        writers: &dyn WriterGroup,
        dir: &Path,
        progress: &mut dyn Progress,
    ) -> Result<RunSummary, RunError<B::Error>> {
        let start = Instant::now();
        let outcome = self.take_directory(writers, dir).map_err(RunError::from);
        let outcome = outcome.and_then(|_| self.run_locked(writers, dir, progress, start));
        self.lock = None;
        outcome
    }

    /// The run in a directory that it has locked.
    fn run_locked(
        &mut self,
        writers: &dyn WriterGroup,
        dir: &Path,
        progress: &mut dyn Progress,
        start: Instant,
    ) -> Result<RunSummary, RunError<B::Error>> {
        let completed_steps = self.stepper.completed_steps();
        let resumed = (completed_steps > 0).then(|| ResumePoint {
            progress: RunProgress { steps: completed_steps, of: self.stepper.count() },
            written: std::mem::take(&mut self.written),
        });
        let (case, mesh) = (&self.case, self.stepper.mesh());
        let files = Arc::new(FieldFiles::new(dir, case, mesh));
        let of_recorder = Arc::clone(&files);
        let opened = writers.on_writer(|| {
            Recorder::open(of_recorder, case, mesh, &self.networks, resumed.as_ref(), progress).map(Some)
        })?;
        let pieces = mesh.part().map(|_| files);
        let identity = self.identity();
        let mut recorder = AgreedRecorder { dir, identity, saved: completed_steps, recorder: opened, pieces, writers };
        let start_of_run = Event::Start(self.start_event(completed_steps));
        recorder.write(|recorder| recorder.log(&start_of_run))?;
        let outcome = self.take_steps(&mut recorder);
        let seconds = start.elapsed().as_secs_f64();
        let steps = self.stepper.completed_steps();
        let reason = match &outcome {
            Ok(_) => None,
            Err(error @ RunError::NotConverged { .. }) => {
                let (state, t) = (self.stepper.state(), steps as f64 / self.stepper.count() as f64);
                recorder.write_last(&FieldState {
                    step: (steps, state.t <= t),
                    mesh: self.stepper.mesh(),
                    state,
                    constraints: self.stepper.constraints(),
                    field: self.stepper.field(),
                })?;
                Some(error.to_string())
            }
            // If results cannot be written, the end of the log cannot either; an interrupted run has no end.
            Err(RunError::Results(_) | RunError::Interrupted(_)) => return outcome,
        };
        let end = Event::End(End { converged: reason.is_none(), reason, steps, seconds });
        recorder.write(|recorder| recorder.log(&end))?;
        let scales = recorder.recorder.and_then(|recorder| recorder.scales());
        outcome.map(|summary| RunSummary { seconds, scales, ..summary })
    }

    fn start_event(&self, completed_steps: usize) -> Start {
        let size = self.problem_size();
        Start {
            title: self.case.title.clone(),
            backend: B::NAME.to_owned(),
            elements: size.elements,
            nodes: size.nodes,
            unknowns: size.unknowns,
            rves: size.rves,
            networks: size.networks.len(),
            solver: size.solver,
            threads: size.threads,
            ranks: size.ranks,
            version: env!("CARGO_PKG_VERSION").to_owned(),
            resumed_from: completed_steps,
            surfaces: self.surfaces.clone(),
        }
    }

    /// Takes the remaining steps, with a checkpoint after every `[output] checkpoint` steps and at the end of the run;
    /// returns a summary without the wall time and the shares of the ranks.
    fn take_steps(&mut self, recorder: &mut AgreedRecorder<'_, '_>) -> Result<RunSummary, RunError<B::Error>> {
        let count = self.stepper.count();
        let mut summary = RunSummary { steps: count, ..RunSummary::default() };
        while self.stepper.completed_steps() < count {
            match self.stepper.step(recorder) {
                Ok(report) => {
                    summary.iterations += report.iterations();
                    summary.cuts += report.cuts;
                    summary.wasted_iterations += report.wasted_iterations();
                }
                Err(SteppingError::Stopped { reason, .. }) => return Err(reason.into()),
                Err(SteppingError::NotConverged { step, reached, halvings, reason, largest_residual, .. }) => {
                    let (reason, failed_rve) = (Box::new(reason), recorder.failed_rve());
                    return Err(RunError::NotConverged {
                        step,
                        count,
                        reached,
                        halvings,
                        reason,
                        failed_rve,
                        largest_residual,
                    });
                }
            }
            let step = self.stepper.completed_steps();
            let is_interrupted = step < count && recorder.is_interrupted()?;
            let is_due = is_interrupted || step.is_multiple_of(self.case.output.checkpoint) || step == count;
            if let Some(saved) = self.stepper.saved().filter(|_| is_due) {
                recorder.write_checkpoint(saved, self.stepper.mesh(), self.stepper.state(), self.stepper.field())?;
            }
            if is_interrupted {
                return Err(RunError::Interrupted(step));
            }
        }
        Ok(summary)
    }
}

/// Returns true if the ranks can no longer exchange messages.
fn is_final<F: std::error::Error>(reason: &StepFailure<TissueFieldError, F>) -> bool {
    let NewtonError::Problem(EquilibriumError::PointField(error)) = reason else { return false };
    matches!(error, TissueFieldError::Ranks(_))
}

fn other_rank(reason: impl ToString) -> ResultsError {
    ResultsError::OtherRank(reason.to_string())
}
