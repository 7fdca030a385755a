//! `biotissue`: multiscale simulation of soft tissue.
//!
//! Soft tissue carries load through networks of collagen fibers a thousand times smaller than the body they are in. Here
//! a macro-scale finite-element model asks, at every integration point and in every Newton iteration, a small
//! fiber network (an RVE, a representative volume element) for its stress and its exact tangent.
//!
//! The crate is a library and the program `biotissue`. Numerics are written **once**, generic over a linear-algebra
//! backend that is chosen at compile time. Data flows one way; an arrow means *uses*:
//!
//! ```text
//! bin -> tissue -> fem, fiber, coupling -> las <- backends
//! ```
//!
//! | module | what | knows |
//! |---|---|---|
//! | [`las`] | the linear-algebra abstraction: hot-loop verbs, solvers, Newton | no library |
//! | [`backends`] | the backends, one folder each | [`las`] and their libraries |
//! | [`fem`] | the macro scale: meshes, elements, materials, load steps | [`las`] |
//! | [`fiber`] | the micro scale: networks, fiber laws, equilibrium, condensed tangent | [`las`] |
//! | [`coupling`] | scales on ranks of their own: which has which ranks, what goes from one to another | [`las`] |
//! | `tissue` | all put together: cases, the two-scale run, results, pictures | all of them |
//!
//! `fem`, `fiber` and `coupling` do not know each other: the first two meet at [`fem::point_field`], the seam that does not care whether a
//! formula or a network answers. Only `tissue`, the program, tests and benches name a concrete backend.
//!
//! # Features
//!
//! | feature | brings | needs on the machine |
//! |---|---|---|
//! | `sparse` (default) | compressed rows; direct solvers, Krylov methods with ILUT | nothing |
//! | `dense` (default) | dense matrices | nothing |
//! | `petsc` (implies `mpi`) | vectors, matrices and solvers of PETSc, on several processes | PETSc 3.18 or later with its headers, MPI, libclang |
//! | `mpi` | ranks as MPI processes | MPI, libclang |
//! | `cuda` | nothing yet: a name that is kept | nothing |
//! | `batched` | many systems of one pattern at once, one in each lane; no solver yet | nothing |
//! | `metis` | orders of elimination by METIS, tried beside those of the crate itself; parts of meshes | a C compiler |
//! | `hwloc` | where in the machine a rank runs, for [`coupling::topology`] | hwloc 2 with its headers |
//! | `generate` | fiber networks made on the spot, Delaunay and Voronoi, isotropic and aligned | nothing |
//! | `app` (default, implies `generate`) | cases, results, pictures, the program `biotissue` | nothing |
//!
//! A library user who wants the numerics alone takes `default-features = false, features = ["sparse"]`.
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
//! use nalgebra::Matrix3;
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
//! After W. R. Tobin, *The Adaptive Multiscale Simulation Infrastructure* (PhD thesis, Rensselaer Polytechnic Institute,
//! 2018).
#![deny(unsafe_code)]
#![warn(missing_docs)]
// Whatever a user, a file or a library can cause is an error value; only tests may panic.
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

// So that `payload!` names the crate alike inside it and outside.
extern crate self as biotissue;

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
#[cfg(feature = "app")]
pub mod tissue;
