//! The stress in the field files.

use nalgebra::Matrix3;

use crate::app::case::{Case, RegionMaterial};
use crate::fem::mesh::Mesh;
use crate::tensor::cauchy;

/// The Cauchy stress of every element, by finite or small-strain theory as its material requires.
///
/// In finite strain, `sigma = P F^T / J`. The small-strain material `linear-elastic` does not distinguish the deformed
/// from the undeformed configuration: its `sigma` is `P`, and `P F^T / J` would not even be symmetric.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct CauchyStress {
    /// Per region of the mesh: true for a small-strain material.
    is_small_strain: Vec<bool>,
}

impl CauchyStress {
    pub(super) fn new(case: &Case, mesh: &Mesh) -> Self {
        let is_small_strain = |region: &String| match case.material_of(region) {
            Some(RegionMaterial::Formula(formula)) => formula.is_small_strain(),
            _ => false,
        };
        Self { is_small_strain: mesh.regions().iter().map(is_small_strain).collect() }
    }

    /// Returns `sigma`, Pa, of an element of a region at the deformation gradient `f` and first Piola-Kirchhoff stress
    /// `pk1`.
    pub(super) fn of(&self, region: u32, f: &Matrix3<f64>, pk1: &Matrix3<f64>) -> Matrix3<f64> {
        match self.is_small_strain.get(region as usize) {
            Some(true) => *pk1,
            _ => cauchy(pk1, f),
        }
    }
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;
    use crate::fem::material::{LinearElastic, Material, NeoHookean};
    use crate::fem::mesh::shapes::cuboid;

    const MU: f64 = 3.0e3;
    const LAMBDA: f64 = 5.0e3;

    fn of(model: &str) -> CauchyStress {
        let text = format!(
            "[mesh]\ngenerate = {{ shape = \"box\", cells = [1, 1, 1], size = [1, 1, 1] }}\n[[region]]\nname = \"*\"\n\
             material = {{ model = \"{model}\", shear_modulus = {MU}, lame_lambda = {LAMBDA} }}\n"
        );
        let case = Case::parse(&text, Path::new("case.toml")).unwrap().case;
        CauchyStress::new(&case, &cuboid([1, 1, 1], [1.0; 3]).unwrap())
    }

    #[test]
    fn linear_elasticity_shows_its_small_strain_stress() {
        let f = Matrix3::new(1.2, 0.3, -0.1, 0.05, 0.9, 0.2, -0.2, 0.1, 1.1);
        let linear = LinearElastic { mu: MU, lambda: LAMBDA }.evaluate(&f).unwrap().pk1;
        assert_eq!(of("linear-elastic").of(0, &f, &linear), linear);
        let finite = NeoHookean { mu: MU, lambda: LAMBDA }.evaluate(&f).unwrap().pk1;
        assert_eq!(of("neo-hookean").of(0, &f, &finite), finite * f.transpose() / f.determinant());
    }
}
