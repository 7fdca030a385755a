//! Couples two user codes, each of which also runs alone.
//!
//! ```text
//! cargo run --package reactions -- heat
//! cargo run --package reactions -- cloud
//! cargo run --package reactions -- coupled 4
//! ```
//!
//! `heat.rs` is a rod that conducts heat. `cloud.rs` is a cloud of cells with a reaction that consumes a reactant and
//! releases heat, faster at higher temperature. Neither code refers to the other or to ranks. `coupled.rs` assigns a
//! cell to each inner node of the rod, and runs the rod on one rank and the cells on separate ranks, here four; it is
//! the only file that uses couplings. Results do not depend on the number of ranks.

mod cloud;
mod coupled;
mod heat;

use std::env;
use std::error::Error;
use std::process::ExitCode;

use cloud::Cloud;
use heat::Rod;

/// Number of inner nodes of the rod, and of cells.
const CELLS: usize = 19;
/// Time steps between two rows of a table.
const STEPS: usize = 20;
/// Rows of a table.
const LINES: usize = 4;

/// The simulation to run.
#[derive(Debug, PartialEq)]
enum Mode {
    Heat,
    Cloud,
    /// Both codes, with this number of ranks for the cells.
    Coupled(usize),
}

impl Mode {
    /// Reads the command-line arguments; the error is the message for the user.
    fn parse(arguments: &[&str]) -> Result<Self, String> {
        match *arguments {
            ["heat"] => Ok(Self::Heat),
            ["cloud"] => Ok(Self::Cloud),
            ["coupled"] => Ok(Self::Coupled(2)),
            ["coupled", ranks] => {
                let count = ranks.parse::<usize>().ok().filter(|count| (1..=CELLS).contains(count));
                let wrong = || format!("`{ranks}` is not a number of ranks from 1 to {CELLS}");
                count.map(Self::Coupled).ok_or_else(wrong)
            }
            [] => Err("the simulation is missing".to_owned()),
            _ => Err(format!("there is no simulation `{}`", arguments.join(" "))),
        }
    }

    fn run(&self) -> Result<(), Box<dyn Error>> {
        match *self {
            Self::Heat => show_heat(),
            Self::Cloud => {
                show_cloud();
                Ok(())
            }
            Self::Coupled(ranks) => show_coupled(ranks),
        }
    }
}

/// Returns a cold rod with one hot end.
fn cold_rod() -> Rod {
    let inner = vec![350.0; CELLS];
    Rod { conductivity: 20.0, capacity: 2.0e6, length: 0.05, ends: [450.0, 350.0], inner, dt: 0.5 }
}

/// Prints a row of a table, with every third of the values.
fn show(name: &str, values: impl Iterator<Item = f64>) {
    let values: Vec<String> = values.step_by(3).map(|value| format!("{value:8.1}")).collect();
    println!("{name:>10} |{}", values.concat());
}

/// Returns the time after `steps` steps, as the label of a row.
fn time(rod: &Rod, steps: usize) -> String {
    format!("{:.0} s", steps as f64 * rod.dt)
}

fn show_heat() -> Result<(), Box<dyn Error>> {
    let mut rod = cold_rod();
    println!("The rod alone: temperature (K) by position and time.\n");
    show("mm", rod.places().map(|place| 1e3 * place));
    for line in 1..=LINES {
        rod = heat::run(rod, STEPS, heat::no_source)?;
        show(&time(&rod, line * STEPS), rod.inner.iter().copied());
    }
    Ok(())
}

fn show_cloud() {
    let (steps, dt) = (4, 0.5);
    println!("The cells alone: 2 s at one temperature.\n");
    println!("temperature | rate       | reactant left   exact | heat of a cell");
    for temperature in [350.0, 400.0, 450.0, 500.0] {
        let mut cloud = Cloud::of(&cold_rod().nodes());
        let start: f64 = cloud.left().iter().sum();
        let heat: f64 = cloud::run(&mut cloud, temperature, steps, dt).iter().sum();
        let left: f64 = cloud.left().iter().sum();
        let rate = cloud::rate(temperature);
        println!(
            "{temperature:9.0} K | {rate:6.3} 1/s | {:11.3} % {:7.3} % | {:6.1} MJ/m^3",
            100.0 * left / start,
            100.0 * (-rate * dt * steps as f64).exp(),
            1e-6 * heat / CELLS as f64
        );
    }
}

fn show_coupled(ranks: usize) -> Result<(), Box<dyn Error>> {
    let rod = cold_rod();
    println!("The rod on one rank, {CELLS} cells on {ranks}: temperature (K) by position and time.\n");
    show("mm", rod.places().map(|place| 1e3 * place));
    let mut left = Vec::new();
    for line in 1..=LINES {
        let ends = coupled::run(&rod, line * STEPS, ranks)?;
        show(&time(&rod, line * STEPS), ends[0].iter().copied());
        left = ends[1..].concat();
    }
    println!("\nRemaining reactant at the end (mol/m^3):\n");
    show("", left.into_iter());
    Ok(())
}

fn main() -> ExitCode {
    let arguments: Vec<String> = env::args().skip(1).collect();
    let arguments: Vec<&str> = arguments.iter().map(String::as_str).collect();
    let mode = match Mode::parse(&arguments) {
        Ok(mode) => mode,
        Err(reason) => {
            eprintln!("reactions: {reason}\nuse: reactions heat | cloud | coupled [RANKS]");
            return ExitCode::from(2);
        }
    };
    match mode.run() {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("reactions: {error}");
            ExitCode::FAILURE
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Runs rod and cells in one loop on one thread; returns temperatures and remaining reactant.
    fn plain(steps: usize) -> [Vec<f64>; 2] {
        let mut rod = cold_rod();
        let mut cloud = Cloud::of(&rod.nodes());
        for _ in 0..steps {
            let heat = cloud.step(&rod.inner, rod.dt);
            rod.step(&heat);
        }
        [rod.inner, cloud.left()]
    }

    fn bits(values: &[f64]) -> Vec<u64> {
        values.iter().map(|value| value.to_bits()).collect()
    }

    #[test]
    fn the_coupling_has_fewer_than_forty_lines_and_the_codes_do_not_use_the_library() {
        let lines = include_str!("coupled.rs").lines().map(str::trim);
        let count = lines.filter(|line| !line.is_empty() && !line.starts_with("//")).count();
        assert!(count < 40, "{count} lines");
        for (name, code) in [("heat.rs", include_str!("heat.rs")), ("cloud.rs", include_str!("cloud.rs"))] {
            assert!(!code.contains("biotissue"), "{name} uses the library");
        }
    }

    #[test]
    fn results_on_any_number_of_ranks_are_those_of_a_loop_on_one_thread() -> Result<(), Box<dyn Error>> {
        let steps = LINES * STEPS;
        let [temperatures, left] = plain(steps);
        for ranks in [1, 2, 3, 5] {
            let ends = coupled::run(&cold_rod(), steps, ranks)?;
            assert_eq!(ends.len(), 1 + ranks);
            assert_eq!(bits(&ends[0]), bits(&temperatures), "temperatures, {ranks} ranks");
            assert_eq!(bits(&ends[1..].concat()), bits(&left), "reactant, {ranks} ranks");
        }
        Ok(())
    }

    /// With the reaction, every node of the rod is hotter than without it.
    #[test]
    fn the_reaction_heats_the_rod() -> Result<(), Box<dyn Error>> {
        let alone = heat::run(cold_rod(), STEPS, heat::no_source)?;
        let ends = coupled::run(&cold_rod(), STEPS, 2)?;
        assert!(ends[0].iter().zip(&alone.inner).all(|(coupled, alone)| coupled > alone), "{ends:?}");
        Ok(())
    }

    #[test]
    fn invalid_arguments_are_errors() {
        assert_eq!(Mode::parse(&["heat"]), Ok(Mode::Heat));
        assert_eq!(Mode::parse(&["coupled", "5"]), Ok(Mode::Coupled(5)));
        let all: [&[&str]; 5] = [&[], &["cold"], &["heat", "2"], &["coupled", "0"], &["coupled", "many"]];
        for wrong in all {
            assert!(Mode::parse(wrong).is_err(), "{wrong:?}");
        }
        assert!(Mode::parse(&["coupled", &(CELLS + 1).to_string()]).is_err());
    }
}
