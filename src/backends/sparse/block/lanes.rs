//! Four numbers at once: vector registers where the machine has them, found out at run time.
//!
//! A node has three unknowns, and so a column of a block has three rows; the fourth lane holds zeros. That wastes a
//! quarter of the multiplications and spares every shuffle.
//!
//! Whatever the kernels call is inlined into the function that is compiled for these registers, or it is compiled without
//! them. Neither link-time optimization nor a single codegen unit is needed for that as long as the kernels keep vectors
//! away from the closures of `array::map` and `array::from_fn`, which the compiler may well leave calls.

use faer::traits::RealField;

use crate::las::Scalar;

/// Numbers in a [`Lanes::Quad`].
pub(in crate::backends::sparse) const LANES: usize = 4;

/// One way of computing with four numbers at once.
pub trait Lanes<T>: Copy {
    /// The four numbers.
    type Quad: Copy;

    /// Rows of a panel that are computed with at once, at most: sums for three columns of each stay in registers.
    const MOST_ROWS: usize;

    /// The same number four times.
    fn splat(self, value: T) -> Self::Quad;

    /// From memory.
    fn load(self, from: &[T; LANES]) -> Self::Quad;

    /// To memory.
    fn store(self, quad: Self::Quad, to: &mut [T; LANES]);

    /// `a + b`.
    fn add(self, a: Self::Quad, b: Self::Quad) -> Self::Quad;

    /// `a b`.
    fn mul(self, a: Self::Quad, b: Self::Quad) -> Self::Quad;

    /// `c + a b`.
    fn add_mul(self, c: Self::Quad, a: Self::Quad, b: Self::Quad) -> Self::Quad;

    /// `c - a b`.
    fn sub_mul(self, c: Self::Quad, a: Self::Quad, b: Self::Quad) -> Self::Quad;
}

/// Work to be done with whatever lanes the machine has.
pub trait Kernel<T> {
    /// What it returns.
    type Output;

    /// Does it. Implementations are `#[inline(always)]`, all the way down: vector instructions are only generated inside
    /// of the function that checked for them.
    fn run<L: Lanes<T>>(self, lanes: L) -> Self::Output;
}

/// The widest registers that a kernel may use.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Width {
    /// Those that every machine of the target has.
    Portable,
    /// AVX2 with fused multiply-add.
    #[cfg(target_arch = "x86_64")]
    Avx2,
    /// AVX-512 with its extensions F, BW, CD, DQ and VL.
    #[cfg(target_arch = "x86_64")]
    Avx512,
}

impl Width {
    /// The widest of this machine.
    #[inline]
    pub(in crate::backends::sparse) fn of_machine() -> Self {
        #[cfg(target_arch = "x86_64")]
        {
            super::x86::width_of_machine()
        }
        #[cfg(not(target_arch = "x86_64"))]
        {
            Self::Portable
        }
    }
}

/// A scalar that blocks of three can be computed with; `f64` and `f32` are.
pub trait BlockScalar: Scalar + RealField {
    /// Runs a kernel with registers of the width given, or the widest below it that this machine has.
    fn dispatch<K: Kernel<Self>>(width: Width, kernel: K) -> K::Output;
}

/// Lanes without any vector instruction in the source; the compiler uses those that every machine of the target has. A
/// product and a sum stay two operations: fused ones would be a call of the mathematical library where there is no
/// instruction for them.
#[derive(Clone, Copy, Debug)]
pub(super) struct Portable;

impl<T: Scalar> Lanes<T> for Portable {
    type Quad = [T; LANES];

    const MOST_ROWS: usize = 3;

    #[inline(always)]
    fn splat(self, value: T) -> [T; LANES] {
        [value; LANES]
    }

    #[inline(always)]
    fn load(self, from: &[T; LANES]) -> [T; LANES] {
        *from
    }

    #[inline(always)]
    fn store(self, quad: [T; LANES], to: &mut [T; LANES]) {
        *to = quad;
    }

    #[inline(always)]
    fn add(self, mut a: [T; LANES], b: [T; LANES]) -> [T; LANES] {
        for k in 0..LANES {
            a[k] += b[k];
        }
        a
    }

    #[inline(always)]
    fn mul(self, mut a: [T; LANES], b: [T; LANES]) -> [T; LANES] {
        for k in 0..LANES {
            a[k] *= b[k];
        }
        a
    }

    #[inline(always)]
    fn add_mul(self, mut c: [T; LANES], a: [T; LANES], b: [T; LANES]) -> [T; LANES] {
        for k in 0..LANES {
            c[k] += a[k] * b[k];
        }
        c
    }

    #[inline(always)]
    fn sub_mul(self, mut c: [T; LANES], a: [T; LANES], b: [T; LANES]) -> [T; LANES] {
        for k in 0..LANES {
            c[k] -= a[k] * b[k];
        }
        c
    }
}

#[cfg(not(target_arch = "x86_64"))]
mod elsewhere {
    use super::{BlockScalar, Kernel, Portable, Width};

    impl BlockScalar for f64 {
        #[inline]
        fn dispatch<K: Kernel<f64>>(_: Width, kernel: K) -> K::Output {
            kernel.run(Portable)
        }
    }

    impl BlockScalar for f32 {
        #[inline]
        fn dispatch<K: Kernel<f32>>(_: Width, kernel: K) -> K::Output {
            kernel.run(Portable)
        }
    }
}
