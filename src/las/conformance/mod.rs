//! One test suite that every backend runs.
//!
//! A backend's tests are one call, `conformance::all::<MyBackend>(&context)`. Verbs and solvers are compared with a naive
//! dense matrix in double precision ([`Oracle`]), over many patterns drawn by a generator with fixed seeds, so that a
//! failure repeats.
//!
//! # Panics
//! All functions of this module report by panicking, as tests do: on the first thing that is not as the traits of
//! [`las`](crate::las) promise. They are not meant for programs.
//!
//! # Limits
//! The suite is for backends whose vectors lie whole in every process. Those with several numbers an entry run all but
//! [`solvers`].
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

/// Everything: [`vectors`], [`matrices`], [`products`], [`algebra`] and [`solvers`].
///
/// # Panics
/// Where the backend does not keep a promise of the traits.
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

/// `count` indices from 0.
fn first_indices<B: Backend>(count: usize) -> Vec<B::Index> {
    (0..count).map(B::Index::of).collect()
}

/// Indices, `None` for a constrained one.
fn indices<B: Backend>(positions: &[Option<usize>]) -> Vec<B::Index> {
    positions.iter().map(|position| position.map_or(B::Index::CONSTRAINED, B::Index::of)).collect()
}

/// What every number is multiplied with in a lane: so that lanes differ and results are known.
fn weight(lane: usize) -> f64 {
    lane as f64 + 1.0
}

/// Numbers as scalars of the backend, times the weight of each lane.
fn scalars<B: Backend>(values: &[f64]) -> Vec<B::Scalar> {
    values.iter().map(|&value| B::Scalar::from_lanes(|lane| Real::<B>::of(value * weight(lane)))).collect()
}

/// The same number in every lane.
fn splat<B: Backend>(value: f64) -> B::Scalar {
    B::Scalar::every(value)
}

/// Whether every lane holds the number times that power of its weight.
fn is<V: Value>(value: &V, expected: f64, power: i32) -> bool {
    (0..V::LANES).all(|lane| value.lane(lane).as_f64() == expected * weight(lane).powi(power))
}

type Real<B> = <<B as Backend>::Scalar as Value>::Real;

/// What a verb returned.
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
