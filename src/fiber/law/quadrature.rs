//! Quadrature of a stress over the stretch, for laws whose energy has no closed form.

/// Points and weights of the eight-point Gauss rule on `[-1, 1]`, one of each symmetric pair (Abramowitz and Stegun,
/// table 25.4). The rule is exact for polynomials of degree 15.
pub(super) const GAUSS: [(f64, f64); 4] = [
    (0.183_434_642_495_649_8, 0.362_683_783_378_362),
    (0.525_532_409_916_329, 0.313_706_645_877_887_3),
    (0.796_666_477_413_626_7, 0.222_381_034_453_374_5),
    (0.960_289_856_497_536_2, 0.101_228_536_290_376_3),
];

/// Integrates from `a` to `b` with eight Gauss points.
#[inline(always)]
pub(super) fn gauss(a: f64, b: f64, integrand: impl Fn(f64) -> f64) -> f64 {
    let (middle, half) = (0.5 * (a + b), 0.5 * (b - a));
    let mut sum = 0.0;
    for (x, w) in GAUSS {
        sum += w * (integrand(middle - half * x) + integrand(middle + half * x));
    }
    half * sum
}

/// Integrates from `a` to `b` an integrand that is continuous and, except for a few kinks, smooth. Halves each panel
/// until eight points on the panel agree with eight on each of its halves.
///
/// The subdivision stops after about 10 000 panels if the integral does not converge.
pub(super) fn adaptive(a: f64, b: f64, integrand: &dyn Fn(f64) -> f64) -> f64 {
    const AGREES: f64 = 1e-14;
    const MOST_PANELS: usize = 10_000;
    let mut open = vec![(a, b, gauss(a, b, integrand), 0)];
    let (mut sum, mut panels) = (0.0, 1);
    while let Some((a, b, whole, depth)) = open.pop() {
        let middle = 0.5 * (a + b);
        let halves = [gauss(a, middle, integrand), gauss(middle, b, integrand)];
        let both = halves[0] + halves[1];
        // Panels next to a kink are accepted if their error is negligible relative to the sum.
        let allowed = AGREES * both.abs().max(f64::abs(sum));
        if (whole - both).abs() <= allowed || depth == 50 || panels >= MOST_PANELS || !both.is_finite() {
            sum += both;
        } else {
            panels += 1;
            open.push((middle, b, halves[1], depth + 1));
            open.push((a, middle, halves[0], depth + 1));
        }
    }
    sum
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn polynomials_of_degree_15_are_exact() {
        let found = gauss(-1.0, 2.0, |x| x.powi(15));
        let exact = (2.0_f64.powi(16) - 1.0) / 16.0;
        assert!((found - exact).abs() < 1e-14 * exact);
    }

    #[test]
    fn kinks_and_steep_rises_are_found() {
        let kink = |x: f64| if x < 1.23 { x } else { 1.23 + 50.0 * (x - 1.23) };
        let exact = 0.5 * (1.23_f64.powi(2) - 1.0) + 1.23 * 0.77 + 25.0 * 0.77 * 0.77;
        assert!((adaptive(1.0, 2.0, &kink) / exact - 1.0).abs() < 1e-13);
        assert!((adaptive(0.0, 30.0, &f64::exp) / 30.0_f64.exp_m1() - 1.0).abs() < 1e-13);
        assert!(adaptive(0.0, 1.0, &|_| f64::NAN).is_nan());
        assert_eq!(adaptive(1.0, 1.0, &f64::exp), 0.0);
    }
}
