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

mod data;
#[cfg(test)]
mod emulation;
mod layout;
mod plan;
mod queue;
mod result;
mod schedule;

use super::{CudaError, Device};
pub use data::{BatchParams, LawData, LawFormula, NetworkData, NetworkStates};
use layout::{BLOCK_THREADS, LANES, MODES, RESULT_LEN, Uniform, Variant};
use plan::{Plan, TILE};
use queue::{Kernel, Memory, Queue, Staging};
pub use result::{NetworkResult, NetworkResults, Status};

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

/// The memory of the networks.
struct Networks {
    /// Networks that fit.
    capacity: usize,
    /// Networks that have a state.
    count: usize,
    in_order: InOrder,
    in_tiles: InTiles,
    host: Host,
}

/// What is copied from and to the host: the numbers of the networks one after the other.
struct InOrder {
    gradients: Memory<f64>,
    positions: Memory<f64>,
    sensitivities: Memory<f32>,
    targets: Memory<f64>,
    reached: Memory<f64>,
    results: Memory<f64>,
}

/// What the kernels work with: the numbers of the networks of a tile alternate.
struct InTiles {
    gradients: Memory<f64>,
    positions: Memory<f64>,
    sensitivities: Memory<f32>,
    predicts: Memory<f64>,
    targets: Memory<f64>,
    reached: Memory<f64>,
    results: Memory<f64>,
}

/// The memory of the threads that solve: the arrays of [`NetworkBatch::scratch_lengths`], one after the other.
struct Scratch {
    threads: usize,
    /// The threads that it was made for, if the memory had sufficed.
    wanted: usize,
    memory: Memory<f64>,
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
        let queue = Queue::Emulated(std::sync::Arc::new(emulation::Emulation::new(variant)?));
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

    /// How many networks the device executes at the same time, if its memory holds them.
    ///
    /// # Errors
    /// Returns the error of the device.
    pub fn at_once(&self) -> Result<usize, CudaError> {
        Ok(self.queue.resident_threads(Kernel::Equilibrate)?.max(BLOCK_THREADS))
    }

    /// Allocates the memory for as many of `count` networks as fit, and returns how many: `count`, a half of it, a
    /// quarter, and so on; 0 if not even a few fit. Their states are undefined.
    ///
    /// # Errors
    /// Returns the error of the device, except that its memory does not suffice.
    pub fn make_room(&mut self, count: usize) -> Result<usize, CudaError> {
        let mut fitting = count;
        loop {
            match self.reserve(fitting).and_then(|()| self.reserve_scratch(fitting)) {
                Ok(()) => return Ok(fitting),
                Err(error) if error.is_out_of_memory() => {
                    (self.networks, self.scratch) = (None, None);
                    self.queue.wait()?;
                    fitting /= 2;
                    if fitting < BLOCK_THREADS {
                        return Ok(0);
                    }
                }
                Err(error) => return Err(error),
            }
        }
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

    /// Numbers of the arrays of a thread: positions, direction, diagonal and other blocks of the stiffness, diagonal and
    /// other blocks of the factor, modes.
    fn scratch_lengths(&self) -> [usize; 7] {
        let Uniform { interior, pairs, blocks, .. } = self.uniform;
        let (interior, pairs, blocks) = (interior as usize, pairs as usize, blocks as usize);
        let vector = 3 * interior;
        [vector, vector, 6 * interior, 6 * pairs, 6 * interior, 9 * (blocks + 1), MODES * vector]
    }

    /// Replaces all networks by `count` others, whose states `write` sets: all numbers, because the memory has old ones.
    ///
    /// # Errors
    /// Returns the error of the device, for example if its memory does not suffice; the states are then undefined.
    pub fn set_states(&mut self, count: usize, write: impl FnOnce(NetworkStates<'_>)) -> Result<(), CudaError> {
        self.reserve(count)?;
        self.queue.wait()?;
        let (interior, sensitivities) = (self.uniform.interior as usize, self.sensitivities());
        let Some(networks) = &mut self.networks else { return Ok(()) };
        let host = &mut networks.host;
        write(host.states(count, interior, sensitivities)?);
        let in_order = &mut networks.in_order;
        self.queue.write(&host.gradients.values()?[..9 * count], &mut in_order.gradients)?;
        self.queue.write(&host.positions.values()?[..3 * interior * count], &mut in_order.positions)?;
        if self.keeps_sensitivities {
            let predicts = &host.predicts.values()?[..count];
            self.queue.write(predicts, &mut networks.in_tiles.predicts)?;
            // Most bytes of a state are sensitivities; those that no start uses stay on the host.
            if predicts.iter().any(|&predicts| predicts != 0.0) {
                let values = &host.sensitivities.values()?[..sensitivities * count];
                self.queue.write(values, &mut in_order.sensitivities)?;
            }
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
        let in_order = &networks.in_order;
        self.queue.read(&in_order.gradients, &mut host.gradients.values()?[..9 * count])?;
        self.queue.read(&in_order.positions, &mut host.positions.values()?[..3 * interior * count])?;
        if self.keeps_sensitivities {
            let values = &mut host.sensitivities.values()?[..sensitivities * count];
            self.queue.read(&in_order.sensitivities, values)?;
            self.queue.read(&networks.in_tiles.predicts, &mut host.predicts.values()?[..count])?;
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
    /// Panics if there are more gradients than networks, or if [`BatchParams::memory`] is not 1 to 8.
    pub fn solve(&mut self, targets: &[[f64; 9]], params: &BatchParams) -> Result<NetworkResults<'_>, CudaError> {
        if targets.is_empty() {
            return Ok(NetworkResults::default());
        }
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
    /// As for [`NetworkBatch::solve`], and if there are not three coordinates for each interior node.
    pub fn continues(
        &mut self,
        targets: &[[f64; 9]],
        reached: &[f64],
        params: &BatchParams,
    ) -> Result<NetworkResults<'_>, CudaError> {
        /// Most Newton steps of the test.
        const STEPS: u32 = 3;
        assert_eq!(reached.len(), 3 * self.uniform.interior as usize * targets.len(), "the positions of all networks");
        if targets.is_empty() {
            return Ok(NetworkResults::default());
        }
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
        self.queue.wait()?;
        let Some(networks) = &mut self.networks else { return Ok(self.uniform) };
        let host = &mut networks.host.targets.values()?[..9 * targets.len()];
        host.copy_from_slice(targets.as_flattened());
        self.queue.write(host, &mut networks.in_order.targets)?;
        self.queue.write(reached.unwrap_or_default(), &mut networks.in_order.reached)?;
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
        self.queue.read(&networks.in_order.results, host)?;
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
        if let Some(Networks { in_order, in_tiles, .. }) = &self.networks {
            uniform.caller_gradients = self.queue.address(&in_order.gradients);
            uniform.caller_positions = self.queue.address(&in_order.positions);
            uniform.caller_targets = self.queue.address(&in_order.targets);
            uniform.caller_reached = self.queue.address(&in_order.reached);
            uniform.caller_results = self.queue.address(&in_order.results);
            uniform.gradients = self.queue.address(&in_tiles.gradients);
            uniform.positions = self.queue.address(&in_tiles.positions);
            uniform.targets = self.queue.address(&in_tiles.targets);
            uniform.reached = self.queue.address(&in_tiles.reached);
            uniform.results = self.queue.address(&in_tiles.results);
            if self.keeps_sensitivities {
                uniform.caller_sensitivities = self.queue.address(&in_order.sensitivities);
                uniform.sensitivities = self.queue.address(&in_tiles.sensitivities);
                uniform.has_sensitivities = self.queue.address(&in_tiles.predicts);
            }
        }
        if let Some(Scratch { threads, memory, .. }) = &self.scratch {
            let mut next = self.queue.address(memory);
            let [trial, direction, stiffness, edges, diagonal, lower, modes] = self.scratch_lengths().map(|length| {
                let address = next;
                next += (size_of::<f64>() * length * threads) as u64;
                address
            });
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
        // RVEs that are created one after the other must not cause an allocation each.
        let held = self.networks.as_ref().map_or(0, |networks| networks.capacity);
        let capacity = count.max(held + held / 2).next_multiple_of(LANES);
        // The scratch memory may take much of the memory; it is allocated again for what the networks leave. The device may
        // still work with both.
        self.queue.wait()?;
        (self.networks, self.scratch) = (None, None);
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
        let queue = &self.queue;
        let numbers = |per_network: usize| queue.zeros::<f64>(per_network * capacity);
        let singles = || queue.zeros::<f32>(of_sensitivities * capacity);
        let in_order = InOrder {
            gradients: numbers(9)?,
            positions: numbers(3 * interior)?,
            sensitivities: singles()?,
            targets: numbers(9)?,
            reached: numbers(3 * interior)?,
            results: numbers(RESULT_LEN)?,
        };
        let in_tiles = InTiles {
            gradients: numbers(9)?,
            positions: numbers(3 * interior)?,
            sensitivities: singles()?,
            predicts: numbers(1)?,
            targets: numbers(9)?,
            reached: numbers(3 * interior)?,
            results: numbers(RESULT_LEN)?,
        };
        self.networks = Some(Networks { capacity, count, in_order, in_tiles, host });
        Ok(())
    }

    /// Allocates memory for as many threads as there are networks, or as the memory holds.
    fn reserve_scratch(&mut self, networks: usize) -> Result<(), CudaError> {
        /// Threads of a kernel, relative to those that the device executes at the same time. When a block of threads has
        /// finished, the next one starts; only the last ones leave a part of the device idle.
        const OVERSUBSCRIPTION: usize = 12;
        /// Share of the free memory for more threads than the device executes at the same time, and for as many.
        const SHARES: [f64; 2] = [0.4, 0.7];
        let resident = self.queue.resident_threads(Kernel::Equilibrate)?;
        let all = networks.next_multiple_of(BLOCK_THREADS);
        let wanted = all.min(OVERSUBSCRIPTION * resident);
        if self.scratch.as_ref().is_some_and(|scratch| scratch.wanted >= wanted) {
            return Ok(());
        }
        self.scratch = None;
        // Memory is free once the device has finished what uses it.
        self.queue.wait()?;
        let free = self.queue.free_bytes()? as f64 / self.bytes_per_thread().max(1) as f64;
        let [of_many, of_few] = SHARES.map(|share| (share * free) as usize / BLOCK_THREADS * BLOCK_THREADS);
        let mut threads = wanted.min(of_many.max(resident.min(of_few)).max(BLOCK_THREADS));
        let length: usize = self.scratch_lengths().iter().sum();
        let memory = loop {
            match self.queue.zeros(length * threads) {
                // Another batch may have taken memory in the meantime.
                Err(error) if error.is_out_of_memory() && threads > BLOCK_THREADS => {
                    threads = (threads / 2).next_multiple_of(BLOCK_THREADS)
                }
                memory => break memory?,
            }
        };
        self.scratch = Some(Scratch { threads, wanted, memory });
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

impl Drop for NetworkBatch {
    fn drop(&mut self) {
        // The device may still access memory of the host. Nothing can be done about an error here.
        let _ = self.queue.wait();
    }
}

impl std::fmt::Debug for NetworkBatch {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("NetworkBatch").field("networks", &self.len()).finish_non_exhaustive()
    }
}
