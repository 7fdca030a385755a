//! The materials of a case: reads each network once and assigns a material to every element.

use std::collections::HashMap;
use std::path::PathBuf;
use std::sync::Arc;

use nalgebra::Matrix3;
use thiserror::Error;

use super::formula::Formula;
use crate::app::case::{Case, Choose, FiberRveCase, MaterialCase, ScaleCase};
use crate::fem::material::SaintVenantKirchhoff;
use crate::fem::mesh::Mesh;
use crate::fiber::equilibrium::{EquilibriumParams, equilibrate};
use crate::fiber::law::FiberMaterial;
use crate::fiber::network::{Network, file};
use crate::fiber::rve::{Rve, RveModel, StressScale};
use crate::fiber::workspace::Workspace;
use crate::input::InputErrors;
use crate::las::{Backend, Scalar, SolverParams};

/// The reason why the materials of a case cannot be set up.
#[derive(Debug, Error)]
pub enum LibraryError {
    /// A network file has errors.
    #[error(transparent)]
    Network(#[from] InputErrors),
    /// A network cannot be used as an RVE.
    #[error("{}: {reason}", file.display())]
    Model {
        /// The network file.
        file: PathBuf,
        /// The reason as text.
        reason: String,
    },
    /// A region of the mesh has no material in the case.
    #[error("no material for the region {0}")]
    NoMaterial(String),
}

/// The materials of a case, shared by all RVEs. Every rank that solves RVEs has the same library.
pub struct Library<B: Backend> {
    pub(super) context: B::Context,
    pub(super) models: Vec<RveModel<B>>,
    /// Indexed by region of the case.
    materials: Vec<Material>,
    pub(super) params: EquilibriumParams,
    /// Whether RVEs keep the sensitivities that predict the start of the next solve.
    pub(super) predict: bool,
}

/// The material of a region.
enum Material {
    Formula(Formula),
    /// The models that elements choose from, and the matrix in parallel.
    Networks {
        case: FiberRveCase,
        models: Vec<usize>,
        matrix: Option<Formula>,
    },
}

/// The material of an element.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum ElementMaterial {
    /// A formula.
    Formula(Formula),
    /// An RVE: its model and the matrix in parallel.
    Rve {
        /// Index into [`Library::models`]; `None` for a matrix alone.
        model: Option<usize>,
        /// The formula of the matrix.
        matrix: Option<Formula>,
    },
}

impl<B: Backend<Scalar = f64>> Library<B> {
    /// Reads the networks of a case; also returns the warnings of the reader.
    ///
    /// # Errors
    /// Returns [`LibraryError::Network`] or [`LibraryError::Model`] if a network cannot be read or used.
    pub fn read(context: B::Context, case: &Case) -> Result<(Self, Vec<String>), LibraryError> {
        let mut reader = Reader::<B> {
            context: &context,
            solver: SolverParams { method: case.micro.solver, ..SolverParams::default() },
            networks: HashMap::new(),
            models: Vec::new(),
            made_of: Vec::new(),
            warnings: Vec::new(),
        };
        let materials =
            case.regions.iter().map(|region| reader.material(&region.material)).collect::<Result<_, _>>()?;
        let Reader { models, warnings, .. } = reader;
        let mut params = EquilibriumParams::default();
        params.newton.tolerance = case.micro.tolerance;
        params.newton.max_iterations = case.micro.max_iterations;
        params.max_cuts = case.micro.max_cuts;
        let params = params.with_stages(case.micro.stages);
        Ok((Self { context, models, materials, params, predict: case.micro.predictor }, warnings))
    }

    /// Returns the models in use: networks, each with its law and scale.
    #[must_use]
    pub fn models(&self) -> &[RveModel<B>] {
        &self.models
    }

    /// Returns the models that the elements of a region of the case choose from; empty for a formula or a matrix alone.
    #[must_use]
    pub fn choices(&self, region: usize) -> &[usize] {
        match &self.materials[region] {
            Material::Formula(_) => &[],
            Material::Networks { models, .. } => models,
        }
    }

    /// Returns the linear response of a model at rest.
    ///
    /// # Errors
    /// Returns [`LibraryError::Model`] if there is none, as for a neutral network.
    pub fn at_rest(&self, model: usize) -> Result<SaintVenantKirchhoff, LibraryError>
    where
        B::Reduced: Scalar,
    {
        let of = &self.models[model];
        let none = |reason: String| LibraryError::Model {
            file: of.network().name().into(),
            reason: format!("no response at rest: {reason}"),
        };
        let mut workspace = Workspace::new(&self.context, of).map_err(|error| none(error.to_string()))?;
        let mut rve = Rve::at_rest(of.network());
        let tangent = equilibrate(of, &mut rve, &Matrix3::identity(), &self.params, &mut workspace)
            .and_then(|mut solved| solved.tangent())
            .map_err(|error| none(error.to_string()))?;
        Ok(SaintVenantKirchhoff::at_rest(&tangent))
    }

    /// Returns the parameters of the solver for equilibria.
    #[must_use]
    pub fn params(&self) -> &EquilibriumParams {
        &self.params
    }

    /// Returns the material of an element in a region of the case.
    #[must_use]
    pub fn of_element(&self, region: usize, element: usize) -> ElementMaterial {
        match &self.materials[region] {
            Material::Formula(formula) => ElementMaterial::Formula(*formula),
            Material::Networks { case, models, matrix } => {
                let model = (!models.is_empty()).then(|| models[choice(case, element, models.len())]);
                ElementMaterial::Rve { model, matrix: *matrix }
            }
        }
    }
}

/// Returns the region of the case for every element of a mesh.
///
/// # Errors
/// Returns [`LibraryError::NoMaterial`] if the case has no material for a region of the mesh.
pub fn regions_of_mesh(case: &Case, mesh: &Mesh) -> Result<Vec<usize>, LibraryError> {
    let region = |name: &String| case.region_of(name).ok_or_else(|| LibraryError::NoMaterial(name.clone()));
    let regions = mesh.regions().iter().map(region).collect::<Result<Vec<usize>, _>>()?;
    Ok(mesh.region_of().iter().map(|&of| regions[of as usize]).collect())
}

/// The networks and models read so far: each file once, each combination of network, law and scale once.
struct Reader<'a, B: Backend> {
    context: &'a B::Context,
    /// The parameters of the linear solver of every model.
    solver: SolverParams,
    networks: HashMap<PathBuf, Arc<Network>>,
    models: Vec<RveModel<B>>,
    /// The network, law and scale of each model.
    made_of: Vec<(PathBuf, Option<FiberMaterial>, ScaleCase)>,
    warnings: Vec<String>,
}

impl<B: Backend<Scalar = f64>> Reader<'_, B> {
    fn material(&mut self, material: &MaterialCase) -> Result<Material, LibraryError> {
        match material {
            MaterialCase::Formula(formula) => Ok(Material::Formula((*formula).into())),
            MaterialCase::FiberRve(case) => {
                let models = case.networks.iter().map(|path| self.model(path, case)).collect::<Result<_, _>>()?;
                Ok(Material::Networks { case: case.clone(), models, matrix: case.matrix.map(Into::into) })
            }
        }
    }

    fn model(&mut self, path: &PathBuf, case: &FiberRveCase) -> Result<usize, LibraryError> {
        let recipe = (path.clone(), case.law.clone(), case.scale);
        if let Some(known) = self.made_of.iter().position(|made| *made == recipe) {
            return Ok(known);
        }
        let network = self.network(path)?;
        let scale = match case.scale {
            ScaleCase::Raw => StressScale::Raw,
            ScaleCase::FiberVolumeFraction(phi) => StressScale::FiberVolumeFraction(phi),
        };
        let model = RveModel::with_solver(self.context, network, case.law.clone(), scale, &self.solver)
            .map_err(|reason| LibraryError::Model { file: path.clone(), reason: reason.to_string() })?;
        self.models.push(model);
        self.made_of.push(recipe);
        Ok(self.models.len() - 1)
    }

    fn network(&mut self, path: &PathBuf) -> Result<Arc<Network>, LibraryError> {
        if let Some(network) = self.networks.get(path) {
            return Ok(Arc::clone(network));
        }
        let read = file::read(path)?;
        self.warnings.extend(read.warnings);
        let network = Arc::new(read.network);
        self.networks.insert(path.clone(), Arc::clone(&network));
        Ok(network)
    }
}

/// Selects one of `count` networks for an element, as a function of the seed and the element alone.
fn choice(case: &FiberRveCase, element: usize, count: usize) -> usize {
    match case.choose {
        Choose::Cycle => element % count,
        // The remainder's bias is below count / 2^64.
        Choose::Random => (scramble(case.seed ^ scramble(element as u64)) % count as u64) as usize,
    }
}

/// The output function of SplitMix64 (Steele, Lea and Flood, OOPSLA 2014).
fn scramble(value: u64) -> u64 {
    let mut z = value.wrapping_add(0x9e37_79b9_7f4a_7c15);
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^ (z >> 31)
}
