//! Where the forces of a state that is not in equilibrium are largest.

use std::fmt;

use super::Equilibrium;
use crate::fem::point_field::PointField;
use crate::las::RealBackend;

/// The node with the largest force that nothing balances.
#[derive(Clone, Debug, Default, PartialEq)]
#[cfg_attr(feature = "app", derive(serde::Serialize, serde::Deserialize))]
pub struct LargestResidual {
    /// The node, in the numbers of the whole mesh.
    pub node: usize,
    /// Its position in the undeformed body, m.
    pub position: [f64; 3],
    /// The force on it, of the free components, N.
    pub force: f64,
    /// The elements at the node, at most [`LargestResidual::ELEMENTS`] of them, in the numbers of the whole mesh.
    pub elements: Vec<usize>,
}

impl LargestResidual {
    /// The greatest number of elements that are named.
    pub const ELEMENTS: usize = 4;
}

impl fmt::Display for LargestResidual {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { node, position: [x, y, z], force, elements } = self;
        write!(f, "the largest residual force, {force:.1e} N, is at node {node} ({x:.4}, {y:.4}, {z:.4}) m")?;
        let elements: Vec<String> = elements.iter().map(usize::to_string).collect();
        match &elements[..] {
            [] => Ok(()),
            [one] => write!(f, " of element {one}"),
            several => write!(f, " of the elements {}", several.join(", ")),
        }
    }
}

impl<B: RealBackend, P: PointField> Equilibrium<B, P> {
    /// Finds the node with the largest residual force in the last state that was evaluated; `None` if all forces are zero.
    /// Rigid surfaces do not count. Collective if the body is divided; all ranks get the same.
    ///
    /// # Errors
    /// Returns the error of the backend if the ranks cannot communicate.
    pub(in crate::fem) fn largest_residual(&mut self) -> Result<Option<LargestResidual>, B::Error> {
        self.set_net_forces();
        let own = self.assembler.largest_free(&mut self.nodal);
        let in_whole = |node: usize| self.mesh.part().map_or(node, |part| part.nodes[node] as usize);
        let mut force = [own.map_or(0.0, |(_, force)| force)];
        self.ranks.max(&mut force)?;
        let [force] = force;
        // Of ranks with equal forces, the one with the last node. Numbers below 2^53 are exact as floating-point numbers.
        let own = own.filter(|&(_, of_rank)| of_rank == force && force > 0.0);
        let mut node = [own.map_or(-1.0, |(node, _)| in_whole(node) as f64)];
        self.ranks.max(&mut node)?;
        let own = own.filter(|&(local, _)| in_whole(local) as f64 == node[0]);
        let mut place = [f64::NEG_INFINITY; 3 + LargestResidual::ELEMENTS];
        if let Some((local, _)) = own {
            place[..3].copy_from_slice(&self.mesh.nodes()[local]);
            let mut elements: Vec<usize> = (0..self.mesh.elements().len())
                .filter(|&element| self.mesh.elements()[element].contains(&(local as u32)))
                .map(|element| self.mesh.part().map_or(element, |part| part.elements[element] as usize))
                .collect();
            elements.sort_unstable();
            place[3..].iter_mut().zip(elements).for_each(|(place, element)| *place = element as f64);
        }
        self.ranks.max(&mut place)?;
        Ok((node[0] >= 0.0).then(|| LargestResidual {
            node: node[0] as usize,
            position: [place[0], place[1], place[2]],
            force,
            elements: place[3..].iter().filter(|&&element| element >= 0.0).map(|&element| element as usize).collect(),
        }))
    }
}
