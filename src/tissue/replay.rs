//! A file with one equilibrium problem of one RVE. `biotissue rve --dump` writes it, and so does a run for an RVE
//! without an equilibrium; `biotissue rve --replay` solves it.
//!
//! The file is a JSON object: the network with the materials of its fibers, the stress scale, the start state, the
//! requested deformation gradient, and the parameters. Numbers have all digits, so that the same program reproduces the
//! equilibrium bit for bit.

use std::path::Path;
use std::sync::Arc;

use nalgebra::Matrix3;
use serde::{Deserialize, Serialize};

use crate::fiber::equilibrium::{EquilibriumParams, Stage, Stages};
use crate::fiber::law::FiberMaterial;
use crate::fiber::network::file::sidecar::NamedLaw;
use crate::fiber::network::{Cube, Network};
use crate::fiber::rve::{Rve, RveModel, Sensitivities, StressScale};
use crate::input::InputError;
use crate::las::RealBackend;
use crate::output;

/// An equilibrium problem of one RVE.
#[derive(Clone, Debug, PartialEq)]
pub struct RveDump {
    /// The origin of the RVE as text.
    pub origin: String,
    /// The network, with the materials of its fibers.
    pub network: Arc<Network>,
    /// The conversion of forces to stresses.
    pub scale: StressScale,
    /// The start state.
    pub start: Rve,
    /// The requested deformation gradient.
    pub target: Matrix3<f64>,
    /// The solver parameters.
    pub params: EquilibriumParams,
}

/// The content of the file; tensors row by row.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Document {
    program: String,
    origin: String,
    network: NetworkDocument,
    materials: Vec<NamedLaw>,
    /// Absent for [`StressScale::Raw`].
    fiber_volume_fraction: Option<f64>,
    start: StateDocument,
    target: [[f64; 3]; 3],
    solver: SolverDocument,
}

/// Lengths in units of the unit cube.
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
    /// Creates the problem of a model from its start state and the requested deformation gradient.
    pub fn new(
        origin: String,
        model: &RveModel<impl RealBackend>,
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

    /// Writes the file as [`output::write`] does, and creates its folder if it does not exist.
    ///
    /// # Errors
    /// Returns an error if the file or its folder cannot be written.
    pub fn write(&self, path: &Path) -> std::io::Result<()> {
        if let Some(folder) = path.parent().filter(|folder| !folder.as_os_str().is_empty()) {
            std::fs::create_dir_all(folder)?;
        }
        output::write(path, serde_json::to_string(&self.document())?.as_bytes())
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
                material_of: network.material_of().to_vec(),
            },
            materials: network.materials().iter().map(NamedLaw::from).collect(),
            fiber_volume_fraction: match self.scale {
                StressScale::Raw => None,
                StressScale::FiberVolumeFraction(phi) => Some(phi),
            },
            start: StateDocument {
                gradient: self.start.gradient().transpose().into(),
                interior: self.start.interior().to_vec(),
                sensitivities: self.start.sensitivities().map(<[Sensitivities]>::to_vec),
            },
            target: self.target.transpose().into(),
            solver: SolverDocument {
                tolerance: self.params.newton.tolerance,
                max_iterations: self.params.newton.max_iterations,
                max_cuts: self.params.max_cuts,
                stages: self.params.stages.iter().map(|stage| stage.name().into()).collect(),
            },
        }
    }

    /// Reads a file written by [`RveDump::write`].
    ///
    /// # Errors
    /// Returns [`InputError`], with the line if there is one, if the file cannot be read or its content is
    /// inconsistent.
    pub fn read(path: &Path) -> Result<Self, InputError> {
        let text = std::fs::read_to_string(path).map_err(|error| InputError::unreadable(path, &error))?;
        let text = text.strip_prefix('\u{feff}').unwrap_or(&text);
        let document: Document = serde_json::from_str(text).map_err(|error| {
            InputError::at_line(path, error.line(), format!("is not an RVE to replay: {error}"), EXPECTED, CURE)
        })?;
        let folder = path.parent().unwrap_or(Path::new(""));
        Self::of(document, folder).map_err(|what| InputError::in_file(path, what, EXPECTED, CURE))
    }

    /// Converts the content of a file, or returns the inconsistency.
    fn of(document: Document, folder: &Path) -> Result<Self, String> {
        let Document { origin, network, materials, fiber_volume_fraction, start, target, solver, .. } = document;
        let NetworkDocument { name, nodes, fibers, material_of } = network;
        let materials: Result<Vec<FiberMaterial>, _> = materials.iter().map(|law| law.material(folder)).collect();
        let materials = materials.map_err(|error| error.to_string())?;
        let network = Network::in_cube(name, Cube::UNIT, nodes, fibers)
            .and_then(|network| network.with_materials(materials, material_of))
            .map_err(|error| error.to_string())?;
        let start = Rve::restored(Matrix3::from(start.gradient).transpose(), start.interior, start.sensitivities);
        start.check(&network).map_err(|error| error.to_string())?;
        let stages: Option<Vec<Stage>> = solver.stages.iter().map(|name| Stage::named(name)).collect();
        let stages = stages.ok_or_else(|| format!("names stages unknown to this program: {:?}", solver.stages))?;
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
            target: Matrix3::from(target).transpose(),
            params,
        })
    }
}

const EXPECTED: &str = "a file written by `biotissue rve --dump`, or by a run in which an RVE failed";
const CURE: &str = "write it again with this version of the program";
