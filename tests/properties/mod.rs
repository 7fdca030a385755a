//! What every backend promises, on cases that `proptest` draws: sequences of verbs, products and sums, each against a
//! naive dense matrix in double precision, one a lane.
//!
//! The cases are the same on every run. `PROPTEST_RNG_SEED=5 PROPTEST_CASES=100000 cargo test --test backends properties`
//! draws others, and more of them.
#![allow(dead_code, reason = "which backends there are depends on the features")]

mod algebra;
mod draw;
mod matrices;
mod vectors;

use std::fmt::{Debug, Display};

use biotissue::las::conformance::Oracle;
use biotissue::las::{Backend, Scalar, Value};
use proptest::strategy::Strategy;
use proptest::test_runner::{Config, RngSeed, TestCaseError, TestError, TestRunner};

/// What a case comes to.
type Outcome = Result<(), TestCaseError>;

/// How many cases are drawn, and whether one that fails is made smaller.
#[derive(Clone, Copy, Debug)]
pub struct Trials {
    pub cases: u32,
    /// Not on several ranks: they would have to agree on which of the smaller cases fail.
    pub shrink: bool,
}

/// Everything that holds for a backend with indices of 32 bits, whatever an entry is.
pub fn all<B>(context: &B::Context, trials: Trials)
where
    B: Backend<Index = i32>,
    B::Reduced: Value,
{
    trials.hold("verbs of vectors", &draw::vectors(), |case| vectors::agree::<B>(context, &case));
    of_matrices::<B>(context, trials, 1);
}

/// The part of it that depends on how matrices are stored; their patterns consist of full blocks of `unit` rows and columns.
pub fn of_matrices<B: Backend<Index = i32>>(context: &B::Context, trials: Trials, unit: usize) {
    trials.hold("verbs of matrices", &draw::matrices(unit), |case| matrices::agree::<B>(context, &case));
    trials.hold("products and sums", &draw::algebra(unit), |case| algebra::agree::<B>(context, &case));
}

impl Trials {
    /// Panics with the first case that does not hold.
    fn hold<S: Strategy>(self, what: &str, strategy: &S, test: impl Fn(S::Value) -> Outcome) {
        let asked_for = |name: &str| std::env::var_os(name).is_some();
        let mut config = Config { failure_persistence: None, ..Config::default() };
        if !asked_for("PROPTEST_CASES") {
            config.cases = self.cases;
        }
        if !asked_for("PROPTEST_RNG_SEED") {
            config.rng_seed = RngSeed::Fixed(1);
        }
        if !self.shrink {
            config.max_shrink_iters = 0;
        }
        match TestRunner::new(config).run(strategy, test) {
            Ok(()) => {}
            Err(TestError::Fail(reason, case)) => panic!("{what}: {reason}\nin {case:?}"),
            Err(TestError::Abort(reason)) => panic!("{what}: {reason}"),
        }
    }
}

/// What a verb returned.
fn done<R, E: Display>(result: Result<R, E>) -> Result<R, TestCaseError> {
    result.map_err(|error| TestCaseError::fail(format!("a verb failed: {error}")))
}

type Real<B> = <<B as Backend>::Scalar as Value>::Real;

fn lanes<B: Backend>() -> usize {
    <B::Scalar as Value>::LANES
}

fn epsilon<B: Backend>() -> f64 {
    <Real<B> as num_traits::Float>::epsilon().as_f64()
}

/// What stands in a lane for a number of the case: lanes are not multiples of each other.
fn in_lane(value: i8, lane: usize) -> f64 {
    f64::from(value) + lane as f64
}

/// The same for a factor, which must not let numbers grow out of what single precision holds exactly.
fn factor_in_lane(factor: i8, lane: usize) -> f64 {
    if lane.is_multiple_of(2) { f64::from(factor) } else { -f64::from(factor) }
}

fn scalar<B: Backend>(of_lane: impl Fn(usize) -> f64) -> B::Scalar {
    B::Scalar::from_lanes(|lane| Real::<B>::of(of_lane(lane)))
}

fn scalars<B: Backend>(values: &[i8]) -> Vec<B::Scalar> {
    values.iter().map(|&value| scalar::<B>(|lane| in_lane(value, lane))).collect()
}

fn factor<B: Backend>(factor: i8) -> B::Scalar {
    scalar::<B>(|lane| factor_in_lane(factor, lane))
}

/// What a buffer holds before a read that must leave part of it alone.
const UNTOUCHED: i8 = 99;

fn untouched<B: Backend>(len: usize) -> Vec<B::Scalar> {
    scalars::<B>(&vec![UNTOUCHED; len])
}

/// Checks every lane of a value against a number that it may miss by as much as `slack`.
fn check<V: Value>(
    what: impl Display,
    found: &V,
    expected: impl Fn(usize) -> f64,
    slack: impl Fn(usize) -> f64,
) -> Outcome {
    for lane in 0..V::LANES {
        let (found, expected) = (found.lane(lane).as_f64(), expected(lane));
        // Not a number is near nothing.
        let near = (found - expected).abs() <= slack(lane);
        if !near {
            return Err(TestCaseError::fail(format!("{what} is {found} and not {expected} in lane {lane}")));
        }
    }
    Ok(())
}

fn exactly(_: usize) -> f64 {
    0.0
}

fn equal<T: PartialEq + Debug>(what: &str, found: T, expected: T) -> Outcome {
    if found == expected {
        return Ok(());
    }
    Err(TestCaseError::fail(format!("{what}: {found:?} and not {expected:?}")))
}

fn at(a: &Oracle, row: usize, column: usize) -> f64 {
    a.values[row * a.cols + column]
}

/// Absolute values: what rounding errors of products are measured by.
fn absolute(a: &Oracle) -> Oracle {
    Oracle { values: a.values.iter().map(|value| value.abs()).collect(), ..*a }
}
