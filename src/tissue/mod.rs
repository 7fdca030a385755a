//! The two-scale problem in memory: a body whose material is a fiber network at every integration point.
//!
//! ```text
//! Materials ─► Library (networks) ─► TissueField or ScaleField ─► fem::stepping
//! ```
//!
//! [`materials`] describes the material of every region. [`micro_scale::TissueField`] implements the interface
//! [`crate::fem::point_field`] with a formula or a network in every element, where all threads solve the networks;
//! [`two_scale::ScaleField`] does so with networks on other ranks.

mod formula;
pub mod materials;
pub mod micro_scale;
mod point_values;
pub mod replay;
pub mod two_scale;
