//! Materials that depend on the mesh, for ranks that do not hold it.

use std::path::PathBuf;

use serde::{Deserialize, Serialize};

use crate::app::case::Case;
use crate::tissue::materials::{
    Formulas, Materials, NetworkAssignment, PointFractions, PointNetworks, Region, RegionMaterial, RveScale,
};

/// What is evaluated on the mesh to get the materials of a case; one rank sends it to others.
#[derive(Clone, Debug, Deserialize, PartialEq, Serialize)]
pub struct MaterialFields(Vec<RegionFields>);

#[derive(Clone, Debug, Deserialize, PartialEq, Serialize)]
struct RegionFields {
    /// The formulas of the region, or of the matrices of its RVEs.
    formulas: Option<Formulas>,
    /// The networks that fields choose.
    networks: Option<(Vec<PathBuf>, PointNetworks)>,
    fractions: Option<PointFractions>,
}

impl MaterialFields {
    /// Returns the fields of the materials of a case.
    pub fn of(materials: &Materials) -> Self {
        let fields = |region: &Region| {
            let (mut networks, mut fractions) = (None, None);
            if let RegionMaterial::FiberRve(rve) = &region.material {
                if let NetworkAssignment::Field(of_point) = &rve.assignment {
                    networks = Some((rve.networks.clone(), of_point.clone()));
                }
                if let RveScale::Fractions(of_point) = &rve.scale {
                    fractions = Some(of_point.clone());
                }
            }
            RegionFields { formulas: region.material.formula().cloned(), networks, fractions }
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
        let regions = case.regions.iter().zip(self.0).map(|(region, fields)| {
            let RegionFields { formulas, networks, fractions } = fields;
            let material = match &region.material {
                RegionMaterial::Formula(_) => RegionMaterial::Formula(formulas?),
                RegionMaterial::FiberRve(rve) => {
                    let chosen = match &rve.assignment {
                        NetworkAssignment::Random => (rve.networks.clone(), NetworkAssignment::Random),
                        NetworkAssignment::Cycle => (rve.networks.clone(), NetworkAssignment::Cycle),
                        NetworkAssignment::Field(_) => {
                            networks.map(|(files, of)| (files, NetworkAssignment::Field(of)))?
                        }
                    };
                    let scale = match &rve.scale {
                        RveScale::Uniform(scale) => RveScale::Uniform(*scale),
                        RveScale::Fractions(_) => RveScale::Fractions(fractions?),
                    };
                    RegionMaterial::FiberRve(rve.with_fields(chosen, scale, formulas))
                }
            };
            Some(Region { name: region.name.clone(), material })
        });
        Some(Materials { regions: regions.collect::<Option<_>>()?, rve: case.micro })
    }
}
