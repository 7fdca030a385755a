//! Materials given by a formula, selected by name in a case.

use nalgebra::Matrix3;

use crate::app::case::{FormulaCase, FormulaModel};
use crate::fem::material::{LinearElastic, Material, MaterialError, NeoHookean, Response};

/// One of the formulas, chosen when the case is read.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Formula {
    /// Neo-Hookean.
    NeoHookean(NeoHookean),
    /// Small strain.
    LinearElastic(LinearElastic),
}

impl Formula {
    /// Returns energy, stress and tangent at a deformation gradient.
    ///
    /// # Errors
    /// Returns [`MaterialError::Inverted`] from the neo-Hookean formula if the determinant is not positive.
    pub fn respond(&self, gradient: &Matrix3<f64>) -> Result<Response, MaterialError> {
        match self {
            Self::NeoHookean(material) => material.evaluate(gradient),
            Self::LinearElastic(material) => material.evaluate(gradient),
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
