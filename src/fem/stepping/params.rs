//! Parameters and reports of load stepping.

use super::IncrementControl;
use crate::fem::equilibrium::LinearizedStart;
use crate::las::{NewtonParams, NewtonReport, NewtonSeconds, SolveReport, SolverParams};

/// Parameters of load stepping.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StepParams {
    /// Number of steps; step `k` ends at `t = k / count`. Default 10.
    pub count: usize,
    /// Maximum number of halvings of a failed step, at most [`StepParams::MAX_CUTS`]. Default 6.
    pub max_cuts: u32,
    /// How the lengths of increments are chosen. Default [`IncrementControl::Halving`].
    pub increments: IncrementControl,
    /// Maximum number of times that equilibrium may be restored at the same pseudo-time after points changed their
    /// material; beyond it, the attempt fails. Default 200.
    pub max_evolutions: usize,
    /// Maximum number of augmentations of the pressures of penalty constraints per attempt. Default 50.
    pub max_augmentations: usize,
    /// Initial guess of Newton in all steps except the first. Default [`StepStart::Tangent`].
    pub start: StepStart,
    /// Stopping criteria of Newton. Default: a tolerance of `1e-8`, 25 iterations, up to 10 reductions of the step
    /// length in the line search. An iterative solver keeps its preconditioner within an attempt at an increment; one
    /// that is chosen by size uses the default forcing terms if none are given.
    pub newton: NewtonParams,
    /// Solver of the linear systems; its symmetry is that of the elements. Default `None`: the one that
    /// [`SolverChoice`](crate::las::SolverChoice) chooses, for definite elements.
    pub solver: Option<SolverParams>,
}

impl StepParams {
    /// The maximum number of halvings, which determines the smallest increment.
    pub const MAX_CUTS: u32 = 40;
}

impl Default for StepParams {
    fn default() -> Self {
        let newton =
            NewtonParams { tolerance: 1e-8, max_iterations: 25, keep_preconditioner: true, ..NewtonParams::default() };
        Self {
            count: 10,
            max_cuts: 6,
            increments: IncrementControl::default(),
            max_evolutions: 200,
            max_augmentations: 50,
            start: StepStart::default(),
            newton,
            solver: None,
        }
    }
}

/// The initial guess of Newton in a step. The first step of a run always starts from the linear-elastic solution of the
/// undeformed body. If the chosen start fails, because the tangent is singular or the moved boundary inverts elements,
/// the other one is tried before the increment is cut.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum StepStart {
    /// The committed state with only the prescribed components moved.
    Prescribed,
    /// The linearization of the committed state: its tangent distributes the increment of loads and prescribed
    /// displacements over the body, at the cost of one more factorization.
    #[default]
    Tangent,
}

/// Cost of one step.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct StepReport {
    /// The step, from 1.
    pub step: usize,
    /// Pseudo-time at the end of the step.
    pub t: f64,
    /// Number of converged increments.
    pub increments: usize,
    /// Number of halvings of the increment.
    pub cuts: usize,
    /// Newton reports of the converged substeps, in order: one per substep, and one more for every time that
    /// equilibrium was restored.
    pub solves: Vec<NewtonReport>,
    /// Number of rounds in which points changed their material, including failed attempts.
    pub evolutions: usize,
    /// Number of rounds in which responses that did not continue the committed state were replaced, including
    /// failed attempts.
    pub verification_rounds: usize,
    /// Number of augmentations of the pressures of penalty constraints, including failed attempts.
    pub augmentations: usize,
    /// Newton reports of the failed attempts, in order.
    pub failures: Vec<NewtonReport>,
    /// Number of linearized starts, each with one factorization and one solve.
    pub linearized: usize,
    /// Time of the linearized starts by phase.
    pub linearized_seconds: NewtonSeconds,
    /// The solutions of the linear systems of linearized starts by an iterative solver.
    pub linearized_solves: Vec<SolveReport>,
}

impl StepReport {
    /// Returns the number of Newton iterations of the converged substeps.
    pub fn iterations(&self) -> usize {
        self.solves.iter().map(|report| report.iterations).sum()
    }

    /// Returns the number of Newton iterations of failed attempts.
    pub fn wasted_iterations(&self) -> usize {
        self.failures.iter().map(|report| report.iterations).sum()
    }

    /// Returns the final residual relative to its scale; `None` before a substep has converged.
    pub fn relative_residual(&self) -> Option<f64> {
        self.solves.last()?.relative.last().copied()
    }

    /// Returns the seconds by phase, for converged and failed attempts and linearized starts together.
    pub fn seconds(&self) -> NewtonSeconds {
        let attempts = self.solves.iter().chain(&self.failures).map(|report| report.seconds);
        attempts.fold(self.linearized_seconds, add)
    }

    /// Returns the number of systems that the iterative solver did not solve and a direct one did, for converged and
    /// failed attempts and linearized starts together.
    pub fn fallbacks(&self) -> usize {
        let attempts = self.solves.iter().chain(&self.failures).map(|report| report.fallbacks);
        attempts.chain(self.linearized_solves.iter().map(|solve| solve.fallbacks)).sum()
    }

    pub(super) fn add_linearized(&mut self, start: &LinearizedStart) {
        self.linearized += 1;
        self.linearized_seconds = add(self.linearized_seconds, start.seconds);
        if start.solve != SolveReport::DIRECT {
            self.linearized_solves.push(start.solve);
        }
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
