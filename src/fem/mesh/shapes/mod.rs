//! Bodies that need no mesher: the box and the dogbone.
//!
//! Both are grids of hexahedra cut into six tetrahedra each ([`KUHN`]), so every face is cut the same way from both
//! sides and nothing hangs.

mod cuboid;
mod dogbone;
mod grid;
mod stations;

pub use cuboid::cuboid;
pub use dogbone::{DogboneShape, dogbone};
pub use grid::KUHN;

use super::MeshError;
use thiserror::Error;

/// The most elements a built-in shape is made of.
pub const MAX_ELEMENTS: u64 = 50_000_000;

/// Why a shape cannot be made.
#[derive(Clone, Debug, Error, PartialEq)]
pub enum ShapeError {
    /// No cells along an axis.
    #[error("{cells:?} cells along x, y and z: there must be at least one along each")]
    NoCells {
        /// Cells along the axes.
        cells: [usize; 3],
    },
    /// A length that is zero, negative, infinite or NaN.
    #[error("{what} is {value}: it must be positive and finite")]
    NotPositive {
        /// Which length.
        what: &'static str,
        /// What was given.
        value: f64,
    },
    /// More elements than [`MAX_ELEMENTS`].
    #[error("{elements} elements are more than the {MAX_ELEMENTS} that are allowed")]
    TooManyElements {
        /// How many it would take (at most what 64 bits hold).
        elements: u64,
    },
    /// An element would not fit into the sample.
    #[error("elements of {element_size} do not fit into a sample whose {what} is {limit}")]
    ElementTooLarge {
        /// The element size given.
        element_size: f64,
        /// Which length it exceeds.
        what: &'static str,
        /// That length.
        limit: f64,
    },
    /// The gauge is not narrower than the grips.
    #[error("the gauge, {gauge_width} wide, is not narrower than the grips, {grip_width} wide")]
    GaugeTooWide {
        /// Width of the gauge.
        gauge_width: f64,
        /// Width of the grips.
        grip_width: f64,
    },
    /// The fillet would meet the grip more steeply than 60 degrees (a quarter circle meets it at 90).
    #[error("a fillet radius of {fillet_radius} is too small to widen the sample well: it must be at least {least}")]
    FilletTooSmall {
        /// Radius given.
        fillet_radius: f64,
        /// The smallest that gives well-shaped elements: the grip's overhang times two.
        least: f64,
    },
    /// Grips and fillets leave nothing for the gauge.
    #[error("grips and fillets take {taken} of a length of {length}: nothing is left for the gauge")]
    NoGauge {
        /// Length of both grips and both fillets.
        taken: f64,
        /// Length of the sample.
        length: f64,
    },
    /// Proportions so extreme, or lengths so large or small, that elements have no volume in floating point.
    #[error("the shape cannot be meshed: {0}")]
    Mesh(#[from] MeshError),
}

/// Refuses lengths that are zero, negative, infinite or NaN.
fn positive(what: &'static str, value: f64) -> Result<(), ShapeError> {
    if value > 0.0 && value.is_finite() { Ok(()) } else { Err(ShapeError::NotPositive { what, value }) }
}
