//! Checks of networks on the device.

use std::path::PathBuf;
use std::sync::Arc;

use biotissue::app::case::Case;
use biotissue::app::run::Simulation;
use biotissue::backends::cuda::Device;
use biotissue::backends::sparse::Sparse;
use biotissue::fiber::equilibrium::{EquilibriumParams, Stage, converges_to, equilibrate};
use biotissue::fiber::law::{FiberMaterial, Law};
use biotissue::fiber::network::generate::{delaunay, voronoi};
use biotissue::fiber::network::{Network, file};
use biotissue::fiber::rve::{Rve, RveModel, StressScale};
use biotissue::fiber::workspace::Workspace;
use biotissue::las::conformance::Random;
use biotissue::rve_batch::DeviceBatch;
use nalgebra::Matrix3;
use rayon::prelude::*;

use crate::Check;
use crate::body::{self, Results};
use crate::emulation::{is_emulated, trials};

pub const CHECKS: &[Check] = &[
    ("networks_laws", laws),
    ("networks_robustness", robustness),
    ("networks_published", published),
    ("networks_continuation", continuation),
    ("networks_repeatable", repeatable),
    ("networks_two_scale", two_scale),
];

pub type Model = RveModel<Sparse>;

pub fn model_of(network: Network, law: Law) -> Model {
    let material = FiberMaterial { law, radius: 3.5e-8, density: None };
    RveModel::new(&(), Arc::new(network), Some(material), StressScale::FiberVolumeFraction(0.01)).unwrap()
}

pub fn exponential() -> Law {
    Law::Exponential { youngs_modulus: 1.0e7, nonlinearity: 1.2 }
}

/// Deformation gradients within `size` of the identity, with positive determinants.
fn gradients(count: usize, size: f64, random: &mut Random) -> Vec<Matrix3<f64>> {
    let mut gradients = Vec::new();
    while gradients.len() < count {
        let gradient = Matrix3::identity() + Matrix3::from_fn(|_, _| size * random.signed());
        if gradient.determinant() > 0.05 {
            gradients.push(gradient);
        }
    }
    gradients
}

pub fn batch_of(device: &Device, model: &Model, predicts: bool) -> DeviceBatch {
    DeviceBatch::new(device, model, predicts).unwrap().unwrap()
}

/// Compares the components of a tensor, relative to the largest.
pub fn near(found: &[f64], expected: &[f64], what: &str) {
    let size = expected.iter().fold(0.0, |size: f64, x| size.max(x.abs()));
    for (found, expected) in found.iter().zip(expected) {
        assert!((found - expected).abs() <= 1e-9 * size, "{what}: {found:e} instead of {expected:e}, of {size:e}");
    }
}

/// Solves from these states on the device and one by one, and compares; returns how many the device left.
fn compare(device: &Device, model: &Model, states: &mut [Rve], targets: &[Matrix3<f64>], predicts: bool) -> usize {
    // The device takes a new factor for each step.
    let mut params = EquilibriumParams::default();
    params.chord_steps = Some(0);
    let mut of_device = states.to_vec();
    let mut all: Vec<&mut Rve> = of_device.iter_mut().collect();
    let found = batch_of(device, model, predicts).solve(&mut all, targets, &params).unwrap();
    let inputs = states.par_iter_mut().zip(&of_device).zip(&found).zip(targets);
    let left = inputs.map_init(
        || Workspace::new(&(), model).unwrap(),
        |workspace, (((rve, of_device), found), target)| {
            let before = rve.clone();
            let solved = equilibrate(model, rve, target, &params, workspace);
            let Some(found) = found else {
                let by_newton_alone = solved.is_ok_and(|solved| {
                    let report = solved.report();
                    let is_definite = report.indefinite == 0 && !report.neutral;
                    report.stage == Some(Stage::Newton) && is_definite && report.iterations <= 30
                });
                assert!(!by_newton_alone, "left at {target}");
                assert_eq!(*of_device, before, "the state of a network that was left is unchanged");
                return 1;
            };
            let mut solved = solved.unwrap_or_else(|error| panic!("{error} at {target}"));
            if solved.report().stage == Some(Stage::Newton) {
                assert_eq!(found.iterations, solved.report().iterations, "iterations at {target}");
            }
            near(found.pk1.as_slice(), solved.pk1().as_slice(), "stress");
            near(&[found.energy], &[solved.energy()], "energy");
            near(found.tangent.as_slice(), solved.tangent().unwrap().as_slice(), "tangent");
            if predicts {
                solved.keep_sensitivities().unwrap();
            }
            drop(solved);
            near(of_device.interior().as_flattened(), rve.interior().as_flattened(), "positions");
            assert_eq!(of_device.has_sensitivities(), predicts);
            0
        },
    );
    left.sum()
}

fn laws(device: &Device) {
    let (youngs_modulus, nonlinearity) = (1.0e7, 1.2);
    let laws = [
        Law::Linear { youngs_modulus },
        exponential(),
        Law::ExponentialStretch { youngs_modulus, nonlinearity, transition: 1.05 },
        exponential().with_buckling(0.1, 0.02),
    ];
    for law in laws {
        for predicts in [false, true] {
            let model = model_of(delaunay(60, 7).unwrap(), law.clone());
            let mut random = Random::new(3);
            let mut states = vec![Rve::at_rest(model.network()); trials(300)];
            for size in [0.03, 0.04, 0.05] {
                let targets = gradients(states.len(), size, &mut random);
                let left = compare(device, &model, &mut states, &targets, predicts);
                assert!(left < states.len() / 5, "{left} of {} were left with {law:?}", states.len());
            }
        }
    }
}

/// Networks of several kinds and sizes, small and large deformations: each case is solved like alone, or left.
fn robustness(device: &Device) {
    let mut random = Random::new(11);
    let (mut cases, mut left) = (0, 0);
    for seed in 0..6 {
        let networks = [delaunay(8 + 40 * seed as usize, seed).unwrap(), voronoi(6 + 4 * seed as usize, seed).unwrap()];
        for network in networks {
            let model = model_of(network, exponential());
            for size in [1e-4, 0.05, 0.2] {
                let mut states = vec![Rve::at_rest(model.network()); trials(40)];
                let targets = gradients(states.len(), size, &mut random);
                cases += states.len();
                left += compare(device, &model, &mut states, &targets, true);
            }
        }
    }
    println!("       {left} of {cases} cases were left to the processor");
}

/// The published networks whose laws the device knows, cold and warm.
fn published(device: &Device) {
    /// Networks with more unknowns take fewer cases.
    const MOST_UNKNOWNS: usize = 110_000;
    /// Larger networks take minutes where kernels are executed by the processor.
    const MOST_EMULATED: usize = 300;
    let Some(folder) = std::env::var_os("BIOTISSUE_NETWORKS").map(PathBuf::from) else {
        let is_required = std::env::var("BIOTISSUE_REQUIRE_NETWORKS").is_ok_and(|required| required != "0");
        assert!(!is_required, "BIOTISSUE_NETWORKS names no folder");
        println!("       skipped: BIOTISSUE_NETWORKS names no folder");
        return;
    };
    let mut compared = Vec::new();
    for folder in [folder.join("ligament"), folder] {
        let entries = std::fs::read_dir(&folder).into_iter().flatten().flatten();
        let mut files: Vec<PathBuf> = entries.map(|entry| entry.path()).collect();
        files.retain(|path| path.extension().is_some_and(|extension| extension == "txt"));
        files.sort();
        for path in files {
            let read = file::read(&path).map_err(|error| error.to_string());
            let model = read.and_then(|read| {
                Model::new(&(), Arc::new(read.network), None, StressScale::Raw).map_err(|error| error.to_string())
            });
            let Ok(model) = model.inspect_err(|error| println!("       left out: {error}")) else { continue };
            if is_emulated() && model.unknowns() > MOST_EMULATED {
                println!("       left out: {} has {} unknowns", path.display(), model.unknowns());
                continue;
            }
            if DeviceBatch::new(device, &model, true).unwrap().is_none() {
                println!("       left out: {} has laws that the device does not know", path.display());
                continue;
            }
            let mut random = Random::new(4);
            let count = trials((MOST_UNKNOWNS / model.unknowns().max(1)).clamp(8, 500));
            let mut states = vec![Rve::at_rest(model.network()); count];
            for size in [0.05, 0.06] {
                let targets = gradients(states.len(), size, &mut random);
                let left = compare(device, &model, &mut states, &targets, true);
                println!("       {}: {left} of {count} were left to the processor", model.network().name());
                assert!(!path.ends_with("Network_2_7.txt") || left < count / 2);
            }
            compared.push(path);
        }
    }
    assert!(compared.iter().any(|path| path.ends_with("Network_2_7.txt")), "{compared:?}");
}

fn continuation(device: &Device) {
    let model = model_of(delaunay(80, 9).unwrap(), exponential());
    let params = EquilibriumParams::default();
    let mut workspace = Workspace::new(&(), &model).unwrap();
    let mut random = Random::new(5);
    let rest = Rve::at_rest(model.network());
    let mut reached = Vec::new();
    for (number, target) in gradients(trials(200), 0.12, &mut random).iter().enumerate() {
        let mut rve = rest.clone();
        equilibrate(&model, &mut rve, target, &params, &mut workspace).unwrap();
        if number % 4 == 0 {
            // Not an equilibrium to which Newton leads.
            let mut interior = rve.interior().to_vec();
            interior[0][1] += 0.05;
            rve = Rve::restored(*target, interior, None);
        }
        reached.push(rve);
    }
    let mut batch = batch_of(device, &model, true);
    let found = batch.converge_to(&vec![&rest; reached.len()], &reached.iter().collect::<Vec<_>>(), &params).unwrap();
    for (number, (rve, found)) in reached.iter().zip(found).enumerate() {
        let expected = converges_to(&model, &rest, rve, &params.newton, &mut workspace);
        assert_eq!(found, expected, "network {number}");
    }
}

/// The result of a network has the same bits in every run, at every place of a batch, and beside any others.
fn repeatable(device: &Device) {
    let model = model_of(delaunay(100, 2).unwrap(), exponential());
    let params = EquilibriumParams::default();
    let mut random = Random::new(6);
    let targets = gradients(trials(3_000), 0.06, &mut random);
    let mut batch = batch_of(device, &model, true);
    let mut solve = |targets: &[Matrix3<f64>]| {
        let mut rves = vec![Rve::at_rest(model.network()); targets.len()];
        let solved = batch.solve(&mut rves.iter_mut().collect::<Vec<_>>(), targets, &params).unwrap();
        let responses: Vec<_> = solved.into_iter().map(|found| found.map(|found| (found.pk1, found.tangent))).collect();
        (rves, responses)
    };
    let first = solve(&targets);
    let second = solve(&targets);
    assert!(first == second, "another run has other bits");
    let backward: Vec<Matrix3<f64>> = targets.iter().skip(17).rev().copied().collect();
    let (rves, responses) = solve(&backward);
    for (number, (rve, response)) in rves.iter().zip(&responses).enumerate() {
        let place = targets.len() - 1 - number;
        assert!(*rve == first.0[place] && *response == first.1[place], "network {place} has other bits elsewhere");
    }
}

/// A body with networks at its points: the same reactions with the device and without.
fn two_scale(_: &Device) {
    let folder = tempfile::tempdir().unwrap();
    let run = |device: &str| {
        let file = body::write(folder.path(), &format!("{device}.toml"), device, "");
        let case = Case::read(&file).unwrap_or_else(|errors| panic!("{errors}")).case;
        let out = folder.path().join(device);
        let mut simulation = Simulation::<Sparse>::new((), case).unwrap_or_else(|error| panic!("{error}"));
        simulation.run(&out, &mut ()).unwrap_or_else(|error| panic!("{error}"));
        Results::read(&out)
    };
    let (expected, found) = (run("none"), run("cuda"));
    found.assert_same(&expected, "reactions");
    assert!(found.share_of_device() > 0.9, "{}", found.share_of_device());
    assert_eq!(expected.share_of_device(), 0.0);
}
