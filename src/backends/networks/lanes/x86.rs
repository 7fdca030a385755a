//! [`Simd`] for AVX2 and AVX-512. Both perform the same operations on each lane, with fused multiply-adds, and therefore
//! give bitwise identical results.

use pulp::x86::{V3, V4};
use pulp::{NullaryFnOnce, b8, cast, f64x4, f64x8, m64x4, u64x4, u64x8};

use super::simd::{Kernel, Simd, Stored4, Stored8};
use crate::backends::networks::TileShape;

struct With<S, K>(S, K);

impl<S: Simd, K: Kernel<S>> NullaryFnOnce for With<S, K> {
    type Output = K::Output;

    #[inline(always)]
    fn call(self) -> K::Output {
        self.1.run(self.0)
    }
}

macro_rules! lanes {
    ($simd:ty, $lanes:literal, $columns:literal, $rows:literal, $floats:ty, $mask:ty, $stored:ident, $bits:ty,
     $splat:ident, $add:ident, $sub:ident, $mul:ident, $div:ident, $mul_add:ident, $negate_mul_add:ident, $sqrt:ident,
     $abs:ident, $less:ident, $less_or_equal:ident, $select:ident,
     $splat_bits:ident, $add_bits:ident, $shift_bits:ident) => {
        impl Simd for $simd {
            type Floats = $floats;
            type Mask = $mask;
            type Stored = $stored;

            const LANES: usize = $lanes;
            const TILE: TileShape = TileShape { columns: $columns, rows: $rows };

            #[inline(always)]
            fn vectorize<K: Kernel<Self>>(self, kernel: K) -> K::Output {
                <$simd>::vectorize(self, With(self, kernel))
            }

            #[inline(always)]
            fn splat(self, value: f64) -> $floats {
                self.$splat(value)
            }

            #[inline(always)]
            fn load(self, from: &$stored) -> $floats {
                cast(from.0)
            }

            #[inline(always)]
            fn store(self, lanes: $floats, to: &mut $stored) {
                to.0 = cast(lanes);
            }

            #[inline(always)]
            fn add(self, a: $floats, b: $floats) -> $floats {
                self.$add(a, b)
            }

            #[inline(always)]
            fn sub(self, a: $floats, b: $floats) -> $floats {
                self.$sub(a, b)
            }

            #[inline(always)]
            fn mul(self, a: $floats, b: $floats) -> $floats {
                self.$mul(a, b)
            }

            #[inline(always)]
            fn div(self, a: $floats, b: $floats) -> $floats {
                self.$div(a, b)
            }

            #[inline(always)]
            fn mul_add(self, a: $floats, b: $floats, c: $floats) -> $floats {
                self.$mul_add(a, b, c)
            }

            #[inline(always)]
            fn negate_mul_add(self, a: $floats, b: $floats, c: $floats) -> $floats {
                self.$negate_mul_add(a, b, c)
            }

            #[inline(always)]
            fn sqrt(self, a: $floats) -> $floats {
                self.$sqrt(a)
            }

            #[inline(always)]
            fn abs(self, a: $floats) -> $floats {
                self.$abs(a)
            }

            #[inline(always)]
            fn less(self, a: $floats, b: $floats) -> $mask {
                self.$less(a, b)
            }

            #[inline(always)]
            fn less_or_equal(self, a: $floats, b: $floats) -> $mask {
                self.$less_or_equal(a, b)
            }

            #[inline(always)]
            fn select(self, mask: $mask, a: $floats, b: $floats) -> $floats {
                self.$select(mask, a, b)
            }

            #[inline(always)]
            fn power_of_two(self, bits: $floats, offset: u64) -> $floats {
                let bits: $bits = cast(bits);
                cast(self.$shift_bits::<52>(self.$add_bits(bits, self.$splat_bits(offset))))
            }
        }
    };
}

lanes!(
    V3,
    4,
    1,
    1,
    f64x4,
    m64x4,
    Stored4,
    u64x4,
    splat_f64x4,
    add_f64x4,
    sub_f64x4,
    mul_f64x4,
    div_f64x4,
    mul_add_f64x4,
    negate_mul_add_f64x4,
    sqrt_f64x4,
    abs_f64x4,
    cmp_lt_f64x4,
    cmp_le_f64x4,
    select_f64x4,
    splat_u64x4,
    wrapping_add_u64x4,
    shl_const_u64x4
);
lanes!(
    V4,
    8,
    2,
    1,
    f64x8,
    b8,
    Stored8,
    u64x8,
    splat_f64x8,
    add_f64x8,
    sub_f64x8,
    mul_f64x8,
    div_f64x8,
    mul_add_f64x8,
    negate_mul_add_f64x8,
    sqrt_f64x8,
    abs_f64x8,
    cmp_lt_f64x8,
    cmp_le_f64x8,
    select_f64x8,
    splat_u64x8,
    wrapping_add_u64x8,
    shl_const_u64x8
);
