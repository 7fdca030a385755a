//! `log.jsonl`: what happened in a run, an object a line; `event` says what kind it is.

use std::fs::{File, OpenOptions};
use std::io::Write;
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

use super::ResultsError;
use super::replace::{replace, whole_lines};

/// One line of the log.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "event", rename_all = "snake_case")]
pub enum Event {
    /// The run begins; a run that is resumed begins again.
    Start(Start),
    /// A step (or a part of one, after cuts) converged.
    Step(Step),
    /// A step did not converge and is tried again with a smaller increment.
    Cut(Cut),
    /// Where the time of every rank went while the points were asked once; of runs on ranks.
    Ranks(Ranks),
    /// The run is over.
    End(End),
    /// Something that a later version writes.
    #[serde(other, skip_serializing)]
    Unknown,
}

/// What is about to be solved.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(default)]
pub struct Start {
    /// What the run is called.
    pub title: String,
    /// The linear-algebra backend.
    pub backend: String,
    /// Elements of the mesh.
    pub elements: usize,
    /// Nodes of the mesh.
    pub nodes: usize,
    /// Free unknowns of the macro scale.
    pub unknowns: usize,
    /// Fiber RVEs.
    pub rves: usize,
    /// Different networks among them.
    pub networks: usize,
    /// Worker threads.
    pub threads: usize,
    /// Ranks of the macro scale and of the RVEs; 1 and 0 in one process.
    pub ranks: [usize; 2],
    /// Version of this program.
    pub version: String,
    /// The converged step that a resumed run goes on from; 0 for a run from the beginning.
    pub resumed_from: usize,
}

/// A converged step.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Step {
    /// The load step, from 1.
    pub step: usize,
    /// Pseudo-time reached.
    pub t: f64,
    /// How often this step was cut before.
    #[serde(default)]
    pub cuts: u32,
    /// How often the body was brought to balance again because RVEs were created, woken or deleted.
    #[serde(default)]
    pub rounds: usize,
    /// Newton at the macro scale.
    pub newton: NewtonLog,
    /// The RVEs, where there are any.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub rve: Option<RveLog>,
    /// Whether forces balance.
    #[serde(default)]
    pub balance: Balance,
}

/// The balance of forces on the body. With body forces, their resultant is what is left.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct Balance {
    /// The sum of the forces through all surfaces and held points, N.
    pub force: [f64; 3],
    /// Its norm over that of the largest of them.
    pub relative: f64,
}

/// An attempt that failed.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Cut {
    /// The load step, from 1.
    pub step: usize,
    /// Pseudo-time aimed at.
    pub t: f64,
    /// Why it failed.
    pub reason: String,
    /// The file, relative to this directory, that repeats the failure of the RVE that caused it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub lost_rve: Option<PathBuf>,
    /// As far as Newton came.
    #[serde(default)]
    pub newton: NewtonLog,
}

/// One trial state of Newton or its line search, rank by rank.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct Ranks {
    /// The load step, from 1.
    pub step: usize,
    /// The trial state of the step, from 1.
    pub iteration: usize,
    /// Where their time went.
    pub ranks: Vec<RankSeconds>,
}

/// Where the time of a rank went since it was last asked, s.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct RankSeconds {
    /// Its number among all ranks.
    pub rank: usize,
    /// It worked.
    pub busy: f64,
    /// It waited for messages that had not come.
    pub idle: f64,
    /// It packed, sent, received and took apart what it exchanged.
    pub exchanging: f64,
}

/// How the run ended.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct End {
    /// Whether all steps converged.
    pub converged: bool,
    /// Why not.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub reason: Option<String>,
    /// Converged steps.
    pub steps: usize,
    /// Wall time, s.
    pub seconds: f64,
}

/// Newton at the macro scale. Residuals that are no finite number are `null` in the file and NaN when read.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct NewtonLog {
    /// Linear solves.
    pub iterations: usize,
    /// Norm of the residual at the end, N.
    #[serde(deserialize_with = "null_is_nan_one")]
    pub residual: f64,
    /// Norm of the residual before every iteration and at the end, N.
    #[serde(deserialize_with = "null_is_nan")]
    pub residuals: Vec<f64>,
    /// The same over the norm that the stop rule compares with.
    #[serde(deserialize_with = "null_is_nan")]
    pub relative: Vec<f64>,
    /// How often the line search halved a step.
    pub line_search_cuts: usize,
    /// Which factorizations were used.
    #[serde(alias = "factorisations")]
    pub factorizations: Factorizations,
    /// Iterations of an iterative linear solver, in all.
    pub linear_iterations: usize,
    /// Where the time went.
    pub seconds: NewtonSeconds,
}

/// Numbers of factorizations.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(default)]
pub struct Factorizations {
    /// Of a positive definite matrix.
    pub cholesky: usize,
    /// Of a symmetric one.
    pub ldlt: usize,
    /// Of an unsymmetric one.
    pub lu: usize,
    /// None: approximate inverses for an iterative method.
    pub approximate: usize,
}

/// Wall time of the phases of a step, s.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct NewtonSeconds {
    /// Stress and tangent at the integration points: the RVEs.
    pub point_field: f64,
    /// Assembly.
    pub assembly: f64,
    /// Factorization.
    pub factor: f64,
    /// Solution.
    pub solve: f64,
    /// The whole step.
    pub total: f64,
}

/// All RVE equilibria of a step.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct RveLog {
    /// RVEs brought to equilibrium, once for every Newton iteration of the macro scale.
    pub solves: u64,
    /// Newton iterations of all of them.
    pub iterations_total: u64,
    /// Of the slowest.
    pub iterations_max: u64,
    /// On average.
    pub iterations_mean: f64,
    /// Increments that were halved.
    pub cuts: u64,
    /// Factorizations of a matrix that was not positive definite.
    pub indefinite: u64,
    /// Steps that the line search halved.
    pub line_search_cuts: u64,
    /// Equilibria that started from a first-order prediction.
    pub predicted: u64,
    /// Equilibria that plain Newton missed and cut increments reached.
    pub by_cuts: u64,
    /// Equilibria that those missed and regularized Newton reached.
    #[serde(alias = "by_regularised")]
    pub by_regularized: u64,
    /// Equilibria that all those missed and dynamic relaxation reached.
    pub by_relaxation: u64,
    /// Steps of dynamic relaxation.
    pub relaxation_steps: u64,
    /// Equilibria shown to continue those of the last converged step, without solving for them again.
    pub verified: u64,
    /// Equilibria solved for again from the last converged step, because that could not be shown.
    pub replaced: u64,
    /// RVEs whose last equilibrium still served.
    pub reused: u64,
    /// Processor time, s, over all workers.
    pub seconds_cpu: f64,
    /// RVEs that sleep after the step.
    pub asleep: u64,
    /// RVEs that are not created yet.
    pub waiting: u64,
    /// RVEs that were deleted.
    pub deleted: u64,
}

fn null_is_nan_one<'de, D: serde::Deserializer<'de>>(deserializer: D) -> Result<f64, D::Error> {
    Ok(Option::<f64>::deserialize(deserializer)?.unwrap_or(f64::NAN))
}

fn null_is_nan<'de, D: serde::Deserializer<'de>>(deserializer: D) -> Result<Vec<f64>, D::Error> {
    let values = Vec::<Option<f64>>::deserialize(deserializer)?;
    Ok(values.into_iter().map(|value| value.unwrap_or(f64::NAN)).collect())
}

/// Writes the log while the run goes on.
#[derive(Debug)]
pub struct LogWriter {
    path: PathBuf,
    file: File,
}

impl LogWriter {
    /// Starts a new log; one that is there is replaced.
    ///
    /// # Errors
    /// [`ResultsError::Write`].
    pub fn create(path: &Path) -> Result<Self, ResultsError> {
        let file = File::create(path).map_err(ResultsError::write(path))?;
        Ok(Self { path: path.into(), file })
    }

    /// Goes on with the log of an interrupted run, after its last whole line; starts one where there is none. What the
    /// interrupted run did after its last checkpoint stays in the log.
    ///
    /// # Errors
    /// [`ResultsError::Read`], [`ResultsError::Write`].
    pub fn resume(path: &Path) -> Result<Self, ResultsError> {
        if path.exists() {
            replace(path, whole_lines(path)?.as_bytes())?;
        }
        let file = OpenOptions::new().create(true).append(true).open(path).map_err(ResultsError::write(path))?;
        Ok(Self { path: path.into(), file })
    }

    /// Appends one event; it is with the operating system when this returns.
    ///
    /// # Errors
    /// [`ResultsError::Write`].
    pub fn write(&mut self, event: &Event) -> Result<(), ResultsError> {
        let line = serde_json::to_string(event).map_err(std::io::Error::from);
        let written = line.and_then(|line| self.file.write_all(format!("{line}\n").as_bytes()));
        written.map_err(ResultsError::write(&self.path))
    }

    /// Brings all events to the disk.
    ///
    /// # Errors
    /// [`ResultsError::Write`].
    pub fn sync(&self) -> Result<(), ResultsError> {
        self.file.sync_data().map_err(ResultsError::write(&self.path))
    }
}

/// Reads a log back. A last line that was not finished is left out.
///
/// # Errors
/// [`ResultsError::Read`]; [`ResultsError::Damaged`] with the line that is no event.
pub fn read(path: &Path) -> Result<Vec<Event>, ResultsError> {
    let text = whole_lines(path)?;
    let mut events = Vec::new();
    for (k, line) in text.lines().enumerate().filter(|(_, line)| !line.trim().is_empty()) {
        events.push(serde_json::from_str(line).map_err(|error| {
            ResultsError::damaged(path, Some(k + 1), error.to_string(), "one JSON object a line with a known `event`")
        })?);
    }
    Ok(events)
}
