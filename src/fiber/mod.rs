//! The micro scale: fiber networks as representative volume elements (RVEs), generic over the linear-algebra backend.
//!
//! A [`network::Network`] is immutable geometry; [`truss::Truss`] adds the fiber materials; [`rve::RveModel`] adds the
//! sparsity pattern and symbolic factorization of the stiffness. All RVEs of a network share these three. An
//! [`rve::Rve`] owns only its state, and a worker owns one [`workspace::Workspace`] per model:
//!
//! ```text
//! Network -> Truss -> RveModel --+
//!                      Rve ------+--> equilibrium::equilibrate --> equilibrium::EquilibriumState: pk1, tangent, energy
//!                      Workspace-+
//! ```

pub mod batch;
pub mod deformation_path;
pub mod dynamic_relaxation;
pub mod equilibrium;
pub mod homogenize;
pub mod law;
pub mod network;
pub mod orientation;
pub mod rve;
mod simd;
pub mod stiffness;
pub mod stress_gradient;
pub mod truss;
pub mod workspace;
