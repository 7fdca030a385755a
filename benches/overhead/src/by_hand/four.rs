//! Four numbers per entry, in compressed rows.

use std::ops::{Add, AddAssign, Mul};

use super::slices;

/// Four numbers.
#[derive(Clone, Copy, Default)]
#[repr(transparent)]
pub struct Four(pub [f64; 4]);

impl Add for Four {
    type Output = Self;

    #[inline(always)]
    fn add(self, other: Self) -> Self {
        Self(std::array::from_fn(|k| self.0[k] + other.0[k]))
    }
}

impl AddAssign for Four {
    #[inline(always)]
    fn add_assign(&mut self, other: Self) {
        for (value, other) in self.0.iter_mut().zip(other.0) {
            *value += other;
        }
    }
}

impl Mul for Four {
    type Output = Self;

    #[inline(always)]
    fn mul(self, other: Self) -> Self {
        Self(std::array::from_fn(|k| self.0[k] * other.0[k]))
    }
}

#[inline(always)]
pub fn dot(x: &[Four], y: &[Four]) -> Four {
    let mut sums = [Four::default(); 2];
    let (x_pairs, x_last) = x.as_chunks::<2>();
    let (y_pairs, y_last) = y.as_chunks::<2>();
    for (x, y) in x_pairs.iter().zip(y_pairs) {
        sums[0] += x[0] * y[0];
        sums[1] += x[1] * y[1];
    }
    for (&x, &y) in x_last.iter().zip(y_last) {
        sums[0] += x * y;
    }
    sums[0] + sums[1]
}

#[inline(always)]
pub fn norm(x: &[Four]) -> Four {
    let squares = dot(x, x);
    let mut norms = Four(squares.0.map(f64::sqrt));
    if !squares.0.iter().all(|&square| slices::is_in_range(square)) {
        sum_scaled(x, &squares, &mut norms);
    }
    norms
}

#[cold]
#[inline(never)]
pub fn sum_scaled(x: &[Four], squares: &Four, norms: &mut Four) {
    for (k, norm) in norms.0.iter_mut().enumerate() {
        if !slices::is_in_range(squares.0[k]) {
            *norm = slices::norm(&x.iter().map(|x| x.0[k]).collect::<Vec<f64>>());
        }
    }
}
