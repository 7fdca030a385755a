//! Handling of runs interrupted by Ctrl-C, SIGTERM or SIGHUP.

use std::io::{IsTerminal, Write};
use std::path::{Path, PathBuf};
use std::process::exit;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::{Arc, Mutex, PoisonError};

use indicatif::ProgressBar;
#[cfg(unix)]
use signal_hook::{
    consts::{SIGHUP, SIGINT, SIGTERM},
    iterator::Signals,
};

use crate::failure::INTERRUPTED;
use crate::ranks::started_by_mpirun;

/// The data of a run that the interrupt handler needs.
#[derive(Clone)]
pub struct Interrupted {
    /// The result directory.
    pub dir: PathBuf,
    /// Number of converged load steps.
    pub completed_steps: Arc<AtomicUsize>,
    /// Number of load steps up to the last checkpoint.
    pub saved_steps: Arc<AtomicUsize>,
    /// Number of load steps between two checkpoints.
    pub between_checkpoints: usize,
    /// Set to end the run after its current load step.
    pub is_interrupted: Arc<AtomicBool>,
    /// The progress bar on a terminal.
    pub bar: Option<ProgressBar>,
}

/// Ends this process at an interrupt with a message on how to continue. No cleanup is necessary: every result file is
/// complete at any moment. If converged steps have no checkpoint yet, the run first completes its current step and writes
/// one. A second interrupt ends the process at once, also if the message cannot be written. Signals that the
/// process was started to ignore stay ignored, such as SIGHUP under `nohup`.
pub fn watch(run: Interrupted) {
    *RUN.lock().unwrap_or_else(PoisonError::into_inner) = Some(run);
    watch_signals();
}

/// Ends this process at an interrupt from now on, with the same exit code and a message, until [`watch`] names the run. Not
/// for processes under `mpirun`, which the signal ends all, and of which one reports.
pub fn watch_preparation() {
    watch_signals();
}

/// The run that an interrupt ends; `None` while it is prepared.
static RUN: Mutex<Option<Interrupted>> = Mutex::new(None);

#[cfg(unix)]
fn watch_signals() {
    static IS_WATCHING: AtomicBool = AtomicBool::new(false);
    if IS_WATCHING.swap(true, Ordering::Relaxed) {
        return;
    }
    // Without a handler an interrupt ends the process without a message, which is no reason not to run.
    let Ok(mut signals) = Signals::new(not_ignored()) else { return };
    let wait = move || {
        let mut signals = signals.forever();
        if signals.next().is_some() && std::thread::Builder::new().spawn(end).is_ok() {
            signals.next();
        }
        exit(INTERRUPTED.into());
    };
    let _ = std::thread::Builder::new().spawn(wait);
}

/// Ends the run, or this process while there is none.
#[cfg(unix)]
fn end() {
    let run = RUN.lock().unwrap_or_else(PoisonError::into_inner).clone();
    if let Some(run) = run {
        return run.end();
    }
    let mut stderr = std::io::stderr().lock();
    let _ = writeln!(stderr, "interrupted before the first load step of this run");
    exit(INTERRUPTED.into());
}

/// Does nothing on systems without these signals.
#[cfg(not(unix))]
fn watch_signals() {}

/// Returns the signals that this process was not started to ignore. If the system does not provide this information,
/// SIGHUP is assumed to be ignored.
#[cfg(unix)]
fn not_ignored() -> Vec<i32> {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let mask = status.lines().find_map(|line| u64::from_str_radix(line.strip_prefix("SigIgn:")?.trim(), 16).ok());
    let mask = mask.unwrap_or(1 << (SIGHUP - 1));
    [SIGINT, SIGTERM, SIGHUP].into_iter().filter(|signal| mask & (1 << (signal - 1)) == 0).collect()
}

impl Interrupted {
    /// Returns true if a resumed run repeats at most the last converged step. Under `mpirun`, a run cannot continue to
    /// its next checkpoint, because the signal has also ended the other ranks.
    fn ends_at_once(&self, completed_steps: usize) -> bool {
        self.between_checkpoints == 1
            || completed_steps == self.saved_steps.load(Ordering::Relaxed)
            || started_by_mpirun().is_some_and(|processes| processes > 1)
    }

    /// Ends the process, or makes the run end after its current step if converged steps would otherwise be repeated.
    fn end(&self) {
        let completed_steps = self.completed_steps.load(Ordering::Relaxed);
        let ends_at_once = self.ends_at_once(completed_steps);
        if let Some(bar) = &self.bar {
            bar.finish_and_clear();
        }
        // The lock is held until the process ends, so that no line of the run follows.
        let mut stderr = std::io::stderr().lock();
        if stderr.is_terminal() {
            // Shows the cursor, which the progress bar may have hidden.
            let _ = stderr.write_all(b"\x1b[?25h");
        }
        if !ends_at_once {
            let _ = writeln!(
                stderr,
                "interrupted: the run ends after the current load step, with a checkpoint; a second interrupt ends it at \
                 once, and --resume then repeats the steps after the last checkpoint"
            );
            self.is_interrupted.store(true, Ordering::Relaxed);
            return;
        }
        let _ = writeln!(stderr, "{}", self.message(completed_steps));
        exit(INTERRUPTED.into());
    }

    /// Returns the message of a process that ends at once.
    fn message(&self, completed_steps: usize) -> String {
        let (dir, saved_steps) = (self.dir.display(), self.saved_steps.load(Ordering::Relaxed));
        match (completed_steps, saved_steps) {
            (0, _) => "interrupted: no load step has converged yet".into(),
            _ if self.between_checkpoints == 1 || completed_steps == saved_steps => how_to_continue(&self.dir),
            (_, 0) => format!(
                "interrupted: {dir} has no checkpoint yet, so that the same command with --resume starts from the beginning"
            ),
            _ => format!(
                "interrupted: the last checkpoint in {dir} is that of load step {saved_steps}; the same command with --resume \
                 continues after it"
            ),
        }
    }
}

/// Returns the message about an interrupted run with converged steps.
pub fn how_to_continue(dir: &Path) -> String {
    let dir = dir.display();
    format!("interrupted: the converged load steps are in {dir}; the same command with --resume continues after them")
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Under `mpirun`, where a run cannot go on to its next checkpoint.
    #[test]
    fn the_message_names_the_step_from_which_a_run_continues() {
        let message = |completed: usize, saved: usize, between_checkpoints: usize| {
            let run = Interrupted {
                dir: "out".into(),
                completed_steps: Arc::new(AtomicUsize::new(completed)),
                saved_steps: Arc::new(AtomicUsize::new(saved)),
                between_checkpoints,
                is_interrupted: Arc::default(),
                bar: None,
            };
            run.message(completed)
        };
        assert!(message(0, 0, 5).contains("no load step has converged yet"));
        assert!(message(3, 0, 5).contains("out has no checkpoint yet"));
        assert!(message(7, 5, 5).contains("that of load step 5;"));
        // The checkpoint of the last step may be written at this moment.
        for message in [message(5, 5, 5), message(3, 2, 1)] {
            assert_eq!(message, how_to_continue(Path::new("out")));
        }
    }
}
