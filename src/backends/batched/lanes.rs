//! Arithmetic on several numbers at once.

use std::ops::{Add, AddAssign, Div, DivAssign, Mul, MulAssign, Neg, Rem, RemAssign, Sub, SubAssign};

use bytemuck::{Pod, Zeroable};
use num_traits::{Num, One, Zero};

use crate::las::{Layout, Payload, Scalar, Value};

/// `N` numbers, one per lane; arithmetic acts on each lane separately.
///
/// The compiler generates vector instructions: four `f64` fill one 32-byte register if the target has such registers,
/// else two of 16 bytes.
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
#[repr(transparent)]
pub struct Lanes<T, const N: usize>(pub [T; N]);

impl<T: Scalar, const N: usize> Default for Lanes<T, N> {
    #[inline(always)]
    fn default() -> Self {
        Self([T::default(); N])
    }
}

macro_rules! by_lane {
    ($($operator:ident $function:ident, $assign:ident $assign_function:ident;)*) => {$(
        impl<T: Scalar, const N: usize> $operator for Lanes<T, N> {
            type Output = Self;

            #[inline(always)]
            fn $function(self, other: Self) -> Self {
                Self(std::array::from_fn(|lane| self.0[lane].$function(other.0[lane])))
            }
        }

        impl<T: Scalar, const N: usize> $assign for Lanes<T, N> {
            #[inline(always)]
            fn $assign_function(&mut self, other: Self) {
                for (value, other) in self.0.iter_mut().zip(other.0) {
                    value.$assign_function(other);
                }
            }
        }
    )*};
}

by_lane! {
    Add add, AddAssign add_assign;
    Sub sub, SubAssign sub_assign;
    Mul mul, MulAssign mul_assign;
    Div div, DivAssign div_assign;
    Rem rem, RemAssign rem_assign;
}

impl<T: Scalar, const N: usize> Neg for Lanes<T, N> {
    type Output = Self;

    #[inline(always)]
    fn neg(self) -> Self {
        Self(self.0.map(Neg::neg))
    }
}

impl<T: Scalar, const N: usize> Zero for Lanes<T, N> {
    #[inline(always)]
    fn zero() -> Self {
        Self([T::zero(); N])
    }

    #[inline(always)]
    fn is_zero(&self) -> bool {
        self.0.iter().all(T::is_zero)
    }
}

impl<T: Scalar, const N: usize> One for Lanes<T, N> {
    #[inline(always)]
    fn one() -> Self {
        Self([T::one(); N])
    }
}

impl<T: Scalar, const N: usize> Num for Lanes<T, N> {
    type FromStrRadixErr = T::FromStrRadixErr;

    /// Parses a number and copies it to every lane.
    fn from_str_radix(text: &str, radix: u32) -> Result<Self, Self::FromStrRadixErr> {
        T::from_str_radix(text, radix).map(Self::splat)
    }
}

impl<T: Scalar, const N: usize> Value for Lanes<T, N> {
    type Real = T;

    const LANES: usize = N;

    #[inline(always)]
    fn splat(value: T) -> Self {
        Self([value; N])
    }

    #[inline(always)]
    fn from_lanes(of: impl FnMut(usize) -> T) -> Self {
        Self(std::array::from_fn(of))
    }

    #[inline(always)]
    fn lane(&self, lane: usize) -> T {
        self.0[lane]
    }
}

/// In a message, lanes are an array.
impl<T: Payload, const N: usize> Payload for Lanes<T, N> {
    fn layout() -> Layout {
        <[T; N]>::layout()
    }
}
