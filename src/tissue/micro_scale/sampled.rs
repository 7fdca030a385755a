//! A body in which only a few RVEs of each network are solved, to measure what RVEs cost without solving all of them.

use nalgebra::Matrix3;

use super::TissueField;
use super::costs::RveCost;
use super::error::{PointFailure, TissueFieldError};
use super::library::{Library, LibraryError};
use super::sites::Sites;
use super::units::Units;
use crate::fem::material::{Material, SaintVenantKirchhoff};
use crate::fem::point_field::{POINTS_PER_CHUNK, PointField, PointResponses};
use crate::las::{Backend, RealBackend};
use crate::parallel;

/// The material of a body whose RVEs respond as their networks do at rest, by a linear law. A few RVEs of each network
/// are solved too, at the same deformation gradients; their responses are not used.
pub struct SampledField<B: Backend> {
    sites: Sites,
    /// The RVEs that are solved.
    units: Units<B>,
    /// The law of each model of the library.
    laws: Vec<SaintVenantKirchhoff>,
    /// Number of evaluations in which an RVE found no equilibrium.
    failures: usize,
}

impl<B: RealBackend> TissueField<B> {
    /// Creates at most `per_model` RVEs of each network, spread over its points, and no others; at most as many as are
    /// solved at once if these are more, because a group that is not full makes each RVE seem to cost more. RVEs that a
    /// load would create later count as well: what they cost is to be known before.
    ///
    /// # Errors
    /// Returns [`LibraryError::AtRest`] if a network has no response at rest.
    pub fn sampled(mut self, per_model: usize) -> Result<SampledField<B>, LibraryError> {
        let models = self.units.library().models().len();
        let laws = (0..models).map(|model| self.units.library().at_rest(model)).collect::<Result<_, _>>()?;
        // The last class is that of RVEs without a network.
        let mut of_model: Vec<Vec<usize>> = vec![Vec::new(); models + 1];
        self.sites.create_waiting();
        for ((point, _), model) in self.sites.existing().zip(self.sites.by_model()) {
            of_model[model.unwrap_or(models)].push(point);
        }
        let mut sampled = Vec::with_capacity(per_model * of_model.len());
        for (model, points) in of_model.iter().enumerate() {
            let group = if model < models { self.units.library().group(model) } else { 1 };
            let samples = per_model.max(group).min(points.len());
            sampled.extend((0..samples).map(|k| points[(2 * k + 1) * points.len() / (2 * samples)]));
        }
        sampled.sort_unstable();
        self.units.clear();
        sampled.into_iter().for_each(|point| self.create(point));
        self.units.keep_costs();
        Ok(SampledField { sites: self.sites, units: self.units, laws, failures: 0 })
    }
}

impl<B: RealBackend> SampledField<B> {
    /// Returns the data that all RVEs share.
    pub fn library(&self) -> &Library<B> {
        self.units.library()
    }

    /// Returns what the RVEs cost in each evaluation since the last call.
    pub fn take_costs(&self) -> Vec<Vec<RveCost>> {
        self.units.take_costs()
    }

    /// Number of evaluations in which an RVE found no equilibrium.
    pub fn failures(&self) -> usize {
        self.failures
    }

    /// Evaluates the laws at all points with an awake RVE.
    fn evaluate_laws(&self, gradients: &[Matrix3<f64>], out: &mut PointResponses) -> Result<(), PointFailure> {
        let Self { sites, laws, .. } = self;
        let chunks = gradients.chunks(POINTS_PER_CHUNK).zip(out.chunks_mut(POINTS_PER_CHUNK)).enumerate();
        parallel::try_each(chunks, |(number, (gradients, mut out))| {
            for (k, f) in gradients.iter().enumerate() {
                let point = number * POINTS_PER_CHUNK + k;
                let Some((network, matrix)) = sites.material(point).filter(|_| sites.is_awake(point)) else { continue };
                let of_network = network.map(|of| Ok(laws[of.model].evaluate(f)?.scaled(of.factor))).transpose();
                let of_matrix = matrix.map(|formula| formula.respond(f)).transpose();
                let responses = of_network.and_then(|network| of_matrix.map(|matrix| [network, matrix]));
                let responses = responses.map_err(|reason| PointFailure::of_formula(sites.locate(point), &reason))?;
                let sum = responses.into_iter().flatten().reduce(|mut sum, matrix| {
                    sum.energy += matrix.energy;
                    sum.pk1 += matrix.pk1;
                    sum.tangent += matrix.tangent;
                    sum
                });
                sum.iter().for_each(|response| out.set(k, response));
            }
            Ok(())
        })
    }
}

impl<B: RealBackend> PointField for SampledField<B> {
    type Error = TissueFieldError;

    fn update(&mut self, gradients: &[Matrix3<f64>], out: &mut PointResponses) -> Result<(), Self::Error> {
        self.sites.evaluate(gradients, out)?;
        self.evaluate_laws(gradients, out)?;
        let sites = &self.sites;
        let solved = self.units.solve(&|_, point| sites.is_awake(point).then(|| gradients[point]));
        self.failures += usize::from(solved.is_err());
        Ok(())
    }

    fn commit(&mut self, ends_step: bool) -> Result<(), Self::Error> {
        self.units.commit(ends_step);
        self.sites.commit(ends_step);
        Ok(())
    }

    fn revert(&mut self) -> Result<(), Self::Error> {
        self.units.revert();
        self.sites.revert();
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;
    use crate::backends::sparse::Sparse;
    use crate::fem::mesh::shapes::cuboid;
    use crate::fiber::batch::BatchSolver;
    use crate::fiber::rve::{RveModel, StressScale};
    use crate::rve_batch::LaneBatch;
    use crate::tissue::materials::{FiberRve, Materials, NetworkAssignment, Region, RegionMaterial, RveLifecycle};
    use crate::tissue::micro_scale::TissueMaterial;

    /// A body of 48 elements with two networks in turn.
    fn body() -> TissueField<Sparse> {
        let network = |name| Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/networks").join(name);
        let rve = FiberRve {
            networks: vec![network("frozen.txt"), network("frozen.txt")],
            assignment: NetworkAssignment::Cycle,
            seed: 0,
            scale: StressScale::Raw.into(),
            law: None,
            matrix: None,
            lifecycle: RveLifecycle::default(),
        };
        let region = Region { name: "*".into(), material: RegionMaterial::FiberRve(rve) };
        let materials = Materials { regions: vec![region], ..Materials::default() };
        TissueField::new((), materials, &cuboid([2, 2, 2], [1.0; 3]).unwrap()).unwrap().0
    }

    #[test]
    fn only_the_sampled_rves_are_created() {
        for per_model in [3, 11] {
            let mut body = body();
            let make = |model: &RveModel<Sparse>| {
                Ok::<_, String>(LaneBatch::new(model, true).map(|lanes| Box::new(lanes) as Box<dyn BatchSolver>))
            };
            body.solve_in_batches(make).unwrap();
            let library = body.library();
            let expected: usize = (0..library.models().len()).map(|model| library.group(model).max(per_model)).sum();
            let mut sampled = body.sampled(per_model).unwrap();
            assert_eq!(sampled.units.len(), expected, "so many of each network, or a full group of lanes");
            assert!(sampled.units.points().is_sorted());
            sampled.update(&[Matrix3::identity() * 1.01; 48], &mut PointResponses::default()).unwrap();
            assert_eq!(sampled.take_costs()[0].len(), expected);
        }
    }

    #[test]
    fn the_first_evaluation_creates_the_rves_of_a_body() {
        let mut body = body();
        let expected = body.rve_bytes();
        assert_eq!(body.units.len(), 0);
        body.update(&[Matrix3::identity(); 48], &mut PointResponses::default()).unwrap();
        assert_eq!((body.units.len(), body.rve_bytes()), (48, expected));
    }
}
