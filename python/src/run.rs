//! `run_case`: a simulation in this process.

use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};

use biotissue::app::case::Case;
use biotissue::app::results::ResultsError;
use biotissue::app::results::log::{Cut, Step};
use biotissue::app::run::{ResumeError, RunError, Setup};
use biotissue::app::{Examination, Progress};
use biotissue::backends::sparse::Sparse;
use pyo3::exceptions::{PyKeyboardInterrupt, PyRuntimeError};
use pyo3::prelude::*;
use rayon::{ThreadPool, ThreadPoolBuilder};

use crate::errors::{ConvergenceError, check_exists, input_error, results_error, value_error, warn};
use crate::results::PyResults;

/// The most threads of a pool.
const MOST_THREADS: usize = 1024;

/// Run a case in this process, as ``biotissue run`` does, and return its results.
///
/// The body and its RVEs are solved by all threads; ``[scales]``, the numbers of ranks of the program, has no effect on
/// the results and none here. Warnings of the readers, and of networks that have motions which no fiber resists, are issued
/// as warnings. Ctrl-C ends the run after the current load step, with a checkpoint, unless `threads` is given.
///
/// Parameters
/// ----------
/// path : str or os.PathLike
///     The case file.
/// out : str or os.PathLike, optional
///     The result directory; by default the one that the case names. Results of an earlier run are replaced.
/// threads : int, optional
///     Number of threads; by default, all cores. Results do not depend on it.
/// resume : bool
///     Continue after the last converged step in the result directory.
///
/// Returns
/// -------
/// Results
///     The results.
///
/// Raises
/// ------
/// FileNotFoundError
///     If there is no such case.
/// ValueError
///     If an input file has errors; the message lists them with file and line.
/// ConvergenceError
///     If a load step does not converge; the results of the steps before it are in the directory.
/// OSError
///     If the results cannot be written, or another run uses the directory.
#[pyfunction]
#[pyo3(signature = (path, out = None, *, threads = None, resume = false))]
pub fn run_case(
    py: Python<'_>,
    path: PathBuf,
    out: Option<PathBuf>,
    threads: Option<usize>,
    resume: bool,
) -> PyResult<PyResults> {
    check_exists(&path)?;
    let pool = pool_of(threads)?;
    let read = py.detach(|| Case::read(&path)).map_err(|errors| input_error(&errors))?;
    warn(py, &read.warnings)?;
    let dir = out.unwrap_or_else(|| read.case.output.directory.clone());
    py.detach(|| match &pool {
        Some(pool) => pool.install(|| run(read.case, &dir, resume)),
        None => run(read.case, &dir, resume),
    })?;
    PyResults::open(py, dir)
}

/// Returns a pool of this many threads; `None` stands for the one that the process shares.
pub fn pool_of(threads: Option<usize>) -> PyResult<Option<ThreadPool>> {
    let Some(threads) = threads else { return Ok(None) };
    if !(1..=MOST_THREADS).contains(&threads) {
        return Err(value_error(format!("threads is {threads}; it must be from 1 to {MOST_THREADS}")));
    }
    let pool = ThreadPoolBuilder::new().num_threads(threads).build();
    pool.map(Some).map_err(|error| PyRuntimeError::new_err(format!("{threads} threads cannot be started: {error}")))
}

/// Takes the load steps; called without the interpreter.
fn run(case: Case, dir: &Path, resume: bool) -> PyResult<()> {
    let setup = Setup::<Sparse>::new((), case).and_then(Setup::with_device).map_err(value_error)?;
    let floppy = setup.floppy_networks(Examination::Quick).warnings;
    Python::attach(|py| warn(py, setup.warnings()).and_then(|()| warn(py, &floppy)))?;
    let mut simulation = setup.simulation().map_err(value_error)?;
    let warnings = if resume {
        simulation.resume(dir).map_err(|error| resume_error(&error))?.warnings
    } else {
        simulation.take_directory(&(), dir).map_err(|error| results_error(&error))?
    };
    Python::attach(|py| warn(py, &warnings))?;
    let mut interrupt = Interrupt::default();
    let outcome = simulation.run(dir, &mut interrupt);
    outcome.map(|_| ()).map_err(|error| match error {
        RunError::Interrupted(step) => interrupt.into_error(step),
        RunError::NotConverged { .. } => ConvergenceError::new_err(error.to_string()),
        RunError::Results(error) => results_error(&error),
    })
}

fn resume_error<F: std::error::Error + 'static>(error: &ResumeError<F>) -> PyErr {
    match error {
        ResumeError::Results(error @ (ResultsError::Locked(..) | ResultsError::Write(..))) => results_error(error),
        error => value_error(error),
    }
}

/// Ends a run after a signal, such as Ctrl-C.
#[derive(Default)]
struct Interrupt {
    /// The exception that the handler of the signal has raised.
    raised: Mutex<Option<PyErr>>,
}

impl Interrupt {
    fn into_error(self, step: usize) -> PyErr {
        let raised = self.raised.into_inner().unwrap_or_else(PoisonError::into_inner);
        raised.unwrap_or_else(|| PyKeyboardInterrupt::new_err(format!("interrupted after load step {step}")))
    }
}

impl Progress for Interrupt {
    fn converged(&mut self, _: &Step) {}

    fn failed(&mut self, _: &Cut) {}

    fn is_interrupted(&self) -> bool {
        let Err(error) = Python::attach(|py| py.check_signals()) else { return false };
        *self.raised.lock().unwrap_or_else(PoisonError::into_inner) = Some(error);
        true
    }
}
