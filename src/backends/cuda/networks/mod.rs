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
//!
//! [`NetworkResult`]: crate::backends::networks::NetworkResult
//! [`Status`]: crate::backends::networks::Status

#[cfg(test)]
pub(crate) mod emulation;
mod incidents;
mod layout;
mod memory;
mod queue;

use super::{CudaError, Device};
use crate::backends::networks::{
    BatchParams, LawData, MODES, NetworkData, NetworkResults, NetworkStates, Plan, RESULT_LEN, STEPS_OF_CONTINUATION,
    TileShape,
};
use incidents::{incidents, sizes};
use layout::{BLOCK_THREADS, Uniform, Variant};
use memory::{Networks, Scratch};
use queue::{Kernel, Memory, Queue};

/// The tiles of the factorization. Of the shapes whose sums fit into the registers, this one was the fastest on an H200;
/// `docs/cuda.md` has the measurements.
const TILE: TileShape = TileShape { columns: 3, rows: 2, panels: None };

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
    /// The most networks that [`NetworkBatch::make_room`] makes room for.
    limit: usize,
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
    pub(crate) fn emulated(
        network: &NetworkData,
        keeps_sensitivities: bool,
        device: emulation::EmulatedDevice,
    ) -> Option<Self> {
        let variant = Variant { tile: TILE, only_law: LawData::only(&network.laws) };
        let queue = Queue::Emulated(std::sync::Arc::new(emulation::Emulation::new(variant, device)?));
        Some(Self::on(queue, network, keeps_sensitivities).unwrap())
    }

    fn on(queue: Queue, network: &NetworkData, keeps_sensitivities: bool) -> Result<Self, CudaError> {
        let plan = Plan::new(network, TILE);
        let incidents = incidents(&plan, network.interior + network.boundary.len());
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
            fiber_ends: index(plan.ends.as_flattened())?,
            fiber_sizes: number(&sizes(network))?,
            fiber_laws: index(&network.law_of)?,
            laws: number(&network.laws.iter().flat_map(LawData::numbers).collect::<Vec<_>>())?,
            boundary: number(network.boundary.as_flattened())?,
            incidents: index(incidents.as_flattened())?,
            factor: index(&schedule.factor)?,
            forward: index(&schedule.forward)?,
            backward: index(&schedule.backward)?,
            order: index(&plan.order)?,
            interior: network.interior as u32,
            nodes: (network.interior + network.boundary.len()) as u32,
            fibers: network.ends.len() as u32,
            blocks: schedule.blocks() as u32,
            pairs: plan.pairs.len() as u32,
            tiles: schedule.tiles as u32,
            inner_ends: incidents.iter().filter(|[node, ..]| (*node as usize) < network.interior).count() as u32,
            ends: incidents.len() as u32,
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
            limit: usize::MAX,
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

    /// Bytes of device memory for each network.
    pub fn bytes_per_network(&self) -> usize {
        let (interior, sensitivities) = (self.uniform.interior as usize, self.sensitivities());
        2 * (size_of::<f64>() * (9 + 3 * interior + 9 + 3 * interior + RESULT_LEN) + size_of::<f32>() * sensitivities)
    }

    /// Bytes of page-locked memory of the host for each network with this number of interior nodes.
    pub fn host_bytes_per_network(interior: usize, keeps_sensitivities: bool) -> usize {
        let of_sensitivities = size_of::<f64>() + size_of::<f32>() * 3 * MODES * interior;
        let of_states = size_of::<f64>() * (9 + 3 * interior + 9 + RESULT_LEN);
        of_states + if keeps_sensitivities { of_sensitivities } else { 0 }
    }

    /// Bytes of device memory for each network that is being solved.
    pub fn bytes_per_thread(&self) -> usize {
        size_of::<f64>() * self.scratch_lengths().iter().sum::<usize>()
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
    /// [`Status::Continues`]: crate::backends::networks::Status::Continues
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
        assert_eq!(reached.len(), 3 * self.uniform.interior as usize * targets.len(), "the positions of all networks");
        if targets.is_empty() {
            return Ok(NetworkResults::default());
        }
        self.reserve_scratch(targets.len())?;
        let params = BatchParams { max_iterations: STEPS_OF_CONTINUATION, ..*params };
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
