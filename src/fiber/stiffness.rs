//! Assembly of the interior stiffness, through positions located once.

use std::sync::Arc;

use super::truss::{FiberStates, Truss};
use crate::las::{Backend, Index, MatrixOps, Sparsity};

/// Where the blocks of the interior stiffness go: the diagonal block of every interior node, and the two mirrored blocks
/// of every fiber between interior nodes. Fibers that reach the boundary only touch diagonal blocks.
#[derive(Debug)]
pub struct StiffnessSlots<B: Backend> {
    /// Nine slots an interior node.
    diagonal: Vec<B::Slot>,
    /// Fibers with two interior ends.
    inner: Vec<u32>,
    /// Eighteen slots each of those: block `(a, b)`, then block `(b, a)`.
    pairs: Vec<B::Slot>,
}

impl<B: Backend<Scalar = f64>> StiffnessSlots<B> {
    /// Finds all positions in a matrix of the given pattern.
    ///
    /// # Errors
    /// What the backend reports.
    pub fn locate(context: &B::Context, truss: &Truss, pattern: &Arc<Sparsity>) -> Result<Self, B::Fault> {
        let matrix = B::matrix(context, pattern)?;
        let number = truss.network().interior_number();
        let rows = |interior: usize| [0, 1, 2].map(|i| B::Index::of(3 * interior + i));
        let mut slots = Self { diagonal: Vec::new(), inner: Vec::new(), pairs: Vec::new() };
        for node in 0..truss.network().interior().len() {
            matrix.locate(&rows(node), &rows(node), &mut slots.diagonal)?;
        }
        for (fiber, &[a, b]) in truss.ends().iter().enumerate() {
            let (a, b) = (number[a as usize], number[b as usize]);
            if a >= 0 && b >= 0 {
                let (a, b) = (rows(a as usize), rows(b as usize));
                slots.inner.push(fiber as u32);
                matrix.locate(&a, &b, &mut slots.pairs)?;
                matrix.locate(&b, &a, &mut slots.pairs)?;
            }
        }
        Ok(slots)
    }

    /// Adds the stiffness of all fibers into a zeroed `matrix`; `diagonal` is scratch.
    ///
    /// # Errors
    /// What the backend reports.
    pub fn assemble(
        &self,
        truss: &Truss,
        states: &FiberStates,
        diagonal: &mut Vec<[f64; 9]>,
        matrix: &mut B::Matrix,
    ) -> Result<(), B::Fault> {
        let number = truss.network().interior_number();
        diagonal.clear();
        diagonal.resize(truss.network().interior().len(), [0.0; 9]);
        for (fiber, ends) in truss.ends().iter().enumerate() {
            let block = states.block(fiber);
            for &node in ends {
                // A boundary node has number -1, which no diagonal block answers to.
                if let Some(sum) = diagonal.get_mut(number[node as usize] as usize) {
                    sum.iter_mut().zip(&block).for_each(|(s, b)| *s += b);
                }
            }
        }
        for (slots, block) in self.diagonal.chunks_exact(9).zip(diagonal.iter()) {
            matrix.add_at(slots, block)?;
        }
        for (slots, &fiber) in self.pairs.chunks_exact(18).zip(&self.inner) {
            let block = states.block(fiber as usize).map(|k| -k);
            // The block is symmetric: the mirrored one is the same.
            matrix.add_at(&slots[..9], &block)?;
            matrix.add_at(&slots[9..], &block)?;
        }
        Ok(())
    }
}
