//! The stress that the fields show.

use nalgebra::Matrix3;

use super::case::{Case, FormulaModel, MaterialCase};
use crate::fem::mesh::Mesh;

/// The Cauchy stress of every element, by the theory that its material belongs to.
///
/// `sigma = P F^T / J` of finite strain does not hold for the small-strain material `linear-elastic`, whose `P` is the stress
/// of the undeformed body as well as of the deformed one: `P F^T / J` of it is not even symmetric. There `sigma = P`.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct CauchyStress {
    /// Whether each region of the mesh is of a small-strain material.
    is_small_strain: Vec<bool>,
}

impl CauchyStress {
    pub(super) fn new(case: &Case, mesh: &Mesh) -> Self {
        let is_small_strain = |region: &String| match case.material_of(region) {
            Some(MaterialCase::Formula(formula)) => formula.model == FormulaModel::LinearElastic,
            Some(MaterialCase::FiberRve(_)) | None => false,
        };
        Self { is_small_strain: mesh.regions().iter().map(is_small_strain).collect() }
    }

    /// `sigma`, Pa, of an element of a region at the deformation gradient `f` and the first Piola-Kirchhoff stress `pk1`.
    pub(super) fn of(&self, region: u32, f: &Matrix3<f64>, pk1: &Matrix3<f64>) -> Matrix3<f64> {
        match self.is_small_strain.get(region as usize) {
            Some(true) => *pk1,
            _ => pk1 * f.transpose() / f.determinant(),
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
        let linear = LinearElastic { mu: MU, lambda: LAMBDA }.respond(&f).unwrap().pk1;
        assert_eq!(of("linear-elastic").of(0, &f, &linear), linear);
        let finite = NeoHookean { mu: MU, lambda: LAMBDA }.respond(&f).unwrap().pk1;
        assert_eq!(of("neo-hookean").of(0, &f, &finite), finite * f.transpose() / f.determinant());
    }
}
