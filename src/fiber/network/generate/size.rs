//! Generation of networks with a given number of nodes or density, by a search for the number of points.

use super::params::{GeneratedNetwork, GeneratorParams};
use super::{GenerateError, Kind};

/// The minimum and the maximum number of nodes that can be requested.
const NODES: [usize; 2] = [40, 100_000];
/// Maximum number of points in the search for a density.
const MAX_POINTS: usize = 100_000;
/// Number of points of the network from which a density is extrapolated.
const SAMPLE: usize = 100;
/// Relative error of the closest density above which the requested one is reported as unreachable.
const UNREACHABLE: f64 = 0.1;

impl GeneratorParams {
    /// Generates the network whose number of nodes, including the boundary, is closest to `nodes` (with fewer points if
    /// two are equally close). The number of points is found by bisection and a search around the result, since the
    /// number of nodes does not grow with every additional point.
    ///
    /// # Errors
    /// Returns [`GenerateError::Nodes`] for fewer than 40 or more than 100 000 nodes; otherwise as for
    /// [`GeneratorParams::of_points`].
    pub fn of_nodes(&self, nodes: usize) -> Result<GeneratedNetwork, GenerateError> {
        let [fewest, most] = NODES;
        if !(fewest..=most).contains(&nodes) {
            return Err(GenerateError::Nodes { nodes, fewest, most });
        }
        let (fewer, _) = self.bisect([1, nodes], |made| made.network.nodes().len() < nodes)?;
        let candidates = fewer.saturating_sub(2).max(1)..=fewer + 3;
        let deviation = |made: &GeneratedNetwork| made.network.nodes().len().abs_diff(nodes) as f64;
        let made = self.closest(candidates.clone(), deviation)?;
        made.ok_or_else(|| self.open_face(candidates).unwrap_or(GenerateError::Nodes { nodes, fewest, most }))
    }

    /// Generates the network whose density, the total length of its fibers in the unit cube, is closest to `density`
    /// (1/edge^2). The number of points is found by bisection. The density grows with this number, but scatters between
    /// consecutive numbers, so that a dozen numbers around the result are tried: the density is accurate to a few parts
    /// in a thousand.
    ///
    /// # Errors
    /// Returns [`GenerateError::Density`] if no number of points from 1 to 100 000 comes within 10 %; otherwise as for
    /// [`GeneratorParams::of_points`].
    pub fn of_density(&self, density: f64) -> Result<GeneratedNetwork, GenerateError> {
        let length = |made: &GeneratedNetwork| made.network.total_length();
        let unreachable = |nearest, points| GenerateError::Density { density, nearest, points };
        // Lengths scale with the spacing and the number of fibers with the points, so that the density scales with
        // `points^(2/3)`.
        let sample = length(&self.of_points(SAMPLE)?);
        let exponent = 2.0 / 3.0;
        let estimate = SAMPLE as f64 * (density / sample).max(0.0).powf(1.0 / exponent);
        if estimate.is_nan() || estimate > MAX_POINTS as f64 {
            let nearest = sample * (MAX_POINTS as f64 / SAMPLE as f64).powf(exponent);
            return Err(unreachable(nearest, MAX_POINTS));
        }
        let most = ((1.5 * estimate) as usize + 8).min(MAX_POINTS);
        let (fewer, _) = self.bisect([1, most], |made| length(made) < density)?;
        let candidates = fewer.saturating_sub(5).max(1)..=fewer + 6;
        let made = self.closest(candidates.clone(), |made| (length(made) - density).abs())?;
        match made {
            Some(made) if (length(&made) - density).abs() <= UNREACHABLE * density => Ok(made),
            Some(made) => Err(self.open_face(candidates).unwrap_or(unreachable(length(&made), made.points))),
            None => Err(self.open_face(candidates).unwrap_or(unreachable(sample, SAMPLE))),
        }
    }

    /// Returns the error of an open face if an aligned network of one of these sizes has one: in such a network, few
    /// fibers cross the faces along the axis, so that no size may be suitable.
    fn open_face(&self, mut candidates: impl Iterator<Item = usize>) -> Option<GenerateError> {
        self.alignment.filter(|alignment| alignment.strength() > 0.0)?;
        candidates.find_map(|points| match self.of_points(points) {
            Err(error @ GenerateError::OpenFace { .. }) => Some(error),
            _ => None,
        })
    }

    /// Returns consecutive numbers of points between which `too_small` changes from true to false. A number of points
    /// that gives no valid network counts as too small.
    fn bisect(
        &self,
        [mut fewer, mut more]: [usize; 2],
        too_small: impl Fn(&GeneratedNetwork) -> bool,
    ) -> Result<(usize, usize), GenerateError> {
        while more - fewer > 1 {
            let middle = fewer + (more - fewer) / 2;
            match self.attempt(middle)? {
                Some(made) if !too_small(&made) => more = middle,
                _ => fewer = middle,
            }
        }
        Ok((fewer, more))
    }

    /// Returns the network with the smallest `deviation`, the first one if there are several; `None` if no candidate
    /// gives a valid network.
    fn closest(
        &self,
        candidates: impl Iterator<Item = usize>,
        deviation: impl Fn(&GeneratedNetwork) -> f64,
    ) -> Result<Option<GeneratedNetwork>, GenerateError> {
        let mut best: Option<GeneratedNetwork> = None;
        for points in candidates {
            if let Some(made) = self.attempt(points)?
                && best.as_ref().is_none_or(|best| deviation(&made) < deviation(best))
            {
                best = Some(made);
            }
        }
        Ok(best)
    }

    /// Generates the network with this number of points; `None` if the network is invalid because they are too few.
    fn attempt(&self, points: usize) -> Result<Option<GeneratedNetwork>, GenerateError> {
        match self.of_points(points) {
            Ok(made) => Ok(Some(made)),
            Err(GenerateError::OpenFace { .. } | GenerateError::Network(_)) => Ok(None),
            Err(error) => Err(error),
        }
    }
}

/// Generates a Delaunay network with `points` interior nodes; see [`GeneratorParams`].
///
/// # Errors
/// As for [`GeneratorParams::of_points`].
///
/// ```
/// let network = biotissue::fiber::network::generate::delaunay(20, 1)?;
/// assert_eq!(network.interior().len(), 20);
/// # Ok::<(), biotissue::fiber::network::generate::GenerateError>(())
/// ```
pub fn delaunay(points: usize, seed: u64) -> Result<crate::fiber::network::Network, GenerateError> {
    Ok(GeneratorParams::new(Kind::Delaunay, seed).of_points(points)?.network)
}

/// Generates a Voronoi network from the cells of `points` points; see [`GeneratorParams`].
///
/// # Errors
/// As for [`GeneratorParams::of_points`].
pub fn voronoi(points: usize, seed: u64) -> Result<crate::fiber::network::Network, GenerateError> {
    Ok(GeneratorParams::new(Kind::Voronoi, seed).of_points(points)?.network)
}

/// Generates the Delaunay network of this seed whose number of nodes is closest to `nodes`; see
/// [`GeneratorParams::of_nodes`].
///
/// # Errors
/// As for [`GeneratorParams::of_nodes`].
pub fn delaunay_of_nodes(nodes: usize, seed: u64) -> Result<crate::fiber::network::Network, GenerateError> {
    Ok(GeneratorParams::new(Kind::Delaunay, seed).of_nodes(nodes)?.network)
}
