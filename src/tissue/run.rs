//! A two-scale simulation from a case to its result directory.

use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Instant;

use thiserror::Error;

use super::case::{Case, MaterialCase};
use super::checkpoint::{self, Checkpoint, CheckpointError, Identity};
use super::macro_scale::{self, MacroScaleError};
use super::micro_scale::{FieldRestoreError, LibraryError, TissueField, TissueFieldError, TissueMaterial};
use super::record::{Progress, Recorder};
use super::results::ResultsError;
use super::results::log::{End, Event, Start};
use super::rve_files;
use crate::fem::boundary::{Boundary, Conditions};
use crate::fem::mesh::Mesh;
use crate::fem::stepping::{
    ConvergedStep, FailedAttempt, RestoreError, SetupError, StepFailure, StepObserver, Stepper, SteppingError,
};
use crate::input::InputErrors;
use crate::las::{Backend, Scalar};

/// Who writes the results of a run that several processes take in step: one of them, and all go on only if it could.
pub trait Writers {
    /// Whether this process writes.
    fn is_writer(&self) -> bool;

    /// The same outcome on all.
    ///
    /// # Errors
    /// The own one, or that of the first that has one.
    fn agree(&self, outcome: Result<(), ResultsError>) -> Result<(), ResultsError>;

    /// That all have found the same number.
    ///
    /// # Errors
    /// On all, where they have not.
    fn agree_on(&self, number: usize) -> Result<(), ResultsError>;
}

/// One process alone.
impl Writers for () {
    fn is_writer(&self) -> bool {
        true
    }

    fn agree(&self, outcome: Result<(), ResultsError>) -> Result<(), ResultsError> {
        outcome
    }

    fn agree_on(&self, _: usize) -> Result<(), ResultsError> {
        Ok(())
    }
}

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

/// What is about to be solved.
#[derive(Clone, Debug, PartialEq)]
pub struct Plan {
    /// Elements of the mesh.
    pub elements: usize,
    /// Nodes of the mesh.
    pub nodes: usize,
    /// Free unknowns of the engineering scale.
    pub unknowns: usize,
    /// RVEs.
    pub rves: usize,
    /// Networks, each with its unknowns and the RVEs that use it.
    pub networks: Vec<NetworkPlan>,
    /// Bytes of all RVE states and answers.
    pub rve_bytes: usize,
    /// Bytes of the gradients, stresses and tangents that the body holds; the factors of its stiffness come on top.
    pub body_bytes: usize,
    /// Load steps.
    pub steps: usize,
    /// Threads that solve RVEs.
    pub threads: usize,
    /// Ranks of the engineering scale and of the RVEs; 1 and 0 in one process.
    pub ranks: [usize; 2],
}

/// One network of the library.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct NetworkPlan {
    /// Its name.
    pub name: String,
    /// Unknowns of one RVE.
    pub unknowns: usize,
    /// RVEs that use it.
    pub rves: usize,
}

/// Why a simulation cannot be set up.
#[derive(Debug, Error)]
pub enum SimulationError<F: std::error::Error + 'static> {
    /// Mesh or conditions.
    #[error("{0}")]
    MacroScale(#[from] MacroScaleError),
    /// Networks.
    #[error("{0}")]
    Library(#[from] LibraryError),
    /// What is to be written of it.
    #[error("{0}")]
    Output(#[from] InputErrors),
    /// Body and conditions do not fit together.
    #[error("{0}")]
    Setup(#[from] Box<SetupError<TissueFieldError, F>>),
}

/// Why a run ended early. Everything that converged is on disk.
#[derive(Debug, Error)]
pub enum RunError<F: std::error::Error + 'static> {
    /// A load step did not converge.
    #[error("load step {step} of {count} does not converge: {reason}")]
    NotConverged {
        /// The step, from 1.
        step: usize,
        /// How many there are.
        count: usize,
        /// The last converged pseudo-time.
        reached: f64,
        /// How often the step was halved.
        halvings: u32,
        /// What stopped the last attempt.
        reason: Box<StepFailure<TissueFieldError, F>>,
        /// The file that repeats the failure of an RVE, where that was the reason.
        lost: Option<PathBuf>,
    },
    /// A result file could not be written.
    #[error("{0}")]
    Results(#[from] ResultsError),
}

/// Why a run cannot go on from where an earlier one stopped.
#[derive(Debug, Error)]
pub enum ResumeError<F: std::error::Error + 'static> {
    /// No checkpoint can be used.
    #[error("{0}")]
    Checkpoint(#[from] CheckpointError),
    /// Another process could not read its checkpoint.
    #[error(transparent)]
    Elsewhere(ResultsError),
    /// A checkpoint of this very run does not fit it. The simulation must then be set up anew.
    #[error("{}: {reason}", path.display())]
    State {
        /// The checkpoint.
        path: PathBuf,
        /// Why.
        reason: Box<RestoreError<FieldRestoreError, TissueFieldError, F>>,
    },
}

/// What [`Simulation::resume`] has found.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Resumed {
    /// The converged step that the run goes on from; 0 where there was no checkpoint and it starts from the beginning.
    pub step: usize,
    /// What the user should know.
    pub warnings: Vec<String>,
}

/// A run that reached its end.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RunSummary {
    /// Load steps.
    pub steps: usize,
    /// Newton iterations of the engineering scale in all.
    pub iterations: usize,
    /// Wall time, s.
    pub seconds: f64,
}

/// A case with everything read and checked that it names, before anything is solved.
pub struct Setup<B: Backend<Scalar = f64>, M = TissueField<B>>
where
    B::Reduced: Scalar,
{
    context: B::Context,
    case: Case,
    mesh: Mesh,
    conditions: Conditions,
    field: M,
    networks: Vec<usize>,
    unknowns: usize,
    warnings: Vec<String>,
}

impl<B: Backend<Scalar = f64>> Setup<B>
where
    B::Reduced: Scalar,
    B::Context: Clone,
{
    /// Reads the mesh and the networks of a case and holds them against what it prescribes.
    ///
    /// # Errors
    /// [`SimulationError`].
    pub fn new(context: B::Context, case: Case) -> Result<Self, SimulationError<B::Fault>> {
        let of_rves = context.clone();
        Self::with_material(context, case, |case, mesh| TissueField::new(of_rves, case, mesh))
    }
}

impl<B: Backend<Scalar = f64>, M: TissueMaterial> Setup<B, M>
where
    B::Reduced: Scalar,
{
    /// Reads the mesh of a case and holds it against what it prescribes; `material` gives its elements their materials, and
    /// warnings.
    ///
    /// # Errors
    /// [`SimulationError`].
    pub fn with_material(
        context: B::Context,
        case: Case,
        material: impl FnOnce(&Case, &Mesh) -> Result<(M, Vec<String>), LibraryError>,
    ) -> Result<Self, SimulationError<B::Fault>> {
        let (mesh, mut warnings) = macro_scale::mesh(&case)?;
        let conditions = macro_scale::conditions(&case)?;
        let boundary = Boundary::new(&mesh, &conditions).map_err(|error| Box::new(error.into()))?;
        let prescribed = boundary.prescribed(mesh.nodes().len());
        let unknowns = prescribed.as_flattened().iter().filter(|&&prescribed| !prescribed).count();
        let (field, network_warnings) = material(&case, &mesh)?;
        warnings.extend(network_warnings);
        warnings.extend(without_networks(&case));
        let networks = rve_files::elements(&case, mesh.elements().len(), &field)?;
        Ok(Self { context, case, mesh, conditions, field, networks, unknowns, warnings })
    }

    /// What is about to be solved.
    #[must_use]
    pub fn plan(&self) -> Plan {
        plan(&self.case, &self.mesh, &self.field, self.unknowns)
    }

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
        &self.mesh
    }

    /// The material of the body.
    pub fn material_mut(&mut self) -> &mut M {
        &mut self.field
    }

    /// Sets up the linear systems of both scales; asks every point for its answer in the undeformed body.
    ///
    /// # Errors
    /// [`SimulationError::Setup`].
    pub fn simulation(self) -> Result<Simulation<B, M>, SimulationError<B::Fault>> {
        let Self { context, case, mesh, conditions, field, networks, warnings, .. } = self;
        let params = macro_scale::step_params(&case);
        let order = field.node_order(&mesh);
        let stepper = Stepper::in_order(&order, &context, Arc::new(mesh), &conditions, field, params);
        let stepper = stepper.map_err(Box::new)?;
        Ok(Simulation { case, stepper, networks, warnings })
    }
}

/// What to say of regions whose RVEs have no network.
fn without_networks(case: &Case) -> impl Iterator<Item = String> {
    case.regions.iter().filter_map(|region| match &region.material {
        MaterialCase::FiberRve(rve) if rve.networks.is_empty() => Some(format!(
            "{}: the region \"{}\" has no networks: its RVEs are the matrix alone",
            case.file.display(),
            region.name
        )),
        _ => None,
    })
}

fn plan(case: &Case, mesh: &Mesh, field: &impl TissueMaterial, unknowns: usize) -> Plan {
    let networks = field.library().models().iter().zip(field.users()).map(|(model, rves)| NetworkPlan {
        name: model.network().name().to_owned(),
        unknowns: model.unknowns(),
        rves,
    });
    // Of every point two states are held: the converged one and the trial.
    let point_bytes = 2 * (1 + 9 + 9 + 81) * size_of::<f64>();
    Plan {
        elements: mesh.elements().len(),
        nodes: mesh.nodes().len(),
        unknowns,
        rves: field.rves(),
        networks: networks.collect(),
        rve_bytes: field.rve_bytes(),
        body_bytes: point_bytes * mesh.elements().len(),
        steps: case.steps.count,
        threads: rayon::current_num_threads(),
        ranks: field.ranks(),
    }
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
        plan(&self.case, self.mesh(), self.stepper.field(), self.stepper.unknowns())
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

/// Records a run where this process writes, and agrees with the others that it could be written.
struct Witness<'w, 'r> {
    recorder: Option<Recorder<'r>>,
    writers: &'w dyn Writers,
}

impl<'r> Witness<'_, 'r> {
    fn write(&mut self, write: impl FnOnce(&mut Recorder<'r>) -> Result<(), ResultsError>) -> Result<(), ResultsError> {
        let outcome = self.recorder.as_mut().map_or(Ok(()), write);
        self.writers.agree(outcome)
    }

    fn lost(&self) -> Option<PathBuf> {
        self.recorder.as_ref().and_then(Recorder::lost).map(Path::to_owned)
    }
}

impl<M: TissueMaterial, F: std::error::Error> StepObserver<M, F> for Witness<'_, '_> {
    type Error = ResultsError;

    fn converged(&mut self, step: &ConvergedStep<'_, M>) -> Result<(), ResultsError> {
        self.write(|recorder| recorder.converged(step))
    }

    fn failed(&mut self, attempt: &FailedAttempt<'_, M, F>) -> Result<(), ResultsError> {
        self.write(|recorder| recorder.failed(attempt))
    }
}
