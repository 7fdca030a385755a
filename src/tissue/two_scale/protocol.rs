//! The messages between the scales: values per RVE, sent over the couplings, and commands of the load stepping loop.

use std::sync::Arc;
use std::time::Instant;

use nalgebra::Matrix3;
use postcard::ser_flavors::Flavor;
use serde::{Deserialize, Serialize};

use super::piece_messages::FolderName;
use crate::fem::material::Response;
use crate::fem::mesh::IntegrationPoint;
use crate::las::{Message, bytemuck};
use crate::tissue::materials::Formula;
use crate::tissue::micro_scale::{
    DeformedNetwork, Piece, PointFailure, PointNetwork, PointSummary, RveCost, RveMaterial, RveStats, SentMatrix,
    UnitState,
};

/// The name of the scale of the body in `[scales]` of a case.
pub const MACRO: &str = "macro";
/// The name of the scale of the RVEs.
pub const MICRO: &str = "micro";

/// Words that suffice for a formula.
const FORMULA: usize = 20;

crate::payload! {
    /// The data that creates an RVE.
    pub struct NewRve {
        /// Its element, the position of its point in the element, and the number of points of the element.
        pub location: [u64; 3],
        /// The region of the case that its point belongs to.
        region: u64,
        /// The index of its network among the models, plus one; 0 for an RVE without fibers.
        network: u64,
        /// The stress of the RVE over that of its model.
        factor: f64,
        /// 0 without a matrix, 1 for that of the region, 2 for a [`NewMatrix`].
        matrix: u64,
    }
}

crate::payload! {
    /// The matrix of a new RVE, if those of RVEs vary over the body.
    pub struct NewMatrix {
        /// The encoded formula.
        formula: [u64; FORMULA],
    }
}

crate::payload! {
    /// The deformation gradient and the task that the macro scale sends to an RVE.
    pub struct RveTask {
        /// Deformation gradient, column by column.
        pub gradient: [f64; 9],
        /// A [`Task`] as a number.
        pub task: u64,
    }
}

crate::payload! {
    /// The response of an RVE; matrices column by column.
    pub struct RveResponse {
        /// Its point, from 0.
        pub point: u64,
        /// An [`Outcome`] as a number.
        pub outcome: u64,
        /// Energy per reference volume, J/m^3.
        pub energy: f64,
        /// First Piola-Kirchhoff stress, Pa.
        pub pk1: [f64; 9],
        /// Derivative of `pk1` with respect to the deformation gradient, Pa.
        pub tangent: [f64; 81],
    }
}

crate::payload! {
    /// What the result files need of an RVE after a step. Its state stays on its rank.
    pub struct RveSummary {
        /// Its point, from 0.
        pub point: u64,
        /// The rank of the program that solves it.
        pub rank: u64,
        /// The index of its network among the models, plus one; 0 for an RVE without fibers, which has no other values.
        pub network: u64,
        /// Newton iterations of the step.
        pub iterations: u64,
        /// Orientation tensor of its fibers, column by column.
        pub orientation: [f64; 9],
        /// Their principal direction.
        pub direction: [f64; 3],
        /// Their alignment, as in [`PointSummary`].
        pub alignment: f64,
        /// Smallest and largest fiber stretch.
        pub stretch: [f64; 2],
    }
}

impl RveSummary {
    /// The size of the value for an RVE that is not known yet.
    pub const NONE: Self = Self {
        point: 0,
        rank: 0,
        network: 0,
        iterations: 0,
        orientation: [0.0; 9],
        direction: [0.0; 3],
        alignment: 0.0,
        stretch: [0.0; 2],
    };

    /// Packs the summary of the RVE of a point, which a rank solves.
    pub fn new(point: usize, rank: usize, summary: Option<&PointSummary>) -> Self {
        let place = Self { point: point as u64, rank: rank as u64, ..Self::NONE };
        let Some(summary) = summary else { return place };
        let PointSummary { orientation, direction, alignment, stretch, iterations, network } = *summary;
        let mut columns = [0.0; 9];
        columns.copy_from_slice(orientation.as_flattened());
        let (network, iterations) = (network as u64 + 1, iterations as u64);
        Self { network, iterations, orientation: columns, direction, alignment, stretch, ..place }
    }

    /// Returns the summary; `None` if the RVE has no fibers.
    pub fn summary(&self) -> Option<PointSummary> {
        let Self { iterations, orientation, direction, alignment, stretch, .. } = *self;
        let column = |k: usize| std::array::from_fn(|i| orientation[3 * k + i]);
        let (orientation, iterations) = (std::array::from_fn(column), iterations as usize);
        let network = self.network.checked_sub(1)? as usize;
        Some(PointSummary { orientation, direction, alignment, stretch, iterations, network })
    }
}

impl NewRve {
    /// The data of an RVE before they are received.
    pub const NONE: Self = Self { location: [0; 3], region: 0, network: 0, factor: 0.0, matrix: 0 };

    /// Creates an RVE at a point.
    pub fn new(point: IntegrationPoint, material: &RveMaterial) -> Self {
        let IntegrationPoint { element, point, points } = point;
        let PointNetwork { model, factor } = material.network.unwrap_or(PointNetwork { model: 0, factor: 0.0 });
        Self {
            location: [element.into(), point.into(), points.into()],
            region: material.region as u64,
            network: material.network.map_or(0, |_| model as u64 + 1),
            factor,
            matrix: match material.matrix {
                SentMatrix::None => 0,
                SentMatrix::OfRegion => 1,
                SentMatrix::Formula(_) => 2,
            },
        }
    }

    /// Returns its material; `matrix` is what came with it.
    ///
    /// # Errors
    /// Returns an error if the matrix is needed and encodes no formula.
    pub fn material(&self, matrix: &NewMatrix) -> Result<RveMaterial, postcard::Error> {
        let model = self.network.checked_sub(1);
        let matrix = match self.matrix {
            0 => SentMatrix::None,
            1 => SentMatrix::OfRegion,
            _ => SentMatrix::Formula(matrix.formula()?),
        };
        let network = model.map(|model| PointNetwork { model: model as usize, factor: self.factor });
        Ok(RveMaterial { region: self.region as usize, network, matrix })
    }

    /// Returns its point.
    pub fn location(&self) -> IntegrationPoint {
        let [element, point, points] = self.location;
        IntegrationPoint { element: element as u32, point: point as u16, points: points as u16 }
    }
}

impl NewMatrix {
    /// The matrix of an RVE that needs none.
    pub const NONE: Self = Self { formula: [0; FORMULA] };

    /// Packs the matrix of a material, if it has to be sent.
    ///
    /// # Errors
    /// Never in practice: all formulas fit.
    pub fn new(material: &RveMaterial) -> Result<Self, postcard::Error> {
        let mut new = Self::NONE;
        if let SentMatrix::Formula(formula) = &material.matrix {
            postcard::to_slice(formula, bytemuck::cast_slice_mut(&mut new.formula))?;
        }
        Ok(new)
    }

    fn formula(&self) -> Result<Arc<Formula>, postcard::Error> {
        postcard::take_from_bytes(bytemuck::cast_slice(&self.formula)).map(|(formula, _)| formula)
    }
}

/// What an RVE does with a deformation gradient.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum Task {
    /// Nothing: the RVE sleeps or was deleted.
    None = 0,
    /// Finds an equilibrium.
    Solve = 1,
    /// Verifies that the equilibrium found there continues the last committed one, or replaces it by one that does.
    Verify = 2,
}

/// The result of a [`Task`] of an RVE.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Outcome {
    /// The RVE has a response, newly solved for or unchanged.
    Solved = 0,
    /// No equilibrium was found.
    Failed = 1,
    /// Verification replaced the response.
    Replaced = 2,
}

impl RveTask {
    /// Packs a deformation gradient and a task.
    pub fn new(gradient: &Matrix3<f64>, task: Task) -> Self {
        let mut columns = [0.0; 9];
        columns.copy_from_slice(gradient.as_slice());
        Self { gradient: columns, task: task as u64 }
    }

    /// Returns the gradient if its task is `task`.
    pub fn for_task(&self, task: Task) -> Option<Matrix3<f64>> {
        (self.task == task as u64).then(|| Matrix3::from_column_slice(&self.gradient))
    }
}

impl RveResponse {
    /// Packs the response of the RVE of a point; `None` stands for a failure.
    pub fn new(point: usize, response: Option<&Response>, is_replaced: bool) -> Self {
        let outcome = Outcome::Failed as u64;
        let mut packed = Self { point: point as u64, outcome, energy: 0.0, pk1: [0.0; 9], tangent: [0.0; 81] };
        if let Some(response) = response {
            packed.outcome = if is_replaced { Outcome::Replaced } else { Outcome::Solved } as u64;
            packed.energy = response.energy;
            packed.pk1.copy_from_slice(response.pk1.as_slice());
            packed.tangent.copy_from_slice(response.tangent.as_slice());
        }
        packed
    }

    /// Unpacks the response.
    pub fn response(&self) -> Response {
        Response {
            energy: self.energy,
            pk1: Matrix3::from_column_slice(&self.pk1),
            tangent: crate::fiber::homogenize::Tangent::from_column_slice(&self.tangent),
        }
    }
}

/// A command that the macro scale broadcasts to the micro scale.
#[derive(Serialize, Deserialize)]
pub enum Command {
    /// This many points of the body use each model, which decides what is solved in lanes.
    Count(Vec<u64>),
    /// Create and delete RVEs.
    Units,
    /// Migrate RVEs between the ranks if that is due and pays; the micro scale answers with a [`MigrationReport`] or
    /// `None`. The number is what the exchange took in the last sweep on the slowest rank of the macro scale, s;
    /// `None` before the first one.
    ///
    /// [`MigrationReport`]: super::MigrationReport
    Balance(Option<f64>),
    /// Solve at the first trial state of a load step or substep.
    Step,
    /// Carry out a task at another trial state of the same step.
    Iterate(Task),
    /// Send the reason why an RVE found no equilibrium.
    Explain,
    /// Commit: an increment has converged at the last trial state. The argument tells whether the load step ends.
    Commit(bool),
    /// Revert to the last committed state: the step has failed.
    Revert,
    /// Write the states of the RVEs of each rank to a piece.
    Save {
        /// The folder of the pieces.
        folder: FolderName,
        /// The beginning of their names.
        stem: String,
    },
    /// Verify pieces, each on one of the ranks.
    Verify(FolderName, Vec<Piece>),
    /// Restore all RVEs from pieces.
    Restore(FolderName, Vec<Piece>),
    /// End: all steps are done.
    Complete,
}

/// The report of a rank of the micro scale at the end of a step.
#[derive(Serialize, Deserialize)]
pub struct RankReport<N = Vec<(u64, Option<DeformedNetwork>)>> {
    /// Counters of the work of its RVEs.
    pub stats: RveStats,
    /// Bytes that its RVEs own.
    pub bytes: usize,
    /// Its times, one entry per trial state.
    pub times: Vec<RankTimes>,
    /// What each of its RVEs cost, one entry per trial state; empty unless that is part of the output.
    pub costs: Vec<Vec<RveCost>>,
    /// The rank correlation of expected and measured costs of all RVEs of the scale, if they were compared.
    pub skill: Option<f64>,
    /// The points whose deformed networks are part of the output, and the networks of those that have one; empty if the
    /// step was reverted.
    pub networks: N,
}

/// An RVE that found no equilibrium.
#[derive(Serialize, Deserialize)]
pub struct RveFailure {
    /// The error message, with point and network.
    pub failure: PointFailure,
    /// The network of its point, its start state, and the requested gradient, column by column; `None` if no network
    /// failed.
    pub start: Option<(PointNetwork, UnitState, [f64; 9])>,
}

/// How a rank spent its time since its previous report, s.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct RankTimes {
    /// Number of the rank among all ranks.
    pub rank: usize,
    /// Time spent computing.
    pub busy: f64,
    /// Time spent waiting for messages that had not arrived.
    pub idle: f64,
    /// Time spent packing, sending, receiving and unpacking messages.
    #[serde(rename = "exchanging")]
    pub communication: f64,
    /// Time spent planning and carrying out migrations of RVEs.
    pub balancing: f64,
    /// RVEs on the rank.
    pub rves: usize,
    /// Newton iterations of its RVEs.
    pub iterations: usize,
}

impl RankTimes {
    /// Returns times of zero.
    pub(super) fn of_rank(rank: usize) -> Self {
        Self { rank, ..Self::default() }
    }

    /// Returns the times and resets them to zero.
    pub(super) fn take(&mut self) -> Self {
        std::mem::replace(self, Self::of_rank(self.rank))
    }

    /// Adds the time since `start` to the communication.
    pub(super) fn add_communication(&mut self, start: Instant) {
        self.communication += start.elapsed().as_secs_f64();
    }
}

/// Serializes a value into a new message.
///
/// # Errors
/// Never in practice: postcard can encode every type of this module.
pub fn pack<T: Serialize>(value: &T) -> Result<Message, postcard::Error> {
    postcard::serialize_with_flavor(value, Packing { message: Message::zeros(64), packed: 0 })
}

/// A postcard flavor that appends bytes to a message, of which the first `packed` are filled.
struct Packing {
    message: Message,
    packed: usize,
}

impl Flavor for Packing {
    type Output = Message;

    fn try_push(&mut self, byte: u8) -> postcard::Result<()> {
        self.try_extend(&[byte])
    }

    fn try_extend(&mut self, bytes: &[u8]) -> postcard::Result<()> {
        let end = self.packed + bytes.len();
        if end > self.message.len() {
            self.message.resize(end.max(2 * self.message.len()));
        }
        self.message.bytes_mut()[self.packed..end].copy_from_slice(bytes);
        self.packed = end;
        Ok(())
    }

    fn finalize(mut self) -> postcard::Result<Message> {
        self.message.resize(self.packed);
        Ok(self.message)
    }
}

/// Deserializes the value from a message of [`pack`].
///
/// # Errors
/// Returns an error if the bytes do not encode a `T`.
pub fn unpack<T: for<'de> Deserialize<'de>>(message: &Message) -> Result<T, postcard::Error> {
    postcard::from_bytes(message.bytes())
}

#[cfg(test)]
mod tests {
    use nalgebra::Vector3;

    use super::*;
    use crate::fem::material::{
        Guccione, HolmesMow, HolzapfelGasserOgden, LinearElastic, NeoHookean, TransverseModuli,
    };
    use crate::tissue::materials::TransverseFormula;

    /// Every formula fits into the data of a new RVE, and arrives with the same bits.
    #[test]
    fn new_rves_bring_their_material_along() {
        let (mu, lambda, axis) = (1.0 / 3.0, 2.0e9 / 7.0, Vector3::new(1.0, 2.0, 3.0).normalize());
        let moduli = TransverseModuli {
            youngs_modulus: 2.5e3,
            poisson_ratio: 0.25,
            axial_youngs_modulus: 4.0e3,
            axial_shear_modulus: 1.0e3,
        };
        let (k1, k2, dispersion, axes) = (mu, lambda, 0.1, [Some(axis), Some(axis.yzx())]);
        let formulas = [
            Formula::NeoHookean(NeoHookean { mu, lambda }),
            Formula::LinearElastic(LinearElastic { mu, lambda }),
            Formula::HolmesMow(HolmesMow { mu, lambda, beta: 0.7 }),
            Formula::TransverselyIsotropic(TransverseFormula::new(moduli, axis.into()).unwrap()),
            Formula::HolzapfelGasserOgden(HolzapfelGasserOgden { mu, k1, k2, dispersion, bulk_modulus: lambda, axes }),
            Formula::Guccione(Guccione { c: mu, bf: 1.0, bt: 2.0, bfs: 3.0, bulk_modulus: lambda, axis }),
        ];
        let location = IntegrationPoint { element: u32::MAX - 1, point: 26, points: 27 };
        for formula in formulas {
            let network = Some(PointNetwork { model: 7, factor: 0.1 });
            let matrix = SentMatrix::Formula(Arc::new(formula));
            for (network, matrix) in [(network, matrix), (None, SentMatrix::OfRegion), (network, SentMatrix::None)] {
                let material = RveMaterial { region: 3, network, matrix };
                let (new, matrix) = (NewRve::new(location, &material), NewMatrix::new(&material).unwrap());
                assert_eq!((new.location(), new.material(&matrix).unwrap()), (location, material));
            }
        }
    }
}
