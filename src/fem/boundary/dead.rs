//! Dead loads: forces per reference area or volume that do not depend on the displacements.

use std::collections::BTreeMap;

use super::{BoundaryError, Load, LoadCondition, LoadCurve, Source, check_finite, find_surface};
use crate::fem::mesh::Mesh;

/// A force per reference area of a surface, whose direction and magnitude do not follow the deformation.
#[derive(Clone, Debug, PartialEq)]
pub struct Traction {
    /// The surface's name.
    pub surface: String,
    /// The traction at a factor of 1, Pa (N per reference m^2).
    pub value: [f64; 3],
    /// The factor over pseudo-time.
    pub curve: LoadCurve,
}

/// A force per reference volume.
#[derive(Clone, Debug, PartialEq)]
pub struct BodyForce {
    /// The region's name; `*` selects the whole body.
    pub region: String,
    /// The force density at a factor of 1, N/m^3.
    pub value: [f64; 3],
    /// The factor over pseudo-time.
    pub curve: LoadCurve,
}

/// A load distributed over nodes: the force on node `a` is `weight_a * value * factor(t)`.
#[derive(Clone, Debug, PartialEq)]
struct NodalLoad {
    surface: Option<usize>,
    /// Nodes with their part of the area, m^2, or volume, m^3; ascending by node.
    weights: Vec<(u32, f64)>,
    value: [f64; 3],
    curve: LoadCurve,
}

impl LoadCondition for Traction {
    /// Each node of a face gets the integral of its shape function over the reference area.
    fn resolve(&self, mesh: &Mesh) -> Result<Box<dyn Load>, BoundaryError> {
        let (number, surface) = find_surface(mesh, &self.surface)?;
        check_finite(|| format!("surface `{}`", self.surface), &self.value)?;
        let mut weights = BTreeMap::new();
        for (face_type, nodes) in surface.faces.typed() {
            face_type.integrate(&mesh.positions_of(nodes), |values, [x, y, z]| {
                add_weights(&mut weights, nodes, values, (x * x + y * y + z * z).sqrt());
            });
        }
        Ok(Box::new(NodalLoad::new(Some(number), weights, self.value, &self.curve)))
    }
}

impl LoadCondition for BodyForce {
    /// Each node of an element gets the integral of its shape function.
    fn resolve(&self, mesh: &Mesh) -> Result<Box<dyn Load>, BoundaryError> {
        check_finite(|| format!("the body force on region `{}`", self.region), &self.value)?;
        let region = match self.region.as_str() {
            "*" => None,
            name => Some(mesh.region(name).ok_or_else(|| BoundaryError::UnknownRegion {
                name: name.to_owned(),
                known: mesh.regions().to_vec(),
            })?),
        };
        let mut weights = BTreeMap::new();
        for ((element_type, nodes), &of) in mesh.elements().typed().zip(mesh.region_of()) {
            if region.is_none_or(|region| region == of) {
                element_type.integrate(&mesh.positions_of(nodes), |values, volume| {
                    add_weights(&mut weights, nodes, values, volume);
                });
            }
        }
        Ok(Box::new(NodalLoad::new(None, weights, self.value, &self.curve)))
    }
}

/// Adds to the weight of each node the value of its shape function times the area or volume of an integration point.
fn add_weights(weights: &mut BTreeMap<u32, f64>, nodes: &[u32], values: &[f64], measure: f64) {
    for (&node, value) in nodes.iter().zip(values) {
        *weights.entry(node).or_insert(0.0) += value * measure;
    }
}

impl NodalLoad {
    fn new(surface: Option<usize>, weights: BTreeMap<u32, f64>, value: [f64; 3], curve: &LoadCurve) -> Self {
        Self { surface, weights: weights.into_iter().collect(), value, curve: curve.clone() }
    }

    fn force_density(&self, t: f64) -> [f64; 3] {
        let factor = self.curve.factor(t);
        self.value.map(|value| value * factor)
    }
}

impl Load for NodalLoad {
    fn add_forces(&self, t: f64, _: &[[f64; 3]], forces: &mut [[f64; 3]]) {
        let density = self.force_density(t);
        for &(node, weight) in &self.weights {
            for (sum, density) in forces[node as usize].iter_mut().zip(density) {
                *sum += weight * density;
            }
        }
    }

    fn resultant(&self, t: f64, _: &[[f64; 3]]) -> [f64; 3] {
        let total: f64 = self.weights.iter().map(|(_, weight)| weight).sum();
        self.force_density(t).map(|density| total * density)
    }

    fn break_points(&self) -> Vec<f64> {
        self.curve.break_points()
    }

    fn source(&self) -> Option<Source> {
        self.surface.map(Source::Surface)
    }
}
