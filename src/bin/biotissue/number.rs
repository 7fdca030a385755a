//! Numbers on the command line. Options with a number accept a leading minus sign, so that a number out of range is
//! reported as such and not as an unknown option.

/// Parses a nonnegative integer.
pub fn count(text: &str) -> Result<usize, String> {
    text.trim().parse().map_err(|_| "expected a whole number from 0 on, as in 20".to_owned())
}

/// Parses a floating-point number.
pub fn real(text: &str) -> Result<f64, String> {
    text.trim().parse().map_err(|_| "expected a number, as in 0.5 or 1e-10".to_owned())
}

/// Parses a seed of random numbers; it must fit into a TOML integer of the sidecar.
pub fn seed(text: &str) -> Result<u64, String> {
    let seed = text.trim().parse().ok().filter(|seed| i64::try_from(*seed).is_ok());
    seed.ok_or_else(|| format!("expected a whole number from 0 to {}", i64::MAX))
}
