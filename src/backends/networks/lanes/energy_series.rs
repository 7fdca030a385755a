//! The energy of the exponential law as a power series of the strain, which takes a fraction of the time of the quadrature.

use super::simd::{Double, Lanes};

/// Terms of the series.
const TERMS: usize = 24;

/// The largest strain for which the series may serve.
const LARGEST: f64 = 0.5;

/// `W(e)`, the integral of `exp(B (e + e^2 / 2)) - 1` from 0 to `e`, as `e^2 (c_0 + c_1 e + ...)`.
///
/// The exponential `f` satisfies `f' = B (1 + e) f`, so that its coefficients are `a_0 = 1`, `a_1 = B` and
/// `a_(k+1) = B (a_k + a_(k-1)) / (k + 1)`; `c_k = a_(k+1) / (k + 2)`.
#[derive(Clone, Copy, Debug)]
pub(super) struct EnergySeries {
    coefficients: [f64; TERMS],
    /// The largest absolute strain at which the terms that are left out do not count; negative if there is none.
    reach: f64,
}

impl EnergySeries {
    pub fn new(b: f64) -> Self {
        // As many terms again show how much is left out.
        let mut all = [0.0; 2 * TERMS];
        let (mut last, mut next) = (1.0, b);
        for (k, coefficient) in all.iter_mut().enumerate() {
            *coefficient = next / (k + 2) as f64;
            (last, next) = (next, b * (next + last) / (k + 2) as f64);
        }
        let mut coefficients = [0.0; TERMS];
        coefficients.copy_from_slice(&all[..TERMS]);
        let serves = |reach: f64| {
            let rest = all.iter().enumerate().skip(TERMS).map(|(k, c)| c.abs() * reach.powi(k as i32)).sum::<f64>();
            // In compression the terms alternate: they must not cancel.
            rest <= 1e-17 * all[0].abs() && b.abs() * reach <= 1.0
        };
        let mut reach = LARGEST;
        while reach > 1e-6 && !serves(reach) {
            reach *= 0.9;
        }
        Self { coefficients, reach: if serves(reach) { reach } else { -1.0 } }
    }

    /// Returns where the series serves.
    #[inline(always)]
    pub fn serves<S: Double>(&self, strain: Lanes<S>) -> S::Mask {
        strain.abs().less_or_equal(Lanes::splat(strain.0, self.reach))
    }

    /// Returns `W`; the even and the odd terms are two chains of operations, which processors overlap.
    #[inline(always)]
    pub fn integral<S: Double>(&self, strain: Lanes<S>) -> Lanes<S> {
        let simd = strain.0;
        let square = strain * strain;
        let coefficient = |k: usize| Lanes::splat(simd, self.coefficients[k]);
        let (mut even, mut odd) = (coefficient(TERMS - 2), coefficient(TERMS - 1));
        for k in (0..TERMS - 2).step_by(2).rev() {
            even = even.mul_add(square, coefficient(k));
            odd = odd.mul_add(square, coefficient(k + 1));
        }
        square * odd.mul_add(strain, even)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::backends::networks::lanes::portable::Portable;
    use crate::fiber::law::{FiberLaw, Law};

    /// The series is the energy of the law, up to where it serves.
    #[test]
    fn the_series_is_the_quadrature() {
        for b in [1e-3, 0.3, 1.2, 2.0, 3.8, 20.0, 500.0] {
            let law = Law::Exponential { youngs_modulus: b, nonlinearity: b };
            let series = EnergySeries::new(b);
            assert!(series.reach >= 0.8 * (1.0 / b).min(0.5), "B = {b}: {}", series.reach);
            for share in [-1.0, -0.5, -0.1, -1e-3, 1e-3, 0.1, 0.5, 1.0] {
                let strain = share * series.reach;
                let expected = law.energy(1.0 + strain);
                let found = series.integral(Lanes::splat(Portable, (1.0 + strain) - 1.0)).numbers()[0];
                assert!((found - expected).abs() <= 4e-15 * expected, "B = {b}, {strain}: {found} {expected}");
            }
        }
    }

    #[test]
    fn beyond_its_reach_it_does_not_serve() {
        let series = EnergySeries::new(1.2);
        let strain = Lanes::of_numbers(Portable, &[0.1, -0.6, 0.6, f64::NAN, 0.0, 0.0, 0.0, 0.0]);
        let one = Lanes::splat(Portable, 1.0);
        let serves = one.where_or(series.serves(strain), Lanes::splat(Portable, 0.0)).numbers();
        assert_eq!(serves[..4], [1.0, 0.0, 0.0, 0.0]);
        let at_rest = EnergySeries::new(1e300).serves(Lanes::splat(Portable, 0.0));
        assert_eq!(
            one.where_or(at_rest, Lanes::splat(Portable, 0.0)).numbers()[0],
            0.0,
            "its coefficients are infinite"
        );
    }
}
