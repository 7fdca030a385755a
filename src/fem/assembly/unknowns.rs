//! Which displacement components are unknown, and their numbers.

use crate::fem::element::UNKNOWNS;
use crate::fem::mesh::Mesh;
use crate::las::{Sparsity, SparsityError};

/// The numbers of the free displacement components: ascending by node, then by component; -1 for prescribed ones.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Unknowns {
    numbers: Vec<i32>,
    free: usize,
}

impl Unknowns {
    /// Numbers all components of `nodes` nodes but those for which `prescribed(node, component)` holds.
    ///
    /// # Errors
    /// [`SparsityError::TooLarge`] for more than a 32-bit index can count.
    pub fn new(nodes: usize, prescribed: impl Fn(usize, usize) -> bool) -> Result<Self, SparsityError> {
        if nodes > i32::MAX as usize / 3 {
            return Err(SparsityError::TooLarge(3 * nodes));
        }
        let mut free = 0;
        let mut number = |k: usize| {
            if prescribed(k / 3, k % 3) {
                return -1;
            }
            free += 1;
            free - 1
        };
        let numbers = (0..3 * nodes).map(&mut number).collect();
        Ok(Self { numbers, free: free as usize })
    }

    /// The number of component `c` of node `a` at `3 * a + c`; -1 where it is prescribed.
    #[must_use]
    pub fn numbers(&self) -> &[i32] {
        &self.numbers
    }

    /// How many are free.
    #[must_use]
    pub fn free(&self) -> usize {
        self.free
    }

    /// The pattern of the stiffness of `mesh`.
    ///
    /// # Errors
    /// [`SparsityError::TooLarge`].
    pub fn pattern(&self, mesh: &Mesh) -> Result<Sparsity, SparsityError> {
        let of_element = |nodes: &[u32; 4]| -> [i32; UNKNOWNS] {
            std::array::from_fn(|k| self.numbers[3 * nodes[k / 3] as usize + k % 3])
        };
        Sparsity::from_elements(self.free, mesh.elements().iter().map(of_element))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn free_components_are_numbered_in_order() {
        let unknowns = Unknowns::new(2, |node, component| node == 0 && component != 1).unwrap();
        assert_eq!(unknowns.numbers(), [-1, 0, -1, 1, 2, 3]);
        assert_eq!(unknowns.free(), 4);
        assert!(matches!(Unknowns::new(800_000_000, |_, _| true), Err(SparsityError::TooLarge(2_400_000_000))));
    }
}
