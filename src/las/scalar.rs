//! The number types of backends: `f64`, `f32`, and lanes of several numbers.

use std::fmt::{Debug, Display, LowerExp};
use std::iter::Sum;
use std::ops::Neg;

use num_traits::{Float, NumAssign};

/// An entry of a vector or matrix: one number, or one number per lane.
///
/// Vector and matrix operations and products need only this arithmetic. Code that compares numbers or takes square
/// roots requires [`Scalar`].
pub trait Value: NumAssign + Neg<Output = Self> + Copy + Default + Debug + Send + Sync + 'static {
    /// The type of a single number: `Self`, or the number in a lane.
    type Real: Scalar;

    /// The number of lanes.
    const LANES: usize;

    /// Returns a value with the same number in every lane.
    fn splat(value: Self::Real) -> Self;

    /// Returns the number nearest to `value` in every lane.
    #[inline(always)]
    fn every(value: f64) -> Self {
        Self::splat(Scalar::of(value))
    }

    /// Returns the value whose lane `k` is `of(k)`.
    fn from_lanes(of: impl FnMut(usize) -> Self::Real) -> Self;

    /// Returns the number in one lane.
    ///
    /// # Panics
    /// Panics if `lane` is not below [`Value::LANES`]; `f64` and `f32` check this only in debug builds.
    fn lane(&self, lane: usize) -> Self::Real;
}

/// A real floating-point number: `f64` or `f32`.
pub trait Scalar: Float + Value<Real = Self> + Sum + Display + LowerExp {
    /// Returns the number nearest to `value`.
    fn of(value: f64) -> Self;

    /// Returns this number in double precision, exactly.
    fn as_f64(self) -> f64;
}

macro_rules! one_lane {
    ($($t:ty),*) => {$(
        impl Value for $t {
            type Real = Self;

            const LANES: usize = 1;

            #[inline(always)]
            fn splat(value: Self) -> Self {
                value
            }

            #[inline(always)]
            fn from_lanes(mut of: impl FnMut(usize) -> Self) -> Self {
                of(0)
            }

            #[inline(always)]
            fn lane(&self, lane: usize) -> Self {
                debug_assert_eq!(lane, 0, "a number has one lane");
                *self
            }
        }

        impl Scalar for $t {
            #[inline(always)]
            fn of(value: f64) -> Self {
                value as $t
            }

            #[inline(always)]
            fn as_f64(self) -> f64 {
                f64::from(self)
            }
        }
    )*};
}

one_lane!(f64, f32);

/// The signed integer type of row and column indices.
///
/// The type is signed because a negative index denotes a constrained unknown: writes to it are dropped, and reads leave
/// the caller's buffer unchanged. Every index type can represent the unknowns of elements, which are `i32`.
pub trait Index: From<i32> + Copy + Ord + Debug + Display + Send + Sync + 'static {
    /// The index of a constrained unknown.
    const CONSTRAINED: Self;

    /// Converts `position` to an index.
    ///
    /// # Panics
    /// Panics in debug builds if `position` does not fit the type.
    fn of(position: usize) -> Self;

    /// Returns the position, or `None` for a constrained unknown.
    fn position(self) -> Option<usize>;
}

macro_rules! signed_index {
    ($($t:ty),*) => {$(
        impl Index for $t {
            const CONSTRAINED: Self = -1;

            #[inline(always)]
            fn of(position: usize) -> Self {
                debug_assert!(<$t>::try_from(position).is_ok(), "index {position} does not fit {}", stringify!($t));
                position as $t
            }

            #[inline(always)]
            fn position(self) -> Option<usize> {
                if self < 0 { None } else { Some(self as usize) }
            }
        }
    )*};
}

signed_index!(i32, i64);
