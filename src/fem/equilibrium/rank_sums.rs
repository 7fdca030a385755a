//! Sums over the nodes of a body, of which each rank may hold a part.

use std::ops::Range;
use std::sync::Arc;

use super::NODES_PER_CHUNK;
use crate::fem::mesh::Part;
use crate::las::Backend;
use crate::parallel;

/// Sums over own nodes, and over the ranks.
pub(super) struct RankSums<B: Backend> {
    /// `None` if every rank holds the whole body.
    divided: Option<Divided<B>>,
}

/// The part of a body that this rank holds.
pub(super) struct Divided<B: Backend> {
    pub part: Arc<Part>,
    /// The context of the linear system of the part.
    pub context: B::Context,
    /// The number of unknowns of the whole body.
    pub unknowns: usize,
}

impl<B: Backend> RankSums<B> {
    pub fn new(divided: Option<Divided<B>>) -> Self {
        Self { divided }
    }

    /// Replaces each value, a sum over own nodes or elements, by its sum over the ranks.
    pub fn sum(&self, values: &mut [f64]) -> Result<(), B::Error> {
        self.divided.as_ref().map_or(Ok(()), |divided| B::sum(&divided.context, values))
    }

    /// Replaces each value by its maximum over the ranks.
    pub fn max(&self, values: &mut [f64]) -> Result<(), B::Error> {
        self.divided.as_ref().map_or(Ok(()), |divided| B::max(&divided.context, values))
    }

    /// Returns the root of a sum of squares over the ranks, given that of this rank.
    pub fn root(&self, squares: f64) -> Result<f64, B::Error> {
        let mut sum = [squares];
        self.sum(&mut sum)?;
        Ok(sum[0].sqrt())
    }

    /// Returns the number of nodes of the whole body, given that of this rank.
    pub fn nodes(&self, local: usize) -> usize {
        self.divided.as_ref().map_or(local, |divided| divided.part.whole.nodes)
    }

    /// Returns the number of unknowns of the whole body, given that of this rank.
    pub fn unknowns(&self, own: usize) -> usize {
        self.divided.as_ref().map_or(own, |divided| divided.unknowns)
    }

    /// Returns the sum of `value(node, component)` over the own nodes, in an order that does not depend on the number of
    /// threads; there are `nodes` nodes.
    pub fn over_own(&self, nodes: usize, value: impl Fn(usize, usize) -> f64 + Sync + Send) -> f64 {
        let starts = (0..nodes).step_by(NODES_PER_CHUNK);
        let of_chunk = |start: usize| self.over_range(start..nodes.min(start + NODES_PER_CHUNK), &value);
        parallel::map(starts, of_chunk).into_iter().sum()
    }

    fn over_range(&self, nodes: Range<usize>, value: impl Fn(usize, usize) -> f64) -> f64 {
        let components = |node| [0, 1, 2].map(|component| value(node, component));
        match &self.divided {
            None => nodes.flat_map(components).sum(),
            Some(Divided { part, .. }) => nodes.filter(|&node| part.is_own_node[node]).flat_map(components).sum(),
        }
    }

    /// Returns the sum of the squares of vectors at the own nodes.
    pub fn squares(&self, vectors: &[[f64; 3]]) -> f64 {
        self.over_own(vectors.len(), |node, component| vectors[node][component] * vectors[node][component])
    }

    /// Returns the sum of the products of vectors at the own nodes.
    pub fn product(&self, a: &[[f64; 3]], b: &[[f64; 3]]) -> f64 {
        self.over_range(0..a.len(), |node, component| a[node][component] * b[node][component])
    }
}
