//! Materials given by formulas, and the formula of every point of a region.

use std::fmt;
use std::sync::Arc;

use nalgebra::{Matrix3, Vector3};
use serde::{Deserialize, Serialize};
use thiserror::Error;

use super::point_values::PointValues;
use crate::fem::material::{
    Guccione, HolmesMow, HolzapfelGasserOgden, LinearElastic, Material, MaterialError, NeoHookean, Response,
    TransverseModuli, TransverselyIsotropic,
};

/// A material given by a formula.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub enum Formula {
    /// Neo-Hookean.
    NeoHookean(NeoHookean),
    /// Linear elasticity at small strain.
    LinearElastic(LinearElastic),
    /// Transversely isotropic, of Bonet and Burton.
    TransverselyIsotropic(TransverseFormula),
    /// Of Holmes and Mow.
    HolmesMow(HolmesMow),
    /// Of Holzapfel, Gasser and Ogden.
    HolzapfelGasserOgden(HolzapfelGasserOgden),
    /// Of Guccione.
    Guccione(Guccione),
    /// A material of another crate.
    #[serde(skip)]
    Custom(CustomMaterial),
}

/// A transversely isotropic material with the constants that it was made from.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct TransverseFormula {
    moduli: TransverseModuli,
    axis: [f64; 3],
    material: TransverselyIsotropic,
}

impl TransverseFormula {
    /// Creates the material; `None` as in [`TransverselyIsotropic::new`].
    pub fn new(moduli: TransverseModuli, axis: [f64; 3]) -> Option<Self> {
        TransverselyIsotropic::new(&moduli, axis).map(|material| Self { moduli, axis, material })
    }

    /// Returns the elastic constants at small strain.
    pub fn moduli(&self) -> &TransverseModuli {
        &self.moduli
    }

    /// Returns the axis, of the length that it was given with.
    pub fn axis(&self) -> [f64; 3] {
        self.axis
    }
}

/// Any [`Material`], shared. Two custom materials are equal if they are the same object, or have the same name and
/// bitwise the same parameters, at least one of them.
#[derive(Clone)]
pub struct CustomMaterial(Arc<dyn Material>);

impl CustomMaterial {
    /// Returns the material.
    pub fn material(&self) -> &dyn Material {
        &*self.0
    }
}

impl fmt::Debug for CustomMaterial {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} {:?}", self.0.name(), self.0.parameters())
    }
}

impl PartialEq for CustomMaterial {
    fn eq(&self, other: &Self) -> bool {
        let bits = |material: &Self| -> Vec<(&'static str, u64)> {
            material.0.parameters().into_iter().map(|(name, value)| (name, value.to_bits())).collect()
        };
        let (one, two) = (bits(self), bits(other));
        Arc::ptr_eq(&self.0, &other.0) || self.0.name() == other.0.name() && one == two && !one.is_empty()
    }
}

/// The formula of every point of a region.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub enum Formulas {
    /// The same formula at all points.
    Uniform(Arc<Formula>),
    /// Formulas whose parameters vary over the region.
    Points(Arc<PointFormulas>),
}

/// Formulas by point; points with equal parameters share one.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct PointFormulas {
    distinct: Vec<Arc<Formula>>,
    of_point: PointValues<u32>,
}

/// A point refers to a formula that does not exist.
#[derive(Clone, Copy, Debug, Error, PartialEq, Eq)]
#[error("point {point} has formula {formula} of {formulas}")]
pub struct PointFormulaError {
    /// The point, from 0.
    pub point: usize,
    /// The index of its formula.
    pub formula: u32,
    /// The number of formulas.
    pub formulas: usize,
}

impl PointFormulas {
    /// The index of the formula of points in other regions.
    pub const NONE: u32 = u32::MAX;

    /// Gives each point of the mesh one of the formulas, by its index, or [`PointFormulas::NONE`].
    ///
    /// # Errors
    /// Returns [`PointFormulaError`] if an index is out of range.
    pub fn new(formulas: Vec<Formula>, of_point: Vec<u32>) -> Result<Self, PointFormulaError> {
        let is_wrong = |&(_, &formula): &(usize, &u32)| formula != Self::NONE && formula as usize >= formulas.len();
        if let Some((point, &formula)) = of_point.iter().enumerate().find(is_wrong) {
            return Err(PointFormulaError { point, formula, formulas: formulas.len() });
        }
        Ok(Self { distinct: formulas.into_iter().map(Arc::new).collect(), of_point: PointValues::new(of_point) })
    }

    /// Returns the index of the formula, or [`PointFormulas::NONE`], of each point that has a value here, in the order of the
    /// points.
    pub fn of_point(&self) -> &[u32] {
        self.of_point.values()
    }

    /// Returns the formulas of these points of the mesh, ascending, and no others.
    pub fn on_points(&self, points: &[usize]) -> Self {
        let of_point = self.of_point.on_points(points, |formula| formula != Self::NONE);
        let (mut distinct, mut number_of) = (Vec::new(), vec![Self::NONE; self.distinct.len()]);
        let of_point = of_point.map(|formula| {
            let number = &mut number_of[formula as usize];
            if *number == Self::NONE {
                *number = distinct.len() as u32;
                distinct.push(Arc::clone(&self.distinct[formula as usize]));
            }
            *number
        });
        Self { distinct, of_point }
    }
}

impl Formulas {
    /// Returns the formula of a point; `None` if none was given to it.
    pub fn at(&self, point: usize) -> Option<&Arc<Formula>> {
        match self {
            Self::Uniform(formula) => Some(formula),
            Self::Points(points) => points.distinct.get(points.of_point.get(point)? as usize),
        }
    }

    /// Returns the formulas of these points of the mesh, ascending; those of all points if they are the same.
    pub fn on_points(&self, points: &[usize]) -> Self {
        match self {
            Self::Uniform(formula) => Self::Uniform(Arc::clone(formula)),
            Self::Points(of) => Self::Points(Arc::new(of.on_points(points))),
        }
    }

    /// Returns all formulas, each once.
    pub fn distinct(&self) -> &[Arc<Formula>] {
        match self {
            Self::Uniform(formula) => std::slice::from_ref(formula),
            Self::Points(points) => &points.distinct,
        }
    }
}

impl From<Formula> for Formulas {
    fn from(formula: Formula) -> Self {
        Self::Uniform(Arc::new(formula))
    }
}

impl Formula {
    /// Wraps a material of another crate.
    pub fn custom(material: impl Material + 'static) -> Self {
        Self::Custom(CustomMaterial(Arc::new(material)))
    }

    /// Returns energy, stress and tangent at a deformation gradient.
    ///
    /// # Errors
    /// Returns [`MaterialError::Inverted`] from a formula of finite strain if the determinant is not positive.
    pub fn respond(&self, f: &Matrix3<f64>) -> Result<Response, MaterialError> {
        match self {
            Self::NeoHookean(material) => material.evaluate(f),
            Self::LinearElastic(material) => material.evaluate(f),
            Self::TransverselyIsotropic(formula) => formula.material.evaluate(f),
            Self::HolmesMow(material) => material.evaluate(f),
            Self::HolzapfelGasserOgden(material) => material.evaluate(f),
            Self::Guccione(material) => material.evaluate(f),
            Self::Custom(material) => material.0.evaluate(f),
        }
    }

    /// Returns the fiber axes in the undeformed body, unit vectors; none of isotropic and custom materials.
    pub fn fiber_axes(&self) -> impl Iterator<Item = Vector3<f64>> {
        let axes = match self {
            Self::NeoHookean(_) | Self::LinearElastic(_) | Self::HolmesMow(_) | Self::Custom(_) => [None; 2],
            Self::TransverselyIsotropic(formula) => [Some(formula.material.axis()), None],
            Self::HolzapfelGasserOgden(material) => material.axes,
            Self::Guccione(material) => [Some(material.axis), None],
        };
        axes.into_iter().flatten()
    }

    /// Returns the shear modulus and the bulk modulus at rest, Pa; of an anisotropic formula, those of the isotropic
    /// tensor nearest to its stiffness `A` (W. Voigt, 1889): `K = A_iijj / 9` and `mu = (A_ijij - 3 K) / 10`, with the
    /// minor symmetry that a state without stress has.
    pub fn mean_moduli(&self) -> [f64; 2] {
        let Ok(Response { tangent, .. }) = self.respond(&Matrix3::identity()) else { return [0.0; 2] };
        let (mut traces, mut whole) = (0.0, 0.0);
        for (i, j) in (0..9).map(|k| (k / 3, k % 3)) {
            traces += tangent[(4 * i, 4 * j)];
            whole += 0.5 * (tangent[(3 * i + j, 3 * i + j)] + tangent[(3 * i + j, 3 * j + i)]);
        }
        let bulk = traces / 9.0;
        [(whole - 3.0 * bulk) / 10.0, bulk]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn mean_moduli_are_those_of_isotropic_formulas() {
        let (mu, lambda) = (3.0e3, 5.0e3);
        let isotropic = [
            Formula::NeoHookean(NeoHookean { mu, lambda }),
            Formula::LinearElastic(LinearElastic { mu, lambda }),
            Formula::HolmesMow(HolmesMow { mu, lambda, beta: 0.7 }),
        ];
        for formula in isotropic {
            let [shear, bulk] = formula.mean_moduli();
            assert!((shear / mu - 1.0).abs() < 1e-12, "{formula:?}: {shear}");
            assert!((bulk / (lambda + 2.0 / 3.0 * mu) - 1.0).abs() < 1e-12, "{formula:?}: {bulk}");
        }
        // Equal constants along the axis and across it.
        let moduli = TransverseModuli {
            youngs_modulus: 2.5e3,
            poisson_ratio: 0.25,
            axial_youngs_modulus: 2.5e3,
            axial_shear_modulus: 1.0e3,
        };
        let [shear, bulk] =
            Formula::TransverselyIsotropic(TransverseFormula::new(moduli, [1.0, 2.0, 0.5]).unwrap()).mean_moduli();
        assert!((shear / 1.0e3 - 1.0).abs() < 1e-12 && (bulk / (2.5e3 / 1.5) - 1.0).abs() < 1e-12, "{shear} {bulk}");
    }

    /// A spring in every direction: `P = k (F - I)`.
    struct Springs(f64);

    impl Material for Springs {
        fn evaluate(&self, f: &Matrix3<f64>) -> Result<Response, MaterialError> {
            let moved = f - Matrix3::identity();
            let tangent = nalgebra::SMatrix::identity() * self.0;
            Ok(Response { energy: 0.5 * self.0 * moved.norm_squared(), pk1: moved * self.0, tangent })
        }

        fn parameters(&self) -> Vec<(&'static str, f64)> {
            vec![("stiffness", self.0)]
        }
    }

    #[test]
    fn custom_materials_are_formulas() {
        let f = Matrix3::new(1.1, 0.1, 0.0, 0.0, 0.9, 0.0, 0.2, 0.0, 1.0);
        let springs = Formula::custom(Springs(3.0));
        assert_eq!(springs.respond(&f), Springs(3.0).evaluate(&f));
        assert_eq!(springs, Formula::custom(Springs(3.0)));
        assert_ne!(springs, Formula::custom(Springs(3.5)));
    }

    #[test]
    fn points_have_their_formulas() {
        let formulas = || [1.0, 2.0].map(|k| Formula::custom(Springs(k))).to_vec();
        let points = PointFormulas::new(formulas(), vec![1, PointFormulas::NONE, 0]).unwrap();
        let points = Formulas::Points(Arc::new(points));
        let at = |points: &Formulas, point| points.at(point).map(|formula| (**formula).clone());
        let [soft, stiff] = [1.0, 2.0].map(|k| Some(Formula::custom(Springs(k))));
        assert_eq!([0, 1, 3].map(|point| at(&points, point)), [stiff, None, None]);
        let some = points.on_points(&[1, 2]);
        assert_eq!([0, 1, 2, 3].map(|point| at(&some, point)), [None, None, soft, None]);
        assert_eq!(some.distinct().len(), 1);
        let wrong = PointFormulas::new(formulas(), vec![0, 2]).unwrap_err();
        assert_eq!(wrong, PointFormulaError { point: 1, formula: 2, formulas: 2 });
    }
}
