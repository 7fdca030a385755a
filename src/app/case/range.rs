//! The admissible range of a number, and its description in messages.

use std::ops::Bound::{self, Excluded, Included, Unbounded};
use std::ops::RangeBounds;

/// A range of finite numbers with its unit.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Range {
    low: Bound<f64>,
    high: Bound<f64>,
    unit: &'static str,
}

impl Range {
    /// Every finite number.
    pub(super) const fn any(unit: &'static str) -> Self {
        Self { low: Unbounded, high: Unbounded, unit }
    }

    /// Every finite number above `low`.
    pub(super) const fn above(low: f64, unit: &'static str) -> Self {
        Self { low: Excluded(low), high: Unbounded, unit }
    }

    /// Every finite number from `low`.
    pub(super) const fn at_least(low: f64, unit: &'static str) -> Self {
        Self { low: Included(low), high: Unbounded, unit }
    }

    /// Every number between `low` and `high`, both excluded.
    pub(super) const fn between(low: f64, high: f64) -> Self {
        Self { low: Excluded(low), high: Excluded(high), unit: "" }
    }

    /// Every number above `low` up to `high`, which is included.
    pub(super) const fn above_to(low: f64, high: f64) -> Self {
        Self { low: Excluded(low), high: Included(high), unit: "" }
    }

    /// Every number from `low` to `high`, both included.
    pub(super) const fn from_to(low: f64, high: f64) -> Self {
        Self { low: Included(low), high: Included(high), unit: "" }
    }

    fn is_above(&self) -> bool {
        matches!(self.low, Excluded(_))
    }

    pub(crate) fn contains(&self, value: f64) -> bool {
        value.is_finite() && (self.low, self.high).contains(&value)
    }

    /// Describes the range, such as ` above 0 and below 1, in Pa`, to follow "a number" or "three numbers".
    pub(crate) fn describe(&self) -> String {
        let mut text = match self.low {
            Included(low) if self.high == Unbounded => format!(" of at least {low}"),
            Included(low) => format!(" from {low}"),
            Excluded(low) => format!(" above {low}"),
            Unbounded => String::new(),
        };
        match self.high {
            Included(high) if self.is_above() => text += &format!(" and at most {high}"),
            Included(high) => text += &format!(" to {high}"),
            Excluded(high) => text += &format!(" and below {high}"),
            Unbounded => {}
        }
        if !self.unit.is_empty() {
            text += if text.is_empty() { " in " } else { ", in " };
            text += self.unit;
        }
        text
    }
}
