//! Simulates scaling to 65 536 micro ranks from the recorded costs of RVEs; see the README.

mod machine;
mod mirror;
mod output;
mod placement;
mod pool;
mod recording;
mod replicas;
mod simulation;
mod study;
mod tables;

use std::error::Error;
use std::fs::File;
use std::io::Write;
use std::path::PathBuf;
use std::process::ExitCode;

use clap::{Parser, ValueEnum};

use crate::machine::{Machine, MacroModel, MacroSolver};
use crate::output::line;
use crate::recording::Recording;
use crate::replicas::{Layout, Perturbation};
use crate::simulation::Scheme;
use crate::study::{Ranks, Row, Study};
use crate::tables::digits;

/// Simulates the iterations of a two-scale run on up to 65 536 micro ranks from the recorded costs of RVEs.
#[derive(Debug, Parser)]
#[command(version)]
struct Args {
    /// `costs.csv` of a run with `costs = true` in `[output]`, or the directory with it; several files are several studies.
    #[arg(required = true)]
    files: Vec<PathBuf>,
    /// What to print.
    #[arg(long, value_enum, value_delimiter = ',', default_values_t = Table::value_variants().to_vec())]
    tables: Vec<Table>,
    /// Schemes of load balancing.
    #[arg(long, value_enum, value_delimiter = ',', default_values_t = Scheme::value_variants().to_vec())]
    schemes: Vec<Scheme>,
    /// Numbers of micro ranks of strong and weak scaling.
    #[arg(
        long,
        value_delimiter = ',',
        default_values_t = [128, 256, 512, 1024, 2048, 4096, 8192, 16_384, 32_768, 65_536],
        value_parser = positive
    )]
    ranks: Vec<usize>,
    /// Elements (RVEs) of the bodies of strong scaling; the ratios are for the first of them.
    #[arg(long, value_delimiter = ',', default_values_t = [64_000, 512_000], value_parser = positive)]
    elements: Vec<usize>,
    /// RVEs per micro rank of weak scaling.
    #[arg(long, value_delimiter = ',', default_values_t = [10, 100], value_parser = positive)]
    per_rank: Vec<usize>,
    /// Micro ranks per macro rank of strong and weak scaling, and of pools.
    #[arg(long, default_value_t = 128, value_parser = positive)]
    ratio: usize,
    /// Micro ranks per macro rank of the table of ratios.
    #[arg(long, value_delimiter = ',', default_values_t = [32, 64, 128, 256, 512], value_parser = positive)]
    ratios: Vec<usize>,
    /// Macro ranks of the table of ratios.
    #[arg(long, value_delimiter = ',', default_values_t = [2, 4, 8, 16, 32, 64, 128], value_parser = positive)]
    macro_ranks: Vec<usize>,
    /// Cores of the micro scale in the table of pools.
    #[arg(long, value_delimiter = ',', default_values_t = [1024, 8192, 65_536], value_parser = positive)]
    cores: Vec<usize>,
    /// Threads per micro rank in the table of pools; divisors of the cores.
    #[arg(long, value_delimiter = ',', default_values_t = [1, 4, 16, 64], value_parser = positive)]
    threads: Vec<usize>,
    /// Bodies with more RVEs are left out.
    #[arg(long, default_value_t = 1_000_000)]
    max_rves: usize,
    /// Number of recorded sweeps to use, from the first one [default: all].
    #[arg(long, value_parser = positive)]
    sweeps: Option<usize>,
    /// Which recorded RVE each simulated one copies.
    #[arg(long, value_enum, default_value_t = Layout::Refine)]
    layout: Layout,
    /// Each simulated RVE copies a random recorded one at most so many places away; 0: the one at its place.
    #[arg(long, default_value_t = 8)]
    window: usize,
    /// Standard deviation of the logarithm of a factor of the seconds of each RVE.
    #[arg(long, default_value_t = 0.0, value_parser = not_negative)]
    spread: f64,
    /// Standard deviation of the logarithm of a factor of the seconds of each RVE in each sweep.
    #[arg(long, default_value_t = 0.0, value_parser = not_negative)]
    noise: f64,
    /// Seed of `--window`, `--spread` and `--noise`.
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// The files are recordings of the same run, of which each RVE takes its least seconds: for costs that were recorded
    /// while other programs ran.
    #[arg(long)]
    least: bool,
    /// A factor of all recorded seconds, for larger networks or slower cores.
    #[arg(long, default_value_t = 1.0, value_parser = not_negative)]
    factor: f64,
    /// Seconds of a message of no bytes.
    #[arg(long, default_value_t = 3e-6, value_parser = not_negative)]
    latency: f64,
    /// Bytes per second.
    #[arg(long, default_value_t = 1.8e9, value_parser = above_zero)]
    bandwidth: f64,
    /// Seconds of a modelled core per second of this one, for what is measured here: planning, and messages in memory.
    #[arg(long, default_value_t = 1.0, value_parser = not_negative)]
    core: f64,
    /// Bytes of the state of an RVE that migrates.
    #[arg(long, default_value_t = 20_000)]
    state_bytes: u64,
    /// How the macro scale solves its linear system.
    #[arg(long = "macro", value_enum, default_value_t = MacroSolver::Direct)]
    solver: MacroSolver,
    /// Seconds of an iteration of the macro scale on one core, with `--macro-elements` elements [default: by the solver].
    #[arg(long, value_parser = not_negative, requires = "macro_elements")]
    macro_seconds: Option<f64>,
    /// Elements of the body of `--macro-seconds`.
    #[arg(long, value_parser = not_negative, requires = "macro_seconds")]
    macro_elements: Option<f64>,
    /// Elements per macro rank below which more of these ranks do not help [default: by the solver].
    #[arg(long, value_parser = not_negative)]
    macro_grain: Option<f64>,
    /// Writes a line per run to this file.
    #[arg(long)]
    csv: Option<PathBuf>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum Table {
    /// Bodies of fixed size, beside figure 3.14.
    Strong,
    /// Bodies that grow with the ranks, beside figure 3.15.
    Weak,
    /// Macro ranks and micro ranks per macro rank, beside figures 3.14 and 3.16.
    Ratio,
    /// Equal numbers of cores in pools of different size.
    Pools,
}

fn positive(text: &str) -> Result<usize, String> {
    let number: usize = text.parse().map_err(|_| "not a whole number".to_owned())?;
    if number > 0 { Ok(number) } else { Err("must be at least 1".into()) }
}

fn not_negative(text: &str) -> Result<f64, String> {
    let number: f64 = text.parse().map_err(|_| "not a number".to_owned())?;
    if number >= 0.0 && number.is_finite() { Ok(number) } else { Err("must be finite and not negative".into()) }
}

fn above_zero(text: &str) -> Result<f64, String> {
    let number = not_negative(text)?;
    if number > 0.0 { Ok(number) } else { Err("must be above 0".into()) }
}

fn main() -> ExitCode {
    match run(&Args::parse()) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("{error}");
            ExitCode::FAILURE
        }
    }
}

fn run(args: &Args) -> Result<(), Box<dyn Error>> {
    let mut csv = match &args.csv {
        Some(path) => Some(create(path)?),
        None => None,
    };
    let of_study = if args.least { args.files.len() } else { 1 };
    for files in args.files.chunks(of_study) {
        let [file, others @ ..] = files else { continue };
        let mut recording = Recording::read(file)?;
        for other in others {
            recording.take_least(other, &Recording::read(other)?)?;
        }
        let study = study(args, &recording);
        line!("# {}\n", file.display());
        describe(&study);
        for &table in &args.tables {
            let rows = print(table, args, &study)?;
            if let Some((path, csv)) = &mut csv {
                let name = table.to_possible_value().map_or_else(String::new, |value| value.get_name().to_owned());
                let lines: String = rows.iter().map(|row| tables::csv_line(&name, row) + "\n").collect();
                csv.write_all(lines.as_bytes()).map_err(|error| format!("{}: {error}", path.display()))?;
            }
        }
    }
    Ok(())
}

/// Creates the CSV file of all runs.
fn create(path: &PathBuf) -> Result<(PathBuf, File), String> {
    let unwritten = |error| format!("{}: {error}; choose another file with `--csv`", path.display());
    let mut file = File::create(path).map_err(unwritten)?;
    writeln!(file, "{}", tables::CSV_HEADER).map_err(unwritten)?;
    Ok((path.clone(), file))
}

fn study<'a>(args: &Args, recording: &'a Recording) -> Study<'a> {
    let mut macro_model = MacroModel::of(args.solver);
    if let (Some(seconds), Some(elements)) = (args.macro_seconds, args.macro_elements) {
        (macro_model.seconds, macro_model.elements) = (seconds, elements.max(1.0));
    }
    if let Some(grain) = args.macro_grain {
        macro_model.elements_per_rank = grain.max(1.0);
    }
    Study {
        recording,
        layout: args.layout,
        perturbation: Perturbation { seed: args.seed, window: args.window, spread: args.spread, noise: args.noise },
        factor: args.factor,
        sweeps: args.sweeps.unwrap_or(usize::MAX).min(recording.sweeps()),
        machine: Machine { latency: args.latency, bandwidth: args.bandwidth, core: args.core },
        macro_model,
        state_bytes: args.state_bytes,
        schemes: args.schemes.clone(),
        ratio: args.ratio,
        max_rves: args.max_rves,
    }
}

/// Prints what was recorded.
fn describe(study: &Study) {
    let Study { recording, sweeps, factor, machine, macro_model, .. } = study;
    let mut seconds: Vec<f64> = recording.seconds().collect();
    seconds.sort_unstable_by(f64::total_cmp);
    let mean = seconds.iter().sum::<f64>() / seconds.len() as f64;
    let quantile = |share: f64| digits(seconds[((seconds.len() - 1) as f64 * share) as usize]);
    line!(
        "{} RVEs of {} networks, {} steps, {} sweeps, of which {sweeps} are used; {} values.",
        recording.rves(),
        recording.networks(),
        recording.steps(),
        recording.sweeps(),
        seconds.len()
    );
    line!(
        "Seconds of an RVE: mean {}, median {}, 99 % {}, largest {}; the simulation multiplies them by {factor}.",
        digits(mean),
        quantile(0.5),
        quantile(0.99),
        quantile(1.0)
    );
    if let Some(persistence) = recording.persistence() {
        line!("Rank correlation of the seconds with those of the sweep before: {persistence:.2}.");
    }
    line!(
        "Latency {} s, bandwidth {} B/s; macro scale: {} s per {} elements on one core, at least {} elements per rank.\n",
        digits(machine.latency),
        digits(machine.bandwidth),
        digits(macro_model.seconds),
        macro_model.elements,
        macro_model.elements_per_rank
    );
}

/// Prints a table; returns its runs.
fn print(table: Table, args: &Args, study: &Study) -> Result<Vec<Row>, Box<dyn Error>> {
    let mut all = Vec::new();
    match table {
        Table::Strong => {
            for &elements in &args.elements {
                line!("## Strong scaling, {elements} RVEs, 1 macro rank per {} micro ranks\n", study.ratio);
                all.extend(scaling(args, study, |_| elements)?);
            }
        }
        Table::Weak => {
            for &per_rank in &args.per_rank {
                line!("## Weak scaling, {per_rank} RVEs per micro rank, 1 macro rank per {} of them\n", study.ratio);
                all.extend(scaling(args, study, |ranks| per_rank * ranks)?);
            }
        }
        Table::Ratio => {
            for &elements in &args.elements {
                line!(
                    "## Macro ranks and micro ranks per macro rank, {elements} RVEs: seconds of an iteration (efficiency)\n"
                );
                let ranks = args.macro_ranks.iter().flat_map(|&macro_ranks| {
                    let of_ratio = move |ratio: &usize| Ranks { micro: macro_ranks * ratio, threads: 1, macro_ranks };
                    args.ratios.iter().map(of_ratio)
                });
                let rows = runs(study, ranks.map(|ranks| (elements, ranks)))?;
                tables::ratios(&rows, &args.ratios);
                all.extend(rows);
            }
        }
        Table::Pools => {
            for &cores in &args.cores {
                for &per_core in &args.per_rank {
                    line!("## Pools of work, {cores} cores, {per_core} RVEs per core\n");
                    let macro_ranks = (cores / study.ratio).max(1);
                    let (fit, odd): (Vec<usize>, Vec<usize>) =
                        args.threads.iter().partition(|&&threads| cores.is_multiple_of(threads));
                    for threads in odd {
                        line!("Left out: {threads} threads per rank do not divide {cores} cores.\n");
                    }
                    let of_threads = |threads: usize| Ranks { micro: cores / threads, threads, macro_ranks };
                    let rows = runs(study, fit.into_iter().map(|threads| (per_core * cores, of_threads(threads))))?;
                    tables::times(&rows);
                    tables::parts(&rows);
                    all.extend(rows);
                }
            }
        }
    }
    Ok(all)
}

/// Prints the tables of bodies whose number of RVEs depends on the micro ranks.
fn scaling(args: &Args, study: &Study, rves: impl Fn(usize) -> usize) -> Result<Vec<Row>, Box<dyn Error>> {
    let rows = runs(study, args.ranks.iter().map(|&ranks| (rves(ranks), study.ranks(ranks))))?;
    tables::times(&rows);
    tables::parts(&rows);
    tables::limits(&rows);
    Ok(rows)
}

fn runs(study: &Study, runs: impl Iterator<Item = (usize, Ranks)>) -> Result<Vec<Row>, Box<dyn Error>> {
    let mut rows = Vec::new();
    for (rves, ranks) in runs {
        let of_ranks = study.run(rves, ranks)?;
        if of_ranks.is_empty() {
            line!("Left out: {rves} RVEs, more than --max-rves {}.\n", study.max_rves);
        }
        rows.extend(of_ranks);
    }
    Ok(rows)
}
