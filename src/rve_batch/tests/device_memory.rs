//! The memory of a device, emulated beside kernels that run on the processor.

use super::*;

/// Returns a batch of networks with this number of points on an emulated device, and the bytes of a network of it;
/// `None` without a C++ compiler.
fn batch(device: &EmulatedDevice, points: usize) -> Option<(Model, DeviceBatch, usize)> {
    let model = model(Law::Linear { youngs_modulus: 1.0e7 }, points);
    let Some(mut batch) = DeviceBatch::emulated(&model, true, device.clone()) else {
        println!("skipped: there is no C++ compiler");
        return None;
    };
    let bytes = batch.networks().bytes_per_network() + batch.networks().bytes_per_thread();
    Some((model, batch, bytes))
}

/// Solves for so many RVEs, and returns how many the batch left; those must be at rest.
fn left(model: &Model, batch: &mut DeviceBatch, count: usize) -> usize {
    let at_rest = Rve::at_rest(model.network());
    let mut rves = vec![at_rest.clone(); count];
    let targets = gradients(count, 0.01, &mut Random::new(1));
    let mut all: Vec<&mut Rve> = rves.iter_mut().collect();
    let solved = batch.solve(&mut all, &targets, &EquilibriumParams::default()).unwrap();
    let is_left = |(_, solved): &(&Rve, &Option<BatchEquilibrium>)| solved.is_none();
    let left: Vec<_> = rves.iter().zip(&solved).filter(is_left).collect();
    assert!(left.iter().all(|(rve, _)| rve.interior() == at_rest.interior()));
    left.len()
}

#[test]
fn batches_share_it() {
    let device = EmulatedDevice { threads: 512, ..EmulatedDevice::default() };
    let Some((small, mut of_small, bytes_of_small)) = batch(&device, 10) else { return };
    let Some((large, mut of_large, bytes_of_large)) = batch(&device, 20) else { return };
    DeviceBatch::share_memory([&mut of_small, &mut of_large], 300 * (bytes_of_small + bytes_of_large));
    for _ in 0..2 {
        assert_eq!((left(&small, &mut of_small, 512), left(&large, &mut of_large, 512)), (0, 0));
        // Whole blocks of threads: the networks of the last part of the batch.
        assert_eq!((of_small.networks().len(), of_large.networks().len()), (256, 256));
    }
}

#[test]
fn a_batch_is_solved_in_parts_that_fit() {
    let unlimited = EmulatedDevice { threads: 512, ..EmulatedDevice::default() };
    let Some((_, mut other, _)) = batch(&unlimited, 10) else { return };
    // Room for the states of 400 networks, and to solve 128 at once.
    let bytes = 400 * other.networks().bytes_per_network() + 128 * other.networks().bytes_per_thread();
    let device = EmulatedDevice { bytes, threads: 512, ..EmulatedDevice::default() };
    let Some((model, mut batch, _)) = batch(&device, 10) else { return };
    for _ in 0..2 {
        assert_eq!(left(&model, &mut batch, 512), 0);
        assert_eq!(batch.networks().len(), 256);
    }
}

#[test]
fn rves_without_memory_are_left() {
    let Some((model, _, bytes)) = batch(&EmulatedDevice::default(), 10) else { return };
    let for_few = EmulatedDevice { bytes: 100 * bytes, ..EmulatedDevice::default() };
    // The batch fits, but then no kernel can be started.
    let for_no_kernel = EmulatedDevice { of_kernels: EmulatedDevice::default().bytes, ..EmulatedDevice::default() };
    for device in [for_few, for_no_kernel] {
        let Some((_, mut batch, _)) = batch(&device, 10) else { return };
        let free = device.free();
        assert_eq!(left(&model, &mut batch, 200), 200);
        assert_eq!(device.free(), free);
        let rve = Rve::at_rest(model.network());
        assert_eq!(batch.converge_to(&[&rve], &[&rve], &EquilibriumParams::default()).unwrap(), [false]);
    }
}
