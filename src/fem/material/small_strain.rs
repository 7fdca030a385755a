//! Strain measures as functions of `H = F - I`, accurate to rounding for arbitrarily small strains.

use nalgebra::Matrix3;

/// For `|J - 1|` up to this bound, `J - 1` is computed as a polynomial in `H`; beyond it, `det F` is as accurate.
const POLYNOMIAL_UP_TO: f64 = 0.5;
/// For `|x|` up to this bound, `x - ln(1 + x)` is a series; beyond it, the difference loses at most the last digit.
const SERIES_UP_TO: f64 = 0.1;
/// Number of terms of the series: the first omitted term is below `0.053^16 / 19`, less than `1e-21` of the first.
const TERMS: u32 = 8;

/// The volume change of a deformation.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Dilatation {
    /// `J - 1`.
    pub(super) change: f64,
    /// `ln J`.
    pub(super) ln: f64,
    /// `(J - 1) - ln J`, which is of second order in `J - 1` and not negative.
    pub(super) beyond_ln: f64,
}

impl Dilatation {
    /// Computes the volume change from `H` and `det F > 0`.
    pub(super) fn of(h: &Matrix3<f64>, determinant: f64) -> Self {
        let trace = h.trace();
        let second_invariant = 0.5 * (trace * trace - (h * h).trace());
        let change = trace + second_invariant + h.determinant();
        if change.abs() <= POLYNOMIAL_UP_TO {
            Self { change, ln: change.ln_1p(), beyond_ln: minus_ln_1p(change) }
        } else {
            let ln = determinant.ln();
            Self { change: determinant - 1.0, ln, beyond_ln: determinant - 1.0 - ln }
        }
    }

    /// Computes `tr E - ln J`, of second order, for the `H` of this volume change: with `tr E = tr H + H : H / 2` and
    /// `J - 1 = tr H + II(H) + det H` it is `e : e - (tr H)^2 / 2 - det H + [(J - 1) - ln J]` with `e = sym(H)`.
    pub(super) fn trace_beyond_ln(&self, h: &Matrix3<f64>) -> f64 {
        let strain = (h + h.transpose()) * 0.5;
        let trace = h.trace();
        strain.norm_squared() - 0.5 * trace * trace - h.determinant() + self.beyond_ln
    }
}

/// Computes `x - ln(1 + x)`. With `s = x / (2 + x)`, `ln(1 + x) = 2 artanh(s)` and `x - 2 s = x s`.
fn minus_ln_1p(x: f64) -> f64 {
    if x.abs() > SERIES_UP_TO {
        return x - x.ln_1p();
    }
    let s = x / (2.0 + x);
    let square = s * s;
    let series = (0..TERMS).rev().fold(0.0, |sum, k| sum * square + 1.0 / f64::from(2 * k + 3));
    s * (x - 2.0 * square * series)
}

/// Computes `exp(x) - 1 - x`.
pub(super) fn exp_beyond_linear(x: f64) -> f64 {
    if x.abs() > SERIES_UP_TO {
        return x.exp_m1() - x;
    }
    // The first omitted term is below 0.1^12 times the sum.
    (2..14).rev().fold(0.0, |sum, k| (sum + 1.0) * x / f64::from(k)) * x
}

/// Computes the Green-Lagrange strain `E = (F^T F - I) / 2 = sym(H) + H^T H / 2`.
pub(super) fn green_lagrange(h: &Matrix3<f64>) -> Matrix3<f64> {
    (h + h.transpose() + h.transpose() * h) * 0.5
}

#[cfg(test)]
mod tests {
    use super::super::{HolmesMow, LinearElastic, Material, NeoHookean, SaintVenantKirchhoff};
    use super::*;

    const MU: f64 = 3.0e3;
    const LAMBDA: f64 = 5.0e3;
    const NEO_HOOKEAN: NeoHookean = NeoHookean { mu: MU, lambda: LAMBDA };

    /// Powers of two from 1e-3 to 5e-10, so that `I + H` represents `H` exactly.
    fn sizes() -> impl Iterator<Item = f64> {
        (10..32).map(|k| 0.5_f64.powi(k))
    }

    fn assert_near(found: f64, expected: f64, tolerance: f64) {
        assert!((found - expected).abs() <= tolerance * expected.abs(), "{found:e} is not {expected:e}");
    }

    /// Computes `x - ln(1 + x)` by its Taylor series.
    fn taylor(x: f64) -> f64 {
        (2..12).rev().map(|n| (-x).powi(n) / f64::from(n)).sum()
    }

    #[test]
    fn both_forms_of_the_gap_agree_where_they_meet() {
        for x in [-0.1_f64, -0.09, 0.09, 0.1] {
            assert_near(minus_ln_1p(x), x - x.ln_1p(), 2e-14);
        }
        for x in [0.5, -0.5, 3.0, -0.99] {
            assert_eq!(minus_ln_1p(x), x - x.ln_1p());
        }
        assert_eq!(minus_ln_1p(0.0), 0.0);
        for x in [-0.1_f64, -0.09, 0.09, 0.1] {
            assert_near(exp_beyond_linear(x), x.exp_m1() - x, 2e-14);
        }
        for x in sizes() {
            assert_near(exp_beyond_linear(x), 0.5 * x * x * (1.0 + x / 3.0 + x * x / 12.0 + x.powi(3) / 60.0), 1e-14);
        }
    }

    /// In principal axes `W = mu sum(a + a^2/2 - ln(1 + a)) + lambda/2 (sum ln(1 + a))^2`, and `P` is diagonal.
    #[test]
    fn neo_hookean_keeps_its_digits_at_small_principal_strains() {
        for s in sizes() {
            let axes = [s, -0.5 * s, 0.25 * s];
            let response = NEO_HOOKEAN.evaluate(&Matrix3::from_diagonal(&axes.map(|a| 1.0 + a).into())).unwrap();
            let ln_j: f64 = axes.iter().map(|a| a.ln_1p()).sum();
            let shear: f64 = axes.iter().map(|&a| 0.5 * a * a + taylor(a)).sum();
            assert_near(response.energy, MU * shear + 0.5 * LAMBDA * ln_j * ln_j, 1e-13);
            for (k, &a) in axes.iter().enumerate() {
                // mu (F - 1/F) + lambda ln J / F with F = 1 + a.
                let expected = (MU * a * (2.0 + a) + LAMBDA * ln_j) / (1.0 + a);
                assert_near(response.pk1[(k, k)], expected, 1e-13);
            }
        }
    }

    /// Simple shear preserves the volume: `W = mu s^2 / 2`, and `P` is `mu s` in both shear components.
    #[test]
    fn neo_hookean_keeps_its_digits_in_small_shear() {
        for s in sizes() {
            let mut f = Matrix3::identity();
            f[(0, 1)] = s;
            let response = NEO_HOOKEAN.evaluate(&f).unwrap();
            assert_near(response.energy, 0.5 * MU * s * s, 1e-13);
            assert_near(response.pk1[(0, 1)], MU * s, 1e-13);
            assert_near(response.pk1[(1, 0)], MU * s, 1e-13);
        }
    }

    /// Every material obeys Hooke's law at small strains: the difference `W - mu e:e - lambda/2 (tr e)^2` is of third
    /// order, and `P - 2 mu e - lambda tr(e) I` is of second order.
    #[test]
    fn every_material_is_hookes_at_small_strains() {
        let linear = LinearElastic { mu: MU, lambda: LAMBDA };
        let saint_venant = SaintVenantKirchhoff::at_rest(&linear.evaluate(&Matrix3::identity()).unwrap().tangent);
        let holmes_mow = HolmesMow { mu: MU, lambda: LAMBDA, beta: 0.5 };
        let materials: [&dyn Material; 4] = [&NEO_HOOKEAN, &linear, &saint_venant, &holmes_mow];
        for (material, s) in materials.iter().flat_map(|material| sizes().map(move |s| (material, s))) {
            let h = Matrix3::new(0.75, 0.5, -0.25, 0.125, -0.5, 0.25, -0.5, 0.25, 0.375) * s;
            let e = (h + h.transpose()) * 0.5;
            let response = material.evaluate(&(Matrix3::identity() + h)).unwrap();
            assert_near(response.energy, MU * e.norm_squared() + 0.5 * LAMBDA * e.trace().powi(2), 10.0 * s + 1e-13);
            let stress = e * (2.0 * MU) + Matrix3::from_diagonal_element(LAMBDA * e.trace());
            assert!((response.pk1 - stress).norm() <= (10.0 * s + 1e-13) * stress.norm(), "{s:e}");
        }
    }
}
