//! Decisions and sums over the ranks that hold parts of a system, with the same outcome on all of them.
//!
//! Sums gather the values of all ranks and add them in the order of the ranks, so that all ranks get the same bits, in
//! every run. Without parts ([`Distribution::Copies`](super::Distribution::Copies)) all ranks have the same values, and
//! nothing is done.

use super::context::Context;
use super::error::PetscError;
use super::ffi;
use super::rows::Parts;
use crate::las::Sparsity;

impl Parts {
    /// Replaces each value by its sum over the ranks. All ranks pass the same number of values.
    pub(super) fn sum(&self, values: &mut [f64]) {
        self.reduce(values, |sum, value| sum + value);
    }

    /// Replaces each value by its maximum over the ranks: NaN if any of them is.
    pub(super) fn max(&self, values: &mut [f64]) {
        self.reduce(values, |largest, value| if value.is_nan() || value > largest { value } else { largest });
    }

    fn reduce(&self, values: &mut [f64], combine: impl Fn(f64, f64) -> f64) {
        let (all, count) = (self.comm().all_gather(values), values.len());
        for (k, value) in values.iter_mut().enumerate() {
            let of_ranks = all[k..].iter().step_by(count).copied();
            *value = of_ranks.reduce(&combine).unwrap_or(*value);
        }
    }
}

impl Context {
    /// Returns the number of rows of all ranks of a system with this pattern on this rank.
    pub(super) fn unknowns(&self, pattern: &Sparsity) -> usize {
        self.rows().map_or(pattern.rows(), |rows| rows.total)
    }

    /// Returns the global row of the first entry of a vector on this rank.
    pub(super) fn first_row(&self) -> usize {
        self.rows().map_or(0, |rows| rows.own.start)
    }

    /// Returns the sum of a value over the parts.
    pub(super) fn sum_of_parts(&self, value: f64) -> f64 {
        let mut values = [value];
        if let Some(parts) = self.parts() {
            parts.sum(&mut values);
        }
        values[0]
    }

    /// Returns the largest of the codes of all parts.
    pub(super) fn largest_code(&self, code: i32) -> i32 {
        self.parts()
            .map_or(code, |parts| parts.comm().all_gather(&[i64::from(code)]).into_iter().max().unwrap_or(0) as i32)
    }

    /// Returns true if a statement holds for all parts.
    pub(super) fn holds_for_all(&self, statement: bool) -> bool {
        self.parts().map_or(statement, |parts| parts.comm().all_gather(&[u8::from(statement)]).iter().all(|&x| x == 1))
    }

    /// Returns the smallest global row that any part names by the position of its entry on its rank.
    pub(super) fn first_of_parts(&self, position: Option<usize>) -> Option<usize> {
        let Some(parts) = self.parts() else { return position };
        let row = position.map_or(u64::MAX, |position| (self.first_row() + position) as u64);
        let least = parts.comm().all_gather(&[row]).into_iter().min();
        least.filter(|&row| row != u64::MAX).map(|row| row as usize)
    }

    /// Returns the first of the smallest values of a vector and its global row; `None` if the vector is empty.
    pub(super) fn smallest(&self, values: &[f64]) -> Option<(usize, f64)> {
        let found = values.iter().copied().enumerate().min_by(|a, b| a.1.total_cmp(&b.1));
        self.candidates(found).into_iter().min_by(|a, b| a.1.total_cmp(&b.1))
    }

    /// Returns the last of the values of largest magnitude of a vector and its global row; `None` if the vector is
    /// empty.
    pub(super) fn largest_magnitude(&self, values: &[f64]) -> Option<(usize, f64)> {
        let found = values.iter().map(|value| value.abs()).enumerate().max_by(|a, b| a.1.total_cmp(&b.1));
        self.candidates(found).into_iter().max_by(|a, b| a.1.total_cmp(&b.1))
    }

    /// Returns the findings of all parts, with global rows.
    fn candidates(&self, found: Option<(usize, f64)>) -> Vec<(usize, f64)> {
        let Some(parts) = self.parts() else { return found.into_iter().collect() };
        // Numbers of rows are exact in double precision.
        let own = found.map_or([-1.0, 0.0], |(position, value)| [(self.first_row() + position) as f64, value]);
        let all = parts.comm().all_gather(&own);
        all.as_chunks::<2>()
            .0
            .iter()
            .filter(|[row, _]| *row >= 0.0)
            .map(|&[row, value]| (row as usize, value))
            .collect()
    }

    /// Returns an outcome that is an error on all ranks if it is one on any of them; collective with parts. Without it,
    /// a rank with an error would leave the others waiting in the next collective call.
    pub(super) fn agree<T, E: From<PetscError>>(&self, outcome: Result<T, E>) -> Result<T, E> {
        let Some(parts) = self.parts() else { return outcome };
        let failed = parts.comm().all_gather(&[u8::from(outcome.is_err())]).iter().position(|&failed| failed == 1);
        match (outcome, failed) {
            (Ok(_), Some(rank)) => {
                let text = format!("rank {rank} reports an error in this collective call");
                Err(PetscError::found(ffi::ERR_ARG_WRONG, "", text).into())
            }
            (outcome, _) => outcome,
        }
    }
}
