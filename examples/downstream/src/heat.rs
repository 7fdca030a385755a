//! Heat conduction with a conductivity proportional to temperature, `du/dt = div(kappa u grad u)`, on any backend.
//!
//! The discretization uses linear triangles, heat capacities lumped at the nodes, and explicit time steps. The
//! conductivity depends on the temperature, so the matrix is assembled again in every step. On a backend with several
//! lanes per entry, each lane is a separate body with the same mesh and its own `kappa`.

use std::sync::Arc;

use biotissue::las::{Backend, Index, MatVec, MatrixOps, Scalar, Sparsity, Value, VectorOps};

use crate::mesh::Mesh;

pub type Error = Box<dyn std::error::Error>;

/// One body, or one body per lane.
pub struct Body<B: Backend> {
    places: Vec<[f64; 2]>,
    elements: Vec<Element<B>>,
    /// Positions of the nine entries of each element in the matrix.
    slots: Vec<B::Slot>,
    /// The matrix whose product with the temperatures is their rates of change.
    rates: B::Matrix,
    temperature: B::Vector,
    /// The rates of change of the temperatures in the last step.
    change: B::Vector,
    /// The area associated with each node.
    capacity: B::Vector,
}

struct Element<B: Backend> {
    nodes: [B::Index; 3],
    /// The matrix from the nodal temperatures to their rates, for a conductivity of one; row by row.
    exchange: [B::Scalar; 9],
}

impl<B: Backend> Body<B> {
    /// Creates a body with an initial temperature that depends on position and lane.
    pub fn new(context: &B::Context, mesh: Mesh, start: impl Fn([f64; 2], usize) -> f64) -> Result<Self, Error> {
        let len = mesh.nodes.len();
        let pattern = Sparsity::from_elements(len, mesh.triangles.iter().map(|triangle| triangle.map(|k| k as i32)))?;
        let mut capacity = B::vector(context, len)?;
        for triangle in &mesh.triangles {
            let third = B::Scalar::every(mesh.shape(triangle).area / 3.0);
            capacity.add(&triangle.map(B::Index::of), &[third; 3])?;
        }
        capacity.finish()?;

        let rates = B::matrix(context, &Arc::new(pattern))?;
        let (mut elements, mut slots) = (Vec::new(), Vec::new());
        for triangle in &mesh.triangles {
            let nodes = triangle.map(B::Index::of);
            let mut shares = [B::Scalar::default(); 3];
            capacity.get(&nodes, &mut shares)?;
            let stiffness = mesh.shape(triangle).stiffness;
            let exchange = std::array::from_fn(|k| B::Scalar::every(-stiffness[k]) / shares[k / 3]);
            rates.locate(&nodes, &nodes, &mut slots)?;
            elements.push(Element { nodes, exchange });
        }

        let (mut temperature, change) = (B::vector(context, len)?, B::vector(context, len)?);
        temperature.with_local_mut(|values| {
            for (value, &place) in values.iter_mut().zip(&mesh.nodes) {
                *value = B::Scalar::from_lanes(|lane| Scalar::of(start(place, lane)));
            }
        })?;
        temperature.finish()?;
        Ok(Self { places: mesh.nodes, elements, slots, rates, temperature, change, capacity })
    }

    /// Assembles the matrix at the current temperatures.
    fn assemble(&mut self, kappa: B::Scalar) -> Result<(), B::Error> {
        let third = kappa * B::Scalar::every(1.0 / 3.0);
        self.rates.zero()?;
        for (element, slots) in self.elements.iter().zip(self.slots.chunks_exact(9)) {
            let mut u = [B::Scalar::default(); 3];
            self.temperature.get(&element.nodes, &mut u)?;
            let conductivity = third * (u[0] + u[1] + u[2]);
            self.rates.add_at(slots, &element.exchange.map(|entry| conductivity * entry))?;
        }
        self.rates.finish()
    }

    /// Takes one explicit time step of `seconds`. It is stable for steps up to a quarter of the squared cell size over
    /// the maximum of `kappa u`.
    pub fn step(&mut self, kappa: B::Scalar, seconds: f64) -> Result<(), Error> {
        self.assemble(kappa)?;
        self.rates.mul(&self.temperature, &mut self.change)?;
        self.temperature.axpy(B::Scalar::every(seconds), &self.change)?;
        Ok(())
    }

    /// Returns the total heat of each body.
    pub fn heat(&self) -> Result<B::Reduced, B::Error> {
        self.temperature.dot(&self.capacity)
    }

    /// Returns the root mean square of the nodal rates of change in the last step, for each body.
    pub fn rms_rate(&self) -> Result<B::Reduced, B::Error> {
        Ok(self.change.norm()? / B::Reduced::every((self.places.len() as f64).sqrt()))
    }

    /// Returns the temperatures of the body in a lane, by node.
    pub fn temperatures(&self, lane: usize) -> Result<Vec<f64>, B::Error> {
        self.temperature.with_local(|values| values.iter().map(|value| value.lane(lane).as_f64()).collect())
    }

    /// Returns the difference from an exact temperature field: the sum of its nodal absolute values, weighted by
    /// capacity, relative to the total heat.
    pub fn error(&self, lane: usize, exact: impl Fn([f64; 2]) -> f64) -> Result<f64, B::Error> {
        let capacity =
            self.capacity.with_local(|values| values.iter().map(|c| c.lane(lane).as_f64()).collect::<Vec<_>>())?;
        let (mut misplaced, mut all) = (0.0, 0.0);
        for ((u, c), &place) in self.temperatures(lane)?.into_iter().zip(capacity).zip(&self.places) {
            misplaced += c * (u - exact(place)).abs();
            all += c * u;
        }
        Ok(misplaced / all)
    }

    /// Returns the largest distance from the origin of a node warmer than a hundredth of the maximum temperature.
    pub fn reach(&self, lane: usize) -> Result<f64, B::Error> {
        let temperatures = self.temperatures(lane)?;
        let hottest = temperatures.iter().copied().fold(0.0, f64::max);
        let warm = self.places.iter().zip(temperatures).filter(|&(_, u)| u > 0.01 * hottest);
        Ok(warm.map(|(&[x, y], _)| x.hypot(y)).fold(0.0, f64::max))
    }
}
