//! Deposits particles on a grid and gathers a field from it, by products with a matrix and its transpose on any
//! backend.
//!
//! ```text
//! cargo run --release --example deposition
//! ```
//!
//! A particle-in-cell code distributes the charge of its particles to the nodes of a mesh, and interpolates the field
//! from the nodes to the particles. Both are products with one rectangular matrix `D`, with a row per node and a column
//! per particle, whose entries are the shape functions of the cell of each particle: `rho = D q` and `e = D^T E`. `D`
//! changes whenever particles move, so its assembly matters as much as the products. In this example the mesh is a
//! square of bilinear cells, and the same code runs on `sparse`, on `dense`, and on `batched` for four kinds of
//! particles at once.

use std::sync::Arc;

use biotissue::backends::{dense::Dense, sparse::Sparse};
use biotissue::las::conformance::Random;
use biotissue::las::{Backend, Index, MatVec, MatrixOps, Scalar, Sparsity, Value, VectorOps};

type Error = Box<dyn std::error::Error>;

/// Number of nodes along a side.
const SIDE: usize = 17;
/// Number of particles.
const PARTICLES: usize = 400;

/// Returns random positions of the particles, in units of the cell size.
fn positions() -> Vec<[f64; 2]> {
    let mut random = Random::new(1);
    let mut coordinate = || 0.5 * (random.signed() + 1.0) * (SIDE - 1) as f64 * (1.0 - 1e-12);
    (0..PARTICLES).map(|_| [coordinate(), coordinate()]).collect()
}

/// Returns the four nodes of a particle's cell, and the values of their shape functions at its position; the values sum
/// to one.
fn shape([x, y]: [f64; 2]) -> ([usize; 4], [f64; 4]) {
    let (i, j) = (x as usize, y as usize);
    let (u, v) = (x - i as f64, y - j as f64);
    let corner = i * SIDE + j;
    let nodes = [corner, corner + 1, corner + SIDE, corner + SIDE + 1];
    (nodes, [(1.0 - u) * (1.0 - v), (1.0 - u) * v, u * (1.0 - v), u * v])
}

/// Assembles `D`: the cells of the particles give the pattern, and the verb `add` writes the values.
fn deposition<B: Backend>(context: &B::Context, positions: &[[f64; 2]]) -> Result<B::Matrix, Error> {
    let mut rows = vec![Vec::new(); SIDE * SIDE];
    for (particle, &position) in positions.iter().enumerate() {
        shape(position).0.into_iter().for_each(|node| rows[node].push(particle as u32));
    }
    let row_offsets = (0..=rows.len()).map(|end| rows[..end].iter().map(|row| row.len() as u32).sum()).collect();
    let pattern = Arc::new(Sparsity::from_rows(positions.len(), row_offsets, rows.concat())?);
    let mut d = B::matrix(context, &pattern)?;
    for (particle, &position) in positions.iter().enumerate() {
        let (nodes, weights) = shape(position);
        let values = weights.map(B::Scalar::every);
        d.add(&nodes.map(B::Index::of), &[B::Index::of(particle)], &values)?;
    }
    d.finish()?;
    Ok(d)
}

/// Deposits charges that differ by lane, gathers a field, and checks conservation of charge and the adjoint identity.
fn round_trip<B: Backend>(context: &B::Context) -> Result<(), Error> {
    let positions = positions();
    let d = deposition::<B>(context, &positions)?;
    let vector = |len: usize, of: &dyn Fn(usize, usize) -> f64| -> Result<B::Vector, Error> {
        let mut vector = B::vector(context, len)?;
        let value = |k: usize| B::Scalar::from_lanes(|lane| Scalar::of(of(k, lane)));
        vector.with_local_mut(|values| values.iter_mut().enumerate().for_each(|(k, v)| *v = value(k)))?;
        vector.finish()?;
        Ok(vector)
    };
    let q = vector(PARTICLES, &|k, lane| (lane + 1) as f64 * (1.0 + (k % 3) as f64))?;
    // A linear field, which bilinear cells interpolate exactly.
    let field = vector(SIDE * SIDE, &|node, _| 0.5 * (node / SIDE) as f64 - 0.25 * (node % SIDE) as f64)?;
    let ones = vector(SIDE * SIDE, &|_, _| 1.0)?;
    let (mut rho, mut gathered) = (B::vector(context, SIDE * SIDE)?, B::vector(context, PARTICLES)?);
    d.mul(&q, &mut rho)?;
    d.mul_transpose(&field, &mut gathered)?;
    let (charge, work_at_nodes, work_at_particles) = (rho.dot(&ones)?, rho.dot(&field)?, gathered.dot(&q)?);
    for lane in 0..B::Reduced::LANES {
        let total: f64 = (0..PARTICLES).map(|k| (lane + 1) as f64 * (1.0 + (k % 3) as f64)).sum();
        let (charge, at_nodes) = (charge.lane(lane).as_f64(), work_at_nodes.lane(lane).as_f64());
        let at_particles = work_at_particles.lane(lane).as_f64();
        println!("{:8} lane {lane}: charge {charge:.10}, q . D^T E = {at_particles:.10}", B::NAME);
        assert!((charge - total).abs() < 1e-9 * total, "the deposited charge is {charge}, not {total}");
        assert!((at_nodes - at_particles).abs() < 1e-9 * at_nodes.abs(), "{at_nodes} and {at_particles} differ");
    }
    let exact = positions.iter().map(|[x, y]| 0.5 * x - 0.25 * y);
    let error = gathered.with_local(|e| {
        e.iter().zip(exact).fold(0.0_f64, |most, (e, exact)| most.max((e.lane(0).as_f64() - exact).abs()))
    })?;
    assert!(error < 1e-12, "the gathered linear field has the error {error:e}");
    Ok(())
}

fn main() -> Result<(), Error> {
    round_trip::<Sparse>(&())?;
    round_trip::<Dense>(&())?;
    #[cfg(feature = "batched")]
    round_trip::<biotissue::backends::batched::Batched<f64, 4>>(&())?;
    Ok(())
}
