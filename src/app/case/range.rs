//! The admissible range of a number, and its description in messages.

/// A range of finite numbers with its unit.
#[derive(Clone, Copy, Debug)]
pub(super) struct Range {
    low: Option<f64>,
    low_belongs: bool,
    high: Option<f64>,
    high_belongs: bool,
    unit: &'static str,
}

impl Range {
    /// Every finite number.
    pub(super) const fn any(unit: &'static str) -> Self {
        Self { low: None, low_belongs: false, high: None, high_belongs: false, unit }
    }

    /// Every finite number above `low`.
    pub(super) const fn above(low: f64, unit: &'static str) -> Self {
        Self { low: Some(low), ..Self::any(unit) }
    }

    /// Every finite number from `low`.
    pub(super) const fn at_least(low: f64, unit: &'static str) -> Self {
        Self { low_belongs: true, ..Self::above(low, unit) }
    }

    /// Every number between `low` and `high`, both excluded.
    pub(super) const fn between(low: f64, high: f64) -> Self {
        Self { high: Some(high), ..Self::above(low, "") }
    }

    /// Every number from `low` to `high`, both included.
    pub(super) const fn from_to(low: f64, high: f64) -> Self {
        Self { low_belongs: true, high_belongs: true, ..Self::between(low, high) }
    }

    pub(super) fn contains(&self, value: f64) -> bool {
        value.is_finite()
            && self.low.is_none_or(|low| value > low || self.low_belongs && value == low)
            && self.high.is_none_or(|high| value < high || self.high_belongs && value == high)
    }

    /// Describes the range, such as ` above 0 and below 1, in Pa`, to follow "a number" or "three numbers".
    pub(super) fn describe(&self) -> String {
        let mut text = String::new();
        if let Some(low) = self.low {
            text += &format!(" {} {low}", if self.low_belongs { "from" } else { "above" });
        }
        if let Some(high) = self.high {
            let join = if self.low.is_none() || self.high_belongs { "" } else { " and" };
            text += &format!("{join} {} {high}", if self.high_belongs { "to" } else { "below" });
        }
        if !self.unit.is_empty() {
            text += if text.is_empty() { " in " } else { ", in " };
            text += self.unit;
        }
        text
    }
}
