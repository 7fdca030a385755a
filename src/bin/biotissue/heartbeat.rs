//! Reports on a load step in progress, also while no iteration of the body ends.

use std::sync::mpsc::{RecvTimeoutError, Sender, channel};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::thread::{self, JoinHandle};
use std::time::{Duration, Instant};

use biotissue::tissue::micro_scale::{ProgressSource, RveProgress, SlowestRve};

/// Reports from a thread of its own until it is dropped.
pub struct Heartbeat {
    state: Arc<Mutex<State>>,
    /// Ends the thread when it is dropped.
    running: Option<Sender<()>>,
    thread: Option<JoinHandle<()>>,
}

struct State {
    /// What is known about the step.
    text: String,
    step_began: Instant,
    last_report: Instant,
}

impl Heartbeat {
    /// Calls `report` if nothing was reported for the time `every`, with a text and the share of the RVEs that are done.
    /// `rves` says what the RVEs do.
    pub fn start(every: Duration, rves: Option<ProgressSource>, report: impl Fn(&str, f64) + Send + 'static) -> Self {
        let now = Instant::now();
        let state = Arc::new(Mutex::new(State { text: String::new(), step_began: now, last_report: now }));
        let (sender, receiver) = channel();
        let of_thread = Arc::clone(&state);
        let beat = move || {
            let mut wait = every;
            while let Err(RecvTimeoutError::Timeout) = receiver.recv_timeout(wait) {
                let mut state = lock(&of_thread);
                wait = every.saturating_sub(state.last_report.elapsed());
                if wait.is_zero() {
                    let progress = rves.as_ref().and_then(|rves| rves());
                    let done =
                        progress.as_ref().filter(|all| all.rves > 0).map(|all| all.done as f64 / all.rves as f64);
                    let text = format!("{}{}", state.text, describe(progress, state.step_began.elapsed()));
                    report(&text, done.unwrap_or(0.0));
                    (state.last_report, wait) = (Instant::now(), every);
                }
            }
        };
        // Without the thread, the run continues without these reports.
        let thread = thread::Builder::new().spawn(beat).ok();
        Self { state, running: Some(sender), thread }
    }

    /// Notes that a step begins or is repeated, after a report about the one before.
    pub fn begin(&self, text: String) {
        let now = Instant::now();
        *lock(&self.state) = State { text, step_began: now, last_report: now };
    }

    /// Notes what is known about the step in progress.
    pub fn update(&self, text: String) {
        lock(&self.state).text = text;
    }
}

/// Waits for the thread: `rves` must not be called once the run is over.
impl Drop for Heartbeat {
    fn drop(&mut self) {
        self.running = None;
        if let Some(thread) = self.thread.take() {
            let _ = thread.join();
        }
    }
}

fn lock(state: &Mutex<State>) -> MutexGuard<'_, State> {
    state.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Describes an evaluation of RVEs, and the time since the step began.
fn describe(progress: Option<RveProgress>, elapsed: Duration) -> String {
    let mut text = String::new();
    if let Some(RveProgress { rves, done, slowest }) = progress {
        text = format!(", {done} of {rves} RVEs done");
        if let Some(SlowestRve { point, elapsed, stage }) = slowest {
            let stage = stage.map_or(String::new(), |stage| format!(" (stage: {})", stage.name()));
            text += &format!(", the slowest, of {point}, takes {:.1} s so far{stage}", elapsed.as_secs_f64());
        }
    }
    format!("{text}, {:.0} s", elapsed.as_secs_f64())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn silence_is_reported_until_the_end() {
        let (sender, reports) = channel();
        let heartbeat = Heartbeat::start(Duration::from_millis(20), None, move |text, _| {
            let _ = sender.send(text.to_owned());
        });
        heartbeat.begin("step 1/2".into());
        assert_eq!(reports.recv().unwrap(), "step 1/2, 0 s");
        heartbeat.update("step 1/2: iteration 1".into());
        assert_eq!(reports.recv().unwrap(), "step 1/2: iteration 1, 0 s");
        drop(heartbeat);
        // The thread ends, and with it the sender.
        while reports.recv().is_ok() {}
    }

    #[test]
    fn frequent_reports_of_the_run_are_enough() {
        let (sender, reports) = channel();
        let heartbeat = Heartbeat::start(Duration::from_millis(1500), None, move |text, _| {
            let _ = sender.send(text.to_owned());
        });
        for step in 1..110 {
            heartbeat.begin(format!("step {step}"));
            std::thread::sleep(Duration::from_millis(20));
        }
        assert!(reports.try_recv().is_err());
    }
}
