//! Nodes with prescribed displacements along directions other than x, y and z.

use nalgebra::{Matrix3, Vector3};

use super::{BoundaryError, PrescribedComponent, Source};
use crate::fem::mesh::Mesh;

/// Directions are linearly dependent if the part of one that is normal to the others is shorter than this. The rounding of
/// coordinates to 6 digits tilts the normals of small planes by almost as much: two surfaces of one plane must not hold
/// a node within the plane.
const DEPENDENT: f64 = 1e-3;
/// A direction depends on another one if its share is greater than this.
const SHARE: f64 = 1e-4;

/// A direction along which the displacement of a node is given.
#[derive(Clone, Debug)]
pub(super) struct GivenDirection {
    pub source: Source,
    /// A unit vector `d`.
    pub along: Vector3<f64>,
    /// The component that gives the displacement along `d`; `None` holds it at 0.
    pub component: Option<PrescribedComponent>,
}

/// A node whose displacement is given along one to three independent directions `d_k`, not all of them axes.
///
/// With the orthonormal vectors `n_k` of the Gram-Schmidt process, `d_k = sum_j L_kj n_j`, the given displacements `g`
/// determine the components along `n_k`, `L y = g`. The remaining directions of the frame are free.
#[derive(Clone, Debug)]
pub(super) struct SkewNode {
    pub node: u32,
    /// Orthonormal columns: the `n_k`, then the free directions.
    pub frame: Matrix3<f64>,
    given: Vec<GivenDirection>,
    lower: Matrix3<f64>,
}

impl SkewNode {
    /// Orthonormalizes the given directions; a direction that depends on the others is left out if all displacements
    /// are held at 0.
    ///
    /// # Errors
    /// Returns [`BoundaryError::PlaneConflict`] if a dependent direction or one of those on which it depends is moved.
    pub fn new(mesh: &Mesh, node: u32, directions: Vec<GivenDirection>) -> Result<Self, BoundaryError> {
        let (mut given, mut frame, mut lower) = (Vec::<GivenDirection>::new(), Matrix3::zeros(), Matrix3::zeros());
        for direction in directions {
            let k = given.len();
            let mut rest = direction.along;
            let mut row = Vector3::zeros();
            for j in 0..k {
                row[j] = frame.column(j).dot(&direction.along);
                rest -= frame.column(j) * row[j];
            }
            let length = rest.norm();
            if k == 3 || length < DEPENDENT {
                let moved = dependence(&lower, row, &given).chain([&direction]).find(|given| !given.is_held());
                match moved {
                    None => continue,
                    Some(moved) => return Err(conflict(mesh, node, &direction, moved, &given)),
                }
            }
            row[k] = length;
            lower.set_row(k, &row.transpose());
            frame.set_column(k, &(rest / length));
            given.push(direction);
        }
        complete(&mut frame, given.len());
        Ok(Self { node, frame, given, lower })
    }

    /// Returns the number of prescribed components, the first ones of the frame.
    pub fn prescribed(&self) -> usize {
        self.given.len()
    }

    /// Returns the directions along which the displacement is given.
    pub fn directions(&self) -> impl Iterator<Item = Vector3<f64>> {
        self.given.iter().map(|given| given.along)
    }

    /// Replaces the prescribed components of a displacement, m, by those of pseudo-time `t`.
    pub fn apply(&self, t: f64, displacement: &mut [f64; 3]) {
        let mut components = self.frame.tr_mul(&Vector3::from(*displacement));
        for (k, given) in self.given.iter().enumerate() {
            let before: f64 = (0..k).map(|j| self.lower[(k, j)] * components[j]).sum();
            let value = given.component.as_ref().map_or(0.0, |component| component.displacement(t));
            components[k] = (value - before) / self.lower[(k, k)];
        }
        *displacement = (self.frame * components).into();
    }

    /// Returns the reaction that each condition exerts, N, of the force that the supports exert on the node: its part
    /// `sum_k mu_k d_k` along the given directions.
    pub fn reactions(&self, force: [f64; 3]) -> impl Iterator<Item = (Source, Vector3<f64>)> {
        let components = self.frame.tr_mul(&Vector3::from(force));
        let mut shares = Vector3::zeros();
        for k in (0..self.given.len()).rev() {
            let after: f64 = (k + 1..self.given.len()).map(|j| self.lower[(j, k)] * shares[j]).sum();
            shares[k] = (components[k] - after) / self.lower[(k, k)];
        }
        self.given.iter().zip(shares.data.0[0]).map(|(given, share)| (given.source, given.along * share))
    }

    /// Returns the components that give the displacements along some of the directions.
    pub fn components(&self) -> impl Iterator<Item = &PrescribedComponent> {
        self.given.iter().filter_map(|given| given.component.as_ref())
    }

    /// Returns the pseudo-times at which the velocity of the node jumps.
    pub fn break_points(&self) -> impl Iterator<Item = f64> {
        self.components().flat_map(PrescribedComponent::break_points)
    }
}

impl GivenDirection {
    pub fn of_component(component: PrescribedComponent) -> Self {
        let along = Vector3::ith(usize::from(component.component), 1.0);
        Self { source: component.source, along, component: Some(component) }
    }

    fn is_held(&self) -> bool {
        self.component.as_ref().is_none_or(PrescribedComponent::is_held)
    }
}

/// Returns the given directions `d_k` on which `d = sum_j row_j n_j` depends: `d = sum_k mu_k d_k` with `L^T mu = row`.
fn dependence<'a>(
    lower: &Matrix3<f64>,
    row: Vector3<f64>,
    given: &'a [GivenDirection],
) -> impl Iterator<Item = &'a GivenDirection> {
    let mut shares = row;
    for k in (0..given.len()).rev() {
        let after: f64 = (k + 1..given.len()).map(|j| lower[(j, k)] * shares[j]).sum();
        shares[k] = (shares[k] - after) / lower[(k, k)];
    }
    given.iter().zip(shares.data.0[0]).filter(|(_, share)| share.abs() > SHARE).map(|(given, _)| given)
}

fn conflict(
    mesh: &Mesh,
    node: u32,
    direction: &GivenDirection,
    moved: &GivenDirection,
    given: &[GivenDirection],
) -> BoundaryError {
    let planes = given.iter().chain([direction]).filter(|given| given.component.is_none());
    let plane = planes.map(|plane| plane.source.describe(mesh)).next().unwrap_or_default();
    let (node, other) = (node as usize, moved.source.describe(mesh));
    let value = moved.component.as_ref().map_or(0.0, |component| component.value);
    let formula = moved.component.as_ref().and_then(PrescribedComponent::formula);
    BoundaryError::PlaneConflict { node, plane, other, value, formula }
}

/// Fills the columns from `first` on so that all are orthonormal.
fn complete(frame: &mut Matrix3<f64>, first: usize) {
    for k in first..3 {
        let projected = |axis: usize| {
            let unit = Vector3::ith(axis, 1.0);
            (0..k).fold(unit, |rest, j| rest - frame.column(j) * frame.column(j).dot(&unit))
        };
        // The longest projection; the first of equal ones.
        let mut best = projected(0);
        for axis in 1..3 {
            let other = projected(axis);
            if other.norm() > best.norm() + DEPENDENT {
                best = other;
            }
        }
        frame.set_column(k, &best.normalize());
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn held(along: [f64; 3]) -> GivenDirection {
        GivenDirection { source: Source::Surface(0), along: Vector3::from(along).normalize(), component: None }
    }

    #[test]
    fn the_displacement_along_given_directions_is_removed() {
        let mesh = crate::fem::mesh::shapes::cuboid([1, 1, 1], [1.0; 3]).unwrap();
        let directions = [held([1.0, 1.0, 0.0]), held([0.0, 1.0, 2.0]), held([1.0, 2.0, 2.0]), held([1.0, 0.0, 0.3])];
        for (count, prescribed) in [(1, 1), (2, 2), (3, 2), (4, 3)] {
            // The third direction is the sum of the first two, before they are normalized.
            let node = SkewNode::new(&mesh, 0, directions[..count].to_vec()).unwrap();
            assert_eq!(node.prescribed(), prescribed);
            assert!((node.frame.tr_mul(&node.frame) - Matrix3::identity()).norm() < 1e-14);
            let mut displacement = [0.3, -0.2, 0.7];
            node.apply(0.5, &mut displacement);
            for direction in &directions[..count] {
                assert!(direction.along.dot(&Vector3::from(displacement)).abs() < 1e-15);
            }
            // The reactions along the given directions sum to the part of the force that the supports take.
            let force = Vector3::new(1.0, 2.0, -3.0);
            let sum: Vector3<f64> = node.reactions(force.into()).map(|(_, reaction)| reaction).sum();
            for k in 0..3 {
                let expected = if k < prescribed { node.frame.column(k).dot(&force) } else { 0.0 };
                assert!((node.frame.column(k).dot(&sum) - expected).abs() < 1e-14);
            }
        }
    }

    #[test]
    fn directions_that_differ_by_rounding_are_one() {
        let mesh = crate::fem::mesh::shapes::cuboid([1, 1, 1], [1.0; 3]).unwrap();
        let axis = |k: u8| GivenDirection::of_component(PrescribedComponent::support(&mesh, 0, k));
        // The second plane is the first one, and the axes x and y span the normal; the node slides along z.
        let planes = [held([0.5, 0.8, 1e-5]), held([0.5, 0.8, -1e-4])];
        for directions in [planes.to_vec(), vec![planes[0].clone(), axis(0), axis(1)]] {
            let prescribed = SkewNode::new(&mesh, 0, directions).unwrap().prescribed();
            assert!(prescribed < 3, "{prescribed}");
        }
        assert_eq!(SkewNode::new(&mesh, 0, planes.to_vec()).unwrap().prescribed(), 1);
        // Planes of a thin sector.
        let sector = [[0.5, 0.8, 0.0], [0.5, 0.8, 0.01]].map(held).to_vec();
        assert_eq!(SkewNode::new(&mesh, 0, sector).unwrap().prescribed(), 2);
    }

    #[test]
    fn a_moved_direction_does_not_conflict_with_a_plane_that_contains_it() {
        let mesh = crate::fem::mesh::shapes::cuboid([1, 1, 1], [1.0; 3]).unwrap();
        for moved in 0..3 {
            // The plane contains the axis `moved`; the node is moved along it and held along the other axes.
            let mut normal = [0.6; 3];
            normal[moved] = 0.0;
            let component = |k: usize| {
                let mut component = PrescribedComponent::support(&mesh, 0, k as u8);
                component.value = if k == moved { 0.1 } else { 0.0 };
                component
            };
            let directions = |count: usize| {
                let components = (0..count).map(|k| GivenDirection::of_component(component(k)));
                std::iter::once(held(normal)).chain(components).collect::<Vec<_>>()
            };
            let node = SkewNode::new(&mesh, 0, directions(3)).unwrap();
            let mut displacement = [0.5; 3];
            node.apply(1.0, &mut displacement);
            for (k, u) in displacement.iter().enumerate() {
                assert!((u - if k == moved { 0.1 } else { 0.0 }).abs() < 1e-15, "{displacement:?}");
            }
            // Out of the plane.
            let mut inclined = directions(3);
            inclined[0] = held([0.6, 0.5, 0.4]);
            let error = SkewNode::new(&mesh, 0, inclined).unwrap_err();
            assert!(matches!(error, BoundaryError::PlaneConflict { value: 0.1, .. }), "{error}");
        }
    }
}
