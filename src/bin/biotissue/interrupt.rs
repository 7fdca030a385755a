//! What becomes of a run that is ended from outside: by Ctrl-C, SIGTERM or SIGHUP.

use std::io::{IsTerminal, Write};
use std::path::PathBuf;
use std::process::exit;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};

use indicatif::ProgressBar;

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
/// was started to ignore stay ignored, as under `nohup`; the others then end it without a word.
pub fn watch(run: Interrupted) {
    let is_second = AtomicBool::new(false);
    // Without a handler an interrupt ends the process without a word, which is no reason not to run.
    let _ = ctrlc::try_set_handler(move || {
        if is_second.swap(true, Ordering::Relaxed) {
            exit(INTERRUPTED);
        }
        let run = run.clone();
        if std::thread::Builder::new().spawn(move || run.end()).is_err() {
            exit(INTERRUPTED);
        }
    });
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
