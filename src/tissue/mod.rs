//! The two-scale problem: couples the macro scale with the fiber RVEs.
//!
//! ```text
//! Case ─┬─► macro_scale (mesh, loads) ─────────┬─► fem::stepping
//!       └─► micro_scale (networks, two_scale) ─┘
//! ```
//!
//! [`micro_scale::TissueField`] implements the interface [`crate::fem::point_field`] with a formula or a network in
//! every element, where all threads solve the networks; [`two_scale::ScaleField`] does so with networks on other ranks.

pub mod macro_scale;
pub mod micro_scale;
pub mod replay;

pub mod two_scale;
