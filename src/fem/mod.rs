//! The macro scale: finite elements, generic over the linear-algebra backend.
//!
//! The formulation is total Lagrangian: all integrals are over the reference volume. `u` are the nodal displacements in
//! meters, `F = I + du/dX` is the deformation gradient, `P` the first Piola-Kirchhoff stress in Pa and `A = dP/dF` its
//! tangent. Data flow:
//!
//! ```text
//!  mesh ──────────► assembly::Unknowns ◄──── boundary::Boundary ◄──── boundary::Conditions (names, values, curves)
//!                         │                        │ prescribed values, loads at pseudo-time t and u
//!                         ▼                        ▼
//!  u ─► assembly::Assembler ─ F ─► PointField ─ P, A ─► Assembler ─ r, K ─► equilibrium::Equilibrium
//!                                  (a formula, or                                │ las::NonlinearProblem
//!                                   RVEs elsewhere)                              ▼
//!                                        stepping::Stepper: load steps, cuts ─► StepObserver (u, P, reactions)
//! ```
//!
//! [`mesh`] holds geometry and names, [`element`] the shape functions, and [`material`] constitutive formulas.
//! [`kinematics`] maps the unknowns to displacements where they are not the components at a node, and [`constraint`]
//! holds or drives volumes of regions and cavities. [`point_field`] is the interface between body and material: an
//! implementation of [`point_field::PointField`] supplies stress and tangent at all integration points, from a formula
//! or from thousands of fiber networks. The assembler does not depend on the constitutive model, the constitutive model
//! does not depend on the mesh, and neither depends on the library that solves the linear system.
//!
//! # Ranks
//! A rank may hold a part of a body ([`mesh::Part`], [`stepping::BodyPart`]): its own elements and nodes, and ghosts, so that
//! sums over the elements at an own node are complete. All code then works on the part; only sums over nodes, elements and
//! points ([`Backend::sum`](crate::las::Backend::sum)) and the vectors of the backend communicate.
//!
//! # Limits
//! Elements are displacement elements ([`element::ElementType`]). Linear ones lock in nearly incompressible materials;
//! patches ([`mesh::Mesh::with_patches`]) prevent it for hexahedra and tetrahedra, with an unsymmetric tangent. The
//! tangent of the other elements is symmetric, because stresses derive from an energy; that of a load
//! ([`boundary::Load`]) may be unsymmetric, but couples only nodes of one element. A constraint couples more nodes by
//! scalar multipliers ([`Border`](crate::las::Border)).

pub mod assembly;
pub mod boundary;
pub mod constraint;
pub mod element;
pub mod equilibrium;
pub mod kinematics;
pub mod material;
pub mod mesh;
pub mod point_field;
pub mod reactions;
pub mod rigid_modes;
pub mod stepping;
