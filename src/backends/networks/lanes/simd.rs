//! Vectors of lanes, one network a lane.
//!
//! All operations act on each lane separately and follow IEEE 754. With a fused multiply-add, the result of a lane is
//! the same for any number of lanes; the portable version rounds products separately.

use std::ops::{Add, AddAssign, Mul, MulAssign, Neg, Sub, SubAssign};

use bytemuck::Pod;

use crate::backends::networks::TileShape;

/// The most lanes of a machine.
pub(super) const MOST_LANES: usize = 8;

/// The instructions of a machine; a value proves that it has them.
///
/// All functions that work with lanes must be `#[inline(always)]` and run inside of [`Simd::vectorize`]: only code that
/// is inlined there is compiled for the instructions.
pub(super) trait Simd: Copy + Send + Sync {
    /// The lanes of a register.
    type Floats: Copy;
    /// The results of comparisons.
    type Mask: Copy;
    /// The lanes in memory, aligned to the size of a register.
    type Stored: Pod + Send;

    const LANES: usize;
    /// The tiles of the factorization, whose sums fit into the registers.
    const TILE: TileShape;

    /// Runs `kernel` with the instructions of this machine.
    fn vectorize<K: Kernel<Self>>(self, kernel: K) -> K::Output;

    fn splat(self, value: f64) -> Self::Floats;
    fn load(self, from: &Self::Stored) -> Self::Floats;
    fn store(self, lanes: Self::Floats, to: &mut Self::Stored);
    fn add(self, a: Self::Floats, b: Self::Floats) -> Self::Floats;
    fn sub(self, a: Self::Floats, b: Self::Floats) -> Self::Floats;
    fn mul(self, a: Self::Floats, b: Self::Floats) -> Self::Floats;
    fn div(self, a: Self::Floats, b: Self::Floats) -> Self::Floats;
    /// `a b + c`
    fn mul_add(self, a: Self::Floats, b: Self::Floats, c: Self::Floats) -> Self::Floats;
    /// `c - a b`
    fn negate_mul_add(self, a: Self::Floats, b: Self::Floats, c: Self::Floats) -> Self::Floats;
    fn sqrt(self, a: Self::Floats) -> Self::Floats;
    fn abs(self, a: Self::Floats) -> Self::Floats;
    /// `a < b`, false if one is not a number.
    fn less(self, a: Self::Floats, b: Self::Floats) -> Self::Mask;
    /// `a <= b`, false if one is not a number.
    fn less_or_equal(self, a: Self::Floats, b: Self::Floats) -> Self::Mask;
    fn select(self, mask: Self::Mask, a: Self::Floats, b: Self::Floats) -> Self::Floats;
    /// Whether the mask is true for all lanes.
    fn all(self, mask: Self::Mask) -> bool;
    /// The numbers of the lanes in memory; zeros beyond the last lane.
    fn numbers(stored: &Self::Stored) -> [f64; MOST_LANES];
}

/// Instructions for lanes of double precision, in memory as `f64`.
pub(super) trait Double: Simd {
    /// The same lanes with single precision.
    type Single: Simd;

    /// Whether single precision is faster. Where it is not, `Single` may have double precision.
    const HAS_SINGLE: bool;

    fn single(self) -> Self::Single;
    /// Rounds to single precision.
    fn narrow(self, a: Self::Floats) -> <Self::Single as Simd>::Floats;
    fn widen(self, a: <Self::Single as Simd>::Floats) -> Self::Floats;
    /// `2^(k + offset - 1023)` for each lane, where `k` is the integer in the lowest bits of the lane.
    fn power_of_two(self, bits: Self::Floats, offset: u64) -> Self::Floats;
}

/// A computation with lanes.
pub(super) trait Kernel<S> {
    type Output;

    fn run(self, simd: S) -> Self::Output;
}

/// The lanes of a register, with the operators of numbers.
#[derive(Clone, Copy)]
pub(super) struct Lanes<S: Simd>(pub S, pub S::Floats);

macro_rules! operator {
    ($operator:ident, $function:ident) => {
        impl<S: Simd> $operator for Lanes<S> {
            type Output = Self;

            #[inline(always)]
            fn $function(self, other: Self) -> Self {
                Self(self.0, self.0.$function(self.1, other.1))
            }
        }

        impl<S: Simd> $operator<f64> for Lanes<S> {
            type Output = Self;

            #[inline(always)]
            fn $function(self, other: f64) -> Self {
                Self(self.0, self.0.$function(self.1, self.0.splat(other)))
            }
        }

        impl<S: Simd> $operator<Lanes<S>> for f64 {
            type Output = Lanes<S>;

            #[inline(always)]
            fn $function(self, other: Lanes<S>) -> Lanes<S> {
                Lanes(other.0, other.0.$function(other.0.splat(self), other.1))
            }
        }
    };
}

operator!(Add, add);
operator!(Sub, sub);
operator!(Mul, mul);

impl<S: Simd> Neg for Lanes<S> {
    type Output = Self;

    #[inline(always)]
    fn neg(self) -> Self {
        0.0 - self
    }
}

macro_rules! assignment {
    ($operator:ident, $function:ident, $by:ident) => {
        impl<S: Simd> $operator for Lanes<S> {
            #[inline(always)]
            fn $function(&mut self, other: Self) {
                self.1 = self.0.$by(self.1, other.1);
            }
        }
    };
}

assignment!(AddAssign, add_assign, add);
assignment!(SubAssign, sub_assign, sub);
assignment!(MulAssign, mul_assign, mul);

impl<S: Simd> Lanes<S> {
    /// The same number in each lane.
    #[inline(always)]
    pub fn splat(simd: S, value: f64) -> Self {
        Self(simd, simd.splat(value))
    }

    #[inline(always)]
    pub fn load(simd: S, from: &S::Stored) -> Self {
        Self(simd, simd.load(from))
    }

    #[inline(always)]
    pub fn store(self, to: &mut S::Stored) {
        self.0.store(self.1, to);
    }

    /// `self b + c`
    #[inline(always)]
    pub fn mul_add(self, b: Self, c: Self) -> Self {
        Self(self.0, self.0.mul_add(self.1, b.1, c.1))
    }

    /// `self b + c` for numbers.
    #[inline(always)]
    pub fn times_plus(self, b: f64, c: f64) -> Self {
        self.mul_add(Self::splat(self.0, b), Self::splat(self.0, c))
    }

    /// Subtracts `a b`.
    #[inline(always)]
    pub fn subtract_product(&mut self, a: Self, b: Self) {
        self.1 = self.0.negate_mul_add(a.1, b.1, self.1);
    }

    /// `self += a b`
    #[inline(always)]
    pub fn add_product(&mut self, a: Self, b: Self) {
        self.1 = self.0.mul_add(a.1, b.1, self.1);
    }

    #[inline(always)]
    pub fn div(self, other: Self) -> Self {
        Self(self.0, self.0.div(self.1, other.1))
    }

    #[inline(always)]
    pub fn sqrt(self) -> Self {
        Self(self.0, self.0.sqrt(self.1))
    }

    #[inline(always)]
    pub fn abs(self) -> Self {
        Self(self.0, self.0.abs(self.1))
    }

    #[inline(always)]
    pub fn less(self, other: Self) -> S::Mask {
        self.0.less(self.1, other.1)
    }

    #[inline(always)]
    pub fn less_or_equal(self, other: Self) -> S::Mask {
        self.0.less_or_equal(self.1, other.1)
    }

    /// `self` where the mask is true, else `other`.
    #[inline(always)]
    pub fn where_or(self, mask: S::Mask, other: Self) -> Self {
        Self(self.0, self.0.select(mask, self.1, other.1))
    }

    /// The numbers of all lanes; those beyond the last lane are zero.
    #[inline(always)]
    pub fn numbers(self) -> [f64; MOST_LANES] {
        let mut stored = bytemuck::Zeroable::zeroed();
        self.store(&mut stored);
        S::numbers(&stored)
    }
}

impl<S: Double> Lanes<S> {
    /// Lanes with these numbers; those beyond the last lane are ignored.
    #[inline(always)]
    pub fn of_numbers(simd: S, numbers: &[f64; MOST_LANES]) -> Self {
        let mut stored: S::Stored = bytemuck::Zeroable::zeroed();
        numbers_of_mut::<S>(std::slice::from_mut(&mut stored)).copy_from_slice(&numbers[..S::LANES]);
        Self::load(simd, &stored)
    }
}

/// The lanes in memory as numbers, entry after entry.
#[inline(always)]
pub(super) fn numbers_of<S: Double>(stored: &[S::Stored]) -> &[f64] {
    bytemuck::cast_slice(stored)
}

#[inline(always)]
pub(super) fn numbers_of_mut<S: Double>(stored: &mut [S::Stored]) -> &mut [f64] {
    bytemuck::cast_slice_mut(stored)
}

/// Loads block `at` of an array of blocks of `N` entries.
#[inline(always)]
pub(super) fn load<S: Simd, const N: usize>(simd: S, from: &[S::Stored], at: usize) -> [Lanes<S>; N] {
    let mut block = [Lanes::splat(simd, 0.0); N];
    let from = &from.as_chunks::<N>().0[at];
    for k in 0..N {
        block[k] = Lanes::load(simd, &from[k]);
    }
    block
}

/// Stores block `at` of an array of blocks of `N` entries.
#[inline(always)]
pub(super) fn store<S: Simd, const N: usize>(block: &[Lanes<S>; N], to: &mut [S::Stored], at: usize) {
    let to = &mut to.as_chunks_mut::<N>().0[at];
    for k in 0..N {
        block[k].store(&mut to[k]);
    }
}

/// `N` numbers, aligned for registers of this size.
macro_rules! stored {
    ($name:ident, $number:ty, $lanes:literal, $align:literal) => {
        #[derive(Clone, Copy, Debug, bytemuck::Pod, bytemuck::Zeroable)]
        #[repr(C, align($align))]
        pub(super) struct $name(pub [$number; $lanes]);
    };
}

stored!(Stored4, f64, 4, 32);
#[cfg(target_arch = "x86_64")]
stored!(Stored8, f64, 8, 64);
#[cfg(target_arch = "x86_64")]
stored!(StoredSingle8, f32, 8, 32);
