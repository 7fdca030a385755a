//! Numbering of the free displacement components, which are the unknowns of the linear system.

use crate::fem::mesh::Mesh;
use crate::las::{Sparsity, SparsityError};

/// The equation numbers of the free displacement components: ascending by node, in mesh order or another given order,
/// then by component. Prescribed components have number -1.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Unknowns {
    equation_numbers: Vec<i32>,
    free: usize,
}

impl Unknowns {
    /// Numbers all components of `nodes` nodes except those for which `prescribed(node, component)` is true.
    ///
    /// # Errors
    /// Returns [`SparsityError::TooLarge`] if the number of components exceeds the range of a 32-bit index.
    pub fn new(nodes: usize, prescribed: impl Fn(usize, usize) -> bool) -> Result<Self, SparsityError> {
        Self::number(nodes, 0..nodes, prescribed)
    }

    /// Numbers the components node by node in the given order; `order` is a permutation of all nodes.
    ///
    /// # Errors
    /// As for [`Unknowns::new`].
    ///
    /// # Panics
    /// Panics if `order` contains a node index that is not below its length.
    pub fn in_order(order: &[u32], prescribed: impl Fn(usize, usize) -> bool) -> Result<Self, SparsityError> {
        Self::number(order.len(), order.iter().map(|&node| node as usize), prescribed)
    }

    fn number(
        nodes: usize,
        order: impl Iterator<Item = usize>,
        prescribed: impl Fn(usize, usize) -> bool,
    ) -> Result<Self, SparsityError> {
        if nodes > i32::MAX as usize / 3 {
            return Err(SparsityError::TooLarge(3 * nodes));
        }
        let (mut equation_numbers, mut free) = (vec![-1; 3 * nodes], 0);
        for (node, component) in order.flat_map(|node| (0..3).map(move |component| (node, component))) {
            if !prescribed(node, component) {
                equation_numbers[3 * node + component] = free;
                free += 1;
            }
        }
        Ok(Self { equation_numbers, free: free as usize })
    }

    /// Returns the equation number of component `c` of node `a` at `3 * a + c`; -1 if the component is prescribed.
    pub fn equation_numbers(&self) -> &[i32] {
        &self.equation_numbers
    }

    /// Returns the number of free components.
    pub fn free(&self) -> usize {
        self.free
    }

    /// Returns the sparsity pattern of the stiffness of `mesh`: each element couples its nodes, and each patch of
    /// elements ([`Mesh::patches`]) all nodes of its elements.
    ///
    /// # Errors
    /// Returns [`SparsityError::TooLarge`] if the pattern exceeds the range of a 32-bit index.
    pub fn pattern(&self, mesh: &Mesh) -> Result<Sparsity, SparsityError> {
        let equations = |nodes: &[u32]| -> Vec<i32> {
            nodes.iter().flat_map(|&node| &self.equation_numbers[3 * node as usize..][..3]).copied().collect()
        };
        let patches = mesh.patches().iter().filter(|patch| patch.len() > 1);
        let of_patch = |patch: &Vec<u32>| -> Vec<u32> {
            let mut nodes: Vec<u32> = patch.iter().flat_map(|&e| &mesh.elements()[e as usize]).copied().collect();
            nodes.sort_unstable();
            nodes.dedup();
            nodes
        };
        let of_patches = patches.map(|patch| equations(&of_patch(patch)));
        Sparsity::from_elements(self.free, mesh.elements().iter().map(equations).chain(of_patches))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn free_components_are_numbered_in_order() {
        let unknowns = Unknowns::new(2, |node, component| node == 0 && component != 1).unwrap();
        assert_eq!(unknowns.equation_numbers(), [-1, 0, -1, 1, 2, 3]);
        assert_eq!(unknowns.free(), 4);
        let reversed = Unknowns::in_order(&[1, 0], |node, component| node == 0 && component != 1).unwrap();
        assert_eq!(reversed.equation_numbers(), [-1, 3, -1, 0, 1, 2]);
        assert!(matches!(Unknowns::new(800_000_000, |_, _| true), Err(SparsityError::TooLarge(2_400_000_000))));
    }
}
