//! `biotissue`: multiscale simulation of soft tissue.
//!
//! Soft tissue carries load through networks of collagen fibers that are about a thousand times smaller than the body.
//! A macro-scale finite-element model solves the body; at every integration point and in every Newton iteration, a
//! small fiber network (a representative volume element, RVE) supplies the stress and its exact tangent.
//!
//! The crate is a library and the program `biotissue`. The numerics are written **once**, generic over a linear-algebra
//! backend that is chosen at compile time. Modules depend on each other in one direction; an arrow means *uses*:
//!
//! ```text
//! bin -> app -> tissue -> fem, fiber, coupling -> las <- backends
//! ```
//!
//! | module | contents | depends on |
//! |---|---|---|
//! | [`las`] | the linear-algebra abstraction: verbs of hot loops, solvers, Newton | no library |
//! | [`backends`] | the backends, one folder each | [`las`] and their libraries |
//! | [`fem`] | the macro scale: meshes, elements, materials, load steps | [`las`] |
//! | [`fiber`] | the micro scale: networks, fiber laws, equilibrium, condensed tangent | [`las`] |
//! | [`coupling`] | scales on separate ranks: the ranks of each scale and the data exchanged between scales | [`las`] |
//! | `tissue` | the two-scale problem in memory: materials, and the RVEs of all elements, in one process or on ranks of their own | [`fem`], [`fiber`], [`coupling`] |
//! | `app` | the application: cases, runs, checkpoints, results, pictures | all of them |
//!
//! All of them may use [`tensor`], [`input`] and [`output`]. `fem`, `fiber` and `coupling` do not depend on each other.
//! `fem` and `fiber` meet at the interface [`fem::point_field`], behind which a formula or a fiber network supplies the
//! stress. Only the program, tests, benches and examples name a concrete backend.
//!
//! # Features
//!
//! | feature | provides | needs on the machine |
//! |---|---|---|
//! | `sparse` (default) | compressed sparse rows; direct solvers, Krylov methods with ILUT or multigrid | nothing |
//! | `dense` (default) | dense matrices | nothing |
//! | `petsc` (implies `mpi`) | distributed vectors, matrices and solvers of PETSc | PETSc 3.18+ with its headers, MPI, libclang |
//! | `mpi` | ranks as MPI processes | MPI, libclang |
//! | `cuda` (implies `sparse`) | products and iterative solvers on a graphics processor of NVIDIA | nothing to build; the driver, NVRTC and cuSPARSE at run time |
//! | `batched` (implies `sparse`) | many systems of one sparsity pattern at once, one in each SIMD lane | nothing |
//! | `metis` | METIS elimination orders, compared with those of the crate itself; mesh partitions | a C compiler |
//! | `hwloc` | the position of a rank in the machine, for [`coupling::topology`] | hwloc 2 with its headers |
//! | `capi` | the C interface of the backends, which Fortran also uses | nothing |
//! | `generate` | generated fiber networks: Delaunay and Voronoi, isotropic and aligned | nothing |
//! | `app` (default, implies `generate`) | `tissue` and `app`: the two-scale problem, cases, results, pictures, the program `biotissue` | nothing |
//!
//! To use the numerics alone, set `default-features = false, features = ["sparse"]`.
//!
//! # Example: one RVE
//!
//! ```
//! # #[cfg(all(feature = "sparse", feature = "generate"))] {
//! use std::sync::Arc;
//! use biotissue::backends::sparse::Sparse;
//! use biotissue::fiber::equilibrium::{EquilibriumParams, equilibrate};
//! use biotissue::fiber::law::{FiberMaterial, Law};
//! use biotissue::fiber::network::generate::delaunay;
//! use biotissue::fiber::rve::{Rve, RveModel, StressScale};
//! use biotissue::fiber::workspace::Workspace;
//! use biotissue::nalgebra::Matrix3;
//!
//! let network = Arc::new(delaunay(20, 1).unwrap());
//! let law = Law::Exponential { youngs_modulus: 1.0e8, nonlinearity: 1.2 };
//! let collagen = FiberMaterial { law, radius: 5.0e-8, density: None };
//! let scale = StressScale::FiberVolumeFraction(0.003);
//! // Shared by all RVEs of this network: geometry, laws, symbolic factor.
//! let model = RveModel::<Sparse>::new(&(), Arc::clone(&network), Some(collagen), scale).unwrap();
//!
//! let mut rve = Rve::at_rest(&network);
//! let mut workspace = Workspace::new(&(), &model).unwrap();
//! let stretched = Matrix3::from_diagonal(&[1.1, 0.97, 0.97].into());
//! let params = EquilibriumParams::default();
//! let mut solved = equilibrate(&model, &mut rve, &stretched, &params, &mut workspace).unwrap();
//!
//! let (pk1, tangent) = (solved.pk1(), solved.tangent().unwrap());
//! assert!(solved.report().iterations < 10 && pk1[(0, 0)] > 0.0);
//! assert!((tangent - tangent.transpose()).amax() < 1e-8 * tangent.amax());
//! # }
//! ```
//!
//! The method follows W. R. Tobin, *The Adaptive Multiscale Simulation Infrastructure* (PhD thesis, Rensselaer
//! Polytechnic Institute, 2018).
#![deny(unsafe_code)]
#![warn(missing_docs)]
// Every failure that a user, a file or a library can cause is an error value; only tests may panic.
#![cfg_attr(
    not(test),
    deny(
        clippy::unwrap_used,
        clippy::expect_used,
        clippy::panic,
        clippy::todo,
        clippy::unimplemented,
        clippy::unreachable
    )
)]

// The attribute of `bytemuck` in `payload!` takes a path as text, where `$crate` has no effect; this makes the path
// valid inside the crate too.
extern crate self as biotissue;

#[cfg(feature = "app")]
pub mod app;
pub mod backends;
#[cfg(feature = "capi")]
pub mod capi;
#[cfg(feature = "app")]
mod checksum;
pub mod coupling;
pub mod fem;
pub mod fiber;
pub mod input;
pub mod las;
pub mod output;
mod parallel;
#[cfg(any(feature = "sparse", feature = "app"))]
mod processor_time;
#[cfg(feature = "sparse")]
pub mod rve_batch;
#[cfg(feature = "app")]
mod sealed_file;
#[cfg(test)]
#[path = "../tests/support/skip.rs"]
mod skip;
pub mod tensor;
#[cfg(feature = "app")]
pub mod tissue;

/// The crate of the small matrices and vectors in public signatures.
pub use nalgebra;

/// Compiles and runs the Rust example of the README with the tests of the documentation.
#[cfg(all(doctest, feature = "sparse", feature = "generate"))]
#[doc = include_str!("../README.md")]
struct Readme;
