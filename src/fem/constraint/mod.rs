//! Volume constraints: named [`VolumeConstraint`]s, resolved on a mesh into [`Constraints`].
//!
//! # Formulation
//! A constraint controls the volume `V(u)` of a region or of a cavity. With its pressure `p`, the weak form of
//! [`assembly`](super::assembly) and the constraint read
//!
//! ```text
//! r = f_int - f_ext - p dV/du = 0,
//! c = V - V_target(t) + (p - p_k) / kappa = 0,      V_target = V0 factor(t),
//! ```
//!
//! with `1 / kappa = 0` for a Lagrange multiplier. A positive pressure presses on the walls of a cavity. In a region it
//! adds the Cauchy stress `-p I`, as in an incompressible material. The penalty method is the augmented Lagrangian
//! method (D. P. Bertsekas, *Constrained Optimization and Lagrange Multiplier Methods*, 1982, chapter 2): `p_k` is
//! fixed during a Newton solve, and `p_(k+1) = p` after it.
//!
//! `p dV/du` of a cavity is an external force on its surfaces; that of a region is a part of the internal forces, which
//! balance each other. The dense matrix `dV/du dV/du^T` borders the stiffness ([`Border`](crate::las::Border)) and is
//! never assembled; `-p d^2V/du^2` is sparse and part of the stiffness.
//!
//! # Weight
//! `r` is a force and `c` a volume. The norm that Newton reduces is `sqrt(|r|^2 + sum (w c)^2)` with the weight
//! `w = |A| V0^(-1/3)`, which turns a volume error into the force that causes it: `|A|` is the mean of the norm of the
//! tangent `dP/dF` at rest over the region, or over the body for a cavity. It stays the same throughout a run.

mod cavity;
mod conditions;
mod error;

pub use cavity::Cavity;
pub use conditions::{ConstrainedVolume, ConstraintMethod, VolumeConstraint};
pub use error::{ConstraintError, OpenEdge};

use super::assembly::Geometry;
use super::boundary::{BoundaryError, LoadCurve};
use super::mesh::{Mesh, Part};

/// The state of a constraint.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct VolumeState {
    /// The volume, m^3.
    pub volume: f64,
    /// The target volume, m^3.
    pub target: f64,
    /// The pressure `p`, Pa.
    pub pressure: f64,
    /// The pressure `p_k` of the last augmentation, Pa; only the penalty method uses it.
    pub augmented: f64,
}

/// A constraint resolved on a mesh.
#[derive(Clone, Debug)]
pub struct Constraint {
    name: String,
    domain: Domain,
    curve: Option<LoadCurve>,
    method: ConstraintMethod,
    /// The reference volume, m^3.
    reference: f64,
    /// The weight `w`, N/m^3.
    weight: f64,
    /// `1 / kappa`, m^3/Pa.
    compliance: f64,
}

/// The volume of a constraint on a mesh.
#[derive(Clone, Debug)]
pub(super) enum Domain {
    /// Whether each integration point belongs to the region. In a part of a mesh, `own` tells whose volume counts on this
    /// rank.
    Region { points: Vec<bool>, own: Option<Vec<bool>> },
    /// The surfaces of the cavity.
    Cavity(Cavity),
}

/// All volume constraints of a body.
#[derive(Clone, Debug, Default)]
pub struct Constraints(Vec<Constraint>);

impl Constraints {
    /// Resolves the names, and checks that the volumes exist and that free displacement components change them.
    /// `prescribed` tells which components of each node are prescribed.
    ///
    /// # Errors
    /// Returns [`ConstraintError`] for the first constraint that cannot be imposed.
    ///
    /// # Panics
    /// Panics if `prescribed` has fewer entries than the mesh has nodes.
    pub fn new(
        mesh: &Mesh,
        geometry: &Geometry,
        conditions: &[VolumeConstraint],
        prescribed: &[[bool; 3]],
    ) -> Result<Self, ConstraintError> {
        let resolve = |condition| Constraint::new(mesh, geometry, condition, prescribed);
        conditions.iter().map(resolve).collect::<Result<_, _>>().map(Self)
    }

    /// Resolves the constraints on a part of the mesh, given an excerpt that contains it, its place there, and the
    /// reference volumes in the whole mesh, on which [`Constraints::new`] has checked them.
    pub(super) fn on_part(
        (excerpt, place): (&Mesh, &Part),
        part: &Mesh,
        conditions: &[VolumeConstraint],
        volumes: &[f64],
    ) -> Result<Self, ConstraintError> {
        let resolve = |(condition, &volume): (&VolumeConstraint, &f64)| {
            let VolumeConstraint { name, of, .. } = condition;
            let domain = match of {
                ConstrainedVolume::Region(region) => {
                    Domain::Region { points: points_of(part, name, region)?, own: Some(part.own_points()) }
                }
                ConstrainedVolume::Cavity(surfaces) => {
                    Domain::Cavity(Cavity::new(excerpt, name, surfaces)?.on_part(place))
                }
            };
            Ok(Constraint::in_domain(condition, domain, volume))
        };
        conditions.iter().zip(volumes).map(resolve).collect::<Result<_, _>>().map(Self)
    }

    /// Returns the reference volumes, m^3.
    pub(super) fn reference_volumes(&self) -> Vec<f64> {
        self.iter().map(|constraint| constraint.reference).collect()
    }

    /// Returns the constraints, in their order.
    pub fn iter(&self) -> impl Iterator<Item = &Constraint> {
        self.0.iter()
    }

    pub(super) fn iter_mut(&mut self) -> impl Iterator<Item = &mut Constraint> {
        self.0.iter_mut()
    }

    /// Returns the number of constraints.
    pub fn len(&self) -> usize {
        self.0.len()
    }

    /// Returns true if there are no constraints.
    pub fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    /// Returns true if the volume of a cavity is constrained, so that external forces depend on the displacements.
    pub fn have_cavities(&self) -> bool {
        self.iter().any(|constraint| constraint.cavity().is_some())
    }

    /// Returns the sum of the pressures of constrained regions at each of the integration points, Pa; `None` if there is
    /// none. A pressure `p` adds `-p I` to the Cauchy stress of the material.
    pub fn region_pressures(&self, states: &[VolumeState], points: usize) -> Option<Vec<f64>> {
        let mut sums: Option<Vec<f64>> = None;
        for (constraint, state) in self.iter().zip(states) {
            let Some(of_region) = constraint.region_points().filter(|_| state.pressure != 0.0) else { continue };
            let sums = sums.get_or_insert_with(|| vec![0.0; points]);
            let inside = sums.iter_mut().zip(of_region).filter(|(_, is_inside)| **is_inside);
            inside.for_each(|(sum, _)| *sum += state.pressure);
        }
        sums
    }

    /// Returns the pseudo-times at which the rate of a target jumps.
    pub fn break_points(&self) -> Vec<f64> {
        self.iter().filter_map(|constraint| constraint.curve.as_ref()).flat_map(LoadCurve::break_points).collect()
    }
}

impl Constraint {
    fn new(
        mesh: &Mesh,
        geometry: &Geometry,
        condition: &VolumeConstraint,
        prescribed: &[[bool; 3]],
    ) -> Result<Self, ConstraintError> {
        let VolumeConstraint { name, of, .. } = condition;
        check_parameters(condition)?;
        let domain = match of {
            ConstrainedVolume::Region(region) => Domain::Region { points: points_of(mesh, name, region)?, own: None },
            ConstrainedVolume::Cavity(surfaces) => Domain::Cavity(Cavity::new(mesh, name, surfaces)?),
        };
        let mut constraint = Self::in_domain(condition, domain, 0.0);
        let at_rest = vec![[0.0; 3]; mesh.nodes().len()];
        let mut gradient = at_rest.clone();
        constraint.reference = constraint.evaluate(geometry, &at_rest, &mut gradient);
        constraint.check_influence(&gradient, prescribed)?;
        Ok(constraint)
    }

    /// A constraint of this reference volume, m^3, before it is weighted.
    fn in_domain(condition: &VolumeConstraint, domain: Domain, reference: f64) -> Self {
        let VolumeConstraint { name, curve, method, .. } = condition.clone();
        Self { name, domain, curve, method, reference, weight: 1.0, compliance: 0.0 }
    }

    /// Checks that the gradient at rest has components that are not prescribed.
    fn check_influence(&self, gradient: &[[f64; 3]], prescribed: &[[bool; 3]]) -> Result<(), ConstraintError> {
        /// The volume of a region depends on the nodes at its boundary only; the gradient at other nodes is rounding.
        const ROUNDING: f64 = 1e-10;
        let (mut free, mut all) = (0.0, 0.0);
        for (slope, is_prescribed) in gradient.as_flattened().iter().zip(prescribed.as_flattened()) {
            all += slope * slope;
            if !is_prescribed {
                free += slope * slope;
            }
        }
        if free > ROUNDING * ROUNDING * all {
            Ok(())
        } else {
            Err(ConstraintError::Fixed { constraint: self.name.clone() })
        }
    }

    /// Returns the name.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Returns the volume in the reference state, m^3.
    pub fn reference(&self) -> f64 {
        self.reference
    }

    /// Returns the weight `w` that turns a volume error into a force, N/m^3.
    pub fn weight(&self) -> f64 {
        self.weight
    }

    /// Returns `1 / kappa`, m^3/Pa: 0 for a multiplier.
    pub fn compliance(&self) -> f64 {
        self.compliance
    }

    /// Returns the method.
    pub fn method(&self) -> ConstraintMethod {
        self.method
    }

    /// Returns the cavity, if the volume is that of one.
    pub fn cavity(&self) -> Option<&Cavity> {
        match &self.domain {
            Domain::Region { .. } => None,
            Domain::Cavity(cavity) => Some(cavity),
        }
    }

    /// Returns whether each integration point belongs to the region, if the volume is that of one.
    pub fn region_points(&self) -> Option<&[bool]> {
        match &self.domain {
            Domain::Region { points, .. } => Some(points),
            Domain::Cavity(_) => None,
        }
    }

    /// Returns the target volume at pseudo-time `t`, m^3.
    pub fn target(&self, t: f64) -> f64 {
        self.curve.as_ref().map_or(self.reference, |curve| self.reference * curve.factor(t, [0.0; 3]))
    }

    /// Returns `c = V - V_target + (p - p_k) / kappa`, m^3.
    pub fn residual(&self, state: &VolumeState) -> f64 {
        state.volume - state.target + self.compliance * (state.pressure - state.augmented)
    }

    /// Returns the volume at these displacements, m^3, and writes `dV/du`, m^2, for all nodes. In a part of a mesh, the
    /// volume is the share of this rank, and the gradient complete at own nodes.
    pub(super) fn evaluate(&self, geometry: &Geometry, displacements: &[[f64; 3]], gradient: &mut [[f64; 3]]) -> f64 {
        gradient.fill([0.0; 3]);
        match &self.domain {
            Domain::Region { points, own } => {
                geometry.add_volume_gradient((points, own.as_deref()), displacements, gradient)
            }
            Domain::Cavity(cavity) => {
                cavity.add_gradient(displacements, gradient);
                cavity.volume(displacements)
            }
        }
    }

    /// Sets the weight and the penalty parameter from the mean norm `|A|` of the tangent at rest, Pa.
    pub(super) fn set_stiffness(&mut self, tangent: f64) {
        // A body without stiffness at rest has no scale; its first linear system is singular anyway.
        let tangent = if tangent > 0.0 { tangent } else { 1.0 };
        self.weight = tangent / self.reference.cbrt();
        self.compliance = match self.method {
            ConstraintMethod::Multiplier => 0.0,
            ConstraintMethod::Penalty { factor } => self.reference / (factor * tangent),
        };
    }
}

fn check_parameters(condition: &VolumeConstraint) -> Result<(), ConstraintError> {
    let constraint = || condition.name.clone();
    if let ConstraintMethod::Penalty { factor } = condition.method
        && !(factor > 0.0 && factor.is_finite())
    {
        return Err(ConstraintError::Penalty { constraint: constraint(), factor });
    }
    let Some(curve) = &condition.curve else { return Ok(()) };
    // Between its points, a table is linear; a ramp starts at no volume at all.
    let mut times = curve.break_points();
    times.extend([0.0, 1.0]);
    let factors = times.into_iter().map(|t| (t, curve.factor(t, [0.0; 3])));
    match factors.into_iter().find(|(_, factor)| !(*factor > 0.0 && factor.is_finite())) {
        Some((t, factor)) => Err(ConstraintError::Target { constraint: constraint(), t, factor }),
        None => Ok(()),
    }
}

/// Returns whether each integration point belongs to a region; `*` is the whole body.
fn points_of(mesh: &Mesh, constraint: &str, name: &str) -> Result<Vec<bool>, ConstraintError> {
    if name == "*" {
        return Ok(vec![true; mesh.points().len()]);
    }
    let region = mesh.region(name).ok_or_else(|| ConstraintError::Unknown {
        constraint: constraint.to_owned(),
        reason: BoundaryError::UnknownRegion { name: name.to_owned(), known: mesh.regions().to_vec() },
    })?;
    let in_region: Vec<bool> = mesh.region_of().iter().map(|&of| of == region).collect();
    Ok(mesh.points().spread(&in_region))
}
