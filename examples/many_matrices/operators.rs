//! The matrices that are used only in products, each built from finite differences by sums and products of matrices.

use biotissue::backends::sparse::{Matrix, Vector};
use biotissue::las::{Backend, Entries, MatMat, MatVec, MatrixOps, Sparsity, VectorOps};

use crate::step::Case;
use crate::{Error, Local};

/// Nodes along a side. The number is odd, so that central differences vanish only for constant fields.
const SIDE: usize = 25;
/// Number of nodes.
pub const NODES: usize = SIDE * SIDE;
/// Distance between neighboring nodes.
pub const H: f64 = 1.0 / SIDE as f64;
/// The magnetic field `B`.
pub const B: [f64; 3] = [0.6, 0.3, 0.9];
/// `gamma p0`.
pub const GAMMA_P: f64 = 0.8;

/// Indices of the components of the velocity `v`.
pub const V: [usize; 3] = [0, 1, 2];
/// Index of the flux `psi`.
pub const PSI: usize = 3;
/// Index of the magnetic field `b_z`.
pub const BZ: usize = 4;
/// Index of the pressure `p`.
pub const P: usize = 5;
/// Index of the density `n`.
pub const N: usize = 6;

/// A matrix that gives the effect of one field on another: `to += A from`.
pub struct Coupling {
    pub to: usize,
    pub from: usize,
    pub a: Matrix,
}

/// All matrices of the model.
pub struct Operators {
    /// `R`, the rates of the other fields from the velocity.
    pub rates: Vec<Coupling>,
    /// `F`, the forces from the other fields: `-R^T`, weighted by the energies of the fields.
    pub forces: Vec<Coupling>,
    /// The diagonal matrix of the density `rho` at rest.
    pub density: Matrix,
    /// `-laplace` by applying central differences twice, as in the current.
    pub current: Matrix,
    /// `-laplace` with nearest neighbors, for isotropic diffusion.
    pub isotropic: Matrix,
    /// `-(B . grad)^2`, for conduction along the field.
    pub along: Matrix,
}

/// Assembles a matrix on the periodic grid with the same stencil at each node. `neighbors` lists the steps in `x` and
/// `y` to each neighbor, and the entry.
pub fn stencil(neighbors: &[(usize, usize, f64)]) -> Result<Matrix, Error> {
    let at = |node: usize, (i, j): (usize, usize)| (node / SIDE + i) % SIDE * SIDE + (node % SIDE + j) % SIDE;
    let to_neighbors = |node| neighbors.iter().map(move |&(i, j, _)| [node as i32, at(node, (i, j)) as i32]);
    let pairs = (0..NODES).flat_map(to_neighbors);
    let mut a = Local::matrix(&(), &Sparsity::from_elements(NODES, pairs)?.into())?;
    for node in 0..NODES {
        for &(i, j, value) in neighbors {
            a.add(&[node as i32], &[at(node, (i, j)) as i32], &[value])?;
        }
    }
    Ok(a)
}

/// Evaluates a function of the position at every node.
pub fn on_nodes(of: impl Fn(f64, f64) -> f64) -> Vector {
    (0..NODES).map(|node| of((node / SIDE) as f64 * H, (node % SIDE) as f64 * H)).collect::<Vec<_>>().into()
}

/// Returns `factor A`.
fn scaled(a: &Matrix, factor: f64) -> Result<Matrix, Error> {
    let mut scaled = a.clone();
    scaled.scale(factor)?;
    Ok(scaled)
}

impl Operators {
    /// Assembles all matrices of a case.
    pub fn new(case: &Case) -> Result<Self, Error> {
        const BACK: usize = SIDE - 1;
        let (slope, c) = (0.5 / H, 1.0 / (H * H));
        let one = stencil(&[(0, 0, 1.0)])?;
        let dx = stencil(&[(1, 0, slope), (BACK, 0, -slope)])?;
        let dy = stencil(&[(0, 1, slope), (0, BACK, -slope)])?;
        let isotropic = stencil(&[(0, 0, 4.0 * c), (1, 0, -c), (BACK, 0, -c), (0, 1, -c), (0, BACK, -c)])?;
        let mut density = one.clone();
        for (node, &rho) in (0..).zip(on_nodes(case.density).as_slice()) {
            density.set(&[node], &[node], &[rho])?;
        }
        let current = dx.product(&dx)?.sum(-1.0, &dy.product(&dy)?, -1.0)?;
        let b_grad = dx.sum(B[0], &dy, B[1])?;
        let along = scaled(&b_grad.product(&b_grad)?, -1.0)?;
        let rates = vec![
            Coupling { to: PSI, from: V[0], a: scaled(&one, B[1])? },
            Coupling { to: PSI, from: V[1], a: scaled(&one, -B[0])? },
            Coupling { to: BZ, from: V[0], a: scaled(&dx, -B[2])? },
            Coupling { to: BZ, from: V[1], a: scaled(&dy, -B[2])? },
            Coupling { to: BZ, from: V[2], a: b_grad },
            Coupling { to: P, from: V[0], a: scaled(&dx, -GAMMA_P)? },
            Coupling { to: P, from: V[1], a: scaled(&dy, -GAMMA_P)? },
            Coupling { to: N, from: V[0], a: scaled(&dx.product(&density)?, -1.0)? },
            Coupling { to: N, from: V[1], a: scaled(&dy.product(&density)?, -1.0)? },
        ];
        // The particle density exerts no force.
        let mut forces = Vec::new();
        for Coupling { to, from, a } in rates.iter().filter(|rate| rate.to != N) {
            let transpose = a.transpose()?;
            let weighted = match *to {
                PSI => scaled(&transpose.product(&current)?, -1.0)?,
                P => scaled(&transpose, -1.0 / GAMMA_P)?,
                _ => scaled(&transpose, -1.0)?,
            };
            forces.push(Coupling { to: *from, from: *to, a: weighted });
        }
        Ok(Self { rates, forces, density, current, isotropic, along })
    }

    /// Assembles `rho - dt^2/4 F R`, with the three unknowns of a node consecutive.
    pub fn implicit_velocity(&self, dt: f64) -> Result<Matrix, Error> {
        let (mut places, mut values) = (Vec::new(), Vec::new());
        let mut put = |a: &Matrix, to: usize, from: usize, factor: f64| {
            a.for_each(|row, column, value| {
                places.push([(3 * row + to) as i32, (3 * column + from) as i32]);
                values.push(factor * value);
            })
        };
        for v in V {
            put(&self.density, v, v, 1.0)?;
        }
        for force in &self.forces {
            for rate in self.rates.iter().filter(|rate| rate.to == force.from) {
                put(&force.a.product(&rate.a)?, force.to, rate.from, -0.25 * dt * dt)?;
            }
        }
        let mut a = Local::matrix(&(), &Sparsity::from_elements(3 * NODES, &places)?.into())?;
        for ([row, column], value) in places.into_iter().zip(values) {
            a.add(&[row], &[column], &[value])?;
        }
        Ok(a)
    }

    /// Returns the energy `1/2 (v . rho v + psi . L psi + b_z^2 + p^2 / gamma p0)`, summed over the nodes, with `L`
    /// from `current`.
    pub fn energy(&self, fields: &[Vector]) -> Result<f64, Error> {
        let mut energy = fields[BZ].dot(&fields[BZ])? + fields[P].dot(&fields[P])? / GAMMA_P;
        let mut product = on_nodes(|_, _| 0.0);
        for (a, field) in V.map(|v| (&self.density, v)).into_iter().chain([(&self.current, PSI)]) {
            a.mul(&fields[field], &mut product)?;
            energy += fields[field].dot(&product)?;
        }
        Ok(0.5 * energy)
    }

    /// Returns the rows of a table: name, number of matrices, total number of entries.
    pub fn groups(&self) -> [(&'static str, usize, usize); 4] {
        let entries = |all: &[&Matrix]| all.iter().map(|a| a.pattern().nnz()).sum();
        let of = |couplings: &[Coupling]| entries(&couplings.iter().map(|coupling| &coupling.a).collect::<Vec<_>>());
        [
            ("rates from the velocity", self.rates.len(), of(&self.rates)),
            ("forces from the fields", self.forces.len(), of(&self.forces)),
            ("density, current", 2, entries(&[&self.density, &self.current])),
            ("diffusion, conduction", 2, entries(&[&self.isotropic, &self.along])),
        ]
    }
}
