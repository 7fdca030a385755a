//! The whole body of a case, read and checked.

use super::SimulationError;
use crate::app::case::Case;
use crate::app::macro_scale;
use crate::app::material_fields::{self, FieldRange, ResolvedMaterials};
use crate::fem::boundary::{Boundary, Conditions};
use crate::fem::mesh::Mesh;
use crate::fem::rigid_modes;
use crate::tissue::materials::Materials;

/// The mesh of a case with its boundary conditions and materials.
pub(super) struct WholeBody {
    pub mesh: Mesh,
    pub conditions: Conditions,
    pub boundary: Boundary,
    pub materials: Materials,
    /// The ranges of the material parameters that vary.
    pub ranges: Vec<FieldRange>,
    /// The warnings of the reader of the mesh.
    pub warnings: Vec<String>,
}

impl WholeBody {
    /// Reads the mesh of a case, and checks conditions, constraints and materials on it.
    pub fn read<F: std::error::Error>(case: &Case) -> Result<Self, SimulationError<F>> {
        let (mesh, warnings) = macro_scale::mesh(case)?;
        let conditions = macro_scale::conditions(case);
        let boundary = macro_scale::boundary(case, &mesh, &conditions)?;
        rigid_modes::check(&mesh, &boundary.restraints(&mesh), boundary.kinematics().rigid_surfaces())
            .map_err(|error| Box::new(error.into()))?;
        macro_scale::check_constraints(case, &mesh, &conditions, &boundary.fixed_components(mesh.nodes().len()))?;
        let ResolvedMaterials { materials, ranges } = material_fields::resolve(case, &mesh)?;
        Ok(Self { mesh, conditions, boundary, materials, ranges, warnings })
    }
}
