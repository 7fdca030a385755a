//! Lanes for machines whose vectors are not known here.

use super::simd::{Double, Kernel, MOST_LANES, Simd, Stored4};
use crate::backends::networks::{PanelShape, TileShape};

/// The version for machines without known vectors: four numbers, on which compilers find the vectors.
#[derive(Clone, Copy, Debug)]
pub(super) struct Portable;

impl Portable {
    #[inline(always)]
    fn each<R: Copy + Default>(operation: impl Fn(usize) -> R) -> [R; 4] {
        let mut result = [R::default(); 4];
        for (lane, result) in result.iter_mut().enumerate() {
            *result = operation(lane);
        }
        result
    }
}

/// Where `f64::mul_add` is an instruction of every machine.
const FUSED: bool = cfg!(target_arch = "aarch64");

impl Simd for Portable {
    type Floats = [f64; 4];
    type Mask = [bool; 4];
    type Stored = Stored4;

    const LANES: usize = 4;
    const TILE: TileShape =
        TileShape { columns: 1, rows: 1, panels: Some(PanelShape { tiles: 2, depth: 2, least: 2 }) };

    #[inline(always)]
    fn vectorize<K: Kernel<Self>>(self, kernel: K) -> K::Output {
        kernel.run(self)
    }

    #[inline(always)]
    fn splat(self, value: f64) -> [f64; 4] {
        [value; 4]
    }

    #[inline(always)]
    fn load(self, from: &Stored4) -> [f64; 4] {
        from.0
    }

    #[inline(always)]
    fn store(self, lanes: [f64; 4], to: &mut Stored4) {
        to.0 = lanes;
    }

    #[inline(always)]
    fn add(self, a: [f64; 4], b: [f64; 4]) -> [f64; 4] {
        Self::each(|k| a[k] + b[k])
    }

    #[inline(always)]
    fn sub(self, a: [f64; 4], b: [f64; 4]) -> [f64; 4] {
        Self::each(|k| a[k] - b[k])
    }

    #[inline(always)]
    fn mul(self, a: [f64; 4], b: [f64; 4]) -> [f64; 4] {
        Self::each(|k| a[k] * b[k])
    }

    #[inline(always)]
    fn div(self, a: [f64; 4], b: [f64; 4]) -> [f64; 4] {
        Self::each(|k| a[k] / b[k])
    }

    #[inline(always)]
    fn mul_add(self, a: [f64; 4], b: [f64; 4], c: [f64; 4]) -> [f64; 4] {
        Self::each(|k| if FUSED { a[k].mul_add(b[k], c[k]) } else { a[k] * b[k] + c[k] })
    }

    #[inline(always)]
    fn negate_mul_add(self, a: [f64; 4], b: [f64; 4], c: [f64; 4]) -> [f64; 4] {
        Self::each(|k| if FUSED { (-a[k]).mul_add(b[k], c[k]) } else { c[k] - a[k] * b[k] })
    }

    #[inline(always)]
    fn sqrt(self, a: [f64; 4]) -> [f64; 4] {
        Self::each(|k| a[k].sqrt())
    }

    #[inline(always)]
    fn abs(self, a: [f64; 4]) -> [f64; 4] {
        Self::each(|k| a[k].abs())
    }

    #[inline(always)]
    fn less(self, a: [f64; 4], b: [f64; 4]) -> [bool; 4] {
        Self::each(|k| a[k] < b[k])
    }

    #[inline(always)]
    fn less_or_equal(self, a: [f64; 4], b: [f64; 4]) -> [bool; 4] {
        Self::each(|k| a[k] <= b[k])
    }

    #[inline(always)]
    fn select(self, mask: [bool; 4], a: [f64; 4], b: [f64; 4]) -> [f64; 4] {
        Self::each(|k| if mask[k] { a[k] } else { b[k] })
    }

    #[inline(always)]
    fn all(self, mask: [bool; 4]) -> bool {
        mask == [true; 4]
    }

    #[inline(always)]
    fn numbers(stored: &Stored4) -> [f64; MOST_LANES] {
        let [a, b, c, d] = stored.0;
        [a, b, c, d, 0.0, 0.0, 0.0, 0.0]
    }
}

impl Double for Portable {
    type Single = Self;

    /// Only for tests, on any machine.
    const HAS_SINGLE: bool = cfg!(test);

    #[inline(always)]
    fn single(self) -> Self {
        self
    }

    #[inline(always)]
    fn narrow(self, a: [f64; 4]) -> [f64; 4] {
        // Twelve bits, so that the directions of small networks need corrections too.
        a.map(|a| f64::from_bits(a.to_bits() & (u64::MAX << 41)))
    }

    #[inline(always)]
    fn widen(self, a: [f64; 4]) -> [f64; 4] {
        a
    }

    #[inline(always)]
    fn power_of_two(self, bits: [f64; 4], offset: u64) -> [f64; 4] {
        Self::each(|k| f64::from_bits((bits[k].to_bits().wrapping_add(offset)) << 52))
    }
}
