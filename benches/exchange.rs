//! Cost of the coupling: a million units of 72 bytes from one rank to another, compared with a bare `MPI_Alltoallv` of
//! the same bytes on the same processes, and between threads; and round trips to a micro model with negligible work.
//!
//! This program starts itself on two processes; the environment variable `MPIRUN` selects a launcher other than
//! `mpirun`. Without `--bench` everything runs once with few units.

#[path = "../tests/support/launcher.rs"]
mod launcher;

use std::process::ExitCode;
use std::time::Instant;

use biotissue::backends::comm::mpi::{self as processes, MpiComm};
use biotissue::backends::comm::thread::{self, ThreadComm};
use biotissue::coupling::{Channel, Coupling, CouplingError, EvenPartition, Plan, Role, Scales, Share, UnitId};
use biotissue::las::Comm;
use mpi::datatype::{Partition, PartitionMut};
use mpi::topology::SimpleCommunicator;
use mpi::traits::CommunicatorCollectives;

type Error = Box<dyn std::error::Error>;

/// The value of a unit: nine numbers, like a stress or a deformation gradient.
type Unit = [f64; 9];

/// The environment variable that marks the two started processes.
const LAUNCHED: &str = "BIOTISSUE_EXCHANGE_BENCH";

/// The size of the measurement.
#[derive(Clone, Copy)]
struct Extent {
    units: usize,
    repetitions: usize,
}

fn main() -> ExitCode {
    let is_whole = std::env::args().any(|word| word == "--bench");
    let (units, repetitions) = if is_whole { (1_000_000, 20) } else { (1000, 1) };
    let extent = Extent { units, repetitions };
    if std::env::var_os(LAUNCHED).is_some() {
        processes::run(|comm| between_processes(&comm, extent), |_| 1);
        return ExitCode::SUCCESS;
    }
    match launch().and_then(|()| between_threads(extent)).and_then(|()| micro_models(extent)) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("error: {error}");
            ExitCode::FAILURE
        }
    }
}

/// Starts the measurement between two processes.
fn launch() -> Result<(), Error> {
    let mut command = launcher::Launcher::find()?.command(2, 1200)?;
    let status = command.args(std::env::args().skip(1)).env(LAUNCHED, "1").status()?;
    if status.success() { Ok(()) } else { Err(format!("{command:?}: {status}").into()) }
}

/// The times of repeated runs, ascending, in seconds.
struct Times(Vec<f64>);

impl Times {
    fn of(mut times: Vec<f64>) -> Self {
        times.sort_by(f64::total_cmp);
        Self(times)
    }

    fn best(&self) -> f64 {
        self.0[0]
    }

    fn median(&self) -> f64 {
        self.0[self.0.len() / 2]
    }

    /// Prints a row of a table of bandwidths.
    fn print(&self, name: &str, units: usize) {
        let rate = |seconds: f64| (units * size_of::<Unit>()) as f64 / seconds / 1e9;
        let (best, median) = (self.best(), self.median());
        println!("| {name} | {best:.4} | {median:.4} | {:.2} | {:.2} |", rate(best), rate(median));
    }
}

fn print_head(title: &str) {
    println!("\n{title}\n");
    println!("| | best, s | median, s | best, GB/s | median, GB/s |");
    println!("|---|---|---|---|---|");
}

/// Returns the seconds until the last rank has finished `work`, which all ranks start together. Collective.
fn seconds<C: Comm>(comm: &C, work: impl FnOnce() -> Result<(), CouplingError>) -> Result<f64, Error> {
    comm.barrier()?;
    let start = Instant::now();
    work()?;
    let mut taken = [start.elapsed().as_secs_f64()];
    comm.max(&mut taken)?;
    Ok(taken[0])
}

/// Creates a coupling from one producing rank to all others.
fn couple<C: Comm>(comm: &C, units: usize) -> Result<Coupling<C>, Error> {
    let plan = Plan::default().with("macro", Share::Count(1)).with("micro", Share::Ratio(1.0));
    let scales = Scales::new(comm, &plan)?;
    let own: Vec<UnitId> = if scales.own() == 0 { (0..units as UnitId).collect() } else { Vec::new() };
    Ok(Coupling::new(&scales, "macro", "micro", &own, &[], &EvenPartition)?)
}

/// A transfer of values from one rank to the other.
struct OneWay<C: Comm> {
    coupling: Coupling<C>,
    channel: Channel<Unit>,
    values: Vec<Unit>,
}

impl<C: Comm> OneWay<C> {
    fn new(comm: &C, units: usize) -> Result<Self, Error> {
        let coupling = couple(comm, units)?;
        let value = |k: usize| match coupling.role() {
            Role::Producer => [k as f64; 9],
            Role::Consumer => [f64::NAN; 9],
        };
        let values = (0..coupling.units().len()).map(value).collect();
        Ok(Self { channel: Channel::new(&coupling)?, coupling, values })
    }

    fn exchange(&mut self) -> Result<(), CouplingError> {
        match self.coupling.role() {
            Role::Producer => self.channel.send(&self.coupling, &self.values),
            Role::Consumer => self.channel.receive(&self.coupling, &mut self.values),
        }
    }

    fn check(&self) {
        assert!(self.values.iter().enumerate().all(|(k, value)| *value == [k as f64; 9]), "all values arrived");
    }
}

/// A transfer of the same bytes by `MPI_Alltoallv`, from rank 0 to rank 1.
struct Bare {
    world: SimpleCommunicator,
    sent: Vec<f64>,
    received: Vec<f64>,
    /// Count of numbers sent to rank 0 and rank 1, and received from them.
    to: [i32; 2],
    from: [i32; 2],
}

impl Bare {
    fn new(rank: usize, units: usize) -> Result<Self, Error> {
        let len = 9 * units;
        let count = i32::try_from(len)?;
        let numbers: Vec<f64> = (0..len).map(|k| (k / 9) as f64).collect();
        let (sent, received, to, from) = match rank {
            0 => (numbers, Vec::new(), [0, count], [0, 0]),
            _ => (Vec::new(), vec![f64::NAN; len], [0, 0], [count, 0]),
        };
        Ok(Self { world: SimpleCommunicator::world(), sent, received, to, from })
    }

    fn exchange(&mut self) {
        let first = [0_i32; 2];
        let sent = Partition::new(&self.sent[..], self.to, first);
        let mut received = PartitionMut::new(&mut self.received[..], self.from, first);
        self.world.all_to_all_varcount_into(&sent, &mut received);
    }

    fn check(&self) {
        assert!(self.received.iter().enumerate().all(|(k, &value)| value == (k / 9) as f64), "all values arrived");
    }
}

fn between_processes(comm: &MpiComm, extent: Extent) -> Result<(), Error> {
    let (mut coupled, mut bare) = (OneWay::new(comm, extent.units)?, Bare::new(comm.rank(), extent.units)?);
    let (mut by_carrier, mut by_hand) = (Vec::new(), Vec::new());
    // The two transfers alternate, so that both see the same load; the first repetition of each is a warm-up.
    for repetition in 0..=extent.repetitions {
        let carried = seconds(comm, || coupled.exchange())?;
        let handed = seconds(comm, || {
            bare.exchange();
            Ok(())
        })?;
        if repetition > 0 {
            by_carrier.push(carried);
            by_hand.push(handed);
        }
    }
    coupled.check();
    bare.check();
    if comm.rank() == 0 {
        let (by_carrier, by_hand) = (Times::of(by_carrier), Times::of(by_hand));
        print_head(&format!("{} units of {} bytes between two processes", extent.units, size_of::<Unit>()));
        by_carrier.print("`Channel`", extent.units);
        by_hand.print("`MPI_Alltoallv`", extent.units);
        let (best, median) = (by_hand.best() / by_carrier.best(), by_hand.median() / by_carrier.median());
        println!("\n`Channel` has {:.0} % of the bandwidth (median {:.0} %).", 100.0 * best, 100.0 * median);
    }
    Ok(())
}

fn between_threads(extent: Extent) -> Result<(), Error> {
    let all = thread::run(2, |comm: ThreadComm| -> Result<Vec<f64>, Error> {
        let mut coupled = OneWay::new(&comm, extent.units)?;
        let mut times = Vec::new();
        for _ in 0..=extent.repetitions {
            times.push(seconds(&comm, || coupled.exchange())?);
        }
        coupled.check();
        Ok(times.split_off(1))
    })?;
    print_head(&format!("{} units of {} bytes between two threads", extent.units, size_of::<Unit>()));
    // All ranks have the same times.
    all.into_iter().take(1).for_each(|times| Times::of(times).print("`Channel`", extent.units));
    Ok(())
}

/// A round trip: one number per unit is sent, and three times that number is returned.
struct MicroModel<C: Comm> {
    coupling: Coupling<C>,
    inverse: Coupling<C>,
    there: Channel<f64>,
    back: Channel<f64>,
    values: Vec<f64>,
    answers: Vec<f64>,
}

impl<C: Comm> MicroModel<C> {
    fn new(comm: &C, units: usize) -> Result<Self, Error> {
        let coupling = couple(comm, units)?;
        let inverse = coupling.inverse();
        let (there, back) = (Channel::new(&coupling)?, Channel::new(&inverse)?);
        let values: Vec<f64> = coupling.units().iter().map(|&unit| unit as f64).collect();
        Ok(Self { answers: vec![f64::NAN; values.len()], coupling, inverse, there, back, values })
    }

    fn exchange(&mut self) -> Result<(), CouplingError> {
        match self.coupling.role() {
            Role::Producer => {
                self.there.send(&self.coupling, &self.values)?;
                self.back.receive(&self.inverse, &mut self.answers)
            }
            Role::Consumer => {
                self.there.receive(&self.coupling, &mut self.values)?;
                self.answers.iter_mut().zip(&self.values).for_each(|(answer, value)| *answer = 3.0 * value);
                self.back.send(&self.inverse, &self.answers)
            }
        }
    }

    fn check(&self) {
        let units = self.coupling.units();
        assert!(self.answers.iter().zip(units).all(|(&answer, &unit)| answer == 3.0 * unit as f64), "all answers came");
    }
}

fn micro_models(extent: Extent) -> Result<(), Error> {
    println!("\nA number there and three times of it back, between threads\n");
    println!("| ranks | units | best, µs a unit and exchange | median, µs a unit and exchange |");
    println!("|---|---|---|---|");
    for consumers in [1, 3] {
        for units in [1000, 10_000, 100_000] {
            let units = units.min(extent.units);
            let all = thread::run(1 + consumers, |comm: ThreadComm| micro_times(&comm, units, extent.repetitions))?;
            for times in all.into_iter().take(1).map(Times::of) {
                let each = |seconds: f64| 1e6 * seconds / units as f64;
                println!("| 1 + {consumers} | {units} | {:.4} | {:.4} |", each(times.best()), each(times.median()));
            }
        }
    }
    Ok(())
}

fn micro_times<C: Comm>(comm: &C, units: usize, repetitions: usize) -> Result<Vec<f64>, Error> {
    let mut model = MicroModel::new(comm, units)?;
    let mut times = Vec::new();
    for _ in 0..=repetitions {
        times.push(seconds(comm, || model.exchange())?);
    }
    model.check();
    Ok(times.split_off(1))
}
