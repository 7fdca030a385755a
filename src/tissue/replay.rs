//! One equilibrium of one RVE, with everything that it depends on, in a file: `biotissue rve --dump`, `--replay`, and what
//! a run leaves of an RVE that it lost.
//!
//! A JSON object: the network with the materials of its fibers, the stress scale, the state that the RVE started from,
//! the deformation gradient asked for, and the parameters. Numbers have all their digits, so that the same program
//! repeats the equilibrium bit for bit.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use nalgebra::Matrix3;
use serde::{Deserialize, Serialize};

use super::results::ResultsError;
use crate::fiber::equilibrium::{EquilibriumParams, Stage, Stages};
use crate::fiber::law::FiberMaterial;
use crate::fiber::network::file::sidecar::NamedLaw;
use crate::fiber::network::{Cube, Network};
use crate::fiber::rve::{Rve, RveModel, Sensitivities, StressScale};
use crate::input::InputError;
use crate::las::Backend;
use crate::output;

/// The folder of a result directory for RVEs that were lost.
pub const LOST_FOLDER: &str = "lost-rve";

/// An equilibrium to be computed.
#[derive(Clone, Debug, PartialEq)]
pub struct RveDump {
    /// Where the RVE comes from, in words.
    pub origin: String,
    /// The network, with the materials of its fibers.
    pub network: Arc<Network>,
    /// How forces become stresses.
    pub scale: StressScale,
    /// The state to start from.
    pub start: Rve,
    /// The deformation gradient asked for.
    pub target: Matrix3<f64>,
    /// How it is to be solved.
    pub params: EquilibriumParams,
}

/// The file as it stands; tensors row by row.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Document {
    program: String,
    origin: String,
    network: NetworkDocument,
    materials: Vec<NamedLaw>,
    /// Absent for forces as they are.
    fiber_volume_fraction: Option<f64>,
    start: StateDocument,
    target: [[f64; 3]; 3],
    solver: SolverDocument,
}

/// In unit-cube units.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct NetworkDocument {
    name: String,
    nodes: Vec<[f64; 3]>,
    fibers: Vec<[u32; 2]>,
    material_of: Vec<u16>,
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct StateDocument {
    gradient: [[f64; 3]; 3],
    interior: Vec<[f64; 3]>,
    #[serde(alias = "rates")]
    sensitivities: Option<Vec<Sensitivities>>,
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct SolverDocument {
    tolerance: f64,
    max_iterations: usize,
    max_cuts: u32,
    stages: Vec<String>,
}

impl RveDump {
    /// An equilibrium of a model.
    #[must_use]
    pub fn new(
        origin: String,
        model: &RveModel<impl Backend<Scalar = f64>>,
        (start, target): (&Rve, &Matrix3<f64>),
        params: &EquilibriumParams,
    ) -> Self {
        let network = match model.material() {
            Some(material) => Arc::new((**model.network()).clone().of_one_material(material.clone())),
            None => Arc::clone(model.network()),
        };
        let scale = model.stress_scale();
        Self { origin, network, scale, start: start.clone(), target: *target, params: *params }
    }

    /// Writes the file as [`output::write`] does, and the folder it lies in where there is none.
    ///
    /// # Errors
    /// [`ResultsError::Write`].
    pub fn write(&self, path: &Path) -> Result<(), ResultsError> {
        if let Some(folder) = path.parent().filter(|folder| !folder.as_os_str().is_empty()) {
            std::fs::create_dir_all(folder).map_err(ResultsError::write(folder))?;
        }
        let text = serde_json::to_string(&self.document())
            .map_err(|error| ResultsError::write(path)(std::io::Error::other(error)))?;
        output::write(path, text.as_bytes()).map_err(ResultsError::write(path))
    }

    fn document(&self) -> Document {
        let network = &self.network;
        Document {
            program: concat!("biotissue ", env!("CARGO_PKG_VERSION")).into(),
            origin: self.origin.clone(),
            network: NetworkDocument {
                name: network.name().into(),
                nodes: network.nodes().to_vec(),
                fibers: network.fibers().to_vec(),
                material_of: network.reaction_of().to_vec(),
            },
            materials: network.materials().iter().map(NamedLaw::from).collect(),
            fiber_volume_fraction: match self.scale {
                StressScale::Raw => None,
                StressScale::FiberVolumeFraction(phi) => Some(phi),
            },
            start: StateDocument {
                gradient: rows(self.start.gradient()),
                interior: self.start.interior().to_vec(),
                sensitivities: self.start.sensitivities().map(<[Sensitivities]>::to_vec),
            },
            target: rows(&self.target),
            solver: SolverDocument {
                tolerance: self.params.newton.tolerance,
                max_iterations: self.params.newton.max_iterations,
                max_cuts: self.params.max_cuts,
                stages: self.params.stages.iter().map(|stage| stage.name().into()).collect(),
            },
        }
    }

    /// Reads a file that [`RveDump::write`] has written.
    ///
    /// # Errors
    /// What is wrong, with the line where there is one.
    pub fn read(path: &Path) -> Result<Self, InputError> {
        let text = std::fs::read_to_string(path).map_err(|error| InputError::unreadable(path, &error))?;
        let text = text.strip_prefix('\u{feff}').unwrap_or(&text);
        let document: Document = serde_json::from_str(text).map_err(|error| {
            InputError::at_line(path, error.line(), format!("is no RVE to replay: {error}"), EXPECTED, CURE)
        })?;
        let folder = path.parent().unwrap_or(Path::new(""));
        Self::of(document, folder).map_err(|what| InputError::in_file(path, what, EXPECTED, CURE))
    }

    /// The content of a file, or what does not fit in it.
    fn of(document: Document, folder: &Path) -> Result<Self, String> {
        let Document { origin, network, materials, fiber_volume_fraction, start, target, solver, .. } = document;
        let NetworkDocument { name, nodes, fibers, material_of } = network;
        let materials: Result<Vec<FiberMaterial>, _> = materials.iter().map(|law| law.material(folder)).collect();
        let materials = materials.map_err(|error| error.to_string())?;
        let network = Network::in_cube(name, Cube::UNIT, nodes, fibers)
            .and_then(|network| network.with_materials(materials, material_of))
            .map_err(|error| error.to_string())?;
        let start = Rve::restored(matrix(&start.gradient), start.interior, start.sensitivities);
        start.check(&network).map_err(|error| error.to_string())?;
        let stages: Option<Vec<Stage>> = solver.stages.iter().map(|name| Stage::named(name)).collect();
        let stages = stages.ok_or_else(|| format!("knows other stages than this program: {:?}", solver.stages))?;
        let mut params = EquilibriumParams::default();
        params.newton.tolerance = solver.tolerance;
        params.newton.max_iterations = solver.max_iterations;
        params.max_cuts = solver.max_cuts;
        let params = params.with_stages(Stages::of(&stages));
        Ok(Self {
            origin,
            network: Arc::new(network),
            scale: fiber_volume_fraction.map_or(StressScale::Raw, StressScale::FiberVolumeFraction),
            start,
            target: matrix(&target),
            params,
        })
    }
}

const EXPECTED: &str = "a file that `biotissue rve --dump` or a run that lost an RVE has written";
const CURE: &str = "write it again with this version of the program";

/// The file, within a result directory, of an RVE that was lost in a load step.
#[must_use]
pub fn lost_file(step: usize, halvings: u32, element: usize) -> PathBuf {
    Path::new(LOST_FOLDER).join(format!("step-{step:05}-cut-{halvings:02}-element-{element}.json"))
}

fn rows(m: &Matrix3<f64>) -> [[f64; 3]; 3] {
    [0, 1, 2].map(|i| [0, 1, 2].map(|j| m[(i, j)]))
}

fn matrix(rows: &[[f64; 3]; 3]) -> Matrix3<f64> {
    Matrix3::from_fn(|i, j| rows[i][j])
}
