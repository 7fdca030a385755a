//! Measures load balancing on units that cost a known time: idle shares of eight ranks without balancing, with the
//! scheme of the reference text, and with the default of `biotissue`.
//!
//! ```text
//! cargo run --release --package studies --bin balance                             # ranks are threads
//! mpirun --oversubscribe -n 9 target/release/balance                              # built with --features mpi
//! ```
//!
//! prints a table of `docs/coupling.md`. An argument, as in `balance 8`, sets the number of sweeps. A unit sleeps instead of
//! computing, so that any number of cores suffices. The ranks compute 60 sweeps of 40 units each, at first 40 units on every
//! rank; four sweeps are a load step:
//!
//! | load | costs of the units |
//! |---|---|
//! | static | 5 to 15 ms, rising along the sequence of units |
//! | drifting | 5 to 15 ms; the most expensive place moves through the units in all sweeps |
//! | heavy tail | 5 ms; 3 % of the units, all near each other at first, 25 ms |
//! | random | a new cost in every sweep: 5 ms, and for a random 3 % of the units 25 ms |
//!
//! The default carries out a migration before the next sweep (`when = "iteration"` of a case), or at the end of the step
//! (`when = "step"`). The patient trigger waits for three unbalanced sweeps with max/mean of 1.35, and three more after a
//! migration. The bound is what remains if every sweep is balanced perfectly: a sweep takes at least the mean load, and at
//! least as long as its largest unit.

use std::error::Error;
use std::f64::consts::TAU;
use std::time::{Duration, Instant};

use biotissue::coupling::balance::{
    self, Balancer, Cost, CostHistory, Diffusive, Greedy, Iterations, Moves, Predictor, Quantity, TriggerParams,
    UnitLoads, Weights, max_over_mean, migrate,
};
use biotissue::coupling::{Channel, Comm, Coupling, EvenPartition, Message, Plan, Role, Scales, Share};
use biotissue::las::conformance::Random;
use biotissue::tissue::two_scale::When;

const RANKS: usize = 8;
const UNITS: usize = 40 * RANKS;
/// Sweeps of a load step, at whose end the text's scheme balances.
const SWEEPS_OF_STEP: usize = 4;
const SECONDS: f64 = 5e-3;

#[derive(Clone, Copy)]
enum Load {
    Static,
    Drifting,
    HeavyTail,
    Random,
}

const LOADS: [(&str, Load); 4] =
    [("static", Load::Static), ("drifting", Load::Drifting), ("heavy tail", Load::HeavyTail), ("random", Load::Random)];

/// The number of sweeps of each run.
fn sweeps() -> usize {
    std::env::args().nth(1).and_then(|count| count.parse().ok()).unwrap_or(60)
}

/// Returns the seconds that a unit takes in a sweep of `sweeps`.
fn seconds(load: Load, unit: u64, (sweep, sweeps): (usize, usize)) -> f64 {
    let place = unit as f64 / UNITS as f64;
    let is_chosen = |seed: u64| Random::new(seed).below(100) < 3;
    SECONDS
        * match load {
            Load::Static => 1.0 + 2.0 * place,
            Load::Drifting => 2.0 + (TAU * (place - sweep as f64 / sweeps as f64)).cos(),
            Load::HeavyTail if place < 0.03 => 5.0,
            Load::Random if is_chosen(unit + (UNITS * sweep) as u64) => 5.0,
            Load::HeavyTail | Load::Random => 1.0,
        }
}

/// How the ranks balance their load.
struct Scheme {
    name: &'static str,
    kind: Kind,
}

enum Kind {
    Nothing,
    /// Newton iterations since the last migration, at the end of every step with an imbalance of 5 % or more.
    Text,
    /// The predictor with single moves, and this trigger.
    Ours(TriggerParams, When),
}

fn schemes() -> Vec<Scheme> {
    let patient = TriggerParams { threshold: 1.35, sweeps: 3, cool_down: 3, ..TriggerParams::default() };
    vec![
        Scheme { name: "nothing", kind: Kind::Nothing },
        Scheme { name: "text", kind: Kind::Text },
        Scheme { name: "default", kind: Kind::Ours(TriggerParams::default(), When::Iteration) },
        Scheme { name: "default, at step ends", kind: Kind::Ours(TriggerParams::default(), When::Step) },
        Scheme { name: "default, patient trigger", kind: Kind::Ours(patient, When::Iteration) },
    ]
}

/// The sums over the sweeps of a run.
#[derive(Default)]
struct Shares {
    longest: f64,
    least: f64,
    mean: f64,
    bound: f64,
    wall: f64,
    moved: usize,
    migrations: usize,
}

impl Shares {
    fn add(&mut self, busy: &[f64], largest: f64) {
        let mean = busy.iter().sum::<f64>() / busy.len() as f64;
        self.longest += busy.iter().copied().fold(0.0, f64::max);
        self.least += busy.iter().copied().fold(f64::INFINITY, f64::min);
        self.mean += mean;
        self.bound += mean.max(largest);
    }
}

type Outcome<T> = Result<T, Box<dyn Error>>;

/// The units of one rank.
struct Cells<C: Comm> {
    scale: C,
    coupling: Coupling<C>,
    histories: Vec<CostHistory>,
    shares: Shares,
}

impl<C: Comm> Cells<C> {
    /// Sleeps for every unit; returns their costs.
    fn sweep(&mut self, load: Load, sweep: (usize, usize)) -> Outcome<Vec<Cost>> {
        let start = Instant::now();
        let costs: Vec<Cost> = (self.coupling.units().iter())
            .map(|&unit| {
                let (start, planned) = (Instant::now(), seconds(load, unit, sweep));
                std::thread::sleep(Duration::from_secs_f64(planned));
                let seconds = start.elapsed().as_secs_f64();
                Cost { iterations: (1e3 * planned).round(), seconds, ..Cost::default() }
            })
            .collect();
        let own = [start.elapsed().as_secs_f64(), costs.iter().map(|cost| cost.seconds).fold(0.0, f64::max)];
        let all = self.scale.gather_all(Message::of(&own))?;
        let all: Vec<[f64; 2]> =
            all.iter().filter_map(|message| message.values::<[f64; 2]>()).flatten().copied().collect();
        let busy: Vec<f64> = all.iter().map(|rank| rank[0]).collect();
        self.shares.add(&busy, all.iter().map(|rank| rank[1]).fold(0.0, f64::max));
        Ok(costs)
    }

    /// Appends costs to the histories; returns the seconds of this rank.
    fn record(&mut self, weights: &mut impl Weights, costs: &[Cost]) -> Outcome<f64> {
        balance::record(&self.scale, weights, &mut self.histories, costs)?;
        Ok(costs.iter().map(|cost| cost.seconds).sum())
    }

    /// The measured max/mean of a sweep.
    fn imbalance(&self, seconds: f64) -> Outcome<f64> {
        let all = self.scale.gather_all(Message::of(&[seconds]))?;
        Ok(max_over_mean(&all.iter().filter_map(|all| all.values::<f64>()?.first().copied()).collect::<Vec<f64>>()))
    }

    /// The weights of the units; their states have a kilobyte each.
    fn weights(&self, weights: &impl Weights) -> (Vec<f64>, Vec<u64>) {
        (self.histories.iter().map(|history| weights.weight(history)).collect(), vec![1000; self.histories.len()])
    }

    /// Balances as the reference text does, whatever it costs.
    fn balance_by_the_text(&mut self) -> Outcome<()> {
        let (weights, bytes) = self.weights(&Iterations);
        let (_, plan) = balance::plan(&self.scale, &Greedy, &weights, &bytes)?;
        self.migrate(plan.of(self.scale.rank()), plan.len())
    }

    /// Balances if that pays.
    fn balance(&mut self, weights: &impl Weights, balancer: &mut Balancer) -> Outcome<()> {
        let (weights, bytes) = self.weights(weights);
        let own = UnitLoads { weights: &weights, bytes: &bytes, partners: &[] };
        let (scale, histories) = (&self.scale, &mut self.histories);
        let Some(due) = balancer.plan(scale, &Diffusive::default(), own, histories)? else {
            // The body waits for an update: one that moves nothing.
            return self.migrate(&Moves::default(), 0);
        };
        let start = Instant::now();
        self.migrate(due.moves(self.scale.rank()), due.units())?;
        Ok(balancer.migrated(&self.scale, &due, start.elapsed().as_secs_f64())?)
    }

    /// Moves units with their histories, `moved` of them on all ranks, and updates the coupling.
    fn migrate(&mut self, moves: &Moves, moved: usize) -> Outcome<()> {
        let units = self.coupling.units().to_vec();
        let histories = &self.histories;
        let (migration, arrived) = migrate(&self.scale, moves, &units, |unit| Message::of(&[histories[unit]]))?;
        let arrived = arrived.iter().map(|message| message.values().and_then(|values| values.first().copied()));
        let arrived = arrived.collect::<Option<Vec<CostHistory>>>().ok_or("a history is missing")?;
        self.histories = migration.apply(std::mem::take(&mut self.histories), arrived)?;
        if moved > 0 {
            self.histories.iter_mut().for_each(CostHistory::restart);
            self.shares.migrations += 1;
        }
        self.shares.moved += moved;
        self.coupling.migrate(&migration)?;
        Ok(())
    }
}

/// A run on one rank; the root of the units returns the shares.
fn run<C: Comm>(world: &C, load: Load, scheme: &Scheme) -> Outcome<Option<Shares>> {
    let plan = Plan::default().with("body", Share::Count(1)).with("cells", Share::Count(RANKS));
    let scales = Scales::new(world, &plan)?;
    let units: Vec<u64> = if scales.own() == 0 { (0..UNITS as u64).collect() } else { Vec::new() };
    let mut coupling = Coupling::new(&scales, "body", "cells", &units, &[], &EvenPartition)?;
    let (mut tasks, mut answers) = (Channel::<f64>::new(&coupling)?, Channel::<u64>::new(&coupling)?);
    let (start, sweeps) = (Instant::now(), sweeps());
    if coupling.role() == Role::Producer {
        for _ in 0..sweeps {
            tasks.send(&coupling, &vec![1.0; UNITS])?;
            let mut from = vec![0; UNITS];
            answers.receive(&coupling.inverse(), &mut from)?;
            assert_eq!(from, units, "every answer comes from its unit");
            if scales.receive(1)?.values::<u64>() == Some(&[1]) {
                coupling.reconcile_migrated()?;
            }
        }
        return Ok(None);
    }
    let mut cells = Cells { scale: scales.comm().clone(), histories: Vec::new(), coupling, shares: Shares::default() };
    cells.histories = vec![CostHistory::default(); cells.coupling.units().len()];
    let params = if let Kind::Ours(params, _) = scheme.kind { params } else { TriggerParams::default() };
    let (mut balancer, mut predictor) = (Balancer::new(params), Predictor::new(Quantity::Seconds, 1));
    for sweep in 0..sweeps {
        let mut strains = vec![0.0; cells.coupling.units().len()];
        tasks.receive(&cells.coupling, &mut strains)?;
        let costs = cells.sweep(load, (sweep, sweeps))?;
        answers.send(&cells.coupling.inverse(), cells.coupling.units())?;
        let ends_step = (sweep + 1) % SWEEPS_OF_STEP == 0;
        let seconds = match scheme.kind {
            Kind::Ours(..) => cells.record(&mut predictor, &costs)?,
            _ => cells.record(&mut Iterations, &costs)?,
        };
        // The body must know whether its coupling changes before it can.
        let due = match scheme.kind {
            Kind::Nothing => false,
            Kind::Text => ends_step && cells.imbalance(seconds)? >= 1.05,
            Kind::Ours(_, when) => {
                balancer.observe(&cells.scale, seconds, &mut cells.histories, &costs)?;
                balancer.is_due() && (when == When::Iteration || ends_step)
            }
        };
        scales.broadcast(0, Message::of(&[u64::from(due)]))?;
        match scheme.kind {
            Kind::Ours(..) if due => cells.balance(&predictor, &mut balancer)?,
            _ if due => cells.balance_by_the_text()?,
            _ => {}
        }
    }
    cells.shares.wall = start.elapsed().as_secs_f64();
    Ok((cells.scale.rank() == 0).then_some(cells.shares))
}

/// All runs of one rank.
fn all_runs<C: Comm>(world: &C) -> Outcome<()> {
    for (name, load) in LOADS {
        for scheme in schemes() {
            if let Some(shares) = run(world, load, &scheme)? {
                let Shares { longest, least, mean, bound, wall, moved, migrations } = shares;
                let percent = |time: f64| 100.0 * (1.0 - time / longest);
                println!(
                    "| {name} | {} | {:.1} % | {:.1} % | {:.1} % | {:.2} | {migrations} | {moved} | {wall:.1} |",
                    scheme.name,
                    percent(least),
                    percent(mean),
                    100.0 * (1.0 - mean / bound),
                    longest / bound,
                );
            }
        }
    }
    Ok(())
}

const HEAD: &str =
    "| load | scheme | idle_any | idle_mean | bound | time / bound | migrations | units moved | wall, s |
|---|---|---|---|---|---|---|---|---|";

#[cfg(feature = "mpi")]
fn main() -> Outcome<()> {
    use biotissue::backends::comm::mpi;
    if std::env::var_os("OMPI_COMM_WORLD_SIZE").is_some() || std::env::var_os("PMI_SIZE").is_some() {
        mpi::run(
            |world| {
                if world.rank() == 0 {
                    println!("{HEAD}");
                }
                all_runs(&world).map_err(|error| error.to_string())
            },
            |_| 1,
        );
        return Ok(());
    }
    on_threads()
}

#[cfg(not(feature = "mpi"))]
fn main() -> Outcome<()> {
    on_threads()
}

fn on_threads() -> Outcome<()> {
    println!("{HEAD}");
    biotissue::coupling::thread::run(1 + RANKS, |world| all_runs(&world))?;
    Ok(())
}
