//! The numbers of a hierarchy, for a backend that runs the cycle itself.

use super::blocks::BlockMatrix;
use super::level::Level;
use super::smoother::inverses;
use super::{AnyHierarchy, Multigrid};
use crate::backends::sparse::{Failure, Matrix};
use crate::las::SolveError;

/// The levels of a hierarchy in single precision. All matrices but the coarsest are divided by `unit`.
pub(in crate::backends) struct Parts<'a> {
    pub levels: Vec<LevelParts<'a>>,
    pub unit: f64,
    /// Number of unknowns of the coarsest level.
    pub coarsest: usize,
    /// The inverse of the coarsest matrix, times `unit`, by rows.
    pub inverse: Vec<f32>,
}

/// A level but the coarsest.
pub(in crate::backends) struct LevelParts<'a> {
    pub a: &'a BlockMatrix<f32>,
    pub prolongation: &'a BlockMatrix<f32>,
    pub restriction: &'a BlockMatrix<f32>,
    /// The inverses of the diagonal blocks `D`, by columns.
    pub inverse: Vec<f32>,
    /// An estimate of the largest eigenvalue of `D^-1 A`.
    pub largest_eigenvalue: f64,
}

impl Multigrid {
    /// Returns the matrix of the last setup or update by blocks.
    pub(in crate::backends) fn matrix_by_blocks(&self) -> &BlockMatrix<f64> {
        &self.a
    }

    /// Returns the place of each unknown in a padded vector.
    pub(in crate::backends) fn places(&self) -> Vec<u32> {
        let of_node = |node: usize| (0..self.nodes.unknowns(node).len()).map(move |i| node * self.nodes.size + i);
        (0..self.nodes.len()).flat_map(of_node).map(|place| place as u32).collect()
    }

    /// Returns true if a padded vector is the vector itself.
    pub(in crate::backends) fn is_unpadded(&self) -> bool {
        self.nodes.are_full()
    }

    /// Returns a copy of the matrix of the last setup or update.
    pub(in crate::backends) fn matrix(&self) -> Matrix<f64> {
        let mut matrix = Matrix::zeros(&self.pattern);
        self.nodes.values_into(&self.pattern, &self.a, matrix.values_mut());
        matrix
    }

    /// Returns the numbers of the hierarchy.
    ///
    /// # Errors
    /// Returns [`SolveError::NotFactored`] without one, and [`SolveError::Unsupported`] if its coarsest level is large.
    pub(in crate::backends) fn parts(&mut self) -> Result<Parts<'_>, Failure> {
        let inverted = match &mut self.hierarchy {
            Some(AnyHierarchy::Single(hierarchy)) => hierarchy.coarsest_inverse(),
            _ => Err(SolveError::NotFactored),
        };
        if inverted.is_err() {
            // A direct method may replace this one.
            self.hierarchy = None;
        }
        let (coarsest, inverse) = inverted?;
        let Some(AnyHierarchy::Single(hierarchy)) = &self.hierarchy else { return Err(SolveError::NotFactored) };
        let unit = hierarchy.unit();
        let mut levels: Vec<LevelParts<'_>> = Vec::new();
        let mut a = &self.a;
        for level in hierarchy.levels() {
            let inverse = inverses(a, level.diagonal(), |_, _| 0.0).map_err(|_| SolveError::NotFactored)?;
            levels.push(LevelParts {
                a: &level.a,
                prolongation: &level.p,
                restriction: &level.r,
                inverse: inverse.iter().map(|&value| (value * unit) as f32).collect(),
                largest_eigenvalue: level.largest_eigenvalue(),
            });
            a = Level::coarse(level);
        }
        let inverse = inverse.iter().map(|&value| (value * unit) as f32).collect();
        Ok(Parts { levels, unit, coarsest, inverse })
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use super::*;
    use crate::backends::sparse::Sparse;
    use crate::backends::sparse::multigrid::MultigridParams;
    use crate::backends::sparse::multigrid::hierarchy::MOST_INVERTED;
    use crate::las::{Backend, MatrixOps, Sparsity, Symmetry};

    /// Nodes without couplings form no aggregates, so that the finest level is the coarsest one.
    #[test]
    fn a_large_coarsest_level_is_not_inverted() {
        let inverse = |unknowns: usize| {
            let nodes: Vec<[i32; 1]> = (0..unknowns as i32).map(|node| [node]).collect();
            let pattern = Arc::new(Sparsity::from_elements(unknowns, nodes.iter().copied()).unwrap());
            let mut matrix = Sparse::<f64>::matrix(&(), &pattern).unwrap();
            nodes.iter().for_each(|node| matrix.add(node, node, &[2.0]).unwrap());
            let mut multigrid = Multigrid::new(&pattern, Symmetry::Definite, MultigridParams::default()).unwrap();
            multigrid.set_up(&matrix).unwrap();
            multigrid.parts().map(|parts| (parts.coarsest, parts.inverse[0]))
        };
        assert_eq!(inverse(1000).unwrap(), (1000, 1.0));
        assert!(matches!(inverse(MOST_INVERTED + 1), Err(SolveError::Unsupported { .. })));
    }
}
