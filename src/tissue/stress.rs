//! The stress that the fields show.

use nalgebra::Matrix3;

use super::case::{Case, FormulaCase, FormulaModel, MaterialCase};
use crate::fem::material::LinearElastic;
use crate::fem::mesh::Mesh;

/// The Cauchy stress of every element, by the theory that its material belongs to.
///
/// `sigma = P F^T / J` of finite strain does not hold for a material of small strain, whose `P` is the stress of the
/// undeformed body as well as of the deformed one: `P F^T / J` of it is not even symmetric. The part of the stress that
/// comes from a `linear-elastic` material, as the material itself or as the matrix around fibers, is therefore its `P`.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct CauchyStress {
    /// The small-strain part of each region of the mesh.
    small_strain: Vec<Option<LinearElastic>>,
}

impl CauchyStress {
    pub(super) fn new(case: &Case, mesh: &Mesh) -> Self {
        let small_strain = mesh.regions().iter().map(|region| {
            let formula = match case.material_of(region)? {
                MaterialCase::Formula(formula) => *formula,
                MaterialCase::FiberRve(rve) => rve.matrix?,
            };
            let FormulaCase { model, shear_modulus: mu, lame_lambda: lambda } = formula;
            (model == FormulaModel::LinearElastic).then_some(LinearElastic { mu, lambda })
        });
        Self { small_strain: small_strain.collect() }
    }

    /// `sigma`, Pa, of an element of a region at the deformation gradient `f` and the first Piola-Kirchhoff stress `pk1`.
    pub(super) fn of(&self, region: u32, f: &Matrix3<f64>, pk1: &Matrix3<f64>) -> Matrix3<f64> {
        match self.small_strain.get(region as usize).copied().flatten() {
            None => pk1 * f.transpose() / f.determinant(),
            Some(linear) => {
                let small = linear.stress(f);
                (pk1 - small) * f.transpose() / f.determinant() + small
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;
    use crate::fem::material::{Material, NeoHookean};
    use crate::fem::mesh::shapes::cuboid;

    const MU: f64 = 3.0e3;
    const LAMBDA: f64 = 5.0e3;

    fn of(material: &str) -> CauchyStress {
        let text = format!(
            "[mesh]\ngenerate = {{ shape = \"box\", cells = [1, 1, 1], size = [1, 1, 1] }}\n[[region]]\nname = \"*\"\n\
             material = {material}\n"
        );
        let case = Case::parse(&text, Path::new("case.toml")).unwrap().case;
        CauchyStress::new(&case, &cuboid([1, 1, 1], [1.0; 3]).unwrap())
    }

    #[test]
    fn linear_elasticity_shows_its_small_strain_stress() {
        let f = Matrix3::new(1.2, 0.3, -0.1, 0.05, 0.9, 0.2, -0.2, 0.1, 1.1);
        let constants = format!("shear_modulus = {MU}, lame_lambda = {LAMBDA} }}");
        let linear = LinearElastic { mu: MU, lambda: LAMBDA }.respond(&f).unwrap().pk1;
        let stress = of(&format!("{{ model = \"linear-elastic\", {constants}"));
        assert_eq!(stress.of(0, &f, &linear), linear);
        let finite = NeoHookean { mu: MU, lambda: LAMBDA }.respond(&f).unwrap().pk1;
        let stress = of(&format!("{{ model = \"neo-hookean\", {constants}"));
        assert_eq!(stress.of(0, &f, &finite), finite * f.transpose() / f.determinant());
        // A matrix beside fibers adds its own stress to theirs.
        let stress = of(&format!(
            "{{ model = \"fiber-rve\", networks = [], scale = \"raw\", matrix = {{ model = \"linear-elastic\", {constants} }}"
        ));
        let sigma = stress.of(0, &f, &(linear + finite));
        assert!((sigma - linear - finite * f.transpose() / f.determinant()).norm() < 1e-12 * MU);
        assert!((sigma - sigma.transpose()).norm() < 1e-12 * MU, "a Cauchy stress is symmetric");
    }
}
