//! Dead loads: forces per reference area or volume that do not depend on the displacements.

use std::collections::BTreeMap;

use super::{
    BoundaryError, ENDS, Indivisible, Load, LoadCondition, LoadCurve, Source, check_finite, check_finite_at,
    find_surface, position_at,
};
use crate::fem::mesh::{Mesh, Part};

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

/// A load distributed over nodes: the force on node `a` is `sum weight_a * value * factor(t, x)`.
#[derive(Clone, Debug, PartialEq)]
struct NodalLoad {
    surface: Option<usize>,
    /// The surface or region in messages.
    name: String,
    /// One place if the factor does not depend on the position, otherwise the integration points.
    places: Vec<Place>,
    value: [f64; 3],
    curve: LoadCurve,
}

/// A position with the nodes that its load acts on.
#[derive(Clone, Debug, Default, PartialEq)]
struct Place {
    /// In the reference state, m.
    position: [f64; 3],
    /// Nodes with their part of the area, m^2, or volume, m^3.
    weights: Vec<(u32, f64)>,
}

/// Collects the parts of area or volume, each node's in one number if the factor is the same at all places.
struct Places<'a> {
    curve: &'a LoadCurve,
    sums: BTreeMap<u32, f64>,
    places: Vec<Place>,
}

impl<'a> Places<'a> {
    fn new(curve: &'a LoadCurve) -> Self {
        Self { curve, sums: BTreeMap::new(), places: Vec::new() }
    }

    /// Adds an integration point with this area or volume, given the values of the shape functions there.
    fn add(&mut self, nodes: &[u32], positions: &[[f64; 3]], values: &[f64], measure: f64) {
        let weights = nodes.iter().zip(values).map(|(&node, value)| (node, value * measure));
        if let LoadCurve::Function(_) = self.curve {
            let position = position_at(positions.iter().copied(), values);
            self.places.push(Place { position, weights: weights.collect() });
        } else {
            weights.for_each(|(node, weight)| *self.sums.entry(node).or_insert(0.0) += weight);
        }
    }

    fn load(mut self, surface: Option<usize>, value: [f64; 3], name: String) -> Result<NodalLoad, BoundaryError> {
        if !self.sums.is_empty() {
            self.places.push(Place { position: [0.0; 3], weights: self.sums.into_iter().collect() });
        }
        let load = NodalLoad { surface, name, places: self.places, value, curve: self.curve.clone() };
        if let LoadCurve::Function(_) = load.curve {
            ENDS.into_iter().try_for_each(|t| load.check_places(t))?;
        }
        Ok(load)
    }
}

impl LoadCondition for Traction {
    /// Each node of a face gets the integral of its shape function over the reference area.
    fn resolve(&self, mesh: &Mesh) -> Result<Box<dyn Load>, BoundaryError> {
        let (number, surface) = find_surface(mesh, &self.surface)?;
        let name = || format!("surface `{}`", self.surface);
        check_finite(name, &self.value)?;
        let mut places = Places::new(&self.curve);
        for (face_type, nodes) in surface.faces.typed() {
            let positions = mesh.positions_of(nodes);
            face_type.integrate(&positions, |values, [x, y, z]| {
                places.add(nodes, &positions, values, (x * x + y * y + z * z).sqrt());
            });
        }
        Ok(Box::new(places.load(Some(number), self.value, name())?))
    }
}

impl LoadCondition for BodyForce {
    /// Each node of an element gets the integral of its shape function.
    fn resolve(&self, mesh: &Mesh) -> Result<Box<dyn Load>, BoundaryError> {
        let name = || format!("the body force on region `{}`", self.region);
        check_finite(name, &self.value)?;
        let region = match self.region.as_str() {
            "*" => None,
            name => Some(mesh.region(name).ok_or_else(|| BoundaryError::UnknownRegion {
                name: name.to_owned(),
                known: mesh.regions().to_vec(),
            })?),
        };
        let mut places = Places::new(&self.curve);
        for ((element_type, nodes), &of) in mesh.elements().typed().zip(mesh.region_of()) {
            if region.is_none_or(|region| region == of) {
                let positions = mesh.positions_of(nodes);
                element_type.integrate(&positions, |values, volume| places.add(nodes, &positions, values, volume));
            }
        }
        Ok(Box::new(places.load(None, self.value, name())?))
    }
}

impl NodalLoad {
    /// Checks the force densities at all integration points.
    fn check_places(&self, t: f64) -> Result<(), BoundaryError> {
        let check =
            |place: &Place| check_finite_at(|| self.name.clone(), (&self.value, &self.curve), t, place.position);
        self.places.iter().try_for_each(check)
    }

    fn force_density(&self, t: f64, place: &Place) -> [f64; 3] {
        let factor = self.curve.factor(t, place.position);
        self.value.map(|value| value * factor)
    }
}

impl Load for NodalLoad {
    fn add_forces(&self, t: f64, _: &[[f64; 3]], forces: &mut [[f64; 3]]) {
        for place in &self.places {
            let density = self.force_density(t, place);
            for &(node, weight) in &place.weights {
                for (sum, density) in forces[node as usize].iter_mut().zip(density) {
                    *sum += weight * density;
                }
            }
        }
    }

    fn resultant(&self, t: f64, _: &[[f64; 3]]) -> [f64; 3] {
        self.places.iter().fold([0.0; 3], |sum, place| {
            let total: f64 = place.weights.iter().map(|(_, weight)| weight).sum();
            let density = self.force_density(t, place);
            std::array::from_fn(|i| sum[i] + total * density[i])
        })
    }

    fn break_points(&self) -> Vec<f64> {
        self.curve.break_points()
    }

    fn check_finite(&self, t: f64) -> Result<(), BoundaryError> {
        if self.curve.is_separable() { Ok(()) } else { self.check_places(t) }
    }

    fn source(&self) -> Option<Source> {
        self.surface.map(Source::Surface)
    }

    fn on_part(&self, part: &Part) -> Result<Option<Box<dyn Load>>, Indivisible> {
        let on_part = |place: &Place| {
            let weights = place.weights.iter().filter_map(|&(node, weight)| Some((part.own_node(node)?, weight)));
            Place { position: place.position, weights: weights.collect() }
        };
        let places: Vec<Place> = self.places.iter().map(on_part).filter(|place| !place.weights.is_empty()).collect();
        Ok((!places.is_empty()).then(|| -> Box<dyn Load> { Box::new(Self { places, ..self.clone() }) }))
    }
}
