//! Handling of runs interrupted by Ctrl-C, SIGTERM or SIGHUP.

use std::io::{IsTerminal, Write};
use std::path::PathBuf;
use std::process::exit;
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};

use indicatif::ProgressBar;
#[cfg(unix)]
use signal_hook::{
    consts::{SIGHUP, SIGINT, SIGTERM},
    iterator::Signals,
};

/// The exit code after any of these signals: by shell convention, that of a process ended by Ctrl-C.
const INTERRUPTED: i32 = 130;

/// The data of a run that the interrupt handler needs.
#[derive(Clone)]
pub struct Interrupted {
    /// The result directory.
    pub dir: PathBuf,
    /// Number of converged load steps.
    pub completed_steps: Arc<AtomicUsize>,
    /// The progress bar on a terminal.
    pub bar: Option<ProgressBar>,
}

/// Ends this process at an interrupt with a message on how to continue. No cleanup is necessary: every result file is
/// complete at any moment. A second interrupt ends the process even if that message cannot be written. Signals that the
/// process was started to ignore stay ignored, such as SIGHUP under `nohup`.
#[cfg(unix)]
pub fn watch(run: Interrupted) {
    // Without a handler an interrupt ends the process without a message, which is no reason not to run.
    let Ok(mut signals) = Signals::new(not_ignored()) else { return };
    let wait = move || {
        let mut signals = signals.forever();
        if signals.next().is_some() && std::thread::Builder::new().spawn(move || run.end()).is_ok() {
            signals.next();
        }
        exit(INTERRUPTED);
    };
    let _ = std::thread::Builder::new().spawn(wait);
}

/// Does nothing on systems without these signals.
#[cfg(not(unix))]
pub fn watch(_: Interrupted) {}

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
    fn end(&self) {
        if let Some(bar) = &self.bar {
            bar.finish_and_clear();
        }
        // The lock is held until the process ends, so that no line of the run follows.
        let mut stderr = std::io::stderr().lock();
        if stderr.is_terminal() {
            // Shows the cursor, which the progress bar may have hidden.
            let _ = stderr.write_all(b"\x1b[?25h");
        }
        let dir = self.dir.display();
        let _ = match self.completed_steps.load(Ordering::Relaxed) {
            0 => writeln!(stderr, "interrupted: no load step has converged yet"),
            _ => writeln!(
                stderr,
                "interrupted: the converged load steps are in {dir}; the same command with --resume continues after them"
            ),
        };
        exit(INTERRUPTED);
    }
}
