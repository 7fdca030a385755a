//! A case with all its input files, read and checked.

use std::sync::Arc;

use thiserror::Error;

use super::Simulation;
use super::memory::MemoryForecast;
use super::problem_size::ProblemSize;
use super::setup_ranks::{
    CommonSetup, ExchangeError, OfWhole, PartSetup, RankSetup, SetupRanks, receive_setup, send_failure, send_fields,
    send_parts,
};
use super::whole_body::WholeBody;
use crate::app::case::{Case, ElementSelection, RegionMaterial};
use crate::app::checkpoint::{hash_of_fields, hash_of_mesh};
use crate::app::macro_scale;
use crate::app::material_fields::{FieldRange, MaterialFields};
use crate::app::plausibility::{self, Examination, FloppyNetworks, LoadSize, Plausibility};
use crate::app::results::ResultsRecord;
use crate::app::results::log::SurfacePlace;
use crate::app::rve_device;
use crate::app::rve_files;
use crate::fem::boundary::Conditions;
use crate::fem::mesh::{Division, Mesh};
use crate::fem::stepping::{BodyDivision, BodyPart, LinearSystem, SetupError, Stepper};
use crate::input::{InputError, InputErrors};
use crate::las::{RealBackend, SolveError, SolverParams, Sparsity};
use crate::tissue::materials::Materials;
use crate::tissue::micro_scale::{LibraryError, ProgressSource, Sites, TissueField, TissueFieldError, TissueMaterial};
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
    /// Another rank failed, or the connection to it.
    #[error("{0}")]
    OtherRank(String),
}

impl<F: std::error::Error + 'static> From<ExchangeError> for SimulationError<F> {
    fn from(error: ExchangeError) -> Self {
        match error {
            ExchangeError::Ranks(reason) => Self::OtherRank(reason),
            ExchangeError::File(errors) => Self::Input(errors),
        }
    }
}

/// A case with all its input files, read and checked before the first solve.
pub struct Setup<B: RealBackend, M = TissueField<B>> {
    pub(super) context: B::Context,
    pub(super) case: Case,
    pub(super) mesh: Arc<Mesh>,
    /// The hashes of the whole mesh and of the materials that vary over it.
    hashes: (u64, Option<u64>),
    /// The surfaces with boundary conditions, on the first rank of the body.
    surfaces: Vec<SurfacePlace>,
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
    /// Whether the material has the networks and matrices of all points, and their warnings are not among the others.
    has_all_networks: bool,
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
        Self::with_material(context, case, &(), |materials, mesh| {
            let (mut field, warnings) = TissueField::new(of_rves, materials, mesh)?;
            if costs {
                field.keep_costs();
            }
            Ok((field, warnings))
        })
    }

    /// Opens the device of the case, if it names one for its RVEs and has any. A run needs it, a check does not.
    ///
    /// # Errors
    /// Returns [`LibraryError::Device`] if the device cannot be used.
    pub fn with_device(mut self) -> Result<Self, SimulationError<B::Error>> {
        let library = self.field.library();
        let needed = self.case.micro.device.filter(|_| !library.models().is_empty());
        if let Some(device) = rve_device::open(needed, 0)? {
            let mut solvers = device.batch_solvers(1, library.models(), library.predicts())?.into_iter();
            self.field.solve_in_batches(|_| Ok::<_, LibraryError>(solvers.next().flatten()))?;
        }
        Ok(self)
    }
}

impl<B: RealBackend, M: TissueMaterial> Setup<B, M> {
    /// Reads the mesh of a case and checks it against the case; `material` sets up the materials of the case on the mesh,
    /// and returns warnings. If there are several `ranks`, the first one reads the mesh, divides the body among them if it
    /// can be ([`BodyPart::new`]), and sends each rank its part; the mesh that `material` gets is then the part, and the
    /// whole mesh is released. Collective over `ranks`. If the body was divided before ([`SetupRanks::files`]), every rank
    /// reads its part, and none the mesh.
    ///
    /// # Errors
    /// As for [`Setup::new`]. On other ranks than the first one, [`SimulationError::OtherRank`] if that one failed.
    /// [`SimulationError::Input`] on a rank that cannot read its part from a file; the others do not know of it.
    pub fn with_material(
        context: B::Context,
        case: Case,
        ranks: &dyn SetupRanks,
        material: impl FnOnce(Materials, &Mesh) -> Result<(M, Vec<String>), LibraryError>,
    ) -> Result<Self, SimulationError<B::Error>> {
        if ranks.rank() > 0 || ranks.files().is_some() {
            return Self::received(context, case, ranks, material);
        }
        let rves_wait = case.materials().is_none();
        let set_up = Self::read(context, case, ranks, material);
        if set_up.is_err() && !ranks.are_files() {
            send_failure(ranks, rves_wait);
        }
        set_up
    }

    /// Sets up the case on the rank that reads the mesh, and sends the others their parts.
    fn read(
        context: B::Context,
        case: Case,
        ranks: &dyn SetupRanks,
        material: impl FnOnce(Materials, &Mesh) -> Result<(M, Vec<String>), LibraryError>,
    ) -> Result<Self, SimulationError<B::Error>> {
        let WholeBody { mesh: whole, conditions, boundary, materials, ranges, mut warnings } = WholeBody::read(&case)?;
        let unknowns = boundary.free_unknowns(whole.nodes().len());
        let fields = case.materials().is_none().then(|| MaterialFields::of(&materials, &case.folder()));
        let of_ranks = |count| Division::new(&whole, partition(&whole, count), count, boundary.node_groups());
        let division = (ranks.count() > 1).then(|| of_ranks(ranks.count()));
        let divide = |division| {
            let params = macro_scale::step_params(&case);
            BodyDivision::new::<B, _>(&whole, &boundary, &conditions, division, &params)
        };
        let divided = division.as_ref().map(divide).transpose().map_err(Box::new)?;
        let own_part = |divided: &BodyDivision<'_>| BodyPart::new(divided.piece(0), &conditions).transpose();
        let part = divided.as_ref().and_then(own_part).transpose().map_err(Box::new)?;
        if part.is_none() && ranks.are_files() {
            return Err(not_divisible(&case).into());
        }
        let mesh = part.as_ref().map_or(&whole, |part| &**part.mesh());
        let (field, network_warnings) = material(materials, mesh)?;
        let Plausibility { warnings: implausible, loads: load_sizes } =
            plausibility::check(&case, &whole, field.library());
        warnings.extend(implausible);
        warnings.extend(without_networks(&case));
        warnings.extend(macro_scale::imbalance(&case, &whole, &boundary));
        let has_condition = |name: &str| case.boundaries.iter().any(|boundary| boundary.surface == name);
        let surfaces = SurfacePlace::of_surfaces(&whole, has_condition);
        let rve_points = rve_points(&case, &whole);
        let is_partial = ranks.are_files() && fields.is_some();
        if is_partial {
            warnings.extend(plausibility::floppy_networks(&case, field.library(), Examination::Quick).warnings);
        }
        let of_whole =
            ranks.are_files().then(|| OfWhole { surfaces: surfaces.clone(), rve_points, warnings: warnings.clone() });
        warnings.extend(network_warnings);
        warnings.extend(idle_ranks(&case, rve_points, field.ranks()));
        if part.is_none() {
            warnings.extend(few_for_a_device(&case, &field.rve_counts().per_model));
        }
        let networks = if part.is_some() && case.output.rve != ElementSelection::None {
            rve_files::points(&case, &Sites::new(field.library(), &whole)?)?
        } else {
            rve_files::points(&case, field.sites())?
        };
        let hashes = (hash_of_mesh(&whole), hash_of_fields(field.library().regions()));
        send_fields(ranks, fields.as_ref())?;
        let common = CommonSetup { networks, unknowns, hashes };
        send_parts(ranks, divided.as_ref().filter(|_| part.is_some()), fields.as_ref(), &common, of_whole)?;
        drop(divided);
        let free_mode_supports = boundary.free_mode_supports().collect();
        Ok(Self {
            context,
            case,
            mesh: part.as_ref().map_or_else(|| Arc::new(whole), |part| Arc::clone(part.mesh())),
            hashes,
            surfaces,
            conditions,
            part,
            field,
            networks: common.networks,
            unknowns,
            free_mode_supports,
            ranges,
            load_sizes,
            warnings,
            has_all_networks: !is_partial,
        })
    }

    /// Sets up the part that the first rank sends.
    fn received(
        context: B::Context,
        case: Case,
        ranks: &dyn SetupRanks,
        material: impl FnOnce(Materials, &Mesh) -> Result<(M, Vec<String>), LibraryError>,
    ) -> Result<Self, SimulationError<B::Error>> {
        let other_rank = |reason: &str| SimulationError::OtherRank(reason.to_owned());
        let setup = match receive_setup(ranks)? {
            RankSetup::Failed => return Err(other_rank("the first rank of the body could not set it up")),
            RankSetup::Undivided => return Self::read(context, case, &(), material),
            RankSetup::Part(setup) => *setup,
        };
        let PartSetup { piece, fields, common: CommonSetup { networks, unknowns, hashes }, of_whole } = setup;
        let has_all_networks = of_whole.is_some() && fields.is_none();
        let conditions = macro_scale::conditions(&case);
        let part = BodyPart::new(piece, &conditions).map_err(Box::new)?;
        let part = part.ok_or_else(|| other_rank("the first rank divided a body that cannot be divided"))?;
        let materials = fields.map_or_else(|| case.materials(), |fields| fields.materials(&case));
        let materials = materials.ok_or_else(|| other_rank("the ranks have different cases"))?;
        let (field, network_warnings) = material(materials, part.mesh())?;
        let (mut surfaces, mut warnings) = (Vec::new(), Vec::new());
        if let Some(of_whole) = of_whole {
            (surfaces, warnings) = (of_whole.surfaces, of_whole.warnings);
            warnings.extend(network_warnings);
            warnings.extend(idle_ranks(&case, of_whole.rve_points, field.ranks()));
        }
        Ok(Self {
            context,
            case,
            mesh: Arc::clone(part.mesh()),
            hashes,
            surfaces,
            conditions,
            part: Some(part),
            field,
            networks,
            unknowns,
            free_mode_supports: Vec::new(),
            ranges: Vec::new(),
            load_sizes: Vec::new(),
            warnings,
            has_all_networks,
        })
    }

    /// Returns the nodes and components that are held because the case has `free = "rigid"`.
    pub fn free_mode_supports(&self) -> impl Iterator<Item = (u32, u8)> {
        self.free_mode_supports.iter().copied()
    }

    /// Returns the size of the problem, and the memory that a run on the threads of this process takes.
    ///
    /// # Errors
    /// Returns [`SimulationError`] if the linear system would be too large, or the backend does not have its solver.
    pub fn problem_size(&self) -> Result<(ProblemSize, MemoryForecast), SimulationError<B::Error>> {
        let (order, params) = (self.field.node_order(&self.mesh), macro_scale::step_params(&self.case));
        let boundary = macro_scale::boundary(&self.case, &self.mesh, &self.conditions)?;
        let constraints = self.conditions.constraints.len();
        let system = LinearSystem::new::<B>(&order, &self.mesh, &boundary, constraints, &params);
        let system = system.map_err(|error| Box::new(SetupError::from(error)))?;
        check_solver::<B>(&self.context, &system.solver).map_err(|error| Box::new(SetupError::from(error)))?;
        let size = ProblemSize::new(&self.case, &self.mesh, &self.field, self.unknowns, system.choice.as_ref());
        let memory = MemoryForecast::new(&self.case, &self.field, &self.mesh, &system, size.threads)
            .map_err(|error| Box::new(SetupError::from(error)))?;
        Ok((size, memory))
    }

    /// Returns the ranges of the material parameters and axes that vary over the body.
    pub fn field_ranges(&self) -> &[FieldRange] {
        &self.ranges
    }

    /// Returns the sizes of the tractions, pressures, point forces and body forces relative to the stiffness of their materials.
    pub fn load_sizes(&self) -> &[LoadSize] {
        &self.load_sizes
    }

    /// Finds the networks of regions without a matrix, or with a soft one, that have motions which no fiber resists: such
    /// equilibria take long to find. Factors a matrix for each network that is not too large, on the backend of the RVEs.
    /// Finds none on a rank that does not have all materials: the other ranks of a divided body, and those that read their
    /// parts from files where materials vary; [`Setup::warnings`] then has what was found when the body was divided.
    pub fn floppy_networks(&self, examination: Examination) -> FloppyNetworks {
        if !self.has_all_networks {
            return FloppyNetworks::default();
        }
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

    /// Returns a function that says, on another thread, what the RVEs are doing in an evaluation; `None` if this rank does not
    /// get to know it.
    pub fn progress_source(&self) -> Option<ProgressSource> {
        self.field.progress_source()
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
        let Self { context, case, mesh, hashes, surfaces, conditions, part, mut field, networks, warnings, .. } = self;
        field.forget_other_points();
        let params = macro_scale::step_params(&case);
        let stepper = match part {
            Some(part) => Stepper::on_part(&context, part, field, params),
            None => {
                let order = field.node_order(&mesh);
                Stepper::in_order(&order, &context, mesh, &conditions, field, params)
            }
        };
        let stepper = stepper.map_err(Box::new)?;
        let (lock, written) = (None, ResultsRecord::default());
        Ok(Simulation { case, stepper, hashes, surfaces, networks, warnings, lock, written })
    }
}

/// Makes the solver of a system of one unknown.
fn check_solver<B: RealBackend>(context: &B::Context, solver: &SolverParams) -> Result<(), SolveError<B::Error>> {
    let symbolic = B::analyze(context, &Arc::new(Sparsity::full(1, 1)), solver)?;
    B::solver(&symbolic).map(|_| ())
}

/// Returns the error of a division of a body that ranks cannot divide.
fn not_divisible(case: &Case) -> InputErrors {
    let problem = "its body cannot be divided: one of its loads has no `Load::on_part`";
    InputError::in_file(&case.file, problem, "loads that can be divided", "run the case without a division").into()
}

/// Returns the number of integration points that may have an RVE.
fn rve_points(case: &Case, mesh: &Mesh) -> usize {
    let has_rves = |name: &String| {
        let region = case.region_of(name).map(|region| &case.regions[region].material);
        matches!(region, Some(RegionMaterial::FiberRve(_)))
    };
    let has_rves: Vec<bool> = mesh.regions().iter().map(has_rves).collect();
    let points = |element: usize| mesh.points().of_element(element).len();
    let elements = mesh.region_of().iter().enumerate().filter(|&(_, &region)| has_rves[region as usize]);
    elements.map(|(element, _)| points(element)).sum()
}

/// Returns a warning if there are more ranks for RVEs than integration points that may have one.
fn idle_ranks(case: &Case, points: usize, [of_body, of_rves]: [usize; 2]) -> Option<String> {
    // There is at least one rank for RVEs.
    (of_rves > points.max(1)).then(|| {
        let rves = if points == 0 { "none".to_owned() } else { format!("at most {points}") };
        let (file, ranks) = (case.file.display(), of_body + of_rves);
        format!(
            "{file}: {of_rves} of {ranks} ranks are for RVEs, of which the case has {rves}: fewer ranks are as fast"
        )
    })
}

/// Returns a warning if one core solves the RVEs of every network faster than a device.
fn few_for_a_device(case: &Case, rves: &[usize]) -> Option<String> {
    /// At least so many networks take one core, with lanes, as long as a device; `docs/cuda.md` has measurements.
    const LEAST: usize = 100;
    let (device, most) = (case.micro.device?, rves.iter().max()?);
    (*most < LEAST).then(|| {
        format!(
            "{}: `device = \"{}\"` in [micro]: a device pays from {LEAST} to 300 RVEs of a network per core on, and the largest \
             number of RVEs of a network is {most}: set `device = \"none\"`",
            case.file.display(),
            device.name()
        )
    })
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
