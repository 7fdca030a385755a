//! The conformance test suite for all backends.
//!
//! A backend runs it with one call, `conformance::all::<MyBackend>(&context)`. The suite compares operations and
//! solvers with a naive dense matrix in double precision ([`Oracle`]) on many random patterns. The seeds are fixed, so
//! that a failure is reproducible.
//!
//! # Panics
//! All functions of this module panic, as tests do, at the first violation of the specification of the
//! [`las`](crate::las) traits. They are not meant for programs.
//!
//! # Limits
//! The suite requires that every process stores whole vectors. Backends with more than one lane run all functions
//! except [`solvers`].
#![allow(clippy::panic, reason = "a test suite reports by panicking")]

mod algebra;
mod case;
mod oracle;
mod solvers;
mod verbs;

pub use algebra::{algebra, products};
pub use oracle::{Oracle, Random};
pub use solvers::solvers;
pub use verbs::{matrices, vectors};

use super::{Backend, Index, Scalar, Value};

/// Runs [`vectors`], [`matrices`], [`products`], [`algebra`] and [`solvers`].
///
/// # Panics
/// Panics if the backend violates the specification of the traits.
pub fn all<B>(context: &B::Context)
where
    B: Backend<Reduced = <B as Backend>::Scalar>,
    B::Scalar: Scalar,
{
    vectors::<B>(context);
    matrices::<B>(context);
    products::<B>(context);
    algebra::<B>(context);
    solvers::<B>(context);
}

/// The indices from 0 to `count - 1`.
fn first_indices<B: Backend>(count: usize) -> Vec<B::Index> {
    (0..count).map(B::Index::of).collect()
}

/// Converts positions to indices; `None` denotes a constrained unknown.
fn indices<B: Backend>(positions: &[Option<usize>]) -> Vec<B::Index> {
    positions.iter().map(|position| position.map_or(B::Index::CONSTRAINED, B::Index::of)).collect()
}

/// The factor of all numbers in a lane: makes lanes differ in a known way.
fn weight(lane: usize) -> f64 {
    lane as f64 + 1.0
}

/// Converts numbers to scalars of the backend, multiplied by the weight of each lane.
fn scalars<B: Backend>(values: &[f64]) -> Vec<B::Scalar> {
    values.iter().map(|&value| B::Scalar::from_lanes(|lane| Real::<B>::of(value * weight(lane)))).collect()
}

/// A scalar with the same number in every lane.
fn splat<B: Backend>(value: f64) -> B::Scalar {
    B::Scalar::every(value)
}

/// Returns true if every lane holds `expected` times this power of its weight.
fn is<V: Value>(value: &V, expected: f64, power: i32) -> bool {
    (0..V::LANES).all(|lane| value.lane(lane).as_f64() == expected * weight(lane).powi(power))
}

type Real<B> = <<B as Backend>::Scalar as Value>::Real;

/// Unwraps the result of an operation.
#[track_caller]
fn done<R, E: std::error::Error>(result: Result<R, E>) -> R {
    match result {
        Ok(value) => value,
        Err(error) => panic!("a verb failed: {error}"),
    }
}

/// Machine epsilon of the backend's scalar.
fn epsilon<B: Backend>() -> f64 {
    <Real<B> as num_traits::Float>::epsilon().as_f64()
}
