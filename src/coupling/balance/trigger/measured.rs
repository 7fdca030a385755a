//! What a trigger learns during a run: what plans, migrations and exchanges cost, and what plans achieve.

/// The weight of former measurements relative to the next one.
const FORGETTING: f64 = 0.5;

/// As `FORGETTING`, for quantities that compare two sweeps: one comparison says little if costs are random.
const MEMORY: f64 = 0.8;

/// How the seconds of the exchange with other scales depend on the number of ranks that the busiest of their ranks
/// exchanges with: in proportion, until a migration shows how much of the exchange the messages are.
#[derive(Clone, Debug, Default)]
pub(super) struct ExchangeGrowth {
    /// Seconds of the exchange, a mean that forgets, since the last migration.
    seconds: Option<f64>,
    /// By how many the neighbors have become more since the last exchange.
    more_neighbors: f64,
    /// Squares of the numbers by which former migrations changed the neighbors, and products with the changes of the
    /// seconds: sums that forget.
    squares: f64,
    products: f64,
}

impl ExchangeGrowth {
    /// Records a migration that gave the busiest rank of another scale `more` neighbors.
    pub fn changed(&mut self, more: f64) {
        self.more_neighbors += more;
    }

    /// Records the seconds of an exchange.
    pub fn observe(&mut self, seconds: f64) {
        let more = std::mem::take(&mut self.more_neighbors);
        // A migration before the first exchange shows nothing.
        let Some(before) = self.seconds else {
            self.seconds = Some(seconds);
            return;
        };
        if more == 0.0 {
            self.seconds = Some(FORGETTING * before + (1.0 - FORGETTING) * seconds);
            return;
        }
        self.squares = MEMORY * self.squares + more * more;
        self.products = MEMORY * self.products + more * (seconds - before);
        self.seconds = Some(seconds);
    }

    /// By how many seconds the exchange becomes longer with `more` neighbors.
    pub fn growth(&self, neighbors: f64, more: f64) -> f64 {
        let per_neighbor = match self.seconds {
            _ if self.squares > 0.0 => (self.products / self.squares).max(0.0),
            Some(seconds) if neighbors > 0.0 => seconds / neighbors,
            _ => 0.0,
        };
        per_neighbor * more.max(0.0)
    }
}

/// The savings that former plans promised, and those that they achieved, as fractions of the largest load: sums that
/// forget.
#[derive(Clone, Debug, Default)]
pub(super) struct Savings {
    promised: f64,
    achieved: f64,
}

impl Savings {
    /// Records a plan that was compared.
    pub fn measure(&mut self, promised: f64, achieved: f64) {
        if self.promised == 0.0 {
            // Before the first comparison, plans are expected to achieve what they promise.
            (self.promised, self.achieved) = (promised, promised);
        }
        self.promised = MEMORY * self.promised + promised;
        self.achieved = MEMORY * self.achieved + achieved;
    }

    /// The fraction of the promised savings that was achieved, from -1 to 1.
    pub fn achieved(&self) -> f64 {
        if self.promised > 0.0 { (self.achieved / self.promised).clamp(-1.0, 1.0) } else { 1.0 }
    }
}

/// What planning costs, and what it is worth.
#[derive(Clone, Debug)]
pub(super) struct Planning {
    /// Seconds, a mean that forgets; zero until a plan is measured.
    seconds: f64,
    /// The fraction of the largest possible savings by which former plans were better than none.
    worth: f64,
    /// The largest possible saving of the next plan, s.
    possible: f64,
}

impl Default for Planning {
    fn default() -> Self {
        Self { seconds: 0.0, worth: 1.0, possible: 0.0 }
    }
}

impl Planning {
    /// Returns true if a plan that may save up to `possible` seconds is expected to save what it costs to make.
    pub fn pays(&mut self, possible: f64) -> bool {
        self.possible = possible;
        let pays = self.worth * possible >= self.seconds;
        if !pays {
            self.worth = (1.1 * self.worth).min(1.0);
        }
        pays
    }

    /// Records the seconds of a plan, and by how many it is expected to shorten the run.
    pub fn measure(&mut self, seconds: f64, saved: f64) {
        /// A plan always pays if it takes less than this part of the largest possible saving.
        const LEAST: f64 = 1e-3;
        let former = if self.seconds > 0.0 { self.seconds } else { seconds };
        self.seconds = FORGETTING * former + (1.0 - FORGETTING) * seconds;
        let worth = if self.possible > 0.0 { (saved / self.possible).clamp(0.0, 1.0) } else { 0.0 };
        self.worth = (FORGETTING * self.worth + (1.0 - FORGETTING) * worth).max(LEAST);
    }
}

/// Seconds per migration and per byte: the line of least squares through the measurements and two points of the first
/// estimate.
#[derive(Clone, Debug)]
pub(super) struct MigrationCost {
    /// Weighted sums of 1, bytes, squared bytes, seconds, and bytes times seconds.
    sums: [f64; 5],
}

impl MigrationCost {
    pub fn new(per_migration: f64, per_byte: f64) -> Self {
        /// The size for which the first estimate is as certain as for no bytes.
        const BYTES: f64 = 1e6;
        let mut cost = Self { sums: [0.0; 5] };
        cost.add(0.0, per_migration);
        cost.add(BYTES, per_migration + per_byte * BYTES);
        cost
    }

    fn add(&mut self, bytes: f64, seconds: f64) {
        let terms = [1.0, bytes, bytes * bytes, seconds, bytes * seconds];
        self.sums.iter_mut().zip(terms).for_each(|(sum, term)| *sum += term);
    }

    /// Records a migration.
    pub fn measure(&mut self, bytes: u64, seconds: f64) {
        self.sums.iter_mut().for_each(|sum| *sum *= FORGETTING);
        self.add(bytes as f64, seconds);
    }

    /// Returns the seconds that a migration of so many bytes is expected to take.
    pub fn seconds(&self, bytes: u64) -> f64 {
        let [count, x, xx, y, xy] = self.sums;
        let spread = count * xx - x * x;
        let per_byte = if spread > 1e-9 * count * xx { ((count * xy - x * y) / spread).max(0.0) } else { 0.0 };
        let per_migration = (y - per_byte * x) / count;
        if per_migration < 0.0 { xy / xx * bytes as f64 } else { per_migration + per_byte * bytes as f64 }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn seconds_per_byte_are_measured() {
        let mut cost = MigrationCost::new(0.01, 2e-9);
        assert!((cost.seconds(1_000_000_000) - 2.01).abs() < 1e-6);
        for bytes in [1_000_000, 5_000_000, 2_000_000, 9_000_000, 3_000_000, 7_000_000, 4_000_000, 1_000_000_u64] {
            cost.measure(bytes, 0.5 + 1e-7 * bytes as f64);
        }
        assert!((cost.seconds(6_000_000) - 1.1).abs() < 0.05, "{}", cost.seconds(6_000_000));
        let mut falling = MigrationCost::new(0.0, 0.0);
        (0..40).for_each(|k| falling.measure(1000 * (1 + k % 2), (2 - k % 2) as f64));
        assert!((1.0..=2.0).contains(&falling.seconds(10_000)), "never less for more bytes");
    }
}
