//! A user-defined fiber law in an RVE: implement the formula, pass it to `Law::custom`, and solve.
//!
//! `cargo run --release --manifest-path examples/custom-law/Cargo.toml` stretches a Delaunay network whose fibers have
//! a toe region and prints its stress; `cargo test` with the same manifest path tests the law.

mod law;

use std::error::Error;
use std::sync::Arc;

use biotissue::backends::sparse::Sparse;
use biotissue::fiber::equilibrium::{EquilibriumParams, equilibrate};
use biotissue::fiber::law::{FiberMaterial, Law};
use biotissue::fiber::network::generate::delaunay;
use biotissue::fiber::rve::{Rve, RveModel, StressScale};
use biotissue::fiber::workspace::Workspace;
use law::Toe;
use nalgebra::Matrix3;

fn main() -> Result<(), Box<dyn Error>> {
    let toe = Toe { youngs_modulus: 1.0e7, straight_modulus: 4.0e8, toe_strain: 0.06, exponent: 2.0 };
    // The fibers buckle in compression: the modifiers of the library apply to every law.
    let law = Law::custom(toe).with_buckling(0.05, 0.01);
    let collagen = FiberMaterial { law, radius: 5.0e-8, density: None };

    let network = Arc::new(delaunay(60, 1)?);
    let scale = StressScale::FiberVolumeFraction(0.003);
    let model = RveModel::<Sparse>::new(&(), Arc::clone(&network), Some(collagen), scale)?;
    let mut rve = Rve::at_rest(&network);
    let mut workspace = Workspace::new(&(), &model)?;

    println!("stretch   P11 (Pa)      W (J/m^3)     iterations");
    for step in 0..=10 {
        let stretch = 1.0 + 0.01 * f64::from(step);
        let f = Matrix3::from_diagonal(&[stretch, 1.0, 1.0].into());
        let solved = equilibrate(&model, &mut rve, &f, &EquilibriumParams::default(), &mut workspace)?;
        let (pk1, energy) = (solved.pk1(), solved.energy());
        println!("{stretch:<9.2} {:<13.6e} {energy:<13.6e} {}", pk1[(0, 0)], solved.report().iterations);
    }
    Ok(())
}
