//! The materials of a body with their networks: reads each network once and assigns a material to every integration point.

use std::collections::{HashMap, HashSet};
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use nalgebra::Matrix3;
use serde::{Deserialize, Serialize};
use thiserror::Error;

#[cfg(feature = "sparse")]
use crate::backends::BackendName;
use crate::fem::material::SaintVenantKirchhoff;
use crate::fem::mesh::{IntegrationPoint, Mesh};
use crate::fiber::batch::BatchSolver;
use crate::fiber::equilibrium::{EquilibriumParams, equilibrate};
use crate::fiber::law::FiberMaterial;
use crate::fiber::network::{Network, file};
use crate::fiber::rve::{Rve, RveModel, StressScale};
use crate::fiber::workspace::Workspace;
use crate::input::InputErrors;
use crate::las::{Backend, Method, RealBackend, SolverParams};
#[cfg(feature = "sparse")]
use crate::rve_batch::LaneBatch;
use crate::tissue::materials::{
    FiberRve, Formula, Formulas, LaneUse, Materials, NetworkAssignment, Region, RegionMaterial, RveLifecycle,
    find_region, random_network,
};

/// The reason why the materials of a body cannot be set up.
#[derive(Debug, Error)]
pub enum LibraryError {
    /// Network files have errors; see [`InputErrors::of_files`] if there are several.
    #[error(transparent)]
    Network(#[from] InputErrors),
    /// The network in a file cannot be used as an RVE: the reason.
    #[error("{0}: {1}")]
    Model(PathBuf, String),
    /// A network has no linear response at rest: its name and the reason.
    #[error("{0}: no response at rest: {1}")]
    AtRest(String, String),
    /// The device that should solve the RVEs cannot be used: the reason.
    #[error("the RVEs cannot be solved on a device: {0}")]
    Device(String),
    /// A region of the mesh has no material.
    #[error("no material for the region {0}")]
    NoMaterial(String),
    /// A point has no material: the values by point belong to another mesh.
    #[error("the region {0} has no material at {1}")]
    NoPointMaterial(String, IntegrationPoint),
}

/// The materials of a body, shared by all RVEs. Every rank has the same regions and models; it needs what varies over the
/// body only at the points of its part.
pub struct Library<B: Backend> {
    pub(super) context: B::Context,
    pub(super) models: Vec<RveModel<B>>,
    /// The edge of the cube in the file of the network, of each model.
    edges: Vec<f64>,
    /// Every region with the models that its points choose from.
    regions: Vec<(Region, Vec<usize>)>,
    pub(super) params: EquilibriumParams,
    /// Whether RVEs keep the sensitivities that predict the start of the next solve.
    pub(super) predict: bool,
    /// How the processor may solve RVEs in lanes.
    lanes: LaneUse,
    /// The solvers of whole batches of RVEs, for models that have one.
    batch_solvers: Vec<Option<Mutex<Box<dyn BatchSolver>>>>,
}

/// The material of an integration point.
#[derive(Clone, Debug, PartialEq)]
pub enum PointMaterial {
    /// A formula, shared by the points with the same parameters.
    Formula(Arc<Formula>),
    /// An RVE: its network and the matrix in parallel.
    Rve {
        /// The network; `None` for a matrix alone.
        network: Option<PointNetwork>,
        /// The formula of the matrix.
        matrix: Option<Arc<Formula>>,
        /// When the RVE is created, sleeps, and is deleted.
        lifecycle: RveLifecycle,
    },
}

/// The network of an integration point.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct PointNetwork {
    /// Index into [`Library::models`].
    pub model: usize,
    /// The stress of the RVE over that of its model: the fiber volume fraction of the point over that of the model.
    pub factor: f64,
}

impl<B: RealBackend> Library<B> {
    /// Reads the networks of the materials; also returns the warnings of the reader.
    ///
    /// # Errors
    /// Returns [`LibraryError::Network`] with the errors of all networks that cannot be read, and
    /// [`LibraryError::Model`] if one cannot be used.
    pub fn read(context: B::Context, materials: Materials) -> Result<(Self, Vec<String>), LibraryError> {
        let Materials { regions, rve } = materials;
        let mut reader = Reader::<B> {
            context: &context,
            solver: SolverParams { method: rve.solver, ..SolverParams::default() },
            names: HashMap::new(),
            networks: HashMap::new(),
            models: Vec::new(),
            sources: Vec::new(),
            warnings: Vec::new(),
        };
        reader.read_networks(&regions)?;
        let with_models = |region: Region| reader.models_of(&region.material).map(|models| (region, models));
        let regions = regions.into_iter().map(with_models).collect::<Result<Vec<_>, _>>()?;
        let edges = reader.sources.iter().map(|(path, ..)| reader.networks[path].1).collect();
        let Reader { models, warnings, .. } = reader;
        let mut params = EquilibriumParams::default();
        params.newton.tolerance = rve.tolerance;
        params.newton.max_iterations = rve.max_iterations;
        params.max_cuts = rve.max_cuts;
        let params = params.with_stages(rve.stages);
        let batch_solvers = models.iter().map(|_| None).collect();
        // The factorization in lanes is a direct one.
        let lanes = if rve.solver == Method::Direct { rve.lanes } else { LaneUse::Off };
        Ok((Self { context, models, edges, regions, params, predict: rve.predictor, lanes, batch_solvers }, warnings))
    }

    /// The context of the backend that solves the RVEs.
    pub(crate) fn context(&self) -> &B::Context {
        &self.context
    }

    /// Solves the RVEs of models of which the whole body has this many in lanes of the processor, where that is faster. It
    /// depends on nothing else, so that results do not depend on ranks.
    pub fn use_lanes(&mut self, counts: &[usize]) {
        #[cfg(feature = "sparse")]
        for ((model, solver), &count) in self.models.iter().zip(&mut self.batch_solvers).zip(counts) {
            // The elimination order of lanes is that of the backend `sparse`.
            let may_use = self.lanes != LaneUse::Off && B::NAME == BackendName::Sparse.as_str();
            if may_use && solver.is_none() && count >= LaneBatch::LEAST_RVES {
                let is_mixed = self.lanes == LaneUse::Mixed;
                let in_precision = |batch: LaneBatch| if is_mixed { batch.with_single_precision() } else { batch };
                let batch = LaneBatch::new_if_faster(model, self.predict).map(in_precision);
                *solver = batch.map(|batch| Mutex::new(Box::new(batch) as Box<dyn BatchSolver>));
            }
        }
        #[cfg(not(feature = "sparse"))]
        let (_, _) = (counts, self.lanes);
    }

    /// Solves the RVEs of models for which `make` returns a solver in batches, many at once; what the solver leaves is
    /// solved as without it.
    ///
    /// # Errors
    /// Returns the error of `make`.
    pub fn solve_in_batches<E>(
        &mut self,
        mut make: impl FnMut(&RveModel<B>) -> Result<Option<Box<dyn BatchSolver>>, E>,
    ) -> Result<(), E> {
        for (model, solver) in self.models.iter().zip(&mut self.batch_solvers) {
            if let Some(made) = make(model)? {
                *solver = Some(Mutex::new(made));
            }
        }
        Ok(())
    }

    /// Returns the solver of the batches of a model.
    pub(super) fn batch_solver(&self, model: usize) -> Option<MutexGuard<'_, Box<dyn BatchSolver>>> {
        // A solver whose call panicked writes all its memory anew.
        self.batch_solvers[model].as_ref().map(|solver| solver.lock().unwrap_or_else(PoisonError::into_inner))
    }

    /// Returns true if batches of the RVEs of a model have a solver.
    pub(super) fn has_batch_solver(&self, model: usize) -> bool {
        self.batch_solvers[model].is_some()
    }

    /// Number of RVEs of a model that are solved at once ([`BatchSolver::group`]); 1 without a solver of batches.
    pub(super) fn group(&self, model: usize) -> usize {
        self.batch_solver(model).map_or(1, |solver| solver.group())
    }

    /// Bytes of memory in which each thread solves batches.
    pub fn batch_bytes_per_thread(&self) -> usize {
        let locked = (0..self.models.len()).filter_map(|model| self.batch_solver(model));
        // The batches of all models share the memory of a thread.
        locked.map(|solver| solver.bytes_per_thread()).max().unwrap_or(0)
    }

    /// Whether RVEs keep the sensitivities that predict the start of the next solve.
    pub fn predicts(&self) -> bool {
        self.predict
    }

    /// Returns the models in use: networks, each with its law and scale.
    pub fn models(&self) -> &[RveModel<B>] {
        &self.models
    }

    /// Returns the edge of the cube that the network of each model fills, in the unit of its file.
    pub fn cube_edges(&self) -> &[f64] {
        &self.edges
    }

    /// Returns the models that the points of a region choose from; empty for a formula or a matrix alone.
    pub fn models_of_region(&self, region: usize) -> &[usize] {
        &self.regions[region].1
    }

    /// Returns the regions with their materials.
    pub fn regions(&self) -> impl ExactSizeIterator<Item = &Region> {
        self.regions.iter().map(|(region, _)| region)
    }

    /// Returns the formulas of a region, or those of the matrix of its RVEs, each once.
    pub fn formulas_of_region(&self, region: usize) -> &[Arc<Formula>] {
        self.regions[region].0.material.formula().map_or(&[], Formulas::distinct)
    }

    /// Returns the formula of a point of a region, or that of the matrix of its RVE, if there is one.
    pub fn formula_at(&self, region: usize, point: usize) -> Option<&Arc<Formula>> {
        self.regions[region].0.material.formula()?.at(point)
    }

    /// Returns true if the formula of a region, or that of the matrix of its RVEs, varies.
    pub(super) fn has_formulas_by_point(&self, region: usize) -> bool {
        matches!(self.regions[region].0.material.formula(), Some(Formulas::Points(_)))
    }

    /// Releases the formulas, networks and fiber volume fractions of all points but these, ascending: those of the part of
    /// this rank, or none on a rank that gets them with its RVEs. Formulas of other crates that vary over the body do not
    /// come with RVEs: a rank that solves these must keep them.
    pub fn keep_points(&mut self, points: &[usize]) {
        self.regions.iter_mut().for_each(|(region, _)| region.material = region.material.on_points(points));
    }

    /// Returns the linear response of a model at rest.
    ///
    /// # Errors
    /// Returns [`LibraryError::AtRest`] if there is none, as for a neutral network.
    pub fn at_rest(&self, model: usize) -> Result<SaintVenantKirchhoff, LibraryError> {
        let of = &self.models[model];
        let none = |reason: String| LibraryError::AtRest(of.network().name().into(), reason);
        let mut workspace = Workspace::new(&self.context, of).map_err(|error| none(error.to_string()))?;
        let mut rve = Rve::at_rest(of.network());
        let tangent = equilibrate(of, &mut rve, &Matrix3::identity(), &self.params, &mut workspace)
            .and_then(|mut solved| solved.tangent())
            .map_err(|error| none(error.to_string()))?;
        Ok(SaintVenantKirchhoff::at_rest(&tangent))
    }

    /// Returns the parameters of the solver for equilibria.
    pub fn params(&self) -> &EquilibriumParams {
        &self.params
    }

    /// Returns the material of a point of a region; `None` if there is no such region or it has none there.
    pub fn of_point(&self, region: usize, point: usize) -> Option<PointMaterial> {
        let (Region { material, .. }, models) = self.regions.get(region)?;
        Some(match material {
            RegionMaterial::Formula(formulas) => PointMaterial::Formula(Arc::clone(formulas.at(point)?)),
            RegionMaterial::FiberRve(rve) => {
                let network = match models.is_empty() {
                    true => None,
                    false => Some(PointNetwork {
                        model: *models.get(assigned(rve, point, models.len()))?,
                        factor: rve.scale.factor(point)?,
                    }),
                };
                let matrix = match &rve.matrix {
                    Some(formulas) => Some(Arc::clone(formulas.at(point)?)),
                    None => None,
                };
                PointMaterial::Rve { network, matrix, lifecycle: rve.lifecycle }
            }
        })
    }

    /// Returns the error for a point without a material.
    pub(super) fn no_material(&self, region: usize, point: IntegrationPoint) -> LibraryError {
        LibraryError::NoPointMaterial(self.regions[region].0.name.clone(), point)
    }

    /// Returns the region of every element of a mesh.
    pub(super) fn regions_of_mesh(&self, mesh: &Mesh) -> Result<Vec<usize>, LibraryError> {
        let names = self.regions.iter().map(|(region, _)| region.name.as_str());
        let region =
            |name: &String| find_region(names.clone(), name).ok_or_else(|| LibraryError::NoMaterial(name.clone()));
        let regions = mesh.regions().iter().map(region).collect::<Result<Vec<usize>, _>>()?;
        Ok(mesh.region_of().iter().map(|&of| regions[of as usize]).collect())
    }
}

/// The networks and models read so far: each file once, each combination of network, law and scale once.
struct Reader<'a, B: Backend> {
    context: &'a B::Context,
    /// The parameters of the linear solver of every model.
    solver: SolverParams,
    /// The names of networks whose files have the same name.
    names: HashMap<PathBuf, String>,
    /// Each with the edge of its cube in the file.
    networks: HashMap<PathBuf, (Arc<Network>, f64)>,
    models: Vec<RveModel<B>>,
    /// The network, law and scale of each model.
    sources: Vec<(PathBuf, Option<FiberMaterial>, StressScale)>,
    warnings: Vec<String>,
}

impl<B: RealBackend> Reader<'_, B> {
    /// Reads the networks of all regions, so that the errors of all files are known before any of them is used.
    fn read_networks(&mut self, regions: &[Region]) -> Result<(), InputErrors> {
        let paths = regions.iter().flat_map(|region| match &region.material {
            RegionMaterial::Formula(_) => &[][..],
            RegionMaterial::FiberRve(rve) => &rve.networks[..],
        });
        let mut tried = HashSet::new();
        let paths: Vec<&PathBuf> = paths.filter(|&path| tried.insert(path)).collect();
        self.names = names_of_same(&paths);
        let errors = paths.into_iter().filter_map(|path| self.network(path).err()).collect();
        InputErrors::of_files(errors).map_or(Ok(()), Err)
    }

    /// Returns the models that the points with this material choose from.
    fn models_of(&mut self, material: &RegionMaterial) -> Result<Vec<usize>, LibraryError> {
        match material {
            RegionMaterial::Formula(_) => Ok(Vec::new()),
            RegionMaterial::FiberRve(rve) => rve.networks.iter().map(|path| self.model(path, rve)).collect(),
        }
    }

    fn model(&mut self, path: &PathBuf, rve: &FiberRve) -> Result<usize, LibraryError> {
        let scale = rve.scale.of_models();
        let source = (path.clone(), rve.law.clone(), scale);
        if let Some(known) = self.sources.iter().position(|known| *known == source) {
            return Ok(known);
        }
        let network = self.network(path)?;
        let model = RveModel::with_solver(self.context, network, rve.law.clone(), scale, &self.solver)
            .map_err(|reason| LibraryError::Model(path.clone(), reason.to_string()))?;
        self.models.push(model);
        self.sources.push(source);
        Ok(self.models.len() - 1)
    }

    fn network(&mut self, path: &PathBuf) -> Result<Arc<Network>, InputErrors> {
        if let Some((network, _)) = self.networks.get(path) {
            return Ok(Arc::clone(network));
        }
        let read = file::read(path)?;
        self.warnings.extend(read.warnings);
        let name = self.names.get(path).map_or_else(|| read.network.name().to_owned(), String::clone);
        let network = Arc::new(read.network.with_name(name));
        self.networks.insert(path.clone(), (Arc::clone(&network), read.cube.edges[0]));
        Ok(network)
    }
}

/// Returns names for different files of the same name in different folders: as many of the last folders in front of it as
/// distinguish them.
fn names_of_same(paths: &[&PathBuf]) -> HashMap<PathBuf, String> {
    let mut of_name = HashMap::<_, Vec<&PathBuf>>::new();
    paths.iter().for_each(|path| of_name.entry(path.file_name()).or_default().push(path));
    let last = |path: &Path, parts: usize| {
        let all: Vec<_> = path.components().map(|part| part.as_os_str().to_string_lossy()).collect();
        all[all.len().saturating_sub(parts)..].join("/")
    };
    let mut names = HashMap::new();
    for same in of_name.into_values().filter(|same| same.len() > 1) {
        let longest = same.iter().map(|path| path.components().count()).max().unwrap_or_default();
        let are_different =
            |parts: &usize| same.iter().map(|path| last(path, *parts)).collect::<HashSet<_>>().len() == same.len();
        let parts = (2..longest).find(are_different).unwrap_or(longest);
        names.extend(same.into_iter().map(|path| (path.clone(), last(path, parts))));
    }
    names
}

/// Assigns one of `count` networks to a point, as a function of the material and the number of the point alone; beyond
/// `count` if the point has none.
fn assigned(rve: &FiberRve, point: usize, count: usize) -> usize {
    match &rve.assignment {
        NetworkAssignment::Field(networks) => networks.at(point).map_or(count, |network| network as usize),
        NetworkAssignment::Cycle => point % count,
        NetworkAssignment::Random => random_network(rve.seed, point, count),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn files_of_the_same_name_are_told_apart_by_their_folders() {
        let paths = ["/n/a/1/x.txt", "/n/b/1/x.txt", "/n/a/2/x.txt", "/n/a/1/y.txt"].map(PathBuf::from);
        let names = names_of_same(&paths.iter().collect::<Vec<_>>());
        let found: Vec<_> = paths.iter().map(|path| names.get(path).map(String::as_str)).collect();
        assert_eq!(found, [Some("a/1/x.txt"), Some("b/1/x.txt"), Some("a/2/x.txt"), None]);
    }
}
