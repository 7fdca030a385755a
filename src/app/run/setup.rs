//! A case with all its input files, read and checked.

use std::sync::Arc;

use thiserror::Error;

use super::Simulation;
use super::memory::MemoryForecast;
use super::problem_size::ProblemSize;
use crate::app::case::{Case, ElementSelection, RegionMaterial};
use crate::app::checkpoint::hash_of_mesh;
use crate::app::macro_scale;
use crate::app::material_fields::{self, FieldRange, ResolvedMaterials};
use crate::app::plausibility::{self, Examination, FloppyNetworks, LoadSize, Plausibility};
use crate::app::results::ResultsRecord;
use crate::app::rve_device;
use crate::app::rve_files;
use crate::fem::boundary::Conditions;
use crate::fem::mesh::{Division, Mesh};
use crate::fem::rigid_modes;
use crate::fem::stepping::{BodyPart, LinearSystem, SetupError, Stepper};
use crate::input::InputErrors;
use crate::las::RealBackend;
use crate::tissue::materials::Materials;
use crate::tissue::micro_scale::{LibraryError, Sites, TissueField, TissueFieldError, TissueMaterial};
use crate::tissue::two_scale::partition;

/// The reason why a simulation cannot be set up.
#[derive(Debug, Error)]
pub enum SimulationError<F: std::error::Error + 'static> {
    /// The mesh, the boundary conditions or the requested output are wrong.
    #[error(transparent)]
    Input(#[from] InputErrors),
    /// The networks or the materials of regions are wrong.
    #[error(transparent)]
    Library(#[from] LibraryError),
    /// The body and its boundary conditions do not match.
    #[error(transparent)]
    Setup(#[from] Box<SetupError<TissueFieldError, F>>),
}

/// A case with all its input files, read and checked before the first solve.
pub struct Setup<B: RealBackend, M = TissueField<B>> {
    pub(super) context: B::Context,
    pub(super) case: Case,
    pub(super) mesh: Arc<Mesh>,
    mesh_hash: u64,
    pub(super) conditions: Conditions,
    /// The part of this rank, if the body is divided.
    part: Option<BodyPart>,
    pub(super) field: M,
    networks: Vec<usize>,
    unknowns: usize,
    free_mode_supports: Vec<(u32, u8)>,
    ranges: Vec<FieldRange>,
    load_sizes: Vec<LoadSize>,
    warnings: Vec<String>,
}

impl<B: RealBackend> Setup<B> {
    /// Reads the mesh and the networks of a case and checks them against the case.
    ///
    /// # Errors
    /// Returns [`SimulationError`] if an input file cannot be read or does not match the case, or if the boundary
    /// conditions leave a rigid-body mode.
    pub fn new(context: B::Context, case: Case) -> Result<Self, SimulationError<B::Error>> {
        Self::with_rves(context.clone(), context, case)
    }
}

impl<B: RealBackend, N: RealBackend> Setup<B, TissueField<N>> {
    /// Like [`Setup::new`], with a context for the RVEs, whose backend may be another one.
    ///
    /// # Errors
    /// As for [`Setup::new`].
    pub fn with_rves(context: B::Context, of_rves: N::Context, case: Case) -> Result<Self, SimulationError<B::Error>> {
        let costs = case.output.costs;
        Self::with_material(context, case, None, |materials, mesh| {
            let (mut field, warnings) = TissueField::new(of_rves, materials, mesh)?;
            if costs {
                field.keep_costs();
            }
            Ok((field, warnings))
        })
    }

    /// Opens the device of the case, if it names one for its RVEs. A run needs it, a check does not.
    ///
    /// # Errors
    /// Returns [`LibraryError::Device`] if the device cannot be used.
    pub fn with_device(mut self) -> Result<Self, SimulationError<B::Error>> {
        let (device, predicts) = (self.case.micro.device, self.field.library().predicts());
        self.field.solve_in_batches(|model| rve_device::batch_solver(device, 0, model, predicts))?;
        Ok(self)
    }
}

/// The ranks among which a body is divided.
#[derive(Clone, Copy, Debug)]
pub struct BodyRanks {
    /// The rank of the caller.
    pub rank: usize,
    /// The number of ranks.
    pub ranks: usize,
}

impl<B: RealBackend, M: TissueMaterial> Setup<B, M> {
    /// Reads the mesh of a case and checks it against the case; `material` sets up the materials of the case on the mesh,
    /// and returns warnings. With `ranks`, the body is divided among them if it can be ([`BodyPart::new`]): the mesh that
    /// `material` gets is then the part of this rank, and the whole mesh is released.
    ///
    /// # Errors
    /// As for [`Setup::new`].
    pub fn with_material(
        context: B::Context,
        case: Case,
        ranks: Option<BodyRanks>,
        material: impl FnOnce(Materials, &Mesh) -> Result<(M, Vec<String>), LibraryError>,
    ) -> Result<Self, SimulationError<B::Error>> {
        let (whole, mut warnings) = macro_scale::mesh(&case)?;
        let conditions = macro_scale::conditions(&case);
        let boundary = macro_scale::boundary(&case, &whole, &conditions)?;
        rigid_modes::check(&whole, &boundary.restraints(&whole), boundary.kinematics().rigid_surfaces())
            .map_err(|error| Box::new(error.into()))?;
        macro_scale::check_constraints(&case, &whole, &conditions, &boundary.fixed_components(whole.nodes().len()))?;
        let unknowns = boundary.free_unknowns(whole.nodes().len());
        let ResolvedMaterials { materials, ranges } = material_fields::resolve(&case, &whole)?;
        let part = match ranks {
            None => None,
            Some(BodyRanks { rank, ranks }) => {
                let division = Division::new(&whole, partition(&whole, ranks), ranks, boundary.node_groups());
                let params = macro_scale::step_params(&case);
                BodyPart::new::<B, _>(&whole, &boundary, &conditions, &division, rank, &params).map_err(Box::new)?
            }
        };
        let mesh = part.as_ref().map_or(&whole, |part| &**part.mesh());
        let (field, network_warnings) = material(materials, mesh)?;
        let Plausibility { warnings: implausible, loads: load_sizes } =
            plausibility::check(&case, &whole, field.library());
        warnings.extend(implausible);
        warnings.extend(network_warnings);
        warnings.extend(without_networks(&case));
        warnings.extend(macro_scale::imbalance(&case, &whole, &boundary));
        let networks = if part.is_some() && case.output.rve != ElementSelection::None {
            rve_files::points(&case, &Sites::new(field.library(), &whole)?)?
        } else {
            rve_files::points(&case, field.sites())?
        };
        let free_mode_supports = boundary.free_mode_supports().collect();
        let mesh_hash = hash_of_mesh(&whole);
        Ok(Self {
            context,
            case,
            mesh: part.as_ref().map_or_else(|| Arc::new(whole), |part| Arc::clone(part.mesh())),
            mesh_hash,
            conditions,
            part,
            field,
            networks,
            unknowns,
            free_mode_supports,
            ranges,
            load_sizes,
            warnings,
        })
    }

    /// Returns the nodes and components that are held because the case has `free = "rigid"`.
    pub fn free_mode_supports(&self) -> impl Iterator<Item = (u32, u8)> {
        self.free_mode_supports.iter().copied()
    }

    /// Returns the size of the problem, and the memory that a run on the threads of this process takes.
    ///
    /// # Errors
    /// Returns [`SimulationError`] if the linear system would be too large.
    pub fn problem_size(&self) -> Result<(ProblemSize, MemoryForecast), SimulationError<B::Error>> {
        let (order, params) = (self.field.node_order(&self.mesh), macro_scale::step_params(&self.case));
        let boundary = macro_scale::boundary(&self.case, &self.mesh, &self.conditions)?;
        let constraints = self.conditions.constraints.len();
        let system = LinearSystem::new::<B>(&order, &self.mesh, &boundary, constraints, &params);
        let system = system.map_err(|error| Box::new(SetupError::from(error)))?;
        let size = ProblemSize::new(&self.case, &self.mesh, &self.field, self.unknowns, system.choice.as_ref());
        let memory = MemoryForecast::new(&self.field, &self.mesh, &system, size.threads);
        Ok((size, memory))
    }

    /// Returns the ranges of the material parameters and axes that vary over the body.
    pub fn field_ranges(&self) -> &[FieldRange] {
        &self.ranges
    }

    /// Returns the sizes of the tractions, pressures and body forces relative to the stiffness of their materials.
    pub fn load_sizes(&self) -> &[LoadSize] {
        &self.load_sizes
    }

    /// Finds the networks of regions without a matrix that have motions which no fiber resists: such equilibria take
    /// long to find. Factors a matrix for each network that is not too large, on the backend of the RVEs.
    pub fn floppy_networks(&self, examination: Examination) -> FloppyNetworks {
        plausibility::floppy_networks(&self.case, self.field.library(), examination)
    }

    /// Returns the warnings of the readers.
    pub fn warnings(&self) -> &[String] {
        &self.warnings
    }

    /// Returns the case.
    pub fn case(&self) -> &Case {
        &self.case
    }

    /// Returns the mesh, in meters; the part of this rank if the body is divided.
    pub fn mesh(&self) -> &Mesh {
        &self.mesh
    }

    /// Returns the material of the body.
    pub fn material_mut(&mut self) -> &mut M {
        &mut self.field
    }

    /// Sets up the linear systems of both scales and evaluates every point of the undeformed body.
    ///
    /// # Errors
    /// Returns [`SimulationError::Setup`] if the linear system cannot be set up or a point of the undeformed body has
    /// no response.
    pub fn simulation(self) -> Result<Simulation<B, M>, SimulationError<B::Error>> {
        let Self { context, case, mesh, mesh_hash, conditions, part, field, networks, warnings, .. } = self;
        let params = macro_scale::step_params(&case);
        let stepper = match part {
            Some(part) => Stepper::on_part(&context, part, field, params),
            None => {
                let order = field.node_order(&mesh);
                Stepper::in_order(&order, &context, mesh, &conditions, field, params)
            }
        };
        let stepper = stepper.map_err(Box::new)?;
        Ok(Simulation { case, stepper, mesh_hash, networks, warnings, lock: None, written: ResultsRecord::default() })
    }
}

/// Warnings for regions whose RVEs have no network.
fn without_networks(case: &Case) -> impl Iterator<Item = String> {
    case.regions.iter().filter_map(|region| match &region.material {
        RegionMaterial::FiberRve(rve) if rve.networks.is_empty() => Some(format!(
            "{}: the region \"{}\" has no networks: its RVEs are the matrix alone",
            case.file.display(),
            region.name
        )),
        _ => None,
    })
}
