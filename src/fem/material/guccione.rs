//! The exponential material of Guccione for the passive heart muscle.

use nalgebra::{Matrix3, Vector3};

use super::lagrangian::{Axial, Lagrangian, Strain, outer, symmetric_square};
use super::{Material, MaterialError, Response};

/// The energy is `W = C/2 (exp Q - 1) + K/4 (J^2 - 1 - 2 ln J)` with
/// `Q = bf E_ff^2 + bt (E_ss^2 + E_nn^2 + 2 E_sn^2) + 2 bfs (E_fs^2 + E_fn^2)`, where `f` is the fiber axis and `s` and
/// `n` are normal to it.
///
/// # Derivation
/// For the unit vector `a` along the fibers and `e = a . E a`, independently of the choice of `s` and `n`,
///
/// ```text
/// Q     = bt E : E + 2 (bfs - bt) |E a|^2 + (bf + bt - 2 bfs) e^2
/// S     = C/2 exp(Q) D,    D = dQ/dE = 2 bt E + 2 (bfs - bt) (a (x) E a + E a (x) a) + 2 (bf + bt - 2 bfs) e a (x) a
/// dS/dE = C/2 exp(Q) (D (x) D + dD/dE)
/// ```
///
/// # References
/// J. M. Guccione, A. D. McCulloch and L. K. Waldman, J. Biomech. Eng. 113 (1991) 42-55; in this notation, S. Land et
/// al., Proc. R. Soc. A 471 (2015) 20150641.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "app", derive(serde::Serialize, serde::Deserialize))]
pub struct Guccione {
    /// Stress scale `C`, Pa.
    pub c: f64,
    /// Exponent along the fibers.
    pub bf: f64,
    /// Exponent across the fibers.
    pub bt: f64,
    /// Exponent of shear along the fibers.
    pub bfs: f64,
    /// Bulk modulus `K` at rest of the volumetric energy, Pa.
    pub bulk_modulus: f64,
    /// The fiber axis, a unit vector.
    pub axis: Vector3<f64>,
}

impl Material for Guccione {
    fn evaluate(&self, f: &Matrix3<f64>) -> Result<Response, MaterialError> {
        let strain = Strain::of(f)?;
        let Self { c, bf, bt, bfs, bulk_modulus, axis } = self;
        let axial = Axial::of(axis, &strain.e);
        let (shear, along) = (2.0 * (bfs - bt), bf + bt - 2.0 * bfs);
        let exponent = bt * strain.e.norm_squared() + shear * axial.square + along * axial.strain * axial.strain;
        let slope = strain.e * (2.0 * bt) + axial.square_slope * shear + axial.structure * (2.0 * along * axial.strain);
        let curvature = symmetric_square(&Matrix3::identity()) * (2.0 * bt)
            + axial.square_moduli() * shear
            + outer(&axial.structure, &axial.structure) * (2.0 * along);
        let scale = 0.5 * c * exponent.exp();
        let passive = Lagrangian {
            energy: 0.5 * c * exponent.exp_m1(),
            pk2: slope * scale,
            moduli: (outer(&slope, &slope) + curvature) * scale,
        };
        Ok(passive.plus(&Lagrangian::volumetric(*bulk_modulus, &strain)).response(f))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// In axes along the fibers, `Q` is the sum of squares of its definition.
    #[test]
    fn the_exponent_is_the_sum_over_the_components() {
        let material = Guccione { c: 2.0, bf: 8.0, bt: 2.0, bfs: 4.0, bulk_modulus: 0.0, axis: Vector3::y() };
        let f = Matrix3::new(1.05, 0.08, -0.02, 0.03, 0.96, 0.05, -0.04, 0.02, 1.03);
        let e = (f.transpose() * f - Matrix3::identity()) * 0.5;
        let square = |i: usize, j: usize| e[(i, j)] * e[(i, j)];
        let q = 8.0 * square(1, 1)
            + 2.0 * (square(0, 0) + square(2, 2) + 2.0 * square(0, 2))
            + 8.0 * (square(0, 1) + square(1, 2));
        let energy = material.evaluate(&f).unwrap().energy;
        assert!((energy - q.exp_m1()).abs() < 1e-15, "{energy:e} {:e}", q.exp_m1());
    }

    /// With equal exponents the material is isotropic, and at rest Hooke's with `mu = C b / 2` and `lambda = K`.
    #[test]
    fn equal_exponents_give_hookes_law_at_rest() {
        let material = Guccione { c: 2.0, bf: 3.0, bt: 3.0, bfs: 3.0, bulk_modulus: 5.0, axis: Vector3::x() };
        let a = material.evaluate(&Matrix3::identity()).unwrap().tangent;
        assert!((a[(0, 0)] - 11.0).abs() < 1e-14 && (a[(0, 4)] - 5.0).abs() < 1e-14 && (a[(1, 1)] - 3.0).abs() < 1e-14);
    }

    /// At rest `W = C/2 Q + K/2 (tr E)^2` to second order. In the axes `f`, `s`, `n`, the moduli are `C bf + K` along
    /// the fibers, `C bt + K` across them, `K` between two normal strains, and the shear moduli `C bfs / 2` along the
    /// fibers and `C bt / 2` across them: `Q` has `2 bfs E_fs^2`, and `S_fs` is half its derivative by `E_fs`.
    #[test]
    fn the_moduli_at_rest_are_those_of_the_exponents() {
        let (f, s, n) = (Vector3::new(2.0, -1.0, 2.0), Vector3::new(2.0, 2.0, -1.0), Vector3::new(-1.0, 2.0, 2.0));
        let frame = [f, s, n].map(|axis| axis / 3.0);
        let material = Guccione { c: 2.0, bf: 8.0, bt: 3.0, bfs: 5.0, bulk_modulus: 7.0, axis: frame[0] };
        let a = material.evaluate(&Matrix3::identity()).unwrap().tangent;
        let expected = |[i, j, k, l]: [usize; 4]| {
            let normal = if i == j && k == l { 7.0 } else { 0.0 };
            match (i == j, (i, j) == (k, l) || (i, j) == (l, k), i == 0 || j == 0) {
                (true, true, true) => normal + 16.0,
                (true, true, false) => normal + 6.0,
                (false, true, true) => 5.0,
                (false, true, false) => 3.0,
                (_, false, _) => normal,
            }
        };
        for at in (0..81).map(|m| [m / 27, m / 9 % 3, m / 3 % 3, m % 3]) {
            let [p, q, r, t] = at.map(|m| frame[m]);
            let component = |row: usize, col: usize| p[row / 3] * q[row % 3] * r[col / 3] * t[col % 3] * a[(row, col)];
            let found: f64 =
                (0..9).flat_map(|row| (0..9).map(move |col| (row, col))).map(|(i, j)| component(i, j)).sum();
            assert!((found - expected(at)).abs() < 1e-13, "{at:?}: {found} instead of {}", expected(at));
        }
    }
}
