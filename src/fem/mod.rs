//! The macro scale: finite elements on tetrahedral meshes, generic over the linear-algebra backend.
//!
//! Total Lagrangian: everything is integrated over the reference volume, `u` are the displacements of the nodes in
//! meters, `F = I + du/dX`, `P` the first Piola-Kirchhoff stress in Pa and `A = dP/dF`. Data flows one way:
//!
//! ```text
//!  mesh ──────────► assembly::Unknowns ◄──── boundary::Boundary ◄──── boundary::Conditions (names, values, curves)
//!                         │                        │ held values and nodal loads at pseudo-time t
//!                         ▼                        ▼
//!  u ─► assembly::Assembler ─ F ─► PointField ─ P, A ─► Assembler ─ r, K ─► equilibrium::Equilibrium
//!                                  (a formula, or                                │ las::NonlinearProblem
//!                                   RVEs elsewhere)                              ▼
//!                                        stepping::Stepper: load steps, cuts ─► StepObserver (u, P, reactions)
//! ```
//!
//! [`mesh`] knows geometry and names, [`element`] the shape functions, [`material`] formulas at a point.
//! [`point_field`] is the seam: whoever implements [`point_field::PointField`] supplies stress and tangent at all
//! integration points, from a formula or from a thousand fiber networks. The assembler never sees the physics, the
//! physics never sees the mesh, and neither sees the library that solves the system.
//!
//! # Limits
//! Linear tetrahedra with one integration point; dead loads, so that every tangent is symmetric.

pub mod assembly;
pub mod boundary;
pub mod element;
pub mod equilibrium;
pub mod material;
pub mod mesh;
pub mod point_field;
pub mod reactions;
pub mod rigid_modes;
pub mod stepping;
