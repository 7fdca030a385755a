//! The positions of many blocks of one size in a matrix.

use super::Backend;
use super::node_positions::NodePositions;

/// The positions of many square blocks of one size in a matrix, made by
/// [`MatrixOps::locate_blocks`](super::MatrixOps::locate_blocks) for
/// [`MatrixOps::add_blocks`](super::MatrixOps::add_blocks).
#[derive(Clone, Debug)]
pub struct BlockSlots<B: Backend> {
    size: usize,
    positions: BlockPositions<B::Slot>,
}

/// One position per entry of a block, or fewer for nodes in compressed rows.
#[derive(Clone, Debug)]
pub(crate) enum BlockPositions<S> {
    Entries(Vec<S>),
    #[cfg_attr(not(any(feature = "sparse", feature = "batched")), expect(dead_code, reason = "no compressed rows"))]
    Nodes(NodePositions),
}

impl<B: Backend> BlockSlots<B> {
    /// Creates the positions of blocks of `size` rows from the slots of all their entries, block by block and row by
    /// row.
    pub fn new(size: usize, slots: Vec<B::Slot>) -> Self {
        debug_assert!(size > 0 && slots.len().is_multiple_of(size * size), "the slots of whole blocks");
        Self { size, positions: BlockPositions::Entries(slots) }
    }

    /// Creates the positions of blocks of nodes in compressed rows.
    #[cfg(any(feature = "sparse", feature = "batched"))]
    pub(crate) fn of_nodes(positions: NodePositions) -> Self {
        Self { size: positions.size(), positions: BlockPositions::Nodes(positions) }
    }

    /// Returns the number of rows of a block.
    pub fn size(&self) -> usize {
        self.size
    }

    /// Returns the number of blocks.
    pub fn len(&self) -> usize {
        match &self.positions {
            BlockPositions::Entries(slots) => slots.len() / (self.size * self.size).max(1),
            BlockPositions::Nodes(positions) => positions.len(),
        }
    }

    /// Returns true if there are no blocks.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Returns the slots of the entries of each block; nothing if the backend stores positions in a form of its own.
    pub fn entries(&self) -> impl Iterator<Item = &[B::Slot]> {
        let slots: &[B::Slot] = match &self.positions {
            BlockPositions::Entries(slots) => slots,
            BlockPositions::Nodes(_) => &[],
        };
        slots.chunks_exact((self.size * self.size).max(1))
    }

    #[cfg(any(feature = "sparse", feature = "batched"))]
    pub(crate) fn positions(&self) -> &BlockPositions<B::Slot> {
        &self.positions
    }
}
