//! The number types a backend can compute with: `f64` and `f32`.

use std::fmt::{Debug, Display, LowerExp};
use std::iter::Sum;

use num_traits::{Float, NumAssign};

/// A real floating-point number that vectors and matrices are made of.
///
/// `f64` and `f32` implement it; nothing else needs to.
pub trait Scalar: Float + NumAssign + Sum + Default + Debug + Display + LowerExp + Send + Sync + 'static {
    /// The number nearest to `value`.
    fn of(value: f64) -> Self;

    /// This number in double precision, exactly.
    fn as_f64(self) -> f64;
}

impl Scalar for f64 {
    #[inline(always)]
    fn of(value: f64) -> Self {
        value
    }

    #[inline(always)]
    fn as_f64(self) -> f64 {
        self
    }
}

impl Scalar for f32 {
    #[inline(always)]
    fn of(value: f64) -> Self {
        value as f32
    }

    #[inline(always)]
    fn as_f64(self) -> f64 {
        f64::from(self)
    }
}

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
