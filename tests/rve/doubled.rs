//! Fibers that join the same two nodes, as in some published networks, contribute like one fiber with the sum of their
//! areas.

use std::sync::Arc;

use biotissue::backends::{dense::Dense, sparse::Sparse};
use biotissue::fiber::law::FiberMaterial;
use biotissue::fiber::network::check::{examine, rigidity};
use biotissue::fiber::network::{Network, file};
use biotissue::las::RealBackend;
use nalgebra::Matrix3;

use crate::support::{self, Bench, frozen, laws};

/// Returns the frozen network with every seventh fiber doubled (the second one in the opposite direction), and the
/// network in which these fibers have twice the area instead.
fn doubled_and_thick(material: &FiberMaterial) -> (Arc<Network>, Arc<Network>) {
    let frozen = frozen();
    let (nodes, mut fibers) = (frozen.nodes().to_vec(), frozen.fibers().to_vec());
    let chosen = |fiber: usize| fiber % 7 == 3;
    let thick = FiberMaterial { radius: material.radius * 2.0_f64.sqrt(), ..material.clone() };
    let material_of = (0..fibers.len()).map(|fiber| u16::from(chosen(fiber))).collect();
    let of_twice_the_area = Network::new("thick", nodes.clone(), fibers.clone())
        .and_then(|network| network.with_materials(vec![material.clone(), thick], material_of));
    let again: Vec<[u32; 2]> =
        fibers.iter().enumerate().filter(|(fiber, _)| chosen(*fiber)).map(|(_, &[a, b])| [b, a]).collect();
    fibers.extend(again);
    let doubled = Network::new("doubled", nodes, fibers).unwrap().of_one_material(material.clone());
    (Arc::new(doubled), Arc::new(of_twice_the_area.unwrap()))
}

fn assert_as_stiff_as_fibers_of_twice_the_area<B: RealBackend<Context = ()>>() {
    let f = Matrix3::new(1.1, 0.05, 0.0, -0.02, 0.97, 0.03, 0.0, 0.01, 1.02);
    for material in laws() {
        let (doubled, thick) = doubled_and_thick(&material);
        let [(pk1, tangent, energy), (of_thick, tangent_of_thick, energy_of_thick)] = [doubled, thick].map(|network| {
            let mut bench = Bench::<B>::new(&network, None);
            let mut rve = bench.at_rest();
            bench.solve(&mut rve, &f).unwrap();
            let pk1 = bench.pk1();
            (pk1, bench.tangent(&rve), bench.energy())
        });
        assert!((pk1 - of_thick).norm() < 1e-9 * of_thick.norm(), "{pk1} {of_thick}");
        assert!((tangent - tangent_of_thick).norm() < 1e-7 * tangent_of_thick.norm());
        assert!((energy - energy_of_thick).abs() < 1e-9 * energy_of_thick);
    }
}

#[test]
fn a_doubled_fiber_is_as_stiff_as_one_of_twice_the_area() {
    assert_as_stiff_as_fibers_of_twice_the_area::<Sparse>();
    assert_as_stiff_as_fibers_of_twice_the_area::<Dense>();
}

/// A doubled fiber resists no additional motion: it does not change the number of zero modes, and if it has a free end,
/// it adds one state of self stress.
#[test]
fn a_doubled_fiber_adds_a_self_stress_and_no_rigidity() {
    let (doubled, thick) = doubled_and_thick(&laws()[0]);
    let more = examine(&doubled).doubled_fibers;
    assert_eq!((more, examine(&thick).doubled_fibers), (doubled.fibers().len() - thick.fibers().len(), 0));
    let on_boundary =
        |fiber: u32| doubled.fibers()[fiber as usize].iter().all(|&node| doubled.interior_number()[node as usize] < 0);
    let free = doubled.doubled().into_iter().filter(|&fiber| !on_boundary(fiber)).count();
    assert!(free > 5, "{free} of {more}");
    let [of_doubled, of_thick] = [&doubled, &thick].map(|network| rigidity::<Sparse>(&(), network).unwrap());
    assert_eq!(of_doubled.zero_modes, of_thick.zero_modes);
    assert_eq!(of_doubled.self_stresses, of_thick.self_stresses + free);
}

/// A published network with doubled fibers is read with a warning and solved.
#[test]
fn a_published_network_with_doubled_fibers_is_solved() {
    let Some(path) = support::published_file("ligament/theta_0_align_0_realization_1.txt") else { return };
    let read = file::read(&path).unwrap_or_else(|errors| panic!("{errors}"));
    assert_eq!((read.network.fibers().len(), read.network.doubled().len()), (3049, 14));
    let [warning] = read.warnings.as_slice() else { panic!("{:?}", read.warnings) };
    assert!(warning.contains(": 14 fibers join two nodes that another fiber already joins"), "{warning}");
    let mut bench = Bench::<Sparse>::new(&Arc::new(read.network), None);
    let mut rve = bench.at_rest();
    bench.solve(&mut rve, &Matrix3::from_diagonal(&[1.02, 0.99, 0.99].into())).unwrap();
    assert!(bench.pk1()[(0, 0)] > 0.0);
}
