//! Assembly of the interior stiffness into precomputed positions.

use std::sync::Arc;

use super::network::Network;
use super::truss::{FiberStates, Truss};
use crate::las::{Backend, Index, MatrixOps, RealBackend, Sparsity, SparsityError};

/// Returns the sparsity pattern of the interior stiffness: three unknowns per interior node, in the order of
/// [`Network::interior`], coupled in full blocks.
///
/// # Errors
/// Returns [`SparsityError::TooLarge`] if the unknowns or entries exceed the index type.
pub fn pattern(network: &Network) -> Result<Sparsity, SparsityError> {
    let number = network.interior_number();
    let unknowns = |node: u32| {
        let first = 3 * number[node as usize];
        if first < 0 { [-1; 3] } else { [first, first + 1, first + 2] }
    };
    let elements = network.fibers().iter().map(|&[a, b]| {
        let (a, b) = (unknowns(a), unknowns(b));
        [a[0], a[1], a[2], b[0], b[1], b[2]]
    });
    Sparsity::from_elements(3 * network.interior().len(), elements)
}

/// Positions of the blocks of the interior stiffness: the diagonal block of every interior node, and the two
/// off-diagonal blocks of every fiber between interior nodes. Fibers that end on the boundary contribute to diagonal
/// blocks only.
#[derive(Debug)]
pub struct StiffnessSlots<B: Backend> {
    /// Nine slots per interior node.
    diagonal: Vec<B::Slot>,
    /// The interior numbers of both ends of every fiber; for an end on the boundary, the count of interior nodes.
    ends: Vec<[u32; 2]>,
    /// Eighteen slots for each fiber between interior nodes: block `(a, b)`, then block `(b, a)`.
    pairs: Vec<B::Slot>,
}

impl<B: RealBackend> StiffnessSlots<B> {
    /// Locates all blocks in a matrix of the given pattern.
    ///
    /// # Errors
    /// Returns the error of the backend if it cannot make or index the matrix.
    pub fn locate(context: &B::Context, truss: &Truss, pattern: &Arc<Sparsity>) -> Result<Self, B::Error> {
        let matrix = B::matrix(context, pattern)?;
        let number = truss.network().interior_number();
        let interior = truss.network().interior().len();
        let rows = |node: usize| [0, 1, 2].map(|i| B::Index::of(3 * node + i));
        let mut slots = Self { diagonal: Vec::new(), ends: Vec::new(), pairs: Vec::new() };
        for node in 0..interior {
            matrix.locate(&rows(node), &rows(node), &mut slots.diagonal)?;
        }
        for ends in truss.ends() {
            let ends = ends.map(|node| usize::try_from(number[node as usize]).unwrap_or(interior));
            slots.ends.push(ends.map(|node| node as u32));
            if ends.iter().all(|&node| node < interior) {
                let [a, b] = ends.map(rows);
                matrix.locate(&a, &b, &mut slots.pairs)?;
                matrix.locate(&b, &a, &mut slots.pairs)?;
            }
        }
        Ok(slots)
    }

    /// Adds the stiffness of all fibers into a zeroed `matrix`. `diagonal` receives the diagonal blocks, and in a last
    /// block the contributions to boundary nodes.
    ///
    /// # Errors
    /// Returns the error of the backend if it cannot add entries.
    pub fn assemble(
        &self,
        truss: &Truss,
        states: &FiberStates,
        diagonal: &mut Vec<[f64; 9]>,
        matrix: &mut B::Matrix,
    ) -> Result<(), B::Error> {
        let interior = truss.network().interior().len();
        // An unused last block collects the contributions to boundary nodes, which avoids a test for each fiber end.
        diagonal.clear();
        diagonal.resize(interior + 1, [0.0; 9]);
        let mut pairs = self.pairs.chunks_exact(18);
        for (fiber, ends) in self.ends.iter().enumerate() {
            let block = states.block(fiber);
            for &node in ends {
                diagonal[node as usize].iter_mut().zip(&block).for_each(|(sum, k)| *sum += k);
            }
            if ends.iter().all(|&node| (node as usize) < interior)
                && let Some(slots) = pairs.next()
            {
                // The block is symmetric, so that the blocks `(a, b)` and `(b, a)` are equal.
                let block = block.map(|k| -k);
                matrix.add_at(&slots[..9], &block)?;
                matrix.add_at(&slots[9..], &block)?;
            }
        }
        for (slots, block) in self.diagonal.chunks_exact(9).zip(diagonal.iter()) {
            matrix.add_at(slots, block)?;
        }
        Ok(())
    }
}
