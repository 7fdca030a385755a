//! Vectors as one array.

use std::ops::{AddAssign, Mul};

/// Number of independent partial sums.
const CHAINS: usize = 8;

#[inline(always)]
pub fn add<T: Copy + AddAssign>(y: &mut [T], rows: &[i32], values: &[T]) {
    for (&row, &value) in rows.iter().zip(values) {
        if let Some(entry) = y.get_mut(row as usize) {
            *entry += value;
        }
    }
}

#[inline(always)]
pub fn set<T: Copy>(y: &mut [T], rows: &[i32], values: &[T]) {
    for (&row, &value) in rows.iter().zip(values) {
        if let Some(entry) = y.get_mut(row as usize) {
            *entry = value;
        }
    }
}

#[inline(always)]
pub fn get<T: Copy + Default>(y: &[T], rows: &[i32], values: &mut [T]) {
    for (&row, value) in rows.iter().zip(values) {
        if let Some(&entry) = y.get(row as usize) {
            *value = entry;
        } else if row >= 0 {
            *value = T::default();
        }
    }
}

#[inline(always)]
pub fn axpy<T: Copy + AddAssign + Mul<Output = T>>(a: T, x: &[T], y: &mut [T]) {
    for (y, &x) in y.iter_mut().zip(x) {
        *y += a * x;
    }
}

#[inline(always)]
pub fn dot(x: &[f64], y: &[f64]) -> f64 {
    let mut sums = [0.0; CHAINS];
    let (x_body, x_tail) = x.as_chunks::<CHAINS>();
    let (y_body, y_tail) = y.as_chunks::<CHAINS>();
    for (x, y) in x_body.iter().zip(y_body) {
        for chain in 0..CHAINS {
            sums[chain] += x[chain] * y[chain];
        }
    }
    for (chain, (&x, &y)) in x_tail.iter().zip(y_tail).enumerate() {
        sums[chain] += x * y;
    }
    sums.into_iter().sum()
}

#[inline(always)]
pub fn norm(x: &[f64]) -> f64 {
    let squares = dot(x, x);
    if is_in_range(squares) { squares.sqrt() } else { scaled_norm(x) }
}

/// Returns whether a sum of squares has neither underflowed nor overflowed.
#[inline(always)]
pub fn is_in_range(squares: f64) -> bool {
    (f64::MIN_POSITIVE..=f64::MAX).contains(&squares)
}

/// The norm of vectors whose squares leave the range of floating-point numbers.
#[cold]
#[inline(never)]
pub fn scaled_norm(x: &[f64]) -> f64 {
    let largest = x.iter().fold(0.0, |largest: f64, v| largest.max(v.abs()));
    if largest == 0.0 || !largest.is_finite() {
        return x.iter().map(|v| v.abs()).sum();
    }
    largest * x.iter().map(|v| (v / largest).powi(2)).sum::<f64>().sqrt()
}

/// The number of entries from which the vectors of `sparse` are long.
const LONG: usize = 1 << 15;

/// Like [`norm`], with a function of its own for long vectors.
#[inline(always)]
pub fn norm_or_long(x: &[f64]) -> f64 {
    if x.len() < LONG { norm(x) } else { long_dot(x, x).sqrt() }
}

/// Like [`dot`], with a function of its own for long vectors.
#[inline(always)]
pub fn dot_or_long(x: &[f64], y: &[f64]) -> f64 {
    if x.len() < LONG { dot(x, y) } else { long_dot(x, y) }
}

/// Like [`axpy`], with a function of its own for long vectors.
#[inline(always)]
pub fn axpy_or_long(a: f64, x: &[f64], y: &mut [f64]) {
    if x.len() < LONG {
        axpy(a, x, y);
    } else {
        long_axpy(a, x, y);
    }
}

/// In place of a function that uses several threads: only its call counts.
#[cold]
#[inline(never)]
pub fn long_dot(x: &[f64], y: &[f64]) -> f64 {
    x.chunks(LONG).zip(y.chunks(LONG)).map(|(x, y)| dot(x, y)).sum()
}

/// See [`long_dot`].
#[cold]
#[inline(never)]
pub fn long_axpy(a: f64, x: &[f64], y: &mut [f64]) {
    axpy(a, x, y);
}
