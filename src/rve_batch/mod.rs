//! Equilibria of many RVEs at once: in the lanes of the processor's vector registers, or on a graphics processor.
//!
//! A [`LaneBatch`] or `DeviceBatch` belongs to one [`RveModel`]. It takes the states of RVEs and returns for each the stress,
//! energy and tangent that [`equilibrate`](crate::fiber::equilibrium::equilibrate) gives, to rounding errors, or `None`
//! for an RVE that needs more than Newton's method; its state is then unchanged, and `equilibrate` decides. The result of
//! an RVE does not depend on the others.
//!
//! ```
//! use biotissue::fiber::equilibrium::EquilibriumParams;
//! use biotissue::fiber::rve::{Rve, RveModel};
//! use biotissue::las::RealBackend;
//! use biotissue::nalgebra::Matrix3;
//! use biotissue::rve_batch::LaneBatch;
//!
//! /// Stretches many RVEs of one model, each by a different amount; returns how many Newton's method solved.
//! fn stretch_all<B: RealBackend>(model: &RveModel<B>) -> usize {
//!     let Some(batch) = LaneBatch::new(model, true) else { return 0 };
//!     let mut rves = vec![Rve::at_rest(model.network()); 1_000];
//!     let targets: Vec<_> =
//!         (0..rves.len()).map(|k| Matrix3::identity() * (1.0 + 1e-5 * k as f64)).collect();
//!     let mut rves: Vec<&mut Rve> = rves.iter_mut().collect();
//!     batch.solve(&mut rves, &targets, &EquilibriumParams::default()).iter().flatten().count()
//! }
//!
//! # #[cfg(feature = "generate")] {
//! # use std::sync::Arc;
//! # use biotissue::backends::sparse::Sparse;
//! # use biotissue::fiber::{law::{FiberMaterial, Law}, network::generate::delaunay, rve::StressScale};
//! # let law = Law::Exponential { youngs_modulus: 1.0e7, nonlinearity: 1.2 };
//! # let material = FiberMaterial { law, radius: 3.5e-8, density: None };
//! # let network = Arc::new(delaunay(30, 1).unwrap());
//! # let model = RveModel::<Sparse>::new(&(), network, Some(material), StressScale::Raw).unwrap();
//! assert_eq!(stretch_all(&model), 1_000);
//! # }
//! ```

#[cfg(feature = "cuda")]
mod device;
mod lanes;
mod queue;
#[cfg(all(test, feature = "generate"))]
mod tests;

use nalgebra::Matrix3;

#[cfg(feature = "cuda")]
pub use device::DeviceBatch;
pub use lanes::LaneBatch;

use crate::backends::networks::{BatchParams, LawData, LawFormula, NetworkData, NetworkResult, Status};
use crate::fiber::batch::BatchEquilibrium;
use crate::fiber::equilibrium::{EquilibriumParams, ExcessiveForce, Stage};
use crate::fiber::homogenize::tangent_from_form;
use crate::fiber::law::Law;
use crate::fiber::rve::RveModel;
use crate::las::RealBackend;

/// Returns the form in which batches evaluate a law; `None` for a table or a custom law.
fn law_data(law: &Law) -> Option<LawData> {
    let formula = match *law {
        Law::Linear { youngs_modulus } => LawFormula::Linear { youngs_modulus },
        Law::Exponential { youngs_modulus, nonlinearity } => LawFormula::Exponential { youngs_modulus, nonlinearity },
        Law::ExponentialStretch { youngs_modulus, nonlinearity, transition } => {
            LawFormula::ExponentialStretch { youngs_modulus, nonlinearity, transition }
        }
        Law::Buckling { ref law, compression, buckling_strain } => {
            let inner = law_data(law)?;
            // The behavior in tension of a law that itself buckles is that of its own law in tension.
            return Some(LawData { buckling: Some((compression, buckling_strain)), ..inner });
        }
        Law::Table(_) | Law::Custom(_) => return None,
    };
    Some(LawData { formula, buckling: None })
}

/// Returns the network of a model for a batch; `None` if it cannot evaluate a law, or if an interior node has no
/// fiber.
fn network_data<B: RealBackend>(model: &RveModel<B>) -> Option<NetworkData> {
    let (truss, network) = (model.truss(), model.network());
    let mut laws = Vec::new();
    let mut law_of = Vec::new();
    for (law, range) in truss.laws() {
        law_of.extend(range.map(|_| laws.len() as u32));
        laws.push(law_data(law)?);
    }
    let interior = network.interior().len();
    let mut has_fiber = vec![false; network.nodes().len()];
    truss.ends().as_flattened().iter().for_each(|&node| has_fiber[node as usize] = true);
    if !network.interior().iter().all(|&node| has_fiber[node as usize]) {
        return None;
    }
    let mut number = vec![0; network.nodes().len()];
    for (place, &node) in (0..).zip(network.interior().iter().chain(network.boundary())) {
        number[node as usize] = place;
    }
    Some(NetworkData {
        interior,
        boundary: network.boundary().iter().map(|&node| network.nodes()[node as usize]).collect(),
        ends: truss.ends().iter().map(|ends| ends.map(|node| number[node as usize])).collect(),
        lengths: truss.lengths().to_vec(),
        areas: truss.areas().to_vec(),
        law_of,
        laws,
    })
}

/// What a batch knows of its model beyond the network.
#[derive(Clone, Copy, Debug)]
struct OfModel {
    /// The stress scale.
    scale: f64,
    /// The residual that counts as zero.
    floor: f64,
    /// The interior nodes.
    interior: usize,
    /// The chord steps of an iteration.
    chord_steps: usize,
}

impl OfModel {
    fn new<B: RealBackend>(model: &RveModel<B>) -> Self {
        let interior = model.network().interior().len();
        let (scale, floor, chord_steps) = (model.scale(), model.rounding_floor(), model.chord_steps());
        Self { scale, floor, interior, chord_steps }
    }

    /// Returns the parameters for a batch; `None` if the parameters ask for something else than Newton's method as the
    /// first stage.
    fn params(&self, params: &EquilibriumParams) -> Option<BatchParams> {
        /// A network that needs more is left: others of its group may wait for it.
        const MOST_ITERATIONS: usize = 30;
        let newton = params.newton_for(self.chord_steps);
        let is_plain = newton.step_tolerance.is_none() && newton.energy_tolerance.is_none();
        let is_possible = params.stages.has(Stage::Newton) && is_plain && (1..=8).contains(&newton.nonmonotone_memory);
        is_possible.then_some(BatchParams {
            tolerance: newton.tolerance,
            floor: self.floor,
            max_iterations: newton.max_iterations.min(MOST_ITERATIONS) as u32,
            chord_steps: newton.chord_steps.try_into().unwrap_or(u32::MAX),
            max_backtracks: newton.max_backtracks,
            sufficient_decrease: newton.sufficient_decrease,
            memory: newton.nonmonotone_memory as u32,
            excessive_force: ExcessiveForce::THRESHOLD,
            wants_tangent: true,
        })
    }

    /// Returns the equilibrium that a result describes; `None` with any other outcome.
    fn equilibrium(&self, result: &NetworkResult<'_>, target: &Matrix3<f64>) -> Option<BatchEquilibrium> {
        if result.status() != Status::Converged {
            return None;
        }
        let pk1 = Matrix3::from_row_slice(&result.stress()) * self.scale;
        Some(BatchEquilibrium {
            tangent: tangent_from_form(&result.form(), self.scale, target, &pk1)?,
            pk1,
            energy: self.scale * result.energy(),
            iterations: result.iterations(),
            backtracks: result.backtracks(),
            seconds: None,
        })
    }
}

fn rows(gradient: &Matrix3<f64>) -> [f64; 9] {
    std::array::from_fn(|k| gradient[(k / 3, k % 3)])
}
