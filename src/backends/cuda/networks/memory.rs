//! The memory of a batch, on the device and on the host.

use super::NetworkBatch;
use super::layout::{BLOCK_THREADS, LANES, Uniform};
use super::queue::{Kernel, Memory, Staging};
use crate::backends::cuda::CudaError;
use crate::backends::networks::{MODES, NetworkStates, RESULT_LEN};

/// The memory of the host for the states, targets and results of networks.
pub(super) struct Host {
    pub gradients: Staging<f64>,
    pub positions: Staging<f64>,
    pub sensitivities: Staging<f32>,
    pub predicts: Staging<f64>,
    pub targets: Staging<f64>,
    pub results: Staging<f64>,
}

/// The memory of the networks.
pub(super) struct Networks {
    /// Networks that fit.
    pub capacity: usize,
    /// Networks that have a state.
    pub count: usize,
    pub in_order: InOrder,
    pub in_tiles: InTiles,
    pub host: Host,
}

/// What is copied from and to the host: the numbers of the networks one after the other.
pub(super) struct InOrder {
    pub gradients: Memory<f64>,
    pub positions: Memory<f64>,
    pub sensitivities: Memory<f32>,
    pub targets: Memory<f64>,
    pub reached: Memory<f64>,
    pub results: Memory<f64>,
}

/// What the kernels work with: the numbers of the networks of a tile alternate.
pub(super) struct InTiles {
    pub gradients: Memory<f64>,
    pub positions: Memory<f64>,
    pub sensitivities: Memory<f32>,
    pub predicts: Memory<f64>,
    pub targets: Memory<f64>,
    pub reached: Memory<f64>,
    pub results: Memory<f64>,
}

/// The memory of the threads that solve: the arrays of [`NetworkBatch::scratch_lengths`], one after the other.
pub(super) struct Scratch {
    pub threads: usize,
    /// The threads that it was made for, if the memory had sufficed.
    pub wanted: usize,
    pub memory: Memory<f64>,
}

impl NetworkBatch {
    /// Makes room for at most this number of networks from now on, rounded down to whole blocks of threads, of which there is
    /// at least one: so other batches of the device have room too.
    pub fn limit(&mut self, networks: usize) {
        self.limit = (networks / BLOCK_THREADS).max(1) * BLOCK_THREADS;
    }

    /// Allocates the memory for as many of `count` networks as fit, and returns how many: `count`, at most the
    /// [limit](NetworkBatch::limit), or a half of it, a quarter, and so on; 0 if not even a few fit. Then this is the limit
    /// from now on. The states are undefined.
    ///
    /// # Errors
    /// Returns the error of the device, except that its memory does not suffice.
    pub fn make_room(&mut self, count: usize) -> Result<usize, CudaError> {
        let mut fitting = count.min(self.limit);
        while fitting > 0 {
            match self.reserve(fitting).and_then(|()| self.reserve_scratch(fitting)) {
                Ok(()) => return Ok(fitting),
                Err(error) if error.is_out_of_memory() => {
                    self.release()?;
                    // Networks in the same block of threads need no more memory than one.
                    fitting = if fitting > BLOCK_THREADS { (fitting / 2).max(BLOCK_THREADS) } else { 0 };
                    self.limit = fitting;
                }
                Err(error) => return Err(error),
            }
        }
        Ok(0)
    }

    /// Frees the memory of all networks, whose states are lost, and makes no room for any from now on.
    ///
    /// # Errors
    /// Returns the error of the device.
    pub fn give_up(&mut self) -> Result<(), CudaError> {
        self.limit = 0;
        self.release()
    }

    /// Frees the memory of all networks, whose states are lost.
    fn release(&mut self) -> Result<(), CudaError> {
        // The device may still access memory of the host.
        self.queue.wait()?;
        (self.networks, self.scratch) = (None, None);
        self.queue.wait()
    }

    /// Numbers of the arrays of a thread: positions, direction, diagonal and other blocks of the stiffness, diagonal and
    /// other blocks of the factor, modes.
    pub(super) fn scratch_lengths(&self) -> [usize; 7] {
        let Uniform { interior, pairs, blocks, .. } = self.uniform;
        let (interior, pairs, blocks) = (interior as usize, pairs as usize, blocks as usize);
        let vector = 3 * interior;
        [vector, vector, 6 * interior, 6 * pairs, 6 * interior, 9 * (blocks + 1), MODES * vector]
    }

    /// Returns the data of the kernels for the first networks.
    pub(super) fn of_networks(&self, count: usize) -> Uniform {
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
    pub(super) fn reserve(&mut self, count: usize) -> Result<(), CudaError> {
        if self.networks.as_ref().is_some_and(|networks| networks.capacity >= count) || count == 0 {
            if let Some(networks) = &mut self.networks {
                networks.count = count;
            }
            return Ok(());
        }
        // RVEs that are created one after the other must not cause an allocation each.
        let held = self.networks.as_ref().map_or(0, |networks| networks.capacity);
        let capacity = count.max((held + held / 2).min(self.limit)).next_multiple_of(LANES);
        // The scratch memory may take much of the memory; it is allocated again for what the networks leave. The device may
        // still work with both.
        self.queue.wait()?;
        (self.networks, self.scratch) = (None, None);
        let interior = self.uniform.interior as usize;
        let of_sensitivities = self.sensitivities();
        let of_predicts = if self.keeps_sensitivities { capacity } else { 0 };
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
        // Locking pages of the host takes long, in vain if the device has no memory left.
        let host = Host {
            gradients: self.queue.staging(9 * capacity)?,
            positions: self.queue.staging(3 * interior * capacity)?,
            sensitivities: self.queue.staging(of_sensitivities * capacity)?,
            predicts: self.queue.staging(of_predicts)?,
            targets: self.queue.staging(9 * capacity)?,
            results: self.queue.staging(RESULT_LEN * capacity)?,
        };
        self.networks = Some(Networks { capacity, count, in_order, in_tiles, host });
        Ok(())
    }

    /// Allocates memory for as many threads as there are networks, or as the memory holds.
    pub(super) fn reserve_scratch(&mut self, networks: usize) -> Result<(), CudaError> {
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
    pub(super) fn states(
        &mut self,
        count: usize,
        interior: usize,
        sensitivities: usize,
    ) -> Result<NetworkStates<'_>, CudaError> {
        let predicts = if sensitivities > 0 { count } else { 0 };
        Ok(NetworkStates {
            gradients: self.gradients.values()?[..9 * count].as_chunks_mut().0,
            positions: &mut self.positions.values()?[..3 * interior * count],
            sensitivities: &mut self.sensitivities.values()?[..sensitivities * count],
            predicts: &mut self.predicts.values()?[..predicts],
        })
    }
}
