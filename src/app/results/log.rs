//! `log.jsonl`: the events of a run, one JSON object per line; `event` is the kind of event.

use std::collections::HashSet;
use std::fs::{File, OpenOptions};
use std::io::Write;
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

use super::ResultsError;
use super::replace::{replace, whole_lines};
pub use super::scales_log::{ScaleLog, ScalesLog};
use crate::fem::equilibrium::LargestResidual;
use crate::fem::mesh::{Mesh, Surface};
pub use crate::tissue::two_scale::{MigrationReport, RankTimes};

/// One line of the log.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "event", rename_all = "snake_case")]
#[allow(clippy::large_enum_variant, reason = "a run has one event at a time")]
pub enum Event {
    /// The run starts; a resumed run writes this event again.
    Start(Start),
    /// A step, or a substep after cuts, converged.
    Step(Step),
    /// A step did not converge and is repeated with a smaller increment.
    Cut(Cut),
    /// How each rank spent its time in one evaluation of the integration points; only in runs on several ranks.
    Ranks(Ranks),
    /// RVEs have moved between the ranks of the micro scale.
    Migration(Migration),
    /// The run ended.
    End(End),
    /// An event that only a later version writes.
    #[serde(other, skip_serializing)]
    Unknown,
}

/// The size of the problem.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct Start {
    /// The title of the run.
    pub title: String,
    /// The linear-algebra backend.
    pub backend: String,
    /// Number of elements of the mesh.
    pub elements: usize,
    /// Number of nodes of the mesh.
    pub nodes: usize,
    /// Number of free unknowns of the macro scale.
    pub unknowns: usize,
    /// Number of fiber RVEs.
    pub rves: usize,
    /// Number of different networks among them.
    pub networks: usize,
    /// The linear solver of the body, and why it was chosen.
    pub solver: String,
    /// Number of worker threads.
    pub threads: usize,
    /// Numbers of ranks of the macro and the micro scale; 1 and 0 if one process computes both.
    pub ranks: [usize; 2],
    /// Version of this program.
    pub version: String,
    /// The last converged step before a resumed run; 0 for a run from the beginning.
    pub resumed_from: usize,
    /// The surfaces of the undeformed body that have boundary conditions.
    pub surfaces: Vec<SurfacePlace>,
}

/// Where a surface of the undeformed body is.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct SurfacePlace {
    /// The name.
    pub name: String,
    /// The mean position, m.
    pub center: [f64; 3],
}

impl SurfacePlace {
    /// Returns the places of the surfaces of a mesh with these names that have an area.
    pub fn of_surfaces(mesh: &Mesh, mut is_named: impl FnMut(&str) -> bool) -> Vec<Self> {
        let of = |surface: &Surface| Some(Self { name: surface.name.clone(), center: mesh.surface_center(surface)? });
        mesh.surfaces().iter().filter(|surface| is_named(&surface.name)).filter_map(of).collect()
    }
}

/// A converged step.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Step {
    /// The load step, from 1.
    pub step: usize,
    /// Pseudo-time reached.
    pub t: f64,
    /// Number of increments of this step.
    #[serde(default)]
    pub increments: usize,
    /// Number of times that this step was cut before it converged.
    #[serde(default)]
    pub cuts: u32,
    /// Number of times that the body was solved again because RVEs were created, woken or deleted.
    #[serde(default)]
    pub rounds: usize,
    /// Number of times that the body was solved again with adapted pressures of penalty constraints.
    #[serde(default)]
    pub augmentations: usize,
    /// Newton's method at the macro scale.
    pub newton: NewtonLog,
    /// Statistics of the RVEs, if there are any.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub rve: Option<RveLog>,
    /// The balance of forces.
    #[serde(default)]
    pub balance: Balance,
    /// How the ranks shared the work; only in runs on several ranks.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub scales: Option<Box<ScalesLog>>,
}

/// The balance of forces on the body. With body forces, the sum is not zero but balances their resultant.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct Balance {
    /// The sum of the forces through all surfaces and at all point conditions, N.
    pub force: [f64; 3],
    /// The norm of this sum divided by that of the largest single force.
    pub relative: f64,
}

/// An attempt that failed.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Cut {
    /// The load step, from 1.
    pub step: usize,
    /// Pseudo-time at the end of the attempted step.
    pub t: f64,
    /// The reason for the failure.
    pub reason: String,
    /// The file, relative to this directory, that reproduces the failure of the RVE that caused the cut.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub lost_rve: Option<PathBuf>,
    /// Newton's method at the macro scale up to the failure.
    #[serde(default)]
    pub newton: NewtonLog,
    /// Where the residual was largest, if Newton's method ended without a small one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub largest_residual: Option<LargestResidual>,
}

/// One evaluation of a trial state by Newton's method or its line search, rank by rank.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct Ranks {
    /// The load step, from 1.
    pub step: usize,
    /// Number of the trial state within the step, from 1.
    pub iteration: usize,
    /// The times of the ranks.
    pub ranks: Vec<RankTimes>,
}

/// A migration of RVEs.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct Migration {
    /// The load step, from 1.
    pub step: usize,
    /// What moved, and why.
    #[serde(flatten)]
    pub report: MigrationReport,
}

/// The outcome of the run.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct End {
    /// Whether all steps converged.
    pub converged: bool,
    /// The reason why not all steps converged.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub reason: Option<String>,
    /// Number of converged steps.
    pub steps: usize,
    /// Wall time, s.
    pub seconds: f64,
}

/// Newton's method at the macro scale. Residuals that are not finite are `null` in the file and NaN when read.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct NewtonLog {
    /// Number of linear solves.
    pub iterations: usize,
    /// Norm of the final residual, N.
    #[serde(deserialize_with = "null_is_nan_one")]
    pub residual: f64,
    /// Norm of the residual before every iteration and at the end, N.
    #[serde(deserialize_with = "null_is_nan")]
    pub residuals: Vec<f64>,
    /// The same norms divided by the residual scale of the convergence test.
    #[serde(deserialize_with = "null_is_nan")]
    pub relative: Vec<f64>,
    /// Number of times that the line search halved a step.
    pub line_search_cuts: usize,
    /// The factorizations used.
    #[serde(alias = "factorisations")]
    pub factorizations: Factorizations,
    /// Total number of iterations of an iterative linear solver, those of linearized starts included.
    pub linear_iterations: usize,
    /// The iterations and the relative residual of each of its solutions within Newton's method.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub linear: Vec<LinearLog>,
    /// The same of each of its solutions in a linearized start, those of failed attempts included; absent in logs of earlier
    /// versions.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub linear_starts: Vec<LinearLog>,
    /// Number of systems that an iterative linear solver did not solve and a direct one did.
    pub fallbacks: usize,
    /// Wall time of the phases.
    pub seconds: NewtonSeconds,
}

/// The solution of a linear system by an iterative solver.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct LinearLog {
    /// Number of iterations.
    pub iterations: usize,
    /// Norm of the residual over that of the right-hand side; with several right-hand sides, the largest.
    pub residual: f64,
}

/// Number of factorizations of each kind.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(default)]
pub struct Factorizations {
    /// Cholesky factorizations of positive definite matrices.
    pub cholesky: usize,
    /// LDL^T factorizations of symmetric matrices.
    pub ldlt: usize,
    /// LU factorizations of unsymmetric matrices.
    pub lu: usize,
    /// Preconditioners of an iterative solver, set up in place of a factorization.
    pub approximate: usize,
    /// Matrices for which an iterative solver kept the preconditioner of an earlier one.
    pub kept: usize,
}

/// Wall time of the phases of a step, s.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct NewtonSeconds {
    /// Evaluation of stress and tangent at the integration points, including the RVEs.
    pub point_field: f64,
    /// Assembly.
    pub assembly: f64,
    /// Factorization.
    pub factor: f64,
    /// Solution with the factors.
    pub solve: f64,
    /// The whole step.
    pub total: f64,
}

/// Statistics of all RVE equilibria of a step.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct RveLog {
    /// Number of RVE solves, one per RVE and Newton iteration of the macro scale.
    pub solves: u64,
    /// Number of those that were solved many at once, in lanes or on a device; absent in logs of earlier versions.
    #[serde(default)]
    pub in_batches: u64,
    /// Total number of Newton iterations.
    pub iterations_total: u64,
    /// Largest number of iterations of one solve.
    pub iterations_max: u64,
    /// The number of iterations that half of the solves did not exceed; absent without solves and in logs of earlier
    /// versions.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub iterations_median: Option<u64>,
    /// The number of iterations that 95 % of the solves did not exceed.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub iterations_p95: Option<u64>,
    /// Mean number of iterations per solve.
    pub iterations_mean: f64,
    /// Number of increments that were halved.
    pub cuts: u64,
    /// Number of factorizations of matrices that were not positive definite.
    pub indefinite: u64,
    /// Number of steps that the line search halved.
    pub line_search_cuts: u64,
    /// Number of equilibria that started from a first-order prediction.
    pub predicted: u64,
    /// Number of equilibria reached by cut increments after the earlier stages failed.
    pub by_cuts: u64,
    /// Number of equilibria reached by regularized Newton after plain Newton failed.
    #[serde(alias = "by_regularised")]
    pub by_regularized: u64,
    /// Number of equilibria reached by dynamic relaxation after all other stages failed.
    pub by_relaxation: u64,
    /// Number of steps of dynamic relaxation.
    pub relaxation_steps: u64,
    /// Number of equilibria verified, without another solve, to continue the equilibrium of the last converged step.
    pub verified: u64,
    /// Number of equilibria solved again from the last converged step because that verification failed.
    pub replaced: u64,
    /// Number of evaluations that reused the last equilibrium because the deformation gradient had not changed.
    pub reused: u64,
    /// Processor time of all RVE solutions, s; for those on a device, their part of the wall time of
    /// the batches.
    pub seconds_cpu: f64,
    /// Number of RVEs that sleep after the step.
    pub asleep: u64,
    /// Number of RVEs that are not created yet.
    pub waiting: u64,
    /// Number of deleted RVEs.
    pub deleted: u64,
}

fn null_is_nan_one<'de, D: serde::Deserializer<'de>>(deserializer: D) -> Result<f64, D::Error> {
    Ok(Option::<f64>::deserialize(deserializer)?.unwrap_or(f64::NAN))
}

fn null_is_nan<'de, D: serde::Deserializer<'de>>(deserializer: D) -> Result<Vec<f64>, D::Error> {
    let values = Vec::<Option<f64>>::deserialize(deserializer)?;
    Ok(values.into_iter().map(|value| value.unwrap_or(f64::NAN)).collect())
}

/// Appends events to the log during a run.
#[derive(Debug)]
pub struct LogWriter {
    path: PathBuf,
    file: File,
}

impl LogWriter {
    /// Creates a new log and replaces an existing one.
    ///
    /// # Errors
    /// Returns [`ResultsError::Write`] if the file cannot be written.
    pub fn create(path: &Path) -> Result<Self, ResultsError> {
        let file = File::create(path).map_err(ResultsError::write(path))?;
        Ok(Self { path: path.into(), file })
    }

    /// Continues the log of an interrupted run after its last whole line; creates the log if it does not exist. Events
    /// of steps that converged after step `steps`, which the run repeats, are removed. Those of a step that did not
    /// converge stay.
    ///
    /// # Errors
    /// Returns [`ResultsError::Read`] or [`ResultsError::Damaged`] if the log cannot be read, [`ResultsError::Write`]
    /// if it cannot be written.
    pub fn resume(path: &Path, steps: usize) -> Result<Self, ResultsError> {
        if path.exists() {
            replace(path, without_later_steps(&whole_lines(path)?, steps).as_bytes())?;
        }
        let file = OpenOptions::new().create(true).append(true).open(path).map_err(ResultsError::write(path))?;
        Ok(Self { path: path.into(), file })
    }

    /// Appends one event and passes it to the operating system before returning.
    ///
    /// # Errors
    /// Returns [`ResultsError::Write`] if the event cannot be written.
    pub fn write(&mut self, event: &Event) -> Result<(), ResultsError> {
        let line = serde_json::to_string(event).map_err(std::io::Error::from);
        let written = line.and_then(|line| self.file.write_all(format!("{line}\n").as_bytes()));
        written.map_err(ResultsError::write(&self.path))
    }

    /// Flushes all events to the disk.
    ///
    /// # Errors
    /// Returns [`ResultsError::Write`] if the file cannot be flushed.
    pub fn sync(&self) -> Result<(), ResultsError> {
        self.file.sync_data().map_err(ResultsError::write(&self.path))
    }
}

/// Returns the lines of a log without the events of steps that converged after step `steps`. A line that is not an
/// event stays.
fn without_later_steps(text: &str, steps: usize) -> String {
    let step_of = |line: &str| match serde_json::from_str(line) {
        Ok(Event::Step(Step { step, .. })) => Some((step, true)),
        Ok(
            Event::Cut(Cut { step, .. }) | Event::Ranks(Ranks { step, .. }) | Event::Migration(Migration { step, .. }),
        ) => Some((step, false)),
        _ => None,
    };
    let of_lines: Vec<Option<(usize, bool)>> = text.lines().map(step_of).collect();
    let later = of_lines.iter().flatten().filter(|&&(step, converged)| converged && step > steps);
    let later: HashSet<usize> = later.map(|&(step, _)| step).collect();
    let is_kept = |of_line: &Option<(usize, bool)>| of_line.is_none_or(|(step, _)| !later.contains(&step));
    let kept = text.split_inclusive('\n').zip(&of_lines).filter(|(_, of_line)| is_kept(of_line));
    kept.map(|(line, _)| line).collect()
}

/// Reads a log. An unfinished last line is ignored.
///
/// # Errors
/// Returns [`ResultsError::Read`] if the file cannot be read, or [`ResultsError::Damaged`] with the first line that is
/// not an event.
pub fn read(path: &Path) -> Result<Vec<Event>, ResultsError> {
    let text = whole_lines(path)?;
    let mut events = Vec::new();
    for (k, line) in text.lines().enumerate().filter(|(_, line)| !line.trim().is_empty()) {
        events.push(serde_json::from_str(line).map_err(|error| {
            ResultsError::damaged(path, Some(k + 1), error.to_string(), "one JSON object per line with a known `event`")
        })?);
    }
    Ok(events)
}
