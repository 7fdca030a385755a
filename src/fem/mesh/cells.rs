//! Elements or faces of several types, in blocks of one type each.

use std::ops::{Index, IndexMut, Range};

use crate::fem::element::{CellType, ElementType, FaceType};

/// Consecutive cells of one type.
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "app", derive(serde::Serialize, serde::Deserialize))]
pub struct Block<T> {
    cell_type: T,
    first: usize,
    /// The nodes of all cells of the block, one cell after the other.
    nodes: Vec<u32>,
}

/// The nodes of cells (elements or faces) of one or more types, in the order of the node numbering of
/// [`reference`](crate::fem::element::reference). Cells are numbered from 0 through all blocks.
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "app", derive(serde::Serialize, serde::Deserialize))]
pub struct Cells<T> {
    blocks: Vec<Block<T>>,
}

/// The elements of a mesh.
pub type Elements = Cells<ElementType>;

/// The faces of a surface.
pub type Faces = Cells<FaceType>;

impl<T: CellType> Block<T> {
    /// Returns the type of the cells.
    pub fn cell_type(&self) -> T {
        self.cell_type
    }

    /// Number of cells.
    pub fn len(&self) -> usize {
        self.nodes.len() / self.cell_type.nodes()
    }

    /// Returns true if the block has no cells, which occurs for no block of a mesh.
    pub fn is_empty(&self) -> bool {
        self.nodes.is_empty()
    }

    /// Returns the numbers of the cells.
    pub fn range(&self) -> Range<usize> {
        self.first..self.first + self.len()
    }

    /// Returns the nodes of all cells of the block, one cell after the other.
    pub fn nodes(&self) -> &[u32] {
        &self.nodes
    }

    /// Returns the nodes of each cell.
    pub fn iter(&self) -> std::slice::ChunksExact<'_, u32> {
        self.nodes.chunks_exact(self.cell_type.nodes())
    }
}

/// No cells.
impl<T: 'static> Default for &Cells<T> {
    fn default() -> Self {
        const { &Cells { blocks: Vec::new() } }
    }
}

impl<T> Default for Cells<T> {
    fn default() -> Self {
        Self { blocks: Vec::new() }
    }
}

impl<T: CellType> Cells<T> {
    /// Appends a cell; it starts a new block if its type differs from that of the last cell.
    ///
    /// # Panics
    /// Panics if the number of nodes is not that of the type.
    pub fn push(&mut self, cell_type: T, nodes: &[u32]) {
        assert_eq!(nodes.len(), cell_type.nodes(), "the nodes of a {cell_type:?}");
        let first = self.len();
        match self.blocks.last_mut() {
            Some(last) if last.cell_type == cell_type => last.nodes.extend_from_slice(nodes),
            _ => self.blocks.push(Block { cell_type, first, nodes: nodes.to_vec() }),
        }
    }

    /// Creates cells of one type.
    fn of_type(cell_type: T, nodes: Vec<u32>) -> Self {
        let block = (!nodes.is_empty()).then_some(Block { cell_type, first: 0, nodes });
        Self { blocks: block.into_iter().collect() }
    }

    /// Appends the cells of `other`.
    pub fn extend(&mut self, other: &Self) {
        other.typed().for_each(|(cell_type, nodes)| self.push(cell_type, nodes));
    }

    /// Returns the blocks; consecutive ones have different types.
    pub fn blocks(&self) -> &[Block<T>] {
        &self.blocks
    }

    /// Number of cells.
    pub fn len(&self) -> usize {
        self.blocks.last().map_or(0, |block| block.range().end)
    }

    /// Returns true if there are no cells.
    pub fn is_empty(&self) -> bool {
        self.blocks.is_empty()
    }

    /// Returns the nodes of each cell.
    pub fn iter(&self) -> impl Iterator<Item = &[u32]> + Clone {
        self.blocks.iter().flat_map(Block::iter)
    }

    /// Returns type and nodes of each cell.
    pub fn typed(&self) -> impl Iterator<Item = (T, &[u32])> + Clone {
        self.blocks.iter().flat_map(|block| block.iter().map(|nodes| (block.cell_type, nodes)))
    }

    /// Returns the type and the nodes of a cell; `None` if it does not exist.
    pub fn get(&self, cell: usize) -> Option<(T, &[u32])> {
        (cell < self.len()).then(|| {
            let (block, range) = self.place(cell);
            let block = &self.blocks[block];
            (block.cell_type, &block.nodes[range])
        })
    }

    /// Returns the type of a cell.
    ///
    /// # Panics
    /// Panics if the cell does not exist.
    pub fn cell_type(&self, cell: usize) -> T {
        self.blocks[self.place(cell).0].cell_type
    }

    /// Returns the number of cells of each type, in the order of their first occurrence.
    pub fn count_by_type(&self) -> Vec<(T, usize)> {
        let mut counts: Vec<(T, usize)> = Vec::new();
        for block in &self.blocks {
            match counts.iter_mut().find(|(cell_type, _)| *cell_type == block.cell_type) {
                Some((_, count)) => *count += block.len(),
                None => counts.push((block.cell_type, block.len())),
            }
        }
        counts
    }

    /// Returns the cells with each node replaced by `map(node)`.
    pub fn map(&self, map: impl Fn(u32) -> u32) -> Self {
        let of_block =
            |block: &Block<T>| Block { nodes: block.nodes.iter().map(|&node| map(node)).collect(), ..*block };
        Self { blocks: self.blocks.iter().map(of_block).collect() }
    }

    /// Returns the block of a cell, and the range of its nodes there. Panics if the cell does not exist.
    fn place(&self, cell: usize) -> (usize, Range<usize>) {
        assert!(cell < self.len(), "cell {cell} of {}", self.len());
        let number = self.blocks.partition_point(|block| block.first <= cell) - 1;
        let block = &self.blocks[number];
        let (nodes, local) = (block.cell_type.nodes(), cell - block.first);
        (number, local * nodes..(local + 1) * nodes)
    }
}

impl<T: CellType> Index<usize> for Cells<T> {
    type Output = [u32];

    fn index(&self, cell: usize) -> &[u32] {
        let (block, range) = self.place(cell);
        &self.blocks[block].nodes[range]
    }
}

impl<T: CellType> IndexMut<usize> for Cells<T> {
    fn index_mut(&mut self, cell: usize) -> &mut [u32] {
        let (block, range) = self.place(cell);
        &mut self.blocks[block].nodes[range]
    }
}

impl<'a, T: CellType> IntoIterator for &'a Cells<T> {
    type Item = &'a [u32];
    type IntoIter = std::iter::FlatMap<
        std::slice::Iter<'a, Block<T>>,
        std::slice::ChunksExact<'a, u32>,
        fn(&'a Block<T>) -> std::slice::ChunksExact<'a, u32>,
    >;

    fn into_iter(self) -> Self::IntoIter {
        self.blocks.iter().flat_map(Block::iter)
    }
}

impl<'a, T: CellType> FromIterator<(T, &'a [u32])> for Cells<T> {
    fn from_iter<I: IntoIterator<Item = (T, &'a [u32])>>(cells: I) -> Self {
        let mut collected = Self::default();
        cells.into_iter().for_each(|(cell_type, nodes)| collected.push(cell_type, nodes));
        collected
    }
}

/// Linear tetrahedra.
impl From<Vec<[u32; 4]>> for Elements {
    fn from(nodes: Vec<[u32; 4]>) -> Self {
        Self::of_type(ElementType::Tet4, nodes.into_flattened())
    }
}

/// Linear triangles.
impl From<Vec<[u32; 3]>> for Faces {
    fn from(nodes: Vec<[u32; 3]>) -> Self {
        Self::of_type(FaceType::Tri3, nodes.into_flattened())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cells_of_several_types_are_numbered_through() {
        let mut cells = Elements::from(vec![[0, 1, 2, 3], [4, 5, 6, 7]]);
        cells.push(ElementType::Wedge6, &[1, 2, 3, 4, 5, 6]);
        cells.push(ElementType::Tet4, &[7, 8, 9, 10]);
        assert_eq!((cells.len(), cells.blocks().len()), (4, 3));
        assert_eq!(cells.count_by_type(), [(ElementType::Tet4, 3), (ElementType::Wedge6, 1)]);
        assert_eq!(cells.blocks()[1].range(), 2..3);
        assert_eq!(cells.get(2), Some((ElementType::Wedge6, &[1, 2, 3, 4, 5, 6][..])));
        assert_eq!((&cells[3], cells.get(4)), (&[7, 8, 9, 10][..], None));
        cells[1][0] = 9;
        let nodes: Vec<&[u32]> = cells.iter().collect();
        assert_eq!(nodes, [&[0, 1, 2, 3][..], &[9, 5, 6, 7], &[1, 2, 3, 4, 5, 6], &[7, 8, 9, 10]]);
        assert_eq!((&cells).into_iter().collect::<Vec<_>>(), nodes);
        assert_eq!(cells.typed().collect::<Elements>(), cells);
        assert_eq!(&cells.map(|node| node + 1)[0], [1, 2, 3, 4]);
        assert!(Faces::default().is_empty() && Faces::default().get(0).is_none());
    }
}
