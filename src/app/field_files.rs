//! The files with the fields of a state: of the whole body, or of the part that this rank holds.

use std::path::{Path, PathBuf};

use nalgebra::Matrix3;

use super::case::{Case, OF_FIBERS, OF_RVES, is_needed};
use super::cell_fields::CellFields;
use super::derived_fields::{green_lagrange_strain, principal_stresses, principal_stretches};
use super::formula_fibers::FormulaFibers;
use super::nodal_fields::NodalFields;
use super::results::collection::{field_file, index_file, partial, point_file, point_index_file};
use super::results::{
    FieldSet, PointCloud, ResultsError, part_file, piece_index, point_piece_index, write_piece, write_pieces,
    write_point_pieces, write_points, write_vtu,
};
use super::stress::CauchyStress;
use crate::fem::constraint::Constraints;
use crate::fem::equilibrium::BodyState;
use crate::fem::mesh::{Mesh, Part};
use crate::fem::stepping::ConvergedStep;
use crate::parallel;
use crate::tissue::micro_scale::TissueMaterial;

const PRINCIPAL_STRESSES: &str = "principal_stresses";
const PRINCIPAL_STRETCHES: &str = "principal_stretches";
const GREEN_LAGRANGE_STRAIN: &str = "green_lagrange_strain";

/// The arrays that every file of integration points has.
const OF_ALL_POINTS: [&str; 4] = ["element", "point", "volume", "jacobian"];

/// Writes the fields of states.
pub(super) struct FieldFiles {
    dir: PathBuf,
    every: usize,
    has_points: bool,
    /// The names of the fields.
    names: Vec<&'static str>,
    /// Reference volume of every integration point.
    volumes: Vec<f64>,
    /// Region of every integration point.
    region_of: Vec<u32>,
    fibers: FormulaFibers,
    stress: CauchyStress,
}

/// The index files of a state whose pieces are written: they name the pieces of all ranks.
#[derive(Debug, Default)]
pub(super) struct PieceIndex {
    fields: Vec<u8>,
    points: Option<Vec<u8>>,
}

/// A state with all that its fields depend on.
pub(super) struct FieldState<'a, M> {
    /// The last full step, and whether the state is that at its end.
    pub step: (usize, bool),
    pub mesh: &'a Mesh,
    pub state: &'a BodyState,
    pub constraints: &'a Constraints,
    pub field: &'a M,
}

impl<'a, M> FieldState<'a, M> {
    /// The state of a converged full step.
    pub fn of(step: &ConvergedStep<'a, M>) -> Self {
        let ConvergedStep { mesh, state, constraints, field, .. } = *step;
        Self { step: (step.step, true), mesh, state, constraints, field }
    }
}

/// The names of the files of a state, relative to the result directory.
pub(super) struct FieldNames {
    pub fields: String,
    pub points: Option<String>,
}

impl FieldFiles {
    pub fn new(dir: &Path, case: &Case, mesh: &Mesh) -> Self {
        Self {
            dir: dir.to_owned(),
            every: case.output.every,
            has_points: case.output.points,
            names: case.fields(),
            volumes: mesh.point_volumes(),
            region_of: mesh.points().spread(mesh.region_of()),
            fibers: FormulaFibers::new(case, mesh),
            stress: CauchyStress::new(case, mesh),
        }
    }

    /// Returns the result directory.
    pub fn dir(&self) -> &Path {
        &self.dir
    }

    /// Returns true if fields are written at the end of some steps.
    pub fn are_written(&self) -> bool {
        self.every > 0
    }

    /// Returns true if the fields of a full step are written.
    pub fn is_due(&self, step: usize, count: usize) -> bool {
        self.every > 0 && (step.is_multiple_of(self.every) || step == count)
    }

    /// Writes the fields of the whole body, and the values at its points if they are requested.
    pub fn write<M: TissueMaterial>(&self, of: &FieldState<'_, M>) -> Result<FieldNames, ResultsError> {
        let names = self.names(of);
        let values = self.at_points(of);
        let shards = of.field.shards();
        if let Some(file) = &names.points {
            let cloud = self.cloud(of, &values);
            let path = self.dir.join(file);
            match shards {
                None => write_points(&path, &cloud)?,
                Some((shard_of, count)) => {
                    write_point_pieces(&path, &cloud, &of.mesh.points().spread(shard_of), count)?;
                }
            }
        }
        let path = self.dir.join(&names.fields);
        self.with_fields(of, values, |fields| match shards {
            None => write_vtu(&path, fields),
            Some((shard_of, count)) => write_pieces(&path, fields, shard_of, count),
        })?;
        Ok(names)
    }

    /// Writes the piece of this rank, if it has elements. Returns the index files, which are to be written after all pieces.
    pub fn write_piece<M: TissueMaterial>(&self, of: &FieldState<'_, M>) -> Result<PieceIndex, ResultsError> {
        let Some(part) = of.mesh.part() else { return Ok(PieceIndex::default()) };
        let names = self.names(of);
        let values = self.at_points(of);
        let cloud = names.points.as_ref().map(|_| self.cloud(of, &values));
        let own: Vec<u32> = part.own_elements().map(|element| element as u32).collect();
        let path = self.dir.join(part_file(&names.fields, part.rank));
        let fields = self.with_fields(of, values, |fields| {
            if !own.is_empty() {
                write_piece(&path, &own, fields)?;
            }
            piece_index(&sources(&names.fields, part), fields)
                .map_err(ResultsError::write(&self.dir.join(&names.fields)))
        })?;
        let points = match names.points.iter().zip(cloud).next() {
            None => None,
            Some((file, cloud)) => {
                let own = of.mesh.own_points();
                let own: Vec<u32> = (0..own.len() as u32).filter(|&point| own[point as usize]).collect();
                let cloud = cloud.select(&own);
                if !own.is_empty() {
                    write_points(&self.dir.join(part_file(file, part.rank)), &cloud)?;
                }
                Some(
                    point_piece_index(&sources(file, part), &cloud)
                        .map_err(ResultsError::write(&self.dir.join(file)))?,
                )
            }
        };
        Ok(PieceIndex { fields, points })
    }

    /// Writes the index files of pieces that all ranks have written.
    pub fn write_index<M: TissueMaterial>(
        &self,
        of: &FieldState<'_, M>,
        index: &PieceIndex,
    ) -> Result<FieldNames, ResultsError> {
        let names = self.names(of);
        if let (Some(file), Some(points)) = (&names.points, &index.points) {
            super::results::replace(&self.dir.join(file), points)?;
        }
        super::results::replace(&self.dir.join(&names.fields), &index.fields)?;
        Ok(names)
    }

    fn names<M: TissueMaterial>(&self, of: &FieldState<'_, M>) -> FieldNames {
        let ((step, is_full), is_divided) = (of.step, of.mesh.part().is_some() || of.field.shards().is_some());
        let of_step = |name: String| if is_full { name } else { partial(&name) };
        let fields = if is_divided { index_file(step) } else { field_file(step) };
        let points = if is_divided { point_index_file(step) } else { point_file(step) };
        FieldNames { fields: of_step(fields), points: self.has_points.then(|| of_step(points)) }
    }

    /// Returns the values at the integration points.
    fn at_points<M: TissueMaterial>(&self, of: &FieldState<'_, M>) -> CellFields {
        let FieldState { state, constraints, field, .. } = of;
        let pressures = constraints.region_pressures(&state.volumes, self.region_of.len());
        let pressure_at = |point: usize| pressures.as_ref().map_or(0.0, |pressures| pressures[point]);
        let stress = |point: usize, f: &_, pk1: &_| {
            let of_material = self.stress.of(self.region_of[point], f, pk1);
            of_material - Matrix3::from_diagonal_element(pressure_at(point))
        };
        let points = of.mesh.points();
        let families =
            |point: usize, f: &_| self.fibers.at(field.library(), (self.region_of[point], points.in_whole(point)), f);
        let status = |point| field.sites().status(point);
        let is_any_of = |names: &[&str]| names.iter().any(|name| is_needed(name, &self.names));
        let (has_fibers, has_rves) = (is_any_of(&OF_FIBERS), is_any_of(&OF_RVES));
        let summaries = if has_fibers || has_rves { field.summaries() } else { Vec::new() };
        CellFields::new(state, has_fibers, stress, families, &summaries, status)
    }

    /// Returns the selected fields of the integration points.
    fn cloud<M: TissueMaterial>(&self, of: &FieldState<'_, M>, values: &CellFields) -> PointCloud {
        let rank_of = |point| of.field.rank_of(point);
        let mut cloud = values.cloud(of.mesh, of.state, &self.volumes, &self.region_of, rank_of);
        cloud.tensors.extend(self.derived(GREEN_LAGRANGE_STRAIN, &values.gradient, green_lagrange_strain));
        cloud.vectors.extend(self.derived(PRINCIPAL_STRETCHES, &values.gradient, principal_stretches));
        cloud.vectors.extend(self.derived(PRINCIPAL_STRESSES, &values.cauchy, principal_stresses));
        cloud.retain(|name| OF_ALL_POINTS.contains(&name) || self.names.contains(&name));
        cloud
    }

    /// Returns a field that follows from tensors, if it or its average at the nodes is selected.
    fn derived<const N: usize>(
        &self,
        name: &'static str,
        tensors: &[[f64; 9]],
        value: impl Fn(&[f64; 9]) -> [f64; N] + Sync + Send,
    ) -> Option<(&'static str, Vec<[f64; N]>)> {
        is_needed(name, &self.names).then(|| (name, parallel::collect(tensors.len(), |at| value(&tensors[at]))))
    }

    /// Passes the selected fields of the elements to `write`.
    fn with_fields<M: TissueMaterial, T>(
        &self,
        of: &FieldState<'_, M>,
        points: CellFields,
        write: impl FnOnce(&FieldSet<'_>) -> Result<T, ResultsError>,
    ) -> Result<T, ResultsError> {
        let FieldState { mesh, state, field, .. } = of;
        let cells = points.averaged(mesh.points(), &self.volumes);
        let region: Vec<i64> = mesh.region_of().iter().map(|&region| region.into()).collect();
        let rank: Vec<i64> =
            (0..region.len()).map(|element| field.rank_of(mesh.points().of_element(element).start) as i64).collect();
        let strain = self.derived(GREEN_LAGRANGE_STRAIN, &cells.gradient, green_lagrange_strain);
        let stretches = self.derived(PRINCIPAL_STRETCHES, &cells.gradient, principal_stretches);
        let stresses = self.derived(PRINCIPAL_STRESSES, &cells.cauchy, principal_stresses);
        let mut fields = FieldSet {
            points: mesh.nodes(),
            elements: mesh.elements(),
            point_vectors: vec![("displacement", &state.displacements)],
            cell_scalars: vec![
                ("von_mises_stress", &cells.von_mises),
                ("energy_density", &cells.energy),
                ("fiber_alignment", &cells.alignment),
                ("stretch_min", &cells.stretch_min),
                ("stretch_max", &cells.stretch_max),
            ],
            cell_integers: vec![
                ("rve_iterations", &cells.iterations),
                ("rve_status", &cells.status),
                ("network", &cells.network),
                ("region", &region),
                ("rank", &rank),
            ],
            cell_vectors: vec![("fiber_direction", &cells.direction)],
            cell_tensors: vec![
                ("cauchy_stress", &cells.cauchy),
                ("deformation_gradient", &cells.gradient),
                ("fiber_orientation", &cells.orientation),
            ],
            ..FieldSet::default()
        };
        fields.cell_tensors.extend(strain.iter().map(|(name, values)| (*name, values.as_slice())));
        fields.cell_vectors.extend(stretches.iter().chain(&stresses).map(|(name, values)| (*name, values.as_slice())));
        // In a divided body, all ranks take part, and none has written a file that may have failed.
        let share = |width: usize, values: &mut [f64]| field.share_at_nodes(mesh, width, values);
        let nodal = NodalFields::of(&fields, &self.names, share);
        let nodal = nodal.map_err(|error| ResultsError::OtherRank(error.to_string()))?;
        fields.retain(|name| self.names.contains(&name));
        nodal.add_to(&mut fields);
        write(&fields)
    }
}

/// Returns the names of the pieces of all ranks with elements.
fn sources(index: &str, part: &Part) -> Vec<String> {
    let with_elements = part.elements_of_rank.iter().enumerate().filter(|(_, count)| **count > 0);
    with_elements.map(|(rank, _)| part_file(index, rank)).collect()
}
