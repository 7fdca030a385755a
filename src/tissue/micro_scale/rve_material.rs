//! The material of an RVE on the way to another rank.
//!
//! Ranks that solve RVEs have the networks of all regions, but not what varies over the body: networks by field, fiber
//! volume fractions and the formulas of matrices come with each RVE.

use std::sync::Arc;

use serde::{Deserialize, Serialize};

use super::library::{Library, PointNetwork};
use super::sites::Sites;
use crate::las::RealBackend;
use crate::tissue::materials::Formula;

/// The material of an RVE.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(in crate::tissue) struct RveMaterial {
    /// The region of the point.
    pub region: usize,
    pub network: Option<PointNetwork>,
    matrix: SentMatrix,
}

/// The matrix of an RVE, for a rank that has the materials of the regions.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
enum SentMatrix {
    /// There is none.
    None,
    /// That of the region there: it is the same at all points, or of another crate, which every rank has itself.
    OfRegion,
    Formula(Arc<Formula>),
}

#[cfg(test)]
impl RveMaterial {
    /// The material of an RVE with this matrix.
    pub fn of(region: usize, network: Option<PointNetwork>, matrix: &Formula) -> Self {
        Self { region, network, matrix: SentMatrix::Formula(Arc::new(matrix.clone())) }
    }
}

impl<B: RealBackend> Library<B> {
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
            Some(formula) if matches!(**formula, Formula::Custom(_)) || self.is_uniform(region) => SentMatrix::OfRegion,
            Some(formula) => SentMatrix::Formula(Arc::clone(formula)),
        };
        RveMaterial { region, network, matrix }
    }

    /// Returns the network and the matrix of an RVE that another rank sent; `None` if this rank has not the same materials.
    pub(in crate::tissue) fn received(
        &self,
        point: usize,
        material: RveMaterial,
    ) -> Option<(Option<PointNetwork>, Option<Arc<Formula>>)> {
        let RveMaterial { region, network, matrix } = material;
        let is_known = region < self.regions().len() && network.is_none_or(|of| of.model < self.models.len());
        let matrix = match matrix {
            SentMatrix::None => None,
            SentMatrix::OfRegion => Some(Arc::clone(self.formula_at(region, point).filter(|_| is_known)?)),
            SentMatrix::Formula(formula) => Some(formula),
        };
        is_known.then_some((network, matrix))
    }
}
