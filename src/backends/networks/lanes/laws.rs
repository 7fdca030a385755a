//! Fiber laws in lanes. The formulas are those of `fiber::law`, without branches that depend on a lane, except for shortcuts that change no bit; the energy of the
//! exponential law is a [series](EnergySeries) where this serves.

use super::energy_series::EnergySeries;
use super::simd::{Double, Lanes};
use crate::backends::networks::{LawData, LawFormula};

/// A law with the numbers that its evaluation needs.
#[derive(Clone, Copy, Debug)]
pub(super) struct Law {
    formula: LawFormula,
    modulus: f64,
    nonlinearity: f64,
    transition: f64,
    /// Residual stiffness, strain, and inverse of the strain.
    buckling: Option<[f64; 3]>,
    /// The modulus over the nonlinearity.
    curve: f64,
    /// The energy of the exponential law over `curve`.
    series: EnergySeries,
    pub inverse_modulus: f64,
}

impl Law {
    pub fn new(law: &LawData) -> Self {
        let [_, modulus, nonlinearity, transition, _, residual, strain, curve, inverse_modulus, inverse_strain] =
            law.numbers();
        let buckling = law.buckling.map(|_| [residual, strain, inverse_strain]);
        let series = EnergySeries::new(nonlinearity);
        Self { formula: law.formula, modulus, nonlinearity, transition, buckling, curve, series, inverse_modulus }
    }

    /// Returns the nominal stress of a fiber and its slope.
    #[inline(always)]
    pub fn stress<S: Double>(&self, stretch: Lanes<S>) -> (Lanes<S>, Lanes<S>) {
        let (stress, slope) = self.stress_in_tension(stretch);
        let Some([residual, strain, inverse_strain]) = self.buckling else { return (stress, slope) };
        let (modulus, lost) = (self.modulus, 1.0 - residual);
        let x = (1.0 - stretch) * inverse_strain;
        let inside = at_most(x, 1.0);
        let (beyond, square) = (x - inside, inside * inside);
        let buckled_slope = modulus * (1.0 - lost * square * (3.0 - 2.0 * inside));
        let buckled_stress =
            -modulus * strain * (inside * (1.0 - lost * square * (1.0 - 0.5 * inside)) + residual * beyond);
        let buckles = stretch.less(Lanes::splat(stretch.0, 1.0));
        (buckled_stress.where_or(buckles, stress), buckled_slope.where_or(buckles, slope))
    }

    #[inline(always)]
    fn stress_in_tension<S: Double>(&self, stretch: Lanes<S>) -> (Lanes<S>, Lanes<S>) {
        let &Self { modulus, nonlinearity, transition, curve, .. } = self;
        match self.formula {
            LawFormula::Linear { .. } => {
                let green = 0.5 * (stretch - 1.0) * (stretch + 1.0);
                (modulus * stretch * green, modulus * (green + stretch * stretch))
            }
            LawFormula::Exponential { .. } => {
                let growth = growth(0.5 * nonlinearity * (stretch - 1.0) * (stretch + 1.0));
                (curve * growth, modulus * stretch * (growth + 1.0))
            }
            LawFormula::ExponentialStretch { .. } => {
                let nearest = at_most(at_least(stretch, 1.0), transition);
                let growth = growth(0.5 * nonlinearity * (nearest - 1.0) * (nearest + 1.0));
                let slope = curve * growth + modulus * nearest * nearest * (growth + 1.0);
                (curve * nearest * growth + slope * (stretch - nearest), slope)
            }
        }
    }

    /// Returns the energy of a fiber per reference volume.
    #[inline(always)]
    pub fn energy<S: Double>(&self, stretch: Lanes<S>) -> Lanes<S> {
        let Some([residual, strain, inverse_strain]) = self.buckling else { return self.energy_in_tension(stretch) };
        let energy = self.energy_in_tension(at_least(stretch, 1.0));
        let lost = 1.0 - residual;
        let x = (1.0 - stretch) * inverse_strain;
        let inside = at_most(x, 1.0);
        let (beyond, square) = (x - inside, inside * inside);
        let buckled = self.modulus
            * strain
            * strain
            * (square * (0.5 - lost * square * (0.25 - 0.1 * inside))
                + beyond * (0.5 * (1.0 + residual) + 0.5 * residual * beyond));
        buckled.where_or(stretch.less(Lanes::splat(stretch.0, 1.0)), energy)
    }

    /// The integral of `exp(B g) - 1` over the strain from zero. Which way a lane takes does not depend on the others.
    #[inline(always)]
    fn integral_of_growth<S: Double>(&self, strain: Lanes<S>) -> Lanes<S> {
        let serves = self.series.serves(strain);
        let by_series = self.series.integral(strain);
        let (zero, one) = (Lanes::splat(strain.0, 0.0), Lanes::splat(strain.0, 1.0));
        if one.where_or(serves, zero).numbers()[..S::LANES].iter().all(|&serves| serves != 0.0) {
            return by_series;
        }
        by_series.where_or(serves, integral_of_growth(self.nonlinearity, strain))
    }

    #[inline(always)]
    fn energy_in_tension<S: Double>(&self, stretch: Lanes<S>) -> Lanes<S> {
        let &Self { modulus, nonlinearity, transition, curve, .. } = self;
        match self.formula {
            LawFormula::Linear { .. } => {
                let green = 0.5 * (stretch - 1.0) * (stretch + 1.0);
                0.5 * modulus * green * green
            }
            LawFormula::Exponential { .. } => curve * self.integral_of_growth(stretch - 1.0),
            LawFormula::ExponentialStretch { .. } => {
                let nearest = at_most(at_least(stretch, 1.0), transition);
                let x = 0.5 * nonlinearity * (nearest - 1.0) * (nearest + 1.0);
                let (growth, beyond) = (growth(x), stretch - nearest);
                let slope = curve * growth + modulus * nearest * nearest * (growth + 1.0);
                let stress = curve * nearest * growth;
                // exp(x) - 1 - x without cancellation.
                let mut series = Lanes::splat(x.0, 1.0);
                for k in (3..=16).rev() {
                    series = 1.0 + series * (x * (1.0 / f64::from(k)));
                }
                let is_large = Lanes::splat(x.0, 0.5).less(x.abs());
                let remainder = (growth - x).where_or(is_large, 0.5 * x * x * series);
                curve / nonlinearity * remainder + beyond * (stress + 0.5 * beyond * slope)
            }
        }
    }
}

#[inline(always)]
fn at_most<S: Double>(x: Lanes<S>, most: f64) -> Lanes<S> {
    let most = Lanes::splat(x.0, most);
    most.where_or(most.less(x), x)
}

#[inline(always)]
fn at_least<S: Double>(x: Lanes<S>, least: f64) -> Lanes<S> {
    let least = Lanes::splat(x.0, least);
    least.where_or(x.less(least), x)
}

/// `exp(x) - 1`, as `fiber::law::exp_m1` computes it; zero has no sign.
#[inline(always)]
fn growth<S: Double>(x: Lanes<S>) -> Lanes<S> {
    const ROUND: f64 = 6_755_399_441_055_744.0;
    /// Half of log 2: below it, `k` is zero. Slightly less, because the product with `LOG2_E` is rounded.
    const NEAR_ZERO: f64 = 0.346;
    let simd = x.0;
    if simd.all(x.abs().less(Lanes::splat(simd, NEAR_ZERO))) {
        // The same number as below, without the operations that do not change it.
        return x + x * x * series(x);
    }
    let bounded = at_least(at_most(x, 710.0), -50.0);
    let shifted = bounded.times_plus(std::f64::consts::LOG2_E, ROUND);
    let k = shifted - ROUND;
    let half_power = Lanes(simd, simd.power_of_two(shifted.1, 1022));
    let high = bounded - k * 6.931_471_803_691_238e-1;
    let low = k * 1.908_214_929_270_587_7e-10;
    let r = high - low;
    let lost = (high - r) - low;
    let beyond = (r * r).mul_add(series(r), lost);
    let scaled = half_power.mul_add(r, half_power - 0.5) + half_power * beyond;
    let is_near_zero = k.abs().less(Lanes::splat(simd, 0.5));
    (r + beyond).where_or(is_near_zero, 2.0 * scaled)
}

/// `(exp(r) - 1 - r) / r^2` to order `r^12` by Estrin's scheme.
#[inline(always)]
fn series<S: Double>(r: Lanes<S>) -> Lanes<S> {
    let r2 = r * r;
    let r4 = r2 * r2;
    let a = r.times_plus(1.0 / 120.0, 1.0 / 24.0).mul_add(r2, r.times_plus(1.0 / 6.0, 1.0 / 2.0));
    let b = r.times_plus(1.0 / 362_880.0, 1.0 / 40_320.0).mul_add(r2, r.times_plus(1.0 / 5_040.0, 1.0 / 720.0));
    let c = r
        .times_plus(1.0 / 6_227_020_800.0, 1.0 / 479_001_600.0)
        .mul_add(r2, r.times_plus(1.0 / 39_916_800.0, 1.0 / 3_628_800.0));
    let d = r4.mul_add(Lanes::splat(r.0, 1.0 / 87_178_291_200.0), c);
    d.mul_add(r4 * r4, b.mul_add(r4, a))
}

/// The integral of `exp(B g) - 1` over the strain from zero, on panels on which the exponent grows by at most about 1. Few
/// fibers need more than one.
#[inline(always)]
fn integral_of_growth<S: Double>(b: f64, strain: Lanes<S>) -> Lanes<S> {
    let simd = strain.0;
    let bound = 0.4 * b * ((strain * (strain + 2.0)).abs() + strain * strain);
    let mut panels = bound.numbers();
    // The number of the panels of a lane does not depend on the other lanes.
    panels.iter_mut().for_each(|bound| *bound = if *bound >= 1.0 { 1.0 + bound.min(4000.0).floor() } else { 1.0 });
    let most = panels[..S::LANES].iter().fold(1.0, |most: f64, &panels| most.max(panels));
    if most <= 1.0 {
        return integral_on_panel(b, Lanes::splat(simd, 0.0), strain);
    }
    let count = Lanes::of_numbers(simd, &panels);
    let width = strain.div(count);
    let mut sum = Lanes::splat(simd, 0.0);
    for panel in 0..most as u32 {
        let panel = Lanes::splat(simd, f64::from(panel));
        let part = integral_on_panel(b, width * panel, width * (panel + 1.0));
        sum = (sum + part).where_or(panel.less(count), sum);
    }
    sum
}

/// The integral from one strain to another by Gauss quadrature with eight points.
#[inline(always)]
fn integral_on_panel<S: Double>(b: f64, from: Lanes<S>, to: Lanes<S>) -> Lanes<S> {
    const POINTS: [f64; 4] =
        [0.183_434_642_495_649_8, 0.525_532_409_916_329, 0.796_666_477_413_626_7, 0.960_289_856_497_536_3];
    const WEIGHTS: [f64; 4] =
        [0.362_683_783_378_362, 0.313_706_645_877_887_3, 0.222_381_034_453_374_5, 0.101_228_536_290_376_3];
    let (middle, half) = (0.5 * (from + to), 0.5 * (to - from));
    let mut sum = Lanes::splat(from.0, 0.0);
    for (point, weight) in POINTS.into_iter().zip(WEIGHTS) {
        let (low, high) = (middle - half * point, middle + half * point);
        sum += weight * (growth(0.5 * b * low * (low + 2.0)) + growth(0.5 * b * high * (high + 2.0)));
    }
    half * sum
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::backends::networks::lanes::portable::Portable;

    /// Lanes near zero have the same bits beside one that is not.
    #[test]
    fn growth_does_not_depend_on_other_lanes() {
        let of = |x: [f64; 4]| {
            let [a, b, c, d] = x;
            growth(Lanes::of_numbers(Portable, &[a, b, c, d, 0.0, 0.0, 0.0, 0.0])).numbers().map(f64::to_bits)
        };
        for k in 0..2000 {
            let x = 0.3459 * f64::from(k) / 2000.0;
            for x in [x, -x, 1e-17 * x, -1e-17 * x, 1e-200 * x] {
                let (alone, beside) = (of([x; 4]), of([x, 0.5, f64::NAN, -3.0]));
                assert_eq!(alone[0], beside[0], "{x}");
                assert!((f64::from_bits(alone[0]) - x.exp_m1()).abs() <= 1e-15 * x.abs(), "{x}");
            }
        }
    }
}
