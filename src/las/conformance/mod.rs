//! The conformance test suite for all backends.
//!
//! The suite compares a backend with a naive dense matrix in double precision ([`DenseReference`]) on random cases:
//! sequences of vector and matrix operations, products, and linear systems. All cases follow from a seed, so that a
//! failure is reproducible; a failing case is reduced and printed.
//!
//! One call runs the required part of the suite on a backend:
//!
//! ```
//! # #[cfg(feature = "sparse")] {
//! use biotissue::backends::sparse::Sparse;
//! use biotissue::las::conformance::{self, Capabilities, Trials};
//!
//! let trials = Trials { count: 20, ..Trials::default() };
//! # if false {
//! conformance::all::<Sparse>(&(), trials, Capabilities::ALL);
//! # }
//! // The extensions `Entries` and `MatMat`, which `Sparse` implements:
//! conformance::entries::<Sparse>(&(), trials);
//! conformance::algebra::<Sparse>(&(), trials);
//! # }
//! ```
//!
//! | function | tests | for |
//! |---|---|---|
//! | [`vectors`], [`matrices`], [`products`] | [`VectorOps`], [`MatrixOps`], [`MatVec`] | all, of several lanes too |
//! | [`solvers`] | [`Solver`](super::Solver) | all, of several lanes too; [`Capabilities`] states what the solvers lack |
//! | [`entries`], [`algebra`] | [`Entries`], [`MatMat`] | backends that implement these extensions |
//!
//! # Panics
//! All functions of this module panic, as tests do, at the first violation of the specification of the
//! [`las`](crate::las) traits. They are not meant for programs.
//!
//! # Limits
//! The suite requires that every process stores whole vectors.
//!
//! [`VectorOps`]: super::VectorOps
//! [`MatrixOps`]: super::MatrixOps
//! [`MatVec`]: super::MatVec
#![allow(clippy::panic, reason = "a test suite reports by panicking")]

mod cases;
mod matrices;
mod products;
mod reference;
mod solvers;
mod system;
mod vectors;

use std::fmt::{Debug, Display};
use std::panic::{AssertUnwindSafe, catch_unwind};

pub use reference::{DenseReference, Random};
pub use solvers::solvers;

use super::{Backend, Entries, MatMat, Scalar, Symmetry, Value};
use cases::Case;

/// The random cases of a test.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Trials {
    /// The number of cases.
    pub count: u32,
    /// The seed of the first case; it increases by one from case to case.
    pub seed: u64,
    /// Number of rows and columns of the full blocks that sparsity patterns consist of.
    pub block_size: usize,
    /// Whether a failing case is reduced before it is printed. This must be `false` on several ranks, where a failure
    /// on one rank only would make that rank repeat collective operations alone.
    pub reduce: bool,
}

impl Default for Trials {
    fn default() -> Self {
        Self { count: 500, seed: 1, block_size: 1, reduce: true }
    }
}

impl Trials {
    /// Replaces `count` and `seed` by the environment variables `CONFORMANCE_COUNT` and `CONFORMANCE_SEED` if they are
    /// set, which allows a longer search without recompilation.
    #[must_use]
    pub fn or_from_environment(self) -> Self {
        let number = |name: &str| std::env::var(name).ok()?.parse::<u64>().ok();
        Self {
            count: number("CONFORMANCE_COUNT").map_or(self.count, |count| count as u32),
            seed: number("CONFORMANCE_SEED").unwrap_or(self.seed),
            ..self
        }
    }

    /// Draws and checks all cases; panics with the first one that fails.
    fn run<C: Case>(self, what: &str, check: impl Fn(&C) -> Outcome) {
        let check = |case: &C| {
            // The message of a panic has already been printed.
            catch_unwind(AssertUnwindSafe(|| check(case))).unwrap_or_else(|_| Err("the backend panicked".to_owned()))
        };
        for seed in (self.seed..).take(self.count as usize) {
            let mut case = C::draw(&mut Random::new(seed), self.block_size);
            let Err(mut problem) = check(&case) else { continue };
            let fails = |case: C| check(&case).err().map(|problem| (case, problem));
            while self.reduce
                && let Some(smaller) = case.smaller().into_iter().find_map(fails)
            {
                (case, problem) = smaller;
            }
            panic!("{what}, seed {seed}: {problem}\nin {case:?}");
        }
    }
}

/// The capabilities of the solvers of a backend beyond Cholesky and LU. The suite does not require those that are
/// `false`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Capabilities {
    /// The backend factors symmetric indefinite matrices by LDL^T and counts their negative pivots.
    ///
    /// Without it, the suite factors only matrices declared [`Symmetry::Definite`] or [`Symmetry::None`]. It requires
    /// that `factor_definite` returns `SolveError::Indefinite` for an indefinite matrix. A matrix that is singular up
    /// to rounding may be reported as indefinite.
    pub ldlt: bool,
    /// The reports and errors of the backend name the unknown at which a factorization failed.
    ///
    /// Without it, `indefinite_at` of [`FactorReport`](super::FactorReport) and `unknown` of
    /// [`SolveError`](super::SolveError) may have any value.
    pub names_unknown: bool,
}

impl Capabilities {
    /// All capabilities; the in-memory backends of this crate have them.
    pub const ALL: Self = Self { ldlt: true, names_unknown: true };

    fn symmetries(self) -> &'static [Symmetry] {
        const ALL: [Symmetry; 3] = [Symmetry::Definite, Symmetry::None, Symmetry::Symmetric];
        if self.ldlt { &ALL } else { &ALL[..2] }
    }
}

/// Runs [`vectors`], [`matrices`], [`products`] and [`solvers`]: all tests that are required of a backend.
///
/// # Panics
/// Panics if the backend violates the specification of the traits.
pub fn all<B: Backend>(context: &B::Context, trials: Trials, capabilities: Capabilities) {
    vectors::<B>(context, trials);
    matrices::<B>(context, trials);
    products::<B>(context, trials);
    solvers::<B>(context, capabilities);
}

/// Tests the operations of vectors.
///
/// # Panics
/// Panics if the backend violates the specification of [`VectorOps`](super::VectorOps).
pub fn vectors<B: Backend>(context: &B::Context, trials: Trials) {
    trials.run("operations of vectors", |case| vectors::check::<B>(context, case));
}

/// Tests the operations of matrices, also of rectangular ones.
///
/// # Panics
/// Panics if the backend violates the specification of [`MatrixOps`](super::MatrixOps).
pub fn matrices<B: Backend>(context: &B::Context, trials: Trials) {
    trials.run("operations of matrices", |case| matrices::check::<B>(context, case));
    trials.run("many blocks at once", |case| matrices::check_many_blocks::<B>(context, case));
}

/// Tests matrix-vector products and diagonals.
///
/// # Panics
/// Panics if the backend violates the specification of [`MatVec`](super::MatVec).
pub fn products<B: Backend>(context: &B::Context, trials: Trials) {
    trials.run("matrix-vector products", |case| products::check_products::<B>(context, case));
}

/// Tests the iteration over all entries of a matrix.
///
/// # Panics
/// Panics if the backend violates the specification of [`Entries`].
pub fn entries<B: Backend<Matrix: Entries<B>>>(context: &B::Context, trials: Trials) {
    trials.run("entries of matrices", |case| products::check_entries::<B>(context, case));
}

/// Tests sums, products and transposes of matrices.
///
/// # Panics
/// Panics if the backend violates the specification of [`MatMat`].
pub fn algebra<B: Backend<Matrix: MatMat<B>>>(context: &B::Context, trials: Trials) {
    trials.run("sums and products of matrices", |case| products::check_algebra::<B>(context, case));
}

/// The result of a check; the error describes the violation.
type Outcome = Result<(), String>;

/// The initial value of the entries of a buffer, some of which a read must leave unchanged.
const UNTOUCHED: f64 = 99.0;

type Real<B> = <<B as Backend>::Scalar as Value>::Real;

fn lanes<B: Backend>() -> usize {
    <B::Scalar as Value>::LANES
}

/// Machine epsilon of the backend's scalar.
fn epsilon<B: Backend>() -> f64 {
    <Real<B> as num_traits::Float>::epsilon().as_f64()
}

/// Returns the number that a lane gets for a number of the case. The offset ensures that the lanes are not multiples of
/// each other.
fn number_in_lane(value: f64, lane: usize) -> f64 {
    value + lane as f64
}

/// Returns the sign of a factor in a lane. The factors of all lanes differ only in sign, so that single precision
/// remains exact.
fn sign_in_lane(lane: usize) -> f64 {
    if lane.is_multiple_of(2) { 1.0 } else { -1.0 }
}

fn scalar<B: Backend>(in_lane: impl Fn(usize) -> f64) -> B::Scalar {
    B::Scalar::from_lanes(|lane| Real::<B>::of(in_lane(lane)))
}

/// Converts numbers of a case to scalars of the backend.
fn scalars<B: Backend>(values: &[f64]) -> Vec<B::Scalar> {
    values.iter().map(|&value| scalar::<B>(|lane| number_in_lane(value, lane))).collect()
}

fn untouched<B: Backend>(len: usize) -> Vec<B::Scalar> {
    scalars::<B>(&vec![UNTOUCHED; len])
}

fn indices<B: Backend>(indices: &[i32]) -> Vec<B::Index> {
    indices.iter().map(|&index| B::Index::from(index)).collect()
}

/// Converts the error of an operation to the description of a violation.
fn tried<R, E: Display>(result: Result<R, E>) -> Result<R, String> {
    result.map_err(|error| format!("an operation failed: {error}"))
}

/// Unwraps the result of an operation; panics with its error.
#[track_caller]
fn unwrap<R, E: Display>(result: Result<R, E>) -> R {
    tried(result).unwrap_or_else(|error| panic!("{error}"))
}

fn equal<T: PartialEq + Debug>(what: &str, found: T, expected: T) -> Outcome {
    if found == expected { Ok(()) } else { Err(format!("{what} is {found:?} instead of {expected:?}")) }
}

/// Checks that a value equals the expected one in every lane.
fn same<V: Value>(what: impl Display, found: &V, expected: impl Fn(usize) -> f64) -> Outcome {
    within(what, found, expected, |_| 0.0)
}

/// Checks that a value differs from the expected one by at most `error` in every lane.
fn within<V: Value>(
    what: impl Display,
    found: &V,
    expected: impl Fn(usize) -> f64,
    error: impl Fn(usize) -> f64,
) -> Outcome {
    for lane in 0..V::LANES {
        let (found, expected) = (found.lane(lane).as_f64(), expected(lane));
        // The comparison is false if a value is NaN.
        let is_near = (found - expected).abs() <= error(lane);
        if !is_near {
            return Err(format!("{what} is {found} instead of {expected} in lane {lane}"));
        }
    }
    Ok(())
}
