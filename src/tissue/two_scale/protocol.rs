//! The messages between the scales: values of units over the couplings, and the commands of the loop.

use nalgebra::Matrix3;
use postcard::ser_flavors::Flavor;
use serde::{Deserialize, Serialize, Serializer};

use crate::fem::material::Response;
use crate::las::Message;
use crate::tissue::checkpoint::UnitRecord;
use crate::tissue::micro_scale::{DeformedNetwork, PointFailure, PointSummary, SweepStats, UnitState};

/// The names of the scales, as `[scales]` of a case has them.
pub const MACRO: &str = "macro";
/// The scale of the RVEs.
pub const MICRO: &str = "micro";

crate::payload! {
    /// What a new RVE is made of.
    pub struct Header {
        /// The region of the case that its element lies in.
        pub region: u64,
    }
}

crate::payload! {
    /// What an RVE is asked.
    pub struct Strain {
        /// Deformation gradient, column by column.
        pub gradient: [f64; 9],
        /// What is to be done there: a [`Task`] as a number.
        pub task: u64,
    }
}

crate::payload! {
    /// What an RVE answers; matrices column by column.
    pub struct Answer {
        /// Its element.
        pub element: u64,
        /// An [`Outcome`] as a number.
        pub outcome: u64,
        /// Energy per reference volume, J/m^3.
        pub energy: f64,
        /// First Piola-Kirchhoff stress, Pa.
        pub pk1: [f64; 9],
        /// Its derivative by the deformation gradient, Pa.
        pub tangent: [f64; 81],
    }
}

/// What an RVE is to do at a gradient.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Task {
    /// Nothing: it sleeps, or was deleted.
    Rest = 0,
    /// Find an equilibrium.
    Solve = 1,
    /// Make the equilibrium found there continue the last committed one.
    Verify = 2,
}

/// How an RVE came to its answer.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Outcome {
    /// As before, or solved for.
    Found = 0,
    /// There is no equilibrium.
    Failed = 1,
    /// Verification replaced the answer.
    Replaced = 2,
}

impl Strain {
    /// Of a gradient.
    #[must_use]
    pub fn new(gradient: &Matrix3<f64>, task: Task) -> Self {
        let mut columns = [0.0; 9];
        columns.copy_from_slice(gradient.as_slice());
        Self { gradient: columns, task: task as u64 }
    }

    /// The gradient, where there is this to do at it.
    #[must_use]
    pub fn for_task(&self, task: Task) -> Option<Matrix3<f64>> {
        (self.task == task as u64).then(|| self.matrix())
    }

    /// The gradient as a matrix.
    #[must_use]
    pub fn matrix(&self) -> Matrix3<f64> {
        Matrix3::from_column_slice(&self.gradient)
    }
}

impl Answer {
    /// Of an element whose RVE found one, or none.
    #[must_use]
    pub fn new(element: usize, response: Option<&Response>, is_replaced: bool) -> Self {
        let outcome = Outcome::Failed as u64;
        let mut answer = Self { element: element as u64, outcome, energy: 0.0, pk1: [0.0; 9], tangent: [0.0; 81] };
        if let Some(response) = response {
            answer.outcome = if is_replaced { Outcome::Replaced } else { Outcome::Found } as u64;
            answer.energy = response.energy;
            answer.pk1.copy_from_slice(response.pk1.as_slice());
            answer.tangent.copy_from_slice(response.tangent.as_slice());
        }
        answer
    }

    /// What it says.
    #[must_use]
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
    /// RVEs are created and deleted.
    Units,
    /// A load step, or a part of one, begins with a trial state.
    Step,
    /// Another trial state of the same step.
    Iterate,
    /// Why RVEs found no equilibrium.
    Explain,
    /// The step has converged at the last trial state.
    Accept,
    /// The step has failed: back to the last one.
    Reject,
    /// All RVEs are to be as they were when they were saved: their elements, ascending, and states.
    Restore(Vec<(u64, UnitRecord)>),
    /// All steps are done.
    Complete,
}

/// What a rank of the micro scale says of a step that is over.
#[derive(Serialize, Deserialize)]
pub struct RankReport<U = Vec<UnitReport>> {
    /// What its RVEs have taken.
    pub stats: SweepStats,
    /// Bytes that they own.
    pub bytes: usize,
    /// Where its time went, trial state by trial state.
    pub seconds: Vec<Seconds>,
    /// Its RVEs, if the step converged.
    pub units: U,
}

/// What is made one by one while it is packed: all RVEs may take as much memory as the body itself.
pub struct OneByOne<F>(pub F);

impl<I: Iterator<Item: Serialize>, F: Fn() -> I> Serialize for OneByOne<F> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_seq((self.0)())
    }
}

/// An RVE after a step.
#[derive(Serialize, Deserialize)]
pub struct UnitReport {
    /// Its element.
    pub element: u64,
    /// What pictures show.
    pub summary: Option<PointSummary>,
    /// What it remembers.
    pub state: UnitRecord,
    /// Its deformed network, if it is to be drawn: number of the model; positions, stretches, forces.
    pub network: Option<Drawn>,
}

/// A deformed network without what every rank knows of it.
#[derive(Serialize, Deserialize)]
pub struct Drawn {
    /// The number of its model.
    pub model: usize,
    /// Positions of the nodes.
    pub positions: Vec<[f64; 3]>,
    /// Stretch of every fiber.
    pub stretches: Vec<f64>,
    /// Force of every fiber, N.
    pub forces: Vec<f64>,
}

impl Drawn {
    /// Of a network.
    #[must_use]
    pub fn new(model: usize, deformed: DeformedNetwork) -> Self {
        let DeformedNetwork { positions, stretches, forces, .. } = deformed;
        Self { model, positions, stretches, forces }
    }
}

impl From<UnitState> for UnitReport {
    fn from(state: UnitState) -> Self {
        Self { element: 0, summary: None, state: state.into(), network: None }
    }
}

/// An RVE without an equilibrium, in words, with what repeats it.
#[derive(Serialize, Deserialize)]
pub struct Failed {
    /// What it says.
    pub failure: PointFailure,
    /// The number of its model, its state, and the gradient asked for, column by column.
    pub start: Option<(usize, UnitRecord, [f64; 9])>,
}

/// Where the time of a rank went, s.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Seconds {
    /// It worked.
    pub busy: f64,
    /// It waited for messages that had not come.
    pub idle: f64,
    /// It packed, sent, received and took apart what it exchanged.
    pub exchanging: f64,
}

impl Seconds {
    /// Busy, idle, exchanging.
    #[must_use]
    pub fn numbers(self) -> [f64; 3] {
        [self.busy, self.idle, self.exchanging]
    }

    /// What [`numbers`](Self::numbers) gave.
    #[must_use]
    pub fn of(numbers: &[f64]) -> Option<Self> {
        let &[busy, idle, exchanging] = numbers else { return None };
        Some(Self { busy, idle, exchanging })
    }
}

/// A value in bytes.
///
/// # Errors
/// None in practice: all values here have such a form.
pub fn pack<T: Serialize>(value: &T) -> Result<Message, postcard::Error> {
    pack_into(Message::zeros(64), value)
}

/// The same, in a message that is as long as it may become; a longer one costs copies.
///
/// # Errors
/// As for [`pack`].
pub fn pack_into<T: Serialize>(message: Message, value: &T) -> Result<Message, postcard::Error> {
    postcard::serialize_with_flavor(value, Packing { message, packed: 0 })
}

/// Bytes that are written into a message, behind those that are there.
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

/// The value of [`pack`].
///
/// # Errors
/// Where the bytes are of something else.
pub fn unpack<T: for<'de> Deserialize<'de>>(message: &Message) -> Result<T, postcard::Error> {
    postcard::from_bytes(message.bytes())
}
