//! Heat conduction that is faster where it is hotter, `du/dt = div(kappa u grad u)`, on any backend.
//!
//! Linear triangles, heat capacities lumped at the nodes, explicit steps in time. The conductivity changes with the
//! temperature, so that the matrix is assembled anew in every step. With a backend of several lanes an entry, each lane
//! is a body of its own: same mesh, another `kappa`.

use std::sync::Arc;

use biotissue::las::{Backend, Index, MatVec, MatrixOps, Scalar, Sparsity, Value, VectorOps};

use crate::mesh::Mesh;

pub type Error = Box<dyn std::error::Error>;

/// One body, or one a lane.
pub struct Body<B: Backend> {
    places: Vec<[f64; 2]>,
    elements: Vec<Element<B>>,
    /// Where the nine entries of each element are in the matrix.
    slots: Vec<B::Slot>,
    /// How fast temperatures change is this matrix times the temperatures.
    rates: B::Matrix,
    temperature: B::Vector,
    change: B::Vector,
    /// The part of the area that belongs to each node.
    capacity: B::Vector,
}

struct Element<B: Backend> {
    nodes: [B::Index; 3],
    /// Rates at its nodes by the temperatures there, for a conductivity of one.
    exchange: [B::Scalar; 9],
}

impl<B: Backend> Body<B> {
    /// A body that starts with the given temperature, by place and lane.
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

    /// The matrix for the temperatures of now.
    fn assemble(&mut self, kappa: B::Scalar) -> Result<(), B::Fault> {
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

    /// One explicit step in time. It is stable up to a quarter of the square of a cell's side over `kappa u`.
    pub fn step(&mut self, kappa: B::Scalar, seconds: f64) -> Result<(), Error> {
        self.assemble(kappa)?;
        self.rates.mul(&self.temperature, &mut self.change)?;
        self.temperature.axpy(B::Scalar::every(seconds), &self.change)?;
        Ok(())
    }

    /// The heat of each body.
    pub fn heat(&self) -> Result<B::Reduced, B::Fault> {
        self.temperature.dot(&self.capacity)
    }

    /// How fast each body changed in the last step, as the root of the mean square over its nodes.
    pub fn unrest(&self) -> Result<B::Reduced, B::Fault> {
        Ok(self.change.norm()? / B::Reduced::every((self.places.len() as f64).sqrt()))
    }

    /// The temperatures of the body in a lane, node by node.
    pub fn temperatures(&self, lane: usize) -> Result<Vec<f64>, B::Fault> {
        self.temperature.with_local(|values| values.iter().map(|value| value.lane(lane).as_f64()).collect())
    }

    /// The distance from an exact temperature by place: heat that is in the wrong place, over all heat.
    pub fn error(&self, lane: usize, exact: impl Fn([f64; 2]) -> f64) -> Result<f64, B::Fault> {
        let capacity =
            self.capacity.with_local(|values| values.iter().map(|c| c.lane(lane).as_f64()).collect::<Vec<_>>())?;
        let (mut misplaced, mut all) = (0.0, 0.0);
        for ((u, c), &place) in self.temperatures(lane)?.into_iter().zip(capacity).zip(&self.places) {
            misplaced += c * (u - exact(place)).abs();
            all += c * u;
        }
        Ok(misplaced / all)
    }

    /// How far from the hot corner a body is warm: above a hundredth of its hottest point.
    pub fn reach(&self, lane: usize) -> Result<f64, B::Fault> {
        let temperatures = self.temperatures(lane)?;
        let hottest = temperatures.iter().copied().fold(0.0, f64::max);
        let warm = self.places.iter().zip(temperatures).filter(|&(_, u)| u > 0.01 * hottest);
        Ok(warm.map(|(&[x, y], _)| x.hypot(y)).fold(0.0, f64::max))
    }
}
