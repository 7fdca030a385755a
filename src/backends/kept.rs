//! How long the preconditioner of an earlier matrix serves.

use crate::las::{Factorization, SolveReport};

/// A kept preconditioner is computed again if the number of iterations per decimal digit exceeds that of the matrix it
/// was computed from by this factor.
const SLOWER: f64 = 1.5;

/// How well a preconditioner serves, by the number of iterations of the solves with it.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct KeptPreconditioner {
    /// Whether it is that of an earlier matrix.
    is_kept: bool,
    /// Number of iterations per decimal digit with the matrix it was computed from, the most so far.
    rate: f64,
    /// Whether the last solve since it was kept took too many iterations.
    is_slow: bool,
}

impl KeptPreconditioner {
    /// Keeps the preconditioner for another matrix. Returns false if it has to be computed again.
    pub(super) fn keep(&mut self) -> bool {
        self.is_kept = true;
        !self.is_slow
    }

    /// Returns true if the preconditioner is that of an earlier matrix.
    pub(super) fn is_kept(self) -> bool {
        self.is_kept
    }

    /// The kind of factorization that reports name.
    pub(super) fn kind(self) -> Factorization {
        if self.is_kept { Factorization::Kept } else { Factorization::Approximate }
    }

    /// Compares the number of iterations of a solve with that for the matrix of the preconditioner.
    pub(super) fn judge(&mut self, report: &SolveReport) {
        let digits = -report.residual.log10();
        // Fewer than two digits say little about the rate.
        if !(digits.is_finite() && digits >= 2.0) {
            return;
        }
        let rate = report.iterations as f64 / digits;
        if self.is_kept {
            self.is_slow = self.rate > 0.0 && rate > SLOWER * self.rate;
        } else {
            self.rate = self.rate.max(rate);
        }
    }
}
