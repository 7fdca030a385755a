//! Cost per fiber of geometry and law, nodal forces and energy, by law and network.
//!
//! Run by `cargo bench --package benches --bench fiber_pass`, with `BIOTISSUE_NETWORKS` set to the folder of the
//! published networks; without it only a generated network of 300 nodes is timed. Criterion reports fibers per second;
//! the inverse of `Gelem/s` is ns per fiber.

use std::hint::black_box;
use std::path::PathBuf;
use std::sync::Arc;

use biotissue::fiber::law::{FiberLaw, FiberMaterial, Law};
use biotissue::fiber::network::generate::delaunay_of_nodes;
use biotissue::fiber::network::{Network, file};
use biotissue::fiber::truss::{FiberStates, Truss};
use criterion::{Criterion, Throughput, criterion_group, criterion_main};

fn networks() -> Vec<(&'static str, Arc<Network>)> {
    let small = delaunay_of_nodes(300, 1).expect("300 nodes make a network");
    let mut networks = vec![("delaunay-300", Arc::new(small))];
    if let Some(folder) = std::env::var_os("BIOTISSUE_NETWORKS") {
        match file::read(&PathBuf::from(folder).join("del_4450seedL5_new_1.txt")) {
            Ok(read) => networks.push(("del_4450", Arc::new(read.network))),
            Err(error) => panic!("{error}"),
        }
    }
    networks
}

fn laws() -> [Law; 3] {
    let (youngs_modulus, nonlinearity) = (1.0e8, 1.2);
    [
        Law::Linear { youngs_modulus },
        Law::Exponential { youngs_modulus, nonlinearity },
        Law::ExponentialStretch { youngs_modulus, nonlinearity, transition: 1.1 },
    ]
}

fn network_law(name: &str) -> Law {
    laws().into_iter().find(|law| law.name() == name).expect("a law of the bench")
}

/// Positions as in an RVE: stretched by a tenth along x, with a small individual displacement of every node.
fn deformed(network: &Network) -> Vec<[f64; 3]> {
    let wave = |x: f64| 0.004 * (40.0 * x).sin();
    network.nodes().iter().map(|&[x, y, z]| [1.1 * x + wave(y), 0.96 * y + wave(z), 0.96 * z + wave(x)]).collect()
}

fn fiber_pass(c: &mut Criterion) {
    for (name, network) in networks() {
        let mut group = c.benchmark_group(name);
        group.throughput(Throughput::Elements(network.fibers().len() as u64));
        let positions = deformed(&network);
        let mut forces = vec![[0.0; 3]; network.nodes().len()];
        for law in laws() {
            let title = law.name().to_owned();
            let material = FiberMaterial { law, radius: 5.0e-8, density: None };
            let truss = Truss::new(Arc::clone(&network), Some(material)).expect("the laws have sense");
            let mut states = FiberStates::default();
            group.bench_function(format!("{title}: evaluate"), |b| {
                b.iter(|| truss.evaluate(black_box(&positions), &mut states));
            });
            group.bench_function(format!("{title}: evaluate, then nodal forces"), |b| {
                b.iter(|| {
                    truss.evaluate(black_box(&positions), &mut states);
                    truss.nodal_forces(&states, &mut forces);
                });
            });
            group.bench_function(format!("{title}: evaluate with forces"), |b| {
                b.iter(|| truss.evaluate_with_forces(black_box(&positions), &mut states, &mut forces));
            });
            let (mut stress, mut slope) = (states.stretches.clone(), states.stretches.clone());
            let law = &network_law(&title);
            group.bench_function(format!("{title}: law"), |b| {
                b.iter(|| law.stresses(black_box(&states.stretches), &mut stress, &mut slope));
            });
            group.bench_function(format!("{title}: energy"), |b| b.iter(|| truss.energy(black_box(&states))));
        }
        group.finish();
    }
}

criterion_group!(benches, fiber_pass);
criterion_main!(benches);
