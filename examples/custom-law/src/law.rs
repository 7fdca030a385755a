//! Collagen with a toe region: crimped fibers straighten at low force before they carry load.

use biotissue::fiber::law::FiberLaw;

/// A power law that continues as a straight line, a common fit of tensile tests of collagen fibers.
///
/// With the strain `e = lambda - 1`, the strain `e_t` at the end of the toe region, the exponent `n >= 2`, the modulus
/// at rest `E` and the modulus `H` of the straightened fiber:
///
/// ```text
/// s = E e                                               e <= 0
/// s = E e + (H - E) e_t / n (e / e_t)^n                 0 <= e <= e_t
/// s = E e_t + (H - E) e_t / n + H (e - e_t)             e_t <= e
/// ```
///
/// Stress and slope are continuous at both ends of the toe region.
#[derive(Clone, Debug)]
pub struct Toe {
    /// Modulus at rest `E`, Pa.
    pub youngs_modulus: f64,
    /// Modulus of the straightened fiber `H`, Pa; greater than `E`.
    pub straight_modulus: f64,
    /// Strain at the end of the toe region `e_t`.
    pub toe_strain: f64,
    /// Exponent `n`, at least 2; for a smaller exponent, the derivative of the slope is infinite at rest.
    pub exponent: f64,
}

impl FiberLaw for Toe {
    fn name(&self) -> &str {
        "toe"
    }

    fn parameters(&self) -> Vec<(&'static str, f64)> {
        vec![
            ("youngs_modulus", self.youngs_modulus),
            ("straight_modulus", self.straight_modulus),
            ("toe_strain", self.toe_strain),
            ("exponent", self.exponent),
        ]
    }

    fn stress(&self, stretch: f64) -> (f64, f64) {
        let (strain, rise) = (stretch - 1.0, self.straight_modulus - self.youngs_modulus);
        // Position in the toe region, from 0 to 1; the line continues beyond it.
        let along = (strain / self.toe_strain).clamp(0.0, 1.0);
        let beyond = (strain - self.toe_strain).max(0.0);
        let curved = rise * self.toe_strain / self.exponent * along.powf(self.exponent);
        let slope = self.youngs_modulus + rise * along.powf(self.exponent - 1.0);
        (self.youngs_modulus * strain + curved + rise * beyond, slope)
    }

    /// Returns the energy in closed form. Without this method the library integrates the stress by quadrature, which is
    /// as accurate but slower.
    fn energy(&self, stretch: f64) -> f64 {
        let (strain, rise) = (stretch - 1.0, self.straight_modulus - self.youngs_modulus);
        let along = (strain / self.toe_strain).clamp(0.0, 1.0);
        let beyond = (strain - self.toe_strain).max(0.0);
        let n = self.exponent;
        let in_toe = self.toe_strain * self.toe_strain / (n * (n + 1.0)) * along.powf(n + 1.0);
        let on_line = beyond * (self.toe_strain / n + 0.5 * beyond);
        0.5 * self.youngs_modulus * strain * strain + rise * (in_toe + on_line)
    }

    fn youngs_modulus(&self) -> f64 {
        self.youngs_modulus
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use biotissue::fiber::law::check;

    fn laws() -> impl Iterator<Item = Toe> {
        [2.0, 2.5, 3.7].into_iter().map(|exponent| Toe {
            youngs_modulus: 1.0e7,
            straight_modulus: 4.0e8,
            toe_strain: 0.06,
            exponent,
        })
    }

    /// The library's check for laws tests that stress, slope, energy and batched evaluation are consistent and
    /// continuous.
    #[test]
    fn the_law_passes_the_check_of_the_library() -> Result<(), biotissue::fiber::law::LawError> {
        laws().try_for_each(|law| check(&law, 0.7..=1.4))
    }

    /// Repeats the test of the slope by central differences, without the library's check.
    #[test]
    fn the_slope_is_the_derivative_of_the_stress() {
        for law in laws() {
            for stretch in [0.9, 0.99, 1.01, 1.03, 1.055, 1.07, 1.2] {
                let h = 1e-6;
                let difference = (law.stress(stretch + h).0 - law.stress(stretch - h).0) / (2.0 * h);
                let slope = law.stress(stretch).1;
                assert!((difference - slope).abs() < 1e-6 * law.straight_modulus, "{stretch}: {difference} {slope}");
            }
        }
    }

    #[test]
    fn the_slope_of_a_straightened_fiber_is_its_modulus() {
        for law in laws() {
            assert_eq!(law.stress(1.0), (0.0, 1.0e7));
            assert!((law.stress(1.2).1 - 4.0e8).abs() < 1.0);
        }
    }
}
