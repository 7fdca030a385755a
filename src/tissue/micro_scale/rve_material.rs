//! The material of an RVE on the way to another rank.
//!
//! Ranks that solve RVEs have the networks of all regions, but not what varies over the body: networks by field, fiber
//! volume fractions and the formulas of matrices come with each RVE.

use std::sync::Arc;

use serde::{Deserialize, Serialize};

use super::library::{Library, PointNetwork};
use super::sites::Sites;
use crate::las::RealBackend;
use crate::tissue::materials::{Formula, Region, RegionMaterial};

/// The material of an RVE.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(in crate::tissue) struct RveMaterial {
    /// The region of the point.
    pub region: usize,
    pub network: Option<PointNetwork>,
    pub matrix: SentMatrix,
}

/// The matrix of an RVE, for a rank that has the materials of the regions.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(in crate::tissue) enum SentMatrix {
    /// There is none.
    None,
    /// That of the region there: it is the same at all points, or of another crate, which every rank has itself.
    OfRegion,
    Formula(Arc<Formula>),
}

impl<B: RealBackend> Library<B> {
    /// Returns true if RVEs bring their matrices along.
    pub(in crate::tissue) fn sends_matrices(&self) -> bool {
        let is_rve = |region: &Region| matches!(region.material, RegionMaterial::FiberRve(_));
        self.regions().enumerate().any(|(number, region)| is_rve(region) && self.has_formulas_by_point(number))
    }

    /// Returns the material of the RVE of a point for another rank; `None` if the point has no RVE.
    pub(in crate::tissue) fn material_to_send(&self, sites: &Sites, point: usize) -> Option<RveMaterial> {
        let (network, matrix) = sites.material(point)?;
        Some(self.to_send(sites.region(point), network, matrix.as_ref()))
    }

    /// Returns the material of an RVE for another rank.
    pub(super) fn to_send(
        &self,
        region: usize,
        network: Option<PointNetwork>,
        matrix: Option<&Arc<Formula>>,
    ) -> RveMaterial {
        let matrix = match matrix {
            None => SentMatrix::None,
            Some(formula) if matches!(**formula, Formula::Custom(_)) => SentMatrix::OfRegion,
            Some(_) if !self.has_formulas_by_point(region) => SentMatrix::OfRegion,
            Some(formula) => SentMatrix::Formula(Arc::clone(formula)),
        };
        RveMaterial { region, network, matrix }
    }

    /// Returns the network and the matrix of an RVE that another rank sent; `None` if this rank does not have the same
    /// materials.
    pub(in crate::tissue) fn received(
        &self,
        point: usize,
        material: RveMaterial,
    ) -> Option<(Option<PointNetwork>, Option<Arc<Formula>>)> {
        let RveMaterial { region, network, matrix } = material;
        if region >= self.regions().len() || network.is_some_and(|of| of.model >= self.models.len()) {
            return None;
        }
        let matrix = match matrix {
            SentMatrix::None => None,
            SentMatrix::OfRegion => Some(Arc::clone(self.formula_at(region, point)?)),
            SentMatrix::Formula(formula) => Some(formula),
        };
        Some((network, matrix))
    }
}

#[cfg(all(test, feature = "sparse"))]
mod tests {
    use super::*;
    use crate::backends::sparse::Sparse;
    use crate::fem::material::{LinearElastic, Material, MaterialError, NeoHookean, Response};
    use crate::fiber::rve::StressScale;
    use crate::tissue::materials::{
        FiberRve, Formulas, Materials, NetworkAssignment, PointFormulas, RveLifecycle, RveParams,
    };

    /// A material of another crate.
    struct Foreign;

    impl Material for Foreign {
        fn evaluate(&self, f: &nalgebra::Matrix3<f64>) -> Result<Response, MaterialError> {
            LinearElastic { mu: 1.0, lambda: 1.0 }.evaluate(f)
        }
    }

    fn library(matrices: impl IntoIterator<Item = Formulas>) -> Library<Sparse> {
        let region = |(number, matrix): (usize, Formulas)| Region {
            name: format!("region {number}"),
            material: RegionMaterial::FiberRve(FiberRve {
                networks: Vec::new(),
                assignment: NetworkAssignment::Cycle,
                seed: 0,
                scale: StressScale::Raw.into(),
                law: None,
                matrix: Some(matrix),
                lifecycle: RveLifecycle::default(),
            }),
        };
        let regions = matrices.into_iter().enumerate().map(region).collect();
        Library::read((), Materials { regions, rve: RveParams::default() }).unwrap().0
    }

    /// Formulas that vary arrive at ranks that have none; those of other crates have to be there, and what a rank does not
    /// have is refused.
    #[test]
    fn matrices_come_with_their_rves() {
        let stiff = || Formula::NeoHookean(NeoHookean { mu: 3.0, lambda: 4.0 });
        let uniform = || Formulas::from(stiff());
        let varying = || Formulas::Points(Arc::new(PointFormulas::new(vec![stiff()], vec![0, 0]).unwrap()));
        let foreign =
            || Formulas::Points(Arc::new(PointFormulas::new(vec![Formula::custom(Foreign)], vec![0, 0]).unwrap()));
        let sender = library([uniform(), varying(), foreign()]);
        let mut receiver = library([uniform(), varying(), foreign()]);
        assert!(sender.sends_matrices() && !library([uniform()]).sends_matrices());
        let sent = |region: usize| sender.to_send(region, None, sender.formula_at(region, 1));
        let arrives = |at: &Library<Sparse>, region: usize| at.received(1, sent(region)).and_then(|(_, matrix)| matrix);
        assert_eq!(arrives(&receiver, 2).as_ref(), receiver.formula_at(2, 1));
        receiver.keep_points(&[]);
        assert!(receiver.sends_matrices());
        assert_eq!([0, 1].map(|region| arrives(&receiver, region)), [(); 2].map(|()| Some(Arc::new(stiff()))));
        assert_eq!(arrives(&receiver, 2), None);
        let other = library([]);
        assert_eq!([0, 1].map(|region| other.received(1, sent(region))), [None, None]);
        let network = Some(PointNetwork { model: 0, factor: 1.0 });
        assert_eq!(receiver.received(1, sender.to_send(0, network, None)), None, "no model");
    }
}
