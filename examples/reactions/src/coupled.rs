//! The rod and the cells coupled. The rod has one rank, the cells any number; each inner node of the rod is a unit, and
//! its cell is on the rank that the unit goes to. In every step temperatures go to the cells and heat comes back.

use biotissue::backends::comm::thread::{self, Failed, ThreadComm};
use biotissue::coupling::{Channel, Coupling, Even, Plan, Scales, Share};
use biotissue::las::Message;

use crate::cloud::Cloud;
use crate::heat::{self, Rod};

/// What a rank ends with.
type Outcome = Result<Vec<f64>, Box<dyn std::error::Error>>;

/// Runs the rod for so many steps, with the cells on `ranks` ranks. Gives by rank what each ends with: first the
/// temperatures of the rod's inner nodes (K), then what is left of the reactant (mol/m^3) in the cells of each rank,
/// which are in order.
///
/// # Errors
/// The first rank that failed.
pub fn run(rod: &Rod, steps: usize, ranks: usize) -> Result<Vec<Vec<f64>>, Failed> {
    // The rod is scale 0, the cells are scale 1.
    let plan = Plan::default().with("rod", Share::Count(1)).with("cells", Share::Count(ranks));
    thread::run(1 + ranks, |comm| {
        let scales = Scales::new(&comm, &plan)?;
        scales.run(&[("rod", &|scales| rod_main(scales, rod.clone(), steps)), ("cells", &cells_main)])
    })
}

/// Runs the rod with the cells as its source.
fn rod_main(scales: &Scales<ThreadComm>, rod: Rod, steps: usize) -> Outcome {
    let there = Coupling::new(scales, "rod", "cells", &rod.nodes(), &[], &Even)?;
    let (back, mut channel) = (there.inverse(), Channel::<f64>::new(&there)?);
    let dt = Message::of(&[rod.dt]);
    let rod = heat::run(rod, steps, |temperatures| -> Outcome {
        scales.broadcast(1, dt.clone())?;
        channel.send(&there, temperatures)?;
        let mut released = vec![0.0; temperatures.len()];
        channel.receive(&back, &mut released)?;
        Ok(released)
    })?;
    // No time step: the end.
    scales.broadcast(1, Message::new())?;
    Ok(rod.inner)
}

/// Runs this rank's cells for as long as time steps come.
fn cells_main(scales: &Scales<ThreadComm>) -> Outcome {
    let there = Coupling::new(scales, "rod", "cells", &[], &[], &Even)?;
    let (back, mut channel) = (there.inverse(), Channel::<f64>::new(&there)?);
    let mut cloud = Cloud::of(there.units());
    let mut temperatures = vec![0.0; there.units().len()];
    while let Some(&[dt]) = scales.receive(0)?.values::<f64>() {
        channel.receive(&there, &mut temperatures)?;
        channel.send(&back, &cloud.step(&temperatures, dt))?;
    }
    Ok(cloud.left())
}
