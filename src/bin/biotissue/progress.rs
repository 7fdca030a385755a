//! Progress of a run, shown to the user.

use std::io::IsTerminal;
use std::path::Path;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use biotissue::app::Progress;
use biotissue::app::results::log::{Cut, Step};
use biotissue::app::run::{ProblemSize, Setup, Simulation};
use biotissue::fem::stepping::Iterating;
use biotissue::las::RealBackend;
use biotissue::tissue::micro_scale::TissueMaterial;
use indicatif::{ProgressBar, ProgressStyle};

use crate::heartbeat::Heartbeat;
use crate::interrupt::{self, Interrupted};
use crate::output;

/// Shows a progress bar on a terminal, otherwise one line per step, and more during a long one.
pub struct Reporter {
    bar: Option<ProgressBar>,
    position: Arc<Mutex<Position>>,
    heartbeat: Heartbeat,
    count: usize,
    /// Whether the case wants a device to solve the RVEs.
    has_device: bool,
    completed_steps: Arc<AtomicUsize>,
    saved_steps: Arc<AtomicUsize>,
    is_interrupted: Arc<AtomicBool>,
}

/// Reports on the first evaluation of a body, at least every `report_every`, until it is dropped. With many large networks,
/// the evaluation takes minutes.
pub fn of_undeformed_body<B: RealBackend, M: TissueMaterial>(setup: &Setup<B, M>, report_every: Duration) -> Heartbeat {
    let heartbeat = Heartbeat::start(report_every, setup.progress_source(), |text, _| output::message(text));
    heartbeat.begin("undeformed body".into());
    heartbeat
}

impl Reporter {
    /// Starts the report of a run with the result directory `dir`, after `completed_steps` converged steps. Without a
    /// terminal, a line is printed at least every `report_every`.
    pub fn new<B: RealBackend, M: TissueMaterial>(
        simulation: &Simulation<B, M>,
        dir: &Path,
        completed_steps: usize,
        report_every: Duration,
    ) -> Self {
        let size = &simulation.problem_size();
        let ProblemSize { elements, unknowns, rves, threads, ranks: [macro_ranks, micro_ranks], .. } = size;
        let workers = match micro_ranks {
            0 => format!("{threads} thread{}", if *threads == 1 { "" } else { "s" }),
            _ => format!("{macro_ranks} + {micro_ranks} ranks"),
        };
        let rves = match size.networks.len() {
            0 => String::new(),
            networks => format!("{rves} RVEs of {networks} network{}, ", if networks == 1 { "" } else { "s" }),
        };
        output::message(&format!("{elements} elements, {unknowns} unknowns, {rves}{workers}"));
        if size.is_iterative {
            output::message(&format!("linear solver: {}", size.solver));
        }
        let bar = std::io::stderr().is_terminal().then(|| {
            let bar = ProgressBar::new((PER_STEP * size.steps as f64) as u64);
            // The duration cannot be estimated before the first step.
            set_style(&bar, "{bar:32} {elapsed} {msg}");
            bar.enable_steady_tick(Duration::from_millis(200));
            bar
        });
        let rves = simulation.progress_source();
        let position = Arc::new(Mutex::new(Position::new(completed_steps)));
        let heartbeat = match bar.clone() {
            Some(bar) => {
                let position = Arc::clone(&position);
                Heartbeat::start(BAR_EVERY, rves, move |text, rves_done| {
                    bar.set_position(lock(&position).within(rves_done));
                    bar.set_message(format!("({text})"));
                })
            }
            None => Heartbeat::start(report_every, rves, |text, _| output::message(text)),
        };
        heartbeat.begin(format!("step {}/{}: start, before its first iteration", completed_steps + 1, size.steps));
        let saved_steps = Arc::new(AtomicUsize::new(completed_steps));
        let completed_steps = Arc::new(AtomicUsize::new(completed_steps));
        let is_interrupted = Arc::new(AtomicBool::new(false));
        interrupt::watch(Interrupted {
            dir: dir.to_owned(),
            completed_steps: Arc::clone(&completed_steps),
            saved_steps: Arc::clone(&saved_steps),
            between_checkpoints: simulation.case().output.checkpoint,
            is_interrupted: Arc::clone(&is_interrupted),
            bar: bar.clone(),
        });
        let has_device = simulation.case().micro.device.is_some();
        Self { bar, position, heartbeat, count: size.steps, has_device, completed_steps, saved_steps, is_interrupted }
    }

    fn message(&self, line: &str) {
        match &self.bar {
            Some(bar) => bar.println(line),
            None => output::message(line),
        }
    }

    pub fn finish(&self) {
        if let Some(bar) = &self.bar {
            bar.finish_and_clear();
        }
    }
}

/// Positions of the bar per load step.
const PER_STEP: f64 = 1000.0;

/// How far the run is: a load step takes as many iterations as those before it did on average.
struct Position {
    /// Converged load steps, with the part of the current one that converged in shorter increments.
    converged: f64,
    /// Converged increments, and their iterations in all.
    former: [usize; 2],
    /// Iterations of the current increment.
    iterations: usize,
    /// The last position: a bar does not go back.
    last: u64,
}

impl Position {
    fn new(completed_steps: usize) -> Self {
        Self { converged: completed_steps as f64, former: [0; 2], iterations: 0, last: 0 }
    }

    /// Returns the position after so many load steps, the last of which took these iterations.
    fn converged(&mut self, steps: f64, iterations: usize) -> u64 {
        self.converged = steps;
        self.former = [self.former[0] + 1, self.former[1] + iterations];
        self.iterations = 0;
        self.within(0.0)
    }

    /// Returns the position after so many iterations of an increment.
    fn iterated(&mut self, iterations: usize) -> u64 {
        self.iterations = iterations;
        self.within(0.0)
    }

    /// Returns the position if this share of the RVEs is done in the current evaluation.
    fn within(&mut self, rves_done: f64) -> u64 {
        /// Iterations of the first increment, of which nothing is known.
        const USUAL: f64 = 4.0;
        /// No increment is as good as done before it converges.
        const MOST: f64 = 0.95;
        let [increments, iterations] = self.former;
        let expected = if increments > 0 { iterations as f64 / increments as f64 } else { USUAL };
        // A start and as many iterations, each with an evaluation.
        let part = ((self.iterations as f64 + rves_done) / (expected + 1.0)).min(MOST);
        self.last = self.last.max((PER_STEP * (self.converged + part)) as u64);
        self.last
    }
}

fn lock(position: &Mutex<Position>) -> MutexGuard<'_, Position> {
    position.lock().unwrap_or_else(PoisonError::into_inner)
}

/// How often the bar shows what the RVEs do.
const BAR_EVERY: Duration = Duration::from_secs(1);

/// The largest relative residual of a converged step that is not due to rounding; tolerances are below it.
const LARGEST_RELATIVE: f64 = 0.1;

impl Progress for Reporter {
    fn converged(&mut self, step: &Step) {
        self.completed_steps.store(step.step, Ordering::Relaxed);
        let newton = &step.newton;
        let residual = match newton.relative.last() {
            // Without loads and stresses, only rounding is left, which no force makes small.
            Some(relative) if *relative > LARGEST_RELATIVE => format!("{:.1e} N by rounding", newton.residual),
            relative => format!("{:.1e}", relative.copied().unwrap_or(0.0)),
        };
        let rves = step.rve.as_ref().map_or(String::new(), |rve| {
            let relaxation = match rve.relaxation_steps {
                0 => String::new(),
                steps => format!(" and {steps} steps of relaxation in all"),
            };
            let (mean, most) = (rve.iterations_mean, rve.iterations_max);
            // The processor solves those for which a device has no memory.
            let on_device = match self.has_device {
                true => format!(", {} on the device or in lanes", share(rve.in_batches, rve.solves)),
                false => String::new(),
            };
            format!(", RVEs {mean:.1} iterations on average, {most} at most{relaxation}{on_device}")
        });
        let life = step.rve.as_ref().filter(|_| step.rounds > 0).map_or(String::new(), |rve| {
            let (waiting, deleted, plural) = (rve.waiting, rve.deleted, if step.rounds == 1 { "" } else { "s" });
            format!(", equilibrium restored {} time{plural} ({waiting} RVEs waiting, {deleted} deleted)", step.rounds)
        });
        let linear = match newton.linear_iterations {
            0 => String::new(),
            iterations => format!(", {iterations} of the linear solver"),
        };
        let fallback = match newton.fallbacks {
            0 => "",
            1 => " (which failed once; a direct solver replaced it)",
            _ => " (which failed repeatedly; a direct solver replaced it)",
        };
        let line = format!(
            "step {}/{} t = {:.4}: {} iterations{linear}{fallback}, residual {residual}{rves}{life}, {:.1} s",
            step.step, self.count, step.t, newton.iterations, newton.seconds.total
        );
        self.message(&line);
        if let Some(bar) = &self.bar {
            set_style(bar, "{bar:32} {elapsed} (left {eta}) {msg}");
            bar.set_position(lock(&self.position).converged(step.t * self.count as f64, newton.iterations));
            bar.set_message("");
        }
        self.heartbeat.begin(if step.step < self.count {
            format!("step {}/{}: start, before its first iteration", step.step + 1, self.count)
        } else {
            "after the last step".into()
        });
    }

    fn iterating(&mut self, iteration: &Iterating<'_>) {
        let Iterating { step, t, newton, .. } = iteration;
        let linear = match newton.linear_solves.last() {
            Some(last) => format!(", linear solver {} iterations to {:.0e}", last.iterations, last.residual),
            None => String::new(),
        };
        let residual = newton.relative.last().copied().unwrap_or(0.0);
        let text = format!(
            "step {step}/{} to t = {t:.4}: iteration {}, residual {residual:.1e}{linear}",
            self.count, newton.iterations
        );
        if let Some(bar) = &self.bar {
            set_style(bar, "{bar:32} {elapsed} {msg}");
            bar.set_position(lock(&self.position).iterated(newton.iterations));
            bar.set_message(format!("({text})"));
        }
        self.heartbeat.update(text);
    }

    fn failed(&mut self, cut: &Cut) {
        self.message(&format!("step {}/{} to t = {:.4} failed: {}", cut.step, self.count, cut.t, cut.reason));
        self.heartbeat.begin(format!(
            "step {}/{}, repeated in shorter increments: before its first iteration",
            cut.step, self.count
        ));
    }

    fn saved(&mut self, step: usize) {
        self.saved_steps.store(step, Ordering::Relaxed);
    }

    fn is_interrupted(&self) -> bool {
        self.is_interrupted.load(Ordering::Relaxed)
    }
}

/// Returns a part in percent. Only none is 0 %, only all is 100 %.
fn share(part: u64, of: u64) -> String {
    match 100.0 * part as f64 / of.max(1) as f64 {
        percent if percent > 0.0 && percent < 1.0 => "less than 1 %".into(),
        percent => format!("{:.0} %", percent.floor()),
    }
}

fn set_style(bar: &ProgressBar, template: &str) {
    if let Ok(style) = ProgressStyle::with_template(template) {
        bar.set_style(style);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_all_is_a_hundred_percent() {
        assert_eq!(
            [(0, 0), (0, 9), (1, 900), (9, 900), (899, 900), (900, 900)].map(|(part, of)| share(part, of)),
            ["0 %", "0 %", "less than 1 %", "1 %", "99 %", "100 %"]
        );
    }

    #[test]
    fn the_bar_moves_within_a_step_and_never_back() {
        let mut position = Position::new(2);
        assert_eq!(position.within(0.0), 2000);
        assert_eq!([position.within(0.5), position.iterated(1), position.within(0.5)], [2100, 2200, 2300]);
        // Repeated in shorter increments.
        assert_eq!([position.iterated(1), position.iterated(9)], [2300, 2950]);
        assert_eq!(position.converged(2.5, 9), 2950, "half of the step");
        assert_eq!([position.converged(3.0, 5), position.within(0.8), position.iterated(7)], [3000, 3100, 3875]);
    }
}
