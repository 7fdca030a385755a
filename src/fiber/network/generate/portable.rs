//! Functions that are bitwise reproducible on every machine, in contrast to those of the system library.
//!
//! Addition, multiplication, division, square root and fused multiply-add are correctly rounded by IEEE 754; cube root
//! and arc tangent are not, and a network must not depend on the library that computes them.

/// Returns the correctly rounded cube root of a positive number: one Newton step with the residual in doubled
/// precision, from an initial value that every library gives to within a few units in the last place.
pub(super) fn cbrt(x: f64) -> f64 {
    let y = x.cbrt();
    let square = y * y;
    let square_error = y.mul_add(y, -square);
    let cube = square * y;
    let cube_error = square.mul_add(y, -cube);
    let residual = ((x - cube) - cube_error) - square_error * y;
    y + residual / (3.0 * square)
}

/// Returns the arc tangent of a number from 0 to about 1e6, to within some units in the last place.
///
/// `atan x = 2 atan(x / (1 + sqrt(1 + x^2)))` is applied ten times; then the argument is below 0.002 and four terms of
/// the series suffice.
pub(super) fn atan(x: f64) -> f64 {
    const HALVINGS: i32 = 10;
    let small = (0..HALVINGS).fold(x, |x, _| x / (1.0 + (1.0 + x * x).sqrt()));
    let square = small * small;
    let series = 1.0 - square * (1.0 / 3.0 - square * (1.0 / 5.0 - square / 7.0));
    f64::from(1 << HALVINGS) * small * series
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cube_roots_are_correctly_rounded() {
        for n in 1..2000u32 {
            let root = cbrt(f64::from(n));
            // The cubes have at most 33 bits and are exact, so that their roots must be exact too.
            assert_eq!(cbrt(f64::from(n).powi(3)), f64::from(n));
            assert!((root - f64::from(n).cbrt()).abs() <= 2.0 * f64::EPSILON * root);
        }
    }

    #[test]
    fn arc_tangents_agree_with_the_library() {
        for k in 0..600 {
            let x = 1.03f64.powi(k - 300);
            assert!((atan(x) - x.atan()).abs() <= 8.0 * f64::EPSILON * x.atan(), "{x}: {} {}", atan(x), x.atan());
        }
        assert_eq!(atan(0.0), 0.0);
    }
}
