//! The coupling of the rod and the cells. The rod has one rank, the cells have any number of ranks. Each inner node of
//! the rod is a unit, and its cell is on the rank that the unit is assigned to. In every step, the temperatures are
//! sent to the cells, and the heat is sent back.

use biotissue::coupling::thread::{self, Failed, ThreadComm};
use biotissue::coupling::{Channel, Coupling, EvenPartition, Message, Plan, Scales, Share};

use crate::cloud::Cloud;
use crate::heat::{self, Rod};

/// The result of a rank.
type Outcome = Result<Vec<f64>, Box<dyn std::error::Error>>;

/// Runs the rod for `steps` steps, with the cells on `ranks` ranks. Returns the results of all ranks: first the
/// temperatures of the rod's inner nodes (K), then the remaining reactant (mol/m^3) of the cells of each rank, in
/// order.
///
/// # Errors
/// Returns the error of the first rank that failed.
pub fn run(rod: &Rod, steps: usize, ranks: usize) -> Result<Vec<Vec<f64>>, Failed> {
    // The rod is scale 0, the cells are scale 1.
    let plan = Plan::default().with("rod", Share::Count(1)).with("cells", Share::Count(ranks));
    thread::run(1 + ranks, |comm| {
        let scales = Scales::new(&comm, &plan)?;
        scales.run(&[("rod", &|scales| rod_main(scales, rod.clone(), steps)), ("cells", &cells_main)])
    })
}

/// Runs the rod, with the cells as its heat source.
fn rod_main(scales: &Scales<ThreadComm>, rod: Rod, steps: usize) -> Outcome {
    let to_cells = Coupling::new(scales, "rod", "cells", &rod.nodes(), &[], &EvenPartition)?;
    let (to_rod, mut channel) = (to_cells.inverse(), Channel::<f64>::new(&to_cells)?);
    let dt = Message::of(&[rod.dt]);
    let rod = heat::run(rod, steps, |temperatures| -> Outcome {
        scales.broadcast(1, dt.clone())?;
        channel.send(&to_cells, temperatures)?;
        let mut released = vec![0.0; temperatures.len()];
        channel.receive(&to_rod, &mut released)?;
        Ok(released)
    })?;
    // A message without a time step ends the loop of every rank of the cells.
    scales.broadcast(1, Message::new())?;
    Ok(rod.inner)
}

/// Runs the cells of this rank until no further time step arrives.
fn cells_main(scales: &Scales<ThreadComm>) -> Outcome {
    let to_cells = Coupling::new(scales, "rod", "cells", &[], &[], &EvenPartition)?;
    let (to_rod, mut channel) = (to_cells.inverse(), Channel::<f64>::new(&to_cells)?);
    let mut cloud = Cloud::of(to_cells.units());
    let mut temperatures = vec![0.0; to_cells.units().len()];
    while let Some(&[dt]) = scales.receive(0)?.values::<f64>() {
        channel.receive(&to_cells, &mut temperatures)?;
        channel.send(&to_rod, &cloud.step(&temperatures, dt))?;
    }
    Ok(cloud.left())
}
