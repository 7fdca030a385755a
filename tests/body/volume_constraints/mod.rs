//! Constrained volumes of regions and cavities.

mod closed_forms;
mod derivatives;
#[path = "../../support/hollow_box.rs"]
mod hollow_box;
mod runs;
mod setup;
mod sphere;

use biotissue::fem::boundary::{Conditions, LoadCurve, SurfaceCondition};
use biotissue::fem::constraint::{ConstrainedVolume, ConstraintMethod, VolumeConstraint};

fn region(name: &str) -> VolumeConstraint {
    let of = ConstrainedVolume::Region(name.into());
    VolumeConstraint { name: name.into(), of, curve: None, method: ConstraintMethod::Multiplier }
}

fn cavity(surfaces: &[&str]) -> VolumeConstraint {
    let of = ConstrainedVolume::Cavity(surfaces.iter().map(|&name| name.into()).collect());
    VolumeConstraint { name: surfaces[0].into(), of, curve: None, method: ConstraintMethod::Multiplier }
}

fn driven(constraint: VolumeConstraint, curve: &[[f64; 2]]) -> VolumeConstraint {
    VolumeConstraint { curve: Some(LoadCurve::table(curve).unwrap()), ..constraint }
}

fn penalized(constraint: VolumeConstraint) -> VolumeConstraint {
    let method = ConstraintMethod::Penalty { factor: ConstraintMethod::DEFAULT_PENALTY };
    VolumeConstraint { method, ..constraint }
}

fn prescribed(surface: &str, displacement: [Option<f64>; 3]) -> SurfaceCondition {
    SurfaceCondition { surface: surface.into(), displacement, curve: LoadCurve::Ramp }
}

/// A body held at x0, whose side x1 moves.
fn sheared(constraints: Vec<VolumeConstraint>) -> Conditions {
    let surfaces = vec![prescribed("x0", [Some(0.0); 3]), prescribed("x1", [Some(0.4), Some(0.3), None])];
    Conditions { surfaces, constraints, ..Conditions::default() }
}
