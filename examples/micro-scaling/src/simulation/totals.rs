//! The time of a run by what it is spent on.

/// The sums over the sweeps of a run, in seconds.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Totals {
    /// Number of sweeps.
    pub sweeps: usize,
    /// RVEs on the slowest rank.
    pub longest: f64,
    /// RVEs on the fastest rank.
    pub least: f64,
    /// RVEs per core, if all cores had the same share.
    pub mean: f64,
    /// The larger of the mean and the longest RVE: no distribution takes less.
    pub bound: f64,
    /// Messages between the scales.
    pub exchange: f64,
    /// The macro scale.
    pub solution: f64,
    /// Load balancing: learning from the costs of the sweeps.
    pub observing: f64,
    /// Load balancing: loads of all ranks, plans, and estimates of their gain.
    pub planning: f64,
    /// Load balancing: migrations and updates of the coupling.
    pub synchronizing: f64,
    /// Number of plans.
    pub plans: usize,
    /// Number of migrations.
    pub migrations: usize,
    /// RVEs that moved.
    pub moved: usize,
}

/// What the time of an iteration is spent on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Part {
    /// The mean of the RVEs per core.
    Rves,
    /// The largest RVE, as far as it takes longer than the mean.
    LargestRve,
    /// The slowest rank, as far as it takes longer than the best distribution.
    Imbalance,
    /// Messages between the scales.
    Exchange,
    /// The macro scale.
    MacroScale,
    /// Load balancing.
    Balancing,
}

impl Part {
    /// Its name in tables.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Rves => "RVEs",
            Self::LargestRve => "largest RVE",
            Self::Imbalance => "imbalance",
            Self::Exchange => "exchange",
            Self::MacroScale => "macro scale",
            Self::Balancing => "balancing",
        }
    }
}

impl Totals {
    /// Adds a sweep: the seconds of each rank, the mean per core, and the longest RVE.
    pub fn add_sweep(&mut self, busy: &[f64], mean: f64, largest: f64) {
        self.sweeps += 1;
        self.longest += busy.iter().copied().fold(0.0, f64::max);
        self.least += busy.iter().copied().fold(f64::INFINITY, f64::min);
        self.mean += mean;
        self.bound += mean.max(largest);
    }

    /// Returns the seconds of load balancing.
    pub fn balancing(&self) -> f64 {
        self.observing + self.planning + self.synchronizing
    }

    /// Returns the seconds of an iteration.
    pub fn iteration(&self) -> f64 {
        (self.longest + self.exchange + self.solution + self.balancing()) / self.sweeps as f64
    }

    /// Returns the fraction of the time of the RVEs in which at least one rank is idle.
    pub fn idle_any(&self) -> f64 {
        1.0 - self.least / self.longest
    }

    /// Returns the mean fraction of the time of the RVEs in which a core is idle.
    pub fn idle_mean(&self) -> f64 {
        1.0 - self.mean / self.longest
    }

    /// Returns the time of the RVEs over their mean.
    pub fn max_over_mean(&self) -> f64 {
        self.longest / self.mean
    }

    /// Returns the parts of an iteration and their seconds, which add up to [`iteration`](Self::iteration).
    pub fn parts(&self) -> [(Part, f64); 6] {
        let parts = [
            (Part::Rves, self.mean),
            (Part::LargestRve, self.bound - self.mean),
            (Part::Imbalance, self.longest - self.bound),
            (Part::Exchange, self.exchange),
            (Part::MacroScale, self.solution),
            (Part::Balancing, self.balancing()),
        ];
        parts.map(|(part, seconds)| (part, seconds / self.sweeps as f64))
    }

    /// Returns the largest part except the RVEs themselves.
    pub fn largest_loss(&self) -> Part {
        let [_, losses @ ..] = self.parts();
        losses.into_iter().max_by(|a, b| a.1.total_cmp(&b.1)).map_or(Part::Rves, |(part, _)| part)
    }
}
