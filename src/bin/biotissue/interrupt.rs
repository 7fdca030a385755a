//! What becomes of a run that is ended from outside: by Ctrl-C, SIGTERM or SIGHUP.

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

use crate::output;

/// The exit code of a process that was interrupted, as shells have it.
const INTERRUPTED: i32 = 130;

/// A run, as far as an interrupt must know it.
#[derive(Clone)]
pub struct Interrupted {
    /// Where its results are.
    pub dir: PathBuf,
    /// How many load steps have converged.
    pub done: Arc<AtomicUsize>,
    /// What it shows on a terminal.
    pub bar: Option<ProgressBar>,
}

/// Ends this process at an interrupt with a word on how to go on. Nothing is left to tidy up: every file of the results is
/// whole at any moment. A second interrupt ends the process even if that word cannot be written. Signals that the process
/// was started to ignore stay ignored, as SIGHUP under `nohup`.
#[cfg(unix)]
pub fn watch(run: Interrupted) {
    // Without a handler an interrupt ends the process without a word, which is no reason not to run.
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

/// Does nothing where there are no such signals.
#[cfg(not(unix))]
pub fn watch(_: Interrupted) {}

/// The signals that this process was not started to ignore. Where the system does not tell, SIGHUP counts as ignored.
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
        let mut stderr = std::io::stderr();
        if stderr.is_terminal() {
            // Shows the cursor, which a bar may hide while it is drawn.
            let _ = stderr.write_all(b"\x1b[?25h");
        }
        let dir = self.dir.display();
        output::say(&match self.done.load(Ordering::Relaxed) {
            0 => "interrupted: no load step has converged yet".to_owned(),
            _ => format!(
                "interrupted: the converged load steps are in {dir}; the same command with --resume goes on after them"
            ),
        });
        exit(INTERRUPTED);
    }
}
