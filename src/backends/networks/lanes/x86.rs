//! [`Simd`] for AVX2 and AVX-512. Both perform the same operations on each lane, with fused multiply-adds, and
//! therefore give bitwise identical results in double precision.

use pulp::x86::{V3, V4};
use pulp::{NullaryFnOnce, b8, cast, f32x8, f64x4, f64x8, m64x4, u64x4, u64x8};

use super::simd::{Double, Kernel, MOST_LANES, Simd, Stored4, Stored8, StoredSingle8};
use crate::backends::networks::{PanelShape, TileShape};

struct With<S, K>(S, K);

impl<S: Simd, K: Kernel<S>> NullaryFnOnce for With<S, K> {
    type Output = K::Output;

    #[inline(always)]
    fn call(self) -> K::Output {
        self.1.run(self.0)
    }
}

/// Panels are of use to factors larger than the second-level cache.
const PANELS: Option<PanelShape> = Some(PanelShape { tiles: 8, depth: 16, least: 64 });

macro_rules! lanes {
    ($simd:ty, $instructions:ty, $number:ty, $lanes:literal, $columns:literal, $floats:ty, $mask:ty,
     $stored:ident, $splat:ident, $add:ident, $sub:ident, $mul:ident, $div:ident, $mul_add:ident, $negate_mul_add:ident, $sqrt:ident,
     $abs:ident, $less:ident, $less_or_equal:ident, $select:ident, $all:expr) => {
        impl Simd for $simd {
            type Floats = $floats;
            type Mask = $mask;
            type Stored = $stored;

            const LANES: usize = $lanes;
            const TILE: TileShape = TileShape { columns: $columns, rows: 1, panels: PANELS };

            #[inline(always)]
            fn vectorize<K: Kernel<Self>>(self, kernel: K) -> K::Output {
                <$instructions>::vectorize(self.into(), With(self, kernel))
            }

            #[inline(always)]
            fn splat(self, value: f64) -> $floats {
                <$instructions>::from(self).$splat(value as $number)
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
                <$instructions>::from(self).$add(a, b)
            }

            #[inline(always)]
            fn sub(self, a: $floats, b: $floats) -> $floats {
                <$instructions>::from(self).$sub(a, b)
            }

            #[inline(always)]
            fn mul(self, a: $floats, b: $floats) -> $floats {
                <$instructions>::from(self).$mul(a, b)
            }

            #[inline(always)]
            fn div(self, a: $floats, b: $floats) -> $floats {
                <$instructions>::from(self).$div(a, b)
            }

            #[inline(always)]
            fn mul_add(self, a: $floats, b: $floats, c: $floats) -> $floats {
                <$instructions>::from(self).$mul_add(a, b, c)
            }

            #[inline(always)]
            fn negate_mul_add(self, a: $floats, b: $floats, c: $floats) -> $floats {
                <$instructions>::from(self).$negate_mul_add(a, b, c)
            }

            #[inline(always)]
            fn sqrt(self, a: $floats) -> $floats {
                <$instructions>::from(self).$sqrt(a)
            }

            #[inline(always)]
            fn abs(self, a: $floats) -> $floats {
                <$instructions>::from(self).$abs(a)
            }

            #[inline(always)]
            fn less(self, a: $floats, b: $floats) -> $mask {
                <$instructions>::from(self).$less(a, b)
            }

            #[inline(always)]
            fn less_or_equal(self, a: $floats, b: $floats) -> $mask {
                <$instructions>::from(self).$less_or_equal(a, b)
            }

            #[inline(always)]
            fn select(self, mask: $mask, a: $floats, b: $floats) -> $floats {
                <$instructions>::from(self).$select(mask, a, b)
            }

            #[inline(always)]
            fn all(self, mask: $mask) -> bool {
                $all(self, mask)
            }

            #[inline(always)]
            fn numbers(stored: &$stored) -> [f64; MOST_LANES] {
                let mut numbers = [0.0; MOST_LANES];
                for (number, &of_lane) in numbers.iter_mut().zip(&stored.0) {
                    *number = of_lane.into();
                }
                numbers
            }
        }
    };
}

/// Eight lanes of single precision, in half a register of AVX-512.
#[derive(Clone, Copy)]
pub(super) struct Single(V4);

impl From<Single> for V4 {
    #[inline(always)]
    fn from(single: Single) -> Self {
        single.0
    }
}

lanes!(
    V3,
    V3,
    f64,
    4,
    1,
    f64x4,
    m64x4,
    Stored4,
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
    |simd: V3, mask: m64x4| simd.avx._mm256_movemask_pd(cast(mask)) == 0b1111
);
lanes!(
    V4,
    V4,
    f64,
    8,
    2,
    f64x8,
    b8,
    Stored8,
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
    |_, mask: b8| mask.0 == u8::MAX
);
lanes!(
    Single,
    V4,
    f32,
    8,
    2,
    f32x8,
    b8,
    StoredSingle8,
    splat_f32x8,
    add_f32x8,
    sub_f32x8,
    mul_f32x8,
    div_f32x8,
    mul_add_f32x8,
    negate_mul_add_f32x8,
    sqrt_f32x8,
    abs_f32x8,
    cmp_lt_f32x8,
    cmp_le_f32x8,
    select_f32x8,
    |_, mask: b8| mask.0 == u8::MAX
);

/// A register of AVX2 holds eight numbers of single precision, but four networks alternate in memory.
impl Double for V3 {
    type Single = Self;

    const HAS_SINGLE: bool = false;

    #[inline(always)]
    fn single(self) -> Self {
        self
    }

    #[inline(always)]
    fn narrow(self, a: f64x4) -> f64x4 {
        a
    }

    #[inline(always)]
    fn widen(self, a: f64x4) -> f64x4 {
        a
    }

    #[inline(always)]
    fn power_of_two(self, bits: f64x4, offset: u64) -> f64x4 {
        let bits: u64x4 = cast(bits);
        cast(self.shl_const_u64x4::<52>(self.wrapping_add_u64x4(bits, self.splat_u64x4(offset))))
    }
}

impl Double for V4 {
    type Single = Single;

    const HAS_SINGLE: bool = true;

    #[inline(always)]
    fn single(self) -> Single {
        Single(self)
    }

    #[inline(always)]
    fn narrow(self, a: f64x8) -> f32x8 {
        self.convert_f64x8_to_f32x8(a)
    }

    #[inline(always)]
    fn widen(self, a: f32x8) -> f64x8 {
        self.convert_f32x8_to_f64x8(a)
    }

    #[inline(always)]
    fn power_of_two(self, bits: f64x8, offset: u64) -> f64x8 {
        let bits: u64x8 = cast(bits);
        cast(self.shl_const_u64x8::<52>(self.wrapping_add_u64x8(bits, self.splat_u64x8(offset))))
    }
}
