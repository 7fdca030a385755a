//! What is simulated: bodies, ranks and schemes.

use biotissue::coupling::balance::BalanceError;

use crate::machine::{Machine, MacroModel};
use crate::mirror::LocalSeconds;
use crate::recording::Recording;
use crate::replicas::{Layout, Perturbation, Replicas};
use crate::simulation::{Case, Scheme, Totals, simulate};

/// What all runs have in common.
#[derive(Clone, Debug)]
pub struct Study<'a> {
    pub recording: &'a Recording,
    pub layout: Layout,
    pub perturbation: Perturbation,
    pub factor: f64,
    pub sweeps: usize,
    pub machine: Machine,
    pub macro_model: MacroModel,
    pub state_bytes: u64,
    pub schemes: Vec<Scheme>,
    /// Micro ranks per macro rank.
    pub ratio: usize,
    /// Bodies with more RVEs are left out.
    pub max_rves: usize,
}

/// The ranks of a run.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Ranks {
    /// Micro ranks.
    pub micro: usize,
    /// Threads of each micro rank.
    pub threads: usize,
    /// Macro ranks.
    pub macro_ranks: usize,
}

/// A simulated run.
#[derive(Clone, Copy, Debug)]
pub struct Row {
    pub rves: usize,
    pub ranks: Ranks,
    pub scheme: Scheme,
    pub totals: Totals,
}

impl Row {
    /// Returns the number of cores of the micro scale.
    pub fn cores(&self) -> usize {
        self.ranks.micro * self.ranks.threads
    }

    /// Returns the speed of the work per core relative to another run, from the seconds of an iteration of both.
    pub fn efficiency(&self, first: &Self, seconds: impl Fn(&Totals) -> f64) -> f64 {
        let work_per_second = |row: &Self| row.rves as f64 / (row.cores() as f64 * seconds(&row.totals));
        work_per_second(self) / work_per_second(first)
    }
}

impl Study<'_> {
    /// Returns the ranks for so many micro ranks of one thread.
    pub fn ranks(&self, micro: usize) -> Ranks {
        Ranks { micro, threads: 1, macro_ranks: (micro / self.ratio).max(1) }
    }

    /// Simulates a body of `rves` RVEs with every scheme; nothing if it is too large.
    ///
    /// # Errors
    /// Returns [`BalanceError`] if a planner fails.
    pub fn run(&self, rves: usize, ranks: Ranks) -> Result<Vec<Row>, BalanceError> {
        if rves > self.max_rves {
            return Ok(Vec::new());
        }
        let Self { recording, layout, perturbation, factor, .. } = *self;
        let local = LocalSeconds::measure(ranks.micro, rves.div_ceil(ranks.micro), recording.networks())?;
        let case = Case {
            replicas: Replicas { recording, units: rves, layout, perturbation, factor },
            ranks: ranks.micro,
            threads: ranks.threads,
            macro_ranks: ranks.macro_ranks,
            sweeps: self.sweeps,
            machine: self.machine,
            macro_model: self.macro_model,
            state_bytes: self.state_bytes,
            local,
        };
        let row = |&scheme: &Scheme| Ok(Row { rves, ranks, scheme, totals: simulate(&case, scheme)? });
        self.schemes.iter().map(row).collect()
    }
}
