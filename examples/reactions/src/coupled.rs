//! The coupled rod and cells. The rod has one rank, the cells any number of ranks. Each inner node of the rod is a
//! unit, and its cell is on the rank that gets the unit. In every step, temperatures are sent to the cells and heat is
//! sent back.

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
    let there = Coupling::new(scales, "rod", "cells", &rod.nodes(), &[], &EvenPartition)?;
    let (back, mut channel) = (there.inverse(), Channel::<f64>::new(&there)?);
    let dt = Message::of(&[rod.dt]);
    let rod = heat::run(rod, steps, |temperatures| -> Outcome {
        scales.broadcast(1, dt.clone())?;
        channel.send(&there, temperatures)?;
        let mut released = vec![0.0; temperatures.len()];
        channel.receive(&back, &mut released)?;
        Ok(released)
    })?;
    // A message without a time step ends the cells.
    scales.broadcast(1, Message::new())?;
    Ok(rod.inner)
}

/// Runs the cells of this rank until no further time step arrives.
fn cells_main(scales: &Scales<ThreadComm>) -> Outcome {
    let there = Coupling::new(scales, "rod", "cells", &[], &[], &EvenPartition)?;
    let (back, mut channel) = (there.inverse(), Channel::<f64>::new(&there)?);
    let mut cloud = Cloud::of(there.units());
    let mut temperatures = vec![0.0; there.units().len()];
    while let Some(&[dt]) = scales.receive(0)?.values::<f64>() {
        channel.receive(&there, &mut temperatures)?;
        channel.send(&back, &cloud.step(&temperatures, dt))?;
    }
    Ok(cloud.left())
}
