//! Equilibria of many fiber networks at once, one thread of the device for each.
//!
//! All networks of a [`NetworkBatch`] have the same connectivity; each has its own positions and deformation gradient. The
//! kernels find equilibria by Newton's method with a line search, factor the stiffness in 3x3 blocks, prove with the
//! factor that an equilibrium is stable, and compute stress, energy and the sensitivities for the tangent. States stay on
//! the device until they are read; a solution transfers deformation gradients in and [`NetworkResult`]s out.
//!
//! The order of elimination and the operations of the factorization are computed once on the host and are data of the
//! kernels (`schedule.rs`). Numbers of 32 networks alternate in memory, so that the threads of a warp access contiguous
//! bytes. A network that needs more than Newton's method (its stiffness is not positive definite, the line search fails,
//! the iterations do not suffice) keeps its state and gets a [`Status`] that says so.

#[cfg(test)]
mod emulation;
mod layout;
mod queue;
mod result;
mod schedule;

use std::sync::Arc;

use cudarc::driver::{DeviceRepr, ValidAsZeroBits};

use super::{CudaError, Device};
use crate::backends::sparse::Sparse;
use crate::las::{Backend, SolverParams, Sparsity, Symmetry};
use layout::{BLOCK_THREADS, FIBER_LEN, INCIDENT_LEN, LANES, LAW_LEN, MODES, RESULT_LEN, Uniform, Variant};
use queue::{Kernel, Memory, Queue, Staging};
pub use result::{NetworkResult, NetworkResults, Status};
use schedule::{NONE, Schedule, TileShape};

/// The law of a fiber: the nominal stress as a function of the stretch, see `fiber::law`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LawData {
    /// The law in tension, and in compression if there is no buckling.
    pub formula: LawFormula,
    /// Residual stiffness and buckling strain.
    pub buckling: Option<(f64, f64)>,
}

/// The formula of a law.
#[derive(Clone, Copy, Debug, PartialEq)]
#[allow(missing_docs, reason = "the parameters are those of the laws of the same name")]
pub enum LawFormula {
    /// See `fiber::law::Linear`.
    Linear { youngs_modulus: f64 },
    /// See `fiber::law::Exponential`.
    Exponential { youngs_modulus: f64, nonlinearity: f64 },
    /// See `fiber::law::ExponentialStretch`.
    ExponentialStretch { youngs_modulus: f64, nonlinearity: f64, transition: f64 },
}

impl LawData {
    /// The number of the formula in the kernels.
    fn kind(&self) -> u32 {
        match self.formula {
            LawFormula::Linear { .. } => 0,
            LawFormula::Exponential { .. } => 1,
            LawFormula::ExponentialStretch { .. } => 2,
        }
    }

    fn numbers(&self) -> [f64; LAW_LEN] {
        let (e, b, transition) = match self.formula {
            LawFormula::Linear { youngs_modulus } => (youngs_modulus, 1.0, 1.0),
            LawFormula::Exponential { youngs_modulus, nonlinearity } => (youngs_modulus, nonlinearity, 1.0),
            LawFormula::ExponentialStretch { youngs_modulus, nonlinearity, transition } => {
                (youngs_modulus, nonlinearity, transition)
            }
        };
        let (residual, strain) = self.buckling.unwrap_or((1.0, 1.0));
        let buckles = f64::from(u8::from(self.buckling.is_some()));
        [f64::from(self.kind()), e, b, transition, buckles, residual, strain, e / b, 1.0 / e, 1.0 / strain]
    }

    /// Returns the kind of all laws, if it is the same and none of them buckles.
    fn only(laws: &[Self]) -> Option<u32> {
        let kind = laws.first()?.kind();
        laws.iter().all(|law| law.kind() == kind && law.buckling.is_none()).then_some(kind)
    }
}

/// The network that all members of a batch share.
#[derive(Clone, Debug)]
pub struct NetworkData {
    /// Number of interior nodes, which move; they have the first numbers.
    pub interior: usize,
    /// Reference positions of the boundary nodes, which follow the deformation gradient.
    pub boundary: Vec<[f64; 3]>,
    /// The two nodes of each fiber.
    pub ends: Vec<[u32; 2]>,
    /// The reference length of each fiber.
    pub lengths: Vec<f64>,
    /// The cross-sectional area of each fiber.
    pub areas: Vec<f64>,
    /// The law of each fiber, an index into `laws`.
    pub law_of: Vec<u32>,
    /// The laws.
    pub laws: Vec<LawData>,
}

/// Tolerances and limits of a solution; see [`NewtonParams`](crate::las::NewtonParams).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BatchParams {
    /// Residual norm relative to the forces of all nodes at convergence.
    pub tolerance: f64,
    /// Residual norm, in N, at which a network has converged in any case.
    pub floor: f64,
    /// Most iterations.
    pub max_iterations: u32,
    /// Most reductions of the step length.
    pub max_backtracks: u32,
    /// The constant of the sufficient-decrease condition.
    pub sufficient_decrease: f64,
    /// Iterates in the sufficient-decrease condition, 1 to 8.
    pub memory: u32,
    /// Ratio of the nominal stress of a fiber and its modulus at which the solution stops.
    pub excessive_force: f64,
    /// Whether the results have the form of the tangent.
    pub wants_tangent: bool,
}

/// The states of networks, one after the other, in memory of the host that the device accesses.
#[derive(Debug)]
pub struct NetworkStates<'a> {
    /// The deformation gradient of each state, row by row.
    pub gradients: &'a mut [[f64; 9]],
    /// The positions of the interior nodes, three numbers each.
    pub positions: &'a mut [f64],
    /// Eighteen numbers for each interior node: the sensitivities of its position to the six unit strains, minus those of
    /// the affine motion. Empty if the batch keeps none.
    pub sensitivities: &'a mut [f32],
    /// 1 for each network whose next start is predicted from its sensitivities, else 0. Empty if the batch keeps none.
    pub predicts: &'a mut [f64],
}

/// Many networks on a device.
pub struct NetworkBatch {
    queue: Queue,
    /// The addresses and counts of the network.
    uniform: Uniform,
    /// What the addresses refer to.
    _network: (Vec<Memory<u32>>, Vec<Memory<f64>>),
    operations: f64,
    bytes_of_factorization: f64,
    keeps_sensitivities: bool,
    networks: Option<Networks>,
    scratch: Option<Scratch>,
}

/// The memory of the host for the states, targets and results of networks.
struct Host {
    gradients: Staging<f64>,
    positions: Staging<f64>,
    sensitivities: Staging<f32>,
    predicts: Staging<f64>,
    targets: Staging<f64>,
    results: Staging<f64>,
}

/// The memory of the networks: whole tiles.
struct Networks {
    /// Networks that fit.
    capacity: usize,
    /// Networks that have a state.
    count: usize,
    /// In the caller's order: gradients, positions, targets, positions to reach, results.
    caller: [Memory<f64>; 5],
    caller_sensitivities: Memory<f32>,
    /// By tiles: gradients, positions, whether the start is predicted, targets, positions to reach, results.
    tiles: [Memory<f64>; 6],
    sensitivities: Memory<f32>,
    host: Host,
}

/// The memory of the threads that solve.
struct Scratch {
    threads: usize,
    arrays: [Memory<f64>; 7],
}

impl NetworkBatch {
    /// Makes an empty batch on a device. With `keeps_sensitivities`, solutions start from a first-order prediction.
    ///
    /// # Errors
    /// Returns the error of the device, for example if the network does not fit into its memory.
    ///
    /// # Panics
    /// Panics if the lists of the network have different lengths, or if a fiber has a node or a law that does not exist.
    pub fn new(device: &Device, network: &NetworkData, keeps_sensitivities: bool) -> Result<Self, CudaError> {
        let variant = Variant { tile: TILE, only_law: LawData::only(&network.laws) };
        Self::on(Queue::on(device, variant)?, network, keeps_sensitivities)
    }

    /// Makes an empty batch whose kernels run on the processor; `None` without a C++ compiler.
    #[cfg(test)]
    pub(crate) fn emulated(network: &NetworkData, keeps_sensitivities: bool) -> Option<Self> {
        let variant = Variant { tile: TILE, only_law: LawData::only(&network.laws) };
        let queue = Queue::Emulated(Arc::new(emulation::Emulation::new(variant)?));
        Some(Self::on(queue, network, keeps_sensitivities).unwrap())
    }

    fn on(queue: Queue, network: &NetworkData, keeps_sensitivities: bool) -> Result<Self, CudaError> {
        let plan = Plan::new(network, TILE);
        let mut indices = Vec::new();
        let mut numbers = Vec::new();
        let mut index = |values: &[u32]| -> Result<u64, CudaError> {
            let memory = queue.copy_of(values)?;
            let address = queue.address(&memory);
            indices.push(memory);
            Ok(address)
        };
        let mut number = |values: &[f64]| -> Result<u64, CudaError> {
            let memory = queue.copy_of(values)?;
            let address = queue.address(&memory);
            numbers.push(memory);
            Ok(address)
        };
        let schedule = &plan.schedule;
        let uniform = Uniform {
            fiber_ends: index(&plan.ends)?,
            fiber_sizes: number(&plan.sizes)?,
            fiber_laws: index(&network.law_of)?,
            laws: number(&network.laws.iter().flat_map(LawData::numbers).collect::<Vec<_>>())?,
            boundary: number(network.boundary.as_flattened())?,
            incidents: index(plan.incidents.as_flattened())?,
            factor: index(&schedule.factor)?,
            forward: index(&schedule.forward)?,
            backward: index(&schedule.backward)?,
            order: index(&plan.order)?,
            interior: network.interior as u32,
            nodes: (network.interior + network.boundary.len()) as u32,
            fibers: network.ends.len() as u32,
            blocks: schedule.blocks() as u32,
            pairs: plan.pairs as u32,
            tiles: schedule.tiles as u32,
            inner_ends: plan.inner_ends as u32,
            ends: plan.incidents.len() as u32,
            ..Uniform::default()
        };
        Ok(Self {
            queue,
            uniform,
            _network: (indices, numbers),
            operations: schedule.operations(),
            bytes_of_factorization: plan.bytes_of_factorization(),
            keeps_sensitivities,
            networks: None,
            scratch: None,
        })
    }

    /// Number of networks that have a state.
    pub fn len(&self) -> usize {
        self.networks.as_ref().map_or(0, |networks| networks.count)
    }

    /// Returns true if no network has a state.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Floating-point operations of one factorization.
    pub fn operations(&self) -> f64 {
        self.operations
    }

    /// Bytes that a factorization reads and writes if nothing but its sums stays in registers.
    pub fn bytes_of_factorization(&self) -> f64 {
        self.bytes_of_factorization
    }

    /// Numbers of the sensitivities of a network.
    fn sensitivities(&self) -> usize {
        if self.keeps_sensitivities { 3 * MODES * self.uniform.interior as usize } else { 0 }
    }

    /// How many networks the device solves at the same time, if its memory holds them.
    ///
    /// # Errors
    /// Returns the error of the device.
    pub fn at_once(&self) -> Result<usize, CudaError> {
        self.queue.resident_threads(Kernel::Equilibrate)
    }

    /// Bytes of device memory for each network.
    pub fn bytes_per_network(&self) -> usize {
        let (interior, sensitivities) = (self.uniform.interior as usize, self.sensitivities());
        2 * (size_of::<f64>() * (9 + 3 * interior + 9 + 3 * interior + RESULT_LEN) + size_of::<f32>() * sensitivities)
    }

    /// Bytes of device memory for each network that is being solved.
    pub fn bytes_per_thread(&self) -> usize {
        size_of::<f64>() * self.scratch_lengths().iter().sum::<usize>()
    }

    /// Numbers of the arrays of a thread, in the order of [`Scratch::arrays`].
    fn scratch_lengths(&self) -> [usize; 7] {
        let Uniform { interior, pairs, blocks, .. } = self.uniform;
        let (interior, pairs, blocks) = (interior as usize, pairs as usize, blocks as usize);
        let vector = 3 * interior;
        [vector, vector, 6 * interior, 6 * pairs, 6 * interior, 9 * (blocks + 1), MODES * vector]
    }

    /// Replaces all networks by `count` others, whose states `write` sets.
    ///
    /// # Errors
    /// Returns the error of the device, for example if its memory does not suffice.
    pub fn set_states(&mut self, count: usize, write: impl FnOnce(NetworkStates<'_>)) -> Result<(), CudaError> {
        self.reserve(count)?;
        let (interior, sensitivities) = (self.uniform.interior as usize, self.sensitivities());
        let Some(networks) = &mut self.networks else { return Ok(()) };
        let host = &mut networks.host;
        write(host.states(count, interior, sensitivities)?);
        let [gradients, positions, ..] = &mut networks.caller;
        self.queue.write(&host.gradients.values()?[..9 * count], gradients)?;
        self.queue.write(&host.positions.values()?[..3 * interior * count], positions)?;
        if self.keeps_sensitivities {
            let values = &host.sensitivities.values()?[..sensitivities * count];
            self.queue.write(values, &mut networks.caller_sensitivities)?;
            self.queue.write(&host.predicts.values()?[..count], &mut networks.tiles[2])?;
        }
        let uniform = self.of_networks(count);
        self.run(Kernel::TakeStates, &uniform, count)
    }

    /// Passes the states of all networks to `read`.
    ///
    /// # Errors
    /// Returns the error of the device.
    pub fn read_states<R>(&mut self, read: impl FnOnce(NetworkStates<'_>) -> R) -> Result<Option<R>, CudaError> {
        let (count, interior, sensitivities) = (self.len(), self.uniform.interior as usize, self.sensitivities());
        self.run(Kernel::GiveStates, &self.of_networks(count), count)?;
        let Some(networks) = &mut self.networks else { return Ok(None) };
        let host = &mut networks.host;
        let [gradients, positions, ..] = &networks.caller;
        self.queue.read(gradients, &mut host.gradients.values()?[..9 * count])?;
        self.queue.read(positions, &mut host.positions.values()?[..3 * interior * count])?;
        if self.keeps_sensitivities {
            let values = &mut host.sensitivities.values()?[..sensitivities * count];
            self.queue.read(&networks.caller_sensitivities, values)?;
            self.queue.read(&networks.tiles[2], &mut host.predicts.values()?[..count])?;
        }
        Ok(Some(read(host.states(count, interior, sensitivities)?)))
    }

    /// Finds the equilibria of the first networks at these deformation gradients, given row by row; an equilibrium becomes
    /// the state of its network.
    ///
    /// # Errors
    /// Returns the error of the device; the states are then undefined.
    ///
    /// # Panics
    /// Panics if there are more gradients than networks.
    pub fn solve(&mut self, targets: &[[f64; 9]], params: &BatchParams) -> Result<NetworkResults<'_>, CudaError> {
        self.reserve_scratch(targets.len())?;
        let uniform = self.prepare(targets, None, params)?;
        let Some(scratch) = &self.scratch else { return Ok(NetworkResults::default()) };
        for first in (0..targets.len()).step_by(scratch.threads) {
            let threads = scratch.threads.min(targets.len() - first);
            let uniform = Uniform { first: first as u64, ..uniform };
            self.run(Kernel::Equilibrate, &uniform, threads)?;
            self.run(Kernel::Condense, &uniform, threads)?;
        }
        self.results(&uniform, targets.len())
    }

    /// Tests for the first networks whether Newton leads from their states, moved affinely to these deformation gradients,
    /// to the equilibria whose interior positions are given, network after network: [`Status::Continues`] if it
    /// evidently does. States do not change.
    ///
    /// # Errors
    /// Returns the error of the device.
    ///
    /// # Panics
    /// Panics if there are more gradients than networks, or not three coordinates for each interior node.
    pub fn continues(
        &mut self,
        targets: &[[f64; 9]],
        reached: &[f64],
        params: &BatchParams,
    ) -> Result<NetworkResults<'_>, CudaError> {
        /// Most Newton steps of the test.
        const STEPS: u32 = 3;
        assert_eq!(reached.len(), 3 * self.uniform.interior as usize * targets.len(), "the positions of all networks");
        self.reserve_scratch(targets.len())?;
        let params = BatchParams { max_iterations: STEPS, ..*params };
        let uniform = self.prepare(targets, Some(reached), &params)?;
        let Some(scratch) = &self.scratch else { return Ok(NetworkResults::default()) };
        for first in (0..targets.len()).step_by(scratch.threads) {
            let uniform = Uniform { first: first as u64, ..uniform };
            self.run(Kernel::Equilibrate, &uniform, scratch.threads.min(targets.len() - first))?;
        }
        self.results(&uniform, targets.len())
    }

    /// Copies targets to the device.
    fn prepare(
        &mut self,
        targets: &[[f64; 9]],
        reached: Option<&[f64]>,
        params: &BatchParams,
    ) -> Result<Uniform, CudaError> {
        assert!(targets.len() <= self.len(), "a state for each target");
        assert!((1..=8).contains(&params.memory), "1 to 8 iterates in the sufficient-decrease condition");
        let Some(networks) = &mut self.networks else { return Ok(self.uniform) };
        let host = &mut networks.host.targets.values()?[..9 * targets.len()];
        host.copy_from_slice(targets.as_flattened());
        self.queue.write(host, &mut networks.caller[2])?;
        self.queue.write(reached.unwrap_or_default(), &mut networks.caller[3])?;
        let mut uniform = self.of_networks(targets.len());
        if reached.is_none() {
            (uniform.reached, uniform.caller_reached) = (0, 0);
        }
        let BatchParams { tolerance, floor, max_iterations, max_backtracks, .. } = *params;
        let BatchParams { sufficient_decrease, memory, excessive_force, wants_tangent, .. } = *params;
        let wants_tangent = u32::from(wants_tangent);
        let uniform = Uniform { tolerance, floor, max_iterations, max_backtracks, sufficient_decrease, ..uniform };
        let uniform = Uniform { memory, excessive_force, wants_tangent, ..uniform };
        self.run(Kernel::TakeTargets, &uniform, targets.len())?;
        Ok(uniform)
    }

    fn results(&mut self, uniform: &Uniform, count: usize) -> Result<NetworkResults<'_>, CudaError> {
        self.run(Kernel::GiveResults, uniform, count)?;
        let Some(networks) = &mut self.networks else { return Ok(NetworkResults::default()) };
        let host = &mut networks.host.results.values()?[..RESULT_LEN * count];
        self.queue.read(&networks.caller[4], host)?;
        Ok(NetworkResults::new(host))
    }

    fn run(&self, kernel: Kernel, uniform: &Uniform, threads: usize) -> Result<(), CudaError> {
        if threads == 0 {
            return Ok(());
        }
        // SAFETY: the addresses are those of memory of this batch, whose lengths `reserve` and `reserve_scratch` choose
        // for these counts; the stream frees memory only after the kernels before it.
        unsafe { self.queue.launch(kernel, uniform, threads) }
    }

    /// Returns the data of the kernels for the first networks.
    fn of_networks(&self, count: usize) -> Uniform {
        let mut uniform = Uniform { networks: count as u64, ..self.uniform };
        if let Some(Networks { caller, caller_sensitivities, tiles, sensitivities, .. }) = &self.networks {
            let [gradients, positions, targets, reached, results] = caller.each_ref().map(|m| self.queue.address(m));
            (uniform.caller_gradients, uniform.caller_positions, uniform.caller_targets) =
                (gradients, positions, targets);
            (uniform.caller_reached, uniform.caller_results) = (reached, results);
            let [gradients, positions, predicts, targets, reached, results] =
                tiles.each_ref().map(|m| self.queue.address(m));
            (uniform.gradients, uniform.positions, uniform.targets) = (gradients, positions, targets);
            (uniform.reached, uniform.results) = (reached, results);
            if self.keeps_sensitivities {
                uniform.caller_sensitivities = self.queue.address(caller_sensitivities);
                uniform.sensitivities = self.queue.address(sensitivities);
                uniform.has_sensitivities = predicts;
            }
        }
        if let Some(Scratch { arrays, .. }) = &self.scratch {
            let [trial, direction, stiffness, edges, diagonal, lower, modes] =
                arrays.each_ref().map(|m| self.queue.address(m));
            (uniform.trial, uniform.direction, uniform.stiffness) = (trial, direction, stiffness);
            (uniform.edges, uniform.diagonal, uniform.lower) = (edges, diagonal, lower);
            uniform.modes = modes;
        }
        uniform
    }

    /// Allocates memory for this number of networks.
    fn reserve(&mut self, count: usize) -> Result<(), CudaError> {
        if self.networks.as_ref().is_some_and(|networks| networks.capacity >= count) || count == 0 {
            if let Some(networks) = &mut self.networks {
                networks.count = count;
            }
            return Ok(());
        }
        // The scratch memory may take nearly all memory; it is allocated again for what the networks leave.
        (self.networks, self.scratch) = (None, None);
        let capacity = count.next_multiple_of(LANES);
        let interior = self.uniform.interior as usize;
        let of_sensitivities = self.sensitivities();
        let of_predicts = if self.keeps_sensitivities { capacity } else { 0 };
        let host = Host {
            gradients: self.queue.staging(9 * capacity)?,
            positions: self.queue.staging(3 * interior * capacity)?,
            sensitivities: self.queue.staging(of_sensitivities * capacity)?,
            predicts: self.queue.staging(of_predicts)?,
            targets: self.queue.staging(9 * capacity)?,
            results: self.queue.staging(RESULT_LEN * capacity)?,
        };
        let numbers = |per_network: usize| self.queue.zeros::<f64>(per_network * capacity);
        let singles = || self.queue.zeros::<f32>(of_sensitivities * capacity);
        self.networks = Some(Networks {
            capacity,
            count,
            caller: arrays([9, 3 * interior, 9, 3 * interior, RESULT_LEN], numbers)?,
            caller_sensitivities: singles()?,
            tiles: arrays([9, 3 * interior, 1, 9, 3 * interior, RESULT_LEN], numbers)?,
            sensitivities: singles()?,
            host,
        });
        Ok(())
    }

    /// Allocates memory for as many threads as the device executes at the same time, as its memory holds, or as there are
    /// networks.
    fn reserve_scratch(&mut self, networks: usize) -> Result<(), CudaError> {
        let wanted = self.queue.resident_threads(Kernel::Equilibrate)?.min(networks.next_multiple_of(BLOCK_THREADS));
        if self.scratch.as_ref().is_some_and(|scratch| scratch.threads >= wanted) {
            return Ok(());
        }
        self.scratch = None;
        let fitting = (0.9 * self.queue.free_bytes()? as f64) as usize / self.bytes_per_thread().max(1);
        let mut threads = wanted.min((fitting / BLOCK_THREADS).max(1) * BLOCK_THREADS);
        let lengths = self.scratch_lengths();
        let arrays = loop {
            match arrays(lengths, |per_thread| self.queue.zeros(per_thread * threads)) {
                // Another batch may have taken memory in the meantime.
                Err(_) if threads > BLOCK_THREADS => threads = (threads / 2).next_multiple_of(BLOCK_THREADS),
                arrays => break arrays?,
            }
        };
        self.scratch = Some(Scratch { threads, arrays });
        Ok(())
    }
}

impl Host {
    fn states(&mut self, count: usize, interior: usize, sensitivities: usize) -> Result<NetworkStates<'_>, CudaError> {
        let predicts = if sensitivities > 0 { count } else { 0 };
        Ok(NetworkStates {
            gradients: self.gradients.values()?[..9 * count].as_chunks_mut().0,
            positions: &mut self.positions.values()?[..3 * interior * count],
            sensitivities: &mut self.sensitivities.values()?[..sensitivities * count],
            predicts: &mut self.predicts.values()?[..predicts],
        })
    }
}

fn arrays<T: DeviceRepr + ValidAsZeroBits, const N: usize>(
    lengths: [usize; N],
    make: impl Fn(usize) -> Result<Memory<T>, CudaError>,
) -> Result<[Memory<T>; N], CudaError> {
    let mut made = Vec::with_capacity(N);
    for length in lengths {
        made.push(make(length)?);
    }
    made.try_into().map_err(|_| unreachable!("one array for each length"))
}

impl std::fmt::Debug for NetworkBatch {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("NetworkBatch").field("networks", &self.len()).finish_non_exhaustive()
    }
}

/// The tiles of the factorization. Of the shapes whose sums fit into the registers, this one was the fastest on an H200;
/// `docs/cuda.md` has the measurements.
const TILE: TileShape = TileShape { columns: 3, rows: 2 };

/// A network with its nodes in the order of elimination.
struct Plan {
    /// By place in the order: the interior node.
    order: Vec<u32>,
    ends: Vec<u32>,
    sizes: Vec<f64>,
    /// The ends of the fibers, node after node, as `kernel.cu` stores them; those of interior nodes come first.
    incidents: Vec<[u32; INCIDENT_LEN]>,
    /// Ends of fibers at interior nodes.
    inner_ends: usize,
    /// Pairs of interior nodes that fibers connect.
    pairs: usize,
    schedule: Schedule,
}

impl Plan {
    fn new(network: &NetworkData, shape: TileShape) -> Self {
        let NetworkData { interior, boundary, ends, lengths, areas, law_of, laws } = network;
        let nodes = interior + boundary.len();
        assert!(ends.as_flattened().iter().all(|&node| (node as usize) < nodes), "the nodes of the fibers exist");
        assert!(law_of.iter().all(|&law| (law as usize) < laws.len()), "the laws of the fibers exist");
        let fibers = ends.len();
        assert!([lengths.len(), areas.len(), law_of.len()] == [fibers; 3], "one entry for each fiber");
        let order = elimination_order(*interior, ends);
        let mut number: Vec<u32> = (0..nodes as u32).collect();
        for (place, &node) in order.iter().enumerate() {
            number[node as usize] = place as u32;
        }
        let ends: Vec<[u32; 2]> = ends.iter().map(|ends| ends.map(|node| number[node as usize])).collect();
        let is_interior = |node: u32| (node as usize) < *interior;
        let mut pairs: Vec<[u32; 2]> = ends
            .iter()
            .filter(|[a, b]| is_interior(*a) && is_interior(*b) && a != b)
            .map(|&[a, b]| [a.min(b), a.max(b)])
            .collect();
        pairs.sort_unstable();
        pairs.dedup();
        let size = |(&length, &area): (&f64, &f64)| -> [f64; FIBER_LEN] {
            [length, 1.0 / length, area, area / length, area * length]
        };
        let incidents = incidents(nodes, &ends, &pairs);
        Self {
            inner_ends: incidents.iter().filter(|[node, ..]| is_interior(*node)).count(),
            incidents,
            sizes: lengths.iter().zip(areas).flat_map(size).collect(),
            schedule: Schedule::new(*interior, &pairs, shape),
            pairs: pairs.len(),
            ends: ends.into_flattened(),
            order,
        }
    }

    /// Returns the bytes that a factorization reads and writes.
    fn bytes_of_factorization(&self) -> f64 {
        let (block, diagonal, vector) = (9, 6, 3);
        let (nodes, blocks) = (self.order.len(), self.schedule.blocks());
        let read = diagonal * (nodes + self.pairs) + vector * (nodes + blocks) + block * self.schedule.reads();
        let written = block * blocks + (diagonal + vector) * nodes;
        (size_of::<f64>() * (read + written)) as f64
    }
}

/// Returns the ends of the fibers, node after node: the node, the node at the other end, the fiber, the pair of nodes to
/// which this end adds the stiffness of the fiber, whether the fiber is the first of the pair, and whether the end is the
/// last of its node.
fn incidents(nodes: usize, ends: &[[u32; 2]], pairs: &[[u32; 2]]) -> Vec<[u32; INCIDENT_LEN]> {
    let mut incidents = vec![Vec::new(); nodes];
    let mut is_known = vec![false; pairs.len()];
    for (fiber, &[a, b]) in (0..).zip(ends) {
        let pair = pairs.binary_search(&[a.min(b), a.max(b)]).ok();
        for (node, other) in [(a, b), (b, a)] {
            let adds = pair.filter(|_| node < other);
            let is_first = adds.is_some_and(|pair| !std::mem::replace(&mut is_known[pair], true));
            let pair = adds.map_or(NONE, |pair| pair as u32);
            incidents[node as usize].push([node, other, fiber, pair, u32::from(is_first), 0]);
        }
    }
    for [.., is_last] in incidents.iter_mut().filter_map(|of_node| of_node.last_mut()) {
        *is_last = 1;
    }
    incidents.concat()
}

/// Returns the order in which the backend `sparse` eliminates the nodes.
fn elimination_order(interior: usize, ends: &[[u32; 2]]) -> Vec<u32> {
    let unknowns = |node: u32| {
        let first = if (node as usize) < interior { 3 * node as i32 } else { -3 };
        [first, first + 1, first + 2].map(|unknown| unknown.max(-1))
    };
    let elements = ends.iter().map(|ends| ends.map(unknowns).concat());
    let pattern = Sparsity::from_elements(3 * interior, elements.collect::<Vec<_>>());
    let symbolic = pattern.ok().and_then(|pattern| {
        Sparse::<f64>::analyze(&(), &Arc::new(pattern), &SolverParams::new(Symmetry::Definite)).ok()
    });
    match symbolic {
        Some(symbolic) => symbolic.order().iter().step_by(3).map(|&unknown| unknown / 3).collect(),
        None => (0..interior as u32).collect(),
    }
}
