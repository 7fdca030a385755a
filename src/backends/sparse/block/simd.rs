//! Arithmetic on four numbers at once, with vector instructions selected at run time.
//!
//! A node has three unknowns, so a column of a block has three rows; the fourth lane is zero. This wastes a quarter of
//! the multiplications but avoids all shuffles.
//!
//! Every function that the kernels call must be inlined into the function that is compiled for these instructions;
//! otherwise it is compiled without them. This requires neither link-time optimization nor a single codegen unit,
//! provided that the kernels pass no vectors through the closures of `array::map` and `array::from_fn`, which the
//! compiler may not inline.

use faer::traits::RealField;

use crate::las::Scalar;

/// The number of scalars in a [`Simd::Quad`].
pub(in crate::backends::sparse) const QUAD_LEN: usize = 4;

/// One implementation of arithmetic on four numbers at once.
pub trait Simd<T>: Copy {
    /// Four numbers.
    type Quad: Copy;

    /// The largest number of panel rows processed at once: the sums of three columns of each stay in registers.
    const MOST_ROWS: usize;

    /// Returns the same number in all four lanes.
    fn splat(self, value: T) -> Self::Quad;

    /// Loads four numbers from memory.
    fn load(self, from: &[T; QUAD_LEN]) -> Self::Quad;

    /// Stores four numbers to memory.
    fn store(self, quad: Self::Quad, to: &mut [T; QUAD_LEN]);

    /// Returns `a + b`.
    fn add(self, a: Self::Quad, b: Self::Quad) -> Self::Quad;

    /// Returns `a b`.
    fn mul(self, a: Self::Quad, b: Self::Quad) -> Self::Quad;

    /// Returns `c + a b`.
    fn add_mul(self, c: Self::Quad, a: Self::Quad, b: Self::Quad) -> Self::Quad;

    /// Returns `c - a b`.
    fn sub_mul(self, c: Self::Quad, a: Self::Quad, b: Self::Quad) -> Self::Quad;
}

/// A computation that runs with any implementation of [`Simd`].
pub trait WithSimd<T> {
    /// The result of the computation.
    type Output;

    /// Runs the computation. Implementations and all functions that they call must be `#[inline(always)]`: the compiler
    /// generates vector instructions only inside the function that checked for them.
    fn with_simd<S: Simd<T>>(self, simd: S) -> Self::Output;
}

/// The vector instructions that a kernel may use; each level includes the previous ones.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum SimdLevel {
    /// The instructions that every machine of the target has.
    Portable,
    /// AVX2 with fused multiply-add.
    #[cfg(target_arch = "x86_64")]
    Avx2,
    /// AVX-512 with its extensions F, BW, CD, DQ and VL.
    #[cfg(target_arch = "x86_64")]
    Avx512,
}

impl SimdLevel {
    /// Returns the highest level that this machine supports.
    #[inline]
    pub(in crate::backends::sparse) fn of_machine() -> Self {
        #[cfg(target_arch = "x86_64")]
        {
            super::x86::level_of_machine()
        }
        #[cfg(not(target_arch = "x86_64"))]
        {
            Self::Portable
        }
    }
}

/// A scalar type for 3x3 blocks: `f64` or `f32`.
pub trait BlockScalar: Scalar + RealField + bytemuck::Pod {
    /// Runs a kernel with the instructions of the given level, or of the next lower one that this machine supports.
    fn dispatch<K: WithSimd<Self>>(level: SimdLevel, kernel: K) -> K::Output;
}

/// [`Simd`] without explicit vector instructions; the compiler uses the instructions that every machine of the target
/// has. Product and sum remain two operations, because a fused one would call the mathematical library on machines
/// without such an instruction.
#[derive(Clone, Copy, Debug)]
pub(super) struct Portable;

impl<T: Scalar> Simd<T> for Portable {
    type Quad = [T; QUAD_LEN];

    const MOST_ROWS: usize = 3;

    #[inline(always)]
    fn splat(self, value: T) -> [T; QUAD_LEN] {
        [value; QUAD_LEN]
    }

    #[inline(always)]
    fn load(self, from: &[T; QUAD_LEN]) -> [T; QUAD_LEN] {
        *from
    }

    #[inline(always)]
    fn store(self, quad: [T; QUAD_LEN], to: &mut [T; QUAD_LEN]) {
        *to = quad;
    }

    #[inline(always)]
    fn add(self, mut a: [T; QUAD_LEN], b: [T; QUAD_LEN]) -> [T; QUAD_LEN] {
        for k in 0..QUAD_LEN {
            a[k] += b[k];
        }
        a
    }

    #[inline(always)]
    fn mul(self, mut a: [T; QUAD_LEN], b: [T; QUAD_LEN]) -> [T; QUAD_LEN] {
        for k in 0..QUAD_LEN {
            a[k] *= b[k];
        }
        a
    }

    #[inline(always)]
    fn add_mul(self, mut c: [T; QUAD_LEN], a: [T; QUAD_LEN], b: [T; QUAD_LEN]) -> [T; QUAD_LEN] {
        for k in 0..QUAD_LEN {
            c[k] += a[k] * b[k];
        }
        c
    }

    #[inline(always)]
    fn sub_mul(self, mut c: [T; QUAD_LEN], a: [T; QUAD_LEN], b: [T; QUAD_LEN]) -> [T; QUAD_LEN] {
        for k in 0..QUAD_LEN {
            c[k] -= a[k] * b[k];
        }
        c
    }
}

#[cfg(not(target_arch = "x86_64"))]
mod elsewhere {
    use super::{BlockScalar, Portable, SimdLevel, WithSimd};

    impl BlockScalar for f64 {
        #[inline]
        fn dispatch<K: WithSimd<f64>>(_: SimdLevel, kernel: K) -> K::Output {
            kernel.with_simd(Portable)
        }
    }

    impl BlockScalar for f32 {
        #[inline]
        fn dispatch<K: WithSimd<f32>>(_: SimdLevel, kernel: K) -> K::Output {
            kernel.with_simd(Portable)
        }
    }
}
