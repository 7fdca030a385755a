//! Loops over fibers, compiled for the widest vectors of the machine that runs them.
//!
//! The program is built for the oldest machine it may meet; here a loop is compiled a second time for vectors of four
//! lanes with fused multiply-add and chosen when it runs. Every operation is one of IEEE 754 and acts on each fiber
//! alone: what a fiber gets does not depend on its place in a batch, on the length of the batch or on the number of
//! threads. A machine without fused multiply-add rounds products of its own and differs in the last digit.

use pulp::{Arch, Simd, WithSimd};

/// A loop over slices that the compiler can turn into vector instructions.
///
/// `run` is to be `#[inline(always)]`, and so is all that it calls: only what is inlined is compiled for vectors.
pub(super) trait Kernel {
    /// The loop; `FUSED` tells whether the machine has a fused multiply-add, see [`fma`].
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

/// `a b + c`, rounded once where the machine can; elsewhere `mul_add` would be a function call of 25 ns.
#[inline(always)]
pub(super) fn fma<const FUSED: bool>(a: f64, b: f64, c: f64) -> f64 {
    if FUSED { a.mul_add(b, c) } else { a * b + c }
}
