//! The closed-form solution of the heat front (Zel'dovich and Kompaneets 1950, Barenblatt 1952).
//!
//! For `du/dt = div(kappa u grad u)` in the plane, with `s = S0 + kappa t / 2`:
//!
//! ```text
//! u = (C - r^2 / (16 s^1/2)) / s^1/2    where that is positive, else 0
//! ```
//!
//! The temperature is zero beyond the radius `4 (C s^1/2)^1/2`, the front.

/// With these values, the maximum initial temperature is 1 and the initial radius of the front is 0.4.
const S0: f64 = 0.01;
const C: f64 = 0.1;

/// Returns `s^1/2` at a time.
fn root(kappa: f64, time: f64) -> f64 {
    (S0 + 0.5 * kappa * time).sqrt()
}

/// Returns the temperature at a position.
pub fn temperature(kappa: f64, time: f64, [x, y]: [f64; 2]) -> f64 {
    let root = root(kappa, time);
    ((C - (x * x + y * y) / (16.0 * root)) / root).max(0.0)
}

/// Returns the radius of the front.
pub fn front(kappa: f64, time: f64) -> f64 {
    4.0 * (C * root(kappa, time)).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Tests the differential equation inside the front by central differences.
    #[test]
    fn the_solution_satisfies_the_equation() {
        let (kappa, time, h) = (3.0, 0.05, 1e-4);
        for [x, y] in [[0.1, 0.0], [0.2, 0.3], [0.0, 0.5]] {
            // kappa u grad u is kappa / 2 times the gradient of u^2.
            let square = |x: f64, y: f64| temperature(kappa, time, [x, y]).powi(2);
            let neighbors = square(x + h, y) + square(x - h, y) + square(x, y + h) + square(x, y - h);
            let inflow = 0.5 * kappa * (neighbors - 4.0 * square(x, y)) / (h * h);
            let at = |time: f64| temperature(kappa, time, [x, y]);
            let rate = (at(time + h) - at(time - h)) / (2.0 * h);
            assert!((inflow - rate).abs() < 1e-4 * rate.abs().max(1.0), "{inflow} {rate}");
        }
        assert_eq!(temperature(kappa, time, [front(kappa, time) + 1e-9, 0.0]), 0.0);
    }
}
