//! RVEs on a graphics processor.

use nalgebra::Matrix3;
use rayon::prelude::*;

use super::{OfModel, network_data, rows};
use crate::backends::cuda::networks::NetworkBatch;
#[cfg(test)]
use crate::backends::cuda::networks::emulation::EmulatedDevice;
use crate::backends::cuda::{CudaError, Device};
use crate::backends::networks::{BatchParams, NetworkStates, Status};
use crate::fiber::batch::{BatchEquilibrium, BatchProgress, BatchSolver};
use crate::fiber::equilibrium::EquilibriumParams;
use crate::fiber::rve::{Rve, RveModel, Sensitivities};
use crate::las::RealBackend;

/// Many RVEs of one model on a graphics processor.
///
/// ```no_run
/// use biotissue::backends::cuda::Device;
/// use biotissue::rve_batch::DeviceBatch;
/// use biotissue::fiber::equilibrium::EquilibriumParams;
/// use biotissue::fiber::rve::{Rve, RveModel};
/// use biotissue::las::RealBackend;
/// use nalgebra::Matrix3;
///
/// fn stretch_all<B: RealBackend>(model: &RveModel<B>) -> Result<(), Box<dyn std::error::Error>> {
///     let Some(mut batch) = DeviceBatch::new(&Device::open(0)?, model, true)? else {
///         return Err("the device has no such fiber law".into());
///     };
///     let mut rves = vec![Rve::at_rest(model.network()); 10_000];
///     let targets: Vec<_> = (0..rves.len())
///         .map(|k| Matrix3::identity() * (1.0 + 1e-6 * k as f64))
///         .collect();
///     let mut rves: Vec<&mut Rve> = rves.iter_mut().collect();
///     for solved in batch.solve(&mut rves, &targets, &EquilibriumParams::default())?.iter().flatten() {
///         println!("{}", solved.pk1);
///     }
///     Ok(())
/// }
/// ```
#[derive(Debug)]
pub struct DeviceBatch {
    batch: NetworkBatch,
    of_model: OfModel,
}

impl DeviceBatch {
    /// Makes an empty batch for RVEs of this model. With `predicts`, a solution keeps the sensitivities of the interior
    /// nodes, and the next one starts from a first-order prediction.
    ///
    /// Returns `None` if the device cannot evaluate a law of the model, which is a table or a custom law, or if an interior
    /// node of the network has no fiber.
    ///
    /// # Errors
    /// Returns the error of the device.
    pub fn new<B: RealBackend>(
        device: &Device,
        model: &RveModel<B>,
        predicts: bool,
    ) -> Result<Option<Self>, CudaError> {
        let Some(network) = network_data(model) else { return Ok(None) };
        Ok(Some(Self::of(model, NetworkBatch::new(device, &network, predicts)?)))
    }

    /// Makes an empty batch whose kernels run on the processor; `None` without a C++ compiler.
    #[cfg(test)]
    pub(crate) fn emulated<B: RealBackend>(
        model: &RveModel<B>,
        predicts: bool,
        device: EmulatedDevice,
    ) -> Option<Self> {
        let batch = NetworkBatch::emulated(&network_data(model)?, predicts, device)?;
        Some(Self::of(model, batch))
    }

    fn of<B: RealBackend>(model: &RveModel<B>, batch: NetworkBatch) -> Self {
        Self { batch, of_model: OfModel::new(model) }
    }

    /// Divides this number of bytes of the memory of a device among batches, so that each may hold the same number of
    /// networks at once.
    pub fn share_memory<'a>(batches: impl IntoIterator<Item = &'a mut Self>, bytes: usize) {
        let batches: Vec<&mut Self> = batches.into_iter().collect();
        let of_batch = |of: &&mut Self| of.batch.bytes_per_network() + of.batch.bytes_per_thread();
        let networks = bytes / batches.iter().map(of_batch).sum::<usize>().max(1);
        batches.into_iter().for_each(|of| of.batch.limit(networks));
    }

    /// Returns the bytes of page-locked memory of this process that a batch of so many RVEs of a model takes, about; 0 if the
    /// device cannot evaluate a law of the model.
    pub fn host_bytes<B: RealBackend>(model: &RveModel<B>, rves: usize, predicts: bool) -> usize {
        /// The kernels need so many registers that a multiprocessor executes at most 256 networks at once, and devices have
        /// at most 160 of these.
        const MOST_AT_ONCE: usize = 160 * 256;
        network_data(model).map_or(0, |network| {
            rves.min(MOST_AT_ONCE) * NetworkBatch::host_bytes_per_network(network.interior, predicts)
        })
    }

    /// The networks on the device.
    pub fn networks(&mut self) -> &mut NetworkBatch {
        &mut self.batch
    }

    /// Floating-point operations of one factorization of the stiffness.
    pub fn operations(&self) -> f64 {
        self.batch.operations()
    }

    /// Returns the parameters for the kernels; `None` if the parameters ask for something else than Newton's method as the
    /// first stage.
    pub fn params(&self, params: &EquilibriumParams) -> Option<BatchParams> {
        self.of_model.params(params)
    }

    /// Brings RVEs to equilibrium at these deformation gradients, as [`BatchSolver::solve`].
    ///
    /// # Errors
    /// Returns the error of the device.
    ///
    /// # Panics
    /// Panics if there is not one target for each RVE.
    pub fn solve(
        &mut self,
        rves: &mut [&mut Rve],
        targets: &[Matrix3<f64>],
        params: &EquilibriumParams,
    ) -> Result<Vec<Option<BatchEquilibrium>>, CudaError> {
        self.solve_with_progress(rves, targets, params, &())
    }

    fn solve_with_progress(
        &mut self,
        rves: &mut [&mut Rve],
        targets: &[Matrix3<f64>],
        params: &EquilibriumParams,
        progress: &dyn BatchProgress,
    ) -> Result<Vec<Option<BatchEquilibrium>>, CudaError> {
        assert_eq!(rves.len(), targets.len(), "one target for each RVE");
        let mut solved = vec![None; rves.len()];
        let Some(params) = self.params(params) else { return Ok(solved) };
        let at_once = self.batch.make_room(rves.len().min(self.batch.at_once()?))?;
        if at_once == 0 {
            return Ok(solved);
        }
        let parts = rves.chunks_mut(at_once).zip(targets.chunks(at_once)).zip(solved.chunks_mut(at_once));
        for (part, ((rves, targets), solved)) in parts.enumerate() {
            let first = part * at_once;
            progress.begin(first);
            let responses = self.solve_part(rves, targets, &params);
            let Some(responses) = self.unless_full(responses)? else {
                progress.end(first, 0);
                break;
            };
            progress.end(first, responses.iter().flatten().count());
            solved.copy_from_slice(&responses);
        }
        Ok(solved)
    }

    /// Solves for the equilibria of RVEs for which there is room.
    fn solve_part(
        &mut self,
        rves: &mut [&mut Rve],
        targets: &[Matrix3<f64>],
        params: &BatchParams,
    ) -> Result<Vec<Option<BatchEquilibrium>>, CudaError> {
        let of_model = self.of_model;
        let interior = of_model.interior;
        self.batch.set_states(rves.len(), |states| write_states(rves, interior, states))?;
        let results = self.batch.solve(&rows_of(targets), params)?;
        let inputs = rves.par_iter().zip(targets).enumerate();
        let responses = inputs.map(|(number, (rve, target))| {
            let is_of_model = rve.interior().len() == interior && target.determinant() > 0.0;
            of_model.equilibrium(&results.get(number), target).filter(|_| is_of_model)
        });
        let responses: Vec<Option<BatchEquilibrium>> = responses.collect();
        self.batch.read_states(|states| {
            let inputs = rves.par_iter_mut().zip(targets).zip(&responses).enumerate();
            inputs.filter(|(_, (_, response))| response.is_some()).for_each(|(number, ((rve, target), _))| {
                take_state(rve, target, interior, &states, number);
            });
        })?;
        Ok(responses)
    }

    /// Returns the result of the device; `None` if it has no memory to start a kernel, because another program has taken it.
    /// Then all RVEs are left to the processor from now on.
    fn unless_full<T>(&mut self, outcome: Result<T, CudaError>) -> Result<Option<T>, CudaError> {
        match outcome {
            Err(error) if error.is_out_of_memory() => self.batch.give_up().map(|()| None),
            outcome => outcome.map(Some),
        }
    }

    /// Returns for each RVE whether Newton evidently leads from the state in `from` to the equilibrium in `reached`, as
    /// [`BatchSolver::converge_to`].
    ///
    /// # Errors
    /// Returns the error of the device.
    ///
    /// # Panics
    /// Panics if there is not one state for each other.
    pub fn converge_to(
        &mut self,
        from: &[&Rve],
        reached: &[&Rve],
        params: &EquilibriumParams,
    ) -> Result<Vec<bool>, CudaError> {
        assert_eq!(from.len(), reached.len(), "one equilibrium for each start");
        let Some(params) = self.params(params) else { return Ok(vec![false; from.len()]) };
        let mut leads = vec![false; from.len()];
        let at_once = self.batch.make_room(from.len().min(self.batch.at_once()?))?;
        if at_once == 0 {
            return Ok(leads);
        }
        for ((from, reached), leads) in from.chunks(at_once).zip(reached.chunks(at_once)).zip(leads.chunks_mut(at_once))
        {
            let of_part = self.part_converges_to(from, reached, &params);
            let Some(of_part) = self.unless_full(of_part)? else { break };
            leads.copy_from_slice(&of_part);
        }
        Ok(leads)
    }

    /// As [`DeviceBatch::converge_to`], for states for which there is room.
    fn part_converges_to(
        &mut self,
        from: &[&Rve],
        reached: &[&Rve],
        params: &BatchParams,
    ) -> Result<Vec<bool>, CudaError> {
        let interior = self.of_model.interior;
        self.batch.set_states(from.len(), |states| write_states(from, interior, states))?;
        let targets: Vec<Matrix3<f64>> = reached.iter().map(|rve| *rve.gradient()).collect();
        let mut positions = vec![0.0; 3 * interior * reached.len()];
        write_positions(reached, interior, &mut positions);
        let results = self.batch.continues(&rows_of(&targets), &positions, params)?;
        Ok(results.iter().map(|result| result.status() == Status::Continues).collect())
    }
}

impl BatchSolver for DeviceBatch {
    fn solve(
        &mut self,
        rves: &mut [&mut Rve],
        targets: &[Matrix3<f64>],
        params: &EquilibriumParams,
        progress: &dyn BatchProgress,
    ) -> Result<Vec<Option<BatchEquilibrium>>, String> {
        self.solve_with_progress(rves, targets, params, progress).map_err(|error| error.to_string())
    }

    fn converge_to(
        &mut self,
        from: &[&Rve],
        reached: &[&Rve],
        params: &EquilibriumParams,
    ) -> Result<Vec<bool>, String> {
        self.converge_to(from, reached, params).map_err(|error| error.to_string())
    }
}

/// Copies the positions of states; those of another network become zeros.
fn write_positions(rves: &[impl std::ops::Deref<Target = Rve> + Sync], interior: usize, positions: &mut [f64]) {
    if interior > 0 {
        positions.par_chunks_mut(3 * interior).zip(rves).for_each(|(place, rve)| {
            if rve.interior().len() == interior {
                place.copy_from_slice(rve.interior().as_flattened());
            } else {
                place.fill(0.0);
            }
        });
    }
}

/// Copies states.
fn write_states(rves: &[impl std::ops::Deref<Target = Rve> + Sync], interior: usize, states: NetworkStates<'_>) {
    let NetworkStates { gradients, positions, sensitivities, predicts } = states;
    gradients.iter_mut().zip(rves).for_each(|(place, rve)| *place = rows(rve.gradient()));
    write_positions(rves, interior, positions);
    if !sensitivities.is_empty() {
        let places = sensitivities.par_chunks_mut(SENSITIVITIES * interior).zip(predicts).zip(rves);
        places.for_each(|((place, predicts), rve)| {
            let known = rve.sensitivities().filter(|known| known.len() == interior);
            *predicts = f64::from(u8::from(known.is_some()));
            if let Some(known) = known {
                place.copy_from_slice(known.as_flattened());
            }
        });
    }
}

/// Sensitivities of an interior node.
const SENSITIVITIES: usize = size_of::<Sensitivities>() / size_of::<f32>();

fn take_state(rve: &mut Rve, target: &Matrix3<f64>, interior: usize, states: &NetworkStates<'_>, number: usize) {
    let positions = &states.positions[3 * interior * number..][..3 * interior];
    let sensitivities = (!states.sensitivities.is_empty())
        .then(|| states.sensitivities[SENSITIVITIES * interior * number..][..SENSITIVITIES * interior].as_chunks().0);
    rve.replace(target, positions.as_chunks().0, sensitivities);
}

fn rows_of(gradients: &[Matrix3<f64>]) -> Vec<[f64; 9]> {
    gradients.iter().map(rows).collect()
}
