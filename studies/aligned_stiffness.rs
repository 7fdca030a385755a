//! Compares the stiffness of aligned networks, along and across their axis, with the affine bound.
//!
//! ```text
//! cargo run --release --package studies --bin aligned_stiffness [-- --points 400 --seeds 5 --svg docs/aligned_stiffness.svg]
//! ```
//!
//! prints the table of `docs/aligned_stiffness.md` and draws its figure. If all fibers deformed affinely with the body,
//! the stiffness of a network at rest would be `phi E <n_i n_j n_k n_l>`, with the average weighted by fiber length.
//! Relaxing the interior nodes to equilibrium can only lower the stiffness.

use std::sync::Arc;

use biotissue::app::report::charts::{Labels, Line, lines};
use biotissue::backends::sparse::Sparse;
use biotissue::fiber::equilibrium::{EquilibriumParams, equilibrate};
use biotissue::fiber::law::{FiberMaterial, Law};
use biotissue::fiber::network::Network;
use biotissue::fiber::network::generate::{Alignment, GeneratorParams, Kind};
use biotissue::fiber::rve::{Rve, RveModel, StressScale};
use biotissue::fiber::workspace::Workspace;
use nalgebra::Matrix3;
use rayon::prelude::*;

type Error = Box<dyn std::error::Error>;

/// Young's modulus of the fibers, Pa.
const MODULUS: f64 = 1.0e8;
/// Fiber volume fraction.
const FRACTION: f64 = 0.003;
/// Index of the axis of alignment (z).
const ALONG: usize = 2;
/// Strengths of alignment; 0 is an isotropic network.
const STRENGTHS: [f64; 10] = [0.0, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9];

/// Stiffness of one network and its affine bound, each along and across the axis, Pa.
struct Stiffness {
    /// Order parameter `P2` about the axis, weighted by fiber length.
    order: f64,
    network: [f64; 2],
    bound: [f64; 2],
}

fn main() -> Result<(), Error> {
    let points = argument("--points").map_or(Ok(400), |text| text.parse())?;
    let seeds: u64 = argument("--seeds").map_or(Ok(5), |text| text.parse())?;
    println!("{points} points, {seeds} networks per row; each ratio is a mean, with minimum and maximum.\n");
    println!(
        "| strength | P2 by length | along (Pa) | affine bound (Pa) | ratio along | across (Pa) | affine bound (Pa) | ratio across |"
    );
    println!("|---|---|---|---|---|---|---|---|");
    let mut curves = [("along", Vec::new()), ("across", Vec::new())];
    for strength in STRENGTHS {
        let of: Result<Vec<Stiffness>, String> = (1..=seeds)
            .into_par_iter()
            .map(|seed| measure(points, strength, seed).map_err(|e| e.to_string()))
            .collect();
        let of = of?;
        let mean = |number: &dyn Fn(&Stiffness) -> f64| of.iter().map(number).sum::<f64>() / of.len() as f64;
        let mut row = format!("| {strength} | {:.3}", mean(&|s| s.order));
        for (k, (_, curve)) in curves.iter_mut().enumerate() {
            let ratios = || of.iter().map(|s| s.network[k] / s.bound[k]);
            let (least, most) = (ratios().fold(f64::INFINITY, f64::min), ratios().fold(0.0, f64::max));
            let ratio = mean(&|s| s.network[k] / s.bound[k]);
            row += &format!(
                " | {:.0} | {:.0} | {ratio:.3} ({least:.3} to {most:.3})",
                mean(&|s| s.network[k]),
                mean(&|s| s.bound[k])
            );
            curve.push((mean(&|s| s.order), ratio));
            if most > 1.0 {
                return Err(format!("a network of strength {strength} is stiffer than the affine bound").into());
            }
        }
        println!("{row} |");
    }
    if let Some(file) = argument("--svg") {
        let labels = Labels {
            chart: "stiffness of aligned networks over the affine bound",
            x: "order parameter P2 about the axis, weighted by length",
            y: "stiffness over affine bound",
        };
        let curves = curves.map(|(name, points)| Line { name: name.into(), points });
        std::fs::write(file, lines(labels, &curves))?;
    }
    Ok(())
}

/// Returns the argument that follows the option `name`.
fn argument(name: &str) -> Option<String> {
    let mut arguments = std::env::args().skip_while(|argument| argument != name);
    arguments.nth(1)
}

/// Generates a network and returns its stiffness at rest.
fn measure(points: usize, strength: f64, seed: u64) -> Result<Stiffness, Error> {
    let mut generator = GeneratorParams::new(Kind::Delaunay, seed);
    if strength > 0.0 {
        let mut direction = [0.0; 3];
        direction[ALONG] = 1.0;
        generator.alignment = Some(Alignment::new(direction, strength)?);
    }
    let network = Arc::new(generator.of_points(points)?.network);
    let material = FiberMaterial { law: Law::Linear { youngs_modulus: MODULUS }, radius: 5.0e-8, density: None };
    let scale = StressScale::FiberVolumeFraction(FRACTION);
    let model = RveModel::<Sparse>::new(&(), Arc::clone(&network), Some(material), scale)?;
    let mut workspace = Workspace::new(&(), &model)?;
    let mut rve = Rve::at_rest(&network);
    let params = EquilibriumParams::default();
    let tangent = equilibrate(&model, &mut rve, &Matrix3::identity(), &params, &mut workspace)?.tangent()?;
    let uniaxial = |k: usize| tangent[(4 * k, 4 * k)];
    let across = |of: &dyn Fn(usize) -> f64| 0.5 * (of((ALONG + 1) % 3) + of((ALONG + 2) % 3));
    let fourth = |k: usize| FRACTION * MODULUS * moment(&network, k, 4);
    Ok(Stiffness {
        order: 1.5 * moment(&network, ALONG, 2) - 0.5,
        network: [uniaxial(ALONG), across(&uniaxial)],
        bound: [fourth(ALONG), across(&fourth)],
    })
}

/// Returns the moment `<n_k^p>` of the fiber directions, weighted by length.
fn moment(network: &Network, k: usize, power: i32) -> f64 {
    let sum: f64 = network
        .lengths()
        .iter()
        .enumerate()
        .map(|(fiber, length)| length * network.direction(fiber)[k].powi(power))
        .sum();
    sum / network.total_length()
}
