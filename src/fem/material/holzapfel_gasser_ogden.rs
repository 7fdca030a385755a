//! The material of Holzapfel, Gasser and Ogden: a soft matrix with families of dispersed fibers.

use nalgebra::{Matrix3, Vector3};

use super::lagrangian::{Lagrangian, Moduli, Strain, outer, symmetric_outer, symmetric_square};
use super::small_strain::exp_beyond_linear;
use super::{Material, MaterialError, Response};

/// The energy is `W = mu/2 (I1' - 3) + sum_a k1 / (2 k2) (exp(k2 <E_a>^2) - 1) + K/4 (J^2 - 1 - 2 ln J)` with
/// `E_a = kappa (I1' - 3) + (1 - 3 kappa) (I4'_a - 1)`, the isochoric invariants `I1' = J^(-2/3) tr C` and
/// `I4'_a = J^(-2/3) a . C a`, and `<x> = max(x, 0)`: fibers carry no compression.
///
/// # Derivation
/// For a symmetric tensor `M`, let `I_M = J^(-2/3) M : C`. Then `I1'` is `I_M` with `M = I`, and `E_a = I_M - 1` with
/// `M = kappa I + (1 - 3 kappa) a (x) a`. With `g = J^(-2/3)`:
///
/// ```text
/// dI_M/dE   = 2 g (M - (M : C)/3 C^-1)
/// d2I_M/dE2 = 4/3 g [(M : C) (C^-1 (x) C^-1 / 3 + C^-1 (.) C^-1) - M (x) C^-1 - C^-1 (x) M]
/// ```
///
/// # References
/// G. A. Holzapfel, T. C. Gasser and R. W. Ogden, J. Elasticity 61 (2000) 1-48; with dispersion, T. C. Gasser, R. W.
/// Ogden and G. A. Holzapfel, J. R. Soc. Interface 3 (2006) 15-35.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "app", derive(serde::Serialize, serde::Deserialize))]
pub struct HolzapfelGasserOgden {
    /// Shear modulus of the matrix, Pa.
    pub mu: f64,
    /// Stiffness of the fibers `k1`, Pa.
    pub k1: f64,
    /// Stiffening of the fibers `k2`, above 0.
    pub k2: f64,
    /// Dispersion `kappa`, from 0 (all fibers along their axis) to 1/3 (isotropic).
    pub dispersion: f64,
    /// Bulk modulus `K` at rest, Pa.
    pub bulk_modulus: f64,
    /// The axes of up to two families of fibers, unit vectors.
    pub axes: [Option<Vector3<f64>>; 2],
}

/// An isochoric invariant `J^(-2/3) M : C` with its derivatives by `E`.
struct Isochoric {
    /// `I_M - tr M`.
    change: f64,
    slope: Matrix3<f64>,
    curvature: Moduli,
}

impl Isochoric {
    fn of(m: &Matrix3<f64>, strain: &Strain) -> Self {
        let inverse = &strain.c_inverse;
        let exponent = -2.0 / 3.0 * strain.dilatation.ln;
        let g = exponent.exp();
        let (trace, product) = (m.trace(), 2.0 * m.dot(&strain.e));
        let contraction = trace + product;
        let square = outer(inverse, inverse) / 3.0 + symmetric_square(inverse);
        Self {
            change: g * product + trace * exponent.exp_m1(),
            slope: (m - inverse * (contraction / 3.0)) * (2.0 * g),
            curvature: (square * contraction - symmetric_outer(m, inverse)) * (4.0 / 3.0 * g),
        }
    }

    /// As [`Isochoric::of`] for `M = I`, without cancellation at small strains: with `y = -2/3 ln J` and `g = exp y`,
    /// `g tr C - 3 = 2 g (tr E - ln J) + 3 (exp(y) - 1 - y - y (exp(y) - 1))`, and
    /// `I - (tr C)/3 C^-1 = 2 C^-1 dev E`.
    fn first(strain: &Strain) -> Self {
        let y = -2.0 / 3.0 * strain.dilatation.ln;
        let g = y.exp();
        let deviator = strain.e - Matrix3::from_diagonal_element(strain.e.trace() / 3.0);
        let product = strain.c_inverse * deviator;
        Self {
            change: 2.0 * g * strain.trace_beyond_ln + 3.0 * (exp_beyond_linear(y) - y * y.exp_m1()),
            slope: (product + product.transpose()) * (2.0 * g),
            curvature: Self::of(&Matrix3::identity(), strain).curvature,
        }
    }
}

impl Material for HolzapfelGasserOgden {
    fn evaluate(&self, f: &Matrix3<f64>) -> Result<Response, MaterialError> {
        let strain = Strain::of(f)?;
        let first = Isochoric::first(&strain);
        let Self { mu, k1, k2, dispersion, .. } = *self;
        let mut sum = Lagrangian {
            energy: 0.5 * mu * first.change,
            pk2: first.slope * (0.5 * mu),
            moduli: first.curvature * (0.5 * mu),
        };
        for axis in self.axes.iter().flatten() {
            let structure =
                Matrix3::from_diagonal_element(dispersion) + axis * axis.transpose() * (1.0 - 3.0 * dispersion);
            let Isochoric { change, slope, curvature } = Isochoric::of(&structure, &strain);
            if change > 0.0 {
                let exponent = k2 * change * change;
                let scale = k1 * exponent.exp();
                sum = sum.plus(&Lagrangian {
                    energy: 0.5 * k1 / k2 * exponent.exp_m1(),
                    pk2: slope * (scale * change),
                    moduli: (outer(&slope, &slope) * (1.0 + 2.0 * exponent) + curvature * change) * scale,
                });
            }
        }
        Ok(sum.plus(&Lagrangian::volumetric(self.bulk_modulus, &strain)).response(f))
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::SVector;

    use super::*;
    use crate::tensor::row_major;

    fn material(dispersion: f64, axes: [Option<Vector3<f64>>; 2]) -> HolzapfelGasserOgden {
        HolzapfelGasserOgden { mu: 3.0, k1: 5.0, k2: 2.0, dispersion, bulk_modulus: 10.0, axes }
    }

    /// Stretch along a fiber at constant volume: `W` in closed form.
    #[test]
    fn the_energy_of_an_isochoric_stretch_is_known() {
        let stretch: f64 = 1.1;
        let across = stretch.powf(-0.5);
        let f = Matrix3::from_diagonal(&[stretch, across, across].into());
        for dispersion in [0.0, 0.1, 1.0 / 3.0] {
            let (i1, i4) = (stretch * stretch + 2.0 / stretch, stretch * stretch);
            let e = dispersion * (i1 - 3.0) + (1.0 - 3.0 * dispersion) * (i4 - 1.0);
            let expected = 1.5 * (i1 - 3.0) + 5.0 / 4.0 * (2.0 * e * e).exp_m1();
            let found = material(dispersion, [Some(Vector3::x()), None]).evaluate(&f).unwrap().energy;
            assert!((found - expected).abs() < 1e-14, "{dispersion}: {found} {expected}");
        }
    }

    #[test]
    fn compressed_fibers_carry_nothing() {
        let f = Matrix3::from_diagonal(&[0.9, 1.05, 1.06].into());
        let fibers = material(0.0, [Some(Vector3::x()), None]).evaluate(&f).unwrap();
        assert_eq!(fibers, material(0.0, [None; 2]).evaluate(&f).unwrap());
    }

    /// At rest: Hooke's law with `mu` and `lambda = K - 2/3 mu`.
    #[test]
    fn the_matrix_is_hookes_at_rest() {
        let a = material(0.0, [None; 2]).evaluate(&Matrix3::identity()).unwrap().tangent;
        assert!((a[(0, 0)] - 14.0).abs() < 1e-13 && (a[(0, 4)] - 8.0).abs() < 1e-13 && (a[(1, 1)] - 3.0).abs() < 1e-13);
    }

    /// The moduli at rest with these families in tension.
    ///
    /// At `E = 0`, `dE_a/dE = 2 dev M = 2 (1 - 3 kappa) N` with `N = a (x) a - I / 3`, because `dev I = 0`. A family
    /// contributes `k1/2 E_a^2` to second order, and only for `E_a > 0`: the moduli at rest jump by
    /// `k1 dE_a/dE (x) dE_a/dE` where `a . dev(E) a` changes its sign. With the isotropic part
    /// `mu/2 (I1' - 3) = mu dev E : dev E` and the volumetric one `K/2 (tr E)^2`,
    ///
    /// ```text
    /// d2W/dE2 = K I (x) I + 2 mu (1 - I (x) I / 3) + 4 k1 (1 - 3 kappa)^2 sum_a N_a (x) N_a
    /// ```
    fn at_rest(material: &HolzapfelGasserOgden, in_tension: [bool; 2]) -> Moduli {
        let HolzapfelGasserOgden { mu, k1, dispersion, bulk_modulus, axes, .. } = material;
        let same = |i: usize, j: usize| f64::from(u8::from(i == j));
        let scale = 4.0 * k1 * (1.0 - 3.0 * dispersion) * (1.0 - 3.0 * dispersion);
        Moduli::from_fn(|row, col| {
            let (i, j, k, l) = (row / 3, row % 3, col / 3, col % 3);
            let symmetric = 0.5 * (same(i, k) * same(j, l) + same(i, l) * same(j, k));
            let volumetric = same(i, j) * same(k, l);
            let fibers = axes.iter().flatten().zip(in_tension).filter(|(_, is_active)| *is_active).map(|(a, _)| {
                let n = |p: usize, q: usize| a[p] * a[q] - same(p, q) / 3.0;
                n(i, j) * n(k, l)
            });
            bulk_modulus * volumetric + 2.0 * mu * (symmetric - volumetric / 3.0) + scale * fibers.sum::<f64>()
        })
    }

    /// Two families: the moduli at rest from the side of tension and of compression of each, and those of the matrix at
    /// rest itself, where no fiber is in tension.
    #[test]
    fn the_moduli_at_rest_are_those_of_matrix_and_stretched_fibers() {
        let axes = [Vector3::new(0.6, 0.8, 0.0), Vector3::new(2.0, -1.0, 2.0) / 3.0];
        let along = |a: &Vector3<f64>| a * a.transpose();
        let volumetric = Matrix3::from_diagonal_element(0.3);
        // A small rotation changes nothing.
        let turn = Vector3::new(0.2, -0.5, 0.3).cross_matrix();
        let directions = [
            (along(&axes[0]) + along(&axes[1]) + volumetric + turn, [true, true]),
            (along(&axes[0]) - along(&axes[1]) - volumetric, [true, false]),
            (along(&axes[1]) - along(&axes[0]) + turn, [false, true]),
            (volumetric - along(&axes[0]) - along(&axes[1]), [false, false]),
        ];
        for dispersion in [0.0, 0.1, 1.0 / 3.0] {
            let material = material(dispersion, axes.map(Some));
            let matrix = at_rest(&material, [false; 2]);
            let found = material.evaluate(&Matrix3::identity()).unwrap().tangent;
            assert!((found - matrix).norm() < 1e-15 * matrix.norm(), "{dispersion}: {found}");
            for (direction, in_tension) in &directions {
                let expected = at_rest(&material, *in_tension);
                // The moduli deviate from those at rest by the order of the strain, and the stress by its square.
                let f = Matrix3::identity() + direction * 0.5_f64.powi(42);
                let response = material.evaluate(&f).unwrap();
                let error = (response.tangent - expected).norm() / expected.norm();
                assert!(error < 1e-11, "{dispersion} {in_tension:?}: {error:e}");
                // The displacement gradient after rounding, exactly.
                let h = f - Matrix3::identity();
                let strain = (h + h.transpose()) * 0.5;
                let stress = SVector::from(row_major(&response.pk1));
                let hookes = expected * SVector::from(row_major(&strain));
                let error = (stress - hookes).norm() / hookes.norm();
                assert!(error < 1e-10, "{dispersion} {in_tension:?}: stress {error:e}");
            }
        }
    }
}
