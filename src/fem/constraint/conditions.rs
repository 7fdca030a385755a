//! Volume constraints by name: regions and surfaces with their targets and methods.

use crate::fem::boundary::LoadCurve;

/// A volume that is held, or driven along a curve.
///
/// ```
/// use biotissue::fem::boundary::{Conditions, LoadCurve};
/// use biotissue::fem::constraint::{ConstrainedVolume, ConstraintMethod, VolumeConstraint};
///
/// let inflated = VolumeConstraint {
///     name: "lumen".into(),
///     of: ConstrainedVolume::Cavity(vec!["inner".into()]),
///     curve: Some(LoadCurve::table(&[[0.0, 1.0], [1.0, 1.5]]).unwrap()),
///     method: ConstraintMethod::Multiplier,
/// };
/// let conditions = Conditions { constraints: vec![inflated], ..Conditions::default() };
/// assert!(conditions.loads.is_empty());
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct VolumeConstraint {
    /// The name of the constraint in errors and results.
    pub name: String,
    /// The volume.
    pub of: ConstrainedVolume,
    /// The target volume relative to the reference volume, over pseudo-time; `None` keeps the reference volume.
    pub curve: Option<LoadCurve>,
    /// How the constraint is imposed.
    pub method: ConstraintMethod,
}

/// The volume that a constraint controls.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum ConstrainedVolume {
    /// The elements of this region; `*` is the whole body.
    Region(String),
    /// The cavity that these surfaces enclose together; the body is outside of it.
    Cavity(Vec<String>),
}

/// How a constraint is imposed.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum ConstraintMethod {
    /// A Lagrange multiplier, the pressure: the constraint holds whenever Newton has converged.
    #[default]
    Multiplier,
    /// The augmented Lagrangian method (Uzawa): `p = p_k - kappa (V - V_target)`, and after convergence `p_(k+1) = p`,
    /// until the volume is within the tolerance of Newton, relative to the reference volume.
    Penalty {
        /// The penalty parameter relative to the stiffness of the material, `kappa V0 / |A|`; see
        /// [`ConstraintMethod::DEFAULT_PENALTY`].
        factor: f64,
    },
}

impl ConstraintMethod {
    /// The usual penalty factor. A round of augmentation divides the volume error by about the factor times
    /// `dV/dp |A| / V0`, which is of order 1. A large factor does not harm the linear systems, whose conditioning does
    /// not depend on it.
    pub const DEFAULT_PENALTY: f64 = 100.0;
}
