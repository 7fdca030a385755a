//! A user's own simulation, written once and run on every backend of `biotissue`.
//!
//! ```text
//! cargo run --release --package downstream
//! cargo run --release --package downstream --features petsc
//! ```
//!
//! `heat.rs` is the simulation, generic over `B: Backend`; this file selects the backends by type. `sparse`, `dense`
//! and `petsc` simulate one material after the other, `batched` all four at once, one per lane.

mod exact;
mod heat;
mod mesh;

use std::time::Instant;

use biotissue::backends::{batched::Batched, dense::Dense, sparse::Sparse};
use biotissue::las::{Backend, Scalar, Value};

use heat::{Body, Error};
use mesh::Mesh;

/// Conductivity divided by temperature, by material.
const KAPPA: [f64; 4] = [0.5, 1.0, 2.0, 4.0];
/// Simulated time, s.
const SECONDS: f64 = 0.1;

type Lanes = Batched<f64, 4>;

/// Simulates the spread of heat from a hot corner on a mesh of `cells` by `cells` squares; `kappa` returns the material
/// by lane.
fn spread<B: Backend>(context: &B::Context, cells: usize, kappa: impl Fn(usize) -> f64) -> Result<Body<B>, Error> {
    let mut body =
        Body::<B>::new(context, Mesh::square(cells), |place, lane| exact::temperature(kappa(lane), 0.0, place))?;
    let kappa = B::Scalar::from_lanes(|lane| Scalar::of(kappa(lane)));
    // All materials take the same steps: nine tenths of the stable step of the fastest material.
    let steps = (SECONDS * 4.0 * KAPPA[3] * (cells * cells) as f64 / 0.9).ceil() as usize;
    for _ in 0..steps {
        body.step(kappa, SECONDS / steps as f64)?;
    }
    Ok(body)
}

/// Returns the final temperatures of all four materials on a backend with one lane, and the elapsed seconds.
fn one_by_one<B: Backend>(context: &B::Context, cells: usize) -> Result<(Vec<Vec<f64>>, f64), Error> {
    let start = Instant::now();
    let mut ends = Vec::new();
    for kappa in KAPPA {
        ends.push(spread::<B>(context, cells, |_| kappa)?.temperatures(0)?);
    }
    Ok((ends, start.elapsed().as_secs_f64()))
}

/// Returns the same as `one_by_one`, but simulates all materials at once, in four lanes.
fn all_at_once(cells: usize) -> Result<(Vec<Vec<f64>>, f64), Error> {
    let start = Instant::now();
    let body = spread::<Lanes>(&(), cells, |lane| KAPPA[lane])?;
    let ends = (0..KAPPA.len()).map(|lane| body.temperatures(lane)).collect::<Result<_, _>>()?;
    Ok((ends, start.elapsed().as_secs_f64()))
}

/// Returns the largest difference between two results.
fn difference(a: &[Vec<f64>], b: &[Vec<f64>]) -> f64 {
    a.iter().flatten().zip(b.iter().flatten()).fold(0.0, |most, (a, b)| most.max((a - b).abs()))
}

fn main() -> Result<(), Error> {
    println!(
        "A hot corner of a square cools down. The conductivity increases with temperature; heat spreads as a front.\n"
    );
    let body = spread::<Lanes>(&(), 32, |lane| KAPPA[lane])?;
    let (heat, rms_rate) = (body.heat()?, body.rms_rate()?);
    println!("conductivity | hottest  exact | front at  exact | heat     change per s | misplaced heat");
    for (lane, kappa) in KAPPA.into_iter().enumerate() {
        let exact = |place: [f64; 2]| exact::temperature(kappa, SECONDS, place);
        let hottest = body.temperatures(lane)?.into_iter().fold(0.0, f64::max);
        println!(
            "{kappa:9.1} u  | {hottest:7.4}  {:6.4} | {:8.3}  {:5.3} | {:.5}  {:12.3} | {:.2} %",
            exact([0.0, 0.0]),
            body.reach(lane)?,
            exact::front(kappa, SECONDS),
            heat.lane(lane),
            rms_rate.lane(lane),
            100.0 * body.error(lane, exact)?
        );
    }

    println!("\nMisplaced heat by mesh (conductivity 4 u):");
    let mut coarser: Option<f64> = None;
    for cells in [8, 16, 32, 64] {
        let body = spread::<Sparse>(&(), cells, |_| KAPPA[3])?;
        let error = body.error(0, |place| exact::temperature(KAPPA[3], SECONDS, place))?;
        let order = coarser.map_or(String::new(), |coarser| format!("   order {:.2}", (coarser / error).log2()));
        println!("{cells:4} x {cells:<4} {:6.3} %{order}", 100.0 * error);
        coarser = Some(error);
    }

    println!("\nThe four materials on every backend, 16 x 16 cells:");
    let (reference, seconds) = one_by_one::<Sparse>(&(), 16)?;
    println!("{:8} one by one  {seconds:7.4} s", Sparse::<f64>::NAME);
    let line = |name: &str, how: &str, (ends, seconds): (Vec<Vec<f64>>, f64)| {
        let difference = difference(&ends, &reference);
        println!("{name:8} {how:10}  {seconds:7.4} s   largest difference from sparse: {difference:.0e}");
    };
    line(Dense::<f64>::NAME, "one by one", one_by_one::<Dense>(&(), 16)?);
    line(Lanes::NAME, "all at once", all_at_once(16)?);
    #[cfg(feature = "petsc")]
    {
        use biotissue::backends::petsc::{Context, Petsc};
        line(Petsc::NAME, "one by one", one_by_one::<Petsc>(&Context::world()?, 16)?);
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn backends_agree_to_rounding() -> Result<(), Error> {
        let (sparse, _) = one_by_one::<Sparse>(&(), 8)?;
        for (name, (ends, _)) in [("dense", one_by_one::<Dense>(&(), 8)?), ("batched", all_at_once(8)?)] {
            let difference = difference(&sparse, &ends);
            assert!(difference < 1e-13, "{name}: {difference:e}");
        }
        let (single, _) = one_by_one::<Sparse<f32>>(&(), 8)?;
        let difference = difference(&sparse, &single);
        assert!((1e-9..1e-4).contains(&difference), "single precision: {difference:e}");
        Ok(())
    }

    /// A single test, because MPI can be initialized only once per process.
    #[test]
    #[cfg(feature = "petsc")]
    fn petsc_agrees_to_rounding() -> Result<(), Error> {
        use biotissue::backends::petsc::{Context, Petsc};
        let (petsc, _) = one_by_one::<Petsc>(&Context::world()?, 8)?;
        let difference = difference(&one_by_one::<Sparse>(&(), 8)?.0, &petsc);
        assert!(difference < 1e-13, "{difference:e}");
        Ok(())
    }

    /// The exact temperature has a kink at the front, where the error is largest.
    #[test]
    fn refinement_converges_to_the_exact_front() -> Result<(), Error> {
        let bodies = [8, 16, 32].map(|cells| spread::<Lanes>(&(), cells, |lane| KAPPA[lane]));
        let [coarse, middle, fine] = bodies;
        let (coarse, middle, fine) = (coarse?, middle?, fine?);
        for (lane, kappa) in KAPPA.into_iter().enumerate() {
            let error = |body: &Body<Lanes>| body.error(lane, |place| exact::temperature(kappa, SECONDS, place));
            let errors = [error(&coarse)?, error(&middle)?, error(&fine)?];
            let order = (errors[0] / errors[2]).log2() / 2.0;
            assert!(order > 1.3 && errors[2] < 0.01, "lane {lane}: {errors:?}, order {order}");
        }
        Ok(())
    }

    #[test]
    fn heat_is_conserved_and_temperatures_are_not_negative() -> Result<(), Error> {
        let start = Body::<Sparse>::new(&(), Mesh::square(12), |place, _| exact::temperature(4.0, 0.0, place))?;
        let end = spread::<Sparse>(&(), 12, |_| 4.0)?;
        assert!((end.heat()? / start.heat()? - 1.0).abs() < 1e-12, "{} {}", end.heat()?, start.heat()?);
        assert!(end.temperatures(0)?.into_iter().all(|u| u >= 0.0));
        assert!(end.reach(0)? > 1.5 * start.reach(0)?, "the front has not moved");
        Ok(())
    }
}
