//! The micro scale: fiber networks as representative volume elements (RVEs), generic over the linear-algebra backend.
//!
//! A [`network::Network`] is immutable geometry; [`truss::Truss`] adds what its fibers are made of; [`rve::RveModel`]
//! adds the pattern and symbolic factor of its stiffness. All three are shared by every RVE of that network. An
//! [`rve::Rve`] owns its state and nothing else, and a worker owns one [`workspace::Workspace`] for each model:
//!
//! ```text
//! Network -> Truss -> RveModel --+
//!                      Rve ------+--> equilibrium::equilibrate --> equilibrium::Solved: pk1, tangent, energy
//!                      Workspace-+
//! ```

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
pub mod truss;
pub mod workspace;
