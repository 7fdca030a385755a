//! The fields of the elements in the field files: values of integration points and their averages.

use std::ops::Range;

use nalgebra::{Matrix3, Vector3};

use super::formula_fibers::DeformedFamilies;
use crate::app::results::PointCloud;
use crate::fem::equilibrium::BodyState;
use crate::fem::mesh::{Mesh, PointNumbering};
use crate::fiber::orientation::principal;
use crate::tensor::{row_major, von_mises};
use crate::tissue::micro_scale::{PointSummary, RveStatus};

/// The fields of all integration points or of all elements, collected for the writer. Those that no file has are empty.
#[derive(Default)]
pub(super) struct CellFields {
    pub energy: Vec<f64>,
    pub cauchy: Vec<[f64; 9]>,
    pub gradient: Vec<[f64; 9]>,
    pub von_mises: Vec<f64>,
    pub orientation: Vec<[f64; 9]>,
    pub direction: Vec<[f64; 3]>,
    pub alignment: Vec<f64>,
    pub stretch_min: Vec<f64>,
    pub stretch_max: Vec<f64>,
    pub iterations: Vec<i64>,
    pub status: Vec<i64>,
    pub network: Vec<i64>,
}

impl CellFields {
    /// Collects the fields of all integration points, those of fibers if `has_fibers` is true. `families` returns the fibers
    /// of a formula, for points without a network; `summaries` is empty if no field of networks is needed.
    pub fn new(
        state: &BodyState,
        has_fibers: bool,
        stress: impl Fn(usize, &Matrix3<f64>, &Matrix3<f64>) -> Matrix3<f64>,
        families: impl Fn(usize, &Matrix3<f64>) -> Option<DeformedFamilies>,
        summaries: &[Option<PointSummary>],
        status: impl Fn(usize) -> Option<RveStatus>,
    ) -> Self {
        let mut cells = Self { energy: state.responses.energy.clone(), ..Self::default() };
        for (point, (f, pk1)) in state.gradients.iter().zip(&state.responses.pk1).enumerate() {
            let cauchy = stress(point, f, pk1);
            cells.von_mises.push(von_mises(&cauchy));
            cells.cauchy.push(row_major(&cauchy));
            cells.gradient.push(row_major(f));
            // Points without fibers have 0 in the fiber fields; those without a network have -1 in `iterations` and
            // `network`.
            let s = summaries.get(point).and_then(Option::as_ref);
            if has_fibers {
                cells.push_fibers(match (s, families(point, f)) {
                    (Some(s), _) => (s.orientation.into(), s.direction.into(), s.alignment, s.stretch),
                    (None, Some(s)) => (s.orientation, s.direction, s.alignment, s.stretch),
                    (None, None) => Default::default(),
                });
            }
            cells.iterations.push(s.map_or(-1, |s| s.iterations as i64));
            cells.status.push(status(point).map_or(-1, |status| match status {
                RveStatus::Awake => 0,
                RveStatus::Asleep => 1,
                RveStatus::Waiting => 2,
                RveStatus::Deleted => 3,
            }));
            cells.network.push(s.map_or(-1, |s| s.network as i64));
        }
        cells
    }

    fn push_fibers(&mut self, (orientation, direction, alignment, [min, max]): Fibers) {
        self.orientation.push(row_major(&orientation));
        self.direction.push(direction.into());
        self.alignment.push(alignment);
        self.stretch_min.push(min);
        self.stretch_max.push(max);
    }

    /// Returns the values at the integration points as a cloud of points at their reference positions.
    pub fn cloud(
        &self,
        mesh: &Mesh,
        state: &BodyState,
        volumes: &[f64],
        region_of: &[u32],
        rank_of: impl Fn(usize) -> usize,
    ) -> PointCloud {
        let numbering = mesh.points();
        let places: Vec<_> = (0..numbering.len()).map(|point| numbering.locate(point)).collect();
        let jacobian = state.gradients.iter().map(|f| f.determinant()).collect();
        PointCloud {
            positions: mesh.at_points(mesh.nodes()),
            scalars: vec![
                ("volume", volumes.to_vec()),
                ("jacobian", jacobian),
                ("von_mises_stress", self.von_mises.clone()),
                ("energy_density", self.energy.clone()),
                ("fiber_alignment", self.alignment.clone()),
                ("stretch_min", self.stretch_min.clone()),
                ("stretch_max", self.stretch_max.clone()),
            ],
            integers: vec![
                ("element", places.iter().map(|place| place.element.into()).collect()),
                ("point", places.iter().map(|place| place.point.into()).collect()),
                ("rve_iterations", self.iterations.clone()),
                ("rve_status", self.status.clone()),
                ("network", self.network.clone()),
                ("region", region_of.iter().map(|&region| region.into()).collect()),
                ("rank", (0..numbering.len()).map(|point| rank_of(point) as i64).collect()),
            ],
            vectors: vec![
                ("displacement", mesh.at_points(&state.displacements)),
                ("fiber_direction", self.direction.clone()),
            ],
            tensors: vec![
                ("cauchy_stress", self.cauchy.clone()),
                ("deformation_gradient", self.gradient.clone()),
                ("fiber_orientation", self.orientation.clone()),
            ],
        }
    }

    /// Returns the fields of the elements, given those of the points and the volumes of the points. Numbers and tensors
    /// are averaged by volume, except for the most iterations and the highest status. The fields of fibers and the network
    /// are those of the points that have some: others wait for their RVE, or theirs is deleted.
    pub fn averaged(self, points: &PointNumbering, volumes: &[f64]) -> Self {
        if points.len() == points.elements() {
            return self;
        }
        let mut cells = Self::default();
        let has_fibers = !self.orientation.is_empty();
        for element in 0..points.elements() {
            let of = points.of_element(element);
            let weights = &volumes[of.clone()];
            cells.energy.push(average(weights, self.energy[of.clone()].iter().map(|&value| [value]))[0]);
            cells.von_mises.push(average(weights, self.von_mises[of.clone()].iter().map(|&value| [value]))[0]);
            cells.cauchy.push(average(weights, self.cauchy[of.clone()].iter().copied()));
            cells.gradient.push(average(weights, self.gradient[of.clone()].iter().copied()));
            if has_fibers {
                cells.push_fibers(self.fibers_of(of.clone(), volumes).unwrap_or_default());
            }
            let highest = |values: &[i64]| values[of.clone()].iter().copied().max().unwrap_or(-1);
            cells.iterations.push(highest(&self.iterations));
            cells.status.push(highest(&self.status));
            cells.network.push(self.network[of.clone()].iter().copied().find(|&network| network >= 0).unwrap_or(-1));
        }
        cells
    }

    /// Returns the fibers of those of the `points` that have any: the orientation tensor averaged by volume, its direction
    /// and alignment, and the smallest and the largest stretch.
    fn fibers_of(&self, points: Range<usize>, volumes: &[f64]) -> Option<Fibers> {
        // The trace of an orientation tensor is 1 with fibers, and 0 without.
        let trace = |point: usize| [0, 4, 8].into_iter().map(|entry| self.orientation[point][entry]).sum::<f64>();
        let of: Vec<usize> = points.filter(|&point| trace(point) > 0.0).collect();
        let weights: Vec<f64> = of.iter().map(|&point| volumes[point]).collect();
        let orientation = average(&weights, of.iter().map(|&point| self.orientation[point]));
        let orientation = Matrix3::from_row_slice(&orientation);
        let smallest = of.iter().map(|&point| self.stretch_min[point]).reduce(f64::min)?;
        let largest = of.iter().map(|&point| self.stretch_max[point]).reduce(f64::max)?;
        let (direction, eigenvalue) = principal(&orientation);
        Some((orientation, direction, eigenvalue - 1.0 / 3.0, [smallest, largest]))
    }
}

/// The orientation tensor of fibers, their mean direction, their alignment, and their smallest and largest stretch.
type Fibers = (Matrix3<f64>, Vector3<f64>, f64, [f64; 2]);

/// Returns the weighted average of the values of an element's points.
fn average<const N: usize>(weights: &[f64], values: impl Iterator<Item = [f64; N]>) -> [f64; N] {
    let (mut sum, total) = ([0.0; N], weights.iter().sum::<f64>());
    for (value, weight) in values.zip(weights) {
        sum.iter_mut().zip(value).for_each(|(sum, value)| *sum += value * weight);
    }
    sum.map(|sum| sum / total)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fem::mesh::QuadraticHexahedron;
    use crate::fem::mesh::shapes::cuboid;

    /// Points without fibers have 0 in all fields of fibers.
    #[test]
    fn fibers_of_an_element_are_those_of_its_points_that_have_some() {
        let mesh = cuboid([1, 1, 1], [1.0; 3]).unwrap().quadratic(QuadraticHexahedron::Serendipity).unwrap();
        let (points, count) = (mesh.points(), mesh.points().len());
        let volumes: Vec<f64> = (0..count).map(|point| 1.0 + point as f64).collect();
        let mut of_points = CellFields {
            energy: vec![2.0; count],
            von_mises: vec![3.0; count],
            cauchy: vec![[4.0; 9]; count],
            gradient: vec![row_major(&Matrix3::identity()); count],
            iterations: vec![-1; count],
            status: vec![3; count],
            network: vec![-1; count],
            ..CellFields::default()
        };
        // Two points of the first element have fibers along x and along y; no point of the second has any.
        let [first, second] = [0, 1].map(|element| points.of_element(element));
        let fibers = [(first.start + 1, 0, [0.8, 1.1]), (first.start + 2, 1, [0.9, 1.2])];
        for point in 0..count {
            let found = fibers.iter().find(|(of, ..)| *of == point);
            of_points.push_fibers(found.map_or_else(Default::default, |&(_, axis, stretch)| {
                let direction = Vector3::ith(axis, 1.0);
                (direction * direction.transpose(), direction, 2.0 / 3.0, stretch)
            }));
        }
        of_points.network[first.start + 1] = 7;
        let cells = of_points.averaged(points, &volumes);
        let share = volumes[first.start + 2] / (volumes[first.start + 1] + volumes[first.start + 2]);
        let expected = Matrix3::from_diagonal(&[1.0 - share, share, 0.0].into());
        assert!((Matrix3::from_row_slice(&cells.orientation[0]) - expected).amax() < 1e-15);
        assert!((cells.alignment[0] - (share - 1.0 / 3.0)).abs() < 1e-15);
        assert!((cells.direction[0][1].abs() - 1.0).abs() < 1e-15);
        assert_eq!((cells.stretch_min[0], cells.stretch_max[0], cells.network[0]), (0.8, 1.2, 7));
        assert!(!second.is_empty());
        assert_eq!((cells.alignment[1], cells.stretch_min[1], cells.network[1]), (0.0, 0.0, -1));
        assert!((cells.energy[0] - 2.0).abs() < 1e-15);
    }
}
