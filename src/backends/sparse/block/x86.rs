//! [`Simd`] for AVX2 and AVX-512.
//!
//! Both store a column of a block in a register of four lanes. AVX-512 has twice as many registers, enough for the sums
//! of six rows instead of three. Both perform the same operations on each number in the same order and therefore give
//! bitwise identical factors. A variant with two block columns in one register of eight lanes was at least a tenth
//! slower than AVX2 on a processor that splits such operations (Zen 4), because panels are laid out for four lanes.

use std::marker::PhantomData;

use pulp::x86::{V3, V4};
use pulp::{NullaryFnOnce, cast, f32x4, f64x4};

use super::simd::{BlockScalar, Portable, QUAD_LEN, Simd, SimdLevel, WithSimd};

/// A kernel for scalars `T`, and the proof `S` that this machine supports the instructions.
struct With<S, K, T> {
    simd: S,
    kernel: K,
    scalar: PhantomData<T>,
}

impl<T, S: Simd<T>, K: WithSimd<T>> NullaryFnOnce for With<S, K, T> {
    type Output = K::Output;

    #[inline(always)]
    fn call(self) -> K::Output {
        self.kernel.with_simd(self.simd)
    }
}

#[inline]
pub(super) fn level_of_machine() -> SimdLevel {
    if V4::is_available() {
        SimdLevel::Avx512
    } else if V3::is_available() {
        SimdLevel::Avx2
    } else {
        SimdLevel::Portable
    }
}

macro_rules! quads {
    ($simd:ty, $most_rows:literal, $scalar:ty, $quad:ty,
     $splat:ident, $add:ident, $mul:ident, $mul_add:ident, $negate_mul_add:ident) => {
        impl Simd<$scalar> for $simd {
            type Quad = $quad;

            const MOST_ROWS: usize = $most_rows;

            #[inline(always)]
            fn splat(self, value: $scalar) -> $quad {
                self.$splat(value)
            }

            #[inline(always)]
            fn load(self, from: &[$scalar; QUAD_LEN]) -> $quad {
                cast(*from)
            }

            #[inline(always)]
            fn store(self, quad: $quad, to: &mut [$scalar; QUAD_LEN]) {
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
    };
}

macro_rules! scalar {
    ($scalar:ty, $quad:ty, $splat:ident, $add:ident, $mul:ident, $mul_add:ident, $negate_mul_add:ident) => {
        quads!(V3, 3, $scalar, $quad, $splat, $add, $mul, $mul_add, $negate_mul_add);
        quads!(V4, 6, $scalar, $quad, $splat, $add, $mul, $mul_add, $negate_mul_add);

        impl BlockScalar for $scalar {
            #[inline]
            fn dispatch<K: WithSimd<$scalar>>(level: SimdLevel, kernel: K) -> K::Output {
                if level >= SimdLevel::Avx512
                    && let Some(simd) = V4::try_new()
                {
                    return simd.vectorize(With { simd, kernel, scalar: PhantomData::<$scalar> });
                }
                if level >= SimdLevel::Avx2
                    && let Some(simd) = V3::try_new()
                {
                    return simd.vectorize(With { simd, kernel, scalar: PhantomData::<$scalar> });
                }
                kernel.with_simd(Portable)
            }
        }
    };
}

scalar!(f64, f64x4, splat_f64x4, add_f64x4, mul_f64x4, mul_add_f64x4, negate_mul_add_f64x4);
scalar!(f32, f32x4, splat_f32x4, add_f32x4, mul_f32x4, mul_add_f32x4, negate_mul_add_f32x4);
