//! Materials given by a formula, as a case names them.

use nalgebra::Matrix3;

use crate::fem::material::{LinearElastic, Material, MaterialError, NeoHookean, Response};
use crate::tissue::case::{FormulaCase, FormulaModel};

/// One of the formulas, chosen when the case is read.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Formula {
    /// Neo-Hookean.
    NeoHookean(NeoHookean),
    /// Small strain.
    LinearElastic(LinearElastic),
}

impl Formula {
    /// Energy, stress and tangent at a deformation gradient.
    ///
    /// # Errors
    /// [`MaterialError::Inverted`] for a determinant that is not positive.
    pub fn respond(&self, gradient: &Matrix3<f64>) -> Result<Response, MaterialError> {
        match self {
            Self::NeoHookean(material) => material.respond(gradient),
            Self::LinearElastic(material) => material.respond(gradient),
        }
    }
}

impl From<FormulaCase> for Formula {
    fn from(case: FormulaCase) -> Self {
        let (mu, lambda) = (case.shear_modulus, case.lame_lambda);
        match case.model {
            FormulaModel::NeoHookean => Self::NeoHookean(NeoHookean { mu, lambda }),
            FormulaModel::LinearElastic => Self::LinearElastic(LinearElastic { mu, lambda }),
        }
    }
}
