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
//! The suite is for backends whose vectors lie whole in one process and whose `norm` and `dot` are one number.
#![allow(clippy::panic, reason = "a test suite reports by panicking")]

mod case;
mod oracle;
mod solvers;
mod verbs;

pub use oracle::{Oracle, Random};
pub use solvers::solvers;
pub use verbs::{matrices, products, vectors};

use super::{Backend, Index, MatVec, Scalar};

/// Everything: [`vectors`], [`matrices`], [`products`] and [`solvers`].
///
/// # Panics
/// Where the backend does not keep a promise of the traits.
pub fn all<B>(context: &B::Context)
where
    B: Backend<Reduced: Into<f64>, Matrix: MatVec<B>>,
{
    vectors::<B>(context);
    matrices::<B>(context);
    products::<B>(context);
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

/// Numbers as scalars of the backend.
fn scalars<B: Backend>(values: &[f64]) -> Vec<B::Scalar> {
    values.iter().map(|&value| B::Scalar::of(value)).collect()
}

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
    <B::Scalar as num_traits::Float>::epsilon().as_f64()
}
