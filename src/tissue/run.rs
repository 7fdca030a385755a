//! A two-scale simulation from a case to its result directory.

use std::path::Path;
use std::sync::Arc;
use std::time::Instant;

use thiserror::Error;

use super::case::Case;
use super::macro_scale::{self, MacroScaleError};
use super::micro_scale::{LibraryError, TissueField, TissueFieldError};
use super::record::{Progress, Recorder};
use super::results::ResultsError;
use super::results::log::{End, Event, Start};
use crate::fem::mesh::Mesh;
use crate::fem::stepping::{SetupError, StepFailure, Stepper, SteppingError};
use crate::las::{Backend, Scalar};

/// A body and its networks, ready to be stepped through its loads.
pub struct Simulation<B: Backend<Scalar = f64>>
where
    B::Reduced: Scalar,
{
    case: Case,
    stepper: Stepper<B, TissueField<B>>,
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
    /// Load steps.
    pub steps: usize,
    /// Threads that solve RVEs.
    pub threads: usize,
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
    Library(#[from] LibraryError<F>),
    /// Body and conditions do not fit together.
    #[error("{0}")]
    Setup(#[from] Box<SetupError<TissueFieldError<F>, F>>),
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
        reason: Box<StepFailure<TissueFieldError<F>, F>>,
    },
    /// A result file could not be written.
    #[error("{0}")]
    Results(#[from] ResultsError),
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
        let (mesh, mut warnings) = macro_scale::mesh(&case)?;
        let conditions = macro_scale::conditions(&case)?;
        let (field, network_warnings) = TissueField::new(context.clone(), &case, &mesh)?;
        warnings.extend(network_warnings);
        let params = macro_scale::step_params(&case);
        let stepper = Stepper::new(&context, Arc::new(mesh), &conditions, field, params).map_err(Box::new)?;
        Ok(Self { case, stepper, warnings })
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
        self.stepper.mesh()
    }

    /// What is about to be solved.
    #[must_use]
    pub fn plan(&self) -> Plan {
        let field = self.stepper.field();
        let networks = field.models().iter().zip(field.users()).map(|(model, rves)| NetworkPlan {
            name: model.network().name().to_owned(),
            unknowns: model.unknowns(),
            rves,
        });
        Plan {
            elements: self.mesh().elements().len(),
            nodes: self.mesh().nodes().len(),
            unknowns: self.stepper.unknowns(),
            rves: field.rves(),
            networks: networks.collect(),
            rve_bytes: field.rve_bytes(),
            steps: self.case.steps.count,
            threads: rayon::current_num_threads(),
        }
    }

    /// Takes all load steps and writes the result directory `dir` on the way.
    ///
    /// # Errors
    /// [`RunError`]; what converged before is on disk.
    pub fn run(&mut self, dir: &Path, progress: &mut dyn Progress) -> Result<RunSummary, RunError<B::Fault>> {
        let start = Instant::now();
        let plan = self.plan();
        let mut recorder = Recorder::create(dir, &self.case, self.stepper.mesh(), self.case.points.len(), progress)?;
        recorder.log(&Event::Start(Start {
            title: self.case.title.clone(),
            backend: B::NAME.to_owned(),
            elements: plan.elements,
            nodes: plan.nodes,
            unknowns: plan.unknowns,
            rves: plan.rves,
            networks: plan.networks.len(),
            threads: plan.threads,
            version: env!("CARGO_PKG_VERSION").to_owned(),
        }))?;
        let outcome = self.stepper.run(&mut recorder);
        let seconds = start.elapsed().as_secs_f64();
        let steps = self.stepper.done();
        match outcome {
            Ok(reports) => {
                let iterations = reports.iter().map(|report| report.iterations()).sum();
                recorder.log(&Event::End(End { converged: true, reason: None, steps, seconds }))?;
                Ok(RunSummary { steps, iterations, seconds })
            }
            Err(SteppingError::Stopped { reason, .. }) => Err(reason.into()),
            Err(SteppingError::NotConverged { step, reached, halvings, reason, .. }) => {
                let error = RunError::NotConverged {
                    step,
                    count: self.case.steps.count,
                    reached,
                    halvings,
                    reason: Box::new(reason),
                };
                recorder.log(&Event::End(End { converged: false, reason: Some(error.to_string()), steps, seconds }))?;
                Err(error)
            }
        }
    }
}
