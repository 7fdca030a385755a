//! Detection of rigid-body modes that the boundary conditions do not constrain.
//!
//! A body with an unconstrained rigid-body mode has a singular stiffness in the undeformed state, whatever its
//! material. Because of rounding, a factorization may not detect the singularity; the geometry does. A rigid motion
//! moves the node at `x` by `v + w x (x - c)`. Every [`Restraint`] is one homogeneous linear equation in the six
//! components of `v` and `w`; a mode in the null space of these equations is free. Each connected component ("part") of
//! the mesh must be constrained separately, except that a rigid surface connects the parts that it touches.
//!
//! ```
//! use biotissue::fem::mesh::shapes;
//! use biotissue::fem::rigid_modes::{self, Restraint};
//!
//! let mesh = shapes::cuboid([1, 1, 1], [1.0; 3]).unwrap();
//! // The lower side slides in its plane.
//! let held: Vec<[bool; 3]> = mesh.nodes().iter().map(|x| [false, false, x[2] == 0.0]).collect();
//! let error = rigid_modes::check(&mesh, &Restraint::of_components(&mesh, &held), &[]).unwrap_err();
//! assert_eq!(error.to_string(), "the body is free to move along x and y and to rotate about z");
//! ```

mod free_modes;
mod imbalance;
mod parts;

use nalgebra::{DMatrix, Matrix6, Vector3, Vector6};
use thiserror::Error;

pub use free_modes::{FreeModes, Screw};
pub use imbalance::{Imbalance, imbalance};

use super::kinematics::RigidSurface;
use super::mesh::Mesh;
use parts::{Part, parts};

/// The maximum number of parts that an error message lists.
const LISTED: usize = 20;
/// A mode is free if every restraint moves by less than this fraction of the motion of the body.
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

/// A condition on the rigid-body motions of the part of the mesh that contains a node.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Restraint {
    /// A point that moves with the body has no displacement along a direction.
    Displacement {
        /// A node of the part.
        node: u32,
        /// The point, m.
        point: [f64; 3],
        /// The direction, a unit vector.
        direction: [f64; 3],
    },
    /// The part does not rotate about an axis.
    Rotation {
        /// A node of the part.
        node: u32,
        /// The axis, a unit vector.
        axis: [f64; 3],
    },
}

impl Restraint {
    /// Returns the restraints of prescribed displacement components: those for which `held[node][component]` is true.
    ///
    /// # Panics
    /// Panics if `held` has more nodes than the mesh.
    pub fn of_components(mesh: &Mesh, held: &[[bool; 3]]) -> Vec<Self> {
        let of_node = |(node, held): (usize, &[bool; 3])| {
            let (point, held) = (mesh.nodes()[node], *held);
            let components = (0..3).filter(move |&component| held[component]);
            components.map(move |component| Self::component(node as u32, point, component))
        };
        held.iter().enumerate().flat_map(of_node).collect()
    }

    /// The restraint of a displacement component of the node at `point`.
    pub(super) fn component(node: u32, point: [f64; 3], component: usize) -> Self {
        Self::Displacement { node, point, direction: Vector3::ith(component, 1.0).into() }
    }

    fn node(&self) -> u32 {
        match self {
            Self::Displacement { node, .. } | Self::Rotation { node, .. } => *node,
        }
    }

    /// Returns the coefficients of `v` and `w` in the displacement or rotation `v + w x (x - center) / size`.
    fn equation(&self, center: &Vector3<f64>, size: f64) -> Vector6<f64> {
        match *self {
            Self::Displacement { point, direction, .. } => {
                equation(direction.into(), (Vector3::from(point) - center) / size)
            }
            Self::Rotation { axis: [x, y, z], .. } => Vector6::new(0.0, 0.0, 0.0, x, y, z),
        }
    }
}

/// Checks that the restraints constrain all six rigid-body modes of every connected part of `mesh`, whose parts the
/// rigid surfaces connect.
///
/// # Errors
/// Returns [`UnderconstrainedBody`] with the free modes of each part.
///
/// # Panics
/// Panics if a restraint names a node that does not exist.
pub fn check(mesh: &Mesh, restraints: &[Restraint], rigid: &[RigidSurface]) -> Result<(), UnderconstrainedBody> {
    let parts = parts(mesh, rigid);
    let equations = by_part(mesh, &parts, restraints);
    let is_one = parts.len() == 1;
    let underconstrained = parts.iter().zip(&equations).filter_map(|(part, restraints)| {
        let Modes { center, size, modes } = free_modes_of(mesh, part, restraints);
        let name = (!is_one).then(|| part.name(mesh));
        (!modes.is_empty()).then(|| UnderconstrainedPart { name, free_modes: FreeModes::new(center, size, &modes) })
    });
    let parts: Vec<UnderconstrainedPart> = underconstrained.collect();
    if parts.is_empty() { Ok(()) } else { Err(UnderconstrainedBody { parts }) }
}

/// Returns node and component of the fewest displacement components which, held at zero in addition to the restraints,
/// leave no free mode of any part. Only components for which `is_free` is true are used; some modes stay free if these
/// are too few.
///
/// The components are chosen one by one, each as the one that moves most in the modes that are still free, so that they
/// are far apart. There are no more than necessary, so they cause no stress if the loads balance.
///
/// # Panics
/// Panics if a restraint names a node that does not exist.
pub fn minimal_supports(
    mesh: &Mesh,
    restraints: &[Restraint],
    rigid: &[RigidSurface],
    is_free: impl Fn(u32, usize) -> bool,
) -> Vec<(u32, usize)> {
    let parts = parts(mesh, rigid);
    let equations = by_part(mesh, &parts, restraints);
    let mut supports = Vec::new();
    for (part, restraints) in parts.iter().zip(&equations) {
        let Modes { center, size, mut modes } = free_modes_of(mesh, part, restraints);
        while !modes.is_empty() {
            let mut best: Option<((u32, usize), Vec<f64>, f64)> = None;
            for (node, component) in part.nodes.iter().flat_map(|&node| (0..3).map(move |component| (node, component)))
            {
                if !is_free(node, component) {
                    continue;
                }
                let row = Restraint::component(node, mesh.nodes()[node as usize], component).equation(&center, size);
                let motion: Vec<f64> = modes.iter().map(|mode| mode.dot(&row)).collect();
                let squared: f64 = motion.iter().map(|part| part * part).sum();
                // The margin makes the choice among equals independent of rounding.
                if best.as_ref().map_or(squared > FREE_BELOW, |(_, _, most)| squared > most * (1.0 + 1e-6)) {
                    best = Some(((node, component), motion, squared));
                }
            }
            let Some((support, motion, _)) = best else { break };
            supports.push(support);
            modes = without(&modes, &motion);
        }
    }
    supports.sort_unstable();
    supports
}

/// Returns an orthonormal basis of the combinations `sum a_k mode_k` with `a . motion = 0`.
fn without(modes: &[Vector6<f64>], motion: &[f64]) -> Vec<Vector6<f64>> {
    // The Householder reflection that maps `motion` to a multiple of the first unit vector.
    let norm = motion.iter().map(|part| part * part).sum::<f64>().sqrt();
    let mut reflector = motion.to_vec();
    reflector[0] += norm.copysign(motion[0]);
    let squared: f64 = reflector.iter().map(|part| part * part).sum();
    let along: Vector6<f64> = modes.iter().zip(&reflector).map(|(mode, part)| mode * *part).sum();
    let reflected = modes.iter().zip(&reflector).map(|(mode, part)| mode - along * (2.0 * part / squared));
    reflected.skip(1).collect()
}

/// Rigid motions `v + w x (x - center) / size`.
struct Modes {
    center: Vector3<f64>,
    size: f64,
    modes: Vec<Vector6<f64>>,
}

/// Returns the restraints of each part.
fn by_part(mesh: &Mesh, parts: &[Part], restraints: &[Restraint]) -> Vec<Vec<Restraint>> {
    let mut part_of = vec![0_usize; mesh.nodes().len()];
    for (number, part) in parts.iter().enumerate() {
        part.nodes.iter().for_each(|&node| part_of[node as usize] = number);
    }
    let mut of_parts = vec![Vec::new(); parts.len()];
    restraints.iter().for_each(|restraint| of_parts[part_of[restraint.node() as usize]].push(*restraint));
    of_parts
}

/// Returns the free modes of a part.
fn free_modes_of(mesh: &Mesh, part: &Part, restraints: &[Restraint]) -> Modes {
    let position = |node: u32| Vector3::from(mesh.nodes()[node as usize]);
    let nodes = || part.nodes.iter().copied();
    let center = nodes().map(position).sum::<Vector3<f64>>() / part.nodes.len() as f64;
    let size = nodes().map(|node| (position(node) - center).norm()).fold(0.0, f64::max);
    let equations: Vec<Vector6<f64>> = restraints.iter().map(|restraint| restraint.equation(&center, size)).collect();
    // The threshold exceeds the rounding error of the arms.
    let rounding = 16.0 * f64::EPSILON * center.norm() / size;
    Modes { center, size, modes: null_space(&equations, rounding.max(FREE_BELOW)) }
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
