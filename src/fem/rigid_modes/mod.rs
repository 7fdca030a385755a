//! Detection of rigid-body modes that the boundary conditions do not constrain.
//!
//! A body with an unconstrained rigid-body mode has a singular stiffness in the undeformed state, whatever its
//! material. Because of rounding, a factorization may not detect the singularity; the geometry does. A rigid motion
//! moves the node at `x` by `v + w x (x - c)`. Every prescribed displacement component is one homogeneous linear
//! equation in the six components of `v` and `w`, and so is every direction in which a spring supports a node; a mode in the null space of these equations is free. Each connected
//! component ("part") of the mesh must be constrained separately.
//!
//! ```
//! use biotissue::fem::{mesh::shapes, rigid_modes};
//!
//! let mesh = shapes::cuboid([1, 1, 1], [1.0; 3]).unwrap();
//! // The lower side slides in its plane.
//! let prescribed: Vec<[bool; 3]> = mesh.nodes().iter().map(|x| [false, false, x[2] == 0.0]).collect();
//! let error = rigid_modes::check(&mesh, &prescribed, []).unwrap_err();
//! assert_eq!(error.to_string(), "the body is free to move along x and y and to rotate about z");
//! ```

mod free_modes;
mod parts;

use std::collections::HashMap;

use nalgebra::{DMatrix, Matrix6, Vector3, Vector6};
use thiserror::Error;

pub use free_modes::{FreeModes, Screw};

use super::boundary::Support;
use super::mesh::Mesh;
use parts::{Part, parts};

/// The maximum number of parts that an error message lists.
const LISTED: usize = 20;
/// A mode is free if every prescribed component moves by less than this fraction of the motion of the body.
const FREE_BELOW: f64 = 1e-8;

/// A body with a part that has free rigid-body modes.
#[derive(Clone, Debug, PartialEq, Error)]
#[error("{}", describe(parts))]
pub struct UnderconstrainedBody {
    /// The insufficiently constrained parts, by ascending lowest node.
    pub parts: Vec<UnderconstrainedPart>,
}

/// A part with free rigid-body modes.
#[derive(Clone, Debug, PartialEq)]
pub struct UnderconstrainedPart {
    /// Regions, position and number of elements of the part; `None` if the mesh is connected.
    pub name: Option<String>,
    /// The free rigid-body modes.
    pub free_modes: FreeModes,
}

/// Checks that the prescribed displacements and the springs constrain all six rigid-body modes of every connected part of `mesh`.
/// `prescribed[node][component]` is true for prescribed components.
///
/// # Errors
/// Returns [`UnderconstrainedBody`] with the free modes of each part.
///
/// # Panics
/// Panics if `prescribed` has fewer nodes than the mesh.
pub fn check<'a>(
    mesh: &Mesh,
    prescribed: &[[bool; 3]],
    supports: impl IntoIterator<Item = &'a Support>,
) -> Result<(), UnderconstrainedBody> {
    let mut springs: HashMap<u32, Vec<Vector3<f64>>> = HashMap::new();
    for support in supports {
        springs.entry(support.node).or_default().push(support.direction.into());
    }
    let parts = parts(mesh);
    let is_one = parts.len() == 1;
    let underconstrained = parts.iter().filter_map(|part| {
        let free_modes = free_modes_of(mesh, part, prescribed, &springs)?;
        Some(UnderconstrainedPart { name: (!is_one).then(|| part.name(mesh)), free_modes })
    });
    let parts: Vec<UnderconstrainedPart> = underconstrained.collect();
    if parts.is_empty() { Ok(()) } else { Err(UnderconstrainedBody { parts }) }
}

/// Returns the free modes of a part; `None` if it has none.
fn free_modes_of(
    mesh: &Mesh,
    part: &Part,
    prescribed: &[[bool; 3]],
    springs: &HashMap<u32, Vec<Vector3<f64>>>,
) -> Option<FreeModes> {
    let position = |node: u32| Vector3::from(mesh.nodes()[node as usize]);
    let nodes = || part.nodes.iter().copied();
    let center = nodes().map(position).sum::<Vector3<f64>>() / part.nodes.len() as f64;
    let size = nodes().map(|node| (position(node) - center).norm()).fold(0.0, f64::max);
    let equations = nodes().flat_map(|node| {
        let arm = (position(node) - center) / size;
        let components = (0..3).filter(move |&component| prescribed[node as usize][component]);
        let held = components.map(|component| Vector3::ith(component, 1.0));
        let supported = springs.get(&node).into_iter().flatten().copied();
        held.chain(supported).map(move |direction| equation(direction, arm))
    });
    let equations: Vec<Vector6<f64>> = equations.collect();
    // The threshold exceeds the rounding error of the arms.
    let rounding = 16.0 * f64::EPSILON * center.norm() / size;
    let modes = null_space(&equations, rounding.max(FREE_BELOW));
    (!modes.is_empty()).then(|| FreeModes::new(center, size, &modes))
}

/// Returns the coefficients of `v` and `w` in the displacement `direction . (v + w x arm)` of a node at `arm` from
/// the center.
fn equation(direction: Vector3<f64>, arm: Vector3<f64>) -> Vector6<f64> {
    let moment = arm.cross(&direction);
    Vector6::new(direction.x, direction.y, direction.z, moment.x, moment.y, moment.z)
}

/// Returns orthonormal modes for which every equation is below `zero` in absolute value.
fn null_space(equations: &[Vector6<f64>], zero: f64) -> Vec<Vector6<f64>> {
    let largest = |mode: &Vector6<f64>| equations.iter().map(|row| row.dot(mode).abs()).fold(0.0, f64::max);
    basis(equations).into_iter().filter(|mode| largest(mode) < zero).collect()
}

/// Returns the right singular vectors of the equations, computed from the triangular factor of their QR factorization.
fn basis(equations: &[Vector6<f64>]) -> Vec<Vector6<f64>> {
    // Six zero rows are appended because there may be fewer equations than unknowns.
    let rows = equations.len() + 6;
    let entry = |row: usize, column: usize| equations.get(row).map_or(0.0, |equation| equation[column]);
    let triangle = DMatrix::from_fn(rows, 6, entry).qr().unpack_r();
    let triangle = Matrix6::from_fn(|i, j| triangle[(i, j)]);
    let vectors = triangle.svd(false, true).v_t.unwrap_or_else(Matrix6::identity);
    vectors.row_iter().map(|row| row.transpose()).collect()
}

fn describe(parts: &[UnderconstrainedPart]) -> String {
    let describe = |UnderconstrainedPart { name, free_modes }: &UnderconstrainedPart| match name {
        Some(name) => format!("{name} is {free_modes}"),
        None => format!("the body is {free_modes}"),
    };
    let mut all: Vec<String> = parts.iter().take(LISTED).map(describe).collect();
    if parts.len() > LISTED {
        all.push(format!("and {} more", parts.len() - LISTED));
    }
    all.join("; ")
}

#[cfg(test)]
mod tests;
