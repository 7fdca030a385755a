//! A user-defined material in a body: implement the formula, and use it alone or in parallel with fiber networks.
//!
//! `cargo run --release --manifest-path examples/custom-material/Cargo.toml` stretches a box of foam by 20 %, alone and
//! with a network at every integration point, and prints the forces; `cargo test` with the same manifest path tests the
//! material and both bodies.

mod material;

use std::error::Error;
use std::path::PathBuf;
use std::sync::Arc;

use biotissue::backends::sparse::Sparse;
use biotissue::fem::boundary::{Conditions, LoadCurve, SurfaceCondition};
use biotissue::fem::mesh::{Mesh, shapes};
use biotissue::fem::point_field::{FormulaField, PointField};
use biotissue::fem::stepping::{StepParams, Stepper};
use biotissue::fiber::law::{FiberMaterial, Law};
use biotissue::fiber::network::file;
use biotissue::fiber::network::generate::delaunay;
use biotissue::fiber::rve::StressScale;
use biotissue::tissue::materials::{
    FiberRve, Formula, Formulas, Materials, NetworkAssignment, OTHER_REGIONS, Region, RegionMaterial, RveLifecycle,
    RveParams,
};
use biotissue::tissue::micro_scale::TissueField;
use material::BlatzKo;

const FOAM: BlatzKo = BlatzKo { mu: 1.0e3 };

/// Stretches a box of 1 m along x and returns the force on `x1` in each step, N.
fn stretch<P>(mesh: &Arc<Mesh>, field: P) -> Result<Vec<f64>, Box<dyn Error>>
where
    P: PointField<Error: 'static> + 'static,
{
    let moved = |surface: &str, x| SurfaceCondition {
        surface: surface.into(),
        displacement: [Some(x), Some(0.0), Some(0.0)],
        curve: LoadCurve::Ramp,
    };
    let conditions = Conditions { surfaces: vec![moved("x0", 0.0), moved("x1", 0.2)], ..Conditions::default() };
    let params = StepParams { count: 4, ..StepParams::default() };
    let mut stepper = Stepper::<Sparse, P>::new(&(), Arc::clone(mesh), &conditions, field, params)?;
    let mut forces = Vec::new();
    for _ in 0..stepper.count() {
        stepper.step(&mut ())?;
        let of_step = stepper.forces();
        forces.extend(of_step.surfaces.iter().filter(|surface| surface.name == "x1").map(|surface| surface.force[0]));
    }
    Ok(forces)
}

/// The body at one scale: the material at every integration point.
fn foam(mesh: &Arc<Mesh>) -> Result<Vec<f64>, Box<dyn Error>> {
    stretch(mesh, FormulaField::uniform(FOAM, mesh))
}

/// The body at two scales: these networks, and the material in parallel with them.
fn foam_with_fibers(mesh: &Arc<Mesh>, networks: Vec<PathBuf>) -> Result<Vec<f64>, Box<dyn Error>> {
    let collagen = FiberMaterial { law: Law::Linear { youngs_modulus: 1.0e6 }, radius: 5.0e-8, density: None };
    let rve = FiberRve {
        networks,
        assignment: NetworkAssignment::Random,
        seed: 1,
        scale: StressScale::FiberVolumeFraction(0.003).into(),
        law: Some(collagen),
        matrix: Some(Formulas::from(Formula::custom(FOAM))),
        lifecycle: RveLifecycle::default(),
    };
    let region = Region { name: OTHER_REGIONS.into(), material: RegionMaterial::FiberRve(rve) };
    let materials = Materials { regions: vec![region], rve: RveParams::default() };
    let (field, _) = TissueField::<Sparse>::new((), materials, mesh)?;
    stretch(mesh, field)
}

fn main() -> Result<(), Box<dyn Error>> {
    let mesh = Arc::new(shapes::cuboid([2, 1, 1], [1.0, 0.5, 0.5])?);
    let folder = tempfile::tempdir()?;
    let network = folder.path().join("network.txt");
    file::write(&network, &delaunay(40, 1)?)?;
    let alone = foam(&mesh)?;
    let with_fibers = foam_with_fibers(&mesh, vec![network])?;
    println!("stretch   foam (N)      foam and fibers (N)");
    for (step, (alone, with_fibers)) in (1..).zip(alone.iter().zip(with_fibers)) {
        println!("{:<9.2} {alone:<13.6e} {with_fibers:.6e}", 1.0 + 0.05 * f64::from(step));
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Without networks, the two-scale body is the body of one scale, to the last bit; fibers make it stiffer.
    #[test]
    fn the_material_is_the_same_at_one_scale_and_at_two() -> Result<(), Box<dyn Error>> {
        let mesh = Arc::new(shapes::cuboid([1, 1, 1], [1.0, 0.5, 0.5])?);
        let alone = foam(&mesh)?;
        assert_eq!(alone.len(), 4);
        assert_eq!(foam_with_fibers(&mesh, Vec::new())?, alone);
        let folder = tempfile::tempdir()?;
        let network = folder.path().join("network.txt");
        file::write(&network, &delaunay(20, 1)?)?;
        let with_fibers = foam_with_fibers(&mesh, vec![network])?;
        assert!(alone.iter().zip(with_fibers).all(|(alone, both)| *alone > 0.0 && both > 1.01 * alone));
        Ok(())
    }
}
