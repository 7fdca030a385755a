//! The fibers of anisotropic formulas, for the field files.

use nalgebra::{Matrix3, Vector3};

use crate::app::case::Case;
use crate::fem::mesh::Mesh;
use crate::fiber::orientation::principal;
use crate::las::RealBackend;
use crate::tissue::micro_scale::Library;

/// The fiber families of a formula in the deformed body.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct DeformedFamilies {
    /// The mean of `a a^T` over the families with the deformed axes `a`, unit vectors; trace 1. Dispersion is left out.
    pub orientation: Matrix3<f64>,
    /// Its principal direction.
    pub direction: Vector3<f64>,
    /// Its largest eigenvalue minus 1/3: 2/3 for one family.
    pub alignment: f64,
    /// The smallest and the largest stretch of an axis.
    pub stretch: [f64; 2],
}

impl DeformedFamilies {
    /// Deforms axes, unit vectors in the undeformed body, by the deformation gradient `f`; `None` without an axis.
    fn new(axes: impl Iterator<Item = Vector3<f64>>, f: &Matrix3<f64>) -> Option<Self> {
        let (mut sum, mut stretch, mut families) = (Matrix3::zeros(), [f64::INFINITY, 0.0_f64], 0.0);
        for axis in axes {
            let deformed = f * axis;
            let length = deformed.norm();
            let direction = deformed / length;
            sum += direction * direction.transpose();
            stretch = [stretch[0].min(length), stretch[1].max(length)];
            families += 1.0;
        }
        (families > 0.0).then(|| {
            let orientation = sum / families;
            let (direction, largest) = principal(&orientation);
            Self { orientation, direction, alignment: largest - 1.0 / 3.0, stretch }
        })
    }
}

/// The regions of a case by those of its mesh.
pub(super) struct FormulaFibers {
    region_of: Vec<Option<usize>>,
}

impl FormulaFibers {
    pub(super) fn new(case: &Case, mesh: &Mesh) -> Self {
        Self { region_of: mesh.regions().iter().map(|name| case.region_of(name)).collect() }
    }

    /// Returns the fibers of the formula, or of the matrix of the RVE, at a point of a region of the mesh; `None` if it
    /// has no fiber axis.
    pub(super) fn at<B: RealBackend>(
        &self,
        library: &Library<B>,
        (region, point): (u32, usize),
        f: &Matrix3<f64>,
    ) -> Option<DeformedFamilies> {
        let formula = library.formula_at((*self.region_of.get(region as usize)?)?, point)?;
        DeformedFamilies::new(formula.fiber_axes(), f)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn fibers_move_with_the_body() {
        let f = Matrix3::new(2.0, 1.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0);
        let one = DeformedFamilies::new([Vector3::y()].into_iter(), &f).unwrap();
        let expected = Vector3::new(1.0, 1.0, 0.0).normalize();
        assert!((one.direction.dot(&expected).abs() - 1.0).abs() < 1e-14, "{one:?}");
        assert!((one.alignment - 2.0 / 3.0).abs() < 1e-14 && (one.orientation.trace() - 1.0).abs() < 1e-14);
        assert_eq!(one.stretch, [2.0_f64.sqrt(); 2]);
        let two = DeformedFamilies::new([Vector3::x(), Vector3::z()].into_iter(), &f).unwrap();
        assert_eq!((two.orientation, two.stretch), (Matrix3::from_diagonal(&Vector3::new(0.5, 0.0, 0.5)), [1.0, 2.0]));
        assert_eq!(DeformedFamilies::new(std::iter::empty(), &f), None);
    }
}
