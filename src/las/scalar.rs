//! The number types a backend can compute with: `f64`, `f32`, and several of them side by side.

use std::fmt::{Debug, Display, LowerExp};
use std::iter::Sum;
use std::ops::Neg;

use num_traits::{Float, NumAssign};

/// What an entry of a vector or matrix is: a number, or one number a lane.
///
/// Hot verbs and products need no more than this arithmetic. Whoever compares or takes roots asks for a [`Scalar`].
pub trait Value: NumAssign + Neg<Output = Self> + Copy + Default + Debug + Send + Sync + 'static {
    /// One number: itself, or what stands in a lane.
    type Real: Scalar;

    /// How many numbers there are.
    const LANES: usize;

    /// The same number in every lane.
    fn splat(value: Self::Real) -> Self;

    /// The number nearest to `value`, the same in every lane.
    #[inline(always)]
    fn every(value: f64) -> Self {
        Self::splat(Scalar::of(value))
    }

    /// The number that `of` gives for each lane.
    fn from_lanes(of: impl FnMut(usize) -> Self::Real) -> Self;

    /// The number in a lane.
    ///
    /// # Panics
    /// Where there is no such lane.
    fn lane(&self, lane: usize) -> Self::Real;
}

/// A real floating-point number that vectors and matrices are made of.
///
/// `f64` and `f32` implement it; nothing else needs to.
pub trait Scalar: Float + Value<Real = Self> + Sum + Display + LowerExp {
    /// The number nearest to `value`.
    fn of(value: f64) -> Self;

    /// This number in double precision, exactly.
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

/// The signed integer a backend addresses rows and columns with.
///
/// Signed, because a negative index is part of every verb's meaning: it stands for a constrained unknown, whose
/// writes are dropped and whose reads leave the caller's buffer alone.
pub trait Index: Copy + Ord + Debug + Display + Send + Sync + 'static {
    /// The index of a constrained unknown.
    const CONSTRAINED: Self;

    /// `position` as an index.
    ///
    /// # Panics
    /// In debug builds, where `position` does not fit the type.
    fn of(position: usize) -> Self;

    /// The position meant, or `None` for a constrained unknown.
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
