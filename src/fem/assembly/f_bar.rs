//! The F-bar method: the points of a patch of elements share one dilatation; see [`assembly`](super#f-bar).

use nalgebra::{Matrix3, SMatrix, SVector};

use super::geometry::{Geometry, GeometryError};
use crate::fem::element::reference::{Hex8, QuadraturePoint};
use crate::fem::element::{ElementType, PointGeometry};
use crate::fem::mesh::Mesh;
use crate::fem::point_field::PointResponses;
use crate::parallel;
use crate::tensor::{cofactor, contract, row_major};

/// A patch of elements (see [`Mesh::patches`]) with its geometry.
#[derive(Clone, Debug)]
pub struct Patch {
    /// The nodes of its elements, ascending.
    pub nodes: Vec<u32>,
    /// Its elements.
    pub elements: Vec<u32>,
    points: Vec<PatchPoint>,
    /// The point at the center of a hexahedron, which defines the dilatation; that of tetrahedra is the mean over their
    /// points.
    center: Option<PatchPoint>,
}

/// A point of a patch.
#[derive(Clone, Debug)]
struct PatchPoint {
    /// Its number in the mesh.
    number: usize,
    volume: f64,
    /// The nodes of its element, as positions in [`Patch::nodes`], with the gradients of their shape functions, 1/m.
    gradients: Vec<(usize, [f64; 3])>,
}

/// The part of the tangent of a patch that couples all its nodes: a change `sum_b dilatation[b] . du_b` of `ln J0`
/// changes the force on node `a` by `forces[a]` times that change.
#[derive(Clone, Debug)]
pub struct PatchCoupling {
    /// `df_a / d ln J0`, N.
    pub forces: Vec<[f64; 3]>,
    /// `d ln J0 / du_b`, 1/m.
    pub dilatation: Vec<[f64; 3]>,
}

/// The tangents of all points with the dilatation of their patch held, and the coupling of each patch.
pub struct PatchTangents {
    /// `dP_eff/dF` at fixed `J0`, Pa; unsymmetric at the points of patches.
    pub tangent: Vec<SMatrix<f64, 9, 9>>,
    /// One entry per patch.
    pub couplings: Vec<PatchCoupling>,
}

/// Returns the patches of a mesh with their geometry.
///
/// # Errors
/// Returns the error of a hexahedron that is inverted at its center.
pub(super) fn patches(mesh: &Mesh, geometry: &Geometry) -> Result<Vec<Patch>, GeometryError> {
    mesh.patches().iter().map(|elements| Patch::new(mesh, geometry, elements)).collect()
}

impl Patch {
    fn new(mesh: &Mesh, geometry: &Geometry, elements: &[u32]) -> Result<Self, GeometryError> {
        let mut nodes: Vec<u32> = elements.iter().flat_map(|&e| &mesh.elements()[e as usize]).copied().collect();
        nodes.sort_unstable();
        nodes.dedup();
        let local = |element: u32| -> Vec<usize> {
            let nodes_of = mesh.elements()[element as usize].iter();
            nodes_of.map(|node| nodes.partition_point(|other| other < node)).collect()
        };
        let mut points = Vec::new();
        for &element in elements {
            let local = local(element);
            for number in mesh.points().of_element(element as usize) {
                let (volume, gradients) = geometry.point(number);
                points.push(PatchPoint { number, volume, gradients: local.iter().copied().zip(gradients).collect() });
            }
        }
        let center = match elements {
            &[element] if mesh.elements().cell_type(element as usize) == ElementType::Hex8 => {
                let point = hexahedron_center(mesh, element as usize)?;
                let gradients = local(element).into_iter().zip(point.gradients).collect();
                Some(PatchPoint { number: points[0].number, volume: point.volume, gradients })
            }
            _ => None,
        };
        Ok(Self { nodes, elements: elements.to_vec(), points, center })
    }

    /// The points whose mean dilatation is that of the patch.
    fn samples(&self) -> &[PatchPoint] {
        self.center.as_ref().map_or(&self.points, std::slice::from_ref)
    }

    fn displacements(&self, of_mesh: &[[f64; 3]]) -> Vec<[f64; 3]> {
        self.nodes.iter().map(|&node| of_mesh[node as usize]).collect()
    }

    /// Returns `J0 = sum V_s J_s / sum V_s` at the displacements of its nodes.
    fn dilatation(&self, displacements: &[[f64; 3]]) -> f64 {
        let (mut current, mut reference) = (0.0, 0.0);
        for sample in self.samples() {
            current += sample.volume * sample.deformation_gradient(displacements).determinant();
            reference += sample.volume;
        }
        current / reference
    }

    /// Returns `d ln J0 / du_b` of each node, 1/m.
    fn dilatation_gradient(&self, displacements: &[[f64; 3]]) -> Vec<[f64; 3]> {
        let mut sums = vec![[0.0; 3]; self.nodes.len()];
        let mut current = 0.0;
        for sample in self.samples() {
            let f = sample.deformation_gradient(displacements);
            current += sample.volume * f.determinant();
            sample.add_forces(&cofactor(&f), &mut sums);
        }
        sums.iter_mut().flatten().for_each(|sum| *sum /= current);
        sums
    }

    /// Returns the factor `(J0 / J)^(1/3)` of `F` of each point; 1 at a point with `J <= 0`, which materials reject.
    fn gradient_factors(&self, displacements: &[[f64; 3]], gradients: &[Matrix3<f64>]) -> Vec<f64> {
        let j0 = self.dilatation(&self.displacements(displacements));
        let factor = |point: &PatchPoint| {
            let j = gradients[point.number].determinant();
            if j > 0.0 { (j0 / j).cbrt() } else { 1.0 }
        };
        self.points.iter().map(factor).collect()
    }

    /// Returns the divisor `(J0 / J)^(2/3)` of `P` of each point.
    fn stress_divisors(&self, displacements: &[[f64; 3]]) -> Vec<f64> {
        let displacements = self.displacements(displacements);
        let j0 = self.dilatation(&displacements);
        let divisor = |point: &PatchPoint| {
            let a = (j0 / point.deformation_gradient(&displacements).determinant()).cbrt();
            a * a
        };
        self.points.iter().map(divisor).collect()
    }

    /// Returns the tangents of the effective stress at fixed `J0`, of each point, and the coupling.
    fn couple(
        &self,
        displacements: &[[f64; 3]],
        responses: &PointResponses,
    ) -> (Vec<SMatrix<f64, 9, 9>>, PatchCoupling) {
        let displacements = self.displacements(displacements);
        let j0 = self.dilatation(&displacements);
        let mut forces = vec![[0.0; 3]; self.nodes.len()];
        let tangent = |point: &PatchPoint| {
            let f = point.deformation_gradient(&displacements);
            let j = f.determinant();
            let a = (j0 / j).cbrt();
            let mut tangent = responses.tangent[point.number];
            let slope = (contract(&tangent, &f) / a - responses.pk1[point.number] * (2.0 / (a * a))) / 3.0;
            tangent /= a;
            tangent -= SVector::from(row_major(&slope)) * SVector::from(row_major(&(cofactor(&f) / j))).transpose();
            point.add_forces(&slope, &mut forces);
            tangent
        };
        let tangents = self.points.iter().map(tangent).collect();
        (tangents, PatchCoupling { forces, dilatation: self.dilatation_gradient(&displacements) })
    }
}

impl PatchPoint {
    fn deformation_gradient(&self, displacements: &[[f64; 3]]) -> Matrix3<f64> {
        // Relative to one node, so that a rigid translation cancels exactly.
        let origin = displacements[0];
        let mut f = Matrix3::identity();
        for &(node, gradient) in &self.gradients {
            for i in 0..3 {
                let relative = displacements[node][i] - origin[i];
                for (j, slope) in gradient.into_iter().enumerate() {
                    f[(i, j)] += relative * slope;
                }
            }
        }
        f
    }

    /// Adds `V P grad N_a` to the forces on the nodes of the patch.
    fn add_forces(&self, pk1: &Matrix3<f64>, forces: &mut [[f64; 3]]) {
        for &(node, g) in &self.gradients {
            for (i, force) in forces[node].iter_mut().enumerate() {
                *force += self.volume * (pk1[(i, 0)] * g[0] + pk1[(i, 1)] * g[1] + pk1[(i, 2)] * g[2]);
            }
        }
    }
}

/// The number of patches that one thread evaluates at a time.
const PATCHES_PER_CHUNK: usize = 64;

/// The number of chunks of patches whose results are held at a time.
const CHUNKS_PER_ROUND: usize = 64;

/// Changes `target` by all patches: calls `evaluate` with them on all threads, and `store` with each patch and its
/// result, in order. A patch must read only what no other patch stores.
fn update<T: Sync + ?Sized, R: Send>(
    patches: &[Patch],
    target: &mut T,
    evaluate: impl Fn(&Patch, &T) -> R + Sync + Send,
    mut store: impl FnMut(&Patch, &mut T, R),
) {
    for patches in patches.chunks(CHUNKS_PER_ROUND * PATCHES_PER_CHUNK) {
        let before = &*target;
        let results = parallel::map(patches.chunks(PATCHES_PER_CHUNK), |patches| {
            patches.iter().map(|patch| evaluate(patch, before)).collect::<Vec<R>>()
        });
        patches.iter().zip(results.into_iter().flatten()).for_each(|(patch, result)| store(patch, target, result));
    }
}

/// Multiplies `F` of each point of a patch by `(J0 / J)^(1/3)`. A point with `J <= 0` keeps its `F`.
pub fn scale_gradients(patches: &[Patch], displacements: &[[f64; 3]], gradients: &mut [Matrix3<f64>]) {
    let evaluate = |patch: &Patch, gradients: &[Matrix3<f64>]| patch.gradient_factors(displacements, gradients);
    update(patches, gradients, evaluate, |patch, gradients, factors| {
        patch.points.iter().zip(factors).for_each(|(point, factor)| gradients[point.number] *= factor);
    });
}

/// Divides `P` of each point of a patch by `(J0 / J)^(2/3)`.
pub fn scale_stresses(patches: &[Patch], displacements: &[[f64; 3]], pk1: &mut [Matrix3<f64>]) {
    let evaluate = |patch: &Patch, _: &[Matrix3<f64>]| patch.stress_divisors(displacements);
    update(patches, pk1, evaluate, |patch, pk1, divisors| {
        patch.points.iter().zip(divisors).for_each(|(point, divisor)| pk1[point.number] /= divisor);
    });
}

/// Computes the tangents of all points, with those of patches replaced.
pub fn tangents(patches: &[Patch], displacements: &[[f64; 3]], responses: &PointResponses) -> PatchTangents {
    let (mut tangent, mut couplings) = (responses.tangent.clone(), Vec::with_capacity(patches.len()));
    let evaluate = |patch: &Patch, _: &[SMatrix<f64, 9, 9>]| patch.couple(displacements, responses);
    update(patches, &mut *tangent, evaluate, |patch, tangent, (of_points, coupling)| {
        patch.points.iter().zip(of_points).for_each(|(point, of_point)| tangent[point.number] = of_point);
        couplings.push(coupling);
    });
    PatchTangents { tangent, couplings }
}

impl PatchCoupling {
    /// Adds the first-order change of the forces on the nodes of the mesh.
    pub fn add_linearized_forces(&self, nodes: &[u32], increments: &[[f64; 3]], forces: &mut [[f64; 3]]) {
        let products = nodes.iter().zip(&self.dilatation).flat_map(|(&node, slope)| {
            increments[node as usize].iter().zip(slope).map(|(increment, slope)| increment * slope)
        });
        let change: f64 = products.sum();
        for (&node, part) in nodes.iter().zip(&self.forces) {
            forces[node as usize].iter_mut().zip(part).for_each(|(force, part)| *force += change * part);
        }
    }

    /// Returns the derivative of the force on `a` by the displacement of `b`, row-major over all nodes and components.
    pub fn stiffness(&self) -> Vec<f64> {
        let columns = self.dilatation.as_flattened();
        self.forces.as_flattened().iter().flat_map(|force| columns.iter().map(move |slope| force * slope)).collect()
    }
}

fn hexahedron_center(mesh: &Mesh, element: usize) -> Result<PointGeometry<8>, GeometryError> {
    let mut nodes = [[0.0; 3]; 8];
    nodes.iter_mut().zip(mesh.positions(element)).for_each(|(node, position)| *node = position);
    let center = QuadraturePoint { xi: [0.0; 3], weight: 8.0 };
    PointGeometry::new::<Hex8, 8>(&nodes, &center).map_err(|reason| GeometryError { element, reason })
}
