//! Rigid-body modes that the boundary conditions leave free.
//!
//! A body that can move or turn as a whole has a singular stiffness in the undeformed state, whatever it is made of.
//! Rounding hides that from a factorization; the geometry shows it. A rigid motion moves the node at `x` by
//! `v + w x (x - c)`. Every prescribed displacement component is one linear equation in the six numbers of `v` and `w`;
//! what satisfies all equations of a part, with zero on the right, is free. Parts are the connected components of the
//! mesh: each must be held for itself.

mod freedom;
mod parts;

use nalgebra::{DMatrix, Matrix6, Vector3, Vector6};
use thiserror::Error;

pub use freedom::{Freedom, Screw};

use super::mesh::Mesh;
use parts::{Part, parts};

/// How many parts an error lists.
const LISTED: usize = 20;
/// A mode is free if no prescribed component moves by more than this part of what the body moves.
const FREE_BELOW: f64 = 1e-8;

/// A body of which a part can move or turn as a whole.
#[derive(Clone, Debug, PartialEq, Error)]
#[error("{}", describe(parts))]
pub struct UnheldBody {
    /// The parts that are not held, by their lowest node.
    pub parts: Vec<UnheldPart>,
}

/// One of them.
#[derive(Clone, Debug, PartialEq)]
pub struct UnheldPart {
    /// The regions it lies in and how many elements it has, where the mesh has several unconnected parts.
    pub name: Option<String>,
    /// How it can move.
    pub freedom: Freedom,
}

/// Checks that every connected part of `mesh` is held in all six rigid-body modes; `prescribed[node][component]` tells
/// which displacements are.
///
/// # Errors
/// [`UnheldBody`], which names the modes.
///
/// # Panics
/// Where `prescribed` has fewer nodes than the mesh.
pub fn check(mesh: &Mesh, prescribed: &[[bool; 3]]) -> Result<(), UnheldBody> {
    let parts = parts(mesh);
    let is_one = parts.len() == 1;
    let unheld = parts.iter().filter_map(|part| {
        let freedom = freedom_of(mesh, part, prescribed)?;
        Some(UnheldPart { name: (!is_one).then(|| part.name(mesh)), freedom })
    });
    let parts: Vec<UnheldPart> = unheld.collect();
    if parts.is_empty() { Ok(()) } else { Err(UnheldBody { parts }) }
}

/// How a part can move; `None` if it is held.
fn freedom_of(mesh: &Mesh, part: &Part, prescribed: &[[bool; 3]]) -> Option<Freedom> {
    let position = |node: u32| Vector3::from(mesh.nodes()[node as usize]);
    let nodes = || part.nodes.iter().copied();
    let center = nodes().map(position).sum::<Vector3<f64>>() / part.nodes.len() as f64;
    let size = nodes().map(|node| (position(node) - center).norm()).fold(0.0, f64::max);
    let equations = nodes().flat_map(|node| {
        let arm = (position(node) - center) / size;
        let held = (0..3).filter(move |&component| prescribed[node as usize][component]);
        held.map(move |component| equation(component, arm))
    });
    let equations: Vec<Vector6<f64>> = equations.collect();
    // What rounding of the coordinates leaves of an arm counts as nothing.
    let rounding = 16.0 * f64::EPSILON * center.norm() / size;
    let modes = null_space(&equations, rounding.max(FREE_BELOW));
    (!modes.is_empty()).then(|| Freedom::new(center, size, &modes))
}

/// The displacement component of a node at `arm` from the center, in terms of `v` and `w`: `e . (v + w x arm)`.
fn equation(component: usize, arm: Vector3<f64>) -> Vector6<f64> {
    let direction = Vector3::ith(component, 1.0);
    let turned = arm.cross(&direction);
    Vector6::new(direction.x, direction.y, direction.z, turned.x, turned.y, turned.z)
}

/// An orthonormal basis of what all equations leave below `zero`.
fn null_space(equations: &[Vector6<f64>], zero: f64) -> Vec<Vector6<f64>> {
    let largest = |mode: &Vector6<f64>| equations.iter().map(|row| row.dot(mode).abs()).fold(0.0, f64::max);
    basis(equations).into_iter().filter(|mode| largest(mode) < zero).collect()
}

/// The right singular vectors of the equations, by the triangle of their QR factorization.
fn basis(equations: &[Vector6<f64>]) -> Vec<Vector6<f64>> {
    // Six rows of zeros more: there may be fewer equations than unknowns.
    let rows = equations.len() + 6;
    let entry = |row: usize, column: usize| equations.get(row).map_or(0.0, |equation| equation[column]);
    let triangle = DMatrix::from_fn(rows, 6, entry).qr().unpack_r();
    let triangle = Matrix6::from_fn(|i, j| triangle[(i, j)]);
    let vectors = triangle.svd(false, true).v_t.unwrap_or_else(Matrix6::identity);
    vectors.row_iter().map(|row| row.transpose()).collect()
}

fn describe(parts: &[UnheldPart]) -> String {
    let mut all: Vec<String> = parts.iter().take(LISTED).map(describe_part).collect();
    if parts.len() > LISTED {
        all.push(format!("and {} more", parts.len() - LISTED));
    }
    all.join("; ")
}

fn describe_part(UnheldPart { name, freedom }: &UnheldPart) -> String {
    match name {
        Some(name) => format!("{name} is {freedom}"),
        None => format!("the body is {freedom}"),
    }
}

#[cfg(test)]
mod tests;
