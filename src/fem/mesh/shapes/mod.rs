//! Built-in meshes: the box, the dogbone and the tube.
//!
//! All are grids of hexahedra, which may be cut into six tetrahedra each ([`KUHN`]). Adjacent cells cut their common
//! face along the same diagonal, so the mesh is conforming.

mod axial_grading;
mod cuboid;
mod dogbone;
mod grid;
mod tube;

pub use cuboid::{cuboid, cuboid_of};
pub use dogbone::{DogboneShape, dogbone};
pub use grid::KUHN;
pub use tube::{TubeShape, between_on_tube, tube};

use super::MeshError;
use thiserror::Error;

/// The maximum number of elements of a built-in shape.
pub const MAX_ELEMENTS: u64 = 50_000_000;

/// The error of a shape that cannot be meshed. All lengths are in m.
#[derive(Clone, Debug, Error, PartialEq)]
pub enum ShapeError {
    /// There are no cells along an axis. The value is the number of cells along each axis.
    #[error("{0:?} cells along x, y and z: there must be at least one along each")]
    NoCells([usize; 3]),
    /// A length is zero, negative, infinite or NaN.
    #[error("{what} is {value}: it must be positive and finite")]
    NotPositive {
        /// Name of the length.
        what: &'static str,
        /// The given value.
        value: f64,
    },
    /// The mesh would have more than [`MAX_ELEMENTS`] elements. The value is the number of elements, or `u64::MAX` if
    /// it is larger.
    #[error("{0} elements are more than the {MAX_ELEMENTS} that are allowed")]
    TooManyElements(u64),
    /// The element size exceeds a dimension of the dogbone.
    #[error("the element size {element_size} exceeds the {what}, {limit}")]
    ElementTooLarge {
        /// The given element size.
        element_size: f64,
        /// Name of the dimension.
        what: &'static str,
        /// The value of the dimension.
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
    /// The fillet would meet the grip at more than 60 degrees (a quarter circle meets it at 90).
    #[error("a fillet radius of {fillet_radius} is too small for well-shaped elements: it must be at least {least}")]
    FilletTooSmall {
        /// The given radius.
        fillet_radius: f64,
        /// The minimum radius for well-shaped elements: twice the overhang of the grip.
        least: f64,
    },
    /// Grips and fillets leave nothing for the gauge.
    #[error("grips and fillets take {taken} of a length of {length}: nothing is left for the gauge")]
    NoGauge {
        /// Total length of grips and fillets.
        taken: f64,
        /// Length of the sample.
        length: f64,
    },
    /// A tube has too few cells. The value is the number of cells through the wall, around the axis and along it.
    #[error("{0:?} cells through the wall, around the axis and along it: there must be at least 1, 3 and 1")]
    TubeCells([usize; 3]),
    /// The inner radius of a tube is not below the outer one.
    #[error("an inner radius of {inner_radius} is not below the outer radius, {outer_radius}")]
    NoWall {
        /// The inner radius.
        inner_radius: f64,
        /// The outer radius.
        outer_radius: f64,
    },
    /// Elements are flat in floating-point arithmetic because of extreme proportions or very large or small lengths.
    #[error("the shape cannot be meshed: {0}")]
    Mesh(#[from] MeshError),
}

/// Returns an error if a length is zero, negative, infinite or NaN.
fn positive(what: &'static str, value: f64) -> Result<(), ShapeError> {
    if value > 0.0 && value.is_finite() { Ok(()) } else { Err(ShapeError::NotPositive { what, value }) }
}

/// Checks that [`Mesh::new`](super::Mesh::new) accepts the parts of a shape without changes.
#[cfg(test)]
fn assert_valid(mesh: &super::Mesh) {
    let super::Mesh { nodes, elements, region_of, regions, surfaces, .. } = mesh.clone();
    assert_eq!(super::Mesh::new(nodes, elements, region_of, regions, surfaces).as_ref(), Ok(mesh));
}
