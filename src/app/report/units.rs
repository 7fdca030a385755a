//! Formatting numbers for readers: few digits, unit prefixes, round ticks.

/// Returns the power of ten that makes numbers up to `largest` readable, and its prefix: `(1e3, "k")` for 25 000.
pub(super) fn prefix(largest: f64) -> (f64, &'static str) {
    const PREFIXES: [(f64, &str); 8] =
        [(1e9, "G"), (1e6, "M"), (1e3, "k"), (1.0, ""), (1e-3, "m"), (1e-6, "\u{b5}"), (1e-9, "n"), (1e-12, "p")];
    let size = largest.abs();
    if size == 0.0 || !size.is_finite() {
        return (1.0, "");
    }
    PREFIXES.into_iter().find(|&(power, _)| size >= 0.9995 * power).unwrap_or((1e-12, "p"))
}

/// Formats three significant digits and the unit with its prefix: `25.3 kPa`. A number without unit gets no prefix.
pub(super) fn quantity(value: f64, unit: &str) -> String {
    if unit.is_empty() {
        return significant(value);
    }
    let (power, prefix) = prefix(value);
    format!("{}\u{a0}{prefix}{unit}", significant(value / power))
}

/// Formats three significant digits, without an exponent for magnitudes from 1e-4 to 1e6.
pub(super) fn significant(value: f64) -> String {
    let size = value.abs();
    if value == 0.0 {
        "0".into()
    } else if !value.is_finite() {
        "\u{2013}".into()
    } else if !(1e-4..1e6).contains(&size) {
        format!("{value:.2e}")
    } else {
        // The exponent after rounding: 0.9997 is 1.00.
        let scientific = format!("{size:.2e}");
        let exponent: i32 = scientific.split_once('e').and_then(|(_, exponent)| exponent.parse().ok()).unwrap_or(0);
        let decimals = (2 - exponent).clamp(0, 7) as usize;
        format!("{value:.decimals$}")
    }
}

/// Returns about `count` round ticks inside `[low, high]`, spaced by 1, 2 or 5 times a power of ten.
pub(super) fn ticks(low: f64, high: f64, count: usize) -> Vec<f64> {
    multiples(round_step((high - low) / count.max(1) as f64), low, high)
}

/// Returns the multiples of `step` inside `[low, high]`; `low` if `step` is zero.
pub(super) fn multiples(step: f64, low: f64, high: f64) -> Vec<f64> {
    if step == 0.0 || !step.is_finite() {
        return vec![low];
    }
    // First and last ticks that lie slightly outside because of rounding errors are kept.
    let (first, last) = ((low / step - 1e-9).ceil() as i64, (high / step + 1e-9).floor() as i64);
    (first..=last).map(|k| k as f64 * step).collect()
}

/// Formats a tick with as many decimals as the spacing of the ticks needs.
pub(super) fn tick_label(tick: f64, ticks: &[f64]) -> String {
    let step = match ticks {
        [first, second, ..] => second - first,
        _ => return significant(tick),
    };
    let decimals = (-(step * 1.001).log10().floor()).clamp(0.0, 9.0) as usize;
    let text = format!("{tick:.decimals$}");
    if text.trim_start_matches('-').chars().all(|letter| letter == '0' || letter == '.') {
        text.trim_start_matches('-').into()
    } else {
        text
    }
}

/// Returns the smallest of 1, 2, 5 times a power of ten that is not below `wanted`; 0 if `wanted` is not positive.
pub(super) fn round_step(wanted: f64) -> f64 {
    if wanted.is_nan() || wanted <= 0.0 {
        return 0.0;
    }
    let power = 10f64.powf(wanted.log10().floor());
    let digit = [1.0, 2.0, 5.0].into_iter().find(|digit| digit * power >= wanted * (1.0 - 1e-9));
    digit.unwrap_or(10.0) * power
}

/// Escapes a text for XML or HTML.
pub(super) fn escape(text: &str) -> String {
    let mut escaped = String::with_capacity(text.len());
    for letter in text.chars() {
        match letter {
            '&' => escaped.push_str("&amp;"),
            '<' => escaped.push_str("&lt;"),
            '>' => escaped.push_str("&gt;"),
            '"' => escaped.push_str("&quot;"),
            letter if letter.is_control() => escaped.push(' '),
            letter => escaped.push(letter),
        }
    }
    escaped
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_have_three_significant_digits() {
        assert_eq!(quantity(25_342.0, "Pa"), "25.3\u{a0}kPa");
        assert_eq!(quantity(999.7, "Pa"), "1.00\u{a0}kPa");
        assert_eq!(quantity(-0.004, "m"), "-4.00\u{a0}mm");
        assert_eq!(quantity(0.0, "N"), "0\u{a0}N");
        assert_eq!(quantity(0.251, ""), "0.251");
        assert_eq!(significant(1.0e-7), "1.00e-7");
    }

    #[test]
    fn ticks_are_round_and_inside() {
        assert_eq!(ticks(0.0, 1.0, 5).len(), 6);
        assert_eq!(ticks(-3.0, 7.0, 4), [0.0, 5.0]);
        assert_eq!(ticks(2.0, 2.0, 4), [2.0]);
        let ticks = ticks(0.0, 0.5, 5);
        assert_eq!(tick_label(ticks[2], &ticks), "0.2");
        assert_eq!(tick_label(-0.0, &ticks), "0.0");
        assert_eq!(round_step(0.03), 0.05);
        assert_eq!(round_step(9.9), 10.0);
    }

    #[test]
    fn control_and_markup_characters_are_escaped() {
        assert_eq!(escape("<a & \"b\">\n"), "&lt;a &amp; &quot;b&quot;&gt; ");
    }
}
