//! Materials that depend on the mesh, for ranks that do not hold it.

use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

use crate::app::case::{Case, FormulaCase};
use crate::tissue::materials::{
    Formulas, Materials, NetworkAssignment, PointFractions, PointNetworks, Region, RegionMaterial, RveScale,
};

/// What is evaluated on the mesh to get the materials of a case; one rank sends it to others.
#[derive(Clone, Debug, Deserialize, PartialEq, Serialize)]
pub struct MaterialFields(Vec<RegionFields>);

#[derive(Clone, Debug, Deserialize, PartialEq, Serialize)]
struct RegionFields {
    /// The formulas of the region, or of the matrices of its RVEs, if they vary: every rank has a case with the others.
    formulas: Option<Formulas>,
    /// The networks that fields choose; those in the folder of the case are relative to it, because another process may see it
    /// elsewhere.
    networks: Option<(Vec<PathBuf>, PointNetworks)>,
    fractions: Option<PointFractions>,
}

impl MaterialFields {
    /// Returns the fields of the materials of a case, which is in this folder.
    pub fn of(materials: &Materials, folder: &Path) -> Self {
        let relative = |file: &PathBuf| file.strip_prefix(folder).map_or_else(|_| file.clone(), Path::to_path_buf);
        let fields = |region: &Region| {
            let (mut networks, mut fractions) = (None, None);
            if let RegionMaterial::FiberRve(rve) = &region.material {
                if let NetworkAssignment::Field(of_point) = &rve.assignment {
                    networks = Some((rve.networks.iter().map(relative).collect(), of_point.clone()));
                }
                if let RveScale::Fractions(of_point) = &rve.scale {
                    fractions = Some(of_point.clone());
                }
            }
            let formulas = region.material.formula().filter(|formulas| matches!(formulas, Formulas::Points(_)));
            RegionFields { formulas: formulas.cloned(), networks, fractions }
        };
        Self(materials.regions.iter().map(fields).collect())
    }

    /// Returns the fields with the values of these points of the mesh, ascending, and no others.
    pub fn on_points(&self, points: &[usize]) -> Self {
        let fields = |RegionFields { formulas, networks, fractions }: &RegionFields| RegionFields {
            formulas: formulas.as_ref().map(|formulas| formulas.on_points(points)),
            networks: networks.as_ref().map(|(files, of_point)| (files.clone(), of_point.on_points(points))),
            fractions: fractions.as_ref().map(|fractions| fractions.on_points(points)),
        };
        Self(self.0.iter().map(fields).collect())
    }

    /// Returns the materials of the case; `None` if the fields are those of another case.
    pub fn materials(self, case: &Case) -> Option<Materials> {
        if self.0.len() != case.regions.len() {
            return None;
        }
        let folder = case.folder();
        let regions = case.regions.iter().zip(self.0).map(|(region, fields)| {
            let RegionFields { formulas, networks, fractions } = fields;
            let formulas = |of_case: &FormulaCase| match of_case {
                FormulaCase::Constant(formula) => Some(formula.clone().into()),
                FormulaCase::Field(_) => formulas,
            };
            let material = match &region.material {
                RegionMaterial::Formula(of_case) => RegionMaterial::Formula(formulas(of_case)?),
                RegionMaterial::FiberRve(rve) => {
                    let chosen = match &rve.assignment {
                        NetworkAssignment::Random => (rve.networks.clone(), NetworkAssignment::Random),
                        NetworkAssignment::Cycle => (rve.networks.clone(), NetworkAssignment::Cycle),
                        NetworkAssignment::Field(_) => {
                            let (files, of_point) = networks?;
                            let files = files.iter().map(|file| folder.join(file)).collect();
                            (files, NetworkAssignment::Field(of_point))
                        }
                    };
                    let scale = match &rve.scale {
                        RveScale::Uniform(scale) => RveScale::Uniform(*scale),
                        RveScale::Fractions(_) => RveScale::Fractions(fractions?),
                    };
                    let matrix = match &rve.matrix {
                        Some(of_case) => Some(formulas(of_case)?),
                        None => None,
                    };
                    RegionMaterial::FiberRve(rve.with_fields(chosen, scale, matrix))
                }
            };
            Some(Region { name: region.name.clone(), material })
        });
        Some(Materials { regions: regions.collect::<Option<_>>()?, rve: case.micro })
    }
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;
    use crate::app::{macro_scale, material_fields};
    use crate::fem::material::{LinearElastic, Material, MaterialError, Response};
    use crate::tissue::materials::Formula;

    /// A material of another crate.
    struct Foreign;

    impl Material for Foreign {
        fn evaluate(&self, f: &nalgebra::Matrix3<f64>) -> Result<Response, MaterialError> {
            LinearElastic { mu: 1.0, lambda: 1.0 }.evaluate(f)
        }
    }

    const CASE: &str = r#"
[mesh]
generate = { shape = "dogbone", element_size = 2e-3 }
[[region]]
name = "gauge"
material = { model = "neo-hookean", shear_modulus = "1000 + 1e5*x", poisson_ratio = 0.3 }
[[region]]
name = "*"
material = { model = "neo-hookean", shear_modulus = 1000, poisson_ratio = 0.3 }
"#;

    /// What arrives at another rank are the materials of the first one. Constant formulas need not be sent, which those of
    /// other crates cannot be.
    #[test]
    fn fields_give_the_materials_on_another_rank() {
        let mut case = Case::parse(CASE, Path::new("case.toml")).unwrap_or_else(|errors| panic!("{errors}")).case;
        case.regions[1].material = RegionMaterial::Formula(FormulaCase::Constant(Formula::custom(Foreign)));
        let (mesh, _) = macro_scale::mesh(&case).unwrap();
        let materials = material_fields::resolve(&case, &mesh).unwrap().materials;
        let fields = MaterialFields::of(&materials, &case.folder());
        let arrived = |fields: &MaterialFields| -> Materials {
            let bytes = postcard::to_allocvec(fields).unwrap();
            postcard::from_bytes::<MaterialFields>(&bytes).unwrap().materials(&case).unwrap()
        };
        let formula = |materials: &Materials, region: usize, point: usize| {
            materials.regions[region].material.formula().and_then(|formulas| formulas.at(point).cloned())
        };
        let all = arrived(&fields);
        let points: Vec<usize> = (0..mesh.points().len()).filter(|point| point % 3 == 1).collect();
        let some = arrived(&fields.on_points(&points));
        for point in 0..mesh.points().len() {
            let expected = formula(&materials, 0, point);
            assert_eq!(formula(&all, 0, point), expected);
            assert_eq!(formula(&some, 0, point), expected.filter(|_| point % 3 == 1));
            // Custom materials without parameters are equal only to themselves.
            assert_eq!(formula(&some, 1, point), formula(&materials, 1, point));
        }
    }
}
