//! The fields of the result files, and which of them a case asks for.

use super::data::Case;
use super::formula::FormulaCase;
use crate::tissue::materials::RegionMaterial;

/// Fields of every body. The displacement is always written.
const OF_BODY: [&str; 7] =
    [DISPLACEMENT, "von_mises_stress", "energy_density", "cauchy_stress", "deformation_gradient", "region", "rank"];
/// Fields of bodies with fibers.
pub(in crate::app) const OF_FIBERS: [&str; 5] =
    ["fiber_alignment", "stretch_min", "stretch_max", "fiber_direction", "fiber_orientation"];
/// Fields of bodies with RVEs.
pub(in crate::app) const OF_RVES: [&str; 3] = ["rve_iterations", "rve_status", "network"];
/// Fields that are written only if the case names them: the last ones are means at the nodes.
const ON_REQUEST: [&str; 14] = [
    "principal_stresses",
    "principal_stretches",
    "green_lagrange_strain",
    "nodal_von_mises_stress",
    "nodal_energy_density",
    "nodal_fiber_alignment",
    "nodal_stretch_min",
    "nodal_stretch_max",
    "nodal_principal_stresses",
    "nodal_principal_stretches",
    "nodal_cauchy_stress",
    "nodal_deformation_gradient",
    "nodal_fiber_orientation",
    "nodal_green_lagrange_strain",
];

/// What the name of a mean at the nodes begins with; the name of the field of the elements follows.
pub(in crate::app) const NODAL: &str = "nodal_";

const DISPLACEMENT: &str = "displacement";

/// The fields that are written to the result files.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub enum FieldSelection {
    /// Those that the materials of the case have, without those that follow from others.
    #[default]
    Default,
    /// These, and the displacement.
    Names(Vec<&'static str>),
}

impl FieldSelection {
    /// Returns the names of all fields.
    pub fn all() -> impl Iterator<Item = &'static str> {
        OF_BODY.into_iter().chain(OF_FIBERS).chain(OF_RVES).chain(ON_REQUEST)
    }
}

/// Returns true if a field of the elements or its mean at the nodes is among `names`.
pub(in crate::app) fn is_needed(field: &str, names: &[&str]) -> bool {
    names.iter().any(|name| *name == field || name.strip_prefix(NODAL) == Some(field))
}

/// Returns the number of components of a field or of its mean at the nodes.
pub(in crate::app) fn components(name: &str) -> usize {
    match name.strip_prefix(NODAL).unwrap_or(name) {
        "cauchy_stress" | "deformation_gradient" | "fiber_orientation" | "green_lagrange_strain" => 9,
        DISPLACEMENT | "fiber_direction" | "principal_stresses" | "principal_stretches" => 3,
        _ => 1,
    }
}

impl Case {
    /// Returns the names of the fields in the result files of this case.
    pub fn fields(&self) -> Vec<&'static str> {
        match &self.output.fields {
            FieldSelection::Names(names) => {
                let others = names.iter().copied().filter(|&name| name != DISPLACEMENT);
                [DISPLACEMENT].into_iter().chain(others).collect()
            }
            FieldSelection::Default => {
                let of_fibers = OF_FIBERS.into_iter().filter(|_| self.has_fibers());
                let of_rves = OF_RVES.into_iter().filter(|_| self.has_rves());
                OF_BODY.into_iter().chain(of_fibers).chain(of_rves).collect()
            }
        }
    }

    /// Returns true if the result files have fields of fibers or RVEs.
    pub fn has_fiber_fields(&self) -> bool {
        let names = self.fields();
        OF_FIBERS.iter().chain(&OF_RVES).any(|name| is_needed(name, &names))
    }

    fn has_rves(&self) -> bool {
        self.regions.iter().any(|region| matches!(region.material, RegionMaterial::FiberRve(_)))
    }

    /// Returns true if some region has networks, or a formula with fibers.
    fn has_fibers(&self) -> bool {
        let has_networks = |material: &_| matches!(material, RegionMaterial::FiberRve(rve) if !rve.networks.is_empty());
        self.regions.iter().any(|region| has_networks(&region.material))
            || self.regions.iter().filter_map(|region| region.material.formula()).any(|formula| match formula {
                FormulaCase::Constant(formula) => formula.fiber_axes().next().is_some(),
                FormulaCase::Field(formula) => !formula.axes.is_empty(),
            })
    }
}
