//! Buckling in compression: a modifier of any law.

use super::batch::Formula;
use super::{BUCKLING_STRAIN, COMPRESSION, FiberLaw};
use crate::fiber::simd::{Kernel, vectorized};

/// A law whose fibers buckle: that of `law` in tension, and below stretch 1 a slope that falls from `E` to `r E`.
///
/// With the compression `e = 1 - lambda`, the residual stiffness `r`, the buckling strain `w`, `x = e / w` and the
/// smoothstep `S(x) = 3 x^2 - 2 x^3`, in `0 <= x <= 1`:
///
/// ```text
/// s' = E (1 - (1 - r) S)
/// s  = -E w (x - (1 - r) (x^3 - x^4 / 2))
/// W  = E w^2 (x^2 / 2 - (1 - r) (x^4 / 4 - x^5 / 10))
/// ```
///
/// and for `x > 1`, with `y = x - 1`: `s' = r E`, `s = -E w ((1 + r) / 2 + r y)`,
/// `W = E w^2 (1/2 - 3 (1 - r) / 20 + (1 + r) y / 2 + r y^2 / 2)`. The stress is C1 at stretch 1 and C2 at `1 - w`. The
/// behavior of `law` in compression has no effect; `E` is its slope at rest.
///
/// A small `r` keeps slack fibers from making the stiffness of a network singular; `r = 1` is Hooke's law in
/// compression.
#[derive(Clone, Copy, Debug)]
pub struct Buckling<'a> {
    law: &'a dyn FiberLaw,
    buckling: CompressiveBranch,
}

/// The behavior below stretch 1.
#[derive(Clone, Copy, Debug)]
struct CompressiveBranch {
    /// `E`.
    youngs_modulus: f64,
    /// `r`.
    residual: f64,
    /// `w`.
    strain: f64,
}

impl<'a> Buckling<'a> {
    /// Modifies `law` with residual stiffness `r`, from 0 to 1, and buckling strain `w > 0`.
    pub fn new(law: &'a dyn FiberLaw, residual: f64, buckling_strain: f64) -> Self {
        let youngs_modulus = law.youngs_modulus();
        Self { law, buckling: CompressiveBranch { youngs_modulus, residual, strain: buckling_strain } }
    }
}

impl CompressiveBranch {
    /// Returns `min(x, 1)` and `y = max(x - 1, 0)`.
    #[inline(always)]
    fn parts(&self, stretch: f64) -> (f64, f64) {
        let x = (1.0 - stretch) / self.strain;
        let inside = if x > 1.0 { 1.0 } else { x };
        (inside, x - inside)
    }
}

impl Formula for CompressiveBranch {
    #[inline(always)]
    fn stress_of<const FUSED: bool>(&self, stretch: f64) -> (f64, f64) {
        let Self { youngs_modulus: e, residual: r, strain: w } = *self;
        let (x, y) = self.parts(stretch);
        let (square, lost) = (x * x, 1.0 - r);
        let slope = 1.0 - lost * square * (3.0 - 2.0 * x);
        let fallen = x * (1.0 - lost * square * (1.0 - 0.5 * x)) + r * y;
        (-e * w * fallen, e * slope)
    }

    #[inline(always)]
    fn energy_of<const FUSED: bool>(&self, stretch: f64) -> f64 {
        let Self { youngs_modulus: e, residual: r, strain: w } = *self;
        let (x, y) = self.parts(stretch);
        let (square, lost) = (x * x, 1.0 - r);
        let inside = square * (0.5 - lost * square * (0.25 - 0.1 * x));
        e * w * w * (inside + y * (0.5 * (1.0 + r) + 0.5 * r * y))
    }
}

impl FiberLaw for Buckling<'_> {
    /// The name of the law in tension.
    fn name(&self) -> &str {
        self.law.name()
    }

    fn parameters(&self) -> Vec<(&'static str, f64)> {
        let mut parameters = self.law.parameters();
        let CompressiveBranch { residual, strain, .. } = self.buckling;
        parameters.extend([(COMPRESSION.name, residual), (BUCKLING_STRAIN.name, strain)]);
        parameters
    }

    fn youngs_modulus(&self) -> f64 {
        self.buckling.youngs_modulus
    }

    fn stress(&self, stretch: f64) -> (f64, f64) {
        if stretch < 1.0 { self.buckling.stress_of::<false>(stretch) } else { self.law.stress(stretch) }
    }

    fn energy(&self, stretch: f64) -> f64 {
        if stretch < 1.0 { self.buckling.energy_of::<false>(stretch) } else { self.law.energy(stretch) }
    }

    fn stresses(&self, stretch: &[f64], stress: &mut [f64], slope: &mut [f64]) {
        self.law.stresses(stretch, stress, slope);
        vectorized(Below { buckling: &self.buckling, stretch, stress, slope });
    }

    fn energies(&self, stretch: &[f64], energy: &mut [f64]) {
        self.law.energies(stretch, energy);
        for (&stretch, energy) in stretch.iter().zip(energy) {
            if stretch < 1.0 {
                *energy = self.buckling.energy_of::<false>(stretch);
            }
        }
    }
}

/// Replaces stress and slope of the fibers below stretch 1 by those of buckling.
struct Below<'a> {
    buckling: &'a CompressiveBranch,
    stretch: &'a [f64],
    stress: &'a mut [f64],
    slope: &'a mut [f64],
}

impl Kernel for Below<'_> {
    #[inline(always)]
    fn run<const FUSED: bool>(self) {
        for ((&stretch, stress), slope) in self.stretch.iter().zip(self.stress).zip(self.slope) {
            let below = self.buckling.stress_of::<FUSED>(stretch);
            let compressed = stretch < 1.0;
            *stress = if compressed { below.0 } else { *stress };
            *slope = if compressed { below.1 } else { *slope };
        }
    }
}
