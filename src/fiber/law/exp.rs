//! Vectorized `exp(x) - 1`.

use crate::fiber::simd::{Kernel, fma, vectorized};

/// Computes `exp(x) - 1` of every element, for laws that grow exponentially. With vectors of four lanes it takes a
/// quarter of the time of `f64::exp_m1`.
///
/// The error is within 2 units in the last place, also for subnormal numbers. `exp_m1(-0.0)` is `-0.0`; the result is
/// infinity above 709.78, -1 below -37.5 and NaN for NaN.
///
/// # Panics
/// Panics if the slices differ in length.
///
/// ```
/// let mut growth = [0.0; 3];
/// biotissue::fiber::law::exp_m1(&[0.0, 1e-20, 1.0], &mut growth);
/// assert_eq!(growth[..2], [0.0, 1e-20]);
/// assert!((growth[2] - 1.0_f64.exp_m1()).abs() < 1e-15);
/// ```
pub fn exp_m1(x: &[f64], growth: &mut [f64]) {
    assert_eq!(x.len(), growth.len(), "one result per number");
    vectorized(Growth { x, growth });
}

struct Growth<'a> {
    x: &'a [f64],
    growth: &'a mut [f64],
}

impl Kernel for Growth<'_> {
    #[inline(always)]
    fn run<const FUSED: bool>(self) {
        for (growth, &x) in self.growth.iter_mut().zip(self.x) {
            *growth = exp_m1_of::<FUSED>(x);
        }
    }
}

/// `ln 2` in two parts; the last 21 bits of the first are zero, so that its product with an exponent is exact.
const LN_2: (f64, f64) = (6.931_471_803_691_238e-1, 1.908_214_929_270_587_7e-10);
/// Adding this number rounds to an integer, which the lowest bits of the sum then hold.
const ROUND: f64 = 6_755_399_441_055_744.0; // 1.5 * 2^52
/// `1/2!` to `1/14!`.
const INVERSE_FACTORIALS: [f64; 13] = {
    let (mut table, mut factorial, mut k) = ([0.0; 13], 1.0, 0);
    while k < table.len() {
        factorial *= (k + 2) as f64;
        table[k] = 1.0 / factorial;
        k += 1;
    }
    table
};

/// `exp(x) - 1` without a branch.
///
/// With `x = k ln 2 + r`, `|r| <= ln 2 / 2`, it is `2^k (exp(r) - 1) + (2^k - 1)`; `exp(r) - 1` is its Taylor series
/// with a remainder below `2^-60`. The computation uses `k - 1` and doubles the result, so that `2^1024` never occurs.
#[inline(always)]
pub(super) fn exp_m1_of<const FUSED: bool>(x: f64) -> f64 {
    // These comparisons propagate NaN.
    let bounded = if x > 710.0 { 710.0 } else { x };
    let bounded = if bounded < -50.0 { -50.0 } else { bounded };

    let shifted = fma::<FUSED>(bounded, std::f64::consts::LOG2_E, ROUND);
    let k = shifted - ROUND;
    let half_power = f64::from_bits((shifted.to_bits() << 52).wrapping_add(1022 << 52)); // 2^(k - 1)

    let high = bounded - k * LN_2.0; // exact
    let low = k * LN_2.1;
    let r = high - low;
    let lost = (high - r) - low; // rounding error of r

    let beyond_r = fma::<FUSED>(r * r, series::<FUSED>(r), lost); // exp(r) - 1 - r

    let scaled = fma::<FUSED>(half_power, r, half_power - 0.5) + half_power * beyond_r;
    let near_zero = if x.abs() < 1e-17 { x } else { r + beyond_r };
    if k == 0.0 { near_zero } else { 2.0 * scaled }
}

/// `(exp(r) - 1 - r) / r^2` to order `r^12` by Estrin's scheme: pairs, then pairs of pairs, for short dependency
/// chains.
#[inline(always)]
fn series<const FUSED: bool>(r: f64) -> f64 {
    let c = INVERSE_FACTORIALS;
    let (r2, pair) = (r * r, |k: usize| fma::<FUSED>(c[k + 1], r, c[k]));
    let r4 = r2 * r2;
    let four = |k: usize| fma::<FUSED>(pair(k + 2), r2, pair(k));
    let low = fma::<FUSED>(four(4), r4, four(0));
    let high = fma::<FUSED>(c[12], r4, four(8));
    fma::<FUSED>(high, r4 * r4, low)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::las::conformance::Random;

    fn of(x: f64) -> f64 {
        let mut growth = [0.0];
        exp_m1(&[x], &mut growth);
        growth[0]
    }

    /// Units in the last place between two numbers of one sign.
    fn ulps(a: f64, b: f64) -> u64 {
        if a == b { 0 } else { a.to_bits().abs_diff(b.to_bits()) }
    }

    /// Compares with the standard library, whose error is itself within 1 ulp.
    fn near(x: f64) {
        for found in [of(x), exp_m1_of::<false>(x)] {
            let expected = x.exp_m1();
            assert!(ulps(found, expected) <= 2, "exp_m1({x:e}) = {found:e}, not {expected:e}");
        }
    }

    #[test]
    fn exp_m1_is_within_two_ulps_over_the_whole_range() {
        for n in 0..400_000 {
            near(-40.0 + 749.7 * f64::from(n) / 4e5);
            near(-1.0 + f64::from(n) / 2e5);
        }
        for n in 0..20_000 {
            let tiny = 2.0_f64.powf(-1074.0 + f64::from(n) * 1074.0 / 2e4);
            near(tiny);
            near(-tiny);
        }
        // Near the switches between powers of two, where digits cancel.
        for k in -60..1024 {
            let switch = (f64::from(k) + 0.5) * std::f64::consts::LN_2;
            for ulp in -3..=3 {
                near(f64::from_bits(switch.to_bits().wrapping_add_signed(ulp)));
            }
        }
    }

    #[test]
    fn the_ends_of_the_range_are_exact() {
        assert_eq!(of(0.0).to_bits(), 0.0_f64.to_bits());
        assert_eq!(of(-0.0).to_bits(), (-0.0_f64).to_bits());
        for x in [-37.5, -50.0, -51.0, -800.0, -1e300, f64::NEG_INFINITY] {
            assert_eq!(of(x), -1.0, "{x}");
        }
        for x in [709.79, 710.0, 711.0, 1e300, f64::INFINITY] {
            assert_eq!(of(x), f64::INFINITY, "{x}");
        }
        assert!(of(709.78).is_finite());
        assert!(of(f64::NAN).is_nan() && exp_m1_of::<false>(f64::NAN).is_nan());
    }

    #[test]
    fn random_bits_agree_with_the_standard_library() {
        let mut random = Random::new(1);
        for _ in 0..100_000 {
            let x = f64::from_bits(random.bits());
            let (found, expected) = (of(x), x.exp_m1());
            assert!(found.is_nan() && expected.is_nan() || ulps(found, expected) <= 2, "{x:e}: {found:e}");
        }
    }

    #[test]
    fn a_result_does_not_depend_on_its_position() {
        let mut random = Random::new(2);
        for count in 1..70 {
            // The factor makes all bits of the arguments vary.
            let x: Vec<f64> = (0..count).map(|_| std::f64::consts::E * random.signed()).collect();
            let mut growth = vec![0.0; count];
            exp_m1(&x, &mut growth);
            for (&x, growth) in x.iter().zip(growth) {
                assert_eq!(of(x).to_bits(), growth.to_bits());
            }
        }
    }
}
