//! Numbers on the command line. Options that take one allow a minus, so that a number out of range is told as that and
//! not as an unknown option.

/// A whole number from 0 on.
pub fn count(text: &str) -> Result<usize, String> {
    text.trim().parse().map_err(|_| "expected a whole number from 0 on, as in 20".to_owned())
}

/// Any number.
pub fn real(text: &str) -> Result<f64, String> {
    text.trim().parse().map_err(|_| "expected a number, as in 0.5 or 1e-10".to_owned())
}

/// The seed of random numbers, which a sidecar in TOML must be able to hold.
pub fn seed(text: &str) -> Result<u64, String> {
    let seed = text.trim().parse().ok().filter(|seed| i64::try_from(*seed).is_ok());
    seed.ok_or_else(|| format!("expected a whole number from 0 to {}", i64::MAX))
}
