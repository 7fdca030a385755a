//! Loops over fibers, compiled for several instruction sets and dispatched at run time.
//!
//! The program is built for a baseline instruction set; each loop here is compiled a second time for vectors of four
//! lanes with fused multiply-add and selected at run time. All operations follow IEEE 754 and act on each fiber
//! separately: the result for a fiber does not depend on its place in a batch, on the batch length or on the number of
//! threads. Results on a machine without fused multiply-add, which rounds products separately, differ in the last
//! digit.

use pulp::{Arch, Simd, WithSimd};

/// A loop over slices that the compiler can vectorize.
///
/// `run` and all functions that it calls must be `#[inline(always)]`: only inlined code is compiled for vectors.
pub(super) trait Kernel {
    /// Runs the loop; `FUSED` is true if the machine has a fused multiply-add, see [`fma`].
    fn run<const FUSED: bool>(self);
}

/// Runs a loop with the vector instructions of this machine.
#[inline]
pub(super) fn vectorized(kernel: impl Kernel) {
    match Arch::new() {
        Arch::Scalar => kernel.run::<false>(),
        #[allow(unreachable_patterns, reason = "machines that pulp knows no vectors of have no other")]
        arch => arch.dispatch(Vectorized(kernel)),
    }
}

struct Vectorized<K>(K);

impl<K: Kernel> WithSimd for Vectorized<K> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        self.0.run::<{ cfg!(any(target_arch = "x86", target_arch = "x86_64", target_arch = "aarch64")) }>();
    }
}

/// `a b + c` with one rounding if `FUSED`; otherwise `mul_add` would be a function call of 25 ns.
#[inline(always)]
pub(super) fn fma<const FUSED: bool>(a: f64, b: f64, c: f64) -> f64 {
    if FUSED { a.mul_add(b, c) } else { a * b + c }
}
