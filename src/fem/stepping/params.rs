//! How a run is to step, and what it reports.

use crate::las::{NewtonParams, NewtonReport, NewtonSeconds, SolverParams};

/// How a run steps through pseudo-time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StepParams {
    /// How many steps; step `k` ends at `t = k / count`. Default 10.
    pub count: usize,
    /// How often a step that fails may be halved, at most [`StepParams::MAX_CUTS`]. Default 6.
    pub max_cuts: u32,
    /// How often the body may be brought to balance again at the same pseudo-time, because the material of points
    /// changed; beyond, the attempt fails. Default 200.
    pub max_rounds: usize,
    /// Where a later step starts. Default [`StepStart::Held`].
    pub start: StepStart,
    /// When Newton stops. Default: a tolerance of `1e-8`, 25 iterations, up to 10 shortenings of a step.
    pub newton: NewtonParams,
    /// How the linear systems are solved. Default: directly, as definite ones.
    pub solver: SolverParams,
}

impl StepParams {
    /// The smallest increment is this many halvings of a step.
    pub const MAX_CUTS: u32 = 40;
}

impl Default for StepParams {
    fn default() -> Self {
        let newton = NewtonParams { tolerance: 1e-8, max_iterations: 25, ..NewtonParams::default() };
        Self {
            count: 10,
            max_cuts: 6,
            max_rounds: 200,
            start: StepStart::default(),
            newton,
            solver: SolverParams::default(),
        }
    }
}

/// Where Newton starts in a step. The first step of a run always starts from the linear-elastic solution of the
/// undeformed body.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum StepStart {
    /// The last state with only the prescribed components moved.
    #[default]
    Held,
    /// The last state linearized: the increment of loads and prescribed components goes through its tangent. Costs one
    /// factorization more and spreads a moved boundary over the body.
    Tangent,
}

/// What one step cost.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct StepReport {
    /// The step, from 1.
    pub step: usize,
    /// Where it ends.
    pub t: f64,
    /// How often it was halved, counted once a halving.
    pub cuts: usize,
    /// Newton in the sub-steps that converged, in order: one where the step was not cut, and one more for every time the
    /// body was brought to balance again.
    pub substeps: Vec<NewtonReport>,
    /// How often points changed their material, failed attempts included.
    pub rounds: usize,
    /// How often responses that did not continue the last accepted state were replaced, failed attempts included.
    pub replaced: usize,
    /// Newton in the attempts that failed, in order.
    pub failures: Vec<NewtonReport>,
    /// Linearized starts: a factorization and a solve each.
    pub linearized: usize,
    /// Where the time of the linearized starts went.
    pub linearized_seconds: NewtonSeconds,
}

impl StepReport {
    /// Newton iterations of the sub-steps that converged.
    #[must_use]
    pub fn iterations(&self) -> usize {
        self.substeps.iter().map(|report| report.iterations).sum()
    }

    /// Newton iterations of failed attempts.
    #[must_use]
    pub fn wasted_iterations(&self) -> usize {
        self.failures.iter().map(|report| report.iterations).sum()
    }

    /// The residual at the end over what it is measured against; `None` before a sub-step has converged.
    #[must_use]
    pub fn relative_residual(&self) -> Option<f64> {
        self.substeps.last()?.relative.last().copied()
    }

    /// Seconds by phase, of converged and failed attempts and linearized starts together.
    #[must_use]
    pub fn seconds(&self) -> NewtonSeconds {
        let attempts = self.substeps.iter().chain(&self.failures).map(|report| report.seconds);
        attempts.fold(self.linearized_seconds, add)
    }

    pub(super) fn add_linearized(&mut self, seconds: NewtonSeconds) {
        self.linearized += 1;
        self.linearized_seconds = add(self.linearized_seconds, seconds);
    }
}

fn add(a: NewtonSeconds, b: NewtonSeconds) -> NewtonSeconds {
    NewtonSeconds {
        residual: a.residual + b.residual,
        jacobian: a.jacobian + b.jacobian,
        factor: a.factor + b.factor,
        solve: a.solve + b.solve,
    }
}
