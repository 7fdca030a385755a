//! Moduli and radii of fibers in other units.

use super::{in_region, range, short};
use crate::app::case::Case;
use crate::fiber::rve::StressScale;
use crate::las::RealBackend;
use crate::tissue::micro_scale::Library;

/// Young's modulus of a fiber at rest, Pa, below which it is probably in MPa: collagen has 1e8 to 1e9, elastin 1e6.
const SOFTEST_FIBER: f64 = 1e4;
/// The greatest share of the cube that fibers fill: that of parallel cylinders which touch each other is 0.91.
const LARGEST_FRACTION: f64 = 0.91;

/// Finds regions with fibers that are too soft or too thick.
pub(super) fn check_fibers<B: RealBackend>(case: &Case, library: &Library<B>) -> Vec<String> {
    let mut warnings = Vec::new();
    for region in 0..library.regions().len() {
        let models = || library.models_of_region(region).iter().map(|&model| &library.models()[model]);
        let moduli = models().flat_map(|model| model.truss().laws().map(|(law, _)| law.youngs_modulus()));
        let raw = models().filter(|model| model.stress_scale() == StressScale::Raw);
        let messages = [soft(moduli), thick(raw.map(|model| model.truss().volume()))];
        warnings.extend(messages.into_iter().flatten().map(|message| in_region(case, region, &message)));
    }
    warnings
}

/// Describes fibers that are too soft, given their moduli at rest.
fn soft(moduli: impl Iterator<Item = f64>) -> Option<String> {
    let [softest, _] = range(moduli)?;
    (softest < SOFTEST_FIBER).then(|| {
        format!(
            "fibers with a Young's modulus of {} Pa are softer than any of tissue (elastin: about 1e6, collagen: 1e8 to 1e9): \
             is `youngs_modulus` in Pa?",
            short(softest)
        )
    })
}

/// Describes fibers that are too thick, given their volumes in the unit cube.
fn thick(volumes: impl Iterator<Item = f64>) -> Option<String> {
    let [_, largest] = range(volumes)?;
    (largest > LARGEST_FRACTION).then(|| {
        format!(
            "with `scale = \"raw\"`, the fibers fill {} times the volume of their cube: the `radius` is in units of the edge of the \
             cube; or give a `fiber_volume_fraction` instead of `scale`",
            short(largest)
        )
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_modulus_in_megapascals_and_a_radius_in_micrometers_are_found() {
        assert_eq!((soft([1e6, 1e9].into_iter()), soft(std::iter::empty())), (None, None));
        let expected = "fibers with a Young's modulus of 100 Pa are softer than any of tissue (elastin: about 1e6, collagen: 1e8 to \
                        1e9): is `youngs_modulus` in Pa?";
        assert_eq!(soft([1e8, 100.0].into_iter()).as_deref(), Some(expected));
        assert_eq!(thick([1e-12, 0.9].into_iter()), None);
        // 54 edges of fiber with a radius of 0.5 edges.
        let expected = "with `scale = \"raw\"`, the fibers fill 42.41 times the volume of their cube: the `radius` is in units of the \
                        edge of the cube; or give a `fiber_volume_fraction` instead of `scale`";
        assert_eq!(thick([54.0 * 0.25 * std::f64::consts::PI].into_iter()).as_deref(), Some(expected));
    }
}
