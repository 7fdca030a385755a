//! From a case to a field: the network library is read, and every element gets its material.

use std::collections::HashMap;
use std::path::PathBuf;
use std::sync::{Arc, Mutex};

use thiserror::Error;

use super::unit::Unit;
use super::worker::Worker;
use super::{Site, TissueField};
use crate::fem::mesh::Mesh;
use crate::fiber::equilibrium::EquilibriumParams;
use crate::fiber::law::FiberMaterial;
use crate::fiber::network::{Network, file};
use crate::fiber::rve::{RveModel, RveModelError, StressScale};
use crate::input::InputErrors;
use crate::las::{Backend, Scalar, SolverParams};
use crate::tissue::case::{Case, Choose, FiberRveCase, MaterialCase, ScaleCase};

/// Why the materials of a case cannot be made.
#[derive(Debug, Error)]
pub enum LibraryError<F: std::error::Error + 'static> {
    /// Something is wrong in a network file.
    #[error("{0}")]
    Network(#[from] InputErrors),
    /// A network cannot serve as an RVE.
    #[error("{}: {reason}", file.display())]
    Model {
        /// The network.
        file: PathBuf,
        /// Why.
        reason: RveModelError<F>,
    },
    /// A region of the mesh has no material in the case.
    #[error("no material for the region {0}")]
    NoMaterial(String),
}

impl<B: Backend<Scalar = f64>> TissueField<B>
where
    B::Reduced: Scalar,
{
    /// Reads the networks of a case and gives every element of the mesh its material; also returns the warnings of the
    /// network reader.
    ///
    /// # Errors
    /// [`LibraryError`].
    pub fn new(context: B::Context, case: &Case, mesh: &Mesh) -> Result<(Self, Vec<String>), LibraryError<B::Fault>> {
        let mut library = Reader {
            context: &context,
            solver: SolverParams { method: case.micro.solver, ..SolverParams::default() },
            networks: HashMap::new(),
            models: Vec::new(),
            made_of: Vec::new(),
            warnings: Vec::new(),
        };
        let mut materials = Vec::new();
        for region in mesh.regions() {
            let material = case.material_of(region).ok_or_else(|| LibraryError::NoMaterial(region.clone()))?;
            materials.push(library.regional(material)?);
        }
        let Reader { models, warnings, .. } = library;

        let mut sites = Vec::with_capacity(mesh.elements().len());
        let (mut units, mut element_of) = (Vec::new(), Vec::new());
        for (element, &region) in mesh.region_of().iter().enumerate() {
            sites.push(match &materials[region as usize] {
                Regional::Formula(formula) => Site::Formula(*formula),
                Regional::Networks { case, models: choices } => {
                    let model = (!choices.is_empty()).then(|| choices[choice(case, element, choices.len())]);
                    units.push(Unit::new(model, &models, case.matrix.map(Into::into)));
                    element_of.push(element);
                    Site::Rve(units.len() - 1)
                }
            });
        }
        let workers = (0..rayon::current_num_threads()).map(|_| Mutex::new(Worker::new(models.len()))).collect();
        let mut params = EquilibriumParams::default();
        params.newton.tolerance = case.micro.tolerance;
        params.newton.max_iterations = case.micro.max_iterations;
        params.max_cuts = case.micro.max_cuts;
        let params = params.with_stages(case.micro.stages);
        let predict = case.micro.predictor;
        let (stats, lost) = Default::default();
        Ok((Self { context, models, sites, units, element_of, workers, params, predict, stats, lost }, warnings))
    }
}

/// The material of a region with its networks read.
enum Regional<'a> {
    Formula(super::Formula),
    /// The numbers of the models that elements choose from.
    Networks {
        case: &'a FiberRveCase,
        models: Vec<usize>,
    },
}

/// Networks and models read so far: each file once, each combination of network, law and scale once.
struct Reader<'a, B: Backend> {
    context: &'a B::Context,
    /// How the linear systems of every model are solved.
    solver: SolverParams,
    networks: HashMap<PathBuf, Arc<Network>>,
    models: Vec<RveModel<B>>,
    /// What each model was made of.
    made_of: Vec<(PathBuf, Option<FiberMaterial>, ScaleCase)>,
    warnings: Vec<String>,
}

impl<B: Backend<Scalar = f64>> Reader<'_, B> {
    fn regional<'c>(&mut self, material: &'c MaterialCase) -> Result<Regional<'c>, LibraryError<B::Fault>> {
        match material {
            MaterialCase::Formula(formula) => Ok(Regional::Formula((*formula).into())),
            MaterialCase::FiberRve(case) => {
                let models = case.networks.iter().map(|path| self.model(path, case)).collect::<Result<_, _>>()?;
                Ok(Regional::Networks { case, models })
            }
        }
    }

    fn model(&mut self, path: &PathBuf, case: &FiberRveCase) -> Result<usize, LibraryError<B::Fault>> {
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
            .map_err(|reason| LibraryError::Model { file: path.clone(), reason })?;
        self.models.push(model);
        self.made_of.push(recipe);
        Ok(self.models.len() - 1)
    }

    fn network(&mut self, path: &PathBuf) -> Result<Arc<Network>, LibraryError<B::Fault>> {
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

/// Which network of `count` an element gets: a function of the seed and the element alone.
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
