//! Four numbers at once: vector registers where the machine has them, found out at run time.
//!
//! A node has three unknowns, and so a column of a block has three rows; the fourth lane holds zeros. That wastes a
//! quarter of the multiplications and spares every shuffle.

use faer::traits::RealField;

use crate::las::Scalar;

/// Numbers in a [`Lanes::Quad`].
pub(in crate::backends::sparse) const LANES: usize = 4;

/// One way of computing with four numbers at once.
pub trait Lanes<T>: Copy {
    /// The four numbers.
    type Quad: Copy;

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

/// A scalar that blocks of three can be computed with; `f64` and `f32` are.
pub trait BlockScalar: Scalar + RealField {
    /// Runs a kernel with the widest lanes that this machine has.
    fn dispatch<K: Kernel<Self>>(kernel: K) -> K::Output;
}

/// Lanes without any vector instruction in the source; the compiler uses those that every machine of the target has. A
/// product and a sum stay two operations: fused ones would be a call of the mathematical library where there is no
/// instruction for them.
#[derive(Clone, Copy, Debug)]
pub(super) struct Portable;

impl<T: Scalar> Lanes<T> for Portable {
    type Quad = [T; LANES];

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
    fn add(self, a: [T; LANES], b: [T; LANES]) -> [T; LANES] {
        std::array::from_fn(|k| a[k] + b[k])
    }

    #[inline(always)]
    fn mul(self, a: [T; LANES], b: [T; LANES]) -> [T; LANES] {
        std::array::from_fn(|k| a[k] * b[k])
    }

    #[inline(always)]
    fn add_mul(self, c: [T; LANES], a: [T; LANES], b: [T; LANES]) -> [T; LANES] {
        std::array::from_fn(|k| c[k] + a[k] * b[k])
    }

    #[inline(always)]
    fn sub_mul(self, c: [T; LANES], a: [T; LANES], b: [T; LANES]) -> [T; LANES] {
        std::array::from_fn(|k| c[k] - a[k] * b[k])
    }
}

#[cfg(target_arch = "x86_64")]
mod x86 {
    use std::marker::PhantomData;

    use pulp::x86::V3;
    use pulp::{NullaryFnOnce, cast, f32x4, f64x4};

    use super::{BlockScalar, Kernel, LANES, Lanes, Portable};

    /// A kernel for scalars `T`, and the proof that this machine has AVX2 and fused multiply-add.
    struct WithAvx2<K, T> {
        avx2: V3,
        kernel: K,
        scalar: PhantomData<T>,
    }

    impl<T, K: Kernel<T>> NullaryFnOnce for WithAvx2<K, T>
    where
        V3: Lanes<T>,
    {
        type Output = K::Output;

        #[inline(always)]
        fn call(self) -> K::Output {
            self.kernel.run(self.avx2)
        }
    }

    macro_rules! avx2 {
        ($scalar:ty, $quad:ty, $splat:ident, $add:ident, $mul:ident, $mul_add:ident, $negate_mul_add:ident) => {
            impl Lanes<$scalar> for V3 {
                type Quad = $quad;

                #[inline(always)]
                fn splat(self, value: $scalar) -> $quad {
                    self.$splat(value)
                }

                #[inline(always)]
                fn load(self, from: &[$scalar; LANES]) -> $quad {
                    cast(*from)
                }

                #[inline(always)]
                fn store(self, quad: $quad, to: &mut [$scalar; LANES]) {
                    *to = cast(quad);
                }

                #[inline(always)]
                fn add(self, a: $quad, b: $quad) -> $quad {
                    self.$add(a, b)
                }

                #[inline(always)]
                fn mul(self, a: $quad, b: $quad) -> $quad {
                    self.$mul(a, b)
                }

                #[inline(always)]
                fn add_mul(self, c: $quad, a: $quad, b: $quad) -> $quad {
                    self.$mul_add(a, b, c)
                }

                #[inline(always)]
                fn sub_mul(self, c: $quad, a: $quad, b: $quad) -> $quad {
                    self.$negate_mul_add(a, b, c)
                }
            }

            impl BlockScalar for $scalar {
                #[inline]
                fn dispatch<K: Kernel<$scalar>>(kernel: K) -> K::Output {
                    match V3::try_new() {
                        Some(avx2) => avx2.vectorize(WithAvx2 { avx2, kernel, scalar: PhantomData }),
                        None => kernel.run(Portable),
                    }
                }
            }
        };
    }

    avx2!(f64, f64x4, splat_f64x4, add_f64x4, mul_f64x4, mul_add_f64x4, negate_mul_add_f64x4);
    avx2!(f32, f32x4, splat_f32x4, add_f32x4, mul_f32x4, mul_add_f32x4, negate_mul_add_f32x4);
}

#[cfg(not(target_arch = "x86_64"))]
mod elsewhere {
    use super::{BlockScalar, Kernel, Portable};

    impl BlockScalar for f64 {
        #[inline]
        fn dispatch<K: Kernel<f64>>(kernel: K) -> K::Output {
            kernel.run(Portable)
        }
    }

    impl BlockScalar for f32 {
        #[inline]
        fn dispatch<K: Kernel<f32>>(kernel: K) -> K::Output {
            kernel.run(Portable)
        }
    }
}
